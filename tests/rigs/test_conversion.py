"""Maps for other tools: without their sun, as harmonics, as irradiance."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap, EnvironmentMapWarning, InputError, convert_map
from stratalux.errors import RigWarning
from stratalux.maps.geometry import direction
from stratalux.maps.irradiance import irradiance as exact_irradiance
from stratalux.maps.layouts import LAYOUTS
from stratalux.maps.sheets import read_sheet
from stratalux.rigs.conversion import irradiance_sheet
from stratalux.rigs.formats import read_rig
from stratalux.rigs.harmonics import COSINE, harmonics, of_radiance
from stratalux.rigs.quality import irradiance, sources, spread
from tests.images.make import write
from tests.rigs.maps import blobs_map, random_map

NORMALS = spread(200)


@pytest.fixture
def sky(tmp_path: Path) -> Path:
    """A sun 2 degrees wide in a coloured sky."""
    height = 128
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), np.arange(height) / (height - 1))
    d = direction(u, v)
    towards = np.array([0.5, 0.6, 0.4]) / np.linalg.norm([0.5, 0.6, 0.4])
    base = 0.4 + 0.3 * d[..., 1:2] * np.array([0.5, 0.8, 1.0]) + 0.1 * d[..., 0:1]
    sun = 4000 * np.exp(-(((1 - d @ towards) / 2e-4) ** 2))[..., None] * np.array([1.0, 0.9, 0.7])
    return write(tmp_path / "sky.exr", (base + sun).astype(np.float32))


def under(texels: NDArray[np.float32]) -> NDArray[np.float64]:
    return irradiance(*sources(EnvironmentMap(texels)), NORMALS)


def test_the_sun_and_the_rest_are_the_map(sky: Path, tmp_path: Path) -> None:
    """The light of both together is that of the map, and so is the irradiance of all normals."""
    rest_file, light_file = tmp_path / "rest.exr", tmp_path / "sun.json"
    made = convert_map(sky, rest_file, remove_sun=True, lights=[(None, light_file), ("three", tmp_path / "t.json")])
    whole, rest, sun = EnvironmentMap.load(sky), EnvironmentMap.load(rest_file), read_rig(light_file)
    assert made.sun is not None and made.sun.is_one and made.sun.share > 0.4
    assert len(sun) == 1 and sun.angle[0] == pytest.approx(made.sun.angle) and (tmp_path / "t.json").exists()
    assert rest.texels.max() < 1.2 < 1000 < whole.texels.max()
    np.testing.assert_allclose(rest.sheet.flux + sun.colour[0], whole.sheet.flux, rtol=1e-3)
    E = under(whole.texels)
    apart = under(rest.texels) + np.maximum(NORMALS @ sun.direction[0], 0)[:, None] * sun.colour[0] - E
    assert np.sqrt((apart**2).sum() / (E**2).sum()) < 1e-3


def test_a_map_without_a_sun_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / "dim.exr", random_map())
    with pytest.warns(RigWarning, match=r"dim\.exr: the map has no sun: .*; that is what is left out"):
        convert_map(path, tmp_path / "rest.exr", remove_sun=True)


@pytest.mark.parametrize("texels", [random_map(), blobs_map()], ids=["random", "blobs"])
def test_harmonics_are_those_of_the_map(texels: NDArray[np.float32]) -> None:
    """Against sums over points between the texels, where the radiance is bilinear."""
    height, width = texels.shape[:2]
    n = 8
    v = (np.arange((height - 1) * n) + 0.5) / n
    u = (np.arange(width * n) + 0.5) / n
    row, column = v.astype(int), u.astype(int)
    y, x = (v - row)[:, None, None], (u - column)[None, :, None]
    wide = np.concatenate([texels, texels[:, :1]], axis=1).astype(np.float64)
    upper = wide[row][:, column] * (1 - x) + wide[row][:, column + 1] * x
    lower = wide[row + 1][:, column] * (1 - x) + wide[row + 1][:, column + 1] * x
    L = upper * (1 - y) + lower * y
    d = direction(*np.meshgrid((u + 0.5) / width, v / (height - 1)))
    weight = np.sin(np.pi * v / (height - 1)) * np.pi / (height - 1) / n * 2 * np.pi / width / n
    expected = np.einsum("yxk,yxc,y->kc", harmonics(d), L, weight)
    np.testing.assert_allclose(of_radiance(texels), expected, atol=2e-4 * np.abs(expected).max())


def test_files_of_harmonics_evaluate_to_the_irradiance(tmp_path: Path) -> None:
    """The GLSL as a compiler would take it, in Python's words; the JSON by its own words."""
    texels = blobs_map()
    source = write(tmp_path / "map.exr", texels)
    made = convert_map(source, [tmp_path / "a.json", tmp_path / "a.glsl"], to="sh")
    assert made.files == (tmp_path / "a.json", tmp_path / "a.glsl")
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["version"] == 1 and content["frame"]["middle_of_the_map"] == "+z"
    x, y, z = NORMALS.T
    terms = content["harmonics"].values()
    basis = np.stack([eval(term, {"x": x, "y": y, "z": z}) * np.ones_like(x) for term in terms])
    E = basis.T @ np.array(content["irradiance"])
    np.testing.assert_allclose(basis.T @ (COSINE[:, None] * content["radiance"]), E, rtol=1e-6)

    code = (tmp_path / "a.glsl").read_text()
    numbers = np.array([[float(v) for v in row.split(",")] for row in re.findall(r"vec3\(([-+.e\d, ]+)\)", code)])
    assert numbers.shape == (9, 3)
    body = re.search(r"return max\((.*),\s*0\.0\);", code, re.DOTALL)
    assert body is not None
    expression = " ".join(re.sub(r"n\.([xyz])", r"\1", body[1]).split())
    names = {"irradianceCoefficients": [row[:, None] for row in numbers], "x": x, "y": y, "z": z}
    found = np.maximum(eval(expression, names), 0).T
    np.testing.assert_allclose(found, np.maximum(E, 0), rtol=1e-4, atol=1e-4 * E.max())
    # Nine harmonics are within a few per cent of the irradiance (Ramamoorthi and Hanrahan 2001).
    exact = np.stack([exact_irradiance(texels, n) for n in NORMALS[:20]])
    assert np.abs(E[:20] - exact).max() < 0.09 * exact.max()


