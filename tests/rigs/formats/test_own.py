"""Our own JSON, read back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stratalux.errors import InputError
from stratalux.rigs.formats.own import encode, read_rig
from stratalux.rigs.lights import Lights
from stratalux.rigs.quality import spread

LIGHTS = Lights(
    spread(3),
    np.array([[1.0, 2, 3], [0, 0, 0], [1e-3, 1e5, 1]]),
    np.array([0, 0.01, np.pi]),
    "by hand",
    np.array([1.0, 2, 3]),
    np.arange(27.0).reshape(9, 3) / 7,
    "sky.hdr",
    {"irradiance_error": 0.125},
)


def same(a: Lights, b: Lights) -> None:
    for name in ("direction", "colour", "solid_angle", "ambient"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    np.testing.assert_allclose(a.angle, b.angle, rtol=1e-14)
    assert (a.method, a.map, a.quality) == (b.method, b.map, b.quality)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    for lights in (LIGHTS, replace(LIGHTS, solid_angle=None, ambient=None, map=None, quality={})):
        path.write_bytes(encode(lights, path))
        same(read_rig(path), lights)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "is no rig of ours"),
        ({"version": 2}, "is a rig of version 2, and this reads 1"),
        ({"frame": {"up": "+z"}}, "its frame or its units"),
        ({"units": {}}, "its frame or its units"),
        ({"lights": []}, "lights: directions"),
        ({"lights": [{"direction": [0, 0, 2], "colour": [1, 1, 1]}]}, "is not a unit vector"),
        ({"lights": [{"direction": [0, 0, 1], "colour": [1, -1, 1]}]}, "a colour is negative"),
        ({"lights": [{"direction": [0, 0, 1], "colour": [1, None, 1]}]}, "a colour is negative or not finite"),
        ({"lights": [{"direction": [0, 0, 1], "colour": [1, 1]}]}, "is damaged"),
        ({"lights": [{"direction": [0, 0, 1]}]}, "is damaged"),
        ({"lights": [{"direction": [0, 0, 1], "colour": [1, 1, 1], "angle": 181}]}, "an angle is not"),
        ({"lights": "none"}, "is damaged"),
        ({"ambient": [1, 2, 3]}, r"the ambient light \(3,\)"),
        ({"quality": 3}, "is damaged"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    path = tmp_path / "rig.json"
    path.write_text(json.dumps({**json.loads(encode(LIGHTS, path)), **change}))
    with pytest.raises(InputError, match=words) as told:
        read_rig(path)
    assert str(told.value).startswith(f"{path}: ") and "\n" not in str(told.value)


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff\xfe", b"{", b"null", b"[" * 100000])
def test_files_that_are_something_else(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "rig.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no"):
        read_rig(path)
    with pytest.raises(InputError, match="no such file"):
        read_rig(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(tmp_path)


numbers = st.one_of(st.none(), st.integers(-3, 3), st.floats(), st.text(max_size=2), st.lists(st.floats(), max_size=3))


@given(key=st.sampled_from(["lights", "ambient", "method", "map", "quality"]), value=numbers)
@settings(max_examples=60)
def test_no_content_ends_in_a_traceback(tmp_path_factory: pytest.TempPathFactory, key: str, value: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_text(json.dumps({**json.loads(encode(LIGHTS, path)), key: value}))
    try:
        read_rig(path)
    except InputError as error:
        assert "\n" not in str(error)
