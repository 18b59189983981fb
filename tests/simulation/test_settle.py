"""Slow motions whose ends are known by hand: a slope, a groove, a pinch; steps, and points with depths of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.settling_step import outcome
from benchmarks.simulation_floor import across, block, on_slope, pinch
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.grasp import Grasp
from handfast.model.shape import Shape
from handfast.simulation.drag_step import STICK_MOTION, StepProblem, drag_step
from handfast.simulation.settled import Rest, Settled, verdict_of
from handfast.simulation.settling import LOADS, GraspInScene, settle
from handfast.simulation.slow_motion import touch_points
from tests.support.slides import ball_in_groove, block_and_stop, fixture, pinch_of_balls

QUICK = {"judge": False}


def slope(tangent: float) -> np.ndarray:
    """(6,) a weight of 1 N on a slope that falls along x."""
    alpha = np.arctan(tangent)
    return np.array([np.sin(alpha), 0, -np.cos(alpha), 0, 0, 0])


def shift(found: Settled) -> np.ndarray:
    """(3,) [m] of the object's origin."""
    out: np.ndarray = found.path[-1].pose[:3, 3] - found.path[0].pose[:3, 3]
    return out


# --- one step -----------------------------------------------------------------------------------


def floor(push: float, friction: float, press: float = 1.0) -> StepProblem:
    """A point that is pressed on a floor, along x[0] upwards, and pushed along x[1]."""
    return StepProblem(
        drag=np.ones(3), push=np.array([-press, push, 0]), normal=np.array([[1.0, 0, 0]]),
        tangent=np.array([[[0, 1.0, 0], [0, 0, 1]]]), depth=np.zeros(1), stiffness=1e3, friction=np.array([friction]),
        stops=np.zeros((0, 3)), room=np.zeros(0), stop_stiffness=1e5,
    )  # fmt: skip


def test_a_step_slides_by_what_friction_leaves() -> None:
    """Drag x / h = push - mu c, with c the press itself but for the drag of sinking in by c / k."""
    x, c = drag_step(floor(0.5, 0.3), 2.0, np.zeros(3), np.zeros(1))
    assert c[0] == pytest.approx(1.0, abs=1e-3)
    assert x[0] == pytest.approx(-1e-3, rel=1e-2)
    assert x[1] == pytest.approx(2 * (0.5 - 0.3 * c[0]), abs=1e-3)
    assert x[2] == 0


def test_a_step_sticks_below_friction_and_takes_the_force_up() -> None:
    x, _ = drag_step(floor(0.29, 0.3), 100.0, np.zeros(3), np.zeros(1))
    assert 0 < x[1] < STICK_MOTION


def test_what_was_pressed_in_presses_out() -> None:
    """k (p - x) = x / h: 1 / 1.001 of p in a step of one."""
    p = replace(floor(0.0, 0.0, press=0.0), depth=np.array([1e-2]))
    x, c = drag_step(p, 1.0, np.zeros(3), np.zeros(1))
    assert x[0] == pytest.approx(1e-2 * 1e3 / 1001, rel=1e-6)
    assert c[0] == pytest.approx(x[0], rel=1e-6)


def test_a_stop_carries_what_is_pushed_against_it() -> None:
    p = replace(floor(1.0, 0.0), stops=np.array([[0.0, 1, 0]]), room=np.array([0.25]))
    x, _ = drag_step(p, 100.0, np.zeros(3), np.zeros(1))
    assert x[1] == pytest.approx(0.25 + 1 / 1e5, rel=1e-3)


def test_a_step_without_drag_is_the_stability_model() -> None:
    """2 mu f of a pinch, and a block on a slope: balanced below the threshold, dragged above."""
    for share, expected in ((0.95, "balanced"), (1.05, "dragged")):
        assert outcome(pinch(0.4), across(0.4, share)) == expected
        assert outcome(block(0.4), on_slope(0.4, share)) == expected


# --- points -------------------------------------------------------------------------------------


