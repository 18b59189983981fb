"""What the joints of a grasp take over from the hand's: friction, springs, stops, each in the closing sense."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import InputError, load_hand
from handfast.core.transforms import transform
from handfast.geometry.contacts import contact_grasp, grasp_of
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.hand.joint_law import JointLaw
from handfast.model.shape import Shape
from tests.support.sprung_jaws import sprung_jaws
from tests.support.tendon_hand import tendon_hand

BALL = Body.of([Shape("sphere", [0.0235])], friction=0.8)
AT = transform([0.0, 0.0, 0.1])  # between straight fingers' tips


def held(sign: int = 1, **options: object) -> Grasp:
    hand = tendon_hand(
        more='<fixed name="odd" stiffness="3" springlength="0.1"><joint joint="left_distal" coef="2"/></fixed>'
    )
    hand = hand.with_closing(dict.fromkeys(hand.joint_names, sign))
    return contact_grasp(hand, np.zeros(6), BALL, AT, threshold=1e-3, **options)  # type: ignore[arg-type]


def test_stops_turn_with_the_closing_sense() -> None:
    """The straight fingers stand at the lower limits of their outer joints."""
    for sign, stop in ((1, "lower"), (-1, "upper")):
        joints = {j.name: j for j in held(sign).joints}
        assert [joints[f"right_{n}"].stop for n in ("proximal", "middle", "distal")] == ["", stop, stop]
        assert {j.friction for n, j in joints.items() if not n.startswith("tendon")} == {0.01}


def test_springs_turn_with_the_closing_sense() -> None:
    hand = tendon_hand()
    first = replace(hand.joints[0], law=JointLaw(0.0, 2.0, (0.1, 0.1)))
    hand = replace(hand, joints=(first, *hand.joints[1:]))
    for sign in (1, -1):
        turned = hand.with_closing({"left_proximal": sign})
        grasp = contact_grasp(turned, np.zeros(6), BALL, AT, threshold=1e-3)
        assert grasp.joints[0].torque == pytest.approx(sign * 0.2)


def test_a_tendon_with_a_spring_is_a_joint_tied_to_those_it_runs_over() -> None:
    """3 N/m, 0.1 m from rest, and 2 m of length for each radian of left_distal: it opens the tendon, and the joint."""
    grasp = held()
    tendon = grasp.joints[-1]
    assert (tendon.name, tendon.moves, tendon.type) == ("tendon odd", (), "prismatic")
    assert tendon.torque == pytest.approx(0.3)
    row = dict(zip([j.name for j in grasp.joints], grasp.mechanism.A[-1], strict=True))
    assert {n: x for n, x in row.items() if x} == {"left_distal": -2.0, "tendon odd": 1.0}
    assert "tendon odd" not in [j.name for j in held(laws="stops,friction").joints]


def test_what_is_asked_for() -> None:
    bare = held(laws="none")
    assert all((j.friction, j.torque, j.stop) == (0.0, 0.0, "") for j in bare.joints)
    assert bare.mechanism.backdrivable == (False,) * 4
    free = held(backdrivable=["left_pull", "right_base"]).mechanism
    named = {n for n, yes in zip(free.actuators, free.backdrivable, strict=True) if yes}
    assert named == {"left_pull", "right_base"}
    direct = held(mechanism="direct", laws="friction")
    assert {j.friction for j in direct.joints} == {0.01}
    with pytest.raises(InputError, match=r"is backdrivable, and with one motor per joint there is no 'left_pull'"):
        held(mechanism="direct", backdrivable=["left_pull"])


def test_a_follower_at_its_limit_stops_its_driver() -> None:
    """The Schunk's two outer joints are coupled rigidly and end together; a Barrett's clutch lets the driver go on."""
    contact = Contact([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5, "index_distal")
    hand = load_hand("schunk-sah")
    q = hand.configuration({"index_distal": hand.joints[hand.joint("index_distal")].upper})
    stops = {j.name: j.stop for j in grasp_of(hand, q, [contact], np.eye(4)).joints}
    assert (stops["index_middle"], stops["index_distal"]) == ("upper", "upper")
    hand = load_hand("barrett-bh8-280")
    end = hand.joints[hand.joint("finger_3_dist")].upper
    contact = replace(contact, link="finger_3_dist")
    for clutch, stop in ((True, ""), (False, "upper")):
        q = hand.configuration({"finger_3_prox": 1.0, "finger_3_dist": end})
        made = grasp_of(replace(hand, breakaway=clutch), q, [contact], np.eye(4))
        assert [(j.name, j.stop) for j in made.joints] == [("finger_3_prox", ""), ("finger_3_dist", stop)]


def test_a_joint_between_two_stops_has_both_whichever_way_it_closes() -> None:
    hand = tendon_hand()
    first = replace(hand.joints[0], law=JointLaw(stops=(0.0, 1e-4)))
    hand = replace(hand, joints=(first, *hand.joints[1:]))
    contact = Contact([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5, "left_proximal")
    for sign in (1, -1):
        turned = hand.with_closing({"left_proximal": sign})
        assert grasp_of(turned, np.zeros(6), [contact], np.eye(4)).joints[0].stop == "both"


def test_a_slide_stands_at_its_stop_within_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    contact = Contact([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.5, "left")
    sprung_jaws(tmp_path)
    hand = load_hand(str(tmp_path / "jaws.xml"))
    for value, stop in ((0.05 - 0.9e-4, "upper"), (0.05 - 1.1e-4, ""), (-0.02 + 0.9e-4, "lower"), (-0.02 + 5e-4, "")):
        made = grasp_of(hand, hand.configuration({"left": value}), [contact], np.eye(4))
        assert made.joints[0].stop == stop


def test_a_stop_is_one_within_a_milliradian() -> None:
    hand = tendon_hand()
    contact = Contact([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5, "left_distal")
    for value, stop in ((9e-4, "lower"), (1.1e-3, ""), (1.4995, "upper")):
        q = hand.configuration({"left_distal": value})
        assert grasp_of(hand, q, [contact], np.eye(4)).joints[-1].stop == stop
