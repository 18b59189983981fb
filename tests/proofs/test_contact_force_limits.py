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
from handfast.proofs import contact_force_limits as force_limits
from handfast.proofs.contact_force_limits import ForceLimits, LeverArm, contact_force_limits, least_arm
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


def embedded(task: Task) -> dict[str, Any]:
    return json.loads(json.dumps(task_to_dict(task)))


def test_the_order_of_joints_does_not_matter() -> None:
    """With index_middle first, which drives index_distal, and the others in reverse; index_proximal moves."""
    given, points = embedded(pads()), {10: [0.3, 0.7], 9: [0.2, 0.4]}
    hand, order = given["hand"], [10, *(j for j in reversed(range(17)) if j != 10)]
    hand["joints"] = [hand["joints"][j] for j in order]
    for link in hand["links"]:
        link["joints"] = [order.index(j) for j in link["joints"]]
    for coupling in hand["couplings"]:
        coupling |= {name: order.index(coupling[name]) for name in ("joint", "leader")}
    moved = [(read_task(given), order), (data(pads()), [*range(17)])]
    for which in ({9: 1.0}, {8: 1.0, 9: -0.5}):
        found = []
        for read, its in moved:
            arm = LeverArm(read, 0, {its.index(j): rate for j, rate in which.items()}, 0.1)
            assert {its[lead] for lead in arm.columns} == {10, *which} - {min(which)}
            x = np.array([[0.4, 0.6], *(points[its[lead]] for lead in arm.columns)]).T
            found.append(arm.over(Interval.of(np.hstack([x[:, :1], x]))).mid)
        assert found[0] == pytest.approx(found[1], abs=1e-12)
        assert np.ptp(found[0]) > 1e-4


def test_a_joint_that_nothing_drives_stands_at_its_offset() -> None:
    """index_distal does so at 0.25 rad: the pad's arm about the axis before does not depend on any joint."""
    given = embedded(pads())
    given["hand"]["couplings"][2] |= {"leader": -1, "ratio": 1.0, "offset": 0.25}
    read = read_task(given)
    assert read.hand.joints[given["hand"]["couplings"][2]["joint"]] == "index_distal"
    arm = LeverArm(read, 0, {10: 1.0}, 0.0)
    assert arm.columns == {}
    assert arm.root.tolist() == [[0, 1], [0, 1]]
    point = Interval.of(np.array([[0.5, 0.5], [0.0, 0.0], [0.5, 0.5]]))
    assert arm.value(11, point).mid.tolist() == [0.25] * 3
    assert Motors.read(Fields({"actuators": []}), read, {}).limits.shape == (0,)
    # 28 and 26 mm along the last link, which is 26 mm from the axis before, and 10 mm aside of it
    length = np.linalg.norm(read.hand.poses[12, :3, 3])
    assert arm.over(point).mid == pytest.approx(np.array([0.028, 0.026, 0.028]) + length * np.cos(0.25), abs=1e-6)


def test_a_joint_that_follows_stands_where_its_coupling_says() -> None:
    """index_distal at half of index_middle and 0.25 rad, and this at -2 times index_proximal and 0.125 rad."""
    given = embedded(pads())
    given["hand"]["couplings"][2] |= {"ratio": 0.5, "offset": 0.25}
    arm = LeverArm(read_task(given), 0, {8: 1.0}, 0.0)
    assert arm.columns == {9: 2, 10: 3}
    x = Interval.of(np.array([[0.5, 0.5, 0.75, 1.0], [0.5, 0.5, 0.25, -3.0]]))
    assert arm.value(11, x).mid.tolist() == [0.75, -1.25]
    assert arm.value(10, x).mid.tolist() == [1.0, -3.0]
    given["hand"]["couplings"].append({"joint": 10, "leader": 9, "ratio": -2.0, "offset": 0.125})
    chained = LeverArm(read_task(given), 0, {8: 1.0}, 0.0)
    assert chained.columns == {9: 2}
    assert chained.value(11, x[:, :3]).mid.tolist() == [0.5 * (0.125 - 1.5) + 0.25, 0.5 * (0.125 - 0.5) + 0.25]


