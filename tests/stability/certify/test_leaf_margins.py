"""Version 1 at the edge of rounding: margins of leaves whose coefficients are known to 1 %, derived by hand.

The relative error of sums is 1e-13 in truth; here it is made so large that every part of the bound can be seen.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.certify.certificate import Certificate, Columns, Question, Row, directions
from handfast.stability.certify.claim import (
    Claim,
    _of_directions,
    equality_multipliers,
    leaf_margins,
    weighed_rows,
)
from handfast.stability.certify.leaf_rows import UNIT
from handfast.stability.goal import LARGEST
from tests.support.certificates import AS_WRITTEN, TURN, UNIT_LENGTHS, Known, empty, row
from tests.support.rounding_edges import QUESTIONS, REFERENCES

JUST = 1e-6  # relative: how far a planted case is from its edge
CAP_R, CAP_Q = np.array([0.3, 0.5, 0.2, 7.0, 9.0, 8.0]), np.array([4.0, 3.0, 0.6])


def cited(question: Question, scalar: Any, names: Any, y: Any) -> tuple[Certificate, Claim]:
    """A root that cites rows, and its claim."""
    c = empty(question, scalar, names, y, REFERENCES, (CAP_R, CAP_Q))
    return c, Claim.of(c)


ROWS = [(Row.CN_UP, 0, 0, 0), (Row.TANGENT, 1, TURN // 7, 0), (Row.GAP_UP, 2, 5, TURN // 9), (Row.E_UP, 0, 0, 0)]
ROWS += [(Row.CHORD, 2, 0, TURN // 5), (Row.T_UP, 2, 0, 0), (Row.D_LEFT, 1, 9, 0), (Row.BOUND_DOWN, 9, 0, 0)]
WEIGHTS = [0.5, 1.25, 0.3, 0.9, 0.7, 0.2, 1.6, 0.4]


@pytest.mark.parametrize("name", ["check", "turned", "preload"])
def test_weighed_rows(name: str) -> None:
    """Sums over the rows, and over their absolute values: of each leaf its own."""
    question, scalar = QUESTIONS[name]
    names, y = [*ROWS, *ROWS[:3]], np.array([*WEIGHTS, 0.6, 0.8, 1.1])
    one, claim = cited(question, scalar, names, y)
    c = replace(one, leaves=np.array([0, 0, 0]), start=np.array([0, 8, 8, 11]))
    S, size, b, b_size = weighed_rows(c, claim)
    known, wide = Known.of(one), _of_directions(one, claim.columns)
    expected = np.zeros((4, 3, S.shape[1]))
    for r, of in enumerate(names):
        k = 0 if r < 8 else 2
        entries, right = row(one, claim, *of, replace(AS_WRITTEN, wider=0))
        for place, value in entries.items():
            expected[0, k, place] += y[r] * float(value)
            expected[1, k, place] += y[r] * abs(float(value))
        expected[1, k] += y[r] * wide[r]
        expected[2, k, 0] += y[r] * float(right)
        expected[3, k, 0] += y[r] * abs(float(right))
    assert known.columns.n < S.shape[1]
    np.testing.assert_allclose(S, expected[0], atol=1e-13)
    np.testing.assert_allclose(size, expected[1], atol=1e-13)
    np.testing.assert_allclose(b, expected[2, :, 0], atol=1e-13)
    np.testing.assert_allclose(b_size, expected[3, :, 0], atol=1e-13)


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_float_directions_add(name: str) -> None:
    """Rows with directions of exactly unit length differ by less than 256 u of what is added to the sizes."""
    question, scalar = QUESTIONS[name]
    eta, mu = question.eta, question.grasp.mu
    names = [(kind, i, a, a + TURN // 3) for kind in Row if kind < Row.STILL_1_UP for i, a in ((0, 7), (2, TURN // 7))]
    names += [(kind, 1, 0, 0) for kind in (Row.STILL_1_UP, Row.T_DOWN, Row.E_UP)]
    c, claim = cited(question, scalar, names, np.ones(len(names)))
    at = claim.columns
    found = _of_directions(c, at)
    wide = 0.5**-1.5  # 1 + cos 120 deg
    expected = np.zeros_like(found)
    for r, (kind, i, *_) in enumerate(names):
        force, motion = at.c.start + 3 * i, at.n + 3 * i
        if kind is Row.TANGENT:
            expected[r, force] = mu[i]
        elif kind is Row.CHORD:
            expected[r, force] = mu[i] * wide
        elif kind in (Row.GAP_UP, Row.DN_UP):
            expected[r, motion + 1 : motion + 3] = np.sin(eta) * wide
        elif kind is Row.GAP_DOWN:
            expected[r, motion + 1 : motion + 3] = np.sin(eta)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-15)
    for r, of in enumerate(names):
        true, _ = row(c, claim, *of, UNIT_LENGTHS)
        mine, _ = row(c, claim, *of, replace(AS_WRITTEN, wider=0))
        for place, value in true.items():
            of_its_size = abs(Fraction(mine[place])) + Fraction(float(expected[r, place]))
            assert abs(Fraction(value) - Fraction(mine[place])) <= 256 * Fraction(UNIT) * of_its_size + Fraction(
                1, 2**70
            )
    wide_open = empty(question, scalar, [(Row.CHORD, 0, 0, TURN // 2)], [1.0], REFERENCES, (CAP_R, CAP_Q))
    assert np.isfinite(_of_directions(wide_open, at)).all()
    U = directions(np.array([7]))
    assert np.abs(U).max() < 1


def table_leaf(slack: float = 0.0, growth: float = 0.0, error: float = 0.0, **more: Any) -> float:
    """The margin of a leaf of one contact, of which a claim of two equalities is made up by hand.

    c_n >= 0 of the row weighed by 2, and c_n = -1, c_n + 3 f = 5 with |c_n| <= 10, f in [-2, 1], and nothing else.
    """
    g = Grasp([Contact([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.0)])
    goal = more.pop("goal", None)
    question = Question(g, goal, direction=np.eye(6)[0]) if goal else Question(g)
    scalar = more.pop("scalar", None)
    names, y = more.pop("rows", ([(Row.CN_UP, 0, 0, 0)], [2.0]))
    c = empty(question, scalar, names, y, caps=(np.ones(6), np.zeros(0)))
    claim, n = Claim.of(c), Columns.of(question).n
    at = claim.columns
    lo, hi, E = np.zeros(n), np.zeros(n), np.zeros((2, n))
    lo[at.c.start], hi[at.c.start] = -10.0, 10.0
    lo[0], hi[0] = -2.0, 1.0
    E[0, at.c.start], E[1, at.c.start], E[1, 0] = 1.0, 1.0, 3.0
    if scalar:
        lo[at.scalar], hi[at.scalar] = scalar
    given = {"lo": lo, "hi": hi, "E": E, "h": np.array([-1.0, 5.0]), "error": error, "Z": np.zeros((3, n))} | more
    claim = replace(claim, **given, slack=np.array([slack, 0.0]), growth=np.array([growth, 0.0]))
    return float(leaf_margins(c, claim)[0])


def test_the_margin_of_a_leaf() -> None:
    """v = (-2, 0) cancels: y b + v h = 2 of |v||h| = 2."""
    assert table_leaf() == pytest.approx(1.0, rel=1e-9)


def test_a_leaf_at_the_edge_of_rounding() -> None:
    """The row and the equation are off by e of their sizes, 2 + 2 + 2, where |c_n| <= 10, and the sums by e (2).

    What is lost: 2 (e (2 (the row's sum) + 2 (rho before) + 2 (v E)) 10 + 2 e) = 124 e of 2, so that e = 1/62 is the
    edge; a row off by 1 % and an equation off by 1 % alone would take 0.4.
    """
    for e in (1e-3, 1e-2):
        assert table_leaf(error=e) == pytest.approx((2 - 124 * e) / 2, rel=1e-6)
    assert table_leaf(error=(1 - JUST) / 62) > 0
    assert not table_leaf(error=(1 + JUST) / 62) > 0


def test_rows_of_motions_are_rounded_twice() -> None:
    """d_t1 >= 0 in place of c_n >= 0, where Z says d_t1 = c_n: no less is lost."""
    Z = np.zeros((3, 9))
    Z[1, 6] = 1.0
    row = [(Row.STILL_1_UP, 0, 0, 0)], [2.0]
    for e in (0.0, 1e-3, 1e-2):
        assert table_leaf(rows=row, Z=Z, error=e) == pytest.approx((2 - 124 * e) / 2, rel=1e-6)


def test_a_leaf_without_rows_beside_others() -> None:
    """It says nothing, wherever it stands, also where something may be missed."""
    question, scalar = QUESTIONS["preload"]
    c, claim = cited(question, scalar, ROWS, WEIGHTS)
    alone = float(leaf_margins(c, claim)[0])
    for start, place in (([0, 8, 8, 8], 0), ([0, 0, 8, 8], 1), ([0, 0, 0, 8], 2)):
        found = leaf_margins(replace(c, leaves=np.array([0, 0, 0]), start=np.array(start)), claim)
        assert found[place] == pytest.approx(alone, rel=1e-9)
        assert not (np.delete(found, place) > 0).any()


def test_what_may_be_missed_at_the_edge() -> None:
    """|v| slack (1 + e): 2 of slack 1 are all there is."""
    assert table_leaf(slack=0.25) == pytest.approx(0.75, rel=1e-9)
    assert table_leaf(slack=1 - JUST) > 0
    assert not table_leaf(slack=1 + JUST) > 0
    assert table_leaf(slack=0.25, error=0.01) == pytest.approx((2 - 1.24 - 0.5 * 1.01) / 2, rel=1e-6)


def test_what_rows_leave_over_is_taken_at_its_worst() -> None:
    """Without equalities the row stands alone: 2 c_n over [-3, 4] is 8 at most, over 2 x 4 involved."""
    n = 9
    of = {"E": np.zeros((2, n)), "h": np.zeros(2)}
    lo, hi = np.zeros(n), np.zeros(n)
    lo[6], hi[6] = -3.0, 4.0
    assert table_leaf(**of, lo=lo, hi=hi) == pytest.approx(-1.0)
    lo[6], hi[6] = -4.0, -3.0  # 2 c_n >= 0 is false: by 6 of 8
    assert table_leaf(**of, lo=lo, hi=hi) == pytest.approx(0.75)
    assert table_leaf(**of, lo=lo, hi=hi, error=0.01) == pytest.approx((6 - 2 * (0.04 * 4 + 0.08)) / 8, rel=1e-6)
    lo[4], hi[4] = -np.inf, np.inf  # of which no row speaks
    assert table_leaf(**of, lo=lo, hi=hi) == pytest.approx(0.75)
    hi[6] = np.inf  # nothing bounds it: not even by rounding
    assert table_leaf(**of, lo=lo, hi=hi) == -np.inf


SCALED = {"goal": LARGEST}


@pytest.mark.parametrize(("scalar", "far"), [((0.5, 3.0), 3.0), ((-4.0, 3.0), 4.0), ((-2.0, -1.0), 2.0)])
def test_what_grows_counts_at_the_farther_end(scalar: tuple[float, float], far: float) -> None:
    for e, lost in ((0.0, 0.0), (1e-3, 0.124)):
        expected = (2 - lost - 2 * 0.01 * far * (1 + e)) / 2
        assert table_leaf(growth=0.01, scalar=scalar, error=e, **SCALED) == pytest.approx(expected, rel=1e-6)


def test_where_the_first_end_pushes() -> None:
    """Rows c_n and s >= 1, weighed by 2 and 0.5, and an equality s = 1 - 0.1 for the second: what is missed grows by
    2 x growth for each unit of s, of which the first end's multiplier takes 0.5."""

    def of(growth: float, error: float = 0.0, scalar: tuple[float, float] = (1.0, 3.0)) -> float:
        rows = [(Row.CN_UP, 0, 0, 0), (Row.BOUND_UP, 9, 0, 0)], [2.0, 0.5]
        E, lo, hi = np.zeros((2, 10)), np.zeros(10), np.zeros(10)
        E[0, 6], E[1, 9] = 1.0, 1.0
        lo[6], hi[6], lo[9], hi[9] = -10.0, 10.0, *scalar
        return table_leaf(
            growth=growth, error=error, scalar=scalar, rows=rows, E=E, lo=lo, hi=hi, h=np.array([-1.0, 0.9]), **SCALED
        )

    # 2 + 0.5 (1 - 0.9), of 2 + 0.5 + 0.45
    plain, involved = 2.05, 2.95
    assert of(0.0) == pytest.approx(plain / involved, rel=1e-9)
    for growth, most in ((0.1, 0.2 * 1), (0.25, 0.5 * 1), (0.3, 0.6 * 3 - 0.5 * 2), (1.0, 2.0 * 3 - 0.5 * 2)):
        assert of(growth) == pytest.approx((plain - most) / involved, rel=1e-9)
    # e = 1 % of the multiplier, and of what grows
    lost = 2 * (0.01 * 6 * 10 + 0.01 * 1.5 * 3 + 0.01 * involved)
    most = 0.6 * 1.01 * 3 - 0.5 * 0.99 * 2
    assert of(0.3, error=0.01) == pytest.approx((plain - lost - most) / involved, rel=1e-6)
    # a range that begins below 0
    involved, plain = 2 + 0.5 * 2 + 0.45, 2 - 1.0 - 0.45
    assert of(0.05, scalar=(-2.0, 3.0)) == pytest.approx((plain - 0.1 * 2) / involved, rel=1e-9)
    assert of(0.35, scalar=(-2.0, 3.0)) == pytest.approx((plain - 0.7 * 2) / involved, rel=1e-9)


def test_other_bounds_push_nothing() -> None:
    """The row c_n >= lo is a first end, but not the scalar's; s <= hi is the scalar's last."""
    n = 10
    E, lo, hi = np.zeros((2, n)), np.zeros(n), np.zeros(n)
    E[0, 6], E[1, 9] = 1.0, 1.0
    lo[6], hi[6], lo[9], hi[9] = -10.0, 10.0, 1.0, 3.0
    of = {"scalar": (1.0, 3.0), "E": E, "lo": lo, "hi": hi, **SCALED}
    for name, h in (((Row.BOUND_UP, 6, 0, 0), [-12.0, 0.0]), ((Row.BOUND_DOWN, 9, 0, 0), [0.0, 4.0])):
        rows = [name], [2.0]
        without = table_leaf(rows=rows, h=np.array(h), **of)
        grown = table_leaf(rows=rows, h=np.array(h), growth=0.0, **of)
        assert without == grown > 0
        if name[0] is Row.BOUND_UP:
            involved = 2 * 10 + 2 * 12
            assert table_leaf(rows=rows, h=np.array(h), growth=0.1, **of) == pytest.approx(
                (4 - 2 * 0.1 * 3) / involved, rel=1e-9
            )


def test_multipliers_of_equalities_make_what_is_left_small() -> None:
    """Each unknown by its reach: those without bound do not count, those that stand still hardly."""
    question, scalar = QUESTIONS["preload"]
    c, claim = cited(question, scalar, ROWS, WEIGHTS)
    n = claim.columns.n
    S = weighed_rows(c, claim)[0]
    rho = S[:, :n] + S[:, n:] @ claim.Z
    v = equality_multipliers(rho, claim)
    weight = np.where(np.isfinite(claim.reach), claim.reach / claim.reach[np.isfinite(claim.reach)].max() + 1e-9, 0.0)
    left = (rho + v @ claim.E) * weight
    assert np.abs(left @ (claim.E * weight).T).max() < 1e-12 * np.abs(rho * weight).max()


def test_equalities_that_say_nothing() -> None:
    """A row of zeros has no multiplier, and no unknown is bounded: no number that is none."""
    question, _ = QUESTIONS["check"]
    _, claim = cited(question, None, ROWS[:1], WEIGHTS[:1])
    n = claim.columns.n
    E = np.zeros((3, n))
    E[0, 3], E[1, 4] = 5.0, 1e-6
    rho = np.zeros((2, n))
    rho[0, 3], rho[1, 4] = 10.0, 3.0
    v = equality_multipliers(rho, replace(claim, E=E))
    np.testing.assert_allclose(v, [[-2.0, 0.0, 0.0], [0.0, -3e6, 0.0]], rtol=1e-9, atol=1e-9)
    v = equality_multipliers(rho, replace(claim, E=E, lo=np.full(n, -np.inf), hi=np.full(n, np.inf)))
    assert np.isfinite(v).all()
    still = equality_multipliers(rho, replace(claim, E=E, lo=np.zeros(n), hi=np.zeros(n)))
    np.testing.assert_allclose(still, [[-2.0, 0.0, 0.0], [0.0, -3e6, 0.0]], rtol=1e-9, atol=1e-9)
