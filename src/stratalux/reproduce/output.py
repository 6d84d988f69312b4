"""What a reproduction leaves in its folder.

====================  ==========================================================================================
``report.html``       everything, to be read
``claims.json``       every claim with its verdict
``results.json``      all numbers
``images``            every picture as ``SECTION-SET-PICTURE.exr`` (linear) and ``.png`` (sRGB)
``steps``             results of the steps, from which an interrupted run goes on; deleting them is always safe
====================  ==========================================================================================

Both JSON files begin with ``format`` ("stratalux-reproduction"), ``format_version`` (1), ``date`` (UTC, ISO 8601),
``machine`` (one line), ``versions`` (by name) and ``settings`` (see :class:`stratalux.reproduce.settings.Settings`).
Numbers that do not exist are null.

- ``claims.json``: ``sections``, each with ``anchor``, ``title`` and ``claims``: ``text``, ``theirs``, ``ours``,
  ``verdict`` ("holds", "partly", "fails" or "not tested") and ``comment``.
- ``results.json``: ``steps``, the plain numbers of every step by its name (for renderings, ``outcomes``: for each
  technique its ``seconds``, ``rmse`` and ``relmse`` by mask, one value a seed); ``charts``: ``title``, ``x_label``,
  ``y_label`` and ``curves`` of points [x, y, lowest y, highest y]; ``heat_maps``: ``title``, ``rows``, ``columns``,
  ``values``; ``tables``: ``title``, ``header``, ``rows``.
"""

from __future__ import annotations

import dataclasses
import datetime
import importlib.util
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..comparison import provenance
from ..comparison.study import Study
from ..images.files import write_atomically
from ..images.tonemap import srgb
from ..images.writing import write_image, write_picture
from ..report.model import Chart, HeatMap, ImageSet, Picture, Report, Table
from .request import ReproductionSettings
from .settings import Settings

FORMAT, FORMAT_VERSION = "stratalux-reproduction", 1


def write_all(report: Report, study: Study, settings: Settings, request: ReproductionSettings, folder: Path) -> None:
    """Write everything but the steps."""
    head = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "machine": provenance.machine(),
        "versions": provenance.versions(),
        "settings": dataclasses.asdict(settings),
        "asked": request.to_json(),
    }
    for name, content in (("claims", _claims(report)), ("results", _results(report, study))):
        _write_json(folder / f"{name}.json", head | content)
    images = folder / "images"
    images.mkdir(exist_ok=True)
    for former in images.iterdir():  # pictures of another size may have other names
        if former.suffix in (".exr", ".png"):
            former.unlink()
    for stem, picture, exposure in pictures(report):
        pixels = np.ascontiguousarray(picture.image, dtype=np.float32)
        write_image(images / f"{stem}.exr", pixels, float32=True)
        write_picture(images / f"{stem}.png", encoded(pixels, exposure))
    _write_page(report, folder / "report.html")


def pictures(report: Report) -> Iterator[tuple[str, Picture, float]]:
    """Name of its files, picture and exposure of everything that the report shows."""
    for section in report.sections:
        for block in section.blocks:
            if isinstance(block, ImageSet):
                shown = (*block.pictures, *([block.reference] if block.reference else []))
                for picture in shown:
                    yield _stem(section.anchor, block.title, picture.name), picture, block.exposure


def encoded(pixels: NDArray[np.float32], exposure: float) -> NDArray[np.uint8]:
    """Linear RGB to 8-bit sRGB, ``exposure`` in stops; what is brighter than white is white."""
    return srgb(np.nan_to_num(pixels) * 2.0**exposure)


def _stem(*parts: str) -> str:
    return "-".join(re.sub(r"[^a-z0-9]+", "-", part.lower()).strip("-") for part in parts)


def _write_page(report: Report, path: Path) -> None:
    if importlib.util.find_spec("stratalux.report.html") is not None:
        importlib.import_module("stratalux.report.html").write_report(report, path)


def _claims(report: Report) -> dict[str, Any]:
    return {
        "sections": [
            {
                "anchor": section.anchor,
                "title": section.title,
                "claims": [dataclasses.asdict(claim) for claim in section.claims],
            }
            for section in report.sections
        ]
    }


def _results(report: Report, study: Study) -> dict[str, Any]:
    blocks = [block for section in report.sections for block in section.blocks]
    return {
        "steps": study.numbers,
        "charts": [dataclasses.asdict(block) for block in blocks if isinstance(block, Chart)],
        "heat_maps": [dataclasses.asdict(block) for block in blocks if isinstance(block, HeatMap)],
        "tables": [dataclasses.asdict(block) for block in blocks if isinstance(block, Table)],
    }


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(_plain(content), indent=1, allow_nan=False, ensure_ascii=False)
    write_atomically(path, lambda name: Path(name).write_text(text + "\n", encoding="utf-8"))


def _plain(value: Any) -> Any:
    """``value`` as JSON knows it: lists for arrays, null for what is no number."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
