"""Reference images: made once by an estimator that takes no part in the comparison, with their own standard error.

A reference is rendered in passes of independent seeds. The variance between the passes gives the standard error of
their mean in every pixel, and with it the error that even a perfect image would seem to have against this reference.

References are kept in ``$STRATALUX_CACHE``, else in ``$XDG_CACHE_HOME/stratalux``, else in ``~/.cache/stratalux``, in
the folder ``references``, under a hash of all that they depend on. Deleting the folder is always safe.
"""

from __future__ import annotations

import hashlib
import json
import time
import warnings
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..caches import cache_folder
from ..errors import CacheWarning, InputError
from ..images.files import write_atomically
from ..images.metrics import RELATIVE_EPSILON, Mask
from ..rendering.identity import add_parameters, structure
from ..rendering.passes import RenderResult, render

ESTIMATORS: tuple[dict[str, Any], ...] = (
    {"type": "direct", "emitter_samples": 2, "bsdf_samples": 1},
    {"type": "path", "max_depth": 2},
    {"type": "volpath", "max_depth": 2},
)
"""Candidates, all Mitsuba's own; the first whose plugin takes no part in a comparison makes its reference."""

PASSES = 16
SEED = 0x5EED0000
"""Of the first pass; each pass is :data:`SEED_STEP` away. Comparisons use seeds below."""
SEED_STEP = 1 << 16

_FORMAT = 1
"""Raised when the meaning of a cached file changes."""


@dataclass(frozen=True)
class Reference:
    """The mean of independent passes.

    ``image``, and ``standard_error`` of each of its values (both (H, W, C), linear). ``estimator``: the integrator and
    its properties. ``spp``: samples per pixel of all ``passes`` together. ``seconds``: time it took when it was made.
    ``cached``: whether it came from the cache.
    """

    image: NDArray[np.float32]
    standard_error: NDArray[np.float32]
    estimator: dict[str, Any]
    spp: int
    passes: int
    seconds: float
    key: str
    cached: bool = False

    def mean(self, mask: Mask | None = None) -> float:
        """Mean over pixels and channels."""
        return float((self.image if mask is None else self.image[mask]).mean(dtype=np.float64))

    def relative_standard_error(self, mask: Mask | None = None) -> float:
        """Mean of s / √(R² + ε) with the ε of :func:`stratalux.images.metrics.relative_mse`."""
        return float(np.sqrt(self._relative_variance(mask)).mean())

    def relative_mse_floor(self, mask: Mask | None = None) -> float:
        """Relative MSE that an image without any error is expected to have against this reference."""
        return float(self._relative_variance(mask).mean())

    def rmse_floor(self, mask: Mask | None = None) -> float:
        """RMSE that an image without any error is expected to have against this reference."""
        error = self.standard_error if mask is None else self.standard_error[mask]
        return float(np.sqrt(np.mean(error.astype(np.float64) ** 2)))

    def _relative_variance(self, mask: Mask | None) -> NDArray[np.float64]:
        error, image = (
            (values if mask is None else values[mask]).astype(np.float64)
            for values in (self.standard_error, self.image)
        )
        return error**2 / (image**2 + RELATIVE_EPSILON)


def choose_estimator(taking_part: Collection[str]) -> dict[str, Any]:
    """The first of :data:`ESTIMATORS` whose plugin is not among those ``taking_part``; raises :class:`InputError`."""
    for estimator in ESTIMATORS:
        if estimator["type"] not in taking_part:
            return estimator
    names = ", ".join(estimator["type"] for estimator in ESTIMATORS)
    raise InputError(f"{names} all take part, so none is left to make the reference; leave one of them out")


def find_reference(
    scene: mi.Scene, estimator: dict[str, Any], spp: int, *, sensor: int = 0, cache: Path | None = None
) -> Reference | None:
    """The cached reference, or None. A damaged file counts as none, with a :class:`CacheWarning`."""
    key = reference_key(scene, estimator, spp, sensor)
    path = _path(key, cache)
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as stored:
            about = json.loads(str(stored["about"]))
            image, error = stored["image"], stored["standard_error"]
        if about["key"] != key or image.shape != error.shape or image.ndim != 3:
            raise ValueError("does not hold what its name says")
        return Reference(
            image, error, about["estimator"], about["spp"], about["passes"], about["seconds"], key, cached=True
        )
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        warnings.warn(f"{path}: damaged ({error}); the reference is made again", CacheWarning, stacklevel=2)
        return None


