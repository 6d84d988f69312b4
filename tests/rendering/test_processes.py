"""Pictures by other processes, and with other scenes and variants in between, are those that each gives alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from tests.helpers import PATIENCE, scene_dict
from tests.variants import MONO, RGB

PROGRAM = """
import multiprocessing, sys
ASKED = {"size": (12, 8), "spp": 32, "seed": 1}
def work(results, variant):
    import stratalux
    results.put(stratalux.render("demo", variant=variant, **ASKED).image.tobytes())
if __name__ == "__main__":
    import stratalux
    how, before, variant, patience = sys.argv[1:]
    if before == "before":
        here = stratalux.render("demo", variant=variant, **ASKED)
    processes = multiprocessing.get_context(how)
    results = processes.Queue()
    workers = [processes.Process(target=work, args=(results, variant), daemon=True) for _ in range(2)]
    for worker in workers:
        worker.start()
    found = [results.get(timeout=float(patience)) for _ in workers]
    if before == "after":
        here = stratalux.render("demo", variant=variant, **ASKED)
    assert found[0] == found[1] == here.image.tobytes()
    print("the same")
"""


@pytest.mark.parametrize("before", ["before", "after"])
@pytest.mark.parametrize("how", ["fork", "spawn"])
def test_workers_render_what_their_parent_does(how: str, before: str, tmp_path: Path) -> None:
    """Bit for bit, whether or not their parent has rendered when they begin."""
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, str(tmp_path / "program.py"), how, before, RGB, str(PATIENCE)]
    done = subprocess.run(command, env=os.environ, capture_output=True, text=True, timeout=2 * PATIENCE, check=False)
    assert done.returncode == 0 and done.stdout.strip() == "the same", done.stderr[-2000:]


@pytest.mark.parametrize("direct", [True, False])
def test_scenes_in_turn_and_variants_between(direct: bool) -> None:
    """With one integrator for each render, and what is kept of recordings, tables and plans."""
    asked = {"spp": 32, "seed": 1, "direct": direct}
    pictures = []
    for _ in range(2):
        mi.set_variant(RGB)
        scenes = [mi.load_dict(scene_dict(bsdf, size=(18, 12))) for bsdf in ("diffuse", "roughconductor")]
        turns = [stratalux.render(scenes[k % 2], **asked).image for k in range(4)]
        np.testing.assert_array_equal(turns[0], turns[2])
        np.testing.assert_array_equal(turns[1], turns[3])
        assert np.abs(turns[0] - turns[1]).max() > 0.01
        pictures.append(turns)
        mi.set_variant(MONO)
        grey = stratalux.render(mi.load_dict(scene_dict("diffuse", size=(18, 12))), **asked).image
        assert abs(grey.mean() / turns[0].mean() - 1) < 0.2
    np.testing.assert_array_equal(pictures[0], pictures[1])
