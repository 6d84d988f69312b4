"""Blender: a Python script that makes sun lights, or, where ``bpy`` is there, a .blend of it.

Blender's z is up: (x, y, z) is (x, −z, y) there. The strength of a sun is the irradiance of what faces it, in W/m²
(Blender manual, "Light Objects"; measured with Cycles 4.4), its colour is linear, and it shines along −z. The ambient
light becomes the world: a colour, or an image of it.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..harmonics import ambient_map
from ..lights import Lights, plain, split

_SECONDS = 300
"""What takes longer counts as hung."""
_SCRIPT = '''"""{count} sun lights by stratalux rig ({method}): run it in Blender (blender --python)."""

import array

import bpy
from mathutils import Vector

# Direction to the light (z up), linear colour, strength in W/m2, radians across.
LIGHTS = {lights}
AMBIENT = {ambient}  # linear radiance, or None
AMBIENT_MAP = {texels}  # (height, width, radiances), upper row first, or None

rig = bpy.data.collections.new("rig")
bpy.context.scene.collection.children.link(rig)
for name, direction, colour, strength, angle in LIGHTS:
    light = bpy.data.lights.new(name, "SUN")
    light.energy, light.color, light.angle = strength, colour, angle
    thing = bpy.data.objects.new(name, light)
    thing.rotation_mode = "QUATERNION"
    thing.rotation_quaternion = Vector(direction).to_track_quat("Z", "Y")
    thing.location = Vector(direction) * 10
    rig.objects.link(thing)

if AMBIENT is not None:
    world = bpy.context.scene.world or bpy.data.worlds.new("rig")
    bpy.context.scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs[0])
    background.inputs["Strength"].default_value = 1.0
    background.inputs["Color"].default_value = (*AMBIENT, 1.0)
    if AMBIENT_MAP is not None:
        height, width, rows = AMBIENT_MAP
        image = bpy.data.images.new("ambient", width, height, alpha=False, float_buffer=True)
        image.colorspace_settings.name = "Linear Rec.709"
        image.pixels = array.array("f", [v for row in reversed(rows) for rgb in row for v in (*rgb, 1.0)])
        image.pack()
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = image
        tree.links.new(node.outputs[0], background.inputs["Color"])
'''


def script(lights: Lights) -> str:
    """The program that makes them."""
    rows = []
    for name, (x, y, z), colour, angle in lights.named():
        tint, strength = split(colour)
        rows.append((name, (float(x), float(0.0 - z), float(y)), tuple(tint), strength, angle))
    listed = "[\n" + "".join(f"    {row!r},\n" for row in rows) + "]"
    ambient = texels = None
    if lights.ambient is not None:
        ambient = tuple(plain(lights.ambient_radiance))
        if lights.varies:
            texels = _world(lights)
    return _SCRIPT.format(count=len(rows), method=lights.method, lights=listed, ambient=ambient, texels=texels)


def encode(lights: Lights, path: Path) -> bytes:
    return script(lights).encode()


def encode_blend(lights: Lights, path: Path) -> bytes:
    """Raises :class:`InputError` without the package bpy."""
    if importlib.util.find_spec("bpy") is None:
        raise InputError(f"{path}: a .blend needs another package: pip install bpy; or write a .py for Blender")
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        file = Path(folder) / "rig.blend"
        program = "import bpy; bpy.ops.wm.read_factory_settings(use_empty=True)\n"
        program += script(lights) + f"\nbpy.ops.wm.save_as_mainfile(filepath={str(file)!r})\n"
        try:
            # In a process of its own: Blender is a program, and ends as one.
            process = subprocess.run(
                [sys.executable, "-"], input=program, capture_output=True, text=True, check=False, timeout=_SECONDS
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"{path}: Blender was given up after {_SECONDS} s; write a .py for it") from None
        if process.returncode or not file.is_file():
            last = " ".join((process.stderr.strip().splitlines() or ["no word"])[-1].split())[:120]
            raise InputError(f"{path}: Blender could not write it ({last}); write a .py for it")
        return file.read_bytes()


def _world(lights: Lights) -> tuple[int, int, Any]:
    """The map of the ambient light, with its middle where Blender has it, at +x; the lights are turned already."""
    assert lights.ambient is not None
    texels = ambient_map(lights.turn(-90).ambient)  # type: ignore[arg-type]
    rounded = [[tuple(float(f"{v:.5g}") for v in rgb) for rgb in row] for row in np.asarray(texels, np.float64)]
    return texels.shape[0], texels.shape[1], rounded
