"""Render the pictures of docs/gallery.md from the test assets: python -m scripts.gallery [NAME ...]."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np

import stratalux
from stratalux import EnvironmentMap, InputError, load_scene, median_cut
from stratalux.assets import Assets
from stratalux.images.files import write_atomically
from stratalux.images.tonemap import tonemap
from stratalux.integrators.techniques import techniques as all_techniques
from stratalux.rigs.picture import draw_regions

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"
STRATA = (16, 32, 64, 256)
EXPOSURE = 4.0
"""Stops, for pictures that are compared."""
MAPS = ("venice", "studio", "forest", "night", "sky", "apartment", "warehouse")


def asset(name: str) -> Path:
    return Assets().require(name)


def save(name: str, pixels: object, quality: int = 85) -> None:
    write_atomically(GALLERY / f"{name}.jpg", lambda path: mi.Bitmap(pixels).write(path, quality=quality))
    print(name, flush=True)


def render(name: str, scene: mi.Scene, **options: int) -> None:
    save(name, tonemap(stratalux.render(scene, **options).image))


def figure_1() -> None:
    environment = EnvironmentMap.load(asset("grace"))
    save("grace-64-regions", draw_regions(environment, median_cut(environment, 64)))


def grace(mesh: str) -> None:
    """Strata and proposals on a diffuse and a glossy surface."""
    for material, proposals, spp in (("diffuse", 1, 4), ("metal", 1, 1), ("metal", 50, 1)):
        scene = load_scene(asset(mesh), environment=asset("grace"), rotate=(180, 0, 0), material=material)
        for strata in STRATA:
            render(f"{mesh}-{material}-{strata}-{proposals}", scene, strata=strata, proposals=proposals, spp=spp)


def maps() -> None:
    for i, name in enumerate(MAPS):
        mesh = ("buddha", "teapot")[i % 2]
        material = ("plastic", "copper", "ceramic", "gold")[i % 4]
        scene = load_scene(asset(mesh), environment=asset(name), material=material)
        render(f"map-{name}", scene, strata=64, proposals=4, spp=32)


def matpreview() -> None:
    render("matpreview", load_scene(asset("matpreview")), strata=64, spp=64)


def techniques() -> None:
    """A strip for each technique: Buddha (diffuse) and teapot (metal) in Grace with 16 and 64 rays a shading point."""
    scenes = [
        load_scene(asset(mesh), environment=asset("grace"), rotate=(180, 0, 0), material=material, size=(300, 200))
        for mesh, material in (("buddha", "diffuse"), ("teapot", "metal"))
    ]
    for name, technique in all_techniques().items():
        strip = []
        for scene in scenes:
            for rays in (16, 64):
                given, samples = technique.with_rays(rays)
                integrator = mi.load_dict(technique.integrator(given))
                image = stratalux.render(scene, integrator=integrator, spp=4 * samples).image
                strip.append(tonemap(image, EXPOSURE))
        save(f"technique-{name}", np.concatenate(strip, axis=1))


def demo() -> None:
    render("demo", load_scene("demo", size=(900, 600)), strata=64, proposals=2, spp=64)


PARTS: dict[str, Callable[[], None]] = {
    "figure-1": figure_1,
    "buddha": lambda: grace("buddha"),
    "teapot": lambda: grace("teapot"),
    "maps": maps,
    "techniques": techniques,
    "matpreview": matpreview,
    "demo": demo,
}


def main() -> None:
    names = sys.argv[1:] or list(PARTS)
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        sys.exit(f"unknown part {unknown[0]}; known: {', '.join(PARTS)}")
    mi.set_variant("llvm_ad_rgb")
    GALLERY.mkdir(parents=True, exist_ok=True)
    for name in names:
        try:
            PARTS[name]()
        except InputError as error:
            sys.exit(str(error))


if __name__ == "__main__":
    main()
