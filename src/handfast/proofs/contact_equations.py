"""The contact equations of a task in interval arithmetic, with their derivatives.

Coordinates are named by labels:

    joint:NAME           value of a free joint (`TaskData.free`) [rad, m]
    position:0 .. 2      the object's origin in the palm frame [m]
    quaternion:0 .. 3    w, x, y, z of the object in the palm frame, of any length: R = matrix / |q|^2
    contact:K:s, :t      parameters of contact K (from 0) on its object region
    contact:K:u, :v      parameters on its hand region, if that is no cap

On a patch both parameters run from 0 to 1; on a cylinder's side too, over its angles and over its heights. On a
cap, s is the angle from the axis and t the angle around it: direction = frame @ (sin s cos t, sin s sin t, cos s)
from the centre, the frame's third column being the axis a, the first e x a with the coordinate axis e that a is least
along, made of length 1.

Per contact, with the link at (R_k, p_k), the object at (R, p), o and n its point and outward unit normal, o_s and o_t
two tangents:

- a hand cap with centre c, radius r and sign g (-1 if hollow): its outward normal must be -R n, so
  p_k + R_k c = p + R (o + g r n), 3 equations; and -g R n must lie in the cone about R_k axis.
- any other hand region with point h and outward normal m: p_k + R_k h = p + R o, (R_k m) . (R o_s) = 0 and
  (R_k m) . (R o_t) = 0, 5 equations; and (R_k m) . (R n) < 0.

Every float of the task is exact, except where no float can be: rotations and unit vectors are those that Gram-Schmidt
makes of the floats, so that links are rigid and spheres are round.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.proofs.chains import Arms, Drive
from handfast.proofs.fields import Array, Integers
from handfast.proofs.intervals import Dual, Interval, dot, join, sqr
from handfast.proofs.regions import ContactSide
from handfast.proofs.tasks import TaskData


@dataclass(frozen=True, eq=False)
class Values:
    """The equations at N points or boxes.

    Attributes:
        coordinates: (N, n). F: (N, E) equations, with derivatives (n, N, E).
        gap: (N, K, 3) [m] between the contact points.
        joints: (N, J) values of the moving joints.
        position, rotation: (N, 3), (N, 3, 3) of the object.
        point, normal: (N, K, 3) of the object at the contacts, in the palm frame.
        axis: (N, K, 3) of the hand's cap, or its outward normal. opposite: (N, K) `Sides.sign` times axis times
            normal: the cosine of the angle at which hand and object face each other; with derivatives (n, N, K).
    """

    coordinates: Interval
    F: Dual
    gap: Interval
    joints: Interval
    position: Interval
    rotation: Interval
    point: Interval
    normal: Interval
    axis: Interval
    opposite: Dual


@dataclass(frozen=True, eq=False)
class Sides:
    """What a contact joins, its constants prepared: K contacts, n coordinates.

    Attributes:
        column: label -> column of a coordinate.
        radius: (K, 1) sign times radius of a hand cap, else 0. sign: (K, 1) -sign of a hand cap, else -1.
    """

    column: Mapping[str, int]
    drive: Drive
    arms: Arms
    hand: ContactSide
    object: ContactSide
    radius: Array
    sign: Array

    @classmethod
    def of(cls, task: TaskData, placed: list[str]) -> Sides:
        """With coordinates of the object's pose between those of the joints and those of the regions.

        `Refused` for couplings and limits that contradict each other, and links that do not stand at rotations.
        """
        column = {label: n for n, label in enumerate([*(f"joint:{task.hand.joints[j]}" for j in task.free), *placed])}
        where: dict[str, list[list[int]]] = {"st": [], "uv": []}
        for k, hand in enumerate(task.on_hand):
            for names, its in where.items():
                if hand.ball and names == "uv":
                    its.append([-1, -1])
                    continue
                its.append([len(column), len(column) + 1])
                column |= {f"contact:{k}:{name}": n for name, n in zip(names, its[-1], strict=True)}
        drive, (st, uv) = Drive.of(task, column), (np.array(its, dtype=np.int64) for its in where.values())
        arms, caps = Arms.of(task, drive, len(column)), [hand if hand.ball else None for hand in task.on_hand]
        return cls(
            column,
            drive,
            arms,
            ContactSide.of(task.on_hand, uv, still=True),
            ContactSide.of(task.on_object, st, still=False),
            np.array([[c.sign * c.radius if c else 0.0] for c in caps]),
            np.array([[-c.sign if c else -1.0] for c in caps]),
        )

    def on_hand(self, x: Interval, n: int) -> tuple[Dual, Dual]:
        """The hand's points and axes or normals (N, K, 3) in the palm frame, at coordinates (N, n).

        With derivatives by all n coordinates, or with none for n = 0.
        """
        at = self.hand.at(x)
        point, vector, by_joints = self.arms.carry(self.drive.at(x), at.point, at.normal, n)
        moved, turned = (self.hand.spread(a, n) for a in (point, vector))
        return Dual(moved.value, moved.slope + by_joints[0]), Dual(turned.value, turned.slope + by_joints[1])


@dataclass(frozen=True, eq=False)
class ContactEquations:
    """F for one task, its constants prepared. K contacts, n coordinates, E equations.

    Attributes:
        rows: (E,) of the 5 numbers (gap, two tangents) of each contact, or the 3 where no hand region has tangents.
    """

    task: TaskData
    sides: Sides
    rows: Integers

    @classmethod
    def of(cls, task: TaskData) -> ContactEquations:
        """The constants; `Refused` as of `Sides`."""
        placed = [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
        each = 3 if all(hand.ball for hand in task.on_hand) else 5
        rows = [each * k + i for k, hand in enumerate(task.on_hand) for i in range(3 if hand.ball else 5)]
        return cls(task, Sides.of(task, placed), np.array(rows, dtype=np.int64))

    @property
    def column(self) -> Mapping[str, int]:
        """Label -> column of a coordinate: joints, position, quaternion, contacts."""
        return self.sides.column

    @property
    def place(self) -> slice:
        """Columns of the object's position; those of its quaternion follow."""
        return slice(self.column["position:0"], self.column["position:0"] + 3)

    def at(self, x: Interval) -> Values:
        """F and its derivatives at coordinates (N, n)."""
        sides, (N, n), K = self.sides, x.shape, len(self.task.links)
        there, axis = sides.on_hand(x, n)
        R, by_q = rotations(x[..., self.place.stop : self.place.stop + 4])
        at = sides.object.at(x)
        centre = at.point + at.normal * sides.radius
        # as rows of (N, K, ., 3): what touches, normal, tangents if there are equations of these
        tangents = (at.first, at.second) if len(self.rows) > 3 * K else ()
        rows = [sides.object.spread(a, n) for a in (centre, at.normal, *tangents)]
        on_object = join([a[..., None, :] for a in rows], -2)
        back = R.swapped()[:, None]
        turned = Dual(on_object.value @ back, on_object.slope @ back)
        quaternion = slice(self.place.stop, self.place.stop + 4)
        turned.slope.ends[quaternion] = (on_object.value @ by_q.swapped()[:, :, None]).ends
        position = x[..., self.place].reshape(N, 1, 3)
        gap = there - turned[..., 0, :] - position
        gap.slope.ends[self.place] = -np.eye(3)[:, None, None, :, None] * [-1.0, 1.0]
        opposite = dot(axis, turned[..., 1, :]) * sides.sign[:, 0]
        F = gap
        if tangents:
            F = join([gap, dot(axis[..., None, :], turned[..., 2:, :])], -1)
        F = Dual(F.value.reshape(N, -1)[:, self.rows], F.slope.reshape(n, N, -1)[..., self.rows])
        normal = turned.value[..., 1, :]
        point = turned.value[..., 0, :] - normal * sides.radius + position
        return Values(x, F, gap.value, sides.drive.at(x), position[:, 0], R, point, normal, axis.value, opposite)


