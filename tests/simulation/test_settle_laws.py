"""A slow motion obeys the laws of the grasp's joints, and the grasp at rest has them, too: jaws with springs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Contact, Grasp
from handfast.readers.load_hand import load_hand
from handfast.simulation.drag_step import StepProblem, drag_step
from handfast.simulation.hand_drive import locked_joints, motors_of
from handfast.simulation.settled import Rest, Settled
from handfast.simulation.settling import settle
from handfast.stability.studies.questions import maximum
from tests.support.sprung_jaws import sprung_jaws

BOTH = ("pull_left", "pull_right")


def followed(grasp: Grasp, *force: float) -> Settled:
    return settle(grasp, force, follow=True, judge=False, distance=1e-3)


def laws(grasp: Grasp | None) -> list[tuple[float, float, str]]:
    assert grasp is not None
    return [(j.friction, round(j.torque, 2), j.stop) for j in grasp.joints]


def test_motors_that_turn_back_still_do_at_rest(tmp_path: Path) -> None:
    """2 N, 1.2 N of the spring and 0.4 N of friction stand against the left jaw's 2 + 0.5 - 0.3 N: 1.4 N are held."""
    grasp = sprung_jaws(tmp_path, backdrivable=BOTH)
    assert maximum(grasp, [1, 0, 0]).lower == pytest.approx(1.4, rel=1e-3)
    held = followed(grasp, 1.3, 0, 0)
    assert held.rest is Rest.SETTLES
    assert held.last is not None
    assert held.last.mechanism.backdrivable == (True, True)
    assert laws(held.last) == [(0.3, 0.5, ""), (0.4, 1.2, "")]
    gone = followed(grasp, 2.0, 0, 0)
    assert gone.rest is Rest.LEAVES
    assert gone.onset == pytest.approx(0.75)  # the first part of 1/20 above 0.7


def test_a_locked_joint_stays_where_it_is(tmp_path: Path) -> None:
    found = followed(sprung_jaws(tmp_path, lock=["right"]), 3, 0, -1)
    assert found.rest is Rest.SETTLES
    assert found.path[-1].q[1] == found.path[0].q[1] == -0.02
    assert found.last is not None
    assert found.last.mechanism.A.tolist() == [[0.0, 1.0]]


def test_a_tendon_at_its_end_lets_its_joint_go_no_further(tmp_path: Path) -> None:
    """The left jaw stops 0.5 mm further in, by the range of a tendon: pushed after it, the cube stays behind."""
    rope = '<tendon><fixed name="t" limited="true" range="0 .0205"><joint joint="left" coef="1"/></fixed></tendon>'
    grasp = sprung_jaws(tmp_path, rope, backdrivable=BOTH)
    found = followed(grasp, 5, 0, 0)
    assert found.rest is Rest.LEAVES
    assert found.path[-1].q[0] == pytest.approx(0.0205, abs=1e-6)
    assert found.path[-1].q[1] > -0.0195


@pytest.mark.slow
def test_laws_that_do_not_count_do_not_at_rest(tmp_path: Path) -> None:
    """Without springs and friction 2 N on each side carry 2 N across, with both 2.8 N."""
    bare, whole = (sprung_jaws(tmp_path, laws=kept) for kept in ("none", "all"))
    held = followed(bare, 0, 0, -1.9)
    assert held.rest is Rest.SETTLES
    assert laws(held.last) == [(0, 0, ""), (0, 0, "")]
    assert held.notes == ()
    assert followed(bare, 0, 0, -2.4).rest is Rest.LEAVES
    assert followed(whole, 0, 0, -2.4).rest is Rest.SETTLES


def test_friction_of_the_file_is_kept_and_what_else_differs_is_said(tmp_path: Path) -> None:
    grasp = sprung_jaws(tmp_path)
    left = replace(grasp.joints[0], friction=0.1, torque=0.7)
    own = Grasp(grasp.contacts, [left, grasp.joints[1]], grasp.mechanism, grasp.preload)
    found = followed(own.about(provenance=grasp.provenance), 0, 0, -1)
    assert laws(found.last) == [(0.1, 0.5, ""), (0.4, 1.2, "")]
    assert found.notes == ("not as the hand's file has it, and at rest as there: the given torque of left",)


def test_a_lock_is_no_coupling_of_the_hand() -> None:
    """A motor for each joint of a hand whose own couplings are left out, and one joint locked."""
    hand = load_hand("barrett-bh8-280")
    pads = [Contact([0, 0, 0.1 + 0.01 * i], [1, 0, 0], 0.5, f"finger_{i}_prox") for i in (1, 3)]
    kinds: tuple[Literal["hand", "direct"], ...] = ("hand", "direct")
    for mechanism in kinds:
        grasp = grasp_of(hand, np.zeros(hand.l), pads, np.eye(4), lock=["finger_3_prox"], mechanism=mechanism)
        assert locked_joints(grasp) == ["finger_3_prox"]
        assert motors_of(grasp, hand) == mechanism


def test_a_joint_that_rubs_and_one_on_a_spring() -> None:
    """Pushed with 0.5: 0.3 are rubbed away, and 0.2 h of the rest are gone to where a spring of 4 balances them."""
    none = np.zeros((0, 2))
    step = StepProblem(
        drag=np.ones(2), push=np.array([0.5, 0.5]), normal=none, tangent=np.zeros((0, 2, 2)), depth=np.zeros(0),
        stiffness=1e3, friction=np.zeros(0), stops=none, room=np.zeros(0), stop_stiffness=1e5,
        elastic=np.diag([0.0, 4.0]), joints=np.eye(2), dry=np.array([0.3, 0.3]),
    )  # fmt: skip
    x, _ = drag_step(step, 2.0, np.zeros(2), np.zeros(0))
    assert x == pytest.approx([0.2 * 2, 0.2 / (4 + 0.5)], rel=1e-6)
    still, _ = drag_step(replace(step, push=np.array([0.29, -0.29])), 2.0, np.zeros(2), np.zeros(0))
    assert np.abs(still).max() < 1e-6
