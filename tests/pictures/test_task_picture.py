"""Pictures of tasks: what hides what, from where it is seen, and that every part is there."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.cylinder_side import CylinderSide
from handfast.model.region import Cap
from handfast.model.shape import Shape
from handfast.pictures.camera import View, first_hit
from handfast.pictures.depth_buffer import Facets, rendered
from handfast.pictures.drawing import picture
from handfast.pictures.task_picture import HAND_REGION, OBJECT_REGION, REGION_VIEWS, clearest, draw_task
from handfast.synthesis.task_file import load_task
from tests.support.feasible import Feasible
from tests.support.holds import grip
from tests.support.places import FEASIBLE as FEASIBLE_FILE

STORED = json.loads(FEASIBLE_FILE.read_text())["tasks"]
RED, BLUE = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
TOP = View("from above", np.eye(3))
LOW, HIGH = np.array([-1.0, -1.0]), np.array([1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Answer:
    q: Array
    pose: Array
    points: Array
    normals: Array


def box(size: tuple[float, float, float], at: tuple[float, float, float], color: Array) -> Facets:
    pose = np.eye(4)
    pose[:3, 3] = at
    vertices, faces = Shape("box", size, pose).triangles()
    return Facets(vertices[faces], color, True)


def hue(image: Array, color: Array | str) -> Array:
    """Which pixels have a colour, whatever their light."""
    want = np.array(to_rgb(color)) if isinstance(color, str) else color
    unit = image / np.maximum(np.linalg.norm(image, axis=2, keepdims=True), 1e-9)
    return unit @ (want / np.linalg.norm(want)) > 0.999


def test_what_is_nearer_hides_what_is_behind() -> None:
    """A red slab in the left half, half of it under a blue one: areas to a pixel, whatever the order."""
    red, blue = box((1, 1, 0.1), (-0.5, 0, 0), RED), box((1, 0.5, 0.1), (-0.5, 0.25, 0.3), BLUE)
    for panel in ([red, blue], [blue, red]):
        image = rendered(panel, TOP, LOW, HIGH, (100, 120))
        assert hue(image, RED).sum() == pytest.approx(60 * 25, abs=70)
        assert hue(image, BLUE).sum() == pytest.approx(60 * 25, abs=70)
        assert hue(image, BLUE)[25:50, :60].mean() > 0.97  # the first row is the top one
        assert (image[:, 62:] == 1).all()
    below = [red, box((1, 0.5, 0.1), (-0.5, 0.25, -0.3), BLUE)]
    assert not hue(rendered(below, TOP, LOW, HIGH, (100, 120)), BLUE).any()


def test_slanted_surfaces_cut_each_other_where_they_meet() -> None:
    """Two slabs crossing at x = 0, which painting whole facets in order cannot show."""
    up, down = (
        np.array([[[-1, -1, -s], [1, -1, s], [1, 1, s]], [[-1, -1, -s], [1, 1, s], [-1, 1, -s]]]) for s in (0.5, -0.5)
    )
    image = rendered([Facets(up, RED, True), Facets(down, BLUE, True)], TOP, LOW, HIGH, (80, 80))
    assert hue(image, RED)[:, 41:].all()
    assert hue(image, BLUE)[:, :39].all()


def test_a_surface_that_faces_away_is_not_drawn() -> None:
    corners = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], dtype=float)
    assert hue(rendered([Facets(corners, RED, True)], TOP, LOW, HIGH, (40, 40)), RED).any()
    assert (rendered([Facets(corners[:, ::-1], RED, True)], TOP, LOW, HIGH, (40, 40)) == 1).all()


def test_what_lies_on_the_way_to_the_viewer() -> None:
    corners = box((1, 1, 0.1), (0, 0, 1), RED).corners
    up, low, high, beside = np.array([0.0, 0, 9]), *np.array([[0.2, 0.1, 0], [0.2, 0.1, 2], [0.7, 0.1, 0]])
    assert first_hit(corners, low, low + up) == pytest.approx(0.95 / 9)
    assert first_hit(corners, high, high + up) == 1
    assert first_hit(corners, beside, beside + up) == 1
    assert first_hit(corners, beside, beside + np.array([-4.5, 0, 9])) < 1


def test_the_first_view_sees_the_contacts() -> None:
    """A wall on one side, contacts on the other: the pictures are taken from there."""
    wall = box((0.01, 2, 2), (0.1, 0, 0), RED)
    spots = np.array([[0.0, 0.1, 0], [0, -0.1, 0]])
    answer = Answer(np.zeros(1), np.eye(4), spots, np.array([[0, 1.0, 0], [0, -1.0, 0]]))
    for wall_side, sign in ((0.1, -1), (-0.1, 1)):
        solid = Facets(wall.corners + np.array([wall_side - 0.1, 0, 0]), RED, True)
        first, second = clearest([solid], answer)
        assert sign * first.matrix[2, 0] > 0
        assert first.matrix[2] @ second.matrix[2] <= 0.8


def answer_of(name: str) -> tuple[object, Answer]:
    task, found = load_task(name), Feasible.of(STORED[name])
    return task, Answer(found.q(task), found.pose, found.points(task), found.normals(task))


@pytest.mark.slow
def test_a_solution_is_drawn_whole() -> None:
    task, answer = answer_of("guitar-holding")
    figure = draw_task(task, answer)  # type: ignore[arg-type]
    left, right = figure.axes
    for ax in (left, right):
        image = ax.images[0].get_array()
        assert hue(image, OBJECT_REGION).sum() > 100
        assert hue(image, HAND_REGION).sum() > 20
        assert {t.get_text() for t in ax.texts} >= {"0", "1", "2", "3", "50 mm"}
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        marks = [line.get_xydata()[0] for line in ax.lines if line.get_marker() == "o"]
        assert len(marks) == 4
        assert all(x0 < x < x1 and y0 < y < y1 for x, y in marks)
    said = " ".join(t.get_text() for t in figure.texts)
    assert "guitar-holding" in said
    assert "1: thumb_distal" in said
    key = [t.get_text() for t in figure.legends[0].get_texts()]
    assert key == ["hand", "object", "region of the hand", "region of the object", "contact, normal of the hand"]


@pytest.mark.slow
def test_a_task_alone_shows_hand_and_object_apart_and_the_same_every_time() -> None:
    task = load_task("scalpel-upholding")
    figure = draw_task(task)
    hand, thing = (ax.images[0].get_array() for ax in figure.axes)
    assert hue(hand, HAND_REGION).any()
    assert not hue(hand, OBJECT_REGION).any()
    assert hue(thing, OBJECT_REGION).any()
    assert not hue(thing, HAND_REGION).any()
    assert "contact, normal of the hand" not in [t.get_text() for t in figure.legends[0].get_texts()]
    assert picture(figure) == picture(draw_task(task))


def test_without_a_mesh_the_regions_are_drawn() -> None:
    task = grip(0.05)
    first = task.contact_pairs[0]
    ball = Cap(np.array([0.0, 0, 0.02]), 0.01, np.array([0.0, 0, 1]), 1.0)
    bare = replace(task, object=None, contact_pairs=(replace(first, object=ball), *task.contact_pairs[1:]))
    assert hue(draw_task(bare).axes[1].images[0].get_array(), OBJECT_REGION).any()
    with pytest.raises(InputError, match="no bundled object of that name"):
        draw_task(replace(task, object="spoon"))


@pytest.mark.slow
def test_the_side_of_a_cylinder_is_seen_from_where_its_normals_point() -> None:
    """The front half of a can, not the half behind, but of a hole the half behind alone."""
    task = grip(0.05)
    seen = {}
    for name, first, flip in (("can", -np.pi / 2, False), ("behind", np.pi / 2, False), ("hole", np.pi / 2, True)):
        angles, towards = (first, first + np.pi), REGION_VIEWS[1].matrix[2]  # about the direction of view
        side = CylinderSide((0, 0, 0), 0.03, (0, 0, 1), towards, angles, (-0.03, 0.03), flip)
        alone = replace(task, object=None, contact_pairs=(replace(task.contact_pairs[0], object=side),))
        seen[name] = hue(draw_task(alone).axes[1].images[0].get_array(), OBJECT_REGION).sum()
    assert seen["can"] > 1000
    assert seen["behind"] < 0.02 * seen["can"]
    assert seen["hole"] > 0.5 * seen["can"]
