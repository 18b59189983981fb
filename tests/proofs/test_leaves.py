"""Square systems: inverses where there are some, pivots, values in their places."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.proofs.cases import CLOSED, OPEN
from handfast.proofs.certificate import Certificate
from handfast.proofs.checker import verify
from handfast.proofs.kinds import Row
from handfast.proofs.leaves import _compact, _inverse, _pivots
from tests.support.proof_states import pinch


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


@pytest.mark.parametrize("values", [np.array([5, 6, 7]), np.array([[5, 6, 7], [5, 6, 7], [5, 6, 7]])])
def test_values_that_are_there_in_their_order(values):
    there = np.array([[True, False, True], [False, False, False], [True, True, True]])
    assert _compact(there, values, 3, 9).tolist() == [[5, 7, 9], [9, 9, 9], [5, 6, 7]]
    assert _compact(there, values, 2, 9).tolist() == [[5, 7], [9, 9], [5, 6]]


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
