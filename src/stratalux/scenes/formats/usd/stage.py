"""A stage, from its root to a model: what is shown of it, and where it stands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom, UsdLux, UsdSkel

from ....errors import InputError
from ...model import Camera, Floats, Instance, Light, Model, Part
from ...sources import source
from .assets import Assets
from .cameras import camera
from .lights import light
from .materials import Materials, Sets
from .meshes import Surfaces
from .notes import Notes


def read_stage(path: Path) -> Model:
    """The model of a file, at the first moment of its animation. Raises InputError for what is no stage."""
    notes = Notes(path)
    # What the library has to say goes to the standard error otherwise.
    with Tf.DiagnosticTrap() as trap:
        try:
            stage = Usd.Stage.Open(str(path))
            if not stage:
                raise InputError(f"{path}: unreadable as USD; export it again")
            for layer in stage.GetUsedLayers():
                if layer.realPath:
                    source(Path(layer.realPath))
            model = _Reader(path, stage, notes).model()
        except Tf.ErrorException as error:
            raise InputError(f"{path}: unreadable as USD ({_first(error)}); export it again") from None
        finally:
            said = [*trap.GetErrors(), *trap.GetWarnings()]
            trap.Clear()
    for each in said:
        notes.add("USD says: " + " ".join(str(each.commentary).split())[:160])
    notes.tell()
    return model


def _first(error: Exception) -> str:
    lines = [each.commentary for each in error.args if hasattr(each, "commentary")] or [str(error)]
    return " ".join(str(lines[0]).split())[:120]


class _Reader:
    """Walks over a stage. Meshes of instances are read once."""

    def __init__(self, path: Path, stage: Usd.Stage, notes: Notes) -> None:
        self._stage, self._notes = stage, notes
        has_range = stage.HasAuthoredTimeCodeRange()
        self._time = Usd.TimeCode(stage.GetStartTimeCode()) if has_range else Usd.TimeCode.EarliestTime()
        self._assets, sets = Assets(path), Sets()
        self._materials = Materials(self._time, self._assets, sets, notes, {})
        self._surfaces = Surfaces(path, self._time, self._materials, notes)
        self._cache = UsdGeom.XformCache(self._time)
        self._parts: list[Part] = []
        self._known: dict[tuple[object, ...], list[int]] = {}
        self._lights: list[Light] = []
        self._cameras: list[Camera] = []

    def model(self) -> Model:
        self._pose()
        instances = list(self._below(self._stage.GetPseudoRoot(), np.eye(4), True))
        return Model(
            self._parts,
            instances,
            self._lights,
            self._cameras,
            up=str(UsdGeom.GetStageUpAxis(self._stage)).lower(),
            metres=UsdGeom.GetStageMetersPerUnit(self._stage)
            if UsdGeom.StageHasAuthoredMetersPerUnit(self._stage)
            else None,
        )

    def _pose(self) -> None:
        """Put what has a skeleton into its pose, in a layer of its own."""
        if not any(prim.IsA(UsdSkel.Root) for prim in self._stage.Traverse()):
            return
        self._stage.SetEditTarget(self._stage.GetSessionLayer())
        moment = self._time.GetValue()
        if not UsdSkel.BakeSkinning(self._stage.Traverse(), Gf.Interval(moment, moment)):
            self._notes.add("what has a skeleton is shown at rest")

    def _below(self, root: Usd.Prim, matrix: Floats, is_scene: bool) -> Iterator[Instance]:
        """What is shown at a prim and below it. `matrix` takes the coordinates of the scene to where it stands."""
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        for prim in prims:
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                continue
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
                continue
            if imageable.ComputePurpose() not in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render):
                continue
            self._tell_animation(prim)
            here = matrix @ self._to_scene(prim)
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                yield from self._scattered(UsdGeom.PointInstancer(prim), here)
            elif prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdGeom.Camera):
                if is_scene:
                    self._add(prim, here)
                else:
                    self._notes.add("lights and cameras that are scattered are not shown", prim.GetPath())
            if prim.IsA(UsdGeom.Gprim):
                for part in self._shared(prim):
                    yield Instance(part, here)

    def _add(self, prim: Usd.Prim, matrix: Floats) -> None:
        if prim.IsA(UsdGeom.Camera):
            seen = camera(prim, matrix, self._time, self._notes)
            self._cameras += [seen] if seen else []
        else:
            lamp = light(prim, matrix, self._time, self._assets, self._notes)
            self._lights += [lamp] if lamp else []

    def _shared(self, prim: Usd.Prim) -> list[int]:
        """The parts of a surface; those of instances are the same, unless their materials differ."""
        own = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = (str(own.GetPath()), id(self._materials.bound(prim)))
        if key not in self._known:
            parts = self._surfaces.parts(prim)
            self._known[key] = list(range(len(self._parts), len(self._parts) + len(parts)))
            self._parts += parts
        return self._known[key]

    def _scattered(self, instancer: UsdGeom.PointInstancer, matrix: Floats) -> Iterator[Instance]:
        """The prototypes of an instancer at all of its points. `matrix` takes its own coordinates to the scene."""
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        indices = np.array(instancer.GetProtoIndicesAttr().Get(self._time) or [], dtype=np.int64)
        transforms = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = list(instancer.ComputeMaskAtTime(self._time)) or [True] * len(indices)
        if len(transforms) != len(indices) or len(mask) != len(indices):
            self._notes.add("instancers whose lists are of different lengths are not shown", instancer.GetPath())
            return
        for number, target in enumerate(targets):
            prototype = self._stage.GetPrimAtPath(target)
            if not prototype:
                self._notes.add("prototypes that are not there are not shown", target)
                continue
            # The transforms have that of the prototype in them.
            back = np.linalg.pinv(self._to_scene(prototype))
            shown = list(self._below(prototype, back, False))
            for index in np.flatnonzero((indices == number) & np.array(mask, dtype=bool)).tolist():
                there = matrix @ np.array(transforms[index]).T
                yield from (Instance(each.part, there @ each.matrix) for each in shown)

    def _to_scene(self, prim: Usd.Prim) -> Floats:
        matrix: Floats = np.array(self._cache.GetLocalToWorldTransform(prim)).T
        return matrix

    def _tell_animation(self, prim: Usd.Prim) -> None:
        xform, points = UsdGeom.Xformable(prim), UsdGeom.PointBased(prim)
        moves = xform and xform.TransformMightBeTimeVarying()
        if moves or (points and points.GetPointsAttr().ValueMightBeTimeVarying()):
            self._notes.add("what moves is shown as it is at the first moment", prim.GetPath())
