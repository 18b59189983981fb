"""A hand whose fingers have one tendon over two joints, as the Shadow's: what holds the difference of the two.

Straight fingers, motors at their base, press point contacts 0.012 m beyond the last joint against each other. The
force F has the arms 0.082, 0.042 and 0.012 m about the three joints of a finger. The tendon gives the outer two joints
the same torque, so that 0.03 F is left to their friction and stops.
"""

from __future__ import annotations

import numpy as np
import pytest

from handfast import Verdict, check
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Contact, Grasp
from tests.support.tendon_hand import FINGERS, tendon_hand

# 0.03 F <= 2 x 0.01 N m, and of the motor's torque 0.01 N m at most stay in the friction of its own joint
MOST = 0.02 / 0.03 * 0.082 + 0.01  # [N m] that friction alone can bear: 0.06467


def settled(command: float, laws: str, motor: str = "base", bend: float = 0.0) -> Grasp:
    """The two fingers against each other, straight, or with the last two joints bent."""
    hand = tendon_hand().with_laws(laws)
    q = hand.configuration({f"{n}_{part}": bend for n in FINGERS for part in ("middle", "distal")})
    contacts = []
    for name in FINGERS:
        pose = hand.link_poses(q)[hand.link(f"{name}_distal")]
        contacts.append(Contact((pose @ [0, 0.006, 0.012, 1])[:3], pose[:3, 1], 0.8, f"{name}_distal"))
    return grasp_of(hand, q, contacts, np.eye(4), preload={f"{n}_{motor}": command for n in FINGERS})


@pytest.mark.parametrize("motor", ["base", "pull"])
def test_without_laws_nothing_holds_the_difference(motor: str) -> None:
    for command in (1e-3, 0.05):
        assert check(settled(command, "none", motor), np.zeros(6)).verdict is Verdict.SLIPS


def test_friction_holds_what_it_can() -> None:
    assert check(settled(MOST - 1e-4, "friction"), np.zeros(6)).verdict is Verdict.HOLDS
    assert check(settled(MOST + 1e-4, "friction"), np.zeros(6)).verdict is Verdict.SLIPS


def test_a_stop_holds_whatever_the_command() -> None:
    """The outer joints of straight fingers stand at their lower stops: they cannot open further."""
    for command in (1e-3, 0.05, 5.0):
        assert check(settled(command, "stops"), np.zeros(6)).verdict is Verdict.HOLDS
    assert check(settled(1e-3, "stops", bend=0.2), np.zeros(6)).verdict is Verdict.SLIPS  # bent, they stand at none


def test_both_hold_a_weight() -> None:
    """0.3 N, pulled along the fingers: friction 0.8 at two contacts under 0.09 N m / 0.082 m or more each."""
    for laws, verdict in (("all", Verdict.HOLDS), ("none", Verdict.SLIPS)):
        assert check(settled(0.1, laws), [0, 0, -0.3, 0, 0, 0]).verdict is verdict
