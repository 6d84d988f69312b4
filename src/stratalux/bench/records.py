"""What the benchmark records of a case: points, curves, and the verdicts that follow from them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..comparison.records import Spread
from .candidates import Configuration, Trial
from .cases import Case
from .race import Curve, Verdict, race

REGIONS = ("surface", "image")
FLOOR_SHARE = 0.25
"""A measured error of which the reference's noise makes up more than this is marked."""
_USABLE = 0.8
"""Where the floor is more than this share of the measured error, the difference says nothing and is left out."""


@dataclass(frozen=True)
class Point:
    """A configuration at ``spp`` samples per pixel. ``errors``: relMSE as measured, by region, of every seed."""

    spp: int
    seconds: Spread
    errors: dict[str, Spread]

    def error(self, region: str, floor: float) -> float | None:
        """The error against the truth: what was measured, less the reference's own ``floor``. None if that is noise."""
        measured = self.errors[region].median
        return measured - floor if measured > 0 and floor <= _USABLE * measured else None

    def limited(self, region: str, floor: float) -> bool:
        """Whether the reference's noise is a large part of what was measured."""
        return floor > FLOOR_SHARE * self.errors[region].median


@dataclass(frozen=True)
class CurveRecord:
    """The points of a configuration, by samples."""

    configuration: Configuration
    points: tuple[Point, ...]

    def usable(self, region: str, floor: float) -> tuple[tuple[Point, float], ...]:
        """The points whose error is not lost in the reference's noise, and that error."""
        errors = ((point, point.error(region, floor)) for point in self.points)
        return tuple((point, error) for point, error in errors if error is not None)

    def curve(self, region: str, floor: float) -> Curve:
        """Seconds and error of what is usable."""
        return Curve(tuple((point.seconds.median, error) for point, error in self.usable(region, floor)))


@dataclass(frozen=True)
class CaseResult:
    """A case as measured.

    ``size``: of the film in pixels. ``scale``: of the map. ``means``: of the reference, and ``floors``: the relMSE that
    a perfect image would have against it, by region (``surface`` only if some pixel is all surface).
    ``reference``: ``spp``, ``passes``, ``seconds`` and ``key``. ``trials``: the screening. ``ours`` and
    ``theirs``: curves. ``preparation_seconds`` and ``compile_seconds`` of ours (Dr.Jit's cache on disk counts).
    """

    case: Case
    size: tuple[int, int]
    scale: float
    surface_fraction: float
    means: dict[str, float]
    floors: dict[str, float]
    reference: dict[str, Any]
    trials: tuple[Trial, ...]
    ours: CurveRecord
    theirs: tuple[CurveRecord, ...]
    preparation_seconds: float
    compile_seconds: float

    def verdict(self, region: str) -> Verdict | None:
        """Our budgets against the lower envelope of their curves; None if nothing can be said."""
        if region not in self.floors:
            return None
        floor = self.floors[region]
        theirs = {record.configuration.label: record.curve(region, floor) for record in self.theirs}
        return race(self.ours.curve(region, floor).points, theirs)

    def limited(self, region: str) -> bool:
        """Whether the reference's noise is a large part of an error of ours; theirs are read off at the same errors."""
        return region in self.floors and any(point.limited(region, self.floors[region]) for point in self.ours.points)

    def to_json(self) -> dict[str, Any]:
        """All of it, with the verdicts; see :mod:`stratalux.bench.results`."""
        return {
            "name": self.case.name,
            "case": asdict(self.case),
            "size": list(self.size),
            "scale": self.scale,
            "surface_fraction": self.surface_fraction,
            "means": self.means,
            "floors": self.floors,
            "reference": self.reference,
            "screening": [asdict(trial) for trial in self.trials],
            "ours": curve_json(self.ours, self.floors),
            "theirs": [curve_json(record, self.floors) for record in self.theirs],
            "preparation_seconds": self.preparation_seconds,
            "compile_seconds": self.compile_seconds,
            **{region: self._verdict(region) for region in REGIONS},
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> CaseResult:
        """The inverse of :meth:`to_json`; verdicts are derived anew."""
        return cls(
            case=Case(**content["case"]),
            size=(int(content["size"][0]), int(content["size"][1])),
            scale=content["scale"],
            surface_fraction=content["surface_fraction"],
            means=content["means"],
            floors=content["floors"],
            reference=content["reference"],
            trials=tuple(
                Trial(**{**trial, "configuration": Configuration(**trial["configuration"])})
                for trial in content["screening"]
            ),
            ours=curve_from_json(content["ours"]),
            theirs=tuple(curve_from_json(record) for record in content["theirs"]),
            preparation_seconds=content["preparation_seconds"],
            compile_seconds=content["compile_seconds"],
        )

    def _verdict(self, region: str) -> dict[str, Any] | None:
        verdict = self.verdict(region)
        return None if verdict is None else {**verdict_json(verdict), "floor_limited": self.limited(region)}


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """The ratio, its range, and the duels that it comes from."""
    return {
        "ratio": verdict.ratio,
        "min": verdict.lowest,
        "max": verdict.highest,
        "outside": verdict.outside,
        "winners": list(verdict.winners),
        "budgets": [{**asdict(duel), "ratio": duel.ratio} for duel in verdict.duels],
    }


def curve_json(record: CurveRecord, floors: dict[str, float]) -> dict[str, Any]:
    """A configuration and its points; ``floors``: of the reference, by region."""
    return {
        "configuration": asdict(record.configuration),
        "points": [
            {
                "spp": point.spp,
                "seconds": spread_json(point.seconds),
                "relmse": {region: spread_json(spread) for region, spread in point.errors.items()},
                "error": {region: point.error(region, floors[region]) for region in point.errors},
            }
            for point in record.points
        ],
    }


def spread_json(spread: Spread) -> dict[str, Any]:
    """``median``, ``min``, ``max`` and ``values``."""
    return {"median": spread.median, "min": spread.minimum, "max": spread.maximum, "values": list(spread.values)}


def spread_from_json(content: dict[str, Any]) -> Spread:
    return Spread(tuple(content["values"]))


def curve_from_json(content: dict[str, Any]) -> CurveRecord:
    """The inverse of :func:`curve_json`."""
    points = tuple(
        Point(
            point["spp"],
            spread_from_json(point["seconds"]),
            {region: spread_from_json(spread) for region, spread in point["relmse"].items()},
        )
        for point in content["points"]
    )
    return CurveRecord(Configuration(**content["configuration"]), points)
