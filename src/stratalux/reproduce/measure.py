"""Renderings in turn, their mean and variance over seeds, and their errors against a reference."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..comparison.reference import Reference
from ..comparison.study import Fraction, Result, Study
from ..images.metrics import Mask, relative_mse, rmse
from .pinned import Pinned
from .scenes import Frame, Workbench

REFERENCE_PASSES = 16
_REFERENCE_SEED = 1 << 20
"""Far from the seeds of the renderings, which begin at 0."""
OVERHEAD_SECONDS = 0.4
"""Of every technique in a step: tracing, preparing and compiling."""


class Moments:
    """Mean and variance of images that come one by one (Welford)."""

    def __init__(self) -> None:
        self.count = 0
        self.mean: NDArray[np.float64] = np.zeros(())
        self._squares: NDArray[np.float64] = np.zeros(())

    def add(self, image: NDArray[np.floating[Any]]) -> None:
        self.count += 1
        difference = image - self.mean
        self.mean = self.mean + difference / self.count
        self._squares = self._squares + difference * (image - self.mean)

    @property
    def variance(self) -> NDArray[np.float64]:
        """Of a single image; 0 where there is but one."""
        return self._squares / max(1, self.count - 1)


@dataclass(frozen=True)
class Judge:
    """A reference, and the masks (H, W) over which errors are measured against it."""

    reference: Reference
    masks: Mapping[str, Mask]

    def measure(
        self, image: NDArray[np.float32], rms: dict[str, list[float]], relative: dict[str, list[float]]
    ) -> None:
        """Append the errors of ``image`` over each mask."""
        for region, mask in self.masks.items():
            rms.setdefault(region, []).append(rmse(image, self.reference.image, mask))
            relative.setdefault(region, []).append(relative_mse(image, self.reference.image, mask))

    def key(self) -> list[str]:
        """Stands for the masks and the reference in the key of a step."""
        return [self.reference.key, *(f"{name} {_digest(mask)}" for name, mask in self.masks.items())]


def _empty() -> NDArray[np.float32]:
    return np.empty((0, 0, 3), dtype=np.float32)


@dataclass(frozen=True)
class Outcome:
    """The renderings of one technique.

    ``seconds`` of each. ``rmse`` and ``relmse`` of each, by mask. ``image``: the first one, ``mean`` and ``variance``
    over all, (H, W, 3), where they were kept, and otherwise empty; the variance is that of a single rendering.
    """

    technique: Pinned
    seconds: list[float]
    preparation_seconds: float
    compile_seconds: float
    rmse: dict[str, list[float]]
    relmse: dict[str, list[float]]
    image: NDArray[np.float32] = field(default_factory=_empty)
    mean: NDArray[np.float32] = field(default_factory=_empty)
    variance: NDArray[np.float32] = field(default_factory=_empty)

    @property
    def time(self) -> float:
        return median(self.seconds)


@dataclass
class _Tally:
    """What is known of one technique while the seeds go on."""

    seconds: list[float] = field(default_factory=list)
    rmse: dict[str, list[float]] = field(default_factory=dict)
    relmse: dict[str, list[float]] = field(default_factory=dict)
    moments: Moments = field(default_factory=Moments)
    image: NDArray[np.float32] | None = None


def contest_work(frame: Frame, techniques: Sequence[Pinned], seeds: int) -> float:
    """About how many seconds :func:`contest` takes on two cores."""
    return sum(OVERHEAD_SECONDS + seeds * t.seconds * frame.lanes / 1e6 for t in techniques)


def contest(
    study: Study,
    bench: Workbench,
    name: str,
    frame: Frame,
    techniques: Sequence[Pinned],
    seeds: int,
    judge: Judge | None = None,
    keep: Sequence[str] = ("image",),
) -> list[Outcome]:
    """Render ``frame`` with every technique and each of ``seeds`` seeds, the techniques in turn, as one step.

    ``keep``: which of ``image``, ``mean`` and ``variance`` are kept.
    """
    settings = {
        **bench.fingerprint(frame),
        "techniques": [technique.text for technique in techniques],
        "seeds": seeds,
        "judge": judge.key() if judge else None,
        "keep": list(keep),
    }

    def compute(fraction: Fraction) -> Result:
        return _render_in_turn(bench, frame, techniques, seeds, judge, keep, fraction)

    result = study.step(name, settings, contest_work(frame, techniques, seeds), compute)
    return [
        Outcome(
            technique=technique,
            **{key: plain[key] for key in ("seconds", "preparation_seconds", "compile_seconds", "rmse", "relmse")},
            **{key: result[f"{key}-{i}"] for key in keep},
        )
        for i, (technique, plain) in enumerate(zip(techniques, result["outcomes"], strict=True))
    ]


def _render_in_turn(
    bench: Workbench,
    frame: Frame,
    techniques: Sequence[Pinned],
    seeds: int,
    judge: Judge | None,
    keep: Sequence[str],
    fraction: Fraction,
) -> Result:
    view = bench.view(frame)
    integrators = [technique.load() for technique in techniques]
    warm = [view.warm_up(integrator) for integrator in integrators]
    tallies = [_Tally() for _ in techniques]
    weights = [technique.seconds for technique in techniques]
    total, done = seeds * sum(weights), 0.0
    for seed in range(seeds):
        for technique, integrator, tally, weight in zip(techniques, integrators, tallies, weights, strict=True):

            def show(part: float, done: float = done, weight: float = weight) -> None:
                fraction((done + part * weight) / total)

            shot = view.render(integrator, technique.samples, seed, show)
            done += weight
            tally.seconds.append(shot.seconds)
            if tally.image is None:
                tally.image = shot.image
            if {"mean", "variance"} & set(keep):
                tally.moments.add(shot.image)
            if judge is not None:
                judge.measure(shot.image, tally.rmse, tally.relmse)
    result: Result = {"outcomes": []}
    for i, (first, tally) in enumerate(zip(warm, tallies, strict=True)):
        arrays = {"image": tally.image, "mean": tally.moments.mean, "variance": tally.moments.variance}
        result |= {f"{key}-{i}": np.asarray(arrays[key], dtype=np.float32) for key in keep}
        result["outcomes"].append(
            {
                "technique": techniques[i].text,
                "seconds": tally.seconds,
                "preparation_seconds": first.preparation_seconds,
                "compile_seconds": first.compile_seconds,
                "rmse": tally.rmse,
                "relmse": tally.relmse,
            }
        )
    return result


def make_reference(study: Study, bench: Workbench, name: str, frame: Frame, technique: Pinned) -> Reference:
    """The mean of :data:`REFERENCE_PASSES` renderings with ``technique``, and its standard error, as one step.

    ``technique``: with the samples of one pass.
    """
    settings = {**bench.fingerprint(frame), "technique": technique.text, "passes": REFERENCE_PASSES}

    def compute(fraction: Fraction) -> Result:
        view, integrator = bench.view(frame), technique.load()
        view.warm_up(integrator)
        moments, seconds = Moments(), 0.0
        for k in range(REFERENCE_PASSES):
            shot = view.render(
                integrator,
                technique.samples,
                _REFERENCE_SEED + k,
                partial(_show_pass, fraction, k),
            )
            moments.add(shot.image)
            seconds += shot.seconds
        error = np.sqrt(moments.variance / REFERENCE_PASSES)
        return {
            "image": moments.mean.astype(np.float32),
            "standard_error": error.astype(np.float32),
            "seconds": seconds,
        }

    result = study.step(name, settings, reference_work(frame, technique), compute)
    return Reference(
        image=result["image"],
        standard_error=result["standard_error"],
        estimator={"technique": technique.text},
        spp=REFERENCE_PASSES,
        passes=REFERENCE_PASSES,
        seconds=result["seconds"],
        key=_digest(result["image"]),
        cached=True,
    )


def _show_pass(fraction: Fraction, k: int, part: float) -> None:
    fraction((k + part) / REFERENCE_PASSES)


def reference_work(frame: Frame, technique: Pinned) -> float:
    """About how many seconds :func:`make_reference` takes on two cores."""
    return contest_work(frame, [technique], REFERENCE_PASSES)


def _digest(array: NDArray[Any]) -> str:
    about = json.dumps([str(array.dtype), array.shape]).encode()
    return hashlib.sha256(about + np.ascontiguousarray(array).tobytes()).hexdigest()[:16]
