"""Maps for the tests of light rigs, and sums over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stratalux import EnvironmentMap
from stratalux.maps.geometry import row_weights
from tests.helpers import hall_map, sun_map


def random_map(height: int = 24, width: int = 48, seed: int = 3, spread: float = 1.5) -> NDArray[np.float32]:
    """Log-normal noise of three colours."""
    return np.random.default_rng(seed).lognormal(0, spread, (height, width, 3)).astype(np.float32)


def black_half_map(height: int = 24, width: int = 48) -> NDArray[np.float32]:
    """Noise whose right half is black."""
    texels = random_map(height, width)
    texels[:, width // 2 :] = 0
    return texels


def blobs_map(height: int = 64, width: int = 128) -> NDArray[np.float32]:
    """A dim sky with a broad glow, a small bright lamp on it and another lamp elsewhere: nested layers."""
    i, j = np.mgrid[:height, :width]
    glow = 3 * np.exp(-((i - height * 0.5) ** 2 + (j - width * 0.4) ** 2) / (0.08 * height) ** 2)
    lamps = 30.0 * (np.hypot(i - height * 0.5, j - width * 0.4) < 2) + 12.0 * (np.hypot(i - 20, j - 100) < 3)
    return (np.array([0.9, 1.0, 1.2]) * (0.2 + glow + lamps)[..., None]).astype(np.float32)


MAPS = {
    "sun": sun_map(),
    "hall": hall_map(),
    "random": random_map(),
    "black half": black_half_map(),
    "blobs": blobs_map(),
    "constant": np.full((16, 32, 3), 0.7, np.float32),
}


def integral(environment: EnvironmentMap) -> NDArray[np.float64]:
    """∫ L dω over the sphere, cell by cell as the bilinear lookup defines it, (3,)."""
    texels = environment.texels.astype(np.float64)
    pairs = (texels + np.roll(texels, -1, axis=1)) / 2
    upper, lower = row_weights(environment.height)
    cells = upper[:, None, None] * pairs[:-1] + lower[:, None, None] * pairs[1:]
    return np.asarray(cells.sum(axis=(0, 1)) * 2 * np.pi / environment.width)
