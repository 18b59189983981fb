"""What ranges that are resisted and ranges that slip say together."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.grasp import read_grasp
from handfast.proofs.question import CHECK, LARGEST_GOAL, Question
from handfast.proofs.ranges import MAX_ARC_DEGREE, Arc, known, least_scale, merged, read_arc, replayed
from handfast.proofs.states import State
from handfast.proofs.tolerance import MIN_FORCE_SCALE, TOO_SMALL
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
        (0, 1, 1, "has 1 controls; 2 to 13 are possible"),
        (0, 1, MAX_ARC_DEGREE + 2, "has 14 controls; 2 to 13 are possible"),
    ],
)
def test_what_is_no_arc(first: float, last: float, controls: int, why: str) -> None:
    with pytest.raises(BadFile, match=f"^arc: {why}"):
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


def test_one_given_torque_counts_where_nothing_is_commanded() -> None:
    """0.25 N m of one of two hinges at 0.5 m from its contact: 0.5 N, where no load may act."""
    contacts = [Contact([0, -0.5, 0], [1, 0, 0], 0.5), Contact([0, 0.5, 0], [-1, 0, 0], 0.5)]
    hinges = [GraspJoint(name, [0, 0, 1], [0, 0, 0], (k,), torque=k / 4) for k, name in enumerate("ab")]
    assert least_scale(data(Grasp(contacts, hinges)), np.zeros((2, 6))) == pytest.approx(0.5)


def test_a_torque_counts_over_the_size_alone() -> None:
    """8 N m about x on contacts that are 4 m from the middle."""
    g = data(Grasp([Contact([0, -4, 0], [1, 0, 0], 0.5), Contact([0, 4, 0], [-1, 0, 0], 0.5)], []))
    assert g.size == 4
    assert least_scale(g, np.array([[0.0, 0, 0, 8, 0, 0]] * 2)) == pytest.approx(2)


# --- what an arc shows: a contact at the origin carries what pushes along -x, and moves as far ---------------


def asked(base: float, along: float, goal: str = LARGEST_GOAL) -> Question:
    """Forces along -x: base, and what is multiplied by the magnitude."""
    grasp = data(Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], []))
    push = np.array([-1.0, 0, 0, 0, 0, 0])
    return Question(grasp, goal, False, base * push, along * push, 0.0, True, {}, np.inf, ())


def pressed(force: float) -> State:
    none = np.zeros(0)
    return State(np.array([-force, 0, 0, 0, 0, 0]), none, np.array([force, 0, 0]), none, none, none, np.zeros(1))


def test_an_arc_from_rest_without_a_load_has_multiples_of_its_last_state() -> None:
    assert replayed(asked(0, 2), Arc(0, 3, (pressed(0), pressed(6)))) == ("", 0)
    assert replayed(asked(0, -2), Arc(0, 3, (pressed(0), pressed(0))))[1] == pytest.approx(1)  # nothing pulls
    why, missed = replayed(asked(0, 2), Arc(0, 3, (pressed(0), pressed(6 + 3e-8))))  # 5e-9 of it
    assert why.startswith("states from 0 to 3: ")
    assert missed == pytest.approx(5e-9)


@pytest.mark.parametrize(
    "controls",
    [
        (pressed(0), pressed(9), pressed(6)),  # more than two
        (pressed(1), pressed(6)),  # not from rest
        (pressed(0), pressed(3), pressed(6)),
    ],
)
def test_nothing_is_shown_of_other_arcs_from_no_load(controls: tuple[State, ...]) -> None:
    assert replayed(asked(0, 2), Arc(0, 3, controls)) == ("there may be no load from 0 to 3", np.inf)


def test_an_arc_from_a_load_does_not_begin_at_rest() -> None:
    for q, first in ((asked(0, 1), 1.0), (asked(1, 1), 0.0), (asked(1, 1), 1.0)):
        last = pressed(-q.wrench[0] + 3)
        assert replayed(q, Arc(first, 3, (pressed(0), last)))[1] == pytest.approx(1)  # all of the first load


def test_what_is_missed_along_an_arc_is_relative_to_its_least_load() -> None:
    """From 1 + 1 N to 1 + 3 N."""
    q = asked(1, 1)
    assert replayed(q, Arc(1, 3, (pressed(2), pressed(4)))) == ("", 0)
    why, missed = replayed(q, Arc(1, 3, (pressed(2), pressed(4 + 8e-9))))
    assert why == "states from 1 to 3: (1), forces is missed by 4.0e-09 of load and commands, above 1e-09"
    assert missed == pytest.approx(4e-9)


def test_nothing_is_shown_where_the_load_passes_zero() -> None:
    q = asked(2, -1)
    assert replayed(q, Arc(0.5, 2, (pressed(1.5), pressed(0)))) == ("there may be no load from 0.5 to 2", np.inf)
    assert replayed(q, Arc(0.5, 1.5, (pressed(1.5), pressed(0.5)))) == ("", 0)


def test_the_smallest_scale_of_which_something_is_shown() -> None:
    least = MIN_FORCE_SCALE
    assert replayed(asked(0, least), Arc(0, 1, (pressed(0), pressed(least)))) == ("", 0)
    assert replayed(asked(0, least), Arc(0, 0.5, (pressed(0), pressed(least / 2)))) == (TOO_SMALL, np.inf)
    assert replayed(asked(least, least), Arc(0, 1, (pressed(least), pressed(2 * least)))) == ("", 0)
    below = replayed(asked(least / 2, least), Arc(0, 1, (pressed(least / 2), pressed(1.5 * least))))
    assert below == ("there may be no load from 0 to 1", np.inf)


def test_an_arc_is_of_a_question_about_magnitudes() -> None:
    assert replayed(asked(0, 1, CHECK), Arc(0, 1, (pressed(0), pressed(1))))[0].startswith("states from 0 to 1: ")


# --- arcs in files ---------------------------------------------------------------------------------------------

RIGHT = {"r": [-1, 0, 0, 0, 0, 0], "q": [], "c": [1, 0, 0], "f": [], "coupling": []}


def test_an_arc_in_a_file() -> None:
    read = read_arc(Fields({"first": 0, "last": 2, "controls": [RIGHT, RIGHT | {"c": [2, 0, 0]}]}, "arc"), asked(0, 1))
    assert (read.first, read.last) == (0, 2)
    np.testing.assert_array_equal(read.table("c"), [[1, 0, 0], [2, 0, 0]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"first": -1}, "a.arcs[3].first: is -1; 0 or more is needed"),
        ({"more": 1}, "a.arcs[3].more: is not a known field; leave it out"),
        ({"controls": [RIGHT, RIGHT | {"more": 1}]}, "a.arcs[3].controls[1].more: is not a known field; leave it out"),
        ({"controls": [RIGHT]}, "a.arcs[3]: has 1 controls; 2 to 13 are possible"),
        ({"last": 0}, "a.arcs[3]: goes from 0 to 0; a range of magnitudes is needed"),
    ],
)
def test_faults_of_an_arc_name_their_field(change: dict[str, Any], words: str) -> None:
    f = Fields({"first": 0, "last": 1, "controls": [RIGHT, RIGHT]} | change, "a.arcs[3]")
    with pytest.raises(BadFile, match=f"^{re.escape(words)}$"):
        read_arc(f, asked(0, 1))
