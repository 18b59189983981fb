"""Boxes of configurations that are discarded, by hand: trees, overlaps, motions of a finger, and files that say so."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.proofs.contact_force_limits import ForceLimits
from handfast.proofs.convex_solids import SolidsData
from handfast.proofs.discarded_boxes import (
    Balance,
    Boxes,
    BoxTree,
    Collision,
    DiscardCounts,
    NoGraspProof,
    OpenBox,
    _faced,
    discarded,
    hand_motion,
    inside,
    replay_no_grasp,
)
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.motors import Motors
from handfast.proofs.posed_boxes import OBJECT_LINK, ContactBoxes
from handfast.proofs.replay import Refused
from handfast.proofs.tasks import LinkData, TaskData, read_task
from handfast.proofs.unbalanced import Motions, Placements
from handfast.synthesis.embedded_task import task_to_dict
from tests.support.holds import flat_grip, grip

LINKS = ["palm", "left_finger", "right_finger"]
TIP = [0.0, 0.005, 0.045]  # the middle of the left fingertip, of 5 mm


def solid(kind: str, size: Sequence[float], place: Sequence[float] = (0, 0, 0), **more: Any) -> dict[str, Any]:
    pose = np.eye(4)
    pose[:3, 3] = place
    return {"kind": kind, "size": list(size), "pose": pose.tolist()} | more


CUBE = {  # of 2.2 m about a point 1 m behind the middle of the left side, which is 0.1 m deep in it
    "vertices": [[x, y, z] for x in (-1.1, 1.1) for y in (-1.1, 1.1) for z in (-1.1, 1.1)],
    "size": [],
}
FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
]  # fmt: skip


def solids(depth: float = 0.594, between: float = 1.39) -> Fields:
    """A ball of 0.5 m about the left fingertip, one of 1 m about the palm's origin, one and a cube on the object."""
    links = [
        {"link": "palm", "solids": [solid("sphere", [1.0])]},
        {"link": "left_finger", "solids": [solid("sphere", [0.5], TIP)]},
        {"link": "right_finger", "solids": []},
    ]
    thing = [solid("sphere", [1.1], (0, -0.975, 0)), solid("mesh", [], (0, -0.975, 0), vertices=CUBE["vertices"])]
    pairs = [{"first": "left_finger", "second": "palm", "depth": between}]
    return Fields({"links": links, "object": thing, "depth": depth, "pairs": pairs}, "solids")


def gripper(**pose: Any) -> TaskData:
    data = task_to_dict(grip(0.05))
    data["pose"].update(pose)
    return read_task(data)


def claim(link: str | None = "left_finger", body: str | None = None, other: int = 0, **more: Any) -> dict[str, Any]:
    return {"link": link, "solid": 0, "body": body, "other": other, "point": TIP} | more


def replayed(
    *claims: dict[str, Any], depth: float = 0.594, between: float = 1.39, task: TaskData | None = None, **more: Any
) -> Any:
    """Every box of each chart is said to be discarded by the first claim."""
    said = {"contacts": [0], "motions": [], "faces": [], "collisions": list(claims), "tree": [-2] * 4} | more
    own = task or gripper()
    shapes = SolidsData.read(solids(depth, between), LINKS)
    placements = Placements.of(own.on_object, np.array([[0, 0, -1.0, 0, 0, 0]]), 0.8)
    motors = Motors.read(Fields({"actuators": []}, ""), own, {})
    return replay_no_grasp(own, shapes, placements, ["w"], motors, Fields(said, "none"))


# --- overlaps -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("other", "depth", "between", "faces"),
    [
        ({}, 0.5949, 9.0, []),  # as in test_grasps: 1.1 m - |(0.01, 1.005, 0.01) m|, and 0.5 m
        ({"other": 1}, 0.595, 9.0, [{"body": None, "solid": 1, "faces": FACES}]),  # 0.1 m - 5 mm, wherever it touches
        # at most 0.045 m aside and 0.095 m up, as the finger closes by 0 to 0.04 m: 1 m - 0.10512 m
        ({"body": "palm"}, 9.0, 1.39488, []),
    ],
)
def test_how_deep_a_fingertip_is_at_least(other: Any, depth: float, between: float, faces: Any) -> None:
    for share, shown in ((0.999, True), (1.001, False)):
        done = replayed(claim(**other), depth=share * depth, between=share * between, faces=faces)
        assert done.ok == shown, done.reason
        assert shown or done.reason == "box 0 of the tree is not discarded as it says"


