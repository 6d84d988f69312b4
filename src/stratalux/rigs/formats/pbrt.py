"""pbrt-v4: ``distant`` lights, to be included with ``Include "rig.pbrt"`` in the world block.

L of a distant light is what a surface that faces it receives: ``DistantLight::SampleLi`` gives L with a pdf of 1
(pbrt-v4, ``src/pbrt/lights.h``). Both it and ``infinite`` divide by the photometric value of their illuminant, so that
RGB is an image's RGB. Coordinates are those of the scene: y up here.
"""

from __future__ import annotations

from pathlib import Path

from ..lights import Lights, plain


def encode(lights: Lights, path: Path) -> bytes:
    lines = [f"# {len(lights)} lights by stratalux rig ({lights.method}): y up, irradiance as L"]
    for name, direction, colour, _ in lights.named():
        lines += [
            f"# {name}",
            f'LightSource "distant" "rgb L" [ {_numbers(plain(colour))} ]',
            f'    "point3 from" [ {_numbers(plain(direction))} ] "point3 to" [ 0 0 0 ]',
        ]
    if lights.ambient is not None:
        lines.append(f'LightSource "infinite" "rgb L" [ {_numbers(plain(lights.ambient_radiance))} ]')
    return ("\n".join(lines) + "\n").encode()


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
