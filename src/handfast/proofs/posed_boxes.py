"""Boxes of configurations of some contacts, in which links and object stand relative to the first contact's link.

Coordinates are the free joints that move these contacts, three of the object's rotation in that link's frame, and the
parameters of the regions. The object's position follows: the first contact touches. So what a fingertip and the object
do to each other depends on no joint. The rotation is that of a quaternion of any length whose largest component is 1
and whose others are within -1 and 1: four `CHARTS`, by the component that is 1.

In a box every link that these joints place, and the object, stand where interval arithmetic encloses them, with
derivatives. The conditions of the contacts, of the pose bounds and of coupled joints narrow a box or empty it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from handfast.proofs.chains import JointStep, Pose, frames, rotated
from handfast.proofs.contact_equations import Sides, rotations
from handfast.proofs.fields import Array, Integers, Mask
from handfast.proofs.impossibility import narrowed_by, whole
from handfast.proofs.intervals import Dual, Interval, dot, join
from handfast.proofs.tasks import TaskData

CHARTS = 4
PALM_LINK = -1  # in place of a link: the palm frame, from which the base may move
OBJECT_LINK = -1  # in place of a link whose solids are meant
SIDE_SLACK = 1e-9  # of a side, by which what conditions leave of it is wider than it needs to be
TURN_NAMES = [f"turn:{i}" for i in range(3)]


@dataclass(frozen=True, eq=False)
class _Edge:
    """From a link to one beside it in the tree of links, downwards to a child or upwards to the parent.

    steps: the joints between, each with its column among the moving ones.
    """

    start: int
    end: int
    child: int
    rotation: Interval
    place: Array
    steps: tuple[tuple[int, JointStep], ...]


@dataclass(frozen=True, eq=False)
class Posed:
    """Where all is in N boxes (N, n, 2), in the first contact's link.

    Attributes:
        poses: of links and `PALM_LINK`. object: the object's rotation, and where its first contact is.
        contact: (N, 3) where that is in the object's own frame. rows: (N, C) of the conditions.
        joints: (N, J) values of the moving joints.
    """

    poses: dict[int, Pose]
    object: Pose
    contact: Dual
    rows: Dual
    joints: Dual

    def some(self, its: Integers) -> Posed:
        """Of some of the boxes."""
        poses = {link: pose.some(its) for link, pose in self.poses.items()}
        return Posed(poses, self.object.some(its), *(a.some(its) for a in (self.contact, self.rows, self.joints)))

    def relative(self, link: int, body: int) -> Pose:
        """The frame of a link in that of another one, or of the `OBJECT_LINK`."""
        back, at, own = *self._back(body), self.poses[link]
        place = rotated(back, own.place - at)
        return Pose(back @ own.rotation, place + self.contact if body == OBJECT_LINK else place)

    def seen(self, link: int, body: int, points: Array) -> Dual:
        """(N, 3) where points (N, 3) [m] of a link are in the frame of another link, or of the `OBJECT_LINK`."""
        n = self.rows.slope.shape[0]
        back, at = self._back(body)
        out = rotated(back, self.poses[link].moved(Dual.constant(Interval.of(points), n)) - at)
        return out + self.contact if body == OBJECT_LINK else out

    def axis(self, at: Pose, step: JointStep) -> tuple[Dual, Dual]:
        """(N, 3) the direction of a joint's axis, and a point on it, of a frame `at` in that of the `OBJECT_LINK`."""
        (back, place), (along, point) = self._back(OBJECT_LINK), step.seen(at)
        return rotated(back, along), rotated(back, point - place) + self.contact

    def _back(self, body: int) -> tuple[Dual, Dual]:
        """(N, 3, 3) into the frame of a body; (N, 3) its origin, of the object its first contact: near what matters."""
        pose = self.object if body == OBJECT_LINK else self.poses[body]
        return pose.rotation.swapped(), pose.place


