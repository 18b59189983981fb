"""From a certificate to the systems of its leaves: every number, against exact rows and equalities."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.certify.certificate import Certificate, Columns, Question, Row
from handfast.stability.certify.leaf_rows import UNIT, bounds, rows_of
from handfast.stability.certify.leaf_systems import LeafSystems, SharedSystem
from tests.support.certificates import (
    AS_WRITTEN,
    CLOSED,
    FREE,
    LOCKED,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN,
    UNDECIDED,
    Known,
    empty,
    exact_equations,
    row,
)
from tests.support.rounding_edges import QUESTIONS

ROWS = [(Row.BOUND_UP, 22, 0, 0), (Row.CN_UP, 0, 0, 0), (Row.GAP_UP, 1, 5, 900), (Row.TANGENT, 2, TURN // 7, 0)]
ROWS += [(Row.BOUND_DOWN, 22, 0, 0), (Row.T_UP, 1, 0, 0), (Row.T_UP, 0, 0, 0), (Row.E_UP, 0, 0, 0)]
ROWS += [(Row.BOUND_UP, 9, 0, 0), (Row.CHORD, 2, 0, TURN // 5), (Row.BOUND_UP, 22, 0, 0), (Row.D_LEFT, 0, 9, 0)]
WEIGHTS = [0.5, 1.25, 30.0, 0.9, 0.7, 0.2, 1.6, 0.4, 0.0, 2.5, 3.5, 0.8]
CASES = np.zeros((3, 6, 3), dtype=np.int64)
CASES[0, :, 0] = OPEN, SLIDE, STICK, FREE, FREE, FREE
CASES[1, :, 0] = CLOSED, OPEN, OPEN, LOCKED, FREE, MOVES
CASES[2, :, 0] = STICK, CLOSED, UNDECIDED, MOVES, FREE, LOCKED
STARTS = [0, 5, 5, 12]


def systems(name: str, chosen: tuple[int, ...] = (2, 0, 1), whole: bool = False):
    """The certificate with leaves of seven rows, none and five, in this order, and their systems."""
    question, scalar = QUESTIONS[name]
    at = Columns.of(question)
    scalar_at = {22: at.scalar.start if scalar else at.c.start}
    names = [(kind, scalar_at.get(i, i), a, b) for kind, i, a, b in ROWS]
    names = [(Row.CN_UP, 1, 0, 0) if kind is Row.BOUND_DOWN and not scalar else (kind, *of) for kind, *of in names]
    one = empty(question, scalar, names, WEIGHTS)
    c = replace(one, leaves=np.zeros(3, dtype=np.int64), start=np.array(STARTS))
    states = np.repeat(CASES[:, :, 0], np.diff(STARTS), axis=0)
    rows = rows_of(c, states, *bounds(question, scalar))
    shared = SharedSystem.of(question)
    return c, rows, shared, LeafSystems.of(c, rows, shared, CASES, np.array(chosen), whole=whole)


@pytest.mark.parametrize("name", QUESTIONS)
def test_systems_of_leaves(name: str) -> None:
    """Rows, then equalities: of the exact ones, times powers of two, to the error; nothing where there is no row."""
    c, rows, shared, s = systems(name)
    question, scalar = QUESTIONS[name]
    at, known = Columns.of(question), Known.of(c)
    E, h, Z = exact_equations(question)
    k, p, n = 7, len(E), at.n
    assert s.B.shape == s.size.shape == (3, k + p, n)
    assert s.error == (64 + 4 * (k + p + n + 9)) * UNIT
    assert s.ends == (scalar or (0.0, 0.0))
    assert s.index.tolist() == [[*range(5, 12)], [*range(5), -1, -1], [-1] * 7]
    for i, original in enumerate((2, 0, 1)):
        opened = {at.c.start + 3 * j + axis for j in range(3) if CASES[original, j, 0] == OPEN for axis in range(3)}
        assert s.closed[i].tolist() == [column not in opened for column in range(n)]
        for place in range(k + p):
            number = int(s.index[i, place]) if place < k else None
            if number == -1:
                assert not s.B[i, place].any()
                assert (s.w[i, place], s.b[i, place], s.free[i, place]) == (0, 0, False)
                assert not s.first[i, place]
                continue
            entries, right = (E[place - k], h[place - k]) if number is None else exact_row(c, known, Z, number, n)
            unit = s.unit[i, place]
            assert np.log2(unit) == np.round(np.log2(unit))
            largest = 0.0
            for column in range(n):
                value = 0.0 if column in opened else float(entries.get(column, 0)) * shared.scale[column] / unit
                assert abs(s.B[i, place, column] - value) <= s.error * s.size[i, place, column]
                assert abs(value) <= s.size[i, place, column] * (1 + 1e-12)
                assert column not in opened or s.size[i, place, column] == 0
                largest = max(largest, abs(value))
            assert (largest == 0 and unit == 1) or 0.7 <= largest <= 1.42
            assert s.size[i, place].max() < 40
            assert s.b[i, place] * unit == pytest.approx(float(right), rel=1e-14)
            if number is not None:
                assert s.free[i, place] == rows.either[number]
                heaviest = max(WEIGHTS[STARTS[original] : STARTS[original + 1]])
                assert s.w[i, place] == pytest.approx(WEIGHTS[number] * unit / heaviest, rel=1e-14)
                of_scalar = c.kind[number] == Row.BOUND_UP and c.index[number] == at.scalar.start
                assert s.first[i, place] == of_scalar
                assert (s.slack[i, place], s.growth[i, place]) == (0, 0)
            else:
                assert s.free[i, place]
                assert not s.first[i, place]
                assert s.slack[i, place] * unit == pytest.approx(shared.slack[place - k], rel=1e-14, abs=0)
                assert s.growth[i, place] * unit == pytest.approx(shared.growth[place - k], rel=1e-14, abs=0)


def exact_row(c: Certificate, known: Known, Z: list, number: int, n: int) -> tuple[dict, Any]:
    """A cited row over x alone."""
    entries, b = row(c, known, *(int(u[number]) for u in (c.kind, c.index, c.a, c.b)), AS_WRITTEN)
    out: dict[int, Any] = {}
    for place, value in entries.items():
        for column, z in ({place: 1} if place < n else Z[place - n]).items():
            out[column] = out.get(column, 0) + Fraction(value) * Fraction(z)
    return out, b


@pytest.mark.parametrize("name", QUESTIONS)
def test_sizes_of_rows(name: str) -> None:
    """|x| and |motions| times the sizes of motions: of rows of one motion the sums that it is made of."""
    _, rows, shared, s = systems(name)
    n = shared.E.shape[1]
    for i, place in ((0, 1), (0, 4), (1, 1), (1, 2)):
        number = int(s.index[i, place])
        value = np.abs(rows.value[number])
        expected = value[:n] * shared.scale + value[n:] @ shared.Z_size
        np.testing.assert_allclose(s.size[i, place] * s.unit[i, place], expected * s.closed[i], rtol=1e-13)


@pytest.mark.parametrize("name", QUESTIONS)
def test_multipliers_of_equalities_by_least_squares(name: str) -> None:
    """What the rows leave over is at right angles to every equality, all columns included."""
    _, rows, shared, s = systems(name)
    p = len(shared.E)
    for i, original in enumerate((2, 0)):
        y = np.array(WEIGHTS)[STARTS[original] : STARTS[original + 1]]
        n = shared.E.shape[1]
        value = rows.value[STARTS[original] : STARTS[original + 1]]
        rest = (y / y.max()) @ (value[:, :n] * shared.scale + value[:, n:] @ shared.Z)
        v = s.w[i, -p:] / s.unit[i, -p:]
        left = rest + v @ shared.E
        assert np.abs(shared.E @ left).max() <= 1e-13 * np.abs(rest).max() * np.abs(shared.E).max()
        assert np.abs(left).max() > 1e-3  # these rows prove nothing


@pytest.mark.parametrize("name", ["check", "largest"])
def test_equations_alone(name: str) -> None:
    """A leaf without rows: v is what of h the equalities cannot make, so that v E = 0 and v h is not below 0."""
    _, _, shared, s = systems(name)
    p = len(shared.E)
    v = s.w[2, -p:] / s.unit[2, -p:]
    assert np.abs(v @ shared.E).max() <= 1e-13
    norms = np.linalg.norm(shared.E, axis=1)
    unit = np.exp2(-np.round(np.log2(np.where(norms > 0, norms, 1.0))))
    h = unit * shared.h
    assert h @ (v / unit) == pytest.approx((v / unit) @ (v / unit), abs=1e-14)


def test_equations_that_contradict_each_other_alone() -> None:
    """Two fixed contacts hold no torque about their line (x): v is that row alone, and its margin is 1."""
    g = Grasp([Contact([x, 0.0, 0.0], [-np.sign(x), 0.0, 0.0], 0.5) for x in (-0.03, 0.03)])
    question = Question(g, wrench=np.eye(6)[3])
    c = empty(question)
    rows = rows_of(c, np.zeros((0, 2), dtype=np.int64), *bounds(question, None))
    s = LeafSystems.of(c, rows, SharedSystem.of(question), np.zeros((1, 2, 3), np.int64), np.array([0]))
    v = s.w[0] / s.unit[0]
    np.testing.assert_allclose(v / np.abs(v).max(), [0, 0, 0, -1, 0, 0], atol=1e-15)
    # 1 N m, less 1e-9 of what a witness may miss
    assert s.margins()[0] == pytest.approx(1 - 1e-9, rel=1e-12)


def test_forces_of_open_contacts_where_all_is_wanted() -> None:
    """The second leaf has an open contact, whose c_n >= 0 is its second row."""
    *_, s = systems("preload", whole=True)
    *_, part = systems("preload")
    assert s.closed.all()
    force = Columns.of(QUESTIONS["preload"][0]).c.start
    assert (s.B[1, 1, force], part.B[1, 1, force]) == (1.0, 0.0)
    assert (s.B[0] == part.B[0]).all()
    np.testing.assert_allclose(s.w[:, :7] / s.unit[:, :7], part.w[:, :7] / part.unit[:, :7], rtol=1e-15)


def test_contacts_in_line_but_for_rounding() -> None:
    """A torque about the line takes 1e13 times as much force: multipliers are found as if there were none of it."""
    points = [np.array([0.3 * k, 0.4 * k, 1e-14 * (k == 0)]) for k in (-0.1, 0.0, 0.1)]
    g = Grasp([Contact(p, [0.8, -0.6, 0.0], 0.5) for p in points])
    question = Question(g, wrench=np.eye(6)[3])
    c = empty(question, None, [(Row.TANGENT, i, TURN // (3 + i), 0) for i in range(3)], [1.0, 0.5, 0.8])
    rows = rows_of(c, np.zeros((3, 3), dtype=np.int64), *bounds(question, None))
    s = LeafSystems.of(c, rows, SharedSystem.of(question), np.zeros((1, 3, 3), np.int64), np.array([0]))
    v = s.w[0, 3:] / s.unit[0, 3:]
    assert 0.1 < np.abs(v).max() < 1e3


def test_some_leaves_are_what_they_are_alone() -> None:
    """Whichever are chosen, and however much longer the others are."""
    _, _, _, every = systems("preload")
    _, _, _, one = systems("preload", chosen=(0,))
    assert one.index.tolist() == [[0, 1, 2, 3, 4]]
    p = one.B.shape[1] - 5
    for array in ("B", "size", "w", "free", "b", "slack", "growth", "first", "unit"):
        mine, theirs = getattr(one, array)[0], getattr(every, array)[1]
        np.testing.assert_allclose(mine, np.concatenate([theirs[:5], theirs[-p:]]), rtol=1e-12, atol=1e-14)
