"""Where each layout has which direction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux.maps.geometry import direction, texel_solid_angle
from stratalux.maps.layouts import LATLONG, LAYOUTS, Layout
from stratalux.maps.layouts.layout import around, integrated
from stratalux.maps.resampling import Sheet, resample
from stratalux.maps.settings import LAYOUT_NAMES
from stratalux.maps.sheets import packed, unpacked

NAMES = [name for name in LAYOUTS if name != "faces"]
AHEAD, RIGHT, UP = (np.array(axis, dtype=float) for axis in ((0, 0, 1), (-1, 0, 0), (0, 1, 0)))
"""Of an observer who looks at the middle of a latitude-longitude map, in its frame."""


def test_the_settings_have_all_names() -> None:
    assert tuple(LAYOUTS) == LAYOUT_NAMES


def directions(count: int, seed: int = 0) -> NDArray[np.float64]:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_each_direction_has_one_place(layout: Layout, seed: int) -> None:
    d = directions(40, seed)
    face, s, t = layout.position(d)
    assert min(s.min(), t.min()) >= -1e-12 and max(s.max(), t.max()) <= 1 + 1e-12
    back = np.stack([layout.direction(int(f), np.array(a), np.array(b)) for f, a, b in zip(face, s, t, strict=True)])
    np.testing.assert_allclose(back, d, atol=1e-7)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_axes_have_a_place(layout: Layout) -> None:
    """At seams, poles and rims, too."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    face, s, t = layout.position(axes)
    back = np.stack([layout.direction(int(f), np.array(a), np.array(b)) for f, a, b in zip(face, s, t, strict=True)])
    np.testing.assert_allclose(back, axes, atol=1e-7)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_densities_are_solid_angles(layout: Layout) -> None:
    """Against the triple product of a small piece's edges; and in all they are the sphere."""
    rng, h = np.random.default_rng(1), 1e-5
    for face in range(layout.faces):
        s, t = rng.uniform(0.02, 0.98, (2, 60))
        density = layout.density(face, s, t)
        d = layout.direction(face, s, t)
        right, down = layout.direction(face, s + h, t) - d, layout.direction(face, s, t + h) - d
        piece = np.linalg.norm(np.cross(right, down), axis=-1) / h**2
        used = density > 0
        assert used.sum() > 40
        np.testing.assert_allclose(density[used], piece[used], rtol=5e-3)
    u = (np.arange(400) + 0.5) / 400
    total = sum(layout.density(face, *np.meshgrid(u, u)).mean() for face in range(layout.faces))
    assert total == pytest.approx(4 * np.pi, rel=2e-3)


