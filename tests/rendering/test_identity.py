"""What a scene is, whatever its objects are called."""

from __future__ import annotations

import hashlib

import mitsuba as mi

from tests.variants import RGB

mi.set_variant(RGB)

NAMELESS = """<scene version="3.0.0">
<sensor type="perspective"><film type="hdrfilm"/></sensor>
<emitter type="constant"/>
<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
<shape type="sphere"><float name="radius" value="{radius}"/></shape>
</scene>"""


def digest(scene: mi.Scene) -> str:
    from stratalux.rendering.identity import add_parameters

    found = hashlib.sha256()
    add_parameters(found, scene)
    return found.hexdigest()


def test_objects_without_names_are_the_same_in_every_process() -> None:
    """Mitsuba calls them by their addresses, which differ for scenes that live at the same time."""
    one, same, other = (mi.load_string(NAMELESS.format(radius=radius)) for radius in (0.5, 0.5, 0.6))
    assert set(mi.traverse(one).keys()) != set(mi.traverse(same).keys())
    assert digest(one) == digest(same) != digest(other)
