"""What is recorded of the renderers of others in one case: curves, agreement with the reference, and the verdicts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..cases import Case
from ..race import Verdict, race
from ..records import CurveRecord, curve_from_json, curve_json, verdict_json

REGION = "surface"
"""Errors count in pixels that are all surface."""


@dataclass(frozen=True)
class PeerTrial:
    """A configuration as screened: ``spp`` taken, ``seconds``, ``error`` less the floor, ``setup_seconds`` before."""

    name: str
    spp: float
    seconds: float
    error: float
    setup_seconds: float


@dataclass(frozen=True)
class PeerRecord:
    """One renderer.

    ``configurations``: settings of all that were tried, by name; ``chosen``: the name of the best. ``trials``: the
    screening. ``curve``: of the best. ``load_seconds``: import and scene; ``setup_seconds``: before its first rendering
    (BVH, importance map). At the highest budget: ``agreement``, the mean over that of the reference, and ``plateau``,
    the relMSE that would stay with any number of samples, from the product of the differences of two seeds; it is
    uncertain by about ``plateau_noise``. ``failure``: why there is nothing more, in one line.
    """

    name: str
    version: str = ""
    configurations: dict[str, dict[str, Any]] | None = None
    chosen: str = ""
    trials: tuple[PeerTrial, ...] = ()
    curve: CurveRecord | None = None
    load_seconds: float | None = None
    setup_seconds: float | None = None
    agreement: float | None = None
    plateau: float | None = None
    plateau_noise: float | None = None
    failure: str | None = None


@dataclass(frozen=True)
class PeersResult:
    """A case. ``floor`` and ``mean``: of the reference, over pixels that are all surface; ``ours``: our curve."""

    case: Case
    size: tuple[int, int]
    scale: float
    reference: dict[str, Any]
    floor: float
    mean: float
    ours: CurveRecord
    peers: tuple[PeerRecord, ...]

    def verdict(self, peer: PeerRecord) -> Verdict | None:
        """Our budgets against the curve of ``peer``; None if nothing can be said."""
        if peer.curve is None:
            return None
        theirs = {peer.curve.configuration.label: peer.curve.curve(REGION, self.floor)}
        return race(self.ours.curve(REGION, self.floor).points, theirs)

    def to_json(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, name) for name in ("size", "scale", "reference", "floor", "mean")},
            "case": asdict(self.case),
            "name": self.case.name,
            "ours": curve_json(self.ours, {REGION: self.floor}),
            "peers": [self._peer(peer) for peer in self.peers],
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> PeersResult:
        """The inverse of :meth:`to_json`; verdicts are derived anew."""
        return cls(
            case=Case(**content["case"]),
            size=(int(content["size"][0]), int(content["size"][1])),
            **{name: content[name] for name in ("scale", "reference", "floor", "mean")},
            ours=curve_from_json(content["ours"]),
            peers=tuple(_peer(peer) for peer in content["peers"]),
        )

    def _peer(self, peer: PeerRecord) -> dict[str, Any]:
        verdict = self.verdict(peer)
        return {
            **asdict(peer),
            "curve": None if peer.curve is None else curve_json(peer.curve, {REGION: self.floor}),
            "verdict": None if verdict is None else verdict_json(verdict),
        }


def _peer(content: dict[str, Any]) -> PeerRecord:
    fields = {name: value for name, value in content.items() if name != "verdict"}
    curve = fields["curve"]
    fields["curve"] = None if curve is None else curve_from_json(curve)
    fields["trials"] = tuple(PeerTrial(**trial) for trial in fields["trials"])
    return PeerRecord(**fields)
