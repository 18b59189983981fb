"""Square systems: inverses where there are some, pivots, values in their places."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import fmpq_mat

from handfast import Settings, load_grasp, maximum
from handfast.proofs import leaves
from handfast.proofs.cases import HALF_TURN
from handfast.proofs.certificate import Certificate
from handfast.proofs.checker import checked_rows, verify
from handfast.proofs.equations import ENTRY_ROUNDING, RightSide, equations_of
from handfast.proofs.fields import Array, Integers, Mask
from handfast.proofs.grasp import StartData
from handfast.proofs.kinds import CLOSED, LOCKED, OPEN, Row
from handfast.proofs.leaves import (
    CitedRows,
    Late,
    LeafSystems,
    Square,
    _compact,
    _groups,
    _inverse,
    _pivots,
    _turns,
    exact_margin,
    in_time,
)
from handfast.proofs.question import CHECK, LARGEST_GOAL, read_question
from handfast.proofs.rows import LeafRows, row_values, zeros
from handfast.proofs.tolerance import UNIT_ROUNDOFF
from tests.support.proof_states import contact, pinch, question, unit


def test_singular_matrices_do_not_keep_others_from_their_inverse():
    B = np.array([[[2.0, 0], [0, 4]], [[1, 1], [1, 1]], [[0, 1], [1, 0]], [[0, 0], [0, 0]]])
    wanted = [[[0.5, 0], [0, 0.25]], [[0, 0], [0, 0]], [[0, 1], [1, 0]], [[0, 0], [0, 0]]]
    assert _inverse(B).tolist() == wanted
    assert _inverse(B[:0]).shape == (0, 2, 2)


def test_pivots_are_independent_rows_in_their_order_and_their_columns():
    B = np.array([[[0, 2.0, 0], [0, 1, 0], [3, 1, 0]], [[1e-7, 0, 0], [0, 0, 0], [0, 1, 1]]])
    rows, columns = _pivots(B, 1e-6)
    assert rows.tolist() == [[True, False, True], [False, False, True]]
    assert columns.tolist() == [[True, True, False], [False, True, False]]
    rows, columns = _pivots(B, 1e-8)
    assert rows[1].tolist() == [True, False, True]
    assert columns[1].tolist() == [True, True, False]


def test_rows_that_depend_on_others_leave_no_pivot_but_for_rounding() -> None:
    """Half of a row; and 10^12 in a column that was eliminated with a pivot of 49: 49 times 1 / 49 is not quite 1."""
    rows, columns = _pivots(np.array([[[2.0, 4.0], [1.0, 2.0]], [[49.0, 0.0], [1e12, 0.0]]]), 1e-6)
    assert rows.tolist() == [[True, False]] * 2
    assert columns.tolist() == [[False, True], [True, False]]


@pytest.mark.parametrize("values", [np.array([5, 6, 7]), np.array([[5, 6, 7], [5, 6, 7], [5, 6, 7]])])
def test_values_that_are_there_in_their_order(values):
    there = np.array([[True, False, True], [False, False, False], [True, True, True]])
    assert _compact(there, values, 3, 9).tolist() == [[5, 7, 9], [9, 9, 9], [5, 6, 7]]
    assert _compact(there, values, 2, 9).tolist() == [[5, 7], [9, 9], [5, 6]]


def test_by_how_many_turns_contacts_stay_where_they_are() -> None:
    """Contacts at -x, +x, once more at -x and +x: about a point 3, about the line of two 1, else none.

    Two at one place are taken for as many as know no turn.
    """
    g = question([contact([x, 0, 0], [0, 0, 1]) for x in (-0.01, 0.01, -0.01, 0.01)], [0, 0, 1, 0, 0, 0]).grasp
    about = [[0], [2], [0, 1], [1, 2], [0, 3], [2, 3], [0, 2], [1, 3], [0, 1, 2], [0, 1, 2, 3], []]
    assert _turns(g, np.array([mask(4, *some) for some in about])).tolist() == [3, 3, 1, 1, 1, 1, 0, 0, 0, 0, 0]


def test_multipliers_that_are_taken_for_0_count_for_nothing() -> None:
    """The row f >= f_c has a positive right side; what it touches does not cancel, so it must not add to the sum.

    Its multiplier is 1e-20 of those of rows that cancel each other, or touch only forces of an open contact.
    """
    joints = [
        {"name": n, "type": "prismatic", "axis": [s, 0, 0], "origin": [-s, 0, 0], "moves": [i]}
        for i, (n, s) in enumerate((("left", 1), ("right", -1)))
    ]
    q = pinch([0, 0, -0.1, 0, 0, 0], joints=joints, preload={"left": 1.0, "right": 1.0})
    command = (Row.E_UP, 1e-20)
    rows = [(Row.CN_UP, 1.0), (Row.CN_DOWN, 1.0), command, (Row.GAP_UP, 1.0), (Row.GAP_DOWN, 1.0), command]
    kind, y = np.array([int(k) for k, _ in rows]), np.array([y for _, y in rows])
    zero, tree = np.zeros(len(rows), np.int64), np.zeros(3, np.int64)
    nodes = (np.array([-1, 0, 0]), tree, np.array([0, OPEN, CLOSED]), tree, tree)
    forged = Certificate(q, None, *nodes, np.array([0, 3, 6]), kind, zero, zero, zero, y)
    assert not verify(forged).ok
    assert "is not proved" in verify(forged).reason


def rank(found: LeafSystems, leaf: int, block: Mask) -> int:
    """Exactly, of the rows that a leaf uses in some unknowns, beside efforts that are put in."""
    own = np.arange(found.rows.start[leaf], found.rows.start[leaf + 1])
    own = found.which[own[found.used[own]]]
    solved, at = found.equations.solved
    columns, equalities = found.alive[leaf] & block, found.used_E[leaf].copy()
    if block[at].all():
        columns[at], equalities[solved] = True, True
    rows = found.equations.exact_rows(found.rows.value[own], np.flatnonzero(equalities), np.flatnonzero(columns))
    return (fmpq_mat(rows).rref()[1] if rows and rows[0] else 0) - block[at].all() * len(solved)


def systems(seed: int, family: str = "any", either: bool = False) -> LeafSystems:
    """Leaves with any rows about one to three of four contacts, in which the others are open, or not.

    family: "planar" is in the plane of x and y, with rows about d_n and c_n alone; two fingers of "soft" are so; motors
    of "geared" turn half as fast as their joints, so that their efforts are unknowns that only (2) of a joint touches.
    "fingers" have four joints with parallel axes before contact 0, and three before contact 1, two of these parallel.
    "geared fingers" are both.
    either: may multipliers have any sign?
    """
    planar = family == "planar"
    rng, flat = np.random.default_rng(seed), np.array([1.0, 1.0, 1.0 - planar])
    normals = [unit(rng) * flat for _ in range(4)]
    contacts = [contact(rng.normal(size=3) * flat, n / np.linalg.norm(n)) for n in normals]
    for soft in contacts[: 2 * (family == "soft")]:
        soft["torsion"] = 0.1
    joints = [
        {"name": f"j{j}", "axis": unit(rng).tolist(), "origin": rng.normal(size=3).tolist(), "moves": [j]}
        for j in range(3)
    ]
    if "fingers" in family:
        axes = [joints[k]["axis"] for k in (0, 0, 0, 0, 1, 1, 2)]
        joints = [
            {"name": f"j{j}", "axis": axis, "origin": rng.normal(size=3).tolist(), "moves": [int(j > 3)]}
            for j, axis in enumerate(axes)
        ]
    actuators = [{"name": j["name"], "joints": {j["name"]: 0.5}} for j in joints]
    of_hand = {"joints": joints} | ({"mechanism": {"actuators": actuators}} if "geared" in family else {})
    preload = dict.fromkeys(["j0", "j1", "j2", "j3"] if "fingers" in family else ["j0"], 1.0)  # others stay
    q = question(contacts, [0, 0, 1, 0, 0, 0], LARGEST_GOAL, **of_hand, direction=[1, 0, 0, 0, 0, 0], preload=preload)
    kinds = [k for k in Row if k <= (Row.DN_UP if planar else Row.E_DOWN)]
    turns = [Row.TURN_UP, Row.SOFT_TANGENT]
    about, cases = [], np.zeros((40, q.grasp.m + q.actuators, 3), dtype=np.int64)
    for leaf in range(len(cases)):
        some = rng.permutation(4)[: rng.integers(1, 4)]
        cases[leaf, :4, 0] = OPEN if rng.random() < 0.7 else CLOSED
        cases[leaf, some, 0] = CLOSED
        cases[leaf, 4:, 0] = LOCKED
        about += [(leaf, rng.choice(kinds), rng.choice(some)) for _ in range(rng.integers(0, 9))]
        about += [(leaf, rng.choice(turns), k) for k in some if k < 2 and family == "soft" and rng.random() < 0.2]
    leaf, kind, index = np.array(about, dtype=np.int64).T
    index = np.where(kind >= Row.T_UP, index % q.actuators, index)
    a, b = np.sort(rng.integers(0, HALF_TURN, size=(2, len(kind))), axis=0)
    value, right = row_values(q, (1.0, 2.0), LeafRows(kind, index, a, b, leaf, np.zeros((0, 5))))
    start = np.append(0, np.cumsum(np.bincount(leaf, minlength=len(cases))))
    none, y = np.zeros(len(kind), dtype=bool), rng.uniform(0.1, 1.0, len(kind))
    once, every = np.arange(len(kind)), none | either
    equations = equations_of(q)
    side = RightSide.of(q, (1.0, 2.0), len(equations.E))
    return LeafSystems(
        equations, side, CitedRows(value, right, once, every, y, start, zeros(q, cases), none, none), np.inf
    )


SHARES = {"planar": 0.65, "fingers": 0.8, "geared fingers": 0.8}  # of ranks that are known


@pytest.mark.parametrize("family", ["any", "planar", "soft", "geared", "fingers", "geared fingers"])
@pytest.mark.parametrize("seed", range(8))
def test_ranks_that_are_known_without_elimination_are_none_too_low(seed, family):
    found = systems(seed, family)
    leaves = np.flatnonzero(found.alive.any(axis=1))
    counted, most = found._most_ranks(leaves), found._most_ranks(leaves, by_entries=True)
    motions = np.arange(found.equations.columns.n) < found.equations.columns.motions
    exact = np.array([[rank(found, k, block) for block in (motions, ~motions)] for k in leaves])
    assert (exact <= counted).all()
    assert (exact <= most).all()
    assert (most <= counted).all()
    alive = np.column_stack([(found.alive[leaves] & block).sum(axis=1) for block in (motions, ~motions)])
    assert ((exact == counted) & (counted < alive)).any(axis=0).all() or family == "planar"
    assert (exact == most).mean() > SHARES.get(family, 0.85)  # what chance makes dependent is not known


def test_joints_with_parallel_axes_move_a_point_in_a_plane() -> None:
    """Four before contact 0 have rank 2, three before contact 1, of which two are parallel, all of their own."""
    found = systems(0, "fingers")
    by, joints = np.eye(4, dtype=bool)[:3], np.zeros((3, found.equations.columns.n), dtype=bool)
    joints[:, found.equations.columns.q] = True
    ((first, fewer),) = found._of_one_contact(joints, by)
    assert np.flatnonzero(first[0]).tolist() == [6, 7, 8, 9]
    assert fewer.tolist() == [2, 0, 0]
    joints[0, 7] = False  # a row knows it besides
    assert found._of_one_contact(joints, by)[0][1].tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("besides", "family"), [("joints", "fingers"), ("joints", "geared fingers"), ("turning", "fingers")]
)
def test_what_rows_know_besides_a_contact_counts_in_ranks(besides: str, family: str) -> None:
    """Three rows are of the motion of contact 0, the others of the joints before it, or of the object's turning."""
    found = systems(0, family)
    n, m = found.equations.columns.n, found.equations.grasp.m
    at = [n, n + 1, n + 2, *([n + 3 * m + j for j in range(4)] if besides == "joints" else [3, 4, 5])]
    value, some = np.eye(found.rows.value.shape[1])[at], np.ones(len(at))
    leaf = a_leaf(found, value, 0 * some, some, some > 0)
    exact = rank(leaf, 0, np.arange(n) < found.equations.columns.motions)
    assert exact >= len(at)
    for by_entries in (False, True):
        assert leaf._most_ranks(np.array([0]), by_entries)[0, 0] >= exact


