"""The page as text; what it does in a browser is tested in test_browser."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from stratalux.report.encode import decode_pixels
from stratalux.report.html import render_report, write_report
from stratalux.report.model import ImageSet, Picture, Report, Section
from tests.report.samples import HEIGHT, NASTY, WIDTH, chart, heat_map, image_set, ramp, report, table


class Page(HTMLParser):
    """Elements with attributes, text outside of scripts and styles, headings, and what is never closed."""

    VOID = ("meta", "img", "br", "input")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self.open):
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def text() -> str:
    return render_report(report())


def test_the_page_is_whole(text: str) -> None:
    page = Page(text)
    assert page.open == []
    assert "A report" in page.text and "Take care." in page.text and "a small one" in page.text
    assert [h for h, _ in page.elements if re.fullmatch(r"h\d", h)][:4] == ["h1", "h2", "h2", "h2"]
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {a["href"] for a in page.all("a")} == {"#report-content", "#claims", "#pictures", "#report-facts"}
    labels = [a["aria-labelledby"] for _, a in page.elements if "aria-labelledby" in a]
    assert set(labels) <= set(ids)


def test_verdicts_are_counted(text: str) -> None:
    summary = re.search(r'<ul class="verdicts".*?</ul>', text)
    assert summary
    found = Page(summary.group()).text
    assert found == "✓2 holds◐1 partly✗1 fails–1 not tested"


def test_nothing_is_loaded(text: str) -> None:
    page = Page(text)
    for tag, attributes in page.elements:
        for name in ("src", "href", "data", "action", "poster", "srcset"):
            value = attributes.get(name) or ""
            assert value.startswith(("#", "data:")) or not value, f"{tag} {name}"
        assert not any(name.startswith("on") for name in attributes), f"handler in {tag}"
    assert not re.search(r"url\(|@import|import\(|\bimport .* from|fetch\(|XMLHttpRequest", text)
    policies = [meta["content"] for meta in page.all("meta") if "http-equiv" in meta]
    assert policies and policies[0] and "default-src 'none'" in policies[0]


def test_the_pixels_are_there(text: str) -> None:
    payloads = dict(re.findall(r'<script type="text/plain" id="([\w-]+)">([A-Za-z0-9+/=]*)</script>', text))
    assert len(payloads) == 4  # double, same, which is the reference too, half, FLIP
    images = [
        decode_pixels(payload, HEIGHT, WIDTH, 1.0)
        for payload in payloads.values()
        if len(base64.b64decode(payload)) > 100
    ]
    assert any(np.allclose(image, ramp(2), rtol=1e-3) for image in images)
    stills = [image["src"] or "" for image in Page(text).all("img")]
    assert len(stills) == 4 and all(still.startswith("data:image/jpeg;base64,/9j/") for still in stills)


def test_text_is_escaped() -> None:
    odd = ImageSet(NASTY, (Picture(NASTY, ramp(), {NASTY: NASTY}),), text=NASTY)
    sections = (Section("a", NASTY, (NASTY,), blocks=(odd, chart(title=NASTY))),)
    text = render_report(Report(NASTY, NASTY, (NASTY,), sections, {NASTY: NASTY}, (NASTY,)))
    page = Page(text)
    assert page.open == [] and page.text.count(NASTY) >= 10


def test_a_report_may_be_almost_empty() -> None:
    page = Page(render_report(Report("t", "", ("Nothing.",), ())))
    assert page.open == [] and "Nothing." in page.text


def noisy_set(k: int) -> ImageSet:
    noise = np.random.default_rng(k).random((64, 64, 3)).astype(np.float32)
    return ImageSet(f"Set {k}", (Picture("noise", noise),))


def test_what_is_too_large_is_left_out_from_below() -> None:
    full = report(images=tuple(noisy_set(k) for k in range(4)))
    nothing = len(render_report(full, largest=0).encode())
    everything = len(render_report(full).encode())
    counts = []
    for largest in np.linspace(everything * 1.15, nothing, 12).astype(int).tolist():
        text = render_report(full, largest)
        page = Page(text)
        assert len(text.encode()) <= largest or not page.all("img")
        counts.append((text.count('class="viewer-data"'), len(page.all("img"))))
        notes = page.text.split("Before you trust the figures")[1].split("Claims")[0]
        assert ("'Set 3' are stills" in notes or "'Set 3' are left out" in notes) is (counts[-1][0] < 4)
        assert page.text.count("These pictures are left out") == 4 - counts[-1][1]
    assert counts[0] == (4, 4) and counts[-1] == (0, 0) and counts == sorted(counts, reverse=True)
    # Stills go last.
    assert all(stills == 4 for viewers, stills in counts if viewers)


def test_pictures_must_fit_together() -> None:
    small = Picture("small", np.zeros((2, 2, 3), dtype=np.float32))
    for pictures, words in (
        ((Picture("a", ramp()), small), "'small'"),
        ((Picture("a", ramp()[..., :1]),), "'a'"),
        ((replace(small, flip=np.zeros((3, 3), dtype=np.float32)),), "FLIP"),
        ((), "no picture"),
    ):
        with pytest.raises(ValueError, match=words):
            render_report(report(images=(ImageSet("s", pictures),)))


def test_anchors_are_unique() -> None:
    with pytest.raises(ValueError, match="anchor 'a'"):
        render_report(Report("t", "", (), (Section("a", "A"), Section("a", "B"))))


def test_a_block_may_stand_in_two_places() -> None:
    block = image_set()
    sections = (Section("a", "A", blocks=(block, chart())), Section("b", "B", blocks=(block, heat_map(), table())))
    page = Page(render_report(Report("t", "", (), sections)))
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids)) and len(page.all("img")) == 8


def test_the_file_appears_whole(tmp_path: Path, text: str) -> None:
    write_report(report(), tmp_path / "r.html")
    assert (tmp_path / "r.html").read_text(encoding="utf-8") == text
    assert [path.name for path in tmp_path.iterdir()] == ["r.html"]


def test_mitsuba_is_not_imported_before_a_picture_is_written() -> None:
    code = "import sys, stratalux.report.html; sys.exit('mitsuba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
