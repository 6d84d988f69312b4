"""The folder that a comparison leaves: a report, images, ``results.json``, and curves.

======================================  ==============================================================================
``reference.exr``, ``.png``             the reference
``reference-standard-error.exr``        standard error of each of its values
``ENTRY-RAYS.exr``, ``.png``            first repeat of an entry at a number of rays
``ENTRY-RAYS-equal-time.exr``, ``.png`` the same at equal time
``report.html``                         everything on one page, see :mod:`stratalux.comparison.page`
``results.json``                        all figures
``error-rays.svg``, ``.png``            relative MSE over shadow rays per pixel
``error-time.svg``, ``.png``            relative MSE over seconds
======================================  ==============================================================================

All PNG images have the exposure of the reference. ``results.json`` (numbers that do not exist, or are infinite or not
defined, are null):

- ``format``: "stratalux-comparison"; ``format_version``: 1; ``date``: UTC, ISO 8601; ``machine``: one line;
  ``versions``: by name; ``notes``: list of lines.
- ``settings``: ``scene``, ``variant``, ``width``, ``height``, ``sampler``, ``filter``, ``rays``, ``spp``, ``repeats``,
  ``seed``, ``sensor``, and ``exposure`` of the PNG images in stops; ``asked``: the groups of settings that the
  comparison was made with (``scene`` is null for one that a program has loaded), and ``command``, which makes it again.
- ``region``: "surface" or "image", the one that curves and tables show; ``surface_fraction`` of the pixels.
- ``reference``: ``file``, ``standard_error_file``, ``estimator``, ``spp``, ``passes``, ``seconds``, ``cached``,
  ``key``, and for each region (below) ``mean`` over pixels and channels, ``relative_standard_error``,
  ``relative_mse_floor`` and ``rmse_floor`` (the errors that a perfect image would have).
- ``entries``: ``name``, ``technique``, ``given``, ``summary``, ``source``, ``unbiased``.
- ``equal_rays``, ``equal_time``: records with ``entry`` (its name), ``rays`` asked for, ``integrator``, ``spp``,
  ``rays_per_sample``, ``shadow_rays_per_pixel``, ``camera_rays``, ``shadow_rays`` (both of the image; shadow rays at
  most), ``seconds`` (``median``, ``min``, ``max``, ``values``), ``preprocessing_seconds``, ``compile_seconds``,
  ``budget_seconds`` (null at equal rays), ``files``, and for each region, ``surface`` (null if no pixel is all
  surface) and ``image``: ``rmse`` and ``relmse`` (``median``, ``min``, ``max``, ``values``), ``flip`` (of the first
  repeat), ``efficiency`` (1 / (seconds · relMSE)), ``relative_to_best`` (efficiency over the best at these ``rays``),
  ``reference_limited``.
- ``files``: the names of all files in the folder.
"""

from __future__ import annotations

import datetime
import json
import math
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..images.files import check_name, check_writable, umask
from ..images.writing import write_image
from ..report.html import write_report
from .curves import draw_curves, why_no_curves
from .findings import Findings
from .page import comparison_report
from .provenance import machine, versions
from .records import Record, Spread

FORMAT = "stratalux-comparison"
REGIONS = ("surface", "image")


def check_folder(folder: str | Path, *, force: bool = False) -> Path:
    """Make sure, before any work is done, that results can be written to ``folder``; raises :class:`InputError`.

    A folder that exists must be empty or, with ``force``, hold the results of a comparison and nothing else.
    """
    check_name(folder)
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; name another folder with -o")
    if folder.is_dir() and any(folder.iterdir()):
        former = _former_files(folder)
        if former is None:
            raise InputError(f"{folder}: is not empty, and holds no results of a comparison; name another with -o")
        strangers = sorted(path.name for path in folder.iterdir() if path.name not in former)
        if strangers:
            raise InputError(f"{folder}: also holds '{strangers[0]}', which would be lost; name another folder with -o")
        if not force:
            raise InputError(f"{folder}: holds results already; --force replaces them, -o names another folder")
    check_writable(folder.absolute().parent / f".{folder.name}-")
    return folder


def write_results(comparison: Findings, folder: str | Path, *, force: bool = False) -> None:
    """Write everything to ``folder``, which appears complete or not at all; see :func:`check_folder` for ``force``.

    Without matplotlib there are no curves, and a note says so.
    """
    target = check_folder(folder, force=force).absolute()
    building = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}-"))
    try:
        _fill(comparison, building)
        os.chmod(building, 0o777 & ~umask())
        if not target.exists():
            os.rename(building, target)
            return
        check_folder(target, force=force)  # it may have changed in the meantime
        former = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}-"))
        os.replace(target, former)
        try:
            os.rename(building, target)
        except BaseException:
            os.rename(former, target)
            raise
        shutil.rmtree(former)
    finally:
        shutil.rmtree(building, ignore_errors=True)


