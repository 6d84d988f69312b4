"""Meshes and basic shapes of a stage, as parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade, Vt

from ...model import Floats, Indices, Material, Part
from ..surface import Table, merged, parts_of_polygons
from ..text import with_alpha
from .materials import Materials
from .notes import Notes
from .shapes import Polygons, capsule, cube, cylinder, plane, sphere


class Surfaces:
    """Makes parts of the surfaces of a stage."""

    def __init__(self, path: Path, time: Usd.TimeCode, materials: Materials, notes: Notes) -> None:
        self._path, self._time, self._materials, self._notes = path, time, materials, notes

    def parts(self, prim: Usd.Prim) -> list[Part]:
        """The parts of a surface, one for each of its materials; none of what has no surface."""
        if prim.IsA(UsdGeom.Mesh):
            return self._mesh(UsdGeom.Mesh(prim))
        polygons = self._shape(prim)
        if polygons is None:
            self._notes.add(f"prims of the type {prim.GetTypeName()} are not shown", prim.GetPath())
            return []
        return self._made(prim, *polygons[:3], np.empty(0, np.int64), Table(polygons.normals), None)

    def _shape(self, prim: Usd.Prim) -> Polygons | None:
        def get(name: str) -> Any:
            return prim.GetAttribute(name).Get(self._time)

        match prim.GetTypeName():
            case "Cube":
                return cube(get("size"))
            case "Sphere":
                return sphere(get("radius"))
            case "Plane":
                return plane(get("width"), get("length"), get("axis"))
            case "Cylinder":
                return cylinder(get("height"), get("radius"), get("radius"), get("axis"))
            case "Cylinder_1":
                return cylinder(get("height"), get("radiusBottom"), get("radiusTop"), get("axis"))
            case "Cone":
                return cylinder(get("height"), get("radius"), 0.0, get("axis"))
            case "Capsule":
                return capsule(get("height"), get("radius"), get("axis"))
        return None

    def _mesh(self, mesh: UsdGeom.Mesh) -> list[Part]:
        prim = mesh.GetPrim()
        points = _array(mesh.GetPointsAttr().Get(self._time), 3)
        sizes = _array(mesh.GetFaceVertexCountsAttr().Get(self._time)).astype(np.int64)
        corners = _array(mesh.GetFaceVertexIndicesAttr().Get(self._time)).astype(np.int64)
        if sizes.min(initial=0) < 0 or sizes.sum() > len(corners):
            self._notes.add("meshes whose faces have less corners than they say are left out", prim.GetPath())
            return []
        corners = corners[: sizes.sum()]
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
            self._notes.add("meshes that refer to points that are not there are left out", prim.GetPath())
            return []
        # The outlines of faces go the other way round there; what their corners have goes with them.
        order = None
        if mesh.GetOrientationAttr().Get(self._time) == UsdGeom.Tokens.leftHanded:
            ends = np.cumsum(sizes)
            order = np.repeat(2 * ends - sizes - 1, sizes) - np.arange(len(corners))
        holes = _array(mesh.GetHoleIndicesAttr().Get(self._time)).astype(np.int64)
        return self._made(prim, points, corners, sizes, holes, self._normals(mesh, corners, sizes), order)

    def _made(
        self,
        prim: Usd.Prim,
        points: Floats,
        corners: Indices,
        sizes: Indices,
        holes: Indices,
        normals: Table | None,
        order: Indices | None,
    ) -> list[Part]:
        materials, chosen = self._chosen(prim, len(sizes))
        uvs = self._coordinates(prim, corners, sizes)
        colours = self._colours(prim, corners, sizes)
        if all(material is not None and not material.vertex_colours for material in materials):
            colours = None
        kept = order
        if len(holes):
            shown = np.ones(len(sizes), dtype=bool)
            shown[holes[(holes >= 0) & (holes < len(sizes))]] = False
            of_corners = np.flatnonzero(np.repeat(shown, sizes))
            kept = of_corners if kept is None else kept[of_corners]
            sizes, chosen = sizes[shown], chosen[shown]

        def same(table: Table | None) -> Table | None:
            if table is None or table.corners is None or kept is None:
                return table
            return Table(table.values, table.corners[kept])

        return parts_of_polygons(
            self._path,
            points,
            corners if kept is None else corners[kept],
            sizes,
            normals=same(normals),
            uvs={number: same(table) or table for number, table in uvs.items()},
            colours=same(colours),
            materials=materials,
            chosen=chosen,
            name=prim.GetName(),
        )

    def _chosen(self, prim: Usd.Prim, faces: int) -> tuple[list[Material | None], Indices]:
        """The materials of a surface, and which of them each face has."""
        materials = [self._materials.bound(prim)]
        chosen = np.zeros(faces, dtype=np.int64)
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            indices = _array(subset.GetIndicesAttr().Get(self._time)).astype(np.int64)
            chosen[indices[(indices >= 0) & (indices < faces)]] = len(materials)
            materials.append(self._materials.bound(subset.GetPrim()))
        # Subsets of the same material are one part.
        first = {id(material): index for index, material in reversed(list(enumerate(materials)))}
        return materials, np.array([first[id(material)] for material in materials])[chosen]

    def _normals(self, mesh: UsdGeom.Mesh, corners: Indices, sizes: Indices) -> Table | None:
        """Those of the primvar, or else those of the attribute; without them, a surface to be subdivided is told."""
        primvar = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            return self._table(primvar, corners, sizes, 3)
        values = mesh.GetNormalsAttr().Get(self._time)
        if values is None or not len(values):
            scheme = mesh.GetSubdivisionSchemeAttr()
            if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none:
                self._notes.add("surfaces that are to be subdivided are shown as they are", mesh.GetPath())
            return None
        interpolation = mesh.GetNormalsInterpolation()
        return self._spread(mesh.GetPrim(), "normals", _array(values, 3), interpolation, corners, sizes)

    def _coordinates(self, prim: Usd.Prim, corners: Indices, sizes: Indices) -> dict[int, Table]:
        found = {}
        for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
            kind = str(primvar.GetTypeName())
            if kind not in ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]", "half2[]"):
                continue
            table = self._table(primvar, corners, sizes, 2)
            if table is not None:
                values = np.stack([table.values[:, 0], 1 - table.values[:, 1]], axis=1)
                found[self._materials.sets.number(primvar.GetPrimvarName())] = Table(values, table.corners)
        return found

    def _colours(self, prim: Usd.Prim, corners: Indices, sizes: Indices) -> Table | None:
        """What is displayed where no material says otherwise: it is linear."""
        api = UsdGeom.PrimvarsAPI(prim)
        colour, opacity = (api.FindPrimvarWithInheritance(name) for name in ("displayColor", "displayOpacity"))
        colours = self._table(colour, corners, sizes, 3) if colour and colour.HasValue() else None
        alphas = self._table(opacity, corners, sizes, 1) if opacity and opacity.HasValue() else None
        if alphas is None:
            return colours and Table(with_alpha(colours.values), colours.corners)
        rgb = np.ones((len(corners), 3)) if colours is None else colours.of(corners)
        return merged(np.concatenate([rgb, alphas.of(corners)], axis=1))

    def _table(self, primvar: UsdGeom.Primvar, corners: Indices, sizes: Indices, width: int) -> Table | None:
        values = _array(primvar.Get(self._time), width)
        indices = _array(primvar.GetIndices(self._time)).astype(np.int64) if primvar.IsIndexed() else None
        prim = primvar.GetAttr().GetPrim()
        return self._spread(prim, primvar.GetPrimvarName(), values, primvar.GetInterpolation(), corners, sizes, indices)

    def _spread(
        self,
        prim: Usd.Prim,
        name: str,
        values: Floats,
        interpolation: str,
        corners: Indices,
        sizes: Indices,
        indices: Indices | None = None,
    ) -> Table | None:
        """Values with the number of that of each corner; None, and a note, if there are too few of them."""
        count = len(values) if indices is None else len(indices)
        numbers: Indices | None
        if interpolation == UsdGeom.Tokens.constant:
            numbers, needed = np.zeros(len(corners), dtype=np.int64), 1
        elif interpolation == UsdGeom.Tokens.uniform:
            numbers, needed = np.repeat(np.arange(len(sizes)), sizes), len(sizes)
        elif interpolation == UsdGeom.Tokens.faceVarying:
            numbers, needed = np.arange(len(corners)), len(corners)
        else:
            numbers, needed = corners, int(corners.max(initial=-1)) + 1
        if count < needed or not len(values):
            self._notes.add(f"{name!r} with less values than its mesh has places for are left out", prim.GetPath())
            return None
        if indices is not None:
            return Table(values, indices[numbers])
        if interpolation == UsdGeom.Tokens.faceVarying:
            return merged(values[: len(corners)])
        return Table(values, numbers)


def _array(values: Vt.Array | None, width: int = 0) -> Any:
    """An array of USD as (N, width), in double precision, or as it is."""
    if values is None:
        return np.empty((0, width)) if width else np.empty(0, dtype=np.int64)
    found = np.array(values)
    return found.reshape(-1, width).astype(np.float64) if width else found
