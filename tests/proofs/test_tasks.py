"""Tasks in plain arrays: what is read is what a task says, and every fault names its field."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast.model.hand.coupling import drivers
from handfast.proofs import tasks
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.regions import read_region
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import PoseBounds, Task
from tests.support.holds import pinch
from tests.support.planted_proofs import odd_case, sah_case

Data = dict[str, Any]


def embedded(task: Task) -> Data:
    return json.loads(json.dumps(task_to_dict(task)))


@pytest.mark.parametrize("case", [odd_case, sah_case])
@pytest.mark.parametrize("seed", range(6))
def test_what_is_read_is_the_task(case: Callable, seed: int) -> None:
    task = case(seed).task
    data, hand = read_task(embedded(task)), task.hand
    assert data.hand.joints == hand.joint_names
    assert [link.name for link in data.hand.links] == list(hand.link_names)
    assert [link.parent for link in data.hand.links] == [link.parent for link in hand.links]
    assert [link.joints for link in data.hand.links] == [link.joints for link in hand.links]
    np.testing.assert_array_equal(data.hand.poses, [link.pose for link in hand.links])
    for name, of in (("axes", "axis"), ("anchors", "anchor"), ("ref", "ref")):
        np.testing.assert_array_equal(getattr(data.hand, name), [getattr(j, of) for j in hand.joints])
    np.testing.assert_array_equal(data.hand.limits, hand.limits)
    assert data.hand.revolute.tolist() == [j.type == "revolute" for j in hand.joints]
    assert {j: (c.driver, c.ratio, c.offset) for j, c in data.hand.couplings.items()} == {
        c.joint: (c.driver, c.ratio, c.offset) for c in hand.couplings
    }
    assert data.links == task.links
    assert tuple(data.moving) == task.moving
    assert tuple(hand.joint_names[j] for j in data.free) == task.free
    follows = drivers(hand)
    for j, path in data.moving.items():
        assert (path[-1].driver if path else j) == follows[j][0]
    for region, pair in zip(data.on_object, task.contact_pairs, strict=True):
        assert (region.kind, region.sign) == (pair.object.kind, pair.object.sign)


def test_bounds_that_are_none_are_infinite() -> None:
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    axes[0, 1] = [-1.0, 0.5]
    pose = PoseBounds(np.array([[-np.inf, 0.3], [0, 1], [-np.inf, np.inf]]), axes)
    data = read_task(embedded(pinch(pose=pose)))
    np.testing.assert_array_equal(data.position, pose.position)
    np.testing.assert_array_equal(data.axes, axes)


def put(*path: Any, to: Any) -> Callable[[Data], None]:
    def change(data: Data) -> None:
        *inner, last = path
        at: Any = data
        for key in inner:
            at = at[key]
        at[last] = to

    return change


def each(kind: str, name: str) -> Callable[[Data], object]:
    """Empty lists in a field of all links or joints."""
    return lambda data: [one.update({name: []}) for one in data["hand"][kind]]


HAND, CONTACT = ("hand",), ("contacts", 0)
FAULTS: list[tuple[Callable[[Data], object], str]] = [
    (put("name", to=1), "task.name: is 1; a text is needed"),
    (put("object", to=1), "task.object: is 1; a text is needed"),
    (put("note", to=1), "task.note: is not a known field"),
    (lambda d: d.pop("pose"), "task.pose: is missing"),
    (put("contacts", to=[]), "task.contacts: has 0 entries; 1 to 1000 are possible"),
    (put(*CONTACT, "link", to="tail"), "task.contacts[0].link: has unknown link 'tail'; known are palm, "),
    (put(*CONTACT, "note", to=1), "task.contacts[0].note: is not a known field"),
    (
        put(*CONTACT, "hand", to={}),
        "task.contacts[0].hand: exactly one of bezier, cap, cylinder_side, cone_side is needed",
    ),
    (put(*CONTACT, "hand", "bezier", to=[]), "task.contacts[0].hand: exactly one of "),
    (
        put(
            *CONTACT,
            "hand",
            to={"cone_side": {**{key: [0, 0, 1] for key in ("center", "axis", "x_axis")}, "radii": [1, 0]}},
        ),
        "task.contacts[0].hand.cone_side.radii: has 0; radii are positive",
    ),
    (put(*CONTACT, "hand", "cap", "radius", to=0.0), "task.contacts[0].hand.cap.radius: is 0; it must be positive"),
    (put(*CONTACT, "hand", "cap", "radius", to=-1.0), "task.contacts[0].hand.cap.radius: is -1; it must be positive"),
    (put(*CONTACT, "hand", "cap", "half_angle", to=0.0), "task.contacts[0].hand.cap.half_angle: is 0; it must be pos"),
    (put(*CONTACT, "hand", "cap", "half_angle", to=3.2), "task.contacts[0].hand.cap.half_angle: is 3.2; pi or less"),
    (put(*CONTACT, "hand", "cap", "more", to=0.0), "task.contacts[0].hand.cap.more: is not a known field"),
    (put(*CONTACT, "hand", "flip", to=1), "task.contacts[0].hand.flip: is 1; true or false is needed"),
    (put(*CONTACT, "object", "bezier", to=[[[0, 0, 0]]]), "task.contacts[0].object.bezier: has 1 x 1 points; 2 x 2 to"),
    (put(*CONTACT, "object", "bezier", to=[[[0, 0]]]), "task.contacts[0].object.bezier: has 1 x 1 x 2 numbers"),
    (put(*CONTACT, "object", "more", to=1), "task.contacts[0].object.more: is not a known field"),
    (put(*HAND, "links", 2, "parent", to=2), "task.hand.links[2].parent: is 2; an earlier link is needed"),
    (put(*HAND, "links", 2, "parent", to=-1), "task.hand.links[2].parent: is -1; an earlier link"),
    (put(*HAND, "links", 0, "parent", to=0), "task.hand.links[0].parent: is 0; an earlier link"),
    (put(*HAND, "links", 0, "parent", to=-2), "task.hand.links[0].parent: is -2; an earlier link"),
    (put(*HAND, "links", 2, "parent", to=True), "task.hand.links[2].parent: is True; an earlier link"),
    (put(*HAND, "links", 2, "joints", to=[99]), "task.hand.links: have joints that do not exist, or a joint twice"),
    (
        lambda d: d["hand"]["links"][2].update(joints=[len(d["hand"]["joints"])]),
        "task.hand.links: have joints that do not exist, or a joint twice",
    ),
    (put(*HAND, "links", 2, "joints", to=[-1]), "task.hand.links: have joints that do not exist, or a joint twice"),
    (put(*HAND, "links", 2, "joints", to=[0, 0]), "task.hand.links: have joints that do not exist, or a joint twice"),
    (put(*HAND, "links", 2, "joints", to=[0.5]), "task.hand.links: have joints that do not exist, or a joint twice"),
    (put(*HAND, "links", 2, "joints", to=0), "task.hand.links: have joints that do not exist, or a joint twice"),
    (put(*HAND, "links", 2, "name", to="palm"), "task.hand.links: has a name twice"),
    (put(*HAND, "links", 2, "name", to=2), "task.hand.links: is no list of texts"),
    (put(*HAND, "links", 2, "more", to=2), "task.hand.links[2].more: is not a known field"),
    (lambda d: d["hand"]["links"][2].pop("pose"), "task.hand.links[2].pose: is missing"),
    (put(*HAND, "links", 2, "pose", 3, to=[0, 0, 0, 2]), "task.hand.links[].pose: has no 0, 0, 0, 1 as last row"),
    (put(*HAND, "links", 2, "pose", 0, 0, to="1"), "task.hand.links[].pose: has '1' where a number is needed"),
    (put(*HAND, "links", 2, "pose", 0, 0, to=True), "task.hand.links[].pose: has True where a number is needed"),
    (put(*HAND, "links", 2, "pose", 0, 0, to=1e60), "task.hand.links[].pose: has a number that is not finite, or"),
    (put(*HAND, "links", to=[]), "task.hand"),
    (
        put(*HAND, "joints", 1, "type", to="ball"),
        "task.hand: has no link, or a joint that is not revolute or prismatic",
    ),
    *(
        (put(*HAND, "joints", 1, "type", to=kind), "task.hand: has no link, or a joint that is not revolute or")
        for kind in ({}, ["revolute"], None, 3)
    ),
    *(
        (each("joints", name), f"task.hand.joints[].{name}: is empty; {size} numbers are needed")
        for name, size in (("limits", 2), ("axis", 3), ("anchor", 3))
    ),
    (each("joints", "ref"), "task.hand.joints[].ref: is empty; single numbers are needed"),
    (each("links", "pose"), "task.hand.links[].pose: is empty; 4 x 4 numbers are needed"),
    (put(*HAND, "joints", 1, "axis", to=[0, 0, 0]), "task.hand.joints[].axis: is zero; a direction is needed"),
    (put(*HAND, "joints", 1, "axis", to=[0, 1]), "task.hand.joints[].axis: is no table of n x 3 numbers"),
    (put(*HAND, "joints", 1, "limits", to=[1, 0]), "task.hand.joints.ring_proximal.limits: is [1, 0]; the lower one"),
    (put(*HAND, "joints", 1, "name", to="ring_abduction"), "task.hand.joints: has a name twice"),
    (put(*HAND, "couplings", 0, "more", to=1), "task.hand.couplings[0].more: is not a known field"),
    (put(*HAND, "more", to=1), "task.hand.more: is not a known field"),
    (put(*HAND, "couplings", 0, "joint", to=99), "task.hand.couplings[0]: ties a joint that does not exist"),
    (put(*HAND, "couplings", 0, "leader", to=99), "task.hand.couplings[0]: ties a joint that does not exist"),
    (
        lambda d: d["hand"]["couplings"][0].update(leader=len(d["hand"]["joints"])),
        "task.hand.couplings[0]: ties a joint that does not exist",
    ),
    (
        lambda d: d["hand"]["couplings"][0].update(joint=len(d["hand"]["joints"])),
        "task.hand.couplings[0]: ties a joint that does not exist",
    ),
    (put(*HAND, "couplings", 0, "leader", to=-2), "task.hand.couplings[0].leader: is -2; a whole number of -1 or more"),
    (lambda d: d["hand"]["couplings"].append(d["hand"]["couplings"][0]), "task.hand.couplings[4]: ties a joint that"),
    (lambda d: d["hand"]["couplings"][0].update(leader=d["hand"]["couplings"][0]["joint"]), "task.hand.couplings: tie"),
    (put("pose", "position", to=[]), "task.pose.position: is no list of three pairs"),
    (put("pose", "position", 2, to=[2]), "task.pose.position: is no list of three pairs"),
    (put("pose", "position", 2, to="12"), "task.pose.position: is no list of three pairs"),
    (put("pose", "position", 0, to=[2, 1]), "task.pose.position: is [2, 1]; the lower one comes first"),
    (put("pose", "position", 0, to=["a", 1]), "task.pose.position: is 'a'; a finite number is needed"),
    (put("pose", "axes", to=[[]]), "task.pose.axes: is no list of three"),
    (put("pose", "axes", 1, to=[[0]]), "task.pose.axes[1]: is no list of three pairs"),
    (put("pose", "more", to=1), "task.pose.more: is not a known field"),
]


@pytest.mark.parametrize(("change", "words"), FAULTS)
def test_faults_name_their_field(change: Callable[[Data], object], words: str) -> None:
    data = embedded(pinch())
    change(data)
    with pytest.raises(BadFile) as fault:
        read_task(data)
    assert str(fault.value).startswith(words)
    assert "\n" not in str(fault.value)


SIDE = {"center": [0, 0, 0], "radius": 0.1, "axis": [0, 0, 1], "x_axis": [1, 0, 0], "angles": [0, 1], "heights": [0, 1]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"radius": 0}, "radius: is 0; it must be positive"),
        ({"angles": [1, 1]}, r"angles: is \[1, 1\]; the lower one first"),
        ({"angles": [0, 6.3]}, r"angles: is \[0, 6.3\]; the lower one first, at most a full turn"),
        ({"heights": [2, 1]}, r"heights: is \[2, 1\]; the lower one first"),
        ({"axis": [0, 0]}, "axis: has 2 numbers; 3 are needed"),
    ],
)
def test_faults_of_the_side_of_a_cylinder(change: Data, words: str) -> None:
    data = embedded(pinch())
    data["contacts"][0]["object"] = {"cylinder_side": SIDE | {"heights": [-9, 9]}}
    read_task(data)  # heights may be farther apart than a full turn
    data["contacts"][0]["object"] = {"cylinder_side": SIDE | change}
    with pytest.raises(BadFile, match=rf"^task.contacts\[0\].object.cylinder_side.{words}"):
        read_task(data)


def test_joints_without_a_driver_do_not_move_with_each_other() -> None:
    """Of two fingers with one contact: what its finger's joints are, and what their driver moves besides."""
    data = embedded(pinch())
    names = [j["name"] for j in data["hand"]["joints"]]
    at = {name: names.index(name) for name in ("index_distal", "ring_distal", "middle_distal", "index_proximal")}
    del data["contacts"][1]
    fixed = [{"joint": at[name], "leader": -1, "ratio": 1.0, "offset": 0.1} for name in ("index_distal", "ring_distal")]
    data["hand"]["couplings"] = [
        *fixed,
        {"joint": at["middle_distal"], "leader": at["index_proximal"], "ratio": 1.0, "offset": 0.0},
    ]
    moving = read_task(data).moving
    assert {names[j] for j in moving} == {n for n in names if n.startswith("index")} | {"middle_distal"}
    assert [(c.driver, c.offset) for c in moving[at["index_distal"]]] == [(-1, 0.1)]


