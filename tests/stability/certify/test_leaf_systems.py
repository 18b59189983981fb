"""Proofs at the edge of rounding: systems of one or two unknowns, whose margins and verdicts are derived by hand.

Every coefficient of a system is known up to `error` times its `size`. Here that is not 1e-14 but one in a thousand or
more, so that each part of the bound decides: a proof just within it passes, one just beyond it does not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast.stability.certify.certificate import Columns
from handfast.stability.certify.leaf_rows import UNIT
from handfast.stability.certify.leaf_systems import LeafSystems, SharedSystem, sizes
from tests.support.certificates import crossed, exact_equations
from tests.support.rounding_edges import QUESTIONS, hand, leaf

JUST = 1e-6  # relative: how far a planted case is from its edge
PAIR = {"B": [[1.0], [-1.0]], "w": [1.0, 1.0], "b": [1.0, 0.0]}


def margin(*of: Any, **more: Any) -> float:
    (out,) = leaf(*of, **more).margins()
    return float(out)


def pair(b: Any = (1.0, 0.0), **more: Any) -> float:
    """x >= b1, -x >= b2 (or =), each weighed by 1: no x where b1 + b2 > 0. P is (1/2, -1/2)."""
    return margin(PAIR["B"], PAIR["w"], b, **more)


def pair_change(error: float, size: float = 1.0) -> float:
    """By what a multiplier of the pair may have to change: rows miss by r = 2 e s, the inverse by e s."""
    return 0.5 * 2 * error * size / (1 - error * size)


# --- how far multipliers are from cancelling ----------------------------------------------------------------


@pytest.mark.parametrize("size", [1.0, 2.0, 30.0])
@pytest.mark.parametrize("error", [1e-2, 1e-3])
def test_the_margin_of_a_pair(error: float, size: float) -> None:
    """b1 less the most that its multiplier may change, and less the rounding of the sum."""
    found = pair(error=error, size=[[size], [size]])
    assert found == pytest.approx(1 - pair_change(error, size) - error, rel=1e-8)


@pytest.mark.parametrize("size", [1.0, 3.0])
def test_a_pair_at_the_edge(size: float) -> None:
    """x >= 1 and -x >= -beta: true rows may be 1 - e s and 1 + e s, so that beta may be no more than their quotient."""
    error = 1e-2
    change = pair_change(error, size) + error
    edge = (1 - change) / (1 + change)
    assert edge < (1 - error * size) / (1 + error * size)
    assert pair((1.0, -edge * (1 - JUST)), error=error, size=[[size], [size]]) > 0
    assert not pair((1.0, -edge * (1 + JUST)), error=error, size=[[size], [size]]) > 0


def test_rows_that_do_not_cancel_are_made_to() -> None:
    """Weights 1 and 1 - 4 d of opposite rows: both change by 2 d at most, and then there is nothing to prove."""
    d = 0.01
    found = margin(PAIR["B"], [1.0, 1 - 4 * d], [1.0, 0.0], error=0.0)
    assert found == pytest.approx(1 - 2 * d, rel=1e-8)
    for beta, holds in ((0.99, True), (1.01, False)):
        b = [1.0, -(1 - 2 * d) / (1 - 4 * d + 2 * d) * beta]
        assert (margin(PAIR["B"], [1.0, 1 - 4 * d], b, error=0.0) > 0) == holds


def test_an_inequality_gives_in_by_the_root_of_its_weight() -> None:
    """B = (1, -4), w = (4, 1): D^2 = (1, 1/4), so P = (1, -1)/5, r = 8 e, and both change by r / 5 (1 - e).

    The lighter weight may not become negative: not beyond e = 5/13, where an equation may go on.
    """
    B, w, b = [[1.0], [-4.0]], [4.0, 1.0], [1.0, 0.0]
    for error in (0.01, 0.3, 5 / 13 * (1 - JUST)):
        change = 8 * error / (5 * (1 - error))
        expected = (4 - change - 4 * error) / 4
        assert margin(B, w, b, error=error, free=[False, False]) == pytest.approx(expected, rel=1e-6)
    assert margin(B, w, b, error=5 / 13 * (1 + JUST), free=[False, False]) == -np.inf
    # sums are rounded up by 1e-9
    assert margin(B, w, b, error=5 / 13 * (1 - 1e-10), free=[False, False]) == -np.inf
    assert margin(B, w, b, error=5 / 13 * (1 - 2e-9), free=[False, False]) > 0
    # as equations: D = 1, P = (1, -4) / 17, and the inverse misses by e / 17 + 16 e / 17
    error = 5 / 13 * (1 + JUST)
    z = 8 * error / (1 - error)
    expected = (4 - z / 17 - 4 * error) / 4
    assert margin(B, w, b, error=error, free=[True, True]) == pytest.approx(expected, rel=1e-6)


def test_the_smallest_weights_may_change_by_little() -> None:
    """D of an inequality is 1e-4 at least: with B = (1, -4, 1), w = (1, 1/4, tiny), D^2 B = (1, -1, 1e-8), over 5.

    Where 1e-7 is missing the tiny weight changes by 2e-16, which it has to be at least.
    """
    for tiny, holds in ((1e-12, True), (2.1e-16, True), (1.9e-16, False)):
        found = margin([[1.0], [-4.0], [1.0]], [1.0 - 1e-7, 0.25, tiny], [1.0, 0, 0], error=0.0, free=[False] * 3)
        assert (found == pytest.approx(1.0, rel=1e-6)) == holds
        assert holds or found == -np.inf


@pytest.mark.parametrize(("error", "holds"), [(0.5 * (1 - JUST), True), (0.5 * (1 + JUST), False)])
def test_an_inverse_that_is_not_shown(error: float, holds: bool) -> None:
    """Two unknowns, one pair of rows each; the second pair cancels exactly and proves. The first is known to 2 e."""
    B = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
    size = [[1.0, 0.0], [1.0, 0.0], [0.0, 1e-9], [0.0, 1e-9]]
    found = margin(B, [1e-6, 1e-6, 1.0, 1.0], [0.0, 0.0, 1.0, 0.0], size=size, error=error)
    assert np.isfinite(found) == holds
    if holds:  # z of the second is its own miss and what its inverse lets in from the first: next to nothing
        assert found == pytest.approx(1 - error, rel=1e-6)


def test_rows_in_two_unknowns() -> None:
    """B = (1 0), (0 1), (-1 -1), w = (1, 1, 1): the inverse of B^T B is (2 -1; -1 2) / 3, P = (2 -1; -1 2; -1 -1) / 3.

    |B|^T |P| = (3 2; 2 3) / 3, so that the inverse misses by 5 e / 3 in each unknown, and the sum by r = 2 e. What has
    to be made up is z = r / (1 - 5 e / 3) at most; the multipliers change by |P| (z, z) = (z, z, 2 z / 3).
    """
    e = 0.01
    z = 2 * e / (1 - 5 * e / 3)
    for k, change in ((0, z), (1, z), (2, 2 * z / 3)):
        b = np.eye(3)[k]
        found = margin([[1, 0], [0, 1], [-1, -1]], [1.0] * 3, b, error=e)
        assert found == pytest.approx(1 - change - e, rel=1e-8)


def test_unknowns_that_no_row_has() -> None:
    """They need no inverse, and cost nothing."""
    B = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 7.0]]
    found = margin(B, [1.0, 1.0, 0.0], [1.0, 0.0, 5.0], error=0.01)
    assert found == pytest.approx(1 - pair_change(0.01) - 0.01, rel=1e-8)


def test_lost_ranks_prove_nothing_in_floating_point() -> None:
    """x + y >= 1 and -x - y >= 0 are a contradiction, but their columns are the same."""
    B = [[1.0, 1.0], [-1.0, -1.0]]
    assert margin(B, [1.0, 1.0], [1.0, 0.0], error=1e-14) == -np.inf


def test_an_inverse_that_overflows_hurts_no_other_leaf() -> None:
    two = [leaf(**PAIR), leaf([[1e200], [-1e200]], [1e-200] * 2, [1.0, 0.0])]
    for first, second in ((0, 1), (1, 0)):
        with np.errstate(all="ignore"):
            found = together(two[first], two[second]).margins()
        assert found[first] == pytest.approx(pair(), rel=1e-12)
        assert found[second] == -np.inf


def together(*leaves: LeafSystems) -> LeafSystems:
    """Leaves of equal shape as one batch."""
    names = ("B", "size", "w", "free", "b", "slack", "growth", "first", "unit", "index", "closed")
    return replace(leaves[0], **{n: np.concatenate([getattr(x, n) for x in leaves]) for n in names})


def test_leaves_do_not_mix() -> None:
    """A batch says of each leaf what it says of it alone; nothing to cancel is no fault, nothing to prove no proof."""
    three = [
        leaf([[1, 0], [0, 1], [-1, -1]], [1.0] * 3, [1.0, 0, 0], slack=[0.1, 0, 0]),
        leaf(
            [[2, 0], [-2, 0], [0, 1]],
            [1.0, 1.0, 0.0],
            [0.5, 0, 0],
            free=[False, True, True],
            first=[True] + [False] * 2,
        ),
        leaf([[0, 0], [0, 0], [0, 0]], [1.0, 2.0, 0.0], [1.0, -0.25, 0]),
        leaf([[0, 0], [0, 0], [0, 0]], [0.0, 0.0, 0.0], [1.0, 0.0, 0]),
    ]
    alone = [float(x.margins()[0]) for x in three]
    assert together(*three).margins().tolist() == pytest.approx(alone, rel=1e-12)
    assert alone[2] == pytest.approx(0.5 / 1.5 - 1e-3, rel=1e-9)
    assert not alone[3] > 0
    picked = together(*three).some(np.array([2, 0]))
    assert picked.margins().tolist() == pytest.approx([alone[2], alone[0]], rel=1e-12)


# --- what a witness may miss --------------------------------------------------------------------------------


def test_what_may_be_missed_is_taken_off() -> None:
    """Of each row, by as much as its multiplier may be: 1 + change."""
    e, change = 0.01, pair_change(0.01)
    found = pair(error=e, slack=[0.2, 0.05])
    assert found == pytest.approx(1 - change - e - 0.25 * (1 + change), rel=1e-8)
    edge = (1 - change - e) / (1 + change)
    assert pair(error=e, slack=[0.0, edge * (1 - JUST)]) > 0
    assert not pair(error=e, slack=[0.0, edge * (1 + JUST)]) > 0


@pytest.mark.parametrize(
    ("ends", "far"), [((2.0, 5.0), 5.0), ((-7.0, 5.0), 7.0), ((-3.0, -1.0), 3.0), ((4.0, 4.0), 4.0)]
)
def test_what_may_be_missed_grows_with_the_scalar(ends: tuple[float, float], far: float) -> None:
    """By `growth` for each unit, up to the end that is farther from 0, as nothing pushes at the first."""
    e, change = 0.01, pair_change(0.01)
    found = pair(error=e, growth=[0.01, 0.02], ends=ends)
    assert found == pytest.approx(1 - change - e - far * 0.03 * (1 + change), rel=1e-8)


@pytest.mark.parametrize("unit", [1.0, 4.0, 0.5])
def test_where_the_first_end_is_the_worst(unit: float) -> None:
    """Its multiplier (1 - change) / unit has to outgrow what may be missed: then that counts at the first end only."""
    e, change, ends = 0.01, pair_change(0.01), (0.5, 3.0)
    edge = (1 - change) / (1 + change) / unit
    for first, push in (([True, False], 1.0), ([False, True], 1.0), ([True, True], 2.0)):
        for growth, end in ((push * edge * (1 - JUST), 0.5), (push * edge * (1 + JUST), 3.0)):
            found = pair((10.0, 0.0), error=e, growth=[0.0, growth], first=first, ends=ends, unit=[unit] * 2)
            expected = (10 * (1 - change - e) - end * growth * (1 + change)) / 10
            assert found == pytest.approx(expected, rel=1e-7)


def test_a_range_without_end() -> None:
    """Nothing that grows may be missed, or the first end pushes more."""
    ends = (0.5, np.inf)
    assert pair(ends=ends) == pair()
    assert pair(ends=ends, growth=[0.0, 1e-9]) == -np.inf
    assert pair(ends=ends, growth=[0.0, 0.01], first=[True, False]) == pytest.approx(pair(slack=[0.0, 0.005]), rel=1e-8)


# --- which rows count -----------------------------------------------------------------------------------------


def test_which_multipliers_count() -> None:
    """Inequalities above 0; equalities of either sign, above 1e-13 of the largest multiplier."""
    w = [0.5, 0.0, -0.5, 1e-300, -2.0, 1.9e-13, 2.1e-13, -2.1e-13, 0.0]
    free = [False] * 4 + [True] * 5
    used = leaf(np.ones((9, 1)), w, np.zeros(9), free=free).used
    assert used.tolist() == [[True, False, False, True, True, False, True, True, False]]
    two = together(leaf(np.ones((2, 1)), [1.0, 1e-12], [0, 0]), leaf(np.ones((2, 1)), [1e20, 1e-12], [0, 0]))
    assert two.used.tolist() == [[True, True], [True, False]]


def test_rows_that_do_not_count_are_not_weighed() -> None:
    """A multiplier below 0 of an inequality is none, and neither its b nor its slack matter."""
    rows = [[1.0], [-1.0], [1.0]]
    for third in (0.0, -1e-3):
        found = margin(rows, [1.0, 1.0, third], [1.0, 0, 50.0], free=[True, True, False], slack=[0, 0, 9.0])
        assert found == pytest.approx(pair(), rel=1e-12)


def test_equalities_without_weight_are_tried_at_last() -> None:
    """x >= 1 and y = 0, of which x - y = 0 counts next to nothing in the file: with it, or not at all.

    An inequality without weight is not taken for that.
    """
    B = [[1.0, 1e-9], [-1.0, 0.0], [0.0, 1.0]]
    of = {"w": [1.0, 1.0, 0.0], "b": [1.0, 0.0, 0.0], "error": 1e-12}
    assert margin(B, **of, equalities=1) == pytest.approx(1.0, rel=1e-6)
    assert margin(B, **of, equalities=2) == pytest.approx(1.0, rel=1e-6)
    assert margin(B, **of, equalities=0) == -np.inf
    assert margin(B, **of, equalities=1, free=[True, True, False]) == -np.inf
    three = together(leaf(B, **of, equalities=1), leaf([[1.0, 0], [-1.0, 0], [0, 1.0]], **of, equalities=1))
    assert three.margins().tolist() == pytest.approx([1.0, 1.0], rel=1e-6)


def test_places_of_the_equalities() -> None:
    assert leaf(np.ones((4, 1)), [1.0] * 4, [0.0] * 4, equalities=2).index_of_all().tolist() == [[0, 1, -1, -1]]
    assert leaf(np.ones((2, 1)), [1.0] * 2, [0.0] * 2).index_of_all().tolist() == [[0, 1]]


# --- what all leaves share ------------------------------------------------------------------------------------


def test_sizes_of_the_grasp_map_and_the_jacobian() -> None:
    """Sums of absolute values of the products behind every entry, of unlike numbers; 0 where a joint moves nothing."""
    g = hand()
    found = sizes(g)
    G, J = found.G, found.J
    expected_G, expected_J = np.zeros((6, 9)), np.zeros((9, 3))
    for i, contact in enumerate(g.contacts):
        for k in range(3):
            axis = np.abs(contact.frame[:, k])
            expected_G[:3, 3 * i + k] = axis
            expected_G[3:, 3 * i + k] = plus(np.abs(contact.position), axis)
            for j, joint in enumerate(g.joints):
                if i in joint.moves:
                    far = np.abs(contact.position) + np.abs(joint.origin)
                    speed = np.abs(joint.axis) if joint.type == "prismatic" else plus(np.abs(joint.axis), far)
                    expected_J[3 * i + k, j] = axis @ speed
    np.testing.assert_allclose(G, expected_G, rtol=1e-14)
    np.testing.assert_allclose(J, expected_J, rtol=1e-14)
    assert (np.abs(g.G) <= G * (1 + 4 * UNIT)).all()
    assert (np.abs(g.J) <= J * (1 + 8 * UNIT)).all()


def plus(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A cross product with all signs +: of the permanents of two columns."""
    minors = [crossed(a.tolist(), (np.eye(3)[k] * b[k]).tolist()) for k in range(3)]
    return np.abs(np.array(minors)).sum(axis=0)