def test_what_a_square_system_is_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """The entries of rows in columns, any numbers in the rows and columns that fill it up, 1 in those beyond."""
    made: list[Array] = []
    monkeypatch.setattr(leaves, "_inverse", lambda B: made.append(B.copy()) or np.linalg.pinv(B))
    found = systems(0, "geared", either=True)
    with np.errstate(all="ignore"):
        found.proved()
    made.clear()
    wanted = np.flatnonzero(found.columns.any(axis=1) & (found.more >= 0).all(axis=0))
    sides, (p, n) = found.columns.sum(axis=1) + found.more[1], found.E.shape
    filled = 0
    for square, matrices in zip(found._squares(wanted), made, strict=True):
        for leaf, columns, places, B in zip(square.leaves, square.columns, square.places, matrices, strict=True):
            side, own = sides[leaf], np.flatnonzero(columns < n)
            start, end = found.rows.start[leaf : leaf + 2]
            basis, equalities = np.flatnonzero(found.basis[start:end]) + start, np.flatnonzero(found.basis_E[leaf])
            k = len(basis) + len(equalities)
            assert places[:k].tolist() == [*basis, *(len(found.which) + leaf * p + equalities)]
            assert (places[k:] == len(found.which) + len(found.count) * p).all()
            rows = np.concatenate([found.F[found.which[basis]], found.E[equalities]])
            np.testing.assert_array_equal(B[:k, : len(own)], rows[:, columns[own]])
            assert B[k:side, :side].all()
            assert B[:side, len(own) : side].all()
            np.testing.assert_array_equal(B[side:], np.eye(len(B))[side:])
            np.testing.assert_array_equal(B[:side, side:], 0)
            filled += k < side
    assert filled > 3


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("share", [1e-10, 1e-12])
def test_multipliers_that_are_rounding_of_a_solver_are_left_out_first(quick: bool, share: float) -> None:
    """-x >= 0 and x >= 1 contradict each other; a third row with y that is told besides does not cancel."""
    told = judged(with_one_that_hardly_counts(0.0, told=share), quick)[0]
    assert (told > 0) == (share < 1e-11 or not quick)  # in rational numbers what does not cancel gets 0


def shown(family: str, at_least: int) -> list[tuple[LeafSystems, int]]:
    """Leaves that floating point proves with multipliers of any sign, rows and columns chosen for rational numbers.

    Which leaves these are depends on how sums are rounded, so seeds go on until there are as many as wanted.
    """
    out: list[tuple[LeafSystems, int]] = []
    for seed in range(40):
        if len(out) >= at_least:
            break
        found = systems(seed, family, either=True)
        with np.errstate(all="ignore"):
            margins = found.proved()
        leaves = np.flatnonzero(margins > 0)
        assert len(leaves) < np.count_nonzero(found.alive.any(axis=1)) / 2
        found._choose(leaves, 1e-9)
        out += [(found, int(leaf)) for leaf in leaves]
    assert len(out) >= at_least
    return out


@pytest.mark.parametrize(
    ("family", "at_least"), [("any", 22), ("planar", 8), ("soft", 22), ("geared", 25), ("fingers", 22)]
)
def test_what_floats_prove_of_rows_by_chance_rational_numbers_prove(family, at_least):
    """Multipliers of any sign and size: a leaf is proved only where some of them cancel every unknown exactly."""
    proved = shown(family, at_least)
    assert any(found.more[:, leaf].any() for found, leaf in proved)  # many have fewer independent columns than columns
    for found, leaf in proved:
        margin, cap = exact_margin(found, leaf)
        assert np.isfinite(margin)  # its sign is that of the row which is left over
        assert cap == np.inf


def quickly_proved(seed: int, family: str) -> tuple[LeafSystems, Integers, Integers, Mask]:
    """Leaves; which of them floats prove; how many rows each uses; have the proved ones one more than unknowns?"""
    found = systems(seed, family, either=True)
    with np.errstate(all="ignore"):
        proved = np.flatnonzero(found.proved() > 0)
    many = found._summed(found.used.astype(np.int64)) + found.used_E.sum(axis=1)
    return found, proved, many, many[proved] - 1 == found.alive[proved].sum(axis=1)


def test_what_counting_does_not_show_places_of_entries_may() -> None:
    """Where rows are no more than the rank by counting, a leaf is proved by the rank that its entries' places allow."""
    shown = 0
    for seed in range(8):
        found, proved, many, square = quickly_proved(seed, "geared")
        ragged = proved[~square]
        shown += (found._most_ranks(ragged).sum(axis=1) >= many[ragged]).sum()
    assert shown


def test_square_systems_without_an_inverse_are_tried_again_with_the_rank_that_is_known() -> None:
    """As many unknowns as rows but one, whose rank is lower since two contacts do not keep an object from turning."""
    shown = 0
    for seed in range(4):
        found, proved, _, square = quickly_proved(seed, "any")
        filled = proved[square & found.more[:, proved].any(axis=0)]
        motions = np.arange(found.equations.columns.n) < found.equations.columns.motions
        for leaf in filled.tolist():
            lower = rank(found, leaf, motions) + rank(found, leaf, ~motions)
            assert found.more[:, leaf].tolist() == [found.alive[leaf].sum() - lower] * 2
        shown += len(filled)
    assert shown


