"""Light paths: from the map to things, and on to what the camera sees (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.points import mix, shuffle, sobol, sobol_2d, sobol_cells, van_der_corput
from ..automatic.launch import Estimator, Group, Launch, Launcher
from ..automatic.nested_strata import PixelPoints, Survivor
from ..automatic.view import Lanes, Range, View, unsigned
from ..both_ways import turned
from ..light_samples import FreshLight, SharedLight
from ..sums import reach_of
from .paths import ENOUGH, Paths
from .vertex import VertexLight

_SEED = 0x510E527F
"""Distinguishes the points of light paths from all others."""
_BITS = 6
"""Light paths are taken in the order of so many bits of each coordinate of where they begin: neighbours meet the same
things, which takes a quarter less time."""
_FINE = 256
"""Points of a pixel's side at which a filter is looked at."""


class LightLauncher(Launcher):
    r"""Takes light paths, one in the place of each camera sample, which land wherever they do.

    Such a path begins on the box around what has gloss, as the map shines there, and goes on where the BSDFs lead. Each
    of its surfaces but the first may be the x_1 of a path to the camera, as :class:`~..both_ways.BothWays` has it:

        q / (q + M p̃ + p_b) A(ω) L(ω) / p(ω) Π_{i=2}^{n} (f_i |cos θ'_i| / p'_i) f_1 |cos θ'_1| W,

    with the BSDFs f as a path from the camera has them, and the weight W of the camera. Where shading normals are not
    those of the surface, f_i has the ratio of both cosines of θ_i, too (Veach 1997, section 5.3). Of all these
    surfaces, one stands for all: a :class:`~..automatic.nested_strata.Survivor`. ``arriving``: what makes the light at
    vertices of paths from the camera.
    """

    def __init__(
        self,
        integrator: Estimator,
        paths: Paths,
        arriving: Callable[..., VertexLight],
        scene: mi.Scene,
        sensor: mi.Sensor,
    ) -> None:
        super().__init__(integrator, scene, sensor)
        self._paths, self._arriving = paths, arriving
        self._order = mi.UInt32(sobol_cells(_BITS))

    def samples(self, launch: Launch) -> tuple[Any, ...]:
        """What each brings, nothing for the variate and for alpha, and its place in pixels."""
        L, place = self.replayed(self._samples, launch)
        return L, mi.Spectrum(0), mi.Bool(False), place

    def _state(self, *_: Any) -> Any:
        return super()._state(), self._order

    @dr.syntax
    def _samples(
        self, scene: mi.Scene, sensor: mi.Sensor, width: mi.UInt32, extent: mi.Vector2f, launch: Launch
    ) -> tuple[mi.Spectrum, mi.Point2f]:
        light, others, sight = self.seen
        ways, ctx = sight.ways, mi.BSDFContext()
        assert ways is not None
        most, roulette = self._paths.limits()
        index, seed = self._points(launch, ways.pixels)
        samples = FreshLight(light, seed) if launch.shared is None else SharedLight(launch.shared)
        arriving = self._arriving(scene, scene, others, light, samples, ways)

        # ---------------------------- From the map to a thing ---------------------------
        si = dr.zeros(mi.SurfaceInteraction3f)
        where = van_der_corput(shuffle(index, mix(seed + 1)), mix(seed + 2))
        ω, luminance, β, _inverse = samples.draw(where >> (32 - light.tables.depth), where, si, mi.Bool(True))
        area = ways.area(ω)
        β = β * area
        ray = ways.ray(ω, sobol_2d(index, mix(seed + 3)))
        ray.time = sensor.shutter_open()

        kept, place = Survivor(), mi.Point2f(0)
        met = mi.UInt32(0)
        q, rest = mi.Float(0), mi.Float(0)  # q / κ, and M p̃ + p_b at x_n
        going = mi.Bool(True)
        while going:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
            bsdf, first = si.bsdf(), met == 0
            cos_in = dr.abs(dr.dot(si.n, ray.d))
            going &= si.is_valid() & (cos_in > 0) & (~first | ways.targeted(si.shape, going))
            points = PixelPoints(index, mix(seed + met * 0x9E3779B9))

            # --------------------------- To the camera ----------------------------
            seen = going & ~first & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            aperture = points.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
            ds, W = sensor.sample_direction(si, aperture, seen)
            seen &= dr.any(W != 0)
            f, p_1 = bsdf.eval_pdf(ctx, turned(si, si.to_local(ds.d)), si.wi, seen)
            of_light = q * ways.first(si, -ray.d, p_1)
            weight = dr.select(seen & (of_light > 0), of_light / (of_light + rest), 0)
            g = β * f * W * (weight * dr.abs(dr.dot(si.n, ds.d)) / cos_in)
            seen &= dr.any(g != 0)
            seen &= ~scene.ray_test(si.spawn_ray_to(ds.p), seen)
            taken = kept.offer(ds.d, dr.select(seen, g, 0), mix(points.next_seed() ^ index))
            place = dr.select(taken, ds.uv, place)

            # ----------------------------- The way on -----------------------------
            u, v = points.next_1d(), points.next_2d()
            u = dr.select(first, sobol(index, 2, mix(seed + 4)), u)
            v = dr.select(first, mi.Point2f(sobol(index, 3, mix(seed + 5)), sobol(index, 4, mix(seed + 6))), v)
            bs, _weight = bsdf.sample(ctx, si, u, v, going)
            going &= (bs.pdf > 0) & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            back = turned(si, bs.wo)
            f, pdf = bsdf.eval_pdf(ctx, back, si.wi, going)
            going &= (pdf > 0) & dr.any(f != 0)
            scattered = f * (dr.abs(dr.dot(si.n, si.to_world(bs.wo))) / (cos_in * bs.pdf))
            β = dr.select(going, β * scattered, 0)
            c = ways.ratio(back, si.wi, pdf, bs.pdf)
            p_map = arriving.density(luminance, arriving.proposals(si.shape, bsdf, going))
            rest = dr.select(first, p_map + pdf, rest)
            q = dr.select(first, arriving.density(luminance, mi.UInt32(1)) / area * pdf * c, q * c)
            met += 1
            going &= met < most

            # ---------------------------- Russian roulette ----------------------------
            survival = dr.minimum(dr.max(scattered), ENOUGH)
            ends = met >= roulette
            going &= ~ends | (points.next_1d() < survival)
            β = dr.select(ends, β / survival, β)
            ray = si.spawn_ray(si.to_world(bs.wo))
        return kept.g, place

    def _points(self, launch: Launch, pixels: mi.UInt32) -> tuple[mi.UInt32, mi.UInt32]:
        """The number of each light path in one sequence of the whole picture, and a seed, which is another one where
        the numbers begin again."""
        cells = 1 << 2 * _BITS
        turn = ((1 << 32) - cells) // pixels
        turns = launch.index // turn
        index = (launch.index - turns * turn) * pixels + launch.pixel
        index = (index & ~mi.UInt32(cells - 1)) | dr.gather(mi.UInt32, self._order, index & (cells - 1))
        return index, mix(mix(launch.seed ^ _SEED) + turns)


