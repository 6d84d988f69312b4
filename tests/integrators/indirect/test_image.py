"""How many paths tell where more are needed."""

from __future__ import annotations


def test_a_pilot_is_a_power_of_two_of_a_good_part() -> None:
    from stratalux.integrators.indirect.image import pilot_paths  # of the active variant

    expected = {1: 1, 2: 1, 3: 2, 4: 2, 8: 4, 12: 8, 16: 8, 24: 16, 64: 32, 100: 64, 1024: 512}
    assert {spp: pilot_paths(spp, box=True) for spp in expected} == expected
    assert {spp: pilot_paths(spp, box=False) for spp in (1, 4, 8, 64)} == {1: 1, 4: 1, 8: 2, 64: 16}