def test_a_contact_that_does_not_move_has_no_lever_arm() -> None:
    arm = LeverArm(data(pads()), 0, {16: 1.0}, 0.1)
    assert arm.steps == []
    assert arm.over(Interval.of(np.full((3, 2), 0.5))).mag.max() < 1e-100


def test_a_contact_that_is_drawn_back_has_no_bound() -> None:
    assert least_arm(data(flat_grip(0.05)), 0, {0: -1.0}, 0.0) == -np.inf
    assert least_arm(data(flat_grip(0.05)), 0, {0: 1.0}, 0.0) == pytest.approx(1.0)


def test_joints_that_move_with_a_free_one() -> None:
    given = embedded(pads())
    read = read_task(given)
    assert force_limits._leads(read, 0) == [10, 9, 8]
    assert force_limits._rates(read, 10) == {10: 1.0, 11: 1.0}
    assert force_limits._rates(read, 9) == {9: 1.0}
    given["hand"]["couplings"][2] |= {"ratio": -0.5}
    assert force_limits._rates(read_task(given), 10) == {10: 1.0, 11: -0.5}
    given["hand"]["couplings"][2] |= {"ratio": 0.0}
    assert force_limits._rates(read_task(given), 10) == {10: 1.0}
    given["hand"]["couplings"][2] |= {"ratio": 1.0}
    given["hand"]["couplings"].append({"joint": 10, "leader": 9, "ratio": 1.0, "offset": 0.0})
    chained = read_task(given)
    assert force_limits._leads(chained, 0) == [9, 8]
    assert force_limits._rates(chained, 9) == {}  # one coupling follows from another
    given["hand"]["couplings"][-1] |= {"leader": -1}
    fixed = read_task(given)
    assert force_limits._leads(fixed, 0) == [9, 8]
    assert force_limits._rates(fixed, 9) == {9: 1.0}


# --- several contacts of one link -----------------------------------------------------------------------


def side_pad(flip: bool) -> Bezier:
    """On the gripper's finger, out towards the other one, or back with `flip`."""
    return Bezier(np.array([[[u, 0, v] for v in (0.03, 0.06)] for u in (-0.01, 0.01)]), flip)


def test_a_motion_that_draws_another_contact_back_limits_nothing() -> None:
    """Both pads on the left finger: of two that face the same way each may bear all; of two that do not, neither."""
    for flip, most in ((True, np.inf), (False, 20.0)):
        pairs = [ContactPair("left_finger", side_pad(back), square(1, 0.02)) for back in (False, flip)]
        task = Task.of(load_hand("parallel-gripper"), tuple(pairs), name="one finger")
        assert limits(task, {"grip": 20.0}) == pytest.approx([most, most])


def test_a_pad_on_the_back_pushes_where_the_finger_opens() -> None:
    back = ContactPair("left_finger", side_pad(True), square(1, 0.02))
    task = Task.of(load_hand("parallel-gripper"), (back,), name="from within")
    assert limits(task, {"grip": 20.0}) == pytest.approx([20.0])


def test_a_finger_that_follows_at_half_the_speed_pushes_twice_as_hard() -> None:
    given = embedded(flat_grip(0.05))
    given["hand"]["couplings"][0]["ratio"] = 0.5
    motors = json.loads(json.dumps(motors_to_dict(flat_grip(0.05).hand.with_laws("none"))))
    read = read_task(given)
    first, second = contact_force_limits(read, Motors.read(Fields(motors), read, {"grip": 20.0}), 0.0).most
    assert second == pytest.approx(2 * first)