def test_a_mesh_without_its_faces_shows_nothing() -> None:
    assert replayed(claim(other=1), depth=0.1).reason == "box 0 of the tree is not discarded as it says"
    cube = solid("mesh", [], vertices=CUBE["vertices"])
    shapes = SolidsData.read(Fields({"links": [], "object": [cube], "depth": 0.0, "pairs": []}, ""), LINKS)
    points = np.array([[0.5, 0.0, 0.0], [0.0, 0.0, 1.2], [np.nan, 0.0, 0.0]])
    assert inside(shapes.of_object[0], points).tolist() == [-np.inf] * 3
    radii = inside(shapes.of_object[0].with_faces(np.array(FACES)), points)
    assert radii == pytest.approx([0.6, -0.1, -np.inf])


def test_what_is_known_of_boxes_that_do_not_overlap_enough() -> None:
    """At one place the fingertip's middle is 0.095 m deep; within balls of 0.5 m and 0.1 m about it, claimed 0.4 m."""
    contacts = ContactBoxes.of(gripper().part([0]))
    root, middle = contacts.root, np.repeat(contacts.root.mean(axis=1)[:, None], 2, axis=1)
    boxes = Boxes.of(contacts, np.array([root, middle, middle, middle]), np.array([0, 0, 1, 2]))
    shapes = SolidsData.read(solids(0.55), LINKS)
    which, far = np.array([[1, 0, OBJECT_LINK, 0]] * 3), np.array([0.0, 0.005, 0.545 + 0.01])
    collision = Collision(shapes, which, np.array([TIP, far, [0, 0.005, 0.345]]))
    assert len(collision) == 3
    # the point itself, twice; 10 mm outside its own solid; 0.2 m deep in it, and outside of the other at that turn
    found = collision.examined(boxes, np.array([0, 0, 1, 2]))
    assert found.refuted.tolist() == [True, True, False, False]
    assert found.missing[[0, 1]].tolist() == [0.0, 0.0]
    assert found.near[[0, 1, 2]].tolist() == [1.0, 1.0, 0.0]
    assert np.isnan(found.missing[2])
    strict = replace(collision, solids=SolidsData.read(solids(0.7), LINKS)).examined(boxes, np.array([0, 0, 1, 2]))
    assert not strict.refuted.any()
    assert strict.missing[1] == pytest.approx(0.7 - 0.5 - 0.095, abs=1e-12)
    assert strict.missing[1] < strict.missing[0] < strict.missing[1] + 1e-3
    assert strict.near[1] == 0.0
    # what would have to be smaller, where it is not shown: where it touches the wall, not how far the finger slides
    columns = contacts.sides.column
    assert found.reach.shape == strict.reach.shape == (4, len(contacts.root))
    assert not found.reach[:2].any()
    assert strict.reach[0, [columns["contact:0:s"], columns["contact:0:t"]]] == pytest.approx([2e-4, 2e-4], rel=0.01)
    assert np.sort(strict.reach[0])[-3] < 1e-12
    assert strict.reach[1].max() < 1e-12
    chosen = collision.chosen([2, 0])
    assert chosen.points.tolist() == [[0, 0.005, 0.345], TIP]
    assert chosen.to_json(LINKS)[1] == claim(point=TIP)


def test_each_box_is_discarded_by_its_own_claim() -> None:
    """The fingertip is 0.595 m deep in the object and 1.395 m deep in the palm: more than one or the other allows."""
    contacts = ContactBoxes.of(gripper().part([0]))
    middle = np.repeat(contacts.root.mean(axis=1)[:, None], 2, axis=1)
    boxes = Boxes.of(contacts, np.array([middle] * 3), np.zeros(3, dtype=np.int64))
    which = np.array([[1, 0, OBJECT_LINK, 0], [1, 0, 0, 0]])
    for depth, between, object_alone in ((0.5, 9.0, True), (9.0, 1.3, False)):
        shapes = SolidsData.read(solids(depth, between), LINKS)
        collision = Collision(shapes, which, np.array([TIP, TIP]))
        found = collision.examined(boxes, np.array([0, 1, 0]))
        assert found.refuted.tolist() == [object_alone, not object_alone, object_alone]
    assert [said["body"] for said in collision.to_json(LINKS)] == [None, "palm"]


def test_a_middle_tells_more_of_a_small_box_than_its_sides() -> None:
    """Of boxes a hundredth as large as the root, around its middle: depths change by a hundredth of 20 mm and more."""
    contacts = ContactBoxes.of(gripper().part([0]))
    middle = contacts.root.mean(axis=1)[:, None]
    box = middle + 1e-2 * (contacts.root - middle)
    boxes = Boxes.of(contacts, np.array([box, np.repeat(middle, 2, axis=1)]), np.zeros(2, dtype=np.int64))
    shapes = SolidsData.read(solids(0.7), LINKS)
    found = Collision(shapes, np.array([[1, 0, OBJECT_LINK, 0]]), np.array([TIP])).examined(boxes, np.zeros(2, int))
    assert found.missing[0] - found.missing[1] == pytest.approx(found.reach[0].sum(), rel=0.1)


