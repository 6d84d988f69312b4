"""What the readers of text files share: their encodings and line ends, numbers, and colours."""

from __future__ import annotations

import codecs
import re
import warnings
from typing import Any

import numpy as np

from ...images.colour import decode
from ..model import Floats

# The longer marks first: that of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def plain_text(data: bytes) -> bytes:
    """The text of a file without its byte order mark, in an extension of ASCII, with lines that end in a newline."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            data = data[len(mark) :] if encoding == "utf-8" else data.decode(encoding, "replace").encode()
            break
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def numbers(text: bytes, dtype: type[Any] = np.float64) -> Any:
    """All numbers of a text that consists of nothing else. Raises ValueError with the first word that is none."""
    text = text.strip()
    if not text:
        return np.empty(0, dtype=dtype)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # what NumPy before 2.3 does with such a word
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (DeprecationWarning, ValueError):
        what = "a whole number" if dtype is np.int64 else "a number"
        for word in text.split():
            try:
                (int if dtype is np.int64 else float)(word)
            except ValueError:
                raise ValueError(f"{word[:20].decode('latin-1')!r} is not {what}") from None
        raise ValueError(f"something is not {what}") from None


def without_comments(text: bytes) -> bytes:
    """The text without what stands behind a '#' in any line."""
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text


def word(name: bytes) -> str:
    """A name of a text file, which may be in any encoding."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def linear(colours: Floats) -> Floats:
    """Colours (N, 3 or 4) that follow the curve of sRGB made linear; an alpha, which is behind them, is kept."""
    found = np.array(colours, dtype=np.float64)
    decode(found[None, :, :3], "srgb")
    return found


def with_alpha(colours: Floats) -> Floats:
    """Colours (N, 3 or 4) with an alpha, (N, 4)."""
    return colours if colours.shape[1] == 4 else np.concatenate([colours, np.ones((len(colours), 1))], axis=1)
