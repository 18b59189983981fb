"""Square systems: inverses where there are some, pivots, values in their places."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.proofs.leaves import _compact, _inverse, _pivots


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
