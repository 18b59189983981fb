"""Closing: where fingers stop, clutches and linkages, limits, meetings, and real hands on real objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import Verdict, check
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Coupling, Hand, Joint, Link
from handfast.model.hand.hand import coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.planning.closing import TOUCH_GAP, close, stands_open, waiting
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from tests.support.four_bar import FourBar
from tests.support.places import SHARED
from tests.support.tendon_hand import FINGERS, tendon_hand

R = 0.005  # finger radius


def finger(ratio: float | None = None, breakaway: bool = True) -> Hand:
    """A planar finger along +x: two links of 50 mm, flexing towards +z; `ratio` couples the joints."""
    lying = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    solid = Shape("capsule", (R, 0.04), transform([0.025, 0, 0], lying))
    joints = tuple(Joint(n, "revolute", np.array([0, -1.0, 0]), np.zeros(3), 0, 1.5) for n in "ab")
    links = (
        Link("palm", -1, np.eye(4)),
        Link("inner", 0, np.eye(4), (0,), (solid,)),
        Link("outer", 1, transform([0.05, 0, 0]), (1,), (solid,)),
    )
    couplings = () if ratio is None else (Coupling(1, 0, ratio),)
    driven = [0, 1] if ratio is None else [0]
    mechanism = Mechanism(
        tuple("ab"[j] for j in driven), np.eye(2)[driven], coupling_rows(couplings, 2), (False,) * len(driven)
    )
    return Hand("finger", links, joints, mechanism, couplings, np.ones(2), breakaway)


def ball(radius: float = 0.01) -> Body:
    return Body.of([Shape("sphere", radius)])


def angle_at(x: float, z: float, radius: float) -> float:
    """At which a bar of radius R through the origin touches a ball centred at (x, z)."""
    return np.arctan2(z, x) - np.arcsin((radius + R) / np.hypot(x, z))


def test_the_inner_link_stops_and_the_outer_one_goes_on() -> None:
    hand, body = finger(), ball()
    pose = transform([0.03, 0, 0.03])
    closed = close(hand, np.zeros(2), body, pose)
    assert closed.q[0] == pytest.approx(angle_at(0.03, 0.03, 0.01), abs=1e-3)
    assert closed.touching == ("inner", "outer")
    assert closed.stopped == {"a": "inner touches", "b": "outer touches"}
    d = Scene(hand, body).distance(closed.q, pose)
    assert (d[1:] >= 0).all()
    assert (d[1:] <= TOUCH_GAP).all()
    assert closed.penetration == 0
    assert [c.link for c in closed.contacts] == ["inner", "outer"]


def test_a_touch_at_the_tip_stops_the_whole_finger() -> None:
    closed = close(finger(), np.zeros(2), ball(), transform([0.085, 0, 0.02]))
    assert closed.stopped == {"a": "outer touches", "b": "outer touches"}
    assert closed.touching == ("outer",)
    assert closed.q[0] == closed.q[1]  # they had turned at the same speed


def test_nothing_in_the_way_ends_at_the_limits() -> None:
    closed = close(finger(), np.array([0.2, 0.0]), ball(), transform([1, 0, 0]))
    np.testing.assert_array_equal(closed.q, [1.5, 1.5])
    assert closed.stopped == {"a": "limit", "b": "limit"}
    assert closed.contacts == ()


def test_a_clutch_lets_the_outer_link_go_on_alone() -> None:
    pose = transform([0.03, 0, 0.03])
    closed = close(finger(ratio=0.3), np.zeros(2), ball(), pose)
    assert closed.q[0] == pytest.approx(angle_at(0.03, 0.03, 0.01), abs=1e-3)
    assert closed.q[1] > 0.3 * closed.q[0] + 0.1
    assert closed.stopped["b"] == "outer touches"


def test_a_rigid_linkage_stops_with_its_leader() -> None:
    pose = transform([0.03, 0, 0.03])
    closed = close(finger(ratio=0.3, breakaway=False), np.zeros(2), ball(), pose)
    assert closed.q[1] == pytest.approx(0.3 * closed.q[0], abs=1e-12)
    assert closed.stopped == {"a": "inner touches", "b": "follows a"}
    again = close(finger(ratio=0.3), np.zeros(2), ball(), pose, breakaway=False)
    np.testing.assert_array_equal(again.q, closed.q)


def test_a_coupled_joint_keeps_its_ratio_until_the_touch() -> None:
    closed = close(finger(ratio=0.3), np.zeros(2), ball(), transform([0.085, 0, 0.02]))
    assert closed.q[1] == pytest.approx(0.3 * closed.q[0], abs=1e-12)
    assert closed.stopped == {"a": "outer touches", "b": "outer touches"}


def test_a_coupled_joint_at_its_limit_stops_a_rigid_linkage() -> None:
    hand = finger(ratio=2.0, breakaway=False)
    closed = close(hand, np.zeros(2), ball(), transform([1, 0, 0]))
    np.testing.assert_allclose(closed.q, [0.75, 1.5])
    assert closed.stopped == {"b": "limit", "a": "follows b"}


def test_negative_senses_close_downwards() -> None:
    hand = finger()
    limits = tuple(replace(j, lower=-1.5, upper=0.0) for j in hand.joints)
    closed = close(replace(hand, joints=limits), np.zeros(2), ball(), transform([0.03, 0, -0.03]), {"a": -1, "b": -1})
    assert closed.q[0] == pytest.approx(-angle_at(0.03, 0.03, 0.01), abs=1e-3)


def test_refusals() -> None:
    with pytest.raises(InputError, match=r"q0: the hand starts 4 mm inside the object at inner"):
        close(finger(), np.zeros(2), ball(), transform([0.03, 0, 0.011]))
    with pytest.raises(InputError, match=r"closing: no joint of the hand closes"):
        close(finger(), np.zeros(2), ball(), transform([1, 0, 0]), {"a": 0, "b": 0})
    with pytest.raises(InputError, match=r"q0: needs 2 finite joint values"):
        close(finger(), np.zeros(3), ball(), transform([1, 0, 0]))
    with pytest.raises(InputError, match=r"unknown joint 'z'; known: a, b"):
        close(finger(), np.zeros(2), ball(), transform([1, 0, 0]), {"z": 1})


def test_fingers_that_meet_stop() -> None:
    hand = load_hand("parallel-gripper")
    shorter, longer = (tuple(replace(j, upper=u) for j in hand.joints) for u in (0.03, 0.06))
    closed = close(replace(hand, joints=shorter), hand.configuration(), ball(), transform([1, 0, 0]))
    assert closed.stopped == {"left_slide": "limit", "right_slide": "limit"}
    closed = close(replace(hand, joints=longer), hand.configuration(), ball(), transform([1, 0, 0]))
    assert closed.q == pytest.approx([0.04, 0.04], abs=2e-5)
    assert closed.stopped["left_slide"] == "left_finger meets right_finger"


def test_the_gripper_holds_what_is_between_its_pads() -> None:
    hand = load_hand("parallel-gripper")
    body = Body.of([Shape("box", (0.05, 0.03, 0.05))], friction=0.5)
    closed = close(hand, hand.configuration(), body, transform([0, 0, 0.095]))
    assert closed.q == pytest.approx([0.025, 0.025], abs=2e-5)
    assert len(closed.contacts) == 8
    grasp = contact_grasp(hand, closed.q, body, transform([0, 0, 0.095]), preload={"grip": 20})
    assert grasp.mechanism.actuators == ("grip",)
    np.testing.assert_allclose(grasp.J[::3] @ [1, 1], 1, atol=1e-9)  # both joints close along the normals
    off = close(hand, hand.configuration(), body, transform([0, 0.005, 0.095]))
    assert off.stopped == {"left_slide": "left_finger touches", "right_slide": "follows left_slide"}


def test_the_same_twice() -> None:
    hand = load_hand("barrett-bh8-280")
    body, pose = Body.of([Shape("cylinder", (0.03, 0.2))]), transform([0.004, 0, 0.19])
    first, second = (close(hand, hand.configuration(), body, pose) for _ in range(2))
    np.testing.assert_array_equal(first.q, second.q)
    assert first.stopped == second.stopped
    assert all(np.array_equal(a.position, b.position) for a, b in zip(first.contacts, second.contacts, strict=True))
    assert {c.link for c in first.contacts} >= {"finger_1_dist", "finger_2_dist", "finger_3_dist"}


real = pytest.mark.skipif(not SHARED.is_dir(), reason="needs ../shared")


def closes(hand: Hand, q0: np.ndarray, body: Body, pose: np.ndarray) -> None:
    scene = Scene(hand, body)
    closed = close(hand, q0, body, pose, scene=scene)
    assert len(closed.contacts) >= 3
    assert len({c.link for c in closed.contacts}) >= 3
    assert closed.penetration < 2e-4
    assert scene.distance(closed.q, pose).min() > -1e-4
    low, high = hand.limits.T
    assert (closed.q >= low - 1e-9).all()
    assert (closed.q <= high + 1e-9).all()
    grasp = contact_grasp(hand, closed.q, body, pose, scene=scene)
    assert np.linalg.matrix_rank(grasp.G) == 6
    assert set(closed.stopped) == {hand.joints[j].name for j in np.flatnonzero(hand.closing)}


@real
@pytest.mark.parametrize("name", ["master_chef_can", "mustard_bottle"])
@pytest.mark.parametrize("which", ["bundled", "vendor"])
def test_barrett_on_real_objects(which: str, name: str) -> None:
    if which == "bundled":
        hand = load_hand("barrett-bh8-280")
    else:
        hand = load_hand(SHARED / "hands" / "barrett_hand" / "bhand_model.urdf")
        hand = hand.with_closing({"finger_1_prox_joint": 0, "finger_2_prox_joint": 0})
    body = load_body(SHARED / "objects" / "ycb" / f"{name}.obj", mass=0.4)
    x, y, _ = body.center_of_mass
    pose = transform([-x, -y, 0.095 - body.vertices[:, 2].min()])
    closes(hand, hand.configuration(), body, pose)


@real
@pytest.mark.parametrize("name", ["master_chef_can", "mustard_bottle"])
def test_allegro_on_real_objects(name: str) -> None:
    hand = load_hand(SHARED / "hands" / "allegro_hand" / "allegro_hand_right.urdf").with_closing({"joint_12.0": 0})
    body = load_body(SHARED / "objects" / "ycb" / f"{name}.obj", mass=0.4)
    across = transform([0.07, 0, 0.02], np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    closes(hand, hand.configuration({"joint_12.0": 1.2}), body, across @ transform(-body.center_of_mass))


def test_a_four_bar_finger_closes_along_its_loop(tmp_path: Path) -> None:
    """The crank drives, the tip on the coupler arrives at the ball, and the loop is closed all the way."""
    bar = FourBar()
    hand = load_hand(bar.write(tmp_path)).with_closing({"crank": -1})
    start = hand.configuration({"crank": 0.5})
    link = hand.link("coupler")

    def tip(q: np.ndarray) -> np.ndarray:
        pose = hand.link_poses(q)[link]
        return pose[:3, :3] @ hand.links[link].shapes[-1].pose[:3, 3] + pose[:3, 3]

    goal = hand.configuration({"crank": -0.4})
    way = tip(goal) - tip(hand.configuration({"crank": -0.39}))
    center = tip(goal) + 0.028 * way / np.linalg.norm(way)  # radii 8 and 20 mm
    ball = Body.of([Shape("sphere", 0.02)])
    closed = close(hand, start, ball, transform(center))
    assert closed.touching == ("coupler",)
    assert hand.values(closed.q) == pytest.approx(bar.joints(np.pi / 2 + hand.values(closed.q)["crank"]), abs=1e-7)
    assert np.linalg.norm(tip(closed.q) - center) == pytest.approx(0.028, abs=3e-5)
    assert closed.stopped["crank"] == "coupler touches"


@pytest.mark.slow
def test_a_loop_stops_where_it_is_stretched(tmp_path: Path) -> None:
    hand = load_hand(FourBar(0.04, 0.035, 0.035, 0.05).write(tmp_path)).with_closing({"crank": 1})
    closed = close(hand, hand.configuration(), Body.of([Shape("sphere", 0.02)]), transform((1.0, 0, 0)))
    stretched = np.arccos((0.04**2 + 0.05**2 - 0.07**2) / (2 * 0.04 * 0.05)) - np.pi / 2
    assert closed.q[0] == pytest.approx(stretched, abs=1e-3)
    assert closed.stopped["crank"] == "loop"


BALL = Body.of([Shape("sphere", [0.012])], friction=0.8)
AT = transform([0.0, 0.0, 0.092])


def test_the_inner_of_two_joints_on_a_tendon_waits() -> None:
    hand = tendon_hand()
    named = {hand.joint_names[j]: [hand.joint_names[i] for i in outer] for j, outer in waiting(hand).items()}
    assert named == {"left_middle": ["left_distal"], "right_middle": ["right_distal"]}
    assert stands_open(hand, hand.joint("left_middle"), 5e-4)
    assert not stands_open(hand, hand.joint("left_middle"), 2e-3)


@pytest.mark.parametrize("name", ["barrett-bh8-280", "schunk-sah", "parallel-gripper"])
def test_nothing_waits_where_joints_are_coupled_or_driven_alone(name: str) -> None:
    assert waiting(load_hand(name)) == {}
    assert waiting(tendon_hand().with_laws("friction")) == {}  # without a stop there is nothing to wait at


def test_a_fingertip_leaves_the_inner_joint_at_its_stop() -> None:
    """Closing without stops bends both joints alike, and slips; with them, it holds under the same command."""
    preload = {f"{n}_pull": 0.02 for n in FINGERS}
    for laws, verdict in (("stops", Verdict.HOLDS), ("none", Verdict.SLIPS)):
        hand = tendon_hand().with_laws(laws)
        closed = close(hand, np.zeros(6), BALL, AT, {f"{n}_proximal": 0 for n in FINGERS})
        assert set(closed.touching) == {"left_distal", "right_distal"}
        middle, distal = (closed.q[[hand.joint(f"{n}_{part}") for n in FINGERS]] for part in ("middle", "distal"))
        assert (distal > 0.1).all()
        assert middle == pytest.approx([0.0, 0.0] if laws == "stops" else distal, abs=1e-9)
        grasp = contact_grasp(hand, closed.q, BALL, AT, preload=preload)
        assert check(grasp, np.zeros(6)).verdict is verdict


def test_a_joint_that_is_bent_already_does_not_wait() -> None:
    hand = tendon_hand()
    closed = close(hand, {"left_middle": 0.1, "right_middle": 0.1}, BALL, AT, {f"{n}_proximal": 0 for n in FINGERS})
    assert (closed.q[[hand.joint(f"{n}_middle") for n in FINGERS]] > 0.15).all()
