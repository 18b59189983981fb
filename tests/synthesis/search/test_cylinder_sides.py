"""Sides of cylinders and cones in the compiled formulas: values, derivatives, remainders; nothing is lost."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from handfast.model.cylinder_side import ConeSide, CylinderSide
from handfast.model.region import Cap
from handfast.synthesis.search.prover import Prover
from handfast.synthesis.task_problem import TaskProblem
from tests.support.planted import Planted, bump, chain, joint, plant, pose, turn
from tests.support.synthesis_kernel import at, certified, coordinates, polynomials
from tests.synthesis.search.test_prover import kept

X, Y, Z = np.eye(3)


@cache
def sides(seed: int) -> Planted:
    """A hand of three fingers, one with the side of a cylinder on an object's patch, one on another side, one cap."""
    rng = np.random.default_rng(seed)
    parts = []
    for name in "abc":
        root = [joint(f"{name}0", turn(rng) @ Z), joint(f"{name}1", turn(rng) @ Z, anchor=0.01 * X)]
        parts.append((f"near_{name}", "palm", pose(rng.normal(0, 0.03, 3), turn(rng)), root))
        parts.append((name, f"near_{name}", pose(np.array([0.05, 0, 0])), [joint(f"{name}2", Y, -0.3, 0.9)]))
    shaft = CylinderSide(0.01 * Z, 0.008, X, Y + 0.2 * X, (-1.0, 1.5), (0.0, 0.03))
    hollow = CylinderSide(0.01 * X, 0.05, Y, Z, (0.5, 6.0), (-0.04, -0.01), flip=True)
    if seed % 2:
        shaft = ConeSide(0.01 * Z, (0.009, 0.006), X, Y + 0.2 * X, (-1.0, 1.5), (0.0, 0.03))
        hollow = ConeSide(0.01 * X, (0.04, 0.06), Y, Z, (0.5, 6.0), (-0.04, -0.01), flip=True)
    cap = Cap([0.01, 0.002, 0], 0.012, [1, 0, 0.2], 1.2)
    return plant(chain(*parts), [("a", shaft, bump(rng, (3, 2))), ("b", shaft, hollow), ("c", cap, hollow)], rng)


@pytest.mark.parametrize("seed", range(4))
def test_equations_vanish_at_planted_solutions_which_are_certified(seed: int) -> None:
    planted = sides(seed)
    problem = TaskProblem.of(planted.task)
    x = coordinates(planted, problem)
    F, _, G, _ = at(problem, x)
    assert problem.equations == 5 + 5 + 3
    assert np.abs(F[:, 0]).max() < 1e-12
    assert G[:3, 0].min() > 0
    assert certified(problem, x) is not None
    away = x.copy()
    away[: len(problem.free)] += 1e-3
    assert np.abs(at(problem, away)[0][:, 0]).max() > 1e-5
    assert certified(problem, away) is None


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_differences_and_balls_hold_every_value(seed: int) -> None:
    problem, rng, step = TaskProblem.of(sides(seed).task), np.random.default_rng(seed), 1e-6
    lower, upper = problem.flat.coordinates.lower, problem.flat.coordinates.upper
    x = rng.uniform(np.maximum(lower, -1), np.minimum(upper, 1))
    _, J, _, H = at(problem, x)
    for i, d in enumerate(step * np.eye(problem.n)):
        plus, minus = at(problem, x + d), at(problem, x - d)
        for value, derivative in ((0, J), (2, H)):
            numeric = (plus[value][:, 0] - minus[value][:, 0]) / (2 * step)
            np.testing.assert_allclose(derivative[:, i, 0], numeric, atol=2e-8)
    for size in (1e-7, 0.01):
        radius = size * rng.random(problem.n)
        boxes = at(problem, x, radius)
        for _ in range(20):
            values = at(problem, x + radius * rng.uniform(-1, 1, problem.n))
            for box, value in zip(boxes, values, strict=True):
                finite = np.isfinite(box[..., 1])  # a patch's normal may vanish in a large box
                assert (np.abs(value[..., 0] - box[..., 0]) <= box[..., 1] + value[..., 1])[finite].all()


@pytest.mark.parametrize("seed", range(3))
def test_remainders_bound_what_the_polynomials_leave_out(seed: int) -> None:
    problem, rng, worst = TaskProblem.of(sides(seed).task), np.random.default_rng(seed), 0.0
    n, limits = problem.n, problem.flat.coordinates
    bounds = next(iter(Prover(problem, workers=1).domains.values())).question.derivative_bounds
    lower, upper = np.maximum(limits.lower, -1), np.minimum(limits.upper, 1)
    for size in (0.5, 0.01):
        h = size * rng.random(n) * 0.5 * (upper - lower)
        x = rng.uniform(lower + h, upper - h)
        for k in range(3):
            value, slope, remainder, *_ = polynomials(k, x, h, problem, bounds)
            for _ in range(30):
                d = h * rng.choice([-1, 1, *rng.uniform(-1, 1, 2)], n)
                there, *_ = polynomials(k, x + d, np.zeros(n), problem, bounds)
                gap = np.linalg.norm(there - value - np.einsum("i,cij->cj", d, slope), axis=1)
                assert (gap <= remainder).all()
                worst = max(worst, float((gap / remainder).max()))
    assert worst > 0.2  # the bounds are not idle


@pytest.mark.parametrize("seed", range(4))
def test_no_search_discards_a_box_around_a_solution(seed: int) -> None:
    planted = sides(seed)
    problem = TaskProblem.of(planted.task)
    x, rng = coordinates(planted, problem), np.random.default_rng(seed)
    assert all(kept(Prover(problem, workers=1), x, size, rng, budget=20) for size in (1.0, 0.1, 1e-3))
