"""The techniques of the paper with every property written out, so that no future default changes what is measured."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from ..integrators.techniques import parse_technique


@dataclass(frozen=True)
class Pinned:
    """A technique as ``stratalux render --technique`` takes it. ``label``: what a reader sees.

    ``rays``: shadow rays of a shading point. ``samples``: light samples, proposals included. ``seconds``: about how
    long a million shading points take on two cores.
    ``biased``: whether its mean is not the image that is sought.
    """

    text: str
    label: str
    rays: int
    samples: int
    seconds: float
    biased: bool = False

    def load(self) -> mi.Integrator:
        technique, given = parse_technique(self.text)
        return mi.load_dict(technique.integrator(given))


def stratified(strata: int, proposals: int = 1) -> Pinned:
    """The paper's scheme: N regions, M proposals in each, one shadow ray each."""
    return Pinned(
        f"stratified:strata={strata},proposals={proposals},bsdf_samples=0",
        f"stratified, N = {strata}, M = {proposals}",
        strata,
        strata * proposals,
        0.055 * strata * proposals,
    )


def importance(samples: int, sequence: str = "sobol") -> Pinned:
    """Importance sampling of the whole map with (0, 2)-points, as in the paper, or ``independent`` random numbers."""
    points = "low-discrepancy points" if sequence == "sobol" else "independent points"
    return Pinned(
        f"importance:samples={samples},proposals=1,bsdf_samples=0,sequence={sequence}",
        f"importance sampling, {samples} {points}",
        samples,
        samples,
        (0.13 if sequence == "sobol" else 0.07) * samples,
    )


def importance_mis(samples: int) -> Pinned:
    """Half of the samples from the map and half from the BSDF: what converges on glossy surfaces."""
    half = samples // 2
    return Pinned(
        f"importance:samples={half},proposals=1,bsdf_samples={half},sequence=sobol",
        f"importance sampling, {half} samples of the map and {half} of the BSDF under MIS",
        2 * half,
        2 * half,
        0.3 * half,
    )


def structured(lights: int, jitter: bool = False) -> Pinned:
    """Structured importance sampling (SIS), with its lights fixed or jittered inside their strata."""
    return Pinned(
        f"structured:lights={lights},jitter={str(jitter).lower()}",
        f"structured, {lights} lights{', jittered' if jitter else ''}",
        lights,
        lights,
        (0.035 if jitter else 0.025) * lights,
        biased=True,
    )


def mitsuba_direct(samples: int) -> Pinned:
    """Mitsuba's own direct light, which shares no sampling code with the others."""
    return Pinned(
        f"direct:emitter_samples={samples},bsdf_samples={samples}",
        f"Mitsuba's direct, {samples} + {samples} samples",
        2 * samples,
        2 * samples,
        0.16 * samples,
    )
