"""What is said beside pictures."""

from __future__ import annotations

from .measure import Outcome


def picture_facts(outcome: Outcome) -> dict[str, str]:
    """Technique, rays and render time of a picture."""
    return {
        "technique": outcome.technique.text,
        "rays per shading point": str(outcome.technique.rays),
        "render time": f"{outcome.time:.3g} s",
    }
