"""The environment emitter of a Mitsuba scene, and the tables that a technique builds from it.

An integrator asks its :class:`MapCache` at every render. The tables are rebuilt only when the map itself has changed: a
density is free of scale, and the emitter's transform and scale are read when a ray is traced.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import EnvironmentMapWarning, InputError
from ..images.repair import repair
from ..maps.envmap import EnvironmentMap
from ..sampling.recording import one_at_a_time
from . import derivatives

T = TypeVar("T", covariant=True)


class MapLight(Generic[T]):
    """The image-based environment of a scene, and what a technique has built from its texels.

    ``emitter``: the ``envmap``. ``tables``: what was built. ``to_world``: rotation from the frame of the map.
    ``scale``: of its radiance; both are constants where the picture is differentiated. ``differentiated``: whether it
    is, now. (No dataclass: Dr.Jit would take it apart and make it the state of a loop.)
    """

    def __init__(
        self, emitter: mi.Emitter, tables: T, to_world: Any, scale: mi.Float, differentiated: bool = False
    ) -> None:
        self.emitter, self.tables, self.to_world, self.scale = emitter, tables, to_world, scale
        self.differentiated = differentiated

    def radiance(self, si: mi.SurfaceInteraction3f, uv: mi.Point2f, d: mi.Vector3f, active: mi.Bool) -> mi.Spectrum:
        """Radiance L at the map coordinates ``uv``, which are those of the direction ``d`` of the world.

        The emitter's own lookup, without a detour over the direction; but not where that may have to be differentiated.
        """
        if self.differentiated:
            return self.radiance_towards(d, si, active)
        ds = dr.zeros(mi.DirectionSample3f)
        ds.uv = uv
        return looked_up(lambda lanes: self.emitter.eval_direction(si, ds, lanes), active)

    def radiance_towards(self, d: mi.Vector3f, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Spectrum:
        """Radiance L that arrives from the direction ``d`` of the world."""
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.wi = -d
        it.wavelengths = si.wavelengths
        return looked_up(lambda lanes: self.emitter.eval(it, lanes), active)

    def arrays(self) -> tuple[Any, ...]:
        """What kernels read, but for the tables."""
        return self.emitter, self.to_world, self.scale

    def from_world(self, d: mi.Vector3f) -> mi.Vector3f:
        """A direction of the world in the frame of the map."""
        return self.to_world.inverse() @ d


def looked_up(lookup: Callable[[mi.Bool], mi.Spectrum], active: mi.Bool | bool) -> mi.Spectrum:
    """What an emitter or a texture itself, not a pointer to one, tells of the lanes that are ``active``, else 0.

    On a GPU it tells all lanes, as its textures clamp what they are asked for: with a mask, they would abort what
    :func:`drjit.freeze` records (Dr.Jit 1.5.0).
    """
    if dr.backend_v(mi.Float) == dr.JitBackend.CUDA:
        return dr.select(active, lookup(mi.Bool(True)), 0)
    return lookup(mi.Bool(active))


def image_emitter(scene: mi.Scene) -> mi.Emitter | None:
    """The scene's ``envmap``, or ours for large maps (:mod:`.large_map`); None if there is none (``constant`` and sky
    models are sampled by Mitsuba itself)."""
    emitter = scene.environment()
    known = emitter is not None and (emitter.class_name() == "EnvironmentMapEmitter" or hasattr(emitter, "large"))
    return emitter if known else None


def stored_texels(emitter: mi.Emitter) -> NDArray[Any]:
    """The texels (H, W, C) of an :func:`image_emitter` as it has them, float32 or float16; of an array on the host,
    without a copy. In spectral variants, they are coefficients."""
    stored: NDArray[Any] = dr.detach(mi.traverse(emitter)["data"]).numpy()
    return stored if hasattr(emitter, "large") else stored[:, 1:-1]  # without the halo columns


class MapCache(Generic[T]):
    """What was built from the last map seen, kept while that map stays the same."""

    def __init__(self, build: Callable[[EnvironmentMap], T]) -> None:
        self._build = build
        self._key: tuple[Any, ...] | None = None
        self._held: Any = None
        self._tables: T | None = None
        self._upright: Any = None

    @one_at_a_time
    def get(self, scene: mi.Scene) -> MapLight[T] | None:
        """The map of ``scene`` with its tables, or None if it has none.

        A scale in ``to_world`` means nothing and is taken out of the scene, with an :class:`EnvironmentMapWarning`.
        Raises :class:`InputError` if ``to_world`` shears or scales unevenly.
        """
        emitter = image_emitter(scene)
        if emitter is None:
            return None
        params = mi.traverse(emitter)
        if self._upright is None or _indices(params["to_world"]) != _indices(self._upright):
            _take_scale_out(emitter, params)
            # A reference of our own, as for the map
            self._upright = type(params["to_world"])(dr.detach(params["to_world"]).matrix)
        to_world, scale = dr.detach(params["to_world"]), dr.detach(params["scale"])
        if self._tables is None or self._key != _key(emitter, params["data"]):
            self._tables = self._build(EnvironmentMap(_rgb_texels(emitter)))
            data = mi.traverse(emitter)["data"]
            # References of our own: neither the emitter's address nor the array's index goes to another meanwhile.
            self._held = emitter, type(data.array)(data.array)
            self._key = _key(emitter, data)
        return MapLight(emitter, self._tables, to_world, scale, derivatives.wanted(scene))


def _indices(to_world: Any) -> tuple[int, ...]:
    """Equal for equal matrices: Dr.Jit gives every changed array a new index."""
    return tuple(value.index for row in dr.detach(to_world).matrix for value in row)


def _take_scale_out(emitter: mi.Emitter, params: mi.SceneParameters) -> None:
    """Leave rotations and mirrors in ``to_world``: of anything else, Mitsuba's lookup makes another picture."""
    matrix = dr.detach(params["to_world"]).matrix.numpy().reshape(4, 4).astype(np.float64)
    squares = matrix[:3, :3] @ matrix[:3, :3].T
    scale = np.sqrt(np.trace(squares) / 3)
    if not (scale > 0 and np.allclose(squares / scale**2, np.eye(3), atol=1e-3)):
        raise InputError(f"environment map '{emitter.id()}': to_world shears or scales unevenly; use rotations alone")
    if abs(scale - 1) > 1e-3:
        warnings.warn(
            f"environment map '{emitter.id()}': to_world scales by {scale:.6g}, which means nothing and is left out",
            EnvironmentMapWarning,
            stacklevel=2,
        )
        matrix[:3, :3] /= scale
        params["to_world"] = type(params["to_world"])(matrix)
        params.update()


