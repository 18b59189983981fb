"""Soft fingers in the proof that no contact forces balance a load: cases by hand, the definition, limits by motors."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from handfast import Contact, Task, check, load_hand
from handfast.core.arrays import Array
from handfast.geometry.contacts import grasp_of
from handfast.model.region import Bezier
from handfast.planning.results.grasps_file import motors_to_dict
from handfast.proofs.contact_force_limits import ForceLimits, LeverArm, contact_force_limits, least_arm
from handfast.proofs.existence import prove
from handfast.proofs.fields import Fields
from handfast.proofs.grasp import read_grasp
from handfast.proofs.intervals import Interval
from handfast.proofs.motors import Motors
from handfast.proofs.question import CHECK, Question
from handfast.proofs.states import Problem, read_state
from handfast.proofs.tasks import TaskData, read_task
from handfast.proofs.unbalanced import Motions, Placements, replay_unbalanced
from handfast.readers import grasp_file
from handfast.stability.answers.answer import state_json
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair
from tests.proofs.test_unbalanced import FAR, data, jaws, of_line, of_twist, skew, weight
from tests.support.holds import flat_grip, pinch, square

SMALL = 1e-6  # [m] half the side of regions that are as good as points


def reason(load: Array, proof: Any, torsion: float, mu: float = 0.5, limit: Any = np.inf, **how: Any) -> str:
    regions = how.get("regions", jaws(SMALL))
    return replay_unbalanced(regions, {"w": load}, mu, limit, None, Fields(proof), torsion=torsion).reason


# --- two contacts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("torsion", "shown"), [(0.0, True), (0.0149, True), (0.0151, False)])
def test_torsion_of_limited_forces_has_a_moment_about_the_line(torsion: float, shown: bool) -> None:
    """1 N at 30 mm from the line, normal forces up to 1 N: two soft fingers have 2 mu_tau N m."""
    assert (reason(weight(FAR), of_line(1, 0), torsion, limit=1.0) == "") == shown
    assert reason(weight(FAR), of_line(0, 1), torsion, limit=1.0)


def test_soft_fingers_that_may_press_as_hard_as_they_like_hold_any_moment() -> None:
    for mu in (0.1, 0.5):
        assert not reason(weight(FAR), of_line(1, 0), 0.0, mu)
        assert reason(weight(FAR), of_line(1, 0), 1e-6, mu)


@pytest.mark.parametrize("torsion", [0.004, 0.02, 0.1])
def test_friction_and_torsion_share_one_ellipsoid(torsion: float) -> None:
    """Each finger carries W / 2 down and W d / 2 about the line: it takes W / 2 sqrt(1 / mu^2 + d^2 / mu_tau^2)."""
    mu, d = 0.5, FAR[0]
    needed = 0.5 * np.hypot(1 / mu, d / torsion)
    turn = d / torsion**2 / (1 / mu**2)  # omega_y over -v_z where the ellipsoid's normal is along the force
    for share, shown in ((0.999, True), (1.001, False)):
        done = reason(weight(FAR), of_twist(0, 0, -1, 0, turn, 0), torsion, mu, share * needed)
        assert (done == "") == shown
    assert reason(weight(FAR), of_twist(0, 0, -1, 0, -turn, 0), torsion, mu, 0.999 * needed)
    assert reason(weight(FAR), of_twist(0, 0, -1, 0, turn, 0), torsion, mu)  # any force would do


def test_of_a_single_soft_finger_nothing_is_shown() -> None:
    """How much force a state may miss follows from its torque over `GraspData.size`, which is a length of the hand.

    Nor of twists that turn the object about a point contact; a twist that only moves it shows that nothing pulls.
    """
    top = data(Bezier(np.array([[[a, b, 0.0] for b in (-SMALL, SMALL)] for a in (-SMALL, SMALL)]), False))
    down = weight([0, 0, 0])
    for torsion, spin, shown in ((0.0, 0.0, True), (1e-3, 0.0, False), (0.0, 1e-9, False)):
        assert (reason(down, of_twist(0, 0, -1, 0, 0, spin), torsion, regions=top) == "") == shown


def test_what_is_said_names_the_torsion() -> None:
    done = replay_unbalanced(jaws(), {"w": weight(FAR)}, 0.5, 1.0, None, Fields(of_line(1, 0)), torsion=0.002)
    assert done.ok
    assert "with a friction of 0.5, a torsion of 2 mm and normal forces up to 1 N no contact forces" in done.claim
    with pytest.raises(ValueError, match="soft fingers need friction"):
        Placements.of(jaws(), weight(FAR)[None], 0.0, torsion=0.002)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_refuted_is_so_at_every_placement(seed: int) -> None:
    """Of random boxes and twists, at random placements: the definition in plain numbers."""
    rng, contacts = np.random.default_rng(seed), 2 + seed % 3
    regions, load = skew(seed, contacts)
    mu, torsion, limit = 0.3, (0.05, 0.01, 0.002)[seed % 3], (np.inf, 0.3)[seed % 2]
    placements = Placements.of(data(*regions), load[None], mu, limit, torsion)
    low = 0.8 * rng.random((200, 2 * contacts))
    boxes = np.stack([low, low + 0.1 * rng.random((200, 1))], axis=2)
    line = np.array([rng.permutation(contacts)[:2] if k % 2 else [-1, -1] for k in range(200)])
    twist = np.where(line[:, :1] < 0, rng.normal(size=(200, 6)) * [0.05, 0.05, 0.05, 1, 1, 1], 0.0)
    motions = Motions(np.ones((200, 1)), line, twist)
    shown = placements.examined(boxes, motions).refuted
    points = Placements.of(data(*regions), load[None], mu, limit).examined(boxes, motions).refuted
    held = []
    for box, pair, xi in zip(boxes, line, twist, strict=True):
        x = box[:, 0] + np.ptp(box, axis=1) * rng.random((20, 2 * contacts))
        p = np.stack([r.at(x[:, 2 * k], x[:, 2 * k + 1]) for k, r in enumerate(regions)], axis=1)
        n = -np.stack([r.outward(x[:, 2 * k], x[:, 2 * k + 1]) for k, r in enumerate(regions)], axis=1)
        omega = p[:, pair[1]] - p[:, pair[0]] if pair[0] >= 0 else np.tile(xi[3:], (20, 1))
        v = -np.cross(omega, p[:, pair[0]]) if pair[0] >= 0 else np.tile(xi[:3], (20, 1))
        u = v[:, None] + np.cross(omega[:, None], p)
        normal, about = (u * n).sum(axis=2), (omega[:, None] * n).sum(axis=2)
        slip = np.linalg.norm(u - normal[..., None] * n, axis=2)
        short = np.maximum(np.hypot(mu * slip, torsion * about) - normal, 0.0).sum(axis=1)
        least = (
            np.where(short > 1e-12, limit * short, 0.0) if np.isfinite(limit) else np.where(short > 1e-12, np.inf, 0)
        )
        held.append(bool((v @ load[:3] + omega @ load[3:] > least).all()))
    assert not (shown & ~np.array(held)).any()
    assert not (shown & ~points).any()
    if contacts == 2 and seed % 2:
        assert shown.any()
        assert (points & ~shown).any()


@pytest.mark.parametrize("seed", range(3))
def test_a_torsion_of_all_but_nothing_changes_all_but_nothing(seed: int) -> None:
    """The least factors of boxes with torsion of 1e-12 m are those of point contacts, from either side."""
    rng, (regions, load) = np.random.default_rng(seed), skew(seed, 2 + seed % 2)
    n = 2 * len(regions)
    low = 0.8 * rng.random((200, n))
    boxes, twist = np.stack([low, low + 0.05], axis=2), rng.normal(size=(200, 6)) * [0.05, 0.05, 0.05, 1, 1, 1]
    motions = Motions(np.ones((200, 1)), np.full((200, 2), -1), twist)
    hard, soft, softer = (
        Placements.of(data(*regions), load[None], 0.3, 0.5, x).least_factors(boxes, motions)[0]
        for x in (0, 1e-12, 0.01)
    )
    assert np.isfinite(hard).any()
    known = np.isfinite(hard)
    assert soft[known] == pytest.approx(hard[known], rel=1e-6)
    assert (softer >= hard * (1 - 1e-9)).all()
    assert (softer[known] > hard[known] * (1 + 1e-3)).any()


# --- limits by motors -----------------------------------------------------------------------------------


def read(task: Task) -> TaskData:
    return read_task(json.loads(json.dumps(task_to_dict(task))))


def limits(task: Task, torques: dict[str, float], friction: float, torsion: float) -> ForceLimits:
    motors = Fields(json.loads(json.dumps(motors_to_dict(task.hand.with_laws("none")))))
    return contact_force_limits(read(task), Motors.read(motors, read(task), torques), friction, torsion)


@pytest.mark.parametrize("seed", range(4))
def test_no_configuration_has_a_smaller_lever_arm(seed: int) -> None:
    """By the hand's own Jacobian: of the contact's point, and of points beside it, which tell how the link turns."""
    rng, task = np.random.default_rng(seed), pinch()
    got, hand, mu, torsion = read(task), task.hand, 0.1, 0.03
    lower, upper = np.array([[j.lower, j.upper] for j in hand.joints]).T
    spun = 0.0
    for k, pair in enumerate(task.contact_pairs):
        path = [j for i in got.hand.path(got.links[k]) for j in got.hand.links[i].joints]
        rates = {j: float(rng.choice([-1.0, 1.0, 0.5])) for j in path[len(path) - 1 - seed % 3 :]}
        arm, bound = LeverArm(got, k, rates, mu, torsion), least_arm(got, k, rates, mu, torsion)
        link, ends = hand.link_names.index(pair.link), got.on_hand[k].ends
        own = np.array(list(rates.values()))
        for _ in range(40):
            q = lower + (upper - lower) * rng.random(len(lower))
            for j, c in got.hand.couplings.items():
                q[j] = c.ratio * q[c.driver] + c.offset
            s, t = ends[:, 0] + np.ptp(ends, axis=1) * rng.random(2)
            pose = hand.link_poses(q)[link]
            p = pose[:3, :3] @ pair.hand.at(s, t) + pose[:3, 3]
            n = pose[:3, :3] @ pair.hand.outward(s, t)
            one = np.linalg.svd(n[None])[2][1]
            u, beside = (hand.jacobian(link, x, q)[:, list(rates)] @ own for x in (p, p + one))
            spin = (beside - u) @ np.cross(n, one)
            value = n @ u - np.hypot(mu * np.linalg.norm(u - (n @ u) * n), torsion * spin)
            x = np.array([s, t, *(q[lead] for lead in arm.columns)])
            found = arm.over(Interval.of(x[None]))
            assert found.mid[0] == pytest.approx(value, abs=1e-9)
            assert found.hi[0] - found.lo[0] < 1e-9
            assert bound <= value
            spun = max(spun, abs(spin))
    assert spun > 0.1


SKEW = """<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom type="box" size="0.02 0.04 0.005"/>
<body name="finger" pos="0 0.04 0"><joint name="finger" axis="1 1 0" range="-0.01 0.01"/>
<geom type="box" size="0.005 0.005 0.03" pos="0 0 0.03"/></body></body></worldbody>
<actuator><motor name="finger" joint="finger"/></actuator></mujoco>"""


def test_a_finger_that_turns_its_pad_pushes_harder_with_torsion(tmp_path: Any) -> None:
    """60 mm from an axis at 45 degrees to the pad's normal: per rad/s it moves 42 mm/s along it and across, and turns
    by 0.71 rad/s about it.
    """
    (tmp_path / "skew.xml").write_text(SKEW)
    points = np.array([[[u, -0.005, 0.06 + v] for v in (-SMALL, SMALL)] for u in (-SMALL, SMALL)])
    pair = ContactPair("finger", Bezier(points, flip=False), square(1, 0.02, SMALL))
    task = Task.of(load_hand(tmp_path / "skew.xml").with_laws("none"), (pair,))
    along, turn = 0.06 / np.sqrt(2), 1 / np.sqrt(2)
    for torsion in (0.0, 0.01, 0.03):
        found = limits(task, {"finger": 1.0}, 0.5, torsion)
        due = 1 / (along - np.hypot(0.5 * along, torsion * turn))
        assert found.most == pytest.approx([due], rel=0.2)
        assert found.most[0] >= due * (1 - 1e-4)
        assert found.turned == pytest.approx(found.most)  # 1 rad/s against 1 N m
        assert found.slid == 0.0
    assert np.isinf(limits(task, {"finger": 1.0}, 0.5, 0.06).most).all()  # 42 mm are less than 47


def test_the_lower_of_two_limits_counts() -> None:
    found = limits(flat_grip(0.05), {"grip": 20.0}, 0.5, 0.01)
    assert found.most == pytest.approx([20.0, 20.0])
    assert found.slid == pytest.approx([2.0, 2.0])  # both slides move
    lower = found.up_to(5.0)
    assert lower.most.tolist() == [5.0, 5.0]
    assert lower.slid.tolist() == lower.turned.tolist() == [0.0, 0.0]
    assert found.up_to(50.0).slid == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize("torsion", [0.0, 0.004])
def test_what_is_held_to_its_tolerance_is_not_refuted(torsion: float) -> None:
    """Jaws whose motor gives 20 N, and a load that presses the block on one of them with a little more.

    Load and joint torques of a state may each be missed by 1e-9 of the load, so that it is held up to 20 N (1 + 2e-9):
    by an exact state near by, which is proved. What is shown to be impossible begins above that.
    """
    task, push = flat_grip(0.05), 20.0
    hand = task.hand.with_laws("none")
    pose = np.eye(4)
    pose[2, 3] = 0.045
    ends = (("left_finger", 1.0), ("right_finger", -1.0))
    contacts = [Contact([0, 0.025 * s, 0], [0, -s, 0], 0.5, link, torsion=torsion) for link, s in ends]
    grasp = grasp_of(hand, np.array([0.015, 0.015]), contacts, pose)
    load = np.array([0, push, 0, 0, 0, 0.0])
    held = check(grasp, load, limits=GraspLimits(torque_limits={"grip": push}))
    assert held.witness is not None
    known = read_grasp(json.loads(json.dumps(grasp_file.to_dict(grasp))), "")
    said = json.loads(json.dumps(state_json(held.witness.state)))
    most = limits(task, {"grip": push}, 0.5, torsion)
    seen = []
    for more in (0.0, 5e-10, 1e-9, 1.5e-9, 1.9e-9, 1e-8, 1e-6):
        scaled = {"r": said["r"], "q": said["q"], "c": said["c"]}
        scaled = {name: [x * (1 + more / 2) for x in values] for name, values in scaled.items()}
        state, wrench = read_state(Fields(said | scaled), known), load * (1 + more)
        asked = Question(known, CHECK, False, wrench, np.zeros(6), 0.0, True, {"grip": push}, np.inf, ())
        found = prove(Problem.of(asked, known.command, wrench), state)
        none = reason(wrench, of_twist(0, 1, 0, 0, 0, 0), torsion, limit=most, regions=read(task).on_object) == ""
        seen.append((found.exact or found.tolerant, none))
    assert seen == [(True, False)] * 5 + [(False, True)] * 2
