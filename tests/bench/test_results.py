"""What the benchmark leaves: JSON there and back, the page, the picture."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from stratalux import InputError
from stratalux.bench import BenchResult
from stratalux.bench.markdown import markdown, marks
from stratalux.bench.picture import draw
from tests.bench.made_up import bench_result


@pytest.fixture(scope="module")
def result() -> BenchResult:
    return bench_result()


def test_json_there_and_back(result: BenchResult, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    result.write(path)
    assert BenchResult.read(path) == result
    content = json.loads(path.read_text())
    assert content["format"] == "stratalux-bench" and content["cases"][0]["surface"]["ratio"] == pytest.approx(2)


def test_the_noise_of_the_reference_is_subtracted_and_marked(result: BenchResult) -> None:
    clean, noisy, _ = result.cases
    verdict = noisy.verdict("surface")
    assert verdict is not None and verdict.ratio == pytest.approx(0.5)
    assert noisy.limited("surface") and not clean.limited("surface")
    assert marks(noisy, "surface").endswith("†")


def test_the_summary_is_a_geometric_mean_and_leaves_silhouettes_to_the_whole_image(result: BenchResult) -> None:
    surface, image = result.summary("surface"), result.summary("image")
    assert surface is not None and image is not None
    assert surface["ratio"] == pytest.approx(1) and surface["cases"] == 2 and surface["ahead"] == 1
    assert surface["worst"] == {"case": "teapot-metal-sky", "ratio": pytest.approx(0.5)}
    assert surface["materials"] == {"diffuse": pytest.approx(2), "metal": pytest.approx(0.5)}
    assert image["ratio"] == pytest.approx(8) and image["cases"] == 1


def test_the_page_names_the_machine_and_every_case(result: BenchResult) -> None:
    page = markdown(result)
    assert page.endswith("\n") and "a machine, 2 core(s)" in page and "mitsuba 3.9.1" in page
    for row in ("| surfaces | **1.00** | 2.00 | - | 0.50 | - |", "| buddha | diffuse | grace | 1, 4, 16, 64 |", "8.00"):
        assert row in page
    assert "| 32x16 | 1 s | 1 s | 1 s | 1 s | - | 1.5 | 3.5 | 6.3 MB | 3.1 MB | 1e+03 ms | 1e+03 ms |" in page
    widths = [{line.count("|") for line in block.splitlines()} for block in page.split("\n\n") if block[0] == "|"]
    assert widths and all(len(width) == 1 for width in widths)


def test_nan_becomes_null(result: BenchResult) -> None:
    result = BenchResult({**result.about, "x": math.nan}, (), {}, ())
    assert result.to_json()["x"] is None and result.to_json()["summary"] == {"surface": None, "image": None}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"format": "another"}', '{"format": "stratalux-bench", "format_version": 1}']
)
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"x\.json: holds no results of stratalux bench"):
        BenchResult.read(path)
    with pytest.raises(InputError, match="cannot be read"):
        BenchResult.read(tmp_path / "none.json")


def test_the_picture(result: BenchResult, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    draw(result, tmp_path)
    draw(BenchResult(result.about, (), {}, ()), tmp_path / "..")
    assert (tmp_path / "bench.svg").stat().st_size > 1000 and (tmp_path / "bench.png").stat().st_size > 1000
