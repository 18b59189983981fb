"""The contact equations of a task in interval arithmetic, with their derivatives; see `verify_existence`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.synthesis.certify.chains import Arms, Drive
from handfast.synthesis.certify.existence import ProofRefused, free_joints
from handfast.synthesis.certify.interval_arithmetic import Dual, Interval, columns, join
from handfast.synthesis.certify.regions import ContactSide
from handfast.synthesis.task import Task


@dataclass(frozen=True, eq=False)
class Values:
    """The equations at the floats (first) and over the box (second).

    Attributes:
        F: (2, E) equations. gap: (K, 3) [m] between the contact points, at the floats.
        joints: (2, J) values of the moving joints.
        rotation: (2, 3, 3) of the object.
        facing: (2, K) hand axis or normal times the object's normal.
    """

    F: Dual
    gap: Interval
    joints: Interval
    rotation: Interval
    facing: Interval


@dataclass(frozen=True, eq=False)
class Equations:
    """F for one task, its constants prepared. K contacts, N coordinates, E equations.

    Attributes:
        column: label -> column of a coordinate; the order of joints, position, quaternion, contacts.
        rows: (E,) of the 5 K numbers (gap, two tangents) per contact.
        radius: (K, 1) sign times radius of a hand cap, 0 for a patch.
    """

    task: Task
    column: Mapping[str, int]
    rows: Indices
    drive: Drive
    arms: Arms
    hand: ContactSide
    object: ContactSide
    radius: Array

    @property
    def count(self) -> int:
        """E."""
        return len(self.rows)

    def columns(self, first: str, count: int) -> slice:
        """Of `count` coordinates from the one with this label on."""
        return slice(self.column[first], self.column[first] + count)

    def at(self, coordinates: Interval, slope: Interval) -> Values:
        """F at coordinates (2, N) with derivatives (E, 2, N)."""
        x, K = Dual(coordinates, slope), len(self.task.contact_pairs)
        joints = self.drive.at(x)
        on_hand = self.arms.carry(joints, *self.hand.at(x)[:2])  # (2, K, 3, 2)
        R = _rotation(x[..., self.columns("quaternion:0", 4)])
        point, normal, first, second = self.object.at(x)
        on_object = R.reshape(2, 1, 3, 3) @ columns([point + normal * self.radius, first, second, normal])
        position = x[..., self.columns("position:0", 3)].reshape(2, 1, 3)
        gap = on_hand[..., 0] - position - on_object[..., 0]
        along = (on_hand[..., 1].reshape(2, K, 1, 3) @ on_object[..., 1:])[..., 0, :]
        F = join([gap, along[..., :2]], -1).reshape(2, 5 * K)[..., self.rows]
        return Values(F, gap.value[0], joints.value, R.value, along.value[..., 2])


@lru_cache(maxsize=16)
def equations_of(task: Task) -> Equations:
    """The constants; `ProofRefused` for a task in which no proof could hold."""
    _refuse_impossible(task)
    labels = [f"joint:{name}" for name in free_joints(task)]
    labels += [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
    rows: list[int] = []
    for k, pair in enumerate(task.contact_pairs):
        labels += [f"contact:{k}:{name}" for name in ("st" if pair.hand.ball else "stuv")]
        rows += range(5 * k, 5 * k + (3 if pair.hand.ball else 5))
    column = {label: n for n, label in enumerate(labels)}
    balls = [t.hand.ball for t in task.contact_pairs]
    radius = [ball.sign * ball.radius if ball else 0.0 for ball in balls]
    drive = Drive.of(task, column)
    return Equations(
        task,
        column,
        np.array(rows, dtype=np.intp),
        drive,
        Arms.of(task, drive.joints),
        ContactSide.of([t.hand for t in task.contact_pairs], "uv", column, still=True),
        ContactSide.of([t.object for t in task.contact_pairs], "st", column, still=False),
        np.array(radius)[:, None],
    )


def _refuse_impossible(task: Task) -> None:
    for i, (lo, hi) in enumerate(task.pose.position):
        if lo == hi:
            raise ProofRefused(f"pose.position[{i}] is bounded to {lo:g} alone; nothing lies strictly inside")
    for k, i in np.argwhere(task.pose.axes[..., 0] == task.pose.axes[..., 1]).tolist():
        only = task.pose.axes[k, i, 0]
        raise ProofRefused(f"pose.{'xyz'[k]}_axis[{i}] is bounded to {only:g} alone; nothing lies strictly inside")


def _rotation(q: Dual) -> Dual:
    """(2, 3, 3) of quaternions (2, 4) of any length."""
    products = q[..., :, None] * q[..., None, :]
    length = products[..., range(4), range(4)].sum()
    return (products.reshape(2, 1, 16) @ QUADRATICS).reshape(2, 3, 3) / length[..., None, None]


def _quadratics() -> Array:
    """(16, 9): a quaternion's products times this are its matrix times the squared length."""
    out = np.zeros((4, 4, 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = i + 1, j + 1, k + 1
        out[0, 0, i, i] = out[a, a, i, i] = 1.0
        out[b, b, i, i] = out[c, c, i, i] = -1.0
        out[b, c, j, k] = out[b, c, k, j] = 2.0
        out[0, a, k, j], out[0, a, j, k] = 2.0, -2.0
    return out.reshape(16, 9)


QUADRATICS = _quadratics()
