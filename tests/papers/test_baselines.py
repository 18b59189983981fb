"""Older methods: what they get right and wrong on problems solved by hand."""

from __future__ import annotations

import numpy as np
import pytest

from handfast import InputError, Verdict, check, load_grasp
from handfast.papers import mixed_integer_solvers
from handfast.papers.baselines import lemke, pyramid_step, turn_scheme
from handfast.stability.problem import model
from tests.support.problems import nest, pinch, table

scip = pytest.mark.skipif(not mixed_integer_solvers.available("scip"), reason="pyscipopt is not installed")


def push(size: float, angle: float, weight: float = 10.0) -> list[float]:
    """Along the table, under the weight; angle in degrees."""
    a = np.radians(angle)
    return [size * np.cos(a), size * np.sin(a), -weight]


# --- Lemke's method -------------------------------------------------------------------------------


def test_lemke_by_hand() -> None:
    """2 x + y = 5, x + 2 y = 6 with both positive: (4/3, 7/3); with q = (-5, 6) only x is: 5/2."""
    M = np.array([[2.0, 1.0], [1.0, 2.0]])
    assert lemke(M, np.array([-5.0, -6.0])) == pytest.approx([4 / 3, 7 / 3])
    assert lemke(M, np.array([-5.0, 6.0])) == pytest.approx([2.5, 0.0])
    assert lemke(M, np.array([1.0, 0.0])) == pytest.approx([0.0, 0.0])
    assert lemke(np.zeros((1, 1)), np.array([-1.0])) is None  # a ray: there is no solution
    assert lemke(M, np.array([-5.0, -6.0]), pivots=0) is None


def test_lemke_on_positive_definite_problems() -> None:
    rng = np.random.default_rng(2)
    for n in (3, 8, 20):
        A = rng.normal(size=(n, n))
        M, q = A @ A.T + 0.1 * np.eye(n) + (A - A.T), rng.normal(size=n)
        z = lemke(M, q)
        assert z is not None
        w = M @ z + q
        assert z.min() >= 0
        assert w.min() >= -1e-8
        assert np.abs(w * z).max() <= 1e-8
        assert z.any()


# --- pyramids ---------------------------------------------------------------------------------------


def test_pyramid_is_a_circle_along_its_edges_only() -> None:
    """mu W = 4 N along an edge; between two of four edges 4 / sqrt 2, so 3 N at 45 degrees is called SLIPS, wrongly."""
    block = table()
    assert pyramid_step(block, push(3.9, 0), edges=4).verdict is Verdict.HOLDS
    assert pyramid_step(block, push(4.1, 0), edges=4).verdict is Verdict.SLIPS
    assert pyramid_step(block, push(2.7, 45), edges=4).verdict is Verdict.HOLDS
    assert pyramid_step(block, push(3.0, 45), edges=4).verdict is Verdict.SLIPS
    assert check(block, push(3.0, 45)).verdict is Verdict.HOLDS
    assert pyramid_step(block, push(3.0, 45), edges=4, turn=np.pi / 4).verdict is Verdict.HOLDS
    assert pyramid_step(block, push(3.0, 45), edges=8).verdict is Verdict.HOLDS


def test_friction_of_a_pyramid_is_off_by_up_to_half_the_angle_of_its_edges() -> None:
    """10 N at 20 degrees: friction stays 4 N along the edge, the block veers off to atan2(3.42, 9.397 - 4)."""
    found = pyramid_step(table(), push(10, 20), edges=4)
    veers = np.arctan2(10 * np.sin(np.radians(20)), 10 * np.cos(np.radians(20)) - 4)
    assert found.verdict is Verdict.SLIPS
    assert found.friction_errors == pytest.approx([veers] * 4, abs=1e-5)
    assert veers < np.pi / 4
    for angle in range(0, 90, 10):
        errors = pyramid_step(table(), push(10, angle), edges=8).friction_errors
        assert np.nanmax(errors) <= np.pi / 8 + 1e-6


def test_pyramid_step_keeps_the_rest_of_the_model() -> None:
    for load, verdict in (([0, 0.99, 0], Verdict.HOLDS), ([0, 1.01, 0], Verdict.SLIPS)):
        assert pyramid_step(pinch(), load, edges=4).verdict is verdict
    assert pyramid_step(pinch().with_preload(None), [0, 0.1, 0]).verdict is Verdict.SLIPS
    assert pyramid_step(nest(), [0, 0, -100]).verdict is Verdict.HOLDS
    assert pyramid_step(nest(), [0, 0, 1]).verdict is Verdict.SLIPS
    coupled = load_grasp("fig1-coupled")
    held = pyramid_step(coupled, [0, 1, 0], edges=16)
    assert held.verdict is Verdict.HOLDS
    assert held.state is not None
    assert held.residuals is not None
    r = held.residuals
    assert max(r.object_balance, r.joint_balance, r.couplings, r.normal, r.cone, r.actuators) < 1e-5
    assert r.dissipation > 1e-4  # which is what the pyramid gets wrong
    assert held.unbalanced < 1e-5


def test_steps_that_cannot_be_posed_are_refused() -> None:
    with pytest.raises(InputError, match=r"edges.*is 5; an even number"):
        pyramid_step(pinch(), [0, 1, 0], edges=5)
    with pytest.raises(InputError, match=r"inertia.*is 0; a positive"):
        pyramid_step(pinch(), [0, 1, 0], inertia=0)
    with pytest.raises(InputError, match="six numbers"):
        pyramid_step(pinch(), ["a"])
    with pytest.raises(InputError, match=r"edges.*is 2; 3 or more"):
        turn_scheme(pinch(), [0, 1, 0], edges=2)
    with pytest.raises(InputError, match=r"turns.*is 0; 1 or more"):
        turn_scheme(pinch(), [0, 1, 0], turns=0)


# --- the scheme in turns -------------------------------------------------------------------------------


@scip
def test_turns_get_simple_grasps_right() -> None:
    for grasp, load, verdict in (
        (table(), push(3.9, 0), Verdict.HOLDS),
        (table(), push(4.1, 0), Verdict.SLIPS),
        (pinch(), [0, 0.99, 0], Verdict.HOLDS),
        (pinch(), [0, 1.01, 0], Verdict.SLIPS),
        (nest(), [0, 0, 1], Verdict.SLIPS),
    ):
        found = turn_scheme(grasp, load)
        assert found.verdict is verdict
        assert found.turns <= 3
    assert turn_scheme(table(), push(4.1, 0), turns=1).verdict is Verdict.UNDECIDED


@scip
def test_friction_pushes_along_the_motion_without_the_principle() -> None:
    """Fig. 1 under 1 N: the first turn balances it while the fingers close, with friction that helps them to slide."""
    grasp = load_grasp("fig1")
    found = turn_scheme(grasp, [0, 1, 0])
    assert found.verdict is Verdict.HOLDS
    assert found.state is not None
    assert np.nanmax(found.friction_errors) > np.pi / 2
    assert model.energy(grasp, np.array([0, 1.0, 0, 0, 0, 0]), found.state).created > 0
    assert found.residuals is not None
    assert found.residuals.dissipation > 1e-3
