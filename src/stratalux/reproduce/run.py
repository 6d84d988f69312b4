"""A whole reproduction: items in turn, each step kept, a report at the end."""

from __future__ import annotations

import dataclasses
import hashlib
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import mitsuba as mi

from ..assets import Assets
from ..comparison import provenance
from ..comparison.study import Progress, Study
from ..errors import InputError
from ..images.files import check_name, check_writable
from ..rendering.cluster import check_packages
from ..report.model import Report, Section
from .items import ITEMS
from .output import write_all
from .request import ReproductionSettings
from .scenes import GROUND_LUMINANCE, Workbench
from .settings import FULL, QUICK, Settings

STEPS = "steps"
TITLE = "An Effective Stratified Sampling Scheme for Environment Maps with Median Cut Method"


def reproduce(
    items: Sequence[str] = ("all",),
    folder: str | Path = "reproduction",
    *,
    quick: bool = False,
    assets: str | Path | None = None,
    progress: Progress | None = None,
    force: bool = False,
    settings: Settings | None = None,
    cluster: str | None = None,
) -> Report:
    """Compute ``items`` (names of :data:`ITEMS`, or ``all``) and write the report to ``folder``.

    ``quick``: small images and few samples, minutes in place of most of an hour; ``settings`` replaces both sizes.
    ``cluster``: address of a Dask scheduler, whose workers make the items, one at a time on each machine.
    ``assets``: folder of the paper's map and meshes instead of the usual one. ``progress`` is told the fraction that is
    done, and what is going on. Results of steps are kept in ``folder``: when a run was interrupted, the same call goes
    on where it stopped; ``force`` computes all of them anew. A variant must be active, or ``llvm_ad_rgb`` will be.

    The files are those of :mod:`stratalux.reproduce.output`. Raises :class:`InputError` for an unknown item, missing
    assets, and a folder that cannot be written or holds something else.
    """
    request = ReproductionSettings(
        items=tuple(items),
        quick=quick,
        folder=str(folder),
        assets=None if assets is None else str(assets),
        force=force,
    )
    return run_reproduction(request, progress=progress, settings=settings, cluster=cluster)


def run_reproduction(
    request: ReproductionSettings,
    *,
    progress: Progress | None = None,
    settings: Settings | None = None,
    cluster: str | None = None,
) -> Report:
    """The same from one object; see :func:`reproduce`. ``cluster``: a scheduler's address, whose workers make items."""
    chosen = [ITEMS[name] for name in item_names(request.items)]
    settings = settings or (QUICK if request.quick else FULL)
    bench = Workbench(settings, Assets(request.assets))
    for name in sorted({name for item in chosen for name in item.assets}):
        bench.assets.require(name)
    folder = check_folder(request.folder)
    if mi.variant() is None or mi.variant().startswith("scalar"):
        mi.set_variant("llvm_ad_rgb")
    if not mi.is_rgb:
        raise InputError(f"variant {mi.variant()}: the paper's figures are in RGB; use llvm_ad_rgb or cuda_ad_rgb")
    if request.force:
        shutil.rmtree(folder / STEPS, ignore_errors=True)
    (folder / STEPS).mkdir(parents=True, exist_ok=True)

    common = {"versions": provenance.versions(), "variant": mi.variant(), "code": code_digest()}
    work = {name: seconds for item in chosen for name, seconds in item.work(settings).items()}
    study = Study(folder / STEPS, common, sum(work.values()), progress)
    if cluster is not None:
        _on_workers(request, settings, cluster, folder, progress)
    sections = tuple(item.run(study, bench) for item in chosen)
    report = _report(sections, bench)
    write_all(report, study, settings, request, folder)
    return report


