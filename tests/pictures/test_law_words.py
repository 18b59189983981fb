"""What joints have besides their motors, as tables and reports say it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast import load_hand
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.hand.hand import Hand
from handfast.model.hand.joint_law import NO_LAW, JointLaw
from handfast.model.mechanism import Mechanism
from handfast.pictures.page_tables import grasp_table
from handfast.pictures.words import hand_joint_text, hand_laws_text, joint_text, laws_text, tendon_rows
from tests.support.tendon_hand import tendon_hand

ODD = '<fixed name="odd" stiffness="3" springlength="0.1 0.2"><joint joint="left_distal" coef="2"/></fixed>'


@pytest.fixture(scope="module")
def grasp() -> Grasp:
    contact = Contact([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5)
    about = {"a": (0.01, 0.0, "lower"), "b": (0.01, -0.2, ""), "c": (0.0, 0.0, "upper"), "d": (0.0, 0.0, "")}
    joints = [
        GraspJoint(n, np.eye(3)[0], np.zeros(3), (0,), "revolute", f, t, s)  # type: ignore[arg-type]
        for n, (f, t, s) in about.items()
    ]
    motors = replace(Mechanism.direct(list(about)), backdrivable=(False, True, False, False))
    return Grasp([contact], joints, motors)


def test_one_line_about_a_grasp(grasp: Grasp) -> None:
    assert laws_text(grasp) == (
        "Joint laws: friction 0.01 N·m at a and b; given torque −0.2 N·m at b; a cannot open further; "
        "c cannot close further; backdrivable: b."
    )
    assert laws_text(Grasp(grasp.contacts)) == ""


def test_each_joint_of_a_grasp(grasp: Grasp) -> None:
    said = ["friction 0.01 N·m, cannot open further", "friction 0.01 N·m, given torque −0.2 N·m"]
    assert [joint_text(grasp, i) for i in range(4)] == [*said, "cannot close further", ""]
    table = grasp_table(grasp)
    assert said[1] in table
    assert "b (backdrivable)" in table
    assert "no torque" in table  # a backdrivable motor without command is not locked


def with_law(hand: Hand, law: JointLaw) -> Hand:
    return replace(hand, joints=(replace(hand.joints[0], law=law), *hand.joints[1:]))


def test_each_joint_of_a_hand() -> None:
    hand = tendon_hand(more=ODD)
    assert hand_joint_text(hand, 0) == "friction 0.01 N·m"
    assert hand_joint_text(with_law(hand, NO_LAW), 0) == "no stops"
    odd = with_law(hand, JointLaw(0.0, 0.5, (0.1, 0.1), (-0.2, np.inf)))
    assert hand_joint_text(odd, 0) == "stops at −0.2 rad, spring 0.5 N·m/rad, slack at 0.1 rad"
    assert tendon_rows(hand) == [["odd", "2 × left_distal", "spring 3 N/m, slack at 0.1 to 0.2 m"]]
    assert hand_joint_text(load_hand("parallel-gripper"), 0) == "–"


def test_the_joints_of_a_hand_counted() -> None:
    about = "of 6 joints 6 have stops, 6 friction (0.01 N·m), none a spring"
    assert hand_laws_text(tendon_hand()) == about
    assert hand_laws_text(tendon_hand(more=ODD)).startswith(about + ", 1 tendon")
