"""Curves, heat maps, tables and claims as markup."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from stratalux.report.charts import chart_markup
from stratalux.report.model import Chart, Claim, Curve, HeatMap, Table
from stratalux.report.tables import claims_markup, heat_map_markup, table_block
from stratalux.report.text import Identifiers, number, script_json
from tests.report.samples import NASTY, chart, heat_map, table

SVG = "{http://www.w3.org/2000/svg}"


def parsed(markup: str) -> ElementTree.Element:
    """Markup whose elements are all closed, as XML."""
    return ElementTree.fromstring(markup)


def svg_of(chart: Chart) -> ElementTree.Element:
    svg = parsed(chart_markup(chart, Identifiers())).find(f".//{SVG}svg[@role='img']")
    assert svg is not None
    return svg


def test_a_chart_has_its_points_bars_and_floor() -> None:
    svg = svg_of(chart())
    assert len(svg.findall(f".//{SVG}g[@class='point']")) == 6
    assert len(svg.findall(f".//{SVG}path[@class='bar']")) == 3  # of the repeats that differ
    assert "noise" in [text.text for text in svg.iter(f"{SVG}text")]
    says = [title.text for title in svg.iter(f"{SVG}title")]
    assert says[1] == "stratified\nrays: 64\nrelMSE: 0.02\nfrom 0.015 to 0.03"
    assert all(name in svg.attrib["aria-label"] for name in ("stratified", "direct", "lights"))


def test_axes_are_logarithmic() -> None:
    points = svg_of(chart(floor=None)).findall(f".//{SVG}g[@class='point']")
    x = [float(point.attrib["data-x"]) for point in points[:3]]
    assert x[1] - x[0] == pytest.approx(x[2] - x[1], abs=0.2)  # 16, 64, 256
    y = [float(point.attrib["data-y"]) for point in (points[3], points[4])]
    assert y[0] < y[1]  # the larger error is higher up


@pytest.mark.parametrize("logarithmic", [True, False])
@pytest.mark.parametrize(
    "points",
    [
        ((1, 2, 1, 3),),
        ((1, 2, 2, 2), (1e6, 1e-9, 1e-9, 1e-9)),
        ((1, 2, 2, 2), (2, 2.01, 2, 2.02)),
        ((1, 0, 0, 0), (2, np.nan, 1, 1), (3, 1, 1, np.inf), (4, 1, 1, 1)),
    ],
)
def test_points_and_ticks_stay_inside(points: tuple[tuple[float, ...], ...], logarithmic: bool) -> None:
    odd = Chart("Odd", "x", "y", (Curve("c", points),), logarithmic=logarithmic)  # type: ignore[arg-type]
    svg = svg_of(odd)
    drawn = svg.findall(f".//{SVG}g[@class='point']")
    assert drawn
    for point in drawn:
        assert 60 < float(point.attrib["data-x"]) < 640 and 30 < float(point.attrib["data-y"]) < 350
    labels = [text.text for text in svg.iter(f"{SVG}text")]
    assert len(labels) >= 4 and not any(label is None for label in labels)


def test_a_chart_without_points_says_so() -> None:
    assert "no value" in chart_markup(chart(curves=(Curve("c", ((1, 0, 0, 0),)),)), Identifiers())


def test_many_curves_have_markers_of_their_own() -> None:
    curves = tuple(Curve(f"c{k}", ((1, k + 1, k + 1, k + 1),)) for k in range(14))
    groups = svg_of(chart(curves=curves)).findall(f".//{SVG}g[@data-curve]")
    looks = []
    for group in groups:
        marker = next(element for element in group.iter() if element.get("class") == "marker")
        corners = marker.get("points", "").split()
        first = [tuple(map(float, corner.split(","))) for corner in corners]
        shape = str([(round(x - first[0][0]), round(y - first[0][1])) for x, y in first])
        looks.append((group.attrib["class"], shape))
    assert len(set(looks)) == 14


def test_a_heat_map_marks_the_best_and_leaves_gaps() -> None:
    markup = heat_map_markup(heat_map(), Identifiers())
    root = parsed(markup)
    cells = [[cell for cell in row.findall("td")] for row in root.findall(".//tbody/tr")]
    assert ["best" in "".join(cell.itertext()) for cell in cells[1]] == [True, False, False]
    assert "".join(cells[0][2].itertext()) == "–" and "style" not in cells[0][2].attrib
    assert [head.attrib["scope"] for head in root.findall(".//th")] == ["col"] * 3 + ["row"] * 2
    upward = parsed(heat_map_markup(replace(heat_map(), lower_is_better=False), Identifiers()))
    assert "best" in "".join(upward.findall(".//tbody/tr")[1].findall("td")[2].itertext())
    empty = replace(heat_map(), values=np.full((2, 3), np.nan))
    assert "★</span>" not in heat_map_markup(empty, Identifiers())
    with pytest.raises(ValueError, match="Times"):
        heat_map_markup(replace(heat_map(), values=np.ones((3, 2))), Identifiers())


def test_columns_of_numbers_are_flush_right() -> None:
    root = parsed(table_block(table(), Identifiers()))
    assert [head.get("class") for head in root.findall(".//thead//th")] == [None, "number"]
    units = Table("t", ("a", "b", "c", "d"), (("1.2 s", "3×", "-", "2 of 3"), ("2 s", "4×", "5", "x")))
    root = parsed(table_block(units, Identifiers()))
    assert [head.get("class") for head in root.findall(".//thead//th")] == ["number", "number", "number", None]


def test_claims_stand_beside_each_other() -> None:
    root = parsed(claims_markup((Claim("It works.", "4×", "3×", "not tested", "Why not."),), "Claims"))
    text = ["".join(cell.itertext()) for cell in root.find(".//tbody/tr") or ()]
    assert text == ["–not tested", "It works.Why not.", "4×", "3×"]


def test_text_is_escaped() -> None:
    odd_chart = Chart(NASTY, NASTY, NASTY, (Curve(NASTY, ((1, 1, 1, 2),)),), floor=(1, NASTY), text=NASTY)
    odd_map = HeatMap(NASTY, NASTY, NASTY, (NASTY,), (NASTY,), np.ones((1, 1)), NASTY, True, NASTY)
    for markup in (
        chart_markup(odd_chart, Identifiers()),
        heat_map_markup(odd_map, Identifiers()),
        table_block(Table(NASTY, (NASTY,), ((NASTY,),), NASTY), Identifiers()),
        claims_markup((Claim(NASTY, NASTY, NASTY, "holds", NASTY),), NASTY),
    ):
        assert "</script" not in markup and "<!--" not in markup
        assert NASTY in "".join(parsed(markup).itertext())
    assert script_json({"a": NASTY}).count("<") == 0


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (1234.5, "1234"),
        (0.012345, "0.0123"),
        (1.0, "1"),
        (64, "64"),
        (12.0, "12"),
        (1.5e-5, "1.50e-5"),
        (2e7, "2.00e7"),
        (float("nan"), "nan"),
        (-0.5, "-0.5"),
    ],
)
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text
