"""What motors, and all else that holds joints, can do at most on a motion of these: by hand."""

from __future__ import annotations

import re
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast import load_hand
from handfast.planning.results.grasps_file import motors_to_dict
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Interval
from handfast.proofs.motors import STOP_INFLATION, Motors
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded_task import task_to_dict
from tests.support.holds import grip

NONE = {"friction": 0.0, "stiffness": 0.0, "rest": [0.0, 0.0], "stops": [None, None]}


def work(
    rates: Sequence[float],
    limits: dict[str, float],
    actuators: list[dict[str, Any]] | None = None,
    at: Sequence[Sequence[float]] = ((0.01, 0.02), (0.01, 0.02)),
    command: float = np.inf,
    **laws: Any,
) -> float:
    """On motions of left_slide and right_slide; laws: of left_slide."""
    task = read_task(task_to_dict(grip(0.05)))
    named = actuators or [{"name": "grip", "joints": {"left_slide": 1.0}}]
    said: dict[str, Any] = {"actuators": named}
    said |= {"laws": {"left_slide": NONE | laws}} if laws else {}
    motors = Motors.read(Fields(said), task, limits, command)
    joints = Interval.between(*np.array(at).T)
    return float(motors.work(Interval.of(np.array(rates)[None]), joints[None])[0])


def test_a_motor_does_its_limit_times_its_motion_either_way() -> None:
    assert work([0.5, 0.0], {"grip": 20.0}) == pytest.approx(10.0)
    assert work([-0.5, 0.0], {"grip": 20.0}) == pytest.approx(10.0)
    assert work([0.0, 3.0], {"grip": 20.0}) == pytest.approx(0.0, abs=1e-200)


def test_gearing_without_a_limit_does_any_work_where_it_moves() -> None:
    assert np.isinf(work([1e-9, 0.0], {}))
    assert work([0.0, 1.0], {}) == pytest.approx(0.0, abs=1e-200)


def test_a_tendon_only_pulls() -> None:
    """Its row is 2 left - right; on motions against its pull it does nothing, with or without a limit."""
    tendon = [{"name": "t", "joints": {"left_slide": 2.0, "right_slide": -1.0}, "tendon": True}]
    assert work([1.0, 0.5], {"t": 4.0}, tendon) == pytest.approx(6.0)
    assert work([-1.0, 0.5], {"t": 4.0}, tendon) == pytest.approx(0.0, abs=1e-200)
    assert work([-1.0, 0.5], {}, tendon) == pytest.approx(0.0, abs=1e-200)
    assert np.isinf(work([1.0, 0.5], {}, tendon))


def test_several_motors_add_up() -> None:
    two = [{"name": n, "joints": {f"{n}_slide": 1.0}} for n in ("left", "right")]
    assert work([1.0, -2.0], {"left": 3.0, "right": 5.0}, two) == pytest.approx(13.0)


def test_a_motor_that_is_turned_back_gives_no_more_than_either_limit() -> None:
    back = [{"name": "grip", "joints": {"left_slide": 1.0}, "backdrivable": True}]
    assert work([1.0, 0.0], {}, back, command=7.0) == pytest.approx(7.0)
    assert work([1.0, 0.0], {"grip": 5.0}, back, command=7.0) == pytest.approx(5.0)
    assert np.isinf(work([1.0, 0.0], {}, command=7.0))


def test_friction_resists_either_way_and_springs_without_a_limit() -> None:
    assert work([-0.5, 0.0], {"grip": 20.0}, friction=4.0) == pytest.approx(12.0)
    assert np.isinf(work([0.5, 0.0], {"grip": 20.0}, stiffness=1.0))
    assert work([0.0, 0.5], {"grip": 20.0}, stiffness=1.0) == pytest.approx(0.0, abs=1e-200)


