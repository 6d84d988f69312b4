"""What a report says, free of how it looks: sections of claims, pictures, curves, heat maps and tables.

:mod:`stratalux.report.html` makes one self-contained page of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Verdict = Literal["holds", "partly", "fails", "not tested"]
"""Whether a claim holds here. ``partly``: in direction but not in size, or in some of the cases."""


@dataclass(frozen=True)
class Claim:
    """One claim of a paper, or one finding: what was said, ``theirs``, beside what was measured, ``ours``.

    ``theirs`` and ``ours`` are short, numbers with units; ``comment`` may explain the difference.
    """

    text: str
    theirs: str
    ours: str
    verdict: Verdict
    comment: str = ""


@dataclass(frozen=True)
class Picture:
    """An image of an :class:`ImageSet`. ``image``: (H, W, 3), linear radiance. ``facts``: what to show beside it.

    ``flip``: HDR-FLIP error in every pixel, (H, W) in [0, 1], where it is known.
    """

    name: str
    image: NDArray[np.float32]
    facts: dict[str, str] = field(default_factory=dict)
    flip: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Crop:
    """A rectangle worth a look: pixels ``left`` <= x < ``right``, ``top`` <= y < ``bottom``."""

    name: str
    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True)
class ImageSet:
    """Images of one view, all of one size, to be compared. ``exposure``: initial one, in stops.

    ``reference``: what differences are taken against, and itself one of the images to flip through.
    """

    title: str
    pictures: tuple[Picture, ...]
    reference: Picture | None = None
    exposure: float = 0.0
    crops: tuple[Crop, ...] = ()
    text: str = ""


@dataclass(frozen=True)
class Curve:
    """``points``: (x, y, lowest y, highest y), in order of x. ``dashed``: for what is biased, or a guide."""

    name: str
    points: tuple[tuple[float, float, float, float], ...]
    dashed: bool = False


@dataclass(frozen=True)
class Chart:
    """Curves over common axes. ``floor``: height of a horizontal line and what it says."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    logarithmic: bool = True
    floor: tuple[float, str] | None = None
    text: str = ""


@dataclass(frozen=True)
class HeatMap:
    """``values``: (rows, columns), one for each pair of labels; NaN where nothing was measured.

    ``lower_is_better`` decides which cell is marked as the best; colours follow the logarithm of the values.
    """

    title: str
    x_label: str
    y_label: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    values: NDArray[np.float64]
    unit: str = ""
    lower_is_better: bool = True
    text: str = ""


@dataclass(frozen=True)
class Table:
    """``rows`` of strings under a ``header``; columns of numbers are set flush right by their content."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text: str = ""


Block = ImageSet | Chart | HeatMap | Table


@dataclass(frozen=True)
class Section:
    """``anchor``: short name for links, unique in the report. ``text``: plain paragraphs."""

    anchor: str
    title: str
    text: tuple[str, ...] = ()
    claims: tuple[Claim, ...] = ()
    blocks: tuple[Block, ...] = ()


@dataclass(frozen=True)
class Report:
    """``summary``: a few sentences that anyone understands. ``facts``: machine, versions, settings, command.

    ``notes``: lines that a reader should see before trusting the figures.
    """

    title: str
    subtitle: str
    summary: tuple[str, ...]
    sections: tuple[Section, ...]
    facts: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