# --- how a finger moves -------------------------------------------------------------------------------


def finger(*aside: dict[str, Any]) -> TaskData:
    """An arm that turns about the palm's z axis, on it a tip 0.1 m out that slides along x; it touches a wall twice.

    aside: joints of a link on the palm that touches nothing.
    """
    joints = [
        {"name": "turn", "type": "revolute", "axis": [0, 0, 1], "anchor": [0, 0, 0], "limits": [-1, 1], "ref": 0},
        {"name": "slide", "type": "prismatic", "axis": [1, 0, 0], "anchor": [0, 0, 0], "limits": [0, 0.1], "ref": 0},
    ]
    out = np.eye(4)
    out[0, 3] = 0.1
    links = [
        {"name": "palm", "parent": -1, "pose": np.eye(4).tolist(), "joints": []},
        {"name": "arm", "parent": 0, "pose": np.eye(4).tolist(), "joints": [0]},
        {"name": "tip", "parent": 1, "pose": out.tolist(), "joints": [1]},
    ]
    if aside:
        links.append({"name": "thumb", "parent": 0, "pose": np.eye(4).tolist(), "joints": [*range(2, 2 + len(aside))]})
    hand = {"name": "finger", "source": "", "links": links, "joints": [*joints, *aside], "couplings": []}
    free, contacts = [[None, None]] * 3, []
    for y in (-0.02, 0.02):
        cap = {"center": [0, y, 0], "radius": 0.01, "axis": [1, 0, 0], "half_angle": 0.5}
        wall = [[[0.0, y + u, z] for z in (-0.01, 0.01)] for u in (-0.01, 0.01)]
        contacts.append({"link": "tip", "hand": {"cap": cap, "flip": False}, "object": {"bezier": wall, "flip": True}})
    pose = {"position": free, "axes": [free] * 3}
    return read_task({"name": "push", "hand": hand, "contacts": contacts, "pose": pose})


@pytest.fixture
def pushing() -> tuple[ContactBoxes, Motors, Boxes]:
    """The finger is straight, 20 mm out, so that the wall is at 0.13 m; motors of 5 N m, and of 7 N geared by 2."""
    contacts = ContactBoxes.of(finger())
    at = {"joint:slide": 0.02} | {f"contact:{k}:{x}": 0.5 for k in (0, 1) for x in "st"}
    x = np.array([at.get(label, 0.0) for label in contacts.sides.column])
    actuators = [{"name": "a", "joints": {"turn": 1.0}}, {"name": "b", "joints": {"slide": 2.0}}]
    motors = Motors.read(Fields({"actuators": actuators}, ""), contacts.task, {"a": 5.0, "b": 7.0})
    box = np.stack([x - 1e-9, x + 1e-9], axis=1)
    return contacts, motors, Boxes.of(contacts, np.array([box]), np.array([0]))


def test_the_wall_is_met_with_the_normals_opposite(pushing: Any) -> None:
    contacts, _, boxes = pushing
    assert contacts.at(Interval.of(boxes.box.mean(axis=2)), boxes.charts, 0).rows.value.mid[0] == pytest.approx(
        [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.02], abs=1e-8
    )
    with np.errstate(all="ignore"):
        alive, _, _ = contacts.narrowed(boxes.box, boxes.over, boxes.middle)
    assert alive.tolist() == [True]


def test_axes_of_two_joints_of_one_link(pushing: Any) -> None:
    """The same finger without the arm between: the axis of the turn is 0.1 m behind the tip, less its slide."""
    hand = finger().hand
    one = (hand.links[0], LinkData("tip", 0, (0, 1)))
    anchors = np.array([[-0.1, 0, 0], [0, 0, 0]], dtype=float)
    task = replace(finger(), hand=replace(hand, links=one, poses=hand.poses[[0, 2]], anchors=anchors), links=(1, 1))
    contacts, (_, _, boxes) = ContactBoxes.of(task), pushing
    axes = contacts.axes(Boxes.of(contacts, boxes.box, boxes.charts).middle, [0, 1])
    (turn, point), (slide, _) = axes[0], axes[1]
    assert turn.value.mid[0] == pytest.approx([0, 0, 1])
    assert point.value.mid[0, :2] == pytest.approx([-0.13, 0], abs=1e-12)
    assert slide.value.mid[0] == pytest.approx([1, 0, 0])