def test_links_up_to_one_begin_at_the_base() -> None:
    hand = read_task(embedded(pinch())).hand
    assert hand.path(0) == [0]
    for i, link in enumerate(hand.links[1:], 1):
        assert hand.path(i) == [*hand.path(link.parent), i]
    assert {link.parent for link in hand.links} > {0}


def test_a_hand_without_joints() -> None:
    data = embedded(pinch())
    data["hand"] |= {"joints": [], "couplings": [], "links": [link | {"joints": []} for link in data["hand"]["links"]]}
    task = read_task(data)
    assert (task.hand.joints, task.free, task.moving) == ((), (), {})
    assert (task.hand.revolute.shape, task.hand.revolute.dtype) == ((0,), np.bool_)


def test_as_many_links_and_joints_as_are_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    data = embedded(pinch())
    most = max(len(data["hand"]["links"]), len(data["hand"]["joints"]))
    monkeypatch.setattr(tasks, "MAX_TASK_PARTS", most)
    read_task(data)
    monkeypatch.setattr(tasks, "MAX_TASK_PARTS", most - 1)
    with pytest.raises(BadFile, match=rf"has a name twice, or more than {most - 1}$"):
        read_task(data)


def test_as_many_contacts_as_are_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    data = embedded(pinch())
    most = len(data["hand"]["links"]) + 1
    monkeypatch.setattr(tasks, "MAX_TASK_PARTS", most)
    data["contacts"] = [data["contacts"][0]] * most
    assert len(read_task(data).links) == most
    data["contacts"] *= 2
    with pytest.raises(BadFile, match=rf"^task.contacts: has {2 * most} entries; 1 to {most} are possible$"):
        read_task(data)


