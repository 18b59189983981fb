"""Tasks with sides of cylinders from file to answer: found and proved, shown to be impossible, drawn, saved."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import CylinderSide, load_task, synthesize, verify
from handfast.core.answer import Reach
from handfast.model.region import Cap
from handfast.readers.load_hand import load_hand
from handfast.synthesis.solution import relative_curvatures
from handfast.synthesis.task import ContactPair, Task
from handfast.synthesis.task_file import save_task
from tests.support.holds import square

X, Y, Z = np.eye(3)
NARROW = (-0.2, 0.2)


def can(radius: float, angles: tuple[float, float] = NARROW) -> Task:
    """A can upright between the round fingertips of the gripper, which opens 80 mm; each has its own part of it."""
    pairs = []
    for side, link in ((1.0, "left_finger"), (-1.0, "right_finger")):
        tip = Cap((0, 0.005 * side, 0.045), 0.005, (0, -side, 0), 1.0)
        pairs.append(ContactPair(link, tip, CylinderSide(0 * X, radius, Z, side * Y, angles, (-0.02, 0.02))))
    return Task.of(load_hand("parallel-gripper"), tuple(pairs), name="can")


def bar(width: float) -> Task:
    """A block between a round bar across one of the gripper's fingers and the round tip of the other."""
    on_hand = CylinderSide((0, 0.005, 0.045), 0.005, X, -Y, (-0.5, 0.5), (-0.01, 0.01))
    tip = Cap((0, -0.005, 0.045), 0.005, Y, 1.0)
    left = ContactPair("left_finger", on_hand, square(1.0, width / 2))
    right = ContactPair("right_finger", tip, square(-1.0, -width / 2))
    return Task.of(load_hand("parallel-gripper"), (left, right), name="bar")


def test_a_can_that_fits_is_found_and_proved(tmp_path: Path) -> None:
    save_task(can(0.03), tmp_path / "can.json")
    task = load_task(tmp_path / "can.json")
    answer = synthesize(task, count=3, seed=1)
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok
    for s in answer.solutions:
        local = (s.points - s.pose[:3, 3]) @ s.pose[:3, :3]
        np.testing.assert_allclose(np.hypot(*local[:, :2].T), 0.03, atol=1e-9)
        assert np.abs(local[:, 2]).max() < 0.02
        across = local[:, :2] / 0.03
        np.testing.assert_allclose(s.normals @ s.pose[:3, :3], -np.column_stack([across, [0, 0]]), atol=1e-7)
        assert (across[:, 1] * [1, -1] > np.cos(0.2)).all()
        assert {"contact:0:s", "contact:1:t"} <= set(s.slacks)
        # a cylinder is straight along its axis, where a ball of 5 mm curves away from it
        np.testing.assert_allclose(relative_curvatures(s), 200, rtol=1e-6)
    answer.save(tmp_path / "answer.json")
    assert verify(tmp_path / "answer.json").ok
    forged = json.loads((tmp_path / "answer.json").read_text())
    assert "cylinder_side" in json.dumps(forged["task"])


def test_a_forged_configuration_is_refused() -> None:
    (s,) = synthesize(can(0.03)).solutions
    thicker = can(0.0301)
    assert not replace(s, task=thicker).verify().ok
    hollow = [replace(p, object=replace(p.object, flip=True)) for p in s.task.contact_pairs]
    assert not replace(s, task=replace(s.task, contact_pairs=tuple(hollow))).verify().ok


def test_a_can_that_is_too_thick_is_shown_to_be_impossible() -> None:
    """No two points of these parts are nearer than 2 r cos 0.2: 88 mm, and the gripper opens 80 mm."""
    answer = synthesize(can(0.045))
    assert answer.verdict is Reach.NONE
    done = answer.verify()
    assert done.ok, done.reason


def test_wider_parts_of_the_same_can_are_reached() -> None:
    answer = synthesize(can(0.045, (-1.0, 1.0)))
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok


def test_a_bar_on_the_hand() -> None:
    answer = synthesize(bar(0.05))
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok
    (s,) = answer.solutions
    assert {"contact:0:u", "contact:0:v"} <= set(s.slacks)
    assert synthesize(bar(0.1)).verdict is Reach.NONE


@pytest.mark.parametrize(("radius", "verdict"), [(0.04, Reach.FOUND), (0.07, Reach.NONE)])
def test_fingertips_spread_a_ring_from_inside(radius: float, verdict: Reach) -> None:
    """Round tips of 15 mm, which come to 55 mm from the middle: not to the parts of a ring that is wider."""
    pairs = []
    for side, link in ((1.0, "left_finger"), (-1.0, "right_finger")):
        inside = CylinderSide(0 * X, radius, Z, side * Y, NARROW, (-0.01, 0.01), flip=True)
        pairs.append(ContactPair(link, Cap((0, 0, 0.045), 0.015, (0, side, 0), 0.8), inside))
    answer = synthesize(Task.of(load_hand("parallel-gripper"), tuple(pairs)))
    assert answer.verdict is verdict
    assert answer.verify().ok
    for s in answer.solutions:
        assert (np.einsum("ij,ij->i", s.normals, s.points - s.pose[:3, 3]) > 0.9 * radius).all()  # away from the axis