def test_flat_fingertips_may_face_flat_sides() -> None:
    contacts = ContactBoxes.of(read_task(task_to_dict(flat_grip(0.05))))
    at = {"joint:left_slide": 0.015} | dict.fromkeys((f"turn:{k}" for k in range(3)), 0.0)
    x = np.array([at.get(label, 0.5) for label in contacts.sides.column])
    boxes = Boxes.of(contacts, np.array([np.stack([x - 1e-3, x + 1e-3], axis=1)]), np.array([0]))
    with np.errstate(all="ignore"):
        alive, _, _ = contacts.narrowed(boxes.box, boxes.over, boxes.middle)
    assert alive.tolist() == [True]


def test_what_bounds_leave_of_a_box(pushing: Any) -> None:
    """Of slides from 50 to 200 mm, those up to the limit of 100 mm; a billionth of the side is left beside."""
    contacts, _, boxes = pushing
    j = contacts.sides.column["joint:slide"]
    box = boxes.box.copy()
    box[0, j] = 0.05, 0.2
    wide = Boxes.of(contacts, box, boxes.charts)
    with np.errstate(all="ignore"):
        alive, kept, _ = contacts.narrowed(box, wide.over, wide.middle)
    assert alive.tolist() == [True]
    assert kept[0, j] == pytest.approx([0.05, 0.1], abs=2e-10)
    assert kept[0, j, 1] > 0.1
    turns = contacts.root[contacts.turns]
    assert turns.tolist() == [[-1.0, 1.0]] * 3


def test_motions_of_a_finger_and_the_work_of_its_motors(pushing: Any) -> None:
    contacts, motors, boxes = pushing
    moved = hand_motion(contacts, motors, boxes, np.array([[2.0, 3.0]]))
    assert [(j.revolute, j.contacts) for j in moved.joints] == [(True, (0, 1)), (False, (0, 1))]
    turn, slide = moved.middle
    assert turn.axis.value.mid[0] == pytest.approx([0, 0, 1])
    assert turn.anchor.value.mid[0, :2] == pytest.approx([-0.13, 0], abs=1e-12)  # the arm is straight
    assert slide.axis.value.mid[0] == pytest.approx([1, 0, 0])
    point = Dual.constant(Interval.of(np.array([[[0, -0.02, 0], [0, 0.02, 0]]])), 0)
    velocity = moved.velocity(point, np.zeros((1, 3)), middle=True).value.mid
    assert velocity == pytest.approx(np.array([[[3.04, 0.26, 0], [2.96, 0.26, 0]]]))
    assert (moved.turned[0], moved.slid[0]) == pytest.approx((2.0, 3.0))
    assert moved.resisted[0] == pytest.approx(5 * 2 + 7 * 2 * 3)
    (only,) = hand_motion(contacts, motors, boxes, np.array([[0.0, 3.0]])).joints
    assert not only.revolute
    (only,) = hand_motion(contacts, motors, boxes, np.array([[2.0, 0.0]])).joints
    assert only.revolute
    assert hand_motion(contacts, motors, boxes, np.array([[2.0, 0.0]])).slid[0] == 0
    both = Boxes.of(contacts, np.repeat(boxes.box, 2, axis=0), np.zeros(2, dtype=np.int64))
    assert hand_motion(contacts, motors, both, np.array([[2.0, 0.0], [2.0, 3.0]])).slid.tolist()[0] == 0


def test_joints_of_two_fingers_move_a_contact_each() -> None:
    task = gripper()
    contacts = ContactBoxes.of(task)
    motors = Motors.read(Fields({"actuators": []}, ""), task, {})
    middle = np.repeat(contacts.root.mean(axis=1)[:, None], 2, axis=1)
    boxes = Boxes.of(contacts, np.array([middle]), np.array([0]))
    moved = hand_motion(contacts, motors, boxes, np.array([[1.0, 0.0]]))
    assert [j.contacts for j in moved.joints] == [(0,), (1,)]


def test_how_far_boxes_reach_from_their_middles(pushing: Any) -> None:
    _, _, boxes = pushing
    j = int(np.argmax(boxes.box[0, :, 0]))
    away = boxes.away
    assert away.shape == boxes.box.shape[:2]
    assert (away.lo[0, j], away.hi[0, j]) == (pytest.approx(-1e-9, rel=1e-6), pytest.approx(1e-9, rel=1e-6))
    assert (away.lo <= -0.9e-9).all()
    assert (away.hi >= 0.9e-9).all()


def test_a_joint_that_one_of_the_motions_moves_is_moved(pushing: Any) -> None:
    contacts, motors, boxes = pushing
    both = Boxes.of(contacts, np.repeat(boxes.box, 2, axis=0), np.zeros(2, dtype=np.int64))
    moved = hand_motion(contacts, motors, both, np.array([[2.0, 3.0], [0.0, 3.0]]))
    assert [j.revolute for j in moved.joints] == [True, False]
    assert moved.resisted == pytest.approx(np.array([5 * 2 + 7 * 2 * 3, 7 * 2 * 3]))
    assert moved.turned == pytest.approx(np.array([2.0, 0.0]))
    assert moved.slid == pytest.approx(np.array([3.0, 3.0]))