def test_texels_of_latitude_and_longitude_stand_for_their_hat_functions() -> None:
    np.testing.assert_allclose(integrated(LATLONG, (17, 33))[0], texel_solid_angle(17, 33), rtol=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_what_is_around_a_face_is_near(layout: Layout) -> None:
    """The texel that stands in for one beyond an edge is its neighbour on the sphere."""
    height, width = 16, 16 * layout.wide
    index = around(layout, (height, width))
    assert index.shape == (layout.faces, height + 2, width + 2)
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    centres = np.stack([layout.direction(f, *layout.of_texels(x, y, (height, width))) for f in range(layout.faces)])
    flat = centres.reshape(-1, 3)
    for face in range(layout.faces):
        grid = index[face]
        for one, other in ((grid[:, 0], grid[:, 1]), (grid[0], grid[1]), (grid[:, -1], grid[:, -2])):
            apart = np.arccos(np.clip((flat[one] * flat[other]).sum(axis=1), -1, 1))
            # One texel; in the corners of a cube and at poles and rims, somewhat more.
            assert np.median(apart) < 2.2 / height * np.pi
    if not layout.disc:
        np.testing.assert_array_equal(index[:, 1:-1, 1:-1].ravel(), np.arange(index[:, 1:-1, 1:-1].size))


# Where an image has what an observer sees: fractions of its width and its height, of the pixel's middle.
PLACES = {
    "latlong": {"ahead": (0.5, 0.5), "right": (0.75, 0.5), "left": (0.25, 0.5)},
    "cross": {
        "ahead": (1.5 / 4, 1.5 / 3),
        "right": (2.5 / 4, 1.5 / 3),
        "left": (0.5 / 4, 1.5 / 3),
        "behind": (3.5 / 4, 1.5 / 3),
        "up": (1.5 / 4, 0.5 / 3),
        "down": (1.5 / 4, 2.5 / 3),
    },
    "vertical-cross": {
        "ahead": (1.5 / 3, 1.5 / 4),
        "right": (2.5 / 3, 1.5 / 4),
        "left": (0.5 / 3, 1.5 / 4),
        "behind": (1.5 / 3, 3.5 / 4),
        "up": (1.5 / 3, 0.5 / 4),
        "down": (1.5 / 3, 2.5 / 4),
    },
    # +X, -X, +Y, -Y, +Z, -Z of a left-handed cube: right, left, up, down, ahead, behind.
    "strip": {name: ((k + 0.5) / 6, 0.5) for k, name in enumerate(("right", "left", "up", "down", "ahead", "behind"))},
    "vertical-strip": {
        name: (0.5, (k + 0.5) / 6) for k, name in enumerate(("right", "left", "up", "down", "ahead", "behind"))
    },
    # +X, -X ... of OpenEXR's frame, which is right-handed, as the map's.
    "openexr-cube": {
        name: (0.5, (k + 0.5) / 6) for k, name in enumerate(("left", "right", "up", "down", "ahead", "behind"))
    },
    "octahedral": {
        "up": (0.5, 0.5),
        "ahead": (0.5, 1.0),
        "behind": (0.5, 0.0),
        "right": (0.0, 0.5),
        "left": (1.0, 0.5),
    },
    "equal-area": {
        "up": (0.5, 0.5),
        "ahead": (0.0, 0.5),
        "behind": (1.0, 0.5),
        "right": (0.5, 0.0),
        "left": (0.5, 1.0),
    },
    "angular": {"ahead": (0.5, 0.5), "right": (0.75, 0.5), "left": (0.25, 0.5), "up": (0.5, 0.25), "down": (0.5, 0.75)},
    "mirror-ball": {
        "behind": (0.5, 0.5),
        "right": (0.5 + 0.5**1.5, 0.5),
        "left": (0.5 - 0.5**1.5, 0.5),
        "up": (0.5, 0.5 - 0.5**1.5),
        "down": (0.5, 0.5 + 0.5**1.5),
    },
}
TOWARDS = {"ahead": AHEAD, "right": RIGHT, "up": UP, "behind": -AHEAD, "left": -RIGHT, "down": -UP}


@pytest.mark.parametrize(("name", "places"), PLACES.items(), ids=PLACES)
def test_known_directions_are_at_known_pixels(name: str, places: dict[str, tuple[float, float]]) -> None:
    """A map of latitude and longitude with one coloured spot is converted; the image has it where it belongs."""
    layout = LAYOUTS[name]
    u, v = np.meshgrid((np.arange(96) + 0.5) / 96, np.arange(48) / 47)
    d = direction(u, v)
    for towards, (x, y) in places.items():
        spot = np.exp(60 * (d @ TOWARDS[towards] - 1))[..., None] * np.ones(3)
        image = packed(resample(Sheet(LATLONG, spot[None].astype(np.float32)), layout, 32))[0][..., 0]
        height, width = image.shape
        row, column = np.unravel_index(image.argmax(), image.shape)
        assert abs((column + 0.5) / width - x) * width < 1.6 and abs((row + 0.5) / height - y) * height < 1.6, towards


def lookups(layout: Layout, d: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack(layout.position(d), axis=-1)


def test_cubes_are_those_of_opengl() -> None:
    """Table 8.19 of its specification, of the direction that three.js looks up: the x of the world is reversed."""
    d = directions(2000)
    x, y, z = (d * [-1, 1, 1]).T
    faces = [(x, -z, -y), (-x, z, -y), (y, x, z), (-y, x, -z), (z, x, -y), (-z, -x, -y)]
    major = np.stack([ma for ma, _, _ in faces])
    face = major.argmax(axis=0)
    s, t = (
        np.take_along_axis((np.stack([f[k] for f in faces]) / np.abs(major) + 1) / 2, face[None], axis=0)[0]
        for k in (1, 2)
    )
    np.testing.assert_allclose(lookups(LAYOUTS["strip"], d), np.stack([face, s, t], axis=-1), atol=1e-12)


def test_octahedra_are_those_of_the_survey() -> None:
    """Cigolle et al. 2014, of (x, z, y): their z is in the middle."""
    d = directions(2000)
    a, b, c = d[:, 0], d[:, 2], d[:, 1]
    p = np.stack([a, b], axis=-1) / np.abs(d).sum(axis=1, keepdims=True)
    folded = (1 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1, -1)
    expected = np.where((c <= 0)[:, None], folded, p) / 2 + 0.5
    np.testing.assert_allclose(lookups(LAYOUTS["octahedral"], d)[:, 1:], expected, atol=1e-12)


def test_probes_are_those_of_debevec() -> None:
    """(u, v) = (Dx, Dy) r with r = arccos(ahead) / π / √(Dx² + Dy²); his x is to the right, and v goes up."""
    d = directions(2000)
    right, up, ahead = d @ RIGHT, d @ UP, d @ AHEAD
    r = np.arccos(ahead) / np.pi / np.hypot(right, up)
    expected = np.stack([(1 + right * r) / 2, (1 - up * r) / 2], axis=-1)
    np.testing.assert_allclose(lookups(LAYOUTS["angular"], d)[:, 1:], expected, atol=1e-9)


def test_balls_reflect() -> None:
    """A camera far away looks ahead: where it sees the ball, the ray is reflected about the normal."""
    layout = LAYOUTS["mirror-ball"]
    d = directions(2000)
    _, s, t = layout.position(d)
    a, b = 2 * s - 1, 1 - 2 * t
    normal = a[:, None] * RIGHT + b[:, None] * UP - np.sqrt(np.maximum(1 - a * a - b * b, 0))[:, None] * AHEAD
    reflected = AHEAD - 2 * (normal @ AHEAD)[:, None] * normal
    np.testing.assert_allclose(reflected, d, atol=1e-6)


def test_equal_areas_are_those_of_pbrt() -> None:
    """``EqualAreaSquareToSphere`` (pbrt-v4, ``util/math.cpp``), and ``imgtool makeequiarea``, which asks a map of
    latitude and longitude at φ / 2π and θ / π of what that gives."""
    rng = np.random.default_rng(2)
    s, t = rng.uniform(0, 1, (2, 2000))
    u, v = 2 * s - 1, 2 * t - 1
    signed = 1 - (np.abs(u) + np.abs(v))
    r = 1 - np.abs(signed)
    φ = ((np.abs(v) - np.abs(u)) / r + 1) * np.pi / 4
    z = np.copysign(1 - r * r, signed)
    x, y = (np.copysign(f(φ), w) * r * np.sqrt(2 - r * r) for f, w in ((np.cos, u), (np.sin, v)))
    expected = direction(np.arctan2(y, x) / (2 * np.pi) % 1, np.arccos(z) / np.pi)
    np.testing.assert_allclose(LAYOUTS["equal-area"].direction(0, s, t), expected, atol=1e-9)


def test_cubes_of_openexr() -> None:
    """ImfEnvmap.h: where each pixel of each face points to; the outermost are on the edges."""
    side = 5
    rows, columns = np.mgrid[:side, :side]
    right, down = 2 * columns / (side - 1) - 1, 2 * rows / (side - 1) - 1
    one = np.ones_like(right)
    faces = [
        (one, -down, right),
        (-one, -down, -right),
        (right, one, -down),
        (right, -one, down),
        (-right, -down, one),
        (right, -down, -one),
    ]
    layout = LAYOUTS["openexr-cube"]
    for face, towards in enumerate(faces):
        d = np.stack(towards, axis=-1)
        s, t = layout.of_texels(columns.astype(float), rows.astype(float), (side, side))
        expected = d / np.linalg.norm(d, axis=-1, keepdims=True)
        np.testing.assert_allclose(layout.direction(face, s, t), expected, atol=1e-12)


@pytest.mark.parametrize("name", ["cross", "vertical-cross"])
def test_faces_of_a_cross_go_on_where_they_touch(name: str) -> None:
    layout, side = LAYOUTS[name], 32
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    d = np.stack([layout.direction(face, *layout.of_texels(x, y, (side, side))) for face in range(6)])
    image = packed(Sheet(layout, (d + 2).astype(np.float32)))[0]
    for axis in (0, 1):
        one, other = (image.take(range(first, image.shape[axis] + first - 1), axis=axis) for first in (0, 1))
        both = (one[..., 0] > 0) & (other[..., 0] > 0)
        assert both.sum() > 5 * side * (side - 1) and np.abs(one - other)[both].max() < 3 / side


@pytest.mark.parametrize("name", NAMES)
def test_images_are_unpacked_as_they_were_packed(name: str) -> None:
    layout = LAYOUTS[name]
    texels = np.random.default_rng(3).random((layout.faces, 6, 6 * layout.wide, 3)).astype(np.float32)
    (image,) = packed(Sheet(layout, texels))
    assert layout.fits(image.shape[1], image.shape[0]) and not layout.fits(image.shape[1] + 1, image.shape[0])
    np.testing.assert_array_equal(unpacked(image, layout).texels, texels)
