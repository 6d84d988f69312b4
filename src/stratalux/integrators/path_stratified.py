"""``path_stratified``: the whole light, its direct part as that of ``direct_stratified``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial, reduce
from typing import Any

import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..sampling.leaf_sampler import BrightLeafSampler
from ..sampling.points import mix
from .automatic.image import Automatic, opaque_seed
from .automatic.launch import Launcher
from .automatic.lobes import DIM, MOST_RAYS
from .automatic.nested_strata import PixelPoints
from .automatic.sample import AllocatedLight, AutomaticSample
from .automatic.stages import TwoStages
from .automatic.view import View, pilot_samples
from .both_ways import BothWays
from .environment import MapCache
from .indirect.image import Indirect, added, pilot_paths
from .indirect.light_paths import LightLauncher, LightView
from .indirect.paths import Paths
from .indirect.sharing import SharingLauncher
from .indirect.tiles import TiledView
from .indirect.vertex import VertexLight
from .indirect.whole import EACH, FEW_IN_THE_SUN, FewRays, Whole, few, pilot_whole, too_large
from .launches import Maker, of_part
from .other_emitters import OtherEmitters
from .sight import Sight
from .sums import UNLIMITED, Memory, Noise, Pixels, added_noise
from .techniques import Property, Technique, properties_from

PATH = Technique(
    name="path-stratified",
    plugin="path_stratified",
    summary="the whole light: stratified at the first surface, paths with strata beyond",
    source="Kajiya 1986; Mei, Jaeger and Hu 2006",
    unbiased=True,
    properties={
        "max_depth": Property(
            -1,
            "segments of a path, at most: 2 is direct light; -1: no limit",
            minimum=-1,
            barred=dict.fromkeys((0, 1), "leaves no light on surfaces; give 2 or more, or -1"),
        ),
        "rr_depth": Property(5, "surfaces from which on paths end at random", minimum=1),
    },
    rays_per_sample=MOST_RAYS,
)
TECHNIQUES = (PATH,)
_FEWER, _MORE = 2, 2
"""Camera samples of direct light are so many times fewer than those asked for, and paths so many times more: with all
their strata, samples of direct light cost as much and have much smaller errors. Paths that share what they find are
better and dearer: of these, there are as many as samples of direct light."""
_RARER = 4
"""Light paths are so many times fewer than others."""
_CONCENTRATED, _CONCENTRATED_FOR_FEW, _MANY = 20.0, 300.0, 8
"""Concentration of a map from which on light paths pay, with that many samples per pixel, and with fewer."""
_PATHS_SEED, _LIGHT_SEED = 0x1B873593, 0xCC9E2D51
_NO_DERIVATIVES = "path_stratified: has no derivatives; use Mitsuba's 'prb', or 'direct_stratified' for direct light"


def _shared_out(spp: int) -> tuple[int, int]:
    """Samples of direct light, and paths."""
    return (spp, spp) if spp >= UNLIMITED else (max(1, spp // _FEWER), spp * _MORE)


def _paths_of(props: mi.Properties) -> Paths:
    settings = properties_from(PATH, props)
    return Paths(int(settings["max_depth"]), int(settings["rr_depth"]), bool(props.get("hide_emitters", False)))


class PathSample(AutomaticSample):
    """The estimate for a camera sample, in whatever order Mitsuba or another integrator asks for them."""

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._paths = _paths_of(props)
        self._indirect = Indirect(self, self._paths)

    def radiance(
        self,
        scene: mi.Scene,
        prepared: AllocatedLight | None,
        others: OtherEmitters,
        sight: Sight,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        active: mi.Bool | bool,
    ) -> tuple[mi.Spectrum, mi.Bool | mi.Float]:
        """Radiance along ``ray``, and its alpha."""
        L, alpha = super().radiance(scene, prepared, others, sight, sampler, ray, active)
        if self._paths.any:
            points = PixelPoints.of(sampler)
            L += self._indirect.radiance(scene, prepared, others, sight, points, ray, active)[0]
        return L, alpha


class PathStratified(Automatic):
    r"""Path tracing: the direct light of ``direct_stratified``, and paths for what is reflected between surfaces.

    ================= ======= ===================================================================================
    ``max_depth``     int     Segments of a path, at most; 2 is direct light alone (default: -1, no limit)
    ``rr_depth``      int     Surfaces from which on paths end at random (default: 5)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ===================================================================================

    These are the properties of Mitsuba's ``path``, with the same meaning but for surfaces that let light go straight
    on, as masks do, which count for no depth. ``background`` and ``catcher`` are those of all our integrators.

    Light that is scattered once is that of :class:`~.automatic.image.Automatic`. The rest, see
    :class:`~.indirect.paths.Paths`, is an image of its own, with camera samples of its own, which is added: for each
    two samples per pixel, one of direct light and four paths. In closed rooms, paths of pixels that are near share what
    they find (:mod:`.indirect.sharing`): one such path for each sample of direct light. A few samples per pixel
    estimate all of it in one (:mod:`.indirect.whole`). Where a map that is concentrated shines on things of gloss
    alone, light paths share with all these (:mod:`.both_ways`): an image of its own (:mod:`.indirect.light_paths`).
    There are no derivatives.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._paths = _paths_of(props)
        self._bright: dict[bool, MapCache[BrightLeafSampler]] = {
            glossy: MapCache(partial(BrightLeafSampler, glossy=glossy)) for glossy in (False, True)
        }
        self._plain: PathSample = PathSample(props)
        self._plain._cache = self._cache

    def sample(
        self,
        scene: mi.Scene,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        medium: mi.Medium | None = None,
        active: mi.Bool | bool = True,
    ) -> tuple[mi.Spectrum, mi.Bool, list[mi.Float]]:
        """Radiance along ``ray``, its alpha, and no AOVs (Mitsuba's integrator interface)."""
        return self._plain.sample(scene, sampler, ray, medium, active)

    def render_forward(
        self, scene: mi.Scene, params: Any, sensor: mi.Sensor | int = 0, seed: int | mi.UInt32 = 0, spp: int = 0
    ) -> mi.TensorXf:
        """Raises :class:`InputError`: there are no derivatives."""
        raise InputError(_NO_DERIVATIVES)

    def render_backward(
        self,
        scene: mi.Scene,
        params: Any,
        grad_in: mi.TensorXf,
        sensor: mi.Sensor | int = 0,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
    ) -> None:
        """Raises :class:`InputError`: there are no derivatives."""
        raise InputError(_NO_DERIVATIVES)

    def _passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, memory: Memory, make: Maker
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        if not self._paths.any:
            yield from super()._passes(scene, sensor, seed, spp, memory, make)
            return
        spp = spp or sensor.sampler().sample_count()
        parts = self._under_way = self._parts(scene, sensor, seed, spp, memory)
        passes = {name: part.passes(of_part(make, name)) for name, part in parts.items()}
        # What a sample of each one stands for
        worth = {name: spp / part.spp for name, part in parts.items()}
        if spp >= UNLIMITED and "light" in parts:
            worth["light"] = _RARER
        so_far: dict[str, tuple[Pixels, float, Noise]] = {}
        for name, those in passes.items():
            so_far[name] = next(those)
            if name == "direct":  # for those beside it
                memory.setdefault("before", so_far[name][0])
        while True:
            image = reduce(added, (image for image, *_ in so_far.values()))
            done = {name: samples * worth[name] for name, (_, samples, _) in so_far.items()}
            noise = reduce(added_noise, (noise for *_, noise in so_far.values()))
            yield image, sum(done.values()) / len(done), noise
            # The part that is most behind goes on, or another one where that has come to its end.
            for name in sorted(passes, key=done.__getitem__):
                if step := next(passes[name], None):
                    so_far[name] = step
                    break
            else:
                return

    def _parts(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, memory: Memory
    ) -> dict[str, TwoStages]:
        if not self._paths.any:
            return super()._parts(scene, sensor, seed, spp, memory)
        light = self._begin(scene, sensor)
        dim, other = DIM * light.mean, opaque_seed(mix(mi.UInt32(seed) ^ _PATHS_SEED))
        make = partial(SharingLauncher, Indirect(self, self._paths), self._paths)
        launcher = self._launcher("paths", light, scene, sensor, make)
        if launcher.enclosed():
            own = memory.setdefault("paths", {})
            view: View = TiledView(launcher, self._most(sensor, own, spp))
            paths = TwoStages(view, view.first(spp), spp, other, dim, own, even=True)
            return {"direct": self._direct(light, scene, sensor, seed, spp, memory), "paths": paths}
        straight = launcher.seen[-1].straight
        if not straight and (whole := self._whole(scene, sensor, spp, light)):
            return self._in_one(whole, light, seed, spp, memory)
        own = memory.setdefault("paths", {})
        less, many = _shared_out(spp)
        limited = spp < UNLIMITED
        from_light = max(1, spp // _FEWER) if limited else spp
        ways = None if straight else self._ways(light, launcher, spp, from_light / many if limited else 1 / _RARER)
        view = View(launcher, None, self._most(sensor, own, less))
        pilot = pilot_paths(many, view.film.rfilter().is_box_filter())
        paths = TwoStages(view, pilot, many, other, dim, own, beside=lambda: memory["before"])
        parts = {"direct": self._direct(light, scene, sensor, seed, less, memory), "paths": paths}
        if ways is not None:
            parts["light"] = self._light_paths(
                "light paths", launcher, VertexLight, ways, seed, from_light, dim, memory
            )
        return parts

    def _in_one(
        self, launcher: Launcher, light: AllocatedLight[Any], seed: int | mi.UInt32, spp: int, memory: Memory
    ) -> dict[str, TwoStages]:
        """The parts of a picture whose light is estimated in one."""
        dim, many, own = DIM * light.mean, spp * EACH, memory.setdefault("whole", {})
        ways = self._ways(light, launcher, spp, 1 / EACH)
        view = View(launcher, None, self._most(launcher.sensor, own, many))
        bright, *_ = launcher.seen
        pilot = pilot_whole(bright, spp, view.pixels, ways is not None)
        if even := pilot == many:
            pilot = view.first(many)
        parts = {"whole": TwoStages(view, pilot, many, opaque_seed(seed), dim, own, even=even)}
        if ways is not None:
            name = "few light paths, in the sun" if bright.tables.sunny else "few light paths"
            parts["light"] = self._light_paths(name, launcher, FewRays, ways, seed, spp, dim, memory)
        return parts

    @staticmethod
    def _ways(light: AllocatedLight[Any], launcher: Launcher, spp: int, share: float) -> BothWays | None:
        """How the camera samples of a ``launcher`` share with so many light paths for each, where these pay."""
        concentrated = _CONCENTRATED if spp >= _MANY else _CONCENTRATED_FOR_FEW
        pays = light.tables.concentration >= concentrated
        ways = BothWays.of(launcher.scene, launcher.sensor, share) if pays else None
        launcher.share(ways)
        return ways

    def _light_paths(
        self,
        name: str,
        beside: Launcher,
        arriving: Callable[..., VertexLight],
        ways: BothWays,
        seed: int | mi.UInt32,
        count: int,
        dim: float,
        memory: Memory,
    ) -> TwoStages:
        """The image of ``count`` light paths a pixel, which share with the samples of the launcher ``beside``."""
        light, *_ = beside.seen
        make = partial(LightLauncher, beside.integrator, self._paths, arriving)
        launcher = self._launcher(name, light, beside.scene, beside.sensor, make)
        launcher.share(ways)
        own = memory.setdefault("light", {})
        view = LightView(launcher, self._most(beside.sensor, own, count))
        other = opaque_seed(mix(mi.UInt32(seed) ^ _LIGHT_SEED))
        return TwoStages(view, view.first(count), count, other, dim, own, even=True)

    def _whole(self, scene: mi.Scene, sensor: mi.Sensor, spp: int, light: AllocatedLight[Any]) -> Launcher | None:
        """For so few samples that all of the light is best estimated in one; None if it is not."""
        if spp > FEW_IN_THE_SUN or self.background != "map" or self.catcher or too_large(scene):
            return None
        found = self._bright[light.allocation.any_glossy].get(scene)
        assert found is not None
        bright = AllocatedLight(found, light.allocation)
        if spp > few(bright, int(np.prod(sensor.film().crop_size()))):
            return None
        # One for each kind of map, as this is compiled into kernels.
        make = partial(Launcher, Whole(self._paths, self.hide_emitters))
        return self._launcher("whole, in the sun" if bright.tables.sunny else "whole", bright, scene, sensor, make)

    def _pilots(self, sensor: mi.Sensor, spp: int) -> tuple[int, ...]:
        if not self._paths.any:
            return super()._pilots(sensor, spp)
        many = spp if spp >= UNLIMITED else spp * _FEWER * _MORE
        # Light paths have none.
        return pilot_samples(spp), pilot_paths(many, sensor.film().rfilter().is_box_filter()), 0

    def to_string(self) -> str:
        return f"PathStratified[max_depth = {self._paths.max_depth}, rr_depth = {self._paths.rr_depth}]"


PLUGINS = {"path_stratified": PathStratified}
