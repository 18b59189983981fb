"""The grasp that contacts make: joints, mechanism, closing senses, couplings and locks."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.contacts import contact_grasp, grasp_of
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.readers.load_hand import load_hand
from tests.support.contact_cases import (
    contact_on,
    linked_finger,
    pinching,
)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_grasp_joints_close_positively(sign: float) -> None:
    pose = transform([0.05, 0, 0], quaternion_matrix([np.cos(0.4), 0, 0, np.sin(0.4)]))
    body = Body.of([Shape("cylinder", (0.02, 0.1))], friction=0.8)
    grasp = contact_grasp(pinching(sign), np.zeros(3), body, pose, preload={"mb": 0.2})
    assert [c.link for c in grasp.contacts] == ["left", "right"]
    assert [j.name for j in grasp.joints] == ["a", "b"]  # the idle finger touches nothing
    assert [j.moves for j in grasp.joints] == [(0,), (1,)]
    np.testing.assert_allclose(grasp.mechanism.R, np.diag([2.0, 3.0]))
    assert grasp.mu.tolist() == [0.8, 0.8]
    assert grasp.preload == {"mb": 0.2}
    # J q: closing moves each fingertip 50 mm/rad along its normal, into the object
    np.testing.assert_allclose(grasp.J[[0, 3]], np.diag([0.05, 0.05]), atol=1e-9)


def test_coupled_joints_and_locks() -> None:
    hand = load_hand("barrett-bh8-280")
    q = hand.configuration({"finger_3_prox": 0.9})
    tip = next(s for s in hand.links[hand.link("finger_3_dist")].shapes if s.kind == "sphere")
    T = hand.link_poses(q)[hand.link("finger_3_dist")]
    wall = Body.of([Shape("box", (0.1, 0.02, 0.1))])
    pose = transform((T @ tip.pose)[:3, 3] + [0, 0.018, 0])
    grasp = contact_grasp(hand, q, wall, pose)
    assert [j.name for j in grasp.joints] == ["finger_3_prox", "finger_3_dist"]
    assert grasp.mechanism.actuators == ("finger_3_prox",)
    np.testing.assert_allclose(grasp.mechanism.A, [[-1 / 3, 1]])
    locked = contact_grasp(hand, q, wall, pose, lock=["finger_3_dist"])
    np.testing.assert_allclose(locked.mechanism.A, [[-1 / 3, 1], [0, 1]])
    direct = contact_grasp(hand, q, wall, pose, mechanism="direct", preload={"finger_3_prox": 0.1})
    assert direct.mechanism.actuators == ("finger_3_prox", "finger_3_dist")
    assert direct.mechanism.A.shape == (0, 2)
    with pytest.raises(InputError, match=r"lock: unknown joint 'x'; known: finger_1_spread"):
        contact_grasp(hand, q, wall, pose, lock=["x"])
    with pytest.raises(InputError, match=r"unknown actuator 'finger_3_dist'; known: finger_3_prox"):
        contact_grasp(hand, q, wall, pose, preload={"finger_3_dist": 0.1})


def test_joints_that_share_an_actuator_or_a_coupling_come_along() -> None:
    """a and b by an actuator, b and c by a coupling; the slide has nothing to do with them."""
    R = np.array([[1.0, 0.5, 0, 0], [0, 0, 0, 2.0]])
    hand = linked_finger(R, np.array([[0, -0.25, 1.0, 0]]), (1, 1, 1, 1))
    grasp = grasp_of(hand, np.zeros(4), contact_on("one"), np.eye(4))
    assert [j.name for j in grasp.joints] == ["a", "b", "c"]
    assert [j.moves for j in grasp.joints] == [(0,), (), ()]
    assert grasp.mechanism.actuators == ("m0",)
    np.testing.assert_array_equal(grasp.mechanism.R, [[1, 0.5, 0]])
    np.testing.assert_array_equal(grasp.mechanism.A, [[0, -0.25, 1]])
    assert grasp.name == "linked"
    alone = grasp_of(hand, np.zeros(4), contact_on("sled"), np.eye(4), name="mine")
    assert [(j.name, j.type) for j in alone.joints] == [("s", "prismatic")]
    assert alone.mechanism.A.shape == (0, 1)
    assert alone.name == "mine"
    palm = grasp_of(hand, np.zeros(4), contact_on("palm"), np.eye(4))
    assert (palm.joints, palm.mechanism.actuators) == ((), ())


@pytest.mark.parametrize(
    ("gain", "closing", "tendon", "turned", "expected"),
    [
        (0.5, 1, False, 1, 0.5),
        (-0.5, 1, False, 1, 0.5),  # the actuator is turned round: positive forces close
        (0.5, -1, False, -1, 0.5),  # the joint is, and the actuator with it
        (-0.5, -1, False, -1, 0.5),
        (-0.5, 0, False, 1, -0.5),  # what does not close stays as it is
        (0.5, 0, False, 1, 0.5),
        (-0.5, 1, True, 1, -0.5),  # a tendon cannot push
        (0.5, -1, True, -1, -0.5),
    ],
)
def test_joints_and_actuators_close_by_positive_values(
    gain: float, closing: float, tendon: bool, turned: float, expected: float
) -> None:
    R = np.array([[0.0, 0, 0, gain]])
    hand = linked_finger(R, np.zeros((0, 4)), (0, 0, 0, closing), tendon)
    grasp = grasp_of(hand, np.zeros(4), contact_on("sled"), np.eye(4))
    np.testing.assert_array_equal(grasp.joints[0].axis, [0, turned, 0])
    np.testing.assert_array_equal(grasp.mechanism.R, [[expected]])
    assert grasp.mechanism.tendon == (tendon,)


def test_a_grasp_is_named_after_hand_and_object_and_has_the_friction_asked_for() -> None:
    pose, body = transform([0.05, 0, 0]), Body.of([Shape("cylinder", (0.02, 0.1))], friction=0.8, name="can")
    grasp = contact_grasp(pinching(), np.zeros(3), body, pose, friction=0.25)
    assert grasp.name == "pinch on can"
    assert grasp.mu.tolist() == [0.25, 0.25]
    assert contact_grasp(pinching(), np.zeros(3), body, pose, name="mine").name == "mine"
