"""Trees whose splits cover every case, and trees that leave one out."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from handfast.proofs.cases import HALF_TURN, MAX_PATCH, STATES, BadCertificate, contains, leaf_cases, patch
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    CLOSED,
    FREE,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN_DIRECTIONS,
    UNDECIDED,
)
from handfast.proofs.question import Question
from tests.support.proof_states import contact, pinch, question

ROOT = (-1, 0, 0, 0, 0)
SPLIT = [(0, 0, OPEN, 0, 0), (0, 0, CLOSED, 0, 0)]
THIRD = TURN_DIRECTIONS // 3
SECTORS = [(SLIDE, 0, THIRD), (SLIDE, THIRD, 2 * THIRD), (SLIDE, 2 * THIRD, TURN_DIRECTIONS)]
JOINTS = [{"name": n, "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]} for n in ("a", "b")]


def walls(**more) -> Question:
    return pinch([0, 0, -1, 0, 0, 0], joints=JOINTS, preload={"a": 1.0}, **more)


def soft() -> Question:
    sides = [contact([0, 0, s], [0, 0, -s], torsion=0.01) for s in (1, -1)]
    return question(sides, [0, 0, 0, 0, 0, 1])


def cases(q: Question, *nodes):
    parent, part, *change = np.array([ROOT, *nodes]).T
    return leaf_cases(q, parent, part, np.column_stack(change))


def closed(*children, at=2, part=0):
    """Contact 0 is closed in node 2, which has these children."""
    return [*SPLIT, *((at, part, *child) for child in children)]


def sought(objective="max") -> Question:
    return walls(goal="torques", driven=["a"], objective=objective)


def test_commands_are_parted_at_the_largest_and_at_none():
    found = cases(sought(), (0, 2, HIGH, 0, 0), (0, 2, BELOW, 0, 0), (2, 2, LOW, 0, 0), (2, 2, MOVES, 0, 0))
    assert found[:, 2, 0].tolist() == [HIGH, LOW, MOVES]
    found = cases(sought(), (0, 2, LOW, 0, 0), (0, 2, ABOVE, 0, 0), (2, 2, HIGH, 0, 0), (2, 2, MOVES, 0, 0))
    assert found[:, 2, 0].tolist() == [LOW, HIGH, MOVES]


PARTED = [(0, 2, HIGH, 0, 0), (0, 2, BELOW, 0, 0)]
UNPARTED = {
    "of a check": (walls, PARTED, "actuator 0: needs LOCKED and MOVES"),
    "of the sum": (lambda: sought("sum"), PARTED, "actuator 0: needs LOCKED and MOVES"),
    "one side alone": (sought, PARTED[:1], "needs LOCKED and MOVES"),
    "what does not cover": (sought, [(0, 2, HIGH, 0, 0), (0, 2, LOW, 0, 0)], "needs LOCKED and MOVES"),
    "sides crossed": (sought, [(0, 2, HIGH, 0, 0), (0, 2, ABOVE, 0, 0)], "needs LOCKED and MOVES"),
    "high below": (sought, [*PARTED, (2, 2, HIGH, 0, 0), (2, 2, MOVES, 0, 0)], "actuator 0: needs LOW and MOVES"),
    "low above": (
        sought,
        [(0, 2, LOW, 0, 0), (0, 2, ABOVE, 0, 0), (2, 2, LOW, 0, 0), (2, 2, MOVES, 0, 0)],
        "actuator 0: needs HIGH and MOVES",
    ),
    "high once more": (sought, [*PARTED, (1, 2, LOW, 0, 0), (1, 2, MOVES, 0, 0)], "actuator 0: it is decided"),
}


@pytest.mark.parametrize("name", UNPARTED)
def test_commands_that_are_parted_with_a_gap(name):
    asked, nodes, why = UNPARTED[name]
    with pytest.raises(BadCertificate, match=why):
        cases(asked(), *nodes)


def test_root_alone_is_a_leaf():
    assert cases(walls()).tolist() == [[[0, 0, 0]] * 4]


@pytest.mark.parametrize("there", [0, 3, -1, 99])
def test_the_root_changes_nothing(there: int) -> None:
    """What stands there in place of a part and its case counts for nothing."""
    parent, part, *change = np.array([(-1, there, CLOSED, 1, 2), *SPLIT]).T
    found = leaf_cases(walls(), parent, part, np.column_stack(change))
    assert found[:, 0].tolist() == [[OPEN, 0, 0], [CLOSED, 0, 0]]
    assert not found[:, 1:].any()
    assert not leaf_cases(walls(), parent[:1], part[:1], np.column_stack(change)[:1]).any()


def test_cases_are_those_of_parents_with_one_part_changed():
    found = cases(walls(), *closed((STICK, 0, 0), *SECTORS), (1, 2, LOCKED, 0, 0), (1, 2, MOVES, 0, 0))
    assert found[:, 0].tolist() == [[STICK, 0, 0], *map(list, SECTORS), [OPEN, 0, 0], [OPEN, 0, 0]]
    assert found[:, 2, 0].tolist() == [0, 0, 0, 0, LOCKED, MOVES]
    assert not found[:, [1, 3]].any()


FINE = {
    "half turns of a closed contact": closed((CLOSED, 5, 5 + HALF_TURN), (CLOSED, 5 + HALF_TURN, 5 + TURN_DIRECTIONS)),
    "sectors in any order": closed((STICK, 0, 0), *SECTORS[::-1]),
    "stick within a sector": [
        *closed((CLOSED, 0, HALF_TURN), (CLOSED, HALF_TURN, TURN_DIRECTIONS)),
        (3, 0, STICK, 0, HALF_TURN), (3, 0, SLIDE, 0, 9), (3, 0, SLIDE, 9, HALF_TURN),
        (4, 0, STICK, 0, 0), (4, 0, SLIDE, HALF_TURN, HALF_TURN + 9), (4, 0, SLIDE, HALF_TURN + 9, TURN_DIRECTIONS),
    ],
    "a sector is halved": [*closed((STICK, 0, 0), *SECTORS), (4, 0, SLIDE, 0, 7), (4, 0, SLIDE, 7, THIRD)],
    "sectors of nearly half a turn": closed(
        (STICK, 0, 0), (SLIDE, 0, HALF_TURN - 1), (SLIDE, HALF_TURN - 1, TURN_DIRECTIONS - 9),
        (SLIDE, TURN_DIRECTIONS - 9, TURN_DIRECTIONS),
    ),
    "sectors that begin below zero": closed((STICK, 0, 0), *((SLIDE, a - 9, b - 9) for _, a, b in SECTORS)),
}  # fmt: skip


@pytest.mark.parametrize("name", FINE)
def test_splits_that_cover(name):
    cases(walls(), *FINE[name])


def test_sectors_of_an_open_contact_where_normals_are_uncertain():
    nodes = [*SPLIT, *((1, 0, OPEN, a, b) for _, a, b in SECTORS)]
    assert cases(walls(eta=0.1), *nodes).shape == (4, 4, 3)
    with pytest.raises(BadCertificate, match="node 1, split of contact 0: it is decided already"):
        cases(walls(), *nodes)
    halves = [(CLOSED, 0, HALF_TURN), (CLOSED, HALF_TURN, TURN_DIRECTIONS)]
    with pytest.raises(BadCertificate, match="node 1, split of contact 0: a child is no sector, or not of the right"):
        cases(walls(eta=0.1), *SPLIT, *((1, 0, *half) for half in halves))  # an open contact is not closed


def test_octants_and_halves_of_patches():
    nodes = closed((STICK, 0, 0), *((SLIDE, k, 0) for k in range(8, 16)))
    nodes += [(5, 0, SLIDE, 2 * 9, 0), (5, 0, SLIDE, 2 * 9 + 1, 0)]
    assert len(cases(soft(), *nodes)) == 11


BAD = {
    "parent of the root": ([(0, 0, 0, 0, 0)], "node 0 has parent 0"),
    "parent after the node": ([ROOT, (2, 0, OPEN, 0, 0), (0, 0, CLOSED, 0, 0)], "node 1 has parent 2"),
    "parent of itself": ([ROOT, (1, 0, OPEN, 0, 0), (0, 0, CLOSED, 0, 0)], "node 1 has parent 1"),
    "states that are none": ([ROOT, (0, 0, OPEN, 0, 0), (0, 0, -1, 0, 0)], "needs OPEN and CLOSED"),
    "states that would be another node's": (
        [ROOT, *SPLIT, *((1, 1, *to) for to in ((OPEN, 0, 0), (CLOSED + STATES + 1, 0, 0))),
         *((2, 1, *to) for to in ((OPEN, 0, 0), (CLOSED - STATES - 1, 0, 0)))],
        "node 1, split of contact 1: needs OPEN and CLOSED",
    ),
    "second root": ([ROOT, ROOT], "node 1 has parent -1"),
    "no such part": ([ROOT, (0, 4, LOCKED, 0, 0), (0, 4, MOVES, 0, 0)], "node 1 changes part 4; there are 4"),
    "negative part": ([ROOT, (0, -1, LOCKED, 0, 0)], "changes part -1"),
    "two parts": ([ROOT, SPLIT[0], (0, 1, CLOSED, 0, 0)], "node 0 is split in several parts at once"),
    "closed alone": ([ROOT, SPLIT[1]], "split of contact 0: needs OPEN and CLOSED"),
    "closed twice": ([ROOT, SPLIT[1], SPLIT[1]], "needs OPEN and CLOSED"),
    "three of two": ([ROOT, *SPLIT, SPLIT[1]], "needs OPEN and CLOSED"),
    "open in a sector": ([ROOT, (0, 0, OPEN, 1, 2), SPLIT[1]], "needs OPEN and CLOSED"),
    "an actuator that cannot move": ([ROOT, (0, 3, LOCKED, 0, 0), (0, 3, MOVES, 0, 0)], "actuator 1: it is decided"),
    "moves alone": ([ROOT, (0, 2, MOVES, 0, 0)], "actuator 0: needs LOCKED and MOVES"),
    "an actuator in a sector": ([ROOT, (0, 2, LOCKED, 1, 2), (0, 2, MOVES, 0, 0)], "needs LOCKED and MOVES"),
    "an actuator twice": (
        [ROOT, (0, 2, LOCKED, 0, 0), (0, 2, MOVES, 0, 0), (1, 2, LOCKED, 0, 0), (1, 2, MOVES, 0, 0)],
        "node 1, split of actuator 0: it is decided",
    ),
    "no stick": ([ROOT, *closed(*SECTORS)], "needs STICK and sectors"),
    "stick twice": ([ROOT, *closed((STICK, 0, 0), (STICK, 0, 0), *SECTORS)], "needs STICK and sectors"),
    "stick in part of it": ([ROOT, *closed((STICK, 0, 9), *SECTORS)], "needs STICK and sectors"),
    "stick alone": ([ROOT, *closed((STICK, 0, 0))], "needs sectors"),
    "a gap": ([ROOT, *closed((STICK, 0, 0), SECTORS[0], SECTORS[2])], "the sectors leave a gap, or overlap"),
    "an overlap": (
        [ROOT, *closed((STICK, 0, 0), SECTORS[0], (SLIDE, THIRD - 1, 2 * THIRD), SECTORS[2])],
        "the sectors leave a gap, or overlap",
    ),
    "no full turn": ([ROOT, *closed((STICK, 0, 0), *SECTORS[:2])], "are not those of the node, or a full turn"),
    "half a turn": (
        [ROOT, *closed((STICK, 0, 0), (SLIDE, 0, HALF_TURN), (SLIDE, HALF_TURN, TURN_DIRECTIONS))],
        "a child is no sector, or not of the right state",
    ),
    "more than half a turn": (
        [ROOT, *closed((CLOSED, 0, HALF_TURN + 1), (CLOSED, HALF_TURN + 1, TURN_DIRECTIONS))],
        "a child is no sector, or not of the right state",
    ),
    "a sector that is none": ([ROOT, *closed((STICK, 0, 0), *SECTORS, (SLIDE, 5, 5))], "a child is no sector"),
    "states are mixed": (
        [ROOT, *closed((STICK, 0, 0), *SECTORS[:2], (CLOSED, 2 * THIRD, TURN_DIRECTIONS))], "a child is no sector",
    ),
    "not all of the sector": (
        [ROOT, *closed((STICK, 0, 0), *SECTORS), (4, 0, SLIDE, 0, 7), (4, 0, SLIDE, 7, THIRD - 1)],
        "are not those of the node",
    ),
    "a gap in a sector that is halved": (
        [ROOT, *closed((STICK, 0, 0), *SECTORS), (4, 0, SLIDE, 0, 7), (4, 0, SLIDE, 8, THIRD)],
        "node 4, split of contact 0: the sectors leave a gap, or overlap",
    ),
    "beyond the sector": (
        [ROOT, *closed((STICK, 0, 0), *SECTORS), (4, 0, SLIDE, -1, 7), (4, 0, SLIDE, 7, THIRD)],
        "are not those of the node",
    ),
    "what sticks": ([ROOT, *closed((STICK, 0, 0), *SECTORS), *((3, 0, *x) for x in SECTORS)], "it is decided already"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_splits_that_leave_something_out(name):
    nodes, why = BAD[name]
    parent, part, *change = np.array(nodes).T
    with pytest.raises(BadCertificate, match=why):
        leaf_cases(walls(), parent, part, np.column_stack(change))


def test_without_the_dissipation_principle_contacts_are_open_or_closed_only():
    cases(walls(mdp=False), *SPLIT)
    with pytest.raises(BadCertificate, match="it is decided already"):
        cases(walls(mdp=False), *closed((STICK, 0, 0), *SECTORS))


SOFT = [(STICK, 0, 0), *((SLIDE, k, 0) for k in range(8, 16))]
BAD_PATCHES = {
    "an octant is missing": (closed(*SOFT[:-1]), "needs STICK and the patches 8 to 15"),
    "an octant twice": (closed(*SOFT[:-1], SOFT[-2]), "needs STICK and the patches 8 to 15"),
    "no stick": (closed(*SOFT[1:]), "needs STICK and the patches"),
    "stick in a sector": (closed((STICK, 0, 9), *SOFT[1:]), "needs STICK and the patches"),
    "sectors of a soft finger": (closed((STICK, 0, 0), *SECTORS), "needs STICK and the patches"),
    "another's half": ([*closed(*SOFT), (5, 0, SLIDE, 18, 0), (5, 0, SLIDE, 21, 0)], "needs the two halves"),
    "one half": ([*closed(*SOFT), (5, 0, SLIDE, 18, 0)], "needs the two halves"),
    "a half twice": ([*closed(*SOFT), (5, 0, SLIDE, 18, 0), (5, 0, SLIDE, 18, 0)], "needs the two halves"),
    "with a right end": ([*closed(*SOFT), (5, 0, SLIDE, 18, 0), (5, 0, SLIDE, 19, 1)], "needs the two halves"),
}


@pytest.mark.parametrize("name", BAD_PATCHES)
def test_patches_that_leave_something_out(name):
    nodes, why = BAD_PATCHES[name]
    with pytest.raises(BadCertificate, match=why):
        cases(soft(), *nodes)


def test_an_open_soft_finger_has_no_patch_to_halve() -> None:
    """No file asks for soft fingers and uncertain normals, where it is not decided; 0 and 1 are halves of no patch."""
    with pytest.raises(BadCertificate, match="node 1, split of contact 0: needs the two halves"):
        cases(replace(soft(), eta=0.1), *SPLIT, (1, 0, SLIDE, 0, 0), (1, 0, SLIDE, 1, 0))


@pytest.mark.parametrize("upper", [0, 1])
def test_patches_end_where_their_numbers_do(upper):
    """Of the first octant the lower halves, of the last one the upper halves, down to the largest number of all."""
    nodes, number = closed(*SOFT), 8 + 7 * upper
    node = 4 + 7 * upper
    while 2 * number + 1 < 2**31:
        nodes += [(node, 0, SLIDE, 2 * number, 0), (node, 0, SLIDE, 2 * number + 1, 0)]
        node, number = len(nodes) - 1 + upper, 2 * number + upper
    cases(soft(), *nodes)
    assert number == (MAX_PATCH if upper else 2**30)
    nodes += [(node, 0, SLIDE, 2 * number, 0), (node, 0, SLIDE, 2 * number + 1, 0)]
    with pytest.raises(BadCertificate, match="needs the two halves"):
        cases(soft(), *nodes)


@pytest.mark.parametrize("number", [8, 15, 16, 17, 31, 37, 200, MAX_PATCH])
def test_patches_lie_between_unit_planes(number: int) -> None:
    """Each corner is on two of them and inside the third; the middle is as far from all corners."""
    found = patch(number)
    for vectors in (found.planes, found.corners, found.middle[None]):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, rtol=1e-14)
    np.testing.assert_allclose(found.corners @ found.middle, found.reach, rtol=1e-7)
    assert (np.abs(found.planes @ found.corners.T) < 1e-14).sum() >= 6
    assert (found.planes @ found.corners.T > -1e-14).all()
    assert 0 < found.reach <= (found.corners @ found.middle).min()


@pytest.mark.parametrize("number", range(8, 16))
def test_octants_have_the_signs_of_their_bits(number: int) -> None:
    signs = [-1.0 if bit == "1" else 1.0 for bit in f"{number:b}"[:0:-1]]
    found = patch(number)
    np.testing.assert_allclose(found.middle, np.array(signs) / 3**0.5, rtol=1e-14)
    np.testing.assert_array_equal(found.planes.sum(axis=0), signs)


@pytest.mark.parametrize("number", [8, 11, 14, 15, 16, 17, 37, 54, 200, 1001])
def test_directions_of_a_patch_are_in_the_half_of_the_corner_that_they_are_nearer_to(number: int) -> None:
    """Sums of its corners: the plane parts those with more of the second from those with more of the third."""
    shares = np.array([x for x in product((-0.5, 0.1, 3.0), repeat=3) if x[1] != x[2]])
    there, (_, second, third) = (shares > 0).all(axis=1), shares.T
    for half, nearer in ((2 * number, second > third), (2 * number + 1, second < third)):
        inside = (shares @ patch(number).corners @ patch(half).planes.T > 0).all(axis=1)
        assert inside.tolist() == (there & nearer).tolist()


@pytest.mark.parametrize("number", [0, 7, MAX_PATCH + 1])
def test_numbers_that_are_no_patch(number: int) -> None:
    with pytest.raises(ValueError, match=f"^{number} is no patch$"):
        patch(number)


def test_which_patch_is_part_of_which():
    pairs = {
        (8, 8): True,
        (8, 17): True,
        (8, 18): False,
        (16, 8): False,
        (15, MAX_PATCH): True,
        (MAX_PATCH, MAX_PATCH): True,
    }
    pairs |= {(7, 7): False, (7, 14): False, (8, MAX_PATCH + 1): False, (MAX_PATCH + 1, MAX_PATCH + 1): False}
    outer, inner = np.array(list(pairs)).T
    assert contains(outer, inner).tolist() == list(pairs.values())


def test_deep_trees_in_any_order():
    """A chain of 400 halvings, whose leaves are the 400 lower halves and the last upper one."""
    nodes, node, left = closed((STICK, 0, 0), *SECTORS), 4, 0
    for _ in range(400):
        nodes += [(node, 0, SLIDE, left, left + 1), (node, 0, SLIDE, left + 1, THIRD)]
        node, left = len(nodes), left + 1
    found = cases(walls(), *nodes)
    assert len(found) == 1 + 3 + 401
    assert found[-1, 0].tolist() == [SLIDE, 400, THIRD]
    assert FREE == UNDECIDED == 0