@pytest.mark.parametrize(("boxes", "batches"), [(7, 3), (8, 4)])
def test_so_many_boxes_are_looked_at(monkeypatch: pytest.MonkeyPatch, boxes: int, batches: int) -> None:
    """1, 2, 4 and 8 of them, where no bound is good enough: each in its middle, and both halves."""
    monkeypatch.setattr(force_limits, "LEVER_BOXES", boxes)
    monkeypatch.setattr(force_limits, "LEVER_BOUND_RATIO", 2.0)
    seen, over = [], LeverArm.over

    def noted(arm: LeverArm, x: Interval) -> Interval:
        seen.append(x.shape[0])
        return over(arm, x)

    monkeypatch.setattr(LeverArm, "over", noted)
    least_arm(data(flat_grip(0.05)), 0, {0: 1.0}, 0.0)
    assert seen == [n for k in range(batches) for n in (2**k, 2 ** (k + 1))]


def test_what_is_not_known_of_a_box_bounds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """1 in the middles of boxes, and no number over them."""
    monkeypatch.setattr(force_limits, "LEVER_BOXES", 8)

    def over(arm: LeverArm, x: Interval) -> Interval:
        return Interval.of(np.where((x.lo == x.hi).all(axis=1), 1.0, np.nan))

    monkeypatch.setattr(LeverArm, "over", over)
    for enough in (0.0, np.inf):
        assert least_arm(data(flat_grip(0.05)), 0, {0: 1.0}, 0.0, enough=enough) == -np.inf


@pytest.mark.parametrize(
    ("own", "others", "most"), [(1.0, 0.0, 20.0), (2.0, 1.0, 10.0), (0.0, 0.0, np.inf), (1.0, -0.1, np.inf)]
)
def test_which_lever_arms_limit_a_force(
    monkeypatch: pytest.MonkeyPatch, own: float, others: float, most: float
) -> None:
    """An arm of a contact itself, and what is enough to know of the other one: that it is not drawn back."""
    seen = []

    def arm(*given: Any, enough: float = np.inf) -> float:
        seen.append((given[3:], enough))
        return own if enough == np.inf else others

    monkeypatch.setattr(force_limits, "least_arm", arm)
    assert limits(flat_grip(0.05), {"grip": 20.0}) == pytest.approx([most, most])
    assert {*seen} <= {((0.5, 0.0), np.inf), ((0.5, 0.0), 0.0)}


def test_joints_that_nothing_drives_push_with_nothing_if_they_have_an_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all motors but one that drives neither finger nothing is left."""
    task = data(flat_grip(0.05))
    idle = Fields({"actuators": [{"name": "idle", "joints": {}}]})
    motors = Motors.read(idle, task, {"idle": 1.0})
    for own, most in ((1.0, 0.0), (0.0, np.inf)):
        monkeypatch.setattr(force_limits, "least_arm", lambda *_, own=own, **__: own)
        assert contact_force_limits(task, motors, 0.5).most == pytest.approx([most, most], abs=1e-200)


def test_friction_of_another_contact_counts() -> None:
    """A round tip of 1 rad beside a flat pad: a friction of 0.7 at the tip may hold the finger back."""
    flat, ball = ContactPair("left_finger", side_pad(False), square(1, 0.02)), grip(0.05).contact_pairs[0]
    task = Task.of(load_hand("parallel-gripper"), (flat, ball), name="flat and round")
    assert np.isinf(limits(task, {"grip": 20.0}, friction=0.7)).all()
    gentle = limits(task, {"grip": 20.0}, friction=0.2)
    assert gentle[0] == pytest.approx(20.0)
    assert gentle[1] > 20 / (np.cos(1) - 0.2 * np.sin(1))


def test_torsion_of_another_contact_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pad that is tilted by 45 degrees to the axes of its finger turns about its normal, too."""
    monkeypatch.setattr(force_limits, "TRIED_JOINTS", 1)
    along, up = np.cos(np.pi / 4), np.sin(np.pi / 4)
    points = [[[0.028 + u, v * along, 0.01 + v * up] for v in (-0.004, 0.004)] for u in (-0.002, 0.002)]
    tilted = ContactPair("index_distal", Bezier(np.array(points), False), square(1, 0.015))
    task = Task.of(load_hand("schunk-sah"), (pads().contact_pairs[0], tilted), name="tilted")
    motors = Fields(json.loads(json.dumps(motors_to_dict(task.hand.with_laws("none")))))
    read = Motors.read(motors, data(task), dict.fromkeys(task.hand.mechanism.actuators, 1.0))
    for torsion, known in ((0.001, [True, True]), (1.0, [False, False])):
        assert np.isfinite(contact_force_limits(data(task), read, 0.1, torsion).most).tolist() == known
    # alone the flat pad does not turn about its normal
    alone = Task.of(task.hand, task.contact_pairs[:1], name="flat")
    assert np.isfinite(contact_force_limits(data(alone), read, 0.1, 1.0).most).all()


