"""Steps are computed once, and again when anything that they depend on has changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.comparison.study import Result, Study
from stratalux.errors import CacheWarning

COMMON: dict[str, Any] = {"version": "1"}


class Counter:
    """A step that counts how often it is computed."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, fraction: Any) -> Result:
        self.calls += 1
        fraction(0.5)
        return {"image": np.arange(6.0).reshape(2, 3), "flag": np.array([True]), "n": self.calls, "list": [1, [2.5]]}


def test_a_step_is_found_again(tmp_path: Path) -> None:
    step = Counter()
    first = Study(tmp_path, COMMON, 1.0).step("a", {"n": 1}, 1.0, step)
    study = Study(tmp_path, COMMON, 1.0)
    second = study.step("a", {"n": 1}, 1.0, step)
    assert step.calls == 1 and study.resumed == 1
    assert second["n"] == 1 and second["list"] == [1, [2.5]]
    np.testing.assert_array_equal(first["image"], second["image"])
    assert second["flag"].dtype == bool
    assert study.numbers == {"a": {"n": 1, "list": [1, [2.5]]}}


@pytest.mark.parametrize(
    ("name", "common", "settings"),
    [("b", COMMON, {"n": 1}), ("a", {"version": "2"}, {"n": 1}), ("a", COMMON, {"n": 2})],
)
def test_what_a_step_depends_on_is_its_key(
    tmp_path: Path, name: str, common: dict[str, Any], settings: dict[str, Any]
) -> None:
    step = Counter()
    Study(tmp_path, COMMON, 1.0).step("a", {"n": 1}, 1.0, step)
    Study(tmp_path, common, 1.0).step(name, settings, 1.0, step)
    assert step.calls == 2


@pytest.mark.parametrize("damage", ["cut", "empty", "text"])
def test_a_damaged_file_counts_as_none(tmp_path: Path, damage: str) -> None:
    step = Counter()
    Study(tmp_path, COMMON, 1.0).step("a", {}, 1.0, step)
    (path,) = tmp_path.iterdir()
    data = path.read_bytes()
    path.write_bytes({"cut": data[: len(data) // 2], "empty": b"", "text": b"hello"}[damage])
    with pytest.warns(CacheWarning, match="damaged"):
        Study(tmp_path, COMMON, 1.0).step("a", {}, 1.0, step)
    assert step.calls == 2
    Study(tmp_path, COMMON, 1.0).step("a", {}, 1.0, step)
    assert step.calls == 2


def test_an_interrupted_step_leaves_nothing(tmp_path: Path) -> None:
    def interrupted(fraction: Any) -> Result:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Study(tmp_path, COMMON, 1.0).step("a", {}, 1.0, interrupted)
    assert not list(tmp_path.iterdir())


def test_progress_goes_on_over_all_steps(tmp_path: Path) -> None:
    seen: list[tuple[float, str]] = []
    study = Study(tmp_path, COMMON, 4.0, lambda done, what: seen.append((done, what)))
    study.step("a", {}, 1.0, Counter())
    study.step("b", {}, 3.0, Counter())
    assert [done for done, _ in seen] == pytest.approx([0, 1 / 8, 1 / 4, 1 / 4, 5 / 8, 1])
    assert {what for _, what in seen} == {"a", "b"}


def test_a_shared_step_counts_once(tmp_path: Path) -> None:
    study = Study(tmp_path, COMMON, 2.0)
    for _ in range(2):
        study.step("a", {}, 1.5, Counter())
    study.step("b", {}, 0.5, Counter())
    assert study.done == 2.0
