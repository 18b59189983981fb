"""Shows with interval arithmetic alone, pose by pose, that a task has no configuration: nothing of the search.

Once the object's pose is given, and the joints that several contacts share, no contact knows of the others. So boxes of
these are halved, and one is discarded where some contact cannot be made in it: boxes of that contact's own joints and
parameters are narrowed by its equations (`contact_equations`), by one row more that adds them up with factors of its
own, and by its bounds, halved as far as it is they and not the pose that blur the equations, and none is left. What a
contact leaves narrows the pose. Its boxes are handed on to both halves, as a smaller pose has no others.

Rotations are quaternions of which one component is 1 and the others are between -1 and 1: each of the four charts is
looked at. The object's origin is where the task bounds it, and no farther than some contact lets it be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from handfast.proofs.configurations import Bounds
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.fields import Array, Integers, Mask
from handfast.proofs.impossibility import MIN_BOX_SHARE, Conditions, Impossibility, narrowed_by, whole
from handfast.proofs.intervals import Interval, join
from handfast.proofs.tasks import TaskData

SINGLE_CONTACT_BOXES = 200_000  # of single contacts that are looked at before the question is left open
POSE_BATCH = 48  # boxes of poses that are looked at together
OWN = 0.5  # a contact's own coordinates are halved until they change its equations by less than this share of the pose
MAX_CONTACT_BOXES = 48  # boxes of a contact beside one box of poses: then the pose is halved first
HALVING_ROUNDS = 6  # of halving them before it is halved, at most
COSINE_ROUNDING = 1e-12  # more than that of a cosine
POSE_RADIAN_LENGTH = 0.05  # [m] that counts as much as a radian
MIN_FACTOR_SHARE = 1e-12  # share of the largest that keeps the factors of a row finite


def impossible_at_every_pose(task: TaskData, *, boxes: int = SINGLE_CONTACT_BOXES) -> Impossibility:
    """Can it be shown that the contacts of the task exclude each other?

    Raises:
        Refused: couplings and limits that contradict each other, links that do not stand at rotations.
    """
    with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which discards nothing
        contacts, stack = _contacts(task), list(_charts(task))
        seen, discarded, narrow = 0, 0.0, np.ptp(stack[0].pose, axis=1)
        while stack and seen < boxes:
            part, stack = stack[-POSE_BATCH:], stack[:-POSE_BATCH]
            poses = np.array([one.pose for one in part])
            reach, alive, left = np.zeros(poses.shape[:2]), np.full(len(part), True), [list(one.own) for one in part]
            for k in sorted(range(len(contacts)), key=lambda k: -contacts[k].decided):
                these = np.flatnonzero(alive)
                if not len(these):
                    break
                looked = contacts[k].left(poses[these], [left[i][k] for i in these.tolist()])
                seen += looked.boxes
                for i, own in zip(these.tolist(), looked.own, strict=True):
                    left[i][k] = own
                poses[these[looked.alive]] = looked.poses[looked.alive]
                reach[these] = np.maximum(reach[these], looked.reach)
                alive[these] = looked.alive
                contacts[k].decided += int((~looked.alive).sum())
            for i, one in enumerate(part):
                if not alive[i]:
                    discarded += one.share
                    continue
                sides = np.ptp(poses[i], axis=1)
                if (sides <= MIN_BOX_SHARE * np.where(narrow > 0, narrow, 1.0)).all():
                    return Impossibility(False, seen, discarded)
                cut = int(np.where(np.isfinite(reach[i]).all(), reach[i], sides).argmax())
                stack += _PoseBox(poses[i], tuple(left[i]), one.share).halves(cut)
        return Impossibility(not stack, seen, 1.0 if not stack else discarded)


@dataclass(frozen=True, eq=False)
class _PoseBox:
    """A box of poses.

    Attributes:
        pose: (d, 2) shared joints, position, quaternion. own: of each contact boxes (., n, 2) of its coordinates.
        share: of the whole.
    """

    pose: Array
    own: tuple[Array, ...]
    share: float

    def halves(self, cut: int) -> list[_PoseBox]:
        """Both halves of a coordinate's side; each has all of the contacts' boxes."""
        low, high = self.pose.copy(), self.pose.copy()
        low[cut, 1] = high[cut, 0] = self.pose[cut].mean()
        return [_PoseBox(half, self.own, self.share / 2) for half in (low, high)]


@dataclass(frozen=True, eq=False)
class _Left:
    """What a contact leaves of B boxes of poses.

    Attributes:
        alive: (B,) bool: may it be made there? poses: (B, d, 2) where in them, if so.
        reach: (B, d) what each side changes of its equations, as a share of what their units are. own: its boxes.
        boxes: how many were looked at.
    """

    alive: Mask
    poses: Array
    reach: Array
    own: list[Array]
    boxes: int


@dataclass(eq=False)
class _Contact:
    """One contact, alone with the pose.

    Attributes:
        equations: of the task of this contact. bounds: of its coordinates, joints, axes and angles.
        root: (n, 2) its coordinates; those of the pose are not used.
        outer: (.,) which of its coordinates belong to the pose; pose: (.,) which of the pose's these are.
        inner: (.,) the others.
        facing: half way between the least cosine of the angle at which hand and object face each other and 1.
        unit: (E + 2,) of its equations, of their sum, and of that cosine.
        decided: boxes of poses in which it cannot be made, so far.
    """

    equations: ContactEquations
    bounds: Bounds
    root: Array
    outer: Integers
    pose: Integers
    inner: Integers
    facing: float
    unit: Array
    decided: int = 0

    @classmethod
    def of(cls, task: TaskData, labels: list[str]) -> _Contact:
        """Of a task with a single contact; labels: of the pose's coordinates."""
        equations = ContactEquations.of(task)
        place = {label: i for i, label in enumerate(labels)}
        columns = list(equations.column)
        outer = [i for i, label in enumerate(columns) if label in place]
        return cls(
            equations,
            Bounds.of(equations),
            whole(task, equations.sides),
            np.array(outer, dtype=np.int64),
            np.array([place[columns[i]] for i in outer], dtype=np.int64),
            np.array([i for i in range(len(columns)) if i not in set(outer)], dtype=np.int64),
            (1.0 + float(np.cos(task.on_hand[0].half_angle) if task.on_hand[0].ball else 0.0)) / 2,
            np.array([POSE_RADIAN_LENGTH] * 3 + [1.0] * (len(equations.rows) - 3) + [np.inf, 1.0]),
        )

    def left(self, poses: Array, own: list[Array]) -> _Left:
        """What is left of boxes of poses (B, d, 2), of boxes (., n, 2) of this contact's coordinates in each."""
        owner = np.repeat(np.arange(len(poses)), [len(x) for x in own])
        work, boxes = self._within(np.concatenate(own), poses[owner]), 0
        done: list[tuple[Array, Integers, Array]] = []
        for turn in range(HALVING_ROUNDS + 1):
            if not len(work):
                break
            boxes += len(work)
            alive, work, reach = self.narrowed(work)
            work, owner, reach = work[alive], owner[alive], reach[alive]
            blur = reach[:, self.inner].max(axis=1, initial=0.0)
            many = np.bincount(owner, minlength=len(poses))
            for _, before, _ in done:
                many += np.bincount(before, minlength=len(poses))
            split = (
                (blur > OWN * reach[:, self.outer].max(axis=1))
                & (many[owner] < MAX_CONTACT_BOXES)
                & (turn < HALVING_ROUNDS)
            )
            done.append((work[~split], owner[~split], reach[~split][:, self.outer]))
            work, owner, reach = work[split], owner[split], reach[split]
            cut = self.inner[reach[:, self.inner].argmax(axis=1)] if len(work) else owner
            halves, each = [work.copy(), work.copy()], np.arange(len(work))
            for end, half in enumerate(halves):
                half[each, cut, 1 - end] = work[each, cut].mean(axis=1)
            work, owner = np.concatenate(halves), np.tile(owner, 2)
        rows, at, reach = (np.concatenate(x) for x in zip(*done, strict=True)) if done else (work, owner, work[..., 0])
        return self._gathered(poses, rows, at, reach, boxes)

    def _within(self, own: Array, poses: Array) -> Array:
        """Boxes (N, n, 2) cut to those of poses (N, d, 2); what is empty then has a lower end above the upper one."""
        out = own.copy()
        its = poses[:, self.pose]
        out[:, self.outer, 0] = np.maximum(own[:, self.outer, 0], its[..., 0])
        out[:, self.outer, 1] = np.minimum(own[:, self.outer, 1], its[..., 1])
        return out

    def _gathered(self, poses: Array, rows: Array, owner: Integers, reach: Array, boxes: int) -> _Left:
        """The boxes that are left, by the box of poses that they belong to."""
        B, d, _ = poses.shape
        counts = np.bincount(owner, minlength=B)
        lower, upper = np.full((B, d), np.inf), np.full((B, d), -np.inf)
        for i, k in zip(self.outer.tolist(), self.pose.tolist(), strict=True):
            np.minimum.at(lower[:, k], owner, rows[:, i, 0])
            np.maximum.at(upper[:, k], owner, rows[:, i, 1])
        hull, far = poses.copy(), np.zeros((B, d))
        hull[:, self.pose] = np.stack([lower, upper], axis=2)[:, self.pose]
        for n, k in enumerate(self.pose.tolist()):
            np.maximum.at(far[:, k], owner, reach[:, n])
        order = np.argsort(owner, kind="stable")
        own = np.split(rows[order], np.cumsum(counts)[:-1])
        return _Left(counts > 0, hull, far, own, boxes)

    def narrowed(self, box: Array) -> tuple[Mask, Array, Array]:
        """Which of boxes (N, n, 2) may hold this contact, where in them, and what each side changes (N, n)."""
        at, middle = self.equations.at(Interval.between(box[..., 0], box[..., 1])), box.mean(axis=2)
        there = self.equations.at(Interval.of(middle))
        here, slope = there.F.value, Interval(at.F.slope.ends.swapaxes(0, 1))  # (N, E), (N, n, E)
        factors = _factors(here.mid, slope.mid, np.ptp(box, axis=2) / 2)
        facing = [x.opposite.value - self.facing for x in (at, there)]  # of unit vectors: at most 1
        value, here = (
            join([x, (x * factors).sum()[:, None], cosine], -1)
            for x, cosine in zip((at.F.value, here), facing, strict=True)
        )
        turning = Interval(at.opposite.slope.ends.swapaxes(0, 1))
        slope = join([slope, (slope * factors[:, None]).sum()[..., None], turning], -1)
        tolerance = np.zeros(value.shape)
        tolerance[:, -1] = 1.0 - self.facing + COSINE_ROUNDING
        alive, kept, reach = narrowed_by(box, middle, value, here, slope, Interval.between(-tolerance, tolerance))
        inside = self.bounds.values(at)
        alive &= ~((inside.lo > self.bounds.upper) | (inside.hi < self.bounds.lower)).any(axis=1)
        return alive, np.where(alive[:, None, None], kept, box), (reach / self.unit).max(axis=2)


