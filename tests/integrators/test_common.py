"""What all integrators of ours share."""

from __future__ import annotations

import subprocess
import sys

from tests.helpers import PATIENCE

RENDER = """
import gc
import mitsuba as mi
import numpy as np
import stratalux

mi.set_variant("llvm_ad_rgb")


def scene():
    return mi.load_dict({
        "type": "scene",
        "ball": {"type": "sphere", "bsdf": {"type": "conductor"}},
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(np.ones((8, 16, 3), dtype=np.float32))},
        "sensor": {"type": "perspective", "to_world": mi.ScalarTransform4f().look_at([0, 0, -4], [0, 0, 0], [0, 1, 0]),
                   "film": {"type": "hdrfilm", "width": 8, "height": 8}},
    })


lit, integrator = scene(), mi.load_dict({"type": "direct_stratified", "strata": 4})
mi.render(lit, integrator=integrator, spp=1)
gc.disable()
past = [scene()]
past.append(past)
del past
# The next collection comes while a kernel is traced that asks for emitters twice: before and after.
traced = type(integrator).environment_light
type(integrator).environment_light = lambda *arguments: [gc.isenabled() and gc.collect(), traced(*arguments)][1]
gc.enable()
assert mi.render(lit, integrator=integrator, spp=1, seed=1).numpy().mean() > 0.9
"""


def test_no_scene_of_the_past_is_freed_while_a_kernel_is_traced() -> None:
    """Dr.Jit would end the process."""
    command = [sys.executable, "-c", RENDER]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
