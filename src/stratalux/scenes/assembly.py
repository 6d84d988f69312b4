"""What a file holds, as the parts of a Mitsuba scene: meshes with their looks, instances and lamps."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneWarning
from .bitmaps import Bitmaps
from .lamps import lamps
from .looks import Looks, Sets, textures
from .materials import material as material_by_name
from .mesh import TriangleMesh
from .model import Material
from .shapes import Object, Shape

CLAY = "clay"
"""The look of what says nothing of its own."""
_WORTH_AN_INSTANCE = 50_000
"""Triangles that instances save: below, copies are quicker to trace."""


def assembled(
    path: Path,
    found: Object,
    material: str | None = None,
    max_memory: int | None = None,
    looks_of: type[Looks] = Looks,
) -> dict[str, Any]:
    """The shapes and lamps of an object for a scene's dictionary; ids begin with "object" for what is no lamp.

    `path`: of the file, for messages. `material`: the name of one that replaces all of the file. `max_memory`: bytes
    that the texels of one image may take. `looks_of`: what makes the BSDFs. What is not shown is told in one
    :class:`SceneWarning`.
    """
    parts: dict[str, Any] = {}
    with Bitmaps(path, max_memory) as bitmaps:
        looks = looks_of(bitmaps)
        if material is None:
            looks.share(
                (shape.material, _sets(shape.mesh, shape.material), "colour" in shape.mesh.attributes)
                for shape in found.shapes
                if shape.material is not None
            )
        plain = mi.load_dict(material_by_name(material or CLAY))
        for shape in found.shapes:
            look = shape.material if material is None else None
            for part in _parts(shape, look, looks, plain):
                parts[f"object{len(parts)}"] = part
        looks.finish()
        if looks.left_out:
            _warn(path, f"not shown as it is: {'; '.join(sorted(looks.left_out))}")
    grouped = {name: part for name, part in parts.items() if isinstance(part, dict) and part["type"] == "instance"}
    groups = {id(part["group"]): part["group"] for part in grouped.values()}
    named = {group: f"group{number}" for number, group in enumerate(groups)}
    for part in grouped.values():
        part["group"] = {"type": "ref", "id": named[id(part["group"])]}
    return {
        **{named[key]: group for key, group in groups.items()},
        **parts,
        **lamps(found.lights, lambda text: _warn(path, text)),
    }


def _parts(shape: Shape, material: Material | None, looks: Looks, plain: Any) -> list[Any]:
    """A shape at all of its places, as shapes of Mitsuba or dictionaries of them."""
    colours = "colour" in shape.mesh.attributes
    sets = _sets(shape.mesh, material)
    bent = material is not None and bool(sets) and (material.normal or material.clearcoat_normal) is not None
    made: list[Any] = []

    def meshed(mesh: TriangleMesh, bsdf: Any, name: str, emitter: Any = None) -> mi.Mesh:
        """The mesh with its BSDF, which may have to know of it."""
        shown = to_mitsuba(mesh, bsdf, name, sets, emitter)
        if material is not None:
            looks.stands(shown, material, sets, colours)
        return shown

    def look(mesh: TriangleMesh) -> list[tuple[TriangleMesh, Any]]:
        """The mesh, or its halves, with their BSDFs."""
        if material is None:
            return [(replace(mesh, attributes={}), plain)]
        if not bent:
            return [(mesh, looks.bsdf(material, sets, colours, False))]
        mirrored = mirrored_faces(mesh, _main(sets))
        halves = [(mesh, False)] if not mirrored.any() else [(mesh, True)] if mirrored.all() else []
        halves = halves or [(mesh.only(~mirrored), False), (mesh.only(mirrored), True)]
        return [(half, looks.bsdf(material, sets, colours, turned)) for half, turned in halves]

    emitter = None if material is None else looks.emitter(material, sets, colours)
    proper = [place for place in shape.places if np.linalg.det(place[:3, :3]) > 0]
    if emitter is None and (len(proper) - 1) * len(shape.mesh.faces) > _WORTH_AN_INSTANCE:
        group: dict[str, Any] = {"type": "shapegroup"}
        for number, (mesh, bsdf) in enumerate(look(shape.mesh)):
            group[f"mesh{number}"] = meshed(mesh, bsdf, f"mesh{number}")
        for place in proper:
            made.append({"type": "instance", "group": group, "to_world": mi.ScalarTransform4f(place)})
        rest = [place for place in shape.places if np.linalg.det(place[:3, :3]) <= 0]
    else:
        rest = list(shape.places)
    for place in rest:
        for mesh, bsdf in look(shape.mesh.transformed(place)):
            made.append(meshed(mesh, bsdf, shape.name or "object", emitter))
    return made


def _sets(mesh: TriangleMesh, material: Material | None) -> dict[int, str | None]:
    """Which set of texture coordinates of a mesh is its own for Mitsuba, and under which attributes the others go."""
    there = {int(name[2:] or 0) for name in mesh.attributes if name.startswith("uv")}
    if material is None or not there:
        return {}
    used = Counter(texture.uv_set for texture in textures(material) if texture.uv_set in there)
    main = used.most_common(1)[0][0] if used else min(there)
    bends = material.normal or material.bump or material.clearcoat_normal
    if bends is not None and bends.texture is not None and bends.texture.uv_set in there:
        main = bends.texture.uv_set  # tangents follow the mesh's own
    return {number: None if number == main else f"vertex_uv{number}" for number in sorted(there)}


def _main(sets: Sets) -> str:
    """The attribute of a mesh that has its own texture coordinates."""
    return next(f"uv{number or ''}" for number, attribute in sets.items() if attribute is None)


def mirrored_faces(mesh: TriangleMesh, coordinates: str) -> NDArray[np.bool_]:
    """Whether, seen from outside, the texture of each face is mirrored, (F,): u to the right, v would go up."""
    uv = mesh.attributes[coordinates].astype(np.float64)[mesh.faces]
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0)


def to_mitsuba(mesh: TriangleMesh, bsdf: Any, name: str, sets: Sets | None = None, emitter: Any = None) -> mi.Mesh:
    """The mesh as a Mitsuba shape called `name` with `bsdf`, a BSDF or the dictionary of one, and perhaps an emitter.

    `sets`: which attributes go where, see :func:`_sets`. Needs a variant to be set; the first one of a process has to
    be made on the main thread.
    """
    props = mi.Properties()
    props.set_id(name)
    if emitter is not None:
        props["emitter"] = mi.load_dict(emitter)
    main = _main(sets) if sets and mesh.attributes else None
    shape = mi.Mesh(
        name,
        vertex_count=len(mesh.vertices),
        face_count=len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=main is not None,
        props=props,
    )
    params = mi.traverse(shape)
    params["vertex_positions"] = mesh.vertices.ravel()
    params["faces"] = mesh.faces.ravel()
    if mesh.normals is not None:
        params["vertex_normals"] = mesh.normals.ravel()
    if main is not None:
        params["vertex_texcoords"] = mesh.attributes[main].ravel()
    params.update()
    # Only now: an update of a shape makes copies of the textures that are on it.
    shape.set_bsdf(mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf)
    for number, attribute in (sets or {}).items():
        if attribute is not None:
            uv = mesh.attributes[f"uv{number or ''}"]
            shape.add_attribute(attribute, 3, np.column_stack([uv, np.zeros(len(uv))]).astype(np.float32).ravel())
    if "colour" in mesh.attributes:
        colours = mesh.attributes["colour"]
        shape.add_attribute("vertex_colour", 3, np.ascontiguousarray(colours[:, :3]).ravel())
        shape.add_attribute("vertex_alpha", 1, np.ascontiguousarray(colours[:, 3]).ravel())
    return shape


def _warn(path: Path, text: str) -> None:
    warnings.warn(f"{path}: {text}", SceneWarning, stacklevel=3)