@dataclass(frozen=True, eq=False)
class ContactBoxes:
    """Boxes of the configurations of some contacts of a task, its constants prepared.

    Attributes:
        task: of these contacts alone. root: (n, 2), the same in each chart. low, high: (C,) bounds of the conditions.
    """

    task: TaskData
    sides: Sides
    edges: tuple[_Edge, ...]
    root: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, task: TaskData) -> ContactBoxes:
        """`Refused` for couplings and limits that contradict each other, links that do not stand at rotations."""
        sides, K = Sides.of(task, TURN_NAMES), len(task.links)
        root = whole(task, sides)
        root[[sides.column[turn] for turn in TURN_NAMES]] = -1.0, 1.0
        limits = task.hand.limits[list(sides.drive.joints)].reshape(-1, 2)
        facing: list[float] = [np.cos(hand.half_angle) - 1e-12 if hand.ball else 0.0 for hand in task.on_hand]
        level = 2 * sum(not hand.ball for hand in task.on_hand)
        bounds = np.concatenate([task.position[_bounded(task.position, np.inf)], task.axes[_bounded(task.axes, 1.0)]])
        low: list[Any] = [np.zeros(3 * (K - 1)), facing, np.zeros(level), limits[:, 0], bounds[:, 0]]
        high: list[Any] = [np.zeros(3 * (K - 1)), np.full(K, np.inf), np.zeros(level), limits[:, 1], bounds[:, 1]]
        return cls(task, sides, _edges(task, sides), root, np.concatenate(low), np.concatenate(high))

    @cached_property
    def turns(self) -> slice:
        """Columns of the rotation."""
        first = self.sides.column[TURN_NAMES[0]]
        return slice(first, first + 3)

    @cached_property
    def placed(self) -> frozenset[int]:
        """The links whose place is known, once these contacts' joints are."""
        return frozenset({self.task.links[0], *(e.end for e in self.edges)}) - {PALM_LINK}

    def at(self, x: Interval, charts: Integers, n: int) -> Posed:
        """Where all is at coordinates (N, m) in charts (N,), with derivatives by n of them: all, or none."""
        sides, joints = self.sides, _with(self.sides.drive.at(x), self._gains(n))
        poses, R = self._poses(joints), self._rotation(x, charts, n)
        hand, thing = sides.hand.at(x), sides.object.at(x)
        at = thing.point + thing.normal * sides.radius
        point, axis, _, _ = (sides.hand.spread(a, n) for a in hand)
        lifted, normal, *tangents = (sides.object.spread(a, n) for a in (at, thing.normal, thing.first, thing.second))
        origin = point[..., 0, :]
        rows, facing, level = [], [], []
        for k, (link, region) in enumerate(zip(self.task.links, self.task.on_hand, strict=True)):
            pose = poses[link]
            if k:
                rows.append(pose.moved(point[..., k, :]) - origin - rotated(R, lifted[..., k, :] - lifted[..., 0, :]))
            # the hand's direction as the object sees it
            seen = rotated(R.swapped(), rotated(pose.rotation, axis[..., k, :]))
            facing.append((dot(seen, normal[..., k, :]) * float(sides.sign[k, 0]))[..., None])
            if not region.ball:
                level += [dot(seen, t[..., k, :])[..., None] for t in tangents]
        rows += facing + level + [joints]
        rows += self._pose_rows(poses, Pose(R, origin), lifted[..., 0, :])
        return Posed(poses, Pose(R, origin), lifted[..., 0, :], join(rows, -1), joints)

    def axes(self, at: Posed, wanted: Collection[int]) -> dict[int, tuple[Dual, Dual]]:
        """Of joints that move the contacts: direction and a point (N, 3) of the axis in the object's frame."""
        out: dict[int, tuple[Dual, Dual]] = {}
        for e in {e.child: e for e in self.edges}.values():
            pose, ahead = at.poses[e.child], [self.sides.drive.joints[column] for column, _ in e.steps]
            for column, step in reversed(e.steps):  # a joint leaves its own axis where it is
                j = ahead.pop()
                if j in wanted:
                    out[j] = at.axis(pose, step)
                if ahead and {*ahead} & {*wanted}:
                    pose = pose.then(step.pose(at.joints[..., column]).inverse)
        return out

    def narrowed(self, box: Array, over: Posed, middle: Posed) -> tuple[Mask, Array, Array]:
        """Which boxes (N, n, 2) may hold a configuration; where in them; what sides change in conditions (N, n, C)."""
        value, bounds = over.rows.value, Interval.between(self.low, self.high)
        within = Interval(np.broadcast_to(bounds.ends, value.ends.shape))
        slope = Interval(over.rows.slope.ends.swapaxes(0, 1))
        alive, kept, changes = narrowed_by(box, box.mean(axis=2), value, middle.rows.value, slope, within)
        # a little wider: a bound that a half only touches would be met or missed by rounding, here or at the checker
        room = SIDE_SLACK * np.ptp(box, axis=2)
        low, high = np.maximum(box[..., 0], kept[..., 0] - room), np.minimum(box[..., 1], kept[..., 1] + room)
        return alive, np.stack([low, high], axis=2), changes

    def _gains(self, n: int) -> Interval:
        """(n, J) by which each coordinate moves each moving joint."""
        drive = self.sides.drive
        ends = np.zeros((n, len(drive.joints), 2))
        if n and len(drive.joints):
            ends[drive.column, np.arange(len(drive.joints))] = drive.gain.ends
        return Interval(ends)

    def _poses(self, joints: Dual) -> dict[int, Pose]:
        n, N = joints.slope.shape[0], joints.value.shape[0]
        out = {self.task.links[0]: Pose.fixed(Interval.of(np.eye(3)), np.zeros(3), N, n)}
        steps: dict[int, Pose] = {}
        for e in self.edges:
            if e.child not in steps:
                steps[e.child] = _edge_pose(e, joints, N, n)
            step = steps[e.child]
            out[e.end] = out[e.start].then(step if e.end == e.child else step.inverse)
        return out

    def _rotation(self, x: Interval, charts: Integers, n: int) -> Dual:
        """(N, 3, 3) of the object, with derivatives."""
        N, rows = len(charts), np.arange(len(charts))[:, None]
        others = np.array([[c for c in range(CHARTS) if c != chart] for chart in range(CHARTS)])[charts]  # (N, 3)
        ends = np.ones((N, 4, 2)) * [-1.0, 1.0]
        ends[rows, others] = x[..., self.turns].ends
        value, by = rotations(Interval(ends))
        slope = np.zeros((n, N, 3, 3, 2))
        if n:
            slope[self.turns] = by.ends[others.T, rows.T]
        return Dual(value, Interval(slope))

    def _pose_rows(self, poses: dict[int, Pose], thing: Pose, contact: Dual) -> list[Dual]:
        """The bounded components of the object's position and axes in the palm frame."""
        position, axes = _bounded(self.task.position, np.inf), _bounded(self.task.axes, 1.0)
        if not (position.any() or axes.any()):
            return []
        there = poses[PALM_LINK].inverse.then(thing)
        place = there.place - rotated(there.rotation, contact)
        turned = [there.rotation[..., i, k][..., None] for k, i in np.argwhere(axes)]
        return [place[..., np.flatnonzero(position)], *turned]