# --- where all joints are ---


def test_joints_beside_a_proof() -> None:
    """ring_distal follows ring_middle; index_proximal is proved to be at 0.2."""
    task = read_task(embedded(pinch()))
    good = dict.fromkeys(task.hand.joints, 0.1) | {"index_proximal": 0.2}
    proved = {"index_proximal": 0.2}
    low, high = task.hand.limits[task.hand.joints.index("ring_proximal")].tolist()

    def said(**joints: float) -> str:
        return task.misplaced(good | joints, proved)

    assert said() == ""
    assert said(index_proximal=0.2 + 0.9e-9) == ""
    assert said(index_proximal=0.2 - 1.1e-9) == "index_proximal is not at the value that is proved"
    assert said(index_proximal=0.2 + 1.1e-9) == "index_proximal is not at the value that is proved"
    assert said(ring_proximal=high + 0.9e-9) == ""
    assert said(ring_proximal=high + 1.1e-9) == "ring_proximal is beyond its limits"
    assert said(ring_proximal=low - 0.9e-9) == ""
    assert said(ring_proximal=low - 1.1e-9) == "ring_proximal is beyond its limits"
    assert said(ring_middle=0.5, ring_distal=0.5) == ""
    assert said(ring_middle=0.5, ring_distal=0.5 + 1.1e-9) == "ring_distal does not follow its coupling"
    assert said(ring_middle=0.5) == "ring_distal does not follow its coupling"
    assert task.misplaced({}, proved).startswith("the joints are ring_abduction, ")


