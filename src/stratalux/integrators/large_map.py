"""Large environment maps: an emitter like Mitsuba's ``envmap``, without tables of its own until they are asked for.

Mitsuba's takes 16 bytes for each texel, half floats or not, and for a moment five times that for tables that our
techniques have no use for. This one keeps the array that it is given, half floats as such.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..maps.coarse import coarse_density
from ..maps.envmap import EnvironmentMap

LARGE = 1 << 24
"""Texels of a map from which on it is one."""
FAR = 1e15
"""How far away it is: no scene is so large, and squares of it are no overflow."""
_NAME = "large_envmap"
_theirs = ContextVar("_theirs", default=False)


def is_large(environment: EnvironmentMap) -> bool:
    """Whether the map is better off with this emitter, in the variant that is active."""
    return environment.height * environment.width >= LARGE and there()


@contextmanager
def as_mitsuba_has_them(wanted: bool) -> Iterator[None]:
    """Where that is ``wanted``, maps have Mitsuba's own emitter, however large they are: with its integrators there is
    less noise."""
    before = _theirs.set(wanted)
    try:
        yield
    finally:
        _theirs.reset(before)


def there() -> bool:
    """Whether this emitter is wanted, and the variant that is active has it: those of RGB, on processors."""
    return not _theirs.get() and bool(
        mi.is_rgb and not mi.is_polarized and dr.backend_v(mi.Float) == dr.JitBackend.LLVM
    )


def large_envmap(texels: NDArray[np.float32 | np.float16], memory: Memory | None = None) -> dict[str, Any]:
    """The emitter of a map (H, W, 3), float16 or float32, as a dictionary; no copy of what is in the ``memory``."""
    mi.register_emitter(_NAME, _kind(mi.variant()))
    return {"type": _NAME, **_stored(texels, memory or Memory())}


class Memory:
    """Where maps are read to that this emitter is to have: memory of Dr.Jit's.

    Arrays of NumPy's would be taken as they are, too, but what :func:`drjit.freeze` records of an emitter in Python
    goes on to read them when they have been replaced by others (Dr.Jit 1.5.0).
    """

    def __init__(self) -> None:
        self._arrays: dict[int, Any] = {}

    def allocate(self, shape: tuple[int, ...], kind: Any) -> NDArray[Any]:
        """An array of that shape and type, float16 or float32, with any content."""
        size = int(np.prod(shape))
        half = np.dtype(kind) == np.float16
        array = dr.empty(mi.UInt32, (size + 1) // 2) if half else dr.empty(mi.Float, size)
        view = array.numpy()
        self._arrays[view.ctypes.data] = array
        return (view.view(np.float16)[:size] if half else view).reshape(shape)

    def array(self, texels: NDArray[Any]) -> Any:
        """Dr.Jit's array of what this has allocated, words of two half floats or float32; a copy of anything else."""
        found = self._arrays.get(texels.ctypes.data)
        if found is None or not texels.flags.c_contiguous or 4 * dr.width(found) < texels.nbytes:
            copy = self.allocate(texels.shape, texels.dtype)
            copy[:] = texels
            found = self._arrays[copy.ctypes.data]
        return found


def _stored(texels: NDArray[Any], memory: Memory) -> dict[str, Any]:
    """The properties that hold an array."""
    array = memory.array(texels)
    if texels.dtype == np.float16:
        return {"words": mi.TensorXu(array), "data": _halves(array, texels.shape)}
    return {"data": mi.TensorXf(array, texels.shape)}


def _halves(words: mi.UInt32, shape: tuple[int, ...]) -> Any:
    """The half floats in an array of words, which is not copied."""
    return mi.TensorXf16(words.numpy().view(np.float16)[: int(np.prod(shape))].reshape(shape))


