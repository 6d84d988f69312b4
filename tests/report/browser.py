"""Chromium without a window, and what the tests ask of a page in it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.helpers import PATIENCE

_PIXEL = """
const [x, y, pane] = arguments;
const canvas = document.querySelectorAll('.viewer canvas')[pane];
const scale = Math.min(canvas.width / 60, canvas.height / 40);
const left = Math.floor(canvas.width / 2 + (x + 0.5 - 30) * scale);
const top_ = Math.floor(canvas.height / 2 + (y + 0.5 - 20) * scale);
return [...canvas.getContext('2d').getImageData(left, top_, 1, 1).data];
"""


def start() -> Any:
    """A driver; skips the test where a browser, its driver or selenium is missing."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium: pip install 'stratalux[dev]'")
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        pytest.skip("needs Chromium and its driver (Debian: chromium, chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    started = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    started.set_script_timeout(PATIENCE)
    started.set_page_load_timeout(PATIENCE)
    return started


class Browser:
    """A page that is open, and short names for what is done with it."""

    def __init__(self, driver: Any, path: Path) -> None:
        self.driver, self.url = driver, path.as_uri()

    def open(self, width: int = 1200, height: int = 1000, *, touch: bool = False) -> None:
        """Load the page anew and wait for its viewer."""
        self.resize(width, height, touch=touch)
        self.driver.get(self.url)
        self.script("document.querySelector('.images').scrollIntoView({behavior: 'instant'})")
        self.wait(lambda: self.script("return document.querySelector('.viewer canvas')?.width > 200"))
        self.settle()

    def resize(self, width: int, height: int, *, touch: bool = False) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": touch}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": touch})

    def script(self, code: str, *arguments: Any) -> Any:
        return self.driver.execute_script(code, *arguments)

    def settle(self) -> None:
        """Wait until the next frames are drawn."""
        self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))"
        )

    def wait(self, happened: Callable[[], Any]) -> None:
        from selenium.webdriver.support.wait import WebDriverWait

        WebDriverWait(self.driver, PATIENCE, poll_frequency=0.02).until(lambda _: happened())

    def find(self, selector: str) -> Any:
        return self.driver.find_element("css selector", selector)

    def text(self, selector: str) -> str:
        return str(self.script("return document.querySelector(arguments[0]).textContent", selector))

    def button(self, label: str) -> Any:
        """The button of the viewer with this text or label."""
        found = self.script(
            "const name = (b) => b.getAttribute('aria-label') ?? b.textContent.replace(/^[1-9](?=\\D)/, '');"
            "return [...document.querySelectorAll('.viewer button')].find((b) => name(b) === arguments[0])",
            label,
        )
        assert found, label
        return found

    def click(self, label: str) -> None:
        self.button(label).click()
        self.settle()

    def pressed(self, label: str) -> bool:
        return bool(self.button(label).get_attribute("aria-pressed") == "true")

    def keys(self, *keys: str, held: str | None = None) -> None:
        """Type into what has the focus, with another key ``held`` down."""
        from selenium.webdriver import ActionChains

        actions = ActionChains(self.driver, duration=0)
        if held:
            actions.key_down(held).send_keys(*keys).key_up(held).perform()
        else:
            actions.send_keys(*keys).perform()
        self.settle()

    def focus(self, selector: str = ".stage") -> None:
        self.script("document.querySelector(arguments[0]).focus()", selector)

    def pixel(self, x: int, y: int, pane: int = 0) -> list[int]:
        """Colour on the canvas where all of the image is seen, in the middle of its pixel (x, y)."""
        return list(self.script(_PIXEL, x, y, pane)[:3])

    def place(self, x: float, y: float) -> tuple[int, int]:
        """Where pixel (x, y) of the image is on the screen, where all of it is seen."""
        left, top, width, height = self.script(
            "const b = document.querySelector('.viewer canvas').getBoundingClientRect();"
            "return [b.x, b.y, b.width, b.height]"
        )
        scale = min(width / 60, height / 40)
        return int(left + width / 2 + (x + 0.5 - 30) * scale), int(top + height / 2 + (y + 0.5 - 20) * scale)

    def mouse(self, kind: str, place: tuple[int, int], **more: Any) -> None:
        """``kind``: mouseMoved, mousePressed, mouseReleased or mouseWheel."""
        event = {"type": kind, "x": place[0], "y": place[1], "button": "none", **more}
        if kind in ("mousePressed", "mouseReleased"):
            event = {**event, "button": "left", "clickCount": more.get("clickCount", 1)}
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)
        self.settle()

    def drag(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        self.mouse("mouseMoved", start)
        self.mouse("mousePressed", start)
        self.mouse("mouseMoved", end, button="left", buttons=1)
        self.mouse("mouseReleased", end)

    def touch(self, kind: str, *places: tuple[int, int]) -> None:
        """``kind``: touchStart, touchMove or touchEnd."""
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
        self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        self.settle()

    def zoom(self) -> int:
        """Size of a pixel in percent."""
        return int(self.text(".zoom output").split()[0])

    def errors(self) -> list[str]:
        """What the browser complains of, since last asked, but for the tests' own look at the pixels."""
        messages = [entry["message"] for entry in self.driver.get_log("browser")]
        return [message for message in messages if "willReadFrequently" not in message]
