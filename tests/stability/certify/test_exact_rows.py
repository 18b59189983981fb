"""Leaves in rational arithmetic: hand-made systems whose margins are fractions, and the equations as fractions."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.stability.certify.certificate import Columns
from handfast.stability.certify.exact_rows import ExactRows, _independent
from handfast.stability.certify.leaf_rows import LeafRows
from tests.support.certificates import exact_equations
from tests.support.rounding_edges import QUESTIONS, leaf

THIRD = 1 / 3  # a float, a little below a third


def fractions(row: Any) -> dict[int, Fraction]:
    return {int(i): Fraction(int(x.p), int(x.q)) for i, x in row.items() if x != 0}


@pytest.mark.parametrize("name", QUESTIONS)
def test_equalities_and_motions_are_fractions(name: str) -> None:
    """Of positions, axes and frames as they are: not one is rounded."""
    question, _ = QUESTIONS[name]
    found = ExactRows.of(question)
    E, _, Z = exact_equations(question)
    assert found.n == Columns.of(question).n
    for mine, theirs in ((found.E, E), (found.Z, Z)):
        assert [fractions(x) for x in mine] == [{k: Fraction(v) for k, v in x.items() if v} for x in theirs]


def margin(
    rows: Any, w: Any, b: Any, *, B: Any = None, equalities: Any = (), Z: Any = (), unknowns: int = 1, **more: Any
) -> float:
    """Of a leaf with these exact rows over (x, motions), and equalities; B is what rounding makes of them."""
    value = np.array(rows, dtype=float).reshape(-1, unknowns + len(Z))
    E = [{i: fmpq(*float(x).as_integer_ratio()) for i, x in enumerate(row) if x} for row in equalities]
    motions = [{i: fmpq(*float(x).as_integer_ratio()) for i, x in enumerate(row) if x} for row in Z]
    if B is None:
        given = value[:, :unknowns] + value[:, unknowns:] @ np.array(Z, dtype=float).reshape(-1, unknowns)
        B = np.vstack([given, np.array(equalities, dtype=float).reshape(-1, unknowns)])
    system = leaf(B, w, b, equalities=len(E), **more)
    exact = ExactRows(E, motions, unknowns)
    return exact.margin(system, 0, LeafRows(value, np.zeros(len(value)), np.zeros(len(value), bool)))


def test_a_contradiction_without_rounding() -> None:
    """x >= 1 and -x >= -beta at the edge: one float of beta decides."""
    pair = [[1.0], [-1.0]], [1.0, 1.0]
    assert margin(*pair, [1.0, 0.0]) == 1.0
    assert margin(*pair, [1.0, -np.nextafter(1.0, 0.0)]) > 0
    assert margin(*pair, [1.0, -1.0]) == -np.inf
    assert margin(*pair, [1.0, -np.nextafter(1.0, 2.0)]) == -np.inf
    assert margin(*pair, [1.0, -0.25]) == 0.75 / 1.25


def test_multipliers_are_made_exact() -> None:
    """3 x >= 1 weighed by a float that is not a third, and -x >= 0: the heavier row's multiplier follows."""
    assert margin([[3.0], [-1.0]], [THIRD, 1.0], [1.0, 0.0], free=[True, False]) == 1.0
    for error in (0.0, 1e-3):  # which bounds other arithmetic
        assert margin([[3.0], [-1.0]], [THIRD, 1.0], [1.0, -0.25], error=error) == pytest.approx(1 / 7, rel=1e-15)


def test_a_multiplier_below_zero_is_none() -> None:
    """x >= 1 and x >= 0 cancel with opposite weights only: an equation may have them, an inequality may not."""
    rows, w = [[1.0], [1.0]], [1.0, 1e-9]
    assert margin(rows, w, [0.5, 1.0], free=[False, False]) == -np.inf
    assert margin(rows, w, [0.5, 1.0], free=[False, True]) == -np.inf
    assert margin(rows, [1.0, -1.0], [1.0, 0.5], free=[False, True]) == pytest.approx(0.5 / 1.5)
    assert margin(rows, [1.0, -1.0], [0.5, 1.0], free=[False, True]) == -np.inf  # the wrong way round


