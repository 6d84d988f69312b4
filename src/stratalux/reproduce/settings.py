"""How large a reproduction is: the paper's own sizes, a quick look, and one so small that a test can afford it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Sizes are (width, height) in pixels, ``seeds`` independent renderings, samples those of a shading point.

    ``size``: of figures 3 to 5, one camera ray a pixel. ``rates``: of figure 4. ``band_size``: of the image that the
    crop of figure 2 is cut from, 2 x 2 camera rays a pixel, and ``band_seeds`` the renderings that are averaged there.
    ``unbiased_size`` and ``unbiased_seeds``: of the test of the mean. ``balance_size``: of the heat maps over
    ``balance_strata`` N and ``balance_proposals`` M, where N M stays below ``balance_limit``. ``rounds``: timings, the
    sides in turn. ``subdivisions``: how often each triangle of the large mesh is cut into four.
    """

    name: str
    size: tuple[int, int]
    seeds: int
    rates: tuple[int, ...]
    reference_samples: int
    band_size: tuple[int, int]
    band_seeds: int
    band_reference_samples: int
    picture_samples: int
    unbiased_size: tuple[int, int]
    unbiased_seeds: int
    balance_size: tuple[int, int]
    balance_seeds: int
    balance_strata: tuple[int, ...]
    balance_proposals: tuple[int, ...]
    balance_limit: int
    rounds: int
    subdivisions: int


FULL = Settings(
    name="full",
    size=(600, 400),
    seeds=3,
    rates=(4, 8, 16, 32, 64, 128, 256, 512),
    reference_samples=10_000,
    band_size=(600, 400),
    band_seeds=256,
    band_reference_samples=8_192,
    picture_samples=256,
    unbiased_size=(150, 100),
    unbiased_seeds=256,
    balance_size=(180, 120),
    balance_seeds=4,
    balance_strata=(4, 16, 64, 256),
    balance_proposals=(1, 2, 4, 8, 16, 50),
    balance_limit=4096,
    rounds=7,
    subdivisions=2,
)
QUICK = Settings(
    name="quick",
    size=(150, 100),
    seeds=3,
    rates=(4, 16, 64, 256),
    reference_samples=4_096,
    band_size=(300, 200),
    band_seeds=48,
    band_reference_samples=1_024,
    picture_samples=64,
    unbiased_size=(75, 50),
    unbiased_seeds=64,
    balance_size=(90, 60),
    balance_seeds=2,
    balance_strata=(4, 16, 64),
    balance_proposals=(1, 4, 16, 50),
    balance_limit=1024,
    rounds=3,
    subdivisions=1,
)
TINY = Settings(
    name="tiny",
    size=(24, 16),
    seeds=2,
    rates=(4, 16),
    reference_samples=256,
    band_size=(60, 40),
    band_seeds=4,
    band_reference_samples=64,
    picture_samples=8,
    unbiased_size=(12, 8),
    unbiased_seeds=8,
    balance_size=(12, 8),
    balance_seeds=2,
    balance_strata=(4, 8),
    balance_proposals=(1, 2),
    balance_limit=8,
    rounds=2,
    subdivisions=1,
)
