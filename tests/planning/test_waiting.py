"""Fingers with one tendon over two joints close the outer joint first, and then rest at a stop."""

from __future__ import annotations

import numpy as np
import pytest

from handfast import Verdict, check, close, load_hand
from handfast.core.transforms import transform
from handfast.geometry.contacts import contact_grasp
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.planning.waiting import stands_open, waiting
from tests.support.tendon_hand import FINGERS, tendon_hand

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
