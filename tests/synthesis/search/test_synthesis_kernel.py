"""The compiled formulas of synthesis: what they compute, their derivatives, and that balls and remainders hold."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from handfast.synthesis.search.prover import Prover
from handfast.synthesis.search.workspace import (
    AngleTerms,
    CenteredBox,
    LineWork,
    Polynomials,
)
from handfast.synthesis.task import PoseBounds
from handfast.synthesis.task_problem import TaskProblem
from tests.support.synthesis_kernel import at, certified, coordinates, everything, polynomials
from tests.support.synthesis_pieces import Operations, Row, ask

X, Y, Z = np.eye(3)


@pytest.mark.parametrize("seed", range(20))
def test_equations_vanish_at_planted_solutions(seed: int):
    planted = everything(seed)
    problem = TaskProblem.of(planted.task)
    x = coordinates(planted, problem)
    F, _, G, _ = at(problem, x)
    assert problem.equations == 3 + 5 + 5 + 3 + 3
    assert np.abs(F[:, 0]).max() < 1e-12
    assert G[: len(planted.spots), 0].min() > 0
    assert np.abs(F[:, 1]).max() < 1e-12  # radii of rounding alone
    wrong = x.copy()
    wrong[0] += 1e-3
    assert np.abs(at(problem, wrong)[0][:, 0]).max() > 1e-5


@pytest.mark.parametrize("seed", range(6))
def test_derivatives_are_those_of_the_values(seed: int):
    problem = TaskProblem.of(everything(seed).task)
    lower, upper = problem.flat.coordinates.lower, problem.flat.coordinates.upper
    x = np.random.default_rng(seed).uniform(np.maximum(lower, -1), np.minimum(upper, 1))
    _, J, _, H = at(problem, x)
    step = 1e-6
    for i in range(problem.n):
        d = step * np.eye(problem.n)[i]
        plus, minus = at(problem, x + d), at(problem, x - d)
        for value, derivative in ((0, J), (2, H)):
            numeric = (plus[value][:, 0] - minus[value][:, 0]) / (2 * step)
            np.testing.assert_allclose(derivative[:, i, 0], numeric, atol=2e-8)


@pytest.mark.parametrize("seed", range(6))
def test_balls_hold_every_value_in_a_box(seed: int):
    problem, rng = TaskProblem.of(everything(seed).task), np.random.default_rng(seed)
    x = rng.uniform(np.maximum(problem.flat.coordinates.lower, -1), np.minimum(problem.flat.coordinates.upper, 1))
    for size in (1e-7, 1e-4, 0.01):
        radius = size * rng.random(problem.n)
        boxes = at(problem, x, radius)
        for _ in range(20):
            values = at(problem, x + radius * rng.uniform(-1, 1, problem.n))
            for box, value in zip(boxes, values, strict=True):
                finite = np.isfinite(box[..., 1])  # a patch's normal may vanish in a large box
                assert (np.abs(value[..., 0] - box[..., 0]) <= box[..., 1] + value[..., 1])[finite].all()
        # and no wild enclosure either
        assert size > 1e-4 or boxes[0][:, 1].max() < 40 * size * problem.n


numbers = st.floats(-1e3, 1e3).filter(lambda v: abs(v) > 1e-6)
radii = st.floats(0, 1e-3)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(numbers, radii, numbers, radii, st.floats(-1, 1), st.floats(-1, 1))
@example(1.0, 0.5, 1.0, 0.5, 1.0, 1.0)  # both radii count: 1.5^2 is 1.25 from 1
def test_operations_on_balls_are_rigorous(a: float, ra: float, b: float, rb: float, s: float, t: float):
    operations = Operations(np.array([[a, ra], [b, rb]]), np.empty((8, 2)))
    ask("operated", operations)
    add, sub, mul, div, root, sine, cosine, scale = operations.result.tolist()
    x, y = Fraction(a) + Fraction(s) * Fraction(ra), Fraction(b) + Fraction(t) * Fraction(rb)
    for (m, r), true in ((add, x + y), (sub, x - y), (mul, x * y), (scale, Fraction(3.7) * x)):
        assert abs(true - Fraction(m)) <= Fraction(r)
    if np.isfinite(div[1]):
        assert abs(x / y - Fraction(div[0])) <= Fraction(div[1])
    else:
        assert abs(b) <= rb * (1 + 1e-9)
    if np.isfinite(root[1]):
        low, high = Fraction(root[0]) - Fraction(root[1]), Fraction(root[0]) + Fraction(root[1])
        assert low <= 0 or low * low <= x
        assert x <= high * high
    else:
        assert a - ra <= abs(a) * 1e-9
    assert abs(np.sin(float(x)) - sine[0]) <= sine[1] + 1e-13
    assert abs(np.cos(float(x)) - cosine[0]) <= cosine[1] + 1e-13
    assert sine[1] <= ra + 1e-14


def bow(k: int, d: np.ndarray, bend: np.ndarray, problem: TaskProblem) -> np.ndarray:
    """(3,) what the second derivatives of a hand's point add d away from where they were taken."""
    chains, out = problem.flat.chains, np.zeros(3)
    for i, j in combinations_with_replacement(range(chains.joints[k]), 2):
        by = d[chains.coordinate[k, i]] * d[chains.coordinate[k, j]]
        out += bend[i, j] * by * (0.5 if i == j else 1.0)
    return out


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.slow
def test_remainders_bound_what_the_polynomials_leave_out(seed: int):
    problem, rng = TaskProblem.of(everything(seed).task), np.random.default_rng(seed)
    flat, n, b = problem.flat, problem.n, len(problem.task.contact_pairs)
    bounds = next(iter(Prover(problem, workers=1).domains.values())).question.derivative_bounds
    worst = worst_bent = 0.0
    for size in (0.5, 0.1, 0.01):
        lower, upper = np.maximum(flat.coordinates.lower, -1), np.minimum(flat.coordinates.upper, 1)
        h = size * rng.random(n) * 0.5 * (upper - lower)
        x = rng.uniform(lower + h, upper - h)
        for k in range(b + 1):  # the last one is the object's origin
            value, slope, remainder, bend, rest = polynomials(k, x, h, problem, bounds)
            for _ in range(30):
                d = h * rng.choice([-1, 1, *rng.uniform(-1, 1, 2)], n)
                there, *_ = polynomials(k, x + d, np.zeros(n), problem, bounds)
                missed = there - value - np.einsum("i,cij->cj", d, slope)
                gap = np.linalg.norm(missed, axis=1)
                assert (gap <= remainder).all()
                worst = max(worst, float((gap / remainder).max()))
                if k < b:
                    bent = float(np.linalg.norm(missed[0] - bow(k, d, bend, problem)))
                    assert bent <= rest
                    worst_bent = max(worst_bent, bent / rest)
    assert worst > 0.2  # the bounds are not idle
    assert worst_bent > 0.1


