"""Scaling: nothing is lost, and questions that have no answer are refused in one line."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp
from handfast.stability.problem import model, scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.scaled_problem import ScaledPoint
from tests.support.problems import pinch, solved, table

Y6 = np.array([0, 1.0, 0, 0, 0, 0])


@pytest.mark.parametrize("seed", range(20))
def test_a_scaled_solution_is_a_solution(seed: int) -> None:
    """Scale a known state down, check the scaled equations, scale back: the same numbers."""
    s = solved(seed)
    p = scaled_problem.build(s.grasp, s.wrench)
    c, q = s.state.c / p.force, s.state.q * p.joint_scale / p.force
    r = s.state.r * np.r_[1, 1, 1, [p.length] * 3] / p.force
    f = s.state.f / (p.force * p.actuator_scale)
    np.testing.assert_allclose(p.G @ c + p.w0, 0, atol=1e-12)
    np.testing.assert_allclose(p.J.T @ c - p.R.T @ f, 0, atol=1e-12)
    d = model.relative_motion(s.grasp, s.state.r, s.state.q).reshape(-1, 3)
    np.testing.assert_allclose(p.relative_motion(r, q), d / p.force, atol=1e-9)
    back = p.unscale(ScaledPoint(r, q, c, f, np.zeros(0)))
    np.testing.assert_allclose(back.r, s.state.r, rtol=1e-12)
    np.testing.assert_allclose(back.f, s.state.f, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(p.command(p.f_c), s.grasp.command, rtol=1e-12)
    assert (p.f_c >= 0).all()


@pytest.mark.parametrize(
    ("wrench", "message"),
    [
        ([0, 1, 0, 0], "wrench: has 4 numbers; .*six are needed"),
        ([0, np.nan, 0, 0, 0, 0], "wrench: contains NaN or infinity"),
        (["a"] * 6, "wrench: needs six numbers"),
        ([0, 0, 0, 1.0, 0, 0], "wrench: cannot be balanced by any forces at these 2 contacts .*rank 5 of 6"),
    ],
)
def test_bad_wrenches(wrench: list, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scaled_problem.build(pinch(), np.array(wrench))


def test_other_refusals() -> None:
    with pytest.raises(InputError, match="direction: is zero, or next to it; give a force"):
        scaled_problem.build(pinch(), np.zeros(6), np.zeros(6))
    with pytest.raises(InputError, match="eta: is 50 degrees; 0 to 45"):
        scaled_problem.build(pinch(), Y6, limits=GraspLimits(eta=np.radians(50)))
    with pytest.raises(InputError, match="eta: needs the maximum dissipation principle"):
        scaled_problem.build(pinch(), Y6, limits=GraspLimits(eta=0.05), mdp=False)
    with pytest.raises(InputError, match="force limit: is -1; a largest normal force is positive"):
        scaled_problem.build(pinch(), Y6, limits=GraspLimits(force_limit=-1.0))
    with pytest.raises(InputError, match="torque limit: unknown actuator 'thumb'; known: right, left"):
        scaled_problem.build(pinch(), Y6, limits=GraspLimits(torque_limits={"thumb": 1.0}))
    with pytest.raises(InputError, match=r"torque limit.right: is 0; a limit is positive"):
        scaled_problem.build(pinch(), Y6, limits=GraspLimits(torque_limits={"right": 0.0}))


def test_one_contact_and_no_joints_are_grasps_too() -> None:
    one = Grasp([Contact(np.zeros(3), np.array([0, 0, 1.0]), 0.5)])
    assert scaled_problem.build(one, np.array([0, 0, -1.0, 0, 0, 0])).sizes == (1, 0, 0, 0)
    assert scaled_problem.build(table(), np.array([0, 0, -1.0, 0, 0, 0])).sizes == (4, 0, 0, 0)
