"""Polytopes about the forms of the canonical system, and what multipliers prove about linear programs over them."""

from __future__ import annotations

from fractions import Fraction as F
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import linprog

from handfast.papers.box_shrinking import (
    Over,
    ShrinkingSettings,
)
from handfast.papers.canonical_system import Expanded, Patch
from handfast.papers.linear_programs import DualBound, LinearProgram, LinearRows, polytopes
from tests.support.exact_programs import exact, exact_below, finger

STEADY = settings(max_examples=40, deadline=None, derandomize=True)
SEEDS = st.integers(0, 2**32 - 1)
QUICK = ShrinkingSettings(over=Over.ORIGINAL, significant=0.4, sigma=0.2)


# --- polytopes --------------------------------------------------------------------------------------------


def forms(patch: np.ndarray) -> Expanded:
    """x2 = x0^2, x3 = x0 x1, x4 = f(x0, x1) and nothing else."""
    none = np.zeros(5)
    return Expanded(
        ("x", "y", "x^2", "x*y", "f"), none, none, sparse.csr_array((0, 5)), np.zeros(0),
        np.array([[2, 0]]), np.array([[3, 0, 1]]), (Patch("(24)", "", 4, 0, 1, patch),), np.zeros(0, dtype=np.intp),
    )  # fmt: skip


def bernstein(points: np.ndarray, x: F, y: F) -> F:
    m, n = (s - 1 for s in points.shape)
    return sum(
        F(float(points[i, j])) * comb(m, i) * x**i * (1 - x) ** (m - i) * comb(n, j) * y**j * (1 - y) ** (n - j)
        for i in range(m + 1)
        for j in range(n + 1)
    )


def violation(rows: LinearRows, x: list[F]) -> F:
    """By how much the worst row is violated, exactly; negative if none is."""
    worst = F(-(10**9))
    for row, lo, hi in zip(rows.A.toarray(), rows.lo, rows.hi, strict=True):
        value = sum(F(float(a)) * v for a, v in zip(row, x, strict=True) if a)
        if np.isfinite(lo):
            worst = max(worst, F(float(lo)) - value)
        if np.isfinite(hi):
            worst = max(worst, value - F(float(hi)))
    return worst


SHAPES = st.sampled_from([(1, 1), (1, 3), (2, 2), (4, 4), "plane", "constant"])
WIDTHS = st.sampled_from([1.0, 0.3, 1e-3, 1e-7, 0.0])


def patch_of(shape, rng) -> np.ndarray:
    if shape == "plane":
        return 0.3 + np.add.outer(np.linspace(0, 0.7, 3), np.linspace(0, -0.4, 2))
    if shape == "constant":
        return np.full((2, 3), 0.7)
    return rng.normal(size=(shape[0] + 1, shape[1] + 1)) * 10.0 ** rng.integers(-3, 3)


@given(SEEDS, SHAPES, WIDTHS, WIDTHS)
@STEADY
def test_polytopes_hold_every_point_of_their_form(seed, shape, width, height):
    rng = np.random.default_rng(seed)
    patch = patch_of(shape, rng)
    size = np.array([width, height])
    lower = rng.uniform(0, 1, 2) * (1 - size)
    lower, upper = (np.concatenate([a, np.zeros(3)]) for a in (lower, np.minimum(lower + size, 1.0)))
    rows = polytopes(forms(patch), lower, upper, 1e-9)
    ends = [(F(float(a)), F(float(b))) for a, b in zip(lower[:2], upper[:2], strict=True)]
    for s, t in [(F(0), F(0)), (F(1), F(0)), (F(0), F(1)), (F(1), F(1))] + [
        (F(int(a), 97), F(int(b), 97)) for a, b in rng.integers(0, 98, (6, 2))
    ]:
        x, y = (a + k * (b - a) for k, (a, b) in zip((s, t), ends, strict=True))
        assert violation(rows, [x, y, x * x, x * y, bernstein(patch, x, y)]) <= 0


@given(SEEDS, st.sampled_from([1.0, 0.1, 1e-3]))
@STEADY
def test_polytopes_hold_little_else(seed, width):
    """At the middle of the box the form cannot be missed by more than the polytope is thick there."""
    rng = np.random.default_rng(seed)
    patch = rng.normal(size=(3, 3))
    lower = np.concatenate([rng.uniform(0, 1 - width, 2), np.zeros(3)])
    upper = lower + width * np.array([1, 1, 0, 0, 0])
    rows = polytopes(forms(patch), lower, upper, 1e-9)
    x, y = exact((lower + upper)[:2] / 2)
    right = [x, y, x * x, x * y, bernstein(patch, x, y)]
    thick = F(width) ** 2  # triangle and tetrahedron: a quarter; a quadratic patch: its second derivatives
    bend = F(float(16 * np.abs(patch).max())) * thick + F(1, 10**9)
    for k, room in ((2, thick), (3, thick), (4, bend)):
        for sign in (-1, 1):
            wrong = list(right)
            wrong[k] += sign * room
            assert violation(rows, wrong) > 0


def test_the_triangle_and_the_tetrahedron_of_figure_5():
    """The corners of both, which lie on their edges, and the known ends of x^2 and x y above the middle."""
    lower, upper = np.array([0.25, 0.5, 0, 0, 0]), np.array([0.75, 1.0, 0, 0, 0])
    rows = polytopes(forms(np.zeros((2, 2))), lower, upper, 1e-9)
    for column, low, high in ((2, 0.1875, 0.3125), (3, 0.3125, 0.4375)):
        c = np.zeros(5)
        c[column] = 1
        bounds = [(0.5, 0.5), (0.75, 0.75)] + [(None, None)] * 3
        A = np.concatenate([rows.A.toarray()[np.isfinite(rows.hi)], -rows.A.toarray()[np.isfinite(rows.lo)]])
        b = np.concatenate([rows.hi[np.isfinite(rows.hi)], -rows.lo[np.isfinite(rows.lo)]])
        assert linprog(c, A, b, bounds=bounds).fun == pytest.approx(low, abs=1e-9)
        assert -linprog(-c, A, b, bounds=bounds).fun == pytest.approx(high, abs=1e-9)


