"""Paths of neighbouring pixels that share what they find, where most of them find something (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..automatic.launch import Estimator, Launch, camera_samples
from ..identities import by_identity, told
from ..kinds import made_of
from .launch import PathLauncher
from .paths import Paths, Way
from .tiles import TILE

ENCLOSED = 0.6
"""Share of the paths that meet a second surface that can be shared, from which on they are: in open scenes, counts of
paths that follow the errors do better."""
_TESTS = 1024
_TEST_SEED = 0x2545F491
MATTE = ("SmoothDiffuse",)
"""What reflects light alike in all directions."""
_RECORD = 4
"""Vectors of four numbers that a second vertex takes: place, geometric and shading normal, light."""


class SharingLauncher(PathLauncher):
    r"""As :class:`~.launch.PathLauncher`, but that each path brings its light to the first surfaces of its whole group.

    The light L_j that leaves the second vertex y_j of sample j, if that is on a matte surface, leaves it alike in all
    directions. So sample i, whose first vertex is x_i, gets

        L ≈ Σ_j L_j F_ij / Σ_k P_kj,    F_ij = f_i cos θ_i (cos θ_j / r²) V,    P_kj = p_k (cos θ_j / r²) V,

    where f_i and p_i are the BSDF at x_i and the density that it draws the direction of y_j with: any sample could have
    found y_j, and the balance heuristic over them tells what it counts (Bekaert, Sbert and Halton 2002, "Accelerating
    Path Tracing by Re-Using Paths"). A sample on the other side of the surface at y_j could not. What is found by
    lobes without width, or on surfaces that are not matte, is not shared. Every pair takes a ray.
    """

    def __init__(self, integrator: Estimator, paths: Paths, scene: mi.Scene, sensor: mi.Sensor) -> None:
        super().__init__(integrator, paths, scene, sensor)
        self._second: Callable[..., Any] = self._second_vertices
        self._connect: Callable[..., Any] = self._connections
        self._tested: Callable[..., Any] = self._test
        self.record(self._second, self._connect, self._tested)
        shapes = scene.shapes_dr()
        matte = [int(made_of(shape.bsdf(), MATTE)) for shape in scene.shapes()]
        self._any_matte = any(matte)
        self._matte = by_identity(shapes, mi.UInt32(matte), 0) if matte else mi.UInt32(0)

    def enclosed(self) -> bool:
        """Whether it pays to share, as a few paths of their own tell. Not where anything lets light straight through:
        what paths pass has no place in the densities."""
        *_, sight = self.seen
        if sight.straight or not self._any_matte:
            return False
        size = self.sensor.film().crop_size()
        pixels = int(size[0]) * int(size[1])
        tests = min(_TESTS, pixels)
        found = self.replayed(self._tested, dr.opaque(mi.UInt32, pixels // tests), mi.UInt32(np.arange(tests))).numpy()
        return int((found > 1).sum()) > ENCLOSED * max(int((found > 0).sum()), 1)

    def samples(self, launch: Launch) -> tuple[Any, ...]:
        """As those of :class:`~.launch.PathLauncher`, with costs that are all alike where samples have groups."""
        if launch.group is None:
            return super().samples(launch)
        way, importance, place = self.replayed(self._begin, launch)
        count = dr.width(launch.pixel)
        L = dr.zeros(mi.Spectrum, count)
        lanes = dr.compress(way.alive)
        if len(lanes):
            some = way.at(lanes)
            index, pixel = dr.gather(mi.UInt32, launch.index, lanes), dr.gather(mi.UInt32, launch.pixel, lanes)
            found = dr.zeros(mi.Float, 4 * _RECORD * count)
            dr.eval(some, index, pixel, found)
            own = self.replayed(self._second, some, index, pixel, launch.seed, launch.shared, lanes, found)
            dr.scatter(L, own, lanes)
            pairs = dr.zeros(mi.Float, 4 * TILE * count)
            dr.eval(L, found, pairs)
            self.replayed(self._connect, launch, *launch.group, found, pairs)
            dr.eval(pairs)
            _weigh(*launch.group, found, pairs)
            dr.eval(found)
            L += _collected(*launch.group, found, pairs)
        return L * importance, mi.Spectrum(0), mi.Bool(False), place

    def _state(self, *_: Any) -> Any:
        return super()._state(), self._matte

    def _test(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        width: mi.UInt32,
        extent: mi.Vector2f,
        step: mi.UInt32,
        number: mi.UInt32,
    ) -> mi.UInt32:
        """1 where a camera ray meets anything, 2 where its path meets a second surface that can be shared."""
        index, seed = dr.zeros(mi.UInt32), mi.UInt32(_TEST_SEED)
        launch = Launch(number * step, index, seed, mi.Float(0), None, None, None, None)
        way, *_ = self._begin_paths(scene, sensor, width, extent, launch)
        si = scene.ray_intersect(way.ray, mi.RayFlags.Minimal, coherent=False, active=way.alive)
        return dr.select(self._shares(way, si, way.alive), 2, dr.select(way.met > 0, mi.UInt32(1), 0))

    def _shares(self, way: Way, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        return told(self._matte, si.shape, 0, active & ~way.delta) != 0

    def _second_vertices(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        width: mi.UInt32,
        extent: mi.Vector2f,
        way: Way,
        index: mi.UInt32,
        pixel: mi.UInt32,
        seed: mi.UInt32,
        shared: mi.Float | None,
        lanes: mi.UInt32,
        found: mi.Float,
    ) -> mi.Spectrum:
        """Write to ``found`` what can be shared, and return what cannot be."""
        L = self._follow_paths(scene, sensor, width, extent, way.white(), index, pixel, seed, shared)
        si = scene.ray_intersect(way.ray, mi.RayFlags.All, coherent=False)
        shares = self._shares(way, si, si.is_valid())
        n, s = (dr.mulsign(normal, -dr.dot(normal, way.ray.d)) for normal in (si.n, si.sh_frame.n))
        light_out = [*L, *[mi.Float(0)] * (4 - dr.size_v(mi.Spectrum))]
        for k, vector in enumerate(([*si.p, mi.Float(1)], [*n, mi.Float(0)], [*s, mi.Float(0)], light_out)):
            dr.scatter(found, mi.Vector4f(*vector), _RECORD * lanes + k, shares)
        return dr.select(shares, 0, way.β * L)

    @dr.syntax
    def _connections(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        width: mi.UInt32,
        extent: mi.Vector2f,
        launch: Launch,
        first: mi.UInt32,
        last: mi.UInt32,
        found: mi.Float,
        pairs: mi.Float,
    ) -> None:
        """Write F_ij and P_ij to ``pairs``, for each lane i and each lane j of its group, ``first`` to ``last``, that
        has found something."""
        _, ray, *_ = camera_samples(sensor, width, extent, launch)
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False)
        bsdf, ctx = si.bsdf(), mi.BSDFContext()
        lane = dr.arange(mi.UInt32, dr.width(launch.pixel))
        smooth = si.is_valid() & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        j = mi.UInt32(first)
        while smooth & (j < last):
            place, there, n, s = _vertex(found, j, smooth)
            d = place - si.p
            distance = dr.norm(d)
            d /= distance
            cos = -dr.dot(n, d)
            there &= (cos > 0) & (dr.dot(s, d) < 0)
            f, pdf = bsdf.eval_pdf(ctx, si, si.to_local(d), there)
            there &= pdf > 0
            V = there & ((j == lane) | ~scene.ray_test(si.spawn_ray_to(place), there & (j != lane)))
            G = cos / dr.square(distance)
            values = [*(f * G), *[mi.Float(0)] * (3 - dr.size_v(mi.Spectrum)), pdf * G]
            dr.scatter(pairs, mi.Vector4f(*values), lane * TILE + (j - first), V)
            j += 1


def _vertex(found: mi.Float, j: mi.UInt32, active: mi.Bool) -> tuple[mi.Point3f, mi.Bool, mi.Vector3f, mi.Vector3f]:
    """What lane j has found: its place, whether there is something, and both normals."""
    place, n, s = (dr.gather(mi.Vector4f, found, _RECORD * j + k, active) for k in range(3))
    return mi.Point3f(place.x, place.y, place.z), place.w > 0, mi.Vector3f(n.x, n.y, n.z), mi.Vector3f(s.x, s.y, s.z)


@dr.syntax
def _weigh(first: mi.UInt32, last: mi.UInt32, found: mi.Float, pairs: mi.Float) -> None:
    """Divide the light of each lane j that is in ``found`` by Σ_k P_kj."""
    lane = dr.arange(mi.UInt32, dr.width(first))
    total = mi.Float(0)
    k = mi.UInt32(first)
    while k < last:
        total += dr.gather(mi.Float, pairs, 4 * (k * TILE + (lane - first)) + 3)
        k += 1
    light = dr.gather(mi.Vector4f, found, _RECORD * lane + 3)
    dr.scatter(found, dr.select(total > 0, light / total, 0), _RECORD * lane + 3)


@dr.syntax
def _collected(first: mi.UInt32, last: mi.UInt32, found: mi.Float, pairs: mi.Float) -> mi.Spectrum:
    """Σ_j L_j F_ij, where what was ``found`` has been weighed."""
    lane = dr.arange(mi.UInt32, dr.width(first))
    L = mi.Vector4f(0)
    j = mi.UInt32(first)
    while j < last:
        pair = dr.gather(mi.Vector4f, pairs, lane * TILE + (j - first))
        L += dr.select(pair.w > 0, pair * dr.gather(mi.Vector4f, found, _RECORD * j + 3), 0)
        j += 1
    return mi.Spectrum(*[L[c] for c in range(dr.size_v(mi.Spectrum))])
