"""Text in a page: numbers, paragraphs, and names of elements."""

from __future__ import annotations

import json
import math
from html import escape
from typing import Any


class Identifiers:
    """Hands out names for elements, each of them once in a page."""

    def __init__(self) -> None:
        self._count = 0

    def new(self, kind: str) -> str:
        self._count += 1
        return f"{kind}-{self._count}"


def number(value: float) -> str:
    """Three significant digits, as a person would write them."""
    if not math.isfinite(value):
        return str(value)
    if value == 0 or 1e-4 <= abs(value) < 1e5:
        digits = 0 if value == 0 else max(0, 2 - math.floor(math.log10(abs(value))))
        text = f"{value:.{digits}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.2e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def paragraphs(*texts: str) -> str:
    """A paragraph for each text that is not empty."""
    return "".join(f"<p>{escape(text)}</p>" for text in texts if text)


def script_json(value: Any) -> str:
    """JSON that may stand in a script element: no ``<``, so nothing in it can end the element."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