# --- what multipliers prove -------------------------------------------------------------------------------


def random_program(rng, feasible: bool):
    A = rng.normal(size=(8, 5)) * 10.0 ** rng.integers(-3, 4, (8, 1))
    x = rng.uniform(-1, 1, 5)
    lo = A @ x - np.abs(A).sum(axis=1) * rng.uniform(0, 0.3, 8)
    hi = np.where(rng.random(8) < 0.5, np.inf, A @ x + np.abs(A).sum(axis=1) * rng.uniform(0, 0.3, 8))
    if not feasible:
        lo[0] = A[0] @ x + 1.001 * np.abs(A[0]).sum() * 2
        hi[0] = np.inf
    return LinearRows(sparse.csr_array(A), lo, hi), -np.ones(5), np.ones(5)


def optimum(rows: LinearRows, lower, upper, c) -> float | None:
    A = np.concatenate([rows.A.toarray()[np.isfinite(rows.hi)], -rows.A.toarray()])
    b = np.concatenate([rows.hi[np.isfinite(rows.hi)], -rows.lo])
    found = linprog(c, A, b, bounds=list(zip(lower, upper, strict=True)))
    assert found.status in (0, 2)
    return found.fun if found.status == 0 else None


@given(SEEDS)
@STEADY
def test_no_multipliers_prove_too_much(seed):
    rng = np.random.default_rng(seed)
    rows, lower, upper = random_program(rng, feasible=True)
    dual = DualBound(rows)
    best = optimum(rows, lower, upper, np.eye(5)[2])
    for _ in range(10):
        y = rng.normal(size=8) * 10.0 ** rng.integers(-8, 8, 8) * (rng.random(8) < 0.6)
        assert dual.below(y, lower, upper) <= 0
        bound = dual.below(y, lower, upper, 2)
        assert bound <= best + 1e-9
        assert F(bound) <= exact_below(rows, y, lower, upper, 2)
        assert F(dual.below(y, lower, upper, 2, -1.0)) <= exact_below(rows, y, lower, upper, 2, -1.0)


@given(SEEDS)
@settings(STEADY, max_examples=12)
def test_the_solvers_multipliers_prove_what_it_says(seed):
    rng = np.random.default_rng(seed)
    rows, lower, upper = random_program(rng, feasible=True)
    dual, program = DualBound(rows), LinearProgram(rows, lower, upper, iterations=1000, seconds=np.inf)
    for column in range(5):
        for sign in (1.0, -1.0):
            (y,) = program.multipliers(column, sign)
            best = optimum(rows, lower, upper, sign * np.eye(5)[column])
            assert dual.below(y, lower, upper, column, sign) == pytest.approx(best, abs=1e-7)
    empty, lower, upper = random_program(rng, feasible=False)
    tried = LinearProgram(empty, lower, upper, iterations=1000, seconds=np.inf).multipliers(0, 1.0)
    assert max(DualBound(empty).below(y, lower, upper) for y in tried) > 0
    assert max(exact_below(empty, y, lower, upper) for y in tried) > 0
    assert optimum(empty, lower, upper, np.zeros(5)) is None


def test_useless_multipliers_prove_nothing():
    rows, lower, upper = random_program(np.random.default_rng(1), feasible=False)
    dual = DualBound(rows)
    assert dual.below(np.zeros(8), lower, upper) <= 0
    assert dual.below(np.full(8, np.nan), lower, upper) <= 0
    assert dual.below(np.full(8, np.inf), lower, upper) == -np.inf
    assert dual.below(np.full(8, 1e308), lower, upper) == -np.inf
    assert dual.below(np.zeros(8), lower, upper, 3) == pytest.approx(-1)


@pytest.mark.parametrize(
    "A, lo",
    [
        ([[4e16], [1.0], [-4e16]], [0.0, 0.0, 0.0]),  # y A is 1, and 0 in floats
        ([[0.0], [0.0], [0.0]], [4e16, -1.0, -4e16]),  # y lo is -1, and 0 in floats
        ([[-4e16], [0.0], [0.0]], [4e16, -1.0, 0.0]),  # both ends of the sum cancel
    ],
)
def test_rounding_is_on_the_safe_side(A, lo):
    rows = LinearRows(sparse.csr_array(np.array(A)), np.array(lo), np.full(3, np.inf))
    lower, upper, y = -np.ones(1), np.ones(1), np.ones(3)
    assert F(DualBound(rows).below(y, lower, upper)) <= exact_below(rows, y, lower, upper) == -1


def test_limits_of_a_program_are_kept():
    system = finger(0.15)
    x = system.expanded
    rows = polytopes(x, x.lower, x.upper, 1e-9)
    moving = np.flatnonzero(x.upper > x.lower)[:30]

    def finished(iterations: int, seconds: float) -> int:
        program = LinearProgram(rows, x.lower, x.upper, iterations=iterations, seconds=seconds)
        return sum(len(program.multipliers(int(k), 1.0)) for k in moving)

    assert finished(10_000, np.inf) == len(moving)
    assert finished(1, np.inf) < len(moving) / 2
    assert finished(10_000, 1e-9) < len(moving) / 2
