"""Unreal: a Python script that makes directional lights, in lux, for the editor (plugin "Python Editor Script").

Unreal is left-handed with z up. A map of latitude and longitude has its middle at −Y and what is right of it at +X:
``LookupLongLat`` and ``TransformSideToWorldSpace`` in ``TextureCompressorModule.cpp``. So (x, y, z) is (−x, −z, y)
there. Lights shine along +X of their actors, and their colours have 8 bits of sRGB.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..colours import decoded, eight_bits
from ..lights import Lights

_HEAD = '''"""{count} directional lights by stratalux rig ({method}): run it in the editor of Unreal."""

import unreal

# Pitch and yaw in degrees, linear colour, lux, degrees across.
LIGHTS = {lights}

actors = unreal.get_editor_subsystem(unreal.EditorActorSubsystem)
for name, pitch, yaw, colour, lux, angle in LIGHTS:
    rotation = unreal.Rotator(roll=0.0, pitch=pitch, yaw=yaw)
    actor = actors.spawn_actor_from_class(unreal.DirectionalLight, unreal.Vector(0.0, 0.0, 0.0), rotation)
    actor.set_actor_label(name)
    actor.set_folder_path("rig")
    light = actor.get_component_by_class(unreal.DirectionalLightComponent)
    light.set_mobility(unreal.ComponentMobility.MOVABLE)
    light.set_intensity(lux)
    light.set_light_color(unreal.LinearColor(*colour, 1.0), True)
    light.set_editor_property("light_source_angle", angle)
    light.set_editor_property("atmosphere_sun_light", False)
'''


def encode(lights: Lights, path: Path) -> bytes:
    rows = []
    for name, direction, colour, angle in lights.named():
        x, y, z = -direction[0], -direction[2], direction[1]
        codes, lux = eight_bits(colour)
        tint = decoded(np.array(codes)).tolist()
        pitch, yaw = math.degrees(math.asin(max(-1.0, min(1.0, -z)))), math.degrees(math.atan2(-y, -x))
        rows.append((name, pitch, yaw, tuple(tint), lux, math.degrees(angle)))
    listed = "[\n" + "".join(f"    {row!r},\n" for row in rows) + "]"
    return _HEAD.format(count=len(rows), method=lights.method, lights=listed).encode()
