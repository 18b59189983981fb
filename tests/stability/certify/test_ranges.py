"""What ranges that are resisted and ranges that slip say together."""

from __future__ import annotations

import pytest

from handfast.stability.certify.ranges import known

# --- ranges together ----------------------------------------------------------------------------------


def test_known_by_hand() -> None:
    said = known([(0, 1), (1, 2), (3.001, 4), (4.5, 5)], [(2.001, 3)], 5.0, 5.004, 1e-3, 1.0)
    assert said.to == 2
    assert said.upper == 2.001
    assert said.holes == ((2.001, 3),)
    assert said.unproved == ((4, 4.5),)


def test_a_wide_gap_beside_a_hole_is_unproved() -> None:
    said = known([(0, 1.9), (3.001, 5)], [(2.0, 3)], 5.0, 5.004, 1e-3, 1.0)
    assert said.unproved == ((1.9, 2.0),)


def test_a_narrow_gap_between_two_resisted_ranges_is_unproved() -> None:
    said = known([(0, 1), (1.0000001, 5)], [], 5.0, 5.004, 1e-3, 1.0)
    assert (said.to, said.upper, said.unproved) == (1, 5.004, ((1, 1.0000001),))


@pytest.mark.parametrize("slips", [(1.5, 1.6), (1.9, 2.5), (4.0, 6.0)])
def test_both_at_once_is_a_contradiction(slips: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="shown to be resisted, and to slip"):
        known([(0, 2)], [slips], 5.0, 5.004, 1e-3, 1.0)
