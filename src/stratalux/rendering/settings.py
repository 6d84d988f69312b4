"""How a picture is sampled and by what, and all that it depends on in one object."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..images.settings import MEMORY, MemorySettings, OutputSettings
from ..scenes.settings import CameraSettings, SceneSettings
from ..settings import Kind, Settings, command_line, option

METADATA = "stratalux"
"""Under this name an OpenEXR file has the JSON of its :class:`PictureSettings`."""

SAMPLES = "stratalux:samples"
"""Under this name it has the samples per pixel, and the seeds after them."""

LARGEST_SEED = (1 << 32) - 1
MOST_SAMPLES = 1 << 30
MOST_SEGMENTS = 1 << 20
USUAL_DEPTH = 8
"""Of paths, where nothing tells: what is reflected seven times."""
MOST_STRATA, MOST_PROPOSALS = 1 << 20, 1 << 16


_UNITS = {"d": 86400, "h": 3600, "m": 60, "s": 1}
_LONGEST = 365 * 86400.0


def _duration(value: Any) -> float:
    try:
        seconds = float(value)
    except (TypeError, ValueError):
        raise InputError(f"time: {value!r} is none; give seconds") from None
    if not 0 < seconds <= _LONGEST:
        raise InputError(f"time: {value} s is out of range; give more than 0 s, and a year at most")
    return seconds


def _cluster(value: Any) -> str:
    text = str(value)
    if re.fullmatch(r"local:[1-9]\d{0,3}|(tcp|tls|ucx|wss?)://\S+", text):
        return text
    raise InputError(f"cluster: {text!r} is none; give the address of a scheduler, as tcp://HOST:8786, or local:N")


def _parse_duration(text: str) -> float:
    match = re.fullmatch("".join(rf"(?:(\d+(?:\.\d+)?){unit})?" for unit in _UNITS), text)
    if re.fullmatch(r"\d+(\.\d*)?|\.\d+", text):
        return _duration(text)
    if match is None or not any(match.groups()):
        raise InputError(f"'{text}' is no duration; write seconds, or for example 90s, 30m, 1h30m")
    return _duration(sum(float(n) * unit for n, unit in zip(match.groups(), _UNITS.values(), strict=True) if n))


@dataclass(frozen=True)
class SamplingSettings(Settings):
    """How it is sampled."""

    technique: str | None = option(
        None,
        "How light is sampled: NAME[:key=value,...], see stratalux techniques.",
        "-t",
        "--technique",
        metavar="NAME[:key=value,...]",
        default_text="path-stratified; stratified for direct light",
    )
    direct: bool = option(False, "Direct light alone, without what is reflected between surfaces.", "--direct")
    max_depth: int | None = option(
        None,
        "Segments of a path from the camera to a light, at most: 2 is direct light, -1 no limit.",
        "--max-depth",
        minimum=-1,
        maximum=MOST_SEGMENTS,
        default_text=f"the scene's own, or {USUAL_DEPTH}",
    )
    strata: int | None = option(
        None, "Pin the scheme of the paper, with N regions.", "-N", "--strata", minimum=1, maximum=MOST_STRATA
    )
    proposals: int | None = option(
        None, "Pin the scheme of the paper, with M proposals.", "-M", "--proposals", minimum=1, maximum=MOST_PROPOSALS
    )
    spp: int = option(
        0,
        "Samples per pixel.",
        "-s",
        "--spp",
        minimum=1,
        maximum=MOST_SAMPLES,
        default_text="the scene's own, or 64",
    )
    time: float | None = option(
        None,
        "Stop after so long: seconds, or as in 90s, 30m, 1h30m.",
        "--time",
        kind=Kind("DURATION", _parse_duration, _duration, lambda seconds: f"{seconds:.15g}s"),
    )
    target_error: float | None = option(
        None,
        "Stop when a pixel of the object has this relative standard error, as far as the passes tell.",
        "--target-error",
        minimum=1e-6,
        maximum=10,
    )
    seed: int = option(0, "Seed of the random numbers.", "--seed", minimum=0, maximum=LARGEST_SEED)
    hide_emitters: bool = option(False, "Leave the map out of the background.", "--hide-emitters")


@dataclass(frozen=True)
class MachineSettings(MemorySettings):
    """What computes it."""

    max_memory: int | None = option(
        None,
        "Memory that the process may take: a larger map is refused, and fewer samples are under way at the same time.",
        "--max-memory",
        kind=MEMORY,
        default_text="half of all",
    )

    variant: str | None = option(
        None,
        "Mitsuba variant.",
        "-m",
        "--variant",
        default_text="cuda_ad_rgb where it works, else llvm_ad_rgb",
    )
    cluster: str | None = option(
        None,
        "Render on a Dask cluster: the address of its scheduler, or local:N for N processes here.",
        "--cluster",
        kind=Kind("ADDRESS|local:N", _cluster, _cluster),
    )


@dataclass(frozen=True)
class PictureSettings(Settings):
    """All that a picture depends on. ``scene`` is None for a scene that a program has loaded by itself."""

    scene: SceneSettings | None = None
    camera: CameraSettings = field(default_factory=CameraSettings)
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    machine: MachineSettings = field(default_factory=MachineSettings)

    @classmethod
    def of(cls, source: str | Path | None, **settings: Any) -> PictureSettings:
        """The same from the settings of all groups as keywords; raises :class:`InputError` for an unknown one.

        ``source``: None for a scene that is loaded already, of which nothing can be said any more.
        """
        groups: dict[str, dict[str, Any]] = {name: {} for name in GROUPS}
        for key, value in settings.items():
            owner = next((name for name, kind in GROUPS.items() if key in {f.name for f in fields(kind)}), None)
            if owner is None:
                raise InputError(f"setting '{key}' is unknown; see help(stratalux.render)")
            if source is None and (owner == "scene" or (owner == "camera" and key != "camera")):
                raise InputError(f"setting '{key}': the scene is loaded already; give it to load_scene")
            groups[owner][key] = value
        made = {name: kind(**groups[name]) for name, kind in GROUPS.items() if name != "scene"}
        return cls(scene=None if source is None else SceneSettings(source, **groups["scene"]), **made)  # type: ignore[arg-type]

    @classmethod
    def of_file(cls, path: str | Path) -> PictureSettings:
        """What an OpenEXR file of ours remembers. Raises :class:`InputError` if it has no such memory."""
        from ..images.reading import read_text

        text = read_text(path, METADATA)
        if text is None:
            raise InputError(f"{path}: says nothing of settings; give an .exr that stratalux has rendered")
        return cls.from_text(text, str(path))

    @classmethod
    def from_text(cls, text: str, name: str = "settings") -> PictureSettings:
        """The same from JSON as text; raises :class:`InputError` that begins with ``name``."""
        try:
            content: Mapping[str, Any] = json.loads(text)
        except ValueError as error:
            raise InputError(f"{name}: is no JSON ({error})") from None
        try:
            return cls.from_json(content)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None

    def to_text(self) -> str:
        """JSON on one line."""
        return json.dumps(self.to_json(), ensure_ascii=False)

    def command(self, *outputs: str | Path) -> str:
        """The command line that makes this picture. Raises :class:`InputError` where no command can."""
        words = [word for path in outputs for word in ("-o", str(path))]
        return command_line("stratalux", "render", self._scene, *self._others, *words)

    def call(self) -> str:
        """The Python call that makes this picture. Raises :class:`InputError` where none can."""
        given = {name: value for group in (self._scene, *self._others) for name, value in group.changed().items()}
        source = given.pop("source")
        written = "".join(f", {name}={value!r}" for name, value in given.items())
        return f"stratalux.render({source!r}{written})"

    @property
    def _scene(self) -> SceneSettings:
        if self.scene is None:
            raise InputError("the scene was loaded by a program of its own; nothing else can make its picture")
        list(self.scene.words())  # raises for a map that is no file
        return self.scene

    @property
    def _others(self) -> tuple[Settings, ...]:
        return self.camera, self.sampling, self.output, self.machine


GROUPS: dict[str, type[Settings]] = {
    "scene": SceneSettings,
    "camera": CameraSettings,
    "sampling": SamplingSettings,
    "output": OutputSettings,
    "machine": MachineSettings,
}
"""The groups of :class:`PictureSettings`; no two share a name of a setting."""
