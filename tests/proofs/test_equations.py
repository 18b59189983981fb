"""By how much the equations may be missed, and what that costs a proof."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.proofs.equations import RightSide, equations_of, power_near
from handfast.proofs.grasp import StartData
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


def test_tiny_multipliers_cost_what_they_slip() -> None:
    """By 3 and 4 in two directions, times 1e-170, of which squares are 0 in floats."""
    q = pinch([0, 0, 2, 0, 0, 0])
    equations, given = equations_of(q), replace(side(q, None), slip=1.0)
    z = np.zeros((1, len(equations.of_contacts)))
    z[0, 1:3] = 3e-170, 4e-170
    v = np.zeros((1, len(equations.E)))
    (slack,), _ = given.costs(equations, v, v, z, 0 * z)
    assert 5e-170 <= slack <= 5e-170 * (1 + 1e-6)


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
        ({4: 2e-170}, {}, 2e-170 / SIZE),  # of which the square is 0 in floats
        ({}, {2: 3e-170}, 6e-170),
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


# --- one contact, two joints, all numbers by hand --------------------------------------------------------------
#
# The contact is at (1/2, 0, 1/4) with the normal z, t1 = y, t2 = -x. Joint a slides along z, b turns about y through
# (0, 0, 1/4), so that it moves the contact down by 1/2; 3/4 N m are given to it. Motor m moves a and b by (-2, 1/2),
# and is commanded -3/2, so that it is mirrored; lock moves b by 4, and is commanded nothing. a and b are coupled.

SLIDE: dict[str, Any] = {"name": "a", "type": "prismatic", "axis": [0, 0, 1], "origin": [0, 0, 0], "moves": [0]}
TURN: dict[str, Any] = {"name": "b", "axis": [0, 1, 0], "origin": [0, 0, 0.25], "moves": [0], "torque": 0.75}
GEARED: dict[str, Any] = {
    "actuators": [{"name": "m", "joints": {"a": -2.0, "b": 0.5}}, {"name": "lock", "joints": {"b": 4.0}}],
    "couplings": [{"a": 3, "b": -1}],
}


def one_contact(goal: str = "check", mechanism: Any = GEARED, torsion: float = 0.0, **more: Any) -> Question:
    point = {"position": [0.5, 0, 0.25], "normal": [0, 0, 1], "friction": 0.5, "torsion": torsion}
    grasp = {"schema": "handfast/grasp/1", "contacts": [point], "joints": [SLIDE, TURN]}
    grasp |= {"preload": {"m": -1.5}, "mechanism": mechanism}
    wrench = [0, 0, 0 if goal == "smallest preload" else -2, 0, 0, 0]
    return read_question({"grasp": grasp, "goal": goal, "wrench": wrench} | more, "q")


ROWS_OF_LOAD: list[list[float]] = [  # over c_n, c_t1, c_t2
    [0, 0, -1],
    [0, 1, 0],
    [1, 0, 0],
    [0, -0.25, 0],
    [-0.5, 0, -0.25],
    [0, 0.5, 0],
]
ROWS_OF_JOINTS: list[list[float]] = [
    [1, 0, 0, -2, 0, -3],
    [-0.5, 0, 0, 0.5, -4, 1],
]  # over c, f of m and lock, the coupling's multiplier
MOTIONS: list[list[float]] = [
    [0, 0, 1, 0, -0.5, 0, -1, 0.5],
    [0, 1, 0, -0.25, 0, 0.5, 0, 0],
    [-1, 0, 0, 0, -0.25, 0, 0, 0],
]
TORSION = [0, 0, 0, 0, 0, 0.5]  # over its lever of 1/2 m, about z


@pytest.mark.parametrize(
    ("goal", "more", "scalar", "efforts"),
    [
        ("check", {}, None, 0),
        ("check", {"torsion": 0.25}, None, 0),
        ("largest", {"direction": [1, 2, 3, 4, 5, 6]}, [1, 2, 3, 4, 5, 6, 0, 0], 0),
        ("torques", {"driven": ["m"]}, [0] * 8, 0),
        ("torques", {"driven": ["m"], "objective": "sum", "torsion": 0.25}, [0] * 8, 2),
        ("smallest preload", {"direction": [1, 2, 3, 4, 5, 6]}, [0] * 7 + [-0.75], 0),
    ],
)
def test_equations_of_one_contact_by_hand(goal: str, more: Any, scalar: Any, efforts: int) -> None:
    made, soft = equations_of(one_contact(goal, **more)), "torsion" in more
    s = 14 + (scalar is not None)
    E = np.zeros((10 + (efforts > 0), s + efforts + soft))
    E[:6, 8:11], E[6:8, 8:14], E[8, 6:8], E[9, 7] = ROWS_OF_LOAD, ROWS_OF_JOINTS, [3, -1], 4
    if scalar is not None:
        E[:8, 14] = scalar
    if efforts:
        E[10, 14], E[10, 15] = 1, -1  # the scalar is the effort of m
    Z = np.zeros((6 + soft, E.shape[1]))
    Z[:3, :8], Z[3, 6:8], Z[4, 7], Z[5, 7] = MOTIONS, [2, -0.5], 4, 0.75
    if soft:
        E[:6, -1] = Z[6, :6] = TORSION
    assert made.E.tolist() == E.tolist()
    assert made.Z.tolist() == Z.tolist()
    assert (made.E_size >= np.abs(E)).all()
    assert (made.E_size[:, 11:14] == np.abs(E[:, 11:14])).all()
    assert (made.E_size[8:] == np.abs(E[8:])).all()
    assert (made.Z_size >= np.abs(Z)).all()
    about = np.eye(len(E))
    about[:3, 3:6] = [[0, 0.25, 0], [-0.25, 0, 0.5], [0, -0.5, 0]]
    assert made.about.tolist() == about.tolist()
    assert made.of_contacts.tolist() == [0, 1, 2, *[6] * soft]
    assert made.touching.tolist() == [8, 9, 10, *[E.shape[1] - 1] * soft]
    assert np.flatnonzero(made.reached).tolist() == [*range(11), *[E.shape[1] - 1] * soft]
    assert made.moved.tolist() == [[True] * 8 + [False] * (E.shape[1] - 8)]
    scale = [1, 1, 1, 4, 2, 2, 1 / 4, 1 / 4, 1, 1, 1, 1 / 2, 1 / 4, 1 / 4]
    assert made.scale[:14].tolist() == scale
    assert made.unit[6:10].tolist() == [1] * 4
    arms = [0] * 6 + [1, 2] + [x * (1 + 0.5e-6) for x in (4, 2, 2)]  # 2, and 1 + 1 by each joint
    assert made._arms[:11] == pytest.approx(arms, rel=1e-6)
    assert made._arms[8] >= 4
    assert not made._arms[11 : E.shape[1] - soft].any()
    if soft:
        assert (made.scale[-1], made._arms[-1]) == (2, pytest.approx(2, rel=1e-5))
    ((contact, joints),) = made.dependent_joints
    assert (contact, np.flatnonzero(joints).tolist()) == (0, [6, 7])
    assert (made.rank_at(0, (6, 7)), made.rank_at(0, (0, 1, 2)), made.rank_at(0, (7,))) == (1, 3, 1)
    rows = made.exact_rows(np.eye(E.shape[1] + len(Z))[[7, E.shape[1] + 1]], np.array([1, 6]), np.array([5, 7, 9, 13]))
    assert rows == [[0, 1, 0, 0], [fmpq(1, 2), 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, -3]]


def test_efforts_of_motors_with_a_joint_of_their_own_are_solved() -> None:
    """(2) says what they are; of two on one joint the first."""
    plain = [{"name": "m", "joints": {"b": -1}}, {"name": "n", "joints": {"a": 1}}, {"name": "o", "joints": {"b": 1}}]
    made = equations_of(one_contact(mechanism={"actuators": plain, "couplings": []}))
    assert [x.tolist() for x in made.solved] == [[6, 7], [12, 11]]
    left = made.E * made.scale / made.unit[:, None]
    left[[6, 7]], left[:, [11, 12]] = 0, 0
    assert left @ made.inverse @ left == pytest.approx(left, abs=1e-12)
    assert made.inverse @ left @ made.inverse == pytest.approx(made.inverse, abs=1e-12)
    geared = equations_of(one_contact())
    assert [x.tolist() for x in geared.solved] == [[], []]
    E = geared.E * geared.scale / geared.unit[:, None]
    assert E @ geared.inverse @ E == pytest.approx(E, abs=1e-12)


@pytest.mark.parametrize(
    ("goal", "more", "ends", "load", "grows"),
    [
        ("check", {}, None, 2, 0),
        ("largest", {"direction": [0, 3, 0, 0, 0, 0]}, (1.0, 2.0), 2, 3 * 1.25**0.5),  # by its torque over 1/2 m
        ("largest", {"direction": [0, 3, 0, 0, 0, 0], "wrench": [0] * 6}, (1.0, 2.0), 0, 3 * 1.25**0.5),
        ("largest", {"direction": [0, 3, 0, 0, 0, 0], "wrench": [0] * 6}, (0.0, 2.0), 3, 3 * 1.25**0.5),
        ("largest", {"direction": [0, 3, 0, 0, 0, 0], "wrench": [0] * 6}, (-2.0, 0.0), 3, 3 * 1.25**0.5),
        ("largest", {"direction": [0, 3, 0, 0, 0, 0], "wrench": [0] * 6}, None, 0, 3 * 1.25**0.5),
        ("smallest preload", {"direction": [0, 0, 5, 0, -2.5, 0]}, (1.0, 2.0), 5, 0),
        ("torques", {"driven": ["m"]}, (1.0, 2.0), 2, 0),
        ("torques", {"driven": ["m"], "wrench": [0] * 6}, (1.0, 2.0), 3, 2),  # what is commanded, by arms of 1, 1/2 m
    ],
)
def test_how_far_equations_may_be_missed_by_hand(goal: str, more: Any, ends: Any, load: float, grows: float) -> None:
    q = one_contact(goal, **({"wrench": [0, 0, -2, 0, 1, 0]} | more if goal != "smallest preload" else more))
    found = side(q, ends)
    units = np.array([1, 1, 1, 0.5, 0.5, 0.5, 1, 0.5, 0, 0])
    assert found.slack == pytest.approx(EPS * load * units)
    assert found.growth == pytest.approx(EPS * grows * units)
    assert (found.slip, found.slip_growth) == pytest.approx((EPS * load, EPS * grows))
    assert found.energy == pytest.approx(1e-6 * load**2)
    assert found.scale == pytest.approx(max(load, grows))
    assert found.ends == (ends or (0.0, 0.0))
    preload = goal == "smallest preload"
    base = q.direction if preload else q.wrench
    assert found.h.tolist() == [*(-base).tolist(), 0, 0 if preload else 0.75, 0, 0]
    assert found.exact == [fmpq(*float(x).as_integer_ratio()) for x in found.h]


def test_what_slack_costs_by_hand() -> None:
    """Multipliers of forces act about the centroid; motions at a contact and its turning count as one vector."""
    q = one_contact(torsion=0.25)
    made = equations_of(q)
    given = replace(side(q, None), slack=np.arange(1.0, 11), growth=np.full(10, 2.0), slip=0.5, slip_growth=0.25)
    v, z = np.zeros((1, 10)), np.array([[2.0, -4, 5, 6]])
    v[0, [0, 4, 7]] = 1, -4, 3
    none = np.zeros_like(v), np.zeros_like(z)
    # v_force + v_torque x centroid: (1 - 4 / 4, 0, 4 / 2); then 4 of y and 3 of b. z has the length 9
    slack, growth = given.costs(made, v, none[0], z, none[1])
    assert slack == pytest.approx([2 * 3 + 4 * 5 + 3 * 8 + 9 * 0.5])
    assert growth == pytest.approx([2 * (2 + 4 + 3) + 9 * 0.25])
    assert slack[0] >= 54.5
    assert growth[0] >= 20.25
    # changes of 1 of the torque about y: 1/4 and 1/2 of forces besides; and of motions to (0, 3, 4) and 0
    changed = np.eye(10)[4:5]
    slack, growth = given.costs(made, none[0], changed, np.array([[0, -2.0, 0, 0]]), np.array([[0, 1.0, 4, 0]]))
    assert slack == pytest.approx([1 / 4 + 3 / 2 + 5 + 5 * 0.5])
    assert growth == pytest.approx([2 * (1 / 4 + 1 / 2 + 1) + 5 * 0.25])


def test_ranks_are_those_of_each_contact() -> None:
    """The slide moves the first contact along its normal."""
    made = equations_of(pinch([0, 0, -2, 0, 0, 0], joints=JOINTS))  # type: ignore[arg-type]
    assert [made.rank_at(k, (6,)) for k in (0, 1)] == [1, 0]
    assert [made.rank_at(k, (0, 1, 2)) for k in (0, 1)] == [3, 3]
    assert made.dependent_joints == []


@pytest.mark.parametrize("weight", [0.25, 8.0])
def test_without_a_load_slack_grows_as_a_weak_motor_does(weight: float) -> None:
    weak = {"actuators": [{"name": "m", "joints": {"a": weight}}, {"name": "n", "joints": {"b": 1.0}}], "couplings": []}
    asked = {"wrench": [0] * 6, "driven": ["m"]}
    assert side(one_contact("torques", weak, **asked), (0.5, 1.0)).slip_growth == pytest.approx(EPS * weight)
    by_turn = side(one_contact("torques", weak, **asked | {"driven": ["n"]}), (0.5, 1.0))
    assert by_turn.slip_growth == pytest.approx(EPS * 2)  # at 1/2 m
    none = side(one_contact("torques", weak, **asked | {"driven": []}), (0.5, 1.0))
    assert none.slip_growth == 0


def test_what_grows_is_rounded_up() -> None:
    given = side(largest([0, 0, 5, 0, 0, 0]), (1.0, 3.0))
    assert 6 < given.grown(np.array([2.0]), np.array([1.0]))[0] < 6 + 1e-8


def test_contacts_press_by_what_they_were_apart_before() -> None:
    """In a step all normal forces may be larger, though only one contact was apart."""
    q = pinch([0, 0, -2, 0, 0, 0], joints=JOINTS)  # type: ignore[arg-type]
    start = StartData(np.array([0.25, 0.0]), np.zeros(1), np.zeros(1))
    step = replace(q, grasp=q.grasp.with_start(start))
    arms, more = (equations_of(asked)._arms[equations_of(asked).columns.c] for asked in (q, step))
    assert more - arms == pytest.approx(np.array([1, 0.5, 0.5] * 2))


@pytest.mark.parametrize(("aside", "seem"), [(1e-10, True), (1e-8, False)])
def test_joints_that_seem_to_move_a_contact_alike(aside: float, seem: bool) -> None:
    """Two slides, one a little aside of the other; a third one moves the other contact alone."""
    slides = [
        {"name": name, "type": "prismatic", "axis": axis, "origin": [0, 0, 0], "moves": [k]}
        for name, axis, k in (("a", [1, 0, 0], 0), ("b", [1, aside, 0], 0), ("c", [1, 0, 0], 1))
    ]
    made = equations_of(pinch([0, 0, -2, 0, 0, 0], joints=slides))  # type: ignore[arg-type]
    found = [(k, np.flatnonzero(joints).tolist()) for k, joints in made.dependent_joints]
    assert found == ([(0, [6, 7])] if seem else [])
    assert made.rank_at(0, (6, 7)) == 2


def test_torques_of_one_joint_are_given_exactly() -> None:
    """0.1 and 0.2 add up to no float; nothing is given to the other joint."""
    spring, back = SLIDE | {"torque": 0.1}, {"name": "m", "joints": {"a": 1.0}, "backdrivable": True}
    point = {"position": [0.5, 0, 0.25], "normal": [0, 0, 1], "friction": 0.5}
    plain = {name: x for name, x in TURN.items() if name != "torque"}
    grasp = {"schema": "handfast/grasp/1", "contacts": [point], "joints": [spring, plain], "preload": {"m": 0.2}}
    grasp |= {"mechanism": {"actuators": [back], "couplings": []}}
    exact = fmpq(*(0.1).as_integer_ratio()) + fmpq(*(0.2).as_integer_ratio())
    q = read_question({"grasp": grasp, "goal": "check", "wrench": [0.0] * 6}, "q")
    assert side(q, None).exact[6:8] == [exact, 0]
    least = read_question(
        {"grasp": grasp, "goal": "smallest preload", "wrench": [0.0] * 6, "direction": [1.0] * 6}, "q"
    )
    made = equations_of(least)
    none = np.zeros((0, made.columns.n + len(made.Z)))
    assert made.exact_rows(none, np.array([6, 7]), np.array([made.columns.scalar.start])) == [[-exact], [0]]


def test_rows_about_the_middle_of_the_contacts_and_their_units() -> None:
    point = {"position": [0.5, 0.25, 0.125], "normal": [0, 0, 1], "friction": 0.5}
    joints = [TURN | {"torque": 64.0}]
    grasp = {"schema": "handfast/grasp/1", "contacts": [point], "joints": joints}
    grasp |= {"mechanism": {"actuators": [], "couplings": []}}
    made = equations_of(read_question({"grasp": grasp, "goal": "check", "wrench": [0.0] * 6}, "q"))
    assert made.about[:3, 3:6].tolist() == [[0, 0.125, -0.25], [-0.125, 0, 0.5], [0.25, -0.5, 0]]
    assert made.scale[6] == 2  # it moves the contact by 1/2 and 1/8; what is given to it is no motion
    assert equations_of(one_contact()).unit.tolist() == [1, 1, 1, 0.25, 0.5, 0.5, 1, 1, 1, 1]


def test_units_of_sliders_are_the_least_of_joints() -> None:
    q = read_question({"grasp": small_grasp(), "goal": "check", "wrench": [0.0] * 6}, "q")
    units = equations_of(q).joint_units
    assert units[:3].tolist() == q.grasp.joint_units.tolist()
    assert units[3] == units[:3].min() < units[:3].max()