def test_ranks_that_are_lost_are_no_matter() -> None:
    """x + y >= 1, -x - y >= 0: two unknowns, one rank. One float of difference between columns, and nothing cancels."""
    sums = [[1.0, 1.0], [-1.0, -1.0]]
    assert margin(sums, [1.0, 1.0], [1.0, 0.0], unknowns=2) == 1.0
    for place in (0, 1):
        off = np.array(sums)
        off[1, place] = -np.nextafter(1.0, 0.0)
        assert margin(off, [1.0, 1.0], [1.0, 0.0], unknowns=2) == -np.inf


def test_what_rounding_shows_is_not_what_counts() -> None:
    """B is rounded: it says which rows to solve for, no more."""
    pair = [[1.0], [-1.0]]
    assert margin([[1.0], [1.0]], [1.0, 1.0], [1.0, 0.0], B=pair, free=[False, False]) == -np.inf
    assert margin(pair, [1.0, 1.0], [1.0, 0.0], B=[[1.0], [-1.5]]) == 1.0
    assert margin([[0.0], [-1.0]], [1.0, 1.0], [1.0, 0.0], B=pair) in (-np.inf, 1.0)  # singular where B is not
    assert margin([[0.0], [-1.0]], [1.0, 1.0], [0.0, 1.0], B=pair) == -np.inf


def test_rows_of_motions() -> None:
    """d >= 1 and -x - y >= 0, with d = x + y, and a third motion besides: through Z, added to what x has itself."""
    Z = [[0.5, 1.0], [4.0, 4.0], [0.5, 0.0]]
    rows = [[0.5, 0.0, 1.0, 0.0, 0.0], [-1.0, -1.0, 0.0, 0.0, 0.0]]
    assert margin(rows, [1.0, 1.0], [1.0, 0.0], Z=Z, unknowns=2) == 1.0
    rows = [[0.0, 0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, -0.25, 0.0]]
    assert margin(rows, [1.0, 1.0], [1.0, 0.0], Z=Z, unknowns=2) == 1.0


def test_equalities_of_the_question() -> None:
    """x >= 1 with 2 x - y = 0 and y = 0.25: v = -1/2, -1/2, also where the file gives the second no weight."""
    E = [[2.0, -1.0], [0.0, 1.0]]
    for second in (-0.5, -0.4, 0.0):
        found = margin([[1.0, 0.0]], [1.0, -0.5, second], [1.0, 0.0, 0.25], equalities=E, unknowns=2)
        assert found == pytest.approx(0.875 / 1.125, rel=1e-15)
    # an inequality without weight is not tried
    rows = [[1.0, 0.0], [2.0, -1.0], [0.0, 1.0]]
    assert margin(rows, [1.0, -0.5, 0.0], [1.0, 0.0, 0.25], unknowns=2) == -np.inf


def test_forces_of_open_contacts_need_not_cancel() -> None:
    """Their columns are 0 in B, and not in the exact rows."""
    rows, B = [[1.0, 3.0], [-1.0, 5.0]], [[1.0, 0.0], [-1.0, 0.0]]
    assert margin(rows, [1.0, 1.0], [1.0, 0.0], B=B, closed=[True, False], unknowns=2) == 1.0
    assert margin(rows, [1.0, 1.0], [1.0, 0.0], B=B, closed=[True, True], unknowns=2) == -np.inf


def test_units_of_rows() -> None:
    """Rows were divided by powers of two: multipliers and right-hand sides belong to the divided ones."""
    rows, unit = [[4.0], [-0.5]], [4.0, 0.5]
    of = {"B": [[1.0], [-1.0]], "unit": unit}
    assert margin(rows, [1.0, 1.0], [1.0, -0.25], **of) == 0.75 / 1.25
    assert margin(rows, [1.0, 1.0], [1.0, 0.0], **of, slack=[0.25, 0.125]) == 0.625


