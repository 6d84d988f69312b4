"""What all formats share: damaged files are one line, and what reading a file imports."""

from __future__ import annotations

import random
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.shapes import load_mesh
from tests.helpers import PATIENCE
from tests.scenes.formats.gltf_files import Gltf

L_PRISM = """v 2 0 0\nv 2 0 -1\nv 1 0 -1\nv 1 0 -2\nv 0 0 -2\nv 0 0 0
v 2 1 0\nv 2 1 -1\nv 1 1 -1\nv 1 1 -2\nv 0 1 -2\nv 0 1 0\nvn 0 1 0
f 7//1 8//1 9//1 10//1 11//1 12//1\nf 6 5 4 3 2 1\nf -12 -11 -5 -6\n"""


def scene(folder: Path) -> bytes:
    """A glTF file with something of everything."""
    gltf = Gltf()
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    targets = [{"POSITION": gltf.accessor(points)}]
    primitive = gltf.primitive(points, [0, 1, 2, 3], mode=5, targets=targets)
    primitive["attributes"] |= {
        "JOINTS_0": gltf.accessor(np.zeros((4, 4)), "u1"),
        "WEIGHTS_0": gltf.accessor(np.tile([255, 0, 0, 0], (4, 1)), "u1", normalized=True),
    }
    skin = gltf.add("skins", joints=[1], inverseBindMatrices=gltf.accessor(np.eye(4)[None]))
    gltf.show(primitive, mesh={"weights": [0.5]}, skin=skin)
    table = {"TRANSLATION": gltf.accessor([[0, 0, 0], [2, 0, 0]])}
    gltf.show(
        gltf.primitive(points, mode=6),
        children=[0],
        extensions={"EXT_mesh_gpu_instancing": {"attributes": table}},
        rotation=[0, 0, 0, 1],
    )
    gltf.json["scenes"] = [{"nodes": [1]}]
    return gltf.write(folder / "scene.glb").read_bytes()


SEEDS: dict[str, Callable[[Path], bytes | str]] = {
    "scene.glb": scene,
    "mesh.ply": lambda _: trimesh.creation.box().export(file_type="ply"),
    "text.ply": lambda _: trimesh.creation.box().export(file_type="ply", encoding="ascii"),
    "mesh.stl": lambda _: trimesh.creation.box().export(file_type="stl"),
    "text.stl": lambda _: trimesh.creation.box().export(file_type="stl_ascii"),
    "mesh.off": lambda _: trimesh.creation.box().export(file_type="off"),
    "mesh.obj": lambda _: L_PRISM,
}


def damaged(data: bytes, rng: random.Random) -> bytes:
    """The data cut short, or with bits flipped, bytes replaced by ones that mean something, left out, or put in."""
    changed = bytearray(data)
    if rng.random() < 0.2:
        return bytes(changed[: rng.randrange(len(changed))])
    for _ in range(rng.choice([1, 1, 2, 5])):
        at = rng.randrange(len(changed))
        match rng.randrange(4):
            case 0:
                changed[at] ^= 1 << rng.randrange(8)
            case 1:
                changed[at] = rng.choice(b'0123456789-.,{}[]"e \n\0\xff/')
            case 2:
                del changed[at : at + rng.randrange(1, 8)]
            case 3:
                changed[at:at] = rng.choices(b"0123456789-", k=rng.randrange(1, 6))
    return bytes(changed)


@pytest.mark.parametrize("name", SEEDS)
def test_damaged_files_give_a_mesh_or_one_line(tmp_path: Path, name: str) -> None:
    data = SEEDS[name](tmp_path)
    data = data.encode() if isinstance(data, str) else data
    path = tmp_path / name
    rng = random.Random(name)
    refused = 0
    for _ in range(80):
        path.write_bytes(damaged(data, rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SceneWarning)
                mesh = load_mesh(path)
        except InputError as error:
            refused += 1
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error) and len(str(error)) < 400
        else:
            assert len(mesh.faces) and np.isfinite(mesh.vertices).all() and np.isfinite(mesh.normals).all()
    assert refused > 10


def test_reading_a_file_imports_neither_trimesh_nor_scipy(tmp_path: Path) -> None:
    (tmp_path / "mesh.obj").write_text(L_PRISM)
    scene(tmp_path)
    code = (
        "import sys\n"
        "from stratalux.scenes.load import load_scene\n"
        "from stratalux.scenes.shapes import load_mesh\n"
        "from_start = {'mapbox_earcut', 'DracoPy'} & set(sys.modules)\n"
        "load_mesh('scene.glb')\n"
        "load_mesh('mesh.obj')\n"
        "sys.exit(bool(from_start or {'trimesh', 'scipy'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False, timeout=PATIENCE).returncode == 0
