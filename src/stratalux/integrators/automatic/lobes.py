"""How many rays a camera sample gets for the map and for the BSDF, and how many proposals for each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from ...sampling.leaf_sampler import LeafSampler
from ..common import draw, only, target
from ..environment import MapLight
from ..identities import by_identity, told

DIM = 0.15
"""Of the map's mean radiance: surfaces darker than that are not thought to be looked at for their noise."""

_DIRECTIONS, _LANES = 256, 16384
"""Test directions for each surface, at least, and for all of them together."""
_DRAWS = 8
"""From the BSDF in each of them, to see how they differ under the map."""


@dataclass(frozen=True)
class Row:
    """What surfaces get whose glossy lobes have a ``concentration`` in sr⁻¹ up to this one.

    ``light`` and ``lobe``: rays for light samples and for samples of the glossy lobes. ``matte``: whether something
    besides those lobes reflects light, which is worth a control variate. ``spread``: relative variance of what BSDF
    samples bring, from which on each ray is worth two proposals; twice that is worth four, and so on up to ``most``.
    """

    concentration: float
    light: int
    lobe: int
    matte: bool
    spread: float
    most: int


ROWS = (
    Row(0.22, 16, 0, True, math.inf, 1),
    Row(math.inf, 8, 4, True, 0.28, 4),
    Row(0.32, 4, 2, False, 0.12, 2),
    Row(3.0, 4, 4, False, 0.28, 4),
    Row(math.inf, 2, 4, False, 0.1, 8),
)
"""The first one is for what has hardly any gloss, the second for what has both, the others for gloss alone. A GGX
conductor of roughness 0.14 has a concentration of 1.3 and one of roughness 0.05 has 9; all sides alike would be 0.2."""
BESIDE_GLOSS = 8
"""Rays for light samples, at most, where other surfaces of the scene have no matte part: most of its camera samples
are theirs, with some for the pixels around them."""
DETAILED_LIGHT = 4
"""The same in a pixel that is :attr:`~.look.Look.detailed`, where it takes camera samples to find what there is."""
DETAILED_SPREAD = 0.082
"""Relative variance of what BSDF samples bring (see :attr:`Row.spread`) that is worth one ray for them there,
on what has no matte part."""
MOST_RAYS = max(row.light + row.lobe for row in ROWS)
_MATTE, _BOTH, _GLOSSY = 0, 1, 2
_UNKNOWN = _BOTH
"""The row of shapes that are not in the list of the scene, as those of instances."""


class Allocation:
    """For every shape of a scene: the rays for light samples N and for BSDF samples K, and proposals M for each ray.

    The concentration of a BSDF is the geometric mean of the pdf of its glossy lobes over directions drawn from them,
    for light from all sides: the reciprocal of about the solid angle that they fill. M follows from how much the map
    varies inside the lobes. Both are measured, so any BSDF and any map have them. It is the shape that tells, since a
    BSDF can look different on each of several. ``matte``: a BSDF that is no shape's, whatever shape it is put on.
    """

    def __init__(self, scene: mi.Scene, light: MapLight[LeafSampler], matte: mi.BSDF | None = None) -> None:
        self._identities, rows = _rows(scene)
        self._matte = matte
        used = set(rows.numpy().tolist()) | ({_UNKNOWN} if _has_instances(scene) else set())
        used |= {_MATTE} if matte is not None else set()
        self.any_bsdf_samples = any(ROWS[row].lobe for row in used)
        self.any_glossy = any(not ROWS[row].matte for row in used)
        """Whether anything has gloss alone."""
        self.any_matte = any(ROWS[row].matte for row in used)
        spreads = _spreads(scene, light, rows) if self.any_bsdf_samples else [math.nan] * len(ROWS)
        self.most_proposals = max((_proposals(ROWS[row], spreads[row]) for row in used), default=1)
        """M of what has most of them."""
        shares = [
            (row, spread, detailed) for detailed in (False, True) for row, spread in zip(ROWS, spreads, strict=True)
        ]
        self._table = mi.UInt32([self._share(*share) for share in shares])

    def arrays(self) -> tuple[mi.UInt32, ...]:
        """What kernels read."""
        return self._identities, self._table

    def _share(self, row: Row, spread: float, detailed: bool) -> int:
        """What :meth:`of` tells, in one number."""
        N, K, M = row.light, row.lobe, _proposals(row, spread)
        if self.any_glossy:
            N = min(N, DETAILED_LIGHT if detailed else BESIDE_GLOSS)
        if detailed and not row.matte and math.isfinite(spread):
            K = min(K, max(1, round(spread / DETAILED_SPREAD)))
        return N | K << 8 | M << 16 | row.matte << 31

    def of(
        self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, detailed: mi.UInt32, active: mi.Bool
    ) -> tuple[mi.UInt32, mi.UInt32, mi.UInt32, mi.Bool]:
        """N, K, M, and whether there is something besides gloss, at each lane.

        ``detailed``: 1 in pixels that are, or 0.
        """
        row = told(self._identities, shape, _UNKNOWN, active)
        if self._matte is not None:
            row = dr.select(bsdf == mi.BSDFPtr(self._matte), _MATTE, row)
        shares = dr.gather(mi.UInt32, self._table, row + detailed * len(ROWS), active)
        return shares & 0xFF, shares >> 8 & 0xFF, shares >> 16 & 0xFF, shares >> 31 != 0


def concentration(bsdf: mi.BSDFPtr, sampler: mi.Sampler, shape: mi.ShapePtr | None = None) -> mi.Float:
    """Logarithm of the pdf of one direction drawn from the glossy lobes; NaN where none could be drawn."""
    bs, _, drawn = _draw(bsdf, _surface(sampler, shape), sampler)
    return dr.select(drawn, dr.log(bs.pdf), dr.nan)