def test_irradiance_is_a_map() -> None:
    texels = blobs_map()
    made = irradiance_sheet(EnvironmentMap(texels), 16)
    u, v = (np.arange(32) + 0.5) / 32, np.arange(16) / 15
    for i, j in ((0, 0), (4, 7), (9, 20), (15, 3)):
        expected = exact_irradiance(texels, direction(u[j], v[i])) / np.pi
        np.testing.assert_allclose(made.texels[0, i, j], expected, rtol=0.01)


def test_irradiance_has_any_layout(tmp_path: Path) -> None:
    source = write(tmp_path / "map.exr", np.full((8, 16, 3), 0.5, np.float32))
    convert_map(source, tmp_path / "a.exr", to="cross", size=5, irradiance=True)
    sheet, _ = read_sheet(tmp_path / "a.exr")
    assert sheet.layout is LAYOUTS["cross"] and sheet.shape == (5, 5)
    np.testing.assert_allclose(sheet.texels, 0.5, rtol=2e-3)


def test_sizes_are_as_fine_as_the_map_unless_told(tmp_path: Path) -> None:
    source = write(tmp_path / "map.exr", np.ones((16, 32, 3), np.float32))
    for name, shape in {"cross": (8, 8), "mirror-ball": (20, 20)}.items():
        made = convert_map(source, tmp_path / "a.exr", to=name)
        assert read_sheet(tmp_path / "a.exr")[0].shape == shape
        assert made.what.endswith("from latlong, 32x16")
    with pytest.warns(EnvironmentMapWarning, match="taken for the layout mirror-ball, as its header says"):
        made = convert_map(tmp_path / "a.exr", tmp_path / "b.exr", size=24)
    assert made.what == "latlong, 48x24, from mirror-ball, 20x20"


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 4)])
def test_the_smallest_maps(tmp_path: Path, shape: tuple[int, int]) -> None:
    source = write(tmp_path / "map.pfm", np.full((*shape, 3), 0.5, np.float32))
    for name in ("latlong", "strip", "angular", "equal-area"):
        convert_map(source, tmp_path / "a.pfm", to=name, size=3 if name == "latlong" else 1)
        sheet, _ = read_sheet(tmp_path / "a.pfm", name)
        np.testing.assert_allclose(sheet.texels, 0.5, rtol=1e-4)


@pytest.mark.parametrize(
    ("outputs", "settings", "expected"),
    [
        ([], {}, "no output is given"),
        ("a.png", {}, "unknown image format '.png'"),
        ("a.exr", {"to": "globe"}, "globe"),
        ("a.exr", {"to": "sh"}, "harmonics are written as .json or .glsl"),
        ("a.json", {"to": "sh", "size": 4}, "leave --size and --irradiance out"),
        ("a.exr", {"lights": [(None, "s.json")]}, "is for the sun that --remove-sun leaves out"),
        ("a.exr", {"lights": [(None, "s.txt")], "remove_sun": True}, "no rig is written as '.txt'"),
        (["a.exr", "a.exr"], {}, "is to be written twice"),
        ("map.exr", {}, "is read, and would be lost"),
        ("a.exr", {"size": 0}, "size: 0 is too small"),
        ("a.exr", {"size": 2}, "size: 2 is too small for latlong; give at least 3"),
        ("a.exr", {"size": 99, "max_memory": 100_000}, "size: 99 rows of latlong take 0.00157 GB, more than 0.0001 GB"),
        ("right.exr", {"source": "left.exr"}, "right.exr: is read, and would be lost"),
    ],
)
def test_what_cannot_be_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, outputs: list[str], settings: dict[str, object], expected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path("map.exr"), np.ones((8, 16, 3), np.float32))
    source = str(settings.pop("source", "map.exr"))
    with pytest.raises(InputError, match=re.escape(expected)):
        convert_map(source, outputs, **settings)
    assert [path.name for path in tmp_path.iterdir()] == ["map.exr"]
