"""Efficiency 1 / (time x relMSE) of ``direct_stratified`` against Mitsuba's ``direct`` at matched time.

Happy Buddha, diffuse 0.5, in Grace Cathedral (turned upright), 300x200, box filter, independent sampler on both sides.
The map is scaled so that the mean of the image is 0.2; relMSE is over pixels that are all surface. The two sides are
rendered in turn, after a warm-up, and medians are shown; the reference is Mitsuba's ``direct`` with many samples.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from statistics import median

import mitsuba as mi
import numpy as np

from benchmarks.common import asset, machine, relative_mse, timed_render

OURS = (64, 1, 4)
"""Strata, proposals, samples per pixel."""
SPLITS = ((1, 1), (4, 4), (16, 0))
"""Emitter and BSDF samples of ``direct``."""


def load(scale: float) -> mi.Scene:
    from stratalux.envmap import EnvironmentMap
    from stratalux.scenes.load import envmap
    from stratalux.scenes.materials import material
    from stratalux.scenes.mesh import load_mesh
    from stratalux.scenes.stage import stage

    emitter = envmap(EnvironmentMap.load(asset("envmaps/grace_latlong.exr")))
    emitter |= {"scale": scale, "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 180)}
    description = stage(load_mesh(asset("meshes/happy_buddha.obj")), material("diffuse"), emitter, (300, 200))
    description["sensor"]["film"]["rfilter"] = {"type": "box"}
    return mi.load_dict(description)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=11, help="timed renders of each side (default: 11)")
    parser.add_argument("--reference-spp", type=int, default=16384, help="samples of the reference (default: 16384)")
    parser.add_argument("--json", type=Path, help="write the figures there")
    arguments = parser.parse_args()

    mi.set_variant("llvm_ad_rgb")
    direct = mi.load_dict({"type": "direct"})
    scale = 0.2 / timed_render(load(1.0), direct, 256, 0)[0].mean()
    scene = load(scale)
    passes = arguments.reference_spp // 1024
    reference = np.mean([timed_render(scene, direct, 1024, 10_000 + k)[0] for k in range(passes)], axis=0, dtype=float)
    hits = [np.array(mi.render(scene, integrator=mi.load_dict({"type": "depth"}), spp=1, seed=k)) for k in range(32)]
    surface = np.all(np.array(hits)[..., 0] > 0, axis=0)

    strata, proposals, spp = OURS
    ours = mi.load_dict({"type": "direct_stratified", "strata": strata, "proposals": proposals})
    techniques = {f"direct_stratified ({strata}, {proposals})": (ours, spp)}
    timed_render(scene, ours, spp, 0)
    target = median(timed_render(scene, ours, spp, k)[1] for k in range(3))
    for emitter, bsdf in SPLITS:
        integrator = mi.load_dict({"type": "direct", "emitter_samples": emitter, "bsdf_samples": bsdf})
        timed_render(scene, integrator, 8, 0)
        per_sample = median(timed_render(scene, integrator, 8, k)[1] for k in range(3)) / 8
        techniques[f"direct {emitter}+{bsdf}"] = integrator, max(1, round(target / per_sample))

    results: dict[str, list[tuple[float, float]]] = {name: [] for name in techniques}
    for k in range(arguments.rounds + 1):
        for name, (integrator, count) in techniques.items():
            image, seconds = timed_render(scene, integrator, count, k)
            if k:  # the first round warms up
                results[name].append((seconds, relative_mse(image, reference, surface)))

    print(machine())
    print(f"map x {scale:.4g}, mean {reference.mean():.3f}, {surface.mean():.1%} of the pixels all surface")
    print(f"{'':28} {'spp':>4} {'seconds':>8} {'relMSE':>9} {'efficiency':>10} {'ours is':>8}")
    rows: dict[str, dict[str, float]] = {}
    for name, samples in results.items():
        seconds, error = (float(median(column)) for column in zip(*samples, strict=True))
        rows[name] = {
            "spp": techniques[name][1],
            "seconds": seconds,
            "relmse": error,
            "efficiency": 1 / seconds / error,
        }
    mine = next(iter(rows.values()))["efficiency"]
    for name, row in rows.items():
        ratio = f"{mine / row['efficiency']:.2f} x"
        print(
            f"{name:28} {row['spp']:4} {row['seconds']:8.3f} {row['relmse']:9.6f} {row['efficiency']:10.1f} {ratio:>8}"
        )
    if arguments.json:
        arguments.json.write_text(json.dumps({"machine": machine(), "scale": float(scale), "results": rows}, indent=1))


if __name__ == "__main__":
    main()
