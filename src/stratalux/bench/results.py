"""What a run leaves: ``results.json``, ``bench.svg``, ``bench.png``, and the ``steps`` that it resumes from.

``results.json`` (numbers that do not exist are null; a *spread* is ``median``, ``min``, ``max``, ``values``):

- ``format``: "stratalux-bench"; ``format_version``: 2; ``date``: UTC, ISO 8601, of the end; ``machine``: one line;
  ``variant``; ``versions``: by name; ``source_sha256``: of the code that was measured; ``suite``: its name;
  ``resumed``: steps whose results an earlier, interrupted run had left; ``settings``: what was asked for, in groups;
  ``left_out``: a line for each case whose files are missing.
- ``ours``: the configuration measured (``technique``, ``sampler``, ``label``, ``rays``, ``compensated``).
- ``summary``: for the regions ``surface`` (of cases with a ground) and ``image`` (of those without): ``ratio``
  (geometric mean over cases), ``worst`` and ``best`` (``case``, ``ratio``), ``ahead`` and ``cases`` (how many), and
  ``materials`` (geometric mean of each).
- ``cases``: a list with
  ``name``; ``case`` (``map``, ``material``, ``scene``, ``ground``); ``size`` of the film in pixels; ``scale`` of the
  map; ``surface_fraction``; ``means`` of the reference and ``floors`` (relMSE of a perfect image against it) by region;
  ``reference`` (``estimator``, ``spp``, ``passes``, ``seconds``, ``key``);
  ``screening``: the search for Mitsuba's best (``configuration``, ``budget`` asked for, ``spp``, ``seconds``,
  ``error`` less the floor);
  ``ours`` and the list ``theirs``: ``configuration`` and ``points`` (``spp``; ``seconds``, a spread; ``relmse``, a
  spread by region, as measured; ``error`` by region, its median less the floor, null where that is noise);
  ``preparation_seconds`` and ``compile_seconds`` of ours;
  and for ``surface`` and ``image`` the verdict, null where nothing can be said: ``ratio`` (seconds that the best of
  Mitsuba's needs for our error over ours, geometric mean over our budgets), ``min``, ``max``, ``outside`` (an error of
  ours was outside of what was measured of theirs, whose curve was continued), ``floor_limited`` (the floor is more than
  a quarter of an error of ours), ``winners`` (labels, by our budgets), ``budgets`` (``seconds``, ``error``, ``theirs``
  seconds, ``winner``, ``outside``, ``ratio``).
- ``floor``: ``rays_seconds`` of bare shadow rays and ``stratified_seconds`` of ``integrator`` with as many, spreads in
  seconds, and their ``ratio``, a spread; ``case``, ``size``, ``spp``, ``sampler``, ``rays_per_sample``. Null where its
  files are missing.
- ``peers``: a list, empty unless renderers of others were measured, with ``name``; ``case``; ``size``; ``scale``;
  ``reference``, its ``mean`` and its ``floor`` over pixels that are all surface; ``ours``: ``configuration`` and
  ``points``, as in cases; and the list ``peers``: ``name``; ``version``; ``configurations``: settings of those tried,
  by name, and ``chosen``, the best of them; ``trials`` (``name``, ``spp``, ``seconds``, ``error`` less the floor,
  ``setup_seconds``); ``curve``: of the best, as ours; ``load_seconds`` (import and scene) and ``setup_seconds`` (BVH,
  importance map), which no other time contains; at the highest budget ``agreement`` (mean over that of the reference)
  and ``plateau``, relMSE that more samples would not take away (the square of the bias), give or take
  ``plateau_noise``; ``failure``: one line where the renderer failed, else null; and the ``verdict``: ``ratio`` (seconds
  that it needs for our error over ours, geometric mean over our budgets), ``min``, ``max``, ``outside``, ``winners``,
  ``budgets``, as in cases.
- ``preparation``: a list with ``width``, ``height``, ``strata``, ``map_bytes``, ``film``; ``seconds`` of
  ``mitsuba_array`` and ``mitsuba_file`` (its envmap built from memory and from a .hdr file), and of what we add:
  ``ours`` (the default) and ``pinned`` (the paper's scheme with ``strata`` regions), spreads; ``peak_bytes_per_byte``
  of the map, of working memory; ``table_bytes`` of ``ours`` and ``pinned``: the leaves, and the samples that a launch
  makes of them; ``seconds_per_spp`` of ``ours`` and ``direct``.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..images.files import write_atomically
from .candidates import OURS, Configuration
from .cases import MATERIALS
from .peers.records import PeersResult
from .race import geometric_mean
from .records import REGIONS, CaseResult

FORMAT = "stratalux-bench"
VERSION = 2


@dataclass(frozen=True)
class BenchResult:
    """All that a run measured; see the module for each part. ``about``: everything of the JSON before ``ours``;
    ``floor`` is None where the files for it are missing."""

    about: dict[str, Any]
    cases: tuple[CaseResult, ...]
    floor: dict[str, Any] | None
    preparation: tuple[dict[str, Any], ...]
    ours: Configuration = OURS
    peers: tuple[PeersResult, ...] = ()

    @property
    def theirs(self) -> str:
        """Mitsuba's integrator that ours is measured against."""
        return "direct" if self.ours == OURS else "path"

    @cached_property
    def ratios(self) -> dict[str, dict[str, float]]:
        """Speed-up at equal error, of each case in the region that it is there for."""
        found: dict[str, dict[str, float]] = {region: {} for region in REGIONS}
        for result in self.cases:
            verdict = result.verdict(result.case.region)
            if verdict is not None:
                found[result.case.region][result.case.name] = verdict.ratio
        return found

    def summary(self, region: str) -> dict[str, Any] | None:
        """Geometric mean, worst and best case, and means by material; None if there is no ratio."""
        ratios = self.ratios[region]
        if not ratios:
            return None
        worst, best = min(ratios, key=lambda name: ratios[name]), max(ratios, key=lambda name: ratios[name])
        of = {result.case.name: result.case.material for result in self.cases}
        groups = {material: [ratio for name, ratio in ratios.items() if of[name] == material] for material in MATERIALS}
        return {
            "ratio": geometric_mean(list(ratios.values())),
            "worst": {"case": worst, "ratio": ratios[worst]},
            "best": {"case": best, "ratio": ratios[best]},
            "ahead": sum(ratio > 1 for ratio in ratios.values()),
            "cases": len(ratios),
            "materials": {material: geometric_mean(values) for material, values in groups.items() if values},
        }

    def to_json(self) -> dict[str, Any]:
        """The content of ``results.json``."""
        return _finite(
            {
                "format": FORMAT,
                "format_version": VERSION,
                **self.about,
                "ours": asdict(self.ours),
                "summary": {region: self.summary(region) for region in REGIONS},
                "cases": [result.to_json() for result in self.cases],
                "peers": [result.to_json() for result in self.peers],
                "floor": self.floor,
                "preparation": list(self.preparation),
            }
        )

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> BenchResult:
        """The inverse of :meth:`to_json`; summaries are derived anew."""
        parts = ("format", "format_version", "ours", "summary", "cases", "peers", "floor", "preparation")
        return cls(
            about={name: value for name, value in content.items() if name not in parts},
            cases=tuple(CaseResult.from_json(case) for case in content["cases"]),
            floor=content["floor"],
            preparation=tuple(content["preparation"]),
            ours=Configuration(**content["ours"]),
            peers=tuple(PeersResult.from_json(case) for case in content.get("peers", ())),
        )

    def write(self, path: str | Path) -> None:
        """Write the JSON to ``path``, complete or not at all."""
        text = json.dumps(self.to_json(), indent=1, allow_nan=False, ensure_ascii=False) + "\n"

        def write(name: str) -> None:
            Path(name).write_text(text, encoding="utf-8")

        write_atomically(path, write)

    @classmethod
    def read(cls, path: str | Path) -> BenchResult:
        """Read what :meth:`write` has written; raises :class:`InputError`."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            if content["format"] != FORMAT or content["format_version"] != VERSION:
                raise ValueError("another format or version")
            return cls.from_json(content)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: holds no results of stratalux bench ({type(error).__name__}: {error})") from None


def _finite(value: Any) -> Any:
    """``value`` with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
