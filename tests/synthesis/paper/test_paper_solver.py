"""The paper's solver: polytopes and multipliers in exact arithmetic, shrinking, small mechanisms, resuming."""

from __future__ import annotations

import json
import sys
from fractions import Fraction as F
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import linprog

from handfast.core.branch import BranchAndPrune, Discarded, Order
from handfast.core.errors import InputError
from handfast.model.hand import load_hand
from handfast.model.region import Bezier, Cap
from handfast.synthesis.paper.box_shrinking import (
    Emptiness,
    Over,
    PaperSolver,
    ShrinkingSettings,
    SystemBox,
    bisect,
    search,
)
from handfast.synthesis.paper.canonical import Canonical, Expanded, Patch
from handfast.synthesis.paper.canonical_build import canonical, point
from handfast.synthesis.paper.dual_bound import DualBound
from handfast.synthesis.paper.highs import LinearProgram
from handfast.synthesis.paper.polytopes import LinearRows, relaxation
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.planted import HOME, X, Z, bump, chain, joint, plant, pose

STEADY = settings(max_examples=40, deadline=None, derandomize=True)
SEEDS = st.integers(0, 2**32 - 1)
QUICK = ShrinkingSettings(over=Over.ORIGINAL, significant=0.4, sigma=0.2)


def exact(a) -> list[F]:
    return [F(float(x)) for x in a]


# --- small mechanisms ------------------------------------------------------------------------------------


def finger(height: float, upper: float = 1.4) -> Canonical:
    """One joint, a round tip at 0.2 m, under a plate at a height [m]; the object does not move.

    The tip touches where 0.2 sin q + 0.01 is the height, with its top, once for q in [0, upper] or never.
    """
    hand = chain(("finger", "palm", HOME, [joint("a", Z, 0.0, upper)]))
    tip = Cap(0.2 * X, 0.01, X, 1.5)
    corners = [[[x, height, z] for z in (-0.02, 0.02)] for x in (0.0, 0.2)]
    still = PoseBounds(np.zeros((3, 2)), np.stack([np.eye(3), np.eye(3)], axis=2))
    task = Task.of(hand, (ContactPair("finger", tip, Bezier(np.array(corners))),), pose=still)
    return canonical(task, unit=0.1)


def wall(half_width: float) -> Canonical:
    """The finger of `finger`, free to turn 1.4 rad to both sides, before a wall 0.175 m away.

    The tip touches at q = 0.6 and -0.6, where y is 0.1129 and -0.1129 m; the wall ends at +-half_width.
    """
    hand = chain(("finger", "palm", HOME, [joint("a", Z, -1.4, 1.4)]))
    tip, x = Cap(0.2 * X, 0.01, X, 1.0), 0.01 + 0.2 * np.cos(0.6)
    corners = [[[x, y, z] for y in (-half_width, half_width)] for z in (-0.02, 0.02)]
    still = PoseBounds(np.zeros((3, 2)), np.stack([np.eye(3), np.eye(3)], axis=2))
    return canonical(Task.of(hand, (ContactPair("finger", tip, Bezier(np.array(corners))),), pose=still), unit=0.1)


def touching(system: Canonical, height: float) -> np.ndarray:
    """The solution of `finger` in the variables x."""
    from handfast.synthesis.paper.patch_form import cap_parameters

    q = np.arcsin((height - 0.01) / 0.2)
    tip = system.task.contact_pairs[0].hand
    assert isinstance(tip, Cap)
    u, v = cap_parameters(tip, np.array([np.sin(q), np.cos(q), 0.0]))
    x = point(system, np.array([q]), HOME, np.array([[u, v, np.cos(q), 0.5]]))
    assert np.abs(system.residual(x)).max() < 1e-12
    return system.expanded.lift(x)


