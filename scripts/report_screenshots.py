"""Screenshots of a report for the documentation: python -m scripts.report_screenshots REPORT.html FOLDER.

Needs Chromium, its driver, and selenium.
"""

from __future__ import annotations

import base64
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from selenium import webdriver

DESKTOP = (1280, 860)
PHONE = (360, 780)
LARGEST = 200_000
"""Bytes of a file."""
_PATIENCE = 30.0
_SCROLL = "document.querySelector(arguments[0]).scrollIntoView({block: 'start', behavior: 'instant'})"
_FRAMES = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))"
_PRESS = """
const stage = document.querySelector('.viewer .stage');
for (const key of arguments[0]) stage.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true}));
"""

SHOTS: tuple[tuple[str, tuple[int, int], str, str, str], ...] = (
    ("light", DESKTOP, "light", "body", ""),
    ("dark", DESKTOP, "dark", "body", ""),
    ("phone", PHONE, "light", ".viewer", "s"),
    ("split", DESKTOP, "light", ".viewer", "s"),
    ("difference", DESKTOP, "dark", ".viewer", "dd"),
    ("flip", DESKTOP, "light", ".viewer", "dddg"),
    ("curves", DESKTOP, "light", ".chart", ""),
)
"""Name, size of the window, colour scheme, what is at the top of it, keys that the first viewer gets."""


def open_browser() -> Any:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or shutil.which("google-chrome") or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))


def shoot(driver: Any, report: Path, size: tuple[int, int], scheme: str, top: str, keys: str) -> bytes:
    """A JPEG file of what the window shows."""
    scheme_feature = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", scheme_feature)
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size == PHONE}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    driver.get(report.resolve().as_uri())
    driver.execute_script(_SCROLL, ".images")
    deadline = time.monotonic() + _PATIENCE
    while not driver.execute_script("return document.querySelector('.viewer canvas')?.width > 200"):
        if time.monotonic() > deadline:
            sys.exit(f"{report}: no viewer appears")
        time.sleep(0.05)
    driver.execute_script("document.querySelector('.viewer .stage').focus({preventScroll: true})")
    driver.execute_script(_PRESS, keys)
    if not keys:
        driver.execute_script("document.activeElement.blur()")
    driver.execute_async_script(_FRAMES)
    driver.execute_script(_SCROLL, top)
    time.sleep(0.3)  # the navigation follows
    driver.execute_async_script(_FRAMES)
    for quality in (88, 75, 60, 45):
        shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "jpeg", "quality": quality})
        data = base64.b64decode(shot["data"])
        if len(data) < LARGEST:
            break
    return data


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit("usage: python -m scripts.report_screenshots REPORT.html FOLDER")
    report, folder = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    driver = open_browser()
    try:
        for name, *how in SHOTS:
            data = shoot(driver, report, *how)
            (folder / f"{name}.jpg").write_bytes(data)
            print(name, len(data), flush=True)
    finally:
        driver.quit()


if __name__ == "__main__":
    main()
