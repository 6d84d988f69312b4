"""The table of rays and proposals, and what is measured to choose from it."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import scene_dict

LANES = 1 << 14
CONDUCTOR = {"type": "roughconductor", "distribution": "ggx", "specular_reflectance": 1.0}
BOTH = {"type": "roughplastic", "alpha": 0.1}


def scene(*bsdfs: dict[str, Any]) -> mi.Scene:
    """A ball of the first of ``bsdfs``, a box of the next one, and a floor of the last; meshes of one are merged."""
    description = scene_dict("diffuse", texels=np.ones((8, 16, 3), dtype=np.float32))
    for name, k in (("ball", 0), ("box", 1), ("floor", -1)):
        description[name]["bsdf"] = dict(bsdfs[min(k, len(bsdfs) - 1)])
    return mi.load_dict(description)


@pytest.mark.parametrize(
    ("ratio", "most", "expected"),
    [
        *((0.0, 8, 1), (1.4, 8, 1), (1.5, 8, 2), (2.8, 8, 2), (2.9, 8, 4), (5.7, 8, 8)),
        *((100, 8, 8), (100, 2, 2), (100, 1, 1), (math.nan, 8, 1), (math.inf, 8, 1)),
    ],
)
def test_proposals_are_powers_of_two(ratio: float, most: int, expected: int) -> None:
    from stratalux.integrators.automatic.lobes import _power_of_two

    assert _power_of_two(ratio, most) == expected


@pytest.mark.parametrize(
    ("bsdf", "row"),
    [
        ({"type": "diffuse"}, 0),
        ({"type": "conductor"}, 0),  # a mirror has no lobes, and gets no rays for any
        (BOTH, 1),
        ({"type": "roughplastic", "alpha": 0.9}, 0),  # with hardly any gloss
        ({**CONDUCTOR, "alpha": 0.3}, 2),
        ({**CONDUCTOR, "alpha": 0.14}, 3),
        ({**CONDUCTOR, "alpha": 0.05}, 4),
    ],
)
def test_rows_follow_the_concentration(bsdf: dict[str, Any], row: int) -> None:
    """That of the BSDF of each shape, whichever of them it is."""
    from stratalux.integrators.automatic.lobes import ROWS, Allocation, _rows

    lit = scene({"type": "diffuse"}, bsdf, {"type": "diffuse", "reflectance": 0.2})
    _, rows = _rows(lit)
    at = [shape.class_name() for shape in lit.shapes()].index("Cube")
    found = rows.numpy().tolist()
    assert found.pop(at) == row and found == [0, 0]
    allocation = Allocation(lit, mi.load_dict({"type": "direct_stratified"}).prepare(lit))
    assert allocation.any_bsdf_samples == (ROWS[row].lobe > 0) and allocation.any_matte
    alone = Allocation(scene(bsdf), mi.load_dict({"type": "direct_stratified"}).prepare(lit))
    assert alone.any_matte == ROWS[row].matte
    N, K, M, matte = allocation.of(
        mi.ShapePtr(lit.shapes()[at]), mi.BSDFPtr(lit.shapes()[at].bsdf()), mi.UInt32(0), mi.Bool(True)
    )
    # All light there is comes evenly from all sides: only beside some light samples do the lobes' bring unlike shares.
    most = 8 if row > 1 else 16
    assert [int(x[0]) for x in (N, K, M)] == [min(ROWS[row].light, most), ROWS[row].lobe, 2 if row == 2 else 1]
    assert bool(matte[0]) == ROWS[row].matte


@pytest.mark.parametrize(("count", "rows"), [(0, []), (1, [3])])
def test_scenes_of_one_shape_or_none(count: int, rows: list[int]) -> None:
    from stratalux.integrators.automatic.lobes import _rows

    ball = {"ball": {"type": "sphere", "bsdf": {**CONDUCTOR, "alpha": 0.14}}}
    lit = mi.load_dict({"type": "scene", "sky": scene_dict()["sky"], **(ball if count else {})})
    assert _rows(lit)[1].numpy().tolist() == rows


def test_a_bsdf_on_several_shapes_has_a_row_on_each() -> None:
    """Its roughness is an attribute of the mesh; and what is told to be matte is, on whatever shape."""
    from stratalux.integrators.automatic.lobes import ROWS, Allocation

    bsdf = mi.load_dict({**CONDUCTOR, "alpha": {"type": "mesh_attribute", "name": "vertex_alpha"}})
    meshes = {}
    for number, alpha in enumerate((0.05, 0.3)):
        mesh = mi.Mesh(f"mesh{number}", 3, 1)
        params = mi.traverse(mesh)
        params["vertex_positions"] = [0.0, 0, number, 1, 0, number, 0, 1, number]
        params["faces"] = [0, 1, 2]
        params.update()
        mesh.add_attribute("vertex_alpha", 1, [alpha] * 3)
        mesh.set_bsdf(bsdf)
        meshes[f"mesh{number}"] = mesh
    lit = mi.load_dict({"type": "scene", "sky": scene_dict()["sky"], **meshes})
    white = mi.load_dict({"type": "diffuse"})
    allocation = Allocation(lit, mi.load_dict({"type": "direct_stratified"}).prepare(lit), white)
    for number, row in enumerate((ROWS[4], ROWS[2])):
        shape = mi.ShapePtr(meshes[f"mesh{number}"])
        N, K, _, matte = allocation.of(shape, mi.BSDFPtr(bsdf), mi.UInt32(0), mi.Bool(True))
        assert (int(N[0]), int(K[0]), bool(matte[0])) == (min(row.light, 8), row.lobe, False)
        _, K, _, matte = allocation.of(shape, mi.BSDFPtr(white), mi.UInt32(0), mi.Bool(True))
        assert (int(K[0]), bool(matte[0])) == (0, True)


def test_what_is_not_known_counts_as_both_matte_and_glossy() -> None:
    from stratalux.integrators.automatic.lobes import ROWS, Allocation

    lit = scene({"type": "diffuse"})
    allocation = Allocation(lit, mi.load_dict({"type": "direct_stratified"}).prepare(lit))
    stranger = mi.load_dict({"type": "sphere"})
    N, K, M, matte = allocation.of(mi.ShapePtr(stranger), mi.BSDFPtr(stranger.bsdf()), mi.UInt32(0), mi.Bool(True))
    assert (int(N[0]), int(K[0]), int(M[0]), bool(matte[0])) == (ROWS[1].light, ROWS[1].lobe, 1, True)
    group = {"type": "shapegroup", "ball": {"type": "sphere"}}
    instance = {"type": "instance", "group": {"type": "ref", "id": "group"}}
    lit = mi.load_dict({**scene_dict("diffuse"), "group": group, "instance": instance})
    allocation = Allocation(lit, mi.load_dict({"type": "direct_stratified"}).prepare(lit))
    assert allocation.any_bsdf_samples and allocation.any_matte


@pytest.mark.parametrize("glossy", [False, True])
def test_shares_are_those_of_the_table(glossy: bool) -> None:
    """Light rays are fewer beside what is glossy; lobe rays, where there is detail and little to be found by them."""
    from stratalux.integrators.automatic.lobes import BESIDE_GLOSS, DETAILED_LIGHT, DETAILED_SPREAD, ROWS, Allocation

    allocation = Allocation.__new__(Allocation)
    allocation.any_glossy = glossy
    for row in ROWS:
        for detailed in (False, True):
            for spread in (math.nan, 0.0, 0.9 * DETAILED_SPREAD, 2.2 * DETAILED_SPREAD, 1.0):
                N, K = row.light, row.lobe
                if glossy:
                    N = min(N, DETAILED_LIGHT if detailed else BESIDE_GLOSS)
                if detailed and not row.matte and spread == spread:
                    K = min(K, {0.0: 1, 1.0: 12}.get(spread, 1 if spread < DETAILED_SPREAD else 2))
                share = allocation._share(row, spread, detailed)
                assert (share & 0xFF, share >> 8 & 0xFF, share >> 31) == (N, K, row.matte)
                assert share >> 16 & 0x7FFF in (1, 2, 4, 8)
    assert allocation._share(ROWS[4], 4 * ROWS[4].spread, False) >> 16 == 4
    assert allocation._share(ROWS[3], 8 * ROWS[3].spread, False) >> 16 == ROWS[3].most


def test_means_leave_out_what_is_no_number() -> None:
    from stratalux.integrators.automatic.lobes import _means

    values, group = mi.Float(1, 2, math.nan, 7, math.nan), mi.UInt32(0, 0, 0, 2, 1)
    np.testing.assert_array_equal(_means(values, group, 4).numpy(), [1.5, math.nan, 7, math.nan])


def test_tests_are_shared_out_among_shapes() -> None:
    from stratalux.integrators.automatic.lobes import _tests

    lit = scene({"type": "diffuse"}, {"type": "diffuse"}, {"type": "diffuse", "reflectance": 0.2})
    shape, tested, sampler = _tests(lit, 0)
    counts = np.bincount(shape.numpy())
    assert len(counts) == 3 and (counts == 16384 // 3).all() and sampler.wavefront_size() == counts.sum()
    assert dr.all(tested == dr.gather(mi.ShapePtr, lit.shapes_dr(), shape))


@pytest.mark.parametrize(("N", "K"), [(0, 1), (0, 4), (2, 4)])
def test_the_spread_of_what_is_even_is_known(N: int, K: int) -> None:
    """Under an even sky, BSDF samples of a lobe without losses bring K p / (N / 4π + K p) each."""
    from stratalux.integrators.automatic.lobes import DIM, _surface, draw, only, spread

    lit = scene({"type": "diffuse"})
    light = mi.load_dict({"type": "direct_stratified"}).prepare(lit)
    metal = mi.load_dict({**CONDUCTOR, "alpha": 0.3})
    bsdf = dr.gather(mi.BSDFPtr, mi.BSDFPtr(metal), dr.zeros(mi.UInt32, LANES))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, LANES)
    found = spread(light, bsdf, mi.Float(N), mi.Float(K), sampler).numpy()

    sampler.seed(3, LANES)  # the same once more, one by one
    si = _surface(sampler)
    brought = []
    for _ in range(8):
        bs, weight, drawn = draw(bsdf, only(mi.BSDFFlags.Glossy), si, sampler.next_1d(), sampler.next_2d())
        value = mi.luminance(weight) / (4 * np.pi) * K * bs.pdf / (N / (4 * np.pi) + K * bs.pdf)
        brought.append(np.where((drawn & dr.isfinite(bs.pdf)).numpy(), value.numpy(), 0))
    brought = np.array(brought, dtype=np.float64)
    expected = brought.var(axis=0, ddof=1) / (brought.mean(axis=0) ** 2 + (DIM / (4 * np.pi)) ** 2)
    np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-5)
    assert expected.mean() > 1e-3


def test_surfaces_face_all_sides_and_are_seen_from_their_front() -> None:
    from stratalux.integrators.automatic.lobes import _surface

    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, LANES)
    si = _surface(sampler)
    assert (si.wi.z.numpy() >= 0).all() and si.is_valid().numpy().all()
    np.testing.assert_allclose(dr.norm(si.wi).numpy(), 1, atol=1e-5)
    np.testing.assert_array_equal(si.n.numpy(), si.sh_frame.n.numpy())
    assert np.abs(si.n.numpy().mean(axis=1)).max() < 4 / np.sqrt(3 * LANES)
    assert 0 <= si.uv.numpy().min() < 0.01 and 0.99 < si.uv.numpy().max() <= 1