def test_a_tilted_block_touches_deeper_on_one_side() -> None:
    """40 mm wide and tilted by 1 mrad about y: 40 micrometres between its edges."""
    hand = fixture(Shape("box", (0.4, 0.4, 0.02), transform([0, 0, -0.01])))
    body = Body.of([Shape("box", (0.04, 0.04, 0.02))])
    c, s = np.cos(1e-3), np.sin(1e-3)
    pose = transform([0, 0, 0.01], np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
    found = touch_points(Scene(hand, body), np.zeros(0), pose, 1e-3, {})
    assert len(found) == 4
    deep = found.positions[:, 0] > 0
    assert found.depths[deep] == pytest.approx(0.02 * s, abs=1e-6)
    assert found.depths[~deep] == pytest.approx(-0.02 * s, abs=1e-6)
    assert found.frames[:, :, 0] == pytest.approx(np.tile([0, 0, 1.0], (4, 1)), abs=2e-3)


def test_pairs_may_touch_at_another_depth() -> None:
    hand = fixture(Shape("box", (0.4, 0.4, 0.02), transform([0, 0, -0.01])))
    body, pose = Body.of([Shape("box", (0.04, 0.04, 0.02))]), transform([0, 0, 0.0103])
    scene = Scene(hand, body)
    assert touch_points(scene, np.zeros(0), pose, 1e-3, {}).depths == pytest.approx([-3e-4] * 4, abs=1e-8)
    assert touch_points(scene, np.zeros(0), pose, 1e-3, {(0, 0, 0): -3e-4}).depths == pytest.approx([0] * 4, abs=1e-8)


# --- motions ------------------------------------------------------------------------------------


def test_a_block_slides_to_its_stop() -> None:
    """mu = 0.3 on a slope of 0.5; 3 mm to the wall, which then carries 0.5 - 0.3 of the weight's part across."""
    found = settle(block_and_stop(3e-3, 0.3), slope(0.5))
    assert verdict_of(found.before) is Verdict.SLIPS
    assert found.rest is Rest.SETTLES
    assert found.confirmed
    assert shift(found) == pytest.approx([3e-3, 0, 0], abs=3e-5)
    assert found.moved == pytest.approx(3e-3, abs=4e-5)
    assert found.turned < 2e-3
    assert found.onset == pytest.approx(1 / LOADS)  # nothing but the weight acts: any part of it slides
    assert found.simulated == "holds"
    assert found.most is not None
    assert found.most.unbounded
    assert found.last is not None
    assert found.last.m == 8
    # with friction at full strength on both: wall = 0.447 - 0.3 table, table = 0.894 - 0.3 wall
    assert found.path[-1].forces.sum() == pytest.approx(0.197 + 0.835, abs=0.03)
    assert found.to_json()["rest"] == "settles"


@pytest.mark.parametrize("least", [0, 2, 3])
def test_a_link_has_the_least_friction_of_its_contacts(least: int) -> None:
    """One corner of the block with 0.3, the others with 0.9: on a slope of 0.5 it slides to the wall, where it rests on
    contacts of 0.3 all."""
    placed = block_and_stop(1e-3, 0.9)
    g = placed.grasp
    mixed = [replace(c, friction=0.3 if i == least else 0.9) for i, c in enumerate(g.contacts)]
    found = settle(replace(placed, grasp=Grasp(mixed, g.joints, g.mechanism)), slope(0.5), follow=True, **QUICK)
    assert shift(found)[0] == pytest.approx(1e-3, abs=1e-5)
    assert found.last is not None
    assert found.last.mu.tolist() == [0.3] * 8


def test_a_block_on_a_slope_that_it_sticks_to_is_not_followed_unless_asked() -> None:
    placed = block_and_stop(3e-3, 0.6)
    assert settle(placed, slope(0.5)).path == ()
    found = settle(placed, slope(0.5), follow=True, **QUICK)
    assert found.rest is Rest.SETTLES
    assert found.onset is None
    assert found.moved < 5e-5


def test_a_block_without_a_stop_leaves() -> None:
    found = settle(block_and_stop(0.1, 0.3), slope(0.5), distance=5e-3)
    assert (found.rest, found.last, found.after) == (Rest.LEAVES, None, None)
    assert 5e-3 < found.moved < 6e-3
    assert not found.moved_on


def test_a_ball_rolls_into_its_groove() -> None:
    """From 3 mm up one wall to the bottom, where it touches both: 45 degrees on either side."""
    found = settle(ball_in_groove(0.02, 3e-3, 1.0), [0, -1, 0], distance=0.05, **QUICK)
    assert found.rest is Rest.SETTLES
    assert found.path[-1].pose[:3, 3] == pytest.approx([0, 0.02 * np.sqrt(2), 0], abs=5e-5)
    assert found.turned == pytest.approx(3e-3 * np.sqrt(2) / 0.02, rel=0.1)  # it rolls, it does not slide
    assert found.last is not None
    normals = [found.path[-1].pose[:3, :3] @ c.normal for c in found.last.contacts]
    assert sorted(n[0] for n in normals) == pytest.approx([-np.sqrt(0.5), np.sqrt(0.5)], abs=5e-3)


def test_a_pinch_lets_go_of_what_is_too_heavy() -> None:
    """2 mu f = 1 N; of 1.25 N the part of 0.8 is too much, and no end of it."""
    found = settle(pinch_of_balls(0.5, 1.0), [0, 0, -1.25], **QUICK)
    assert found.rest is Rest.LEAVES
    assert (found.onset, found.onset_of) == (pytest.approx(0.85), "load")
    assert settle(pinch_of_balls(0.5, 1.0), [0, 0, -0.95]).rest is Rest.HOLDS


def test_a_finger_that_does_not_turn_back_carries_more_than_its_command() -> None:
    found = settle(pinch_of_balls(0.5, 1.0), [3, 0, 0], follow=True, **QUICK)
    assert found.rest is Rest.SETTLES
    assert found.path[-1].links == ("finger",)
    assert found.path[-1].forces == pytest.approx([3.0], rel=1e-2)
    assert abs(found.path[-1].q[0]) < 1e-4


def test_the_same_question_has_the_same_path_and_the_steps_have_an_end() -> None:
    one, other = (settle(block_and_stop(3e-3, 0.3), slope(0.5), steps=12, **QUICK) for _ in range(2))
    assert one.rest is Rest.UNDECIDED
    assert len(one.path) == 13
    assert np.array_equal(one.path[-1].pose, other.path[-1].pose)


def test_a_force_off_the_origin_moves_along_with_its_point() -> None:
    """A weight at the centre of mass is no torque there however the object turns; at the origin it would be."""
    placed = ball_in_groove(0.02, 3e-3, 1.0)
    w = np.r_[0, -1.0, 0, np.cross([1e-3, 0, 0], [0, -1.0, 0])]
    found = settle(placed, w, at=[1e-3, 0, 0], distance=0.05, **QUICK)
    assert found.last_wrench is not None
    R = found.path[-1].pose[:3, :3]
    assert R[:2, :2] != pytest.approx(np.eye(2), abs=1e-2)
    assert found.last_wrench[:3] == pytest.approx(R.T @ [0, -1, 0], abs=1e-9)
    assert found.last_wrench[3:] == pytest.approx(np.cross([1e-3, 0, 0], found.last_wrench[:3]), abs=1e-9)


def test_bad_questions() -> None:
    placed = block_and_stop(3e-3, 0.3)
    with pytest.raises(InputError, match="distance: is -1"):
        settle(placed, slope(0.5), distance=-1)
    with pytest.raises(InputError, match="steps: is 0"):
        settle(placed, slope(0.5), steps=0)
    with pytest.raises(InputError, match="nothing would happen"):
        settle(placed, [0, 0, 0], follow=True)
    with pytest.raises(InputError, match="provenance: hand and object are not known: the grasp file does not say"):
        GraspInScene.of(placed.grasp.about())
