"""Contacts, mechanisms and grasps: what they compute, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from tests.support.problems import X, Z, pinch

ORIGIN = np.zeros(3)


def test_grasp_map_and_jacobian_by_hand() -> None:
    """Right fingertip at x = 30 mm pressing along -x, its joint 0.1 m below: J_n = 0.1 m."""
    g = pinch(arm=0.1)
    force = np.array([-2.0, 1.0, 0.5])
    c = np.r_[g.contacts[0].frame.T @ force, 0, 0, 0]
    np.testing.assert_allclose(g.G @ c, np.r_[force, np.cross([0.03, 0, 0], force)], atol=1e-15)
    np.testing.assert_allclose(g.J[[0, 3]], 0.1 * np.eye(2), atol=1e-15)
    assert (g.m, g.l, g.size) == (2, 2, pytest.approx(0.03))


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1))
def test_contact_frames_are_right_handed(n: tuple[float, float, float]) -> None:
    frame = Contact(ORIGIN, np.array(n) / np.linalg.norm(n), 0.5).frame
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_prismatic_joints_push_along_their_axis() -> None:
    slide = GraspJoint("slide", -X, ORIGIN, (0,), "prismatic")
    g = Grasp([Contact(np.array([0.1, 0.2, 0.3]), -X, 0.5)], [slide])
    np.testing.assert_allclose(g.J[:, 0], [1, 0, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Contact(ORIGIN, np.zeros(3), 0.5), "normal: is zero; a unit vector is needed"),
        (lambda: Contact(ORIGIN, np.array([0, 0, 2.0]), 0.5), "normal: has length 2; a unit vector"),
        (lambda: Contact(np.array([0, np.nan, 0]), Z, 0.5), "position: contains NaN or infinity"),
        (lambda: Contact(ORIGIN, Z, -0.1), "friction: is -0.1; a friction coefficient is 0 or more"),
        (lambda: Contact(ORIGIN, Z, float("nan")), "friction: is nan"),
        (lambda: Contact(np.zeros(2), Z, 0.5), r"position: has shape \(2,\), needs \(3,\)"),
        (lambda: Grasp([]), "contacts: is empty; a grasp needs at least one contact"),
        (
            lambda: Grasp([Contact(ORIGIN, Z, 0.5)], [GraspJoint("a", Z, ORIGIN, (1,))]),
            r"joints\[0\].moves: has contact 1, out of range: contacts are 0 to 0",
        ),
        (
            lambda: Grasp([Contact(ORIGIN, Z, 0.5)], [GraspJoint("a", Z, ORIGIN, (0,))] * 2),
            r"joints\[1\].name: 'a' is the name of two joints",
        ),
        (
            lambda: Grasp([Contact(ORIGIN, Z, 0.5)], mechanism=Mechanism.direct(["a"])),
            "mechanism: has 1 joint columns, the grasp has 0 joints",
        ),
        (lambda: pinch().with_preload({"thumb": 1.0}), "preload: unknown actuator 'thumb'; known: right, left"),
        (lambda: pinch().with_preload({"left": float("nan")}), "preload.left: is nan; a finite torque"),
        (lambda: GraspJoint("a", Z, ORIGIN, (0,), "ball"), "type: is 'ball'; 'revolute' or 'prismatic'"),
        (
            lambda: Mechanism(("a", "a"), np.eye(2), np.zeros((0, 2)), (False, False)),
            "actuator 'a' is defined twice",
        ),
        (lambda: Mechanism(("a",), np.zeros((1, 2)), np.zeros((0, 2)), (False,)), "actuator 'a' moves no joint"),
    ],
)
def test_refusals(make, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_tendons_only_pull() -> None:
    mechanism = Mechanism(("t",), np.array([[1.0]]), np.zeros((0, 1)), (True,))
    with pytest.raises(InputError, match=r"preload.t: is -1; a tendon can only pull|preload.t: is -1.0; a tendon"):
        mechanism.commands({"t": -1.0})


def test_immutable_and_copied() -> None:
    g = pinch()
    with pytest.raises(ValueError, match="read-only"):
        g.G[0, 0] = 1.0
    other = g.with_preload({"left": 0.3})
    assert (g.preload, other.preload) == ({"right": 0.1, "left": 0.1}, {"left": 0.3})
    assert g.with_friction(0.9).mu.tolist() == [0.9, 0.9]
    assert "2 contacts, 2 joints" in repr(g)