def _factors(value: Array, slope: Array, half: Array) -> Array:
    """(N, E) factors with which rows of a value (N, E) and slopes (N, n, E) say most over half sides (N, n).

    Any will do: they are those of the least step, in units of the sides, that would make all rows zero.
    """
    by = slope * half[..., None]
    M = by.swapaxes(1, 2) @ by
    M = M + MIN_FACTOR_SHARE * np.trace(M, axis1=1, axis2=2)[:, None, None] * np.eye(M.shape[-1])
    good = np.isfinite(M).all(axis=(1, 2)) & np.isfinite(value).all(axis=1) & (np.abs(M).max(axis=(1, 2)) > 0)
    M = np.where(good[:, None, None], M, np.eye(M.shape[-1]))
    found = np.linalg.solve(M, np.where(good[:, None], value, 0.0)[..., None])[..., 0]
    most = np.abs(found).max(axis=1, keepdims=True)
    return np.asarray(np.where(most > 0, found / np.where(most > 0, most, 1.0), 0.0))


def _labels(task: TaskData) -> list[str]:
    """The pose's coordinates: joints that several contacts share, position, quaternion."""
    free = [set(task.part([k]).free) for k in range(len(task.links))]
    shared = [j for j in task.free if sum(j in its for its in free) > 1]
    joints = [f"joint:{task.hand.joints[j]}" for j in shared]
    return joints + [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]


def _contacts(task: TaskData) -> list[_Contact]:
    labels = _labels(task)
    return [_Contact.of(task.part([k]), labels) for k in range(len(task.links))]


def _charts(task: TaskData) -> Iterator[_PoseBox]:
    """The whole, by which component of the quaternion is 1."""
    labels, contacts = _labels(task), _contacts(task)
    shared = [task.hand.limits[task.hand.joints.index(x.removeprefix("joint:"))] for x in labels[:-7]]
    position = Conditions.of(task, True).position
    for one in range(4):
        turn = np.array([[1.0, 1.0] if i == one else [-1.0, 1.0] for i in range(4)])
        pose = np.concatenate([np.reshape(shared, (-1, 2)), position, turn])
        own = []
        for contact in contacts:
            box = contact.root.copy()
            box[contact.outer] = pose[contact.pose]
            own.append(box[None])
        yield _PoseBox(pose, tuple(own), 0.25)