def gripper(seed: int):
    """Two short fingers, one turning and one sliding, with a cap and a patch on an object that is free to move."""
    rng = np.random.default_rng(seed)
    hand = chain(
        ("left", "palm", pose(-0.05 * X), [joint("l", Z, -0.5, 0.5)]),
        ("right", "palm", pose(0.05 * X), [joint("r", X, -0.02, 0.02, type="prismatic")]),
    )
    tip = Cap(0.03 * X, 0.01, X, 1.0)
    planted = plant(hand, [("left", tip, bump(rng, (1, 2))), ("right", bump(rng, (1, 1)), bump(rng, (2, 1)))], rng)
    system = canonical(planted.task, unit=0.1)
    return system, system.expanded.lift(point(system, planted.q, planted.pose, planted.parameters))


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
    rows = relaxation(forms(patch), lower, upper, 1e-9)
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
    rows = relaxation(forms(patch), lower, upper, 1e-9)
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
    rows = relaxation(forms(np.zeros((2, 2))), lower, upper, 1e-9)
    for column, low, high in ((2, 0.1875, 0.3125), (3, 0.3125, 0.4375)):
        c = np.zeros(5)
        c[column] = 1
        bounds = [(0.5, 0.5), (0.75, 0.75)] + [(None, None)] * 3
        A = np.concatenate([rows.A.toarray()[np.isfinite(rows.hi)], -rows.A.toarray()[np.isfinite(rows.lo)]])
        b = np.concatenate([rows.hi[np.isfinite(rows.hi)], -rows.lo[np.isfinite(rows.lo)]])
        assert linprog(c, A, b, bounds=bounds).fun == pytest.approx(low, abs=1e-9)
        assert -linprog(-c, A, b, bounds=bounds).fun == pytest.approx(high, abs=1e-9)


# --- what multipliers prove -------------------------------------------------------------------------------


def exact_below(rows: LinearRows, y, lower, upper, column=None, sign=1.0) -> F:
    """The bound of `DualBound.below` in rationals."""
    out, d = F(0), [F(0)] * rows.A.shape[1]
    if column is not None:
        d[column] = F(sign)
    for weight, row, lo, hi in zip(exact(y), rows.A.toarray(), rows.lo, rows.hi, strict=True):
        end = lo if weight > 0 else hi
        if weight == 0 or not np.isfinite(end):
            continue
        out += weight * F(float(end))
        for k in np.flatnonzero(row):
            d[k] -= weight * F(float(row[k]))
    for slope, l, u in zip(d, exact(lower), exact(upper), strict=True):
        out += min(slope * l, slope * u)
    return out


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
    dual, program = DualBound(rows), LinearProgram(rows, lower, upper, iterations=1000, seconds=1.0)
    for column in range(5):
        for sign in (1.0, -1.0):
            (y,) = program.multipliers(column, sign)
            best = optimum(rows, lower, upper, sign * np.eye(5)[column])
            assert dual.below(y, lower, upper, column, sign) == pytest.approx(best, abs=1e-7)
    empty, lower, upper = random_program(rng, feasible=False)
    tried = LinearProgram(empty, lower, upper, iterations=1000, seconds=1.0).multipliers(0, 1.0)
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
    rows = relaxation(x, x.lower, x.upper, 1e-9)
    moving = np.flatnonzero(x.upper > x.lower)[:30]

    def finished(iterations: int, seconds: float) -> int:
        program = LinearProgram(rows, x.lower, x.upper, iterations=iterations, seconds=seconds)
        return sum(len(program.multipliers(int(k), 1.0)) for k in moving)

    assert finished(10_000, 10.0) == len(moving)
    assert finished(1, 10.0) < len(moving) / 2
    assert finished(10_000, 1e-9) < len(moving) / 2


# --- shrinking ---------------------------------------------------------------------------------------------


def around(x: np.ndarray, root: SystemBox, rng, size: float) -> SystemBox:
    """A random sub-box of a size (relative) that holds a point, sometimes on its edge."""
    low = np.maximum(root.lower, x - rng.uniform(0, 1, len(x)) * size * root.sides)
    high = np.minimum(root.upper, x + rng.uniform(0, 1, len(x)) * size * root.sides)
    edge = rng.random(len(x)) < 0.1
    low = np.where(edge & (rng.random(len(x)) < 0.5), x, low)
    return SystemBox(np.minimum(low, x), np.maximum(high, x))


@pytest.mark.parametrize("over", Over)
def test_shrinking_never_loses_a_planted_solution(over):
    for seed, size in enumerate([1.0, 3e-3]):
        system, x = gripper(seed)
        solver = PaperSolver(system, ShrinkingSettings(over=over, narrow=1e-6))
        rng = np.random.default_rng(seed)
        box = around(x, solver.root, rng, size)
        after = solver.shrink(box)
        assert isinstance(after, SystemBox)
        assert after.holds(x)
        assert (after.lower >= box.lower).all()
        assert (after.upper <= box.upper).all()
        if size < 1:
            assert after.sides[: solver.width].sum() < 0.98 * box.sides[: solver.width].sum()
        if over is Over.ALL:
            break  # more programs of the same kind


