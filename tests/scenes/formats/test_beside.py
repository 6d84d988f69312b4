"""Files that a file names, and those that it does not get."""

from __future__ import annotations

from pathlib import Path

import pytest

from stratalux.scenes.formats.beside import file_beside


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inner = tmp_path / "in"
    for name in ("a.png", "My Wood.PNG", "sub/b.png", "sub/a.png", "../out.png", "c:d.png"):
        (inner / name).parent.mkdir(parents=True, exist_ok=True)
        (inner / name).write_bytes(b"")
    return inner


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("a.png", "a.png"),
        (" ./sub/../a.png ", "a.png"),
        ("sub\\b.png", "sub/b.png"),
        ("'My Wood.PNG'", "My Wood.PNG"),
        ("my wood.png", "My Wood.PNG"),
        ("SUB/B.png", None),  # of a folder, letters have to agree
        ("C:\\textures\\a.png", "a.png"),
        ("/somewhere/else/a.png", "a.png"),
        ("../in/sub/b.png", "sub/b.png"),
        ("c:d.png", "c:d.png"),
        ("b.png", None),
        ("../out.png", None),
        ("/etc/hostname", None),
        ("https://example.org/x.png", None),
        ("sub", None),
        ("..", None),
        ("", None),
        ("a" * 5000, None),
        ("a\0.png", None),
    ],
)
def test_names(folder: Path, name: str, found: str | None) -> None:
    place = file_beside(folder, name)
    assert (place and place.resolve()) == (folder / found if found else None)


def test_names_are_relative_to_their_own_file_first(folder: Path) -> None:
    assert file_beside(folder, "a.png", folder / "sub") == folder / "sub" / "a.png"
    assert file_beside(folder, "../a.png", folder / "sub") == folder / "sub" / ".." / "a.png"
    assert file_beside(folder, "sub/b.png", folder / "sub") == folder / "sub" / "b.png"


def test_links_that_lead_out_of_the_folder_are_missing_files(folder: Path) -> None:
    for name, target in (("in.png", "a.png"), ("out.png", "../out.png"), ("Out2.png", "../out.png"), ("up", "..")):
        (folder / name).symlink_to(folder / target)
    assert file_beside(folder, "in.png") == folder / "in.png"
    for name in ("out.png", "out2.png", "up/out.png", "/elsewhere/out.png"):
        assert file_beside(folder, name) is None
    (folder.parent / "link").symlink_to(folder)
    assert file_beside(folder.parent / "link", "a.png") == folder.parent / "link" / "a.png"
