"""Supports and obstacles: where they are, and whether a hand comes in and leaves in a straight line, by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast import load_body, load_hand
from handfast.cli import main
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.planning.filters.surroundings import Surroundings, Way, WayFinder
from handfast.planning.plan_grasps import plan
from handfast.planning.search import RejectionReason

GRIPPER = load_hand("parallel-gripper")  # palm from z = 0 to 50 mm, 60 mm wide; jaws to 110 mm, along y
OPENED, CLOSED = np.zeros(2), np.full(2, 0.015)
AHEAD = np.array([0.0, 0.0, 1.0])
AT = transform([0.0, 0.0, 0.095])  # of the object, between the jaws


def way(around: Surroundings, size: tuple[float, float, float] = (0.03, 0.05, 0.05)) -> Way | None:
    body = Body.of([Shape("box", size)], mass=0.1)
    return WayFinder(Scene(GRIPPER, body), around).way(OPENED, CLOSED, AT, AHEAD)


def block(*at: float) -> Shape:
    return Shape("box", (0.02, 0.02, 0.02), transform(np.array(at)))


def test_a_plane_is_below_the_lowest_point_of_the_object() -> None:
    body = Body.of([Shape("sphere", 0.03), block(0.0, 0.0, -0.05)], mass=0.1)
    (plane,) = Surroundings([0, 0, 2]).solids(body)
    inside = plane.depth(np.array([[0, 0, -0.0601], [0.9, -0.9, -0.0601], [0, 0, -0.0599]])) > 0
    assert inside.tolist() == [True, True, False]
    (plane,) = Surroundings([0, 1, 0]).solids(body)
    assert (plane.depth(np.array([[0, -0.0301, 0], [0, -0.0299, 0]])) > 0).tolist() == [True, False]


def test_a_hand_from_above_has_its_way_and_one_from_below_has_not() -> None:
    found = way(Surroundings([0, 0, -1], travel=0.2))  # the object's top is the gripper's way out
    assert found == Way({"left_slide": 0.0, "right_slide": 0.0}, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 0.2)
    assert way(Surroundings([0, 0, 1])) is None
    body = Body.of([Shape("box", (0.03, 0.05, 0.05))], mass=0.1)
    finder = WayFinder(Scene(GRIPPER, body), Surroundings([0, 0, -1]))
    assert finder.clearance(OPENED, AT) == pytest.approx(0.010, abs=1e-6)  # plane at 120 mm, fingertips at 110


def test_a_flat_object_on_a_plane_cannot_be_reached_around() -> None:
    assert way(Surroundings([0, 0, -1]), (0.03, 0.05, 0.033)) is not None  # 1.5 mm below the fingertips
    assert way(Surroundings([0, 0, -1]), (0.03, 0.05, 0.031)) is None  # 0.5 mm


def test_an_obstacle_that_the_hand_passes_on_its_way() -> None:
    behind = Surroundings(obstacles=[block(0, 0, -0.205)], travel=0.15)  # from 100 to 120 mm behind the palm
    assert way(behind) is None
    assert way(Surroundings(obstacles=behind.obstacles, travel=0.095)) is not None
    beside = Surroundings(obstacles=[block(0, 0.1, -0.02)], travel=0.15)
    assert way(beside) is not None


def test_an_obstacle_in_the_object_is_refused() -> None:
    body = Body.of([Shape("box", (0.03, 0.05, 0.05))], mass=0.1)
    scene = Scene(GRIPPER, body)
    assert WayFinder(scene, Surroundings(obstacles=[block(0.026, 0.0, 0.0)]))  # 1 mm beside it
    with pytest.raises(InputError, match=r"obstacle: is in the object, 5 mm deep"):
        WayFinder(scene, Surroundings(obstacles=[block(0.02, 0.0, 0.0)]))


@pytest.mark.parametrize("seed", range(8))
def test_a_bar_across_the_object_is_in_it_however_both_are_turned(seed: int) -> None:
    """It has no corner in the object, nor the object one in it: 3 mm of its 4 mm are in the box, or it only touches."""
    R = Rotation.random(random_state=seed).as_matrix()
    body = Body.of([Shape("box", (0.03, 0.05, 0.05), transform(np.zeros(3), R))], mass=0.1)
    for deep, inside in ((3e-3, True), (0.0, False)):
        bar = Shape("box", (0.004, 0.3, 0.01), transform(R @ np.array([0.015 + 0.002 - deep, 0.0, 0.0]), R))
        around = Surroundings(obstacles=[bar])
        if inside:
            with pytest.raises(InputError, match=r"obstacle: is in the object, 3 mm deep"):
                WayFinder(Scene(GRIPPER, body), around)
        else:
            assert WayFinder(Scene(GRIPPER, body), around)


def test_an_obstacle_where_fingers_close() -> None:
    assert way(Surroundings(obstacles=[block(0, 0.045, 0.02)])) is None  # in the way of the open jaw's tip


def test_the_object_is_not_drawn_through_an_obstacle() -> None:
    around = Surroundings(obstacles=[block(0.08, 0, -0.06)])  # beside the palm
    assert way(around) is not None
    assert way(around, (0.2, 0.05, 0.05)) is None


def test_what_cannot_be() -> None:
    with pytest.raises(InputError, match="up: is zero"):
        Surroundings([0, 0, 0])
    with pytest.raises(InputError, match="travel: is 0 m"):
        Surroundings(travel=0.0)


@pytest.mark.slow
def test_planned_grasps_keep_clear_of_the_support() -> None:
    hand, body = load_hand("barrett-bh8-280"), load_body("can")
    around = Surroundings([0, 0, 1])
    found = plan(hand, body, count=1, seed=1, jobs=1, surroundings=around)
    assert len(found.grasps) == 1
    assert found.tally[RejectionReason.BLOCKED]
    assert found.first is not None
    assert 0 < found.first <= found.seconds
    free = Scene(hand, Body.of(around.solids(body)))
    for g in found.grasps:
        assert free.distance(g.q, g.pose).min() >= 1e-3
        assert g.way is not None
        assert g.way.retreat == (0.0, 0.0, 1.0)
        opened = hand.configuration(g.way.joints)
        for at in np.linspace(0.0, g.way.distance, 21):
            there = transform(at * np.array(g.way.approach)) @ g.pose
            assert free.distance(opened, there).min() > 0
            assert Scene(hand, body).distance(opened, there).min() > -1.1e-4


@pytest.mark.slow
def test_several_objects_a_support_and_an_obstacle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = tmp_path / "wall.json"
    far.write_text(
        json.dumps(
            {
                "schema": "handfast/body/1",
                "name": "wall",
                "shapes": [{"box": {"size": [0.02, 0.4, 0.4]}, "pose": {"position": [0.3, 0, 0]}}],
            }
        )
    )
    how = ["-n", "1", "--jobs", "1", "--support", "plane", "--obstacle", str(far), "--travel", "0.05", "--json"]
    how += ["--up", "z", "--seed", "3"]
    assert main(["plan", "barrett-bh8-280", "can", "ball", *how, "-o", str(tmp_path / "out")]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["name"] for row in rows] == ["can", "ball"]
    for row in rows:
        (grasp,) = row["answer"]["grasps"]
        assert grasp["way"]["distance"] == 0.05
        assert row["answer"]["first_seconds"] > 0
        folder = tmp_path / "out" / row["name"]
        assert json.loads((folder / "plan.json").read_text("utf-8"))["grasps"] == row["answer"]["grasps"]
    resumed = ["--output", str(tmp_path / "out" / "can"), "--resume"]
    assert main(["plan", "barrett-bh8-280", "can", *how, *resumed]) == 0
    assert json.loads(capsys.readouterr().out)["grasps"] == rows[0]["answer"]["grasps"]
    assert main(["plan", "barrett-bh8-280", "can", "can"]) == 2
    assert "'can' is given twice" in capsys.readouterr().err


def test_ctrl_c_ends_a_call_about_several_objects(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("handfast.planning.evaluation.attempt.Runner.run", interrupted)
    assert main(["plan", "barrett-bh8-280", "can", "ball", "--jobs", "1", "--json"]) == 3
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["name"], row["answer"]["stop"]) == ("can", "interrupted")
