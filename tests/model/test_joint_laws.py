"""Stops, dry friction and springs of joints and tendons, from URDF, MJCF and GraspIt! files."""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pytest

from handfast import load_hand
from handfast.core.errors import InputError
from handfast.model.hand.joint_law import NO_LAW, NO_STOPS, JointLaw
from tests.support import graspit_files as graspit
from tests.support.tendon_hand import tendon_hand

URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="hinge" type="revolute"><parent link="a"/><child link="b"/><limit lower="-0.1" upper="1"/>{}</joint>
<joint name="wheel" type="continuous"><parent link="b"/><child link="c"/></joint></robot>"""
MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom size="0.01"/>
<body><joint name="a" {joint}/><geom size="0.01"/><body><joint name="b"/><geom size="0.01"/>
<site name="s"/></body></body><site name="p"/></body></worldbody><tendon>{tendon}</tendon></mujoco>"""


def mjcf(joint: str = "", tendon: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MJCF.format(joint=joint, tendon=tendon))


def test_urdf_limits_are_stops_and_friction_is_dry(tmp_path: Path) -> None:
    file = tmp_path / "r.urdf"
    file.write_text(URDF.format('<dynamics damping="3" friction="0.2"/>'))
    hinge, wheel = (j.law for j in load_hand(file).joints)
    assert hinge == JointLaw(0.2, stops=(-0.1, 1.0))
    assert wheel == NO_LAW
    file.write_text(URDF.format('<dynamics friction="-1"/>'))
    with pytest.raises(InputError, match=r"joint hinge: <dynamics> friction is -1; 0 or more is needed"):
        load_hand(file)


def test_mjcf_joints() -> None:
    said = 'range="-1 2" frictionloss="0.3" stiffness="2" springref="0.4" damping="9" armature="1"'
    a, b = (j.law for j in load_hand(mjcf(said)).joints)
    assert a == JointLaw(0.3, 2.0, (0.4, 0.4), (-1.0, 2.0))
    assert b == NO_LAW


def test_mjcf_joints_behind_a_free_one() -> None:
    """An object that floats comes first: it takes 7 numbers of the position and 6 of the velocity."""
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="ball"><freejoint/><geom size="0.01"/></body>
    <body name="palm"><geom size="0.01"/><body><joint name="a" frictionloss="0.1" stiffness="2" springref="0.4"/>
    <geom size="0.01"/><body><joint name="b" frictionloss="0.3" stiffness="5" springref="-0.2"/><geom size="0.01"/>
    </body></body></body></worldbody></mujoco>"""
    hand = load_hand(mujoco.MjModel.from_xml_string(text), root="palm")
    assert [j.law for j in hand.joints] == [JointLaw(0.1, 2.0, (0.4, 0.4)), JointLaw(0.3, 5.0, (-0.2, -0.2))]


def test_mjcf_tendons() -> None:
    runs = '<joint joint="a" coef="2"/><joint joint="b" coef="-1"/>'
    said = 'frictionloss="0.4" stiffness="3" springlength="0.1 0.2" range="-1 1" limited="true"'
    (tendon,) = load_hand(
        mjcf(tendon=f'<fixed name="t" {said}>{runs}</fixed><fixed name="idle">{runs}</fixed>')
    ).tendons
    assert tendon.name == "t"
    assert tendon.row.tolist() == [2.0, -1.0]
    assert tendon.law == JointLaw(0.4, 3.0, (0.1, 0.2), (-1.0, 1.0))


def test_what_is_not_understood_is_said(caplog: pytest.LogCaptureFixture) -> None:
    spatial = '<spatial name="wire" frictionloss="1"><site site="p"/><site site="s"/></spatial>'
    odd = "stiffness='1 2 3'" if hasattr(mjcf(), "jnt_stiffnesspoly") else ""
    with caplog.at_level(logging.WARNING):
        hand = load_hand(mjcf(odd, spatial))
    assert hand.tendons == ()
    assert hand.joints[0].law.stiffness == 0
    assert "friction, spring and range of the spatial tendon wire" in caplog.text
    assert not odd or "not read, grasps go without: the spring of joint a" in caplog.text


def test_graspit_counts_in_millionths(tmp_path: Path) -> None:
    """5e7 millionths of a newton millimetre are 0.05 N m, of a newton 50 N; viscous friction has no part at rest."""
    said = "</maxValue><viscousFriction>9</viscousFriction><CoulombFriction>5.0e+7</CoulombFriction>"
    hinge = graspit.joint("d0", a=40, high=90).replace("</maxValue>", said)
    slide = graspit.joint("0", d="d1", low=0, high=30).replace("</maxValue>", said)
    links = ("Revolute", "Prismatic")
    path = graspit.write_robot(tmp_path, graspit.dof(), graspit.dof(), graspit.chain(hinge, slide, links=links))
    one, two = (j.law for j in load_hand(path).joints)
    assert [one.friction, *one.stops] == pytest.approx([0.05, 0.0, np.pi / 2])
    assert [two.friction, *two.stops] == pytest.approx([50.0, 0.0, 0.03])


def test_springs_push_towards_their_rest_and_stops_are_near() -> None:
    law = JointLaw(0.0, 2.0, (0.1, 0.2), (0.0, 1.0))
    assert [law.torque(x) for x in (0.0, 0.1, 0.15, 0.2, 0.7)] == pytest.approx([0.2, 0.0, 0.0, 0.0, -1.0])
    assert [law.stop(x, 1e-3) for x in (-0.1, 9e-4, 2e-3, 0.5, 1.0)] == ["lower", "lower", "", "", "upper"]
    assert JointLaw(stops=(0.0, 1e-4)).stop(0.0, 1e-3) == "both"


def test_a_hand_with_some_of_its_laws() -> None:
    hand = tendon_hand()
    full = JointLaw(0.01, stops=(0.0, 1.5))
    assert hand.with_laws("all") is hand
    assert [hand.with_laws(w).joints[1].law for w in ("none", "friction", "stops,springs")] == [
        NO_LAW,
        JointLaw(0.01),
        JointLaw(stops=full.stops),
    ]
    with pytest.raises(InputError, match=r"laws: is 'damping'; all, none, or some of stops, friction, springs"):
        hand.with_laws("damping")
    limp = hand.with_backdrivable(["left_pull"]).mechanism
    assert limp.backdrivable == (False, True, False, False)
    with pytest.raises(InputError, match=r"unknown actuator 'thumb'; known: left_base"):
        hand.with_backdrivable(["thumb"])


def test_a_limit_of_a_task_is_no_stop() -> None:
    law = JointLaw(stops=(0.0, 1.0))
    assert law.within(0.2, 0.8) == law  # the joint may not go there, and nothing holds it
    assert law.within(-0.5, 1.0).stops == (-np.inf, 1.0)
    assert law.within(0.0, 1.5).stops == (0.0, np.inf)
    assert law.within(-0.5, 2.0).stops == NO_STOPS


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"friction": -1.0}, "friction: is -1; 0 or more is needed"),
        ({"stiffness": np.inf}, "stiffness: is inf; 0 or more is needed"),
        ({"stops": (1.0, 0.0)}, "stops: are 1 and 0; two numbers, the lower one first, are needed"),
        ({"rest": (0.0, np.inf)}, "rest: are 0 and inf; two numbers"),
    ],
)
def test_laws_of_wrong_numbers(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        JointLaw(**wrong)  # type: ignore[arg-type]
