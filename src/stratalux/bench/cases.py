"""What the benchmark renders: a map, a material and a scene for each case, and the sizes of the two suites."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

from ..errors import InputError

MAPS = ("grace", "venice", "studio", "forest", "night", "sky", "apartment", "warehouse")
FLIPPED = frozenset({"grace"})
"""Maps that are upside down as distributed in a y-up scene; they are turned by 180 degrees about x."""
MATERIALS = ("diffuse", "plastic", "metal", "polished")
"""By name in :mod:`stratalux.scenes.materials`: matte, GGX 0.14 under matte, conductor GGX 0.14, conductor GGX 0.05."""
SCENES = ("buddha", "teapot", "matpreview")
ROOM = "room"
"""A scene that is no asset: one with a window, :func:`.scenes.room`."""


@dataclass(frozen=True)
class Case:
    """``map`` and ``scene``: names of assets. ``material``: of the object, by its name.

    ``ground``: whether a mesh stands on one, which fills the image with surfaces; without it, the object is seen
    against the map, silhouettes and all. The scenes of ``matpreview`` and :data:`ROOM` have their own.
    """

    map: str
    material: str
    scene: str
    ground: bool = True

    @property
    def name(self) -> str:
        return f"{self.scene}-{self.material}-{self.map}{'' if self.ground else '-open'}"

    @property
    def assets(self) -> tuple[str, ...]:
        """Names of those that it needs."""
        return (self.map,) if self.scene == ROOM else (self.scene, self.map)

    @property
    def region(self) -> str:
        """Where its errors count: "surface", in pixels that are all surface, or "image", in all."""
        return "surface" if self.ground else "image"


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A set of cases, and how thoroughly they are measured.

    ``cases``, and ``open_cases`` whose whole image counts, map and silhouettes included. ``size``: (width, height) of
    the film in pixels; ``preview_size``: that of ``matpreview``, which is 4:3. ``reference_spp``: samples of a
    reference. ``ladder``: at least three budgets, in samples per pixel of two rays each, of which the two lowest serve
    to screen. ``most``: the ladder is continued up to there where it does not reach our error. ``screened``:
    configurations that get the second screening; ``finalists``: those that get curves. ``repeats``: seeds of every
    point. ``seconds``: of a case on two cores, for the progress alone. ``floor_spp``: samples of the bare-ray floor;
    ``preparation``: (width, height) and regions of the maps whose preparation is timed, and the repeats. ``depth``:
    segments of a path, at most; 2 is direct light.
    """

    name: str
    cases: tuple[Case, ...]
    open_cases: tuple[Case, ...] = ()
    size: tuple[int, int] = (120, 80)
    preview_size: tuple[int, int] = (112, 84)
    reference_spp: int
    ladder: tuple[int, ...] = (16, 64, 256)
    most: int = 1024
    screened: int = 4
    finalists: int = 2
    repeats: int
    seconds: float
    floor_spp: int = 16
    preparation: tuple[tuple[int, int, int, int], ...] = ()
    depth: int = 2

    @property
    def all_cases(self) -> tuple[Case, ...]:
        return self.cases + self.open_cases


QUICK = Suite(
    name="quick",
    cases=(
        Case("grace", "diffuse", "buddha"),
        Case("sky", "plastic", "teapot"),
        Case("studio", "metal", "matpreview"),
        Case("venice", "polished", "buddha"),
    ),
    open_cases=(Case("grace", "metal", "teapot", ground=False),),
    reference_spp=4096,
    repeats=3,
    seconds=45.0,
    preparation=((1024, 512, 1024, 5),),
)
"""All materials, four maps and all scenes, in a few minutes."""

FULL = Suite(
    name="full",
    cases=tuple(Case(m, material, scene) for scene, material, m in product(SCENES, MATERIALS, MAPS)),
    open_cases=tuple(
        Case(m, material, scene, ground=False)
        for scene, material, m in (
            ("buddha", "diffuse", "grace"),
            ("buddha", "metal", "sky"),
            ("teapot", "plastic", "studio"),
            ("teapot", "polished", "forest"),
        )
    ),
    reference_spp=2048,
    repeats=2,
    seconds=35.0,
    preparation=((1024, 512, 1024, 11), (16384, 8192, 1024, 3)),
)
"""Every map in every material in every scene."""

LIGHT = Suite(
    name="light",
    cases=(
        *(
            Case(m, material, scene)
            for material, scene in (("diffuse", "buddha"), ("plastic", "teapot"), ("metal", "buddha"))
            for m in ("grace", "sky", "studio")
        ),
        Case("sky", "diffuse", ROOM),
    ),
    reference_spp=4096,
    repeats=2,
    seconds=90.0,
    depth=8,
)
"""The whole light, three maps in three materials, and a room with a window."""

LIGHT_FULL = replace(
    LIGHT,
    name="light-full",
    cases=(
        *(
            Case(m, material, scene)
            for scene, material, m in product(SCENES, MATERIALS, ("grace", "sky", "studio", "forest"))
        ),
        *LIGHT.cases[-1:],
    ),
)
"""The same in all scenes and materials, under four maps."""

SUITES = {suite.name: suite for suite in (QUICK, FULL, LIGHT, LIGHT_FULL)}


def find_suite(suite: str | Suite) -> Suite:
    """The suite of a name. Raises :class:`InputError` for an unknown one."""
    if isinstance(suite, Suite):
        return suite
    if suite not in SUITES:
        raise InputError(f"suite '{suite}' is unknown; use one of {', '.join(SUITES)}")
    return SUITES[suite]