@cache
def _kind(variant: str) -> Any:
    """The class for a variant, whose own emitter it derives from."""

    class LargeEnvironmentMap(mi.Emitter):
        """``data`` (H, W, 3), float16 or float32, as Mitsuba's ``envmap`` has it but for its columns of neighbours.

        ``to_world`` and ``scale`` are those of ``envmap``. Half floats are read as ``words`` of two in the same memory,
        which is twice as fast (Dr.Jit 1.5.0). Float32 has derivatives. Directions are sampled by
        :func:`.maps.coarse.coarse_density`, whose table is made when somebody asks for it.
        """

        large = True

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.SpatiallyVarying
            data = props["data"]
            half = dr.type_v(data) == dr.VarType.Float16
            self.single = None if half else data
            self.words = props["words"].array if half else None
            self.half = _hidden(data) if half else None
            self.scale = mi.Float(props.get("scale", 1.0))
            self.turn = mi.AffineTransform4f(props.get("to_world", mi.ScalarAffineTransform4f()).matrix)
            dr.make_opaque(self.scale, self.turn)
            self._look()

        @property
        def data(self) -> Any:
            """The texels (H, W, 3)."""
            return self.single if self.half is None else self.half()

        def _look(self) -> None:
            """At ``data``, which is another."""
            shape = self.data.shape
            if len(shape) != 3 or shape[2] != 3 or min(shape[:2]) < 2:
                raise InputError(f"environment map: shape {tuple(shape)} is none; give (height, width, 3)")
            self.height, self.width = dr.opaque(mi.UInt32, shape[0]), dr.opaque(mi.UInt32, shape[1])
            self.warp: Any = None

        # ------------------------------- Mitsuba's interface -------------------------------

        def traverse(self, callback: mi.TraversalCallback) -> None:
            super().traverse(callback)
            learns = mi.ParamFlags.Differentiable if self.half is None else mi.ParamFlags.NonDifferentiable
            callback.put("data", self.data, learns)
            callback.put("scale", self.scale, mi.ParamFlags.Differentiable)
            callback.put("to_world", self.turn, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys: list[str]) -> None:
            super().parameters_changed(keys)
            if not keys or "data" in keys:
                data = self.data
                changed = _stored(dr.detach(data).numpy(), Memory())
                if self.half is not None:
                    self.words, self.half = changed["words"].array, _hidden(changed["data"])
                elif not dr.grad_enabled(data):
                    self.single = changed["data"]
                self._look()

        def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
            return self._radiance(_uv(self.turn.inverse() @ -si.wi), active)

        def eval_direction(self, it: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool = True) -> mi.Spectrum:
            return self._radiance(ds.uv, active)

        def sample_direction(
            self, it: mi.Interaction3f, sample: mi.Point2f, active: mi.Bool = True
        ) -> tuple[mi.DirectionSample3f, mi.Spectrum]:
            place, density = self._warp().sample(sample, active=active)
            uv = mi.Point2f(place)
            sin_θ, cos_θ = dr.sincos(dr.pi * uv.y)
            sin_φ, cos_φ = dr.sincos(dr.two_pi * uv.x)
            ds = dr.zeros(mi.DirectionSample3f)
            ds.uv, ds.time, ds.delta, ds.emitter = uv, it.time, mi.Bool(False), mi.EmitterPtr(self)
            ds.d = dr.normalize(self.turn @ mi.Vector3f(sin_φ * sin_θ, cos_θ, -cos_φ * sin_θ))
            ds.dist, ds.p, ds.n = mi.Float(FAR), dr.fma(ds.d, FAR, it.p), -ds.d
            ds.pdf = dr.select(active, _per_steradian(density, sin_θ), 0)
            weight = dr.select(ds.pdf > 0, self._radiance(uv, active) / ds.pdf, 0)
            return ds, weight

        def pdf_direction(self, it: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool = True) -> mi.Float:
            d = self.turn.inverse() @ ds.d
            density = self._warp().eval(_uv(d), active=active)
            return dr.select(active, _per_steradian(density, dr.sqrt(dr.fma(d.x, d.x, d.z * d.z))), 0)

        def sample_wavelengths(
            self, si: mi.SurfaceInteraction3f, sample: mi.Float, active: mi.Bool = True
        ) -> tuple[Any, mi.Spectrum]:
            return mi.Color0f(), self.eval(si, active)

        def sample_position(self, *_: Any) -> Any:
            raise InputError(f"environment map '{self.id()}': has no positions to be sampled")

        def sample_ray(self, *_: Any) -> Any:
            raise InputError(
                f"environment map '{self.id()}': so large a one emits no rays into a scene; render from the camera, "
                "or make it smaller"
            )

        def bbox(self) -> mi.ScalarBoundingBox3f:
            return mi.ScalarBoundingBox3f()  # like every environment, it has none

        def to_string(self) -> str:
            return f"LargeEnvironmentMap[size = {self.data.shape[1]}x{self.data.shape[0]}]"

        # ------------------------------------- Look-up -------------------------------------

        def _radiance(self, uv: mi.Point2f, active: mi.Bool | bool) -> mi.Spectrum:
            """Bilinear between the four texels around ``uv``."""
            x = dr.fma(uv.x - dr.floor(uv.x), mi.Float(self.width), -0.5)
            x = dr.select(x < 0, x + mi.Float(self.width), x)
            y = dr.clip(uv.y, 0, 1) * mi.Float(self.height - 1)
            column, row = dr.minimum(mi.UInt32(x), self.width - 1), dr.minimum(mi.UInt32(y), self.height - 2)
            s, t = x - mi.Float(column), y - mi.Float(row)
            beside = dr.select(column + 1 == self.width, 0, column + 1)
            upper = row * self.width
            lower = upper + self.width
            a, b, c, d = (
                self._texel(at, active) for at in (upper + column, upper + beside, lower + column, lower + beside)
            )
            return dr.lerp(dr.lerp(a, b, s), dr.lerp(c, d, s), t) * self.scale

        def _texel(self, index: mi.UInt32, active: mi.Bool | bool) -> mi.Color3f:
            if self.words is None:
                return dr.gather(mi.Color3f, self.data.array, index, active)
            # Red, green and blue of every other texel begin in the middle of a word.
            at, odd = (3 * index) >> 1, (index & 1) != 0
            first, second = (dr.gather(mi.UInt32, self.words, at + k, active) for k in (0, 1))
            r = dr.select(odd, first >> 16, first)
            g = dr.select(odd, second, first >> 16)
            b = dr.select(odd, second >> 16, second)
            return mi.Color3f(*(_number(bits & 0x7FFF) for bits in (r, g, b)))

        def _warp(self) -> Any:
            """Samples directions by a coarse density. Made of what NumPy has, as this may be while a loop is traced."""
            if self.warp is None:
                self.warp = mi.Hierarchical2D0(coarse_density(dr.detach(self.data).numpy()))
            return self.warp

    return LargeEnvironmentMap


def _hidden(data: Any) -> Callable[[], Any]:
    """What :func:`drjit.freeze` does not find: it takes arrays for one that have one memory."""
    return lambda: data


def _number(bits: mi.UInt32) -> mi.Float:
    """The half float with these ``bits``, not negative; without numbers that are so small that processors skip them."""
    moved = bits << 13
    usual = dr.reinterpret_array(mi.Float, moved + (112 << 23))
    tiny = dr.reinterpret_array(mi.Float, moved + (113 << 23)) - 2.0**-14
    return dr.select(bits < 0x400, tiny, usual)


def _uv(d: mi.Vector3f) -> mi.Point2f:
    """Map coordinates of a unit direction in the map's frame, see :mod:`.maps.geometry`."""
    u = dr.atan2(d.x, -d.z) * dr.inv_two_pi
    return mi.Point2f(u - dr.floor(u), dr.safe_acos(d.y) * dr.inv_pi)


def _per_steradian(density: mi.Float, sin_θ: mi.Float) -> mi.Float:
    """A density over the unit square as one over directions: dω = 2π² sin θ du dv, equation (2)."""
    return density / (2 * dr.pi**2 * dr.maximum(sin_θ, dr.epsilon(mi.Float)))