def _rows(scene: mi.Scene) -> tuple[mi.UInt32, mi.UInt32]:
    """The row of each shape, by the identity that Dr.Jit gives it, and by its place in the scene's list."""
    count = len(scene.shapes())
    if count == 0:
        return mi.UInt32(_UNKNOWN), mi.UInt32()
    shape, tested, sampler = _tests(scene, 0)
    value = dr.exp(_means(concentration(tested.bsdf(), sampler, tested), shape, count))
    shapes = dr.gather(mi.ShapePtr, scene.shapes_dr(), dr.arange(mi.UInt32, count))
    glossy = mi.UInt32(_GLOSSY)
    for limit in ROWS[_GLOSSY:-1]:
        glossy += mi.UInt32(dr.select(value > limit.concentration, 1, 0))
    row = dr.select(mi.has_flag(shapes.bsdf().flags(), mi.BSDFFlags.Diffuse), _BOTH, glossy)
    row = dr.select(value > ROWS[0].concentration, row, 0)  # of those that have no glossy lobes, too
    dr.eval(row)
    return by_identity(shapes, row, _UNKNOWN), row


def _spreads(scene: mi.Scene, light: MapLight[LeafSampler], rows: mi.UInt32) -> list[float]:
    """Mean :func:`spread` for each of :data:`ROWS`, NaN where there is none; ``rows``: that of each shape."""
    shape, tested, sampler = _tests(scene, 1)
    row = dr.gather(mi.UInt32, rows, shape)
    N, K = (
        dr.gather(mi.Float, mi.Float(numbers), row)
        for numbers in ([row.light for row in ROWS], [row.lobe for row in ROWS])
    )
    return [
        float(value) for value in _means(spread(light, tested.bsdf(), N, K, sampler, tested), row, len(ROWS)).numpy()
    ]


def _proposals(row: Row, spread: float) -> int:
    return _power_of_two(spread / row.spread, row.most)


def _power_of_two(ratio: float, most: int) -> int:
    """The one next to ``ratio``, in 1 … ``most``; 1 where nothing was measured."""
    return 1 << round(math.log2(min(max(ratio, 1), most))) if math.isfinite(ratio) else 1


def _tests(scene: mi.Scene, seed: int) -> tuple[mi.UInt32, mi.ShapePtr, mi.Sampler]:
    """The number of the shape of each test direction, that shape, and random numbers for them."""
    each = max(_DIRECTIONS, _LANES // len(scene.shapes()))
    count = len(scene.shapes()) * each
    shape = dr.arange(mi.UInt32, count) // each
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, count)
    return shape, dr.gather(mi.ShapePtr, scene.shapes_dr(), shape), sampler


def _means(values: mi.Float, group: mi.UInt32, count: int) -> mi.Float:
    """Mean in each of ``count`` groups of the values that are not NaN; NaN where there is none."""
    counted = ~dr.isnan(values)
    total, weight = dr.zeros(mi.Float, count), dr.zeros(mi.Float, count)
    dr.scatter_add(total, dr.select(counted, values, 0), group)
    dr.scatter_add(weight, mi.Float(counted), group)
    return total / weight


@dr.syntax
def spread(
    light: MapLight[LeafSampler],
    bsdf: mi.BSDFPtr,
    N: mi.Float,
    K: mi.Float,
    sampler: mi.Sampler,
    shape: mi.ShapePtr | None = None,
) -> mi.Float:
    """Variance of what BSDF samples bring that stand beside N light samples, K in all, at a random surface.

    It is relative to the square of their mean, or of :data:`DIM` of the map's if that is more. No shadows.
    """
    si = _surface(sampler, shape)
    energy = light.tables.total * light.scale
    total, squares = mi.Float(0), mi.Float(0)
    k = mi.UInt32(0)
    while k < _DRAWS:
        bs, weight, found = _draw(bsdf, si, sampler)
        L = light.radiance_towards(si.to_world(bs.wo), si, found)
        brightness = target(L) / energy  # in units of the map, whose squares stay within single precision
        g = target(L / energy * weight) * K * bs.pdf / (N * brightness + K * bs.pdf)
        g = dr.select(found, g, 0)
        total += g
        squares += g * g
        k += 1
    mean = total / _DRAWS
    variance = dr.maximum(squares - total * mean, 0) / (_DRAWS - 1)
    dim = DIM / (4 * dr.pi)
    return variance / (mean * mean + dim * dim)


def _draw(
    bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, sampler: mi.Sampler
) -> tuple[mi.BSDFSample3f, mi.Spectrum, mi.Bool]:
    """A sample of the glossy lobes, its weight, and whether there is one of finite density."""
    bs, weight, found = draw(bsdf, only(mi.BSDFFlags.Glossy), si, sampler.next_1d(), sampler.next_2d())
    return bs, weight, found & dr.isfinite(bs.pdf)


def _surface(sampler: mi.Sampler, shape: mi.ShapePtr | None = None) -> mi.SurfaceInteraction3f:
    """Somewhere on a surface of any orientation, of that `shape`, seen from anywhere in front of it."""
    si = dr.zeros(mi.SurfaceInteraction3f, sampler.wavefront_size())
    n = mi.warp.square_to_uniform_sphere(sampler.next_2d())
    si.t = 1
    si.sh_frame = mi.Frame3f(n)
    si.n = n
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    si.uv = sampler.next_2d()
    if shape is not None:
        si.shape = shape
    if mi.is_spectral:
        si.wavelengths = mi.Spectrum(550)
    return si


def _has_instances(scene: mi.Scene) -> bool:
    return any(shape.class_name() == "Instance" for shape in scene.shapes())