def test_joints_may_be_off_by_the_tolerance_exactly() -> None:
    task = read_task(embedded(pinch()))
    good = dict.fromkeys(task.hand.joints, 0.1)
    low, high = task.hand.limits[task.hand.joints.index("ring_proximal")].tolist()
    for proved, joints in (
        ({"index_proximal": 0.0}, {"index_proximal": 1e-9}),
        ({}, {"ring_proximal": low - 0.999e-9}),
        ({}, {"ring_proximal": high + 0.999e-9}),
    ):
        assert task.misplaced(good | joints, proved) == ""


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.25, ""), (0.25 + 0.9e-9, ""), (0.25 + 1.1e-9, "does not"), (-0.25, "is beyond"), (0.3, "does not")],
)
def test_a_joint_that_nothing_drives_is_at_its_offset(value: float, words: str) -> None:
    data = embedded(pinch())
    names = [j["name"] for j in data["hand"]["joints"]]
    data["hand"]["couplings"] = [{"joint": names.index("ring_distal"), "leader": -1, "ratio": 2.0, "offset": 0.25}]
    task = read_task(data)
    said = task.misplaced(dict.fromkeys(task.hand.joints, 0.1) | {"ring_distal": value}, {})
    assert said.startswith(f"ring_distal {words}" if words else "")
    assert bool(said) == bool(words)