def test_shrinking_keeps_the_solution_of_a_whole_hand():
    rng = np.random.default_rng(2)
    tip = Cap(np.array([0.02, 0, 0]), 0.013, np.array([0.14, 0, 0.99]), np.pi / 3)
    planted = plant(load_hand("schunk-sah"), [("index_distal", tip, bump(rng, (1, 1)))], rng)
    system = canonical(planted.task, unit=0.001)
    x = system.expanded.lift(point(system, planted.q, planted.pose, planted.parameters))
    solver = PaperSolver(system, ShrinkingSettings(over=Over.ORIGINAL, narrow=1e-6))
    after = solver.shrink(around(x, solver.root, rng, 0.01))
    assert isinstance(after, SystemBox)
    assert after.holds(x)
    assert solver.statistics.unproved <= 0.05 * solver.statistics.programs


@pytest.mark.parametrize("liar", ["zeros", "noise", "nan", "nothing", "mirrored"])
def test_a_solver_that_lies_loses_no_solution(liar, monkeypatch):
    """Whatever multipliers come, right ones included, of another variable or of the other sign."""
    system, x = gripper(1)
    solver = PaperSolver(system, ShrinkingSettings(over=Over.ORIGINAL))
    rng = np.random.default_rng(0)
    honest = LinearProgram.multipliers

    def answer(self, column, sign):
        rows = self._solver.getNumRow()
        match liar:
            case "zeros":
                return [np.zeros(rows)]
            case "noise":
                return [rng.normal(size=rows) * 10.0 ** rng.integers(-6, 6)]
            case "nan":
                return [np.full(rows, np.nan), np.full(rows, np.inf)]
            case "nothing":
                return []
        return [-y for y in honest(self, column, -sign)]

    monkeypatch.setattr(LinearProgram, "multipliers", answer)
    box = around(x, solver.root, rng, 0.1)
    after = solver.shrink(box)
    assert isinstance(after, SystemBox)
    assert after.holds(x)
    if liar in ("nan", "nothing"):
        np.testing.assert_array_equal(after.lower[: system.n_v], box.lower[: system.n_v])
        np.testing.assert_array_equal(after.upper[: system.n_v], box.upper[: system.n_v])


def test_the_halves_of_a_box_are_the_box():
    box = SystemBox(np.array([0.0, -1.0, 5.0]), np.array([1.0, 2.0, 50.0]), share=0.5)
    first, second = bisect(box, 2)
    np.testing.assert_array_equal(first.lower, box.lower)
    np.testing.assert_array_equal(second.upper, box.upper)
    np.testing.assert_array_equal(first.upper, [1.0, 0.5, 50.0])  # the third side is not asked for
    np.testing.assert_array_equal(second.lower, [0.0, 0.5, 5.0])
    assert first.share == second.share == 0.25


# --- searches ----------------------------------------------------------------------------------------------


def run(search: BranchAndPrune[SystemBox], steps: int = 10**6) -> list[Discarded]:
    """The discarded boxes of a search of so many steps at most."""
    out = []
    for _, state in zip(range(steps), search, strict=False):
        if isinstance(state.outcome, Discarded):
            out.append(state.outcome)
    return out


def proved(system: Canonical, why: Emptiness, slack: float) -> bool:
    """Is the box empty, by rational arithmetic alone?"""
    rows = relaxation(system.expanded, why.start.lower, why.start.upper, slack)
    bound = exact_below(rows, why.multipliers, why.box.lower, why.box.upper, why.column, why.sign)
    if why.column is None:
        return bound > 0
    return bound > F(float(why.box.upper[why.column] if why.sign > 0 else -why.box.lower[why.column]))


@pytest.mark.parametrize("order", [Order.DEPTH, Order.BREADTH])
def test_the_only_solution_of_a_finger_is_found(order):
    height = 0.15
    system = finger(height)
    x = touching(system, height)
    found = search(system, QUICK, order=order)
    discarded = run(found)
    state = found.state
    assert state.pending == 0
    assert not state.unfinished
    assert len(state.finals) >= 1
    assert all(box.sides[: system.n_v].max() <= QUICK.sigma for box in state.finals)
    assert any(box.holds(x) for box in state.finals)
    angle = system.names.index("cos[a]")
    assert all(box.lower[angle] - 0.2 <= x[angle] <= box.upper[angle] + 0.2 for box in state.finals)
    assert all(proved(system, out.evidence, QUICK.slack) for out in discarded)
    assert state.discarded == pytest.approx(1 - sum(box.share for box in state.finals), abs=1e-12)


