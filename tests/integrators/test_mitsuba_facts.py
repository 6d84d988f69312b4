"""What we take for granted about Mitsuba: an upgrade that changes it is noticed here."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux.maps.geometry import direction
from tests.helpers import hall_map
from tests.variants import MONO, RGB, SPECTRAL


def emitter() -> mi.Emitter:
    return mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(hall_map()), "scale": 2.0})


def lookup(d: np.ndarray) -> np.ndarray:
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.wi = -mi.Vector3f(*(mi.Float(d[:, k].astype(np.float32)) for k in range(3)))
    return emitter().eval(si).numpy().T


def test_data_has_a_halo_column_on_each_side() -> None:
    data = mi.traverse(emitter())["data"].numpy()
    np.testing.assert_array_equal(data[:, 1:-1], hall_map())
    np.testing.assert_array_equal(data[:, 0], hall_map()[:, -1])
    np.testing.assert_array_equal(data[:, -1], hall_map()[:, 0])


def test_texels_are_lattice_points_of_a_bilinear_lookup() -> None:
    texels = hall_map()
    height, width, _ = texels.shape
    i, j = (k.ravel() for k in np.mgrid[1 : height - 1, 0:width])
    d = direction((j + 0.5) / width, i / (height - 1))
    np.testing.assert_allclose(lookup(d), 2 * texels[i, j], atol=2e-3)
    d = direction((j + 1.0) / width, (i + 0.5) / (height - 1))
    corners = [texels[i + a, (j + b) % width] for a in (0, 1) for b in (0, 1)]
    np.testing.assert_allclose(lookup(d), 2 * np.mean(corners, axis=0), atol=2e-3)


def test_eval_direction_looks_up_uv() -> None:
    u, v = np.random.default_rng(0).random((2, 500)).astype(np.float32)
    ds = dr.zeros(mi.DirectionSample3f, 500)
    ds.uv = mi.Point2f(mi.Float(u), mi.Float(v))
    it = dr.zeros(mi.SurfaceInteraction3f, 500)
    np.testing.assert_allclose(
        emitter().eval_direction(it, ds).numpy().T, lookup(direction(u, v)), rtol=2e-3, atol=2e-3
    )


def test_random_floats_are_multiples_of_2_to_the_minus_23() -> None:
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 100000)
    units = sampler.next_1d().numpy().astype(np.float64) * 2**23
    np.testing.assert_array_equal(units, np.round(units))


def test_luminance_weights() -> None:
    from stratalux.images.colour import LUMINANCE

    basis = [float(mi.luminance(mi.Color3f(*row))[0]) for row in np.eye(3).tolist()]
    np.testing.assert_allclose(basis, LUMINANCE)


def test_the_bilinear_warp_agrees_with_its_pdf() -> None:
    u = mi.Point2f(mi.Float([0.2, 0.7, 0.99]), mi.Float([0.1, 0.5, 0.9]))
    point, pdf = mi.warp.square_to_bilinear(mi.Float(0.0), mi.Float(1.0), mi.Float(0.5), mi.Float(0.2), u)
    again = mi.warp.square_to_bilinear_pdf(mi.Float(0.0), mi.Float(1.0), mi.Float(0.5), mi.Float(0.2), point)
    np.testing.assert_allclose(pdf.numpy(), again.numpy(), rtol=1e-5)


def test_where_a_map_is() -> None:
    """Its middle is at +z, what is right of it at -x, and its first row at +y."""
    height, width = 64, 128
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, np.arange(height) / (height - 1))
    texels = np.stack([np.abs(u - 0.5), np.abs(u - 0.75), v], axis=-1).astype(np.float32)
    light = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(texels)})
    si = dr.zeros(mi.SurfaceInteraction3f, 3)
    si.wi = -mi.Vector3f([0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    values = light.eval(si).numpy()
    np.testing.assert_allclose([values[0, 0], values[1, 1], values[2, 2]], 0, atol=0.005)
    np.testing.assert_allclose(values[2, :2], 0.5, atol=0.005)


@pytest.mark.parametrize(
    ("light", "seen"),
    [
        ({"type": "point", "position": [0, 0, 2], "intensity": 8.0}, 2.0),
        (
            {"type": "spot", "to_world": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]], "intensity": 8.0},
            2.0,
        ),
        ({"type": "directional", "direction": [0, 0, -1], "irradiance": 3.0}, 3.0),
    ],
)
def test_units_of_lights_that_are_points(light: dict, seen: float) -> None:
    """Irradiance of what faces them 2 away: W/sr over the squared distance, and W/m² as they are."""
    if "to_world" in light:
        light = {**light, "to_world": mi.ScalarTransform4f(light["to_world"])}
    it = dr.zeros(mi.Interaction3f)
    ds, weight = mi.load_dict(light).sample_direction(it, mi.Point2f(0.5))
    np.testing.assert_allclose(weight.numpy().ravel(), seen, rtol=1e-5)
    np.testing.assert_allclose(ds.d.numpy().ravel(), [0, 0, 1], atol=1e-6)


def test_units_of_lights_with_an_area() -> None:
    """Radiance is what a camera sees, at any distance."""
    for light in ({"type": "constant", "radiance": 5.0}, {"type": "sphere", "e": {"type": "area", "radiance": 5.0}}):
        scene = mi.load_dict({"type": "scene", "light": light})
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, 9), mi.Vector3f(0, 0, -1)))
        np.testing.assert_allclose(si.emitter(scene).eval(si).numpy().ravel(), 5, rtol=1e-5)


def test_the_first_texel_of_a_texture_is_at_uv_0_0() -> None:
    texels = np.eye(4, dtype=np.float32)[[1, 2, 3, 0]].reshape(2, 2, 4)[..., 1:]
    texture = mi.load_dict({"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, "filter_type": "nearest"})
    si = dr.zeros(mi.SurfaceInteraction3f, 4)
    si.uv = mi.Point2f([0.1, 0.9, 0.1, 0.9], [0.1, 0.1, 0.9, 0.9])
    np.testing.assert_allclose(texture.eval(si).numpy().T, texels.reshape(4, 3), atol=1e-6)


@pytest.mark.parametrize("variant", [RGB, MONO, SPECTRAL])
def test_a_changed_map_is_a_new_array(variant: str) -> None:
    mi.set_variant(variant)
    light = emitter()
    params = mi.traverse(light)
    held = mi.Float(params["data"].array)  # a reference of its own: ``array`` alone follows the emitter
    assert mi.traverse(light)["data"].array.index == held.index
    params["data"] = params["data"] * 0.5
    params.update()
    assert mi.traverse(light)["data"].array.index != held.index


@pytest.mark.parametrize(("more", "drawn"), [(0, False), (int(mi.BSDFFlags.Null), True)])
def test_a_mask_draws_what_it_covers_only_along_with_what_goes_through(more: int, drawn: bool) -> None:
    bsdf = mi.load_dict({"type": "mask", "opacity": 0.5, "nested": {"type": "diffuse"}})
    ctx = mi.BSDFContext()
    ctx.type_mask = int(mi.BSDFFlags.Smooth) | more
    si = dr.zeros(mi.SurfaceInteraction3f, 64)
    si.wi = mi.Vector3f(0, 0, 1)
    bs, _ = bsdf.sample(ctx, si, (dr.arange(mi.Float, 64) + 0.5) / 64, mi.Point2f(0.3, 0.6))
    assert dr.any(mi.has_flag(bs.sampled_type, mi.BSDFFlags.Smooth))[0] == drawn


def test_wrappers_do_not_tell_what_a_mask_inside_lets_through() -> None:
    """If one day they do, nothing has to be told of them any more (see :mod:`stratalux.scenes.mitsuba_xml`)."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    mask = {"type": "mask", "opacity": 0.25, "covers": {"type": "diffuse"}}
    blend = {"type": "blendbsdf", "weight": 0.5, "first": mask, "second": {"type": "diffuse"}}
    bumpy = {"type": "bumpmap", "bumps": {"type": "checkerboard"}, "covers": mask}
    for description, transmission in ((mask, 0.75), (blend, 0.375), (bumpy, 0), ({"type": "null"}, 1)):
        bsdf = mi.load_dict(description)
        assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null)
        assert bsdf.eval_null_transmission(si).numpy().ravel() == pytest.approx(transmission)
