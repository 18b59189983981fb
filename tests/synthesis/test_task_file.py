"""The handfast/task/1 file: nothing is lost, every fault is one line with file and field."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.model.region import Bezier, Cap
from handfast.model.shape import Shape
from handfast.synthesis.pose_check import refuse_contradiction
from handfast.synthesis.task import PoseBounds, Task
from handfast.synthesis.task_file import from_dict, load_task, save_task
from tests.support.places import SHARED

SHARED = SHARED / "tasks"
SQUARE = [[[0, 0, 0], [0, 0.01, 0]], [[0.01, 0, 0], [0.01, 0.01, 0]]]
CAP = {"center": [0.02, 0, 0], "radius": 0.013, "axis": [0.14, 0, 0.99], "half_angle": 1.05}
MINIMAL: dict[str, Any] = {
    "schema": "handfast/task/1",
    "hand": "schunk-sah",
    "object": None,
    "limits": {"index_abduction": [-0.2, 0.2]},
    "couplings": [{"joint": "ring_proximal", "equals": "middle_proximal", "ratio": 0.5}],
    "pose": {"z_axis": [[-1, 1], [-1, 1], [0.9, 1]]},
    "contacts": [
        {"hand": {"link": "index_distal", "region": {"cap": CAP}}, "object": {"region": {"bezier": SQUARE}}},
        {
            "hand": {"link": "thumb_distal", "region": {"bezier": SQUARE, "flip": True}},
            "object": {"region": {"cap": CAP}},
        },
    ],
}


def changed(path: str, value: Any) -> dict[str, Any]:
    data = deepcopy(MINIMAL)
    *parts, last = path.split(".")
    target: Any = data
    for part in parts:
        target = target[int(part) if part.isdigit() else part]
    if value is None:
        del target[last]
    else:
        target[int(last) if last.isdigit() else last] = value
    return data


def same(a: Task, b: Task) -> None:
    assert (a.name, a.hand.source, a.links) == (b.name, b.hand.source, b.links)
    assert np.array_equal(a.hand.limits, b.hand.limits)
    assert a.hand.couplings == b.hand.couplings
    assert np.array_equal(a.hand.mechanism.A, b.hand.mechanism.A)
    assert np.array_equal(a.pose.axes, b.pose.axes)
    assert np.array_equal(a.pose.position, b.pose.position)
    for s, t in zip(a.contact_pairs, b.contact_pairs, strict=True):
        for r, q in ((s.hand, t.hand), (s.object, t.object)):
            assert type(r) is type(q)
            assert r.flip == q.flip
            if isinstance(r, Bezier) and isinstance(q, Bezier):
                assert np.array_equal(r.points, q.points)
            if isinstance(r, Cap) and isinstance(q, Cap):
                assert (r.radius, r.half_angle) == (q.radius, q.half_angle)
                assert np.array_equal(r.center, q.center)
                assert r.axis == pytest.approx(q.axis, abs=1e-15)


def test_what_the_file_says() -> None:
    task = from_dict(MINIMAL, name="minimal")
    hand = task.hand
    assert hand.limits[hand.joint("index_abduction")].tolist() == [-0.2, 0.2]
    assert hand.limits[hand.joint("thumb_base")] == pytest.approx([0, np.pi / 2])
    q = hand.configuration({"middle_proximal": 0.4, "index_middle": 0.3})
    assert q[hand.joint("ring_proximal")] == pytest.approx(0.2)  # the task's coupling
    assert q[hand.joint("index_distal")] == pytest.approx(0.3)  # the hand's own
    assert [t.link for t in task.contact_pairs] == ["index_distal", "thumb_distal"]
    assert task.pose.axes[2, 2].tolist() == [0.9, 1.0]
    assert np.isinf(task.pose.position).all()
    assert isinstance(task.contact_pairs[0].hand, Cap)
    assert task.contact_pairs[0].hand.axis == pytest.approx(np.array([0.14, 0, 0.99]) / np.hypot(0.14, 0.99))
    patch = task.contact_pairs[0].object
    assert isinstance(patch, Bezier)
    assert patch.at(1.0, 0.0) == pytest.approx([0.01, 0, 0])


def test_flip_in_the_region_or_beside_it() -> None:
    region = from_dict(MINIMAL).contact_pairs[1].hand
    assert isinstance(region, Bezier)
    assert region.normal(0.5, 0.5)[2] < 0
    beside = (
        from_dict(changed("contacts.0.object", {"region": {"bezier": SQUARE}, "flip": True})).contact_pairs[0].object
    )
    assert isinstance(beside, Bezier)
    assert beside.normal(0.5, 0.5)[2] < 0
    both = changed("contacts.0.object", {"region": {"bezier": SQUARE, "flip": True}, "flip": True})
    with pytest.raises(InputError, match=r"contacts\[0\].object.region.flip: is given twice"):
        from_dict(both)


def test_round_trip(tmp_path: Path) -> None:
    (tmp_path / "m.json").write_text(json.dumps(MINIMAL))
    task = load_task(tmp_path / "m.json")
    save_task(task, tmp_path / "deeper" / "m.json")
    same(task, load_task(tmp_path / "deeper" / "m.json"))
    written = json.loads((tmp_path / "deeper" / "m.json").read_text())
    assert written["limits"] == MINIMAL["limits"]
    assert written["couplings"] == MINIMAL["couplings"]
    with pytest.raises(InputError, match=r"m.json: exists already; give --force"):
        save_task(task, tmp_path / "deeper" / "m.json")


def test_hand_and_object_lie_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    urdf = (bundled.folder("hands") / "schunk-sah.urdf").read_text()
    (tmp_path / "my.urdf").write_text(urdf)
    v, f = Shape("box", (0.1, 0.1, 0.1)).triangles()
    obj = [f"v {x} {y} {z}" for x, y, z in v] + [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in f]
    (tmp_path / "a" / "box.obj").write_text("\n".join(obj))
    data = changed("hand", "../my.urdf") | {"object": "box.obj"}
    (tmp_path / "a" / "t.json").write_text(json.dumps(data))
    task = load_task(tmp_path / "a" / "t.json")
    assert task.object is not None
    assert Path(task.object).samefile(tmp_path / "a" / "box.obj")
    save_task(task, tmp_path / "b" / "t.json")
    written = json.loads((tmp_path / "b" / "t.json").read_text())
    assert (written["hand"], written["object"]) == ("../my.urdf", "../a/box.obj")
    again = load_task(tmp_path / "b" / "t.json")
    assert again.object is not None
    assert Path(again.object).samefile(task.object)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("colour", 1, "colour: is not a known field; leave it out"),
        ("contacts.0.colour", 1, r"contacts\[0\].colour: is not a known field"),
        ("schema", "handfast/task/2", "schema: input should be 'handfast/task/1'"),
        ("hand", None, "hand: is missing"),
        ("hand", "claw", "hand: 'claw' is no file beside the task and no bundled hand; bundled: .*schunk-sah"),
        ("object", "thing.obj", "object: 'thing.obj' is no file beside the task and no bundled object; bundled: .*jar"),
        ("object", "t.json/..", "object: 't.json/..' is no file beside the task"),
        ("contacts", [], "contacts: is empty; at least one pair of regions is needed"),
        ("contacts.0.hand.link", "toe", r"contacts\[0\].hand.link: unknown link 'toe'; known: palm, ring_knuckle"),
        ("limits.elbow", [0, 1], "limits: unknown joint 'elbow'; known: ring_abduction"),
        ("limits.index_abduction", [0.2, -0.2], r"limits.index_abduction: is \[0.2, -0.2\]; the lower one comes first"),
        ("limits.index_abduction", [0.2], r"limits.index_abduction\[1\]: is missing"),
        ("couplings.0.joint", "elbow", r"couplings\[0\].joint: unknown joint 'elbow'; known: ring_abduction"),
        ("couplings.0.equals", "elbow", r"couplings\[0\].equals: unknown joint 'elbow'; known: "),
        ("couplings.0.equals", "ring_proximal", r"couplings\[0\]: ties ring_proximal to itself"),
        ("couplings.0.ratio", 0, r"couplings\[0\].ratio: is 0; a finite number other than zero is needed"),
        (
            "contacts.0.object.region",
            {},
            r"contacts\[0\].object.region: exactly one of bezier, cap, cylinder_side, cone_side is needed",
        ),
        (
            "contacts.0.object.region.cap",
            CAP,
            r"contacts\[0\].object.region: exactly one of bezier, cap, cylinder_side, cone_side is needed",
        ),
        (
            "contacts.0.object.region.bezier",
            [SQUARE[0]],
            r"contacts\[0\].object.region.bezier: has 1 x 2 points; at least 2 x 2 are needed",
        ),
        (
            "contacts.0.object.region.bezier",
            [SQUARE[0], [*SQUARE[1], [0, 0, 1]]],
            r"contacts\[0\].object.region.bezier: has rows of 2, 3 points; every row needs the same number",
        ),
        (
            "contacts.0.object.region.bezier",
            [SQUARE[0], SQUARE[0]],
            r"contacts\[0\].object.region.bezier: is degenerate: the normal vanishes near u = ",
        ),
        ("contacts.0.hand.region.cap.radius", None, r"contacts\[0\].hand.region.cap.radius: is missing"),
        ("contacts.0.hand.region.cap.radius", -1, r"contacts\[0\].hand.region.cap.radius: is -1; it must be positive"),
        ("contacts.0.hand.region.cap.axis", [0, 0, 0], r"contacts\[0\].hand.region.cap.axis: is zero"),
        ("contacts.0.hand.region.cap.half_angle", 4, r"contacts\[0\].hand.region.cap.half_angle: is 4; it lies in"),
        ("pose.z_axis", [[-1, 1], [0.5, 0.4], [0, 1]], r"pose.z_axis\[1\]: is \[0.5, 0.4\]; the lower one comes first"),
        ("pose.z_axis", [[0, 0.5]] * 3, "pose.z_axis: contradicts itself: every vector within is shorter than 1"),
        ("pose.x_axis", [[-0.1, 0.1]] * 2 + [[0.9, 1]], "pose: x_axis and z_axis contradict each other: no rotation"),
        ("pose.position", [[0, 1], [1, 0], [0, 1]], r"pose.position\[1\]: is \[1, 0\]; the lower one comes first"),
    ],
)
def test_faults(tmp_path: Path, path: str, value: Any, message: str) -> None:
    file = tmp_path / "t.json"
    file.write_text(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match="t.json: " + message) as caught:
        load_task(file)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_tasks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone: no such file, and no bundled task of that name; bundled: "):
        load_task("gone")
    with pytest.raises(InputError, match=r"gone.json: no such file; a task file is needed"):
        load_task(tmp_path / "gone.json")
    file = tmp_path / "t.json"
    file.write_text('{"schema": ')
    with pytest.raises(InputError, match=r"t.json: is not valid JSON"):
        load_task(file)
    file.write_text("[]")
    with pytest.raises(InputError, match=r"t.json: "):
        load_task(file)
    (tmp_path / "notes.txt").write_text("hello")
    file.write_text(json.dumps(MINIMAL | {"object": "notes.txt"}))
    with pytest.raises(InputError, match=r"t.json: object: 'notes.txt' is no mesh; known endings: .obj"):
        load_task(file)


def test_what_a_file_cannot_say_is_not_written(tmp_path: Path) -> None:
    task = from_dict(MINIMAL)
    with pytest.raises(InputError, match="hand: was not loaded from a file"):
        save_task(replace(task, hand=replace(task.hand, source="")), tmp_path / "t.json")
    offset = replace(task.hand, couplings=(replace(task.hand.couplings[0], offset=0.1), *task.hand.couplings[1:]))
    with pytest.raises(InputError, match="couplings: the one of ring_distal has no place in a task file"):
        save_task(replace(task, hand=offset), tmp_path / "t.json")
    with pytest.raises(InputError, match="has other links or joints than parallel-gripper"):
        save_task(replace(task, hand=replace(task.hand, source="parallel-gripper")), tmp_path / "t.json")
    position = np.tile([-np.inf, np.inf], (3, 1))
    position[0, 0] = 0.0
    with pytest.raises(InputError, match=r"pose.position: is bounded on some sides only"):
        save_task(replace(task, pose=PoseBounds(position, task.pose.axes)), tmp_path / "t.json")
    assert not (tmp_path / "t.json").exists()


# --- bounds on the axes that contradict each other -------------------------------------------------


def around(R: Any, width: Any) -> PoseBounds:
    axes = np.stack([np.clip(R.T - width, -1, 1), np.clip(R.T + width, -1, 1)], axis=-1)
    return PoseBounds(PoseBounds.none().position, axes)


def test_no_bounds_that_a_rotation_meets_are_refused() -> None:
    rng = np.random.default_rng(1)
    for R in Rotation.random(20, random_state=rng).as_matrix():
        for width in (1e-12, 1e-3, 0.2 * rng.random((3, 3)), 0.9 * rng.random((3, 3))):
            refuse_contradiction(around(R, width))
    refuse_contradiction(PoseBounds.none())


@pytest.mark.parametrize(
    ("axes", "names"),
    [
        ({0: [0, 0, 1], 1: [0, 0, 1]}, "x_axis and y_axis"),
        ({1: [0.6, 0, 0.8], 2: [0.6, 0.3, 0.74]}, "y_axis and z_axis"),
        ({0: [1, 0, 0], 1: [0, 1, 0], 2: [0, 0, -1]}, "x_axis and y_axis and z_axis"),  # a left-handed frame
    ],
)
def test_true_contradictions_are_refused(axes: dict[int, list[float]], names: str) -> None:
    bounds = np.tile([-1.0, 1.0], (3, 3, 1))
    for k, v in axes.items():
        bounds[k] = np.stack([np.clip(np.array(v) - 0.1, -1, 1), np.clip(np.array(v) + 0.1, -1, 1)], axis=-1)
    with pytest.raises(InputError, match=f"pose: {names} contradict each other"):
        refuse_contradiction(PoseBounds(PoseBounds.none().position, bounds))


def test_refusals_agree_with_sampling() -> None:
    rng = np.random.default_rng(2)
    turns = Rotation.random(50_000, random_state=rng).as_matrix().swapaxes(1, 2)
    refused = 0
    for _ in range(20):
        middle = rng.uniform(-1, 1, (3, 3))
        bounds = np.stack([np.clip(middle - 0.4, -1, 1), np.clip(middle + 0.4, -1, 1)], axis=-1)
        try:
            pose = PoseBounds(PoseBounds.none().position, bounds)
            refuse_contradiction(pose)
        except InputError:
            refused += 1
            assert not ((turns >= bounds[..., 0]) & (turns <= bounds[..., 1])).all(axis=(1, 2)).any()
    assert 7 < refused < 20


# --- the authors' tasks ----------------------------------------------------------------------------


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared tasks are not here")
@pytest.mark.parametrize(("name", "contacts"), [("upholding", 2), ("handling", 3), ("service", 3)])
def test_the_authors_tasks_load(name: str, contacts: int, tmp_path: Path) -> None:
    task = load_task(SHARED / f"{name}.json")
    assert (task.name, len(task.contact_pairs)) == (name, contacts)
    assert all(isinstance(t.hand, Cap) and isinstance(t.object, Bezier) for t in task.contact_pairs)
    save_task(task, tmp_path / f"{name}.json")
    same(task, load_task(tmp_path / f"{name}.json"))