def describe(comparison: Findings) -> dict[str, Any]:
    """The content of ``results.json`` but for ``files``, as documented above."""
    reference = comparison.reference
    masks = {region: comparison.mask(region) for region in REGIONS if region == "image" or comparison.surface.any()}
    floors = {
        region: {
            "mean": reference.mean(mask),
            "relative_standard_error": reference.relative_standard_error(mask),
            "relative_mse_floor": reference.relative_mse_floor(mask),
            "rmse_floor": reference.rmse_floor(mask),
        }
        for region, mask in masks.items()
    }
    return {
        "format": FORMAT,
        "format_version": 1,
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "machine": machine(gpu=comparison.settings["variant"].startswith("cuda")),
        "versions": versions(),
        "notes": comparison.notes,
        "settings": {**comparison.settings, "exposure": comparison.exposure},
        "region": comparison.region,
        "surface_fraction": float(comparison.surface.mean()),
        "reference": {
            "file": "reference.exr",
            "standard_error_file": "reference-standard-error.exr",
            **{name: getattr(reference, name) for name in ("estimator", "spp", "passes", "seconds", "cached", "key")},
            **{region: floors.get(region) for region in REGIONS},
        },
        "entries": [
            {
                "name": entry.name,
                "technique": entry.technique.name,
                "given": entry.given,
                "summary": entry.technique.summary,
                "source": entry.technique.source,
                "unbiased": entry.technique.unbiased,
            }
            for entry in comparison.entries
        ],
        "equal_rays": [_describe_record(comparison, record) for record in comparison.equal_rays],
        "equal_time": [_describe_record(comparison, record) for record in comparison.equal_time],
    }


def _describe_record(comparison: Findings, record: Record) -> dict[str, Any]:
    regions = {
        region: {
            "rmse": _describe_spread(errors.rmse),
            "relmse": _describe_spread(errors.relative_mse),
            "flip": errors.flip,
            "efficiency": errors.efficiency,
            "relative_to_best": comparison.relative_to_best(record, region),
            "reference_limited": errors.reference_limited,
        }
        for region, errors in record.errors.items()
    }
    return {
        "entry": record.entry.name,
        "rays": record.rays,
        "integrator": record.integrator,
        "spp": record.spp,
        "rays_per_sample": record.rays_per_sample,
        "shadow_rays_per_pixel": record.rays_per_pixel,
        "camera_rays": record.camera_rays,
        "shadow_rays": record.shadow_rays,
        "seconds": _describe_spread(record.seconds),
        "preprocessing_seconds": record.preparation_seconds,
        "compile_seconds": record.compile_seconds,
        "budget_seconds": record.budget_seconds,
        "files": [f"{record.stem}.exr", f"{record.stem}.png"],
        **{region: regions.get(region) for region in REGIONS},
    }


def _describe_spread(spread: Spread) -> dict[str, Any]:
    return {"median": spread.median, "min": spread.minimum, "max": spread.maximum, "values": list(spread.values)}


def _fill(comparison: Findings, folder: Path) -> None:
    stops = comparison.exposure
    reference = comparison.reference
    about: dict[str, str | int | float] = {
        "spp": reference.spp,
        "integrator": json.dumps(reference.estimator),
        "key": reference.key,
    }
    for suffix in (".exr", ".png"):
        write_image(folder / f"reference{suffix}", reference.image, about, exposure=stops, float32=True)
        for record in (*comparison.equal_rays, *comparison.equal_time):
            write_image(
                folder / f"{record.stem}{suffix}", record.image, _metadata(record), exposure=stops, float32=True
            )
    write_image(folder / "reference-standard-error.exr", reference.standard_error, about, float32=True)

    no_curves = why_no_curves()
    if no_curves is None:
        draw_curves(comparison, folder)
    elif no_curves not in comparison.notes:
        comparison.notes.append(no_curves)
    write_report(comparison_report(comparison), folder / "report.html")
    content = describe(comparison)
    content["files"] = sorted([path.name for path in folder.iterdir()] + ["results.json"])
    text = json.dumps(_finite(content), indent=1, allow_nan=False, ensure_ascii=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _metadata(record: Record) -> dict[str, str | int | float]:
    seconds = record.seconds.values[0]
    return {
        "technique": record.entry.name,
        "integrator": json.dumps(record.integrator),
        "spp": record.spp,
        "rays": record.rays,
        "seconds": seconds,
        "renderTimeSeconds": seconds,
        "samplesPerPixel": record.spp,
    }


def _former_files(folder: Path) -> set[str] | None:
    """The files that a former comparison has written to ``folder``, or None if there was none."""
    try:
        content = json.loads((folder / "results.json").read_text(encoding="utf-8"))
        return set(content["files"]) if content["format"] == FORMAT else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _finite(value: Any) -> Any:
    """``value`` with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