def boxed(n: int, half: float) -> tuple[CenteredBox, Row]:
    """A box of n coordinates about 0, and a row that has them all."""
    zero = np.zeros(n)
    return CenteredBox(zero, np.full(n, half), np.full(n, -half), np.full(n, half)), Row(np.zeros(n), np.arange(n))


@pytest.mark.parametrize("half", [1e-3, 0.1, 0.5, 0.7])
def test_the_direction_of_a_line_bends_no_more_than_its_bound(half: float) -> None:
    """Line (1, t, 0): its unit vector is (1, t, 0) / sqrt(1 + t^2), and (1, t, 0) to first order."""
    box, row = boxed(1, half)
    n, b = 1, 2
    line = LineWork(
        np.array([X, X]), np.zeros((b, n, 3)), np.zeros(n), np.zeros((n, n)), np.zeros((b, 3)), np.zeros((b, n, 3)),
        np.zeros((b, 2)), np.zeros((4, 3)), np.zeros((1, 5)),
    )  # fmt: skip
    line.slope[0, 0] = Y
    ask("unit_line", 0.0, half, box, row, line)
    remainder, stray = line.unit_bound[0]
    unit = np.array([1, half, 0]) / np.hypot(1, half)
    np.testing.assert_allclose(line.unit[0] + half * line.unit_slope[0, 0], [1, half, 0], atol=1e-15)
    assert np.linalg.norm(unit - [1, half, 0]) <= remainder
    assert np.linalg.norm(unit - X) <= stray < np.inf


