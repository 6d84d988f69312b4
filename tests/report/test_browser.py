"""The page in a real browser: every control does what it says, to the pixel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.images.tonemap import tonemap
from stratalux.report.colours import MAGMA, SIGNED, interpolate
from stratalux.report.html import write_report
from tests.report.browser import Browser, start
from tests.report.samples import HEIGHT, WIDTH, ramp, report

LEFT, RIGHT, UP, DOWN, SHIFT, ESCAPE, TAB = "\ue012", "\ue014", "\ue013", "\ue015", "\ue008", "\ue00c", "\ue004"
NAMES = ("double", "same", "half", "truth")
GAINS = {"double": 2.0, "same": 1.0, "half": 0.5, "truth": 1.0}


@pytest.fixture(scope="module")
def driver() -> Iterator[Any]:
    driver = start()
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(report(), path)
    return path


@pytest.fixture
def browser(driver: Any, page: Path) -> Iterator[Browser]:
    browser = Browser(driver, page)
    browser.errors()
    browser.open()
    yield browser
    assert browser.errors() == []


def expected(name: str, exposure: float, x: int, y: int) -> list[int]:
    return list(map(int, tonemap(ramp(GAINS[name]), exposure)[y, x]))


def assert_colour(found: list[int], wanted: list[int], tolerance: int = 1) -> None:
    assert np.abs(np.subtract(found, wanted)).max() <= tolerance, f"{found} instead of {wanted}"


def test_the_image_is_that_of_python_and_flips(browser: Browser) -> None:
    browser.focus()
    for k, name in reversed(list(enumerate(NAMES))):
        browser.keys(str(k + 1))
        assert browser.pressed(name) and [browser.pressed(other) for other in NAMES].count(True) == 1
        for x, y in ((0, 0), (30, 20), (59, 39)):
            assert_colour(browser.pixel(x, y), expected(name, -1, x, y))
        assert name in browser.text(".viewer [aria-live]") and f"{k + 1} of 4" in browser.text(".viewer [aria-live]")
    browser.keys("9")
    assert browser.pressed("double")
    for key, name in ((RIGHT, "same"), (RIGHT, "half"), (LEFT, "same"), (LEFT, "double"), (LEFT, "truth")):
        browser.keys(key)
        assert browser.pressed(name)
    browser.click("half")
    assert browser.pressed("half") and "relMSE 0.25" in browser.text(".picture-facts")
    assert browser.find(".viewer canvas").get_attribute("aria-label") == "half"
    browser.focus()
    for name in ("truth", "half", "truth"):
        browser.keys("r")
        assert browser.pressed(name)


def test_exposure(browser: Browser) -> None:
    browser.focus()
    browser.keys("E", "E")
    assert browser.text(".exposure output") == "+0.00"
    assert_colour(browser.pixel(5, 7), expected("double", 0, 5, 7))
    browser.keys("e", "e", "e", "e")
    assert_colour(browser.pixel(5, 7), expected("double", -2, 5, 7))
    browser.focus(".exposure input")
    browser.keys(RIGHT)  # the slider keeps its arrow keys
    assert browser.text(".exposure output") == "−1.75" and browser.pressed("double")
    assert_colour(browser.pixel(5, 7), expected("double", -1.75, 5, 7))
    browser.click("Reset exposure")
    assert browser.text(".exposure output") == "−1.00"


def test_values_under_the_cursor(browser: Browser) -> None:
    assert browser.text(".where").startswith("middle pixel 30, 20")
    browser.mouse("mouseMoved", browser.place(15, 31))
    assert browser.text(".where") == "pixel 15, 31"
    values = [value.text.split() for value in browser.driver.find_elements("css selector", ".value")]
    assert values == [["double", "1.00", "2.00", "0.500"], ["truth", "0.500", "1.00", "0.250"]]
    browser.click("Relative error")
    browser.mouse("mouseMoved", browser.place(15, 31))
    luminance = ramp()[31, 15] @ [0.2126, 0.7152, 0.0722]
    error = luminance / np.sqrt(luminance**2 + 0.01)
    assert browser.find(".error").text.startswith("Relative error 0.")
    assert float(browser.find(".error").text.split()[-1]) == pytest.approx(error, abs=2e-3)
    browser.mouse("mouseMoved", (2, 2))
    assert browser.text(".where").startswith("middle")


def test_maps_of_differences(browser: Browser) -> None:
    x, y = 12, 9
    browser.click("Absolute error")
    error = float(np.abs(ramp(2) - ramp())[y, x].mean())
    top = 0.18 * 2.0  # exposure −1
    assert_colour(browser.pixel(x, y), interpolate(MAGMA, np.array(error / top)).tolist(), 3)
    assert browser.text(".ends span:last-child") == "0.360 or more"
    browser.focus()
    browser.keys("e", "e")
    assert browser.text(".ends span:last-child") == "0.720 or more"
    assert_colour(browser.pixel(x, y), interpolate(MAGMA, np.array(error / 2 / top)).tolist(), 3)
    browser.keys("2")
    assert browser.pixel(x, y) == [0, 0, 4] and browser.pixel(40, 30) == [0, 0, 4]  # no error at all

    browser.click("Reset exposure")
    browser.click("Relative error")
    zero = interpolate(SIGNED, np.array(0.5)).tolist()
    assert_colour(browser.pixel(x, y), zero)
    browser.click("double")
    red, _, blue = browser.pixel(1, 1)
    assert red > blue + 50  # too bright
    browser.click("half")
    red, _, blue = browser.pixel(1, 1)
    assert blue > red + 50
    assert "too dark" in browser.text(".ends") and browser.find(".strip").get_attribute("aria-label")

    browser.click("FLIP")
    assert browser.pixel(x, y) == [0, 229, 255]  # unknown
    browser.click("double")
    assert_colour(browser.pixel(20, 10), [252, 253, 191])
    assert browser.pixel(21, 10) == [0, 0, 4]
    browser.click("truth")
    assert browser.pixel(20, 10) == [0, 0, 4]
    browser.focus()
    for name in ("Image", "Absolute error", "Relative error", "FLIP"):
        browser.keys("d")
        assert browser.pressed(name)
    browser.click("Image")
    assert not browser.find(".colour-bar").is_displayed()


def test_zooming_and_moving(browser: Browser) -> None:
    browser.focus()
    fit = browser.zoom()
    browser.keys("+")
    assert browser.zoom() == pytest.approx(1.25 * fit, abs=2)
    browser.keys("-", "-")
    assert browser.zoom() == fit
    browser.click("Zoom in")
    browser.click("Zoom in")
    assert browser.zoom() == pytest.approx(1.25**2 * fit, abs=2)
    browser.click("Fit")
    assert browser.zoom() == fit

    # Whatever is under the cursor stays there.
    place = browser.place(45, 10)
    browser.mouse("mouseMoved", place)
    assert browser.text(".where") == "pixel 45, 10"
    browser.mouse("mouseWheel", place, deltaX=0, deltaY=-200)
    assert browser.zoom() == pytest.approx(2 * fit, abs=2)
    browser.mouse("mouseMoved", (place[0] + 1, place[1]))
    assert browser.text(".where") == "pixel 45, 10"
    # Dragged by five of its pixels, and back by keys.
    step = 5 * browser.zoom() / 100
    browser.drag(place, (int(place[0] + step), place[1]))
    browser.mouse("mouseMoved", place)
    assert browser.text(".where") == "pixel 40, 10"
    browser.keys(RIGHT, held=SHIFT)
    browser.mouse("mouseMoved", (place[0] - 1, place[1]))
    assert browser.text(".where") in ("pixel 42, 10", "pixel 43, 10")  # a tenth of what is seen
    for _ in range(2):
        browser.mouse("mousePressed", place, clickCount=2)
        browser.mouse("mouseReleased", place, clickCount=2)
    assert browser.zoom() == fit
    browser.keys("+", "0")
    assert browser.zoom() == fit


def test_the_wheel_scrolls_the_page_before_a_click(browser: Browser) -> None:
    browser.script("document.activeElement.blur(); window.setTimeout = () => 0")  # the hint stays
    fit, place = browser.zoom(), browser.place(30, 20)
    browser.mouse("mouseWheel", place, deltaX=0, deltaY=-120)
    assert browser.zoom() == fit and "seen" in browser.find(".hint").get_attribute("class")
    browser.mouse("mouseWheel", browser.place(30, 5), deltaX=0, deltaY=-120, modifiers=2)
    assert browser.zoom() > fit


def test_crops_and_pixels_that_show_their_values(browser: Browser) -> None:
    fit = browser.zoom()
    browser.click("corner")
    assert browser.zoom() == pytest.approx(2 * fit, abs=2)  # half of the height
    browser.find(".crops button").click()
    assert browser.text(".where") == "middle pixel 45, 29" or browser.text(".where").startswith("middle pixel 4")
    for _ in range(12):
        browser.click("Zoom in")
    assert browser.zoom() == 9600
    colours = browser.script(
        "const c = document.querySelector('.viewer canvas');"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "let white = 0; for (let i = 0; i < d.length; i += 4) white += d[i] + d[i + 1] + d[i + 2] === 765; return white"
    )
    assert colours > 100  # of the digits


def test_split(browser: Browser) -> None:
    browser.focus()
    browser.keys("s")
    assert browser.pressed("Split") and browser.find(".divider").is_displayed()
    assert_colour(browser.pixel(10, 20), expected("double", -1, 10, 20))
    assert_colour(browser.pixel(50, 20), expected("truth", -1, 50, 20))
    browser.drag(browser.place(30, 15), browser.place(54, 15))
    assert_colour(browser.pixel(50, 20), expected("double", -1, 50, 20))
    assert int(browser.find(".divider").get_attribute("aria-valuenow")) == pytest.approx(91, abs=2)
    browser.focus(".divider")
    browser.keys("\ue011")  # home
    assert_colour(browser.pixel(3, 20), expected("truth", -1, 3, 20))
    browser.keys(*[RIGHT] * 5)
    assert browser.find(".divider").get_attribute("aria-valuenow") == "10" and browser.pressed("double")
    assert_colour(browser.pixel(3, 20), expected("double", -1, 3, 20))
    browser.focus(".against select")
    browser.keys(UP)
    browser.settle()
    assert_colour(browser.pixel(50, 20), expected("half", -1, 50, 20))
    browser.click("One")
    assert not browser.find(".divider").is_displayed()


def test_side_by_side(browser: Browser) -> None:
    browser.focus()
    browser.keys("g")
    assert browser.script("return document.querySelectorAll('.viewer canvas').length") == 4
    for pane, name in enumerate(NAMES):
        assert_colour(browser.pixel(33, 22, pane), expected(name, -1, 33, 22))
    fit = browser.zoom()
    browser.keys("+", "+", "+")
    assert browser.zoom() > fit
    browser.keys("0", "3")
    assert browser.script("return document.querySelector('.pane.current .name').textContent") == "half"
    browser.click("Side by side")
    browser.keys("g")
    assert browser.script("return document.querySelectorAll('.viewer canvas').length") == 1


def test_large_and_back(browser: Browser) -> None:
    browser.focus()
    browser.keys("f")
    box = browser.script(
        "const b = document.querySelector('.viewer').getBoundingClientRect(); return [b.x, b.y, b.width]"
    )
    assert box == [0, 0, 1200]
    assert_colour(browser.pixel(33, 22), expected("double", -1, 33, 22))
    browser.keys(ESCAPE)
    assert not browser.script("return document.querySelector('.viewer').classList.contains('large')")
    browser.click("Large")
    browser.click("Close")
    assert not browser.script("return document.querySelector('.viewer').classList.contains('large')")
    # Whoever tabs out of it sees the page again.
    browser.keys("f")
    browser.script("document.querySelector('.contents a').focus()")
    assert not browser.script("return document.querySelector('.viewer').classList.contains('large')")


def test_keys_are_for_the_viewer_with_the_focus_or_the_cursor(browser: Browser) -> None:
    browser.script("document.activeElement.blur()")
    browser.mouse("mouseMoved", (2, 2))
    browser.keys("2")
    assert browser.pressed("double")
    browser.mouse("mouseMoved", browser.place(30, 20))
    browser.keys("2")
    assert browser.pressed("same")


def test_everything_is_reached_by_tab(browser: Browser) -> None:
    browser.script("document.activeElement.blur(); document.querySelector('.skip').focus()")
    seen = set()
    for _ in range(60):
        browser.driver.switch_to.active_element.send_keys(TAB)
        seen.add(browser.script("const e = document.activeElement; return e.className + '|' + e.textContent.trim()"))
        visible = browser.script(
            "const e = document.activeElement;"
            "return e === document.body || e.type === 'range' || getComputedStyle(e).outlineStyle !== 'none'"
        )
        assert visible
    reached = " ".join(seen)
    for name in ("plot", "scroller", "stage", "double", "Side by side", "FLIP", "corner", "Large", "Keys and gestures"):
        assert name in reached, name


def test_touch(browser: Browser) -> None:
    browser.open(360, 780, touch=True)
    fit = browser.zoom()
    place = browser.place(20, 30)
    browser.touch("touchStart", place)
    assert browser.text(".where") == "pixel 20, 30"
    browser.touch("touchEnd")
    assert browser.text(".where") == "pixel 20, 30"  # it stays when the finger is lifted
    x, y = browser.place(30, 20)
    browser.touch("touchStart", (x - 20, y), (x + 20, y))
    for spread in (30, 40):
        browser.touch("touchMove", (x - spread, y), (x + spread, y))
    browser.touch("touchEnd")
    assert browser.zoom() == pytest.approx(2 * fit, rel=0.1)
    browser.click("Fit")
    browser.touch("touchStart", (x + 60, y))
    browser.touch("touchMove", (x + 20, y))
    browser.touch("touchMove", (x - 60, y))
    browser.touch("touchEnd")
    assert browser.pressed("same")


def test_nothing_overflows_on_a_phone(browser: Browser) -> None:
    browser.open(360, 780, touch=True)
    for layout in ("One", "Split", "Side by side"):
        browser.click(layout)
        assert browser.script("return document.documentElement.scrollWidth") <= 360
    browser.click("FLIP")
    overflowing = browser.script(
        "return [...document.querySelectorAll('main *')].filter((e) => !e.closest('.scroller, .unseen, svg, thead')"
        " && e.getBoundingClientRect().right > 361).map((e) => e.outerHTML.slice(0, 80))"
    )
    assert overflowing == []


def test_curves(browser: Browser) -> None:
    browser.script("document.querySelector('.plot').scrollIntoView({behavior: 'instant', block: 'center'})")
    box = browser.script(
        "const b = document.querySelectorAll('.point .marker')[1].getBoundingClientRect(); return [b.x, b.y, b.width]"
    )
    place = (int(box[0] + box[2] / 2), int(box[1] + box[2] / 2))
    browser.mouse("mouseMoved", place)
    assert browser.find(".tip").is_displayed() and browser.find(".tip").text.split("\n") == [
        "stratified", "rays: 64", "relMSE: 0.02", "from 0.015 to 0.03",
    ]  # fmt: skip
    button = browser.find(".legend button")
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert not browser.find(".curve").is_displayed()
    browser.mouse("mouseMoved", place)
    assert "stratified" not in browser.text(".tip") or not browser.find(".tip").is_displayed()
    button.click()
    assert browser.find(".curve").is_displayed()
    browser.focus(".plot")
    browser.keys(RIGHT)
    assert "rays: 16" in browser.text(".tip")
    browser.keys(RIGHT, DOWN)
    assert "direct" in browser.text(".tip") and "direct. rays: 64" in browser.text(".plot [aria-live]")
    browser.keys(UP, ESCAPE)
    assert not browser.find(".tip").is_displayed()


def test_tables_sort(browser: Browser) -> None:
    cells = "section.block .sortable tbody td:first-child"
    names = f"return [...document.querySelectorAll('{cells}')].map((e) => e.textContent)"
    heads = browser.driver.find_elements("css selector", "section.block .sortable th button")
    heads[1].click()
    assert browser.script(names) == ["stratified", "lights", "direct"]
    heads[1].click()
    assert browser.script(names) == ["direct", "lights", "stratified"]
    heads[0].click()
    assert browser.script(names) == ["direct", "lights", "stratified"]


def test_light_and_dark(browser: Browser) -> None:
    grounds = []
    for scheme in ("light", "dark"):
        features = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", features)
        grounds.append(browser.script("return getComputedStyle(document.body).backgroundColor"))
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    light, dark = (int(ground.split("(")[1].split(",")[0]) for ground in grounds)
    assert light > 200 and dark < 50


def test_stills_where_scripts_do_not_run(driver: Any, page: Path) -> None:
    driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        driver.get(page.as_uri())
        root = driver.execute_cdp_cmd("DOM.getDocument", {"depth": 1})["root"]["nodeId"]

        def sizes(selector: str) -> list[tuple[int, int]]:
            found = driver.execute_cdp_cmd("DOM.querySelectorAll", {"nodeId": root, "selector": selector})["nodeIds"]
            boxes = [driver.execute_cdp_cmd("DOM.getBoxModel", {"nodeId": node})["model"] for node in found]
            return [(box["width"], box["height"]) for box in boxes]

        stills = sizes(".stills img")
        assert len(stills) == 4 and all(width > 200 and height > 100 for width, height in stills)
        assert all(width > 300 for width, _ in sizes(".plot svg")) and sizes(".heat") and sizes(".claims")
    finally:
        driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_stills_where_nothing_can_be_decompressed(driver: Any, page: Path) -> None:
    source = {"source": "delete window.DecompressionStream"}
    script = driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", source)
    try:
        driver.get(page.as_uri())
        browser = Browser(driver, page)
        browser.script("document.querySelector('.images').scrollIntoView()")
        browser.settle()
        assert browser.find(".stills img").is_displayed() and not browser.script(
            "return document.querySelector('.viewer')"
        )
        assert browser.script("return document.querySelector('.legend button')")  # the rest works
        assert browser.errors() == []
    finally:
        driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)


def test_a_single_picture_without_reference(driver: Any, tmp_path: Path) -> None:
    from stratalux.report.model import ImageSet, Picture

    wild = ramp(3e5)
    wild[5, 6] = [np.nan, np.inf, 1e6]
    write_report(report(images=(ImageSet("Alone", (Picture("one", wild),), exposure=-19.0),)), tmp_path / "r.html")
    browser = Browser(driver, tmp_path / "r.html")
    browser.open()
    labels = browser.script("return [...document.querySelectorAll('.viewer .joined button')].map((b) => b.textContent)")
    assert labels == ["One"]
    assert_colour(browser.pixel(3, 3), list(map(int, tonemap(wild, -19.0)[3, 3])))
    browser.mouse("mouseMoved", browser.place(6, 5))
    assert "NaN" in browser.text(".values") and "Infinity" in browser.text(".values")
    assert browser.errors() == []
    assert (WIDTH, HEIGHT) == (60, 40)