def test_a_stop_resists_where_its_joint_may_stand_at_it(pushing: Any) -> None:
    """The slide's lower one, at 0: as the tip goes back it pushes as hard as it likes, 20 mm before it not at all."""
    contacts, _, boxes = pushing
    stopped = Motors.read(Fields({"actuators": [], "laws": {"slide": {"stops": [0.0, None]}}}, ""), contacts.task, {})
    j, back, out = contacts.sides.column["joint:slide"], np.array([[0.0, -3.0]]), np.array([[0.0, 3.0]])
    assert hand_motion(contacts, stopped, boxes, back).resisted[0] == pytest.approx(0, abs=1e-280)
    box = boxes.box.copy()
    box[0, j] = 0.0, 1e-3
    at_stop = Boxes.of(contacts, box, boxes.charts)
    assert hand_motion(contacts, stopped, at_stop, back).resisted[0] == np.inf
    assert hand_motion(contacts, stopped, at_stop, out).resisted[0] == pytest.approx(0, abs=1e-280)


@pytest.mark.parametrize(("stops", "rate", "work"), [
    ([None, -1.0], 1.0, np.inf), ([None, -1.0], -1.0, 0.0), ([-2.0, None], -1.0, np.inf), ([-2.5, None], -1.0, 0.0),
    ([None, -0.5], 1.0, 0.0),
])  # fmt: skip
def test_a_joint_that_moves_no_contact_may_stand_at_either_limit(stops: Any, rate: float, work: float) -> None:
    bend = {"name": "bend", "type": "revolute", "axis": [0, 0, 1], "anchor": [0] * 3, "limits": [-2, -1], "ref": 0}
    contacts = ContactBoxes.of(finger(bend))
    motors = Motors.read(Fields({"actuators": [], "laws": {"bend": {"stops": stops}}}, ""), contacts.task, {})
    boxes = Boxes.of(contacts, contacts.root[None], np.array([0]))
    moved = hand_motion(contacts, motors, boxes, np.array([[0.0, 0.0, rate]]))
    assert moved.joints == ()
    assert moved.resisted[0] == pytest.approx(work, abs=1e-280)


def balance(contacts: ContactBoxes, motors: Motors, load: Sequence[float], *motions: Any) -> Balance:
    placements = Placements.of(contacts.task.on_object, np.array([load]), 0.5, ForceLimits.of(np.inf, 2))
    one, line = np.ones((len(motions), 1)), np.full((len(motions), 2), -1)
    twists, joints = (np.array([m[k] for m in motions], dtype=float) for k in (0, 1))
    return Balance(placements, Motions(one, line, twists, joints), contacts, motors)


def test_a_load_that_the_motors_do_not_carry(pushing: Any) -> None:
    """The object goes with the finger, and 3 mm/s faster away from it, so that contacts do no work.

    On the twist the load F along x does 3.003 F, and the motors 52 W at most: they do not hold 17.32 N.
    """
    contacts, motors, boxes = pushing
    along, one = ([3.003, 0.26, 0, 0, 0, 2.0], [2.0, 3.0]), [1.001, 0.13, 0, 0, 0, 1.0]
    still = [0.003, 0.0, 0, 0, 0, 0], [0.0, 0.0]
    for force, refuted in ((17.32, True), (17.31, False)):
        found = balance(contacts, motors, [force, 0, 0, 0, 0, 0], along).examined(boxes, np.array([0]))
        assert found.refuted.tolist() == [refuted]
        assert found.reach.shape == (1, len(contacts.root))
    assert np.isfinite(found.reach).all()
    assert found.reach.max() > 0
    for joints, twist, most in (([0.0, 3.0], [3.003, 0, 0, 0, 0, 0], 42 / 3.003), ([1.0, 1.0], one, 19 / 1.001)):
        for force, refuted in ((1.001 * most, True), (0.999 * most, False)):
            found = balance(contacts, motors, [force, 0, 0, 0, 0, 0], (twist, joints)).examined(boxes, np.array([0]))
            assert found.refuted.tolist() == [refuted]
    # without motions of joints the load would have to be held by the finger alone, which pushes against it
    both = Boxes.of(contacts, np.repeat(boxes.box, 3, axis=0), np.zeros(3, dtype=np.int64))
    found = balance(contacts, motors, [17.32, 0, 0, 0, 0, 0], along, still).examined(both, np.array([0, 1, 0]))
    assert found.refuted.tolist() == [True, True, True]
    found = balance(contacts, motors, [-17.32, 0, 0, 0, 0, 0], along, still).examined(both, np.array([0, 1, 0]))
    assert found.refuted.tolist() == [False, False, False]
    assert np.isfinite(found.reach).all()
    assert found.reach[1].max() > 0
    reason = balance(contacts, motors, [17.32, 0, 0, 0, 0, 0], along, still)
    assert len(reason) == 2
    assert reason.chosen([1]).motions.moved.tolist() == [False]


