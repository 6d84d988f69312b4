"""Pictures from several threads at once are those that each seed gives alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers import PATIENCE
from tests.variants import RGB

PROGRAM = """
import sys, threading
import mitsuba as mi
import numpy as np
import stratalux
from tests.helpers import scene_dict
mi.set_variant(sys.argv[2])
count = int(sys.argv[1])
scenes = [mi.load_dict(scene_dict(("diffuse", "roughconductor")[k % 2], size=(30, 20))) for k in range(count)]
def render(k, seed):
    return stratalux.render(scenes[k], spp=8, seed=seed, **({} if k < 2 else {"strata": 4})).image
alone = [[render(k, seed) for seed in range(3)] for k in range(count)]
found = [[None] * 3 for _ in scenes]
def work(k):
    for seed in range(3):
        found[k][seed] = render(k, seed)
threads = [threading.Thread(target=work, args=(k,)) for k in range(count)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
for mine, others in zip(alone, found):
    for a, b in zip(mine, others):
        np.testing.assert_allclose(b, a, rtol=1e-4, atol=1e-6)
print("the same")
"""
"""Threads add up in another order, so that the last digits may differ."""


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_threads_render_what_one_does(count: int) -> None:
    root = Path(__file__).parents[2]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", PROGRAM, str(count), RGB]
    done = subprocess.run(command, env=env, cwd=root, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0 and done.stdout.strip() == "the same", done.stderr[-2000:]
