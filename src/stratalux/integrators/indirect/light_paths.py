"""Light paths: from the map to things, and on to what the camera sees (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.points import mix, shuffle, sobol, sobol_2d, van_der_corput
from ..automatic.launch import Estimator, Launch, Launcher
from ..automatic.nested_strata import PixelPoints, Survivor
from ..automatic.view import Lanes, View
from ..both_ways import turned
from ..light_samples import FreshLight, SharedLight
from ..sums import reach_of
from .paths import ENOUGH, Paths
from .vertex import VertexLight

_SEED = 0x510E527F
"""Distinguishes the points of light paths from all others."""


_FINE = 256
"""Points of a pixel's side at which a filter is looked at."""


class LightLauncher(Launcher):
    """Takes light paths, one in the place of each camera sample, which bring their light to wherever they meet.

    Of all surfaces that a path meets, one stands for all, as a :class:`~..automatic.nested_strata.Survivor`: the first
    one aside, as direct light has no need of this. ``light``: what arrives at vertices of paths from the camera.
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
        self._pi = mi.UInt32(_coherent())
        dr.make_opaque(self._pi)

    def samples(self, launch: Launch) -> tuple[Any, ...]:
        """What each brings, nothing for the variate and for alpha, and its place in pixels."""
        L, place = self.replayed(self._samples, launch)
        return L, mi.Spectrum(0), mi.Bool(False), place

    def _state(self, *_: Any) -> Any:
        return super()._state(), self._pi

    @dr.syntax
    def _samples(
        self, scene: mi.Scene, sensor: mi.Sensor, width: mi.UInt32, extent: mi.Vector2f, launch: Launch
    ) -> tuple[mi.Spectrum, mi.Point2f]:
        light, others, sight = self.seen
        ways, ctx = sight.ways, mi.BSDFContext()
        assert ways is not None
        most = dr.opaque(mi.UInt32, self._paths.max_depth - 1 if self._paths.max_depth > 0 else 0xFFFFFFFF)
        roulette = dr.opaque(mi.UInt32, self._paths.rr_depth)

        # All paths of the picture have one sequence, of as many points as there are numbers, and then another one.
        turn = 0xFFFFFFFF // ways.pixels
        turns = launch.index // turn
        index = (launch.index - turns * turn) * ways.pixels + launch.pixel
        import os

        if not os.environ.get("NOPI"):
            index = (index & 0xFFFFF000) | dr.gather(mi.UInt32, self._pi, index & 0xFFF)
        seed = mix(mix(launch.seed ^ _SEED) + turns)
        samples = FreshLight(light, seed) if launch.shared is None else SharedLight(launch.shared)
        arriving = self._arriving(scene, scene, others, light, samples, ways)

        # ---------------------------- From the map to a thing ---------------------------
        si = dr.zeros(mi.SurfaceInteraction3f)
        where = van_der_corput(shuffle(index, mix(seed + 1)), mix(seed + 2))
        ω, luminance, β, _inverse = samples.draw(where >> (32 - light.tables.depth), where, si, mi.Bool(True))
        ray, area = ways.ray(ω, sobol_2d(index, mix(seed + 3))), ways.area(ω)
        β = β * area

        kept, place = Survivor(), mi.Point2f(0)
        met = mi.UInt32(0)
        q, rest = mi.Float(0), mi.Float(0)  # p̃ p_b Π c, and M p̃ + p_b, of the last surface
        going = mi.Bool(True)
        while going:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
            going &= si.is_valid()
            bsdf = si.bsdf()
            cos_in = dr.abs(dr.dot(si.n, ray.d))
            going &= (cos_in > 0) & ((met > 0) | ways.targeted(si.shape, going))
            points = PixelPoints(index, mix(seed + met * 0x9E3779B9))

            # --------------------------- To the camera ----------------------------
            seen = going & (met > 0) & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            aperture = points.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
            ds, W = sensor.sample_direction(si, aperture, seen)
            seen &= dr.any(W != 0)
            back = turned(si, si.to_local(ds.d))
            f, p_1 = bsdf.eval_pdf(ctx, back, si.wi, seen)
            found = q * ways.first(si, -ray.d, p_1)
            weight = dr.select(seen & (found > 0), found / (found + rest), 0)
            g = β * f * W * (weight * dr.abs(dr.dot(si.n, ds.d)) / cos_in)
            seen &= dr.any(g != 0)
            seen &= ~scene.ray_test(si.spawn_ray_to(ds.p), seen)
            taken = kept.offer(ds.d, dr.select(seen, g, 0), mix(points.next_seed() ^ index))
            place = dr.select(taken, ds.uv, place)

            # ----------------------------- The way on -----------------------------
            first = met == 0
            u, v = points.next_1d(), points.next_2d()
            u = dr.select(first, sobol(index, 2, mix(seed + 4)), u)
            v = dr.select(first, mi.Point2f(sobol(index, 3, mix(seed + 5)), sobol(index, 4, mix(seed + 6))), v)
            bs, _weight = bsdf.sample(ctx, si, u, v, going)
            going &= (bs.pdf > 0) & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            back = turned(si, bs.wo)
            f, pdf = bsdf.eval_pdf(ctx, back, si.wi, going)
            going &= (pdf > 0) & dr.any(f != 0)
            cos_out = dr.abs(dr.dot(si.n, si.to_world(bs.wo)))
            β *= dr.select(going, f * (cos_out / (cos_in * bs.pdf)), 0)
            c = ways.ratio(back, si.wi, pdf, bs.pdf)
            M = arriving.proposals(si.shape, bsdf, going)
            p_map = arriving.density(luminance, M)
            rest = dr.select(first, p_map + pdf, rest)
            q = dr.select(first, arriving.density(luminance, mi.UInt32(1)) / area * pdf * c, q * c)
            met += 1
            going &= met < most
            survival = dr.minimum(dr.max(f) * cos_out / (cos_in * bs.pdf), ENOUGH)
            ends = met >= roulette
            going &= ~ends | (points.next_1d() < survival)
            β = dr.select(ends, β / survival, β)
            ray = si.spawn_ray(si.to_world(bs.wo))
        return kept.g, place


def _coherent():
    i = np.arange(4096, dtype=np.uint32)

    def brev(v):
        v = v.astype(np.uint64)
        r = np.zeros_like(v)
        for k in range(32):
            r |= ((v >> np.uint64(k)) & np.uint64(1)) << np.uint64(31 - k)
        return r

    x = brev(i)
    y = brev(i).astype(np.uint64)
    for shift, bits in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        y = y ^ ((y & np.uint64(bits)) << np.uint64(shift))
    y = y & np.uint64(0xFFFFFFFF)
    X, Y = (x >> np.uint64(26)).astype(int), (y >> np.uint64(26)).astype(int)
    assert len(set(zip(X, Y))) == 4096
    morton = np.zeros(4096, int)
    for k in range(6):
        morton |= ((X >> k) & 1) << (2 * k) | ((Y >> k) & 1) << (2 * k + 1)
    return np.argsort(morton).astype(np.uint32)


class LightView(View):
    """A film on which samples of its pixels, all with as many, land anywhere."""

    def __init__(self, launcher: Launcher, most: int = 1 << 40) -> None:
        super().__init__(launcher, None, most)
        if reach_of(self.film):
            down, across = (self._gathered(size) for size in (self.height, self.width))
            self._filtered = down[:, None] * across

    def _gathered(self, size: int) -> NDArray[np.float64]:
        """∫ of the filter around each pixel along a side of the film, as far as that goes."""
        filter = self.film.rfilter()
        inside = (np.arange(size * _FINE) + 0.5) / _FINE
        reach = reach_of(self.film)
        offset = (np.arange((2 * reach + 1) * _FINE) + 0.5) / _FINE - reach - 0.5
        values = np.array(filter.eval(mi.Float(offset)), dtype=np.float64)
        del inside
        total = np.zeros(size)
        for k, value in zip(offset, values, strict=True):
            x = np.arange(size) + 0.5 + k
            total += value / _FINE * ((x >= 0) & (x < size))
        return total

    def lanes(self, first, number):
        import os

        if os.environ.get("NOPI"):
            return super().lanes(first, number)
        pixels = [np.flatnonzero(number > k) for k in range(int(number.max()))]
        index = np.concatenate([first[p] + k for k, p in enumerate(pixels)]).astype(np.uint32)
        return mi.UInt32(np.concatenate(pixels).astype(np.uint32)), mi.UInt32(index), None

    def put(
        self, lanes: Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float, most: int
    ) -> NDArray[np.float64]:
        """As for any film, but that a pixel's weight is that of its own samples, wherever these are."""
        width = mi.UInt32(dr.opaque(mi.UInt32, self.width))
        pixel = mi.UInt32(lanes.place.y) * width + mi.UInt32(lanes.place.x)
        pixel = dr.minimum(pixel, self.pixels - 1)
        found = super().put(replace(lanes, pixel=pixel), value, alpha, weight, most * self.pixels)
        own = np.bincount(lanes.pixel.numpy(), weight.numpy(), self.pixels).reshape(self.height, self.width)
        if reach_of(self.film):
            found[..., :-1] /= self._filtered[..., None]
        found[..., -1] = own
        return found
