"""The plugin is there before and after a variant is set, in every variant it can run in, and refused in others."""

from __future__ import annotations

import subprocess
import sys

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import PATIENCE, scene_dict
from tests.variants import RGB

RENDER = (
    "scene = mi.load_dict({'type': 'scene', 'i': {'type': 'direct_stratified', 'strata': 4}, 's': {'type': 'sphere'},"
    " 'e': {'type': 'envmap', 'bitmap': mi.Bitmap(np.ones((4, 8, 3), dtype='float32'))},"
    " 'c': {'type': 'perspective', 'film': {'type': 'hdrfilm', 'width': 4, 'height': 4}}})\n"
    "assert np.isfinite(np.array(mi.render(scene, spp=1))).all()\n"
)


def run(program: str) -> None:
    command = [sys.executable, "-c", f"RGB = {RGB!r}\n{program}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "program",
    [
        "import stratalux, mitsuba as mi, numpy as np\nmi.set_variant(RGB)\n" + RENDER,
        "import mitsuba as mi, numpy as np, stratalux\nmi.set_variant(RGB)\n" + RENDER,
        "import mitsuba as mi, numpy as np\nmi.set_variant(RGB)\nimport stratalux\n" + RENDER,
        "import stratalux, mitsuba as mi, numpy as np\n"
        "for variant in (RGB, 'scalar_rgb', RGB.replace('rgb', 'mono'), RGB):\n"
        "    mi.set_variant(variant)\n" + RENDER,
    ],
    ids=["before", "after import", "after variant", "changes"],
)
def test_registered_in_any_order(program: str) -> None:
    run(program)


def test_the_partition_needs_no_mitsuba() -> None:
    run(
        "import sys, numpy as np\n"
        "from stratalux import EnvironmentMap, median_cut, region_content\n"
        "environment = EnvironmentMap.from_array(np.ones((8, 16, 3)))\n"
        "region_content(environment, median_cut(environment, 8))\n"
        "assert not any(name.split('.')[0] in ('mitsuba', 'drjit') for name in sys.modules)\n"
    )


def test_names_of_the_library_are_not_shadowed_by_modules() -> None:
    run("import stratalux.rendering.passes, stratalux as s\nassert callable(s.render) and callable(s.load_scene)\n")
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        __import__("stratalux").nonsense  # noqa: B018


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_mono_polarized"])
def test_other_variants_are_refused(variant: str) -> None:
    mi.set_variant(variant)
    with pytest.raises(RuntimeError, match=f"does not run in the variant '{variant}'.*llvm_ad_rgb"):
        mi.load_dict({"type": "direct_stratified"})


def test_from_xml_with_properties() -> None:
    integrator = mi.load_string(
        '<integrator version="3.0.0" type="direct_stratified"><integer name="strata" value="37"/>'
        '<integer name="proposals" value="5"/><boolean name="hide_emitters" value="true"/></integrator>'
    )
    assert (integrator.strata, integrator.proposals, integrator.hide_emitters) == (37, 5, True)
    assert "strata = 37, proposals = 5" in str(integrator)
    defaults = mi.load_dict({"type": "direct_stratified"})
    assert (defaults.strata, defaults.automatic) == (0, True)
    pinned = mi.load_dict({"type": "direct_stratified", "bsdf_samples": 0})
    assert (pinned.strata, pinned.proposals, pinned.automatic) == (64, 1, False)


@pytest.mark.parametrize("bad", [{"strata": -1}, {"proposals": -2}, {"strata": 2.5}, {"regions": 4}])
def test_bad_properties_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(RuntimeError, match=next(iter(bad))):
        mi.load_dict({"type": "direct_stratified", **bad})


@pytest.mark.parametrize("settings", [[(1, 1), (4, 1), (37, 1), (64, 1)], [(1, 2), (16, 3), (64, 16), (64, 50)]])
def test_kernels_do_not_grow_with_strata_and_proposals(settings: list[tuple[int, int]]) -> None:
    """What is compiled has as many operations for all N and M. (One proposal needs no loop over proposals.)

    Dr.Jit may still compile it more than once: how it addresses an array depends on how that array came about.
    """
    import drjit as dr

    scene = mi.load_dict(scene_dict("diffuse"))
    operations = []
    for strata, proposals in settings:
        integrator = mi.load_dict({"type": "direct_stratified", "strata": strata, "proposals": proposals})
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            mi.render(scene, integrator=integrator, spp=1)
            dr.sync_thread()
            history = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
        main = max(history, key=lambda kernel: kernel["operation_count"])
        operations.append(main["operation_count"])
    assert max(operations) < 1.02 * min(operations)


def test_usable_inside_other_integrators() -> None:
    scene = mi.load_dict(scene_dict("diffuse"))
    nested = mi.load_dict({"type": "aov", "aovs": "d:depth", "inner": {"type": "direct_stratified", "strata": 8}})
    image = np.array(mi.render(scene, integrator=nested, spp=16))
    alone = np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct_stratified", "strata": 8}), spp=16))
    np.testing.assert_allclose(image[..., :3], alone, rtol=1e-4, atol=1e-5)
