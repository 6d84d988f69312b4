"""A view through a fixed set of camera rays.

Every technique, and the reference, shades the same points: pixels are cut into a grid, and one ray passes through the
middle of each of its cells. So nothing but light differs between two images, a technique without random numbers gives
the same image each time, and an error is an error of the lighting: with random camera rays, the edges of the object
would hide all that happens at high sampling rates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

_SAMPLES_PER_LAUNCH = 1 << 24
"""Light samples of one kernel: about a second on two cores, so that an interruption is heard soon."""
_WARM_UP_PIXELS = 64


@dataclass(frozen=True)
class Shot:
    """An image (H, W, 3), linear. ``seconds``: of the kernels alone; tracing and compiling them is apart."""

    image: NDArray[np.float32]
    seconds: float
    preparation_seconds: float
    compile_seconds: float


@dataclass(frozen=True)
class Hits:
    """Masks (H, W) of the pixels all of whose camera rays hit a surface, the object, the ground."""

    surface: NDArray[np.bool_]
    object: NDArray[np.bool_]
    ground: NDArray[np.bool_]


class View:
    """``size``: (width, height) of the whole image; ``crop``: left, top, right, bottom of the part that is rendered."""

    def __init__(
        self,
        scene: mi.Scene,
        size: tuple[int, int],
        grid: int = 1,
        crop: tuple[int, int, int, int] | None = None,
    ) -> None:
        self.scene, self.size, self.grid = scene, size, grid
        self.crop = crop or (0, 0, *size)
        left, top, right, bottom = self.crop
        self.shape = (bottom - top, right - left)
        self.pixels = self.shape[0] * self.shape[1]

    def rays(self, first: int = 0, count: int | None = None) -> mi.RayDifferential3f:
        """The rays of ``count`` pixels from pixel ``first`` on, row by row; the rays of a pixel are neighbours."""
        count = self.pixels - first if count is None else count
        cells = self.grid**2
        lane = dr.arange(mi.UInt32, count * cells) + dr.opaque(mi.UInt32, first * cells)
        pixel, cell = lane // cells, lane % cells
        left, top, _, _ = self.crop
        x = mi.Float(pixel % self.shape[1] + left) + (mi.Float(cell % self.grid) + 0.5) / self.grid
        y = mi.Float(pixel // self.shape[1] + top) + (mi.Float(cell // self.grid) + 0.5) / self.grid
        camera = self.scene.sensors()[0]
        position = mi.Point2f(x / self.size[0], y / self.size[1])
        ray, _ = camera.sample_ray_differential(0, 0, position, mi.Point2f(0.5))
        dr.eval(ray)
        return ray

    def render(
        self,
        integrator: mi.Integrator,
        work: int,
        seed: int,
        progress: Callable[[float], None] | None = None,
        pixels: int | None = None,
    ) -> Shot:
        """Shade every point with ``integrator``, which takes about ``work`` light samples for one.

        ``pixels``: only so many, to warm up; the others stay black.
        """
        start = time.perf_counter()
        if hasattr(integrator, "prepare"):
            integrator.prepare(self.scene)
        preparation = time.perf_counter() - start
        image = np.zeros((self.pixels, 3), dtype=np.float32)
        seconds = compiling = 0.0
        total = pixels or self.pixels
        for chunk, (first, count) in enumerate(self._chunks(total, work)):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed((seed * 1_000_003 + chunk) % (1 << 32), count * self.grid**2)
            sampler.schedule_state()
            ray = self.rays(first, count)
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
                dr.kernel_history_clear()
                light, _, _ = integrator.sample(self.scene, sampler, ray)
                dr.eval(light)
                dr.sync_thread()
                history = dr.kernel_history()
            seconds += _milliseconds(history, "execution_time") / 1000
            compiling += _milliseconds(history, "codegen_time", "backend_time") / 1000
            rays = np.array(mi.Color3f(light)).T.reshape(count, self.grid**2, 3)
            image[first : first + count] = rays.mean(axis=1, dtype=np.float64)
            if progress is not None:
                progress((first + count) / total)
        return Shot(image.reshape(*self.shape, 3), seconds, preparation, compiling)

    def warm_up(self, integrator: mi.Integrator) -> Shot:
        """Prepare the technique and compile its kernel on a few pixels, so that a rendering does neither."""
        return self.render(integrator, 1, 0, pixels=min(_WARM_UP_PIXELS, self.pixels))

    def intersections(self) -> mi.SurfaceInteraction3f:
        """First hits of all rays."""
        si = self.scene.ray_intersect(self.rays())
        dr.eval(si)
        return si

    def hits(self) -> Hits:
        """Which pixels show surfaces, the object, and the ground."""
        si = self.intersections()
        shapes = {shape.id(): shape for shape in self.scene.shapes()}
        masks = [si.is_valid()]
        masks += [si.is_valid() & (si.shape == mi.ShapePtr(shapes[name])) for name in ("object", "ground")]
        return Hits(*(np.asarray(self.per_pixel(mask).all(axis=2)) for mask in masks))

    def per_pixel(self, values: Any) -> NDArray[Any]:
        """One value a ray to (H, W, rays of a pixel)."""
        return np.array(values).reshape(*self.shape, self.grid**2)

    def _chunks(self, pixels: int, work: int) -> Iterator[tuple[int, int]]:
        """First pixel and number of pixels of each kernel."""
        size = max(_WARM_UP_PIXELS, _SAMPLES_PER_LAUNCH // (work * self.grid**2))
        for first in range(0, pixels, size):
            yield first, min(size, pixels - first)


def _milliseconds(history: list[dict[str, Any]], *kinds: str) -> float:
    return float(sum(kernel.get(kind, 0) for kernel in history for kind in kinds))
