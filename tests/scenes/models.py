"""Small models for tests: a square that is seen from the front, with pictures of known texels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from stratalux.scenes.assembly import assembled
from stratalux.scenes.model import Material, Model, Part, Picture, Texture
from stratalux.scenes.shapes import object_of

CORNERS = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
UV = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
"""Of the corners: the upper left one, where the image begins, has (0, 0)."""
_alive: list[mi.Scene] = []
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def picture(folder: Path, texels: Any, name: str = "texture.png") -> Picture:
    """An image file of `texels` (H, W, C), of the type that they have."""
    texels = np.asarray(texels)
    height, width, channels = texels.shape
    kind = {np.dtype(np.uint8): "uint8", np.dtype(np.uint16): "uint16"}.get(texels.dtype, "float")
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, kind))
    image.specmod().attribute("oiio:UnassociatedAlpha", 1)
    image.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, channels), texels)
    assert image.write(str(folder / name)), image.geterror()
    return Picture(name, folder / name)


def texture(folder: Path, texels: Any, **how: Any) -> Texture:
    """The same as a texture of single texels."""
    return Texture(picture(folder, texels, f"{len(list(folder.iterdir()))}.png"), **{"nearest": True, **how})


def square(material: Material | None = None, **more: Any) -> Part:
    """A square of side 2 in front of +z; `more` as the fields of a part are called."""
    return Part(CORNERS, SQUARE, **{"uvs": {0: UV}, "material": material, **more})


def parts(*pieces: Part | Model) -> dict[str, Any]:
    """Shapes and lamps for a scene's dictionary."""
    (model,) = pieces if isinstance(pieces[0], Model) else (Model.of(*pieces),)  # type: ignore[arg-type]
    return assembled(Path("a.glb"), object_of(Path("a.glb"), model))


def look(part: Part, x: Any, y: Any) -> tuple[mi.BSDF, mi.SurfaceInteraction3f]:
    """What is seen from the front at places of a square: its BSDF, and where it is asked."""
    (shape,) = parts(part).values()
    scene = mi.load_dict({"type": "scene", "shape": shape})
    origin = mi.Point3f(mi.Float(x), mi.Float(y), 5)
    si = scene.ray_intersect(mi.Ray3f(origin, mi.Vector3f(0, 0, -1)))
    assert np.all(si.is_valid().numpy())
    _alive[:] = [scene]  # what was hit belongs to it; of others, Dr.Jit would trace the BSDFs, too
    return shape.bsdf(), si


def base_colour(part: Part, x: Any, y: Any) -> NDArray[np.float32]:
    """The base colours (N, 3) of a square at places (N,)."""
    bsdf, si = look(part, x, y)
    return np.array(bsdf.eval_diffuse_reflectance(si)).T


def seen(description: dict[str, Any], integrator: str = "direct_stratified", spp: int = 16) -> NDArray[np.float32]:
    """A picture (8, 8, C) of the square from the front, of which it fills the middle half."""
    sensor = {
        "type": "perspective",
        "fov": 2 * np.degrees(np.arctan(2 / 5)),
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "rgba", "rfilter": {"type": "box"}},
    }
    scene = mi.load_dict({"type": "scene", "sensor": sensor, **description})
    return np.array(mi.render(scene, integrator=mi.load_dict({"type": integrator}), spp=spp))