def _on_workers(
    request: ReproductionSettings, settings: Settings, cluster: str, folder: Path, progress: Progress | None
) -> None:
    """Let workers make the steps of all items, and keep them as if they had been made here."""
    check_packages()
    from ..rendering.cluster.parts import timed

    names = item_names(request.items)
    items = [(dataclasses.replace(request, items=(name,), force=False), settings, mi.variant()) for name in names]
    for count, (_, steps) in enumerate(timed(cluster, mi.variant(), _steps_of, items), 1):
        for name, content in steps.items():
            (folder / STEPS / name).write_bytes(content)
        if progress is not None:
            progress(count / (len(items) + 1), f"{count} of {len(items)} items")


def _steps_of(item: tuple[ReproductionSettings, Settings, str]) -> dict[str, bytes]:
    """What a worker makes of an item: its steps as files."""
    from ..rendering.cluster.parts import files_of

    request, settings, variant = item
    mi.set_variant(variant)

    def make(folder: Path) -> None:
        run_reproduction(dataclasses.replace(request, folder=str(folder / "made")), settings=settings)

    return files_of(make, f"made/{STEPS}")


def item_names(items: Sequence[str]) -> list[str]:
    """Names of :data:`ITEMS` in their order; raises :class:`InputError` for an unknown one."""
    for name in items:
        if name not in ITEMS and name != "all":
            raise InputError(f"item '{name}' is unknown; use {', '.join(ITEMS)} or all")
    return [name for name in ITEMS if name in items or "all" in items or not items]


def check_folder(folder: str | Path) -> Path:
    """Make sure that results can be written to ``folder``: a new or empty one, or that of a former reproduction."""
    check_name(folder)
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; name another folder with -o")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / STEPS).is_dir():
        raise InputError(f"{folder}: is not empty, and holds no reproduction; name another with -o")
    check_writable(folder.absolute().parent / f".{folder.name}-")
    return folder


def code_digest() -> str:
    """SHA-256 of the package's own source: figures of another version of the code do not mix with those of this one."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in ("cli", "report"):  # they measure nothing
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def _report(sections: Sequence[Section], bench: Workbench) -> Report:
    settings = bench.settings
    verdicts = Counter(str(claim.verdict) for section in sections for claim in section.claims)
    said = {
        kind: [claim.text for section in sections for claim in section.claims if claim.verdict == kind]
        for kind in ("fails", "partly")
    }
    words = {"holds": "hold", "partly": "hold in part", "fails": "fail", "not tested": "could not be tested"}
    counted = [f"{verdicts[kind]} {word}" for kind, word in words.items() if verdicts[kind]]
    notes = []
    if settings is not FULL:
        notes.append(
            f"A {settings.name} run: small images and few samples. Its verdicts are less certain than a full run's."
        )
    if any("buddha" in ITEMS[section.anchor].assets for section in sections):
        notes.append(
            f"The Buddha has {bench.triangles('buddha'):,} triangles here, and more than a million in the paper."
        )
    return Report(
        title="The paper, computed again",
        subtitle=f"{TITLE} (Mei, Jaeger and Hu)",
        summary=(
            f"{sum(verdicts.values())} claims of the paper's sections 4 and 5 were put to the test on its own scenes: "
            f"{', '.join(counted)}.",
            *(
                f"{heading}: {'; '.join(found)}."
                for heading, found in (("What fails here", said["fails"]), ("What holds in part", said["partly"]))
                if found
            ),
            "Where the paper shows only a picture, a claim was given a measure and a threshold.",
        ),
        sections=tuple(sections),
        facts={
            "machine": provenance.machine(),
            "versions": ", ".join(f"{name} {found}" for name, found in provenance.versions().items() if found),
            "variant": str(mi.variant()),
            "size": settings.name,
            "command": " ".join(
                ["stratalux reproduce", *(s.anchor for s in sections), *(["--quick"] if settings is QUICK else [])]
            ),
            "settings": ", ".join(f"{key} {value}" for key, value in dataclasses.asdict(settings).items()),
            "map": "Grace Cathedral, turned by 180 degrees about x to be upright (y is up), radiance times "
            f"{bench.scale:.4g}, which gives open ground a luminance of {GROUND_LUMINANCE}",
        },
        notes=tuple(notes),
    )