# --- trees --------------------------------------------------------------------------------------------


def test_where_halves_stand() -> None:
    tree = BoxTree((0, 1, -1, -1, -1, -1, None, 2, -1, -1))
    assert tree.upper() == {0: 4, 1: 3, 7: 9}
    assert tree.roots(tree.upper()) == [0, 5, 6, 7]
    with pytest.raises(Refused, match=r"^the tree goes on after its last box, at entry 4$"):
        BoxTree((-1,) * 5).upper()
    with pytest.raises(Refused, match=r"^the tree leaves out 2 boxes$"):
        BoxTree((-1, -1, 0, -1)).upper()


def test_halves_of_what_is_kept() -> None:
    """A box of 2 by 1 of which 1 by 1 is kept, halved along its first side: a quarter of its share each."""
    one = OpenBox(7, np.array([[0.0, 2.0], [0.0, 1.0], [3.0, 3.0]]), 2, 0.5)
    upper, lower = one.halves(np.array([[0.0, 1.0], [0.0, 1.0], [3.0, 3.0]]), 0, (8, 11))
    assert (lower.index, lower.chart, lower.share) == (8, 2, 0.125)
    assert lower.box.tolist() == [[0.0, 0.5], [0.0, 1.0], [3.0, 3.0]]
    assert (upper.index, upper.share) == (11, 0.125)
    assert upper.box[0].tolist() == [0.5, 1.0]
    upper, lower = one.halves(np.array([[0.0, 1.0], [0.25, 0.5], [3.0, 3.0]]), 1, (8, 11))
    assert (lower.share, upper.share) == (0.03125, 0.03125)
    assert (lower.box[1].tolist(), upper.box[1].tolist()) == ([0.25, 0.375], [0.375, 0.5])


def test_what_is_not_touched_is_counted_once() -> None:
    """The object is to be 1 m above the palm, where no finger is: all charts are empty, halved or not."""
    far = gripper(position=[[None, None], [None, None], [1.0, 1.1]])
    done = replayed(task=far, collisions=[], tree=[-1, -1, 0, -1, -1, -1])
    assert done.ok, done.reason
    assert done.figures == {"boxes": 6, "contacts": 4, "balance": 0, "slips": 0, "collision": 0}
    assert done.claim == "wherever left_finger would touch as asked, they cannot touch so (100 %) of 4 boxes"
    near = replayed(tree=[-1] * 4)
    assert near.reason == "box 0 of the tree is not discarded as it says"
    still_open = replayed(claim(), tree=[-2, None, None, -2])
    assert (still_open.reason, still_open.figures) == ("2 boxes are open", {"boxes": 4})
    halved = replayed(claim(), tree=[0, -2, -2, 1, -2, -2, -2, 0, 1, -2, -2, -2])
    assert halved.figures == {"boxes": 12, "contacts": 0, "balance": 0, "slips": 0, "collision": 8}


def test_open_boxes_have_their_shares_of_the_whole() -> None:
    """A quarter for each chart, half of that for each half; a far object leaves nothing but what is open already."""
    contacts = ContactBoxes.of(gripper().part([0]))
    n = len(contacts.root)
    left, done = BoxTree((None, 0, None, None, None, None)).checked(contacts, ())
    assert sorted((at.index, at.chart) for at in left) == [(0, 0), (2, 1), (3, 1), (4, 2), (5, 3)]
    shares = {at.index: at.share for at in left}
    assert [shares[k] for k in (0, 4, 5)] == [0.25] * 3
    assert 0 < shares[2] == shares[3] <= 0.125
    assert (len(left[0].box), sum(done.values())) == (n, 0)
    lower, upper = ({at.index: at.box for at in left}[k] for k in (2, 3))
    assert np.flatnonzero((lower != upper).any(axis=1)).tolist() == [0]
    assert lower[0, 1] == upper[0, 0]


def test_all_of_many_boxes_are_looked_at_once() -> None:
    """32 halves of each chart, more than are looked at together."""

    def halved(times: int, leaf: int | None) -> list[int | None]:
        return [times % 3, *halved(times - 1, leaf), *halved(times - 1, leaf)] if times else [leaf]

    contacts = ContactBoxes.of(gripper().part([0]))
    entries = halved(5, None) * 4
    left, done = BoxTree(tuple(entries)).checked(contacts, ())
    assert sorted(at.index for at in left) == [k for k, x in enumerate(entries) if x is None]
    assert not done


