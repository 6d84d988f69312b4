"""The environment emitter of a Mitsuba scene, and the sampling tables that belong to it.

``strata_for(scene, n)`` is what an integrator asks for at every render. The tables are rebuilt only when the map itself
has changed: a density is free of scale, and the emitter's transform and scale are read when a ray is traced.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .envmap import EnvironmentMap, clean
from .median_cut import median_cut
from .regions import Regions
from .sampling import RegionSampler


class Strata:
    """The stratified environment of a scene.

    ``emitter``: the ``envmap``. ``regions``: its partition, and ``sampler`` their densities. ``to_world``: rotation
    from the frame of the map. (No dataclass: Dr.Jit would take it apart and make it the state of a loop.)
    """

    def __init__(self, emitter: mi.Emitter, regions: Regions, sampler: RegionSampler, to_world: Any) -> None:
        self.emitter, self.regions, self.sampler, self.to_world = emitter, regions, sampler, to_world

    def radiance(self, si: mi.SurfaceInteraction3f, uv: mi.Point2f, active: mi.Bool) -> mi.Spectrum:
        """Radiance L at the map coordinates ``uv``: the emitter's own lookup, without a detour over the direction."""
        ds = dr.zeros(mi.DirectionSample3f)
        ds.uv = uv
        return self.emitter.eval_direction(si, ds, active)


def image_emitter(scene: mi.Scene) -> mi.Emitter | None:
    """The scene's ``envmap``, or None if there is none (``constant`` and sky models are sampled by Mitsuba itself)."""
    emitter = scene.environment()
    return emitter if emitter is not None and emitter.class_name() == "EnvironmentMapEmitter" else None


class StrataCache:
    """Strata of the last scene rendered, kept while its map stays the same."""

    def __init__(self) -> None:
        self._key: tuple[Any, ...] | None = None
        self._owner: tuple[Any, ...] = ()
        self._built: tuple[Regions, RegionSampler] | None = None

    def get(self, emitter: mi.Emitter, n: int) -> Strata:
        """Strata of ``emitter`` cut into ``n`` regions.

        Raises RuntimeError if the emitter's ``to_world`` is not orthonormal: Mitsuba's lookup makes no sense of it.
        """
        params = mi.traverse(emitter)
        rotation = np.array(dr.slice(params["to_world"].matrix) if dr.width(params["to_world"].matrix) else 0)[:3, :3]
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
            raise RuntimeError(
                f"environment map '{emitter.id()}': to_world scales or shears; use rotations (and 'scale' for brightness)"
            )
        data = params["data"]
        # The array is kept referenced, so a changed map cannot come back under the old index.
        key = (emitter.ptr, data.array.index, tuple(data.shape), n)
        if key != self._key:
            texels = _rgb_texels(params)
            regions = median_cut(EnvironmentMap(texels), n)
            self._built = regions, RegionSampler(EnvironmentMap(texels), regions)
            data = mi.traverse(emitter)["data"]
            self._key, self._owner = (emitter.ptr, data.array.index, tuple(data.shape), n), (emitter, data.array)
        assert self._built is not None
        return Strata(emitter, *self._built, params["to_world"])


def _rgb_texels(params: mi.SceneParameters) -> np.ndarray:
    """What the density should follow, (H, W, 3), from the emitter's own storage; bad texels are repaired there too."""
    stored = params["data"].numpy().astype(np.float32)
    repaired = stored
    if not mi.is_spectral:
        repaired = clean(stored, "environment map of the scene")
    elif not np.isfinite(stored).all():
        raise RuntimeError("environment map of the scene: NaN or infinite texels; repair the file first")
    if repaired is not stored:
        params["data"] = mi.TensorXf(repaired)
        params.update()
    texels = repaired[:, 1:-1]  # without the halo columns
    if mi.is_spectral:
        # Three coefficients of the upsampling model and a scale; their mean over wavelengths plays the luminance.
        height, width, _ = texels.shape
        coefficients = mi.Vector3f(*(mi.Float(texels[..., c].ravel()) for c in range(3)))
        mean = mi.srgb_model_mean(coefficients).numpy().reshape(height, width)
        texels = np.repeat((mean * np.maximum(texels[..., 3], 0))[..., None], 3, axis=2)
    return np.ascontiguousarray(texels)
