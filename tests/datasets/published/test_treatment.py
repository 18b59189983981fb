"""What is done to a published grasp: apart by the least motion, gaps closed, few contacts for the same wrenches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.transforms import transform
from handfast.datasets.published.separating import (
    CLEAR_DEPTH,
    Separator,
    fingers_of,
    gaps_closed,
    least_distance,
    pushed_on,
    reaches,
)
from handfast.geometry.contact_patch import reduced_contacts
from handfast.geometry.contacts import find_contacts
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.model.shape import Shape
from handfast.readers.load_hand import load_hand
from tests.support.published import tiny


@pytest.fixture
def hand(tmp_path: Path) -> Hand:
    return load_hand(tiny(tmp_path)[0])


def cube(half: float = 0.02) -> Body:
    return Body.of([Shape("box", [2 * half] * 3)])


def above(hand: Hand, x: float = 0.0, z: float = 0.05) -> Array:
    """(4, 4) an object above the palm, in the hand's base frame, wherever that is."""
    palm = hand.link_poses(hand.configuration())[hand.link("palm")]
    return palm @ transform([x, 0, z])


# --- the least distance problem --------------------------------------------------------------------


def test_least_distance_by_hand() -> None:
    assert np.allclose(least_distance(np.array([[3.0, 4.0]]), np.array([5.0])), [0.6, 0.8])
    rows = np.array([[1.0, 0], [0, 1.0], [1.0, 1.0]])
    assert np.allclose(least_distance(rows, np.array([1.0, 2.0, -9.0])), [1, 2])
    assert np.allclose(least_distance(rows, np.array([-1.0, 0.0, -1.0])), [0, 0])
    assert np.allclose(least_distance(1e3 * rows, np.array([1e-6, 2e-6, 0])), [1e-9, 2e-9], rtol=1e-6)


def test_least_distance_is_optimal_on_random_problems() -> None:
    from scipy.optimize import minimize

    rng = np.random.default_rng(3)
    for _ in range(20):
        rows = rng.normal(size=(5, 4))
        least = rows @ rng.normal(size=4) - rng.random(5)  # something fulfils them
        x = least_distance(rows, least)
        assert (rows @ x >= least - 1e-8).all()
        opened = {"type": "ineq", "fun": lambda v, A=rows, b=least: A @ v - b}
        other = minimize(lambda v: v @ v, np.ones(4), constraints=opened)
        assert x @ x <= other.fun + 1e-5


# --- apart -----------------------------------------------------------------------------------------


def test_an_object_a_finger_is_in_moves_away_from_it(hand: Hand) -> None:
    scene = Scene(hand, cube())
    q, pose = hand.configuration(), above(hand, x=0.003)  # 22 mm of room, 20 mm of cube: 1 mm in the right finger
    done = Separator(scene).separated(q, pose)
    assert done.before == pytest.approx(0.001, abs=1e-6)
    assert done.apart
    assert done.after <= CLEAR_DEPTH
    assert scene.distance(done.q, done.pose).min() >= -CLEAR_DEPTH
    # the object and the joint share the millimetre; each alone would have to move all of it
    assert 0 < done.object_moved < 0.001
    assert 0 < done.surface_moved < 0.0015
    assert done.joints_moved > 0


def test_squeezed_from_both_sides_the_joints_open(hand: Hand) -> None:
    scene = Scene(hand, cube(half=0.0235))  # 1.5 mm in either finger
    done = Separator(scene).separated(hand.configuration(), above(hand))
    assert done.apart
    there = done.pose[:3, 3] - above(hand)[:3, 3]
    assert np.abs(there[:2]).max() < 1e-6  # upwards helps, as its lower edges are what the fingers are deepest at
    assert (done.q < -0.01).all()
    assert done.q[0] == pytest.approx(done.q[1], abs=1e-3)


def test_what_is_apart_is_left_as_it_is(hand: Hand) -> None:
    q, pose = hand.configuration(), above(hand)
    done = Separator(Scene(hand, cube())).separated(q, pose)
    assert (done.before, done.object_moved, done.object_turned, done.joints_moved) == (0, 0, 0, 0)
    assert np.array_equal(done.q, q)
    assert np.array_equal(done.pose, pose)


def test_a_finger_that_is_open_already_leaves_it_to_the_object(hand: Hand) -> None:
    q = hand.configuration({"left_hinge": -0.59, "right_hinge": -0.59})
    done = Separator(Scene(hand, cube())).separated(q, above(hand, x=0.016))
    assert done.before > 0.002
    assert done.apart
    assert (done.q >= hand.limits[:, 0]).all()
    assert done.object_moved > 0.001


def test_what_cannot_part_is_said(hand: Hand) -> None:
    q = hand.configuration({"left_hinge": -0.59, "right_hinge": -0.59})
    done = Separator(Scene(hand, cube(half=0.065))).separated(q, above(hand, z=0.075))
    assert not done.apart
    assert done.after > CLEAR_DEPTH
    assert (done.q >= hand.limits[:, 0]).all()