@pytest.mark.parametrize("which", range(3))
def test_products_of_directions_leave_out_what_two_of_them_stray(which: int) -> None:
    """The product of e_i + t e_k with itself is 1 + t^2; so is the triple product of e_i + t e_k, e_j and e_k - t e_i,
    for each cyclic order of i, j, k."""
    half, axes = 0.3, np.eye(3)
    box, row = boxed(1, half)
    i, j, k = which, (which + 1) % 3, (which + 2) % 3
    lines = {i: (axes[i], axes[k]), j: (axes[j], np.zeros(3)), k: (axes[k], -axes[i])}
    for two in (False, True):
        of = polynomials_of([lines[i], lines[i], lines[j]] if two else [lines[c] for c in range(3)], half)
        terms = AngleTerms(np.zeros((16, 3)), np.zeros((16, 1)))
        ask("multiplied", of, box, row, terms)
        value, remainder, stray = terms.value[0 if two else 1]
        assert value == 1
        assert terms.slope[0 if two else 1, 0] == 0
        assert half**2 <= remainder <= half**2 + half**3
        assert stray >= remainder


def polynomials_of(directions: list[tuple[np.ndarray, np.ndarray]], half: float) -> Polynomials:
    """Of directions on the hand, each with its derivative by the one coordinate, in a box of this half width: exact."""
    b = len(directions)
    out = Polynomials(
        np.zeros((b, 4, 3)), np.zeros((b, 4, 1, 3)), np.zeros((b, 4)), np.zeros((b, 1, 1, 3)), np.zeros(b),
        np.zeros((b, 4)), np.zeros(b),
    )  # fmt: skip
    for k, (value, slope) in enumerate(directions):
        out.value[k, 1], out.slope[k, 1, 0] = value, slope
        out.swing[k, 1] = half * np.linalg.norm(slope)
    return out


@pytest.mark.parametrize("seed", range(20))
def test_certifies_what_is_there_and_nothing_beside_it(seed: int):
    problem = TaskProblem.of((planted := everything(seed)).task)
    x = coordinates(planted, problem)
    # five contacts on ten free joints and pose leave room: no hand of these is singular there
    _, J, _, _ = at(problem, x)
    assert np.linalg.svd(J[:, :, 0], compute_uv=False)[-1] > 1e-3
    found = certified(problem, x)
    assert found is not None
    assert len(set(found[0])) == problem.equations
    away = x.copy()
    away[: len(problem.free)] += 1e-3
    assert certified(problem, away) is None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("end", ["lower", "upper"])
def test_the_whole_box_must_lie_within_the_bounds(seed: int, end: str):
    """A solution that is nearer to a bound than the box is wide may lie beyond it; wider bounds let it pass."""
    problem = TaskProblem.of((planted := everything(seed)).task)
    x, flat, sign = coordinates(planted, problem), problem.flat, {"lower": -1, "upper": 1}[end]
    x[: len(problem.free)] += 1e-5  # beside the solution: the box has to reach it
    found = certified(problem, x)
    assert found is not None
    width = found[1].max()
    assert 1e-5 < width < 1e-2
    bounded = np.array([not name.startswith("quaternion") for name in problem.labels])
    dependent = np.isin(np.arange(problem.n), found[0])
    assert (bounded & dependent).sum() > 5

    def between(room: float) -> bool:
        """Is it proved if the dependent coordinates have so much room, and the others, which stand still, less?"""
        slack = np.where(dependent, room, room / 50)
        narrow = np.where(bounded, x + sign * slack, getattr(flat.coordinates, end))
        return certified(problem, x, **{end: narrow}) is not None

    assert between(100 * width)
    assert not between(0.5 * width)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("end", [0, 1])
def test_no_axis_of_the_object_may_leave_its_bounds_anywhere_in_the_box(seed: int, end: int):
    planted = everything(seed)
    axes = np.array(PoseBounds.none().axes)

    def within(room: float) -> bool:
        axes[1, 2, end] = planted.pose[2, 1] + (room if end else -room)
        task = replace(planted.task, pose=PoseBounds(PoseBounds.none().position, axes))
        problem = TaskProblem.of(task)
        x = coordinates(planted, problem)
        x[: len(problem.free)] += 1e-5
        return certified(problem, x) is not None

    assert within(1e-3)
    assert not within(1e-7)  # the pose is proved to some 1e-5 only
