"""How hard a hand can push: cases derived by hand, and the definition in plain numbers at random configurations."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import Loads, Reach, Task, check, grasp_for, load_hand, load_task, verify
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.model.body import Body
from handfast.model.region import Bezier, Cap
from handfast.model.shape import Shape
from handfast.planning.question import PlanLimits
from handfast.planning.results.folder import GraspFolder
from handfast.planning.results.grasps_file import motors_to_dict
from handfast.proofs.contact_force_limits import LeverArm, contact_force_limits, least_arm
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Interval
from handfast.proofs.motors import Motors
from handfast.proofs.tasks import TaskData, read_task
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair
from tests.support.holds import flat_grip, grip, pinch, square


def data(task: Task) -> TaskData:
    return read_task(json.loads(json.dumps(task_to_dict(task))))


def limits(task: Task, torques: dict[str, float], friction: float = 0.5, laws: str = "none", **how: Any) -> Array:
    hand = task.hand.with_laws(laws)
    motors = json.loads(json.dumps(motors_to_dict(hand) | how.pop("motors", {})))
    return contact_force_limits(data(task), Motors.read(Fields(motors), data(task), torques, **how), friction).most


# --- jaws ---------------------------------------------------------------------------------------------


def test_flat_jaws_push_as_hard_as_their_motor() -> None:
    assert limits(flat_grip(0.05), {"grip": 20.0}) == pytest.approx([20.0, 20.0])


def test_round_jaws_may_push_at_an_angle() -> None:
    """At 1 rad from the jaw's motion a force within its friction cone may be square to it: no limit."""
    assert np.isinf(limits(grip(0.05), {"grip": 20.0}, friction=0.7)).all()
    arm = np.cos(1) - 0.2 * np.sin(1)
    gentle = limits(grip(0.05), {"grip": 20.0}, friction=0.2)
    assert (gentle >= 20.0 / arm).all()
    assert (gentle <= 20.0 / arm / 0.85).all()


@pytest.mark.parametrize("times", [0.25, 4.0])
def test_forces_are_in_proportion_to_torques(times: float) -> None:
    names = flat_grip(0.05).hand.mechanism.actuators
    one, other = (limits(flat_grip(0.05), dict.fromkeys(names, x)) for x in (20.0, 20.0 * times))
    assert other == pytest.approx(times * one, rel=1e-12)


def test_what_is_not_limited() -> None:
    task = flat_grip(0.05)
    names = task.hand.mechanism.actuators
    most = dict.fromkeys(names, 20.0)
    assert np.isinf(limits(task, {})).all()  # gearing carries anything
    assert np.isinf(limits(task, {}, command_limit=1.0)).all()
    joints = task.hand.joint_names

    def of_laws(**law: Any) -> Array:
        each = {"friction": 0.0, "stops": [None, None]} | law
        return limits(task, most, motors={"laws": {joint: dict(each) for joint in joints}})

    assert np.isinf(of_laws(stiffness=5.0)).all()
    assert np.isinf(of_laws(stops=[0.0, None])).all()  # an open finger leans on its stop
    assert np.isinf(of_laws(stops=[-0.9e-4, 0.04])).all()  # a slide within 0.1 mm of its stop stands at it
    assert of_laws(stops=[-1.1e-4, 0.04]) == pytest.approx([20.0, 20.0])  # one that is closed pushes less for it
    assert of_laws(friction=3.0) == pytest.approx([26.0, 26.0])  # of both fingers
    assert np.isinf(limits(task, most, laws="all")).all()
    tendon = {"tendons": {"t": {"joints": dict.fromkeys(joints, 1.0), "stiffness": 1.0}}}
    assert np.isinf(limits(task, most, motors=tendon)).all()


@pytest.mark.slow
def test_a_stop_beside_the_joint_ranges_of_the_task_carries_too() -> None:
    """30 um off its stop a slide stands at it, as `JointLaw.stop` says of all within 0.1 mm: it carries any force.

    Ranges of a task that begin there are no ranges without the stop. The grasp holds 100 N while the motor gives 1 N,
    which is proved; that no forces up to 1.29 N balance them would be proved of the same question.
    """
    pairs = []
    for side, link, z in ((1.0, "left_finger", 0.045), (-1.0, "right_finger", 0.033), (-1.0, "right_finger", 0.057)):
        tip = Cap((0, 0.005 * side, z), 0.005, (0, -side, 0), 0.3)
        pairs.append(ContactPair(link, tip, square(side, side * 0.0799 / 2, 0.014)))
    near = dict.fromkeys(("left_slide", "right_slide"), (3e-5, 0.04))
    task = Task.of(load_hand("parallel-gripper"), tuple(pairs), limits=near, name="near the stop")
    block = Body.of([Shape("box", (0.028, 0.0799, 0.028), np.eye(4))], mass=0.1, name="block")
    push, most = Loads.wrench([0, 100, 0, 0, 0, 0]), {"grip": 1.0}
    free = grasp_for(task, block, push, timeout=60, friction=0.5, jobs=1, count=1, safety=1.0)
    assert free.verdict is Reach.FOUND
    grasp = free.grasps[0].grasp
    assert {joint.stop for joint in grasp.joints} == {"lower"}
    held = check(grasp, push.wrenches[0], limits=GraspLimits(torque_limits=most))
    assert (held.verdict, held.exact) == (Verdict.HOLDS, True)
    assert np.isinf(limits(task, most, laws="all")).all()
    limited = PlanLimits(torque_limits=most)
    answer = grasp_for(task, block, push, timeout=60, friction=0.5, jobs=1, count=1, safety=1.0, limits=limited)
    assert answer.verdict is not Reach.NONE


