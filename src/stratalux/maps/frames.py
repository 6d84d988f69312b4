"""Where other tools have the middle of a map: what :mod:`.geometry` has at +z, y up."""

from __future__ import annotations

ENV_FRAMES = {"mitsuba": 0.0, "blender": 90.0, "three": 90.0}
"""Degrees about +y by which a map is turned to stand as in that tool; docs/conventions.md says why."""
