"""What becomes of numbers that are no radiance: NaN, negative, infinite, or too large to be reckoned with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Texels = NDArray[np.floating[Any]]

LARGEST_HALF = 65504.0
BEYOND = 10.0
"""An infinite texel of unknown type becomes so many times the largest finite one: how bright it was, nobody knows."""
LIMIT = 1e30
"""Larger texels are cut off: what is made of them, and sums over a film, stays within float32, with some room."""
DOUBTFUL = 1e20
"""No light is so bright. Such texels are kept, but not without a word: one alone outshines the rest of the map."""
_ROWS = 16


def repair(texels: Texels, largest: float | None = None, *, keep_negative: bool = False) -> tuple[Any, str]:
    """``texels`` (H, W, C) without what is no radiance, and a line that says what was done; the same array if there was
    nothing to do, and no line if there is nothing to say.

    NaN and negative values become 0, infinite ones ``largest``: the largest number of the type that they had overflowed
    (65504 for half floats); else :data:`BEYOND` times the largest finite value. Nothing is above :data:`LIMIT`; of what
    is above :data:`DOUBTFUL` the line tells, too.
    ``keep_negative``: leave those that are negative and finite, as colours may be that are to be converted.
    """
    if _sound(texels):
        return texels, ""
    if texels.dtype == np.float16:  # whose largest number is below the limits
        wide = texels.astype(np.float32)
        repaired, said = repair(wide, largest or LARGEST_HALF, keep_negative=keep_negative)
        return (texels if repaired is wide else repaired.astype(np.float16)), said
    finite = np.isfinite(texels)
    nan, infinite = np.isnan(texels), np.isposinf(texels)
    negative = np.isneginf(texels) if keep_negative else texels < 0
    beyond = finite & (texels > LIMIT)
    doubtful = finite & (texels > DOUBTFUL) & ~beyond
    count = doubtful.any(axis=2).sum()
    doubt = f"{count} texel(s) above {DOUBTFUL:g}, brighter than any light" if count else ""
    if not (nan | infinite | negative | beyond).any():
        return texels, doubt  # but for zeros with a sign, or what may be negative
    brightest = float(np.minimum(texels, LIMIT, where=finite, out=np.zeros_like(texels)).max(initial=0))
    ceiling = largest or min(BEYOND * (brightest or 1.0), LIMIT)
    repaired = np.where(nan | negative, 0, np.where(infinite, ceiling, np.minimum(texels, LIMIT))).astype(texels.dtype)
    known = largest == LARGEST_HALF
    became = "the largest half" if known else f"{BEYOND:g} times the largest other" if ceiling < LIMIT else "the limit"
    rules = {
        "NaN": (nan, "NaN to 0"),
        "infinite": (infinite, f"infinite to {ceiling:g}, {became}, so that a sun may be too dark"),
        "negative": (negative, "negative to 0"),
        f"above {LIMIT:g}": (beyond, "those to that"),
    }
    found = {kind: rule for kind, (mask, rule) in rules.items() if mask.any()}
    counts = ", ".join(f"{rules[kind][0].any(axis=2).sum()} {kind}" for kind in found)
    repairs = f"{counts} texel(s) repaired ({', '.join(found.values())})"
    return repaired, f"{repairs}; {doubt}" if doubt else repairs


def _sound(texels: Texels) -> bool:
    """Whether there is nothing to repair or to say, in one pass over blocks that stay in the cache.

    Taken as integers, infinity and NaN are above all finite numbers, and negative ones above those.
    """
    bits = np.dtype(f"u{texels.dtype.itemsize}")
    limit = np.array(min(DOUBTFUL, float(np.finfo(texels.dtype).max)), texels.dtype).view(bits)
    blocks = (texels[first : first + _ROWS].view(bits) for first in range(0, len(texels), _ROWS))
    return all(block.max(initial=0) <= limit for block in blocks)
