"""Assets: where they are looked for, what is said where they are missing, and downloads, from a server of our own."""

from __future__ import annotations

import hashlib
import json
import re
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar
from urllib.parse import urlsplit

import pytest
from click.shell_completion import ShellComplete

import stratalux.cli.assets  # noqa: F401  (knows the names of the real registry)
from stratalux import assets
from stratalux.assets import ASSETS, Asset, AssetFile, Assets
from stratalux.cli import cli
from stratalux.errors import InputError
from stratalux.images.files import umask
from tests.helpers import run

CONTENT = b"v 0 0 0\n" * 50_000
"""Several of the chunks that a download comes in."""


class Server(BaseHTTPRequestHandler):
    """Serves :data:`CONTENT`, whole, cut short, or something else, by the path."""

    asked: ClassVar[list[str]] = []

    def do_GET(self) -> None:
        path = urlsplit(self.path).path
        self.asked.append(path)
        if path == "/nothing":
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT)))
        self.end_headers()
        content = {"/short": CONTENT[: len(CONTENT) // 2], "/other": CONTENT[::-1]}.get(path, CONTENT)
        self.wfile.write(content)

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Server) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()


@pytest.fixture(autouse=True)
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """All four folders, empty; nothing of this machine is found."""
    made = {name: tmp_path / name for name in ("given", "named", "beside", "home/assets")}
    for folder in made.values():
        folder.mkdir(parents=True)
    monkeypatch.setenv("STRATALUX_ASSETS", str(made["named"]))
    monkeypatch.setenv("STRATALUX_CACHE", str(tmp_path / "home"))
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setattr(assets, "_beside_checkout", lambda: made["beside"])
    Server.asked.clear()
    return made


def mesh(url: str = "http://127.0.0.1:1/blob", **more: object) -> Asset:
    file = AssetFile("meshes/blob.obj", hashlib.sha256(CONTENT).hexdigest(), len(CONTENT), url)
    blob = Asset("blob", "a blob", "nobody", "none", "https://example.org/blob", (file,))
    return replace(blob, **more)  # type: ignore[arg-type]


def lookup(asset: Asset, folder: Path | None = None) -> Assets:
    return Assets(folder, registry={asset.name: asset})


def put(folder: Path, file: str, content: bytes = CONTENT) -> Path:
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_folders_are_looked_through_in_order(places: dict[str, Path]) -> None:
    found = lookup(mesh(), places["given"])
    assert found.folders == tuple(places.values())
    assert found.find("blob") is None and found.locate("blob") is None
    for folder in reversed(places.values()):
        path = put(folder, "meshes/blob.obj")
        assert found.find("blob") == found.find("meshes/blob.obj") == found.require("blob") == path
    assert lookup(mesh()).find("blob") == places["named"] / "meshes/blob.obj"


def test_the_checkout_is_the_one_that_the_package_is_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.undo()
    root = Path(__file__).parents[1]
    assert assets._beside_checkout() == root.parent / "shared" / "assets"
    monkeypatch.setattr(assets, "__file__", str(tmp_path / "site" / "stratalux" / "assets.py"))
    assert assets._beside_checkout() is None  # an installed package has no checkout


def test_says_whether_it_is_what_was_measured_with(places: dict[str, Path]) -> None:
    found = lookup(mesh(alternatives=("meshes/blob.ply",)))
    path = put(places["named"], "meshes/blob.ply")
    assert found.locate("blob") == assets.Found(path, as_measured=False)
    assert found.find("meshes/blob.obj") is None  # asked for that very file
    path = put(places["named"], "meshes/blob.obj", b"another")
    assert found.locate("blob") == assets.Found(path, as_measured=False)
    put(places["named"], "meshes/blob.obj")
    assert found.locate("blob") == assets.Found(path, as_measured=True)
    within = lookup(mesh(), places["named"].parent)  # one folder within another
    assert within.locate("blob") == assets.Found(path, as_measured=True)


def test_a_scene_is_found_with_all_its_files_and_in_one_folder(places: dict[str, Path]) -> None:
    digest = hashlib.sha256(CONTENT).hexdigest()
    scene = mesh(
        files=tuple(AssetFile(f"s/{name}", digest, len(CONTENT), "https://example.org") for name in ("a.xml", "b.exr"))
    )
    put(places["named"], "s/a.xml")
    put(places["beside"], "s/b.exr")
    assert lookup(scene).find("blob") is None
    path = put(places["beside"], "s/a.xml")
    assert lookup(scene).locate("blob") == assets.Found(path, as_measured=True)
    put(places["beside"], "s/b.exr", b"another")
    assert lookup(scene).locate("blob") == assets.Found(path, as_measured=False)


def test_what_is_missing_is_said_in_one_line(places: dict[str, Path]) -> None:
    with pytest.raises(InputError) as error:
        lookup(mesh("http://example.org/blob")).require("blob")
    message = str(error.value)
    assert "blob is missing: there is no meshes/blob.obj in" in message and "\n" not in message
    assert all(str(folder) in message for name, folder in places.items() if name != "given")
    assert message.endswith("type: stratalux assets fetch blob")
    with pytest.raises(InputError, match="no asset is called 'bunny'; known: grace, venice"):
        Assets().find("bunny")
    with pytest.raises(InputError, match="nowhere: no such folder"):
        Assets("nowhere")


def test_a_file_that_cannot_be_read(places: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = put(places["named"], "meshes/blob.obj")

    def refuse(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(InputError, match=f"{path}: cannot be read"):
        lookup(mesh()).locate("blob")


def test_fetches_once_and_reports_progress(places: dict[str, Path], server: str) -> None:
    told: list[tuple[str, int, int]] = []
    found = lookup(mesh(f"{server}/blob"))
    path = found.fetch("blob", lambda *report: told.append(report))
    assert path == places["home/assets"] / "meshes/blob.obj" and path.read_bytes() == CONTENT
    assert len(told) > 3 and told[-1] == ("blob.obj", len(CONTENT), len(CONTENT))
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask()
    assert found.fetch("blob") == path == found.find("blob")
    assert Server.asked == ["/blob"] and files(places["home/assets"]) == [path]


def test_fetches_into_the_given_folder_and_replaces_nothing_there(places: dict[str, Path], server: str) -> None:
    found = lookup(mesh(f"{server}/blob"), places["given"])
    path = found.fetch("blob")
    assert path == places["given"] / "meshes/blob.obj"
    path.write_bytes(b"mine")
    assert found.fetch("blob") == path and path.read_bytes() == b"mine"
    path.unlink()
    mine = put(places["named"], "meshes/blob.obj", b"mine")
    assert found.fetch("blob") == mine  # found before, so it is there
    assert Server.asked == ["/blob"]


def test_nor_is_a_part_of_a_scene_replaced_there(places: dict[str, Path], server: str) -> None:
    digest = hashlib.sha256(CONTENT).hexdigest()
    parts = tuple(AssetFile(f"s/{name}", digest, len(CONTENT), f"{server}/{name}") for name in ("a.xml", "b.exr"))
    mine = put(places["given"], "s/b.exr", b"mine")
    with pytest.raises(InputError, match=f"{mine}: is another file than the one to fetch"):
        lookup(mesh(files=parts), places["given"]).fetch("blob")
    assert mine.read_bytes() == b"mine"
    assert lookup(mesh(files=parts)).fetch("blob") == places["home/assets"] / "s/a.xml"


def test_a_damaged_file_of_the_cache_is_replaced(places: dict[str, Path], server: str) -> None:
    path = put(places["home/assets"], "meshes/blob.obj", CONTENT[:10])
    assert lookup(mesh(f"{server}/blob")).fetch("blob") == path
    assert path.read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("other", "serves another file than the one pinned"),
        ("short", "cannot be downloaded|serves another file"),
        ("nothing", "cannot be downloaded .the server answers 404."),
    ],
)
def test_nothing_is_left_of_a_bad_download(places: dict[str, Path], server: str, what: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        lookup(mesh(f"{server}/{what}")).fetch("blob")
    assert "\n" not in str(error.value) and str(places["home/assets"] / "meshes/blob.obj") in str(error.value)
    assert not files(places["home/assets"])


def test_nothing_is_left_of_an_interrupted_download(places: dict[str, Path], server: str) -> None:
    def interrupt(name: str, done: int, total: int) -> None:
        if done > total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lookup(mesh(f"{server}/blob")).fetch("blob", interrupt)
    assert not files(places["home/assets"])


def test_no_network_and_no_place_to_write(
    places: dict[str, Path], server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"cannot be downloaded \(no connection\)"):
        lookup(mesh("http://127.0.0.1:1/blob")).fetch("blob")
    put(places["given"], "meshes", b"a file where a folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        lookup(mesh(f"{server}/blob"), places["given"]).fetch("blob")


def test_without_pooch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(InputError, match=r"pip install 'stratalux\[assets\]'"):
        lookup(mesh("http://example.org/blob")).fetch("blob")


def test_the_registry_is_whole() -> None:
    listed = [file for asset in ASSETS.values() for file in asset.files]
    assert len({file.file for file in listed}) == len({file.sha256 for file in listed}) == len(listed)
    for asset in ASSETS.values():
        for file in asset.files:
            assert len(bytes.fromhex(file.sha256)) == 32 and file.size > 0
            assert re.fullmatch(r"https://\S+/[0-9a-f]{40}/\S+", file.url)  # pinned to a commit


@pytest.fixture
def registry(server: str) -> Iterator[None]:
    """A registry of a blob that is served, and a lump of which another file is, in place of the real one."""
    entries = {
        "blob": mesh(f"{server}/blob"),
        "lump": mesh(name="lump", files=(AssetFile("lump.obj", "0" * 64, 1, f"{server}/other"),)),
    }
    before = dict(ASSETS)
    ASSETS.clear()
    ASSETS.update(entries)
    yield
    ASSETS.clear()
    ASSETS.update(before)


def test_lists(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], places: dict[str, Path], registry: None
) -> None:
    put(places["given"], "lump.obj")
    assert run(monkeypatch, "assets", "--assets", str(places["given"])) == 0
    head, blob, lump, note = capsys.readouterr().out.splitlines()
    assert head.split() == ["name", "status", "size", "owner", "terms", "what", "where"]
    assert "missing" in blob and "0.4 MB" in blob and "nobody" in blob
    assert "differs" in lump and str(places["given"] / "lump.obj") in lump
    assert note == "stratalux assets fetch: downloads blob"
    assert run(monkeypatch, "assets") == 0
    assert capsys.readouterr().out.splitlines()[-1] == "stratalux assets fetch: downloads blob, lump"
    assert run(monkeypatch, "assets", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["folders"] == [str(places[name]) for name in ("named", "beside", "home/assets")]
    blob, lump = content["assets"]
    assert (blob["status"], blob["path"], lump["status"]) == ("missing", None, "missing")
    assert blob["files"][0]["sha256"] == hashlib.sha256(CONTENT).hexdigest()


def test_fetches_all_and_says_the_terms(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], places: dict[str, Path], registry: None
) -> None:
    path = places["home/assets"] / "meshes/blob.obj"
    assert run(monkeypatch, "assets", "fetch") == 2  # of the lump, another file is served
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and "serves another file" in captured.err
    lines = captured.out.splitlines()
    assert lines[0] == "blob: a blob; by nobody, https://example.org/blob; terms: none"
    assert lines[1].strip() == str(path) and path.read_bytes() == CONTENT
    assert run(monkeypatch, "assets") == 0
    assert "as measured" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fetch", "grace"), "cannot be downloaded"),
        (("fetch", "buddha", "--assets", "no/such"), "no/such: cannot be made"),
        (("fetch", "bunny"), "'bunny' is not one of"),
        (("--assets", "nowhere"), "nowhere: no such folder"),
        (("--json", "fetch"), "does not go with fetch"),
    ],
)
def test_trouble_is_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    unreachable = AssetFile(ASSETS["grace"].file, "0" * 64, 1, "http://127.0.0.1:1/grace")
    monkeypatch.setitem(ASSETS, "grace", replace(ASSETS["grace"], files=(unreachable,)))
    assert run(monkeypatch, "assets", *arguments) == 2
    err = capsys.readouterr().err
    assert message in err and err.startswith("stratalux: error: ") and err.count("\n") == 1


def test_names_are_completed() -> None:
    shell = ShellComplete(cli, {}, "stratalux", "_STRATALUX_COMPLETE")
    assert [item.value for item in shell.get_completions(["assets", "fetch"], "b")] == ["buddha"]
