"""Godot 4: a scene of ``DirectionalLight3D``, which shine along −z.

Godot multiplies the energy of a directional light by π, and its matte surfaces divide by π: the energy is irradiance
over π. Colours are decoded from sRGB (``servers/rendering``, ``light_data.energy *= Math_PI`` and ``srgb_to_linear``).
Ambient light is a radiance. With physical light units switched on in the project, energies mean something else.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np

from ...errors import RigWarning
from ..colours import encoded
from ..lights import Lights, frame_towards, split

_MOST = 8
"""Directional lights that are shown (``MAX_DIRECTIONAL_LIGHTS``)."""


def encode(lights: Lights, path: Path) -> bytes:
    shining = lights.named()
    if len(shining) > _MOST:
        warnings.warn(
            f"{path}: Godot shows {_MOST} directional lights, and the rig has {len(shining)}; make fewer with -n",
            RigWarning,
            stacklevel=2,
        )
    ambient = lights.ambient is not None
    lines = [f"[gd_scene{' load_steps=2' if ambient else ''} format=3]", ""]
    if ambient:
        tint, radiance = split(lights.ambient_radiance)
        lines += [
            '[sub_resource type="Environment" id="ambient"]',
            "background_mode = 1",
            "ambient_light_source = 2",
            f"ambient_light_color = {_colour(tint)}",
            f"ambient_light_energy = {radiance:.9g}",
            "",
        ]
    lines += ['[node name="rig" type="Node3D"]', ""]
    for name, direction, colour, angle in shining:
        tint, irradiance = split(colour)
        numbers = [*frame_towards(direction).ravel().tolist(), 0.0, 0.0, 0.0]
        lines += [
            f'[node name="{name}" type="DirectionalLight3D" parent="."]',
            f"transform = Transform3D({', '.join(f'{number:.9g}' for number in numbers)})",
            f"light_color = {_colour(tint)}",
            f"light_energy = {irradiance / math.pi:.9g}",
            f"light_angular_distance = {np.degrees(angle):.9g}",
            "shadow_enabled = true",
            "",
        ]
    if ambient:
        lines += [
            '[node name="ambient" type="WorldEnvironment" parent="."]', 'environment = SubResource("ambient")', ""
        ]  # fmt: skip
    return "\n".join(lines).encode()


def _colour(tint: list[float]) -> str:
    return f"Color({', '.join(f'{c:.9g}' for c in encoded(tint))}, 1)"
