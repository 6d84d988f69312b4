"""What the README shows can be done: its examples run as printed, with a server of our own for the network."""

from __future__ import annotations

import hashlib
import re
import shlex
import threading
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux.cli.assets  # noqa: F401  (knows the names of the real registry)
from stratalux.assets import ASSETS, Asset, AssetFile
from stratalux.scenes.camera import sensor
from tests.helpers import hall_map, run
from tests.scenes.formats.gltf_files import Gltf

README = Path(__file__).parents[1] / "README.md"
MESH = "v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv 0 1.5 0\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n"
SCENE = """<scene version="3.0.0">
    <default name="spp" value="2"/>
    <sensor type="perspective">
        <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/></film>
        <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    </sensor>
    <shape type="sphere"><transform name="to_world"><translate z="4"/></transform></shape>
    <emitter type="envmap"><string name="filename" value="envmap.exr"/></emitter>
</scene>"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: object) -> None:
        pass


@pytest.fixture
def network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A small stand-in for every asset, served on this machine; an empty folder to work in, and nothing cached."""
    content = tmp_path / "server"
    (content / "x").mkdir(parents=True)
    mi.Bitmap(hall_map(32, 64)).write(str(content / "x/map.exr"))
    mi.Bitmap(hall_map(32, 64)).write(str(content / "x/map.hdr"))
    (content / "x/mesh.obj").write_text(MESH)
    (content / "x/scene.xml").write_text(SCENE)
    file = Gltf()
    corners = [[-1, 0, -1], [1, 0, -1], [0, 0, 1], [0, 1.5, 0]]
    triangles = np.array([0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0], dtype=np.uint16)
    file.add("materials", pbrMetallicRoughness={"baseColorFactor": [0.2, 0.4, 0.8, 1]})
    file.add("scenes", nodes=[file.show(file.primitive(corners, triangles, material=0))])
    (content / "x/model.glb").write_bytes(file.write(tmp_path / "model.glb").read_bytes())
    (content / "x/rest").write_bytes(b"unused")
    kinds = {".exr": "map.exr", ".hdr": "map.hdr", ".obj": "mesh.obj", ".xml": "scene.xml", ".glb": "model.glb"}

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(content / "x"))) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()

        def stand_in(file: AssetFile) -> AssetFile:
            name = kinds.get(Path(file.file).suffix, "rest")
            data = (content / "x" / name).read_bytes()
            url = f"http://127.0.0.1:{http.server_port}/{name}"
            return replace(file, sha256=hashlib.sha256(data).hexdigest(), size=len(data), url=url)

        def served(asset: Asset) -> Asset:
            return replace(asset, files=tuple(map(stand_in, asset.files)))

        for name, asset in list(ASSETS.items()):
            monkeypatch.setitem(ASSETS, name, served(asset))
        monkeypatch.setenv("no_proxy", "127.0.0.1")
        monkeypatch.setenv("STRATALUX_CACHE", str(tmp_path / "cache"))
        monkeypatch.delenv("STRATALUX_ASSETS", raising=False)
        monkeypatch.setattr("stratalux.assets._beside_checkout", lambda: None)
        (tmp_path / "work").mkdir()
        monkeypatch.chdir(tmp_path / "work")
        yield
        http.shutdown()


def blocks(heading: str) -> list[tuple[str, str]]:
    """Language and text of the code under a heading of the README."""
    section = README.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"```(\w+)\n(.*?)```", section, re.DOTALL)


def commands(text: str) -> list[list[str]]:
    lines = [shlex.split(line, comments=True) for line in text.replace("\\\n", " ").splitlines()]
    return [line[1:] for line in lines if line and line[0] == "stratalux"]


def test_the_three_ways_to_use_it(network: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.scenes.load.USUAL_SIZE", (60, 40))
    monkeypatch.setattr("stratalux.scenes.load.sensor", partial(sensor, spp=4))
    said: dict[str, Any] = {}
    for language, text in blocks("Three ways to use it"):
        if language == "python":
            exec(compile(text, "README.md", "exec"), said)
            continue
        for command in commands(text):
            assert run(monkeypatch, *command) == 0, command
    for written in (
        "truck.png",
        "buddha.exr",
        "buddha.jpg",
        "buddha.png",
        "preview.exr",
        "regions.png",
        "regions.json",
    ):
        assert Path(written).stat().st_size > 0
    assert np.isfinite(np.array(said["image"])).all() and said["lights"].flux.shape == (64, 3)


def shown(command: str) -> list[list[str]]:
    """The commands of that name under "Techniques"."""
    return [words for _, text in blocks("Techniques") for words in commands(text) if words[0] == command]


def test_the_rig(network: None, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"SPHERES": (24, 8), "OBJECT": (12, 8), "_SPP": 4, "_SPP_OF_ALL": 4, "_DETAIL": 1}.items():
        monkeypatch.setattr(f"stratalux.comparison.rig_scenes.{name}", value)
    assert run(monkeypatch, "assets", "fetch", "venice", "--assets", "data") == 0
    for words in shown("rig"):
        assert run(monkeypatch, *words) == 0
    assert all(Path(name).stat().st_size > 0 for name in ("rig.json", "rig.png", "rig.glb", "rig.py"))


@pytest.mark.slow
def test_the_comparison(network: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """But for its size: at that of the example, the reference takes a minute."""
    quick = ("--reference-spp", "16", "--repeats", "1", "--size", "24x16")
    (words,) = shown("compare")
    assert run(monkeypatch, *words, *quick) == 0


def test_every_command_of_the_documentation_is_one() -> None:
    """Options included: a newcomer types what is shown."""
    from stratalux.cli import cli

    pages = [README, *(README.parent / "docs").glob("*.md"), README.parent / "CONTRIBUTING.md"]
    shown = [
        line
        for page in pages
        for block in re.findall(r"```sh\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
        for line in commands(block)
    ]
    assert len(shown) > 10
    for command in shown:
        with cli.make_context("stratalux", command, resilient_parsing=False) as context:
            name, subcommand, rest = cli.resolve_command(context, [*context._protected_args, *context.args])
            assert subcommand is not None
            if not hasattr(subcommand, "commands"):
                subcommand.make_context(name, rest, parent=context)