def _bounded(bounds: Array, free: float) -> Mask:
    """Which of bounds (..., 2) forbid anything."""
    return np.asarray((bounds[..., 0] > -free) | (bounds[..., 1] < free))


def _edges(task: TaskData, sides: Sides) -> tuple[_Edge, ...]:
    """From the first contact's link to all links that moving joints place, nearest first."""
    hand, start = task.hand, task.links[0]
    beside: dict[int, list[tuple[int, int]]] = {}
    for child, link in enumerate(hand.links):
        if all(j in sides.drive.joints for j in link.joints):
            beside.setdefault(link.parent, []).append((child, child))
            beside.setdefault(child, []).append((link.parent, child))
    out: list[_Edge] = []
    known, queue = {start}, [start]
    for at in queue:
        for end, child in beside.get(at, []):
            if end not in known:
                known.add(end)
                queue.append(end)
                frame, place = (a[0] for a in frames(hand, np.array([child or -1])))  # the base's is the palm's
                steps = ((sides.drive.joints.index(j), JointStep.of(hand, j)) for j in hand.links[child].joints)
                out.append(_Edge(at, end, child, frame, place.mid[:, 0], tuple(steps)))
    return tuple(out)


def _edge_pose(e: _Edge, joints: Dual, N: int, n: int) -> Pose:
    """Of the child in its parent's frame."""
    pose = Pose.fixed(e.rotation, e.place, N, n)
    for column, step in e.steps:
        pose = pose.then(step.pose(joints[..., column]))
    return pose


def _with(value: Interval, gains: Interval) -> Dual:
    """(N, J) with constant derivatives (n, J)."""
    n, J, _ = gains.ends.shape
    return Dual(value, Interval(np.broadcast_to(gains.ends[:, None], (n, len(value.ends), J, 2))))


def mean_value(over: Dual, middle: Interval, away: Interval) -> tuple[Array, Array]:
    """Lower bounds (N, R) of R functions over N boxes, NaN where nothing is known; (N, R, n) what each side changes.

    Args:
        over: values and derivatives (n, N, R) over the boxes. middle: (N, R) in their middles.
        away: (N, n) of the boxes from their middles.
    """
    changes = Interval(over.slope.ends.transpose(1, 2, 0, 3)) * away[:, None]
    return np.fmax(over.value.lo, (middle + changes.sum()).lo), changes.mag
