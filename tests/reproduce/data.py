"""The paper's assets in miniature, made here."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import trimesh

from tests.helpers import hall_map


def make_assets(folder: Path) -> Path:
    """A folder that :class:`stratalux.assets.Assets` takes for the paper's data."""
    for name in ("envmaps", "meshes"):
        (folder / name).mkdir(parents=True)
    mi.Bitmap(hall_map(32, 64)).write(str(folder / "envmaps" / "grace_latlong.exr"))
    for name in ("happy_buddha", "teapot"):
        body = trimesh.creation.icosphere(subdivisions=2)
        brim = trimesh.creation.box((3.0, 0.2, 3.0))
        trimesh.util.concatenate([body, brim]).export(folder / "meshes" / f"{name}.obj")
    return folder
