"""A tendon hand, a body on four feet and a fixture: bundled grasps with numbers derived by hand on their pages."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.other_bodies import own_motors, weight_at
from handfast import Settings, check, load_configuration, load_grasp, load_hand, maximum, torques
from handfast.core.answer import Verdict
from handfast.geometry.contacts import contact_grasp
from handfast.pictures import sentences
from handfast.readers.load_body import load_body

PERCENT = Settings(gap=1e-2, verify=False)


@pytest.mark.parametrize("name", ["tendon-block", "milling-fixture", "four-feet"])
def test_files_are_what_their_hands_and_configurations_give(name: str) -> None:
    placed = load_configuration(name)
    hand, q = placed.applied(load_hand(placed.hand or ""))
    made = contact_grasp(hand, q, load_body(placed.object or ""), placed.pose, preload=placed.preload)
    stored = load_grasp(name)
    np.testing.assert_allclose(stored.G, made.G, atol=1e-8)
    np.testing.assert_allclose(stored.J, made.J, atol=1e-8)
    assert np.array_equal(stored.mechanism.R, made.mechanism.R)
    assert stored.mechanism.tendon == made.mechanism.tendon
    assert np.array_equal(stored.command, made.command)


def test_the_tendon_hand_has_one_tendon_over_two_joints_a_finger() -> None:
    mechanism = load_grasp("tendon-block").mechanism
    assert mechanism.tendon == (True, True, True)
    assert np.array_equal(np.sort(mechanism.R[mechanism.R > 0]), [0.002] * 3 + [0.008] * 3)
    assert len(mechanism.A) == 0


@pytest.mark.parametrize(
    ("direction", "largest"),
    [([0, 1, 0], 140 / 9), ([0, -1, 0], 15.0), ([-1, 0, 0, 0, 0, 0.03], 35.0)],
    ids=["pulled out", "pushed in", "beside the middle"],
)
def test_largest_loads_of_the_tendon_hand(direction: list[float], largest: float) -> None:
    found = maximum(load_grasp("tendon-block"), direction, settings=PERCENT)
    assert found.lower <= largest * (1 + 1e-6)
    assert found.upper >= largest * (1 - 1e-6)
    assert found.upper <= 1.011 * found.lower


def test_a_locked_tendon_carries_what_its_command_does_not() -> None:
    grasp = load_grasp("tendon-block")
    witness = check(grasp, [-40, 0, 0]).witness
    assert witness is not None
    tension = dict(zip(grasp.mechanism.actuators, witness.state.f, strict=True))
    assert tension["left"] == pytest.approx(50)
    # the thumb's pads carry 0.16 N for each newton of tension, give or take friction's share of its torques
    assert tension["thumb"] > 300
    thumb, fingers = witness.forces[:2, 0].sum(), -witness.forces[2:, 0].sum()
    assert thumb == pytest.approx(fingers + 40)
    # off the middle its joints trade motion; with a motor at each they cannot
    beside = [-40, 0, 0, 0, 0, 1.2]
    assert check(grasp, beside).verdict is Verdict.SLIPS
    assert check(own_motors(grasp), beside).verdict is Verdict.HOLDS


@pytest.mark.parametrize(("across", "verdict"), [(5.4, "holds"), (5.7, "slips")])
def test_without_preload_the_tendon_hand_holds_near_one_line(across: float, verdict: str) -> None:
    """Both pads of the thumb stick up to 0.25 / 1.8 of the force against it: 5.56 N beside 40 N."""
    locked = load_grasp("tendon-block").with_preload(None)
    assert check(locked, [-40, across, 0]).verdict == verdict


@pytest.mark.parametrize(
    ("x", "verdict"),
    [(-0.305, "slips"), (-0.295, "holds"), (-0.145, "holds"), (-0.135, "slips"), (0.0, "slips")],
)
def test_where_the_centre_of_mass_of_four_feet_may_be(x: float, verdict: str) -> None:
    grasp = load_grasp("four-feet")
    assert check(grasp, weight_at(grasp, x, 0.0)).verdict == verdict


def test_the_fixture_against_its_free_end() -> None:
    """0.2 times two straps of 1000 N and a screw of 500 N, and as much at the buttons behind them."""
    grasp = load_grasp("milling-fixture")
    found = maximum(grasp, [1, 0, 0])
    assert found.lower == pytest.approx(1000, rel=1e-3)
    assert found.upper == pytest.approx(1000, rel=2e-3)
    assert found.verify().ok
    assert maximum(grasp, [0, 0, 1], settings=PERCENT).unbounded


def test_the_smallest_clamping_forces() -> None:
    grasp = load_grasp("milling-fixture")
    found = torques(grasp, [500, 0, 0], settings=PERCENT)
    assert found.lower <= 500 / 1.2 <= found.upper * (1 + 1e-9)
    assert found.upper == pytest.approx(500 / 1.2, rel=1e-2)
    sentence = sentences.torques_sentence(found, "the cut")
    assert " N, and none below" in sentence  # clamps are forces, not torques
