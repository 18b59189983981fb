"""By how much the equations may be missed, and what that costs a proof."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.proofs.equations import RightSide, equations_of, power_near
from handfast.proofs.question import LARGEST_GOAL, TORQUES, Question, read_question
from handfast.proofs.tolerance import EPS
from tests.support.proof_states import pinch
from tests.support.small_grasp import small_grasp

JOINTS = [{"name": "a", "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": [0]}]


def side(q: Question, scalar: tuple[float, float] | None) -> RightSide:
    return RightSide.of(q, scalar, len(equations_of(q).E))


def largest(wrench: list[float]) -> Question:
    return pinch(wrench, goal=LARGEST_GOAL, direction=[0, 3, 0, 0, 0, 0])


def test_slack_is_of_the_base_load_and_growth_of_the_direction() -> None:
    found = side(largest([0, 0, 5, 0, 0, 0]), (1.0, 2.0))
    np.testing.assert_allclose(found.slack[:6], EPS * 5 * np.ones(6))
    np.testing.assert_allclose(found.growth[:6], EPS * 3 * np.ones(6))
    assert (found.scale, found.ends) == (5.0, (1.0, 2.0))


def test_without_a_base_load_there_is_slack_only_where_the_scalar_may_be_0() -> None:
    assert not side(largest([0] * 6), (1.0, 2.0)).slack.any()
    assert side(largest([0] * 6), (1.0, 2.0)).slip == 0
    assert side(largest([0] * 6), (0.0, 2.0)).slack[0] == EPS  # 1 N, as nothing acts
    assert side(largest([0] * 6), (-1.0, 2.0)).slack[0] == EPS


def test_without_a_load_slack_grows_with_the_commands_that_are_sought() -> None:
    """A slide of 2 N per newton of its motor; and one that is not sought is none."""
    mechanism = {"actuators": [{"name": "m", "joints": {"a": -2.0}}, {"name": "other", "joints": {"a": 9.0}}]}
    asked = {"joints": JOINTS, "mechanism": mechanism, "driven": ["m"]}
    found = side(pinch([0] * 6, goal=TORQUES, **asked), (0.5, 1.0))
    np.testing.assert_allclose(found.growth[:3], EPS * 2.0)
    assert found.scale == 2.0
    assert not side(pinch([1, 0, 0, 0, 0, 0], goal=TORQUES, **asked), (0.5, 1.0)).growth.any()


def test_multipliers_and_their_changes_cost_slack() -> None:
    q = pinch([0, 0, -2, 0, 0, 0])
    equations, given = equations_of(q), side(q, None)
    v = np.zeros((1, len(equations.E)))
    v[0, 0] = -3.0
    change, none = np.zeros_like(v), np.zeros((1, len(equations.of_contacts)))
    change[0, 1] = 0.5
    slack, growth = given.costs(equations, v, change, none, none)
    assert slack == pytest.approx(EPS * 2 * 3.5, rel=1e-6)
    assert slack >= EPS * 2 * 3.5
    assert growth == 0


def test_what_grows_is_worst_at_the_first_end_where_multipliers_grow_faster() -> None:
    given = side(largest([0, 0, 5, 0, 0, 0]), (1.0, 3.0))
    found = given.grown(np.array([2.0, 2.0, 2.0, 0.0]), np.array([2.5, 2.0, 1.0, -1.0]))
    np.testing.assert_allclose(found, [2.0, 2.0, 6.0, 0.0])
    endless = side(largest([0, 0, 5, 0, 0, 0]), (1.0, np.inf))
    assert endless.grown(np.array([0.0]), np.array([-1.0])).tolist() == [0.0]


def test_powers_of_two() -> None:
    assert power_near(np.array([0.0, 1.0, 1.4, 1.5, 6.0, 0.3])).tolist() == [1.0, 1.0, 1.0, 2.0, 8.0, 0.25]


SIZE = np.sqrt(0.09375)  # of the small grasp, and how far its middle (1/4, -1/8, 1/8) is from the origin


@pytest.mark.parametrize(
    ("rest", "off", "reach"),
    [
        ({0: 3, 1: 4, 3: -0.5, 4: 0.375, 5: 1.375}, {}, 5),  # a force at the middle has no torque there
        ({0: 3, 1: 4, 3: -0.5, 4: 0.375, 5: 1.375 + 2}, {}, 5 + 2 / SIZE),
        ({2: 3, 3: -0.375, 4: -0.75}, {}, 3),
        ({4: 2}, {}, 2 / SIZE),
        ({}, {2: 3}, 3 + 3),
        ({}, {3: 4}, 4 / SIZE),
        ({6: -2}, {}, 2 / SIZE),
        ({6: -2}, {6: 1}, 3 / SIZE),
    ],
)
def test_how_far_multipliers_reach_where_motions_are_1_by_hand(rest, off, reach) -> None:
    q = read_question({"grasp": small_grasp(), "goal": "check", "wrench": [0.0] * 6}, "q")
    made = equations_of(q)
    rho, more = np.zeros((1, made.columns.n)), np.zeros((1, made.columns.n))
    rho[0, list(rest)], more[0, list(off)] = list(rest.values()), list(off.values())
    assert reach <= made.reach(rho, more)[0] <= reach * (1 + 1e-8)


def test_exact_rows_are_the_rounded_ones() -> None:
    """Rows of (1) and (2), and motions, exactly and as floats: all numbers of the small grasp are dyadic."""
    q = read_question({"grasp": small_grasp(), "goal": "check", "wrench": [0.0] * 6}, "q")
    made = equations_of(q)
    for exact, rounded in zip(made._exact, (made.E, made.Z), strict=True):
        np.testing.assert_array_equal([[float(fmpq(x).p) / float(fmpq(x).q) for x in row] for row in exact], rounded)
    contacts = made.touching[:6]
    np.testing.assert_array_equal(made.E[:6, contacts], made.Z[:6, :6].T)  # (1) and (3) have the same G
    np.testing.assert_array_equal(made.E[6:9, contacts], -made.Z[:6, 6:9].T)


def test_leaves_together_reach_and_cost_what_each_alone_does() -> None:
    q = pinch([0, 0, -2, 0, 0, 0], joints=JOINTS)
    made, rng = equations_of(q), np.random.default_rng(0)
    (p, n), d = made.E.shape, len(made.of_contacts)
    given = replace(side(q, None), growth=np.full(p, 0.5), slip_growth=0.25, ends=(1.0, 3.0))
    rest, off = rng.normal(size=(4, n)), rng.uniform(size=(4, n))
    costs = rng.normal(size=(4, p)), rng.uniform(size=(4, p)), rng.normal(size=(4, d)), rng.uniform(size=(4, d))
    slack, grows = given.costs(made, *costs)
    for k in range(4):
        assert made.reach(rest[k : k + 1], off[k : k + 1])[0] == pytest.approx(made.reach(rest, off)[k])
        alone = given.costs(made, *(x[k : k + 1] for x in costs))
        assert (alone[0][0], alone[1][0]) == pytest.approx((slack[k], grows[k]))
    grown = given.grown(np.array([2.0, 2.0, 0.0, -1.0]), np.array([1.0, 2.0, -1.0, -2.0]))
    assert grown == pytest.approx([6, 2, 0, 0])


@pytest.mark.parametrize(
    ("joint", "arm"),
    [
        ({"type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0]}, 3),  # 1 of the object's way, turn and joint
        ({"type": "prismatic", "axis": [0.8, 0.6, 0], "origin": [0, 0, 0]}, 2.8),
        ({"type": "prismatic", "axis": [0, 1, 0], "origin": [0, 0, 0]}, 2),
        # 4 off the normal's line: 4 per unit of a turn, of which there is 1 / 2 where the size is 2
        ({"type": "revolute", "axis": [0, 0, 1], "origin": [0, 4, 0]}, 4),
    ],
)
def test_how_large_forces_are_where_motions_are_1_by_hand(joint: dict[str, Any], arm: float) -> None:
    """c_n is |d_n| at most, c_t half of it by friction; what no joint moves has 2."""
    made = equations_of(pinch([0, 0, -2, 0, 0, 0], size=2.0, joints=[{"name": "a", "moves": [0]} | joint]))
    zero = np.zeros((1, made.columns.n))

    def reach(force: int) -> float:
        rest = zero.copy()
        rest[0, made.columns.c.start + force] = -1.0
        return float(made.reach(rest, zero)[0])

    assert [reach(k) for k in range(6)] == pytest.approx([arm, arm / 2, arm / 2, 2, 1, 1], rel=1e-5)