@pytest.mark.parametrize("name", ["check", "preload", "sum"])
def test_shared_equalities_are_right_to_their_sizes(name: str) -> None:
    """|rounded - exact| <= error size, unknowns scaled by powers of two to coefficients of 0.7 to 1.4."""
    question, _ = QUESTIONS[name]
    s, at = SharedSystem.of(question), Columns.of(question)
    assert s.error == 64 * UNIT
    assert (np.log2(s.scale) == np.round(np.log2(s.scale))).all()
    assert (s.scale[at.c] == 1).all()
    E, h, Z = exact_equations(question)
    assert s.h.tolist() == [float(x) for x in h]
    largest = np.zeros(at.n)
    for found, size, exact in ((s.E, s.E_size, E), (s.Z, s.Z_size, Z)):
        assert found.shape == size.shape == (len(exact), at.n)
        for r, entries in enumerate(exact):
            for k in range(at.n):
                value = float(entries.get(k, 0))
                largest[k] = max(largest[k], abs(value))
                value *= s.scale[k]
                assert abs(found[r, k] - value) <= s.error * size[r, k]
                assert abs(value) * (1 - 1e-12) <= size[r, k]
                assert (size[r, k] == 0) == (value == 0 and k not in entries) or value == 0
        assert size.max() < 4
    others = np.delete(np.arange(at.n), np.r_[at.c])
    scaled = (largest * s.scale)[others]
    assert ((scaled == 0) | ((scaled >= 0.7) & (scaled <= 1.42))).all()
    assert (s.scale[largest == 0] == 1).all()
