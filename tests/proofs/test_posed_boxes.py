"""Where links, object and axes stand in boxes of configurations: against matrices in floating point, and differences.

A base that a joint lifts from the palm, on it an arm that turns and a tip that slides, and a thumb with two joints of
which the second follows the first. The tip touches with a ball, the thumb with a patch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

from handfast.proofs.chains import JointStep
from handfast.proofs.fields import Array
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.posed_boxes import OBJECT_LINK, PALM_LINK, ContactBoxes, Posed, mean_value
from handfast.proofs.tasks import TaskData, read_task

BASE, ARM, TIP, THUMB, NAIL, LAMP = range(6)


def rotation(quaternion: Any) -> Array:
    w, x, y, z = quaternion
    by_square = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(by_square) / (w * w + x * x + y * y + z * z)


def frame(quaternion: Any = (1, 0, 0, 0), place: Any = (0, 0, 0)) -> Array:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation(quaternion), place
    return out


POSES = [
    frame((1, 2, 3, 4), (9, 9, 9)),  # of the base: the palm's frame is where it stands itself
    frame((1, 0.1, -0.2, 0.3), (0.05, 0.02, 0.1)),
    frame((1, -0.3, 0.2, 0.1), (0.1, 0.01, -0.02)),
    frame((1, 0.2, 0.1, -0.4), (-0.05, 0.03, 0.08)),
    frame((1, 0, 0.5, 0), (0.01, 0.02, 0.03)),
    frame((1, 0.5, 0, 0), (0.02, 0.01, 0.05)),
]
JOINTS: list[tuple[str, list[float], list[float], list[float], float]] = [
    ("prismatic", [0, 0, 2], [0, 0, 0], [-0.1, 0.1], 0.01),
    ("revolute", [1, 2, 2], [0.1, -0.2, 0.05], [-1, 1], 0.2),
    ("prismatic", [3, 0, 4], [0, 0, 0], [0, 0.1], 0.0),
    ("revolute", [0, 1, 0.5], [0.02, 0, 0.01], [-0.5, 0.75], -0.1),
    ("prismatic", [1, 0, 1], [0, 0, 0], [-0.3, 0.4], 0.02),
    ("revolute", [0, 0, 1], [0, 0, 0], [-1, 1], 0.0),  # of the nail, on which nothing touches
]
OF_LINKS = [[0], [1], [2], [3, 4], [5], []]
POSITION = [[None, None], [-0.5, 0.5], [None, 0.25]]
AXES = [[[None, None]] * 3, [[None, None], [0.1, None], [None, None]], [[-0.5, 0.9], [None, None], [None, None]]]


def task(position: Any = POSITION, axes: Any = AXES) -> TaskData:
    names = ["base", "arm", "tip", "thumb", "nail", "lamp"]
    parents = [-1, BASE, ARM, BASE, THUMB, THUMB]
    joints = [
        {"name": f"j{j}", "type": kind, "axis": axis, "anchor": anchor, "limits": limits, "ref": ref}
        for j, (kind, axis, anchor, limits, ref) in enumerate(JOINTS)
    ]
    links = [
        {"name": name, "parent": parent, "pose": pose.tolist(), "joints": its}
        for name, parent, pose, its in zip(names, parents, POSES, OF_LINKS, strict=True)
    ]
    couplings = [{"joint": 4, "leader": 3, "ratio": 0.5, "offset": 0.03}]
    hand = {"name": "hand", "source": "", "links": links, "joints": joints, "couplings": couplings}
    tip = {"cap": {"center": [0.01, 0.02, 0.03], "radius": 0.02, "axis": [1, 2, 2], "half_angle": 0.5}, "flip": True}
    pad = {"bezier": [[[0.1 * u, 0.1 * v, 0.05 * u * v] for v in (0, 1)] for u in (0, 1)]}
    wall = {"bezier": [[[0.03 * u * v, 0.1 * v, 0.2 * u] for v in (0, 1)] for u in (0, 1)], "flip": True}
    dome = {"cap": {"center": [0.2, 0, 0.1], "radius": 0.05, "axis": [0, 0, 1], "half_angle": 1.0}}
    contacts = [{"link": "tip", "hand": tip, "object": wall}, {"link": "thumb", "hand": pad, "object": dome}]
    pose = {"position": position, "axes": axes}
    return read_task({"name": "t", "hand": hand, "contacts": contacts, "pose": pose})


@cache
def prepared() -> ContactBoxes:
    return ContactBoxes.of(task())


def points(contacts: ContactBoxes, seed: int = 0, count: int = 4) -> Array:
    """(count, n) within the root."""
    low, high = contacts.root.T
    out: Array = low + (high - low) * (0.1 + 0.8 * np.random.default_rng(seed).random((count, len(low))))
    return out


# --- the same in floating point


def joint_motion(j: int, value: float) -> Array:
    kind, axis, anchor, _, ref = JOINTS[j]
    a, by, out = np.array(axis) / np.linalg.norm(axis), value - ref, np.eye(4)
    if kind == "prismatic":
        out[:3, 3] = by * a
        return out
    x, y, z = a
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out[:3, :3] += np.sin(by) * turn + (1 - np.cos(by)) * turn @ turn
    out[:3, 3] = anchor - out[:3, :3] @ anchor
    return out


def values(x: Array) -> list[float]:
    """Of joints 0 to 4, of which the last follows the one before."""
    return [*x[:4].tolist(), 0.5 * float(x[3]) + 0.03]


def in_the_palm(x: Array) -> dict[int, Array]:
    q = values(x)
    out = {PALM_LINK: np.eye(4), BASE: joint_motion(0, q[0])}
    for link, parent in ((ARM, BASE), (TIP, ARM), (THUMB, BASE), (LAMP, THUMB)):
        out[link] = out[parent] @ POSES[link]
        for j in OF_LINKS[link]:
            out[link] = out[link] @ joint_motion(j, q[j])
    return out


def patch(u: float, v: float, ways: Any, bend: Any, sign: float) -> tuple[Array, Array, Array, Array]:
    """Point, normal and tangents of u a + v b + u v c."""
    (a, b), c = np.array(ways), np.array(bend)
    first, second = a + v * c, b + u * c
    normal = np.cross(first, second)
    return u * a + v * b + u * v * c, sign * normal / np.linalg.norm(normal), first, second


def expected(x: Array, chart: int) -> dict[str, Array]:
    """Frames in the tip's, of the object too; its first contact in its own; the rows by the module's formulas."""
    there, y = in_the_palm(x), dict(zip(("s0", "t0", "s1", "t1", "u1", "v1"), x[7:].tolist(), strict=True))
    frames = {link: np.linalg.inv(there[TIP]) @ pose for link, pose in there.items()}
    wall = patch(y["s0"], y["t0"], [[0, 0, 0.2], [0, 0.1, 0]], [0.03, 0, 0], -1)
    pad = patch(y["u1"], y["v1"], [[0.1, 0, 0], [0, 0.1, 0]], [0, 0, 0.05], 1)
    (sin_s, sin_t), (cos_s, cos_t) = (of([y["s1"], y["t1"]]) for of in (np.sin, np.cos))
    normal = np.array([sin_s * sin_t, -sin_s * cos_t, cos_s])
    first, second = np.array([cos_s * sin_t, -cos_s * cos_t, -sin_s]), np.array([cos_t, sin_t, 0])
    R, centre = rotation(np.insert(x[4:7], chart, 1.0)), np.array([0.01, 0.02, 0.03])
    # the hollow ball of the tip has its radius inwards, and its outward normal along the wall's
    lifted = [wall[0] - 0.02 * wall[1], np.array([0.2, 0, 0.1]) + 0.05 * normal]
    touch = frames[THUMB][:3, :3] @ pad[0] + frames[THUMB][:3, 3]
    gap = touch - centre - R @ (lifted[1] - lifted[0])
    axis, facing = R.T @ np.array([1, 2, 2]) / 3, R.T @ frames[THUMB][:3, :3] @ pad[1]
    rows = [*gap, axis @ wall[1], -facing @ normal, facing @ first, facing @ second, *values(x)]
    body = np.eye(4)
    body[:3, :3], body[:3, 3] = R, centre - R @ lifted[0]
    in_palm = there[TIP] @ body
    rows += [in_palm[1, 3], in_palm[2, 3], in_palm[1, 1], in_palm[0, 2]]
    return {"object": body, "contact": lifted[0], "rows": np.array(rows), "joints": np.array(values(x))} | {
        str(link): pose for link, pose in frames.items()
    }


def parts(at: Posed) -> dict[str, tuple[Dual, ...]]:
    found = {str(link): (pose.rotation, pose.place) for link, pose in at.poses.items()}
    return found | {
        "contact": (at.contact,),
        "rows": (at.rows,),
        "joints": (at.joints,),
        "object": (at.object.rotation, at.object.place),
    }


def split(name: str, wanted: dict[str, Array]) -> tuple[Array, ...]:
    if wanted[name].shape != (4, 4):
        return (wanted[name],)
    place = wanted[name][:3, 3]
    if name == "object":  # where its first contact is
        place = wanted[name][:3, :3] @ wanted["contact"] + place
    return wanted[name][:3, :3], place


CHARTS = np.arange(4)


def test_where_all_is_at_points() -> None:
    contacts = prepared()
    x = points(contacts)
    at = contacts.at(Interval.of(x), CHARTS, x.shape[1])
    without = contacts.at(Interval.of(x), CHARTS, 0)
    assert at.poses.keys() == {PALM_LINK, BASE, ARM, TIP, THUMB, LAMP}
    assert contacts.placed == {BASE, ARM, TIP, THUMB, LAMP}
    for k, chart in enumerate(CHARTS.tolist()):
        wanted = expected(x[k], chart)
        for name, its in parts(at).items():
            for one, bare, right in zip(its, parts(without)[name], split(name, wanted), strict=True):
                assert np.abs(one.value.mid[k] - right).max() < 1e-14
                assert (one.value.hi - one.value.lo < 1e-12).all()
                np.testing.assert_array_equal(one.value.ends, bare.value.ends)
                assert bare.slope.shape == (0, *bare.value.shape)


def test_derivatives_are_those_of_what_is_there() -> None:
    """By differences over 2e-6."""
    contacts = prepared()
    x = points(contacts, 1)
    found = parts(contacts.at(Interval.of(x), CHARTS, x.shape[1]))
    for k, column in product(range(4), range(x.shape[1])):
        step = 1e-6 * np.eye(x.shape[1])[column]
        low, high = (expected(x[k] + sign * step, k) for sign in (-1, 1))
        for name in ("rows", "object", "contact", str(LAMP)):
            for one, a, b in zip(found[name], split(name, low), split(name, high), strict=True):
                assert np.abs(one.slope.mid[column, k] - (b - a) / 2e-6).max() < 1e-8
    for its in found.values():
        for one in its:
            assert (one.slope.hi - one.slope.lo < 1e-9).all()


def test_boxes_hold_what_is_at_their_points() -> None:
    contacts = prepared()
    x, rng = points(contacts, 2), np.random.default_rng(3)
    over = parts(contacts.at(Interval.between(x - 1e-3, x + 1e-3), CHARTS, x.shape[1]))
    for _ in range(2):
        some = x + rng.choice([-1e-3, 1e-3], size=x.shape)
        at = parts(contacts.at(Interval.of(some), CHARTS, x.shape[1]))
        for name, its in over.items():
            for wide, thin in zip(its, at[name], strict=True):
                for a, b in ((wide.value, thin.value), (wide.slope, thin.slope)):
                    assert ((a.lo <= b.hi) & (b.lo <= a.hi)).all()


def test_some_of_the_boxes() -> None:
    contacts = prepared()
    x = points(contacts)
    every = contacts.at(Interval.of(x), CHARTS, x.shape[1])
    its = np.array([2, 0])
    for name, some in parts(every.some(its)).items():
        for one, all_ in zip(some, parts(every)[name], strict=True):
            np.testing.assert_array_equal(one.value.ends, all_.value.ends[its])
            np.testing.assert_array_equal(one.slope.ends, all_.slope.ends[:, its])


def near(found: Dual, right: Callable[[Array, int], Array], x: Array) -> None:
    """Is it this at each of the points, and are the derivatives, along some way?"""
    ways = np.random.default_rng(7).normal(size=x.shape)
    for k, way in enumerate(ways):
        assert np.abs(found.value.mid[k] - right(x[k], k)).max() < 1e-13
        change = (right(x[k] + 1e-6 * way, k) - right(x[k] - 1e-6 * way, k)) / 2e-6
        assert np.abs(np.tensordot(way, found.slope.mid[:, k], 1) - change).max() < 1e-8


@pytest.mark.parametrize("body", [OBJECT_LINK, THUMB])
def test_links_and_points_as_others_see_them(body: int) -> None:
    contacts = prepared()
    x, name = points(contacts, 4), "object" if body == OBJECT_LINK else str(body)
    at = contacts.at(Interval.of(x), CHARTS, x.shape[1])
    of_link = np.random.default_rng(5).normal(size=(4, 3))

    def relative(y: Array, chart: int) -> Array:
        wanted = expected(y, chart)
        out: Array = np.linalg.inv(wanted[name]) @ wanted[str(ARM)]
        return out

    pose = at.relative(ARM, body)
    near(pose.rotation, lambda y, chart: relative(y, chart)[:3, :3], x)
    near(pose.place, lambda y, chart: relative(y, chart)[:3, 3], x)
    found = at.seen(ARM, body, of_link).value.mid
    for k, chart in enumerate(CHARTS.tolist()):
        assert found[k] == pytest.approx((relative(x[k], chart) @ [*of_link[k], 1])[:3], abs=1e-13)
    assert at.seen(ARM, body, of_link).slope.shape == (x.shape[1], 4, 3)


# frames in which a joint's axis stands still: of its link, after the joint itself
AFTER: dict[int, tuple[int, tuple[int, ...]]] = {
    0: (BASE, ()),
    1: (ARM, ()),
    2: (TIP, ()),
    3: (THUMB, (4,)),
    4: (THUMB, ()),
}


def test_axes_of_joints_as_the_object_sees_them() -> None:
    contacts = prepared()
    x = points(contacts, 6)
    at = contacts.at(Interval.of(x), CHARTS, x.shape[1])

    def seen(j: int, y: Array, chart: int) -> Array:
        wanted, (link, behind) = expected(y, chart), AFTER[j]
        pose = np.linalg.inv(wanted["object"]) @ wanted[str(link)]
        for other in behind:
            pose = pose @ np.linalg.inv(joint_motion(other, values(y)[other]))
        axis = np.array(JOINTS[j][1]) / np.linalg.norm(JOINTS[j][1])
        return np.stack([pose[:3, :3] @ axis, pose[:3, :3] @ JOINTS[j][2] + pose[:3, 3]])

    every = contacts.axes(at, range(5))
    assert every.keys() == {*range(5)}
    for j, found in every.items():
        for k, one in enumerate(found):
            near(one, lambda y, chart, j=j, k=k: seen(j, y, chart)[k], x)  # type: ignore[misc]
    for wanted in ([3], [4], [1, 3], []):
        some = contacts.axes(at, wanted)
        assert some.keys() == {*wanted}
        for j in wanted:
            np.testing.assert_array_equal(some[j][1].value.ends, every[j][1].value.ends)
    step = JointStep.of(contacts.task.hand, 1)
    along, point = at.axis(at.poses[ARM], step)
    np.testing.assert_array_equal(along.value.ends, every[1][0].value.ends)
    np.testing.assert_array_equal(point.value.ends, every[1][1].value.ends)


def test_what_is_asked_of_the_rows() -> None:
    """That contacts meet, face each other within the cone, lie flat; limits of joints, bounds of the pose."""
    inf = np.inf
    contacts = prepared()
    lowest = [0, 0, 0, np.cos(0.5) - 1e-12, 0, 0, 0, -0.1, -1, 0, -0.5, -0.3, -0.5, -inf, 0.1, -0.5]
    highest = [0, 0, 0, inf, inf, 0, 0, 0.1, 1, 0.1, 0.75, 0.4, 0.5, 0.25, 1, 0.9]
    assert contacts.low == pytest.approx(lowest)
    assert contacts.high == pytest.approx(highest)
    assert contacts.low[3] < np.cos(0.5)
    n = len(contacts.root)
    assert contacts.turns == slice(4, 7)
    assert contacts.root.tolist() == [
        [-0.1, 0.1], [-1, 1], [0, 0.1], [-0.5, 0.75], *[[-1, 1]] * 3, *[[0, 1]] * 2, [0, 1], [-3.2, 3.2], *[[0, 1]] * 2
    ]  # fmt: skip
    free = ContactBoxes.of(task([[None, None]] * 3, [[[None, None]] * 3] * 3))
    assert (len(free.low), len(free.high)) == (12, 12)
    x = Interval.of(points(free))
    assert free.at(x, CHARTS, n).rows.value.shape == (4, 12)
    for position, axes, more in ((POSITION, [[[None, None]] * 3] * 3, 2), ([[None, None]] * 3, AXES, 2)):
        some = ContactBoxes.of(task(position, axes))
        assert some.at(x, CHARTS, 0).rows.value.shape == (4, 12 + more) == (4, len(some.low))


def test_a_contact_on_what_nothing_moves() -> None:
    """On the palm itself: three coordinates of the rotation, two of the region."""
    cap = {"cap": {"center": [0, 0, 0.1], "radius": 0.01, "axis": [0, 0, 1], "half_angle": 0.5}}
    wall = {"bezier": [[[u, v, 0] for v in (0, 1)] for u in (0, 1)], "flip": True}
    links = [{"name": "palm", "parent": -1, "pose": np.eye(4).tolist(), "joints": []}]
    hand = {"name": "hand", "source": "", "links": links, "joints": [], "couplings": []}
    touches = [{"link": "palm", "hand": cap, "object": wall}]
    pose = {"position": [[None, None]] * 3, "axes": [[[None, None]] * 3] * 3}
    contacts = ContactBoxes.of(read_task({"name": "t", "hand": hand, "contacts": touches, "pose": pose}))
    assert contacts.root.tolist() == [[-1, 1]] * 3 + [[0, 1]] * 2
    at = contacts.at(Interval.of(np.array([[0, 0, 0, 0.25, 0.5]])), np.array([0]), 5)
    # the outward normal of the wall is -z, that of the ball +z: it touches where z of both is 0.11 m
    assert at.rows.value.mid[0] == pytest.approx([1.0])
    assert at.contact.value.mid[0] == pytest.approx([0.25, 0.5, -0.01])
    assert at.object.place.value.mid[0] == pytest.approx([0, 0, 0.1])
    assert at.joints.value.shape == (1, 0)
    # turning about x by angle 2 x and about y tilts the wall; facing has its largest value here
    assert at.rows.slope.mid[:, 0, 0] == pytest.approx([0] * 5, abs=1e-12)


def test_lower_bounds_over_boxes_and_what_sides_change() -> None:
    """Of two functions: the better of the values over the box, and those in the middle less what sides change."""

    def one(lo: Any, hi: Any) -> Interval:
        return Interval.between(np.array(lo, dtype=float), np.array(hi, dtype=float))

    over = Dual(one([[-9, 2], [np.nan] * 2], [[9, 5], [np.nan] * 2]), one(np.zeros((3, 2, 2)), np.zeros((3, 2, 2))))
    slope = over.slope.ends
    slope[0, 0, 0], slope[2, 0, 0], slope[1, 0, 1] = (-2, 4), (1, -1), (0, 1)  # 2 to 4, -1, 0 to 1
    slope[0, 1] = np.nan
    middle, away = one([[1, 3], [0, 0]], [[1.5, 3], [0, 0]]), one([[-0.5, -2, -0.25]] * 2, [[0.25, 2, 0.25]] * 2)
    least, changes = mean_value(over, middle, away)
    assert least[0] == pytest.approx([1 - 2 - 0.25, 2])
    assert (least[0] <= [-1.25, 2]).all()
    assert np.isnan(least[1]).all()
    assert changes[0] == pytest.approx(np.array([[2, 0, 0.25], [0, 2, 0]]), rel=1e-12, abs=1e-200)


def test_what_conditions_leave_of_boxes() -> None:
    """A ball on a slide of 0 to 0.1 m, which turns about nothing, at a wall that faces it: its limits cut boxes.

    A billionth of each side is left beside what they cut, and none of what is beyond them, or faces away.
    """
    cap = {"cap": {"center": [0, 0, 0.1], "radius": 0.01, "axis": [0, 0, 1], "half_angle": 0.5}}
    wall = {"bezier": [[[u, v, 0] for v in (0, 1)] for u in (0, 1)], "flip": True}
    slide = {"name": "j", "type": "prismatic", "axis": [0, 0, 1], "anchor": [0] * 3, "limits": [0, 0.1], "ref": 0}
    links = [{"name": "finger", "parent": -1, "pose": np.eye(4).tolist(), "joints": [0]}]
    hand = {"name": "hand", "source": "", "links": links, "joints": [slide], "couplings": []}
    touches = [{"link": "finger", "hand": cap, "object": wall}]
    pose = {"position": [[None, None]] * 3, "axes": [[[None, None]] * 3] * 3}
    contacts = ContactBoxes.of(read_task({"name": "t", "hand": hand, "contacts": touches, "pose": pose}))
    slides = np.array([[0.05, 0.2], [-0.3, 0.05], [0.02, 0.03], [0.2, 0.3], [0.02, 0.03]])
    box = np.concatenate([slides[:, None], np.tile([[-1e-3, 1e-3]] * 3 + [[0.25, 0.5]] * 2, (5, 1, 1))], axis=1)
    charts = np.array([0, 0, 0, 0, 1])  # the last: half a turn about x
    over = contacts.at(Interval.between(box[..., 0], box[..., 1]), charts, 6)
    middle = contacts.at(Interval.of(box.mean(axis=2)), charts, 0)
    with np.errstate(all="ignore"):
        alive, kept, changes = contacts.narrowed(box, over, middle)
    assert alive.tolist() == [True, True, True, False, False]
    assert kept[:3, 0] == pytest.approx(np.array([[0.05, 0.1], [0.0, 0.05], [0.02, 0.03]]), abs=1e-9)
    assert kept[0, 0, 1] - 0.1 == pytest.approx(0.15e-9, rel=1e-4)
    assert 0.0 - kept[1, 0, 0] == pytest.approx(0.35e-9, rel=1e-4)
    assert (kept[0, 0, 0], kept[1, 0, 1], *kept[2, 0]) == (0.05, 0.05, 0.02, 0.03)
    np.testing.assert_array_equal(kept[:3, 1:], box[:3, 1:])
    assert changes.shape == (5, 6, 2)  # of how it faces the wall, and of its slide
    assert changes[:, 0, 1] == pytest.approx(np.ptp(slides, axis=1) / 2)
    assert changes[:, 1:, 1].max() < 1e-200
    assert (changes[:, 1:4, 0] < 1e-4).all()
