"""Buffers and the views of them."""

from __future__ import annotations

from pathlib import Path

from stratalux.scenes.formats.gltf.container import Document
from tests.scenes.formats.gltf_files import Gltf


def test_views_are_no_copies(tmp_path: Path) -> None:
    """Thousands of meshes may share a view of gigabytes."""
    gltf = Gltf()
    first, second = gltf.view(b"some"), gltf.view(b"other")
    document = Document(gltf.write(tmp_path / "scene.glb"))
    views = [document.view(index)[0] for index in (first, second, second)]
    assert [bytes(view) for view in views] == [b"some", b"other", b"other"]
    assert views[0].obj is views[1].obj is views[2].obj