@pytest.mark.parametrize(("ends", "far"), [((2.0, 5.0), 5.0), ((-7.0, 5.0), 7.0), ((0.0, np.inf), np.inf)])
def test_what_may_be_missed(ends: tuple[float, float], far: float) -> None:
    """Slack of each row, and growth up to the farther end of the scalar, as nothing pushes at the first."""
    pair = [[1.0], [-1.0]], [1.0, 1.0], [64.0, 0.0]
    assert margin(*pair, slack=[1.0, 2.0], ends=ends) == 61 / 64
    expected = (64 - 3 * far) / 64 if np.isfinite(far) else -np.inf
    assert margin(*pair, growth=[2.0, 1.0], ends=ends) == expected


def test_where_the_first_end_is_worst_without_rounding() -> None:
    """Its multipliers have to be as large at least as what may be missed grows: 1 or 2 in units of the rows."""
    pair = [[4.0], [-4.0]], [1.0, 1.0], [64.0, 0.0]
    of = {"B": [[1.0], [-1.0]], "unit": [4.0, 4.0], "ends": (0.5, 3.0)}
    for first, push in (([True, False], 0.25), ([False, True], 0.25), ([True, True], 0.5)):
        assert margin(*pair, **of, first=first, growth=[0.0, push]) == (64 - 0.5 * push) / 64
        more = float(np.nextafter(push, 1.0))
        assert margin(*pair, **of, first=first, growth=[0.0, more]) == pytest.approx((64 - 3 * push) / 64, rel=1e-12)
    endless = of | {"ends": (0.5, np.inf)}
    assert margin(*pair, **endless, first=[True, False], growth=[0.125, 0.125]) == (64 - 0.125) / 64
    assert margin(*pair, **endless, first=[True, False], growth=[0.125, 0.126]) == -np.inf


def test_nothing_proves_nothing() -> None:
    """No unknown at all, and no right-hand side; numbers that are none."""
    assert margin([[0.0], [0.0]], [1.0, 2.0], [1.0, -0.25]) == 0.5 / 1.5
    assert margin([[1.0], [-1.0]], [1.0, 1.0], [0.0, 0.0]) == -np.inf
    for wrong in (np.inf, np.nan):
        assert margin([[1.0], [-1.0]], [1.0, wrong], [1.0, 0.0]) == -np.inf
        assert margin([[1.0], [-1.0]], [1.0, 1.0], [1.0, 0.0], B=[[wrong], [-1.0]]) == -np.inf


def test_the_leaf_that_is_asked_for() -> None:
    """Of two leaves that cite rows of their own."""
    first = leaf([[1.0], [-1.0]], [1.0, 1.0], [1.0, 0.0])
    second = leaf([[1.0], [-1.0]], [1.0, 1.0], [1.0, -0.25], slack=[0.25, 0.0])
    names = ("B", "size", "w", "free", "b", "slack", "growth", "first", "unit", "index", "closed")
    both = replace(first, **{n: np.concatenate([getattr(first, n), getattr(second, n)]) for n in names})
    both = replace(both, index=np.array([[0, 1], [2, 3]]))
    rows = LeafRows(np.array([[1.0], [-1.0], [3.0], [-3.0]]), np.zeros(4), np.zeros(4, bool))
    exact = ExactRows([], [], 1)
    assert [exact.margin(both, k, rows) for k in (0, 1)] == [1.0, 0.5 / 1.25]


def test_independent_columns() -> None:
    """The largest first, of what the others leave; not one that is a sum of others but for rounding."""
    A = np.array([[1.0, 3.0, 0.0, 4.0], [0.0, 0.0, 2.0, 2.0], [0.0, 0.0, 0.0, 0.0]])
    assert _independent(A) == [3, 2]  # (4, 2), which leaves 1.8 of (0, 2) and 1.3 of (3, 0)
    assert _independent(A[:, :3]) == [1, 2]
    assert _independent(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-12]])) == [1]
    assert sorted(_independent(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-6]]))) == [0, 1]
    for small, count in ((2e-9, 2), (0.5e-9, 1)):
        assert len(_independent(np.array([[100.0, 0.0], [0.0, 100 * small]]))) == count
    assert _independent(np.zeros((2, 2))) == []
    before = A.copy()
    _independent(A)
    assert (before == A).all()
