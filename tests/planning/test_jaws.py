"""Grippers of two jaws: where they start, with what they meet, and that flat pads find their preloads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from handfast import Verdict, check, load_hand
from handfast.core.transforms import transform
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.model.hand.anatomy import Anatomy
from handfast.model.shape import Shape
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, Pads, PreShape, antipodal, palm_of, squeezed
from handfast.planning.candidates.surface import SurfaceSampler
from handfast.planning.evaluation.attempt import Attempts, Runner
from handfast.stability.problem.loads import Loads
from tests.support.unprepared_hands import adaptive, angled

BOX = Body.of([Shape("box", (0.04, 0.05, 0.3))], mass=0.05, friction=0.5, name="box")
BLOCK = Body.of([Shape("box", (0.04, 0.03, 0.03))], mass=0.05, friction=0.5, name="block")


@pytest.fixture(scope="module")
def gripper(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    return load_hand(adaptive(tmp_path_factory.mktemp("hands")))


def runner(hand: Hand, body: Body) -> Runner:
    return Runner(Attempts(hand, body, Loads.gravity(body)))


# --- what a linkage makes of a jaw ------------------------------------------------------------------


def test_the_fingertip_of_a_linkage_is_its_jaw(gripper: Hand) -> None:
    assert {gripper.link_names[i] for i in Anatomy.of(gripper).tips} == {"left_jaw", "right_jaw"}
    assert palm_of(gripper).jaws


def test_what_no_motor_moves_is_at_rest_in_every_start(gripper: Hand) -> None:
    idle = [gripper.joint(f"{s}_coupler") for s in ("left", "right")]
    assert list(gripper.idle) == idle
    one = runner(gripper, BLOCK)
    palm = one.asked.palm
    draws = [palm_poses.draw(np.random.default_rng(k), gripper, palm, one.surface, STANDARD).q for k in range(20)]
    for q in (palm.opened, *draws):
        np.testing.assert_allclose(q[idle], 0, atol=1e-9)
        np.testing.assert_allclose(q, palm.opened, atol=1e-9)
    cranks = [gripper.joint(f"{s}_crank") for s in ("left", "right")]
    assert (palm.closed[cranks] > palm.opened[cranks] + 0.5).all()


def test_a_linkage_pushes_the_object_to_the_middle_of_its_jaws(gripper: Hand) -> None:
    pose = transform([0.005, 0, 0.12], np.eye(3))
    closed, moved = runner(gripper, BLOCK)._closed(palm_of(gripper).opened, pose)
    assert {c.link for c in closed.contacts} == {"left_jaw", "right_jaw"}
    assert moved[0, 3] == pytest.approx(0, abs=1e-3)
    assert np.abs(moved - pose)[:3, 3].argmax() == 0


# --- between the jaws -------------------------------------------------------------------------------


def test_jaws_face_each_other_with_their_pads_not_their_middles(tmp_path: Path) -> None:
    hand = load_hand(angled(tmp_path))
    palm = palm_of(hand)
    pads = Pads.of(palm.anatomy, palm.tips, palm.opened)
    assert abs(pads.line[0]) == pytest.approx(1)
    np.testing.assert_allclose(pads.points[:, 2], 0.095, atol=1e-9)
    assert pads.width == pytest.approx(0.076)
    assert palm.center == pytest.approx([0, 0, 0.095], abs=1e-9)


def test_a_ray_comes_out_on_the_other_side() -> None:
    surface, rng = SurfaceSampler(BOX), np.random.default_rng(0)
    half = np.array([0.02, 0.025, 0.15])
    for _ in range(20):
        point, normal = surface.draw(rng)
        opposite = surface.opposite(point, -normal)
        assert opposite is not None
        k = int(np.abs(normal).argmax())
        np.testing.assert_allclose(opposite[0] - point, -2 * half[k] * normal, atol=1e-12)
        assert abs(opposite[1][k]) == pytest.approx(1)
        assert surface.opposite(point, normal) is None


def test_two_points_press_against_each_other_within_the_opening() -> None:
    surface, rng = SurfaceSampler(BOX), np.random.default_rng(0)
    lines = {int(np.abs(pair[1]).argmax()) for _ in range(40) if (pair := antipodal(rng, surface, 0.06))}
    assert lines == {0, 1}  # the box is too long for its third side
    assert antipodal(rng, surface, 0.03) is None


@pytest.mark.parametrize(("friction", "some"), [(0.8, True), (0.3, False)])
def test_the_second_point_is_within_its_friction_cone(friction: float, some: bool) -> None:
    corners = np.array([[0, y, z] for y in (-0.02, 0.02) for z in (0, 0.06)])
    corners = np.vstack([corners, [[0.03, -0.02, 0], [0.03, 0.02, 0]]])  # a wedge, its slope 2 to 1
    inside = Shape("box", (0.005, 0.02, 0.02), transform([0.008, 0, 0.02], np.eye(3)))
    mesh = corners, ConvexHull(corners).simplices
    wedge = SurfaceSampler(Body.of([inside], mass=0.1, friction=friction, mesh=mesh))
    rng = np.random.default_rng(1)
    pairs = [p for _ in range(30) if (p := antipodal(rng, wedge, 0.1)) and abs(p[1][1]) < 0.9]
    assert bool(pairs) == some


def test_a_line_of_the_object_is_laid_along_that_of_the_jaws() -> None:
    closing, line, seen = np.array([0.0, 0.6, 0.8]), np.array([0.8, 0.0, 0.6]), np.array([-0.6, 0.0, 0.8])
    R = squeezed(closing, line, (seen, np.array([1.0, 0, 0])), 0.0)
    np.testing.assert_allclose(R @ line, closing, atol=1e-12)
    np.testing.assert_allclose(R @ seen, [1, 0, 0], atol=1e-12)
    rolled = squeezed(closing, line, None, 1.0)
    np.testing.assert_allclose(rolled @ line, closing, atol=1e-12)


def test_a_push_ends_with_the_object_between_the_jaws() -> None:
    hand = load_hand("parallel-gripper")
    palm, scene = palm_of(hand), Scene(hand, BLOCK)
    between = PreShape(palm.opened, transform(palm.center, np.eye(3)), palm.axis, around=True)
    np.testing.assert_array_equal(palm_poses.pushed(scene, between, 0.02), between.pose)
    deeper = PreShape(palm.opened, transform(palm.center - 0.05 * palm.axis, np.eye(3)), palm.axis, around=True)
    pose = palm_poses.pushed(scene, deeper, 0.0)
    assert pose is not None
    assert 1e-3 < scene.distance(palm.opened, pose).min() < 3e-3  # the palm touched before


# --- that they hold ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_flat_pads_find_their_preload(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Runner, "measured", lambda _, g, *__: g)  # margins are not asked for
    one = runner(load_hand("parallel-gripper"), BLOCK)
    (g,) = one.run(1).found
    assert g.grasp.m == 8
    assert all(check(g.grasp, w).verdict is Verdict.HOLDS for w in g.answer.loads.wrenches)
