"""``direct_wavelet``: direct light from samples of the product of map and BSDF, by hierarchical warping."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..errors import InputError
from ..sampling.equal_area import (
    LightPyramid,
    direction_to_square,
    first_node,
    index_of_texel,
    square_to_direction,
    square_to_map,
    texel_of_index,
    warp,
)
from ..sampling.region_sampler import DirectionSample
from .common import DirectIntegrator, target
from .derivatives import SUM
from .environment import MapCache, MapLight
from .straight import Scene, arriving
from .techniques import Property, Technique, properties_from

WAVELET = Technique(
    name="wavelet",
    plugin="direct_wavelet",
    summary="shadow rays from the product of map and BSDF, by hierarchical warping",
    source="Clarberg, Jarosz, Akenine-Möller and Jensen 2005, with the product formed at run time",
    unbiased=True,
    properties={
        "samples": Property(16, "shadow rays per shading point, S", minimum=1),
        "resolution": Property(16, "cells along a side of the square, R, in which the product is formed", minimum=8),
    },
    rays=("samples",),
)
TECHNIQUES = (WAVELET,)

_BLOCK_LEVELS = 3
"""A shading point keeps the product of 8x8 blocks of cells: 64 numbers still fit the state of a loop."""

_MAX_RESOLUTION = 32
"""Finer products cost more than the noise they save, in BSDF evaluations and in numbers kept."""

_FLOOR = 0.2
"""β, the weight of the map alone beside the product. With less, coarse cells miss more; with more, samples are wasted:
for R = 16 the error hardly depends on it from 0.03 on, and for R = 8 it halves up to here."""

_LEAST = 1e-20
"""A product of a smaller mean counts as none, or its quotients would underflow."""


class DirectWavelet(DirectIntegrator):
    r"""Direct lighting by wavelet importance sampling (Clarberg et al. 2005), with the product formed at run time.

    ================= ======= ========================================================================
    ``samples``       int     Shadow rays S per shading point (default: 16)
    ``resolution``    int     Cells R along a side of the coarse product: 8, 16 or 32 (default: 16)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ========================================================================

    The sphere of directions is a quadtree over an equal-area square. S points, which cover the unit square evenly, are
    warped level by level so that their density becomes that of a product of map and BSDF, and

        L_o(p, ω_o) = (1/S) Σ_k V(p, x_k) L(x_k) f(x_k) cos(x_k) / p(x_k)

    with the map's own L and the BSDF's own f, so that what is approximate in the product costs variance, not bias.

    *As published*, map and BRDF are both wavelet-transformed in advance, the BRDF times cosine as tables over the same
    square, in the world's frame, for many orientations of surface and view, all kept sparse. For a shading point the
    two transforms are multiplied, and the points are warped by the product down to the finest level.

    *Here* nothing is known of a BSDF in advance. Only the map is prepared, as means over the nodes of the quadtree,
    which are the scaling coefficients of its Haar transform, none left out. For a shading point the product is formed
    in R x R cells c, with one evaluation of the BSDF each, towards the centroid d_c of the light in the cell,

        P_c = E_c f(d_c) cos(d_c),    p(x) = 1 / 4π · E(x) / E_c · (P_c / P̄ + β E_c) / (1 + β)

    where E_c and E(x) are the map's means in the cell and in the finest texel, over its mean of all, and P̄ is the mean
    of P. Below the cells the map alone is followed. So every BSDF can be sampled, with its textures and normal maps,
    under a map that is turned at will, without tables, at R² evaluations a shading point; but a lobe narrower than a
    cell is not resolved. The floor β lets β / (1 + β) of the samples follow the map alone. It keeps p > 0 wherever the
    map has light: in cells that the horizon crosses, in lobes between centroids. Where all P are 0 it is all there is.

    Other emitters, delta lobes and environments that are no image are sampled as Mitsuba's ``direct`` does.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings = properties_from(WAVELET, props)
        self.samples = int(settings["samples"])
        self.resolution = int(settings["resolution"])
        if self.resolution & (self.resolution - 1) or self.resolution > _MAX_RESOLUTION:
            raise InputError(f"technique wavelet: resolution: {self.resolution} is not one of 8, 16 and 32")
        self._cache = MapCache(lambda environment: LightPyramid(environment, self.resolution.bit_length() - 1))

    def prepare(self, scene: mi.Scene) -> MapLight[LightPyramid] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    @dr.syntax
    def environment_light(
        self,
        scene: Scene,
        light: MapLight[LightPyramid],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        if dr.hint(light.tables.black, mode="scalar"):
            return mi.Spectrum(0)
        ctx = mi.BSDFContext()
        with dr.suspend_grad():
            product = Product(light, si, bsdf, active)
        S = dr.opaque(mi.UInt32, self.samples)
        # A random shift, modulo 1, makes every point of the Hammersley set uniform. Warping takes more bits than one
        # number of single precision has.
        shift = mi.Point2d(sampler.next_2d(active)) + mi.Point2d(sampler.next_2d(active)) * 2.0**-24

        L_o = mi.Spectrum(0)  # Outgoing radiance
        k = mi.UInt32(0)  # Index of the sample
        while dr.hint(k < S, max_iterations=SUM):
            # ------------------- A direction from the product -----------------
            u = shift + mi.Point2d(mi.Float64(k) / mi.Float64(S), mi.Float64(dr.brev(k)) * 2.0**-32)
            x = dr.detach(product.sample(u - dr.floor(u), active))
            d = light.to_world @ x.d
            valid = active & (x.pdf > 0)
            g = light.radiance(si, x.uv, d, valid) * bsdf.eval(ctx, si, si.to_local(d), valid)

            # -------------------------- Its shadow ray ------------------------
            lit = valid & (dr.any(g > 0) | light.differentiated)
            L_o += arriving(scene, si, d, g / x.pdf, lit)
            k += 1
        return L_o / mi.Float(S)

    def to_string(self) -> str:
        return f"DirectWavelet[samples = {self.samples}, resolution = {self.resolution}]"


class Product:
    """The density p of a shading point: the product P in R x R cells, the map's means below, the floor beside it.

    Only the means over 8x8 blocks of cells are kept, and the cells of a block that has been chosen are evaluated once
    more. An array in local memory (``dr.alloc_local``) could hold all of them, but with Dr.Jit 1.5 and LLVM a loop that
    walks down such a quadtree, every lane its own way, reads wrong values. (No dataclass: Dr.Jit would take it apart
    and make it the state of a loop.)
    """

    def __init__(
        self, light: MapLight[LightPyramid], si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool | bool
    ) -> None:
        self._pyramid, self._to_world = light.tables, light.to_world
        self._si, self._bsdf, self._active = si, bsdf, active
        self._block_size = 4 ** (self._pyramid.cells - _BLOCK_LEVELS)
        self._levels = _with_means(self._block_means())
        mean = 0.25 * sum(self._levels[0])
        some = mean > _LEAST
        self._scale = dr.select(some, dr.rcp(mean), 0)
        self._total = dr.select(some, 1 + _FLOOR, _FLOOR)

    def sample(self, u: mi.Point2d, active: mi.Bool | bool = True) -> DirectionSample:
        """Warp a point of the unit square to a direction."""
        node = block = mi.UInt32(0)
        value = mi.Float(0)

        # ------------- The product: first to a block, then to a cell -------------
        for values in self._levels:
            E = self._pyramid.children(node, active)
            child, value, u = warp(self._density(_quadruple(values, block), E), u)
            node, block = 4 * node + 1 + child, 4 * block + child
        within = mi.UInt32(0)
        for values in _with_means(self._block(block)) if self._block_size > 1 else ():
            E = self._pyramid.children(node, active)
            child, value, u = warp(self._density(_quadruple(values, within), E), u)
            node, within = 4 * node + 1 + child, 4 * within + child
        return self._below(node, block * self._block_size + within, value, u, active)

    @dr.syntax
    def _below(
        self, node: mi.UInt32, cell: mi.UInt32, value: mi.Float, u: mi.Point2d, active: mi.Bool | bool
    ) -> DirectionSample:
        """Go on from a cell, ``node`` of the quadtree and of density ``value``, through the map's own levels."""
        E = self._pyramid.value(node, active)
        ratio = self._ratio(value, E)
        texel = mi.UInt32(cell)
        level = mi.UInt32(self._pyramid.cells)
        while level < dr.opaque(mi.UInt32, self._pyramid.levels):
            child, E, u = warp(self._pyramid.children(node, active), u)
            node, texel = 4 * node + 1 + child, 4 * texel + child
            level += 1
        s = (mi.Point2f(texel_of_index(texel)) + mi.Point2f(u)) / self._pyramid.resolution
        return DirectionSample(uv=square_to_map(s), d=square_to_direction(s), pdf=ratio * E * dr.inv_four_pi)

    def pdf(self, d: mi.Vector3f, active: mi.Bool | bool = True) -> mi.Float:
        """Density, per steradian, at the unit direction ``d`` (map's frame)."""
        resolution = self._pyramid.resolution
        texel = index_of_texel(dr.minimum(mi.Point2u(direction_to_square(d) * resolution), resolution - 1))
        cell = texel >> 2 * (self._pyramid.levels - self._pyramid.cells)
        E_c = self._pyramid.value(first_node(self._pyramid.cells) + cell, active)
        E = self._pyramid.value(first_node(self._pyramid.levels) + texel, active)
        return self._ratio(self._density(self._evaluate(cell), E_c), E_c) * E * dr.inv_four_pi

    def _density(self, P: Any, E: Any) -> Any:
        """What nodes are chosen by: P / P̄ + β E."""
        return self._scale * P + _FLOOR * E

    def _ratio(self, value: mi.Float, E: mi.Float) -> mi.Float:
        """Density of a cell in which the above is ``value`` over that of the map alone, which is ``E``."""
        return dr.select(E > 0, value / (self._total * E), 0)

    def _evaluate(self, cell: mi.UInt32) -> mi.Float:
        """The product P in one cell."""
        E = self._pyramid.value(first_node(self._pyramid.cells) + cell, self._active)
        lit = self._active & (E > 0)
        d = self._si.to_local(self._to_world @ self._pyramid.centroid(cell, lit))
        f_cos = target(self._bsdf.eval(mi.BSDFContext(), self._si, d, lit))
        return E * dr.select(lit & (f_cos > 0), f_cos, 0)

    @dr.syntax
    def _block_means(self) -> list[mi.Float]:
        """Mean of the product over the cells of each block, in Z-order."""
        means = [mi.Float(0)] * 4**_BLOCK_LEVELS
        block = mi.UInt32(0)
        while block < 4**_BLOCK_LEVELS:
            means = _put(means, block, sum(self._block(block)) / self._block_size)
            block += 1
        return means

    @dr.syntax
    def _block(self, block: mi.UInt32) -> list[mi.Float]:
        """The product in the cells of a block, in Z-order."""
        values = [mi.Float(0)] * self._block_size
        k = mi.UInt32(0)
        while k < self._block_size:
            values = _put(values, k, self._evaluate(block * self._block_size + k))
            k += 1
        return values


def _with_means(values: list[mi.Float]) -> list[list[mi.Float]]:
    """``values`` of one level of a quadtree, after the means that make up the coarser levels, four values first."""
    levels = [values]
    while len(levels[0]) > 4:
        fine = levels[0]
        levels.insert(0, [0.25 * sum(fine[i : i + 4]) for i in range(0, len(fine), 4)])
    return levels


def _put(values: list[mi.Float], index: mi.UInt32, value: mi.Float) -> list[mi.Float]:
    return [dr.select(index == i, value, old) for i, old in enumerate(values)]


def _quadruple(values: list[mi.Float], index: mi.UInt32) -> mi.Vector4f:
    """``values[4 * index : 4 * index + 4]``."""
    found = mi.Vector4f(*values[:4])
    for i in range(1, len(values) // 4):
        found = dr.select(index == i, mi.Vector4f(*values[4 * i : 4 * i + 4]), found)
    return found


PLUGINS = {"direct_wavelet": DirectWavelet}
