"""A contact sheet: of each file what Cycles and we show, and the difference; base colours and normals apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stratalux.images.metrics import flip_map

COLUMNS = 3
"""Files side by side."""


def sheet(folder: Path, names: Sequence[str]) -> None:
    """``sheet.jpg`` of the pictures of files, and ``passes.jpg`` of their base colours and normals, in a ``folder``."""
    from matplotlib import colormaps

    rows: list[list[NDArray[np.float32]]] = []
    passes: list[list[NDArray[np.float32]]] = []
    magma = colormaps["magma"]
    for name in names:
        with np.load(folder / f"{name}.npz") as stored:
            arrays = {key: stored[key] for key in stored.files}
        ours, theirs = arrays["ours_picture"], arrays["cycles_picture"]
        errors = flip_map(ours, theirs)
        assert errors is not None
        there = arrays["cycles_coverage"] > 0.5
        white = np.percentile(theirs[there] if there.any() else theirs, 95)
        rows.append([_display(theirs / white), _display(ours / white), magma(errors)[..., :3]])
        base = [arrays[f"{who}_base"] for who in ("cycles", "ours")]
        bent = [arrays[f"{who}_normals"] for who in ("cycles", "ours")]
        apart = [np.clip(4 * np.abs(a - b), 0, 1) for a, b in (base, bent)]
        passes.append([*map(_display, base), apart[0], *bent, apart[1]])
    _write(folder / "sheet.jpg", names, rows, COLUMNS)
    _write(folder / "passes.jpg", names, passes, 2)


def _display(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _write(path: Path, names: Sequence[str], rows: Sequence[Sequence[NDArray[np.float32]]], columns: int) -> None:
    from matplotlib import pyplot

    height, width = rows[0][0].shape[:2]
    many = len(rows[0])
    lines = -(-len(rows) // columns)
    inches = (columns * many * width / 100, lines * (height + 16) / 100)
    figure, axes = pyplot.subplots(lines, columns, figsize=inches, dpi=100, squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, name, row in zip(axes.flat, names, rows, strict=False):
        axis.imshow(np.concatenate(row, axis=1), interpolation="nearest")
        axis.set_title(name, fontsize=8, loc="left", pad=2)
    figure.subplots_adjust(0, 0, 1, 1 - 14 / (lines * (height + 16)), 0.01, 16 / height)
    figure.savefig(path, pil_kwargs={"quality": 80} if path.suffix == ".jpg" else None)
    pyplot.close(figure)