def rotations(q: Interval) -> tuple[Interval, Interval]:
    """(N, 3, 3) of quaternions (N, 4) of any length, and their derivatives (4, N, 3, 3)."""
    by = (q @ _BILINEAR).reshape(-1, 4, 3, 3)  # of the matrix times the squared length, which is half of q . by
    by = Interval(np.moveaxis(by.ends, 1, 0))
    each = Interval(np.moveaxis(q.ends, 1, 0))[..., None, None]
    length = sqr(q).sum()[:, None, None]
    total = each[0] * by[0] + each[1] * by[1] + each[2] * by[2] + each[3] * by[3]
    R = total * 0.5 / length
    return R, (by - 2.0 * each * R) / length


def _bilinear() -> Array:
    """(4, 36): a quaternion times this are the derivatives (4, 3, 3) of its matrix times its squared length."""
    out = np.zeros((4, 4, 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = i + 1, j + 1, k + 1
        out[0, 0, i, i] = out[a, a, i, i] = 1.0
        out[b, b, i, i] = out[c, c, i, i] = -1.0
        out[b, c, j, k] = out[b, c, k, j] = 2.0
        out[0, a, k, j], out[0, a, j, k] = 2.0, -2.0
    both: Array = out + out.swapaxes(0, 1)
    return both.reshape(4, 36)


_BILINEAR = _bilinear()