class LightView(View):
    """A film on which samples of its pixels, all with as many, land anywhere."""

    def __init__(self, launcher: Launcher, most: int = 1 << 40) -> None:
        super().__init__(launcher, None, most)
        self._reach = reach_of(self.film)
        if self._reach:
            self._weights = self._gathered(self.height)[:, None] * self._gathered(self.width)

    def lanes(self, first: Range, number: Range) -> tuple[mi.UInt32, mi.UInt32, Group]:
        """As for any film, but that one sample of all pixels follows another."""
        pixels = [np.flatnonzero(number > k) for k in range(int(number.max()))]
        index = np.concatenate([first[those] + k for k, those in enumerate(pixels)])
        return mi.UInt32(np.concatenate(pixels).astype(np.uint32)), unsigned(index), None

    def put(
        self, lanes: Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float, most: int
    ) -> NDArray[np.float64]:
        """As for any film, but that a pixel's weight is that of its own samples, wherever these are."""
        width = dr.opaque(mi.UInt32, self.width)
        pixel = dr.minimum(mi.UInt32(lanes.place.y) * width + mi.UInt32(lanes.place.x), self.pixels - 1)
        found = super().put(replace(lanes, pixel=pixel), value, alpha, weight, most * self.pixels)
        if self._reach:
            found[..., :-1] /= self._weights[..., None]
        own = np.bincount(lanes.pixel.numpy(), weight.numpy(), self.pixels)
        found[..., -1] = own.reshape(self.height, self.width)
        return found

    def _gathered(self, size: int) -> NDArray[np.float64]:
        """∫ of the filter around each pixel of a side of the film, as far as that goes."""
        offsets = (np.arange((2 * self._reach + 1) * _FINE) + 0.5) / _FINE - self._reach - 0.5
        shares = np.asarray(self.film.rfilter().eval(mi.Float(offsets)), dtype=np.float64) / _FINE
        until = np.concatenate([[0.0], np.cumsum(shares)])
        middle = np.arange(size) + 0.5
        first, last = (np.searchsorted(offsets, edge - middle) for edge in (0, size))
        found: NDArray[np.float64] = until[last] - until[first]
        return found