@pytest.mark.parametrize(("stops", "up", "down"), [([0.01, None], True, False), ([None, 0.02], False, True)])
def test_a_stop_pushes_away_from_itself(stops: list[float | None], up: bool, down: bool) -> None:
    """The left slide is between 10 and 20 mm; a stop counts within 0.1 mm."""
    for sense, leans in ((1.0, up), (-1.0, down)):
        assert np.isinf(work([sense, 0.0], {"grip": 20.0}, stops=stops)) == leans
        beyond = [None if end is None else end + side * 0.9e-4 for end, side in zip(stops, (-1, 1), strict=True)]
        assert np.isinf(work([sense, 0.0], {"grip": 20.0}, stops=beyond)) == leans
        away = [None if end is None else end + side * 1.1e-4 for end, side in zip(stops, (-1, 1), strict=True)]
        assert work([sense, 0.0], {"grip": 20.0}, stops=away) == pytest.approx(20.0)


@pytest.mark.parametrize(("revolute", "near"), [(True, 1e-3), (False, 1e-4)])
def test_how_near_a_stop_counts(revolute: bool, near: float) -> None:
    """Within `near` of it and 1e-9 of its value, for rounding."""
    task = SimpleNamespace(hand=SimpleNamespace(joints=("a", "b", "c"), revolute=[revolute] * 3))
    laws = {"a": {"stops": [1e6, -1e6]}, "b": {"stops": [None, 0.0]}, "c": {}}
    actuators = [{"name": "m", "joints": {"b": 2.0}}]
    motors = Motors.read(Fields({"actuators": actuators, "laws": laws}), task, {})  # type: ignore[arg-type]
    assert (motors.rows.tolist(), motors.friction.tolist(), motors.sprung.any()) == (
        [[0.0, 2.0, 0.0]],
        [0.0] * 3,
        False,
    )
    stops = motors.stops
    assert stops[1:].tolist() == [[-np.inf, -near * STOP_INFLATION], [-np.inf, np.inf]]
    assert stops[0] == pytest.approx([1e6 + 1e-3 + near, -1e6 - 1e-3 - near], abs=1e-8)


@pytest.mark.parametrize(
    ("rate", "most"),
    [
        ([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 0.0),
        ([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]], np.inf),  # away from the lower stop
        ([[-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 2.0),  # against it: friction alone
        ([[0.0, 0.0], [-1.0, 0.0], [0.0, 0.0]], np.inf),
        ([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]], 0.0),
        ([[0.0, 0.0], [0.5, 1.0], [0.0, 0.0]], 0.0),
        ([[0.0, 0.0], [0.0, 0.0], [0.0, 3.0]], 15.0),  # the first motor's limit
    ],
)
def test_each_motion_alone(rate: list[list[float]], most: float) -> None:
    """Joints at a lower stop, at an upper one, and free, exactly; beside it a motion with any work."""
    motors = Motors(
        rows=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), tendon=np.zeros(3, dtype=bool),
        limits=np.array([5.0, np.inf, np.inf]), friction=np.array([2.0, 0.0, 0.0]), sprung=np.zeros(3, dtype=bool),
        stops=np.array([[0.1, np.inf], [-np.inf, 0.2], [-np.inf, np.inf]]),
    )  # fmt: skip
    rates = np.array([rate, [[1.0, 1.0]] * 3])
    joints = Interval.between(np.array([0.1, 0.1, 0.0]), np.array([0.15, 0.2, 0.0]))
    found = motors.work(Interval.between(*rates.transpose(2, 0, 1)), joints[None])
    assert found.tolist() == [pytest.approx(most, rel=1e-14, abs=1e-200), np.inf]


