"""Mitsuba's own integrators, as they are, to compare with."""

from __future__ import annotations

from typing import Any

from .techniques import Property, Technique

_MOST = 512
"""Mitsuba writes its code once for each of these samples, and is compiled for a minute at that number."""

TECHNIQUES = (
    Technique(
        name="direct",
        plugin="direct",
        summary="Mitsuba's direct light: emitter and BSDF samples under MIS",
        source="Veach and Guibas 1995 (power heuristic); Mitsuba 3",
        unbiased=True,
        properties={
            "emitter_samples": Property(1, "shadow rays to the emitters", minimum=0, maximum=_MOST),
            "bsdf_samples": Property(1, "rays drawn from the BSDF", minimum=0, maximum=_MOST),
        },
        needs_rays=True,
        rays=("emitter_samples", "bsdf_samples"),
    ),
    Technique(
        name="path",
        plugin="path",
        summary="Mitsuba's path tracer: one emitter and one BSDF sample under MIS; by itself, one bounce",
        source="Mitsuba 3",
        unbiased=True,
        properties={
            "max_depth": Property(2, "segments of a path, at most: 2 is direct light; -1: no limit", minimum=-1),
        },
        rays_per_sample=2,
    ),
)
PLUGINS: dict[str, Any] = {}