# --- limits ---------------------------------------------------------------------------------------------


def test_the_lower_of_limits_and_one_for_all() -> None:
    most, turned, slid = np.array([1.0, 2, 3]), np.array([0.1, 0.2, 0.3]), np.array([4.0, 5, 6])
    lower = ForceLimits(most, turned, slid).up_to(2.0)
    assert lower.most.tolist() == [1, 2, 2]
    assert lower.turned.tolist() == [0.1, 0, 0]  # what is missed of torques does not add to a limit that is given
    assert lower.slid.tolist() == [4, 0, 0]
    for given in (7.0, np.full(2, 7.0)):
        same = ForceLimits.of(given, 2)
        assert (same.most.tolist(), same.turned.tolist(), same.slid.tolist()) == ([7, 7], [0, 0], [0, 0])


def test_by_how_much_a_force_grows_for_what_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both slides move as far as a pad: 2 N of both for each; a finger's two last joints 2 rad over its arm."""
    monkeypatch.setattr(force_limits, "TRIED_JOINTS", 1)
    task = flat_grip(0.05)
    motors = json.loads(json.dumps(motors_to_dict(task.hand.with_laws("none"))))
    found = contact_force_limits(data(task), Motors.read(Fields(motors), data(task), {"grip": 20.0}), 0.5)
    assert found.slid == pytest.approx([2, 2])
    assert found.turned.tolist() == [0, 0]
    none = contact_force_limits(data(task), Motors.read(Fields(motors), data(task), {}), 0.5)
    assert np.isinf(none.most).all()
    assert (none.turned.tolist(), none.slid.tolist()) == ([0, 0], [0, 0])
    motors = json.loads(json.dumps(motors_to_dict(pads().hand.with_laws("none"))))
    torques = dict.fromkeys(pads().hand.mechanism.actuators, 3.0)
    only = contact_force_limits(data(pads()), Motors.read(Fields(motors), data(pads()), {"thumb_middle": 3.0}), 0.1)
    assert np.isfinite(only.most).tolist() == [False, True]
    fingers = contact_force_limits(data(pads()), Motors.read(Fields(motors), data(pads()), torques), 0.1)
    assert fingers.slid.tolist() == [0, 0]
    assert fingers.turned / fingers.most == pytest.approx([2 / 3, 2 / 3])  # 3 N m for them


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


# --- small hands by hand --------------------------------------------------------------------------------