class Numbered:
    """A reason with some claims, of which one discards what it is said of."""

    name = "numbered"

    def __init__(self, count: int, right: int) -> None:
        self.count, self.right = count, right
        self.said: list[Any] = []
        self.motions: Any = None

    def __len__(self) -> int:
        return self.count

    def examined(self, boxes: Any, claims: Any) -> Any:
        self.said.append((boxes, claims.tolist()))
        return SimpleNamespace(refuted=claims == self.right)


def test_claims_are_numbered_through_all_reasons() -> None:
    """2, none and 3 of them, of which 1 and 2 + 2 discard."""
    reasons = [Numbered(2, 1), Numbered(0, 0), Numbered(3, 2)]
    boxes: Any = SimpleNamespace(some=lambda its: its.tolist())
    assert discarded(boxes, np.array([4, 0, 1, 2, 4, 3]), reasons).tolist() == [True, False, True, False, True, False]  # type: ignore[arg-type]
    assert [reason.said for reason in reasons] == [[([1, 2], [0, 1])], [], [([0, 3, 4, 5], [2, 0, 2, 1])]]


def test_a_box_without_contacts_needs_no_other_reason() -> None:
    """It is above the palm, where no finger is: whatever else it says, no collision counts there."""
    far = gripper(position=[[None, None], [None, None], [1.0, 1.1]])
    done = replayed(claim(), depth=9.0, task=far)
    assert done.ok
    assert done.figures == {"boxes": 4, "contacts": 4, "balance": 0, "slips": 0, "collision": 0}
    assert done.claim == "wherever left_finger would touch as asked, they cannot touch so (100 %) of 4 boxes"
    assert not replayed(claim(), depth=9.0).ok


@pytest.mark.parametrize(("entry", "stands"), [(2, True), (3, False), (0, True), (-1, True), (-3, True), (-4, False)])
def test_an_entry_is_a_coordinate_or_a_claim(entry: int, stands: bool) -> None:
    """Of three coordinates and two claims."""
    f = Fields({"tree": [None, None, None, entry]}, "none")
    if stands:
        assert BoxTree.read(f, 3, 2).entries == (None, None, None, entry)
    else:
        with pytest.raises(
            BadFile, match=r"^none\.tree\[3\]: is -?\d; a coordinate below 3, a claim or null is needed"
        ):
            BoxTree.read(f, 3, 2)


def test_counts_of_a_reason_add_up() -> None:
    balance = Numbered(4, 0)
    balance.motions = SimpleNamespace(moved=np.array([0, 1, 0, 1], dtype=bool))
    which = np.array([[1, 0, 0, 0], [1, 1, 0, 2], [1, 0, 2, 0]])
    proof: Any = SimpleNamespace(balance=balance, collision=SimpleNamespace(which=which))
    counts = DiscardCounts.of(proof, {-2: 1, -3: 2, -4: 3, -5: 4, -6: 5, -7: 6, -8: 7})
    assert counts == DiscardCounts(0, 4, 6, Counter({(1, 0): 11, (1, 2): 7}))


def test_shares_of_each_reason() -> None:
    task = gripper()
    contacts = ContactBoxes.of(task.part([0]))
    motors = Motors.read(Fields({"actuators": []}, ""), task, {})
    motions = Motions(np.ones((2, 1)), np.full((2, 2), -1), np.ones((2, 6)), np.array([[0.0, 0.0], [1.0, 0.0]]))
    own = Balance(Placements.of(task.on_object, np.ones((1, 6)), 0.5), motions, contacts, motors)
    which = np.array([[1, 0, OBJECT_LINK, 0], [1, 0, 0, 0], [1, 0, OBJECT_LINK, 1]])
    shapes = SolidsData.read(solids(0.25, 0.125), LINKS)
    proof = NoGraspProof((0,), contacts, own, Collision(shapes, which, np.zeros((3, 3))), BoxTree((-1,) * 4))
    counts = DiscardCounts.of(proof, {-1: 10, -2: 20, -3: 30, -4: 11, -5: 28, -6: 1})
    assert counts == DiscardCounts(10, 20, 30, Counter({(1, OBJECT_LINK): 12, (1, 0): 28}))
    assert counts.words(task, shapes) == (
        "wherever left_finger, right_finger would touch as asked, left_finger is more than 125 mm inside palm (28 %), "
        "or left_finger is more than 250 mm inside the object (12 %), or no contact forces balance the loads (20 %), "
        "or it slips, whatever the motors do within their limits (30 %), or they cannot touch so (10 %) of 100 boxes"
    )


