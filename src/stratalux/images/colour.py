"""What is known of colours: linear sRGB and its luminance."""

from __future__ import annotations

import numpy as np

LUMINANCE = np.array([0.212671, 0.715160, 0.072169], dtype=np.float32)
"""Rec. 709 luminance weights, those of Mitsuba's ``luminance()``."""