def test_reaches_bound_what_a_joint_moves_at_any_configuration() -> None:
    hand = load_hand("schunk-sah")
    scene, rng = Scene(hand, cube()), np.random.default_rng(0)
    reach, (lower, upper) = reaches(hand, scene.link_radius), hand.limits.T
    for _ in range(20):
        q = lower + rng.random(hand.l) * (upper - lower)
        poses, (_, origins) = hand.link_poses(q), hand.joint_axes(q)
        for i, radius in enumerate(scene.link_radius):
            for j in hand.moved_by(i):
                assert np.linalg.norm(poses[i][:3, 3] - origins[j]) + radius <= reach[j] + 1e-12
    assert reach.max() < 0.3


# --- gaps ------------------------------------------------------------------------------------------


def test_each_finger_that_does_not_touch_is_closed_on_its_own_way(hand: Hand) -> None:
    scene, pose = Scene(hand, cube()), above(hand, x=0.001)  # 3 mm of room on the left, 1 mm on the right
    target = hand.configuration({"left_hinge": 0.4, "right_hinge": 0.4})
    found = gaps_closed(scene, hand.configuration(), pose, target)
    assert found.closed == pytest.approx({"left": 0.003, "right": 0.001}, abs=1e-6)
    assert found.open == {}
    distance = scene.distance(found.q, pose)
    assert (np.abs(distance[[hand.link("left"), hand.link("right")]]) < 2e-5).all()
    assert (distance >= 0).all()
    assert found.q[hand.joint("left_hinge")] > found.q[hand.joint("right_hinge")]


def test_a_finger_that_never_arrives_stays(hand: Hand) -> None:
    scene, pose, q = Scene(hand, cube()), above(hand), hand.configuration()
    target = hand.configuration({"left_hinge": 0.4, "right_hinge": 0.01})
    found = gaps_closed(scene, q, pose, target)
    assert list(found.closed) == ["left"]
    assert found.open == pytest.approx({"right": 0.002}, abs=1e-6)
    assert found.q[hand.joint("right_hinge")] == 0
    touching = gaps_closed(scene, found.q, pose, target)
    assert touching.q[hand.joint("left_hinge")] == found.q[hand.joint("left_hinge")]


def test_a_finger_that_would_meet_another_stays(hand: Hand) -> None:
    scene, q = Scene(hand, cube(half=0.004)), hand.configuration()
    target = hand.configuration({"left_hinge": 0.8, "right_hinge": 0.8})
    found = gaps_closed(scene, q, above(hand, x=0.02), target)  # the left finger would have to go through the right one
    assert found.closed == {}
    assert "left" in found.open
    assert scene.self_collisions(found.q, 0.0) == []


def test_a_gripper_pushes_the_object_until_it_is_held() -> None:
    gripper = load_hand("parallel-gripper")
    body = Body.of([Shape("box", [0.02, 0.05, 0.02])])
    q, pose = gripper.configuration(), transform([0, 0.01, 0.095])  # 5 mm from one jaw, 25 mm from the other
    separator = Separator(Scene(gripper, body))
    target = gripper.configuration({"left_slide": 0.04})
    touching = gaps_closed(separator.scene, q, pose, target).q
    assert touching[0] == pytest.approx(0.005, abs=1e-4)
    held, there, pushed = pushed_on(separator, touching, pose, target)
    assert pushed == pytest.approx(0.01, abs=1e-4)
    assert np.abs(there[:3, 3] - [0, 0, 0.095]).max() < 1e-4
    assert held == pytest.approx([0.015, 0.015], abs=1e-4)
    assert sorted(separator.scene.distance(held, there))[1] < 5e-5
    # nothing to push against: the other jaw is gone
    short = gripper.configuration({"left_slide": 0.01})
    assert pushed_on(separator, touching, pose, short) == (pytest.approx(touching), pytest.approx(pose), 0)


def test_fingers_begin_where_they_part_and_one_motor_makes_them_one() -> None:
    barrett = load_hand("barrett-bh8-280")
    assert len(fingers_of(load_hand("schunk-sah"))) == 4
    assert len(fingers_of(load_hand("parallel-gripper"))) == 1
    joints = [j for own, _ in fingers_of(barrett) for j in own]
    assert len(set(joints)) == len(joints)


# --- contacts --------------------------------------------------------------------------------------


def test_a_face_on_a_finger_keeps_its_ends(hand: Hand) -> None:
    scene, pose = Scene(hand, cube()), above(hand)
    target = hand.configuration({"left_hinge": 0.4, "right_hinge": 0.4})
    q = gaps_closed(scene, hand.configuration(), pose, target).q
    contacts = find_contacts(hand, q, scene.body, pose, scene=scene)
    assert {c.link for c in reduced_contacts(contacts, scene.body).contacts} == {"left", "right"}