def _key(emitter: mi.Emitter, data: mi.TensorXf) -> tuple[Any, ...]:
    """Equal for equal maps: Dr.Jit gives every changed array a new index."""
    return emitter.ptr, data.array.index, tuple(data.shape)


def _rgb_texels(emitter: mi.Emitter) -> NDArray[Any]:
    """What the density should follow, (H, W, 3), from the emitter's own storage; bad texels are repaired there too."""
    stored = stored_texels(emitter)
    if mi.is_spectral:
        # Three coefficients of the upsampling model and a scale; their mean over wavelengths plays the luminance.
        if not np.isfinite(stored).all():
            raise InputError("environment map of the scene: NaN or infinite texels; repair the file first")
        coefficients = mi.Vector3f(*(mi.Float(stored[..., c].ravel()) for c in range(3)))
        mean = mi.srgb_model_mean(coefficients).numpy().reshape(stored.shape[:2])
        stored = np.repeat((mean * np.maximum(stored[..., 3], 0))[..., None], 3, axis=2)
    else:
        repaired, said = repair(stored)
        # Not one that is being learned: whoever does that would learn of another one.
        if repaired is not stored and not mi.traverse(emitter)["data"].array.index_ad:
            warnings.warn(f"environment map of the scene: {said}", EnvironmentMapWarning, stacklevel=3)
            store(emitter, repaired)
        stored = repaired
    return stored


def store(emitter: mi.Emitter, texels: NDArray[Any]) -> None:
    """Give an :func:`image_emitter` the texels (H, W, C), of the type that it has."""
    if not hasattr(emitter, "large"):
        height, width, channels = texels.shape
        stored = np.empty((height, width + 2, channels), dtype=np.float32)
        stored[:, 1:-1], stored[:, 0], stored[:, -1] = texels, texels[:, -1], texels[:, 0]
        texels = stored
    params = mi.traverse(emitter)
    params["data"] = type(params["data"])(texels)
    params.update()