def test_one_of_several_motors_or_joints_moves() -> None:
    """Without a limit, whatever the other actuator does; a differential moves where one joint does."""
    two = [{"name": n, "joints": {f"{n}_slide": 1.0}} for n in ("left", "right")]
    assert np.isinf(work([1.0, 0.0], {}, two))
    both = [{"name": "t", "joints": {"left_slide": 1.0, "right_slide": 1.0}}]
    assert work([1.0, 0.0], {"t": 4.0}, both) == pytest.approx(4.0)
    apart = Motors(np.eye(2), np.zeros(2, dtype=bool), np.full(2, np.inf), np.zeros(2), np.zeros(2, dtype=bool),
                   np.tile([-np.inf, np.inf], (2, 1)))  # fmt: skip
    rates = Interval.of(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert apart.work(rates, Interval.of(np.zeros((2, 2)))).tolist() == [pytest.approx(0.0, abs=1e-200), np.inf]


def test_passive_tendons_push_without_a_limit() -> None:
    task = read_task(task_to_dict(grip(0.05)))
    said = {"actuators": [], "tendons": {"t": {"joints": {"right_slide": 1.0}}}}
    motors = Motors.read(Fields(said), task, {})
    assert motors.sprung.tolist() == [name == "right_slide" for name in task.hand.joints]
    assert (motors.rows.shape, motors.tendon.dtype) == ((0, len(task.hand.joints)), bool)


@pytest.mark.parametrize(
    ("said", "field", "problem"),
    [
        ({"actuators": [{"name": "a", "joints": {"elbow": 1.0}}]}, "actuators[0].joints", "joint 'elbow'"),
        ({"actuators": [], "laws": {"elbow": {}}}, "laws", "joint 'elbow'"),
        ({"actuators": [], "tendons": {"t": {"joints": {"elbow": 1.0}}}}, "tendons", "joint 'elbow'"),
        ({"actuators": [], "laws": {"left_slide": {"friction": -1.0}}}, "laws.left_slide.friction", "-1"),
        *(
            ({"actuators": [], "laws": {"left_slide": {"stops": stops}}}, "laws.left_slide.stops", problem)
            for stops, problem in (
                (False, "is False; the lower and the upper one are needed, null for none"),
                (3, "is 3; the lower and the upper one are needed, null for none"),
                ("ab", "is 'ab'; the lower and the upper one are needed, null for none"),
                ({"a": 1, "b": 2}, "is {'a': 1, 'b': 2}; the lower and the upper one are needed, null for none"),
                ([], "is []; the lower and the upper one are needed, null for none"),
                ([0.0, 0.1, 0.2], "is [0.0, 0.1, 0.2]; the lower and the upper one are needed"),
                ([None, {}], "is {}; a finite number is needed"),
                ([True, None], "is True; a finite number is needed"),
                (["0", None], "is '0'; a finite number is needed"),
            )
        ),
    ],
)
def test_faults_of_motors(said: dict[str, Any], field: str, problem: str) -> None:
    with pytest.raises(BadFile, match=rf"\A{re.escape(field)}: .*{re.escape(problem)}"):
        Motors.read(Fields(said), read_task(task_to_dict(grip(0.05))), {})


def test_a_hand_without_joints_has_motors_that_move_nothing() -> None:
    data = task_to_dict(grip(0.05))
    data["hand"] |= {"joints": [], "couplings": [], "links": [link | {"joints": []} for link in data["hand"]["links"]]}
    task = read_task(data)
    for actuators, a in (([], 0), ([{"name": "a", "joints": {}}], 1)):
        motors = Motors.read(Fields({"actuators": actuators}), task, {})
        assert (motors.rows.shape, motors.stops.shape) == ((a, 0), (0, 2))
        nothing = Interval.of(np.zeros((2, 0)))
        assert motors.work(nothing, nothing).tolist() == [pytest.approx(0.0, abs=1e-200)] * 2


def test_stops_that_are_not_said_are_none() -> None:
    task = read_task(task_to_dict(grip(0.05)))
    for law in ({}, {"stops": None}, {"stops": [None, None]}):
        assert np.isinf(Motors.read(Fields({"actuators": [], "laws": {"left_slide": law}}), task, {}).stops).all()
    # 0.1 mm before the stop of a slide at 20 mm, and 1e-9 more of all
    (lower, upper), *_ = Motors.read(
        Fields({"actuators": [], "laws": {"left_slide": {"stops": [0.02, None]}}}), task, {}
    ).stops.tolist()
    assert (lower, upper) == (pytest.approx(0.0201 + 2e-11, abs=1e-12), np.inf)


def test_bundled_hands_can_be_read() -> None:
    task = read_task(task_to_dict(grip(0.05)))
    motors = Motors.read(Fields(motors_to_dict(load_hand("parallel-gripper"))), task, {"grip": 60.0})
    assert motors.limits.tolist() == [60.0]
