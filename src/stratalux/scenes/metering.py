"""How much light falls onto an object, as a light meter in its place would tell."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

_PLACES = 2048
"""Of the object, at most."""
_SAMPLES = 1 << 15
"""Of the light, for all of them."""


def incident_light(scene: mi.Scene, camera: mi.Sensor, mask: NDArray[np.bool_]) -> float:
    """The mean luminance that what the pixels of a ``mask`` (H, W) show would have if it were white and matte.

    Of direct light alone, and what is in its way casts a shadow, glass too: it is rather too little, and 0 where none
    is found. It is the same each time.
    """
    seen = np.flatnonzero(mask)
    chosen = np.linspace(0, len(seen) - 1, min(_PLACES, len(seen))).astype(np.int64)
    if len(chosen) == 0:
        return 0.0
    rows, columns = np.divmod(seen[chosen], mask.shape[1])
    place = (np.stack([columns, rows]) + 0.5) / np.array(mask.shape[::-1])[:, None]
    position = mi.Point2f(*np.repeat(place, _SAMPLES // len(chosen), axis=1).astype(np.float32))
    ray, share = camera.sample_ray(0, 0.5, position, mi.Point2f(0.5))
    si = scene.ray_intersect(ray)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, dr.width(position))
    ds, weight = scene.sample_emitter_direction(si, sampler.next_2d(), True, si.is_valid())
    cos = dr.dot(ds.d, si.sh_frame.n) * dr.sign(mi.Frame3f.cos_theta(si.wi))
    lit = si.is_valid() & (ds.pdf > 0) & (cos > 0)
    light = mi.unpolarized_spectrum(share * weight) * cos / dr.pi
    found = dr.select(lit, _luminance(light, si.wavelengths), 0).numpy()
    return float(np.mean(found[np.isfinite(found)], dtype=np.float64)) if np.isfinite(found).any() else 0.0


def _luminance(light: mi.UnpolarizedSpectrum, wavelengths: mi.Wavelength) -> mi.Float:
    if mi.is_monochromatic:
        return light[0]
    return mi.spectrum_to_xyz(light, wavelengths).y if mi.is_spectral else mi.luminance(light)