def test_a_wall_that_is_too_narrow_is_discarded_with_proofs():
    """Half of it between the two places where the tip would touch: the relaxation of the root holds it."""
    system = wall(0.08)
    found = search(system, QUICK)
    discarded = run(found)
    assert not found.state.finals
    assert found.state.pending == 0
    assert found.state.discarded == pytest.approx(1, abs=1e-12)
    assert len(discarded) == found.state.nodes - 1 > 1  # all but the root, which is split
    assert all(proved(system, out.evidence, QUICK.slack) for out in discarded)


def test_both_places_on_a_wider_wall_are_found():
    system = wall(0.12)
    found = search(system, QUICK)
    run(found)
    y = system.names.index("o[0].y")
    centers = sorted((box.lower[y] + box.upper[y]) / 2 for box in found.state.finals)
    assert centers == pytest.approx([-1.129, 1.129], abs=0.01)  # in units of 0.1 m
    assert found.state.pending == 0


def test_the_exact_check_refuses_spoiled_evidence():
    system = finger(0.3)
    (out,) = run(search(system, QUICK))
    why = out.evidence
    assert proved(system, why, QUICK.slack)
    spoiled = [
        Emptiness(why.box, why.start, y, why.column, why.sign, why.margin)
        for y in (0 * why.multipliers, -why.multipliers, np.roll(why.multipliers, 1))
    ]
    assert not any(proved(system, s, QUICK.slack) for s in spoiled)


def test_to_the_letter_all_sides_of_x_are_shrunk_and_split():
    system = finger(0.15)
    found = search(system, ShrinkingSettings(sigma=0.5, significant=0.5))
    for state in found:
        if state.finals:
            break
    (box,) = found.state.finals
    assert box.sides.max() <= 0.5
    assert box.holds(touching(system, 0.15))


def test_a_resumed_search_finds_the_same():
    system = wall(0.12)
    first, parts = search(system, QUICK), []
    for stop in (1, 3, 3):  # in the root's passes and after the bisection
        run(first, stop)
        text = json.dumps(first.save())
        first = BranchAndPrune.restored(PaperSolver(system, QUICK), json.loads(text))
        parts.append(first.state.steps)
    run(first)
    whole = search(system, QUICK)
    run(whole)
    assert first.save() == whole.save()
    assert parts == [1, 4, 7]
    assert whole.state.steps > 7


def test_statistics():
    system = finger(0.15)
    found = search(system, QUICK)
    run(found, 3)
    s = found.domain.statistics
    assert s.passes == 3
    assert s.boxes == found.state.nodes
    assert s.programs > 3 * system.n_v / 2
    assert 0.3 < s.program_share < 1
    assert s.boxes_per_second == s.boxes / s.seconds


# --- bad input ---------------------------------------------------------------------------------------------


def test_a_missing_solver_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "highspy", None)
    with pytest.raises(InputError, match=r"solver: needs the package highspy: pip install 'handfast\[reference\]'"):
        search(finger(0.15))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"sigma": 0.0}, "sigma: is 0; it must be positive"),
        ({"seconds": -1.0}, "seconds: is -1; it must be positive"),
        ({"significant": 1.0}, r"significant: is 1; it lies in \(0, 1\)"),
        ({"sigma": float("nan")}, "sigma: is nan"),
    ],
)
def test_settings_are_checked(change, message):
    with pytest.raises(InputError, match=message):
        ShrinkingSettings(**change)


def test_saved_boxes_are_checked():
    solver = PaperSolver(finger(0.15), QUICK)
    good = solver.encode(solver.root)
    assert solver.decode(json.loads(json.dumps(good))).holds(solver.root.lower)
    n = solver.system.expanded.n
    with pytest.raises(InputError, match=f"box: has 3 lower and {n} upper ends; {n} are needed"):
        solver.decode(good | {"lower": [0.0, 0.0, 0.0]})
    with pytest.raises(InputError, match="box: has a lower end above the upper one"):
        solver.decode(good | {"lower": good["upper"], "upper": good["lower"]})
    with pytest.raises(InputError, match="share: is missing"):
        solver.decode({"lower": [], "upper": []})