# --- files --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"collisions": [claim(link=None)]}, r"^none\.collisions\[0\]: may overlap, or stands where"),
        ({"collisions": [claim(body="right_finger")]}, r"^none\.collisions\[0\]: may overlap, or stands where"),
        ({"collisions": [claim(link="palm", body="palm")]}, r"^none\.collisions\[0\]: may overlap"),
        ({"collisions": [claim(link="thumb")]}, r"^none\.collisions\[0\]\.link: has unknown link 'thumb'"),
        ({"collisions": [claim(solid=1)]}, r"^none\.collisions\[0\]: has no such solid"),
        ({"collisions": [claim(other=2)]}, r"^none\.collisions\[0\]: has no such solid"),
        ({"collisions": [claim(more=1)]}, "more"),
        ({"contacts": []}, r"^none\.contacts: is \[\]; contacts from 0 to 1 in order are needed"),
        ({"contacts": [1, 0]}, r"^none\.contacts: is \[1.0, 0.0\]; contacts from 0 to 1"),
        ({"contacts": [0, 0]}, r"^none\.contacts: is"),
        ({"contacts": [2]}, r"^none\.contacts: is"),
        ({"contacts": [0.5]}, r"^none\.contacts: is"),
        ({"motions": [{"loads": {"w": 1.0}, "twist": [1.0] * 6}]}, r"^none\.motions: are there, but not all contacts"),
        ({"tree": [-1] * 3}, r"^none\.tree: is no list of 4 to"),
        ({"tree": "-1"}, r"^none\.tree: is no list"),
        ({"tree": [-1, -1, -1, -2]}, r"^none\.tree\[3\]: is -2; a coordinate below"),
        ({"tree": [-1, 99, -1, -1]}, r"^none\.tree\[1\]: is 99; a coordinate below"),
        ({"tree": [-1, True, -1, -1]}, r"^none\.tree\[1\]: is True"),
        ({"tree": [-1, 0.0, -1, -1]}, r"^none\.tree\[1\]: is 0.0"),
        ({"faces": [{"body": None, "solid": 2, "faces": FACES}]}, r"^none\.faces\[0\]: has no such solid"),
        ({"faces": [{"body": "right_finger", "solid": 0, "faces": FACES}]}, r"^none\.faces\[0\]: has no such solid"),
        ({"faces": [{"body": None, "solid": 1, "faces": [[0, 1, 2.5]]}]}, r"^none\.faces\[0\]\.faces: are no indices"),
        ({"faces": [{"body": None, "solid": 1, "faces": [[0, 1]]}]}, r"^none\.faces\[0\]\.faces"),
        ({"faces": [{"body": "thumb", "solid": 1, "faces": FACES}]}, r"^none\.faces\[0\]\.body: .*thumb"),
        ({"faces": [{"body": None, "solid": 1, "faces": FACES, "more": 1}]}, "more"),
        ({"tree": [-1] * 4, "more": 1}, "more"),
    ],
)
def test_what_no_proof_says(more: dict[str, Any], why: str) -> None:
    with pytest.raises(BadFile, match=why):
        replayed(**more)


def test_what_is_claimed_where_it_is_not_shown() -> None:
    for done in (replayed(tree=[-1] * 4), replayed(claim(), tree=[-2, None, None, -2])):
        assert (done.name, done.claim, done.ok) == ("no grasp", "every configuration is discarded", False)
    assert replayed(claim()).name == "no grasp"


def test_faces_are_of_solids_that_a_link_has() -> None:
    shapes = SolidsData.read(solids(), LINKS)
    some = replace(shapes, of_link={k: x for k, x in shapes.of_link.items() if k})
    said = Fields({"faces": [{"body": "palm", "solid": 0, "faces": FACES}]}, "none")
    with pytest.raises(BadFile, match=r"^none\.faces\[0\]: has no such solid$"):
        _faced(said, some, LINKS)


def test_joints_that_may_move_in_a_file() -> None:
    """The right slide follows the left one."""

    def said(joint: str) -> Any:
        motion = {"loads": {"w": 1.0}, "twist": [0, 0, -1, 0, 0, 0], "joints": {joint: 1.0}}
        return replayed(contacts=[0, 1], motions=[motion])

    assert said("left_slide").reason == "box 0 of the tree is not discarded as it says"
    with pytest.raises(BadFile, match="has unknown joint 'right_slide'"):
        said("right_slide")
    sphere = {"body": None, "solid": 0, "faces": FACES}
    assert replayed(claim(), faces=[sphere]).reason.startswith("faces are given of what is no mesh")