def make_reference(
    scene: mi.Scene,
    estimator: dict[str, Any],
    spp: int,
    *,
    sensor: int = 0,
    cache: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Reference:
    """Render a reference of ``spp`` samples per pixel, rounded up to a multiple of :data:`PASSES`, and cache it.

    ``estimator``: dictionary of an integrator, see :func:`choose_estimator`. ``cache``: folder, instead of the usual
    one. ``progress`` is told the fraction that is done. A cache that cannot be written costs a :class:`CacheWarning`.
    """
    start = time.perf_counter()

    def images() -> Iterator[NDArray[np.float64]]:
        for k, image in enumerate(render_passes_of(scene, estimator, spp, range(PASSES), sensor)):
            yield image
            if progress is not None:
                progress((k + 1) / PASSES)

    key = reference_key(scene, estimator, spp, sensor)
    return reference_of(images(), estimator, spp, lambda: time.perf_counter() - start, key, cache=cache)


def render_passes_of(
    scene: mi.Scene, estimator: dict[str, Any], spp: int, passes: Iterable[int], sensor: int = 0
) -> Iterator[NDArray[np.float64]]:
    """The images (H, W, C) of some of the :data:`PASSES` of a reference of ``spp`` samples per pixel."""
    integrator = mi.load_dict(estimator)
    for k in passes:
        seed = SEED + k * SEED_STEP
        yield pixels(render(scene, integrator=integrator, spp=-(-spp // PASSES), seed=seed, camera=sensor))


def reference_of(
    images: Iterable[NDArray[np.float64]],
    estimator: dict[str, Any],
    spp: int,
    seconds: Callable[[], float],
    key: str,
    *,
    cache: Path | None = None,
) -> Reference:
    """That of the ``images`` of all passes, and of the ``seconds`` that they have taken in the end; it is kept."""
    mean: NDArray[np.float64] = np.zeros(())
    squares = mean
    for k, image in enumerate(images):
        # Welford's update: no difference of large numbers.
        difference = image - mean
        mean = mean + difference / (k + 1)
        squares = squares + difference * (image - mean)
    reference = Reference(
        image=mean.astype(np.float32),
        standard_error=np.sqrt(squares / (PASSES - 1) / PASSES).astype(np.float32),
        estimator=estimator,
        spp=-(-spp // PASSES) * PASSES,
        passes=PASSES,
        seconds=seconds(),
        key=key,
    )
    _store(reference, _path(key, cache))
    return reference


def reference(
    scene: mi.Scene,
    taking_part: Collection[str] = (),
    spp: int = 4096,
    *,
    sensor: int = 0,
    cache: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Reference:
    """The reference of ``scene`` for a comparison of the plugins ``taking_part``: from the cache, or made now."""
    estimator = choose_estimator(taking_part)
    found = find_reference(scene, estimator, spp, sensor=sensor, cache=cache)
    return found or make_reference(scene, estimator, spp, sensor=sensor, cache=cache, progress=progress)


def reference_key(scene: mi.Scene, estimator: dict[str, Any], spp: int, sensor: int = 0) -> str:
    """SHA-256 of all that a reference depends on.

    That is every parameter of the loaded scene (meshes, textures, the map, the camera, the film's size), its structure
    as Mitsuba prints it (kinds of plugins, the pixel filter, options that are no parameters), the estimator, the
    samples, the variant and Mitsuba's version. Names of files and samplers do not count.
    """
    digest = hashlib.sha256()
    settings = [_FORMAT, mi.__version__, mi.variant(), estimator, spp, PASSES, SEED, sensor]
    digest.update(json.dumps(settings, sort_keys=True).encode())
    digest.update(structure(scene, scene.sensors()[sensor]).encode())
    add_parameters(digest, scene)
    return digest.hexdigest()


def pixels(result: RenderResult) -> NDArray[np.float64]:
    """The colours of a rendering (H, W, 3), or (H, W, 1) for a film of luminance; alpha is left out.

    A film of half floats stores what is beyond their range as infinite; it counts as their largest number.
    """
    image = result.image
    if image.ndim == 2:
        image = image[..., None]
    image = image[..., : 3 if image.shape[2] >= 3 else 1]
    if image.dtype == np.float16:
        limit = float(np.finfo(np.float16).max)
        return np.clip(image.astype(np.float64), -limit, limit)
    return image.astype(np.float64)


def _path(key: str, cache: Path | None) -> Path:
    return (cache or cache_folder()) / "references" / f"{key}.npz"


def _store(reference: Reference, path: Path) -> None:
    about = {name: getattr(reference, name) for name in ("key", "estimator", "spp", "passes", "seconds")}

    def write(name: str) -> None:
        np.savez(
            name, image=reference.image, standard_error=reference.standard_error, about=np.array(json.dumps(about))
        )

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, write)
    except OSError as error:
        warnings.warn(
            f"{path.parent}: the reference cannot be kept ({error.strerror or error}); "
            "STRATALUX_CACHE names another folder",
            CacheWarning,
            stacklevel=4,
        )
