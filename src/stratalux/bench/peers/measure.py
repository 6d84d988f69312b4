"""The race against the renderers of others in one case: reference, the best configuration of each, curves in turn."""

from __future__ import annotations

import tempfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...assets import Assets
from ...comparison.records import Spread
from ...images.metrics import RELATIVE_EPSILON
from ..candidates import Configuration, cost, ours
from ..cases import Case, Suite
from ..measure import Arena, Fraction, Truth, about_reference, reference_of
from ..records import CurveRecord, Point
from ..scenes import load_setting
from .records import REGION, PeerRecord, PeersResult, PeerTrial
from .scene import export
from .worker import PEERS, Peer, PeerError, PeerShot

CASES = (Case("grace", "diffuse", "buddha"),)
OUR_SPP = (4, 16, 64)
PEER_SPP = (16, 64, 256, 1024)
"""Budgets, chosen so that errors of ours lie within theirs."""
SCREEN_SPP = 64
REPEATS = 2
PEER_SECONDS = 420.0
"""Of a case on two cores, for the progress alone."""


class Contender:
    """A renderer that takes part: its process, what is known of it, and what it has rendered."""

    def __init__(self, name: str) -> None:
        self.record = PeerRecord(name)
        self.peer: Peer | None = None
        self.shots: dict[int, list[PeerShot]] = defaultdict(list)

    def attempt(self, work: Callable[[Peer], None]) -> None:
        """Do ``work`` unless the renderer has failed; where it fails, that is noted."""
        if self.peer is None or self.record.failure is not None:
            return
        try:
            work(self.peer)
        except PeerError as error:
            self.record = replace(self.record, failure=str(error))

    def start(self, stack: ExitStack, folder: Path, python: str | None) -> None:
        try:
            self.peer = stack.enter_context(Peer(self.record.name, folder, python))
        except PeerError as error:
            self.record = replace(self.record, failure=str(error))
            return
        self.record = replace(
            self.record,
            version=self.peer.version,
            configurations=self.peer.configurations,
            load_seconds=self.peer.load_seconds,
        )


def measure_peers(
    case: Case,
    suite: Suite,
    assets: Assets,
    *,
    python: str | None = None,
    cache: Path | None = None,
    peer_spp: Sequence[int] = PEER_SPP,
    fraction: Fraction = lambda _: None,
) -> PeersResult:
    """Measure ``case``. ``python``: interpreter of the renderers. ``cache``: folder for references.

    A renderer that fails is left out from there on, and its record says why.
    """
    setting = load_setting(case, suite, assets)
    arena = Arena(setting)
    spp, mine = suite.reference_spp, ours(suite.depth)
    truth = Truth(case, setting, reference_of(setting, spp, cache, lambda done: fraction(0.2 * done), suite.depth))
    contenders = [Contender(name) for name in PEERS]
    with tempfile.TemporaryDirectory(prefix="stratalux-peers-") as name, ExitStack() as stack:
        folder = Path(name)
        export(case, setting, assets, folder, suite.depth)
        for k, contender in enumerate(contenders):
            contender.start(stack, folder, python)
            _screen(contender, truth, min(SCREEN_SPP, max(peer_spp)))
            fraction(0.2 + 0.3 * (k + 1) / len(contenders))
        seed = 1000
        for k in range(REPEATS):
            for n, budget in enumerate(peer_spp if k % 2 == 0 else peer_spp[::-1]):
                seed += 1
                arena.rounds([(mine, count) for count in OUR_SPP], 1, lambda _: None)
                for contender in contenders:
                    _shoot(contender, budget, seed)
                fraction(0.5 + 0.5 * (k + (n + 1) / len(peer_spp)) / REPEATS)
    reference = truth.reference
    return PeersResult(
        case=case,
        size=setting.size,
        scale=setting.scale,
        reference=about_reference(reference),
        floor=truth.floors[REGION],
        mean=reference.mean(truth.masks[REGION]),
        ours=_surface_only(truth.record(arena, mine)),
        peers=tuple(_concluded(contender, truth) for contender in contenders),
    )


def peer_settings(case: Case, suite: Suite) -> dict[str, Any]:
    """What the result depends on, besides the code, the machine and the versions."""
    budgets = {"ours": OUR_SPP, "theirs": PEER_SPP, "screen": SCREEN_SPP, "repeats": REPEATS}
    size = {"size": suite.size, "reference": suite.reference_spp, "depth": suite.depth}
    return {"case": case.name, **size, **budgets}


def _screen(contender: Contender, truth: Truth, spp: int) -> None:
    """Try every configuration, the second time for the clock, and choose as the benchmark's own search does."""

    def work(peer: Peer) -> None:
        trials = []
        for name in peer.configurations:
            first, second = (peer.render(name, spp, seed) for seed in (1, 2))
            error = max(truth.errors(second.image)[REGION] - truth.floors[REGION], 0.0)
            trials.append(PeerTrial(name, second.spp, second.seconds, error, first.setup_seconds))
        best = min(trials, key=lambda trial: cost(trial.seconds, trial.error))
        contender.record = replace(
            contender.record, trials=tuple(trials), chosen=best.name, setup_seconds=trials[0].setup_seconds
        )

    contender.attempt(work)


def _shoot(contender: Contender, spp: int, seed: int) -> None:
    def work(peer: Peer) -> None:
        shot = peer.render(contender.record.chosen, spp, seed)
        contender.shots[spp].append(shot)

    contender.attempt(work)


def _surface_only(record: CurveRecord) -> CurveRecord:
    points = (Point(point.spp, point.seconds, {REGION: point.errors[REGION]}) for point in record.points)
    return CurveRecord(record.configuration, tuple(points))


def _concluded(contender: Contender, truth: Truth) -> PeerRecord:
    record = contender.record
    if not contender.shots:
        return record
    mask = truth.masks[REGION]
    points = []
    for spp, shots in sorted(contender.shots.items()):
        errors = Spread(tuple(truth.errors(shot.image)[REGION] for shot in shots))
        points.append(Point(spp, Spread(tuple(shot.seconds for shot in shots)), {REGION: errors}))
    images = [shot.image[mask].astype(np.float64) for shot in contender.shots[max(contender.shots)]]
    wanted = truth.reference.image[mask].astype(np.float64)
    plateau, noise = plateau_of(images, wanted, truth.floors[REGION])
    configuration = Configuration(record.name, record.chosen, f"{record.version}, {record.chosen}")
    return replace(
        record,
        curve=CurveRecord(configuration, tuple(points)),
        agreement=float(np.mean([image.mean() for image in images]) / wanted.mean()),
        plateau=plateau,
        plateau_noise=noise,
    )


def plateau_of(
    images: Sequence[NDArray[np.float64]], wanted: NDArray[np.float64], floor: float
) -> tuple[float | None, float | None]:
    """relMSE that more samples would not take away, and its standard error; None for a single image.

    Noise of two seeds is independent, so the product of their differences from the reference (N, 3) has the square of
    the bias for its mean, and the variance of the reference, which is the ``floor``.
    """
    differences = [(image - wanted) / np.sqrt(wanted**2 + RELATIVE_EPSILON) for image in images]
    products = [(one * other).mean(axis=-1) for one, other in combinations(differences, 2)]
    if not products:
        return None, None
    product = np.mean(products, axis=0)
    return float(product.mean() - floor), float(product.std() / np.sqrt(product.size))
