"""What the largest maps take from the file to the first sample, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from stratalux.images.reading import default_memory
from tests.helpers import PATIENCE
from tests.variants import BACKEND

HEIGHT, WIDTH = 8192, 16384
RATIO = 2.5
"""Bytes of memory for each byte of pixels, in all."""
PROGRAM = """
import resource, sys
import mitsuba as mi
import stratalux

mi.set_variant("llvm_ad_rgb")
for result in stratalux.render_passes("demo", environment=sys.argv[1], size=(60, 40), spp=1):
    print(result.image.mean(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    break
"""


def make(path: Path, kind: str) -> None:
    """A bright sky over a dark ground, and a sun of a few texels."""
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, kind)
    spec.attribute("compression", "zips")
    file = oiio.ImageOutput.create(str(path))
    file.open(str(path), spec)
    step = 256
    for y in range(0, HEIGHT, step):
        rows = np.full((step, WIDTH, 3), 0.5 + 0.5 * (1 - y / HEIGHT), dtype=np.float32)
        if y <= 2000 < y + step:
            rows[2000 - y : 2010 - y, 5000:5010] = 3e4
        file.write_scanlines(y, y + step, 0, rows)
    file.close()


@pytest.mark.slow
@pytest.mark.skipif(BACKEND != "llvm", reason="other backends have Mitsuba's envmap")
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, the memory of a process is counted in other units")
@pytest.mark.parametrize(("name", "kind", "each"), [("map.exr", "half", 6), ("map.hdr", "float", 12)])
def test_memory_until_the_first_sample(tmp_path: Path, name: str, kind: str, each: int) -> None:
    """Half floats count for what they are: two bytes."""
    if default_memory() < 4 << 30:
        pytest.skip("takes 3 GB of memory")
    make(tmp_path / name, kind)
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path / name)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    mean, peak = (float(number) for number in run.stdout.split())
    assert 0.1 < mean < 10
    assert 1024 * peak < RATIO * each * WIDTH * HEIGHT