def small_hand(*fingers: list[dict[str, Any]], pad: Any = None) -> TaskData:
    """Fingers of one link each, on the palm, with a pad at the origin that pushes along z; their joints, in order."""
    wall = {"bezier": [[[u, v, 0] for v in (0, 1)] for u in (0, 1)], "flip": True}
    each = [
        {"type": "prismatic", "axis": [0, 0, 1], "anchor": [0] * 3, "limits": [0, 0.1], "ref": 0} | j
        for f in fingers
        for j in f
    ]
    joints = [{"name": f"j{k}"} | joint for k, joint in enumerate(each)]
    links = [{"name": "palm", "parent": -1, "pose": np.eye(4).tolist(), "joints": []}]
    count = 0
    for k, finger in enumerate(fingers):
        its = list(range(count, count + len(finger)))
        count += len(finger)
        links.append({"name": f"f{k}", "parent": 0, "pose": np.eye(4).tolist(), "joints": its})
    flat = {"bezier": [[[u, v, 0] for v in (-0.001, 0.001)] for u in (-0.001, 0.001)]}
    contacts = [{"link": f"f{k}", "hand": pad or flat, "object": wall} for k in range(len(fingers))]
    hand = {"name": "hand", "source": "", "links": links, "joints": joints, "couplings": []}
    pose = {"position": [[None, None]] * 3, "axes": [[[None, None]] * 3] * 3}
    return read_task({"name": "t", "hand": hand, "contacts": contacts, "pose": pose})


def driven(task: TaskData, torques: dict[str, float], **laws: Any) -> Array:
    """A motor for each joint, with the joint's name; laws of joints."""
    actuators = [{"name": name, "joints": {name: 1.0}} for name in task.hand.joints]
    motors = Motors.read(Fields({"actuators": actuators, "laws": laws}), task, torques)
    return contact_force_limits(task, motors, 0.5).most


@pytest.mark.parametrize("limits", [(10.0, 20.0), (20.0, 10.0)])
def test_the_weaker_of_two_motors_behind_each_other_limits(limits: tuple[float, float]) -> None:
    assert driven(small_hand([{}, {}]), dict(zip(("j0", "j1"), limits, strict=True))) == pytest.approx([10])


def test_fingers_that_move_apart_are_limited_each_by_its_own_motor() -> None:
    task = small_hand([{}], [{}])
    assert driven(task, {"j0": 10.0, "j1": 20.0}) == pytest.approx([10, 20])
    assert driven(task, {"j1": 20.0}) == pytest.approx([np.inf, 20])


def test_a_stop_in_the_other_sense_carries_nothing() -> None:
    """The pad pushes as its slide moves back, which an upper stop may push, too: a lower one does not."""
    back = small_hand([{"axis": [0, 0, -1]}])
    for stops, most in (([0.0, None], 10.0), ([None, 0.1], np.inf)):
        assert driven(back, {"j0": 10.0}, j0={"friction": 0.0, "stops": stops}) == pytest.approx([most])


def test_the_lever_arm_by_way_of_an_outer_joint_of_the_same_link() -> None:
    """j0 turns about y through (-0.1, 0, 0), j1 behind it by q about z through (0, 0.05, 0).

    The pad's middle is at (0.05 sin q, 0.05 (1 - cos q), 0) before j0: 0.1 + 0.05 sin q from its axis, against z.
    """
    inner = {"type": "revolute", "axis": [0, -1, 0], "anchor": [-0.1, 0, 0], "limits": [0, 1]}
    outer = {"type": "revolute", "axis": [0, 0, 1], "anchor": [0, 0.05, 0], "limits": [0, 1]}
    arm = LeverArm(small_hand([inner, outer]), 0, {0: 1.0}, 0.5)
    assert arm.columns == {1: 2}
    assert arm.root.tolist() == [[0, 1], [0, 1], [0, 1]]
    found = arm.over(Interval.of(np.array([[0.5, 0.5, q] for q in (0.0, 0.5, 1.0)]))).mid
    assert found == pytest.approx(0.1 + 0.05 * np.sin([0.0, 0.5, 1.0]), abs=1e-12)


def test_a_bound_of_the_lever_arm_of_a_bent_pad() -> None:
    """Bent across v alone, up to a slope of 3: without friction the arm is 1 / sqrt 10 of the rate of 2 at least."""
    bent = {"bezier": [[[u, y, z] for y, z in ((-0.1, 0), (0, 0.3), (0.1, 0))] for u in (-0.1, 0.1)]}
    least = 2 / np.sqrt(10)
    assert 0.9 * least <= least_arm(small_hand([{}], pad=bent), 0, {0: 2.0}, 0.0) <= least