def test_systems_of_like_size_are_grouped_so_that_padding_costs_less_than_a_group(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """100 of side 4, 2 of 5 and 100 of 20: 102 (20^3 - 5^3) is more than a group costs, 100 (5^3 - 4^3) is not."""
    size = np.array([20, 4, 20, 5, 4, 20] + 97 * [4, 20] + [4, 5, 4, 4])
    some = np.arange(len(size))[::-1]
    groups = _groups(some, size)
    assert [sorted(set(size[group].tolist())) for group in groups] == [[4, 5], [20]]
    assert sorted(np.concatenate(groups).tolist()) == sorted(some.tolist())
    few = np.array(100 * [4] + [20, 30])  # 30^3 - 20^3 is less than a group costs, 100 times as much is more
    assert [sorted(set(few[group].tolist())) for group in _groups(np.arange(102), few)] == [[4], [20, 30]]
    many = np.array(100 * [20] + [30])  # the 100 are not to be padded from 20 to 30
    assert [len(group) for group in _groups(np.arange(101), many)] == [100, 1]
    near = np.array(100 * [9] + [10])
    assert [len(group) for group in _groups(np.arange(101), near)] == [101]
    monkeypatch.setattr(leaves, "GROUP_COST", 100 * (10**3 - 9**3))  # and as much is not more
    assert [len(group) for group in _groups(np.arange(101), near)] == [101]
    assert [len(group) for group in _groups(np.arange(300), np.full(300, 7))] == [300]
    assert _groups(some[:0], size) == []


def test_equalities_cancel_what_they_can_of_the_rows() -> None:
    """Least squares: what is left of rows and equalities is across all that equalities can change."""
    for seed in range(4):
        found = systems(seed)
        left = found.rest + found.stated_v @ found.E
        assert np.abs(found.rest @ found.equations.inverse).max() > 0.1
        assert np.abs(left @ found.equations.inverse).max() < 1e-13
        terms = found.count.max() + sum(found.E.shape) + len(found.equations.Z)
        assert found.error - ENTRY_ROUNDING >= 3.99 * terms * UNIT_ROUNDOFF


def test_bounds_hold_for_an_inverse_that_is_not_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """X that is a part in 1000 or less too small in each entry: d with d B = r is within the bounds all the same."""
    matrices, rng = [], np.random.default_rng(0)

    def small(B: Array) -> Array:
        matrices.append(B)
        return np.linalg.pinv(B) * (1 - 1e-3 * rng.random(B.shape))

    monkeypatch.setattr(leaves, "_inverse", small)
    found = systems(1, either=True)
    with np.errstate(all="ignore"):
        found.proved()
    matrices.clear()
    squares = found._squares(np.flatnonzero(found.columns.any(axis=1)))
    tried = 0
    for square, B in zip(squares, matrices, strict=True):
        for column in range(found.E.shape[1]):
            residual = np.zeros((len(found.count), found.E.shape[1]))
            residual[:, column] = 1.0
            exact = np.abs((square._of(residual) @ np.linalg.pinv(B))[:, 0])
            with np.errstate(all="ignore"):
                most, regular = square.bound(residual)
            assert (exact <= most)[regular].all()
            tried += (exact > 0)[regular].sum()
    assert tried > 100


def test_no_multiplier_of_an_inequality_is_negative_in_rational_numbers():
    refused = []
    for found, leaf in shown("any", 22):
        own = np.arange(found.rows.start[leaf], found.rows.start[leaf + 1])
        own = own[found.y[own] > 0]
        ties = np.flatnonzero(found.used_E[leaf] | np.isin(np.arange(len(found.E)), found.equations.solved[0]))
        columns = found.alive[leaf].copy()
        columns[found.equations.solved[1]] = True
        value = found.rows.value[found.which[own]]
        rows = fmpq_mat(found.equations.exact_rows(value, ties, np.flatnonzero(columns)))
        both = fmpq_mat([[*row, *(int(i == j) for j in range(rows.nrows()))] for i, row in enumerate(rows.tolist())])
        last = both.rref()[0].tolist()[-1]  # of rows that are dependent once
        if any(last[: rows.ncols()]) or not np.any(last[rows.ncols() :][: len(own)]):
            continue
        signs = {x > 0 for x in last[rows.ncols() :][: len(own)] if x != 0}
        found.rows.either[:] = False
        margin, _ = exact_margin(found, leaf)
        assert len(signs) == 1 or margin == -np.inf
        refused.append(len(signs) > 1)
    assert any(refused)


def judged(found: LeafSystems, quick: bool = False) -> tuple[Array, Array]:
    """Margins and caps, in floating point alone if it is to be quick."""
    with np.errstate(all="ignore"):
        margins = found.proved()
        if quick or (margins > 0).all():
            return margins, np.full(len(margins), np.inf)
        return found.more_exactly(margins, np.inf)


def with_one_that_hardly_counts(share: float, either: bool = False, told: float = 1e-10) -> LeafSystems:
    """A leaf of three rows: -x + share y >= 0, x >= 1 and y >= 0. They cancel with 1, 1 and -share, and with no others.

    told: what the certificate says of the last. either: may its multiplier have any sign?
    """
    found = systems(3)
    value, right = np.zeros((3, found.rows.value.shape[1])), np.array([0.0, 1.0, 0.0])
    value[:, :2] = [[-1.0, share], [1.0, 0.0], [0.0, 1.0]]
    return a_leaf(found, value, right, np.array([1.0, 1.0, told]), np.array([False, False, either]))


def a_leaf(found: LeafSystems, value: Array, right: Array, y: Array, either: Mask) -> LeafSystems:
    """Of these rows alone, with the equations of others; no unknown is 0."""
    none, start = np.zeros(len(y), dtype=bool), np.array([0, len(y)])
    zero = np.zeros((1, found.equations.columns.n), dtype=bool)
    cited = CitedRows(value, right, np.arange(len(y)), either, y, start, zero, none, none)
    return LeafSystems(found.equations, found.side, cited, np.inf)


@pytest.mark.parametrize(("gap", "proved"), [(0.0, True), (1.9, True), (-2.0, True), (2.1, False), (-2.1, False)])
def test_a_cap_is_none_of_motions_that_were_there_before(monkeypatch: pytest.MonkeyPatch, gap: float, proved) -> None:
    """What holds for motions up to 2 N says nothing where a contact was farther away, or pressed more."""
    monkeypatch.setattr(leaves, "exact_margin", lambda *_: (0.5, 2.0))
    found = with_one_that_hardly_counts(1e-30)
    g = found.equations.grasp
    before = StartData(gap * np.eye(g.m)[1], np.zeros(g.l), np.zeros(g.a))
    found.equations = replace(found.equations, grasp=g.with_start(before))
    margins, caps = judged(found)
    assert (margins.tolist(), caps.tolist()) == (([0.5], [2.0]) if proved else ([-np.inf], [np.inf]))


def test_it_ends_where_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before squares are inverted, ranks are counted by entries, rows are chosen, and each leaf in rational numbers."""
    places: list[str] = []
    monkeypatch.setattr(leaves, "in_time", lambda until: places.append(sys._getframe(1).f_code.co_name))
    judged(systems(0, either=True))
    assert set(places) == {"_squares", "_most_by_entries", "_choose", "more_exactly"}
    monkeypatch.undo()
    with pytest.raises(Late):
        in_time(time.monotonic() - 1)
    in_time(np.inf)


@pytest.mark.parametrize("share", [10.0**-k for k in (1, 3, 6, 9, 12, 14, 15, 16, 18, 30, 100)])
@pytest.mark.parametrize("quick", [True, False])
def test_no_multiplier_of_an_inequality_may_be_negative_however_small(share: float, quick: bool) -> None:
    """x = 1, y = 1 / share meets all three rows. The solved multiplier of the last is -share, 0 but for rounding.

    Nothing is proved by it, whether it is far below 0, or so near that floating point takes it for 0.
    """
    assert judged(with_one_that_hardly_counts(share, either=True), quick)[0] > 0
    assert judged(with_one_that_hardly_counts(share), quick)[0] == -np.inf
    # with the other sign it is a proof, which floating point finds where that is beyond rounding
    assert (judged(with_one_that_hardly_counts(-share), quick)[0] > 0) == (share >= 1e-12 or not quick)


def test_only_motions_and_forces_of_contacts_may_be_left_over():
    """Where a column is not solved for, what is left in it is known to be small for motions up to a cap, or not."""
    kinds = set()
    for found, leaf in shown("any", 22):
        basis, columns, reached = found.basis.copy(), found.columns.copy(), found.equations.reached
        row = int(np.flatnonzero(basis[found.rows.start[leaf] :])[0]) + found.rows.start[leaf]
        if row >= found.rows.start[leaf + 1]:
            continue
        for column in np.flatnonzero(columns[leaf]):
            found.basis, found.columns = basis.copy(), columns.copy()
            found.basis[row] = found.columns[leaf, column] = False
            margin, cap = exact_margin(found, leaf)
            assert margin == -np.inf if not reached[column] else cap < np.inf or margin == -np.inf
            kinds.add((bool(reached[column]), bool(np.isfinite(margin))))
        found.basis, found.columns = basis, columns
    assert {(True, True), (False, False)} <= kinds


def test_the_balance_of_energy_may_be_missed_in_rational_numbers_too():
    """What a balance takes of the margin is in proportion to by how much it may be missed."""
    changed = []
    for found, leaf in shown("any", 22):
        found.side = replace(found.side, energy=1.0)
        margin, _ = exact_margin(found, leaf)
        found.rows = replace(found.rows, energy=~found.rows.energy)
        less, _ = exact_margin(found, leaf)
        found.side = replace(found.side, energy=2.0)
        least, _ = exact_margin(found, leaf)
        changed.append(less != margin)
        assert margin - least == pytest.approx(2 * (margin - less), rel=1e-6)
        found.rows = replace(found.rows, energy=~found.rows.energy)
    assert np.mean(changed) > 0.5


def test_what_rounding_leaves_open_is_of_all_terms_of_a_sum() -> None:
    """Of every row and every equality by its largest entry, whatever the sign; of unknowns that are put in all is 0."""
    found, asked = systems(3, either=True), []
    found.columns = found.alive
    L, none = len(found.count), np.zeros((len(found.count), 0))

    def bound(residual: Array) -> tuple[Array, Mask]:
        asked.append(residual)
        return none, np.ones(L, dtype=bool)

    places = np.zeros((L, 0), dtype=np.int64)
    found._enclosed([SimpleNamespace(places=places, leaves=np.arange(L), solution=lambda _: none, bound=bound)])  # type: ignore[list-item]
    for leaf, (start, end) in enumerate(zip(found.rows.start, found.rows.start[1:], strict=False)):
        size = sum(found.y[k] * found.largest[found.which[k]] for k in range(start, end))
        size += sum(abs(v) * most for v, most in zip(found.v[leaf], found.E_largest, strict=True))
        np.testing.assert_allclose(asked[0][leaf, found.equations.solved[1]], found.error * size, rtol=1e-6)
    assert (found.v < 0).any()
    assert len(set(found.unit)) > 1
    assert ((found.largest >= np.abs(found.F).max(axis=1)) & (found.largest > 0.5) & (found.largest < 2)).all()


def test_efforts_are_put_in_from_the_balance_of_their_joint():
    """What is left of rows and equations in all unknowns is the same with the multipliers of these equations."""
    found = systems(3)
    q, rows = found.equations, found.rows
    solved, at = q.solved
    assert len(solved) == 3
    whole = (rows.value[:, : q.columns.n] + rows.value[:, q.columns.n :] @ q.Z) * q.scale / found.unit[:, None]
    whole += found.put_in @ (q.E * q.scale / q.unit[:, None])[solved]
    np.testing.assert_allclose(whole, found.F, atol=1e-14)
    assert found.put_in.any(axis=0).all()
    assert not found.F[:, at].any()
    assert not found.E[solved].any()


@pytest.mark.parametrize(
    ("slip", "grows", "energy", "first", "unit", "margin"),
    [
        (0.25, 0, 0, False, (1, 1), 0.75),
        (0.25, 0, 0, False, (8, 0.25), 0.75),  # it is 1 of one row and of the other, whatever their units are
        (0, 0.125, 0, False, (8, 0.25), 0.5),  # the farther end is 4
        (0, 0.125, 0, True, (8, 0.25), 0.875),  # the multiplier 1 / 0.25 grows faster, so the first end is worst
        (0, 0.125, 0, True, (8, 64), 0.5),  # 1 / 64 grows more slowly
        (0, 1 - 5e-10, 0, True, (1, 1), 1 - 4 * (1 - 5e-10)),  # or surely no faster
        (0, 0, 0.125, False, (8, 0.25), 1 - 0.125 / 8),
        (0, 0, 0.125, False, (2**-10, 64), 1 - 0.125 * 2**10),
    ],
)
def test_the_margin_of_two_rows_by_hand(slip, grows, energy, first, unit, margin) -> None:
    """d_n >= 0 of contact 1, r_x >= 1: their sum is d_n + r_x, which is missed by slip, and grows with the scalar.

    In floating point and in rational numbers. energy: of the first row. first: is the second the scalar's first end?
    """
    q = pinch([0] * 6, goal=LARGEST_GOAL, direction=[1, 0, 0, 0, 0, 0])
    made = equations_of(q)
    n = made.columns.n
    value, none = np.zeros((2, n + len(made.Z))), np.zeros(2, dtype=bool)
    value[0, n + 3], value[1, 0], right = unit[0], unit[1], np.array([0.0, unit[1]])
    side = RightSide.of(q, (1.0, 4.0), len(made.E))
    side = replace(side, slack=0 * side.slack, growth=0 * side.growth, slip=slip, slip_growth=grows, energy=energy)
    y, zero, flags = (
        1 / np.array(unit),
        np.zeros((1, n), dtype=bool),
        (np.array([False, first]), np.array([True, False])),
    )
    for size in (1.0, 1 / 16):  # of the multipliers: relative it is the same
        cited = CitedRows(value, right, np.arange(2), none, size * y, np.array([0, 2]), zero, *flags)
        found = LeafSystems(made, side, cited, np.inf)
        floats = found.proved()[0]
        found._choose(np.array([0]), 1e-9)
        for least in (floats, exact_margin(found, 0)[0]):
            assert margin - 1e-8 * abs(margin) <= least <= margin


# --- parts by hand: two walls across from each other at -x and x; r is the columns 0 to 5, c the columns 6 to 11


def walls_of(counts: list[int], wrench: Sequence[float] = (0.0,) * 6, **more: Any) -> LeafSystems:
    """Leaves with so many rows that say nothing, for what is put into them."""
    q = pinch(wrench, **more)
    made = equations_of(q)
    R, L = sum(counts), len(counts)
    none, zero = np.zeros(R, dtype=bool), np.zeros((L, made.columns.n), dtype=bool)
    value, start = np.zeros((R, made.columns.n + len(made.Z))), np.cumsum([0, *counts])
    cited = CitedRows(value, np.zeros(R), np.arange(R), none.copy(), np.ones(R), start, zero, none, none)
    scalar = (1.0, 2.0) if q.has_scalar else None
    return LeafSystems(made, RightSide.of(q, scalar, len(made.E)), cited, np.inf)


def mask(size: int, *places: int) -> Mask:
    out = np.zeros(size, dtype=bool)
    out[list(places)] = True
    return out


def test_the_row_with_the_largest_multiplier_of_those_used_is_left_out() -> None:
    """The first row of several; an equality where it is larger than all rows, or there are none."""
    found = walls_of([3, 0, 2, 2, 1])
    found.y, found.used = np.array([1.0, 3, 3, 2, 2, 9, 1, 3]), ~mask(8, 5)
    found.v = np.zeros((5, 6))
    found.v[[0, 0, 1, 1, 2, 3, 4], [2, 5, 1, 2, 3, 4, 0]] = -2, -9, -0.5, 0.25, -2, -1.5, 2
    found.used_E = (found.v != 0) & (found.v > -9)
    found.basis, found.basis_E = found.used.copy(), found.used_E.copy()
    found._leave_out_one()
    assert np.flatnonzero(found.basis).tolist() == [0, 2, 4, 6]
    assert np.argwhere(found.basis_E).tolist() == [[0, 2], [1, 2], [2, 3], [4, 0]]


def test_which_rows_and_equalities_are_used() -> None:
    """Those whose multipliers are no less than a share of the largest of their leaf, and that touch what is not 0."""
    found = walls_of([3, 1, 0])
    found.stated = np.array([1.0, 0.5, 2e-3, 1e-4])
    found.touches = np.array([mask(12, 0, 6), mask(12, 7), mask(12, 0), mask(12, 8)])
    found.E_touches = np.array([mask(12, 6, 9), mask(12, 7), mask(12, 10), *[mask(12, 11)] * 3])
    found.rows.zero[0, 7] = True
    v = np.array([[4.0, -0.25, -1e-4, 0, 0, 0], [0, 0, 0, -1.0, 0, 0], [-2.0, 0, 2e-3, 0, 0, 0]])
    found._use(v, 1e-3)
    assert found.top.tolist() == [4, 1, 2]
    assert found.y.tolist() == [1, 0.5, 0, 0]
    assert found.used.tolist() == [True, False, False, False]
    assert found.v.tolist() == [[4, -0.25, 0, 0, 0, 0], [0, 0, 0, -1, 0, 0], [-2, 0, 0, 0, 0, 0]]
    assert np.argwhere(found.used_E).tolist() == [[0, 0], [1, 3], [2, 0]]
    assert [np.flatnonzero(x).tolist() for x in found.alive] == [[0, 6, 9], [11], [6, 9]]


@pytest.mark.parametrize(("least", "normal"), [(1e-9, -1.0), (0.9, 0.0)])
def test_equalities_are_solved_for_again_without_what_is_0(least: float, normal: float) -> None:
    """Contact 1 is open in the first leaf: its c_n is in (1) of x alone, the others in two equations each.

    Contact 0 is open in the second, which has no rows: what is left of the load of -1 along y is across (1).
    least: of singular values, relative; those of the tangents are the square root of 2.
    """
    found = walls_of([1, 0, 0], wrench=[0, 1, 0, 0, 0, 0])
    before = found.v[2].copy()
    found.rest = np.array([[0.0] * 6 + [1, 2, 3, 4, 5, 6]] * 3)
    found.rows.zero[0, 9:], found.rows.zero[1, 6:9] = True, True
    found._solve_again(np.array([0, 1]), least)
    np.testing.assert_allclose(found.v[0], [normal, 1.5, -1, 0, -1, -1.5], atol=1e-14)
    np.testing.assert_allclose(found.v[1], [0, -0.5, 0, 0, 0, 0.5], atol=1e-14)
    assert found.v[2].tolist() == before.tolist()
    assert found.used_E[1].tolist() == [False, True, False, False, False, True]  # and are taken for what is used


@pytest.mark.parametrize(
    ("y", "v", "either", "basis", "basis_E"),
    [
        ([5, 1, 2, 3], [0, 0], [3], [2, 3], []),  # any sign first, then the larger; the largest is left over
        ([5, 2, 1, 3], [0, 0], [3], [1, 3], []),
        ([5, 2, 1, 3], [0.1, 0], [3], [3], [0]),
        ([5, 1, 2, 3], [0.1, 0], [], [3], [0]),
        ([1, 5, 2, 3], [0.1, 0.1], [], [], [0, 1]),
        ([5, 1, 2, 3], [-9, 0], [], [0, 3], []),  # it may be an equality
        ([5, 9, 2, 3], [-9, 0], [], [0, 3], []),  # two are the largest
        ([5, 1, 2, 3], [0, 0, 0, 0, 0, -9], [], [0, 3], []),  # or the last of (1)
    ],
)
def test_which_rows_are_chosen_by_elimination(
    y: list[float], v: list[float], either: list[int], basis, basis_E
) -> None:
    """Rows along x, y, y, and 3 x + y; (1) of x along x, that of y along x + y. What is not alive does not count."""
    found = walls_of([1, 4])
    found.y, found.v[1, : len(v)] = np.array([1.0, *y]), v
    found.used, found.used_E = mask(5, 0, 1, 2, 3, 4), found.v != 0
    found.rows.either[1 + np.array(either, dtype=int)] = True
    every = np.zeros((12, 13))
    every[:7, :2] = [[1, 0], [1, 0], [0, 1], [0, 1], [3, 1], [1, 0], [1, 1]]
    every[10, 0], every[1:7, 5] = 1.0, 7.0
    found.every, found.alive = every, np.array([mask(12, 5), mask(12, 0, 1)])
    found.basis, found.basis_E, found.columns = ~found.used, ~found.used_E, ~found.alive
    found._choose(np.array([0, 1]), 1e-6)
    assert not found.basis[0]  # the first leaf has no pivot in what is alive
    assert np.flatnonzero(found.basis[1:]).tolist() == basis
    assert np.argwhere(found.basis_E).tolist() == [[1, k] for k in basis_E]
    assert [np.flatnonzero(x).tolist() for x in found.columns] == [[], [0, 1]]


def test_where_the_rows_of_leaves_stand_among_rows_and_equalities() -> None:
    """R = 3 rows and 6 equalities: 9 stands for none."""
    found = walls_of([2, 1])
    equalities = np.array([mask(6, 1), mask(6, 0, 2)])
    for width, ends in ((None, ()), (4, (9,))):
        index, there = found.places(np.array([0, 1]), mask(3, 0, 2), equalities, width)
        assert index.tolist() == [[0, 4, 9, *ends], [2, 3, 5, *ends]]
        assert there.tolist() == [[True, True, False, *(False for _ in ends)], [True] * 3 + [False for _ in ends]]
    assert found.places(np.array([1]), mask(3, 0, 2), equalities, 2)[0].tolist() == [[2, 3]]
    assert found.places(np.array([0, 1]), mask(3), mask(12).reshape(2, 6))[0].shape == (2, 0)
    assert found.places(np.zeros(0, dtype=np.int64), mask(3), equalities)[0].shape == (0, 0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("upper", "regular"), [(0.0, True), (0.25, True), (0.5, False), (0.75, False)])
def test_the_bounds_of_a_square_system_by_hand(
    monkeypatch: pytest.MonkeyPatch, upper: float, regular: bool, sign: int
) -> None:
    """B = diag(2, 4), X = B^-1 + (0, x / 2; 0, 0), x = upper or -upper: B X is 1 + (0, x; 0, 0).

    The error of entries, 2^-12, times 4, the largest of the second row, and all of |X|, comes to that.
    """
    B, X = np.diag([2.0, 4.0]), np.array([[0.5, sign * upper / 2], [0.0, 0.25]])
    monkeypatch.setattr(leaves, "_inverse", lambda b: X[None] if np.array_equal(b[0], B) else 0 * b)
    every = np.zeros((4, 3))
    every[:2, :2] = B
    systems = SimpleNamespace(
        which=np.arange(2), E=np.zeros((1, 2)), basis=None, basis_E=None, columns=np.ones((1, 2), dtype=bool),
        places=lambda *_: (np.array([[0, 1]]), np.ones((1, 2), dtype=bool)), row_of=np.arange(4), every=every,
        more=np.zeros((2, 1)), count=np.array([2]), largest=np.array([0.5, 4.0]), E_largest=np.ones(1), error=2.0**-12,
    )  # fmt: skip
    square = Square(systems, np.array([0]), np.array([2]))  # type: ignore[arg-type]
    size = 0.75 + upper / 2
    rows, columns = max(upper + 2.0**-12 * size, 2.0**-10 * size), np.array([0, upper]) + 2.0**-10 * size
    assert square.regular.tolist() == [regular]
    assert (square._columns[0] >= columns).all()
    assert square._rows[0] >= rows
    residual = np.array([[1.0, 8.0]])
    with np.errstate(all="ignore"):
        bound, sound = square.bound(residual)
    assert sound.tolist() == [regular]
    at_most = np.array([0.5, upper / 2 + 2.0])
    wanted = at_most + at_most.sum() / (1 - rows) * columns if regular else np.zeros(2)
    assert (bound[0] >= wanted).all()
    np.testing.assert_allclose(bound[0], wanted, rtol=1e-8)
    assert square.solution(residual)[0].tolist() == ([0.5, sign * upper / 2 + 2.0] if regular else [0, 0])


def test_which_systems_are_tried_again_with_the_rank_by_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    """(rows, unknowns), rank by counting, by entries; filled up to the rank where rows are not one more than unknowns.

    Tried again is what was not shown, and has a lower rank by entries.
    """
    table: dict[tuple[Any, ...], tuple[int, int]] = {
        (3, 2): (9, 9),  # square, shown
        (4, 2): (2, 9),  # one row too many
        (2, 3): (2, 1),  # as many rows as the rank: nothing follows before entries are counted
        (1, 0): (9, 9),  # nothing to cancel
        (3, 2, ""): (9, 1),  # square, but singular
        (3, 2, " "): (9, 2),  # no lower rank: it is not tried again
        (5, 3): (2, 2),
    }
    shapes = [key[:2] for key in table]
    found = walls_of([rows for rows, _ in shapes])
    found.used[:], found.used_E[:] = True, False
    found.alive = np.array([np.arange(12) < columns for _, columns in shapes])
    tried: list[tuple[list[int], list[list[int]]]] = []

    def ranks(leaves: Integers, by_entries: bool = False) -> Integers:
        """In motions, and in the other unknowns."""
        total = np.array(list(table.values()))[leaves, int(by_entries)]
        return np.column_stack([total - 1, np.ones_like(total)])

    def squares(leaves: Integers) -> list[SimpleNamespace]:
        tried.append((leaves.tolist(), found.more[:, leaves].T.tolist()))
        return [SimpleNamespace(leaves=leaves, regular=np.isin(leaves, [0, 1, 3]))]

    given = np.array([0.5, 0.25, 0.0, -1.0, -np.inf, np.nan, 1.0])
    monkeypatch.setattr(found, "_most_ranks", ranks)
    monkeypatch.setattr(found, "_squares", squares)
    monkeypatch.setattr(found, "_enclosed", lambda shown: (given if len(shown) == 2 else 0 * given, None))
    margins = found.proved()
    assert tried[0] == ([0, 1, 3, 4, 5, 6], [[0, 0], [0, 1], [0, 0], [0, 0], [0, 0], [1, 2]])
    assert tried[1] == ([2, 4], [[2, 0], [1, 1]])
    np.testing.assert_array_equal(margins, given)


def test_what_floats_do_not_show_is_tried_in_rational_numbers_with_ever_larger_pivots(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """First with the multipliers as they are stated, then with those that are solved for again."""
    found, done = walls_of([1, 1, 1, 1]), list[Any]()
    found.alive[:] = True
    found.alive[3] = False
    wanted = {1: 0, 2: 1}  # a leaf: after how many others it is proved
    asked = dict.fromkeys(range(4), 0)

    def exact(systems: LeafSystems, leaf: int) -> tuple[float, float]:
        asked[leaf] += 1
        return (0.5, 8.0) if asked[leaf] > wanted.get(leaf, 9) else (-1.0, 4.0)

    first, none = np.array([0.5, 0.0, -np.inf, np.nan]), np.full(4, np.inf)
    found.more, found.basis, found.basis_E, found.columns = np.zeros((2, 4), int), found.used, found.used_E, found.alive
    monkeypatch.setattr(found, "_enclosed", lambda _: (-none, none))
    monkeypatch.setattr(found, "_asked", lambda _: str(len(done)))  # another question each time
    monkeypatch.setattr(found, "_squares", lambda _: [])
    monkeypatch.setattr(found, "_most_ranks", lambda some, by_entries=False: np.full((len(some), 2), 9))
    monkeypatch.setattr(found, "_use", lambda v: done.append(v is found.stated_v))
    monkeypatch.setattr(found, "_choose", lambda some, least: done.append(("choose", some.tolist(), least)))
    monkeypatch.setattr(found, "_solve_again", lambda some, least: done.append(("solve", some.tolist(), least)))
    monkeypatch.setattr(leaves, "exact_margin", exact)
    monkeypatch.setattr(leaves, "in_time", lambda until: done.append(until))
    margins, caps = found.more_exactly(first, np.inf)
    assert done == [
        True, ("choose", [1, 2], 1e-9), *[np.inf] * 3,
        ("solve", [2, 3], 1e-6), ("choose", [2], 1e-6), *[np.inf] * 2,
        ("solve", [3], 1e-4), ("choose", [], 1e-4), np.inf,
    ]  # fmt: skip
    assert margins.tolist() == [0.5, 0.5, 0.5, -1]
    assert caps.tolist() == [np.inf, 8, 8, np.inf]  # of what is not proved there is none


@pytest.mark.parametrize(
    ("slip", "grows", "energy", "less"),
    [
        (0, 0, 0, 0),
        (0.25, 0, 0, 0.25 * 1.125),
        (0, 1.5, 0, 1.5 * 1.125),  # 1.75, the least multiplier of the first end, is more: that end, 1
        (0, 1.6, 0, 1.6 * 1.125 * 4),  # less: the farther one, 4
        (0, 1.75 / 1.125 * (1 - 5e-10), 0, 1.75 * 4),  # or not surely more
        (0, 0, 0.5, 0.5 * 1.125 / 2),
    ],
)
@pytest.mark.parametrize("put_in", [(0.0, 0.0), (0.5, 0.25), (0.5, -0.25)])
def test_a_margin_is_less_by_all_that_multipliers_may_be_off(
    slip: float, grows: float, energy: float, less: float, put_in: tuple[float, float]
) -> None:
    """Multipliers 1 and 2 of rows with right sides 1 and -1/4, 1/2 of (1) along y, whose right side is -1.

    They may be off by 1/8, 1/4 and 1/16. The first row is 2 d_n of contact 1, over 2, and a balance of energy; the
    second the scalar's first end. An effort is put in from an equation whose right side is -1.
    """
    turning = [{"name": "a", "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]}]
    found = walls_of([2, 0], wrench=[0, 1, 0, 0, 0, 0], joints=turning, preload={"a": 1.0})
    side, n = found.side, found.equations.columns.n
    side = replace(side, slack=0 * side.slack, growth=0 * side.growth, slip=slip, slip_growth=grows, energy=energy)
    found.side, found.error = replace(side, ends=(1.0, 4.0)), 2.0**-8
    found.rows.value[0, n + 3], found.unit[0] = 2.0, 2.0
    found.rows = replace(found.rows, energy=mask(2, 0), first=mask(2, 1))
    found.y, found.b, found.put_in = np.array([1.0, 2.0]), np.array([1.0, -0.25]), np.array(put_in)[:, None]
    found.v, found.columns = np.array([[0, -0.5, 0, 0, 0, 0, 9.0], np.zeros(7)]), found.alive
    found.h[6], found.F[1, 9] = -1.0, -0.25  # of a force in (1) along y, which is left out by half of it
    change = np.array([0.125, 0.25, 0, 0.0625, 0, 0, 0, 0, 9.0])
    asked: list[Array] = []

    def margins(sound: bool) -> Array:
        def bound(residual: Array) -> tuple[Array, Mask]:
            asked.append(residual)
            return np.array([change, 0 * change]), np.array([sound, True])

        places = np.array([np.arange(9), [*[16] * 2, *range(9, 16)]])
        square = SimpleNamespace(places=places, leaves=np.arange(2), solution=lambda _: np.zeros((2, 9)), bound=bound)
        given = found.v.copy()
        out = found._enclosed([square])[0]  # type: ignore[list-item]
        found.v = given
        return out

    effort, sizes = put_in[0] + 2 * put_in[1], abs(put_in[0]) + 2 * abs(put_in[1])
    terms = 2.0 + sizes
    value = 1.0 - effort - 2.0**-8 * terms
    value -= 0.125 + 0.25 * 0.25 + 0.0625 + 0.125 * abs(put_in[0]) + 0.25 * abs(put_in[1]) + 2.0**-8 * sizes
    margin, none = margins(sound=True)
    assert none == -np.inf  # without any terms
    assert margin == pytest.approx((value - less) / terms, rel=1e-7)
    assert margin <= (value - less) / terms
    entries = found.y @ found.largest[:2] + abs(found.v[0]) @ found.E_largest
    left = np.abs(found._weighed(found.y) + found.v @ found.E)
    assert left[0, 9] == 0
    assert (asked[0] > 0).all()
    np.testing.assert_allclose(asked[0], left + 2.0**-8 * np.array([[entries], [0.0]]), rtol=1e-6, atol=1e-299)
    assert (asked[0][0] >= left[0] + 2.0**-8 * entries).all()
    assert margins(sound=False)[0] == -np.inf
    change[1] = 2.5  # more than the multiplier: an inequality's may be negative
    assert margins(sound=True)[0] == -np.inf
    found.rows.either[1] = True
    assert np.isfinite(margins(sound=True)[0])


def two_rows(share: float, column: int, right: float = 1.0, **more: Any) -> LeafSystems:
    """-r_x + share times another unknown >= 0, and r_x >= 1; r_x alone is chosen to be solved for, by the second."""
    q = pinch([0] * 6, goal=LARGEST_GOAL, direction=[1, 0, 0, 0, 0, 0])
    made = equations_of(q)
    value, none = np.zeros((2, made.columns.n + len(made.Z))), np.zeros(2, dtype=bool)
    value[:, 0], value[0, column] = (-1, 1), share
    side = RightSide.of(q, (1.0, 2.0), len(made.E))
    none_missed: dict[str, Any] = {"slack": 0 * side.slack, "growth": 0 * side.growth, "slip": 0.0, "energy": 0.0}
    side = replace(side, **none_missed | more)
    zero = np.zeros((1, made.columns.n), dtype=bool)
    cited = CitedRows(value, np.array([0, right]), np.arange(2), none, np.ones(2), np.array([0, 2]), zero, none, none)
    found = LeafSystems(made, side, cited, np.inf)
    found.basis, found.basis_E, found.columns = mask(2, 1), np.zeros_like(found.used_E), mask(13, 0)[None]
    return found


@pytest.mark.parametrize(
    ("column", "share", "margin", "cap"),
    [
        (1, 2.0**-20, 1.0, 2.0**19),  # up to a motion of 2^19 it takes half of the margin
        (1, 0.0, 1.0, np.inf),
        (12, 2.0**-20, -np.inf, np.inf),  # nothing bounds the scalar
        (12, 0.0, 1.0, np.inf),
    ],
)
def test_what_is_left_over_is_bounded_by_motions_up_to_a_cap(
    column: int, share: float, margin: float, cap: float
) -> None:
    found = two_rows(share, column)
    assert exact_margin(found, 0) == pytest.approx((margin, cap), rel=1e-8)
    by_floats = np.ravel(by_square(found))
    assert by_floats == pytest.approx((margin, cap if margin > 0 else 0.0), rel=1e-6)
    assert (by_floats <= (margin, cap)).all()


def by_square(found: LeafSystems) -> tuple[Array, Array]:
    """Margins and caps in floating point, with the rows and columns that are chosen."""
    found.more = np.zeros((2, len(found.count)), dtype=np.int64)
    fits = found._summed(found.basis.astype(np.int64)) + found.basis_E.sum(axis=1) == found.columns.sum(axis=1)
    with np.errstate(all="ignore"):
        return found._enclosed(found._squares(np.flatnonzero(fits)))


def test_what_is_0_but_for_rounding_may_be_left_over_in_floats() -> None:
    """In a motion it needs a cap, and what is no motion it may not be in; rational numbers are asked what it is."""
    none = -np.inf, np.inf
    margin, cap = by_square(two_rows(1e-300, 1))
    assert margin == pytest.approx(1)
    assert 1e12 < cap[0] < 1e16 < exact_margin(two_rows(1e-300, 1), 0)[1]
    assert np.ravel(by_square(two_rows(1e-300, 12))).tolist() == [*none]
    assert np.ravel(by_square(two_rows(0.0, 1, right=-1.0))).tolist() == [pytest.approx(-1), np.inf]


def test_what_is_left_over_is_of_all_that_multipliers_may_be_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two leaves of two rows each, of which the first leaves r_y and a slider's motion q over.

    -r_x + 2^-20 r_y + 2^-20 q >= 0 and r_x >= 1 with multipliers 1, off by 1/8 and 1/4; (1) along x by 1/16, which
    touches c_n of both walls, is of c alone. q is scaled by a half; of d_n it is 2 at contact 0, where r_y is 0.
    """
    slider = [{"name": "a", "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": [0]}]
    found = walls_of([2, 2], joints=slider, preload={"a": 1.0})
    q, share = found.equations, 2.0**-20
    scale = np.ones(q.columns.n)
    scale[6] = 0.5
    monkeypatch.setitem(q.__dict__, "scale", scale)
    found.alive, found.columns = np.zeros((2, q.columns.n), dtype=bool), np.zeros((2, q.columns.n), dtype=bool)
    found.alive[:, [0, 1, 6]], found.columns[0, 0], found.columns[1, [0, 1, 6]] = True, True, True
    found.F[:] = 0.0
    found.F[:, 0], found.F[0, [1, 6]] = [-1, 1, -1, 1], share
    found.size, found.largest, found.unit, found.put_in = (
        np.abs(found.F),
        0 * found.largest,
        0 * found.unit + 1,
        0 * found.put_in,
    )
    found.size[1, 1], found.size[1, 6] = 3.0, 5.0  # terms that cancel each other
    found.y, found.v, found.b = np.ones(4), 0 * found.v, np.array([0.0, 1, 0, 1])
    found.E, found.E_largest, found.E_size = 0 * found.E, 0 * found.E_largest, 0 * found.E_size
    found.E_size[0, 1] = 7.0
    side = found.side
    found.side = replace(side, slack=0 * side.slack, growth=0 * side.growth, slip=0.0, slip_growth=0.0, energy=0.0)
    found.error = 0.0
    p = found.v.shape[1]
    off = np.array([0.125, 0.25, 0.0625])
    places = np.array([[0, 1, 4], [2, 3, 4 + p]])

    def enclosed(off: Array) -> tuple[Array, Array]:
        bounds = np.array([off, 0 * off]), np.ones(2, dtype=bool)
        square = SimpleNamespace(
            places=places, leaves=np.arange(2), solution=lambda _: np.zeros((2, 3)), bound=lambda _: bounds
        )
        return found._enclosed([square])  # type: ignore[list-item]

    margins, caps = enclosed(off)
    value = 1 - 0.25  # of the right side 1 of the row r_x >= 1
    assert margins == pytest.approx([value, 1.0], rel=1e-7)
    rest = np.zeros((1, q.columns.n))
    rest[0, 1], rest[0, 6] = share, share / 0.5
    wide = np.zeros((1, q.columns.n))
    wide[0, 1] = 0.125 * share + 0.25 * 3 + 0.0625 * 7
    wide[0, 6] = (0.125 * share + 0.25 * 5) / 0.5
    wanted = value / (2 * q.reach(rest, wide)[0])
    assert caps[0] == pytest.approx(wanted, rel=1e-7)
    assert caps[0] <= wanted
    assert caps[1] == np.inf  # nothing is left over
    found.rows.either[:] = False
    margins, caps = enclosed(np.array([1.5, 0.25, 0.0]))  # an inequality's may be negative
    assert margins[0] == -np.inf
    assert (caps[0], caps[1]) == (np.inf, np.inf)
    found.y[0] = -2.0  # and this one's surely is
    assert enclosed(np.array([1.5, 0.25, 0.0]))[1].tolist() == [0, np.inf]


def test_sizes_are_of_all_terms_of_an_entry() -> None:
    """Of rows over their unit, with efforts put in: absolute values in place of numbers, no less than the entries."""
    found = systems(3)
    q, rows = found.equations, found.rows
    solved, at = q.solved
    size = np.abs(rows.value[:, : q.columns.n]) * q.scale
    size += np.abs(rows.value[:, q.columns.n :]) @ (q.Z_size * q.scale)
    put_in = np.abs(found.put_in * found.unit[:, None])
    size += put_in @ (q.E_size * q.scale / q.unit[:, None])[solved]
    size[:, at] = 0.0
    np.testing.assert_allclose(found.size, size / found.unit[:, None], rtol=1e-12)
    assert (np.abs(found.F) <= found.size * (1 + 1e-12)).all()
    assert (np.abs(found.E) <= found.E_size * (1 + 1e-12)).all()
    assert len(set(found.unit)) > 2


def test_a_real_proof_has_the_same_cap_with_far_fewer_leaves_in_rational_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The largest pull of the bell along y: points that depend on each other but for rounding."""
    answer = maximum(load_grasp("fig1"), [0, 1, 0, 0, 0, 0], settings=Settings(verify=False, jobs=1))
    certificate, asked = answer.certificate, list[int]()
    assert certificate is not None
    exact, enclosed = leaves.exact_margin, LeafSystems._enclosed
    monkeypatch.setattr(leaves, "exact_margin", lambda s, leaf: asked.append(leaf) or exact(s, leaf))
    found, some = verify(certificate), len(asked)
    asked.clear()

    def nothing_up_to_a_cap(systems: LeafSystems, squares: list[Square]) -> tuple[Array, Array]:
        margins, caps = enclosed(systems, squares)
        return np.where(caps < np.inf, -np.inf, margins), np.full(len(caps), np.inf)

    monkeypatch.setattr(LeafSystems, "_enclosed", nothing_up_to_a_cap)
    all_exactly = verify(certificate)
    assert (found.ok, found.unproved, found.cap) == (all_exactly.ok, all_exactly.unproved, all_exactly.cap)
    assert 0 < some < len(asked) / 2


@pytest.mark.parametrize("family", ["any", "soft", "fingers"])
def test_floats_claim_no_more_than_rational_numbers_of_what_is_left_over(family: str) -> None:
    """Of leaves with multipliers of any sign, and of the same as inequalities, with one column left out, in turn."""
    kinds: list[str] = []
    for found, leaf in shown(family, 22):
        basis, columns = found.basis.copy(), found.columns.copy()
        for row in np.flatnonzero(basis[found.rows.start[leaf] : found.rows.start[leaf + 1]])[:2]:
            for column in np.flatnonzero(columns[leaf]):
                found.basis, found.columns = basis.copy(), columns.copy()
                found.basis[found.rows.start[leaf] + row] = found.columns[leaf, column] = False
                for either in (True, False):
                    found.rows.either[:] = either
                    margin, cap = (x[leaf] for x in by_square(found))
                    exact = exact_margin(found, leaf)
                    if cap == 0:
                        kinds.append("never")
                        assert exact[0] == -np.inf
                    elif margin > -np.inf:
                        kinds.append("shown" if margin > 0 else "too little")
                        assert margin <= exact[0] + 1e-8 * (1 + abs(exact[0]))  # of what slack takes
                        assert cap <= exact[1] * (1 + 1e-8) or margin <= 0
        found.basis, found.columns = basis, columns
        found.rows.either[:] = True
    assert {*kinds} == {"never", "shown", "too little"}
    assert kinds.count("shown") > 20


NONE = np.inf


@pytest.mark.parametrize(
    ("exact", "cap", "gap", "exactly", "wanted"),
    [
        # where a leaf has a cap, 40 N is enough
        ([80, 90, 400, 70], NONE, 0, [3, 0], [80, 50, 200, 70]),
        ([80, 90, 400, 45], NONE, 0, [3, 0], [80, 50, 200, 45]),
        ([NONE, 90, 400, 70], NONE, 0, [3, 0], [NONE, 50, 200, 70]),
        ([80, 90, 400, NONE], NONE, 0, [3, 0], [80, 50, 200, NONE]),
        ([NONE, 90, 400, NONE], NONE, 0, [3, 0, 1], [NONE, 90, 200, NONE]),
        ([80, 90, 400, NONE], 100.0, 0, [3, 0], [80, 50, 200, NONE]),
        ([80, 90, 400, NONE], 100.0, 60, [3, 0, 1], [80, 90, 200, NONE]),
        # it is no more than that
        ([8, 90, 400, 7], NONE, 0, [3, 0], [8, 50, 200, 7]),  # what floats do not show comes first
        ([8, 90, 400, 4], NONE, 0, [3], [5, 50, 200, 4]),
        ([8, 90, 400, 7], 5.0, 0, [3], [5, 50, 200, 7]),
        ([8, 90, 400, NONE], NONE, 0, [3, 0], [8, 50, 200, NONE]),
        ([NONE, 60, 400, NONE], NONE, 0, [3, 0, 1], [NONE, 60, 200, NONE]),
        ([NONE] * 4, NONE, 0, [3, 0, 1, 2], [NONE] * 4),
        ([-1, 90, 400, NONE], NONE, 0, [3, 0], [5, 50, 200, NONE]),  # where that fails floats have said enough
        ([8, 90, 400, 7], NONE, 8, [3, 0], [8, 50, 200, 0]),  # with a cap below the gap nothing is proved
        ([7, 90, 400, 7], NONE, 60, [3, 0, 1], [0, 90, 200, 0]),
        ([9, 90, 400, 60], 5.0, 8, [3, 0], [9, 50, 200, 60]),
    ],
)
def test_caps_that_another_leaf_makes_good_enough_are_those_of_floats(
    exact: list[float], cap: float, gap: float, exactly: list[int], wanted: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Floats show leaves 0, 1 and 2 up to 5, 50 and 200 N, and of 3 nothing; of 4 that nothing near it is a proof."""
    found, asked = walls_of([1] * 5), list[int]()
    g = found.equations.grasp
    before = StartData(gap * np.eye(g.m)[1], np.zeros(g.l), np.zeros(g.a))
    found.equations = replace(found.equations, grasp=g.with_start(before))

    def exact_margin(systems: LeafSystems, leaf: int) -> tuple[float, float]:
        asked.append(leaf)
        return (0.25, exact[leaf]) if exact[leaf] > 0 else (-1.0, np.inf)

    none, later = np.full(5, -np.inf), np.array([*[np.inf] * 4, 0])
    first = np.array([0.5, 0.5, 0.5, -np.inf, -np.inf]), np.array([5, 50, 200, np.inf, 0])
    stages = [(none, later), first, *[(none, later)] * 9]  # at once nothing is shown
    monkeypatch.setattr(found, "_enclosed", lambda _: stages.pop(0))
    monkeypatch.setattr(leaves, "exact_margin", exact_margin)
    margins, caps = judged_exactly(found, cap)
    assert asked == exactly
    assert caps.tolist() == [*(x or np.inf for x in wanted), np.inf]
    shown = (0.25 if k in asked and exact[k] > 0 else 0.5 for k in range(4))
    assert margins.tolist() == [*(x if w else -np.inf for x, w in zip(shown, wanted, strict=True)), -np.inf]


def judged_exactly(found: LeafSystems, cap: float) -> tuple[Array, Array]:
    with np.errstate(all="ignore"):
        found.proved()
        return found.more_exactly(np.full(len(found.count), -np.inf), cap, 40.0)


def test_what_failed_in_rational_numbers_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless what it depends on has changed: basis, columns, or multipliers outside the basis."""
    found = systems(0, either=True)
    with np.errstate(all="ignore"):
        found.proved()
    found._use(found.stated_v)
    leaf = int(np.flatnonzero(found._summed(found.basis.astype(int)) * found.used_E.any(axis=1) > 1)[0])
    own = np.arange(found.rows.start[leaf], found.rows.start[leaf + 1])
    inside, outside = own[found.basis[own]][0], own[0]
    found.basis[outside], tie = outside == inside, int(np.flatnonzero(found.used_E[leaf])[0])
    found.basis[inside], found.basis_E[leaf] = True, False

    def changed(place: Any, index: Any, value: Any) -> bool:
        before, place[index] = place[index].copy(), value
        again = found._asked(leaf)
        place[index] = before
        return again != asked

    asked = found._asked(leaf)
    assert asked == found._asked(leaf) != found._asked(leaf + 1)
    assert not changed(found.y, inside, 2 * found.y[inside] + 1)
    assert changed(found.basis, inside, False)
    assert changed(found.v, (leaf, tie), 2 * found.v[leaf, tie] + 1)
    assert changed(found.basis_E, (leaf, tie), True)
    column = int(np.flatnonzero(found.columns[leaf])[0])
    assert changed(found.columns, (leaf, column), False)
    found.basis_E[leaf, tie] = True
    asked = found._asked(leaf)
    assert not changed(found.v, (leaf, tie), 2 * found.v[leaf, tie] + 1)
    tried: list[int] = []
    monkeypatch.setattr(
        found, "_enclosed", lambda _: (np.full(len(found.count), -np.inf), np.full(len(found.count), np.inf))
    )
    monkeypatch.setattr(found, "_choose", lambda *_: None)
    monkeypatch.setattr(found, "_solve_again", lambda *_: None)
    monkeypatch.setattr(leaves, "exact_margin", lambda _, leaf: tried.append(leaf) or (-1.0, np.inf))
    found.more_exactly(np.full(len(found.count), -np.inf), np.inf)
    assert tried == list(range(len(found.count)))


def parts_of(size: float, y: float, each: float, parts: int = 8) -> LeafSystems:
    """r_x >= size with y, and -r_x >= -3/2 size as so many rows with y each: they hold together, and cancel."""
    found = systems(3)
    value, right = np.zeros((1 + parts, found.rows.value.shape[1])), np.full(1 + parts, -1.5 * size)
    value[0, 0], value[1:, 0], right[0] = 1, -1, size
    return a_leaf(found, value, right, np.array([y, *[each] * parts]), np.zeros(1 + parts, dtype=bool))


@pytest.mark.parametrize("size", [1.0, 1e-40, 1e-100, 1e-150, 1e-290, 1e-310])
@pytest.mark.parametrize("quick", [True, False])
def test_products_that_underflow_prove_nothing(size: float, quick: bool) -> None:
    """Multipliers with which y b of the first row rounds up to the smallest number, and of all others to 0."""
    for share in np.arange(0.55, 1.0, 0.05):
        y = share * 4.94e-24 / size * 1e-300 if size > 1e-300 else 1.0
        assert judged(parts_of(size, y, y / 8), quick)[0] <= 0
    assert judged(parts_of(5e-324, 1.0, 0.125), quick)[0] <= 0


def test_what_underflow_takes_is_less_than_what_a_proof_has_to_leave() -> None:
    """A right side below it proves nothing, and no cap is told that is one of rounding."""
    assert exact_margin(two_rows(0.0, 1, right=1e-305), 0)[0] < 0
    assert exact_margin(two_rows(0.0, 1, right=1e-290), 0)[0] == pytest.approx(1)
    assert by_square(two_rows(0.0, 1, right=1e-305))[0][0] < 0
    assert by_square(two_rows(0.0, 1, right=1e-290))[0][0] == pytest.approx(1)
    assert exact_margin(two_rows(5e-324, 1, right=1e10), 0)[1] == 1e300
    assert exact_margin(two_rows(5e-324, 1), 0)[1] == pytest.approx(1e300)


def test_what_shows_nothing_in_rational_numbers() -> None:
    """Right sides of 0, a slack without end, multipliers that are no numbers, more columns than rows, no inverse."""
    none = -np.inf, np.inf
    assert exact_margin(two_rows(0.0, 1), 0)[0] == pytest.approx(1)
    assert exact_margin(two_rows(0.0, 1, right=0.0), 0) == none
    with np.errstate(all="ignore"):
        assert exact_margin(two_rows(0.0, 1, slip=np.inf), 0) == none
    assert exact_margin(two_rows(0.0, 1, right=-1.0), 0) == (-1.0, np.inf)
    for name, bad in (("y", np.inf), ("y", np.nan), ("v", np.inf), ("v", np.nan)):
        found = two_rows(0.0, 1)
        getattr(found, name)[..., 0] = bad
        assert exact_margin(found, 0) == none
    found = two_rows(0.0, 1)
    found.columns[0, 1] = True
    assert exact_margin(found, 0) == none
    found.columns = mask(13, 2)[None]
    assert exact_margin(found, 0) == none


@pytest.mark.parametrize(("of_f", "of_c"), [(0.0, -3.0), (-1.5, -1.5)])
def test_efforts_are_put_in_where_any_row_knows_them(of_f: float, of_c: float) -> None:
    """3 f >= 3; -3 c_n >= 0, or half of both, of contact 0, whose slider is balanced by c_n - f = 0."""
    slider = [{"name": "a", "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 1, 0], "moves": [0]}]
    like = walls_of([1], joints=slider, preload={"a": 1.0})
    like.side = replace(like.side, slack=0 * like.side.slack, slip=0.0, energy=0.0)
    value = np.zeros((2, like.rows.value.shape[1]))
    value[0, 13], value[1, [7, 13]] = 3.0, (of_c, of_f)
    found = a_leaf(like, value, np.array([3.0, 0.0]), np.array([1.0, 1.0]), np.array([False, False]))
    assert found.put_in.tolist() == [[0.75], [of_f / 4]]  # 3 f, over 4
    assert found.F[:, [7, 13]].tolist() == [[0.75, 0], [-0.75, 0]]
    assert found.touches[0].tolist() == mask(14, 7).tolist()
    assert (found.unit.tolist(), found.largest.tolist(), found.b.tolist()) == ([4, 4], [0.75, 0.75], [0.75, 0])
    assert found.proved() == pytest.approx(1)
    found._use(found.stated_v)
    found._choose(np.array([0]), 1e-9)
    assert exact_margin(found, 0) == (pytest.approx(1), np.inf)


def test_ranks_of_point_contacts_by_hand() -> None:
    """Four contacts in no special place, no joints: by counting and by entries.

    Motions are known by d of contacts, or of the object; forces by (1), where others are of open contacts.
    """
    places = [[1, 2, 3], [-2, 1, 1.5], [1, -1.5, 2], [3, 1, -2]]
    normals = np.array([[1, 2, 2], [2, -1, 2], [2, 2, -1], [-2, 1, 2]]) / 3
    direction = [1, 2, 3, 1, 2, 3]
    q = question(
        [contact(p, n) for p, n in zip(places, normals, strict=True)], [0] * 6, LARGEST_GOAL, direction=direction
    )
    made = equations_of(q)
    n, scalar, every = made.columns.n, made.columns.scalar.start, [*range(6)]

    def d(*contacts: int) -> list[int]:
        return [n + 3 * k + i for k in contacts for i in range(3)]

    table: list[tuple[list[int], list[int], list[int], bool, list[int]]] = [
        # columns of rows, equalities, closed contacts, is the scalar known, ranks of motions and forces
        (2 * d(0), [], [], False, [3, 0]),
        (2 * d(0, 1), [], [], False, [5, 0]),
        (2 * d(0, 1, 2), [], [], False, [6, 0]),
        ([*d(0, 0), 0], [], [], False, [6, 0]),  # the object's motion besides
        (d(0), [], [], False, [3, 0]),
        (d(0)[:2], [], [], False, [2, 0]),
        ([*2 * d(0), *d(1)[:1]], [], [], False, [5, 0]),  # the other contact by one row alone
        ([], every, [0, 1], False, [0, 5]),
        ([], every, [0], False, [0, 3]),
        ([], every, [0, 1, 2], False, [0, 6]),
        ([6], every, [0, 1], False, [0, 6]),  # a force of contact 0 besides
        ([6, 6], every, [0], False, [0, 3]),
        ([6, 9, 12], every, [0, 1, 2], False, [0, 9]),
        ([6, 9, 9], every, [0, 1, 2], False, [0, 9]),  # by entries 8: two are about one force
        ([], every, [0, 1], True, [0, 6]),  # the load besides: torques about both contacts count
        ([scalar], every, [0, 1], True, [0, 6]),  # forces through two points have 5
        ([], every[:3], [0, 1], False, [0, 3]),
        (3 * [scalar], every[:3], [0, 1], True, [0, 4]),
        ([], every[1:], [0, 1], False, [0, 5]),
        ([*d(0), 6], every, [0, 1, 3], False, [3, 7]),
        (d(0)[:2], every, [0, 1], False, [2, 5]),
    ]
    value = np.zeros((sum(len(row[0]) for row in table), n + len(made.Z)))
    value[np.arange(len(value)), [column for row in table for column in row[0]]] = 1.0
    start, zero = np.cumsum([0, *(len(row[0]) for row in table)]), np.zeros((len(table), n), dtype=bool)
    for k, (_, _, closed, load, _) in enumerate(table):
        zero[k, made.columns.c] = np.repeat(~mask(4, *closed), 3)
        zero[k, scalar] = not load
    none = np.zeros(len(value), dtype=bool)
    cited = CitedRows(value, 0.0 * none, np.arange(len(value)), none, 1.0 + none, start, zero, none, none)
    found = LeafSystems(made, RightSide.of(q, (1.0, 2.0), 6), cited, np.inf)
    found._use(np.array([mask(6, *row[1]).astype(float) for row in table]))
    for by_entries in (False, True):
        wanted = [row[-1] for row in table]
        wanted[13] = [0, 8 if by_entries else 9]
        assert found._most_ranks(np.arange(len(table)), by_entries).tolist() == wanted
        assert found._most_ranks(np.array([7]), by_entries).tolist() == [table[7][-1]]


def test_multipliers_of_equalities_are_improved_once() -> None:
    """With an inverse that is too small by 2^-10, relative, what it leaves of the rest is 2^-20 of it."""
    found = walls_of([1, 0], wrench=[0, 1, 0, 0, 0, 0])
    found.rows.value[0, 6:12] = [1, 2, 3, 4, 5, 6]
    rough = replace(found.equations)
    rough.__dict__["inverse"] = found.equations.inverse * (1 - 2.0**-10)
    better = LeafSystems(rough, found.side, found.rows, np.inf)
    exact = -better.rest[0] @ found.equations.inverse
    np.testing.assert_allclose(better.stated_v[0], exact * (1 - 2.0**-20), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(better.stated_v[1], better.own_h * 2.0**-20, rtol=1e-6, atol=1e-15)  # (1) holds it all


def test_multipliers_in_rational_numbers_are_those_of_rows_in_their_own_units() -> None:
    """r_x >= 3 and 4 r_x >= 8 with 1 each, -r_x >= -1 with the 5 that cancels them: 6 of 16."""
    like = two_rows(0.0, 1)
    value = np.zeros((3, like.rows.value.shape[1]))
    value[:, 0] = [-1, 1, 4]
    found = a_leaf(like, value, np.array([-1.0, 3, 8]), np.array([4.9, 1, 1]), mask(3))
    found.basis, found.basis_E, found.columns = mask(3, 0), np.zeros_like(found.used_E), mask(13, 0)[None]
    assert exact_margin(found, 0) == (pytest.approx(6 / 16), np.inf)


def test_ranks_of_joints_soft_fingers_and_geared_motors_by_hand() -> None:
    """Four parallel joints before contact 0 move it in a plane; those before the soft finger 1 move it freely.

    The motor of the first joint turns half as fast: its effort is not put in. Two joints of each contact are coupled.
    """
    contacts = [contact([1, 2, 3], [1 / 3, 2 / 3, 2 / 3]), contact([-2, 1, 1.5], [2 / 3, -1 / 3, 2 / 3], torsion=0.1)]
    axes = [[0, 0, 1]] * 4 + [[0.6, 0.8, 0], [0, 0.6, 0.8], [0.8, 0, 0.6]]
    joints: list[dict[str, Any]] = [
        {"name": f"j{k}", "axis": axis, "origin": [k, 3 - k * k, 1], "moves": [int(k > 3)]}
        for k, axis in enumerate(axes)
    ]
    actuators = [{"name": j["name"], "joints": {j["name"]: 1.0 if k else 0.5}} for k, j in enumerate(joints)]
    q = question(
        contacts, [0] * 6, joints=joints, preload={j["name"]: 1.0 for j in joints},
        mechanism={"actuators": actuators, "couplings": [{"j1": 1.0, "j2": -1.0}, {"j4": 1.0, "j5": 1.0}]},
    )  # fmt: skip
    made = equations_of(q)
    at, n, wrench = made.columns, made.columns.n, [*range(6)]
    assert made.solved[0].tolist() == [*range(7, 13)]
    tie, other_tie, geared, turning, t = 13, 14, 6, n + len(made.Z) - 1, n + 6

    def d(*contacts: int) -> list[int]:
        return [n + 3 * k + i for k in contacts for i in range(3)]

    c = at.c.start
    table: list[tuple[list[int], list[int], list[int], bool, list[int]]] = [
        # columns of rows, equalities, closed contacts, is the torsion known, ranks of motions and forces
        (3 * d(0), [], [], False, [5, 0]),  # 6 of the object, less 3 turns, and 2 of the joints
        ([*3 * d(0), at.q.start], [], [], False, [6, 0]),  # a joint by itself, and 2 of the others
        ([*3 * d(0), t], [], [], False, [6, 0]),  # by its motor
        ([*3 * d(0), t + 4], [], [], False, [6, 0]),  # a joint of the other contact
        (3 * d(0), [tie], [], False, [7, 0]),  # two of them by their coupling, and 2 of the others
        (3 * d(0), [other_tie], [], False, [7, 0]),  # two joints of the other contact, by entries one
        (3 * d(1), [], [], False, [6, 0]),
        (3 * d(0, 1), [], [], False, [10, 0]),  # 5 of the object, 2 of four joints and all 3
        ([*3 * d(0), turning], [], [], False, [10, 0]),
        ([*5 * d(0), turning], [], [], False, [11, 0]),  # all of the object, 2 of four joints and all 3 by turning
        ([], wrench, [0, 1], False, [0, 5]),
        ([], wrench, [0, 1], True, [0, 6]),  # the torsion acts besides
        ([at.twist.start], wrench, [0, 1], True, [0, 6]),  # forces through two points have 5
        ([], [*wrench, geared], [0, 1], False, [0, 6]),
        ([c, c + 3], [*wrench, geared], [0, 1], False, [0, 7]),
        ([c, c + 3, at.f.start], [*wrench, geared], [0, 1], True, [0, 8]),
        ([c, c], [geared], [0, 1], False, [0, 3]),
    ]
    value = np.zeros((sum(len(row[0]) for row in table), n + len(made.Z)))
    value[np.arange(len(value)), [column for row in table for column in row[0]]] = 1.0
    start, zero = np.cumsum([0, *(len(row[0]) for row in table)]), np.zeros((len(table), n), dtype=bool)
    for k, (_, _, closed, twisted, _) in enumerate(table):
        zero[k, at.c] = np.repeat(~mask(2, *closed), 3)
        zero[k, at.twist] = not twisted
    none = np.zeros(len(value), dtype=bool)
    cited = CitedRows(value, 0.0 * none, np.arange(len(value)), none, 1.0 + none, start, zero, none, none)
    found = LeafSystems(made, RightSide.of(q, None, len(made.E)), cited, np.inf)
    found._use(np.array([mask(len(made.E), *row[1]).astype(float) for row in table]))
    wanted = [row[-1] for row in table]
    assert found._most_ranks(np.arange(len(table))).tolist() == wanted
    wanted[5], wanted[8], wanted[9] = (
        [6, 0],
        [9, 0],
        [9, 0],
    )  # by entries the three joints count once, as one row alone knows them
    wanted[16] = [0, 2]  # and what two rows say of one force once
    assert found._most_ranks(np.arange(len(table)), by_entries=True).tolist() == wanted


def test_multipliers_of_equalities_are_in_their_own_units_in_rational_numbers() -> None:
    """Walls at -4 and 4: (1) along y is -a - b = -1 of the two tangential forces, and about z 4 (a - b) = 0.

    Multiplied by 3 and by 1/4 they leave 2 and 4 for a >= 1 and b >= 1: 2 + 4 - 3 of 9.
    """
    like = walls_of([1], wrench=[0, 1, 0, 0, 0, 0], size=4.0)
    like.side = replace(like.side, slack=0 * like.side.slack, slip=0.0, energy=0.0)
    value = np.zeros((2, like.rows.value.shape[1]))
    value[[0, 1], [8, 11]] = 1.0
    found = a_leaf(like, value, np.ones(2), np.array([2.1, 4.1]), mask(2))
    assert found.equations.unit[5] == 4
    found.v = np.array([[0, 3.0, 0, 0, 0, 1.0]])
    found.used_E = found.v != 0
    found.basis, found.basis_E, found.columns = mask(2, 0, 1), mask(6)[None], mask(12, 8, 11)[None]
    assert exact_margin(found, 0) == (pytest.approx(3 / 9), np.inf)


def test_unknowns_and_equations_are_scaled_to_like_sizes() -> None:
    """The scalar's load is 8 N: (1) along x is c_n - c_n + 8 s, of which 8 s is the unknown. The lever is 4 m."""
    found = walls_of([1], [0, 0, 0, 0, 0, 2], goal=LARGEST_GOAL, direction=[8, 0, 0, 0, 0, 0], size=4.0)
    value = np.zeros((1, found.rows.value.shape[1]))
    value[0, 12] = 1.0
    one = a_leaf(found, value, np.ones(1), np.ones(1), mask(1))
    assert found.equations.scale[12] == 1 / 8
    assert one.E[0, [6, 9, 12]].tolist() == [1, -1, 1]
    assert one.E[5, [8, 11]].tolist() == [1, -1]
    assert one.E_largest[[0, 5]].tolist() == [1, 1]
    assert one.h[5] == -0.5
    assert one.E_touches[0].tolist() == mask(13, 6, 9, 12).tolist()
    assert (one.F[0, 12], one.unit[0], one.b[0], one.largest[0]) == (1, 1 / 8, 8, 1)
    assert one.stated[0] == 1  # of any size: the largest of a leaf is about 1


@pytest.mark.parametrize("step", ["_squares", "_choose", "_most_ranks"])
def test_no_step_goes_on_once_time_is_over(step: str) -> None:
    found, one = walls_of([1]), np.array([0])
    found.used = mask(1, 0)
    found.basis, found.basis_E, found.columns, found.more = mask(1), found.used_E, found.alive, np.zeros((2, 1), int)
    more = {"_choose": (1e-9,), "_most_ranks": (True,)}.get(step, ())
    getattr(found, step)(one, *more)
    found.until = -np.inf
    with pytest.raises(Late):
        getattr(found, step)(one, *more)


def test_rounding_is_that_of_as_many_terms_as_any_leaf_has() -> None:
    found = walls_of([5, 1, 3])
    terms = 5 + sum(found.E.shape) + len(found.equations.Z)
    assert found.error == ENTRY_ROUNDING + 4 * terms * UNIT_ROUNDOFF


# --- joints that something acts on, with a motor of their own


def with_idle_springs(seed: int) -> Certificate:
    """No cases and no rows: of a load that contact forces balance, beside joints that move nothing.

    Springs of 1 N m turn these, and motors of their own hold them. One motor drives two others.
    """
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(3, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    force = -normals + 0.3 * np.cross(normals, rng.normal(size=(3, 3)))
    w = np.concatenate([-force.sum(axis=0), -np.cross(0.03 * normals, force).sum(axis=0)])
    spots = zip((0.03 * normals).tolist(), normals.tolist(), strict=True)
    contacts = [{"position": p, "normal": n, "friction": 0.5, "link": ""} for p, n in spots]
    turning = {"type": "revolute", "axis": [0, 0, 1.0], "origin": [0.1, 0.2, 0]}
    idle = [{"name": f"x{k}", "moves": [], "torque": 1.0} | turning for k in range(2)]
    driven = [{"name": f"j{k}", "moves": [k]} | turning | {"axis": np.eye(3)[k].tolist()} for k in range(2)]
    motors = [{"name": f"mx{k}", "joints": {f"x{k}": 1.0}, "tendon": False} for k in range(2)]
    motors.append({"name": "drive", "joints": {"j0": 1.0, "j1": 2.0}, "tendon": False})
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": idle + driven}
    grasp |= {"mechanism": {"actuators": motors, "couplings": []}}
    return Certificate.of_root(read_question({"grasp": grasp, "goal": CHECK, "wrench": w.tolist()}, "q"), None)


def test_a_motor_takes_what_acts_on_its_joint_whatever_rounding_says_of_it() -> None:
    """The load is balanced: nothing contradicts itself."""
    for seed in range(60):
        done = verify(with_idle_springs(seed))
        assert not done.ok or (done.cap is not None and done.cap < 1.0), seed  # [N]; forces of 1 N press


def test_multipliers_of_what_nothing_looks_at_prove_nothing() -> None:
    """1e-17 at the equation of an idle joint, times its torque, is more than 0, but its motor takes the torque."""
    c = with_idle_springs(0)
    q = equations_of(c.question)
    cases = np.zeros((1, c.question.grasp.m + c.question.actuators, 3), dtype=np.int64)
    side = RightSide.of(c.question, None, len(q.E))
    found = LeafSystems(q, side, checked_rows(c, cases, np.arange(1)), np.inf)
    found._begin()
    rows, efforts = q.solved
    assert len(rows) == 2
    found.v[:], found.basis_E[:], found.columns[:] = 0.0, False, False
    for sense in (1.0, -1.0):
        found.v[0, rows[0]] = sense * 1e-17
        assert exact_margin(found, 0) == leaves.UNBOUNDED_RANGE
    found._use(np.full((1, len(q.E)), 1e-3))
    assert (found.v[0, rows] == 0).all()
    assert not found.alive[0, efforts].any()