def test_a_coupling_may_be_missed_by_the_tolerance_exactly() -> None:
    """A joint that follows 0, at 0: ring_distal's limits are widened to there."""
    data = embedded(pinch())
    names = [j["name"] for j in data["hand"]["joints"]]
    k = names.index("ring_distal")
    data["hand"]["joints"][k]["limits"] = [-1, 1]
    data["hand"]["couplings"] = [{"joint": k, "leader": -1, "ratio": 1.0, "offset": 0.0}]
    task = read_task(data)
    for value, words in ((1e-9, ""), (-1e-9, ""), (np.nextafter(1e-9, 1), "ring_distal does not follow its coupling")):
        assert task.misplaced(dict.fromkeys(task.hand.joints, 0.1) | {"ring_distal": value}, {}) == words


@pytest.mark.parametrize(("part", "low", "high"), [
    ({"cap": {"center": [1, 2, 3], "axis": [0, 0, 1], "radius": 0.5, "half_angle": np.pi}},
     [0.5, 1.5, 2.5], [1.5, 2.5, 3.5]),
    # a lens of 20 mm of a ball of 100 m
    ({"cap": {"center": [0, 0, -100], "axis": [0, 0, 1], "radius": 100, "half_angle": 1e-4}},
     [-0.01, -0.01, -5e-7], [0.01, 0.01, 0]),
    (
        {"cone_side": {"center": [1, 0, 0], "axis": [0, 0, 1], "x_axis": [1, 0, 0], "radii": [0.5, 0.25],
                       "angles": [0, np.pi], "heights": [7, 9]}},
        [0.5, 0, 7], [1.5, 0.5, 9],
    ),
    ({"bezier": [[[0, 0, 0], [3, 0, 0]], [[0, 4, 0], [3, 4, 0]]]}, [0, 0, 0], [3, 4, 0]),
])  # fmt: skip
def test_how_far_regions_reach(part: Data, low: list[float], high: list[float]) -> None:
    places = read_region(Fields(part)).places
    assert places.min(axis=0) == pytest.approx(low, abs=0.002)
    assert places.max(axis=0) == pytest.approx(high, abs=0.002)


def test_the_size_of_a_task_is_that_of_its_object_wherever_that_is() -> None:
    """A half ball about (100, 0, 0) of 0.5 m, upwards, and a point at (103, 4, 0)."""
    task = read_task(embedded(pinch()))
    ball = {"center": [100.0, 0, 0], "axis": [0, 0, 1], "radius": 0.5, "half_angle": np.pi / 2}
    flat = [[[103.0, 4, 0], [103, 4, 0]], [[103, 4, 0], [103, 4, 0]]]
    regions = tuple(read_region(Fields(x)) for x in ({"cap": ball}, {"bezier": flat}))
    task = replace(task, on_object=regions)
    size = np.linalg.norm([3.5, 4.5, 0.5])
    assert task.size == pytest.approx(size, rel=0.01)
    slides = replace(task, hand=replace(task.hand, revolute=np.zeros(len(task.hand.joints), dtype=bool)))
    assert (task.tolerance(0), slides.tolerance(0)) == (1e-9, pytest.approx(1e-9 * size, rel=0.01))


def test_couplings_are_judged_by_what_they_are_and_not_by_floats() -> None:
    """1.1 a - 1e14 is 0.00495 where floats make it 0."""
    data = embedded(pinch())
    a, b, *_ = (j["name"] for j in data["hand"]["joints"])
    driver = next(x for k in range(-400, 400) if 1.1 * (x := 1e14 / 1.1 + k * 2.0**-7) == 1e14)
    data["hand"]["couplings"] = [{"joint": 1, "leader": 0, "ratio": 1.1, "offset": -1e14}]
    for joint in data["hand"]["joints"]:
        joint["limits"] = [-1e15, 1e15]
    task = read_task(data)
    said = dict.fromkeys(task.hand.joints, 0.0) | {a: driver}
    assert task.misplaced(said, {}) == f"{b} does not follow its coupling"
    assert task.misplaced(said | {a: 2.0**47, b: 1.1 * 2.0**47 - 1e14}, {}) == ""
