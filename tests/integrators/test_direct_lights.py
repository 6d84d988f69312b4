"""Rigs on the device: directions, colours, and texels at random."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap
from stratalux.maps.geometry import direction
from stratalux.rigs import light_rig
from tests.helpers import hall_map


@pytest.mark.parametrize("method", ["median-cut", "kmeans"])
def test_tables_hold_the_rig(method: str) -> None:
    from stratalux.integrators.direct_lights import RigTables  # of the active variant

    rig = light_rig(method, EnvironmentMap(hall_map()), 12)
    tables = RigTables(rig)
    i = dr.arange(mi.UInt32, tables.count)
    np.testing.assert_allclose(tables.direction(i, mi.Bool(True)).numpy().T, rig.direction, rtol=1e-6)
    np.testing.assert_allclose(tables.colour(i, mi.Bool(True)).numpy().T, rig.colour, rtol=1e-6)


def test_jitter_takes_each_texel_of_a_stratum_alike() -> None:
    from stratalux.integrators.direct_lights import RigTables

    rig = light_rig("kmeans", EnvironmentMap(hall_map()), 12)
    height, width = rig.shape
    order, offset = rig.texels_by_light()
    tables = RigTables(rig)
    for light in range(tables.count):
        texels = np.sort(order[offset[light] : offset[light + 1]])
        u = (np.arange(4 * len(texels)) + 0.5) / (4 * len(texels))
        d = tables.jittered(mi.UInt32(light), mi.Float(u.astype(np.float32)), mi.Bool(True)).numpy().T
        expected = direction((texels % width + 0.5) / width, texels // width / (height - 1))
        keys = np.round(expected, 4) + 0.0
        found = np.round(d, 4) + 0.0
        # Each of them four times, in whatever order
        places = {tuple(key) for key in keys.tolist()}
        distance = np.abs(d[:, None] - expected[None]).max(axis=2)
        assert distance.min(axis=1).max() < 1e-5 and len(found) == 4 * len(keys)
        if len(places) == len(keys):
            assert (np.bincount(distance.argmin(axis=1), minlength=len(keys)) == 4).all()
    last = tables.jittered(mi.UInt32(0), mi.Float(1.0), mi.Bool(True)).numpy()  # which no sampler gives, but rounding
    texel = order[offset[1] - 1]
    np.testing.assert_allclose(
        last.ravel(),
        direction(np.array((texel % width + 0.5) / width), np.array(texel // width / (height - 1))),
        atol=1e-5,
    )


def test_each_says_its_source() -> None:
    """Authors and year, in one line."""
    from stratalux.integrators.techniques import techniques

    known = {
        "median-cut": "(Debevec 2005)",
        "structured": "(Agarwal, Ramamoorthi, Belongie and Jensen 2003)",
        "kmeans": "(Cohen and Debevec 2001)",
        "lloyd": "(Kollig and Keller 2003)",
        "penrose": "(Ostromoukhov, Donohue and Jodoin 2004)",
    }
    for name, source in known.items():
        assert techniques()[name].source.endswith(f" {source}") and "\n" not in techniques()[name].source