def test_a_motor_that_is_turned_back_gives_its_command() -> None:
    task = flat_grip(0.05)
    names = task.hand.mechanism.actuators
    loose = replace(task, hand=task.hand.with_backdrivable(names))
    assert limits(loose, {}, command_limit=20.0) == pytest.approx(limits(task, dict.fromkeys(names, 20.0)))


def test_broken_motors_are_said_so() -> None:
    task = flat_grip(0.05)
    with pytest.raises(BadFile, match="has unknown joint 'elbow'"):
        limits(task, {}, motors={"laws": {"elbow": {"friction": 0.0}}})


# --- fingers ------------------------------------------------------------------------------------------


def pads(mu: float = 0.0) -> Task:
    """Flat pads across the closing of index finger and thumb, 30 mm along the last links."""
    pairs = []
    for side, link in ((1.0, "index_distal"), (-1.0, "thumb_distal")):
        points = np.array([[[0.028 + u, v, 0.01] for v in (-0.004, 0.004)] for u in (-0.002, 0.002)])
        pairs.append(ContactPair(link, Bezier(points, False), square(side, side * 0.015)))
    return Task.of(load_hand("schunk-sah"), tuple(pairs), name="pads")


@pytest.mark.parametrize("seed", range(4))
def test_no_configuration_has_a_smaller_lever_arm(seed: int) -> None:
    """The velocity of the contact by the hand's own Jacobian, at random points, joints and motions: the same number."""
    rng, task = np.random.default_rng(seed), (pads(), pinch())[seed % 2]
    read, hand, mu = data(task), task.hand, 0.1
    lower, upper = np.array([[j.lower, j.upper] for j in hand.joints]).T
    for k, pair in enumerate(task.contact_pairs):
        path = [j for i in read.hand.path(read.links[k]) for j in read.hand.links[i].joints]
        rates = {j: float(rng.choice([-1.0, 1.0, 0.5])) for j in path[len(path) - 1 - seed % 3 :]}
        arm, bound = LeverArm(read, k, rates, mu), least_arm(read, k, rates, mu)
        link, ends = hand.link_names.index(pair.link), read.on_hand[k].ends
        for _ in range(40):
            q = lower + (upper - lower) * rng.random(len(lower))
            for j, c in read.hand.couplings.items():
                q[j] = c.ratio * q[c.driver] + c.offset
            s, t = ends[:, 0] + np.ptp(ends, axis=1) * rng.random(2)
            pose = hand.link_poses(q)[link]
            p = pose[:3, :3] @ pair.hand.at(s, t) + pose[:3, 3]
            n = pose[:3, :3] @ pair.hand.outward(s, t)
            u = hand.jacobian(link, p, q)[:, list(rates)] @ np.array(list(rates.values()))
            value = n @ u - mu * np.linalg.norm(u - (n @ u) * n)
            x = np.array([s, t, *(q[lead] for lead in arm.columns)])
            found = arm.over(Interval.of(x[None]))
            assert found.mid[0] == pytest.approx(value, abs=1e-9)
            assert found.hi[0] - found.lo[0] < 1e-9
            assert bound <= value


def test_pads_push_with_a_lever_arm() -> None:
    """28 mm from the last axis, and farther from the one before, which moves as much."""
    task = pads()
    found = limits(task, dict.fromkeys(task.hand.mechanism.actuators, 1.0), friction=0.1)
    assert np.isfinite(found).all()
    assert (found > 1 / 0.15).all()
    assert (found < 1 / 0.02).all()
    assert np.isinf(limits(task, {"thumb_middle": 1.0}, friction=0.1))[0]


def test_a_palm_is_not_limited_and_wide_tips_may_be_struts() -> None:
    task = load_task("scalpel-handling")
    found = limits(task, dict.fromkeys(task.hand.mechanism.actuators, 1.0))
    assert np.isinf(found).all()


# --- none ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("newtons", "none"), [(8.9, True), (19.7, False)])
def test_motors_too_weak_for_a_weight(newtons: float, none: bool, tmp_path: Path) -> None:
    """A block of 1 kg between flat jaws, mu = 0.5: each pushes with 9.81 N, the motor with both; replayed."""
    task = flat_grip(0.05)
    task = replace(task, hand=task.hand.with_laws("none"))
    block = Body.of([Shape("box", (0.02, 0.05, 0.02))], mass=1.0, friction=0.5)
    how: dict[str, Any] = {"limits": PlanLimits(torque_limits={"grip": newtons}), "journal": GraspFolder(tmp_path)}
    answer = grasp_for(task, block, Loads.gravity(block, "-z"), timeout=60 if none else 2, jobs=1, **how)
    assert (answer.verdict is Reach.NONE) == none
    if none:
        assert verify(tmp_path / "grasps.json").ok
        assert "normal forces up to 8.9 N no contact forces balance" in answer.verify().parts[0].claim
