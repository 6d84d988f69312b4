"""An image in two stages: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ...sampling.points import mix
from ..launches import Arrays, Launch, Maker
from ..sums import Memory, Noise, Pixels, Sums
from .view import PLENTY, Pilot, Range, View, combined

PARTS = 4
"""Of a pilot, whose differences tell its error."""
_DEARER = 1.15
"""A later sample counts for so many of the pilot, as they are where there is more to be seen; a pilot that learns
something takes as long. That only tells what to expect of them, until it is measured."""
_KNOWN = "counts", "level", "share", "learned"
"""What of its memory the second stage depends on."""


class TwoStages:
    """``few`` of ``spp`` samples of each pixel of a ``view`` are the pilot.

    ``dim``: radiance below which errors count as if it were that bright. ``grey``: radiance of what a picture is laid
    over where alpha is a share. ``varied``: whether there are a control variate and something to learn for it.
    ``beside``: an image that this one is added to, which errors are measured by, as it is after the pilot. ``even``:
    all pixels get as many samples.
    """

    def __init__(
        self,
        view: View,
        few: int,
        spp: int,
        seed: mi.UInt32,
        dim: float,
        memory: Memory,
        *,
        grey: float = 0.0,
        varied: bool = False,
        beside: Callable[[], Pixels] | None = None,
        even: bool = False,
    ) -> None:
        self.spp, self._view, self._few, self._seed, self._dim = spp, view, few, seed, dim
        self._memory, self._varied, self._beside = memory, varied, beside
        self._done = 0.0
        self._even = even or (few == spp and not varied)  # a share of the variate is planned, too
        # As neighbours' errors choose the number of a pixel's samples, they may share those of the map only where all
        # do, the pilot's and the later ones: with any such set fixed, pixels are independent.
        self._shared = view.launcher.light_samples(mix(~seed)) if view.at_once(spp) else None
        parts = 0 if self._even else min(PARTS, few)
        self._pilot = Pilot(view, few, parts, self._shared, seed, dim, grey, varied, varied and few < spp)

    @property
    def work(self) -> dict[str, tuple[float, float]]:
        """Samples of a pixel that are done, and all there will be, by kinds that take unlike times."""
        few, spp = float(self._few), float(self.spp)
        if "counts" in self._memory:  # planned, they are a few less
            spp = float(self._memory["counts"].mean())
        if self._even or few == spp:
            return {"": (self._done, spp)}
        dearer = 1.0 if self._varied else _DEARER
        return {
            "/pilot": (min(self._done, few), few),
            "/later": (max(self._done - few, 0.0) * dearer, (spp - few) * dearer),
        }

    def passes(self, make: Maker) -> Iterator[tuple[Pixels, float, Noise]]:
        """The image so far, with the film's channels and weights, its samples per pixel and its noise."""
        for image, done, noise in self._passes(make):
            self._done = done
            yield image, done, noise

    def _passes(self, make: Maker) -> Iterator[tuple[Pixels, float, Noise]]:
        memory, few = self._memory, self._few
        if "first" not in memory:
            launches = self._pilot.launches
            for done, found in make("pilot", {}, 0, len(launches), self._pilot.launch):
                self._pilot.add(found)
                found = {}  # of a large film, it is much
                if done < len(launches):
                    yield self._pilot.image(0), float(launches.until(done).mean()), None
            self._plan()
        yield memory["first"], float(few), None
        if few == self.spp:
            return
        sums, counts = Sums(memory), memory["counts"] - few
        launches = self._view.launches(counts, few)

        def so_far() -> tuple[Pixels, float, Noise]:
            done = launches.until(sums.launches).reshape(counts.shape)
            return combined(memory["first"], sums.image(), few, done), few + float(done.mean()), sums.noise()

        if sums.launches:
            yield so_far()
        known = {name: memory[name] for name in _KNOWN if name in memory}
        for done, found in make("later", known, sums.launches, len(launches), self._later()):
            sums.add(found["raw"], done)
            yield so_far()

    def launch(self, stage: str) -> Launch:
        """That of a stage; of the second one, the memory has what it depends on."""
        return self._pilot.launch if stage == "pilot" else self._later()

    def _plan(self) -> None:
        """What follows from the pilot."""
        memory, pilot = self._memory, self._pilot
        if self._even:
            memory["counts"] = np.full((self._view.height, self._view.width), min(self.spp, PLENTY))
            memory["first"] = pilot.image(0)
            pilot.forget()
            return
        plan = pilot.plan(self.spp, self._beside() if self._beside else None)
        memory["counts"] = plan.counts
        if self._varied:
            memory["level"], memory["share"] = np.array(plan.level), np.array(plan.share)
            if self._few < self.spp:
                memory["learned"] = pilot.learned()
        memory["first"] = pilot.image(memory["share"].reshape(plan.counts.shape) if self._varied else 0)
        pilot.forget()

    def _later(self) -> Launch:
        """Launches of the second stage, as the memory has it planned."""
        view, memory, few, seed = self._view, self._memory, self._few, self._seed
        counts = memory["counts"] - few
        launches, number = view.launches(counts, few), mi.Float(counts.ravel().astype(np.float32))
        expected, share, learned = dr.opaque(mi.Float, self._dim), None, None
        if self._varied:
            expected = dr.maximum(mi.Float(memory["level"]), self._dim)
            share, learned = mi.Float(memory["share"]), mi.Float(memory["learned"])

        def launch(k: int) -> Arrays:
            start, end = launches[k]
            if (start == end).all():  # what was left has been rounded into the one before
                return {"raw": np.zeros((view.height, view.width, view.channels))}
            samples = self._shared
            if samples is None:
                samples = view.launcher.light_samples(mix(mix(seed) + mi.UInt32(k + 1)))

            def piece(start: Range, end: Range) -> dict[str, Any]:
                lanes = view.samples(start, end - start, seed, expected, samples, learned=learned)
                L = lanes.L
                if share is not None:
                    L = L + dr.gather(mi.Float, share, lanes.pixel) * lanes.difference
                weight = dr.rcp(dr.gather(mi.Float, number, lanes.pixel))
                return {"raw": view.put(lanes, L, lanes.alpha, weight, int((end - start).max()))}

            return view.in_pieces(few + start, few + end, piece)

        return launch
