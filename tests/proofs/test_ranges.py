"""What ranges that are resisted and ranges that slip say together."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.fields import BadFile
from handfast.proofs.grasp import read_grasp
from handfast.proofs.ranges import MAX_ARC_DEGREE, Arc, known, least_scale, merged
from tests.support.exact_states import data
from tests.support.small_grasp import small_grasp

INF = float("inf")
Ranges = list[tuple[float, float]]


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


def test_a_narrow_gap_between_two_ranges_that_slip_is_unproved() -> None:
    said = known([(0, 1), (4, 5)], [(1, 2), (2.0001, 4)], 5.0, 5.004, 1e-3, 1.0)
    assert (said.upper, said.holes, said.unproved) == (1, ((1, 2), (2.0001, 4)), ((2, 2.0001),))


def test_all_is_resisted() -> None:
    said = known([(0, 5)], [], 5.0, 5.004, 1e-3, 1.0)
    assert (said.to, said.upper, said.holes, said.unproved) == (5, 5.004, (), ())


def test_nothing_is_known() -> None:
    said = known([], [], 5.0, INF, 1e-3, 1.0)
    assert (said.to, said.upper, said.holes, said.unproved) == (0, INF, (), ((0, 5),))


def test_nothing_is_sought_where_the_largest_is_zero() -> None:
    said = known([], [], 0.0, 0.1, 1e-3, 1.0)
    assert (said.to, said.upper, said.unproved) == (0, 0.1, ())


def test_what_does_not_begin_at_zero_is_not_known_from_there() -> None:
    said = known([(0.5, 5)], [], 5.0, 5.004, 1e-3, 1.0)
    assert (said.to, said.unproved) == (0, ((0, 0.5),))
    assert known([(-1, 5)], [], 5.0, 5.004, 1e-3, 1.0).to == 5


def test_a_range_beyond_the_largest_counts_up_to_it() -> None:
    said = known([(0, 7)], [], 5.0, 5.004, 1e-3, 1.0)
    assert (said.to, said.unproved) == (5, ())


def test_a_range_that_slips_above_the_largest_is_no_hole() -> None:
    said = known([(0, 5)], [(5, 6), (7, 8)], 5.0, 5.004, 1e-3, 1.0)
    assert (said.upper, said.holes, said.unproved) == (5.004, (), ())
    below = known([(0, 4)], [(4, 5)], 5.0, 5.004, 1e-3, 1.0)  # ends at the largest
    assert (below.upper, below.holes, below.unproved) == (4, ((4, 5),), ())


@pytest.mark.parametrize(
    ("end", "unproved"),
    [
        # beside a hole from 2.0 on: 1e-3 of 2, so from 1.998 on
        (1.9981, ()),
        (1.9979, ((1.9979, 2.0),)),
    ],
)
def test_a_gap_beside_a_hole_may_be_as_wide_as_the_resolution_of_its_end(end: float, unproved: Ranges) -> None:
    assert known([(0, end), (3, 5)], [(2.0, 3)], 5.0, 5.004, 1e-3, 1.0).unproved == unproved


@pytest.mark.parametrize(
    ("unit", "end", "unproved"),
    [
        # the hole begins at 0.1, below the unit of 1: 1e-3 of the unit
        (1.0, 0.0991, ()),
        (1.0, 0.0989, ((0.0989, 0.1),)),
        # and of the largest, 5, where the unit is beyond it
        (70.0, 0.0951, ()),
        (70.0, 0.0949, ((0.0949, 0.1),)),
        # and of the hole's own place, where the unit is less
        (0.01, 0.09991, ()),
        (0.01, 0.09989, ((0.09989, 0.1),)),
    ],
)
def test_small_magnitudes_have_the_resolution_of_the_unit(unit: float, end: float, unproved: Ranges) -> None:
    assert known([(0, end), (3, 5)], [(0.1, 3)], 5.0, 5.004, 1e-3, unit).unproved == unproved


def test_what_slips_from_zero_on() -> None:
    said = known([(3, 5)], [(0, 3)], 5.0, 5.004, 1e-3, 1.0)
    assert (said.to, said.upper, said.holes, said.unproved) == (0, 0, ((0, 3),), ())
    # zero itself counts as resisted: between it and a hole a narrow gap is no lack
    assert known([(3, 5)], [(0.0009, 3)], 5.0, 5.004, 1e-3, 1.0).unproved == ()
    assert known([(3, 5)], [(0.0011, 3)], 5.0, 5.004, 1e-3, 1.0).unproved == ((0, 0.0011),)


def test_gaps_nearer_to_each_other_than_the_resolution_are_one() -> None:
    # (1, 2) and (2.001, 3): 1e-3 apart, less than 1e-3 of 3
    assert known([(0, 1), (2, 2.001), (3, 5)], [], 5.0, 5.004, 1e-3, 1.0).unproved == ((1, 3),)
    # 3.1e-3 apart: more
    said = known([(0, 1), (2, 2.0031), (3, 5)], [], 5.0, 5.004, 1e-3, 1.0)
    assert said.unproved == ((1, 2), (2.0031, 3))
    # a chain of three
    assert known([(0, 1), (2, 2.001), (3, 3.001), (4, 5)], [], 5.0, 5.004, 1e-3, 1.0).unproved == ((1, 4),)


def test_of_several_gaps_the_last_one_grows() -> None:
    resisted: Ranges = [(0, 0.5), (1, 1.2), (1.5, 2), (3, 3.001), (4, 5)]
    said = known(resisted, [(1.2, 1.5)], 5.0, 5.004, 1e-3, 1.0)
    assert said.unproved == ((0.5, 1), (2, 4))


def test_exactly_the_resolution() -> None:
    """2^-10 of 4 is 2^-8: as wide as that a gap beside a hole is none, and two gaps so far apart are two."""
    fine = 2.0**-8
    assert known([(0, 4 - fine), (4.5, 5)], [(4, 4.5)], 5.0, 5.004, 2.0**-10, 1.0).unproved == ()
    said = known([(0, 1), (2, 2 + fine), (4, 5)], [], 5.0, 5.004, 2.0**-10, 1.0)
    assert said.unproved == ((1, 2), (2 + fine, 4))


def test_the_largest_is_resisted_itself() -> None:
    assert known([(0, 4.999)], [], 5.0, 5.004, 1e-3, 1.0).unproved == ((4.999, 5),)
    assert known([(0, 4)], [(4, 4.999)], 5.0, 5.004, 1e-3, 1.0).unproved == ()
    assert known([(0, 4)], [(4, 4.99)], 5.0, 5.004, 1e-3, 1.0).unproved == ((4.99, 5),)


def test_gaps_on_both_sides_of_a_hole_stay_two() -> None:
    said = known([(0, 1), (3, 5)], [(2, 2.001)], 5.0, 5.004, 1e-3, 1.0)
    assert said.unproved == ((1, 2), (2.001, 3))
    # a hole before both of them does not part them, nor one behind
    said = known([(0, 0.5), (1.5, 2), (3, 3.001), (4, 4.2), (4.4, 5)], [(0.5, 1.5), (4.2, 4.4)], 5.0, 5.004, 1e-3, 1.0)
    assert said.unproved == ((2, 4),)


@pytest.mark.parametrize(
    ("slips", "at"),
    # from where on both are said: the beginning of the later of the two ranges
    [((1.5, 1.6), 1.5), ((1.9, 2.5), 1.9), ((-1, 0.5), 0)],
)
def test_both_at_once_is_a_contradiction(slips: tuple[float, float], at: float) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(f'{at:g} is shown to be resisted, and to slip')}$"):
        known([(0, 2)], [slips], 5.0, 5.004, 1e-3, 1.0)


@pytest.mark.parametrize("slips", [(4.0, 6.0), (4.999, 5.001)])
def test_the_largest_is_resisted(slips: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"^5 is shown to be resisted, and to slip$"):
        known([(0, 2)], [slips], 5.0, 5.004, 1e-3, 1.0)


def test_ranges_that_touch_are_no_contradiction() -> None:
    assert known([(0, 2), (3, 5)], [(2, 3)], 5.0, 5.004, 1e-3, 1.0).unproved == ()


def test_merged_ranges() -> None:
    assert merged([]) == ()
    assert merged([(3, 4), (0, 1), (1, 2)]) == ((0, 2), (3, 4))
    assert merged([(0, 5), (1, 2)]) == ((0, 5),)
    assert merged([(0, 2), (1, 3), (3.5, 4)]) == ((0, 3), (3.5, 4))
    assert merged([(0, 1), (2, 3), (2.5, 4)]) == ((0, 1), (2, 4))
    assert merged([(0, 1), (2, 5), (3, 4)]) == ((0, 1), (2, 5))
    assert merged([(0, 1), (1.0000001, 2)]) == ((0, 1), (1.0000001, 2))


# --- arcs ---------------------------------------------------------------------


def arc(first: float, last: float, controls: int) -> Arc:
    state: Any = None
    return Arc(first, last, (state,) * controls)


@pytest.mark.parametrize(
    ("first", "last", "controls", "why"),
    [
        (1, 1, 2, "goes from 1 to 1"),
        (2, 1, 2, "goes from 2 to 1"),
        (-0.5, 1, 2, "goes from -0.5 to 1"),
        (0, INF, 2, "goes from 0 to inf"),
        (0, 1, 1, "has 1 controls"),
        (0, 1, MAX_ARC_DEGREE + 2, "has 14 controls"),
    ],
)
def test_what_is_no_arc(first: float, last: float, controls: int, why: str) -> None:
    with pytest.raises(BadFile, match=why):
        arc(first, last, controls)
    assert len(arc(0, 0.5, 2).controls) == 2
    assert len(arc(0.5, 1, MAX_ARC_DEGREE + 1).controls) == 13


def test_the_least_scale_between_two_loads_by_hand() -> None:
    """Of forces and torques in one direction the smaller end; beside commands of 0.3 N m at 0.02 m, 15 N."""
    hinge = GraspJoint("hinge", [0, 0, 1], [0.1, 0, 0], (1,))
    contacts = [Contact([-0.02, 0, 0], [1, 0, 0], 0.5), Contact([0.02, 0, 0], [-1, 0, 0], 0.5)]
    loads = np.array([[3.0, 0, 4, 0, 0, 0], [6, 0, 8, 0, 0, 0]])
    free, squeezed = data(Grasp(contacts, [hinge])), data(Grasp(contacts, [hinge], preload={"hinge": 0.3}))
    assert least_scale(free, loads) == pytest.approx(5)
    assert least_scale(free, loads * [[1], [-1]]) == 0  # nothing acts in between
    assert least_scale(squeezed, loads) == pytest.approx(15)
    assert least_scale(squeezed, 4 * loads) == pytest.approx(20)
    # a force through the contacts' middle (1/4, -1/8, 1/8) has no torque there; 10 and 20 N over the size besides
    g = read_grasp(small_grasp() | {"preload": {}}, "g")
    g = g.with_command(np.zeros(g.a))
    turned = np.array([[0, 3, 4, -0.875, -1, 0.75 + 100 * g.size], [0, 3, 4, -0.875, -1, 0.75 + 200 * g.size]])
    assert least_scale(g, turned) == pytest.approx(100)
