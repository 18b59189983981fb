"""Problem: a task in minimal coordinates.

Coordinates x, in this order: the free joints (those that move a contact, neither driven by another joint nor
fixed by equal limits), the object's position (3), its unnormalised quaternion (4; w, x, y, z), and for
each contact the parameters s, t of the object region and, if the hand region is no cap, u, v of that one.

Equations, 3 or 5 a contact. A cap on the hand rolls: its centre lies at the distance of its radius from the
object region, along the region's normal, so that points coincide and normals oppose (15), (16) whatever
the direction,

    p_k + R_k c = p + R (o + r n)(s, t)                                                     three,

and any other region on the hand is tangent to the region with coinciding points,

    p_k + R_k h(u, v) = p + R o(s, t),   R_k m . R o_s = 0,   R_k m . R o_t = 0              five.

No equation is redundant, so the solutions have the dimension that the paper's d predicts. Inequalities:
the contact lies within the cap's cone (or the patch normals oppose), the object's axes lie within the
pose bounds. Bounds of x: joint limits (those of mimic joints carried over), pose and [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from handfast.core.arrays import Array
from handfast.model.cylinder_side import RoundSide
from handfast.model.hand.coupling import driver_ranges, drivers
from handfast.model.hand.hand import Hand
from handfast.model.region import Bezier, Cap
from handfast.synthesis.task import Task
from handfast.synthesis.task_groups import (
    CAP_REGION,
    PATCH_REGION,
    PRISMATIC,
    REVOLUTE,
    SIDE_REGION,
    Chains,
    Coordinates,
    Flat,
    Regions,
)

SURFACE_NUMBERS = 19  # of a surface that is no patch, at most


@dataclass(frozen=True, eq=False)
class TaskProblem:
    """A task in minimal coordinates.

    Attributes:
        task: as given.
        free: (nj,) hand joint of each joint coordinate.
        labels: n names, "joint:<name>", "position:0", "quaternion:3", "contact:1:s".
        unit: [m], a power of two: one unit of length in `flat`.
        flat: the arrays for the kernels.
        equations: number of equations.
    """

    task: Task
    free: tuple[int, ...]
    labels: tuple[str, ...]
    unit: float
    flat: Flat
    equations: int

    @classmethod
    def of(cls, task: Task) -> TaskProblem:
        """The problem of a task.

        Raises:
            InputError: joints whose limits and couplings leave nothing, by name.
        """
        hand = task.hand
        follows = drivers(hand)
        ranges = driver_ranges(hand, task.involved.tolist())
        lower, upper = np.array([ranges.get(j, (0.0, 0.0)) for j in range(hand.l)]).T
        driving = sorted({follows[j][0] for j in task.involved.tolist() if follows[j][0] >= 0})
        free = tuple(j for j in driving if lower[j] < upper[j])
        reach = [_reach(hand, link) + t.hand.outermost for link, t in zip(task.links, task.contact_pairs, strict=True)]
        unit = float(2.0 ** np.round(np.log2(max(max(reach), 1e-6))))
        # no contact lets the origin be farther from the palm than it is from the region beyond the hand's reach
        far = min(r + t.object.outermost for r, t in zip(reach, task.contact_pairs, strict=True)) * (1 + 1e-9)
        position = np.clip(task.pose.position, -far, far) / unit
        labels = [f"joint:{hand.joint_names[j]}" for j in free]
        labels += [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
        per = [unit if hand.joints[j].type == "prismatic" else 1.0 for j in free]
        box = [(lower[j] / p, upper[j] / p) for j, p in zip(free, per, strict=True)]
        box += [(lo, hi) for lo, hi in position] + [(-2.0, 2.0)] * 4
        params, rows, row = [], [], 0
        for k, t in enumerate(task.contact_pairs):
            params.append(len(labels))
            rows.append(row)
            names = "st" if t.hand.ball else "stuv"
            labels += [f"contact:{k}:{name}" for name in names]
            box += t.object.search_bounds.tolist() + ([] if t.hand.ball else t.hand.search_bounds.tolist())
            row += 3 if t.hand.ball else 5
        bounds = np.array(box)
        coordinates = Coordinates(
            row=np.array(rows, dtype=np.intp),
            parameter=np.array(params, dtype=np.intp),
            axes=np.array(task.pose.axes.reshape(9, 2)),
            lower=bounds[:, 0].copy(),
            upper=bounds[:, 1].copy(),
        )
        flat = Flat(_chains(task, free, lower, unit), _regions(task, unit), coordinates)
        return cls(task, free, tuple(labels), unit, flat, row)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.labels)

    @cached_property
    def lengths(self) -> Array:
        """(n,) [m] for coordinates that are lengths, 1 for the others: x times this is in SI units."""
        prismatic = {f"joint:{j.name}" for j in self.task.hand.joints if j.type == "prismatic"}
        return np.array([self.unit if v in prismatic or v.startswith("position") else 1.0 for v in self.labels])


def _reach(hand: Hand, link: int) -> float:
    """[m] no point that the link's frame origin can reach lies farther from the palm's origin."""
    reach = 0.0
    while link >= 0:
        joints = [hand.joints[j] for j in hand.links[link].joints]
        reach += float(np.linalg.norm(hand.links[link].pose[:3, 3]))
        for j in joints:
            travel = max(abs(j.lower), abs(j.upper)) if j.type == "prismatic" else 2 * np.linalg.norm(j.anchor)
            reach += float(travel)
        link = hand.links[link].parent
    return reach


# --- the arrays for the kernels -------------------------------------------------------------------


class _Chain(NamedTuple):
    motions: list[Array]  # rigid motions (4, 4): before each joint, and after the last
    joints: list[tuple[int, int, float, float]]  # kind, coordinate, ratio, offset


def _chains(task: Task, free: tuple[int, ...], fixed: Array, unit: float) -> Chains:
    """The chains of a task's links.

    Args:
        free: hand joint of each joint coordinate.
        fixed: (l,) values of the joints that cannot move.
        unit: [m] of length.
    """
    follows = drivers(task.hand)
    chains = [_chain(task.hand, link, follows, free, fixed, unit) for link in task.links]
    b, most = len(chains), max(len(c.joints) for c in chains)
    out = Chains(
        np.array([len(c.joints) for c in chains], dtype=np.intp),
        np.tile(np.eye(3), (b, most + 1, 1, 1)),
        np.zeros((b, most + 1, 3)),
        np.zeros((b, most), dtype=np.intp),
        np.full((b, most), -1, dtype=np.intp),
        np.zeros((b, most)),
        np.zeros((b, most)),
    )
    for k, c in enumerate(chains):
        for i, M in enumerate(c.motions):
            out.rotation[k, i], out.translation[k, i] = M[:3, :3], M[:3, 3]
        for i, joint in enumerate(c.joints):
            out.kind[k, i], out.coordinate[k, i], out.ratio[k, i], out.offset[k, i] = joint
    return out


def _chain(
    hand: Hand,
    link: int,
    follows: dict[int, tuple[int, float, float]],
    free: tuple[int, ...],
    fixed: Array,
    unit: float,
) -> _Chain:
    """Palm to link: joints that cannot move are part of the rigid motions between the others."""
    path: list[int] = []
    while link >= 0:
        path.insert(0, link)
        link = hand.links[link].parent
    motions: list[Array] = []
    joints: list[tuple[int, int, float, float]] = []
    T: Array = np.eye(4)
    for i in path:
        T = T @ hand.links[i].pose if hand.links[i].parent >= 0 else T
        for j in hand.links[i].joints:
            joint = hand.joints[j]
            leader, ratio, offset = follows[j]
            if leader not in free:
                value = ratio * fixed[leader] + offset if leader >= 0 else offset
                T = T @ joint.motion(value)
                continue
            to_axis = np.eye(4)
            to_axis[:3, :3] = _onto_z(joint.axis)
            to_axis[:3, 3] = joint.anchor
            motions.append(T @ to_axis)
            scale = unit if joint.type == "prismatic" else 1.0
            led_by = unit if hand.joints[leader].type == "prismatic" else 1.0
            kind = PRISMATIC if joint.type == "prismatic" else REVOLUTE
            joints.append((kind, free.index(leader), ratio * led_by / scale, (offset - joint.ref) / scale))
            T = np.eye(4)
            T[:3, :3] = to_axis[:3, :3].T
            T[:3, 3] = -to_axis[:3, :3].T @ joint.anchor
    motions.append(T)
    for M in motions:
        M[:3, 3] /= unit
    return _Chain(motions, joints)


def _onto_z(axis: Array) -> Array:
    """(3, 3) a rotation that takes z to the unit vector `axis`."""
    x, y, z = axis.tolist()
    if z < -0.5:  # the formula below divides by 1 + z
        return np.diag([1.0, -1.0, -1.0]) @ _onto_z(np.array([x, -y, -z]))
    f = 1 / (1 + z)
    return np.array([[1 - f * x * x, -f * x * y, x], [-f * x * y, 1 - f * y * y, y], [-x, -y, z]])


def _regions(task: Task, unit: float) -> Regions:
    """The regions of a task's contacts; unit: [m] of length."""
    b = len(task.contact_pairs)
    center, axis = np.zeros((b, 3)), np.zeros((b, 3))
    radius, cone, sign = np.zeros(b), np.full(b, -2.0), np.ones(b)
    for k, t in enumerate(task.contact_pairs):
        if ball := t.hand.ball:
            center[k], axis[k], sign[k] = ball.center / unit, ball.axis, ball.sign
            radius[k] = ball.sign * ball.radius / unit
            cone[k] = np.cos(ball.half_angle) if ball.half_angle < np.pi else -2.0
    surfaces = [*(t.object for t in task.contact_pairs), *(t.hand for t in task.contact_pairs)]
    kind, degree = np.zeros(2 * b, dtype=np.intp), np.zeros((2 * b, 2), dtype=np.intp)
    first, numbers = np.zeros(2 * b, dtype=np.intp), np.zeros((2 * b, SURFACE_NUMBERS))
    points: list[Array] = [np.zeros((1, 3))]
    for which, region in enumerate(surfaces):
        match region:
            case Bezier():
                kind[which], degree[which], first[which] = PATCH_REGION, region.degree, sum(len(p) for p in points)
                points.append(region.points.reshape(-1, 3) / unit)
            case Cap():  # its frame row by row, its centre and radius
                kind[which] = CAP_REGION
                numbers[which, :13] = [*region.frame.ravel(), *(region.center / unit), region.radius / unit]
            case RoundSide():  # its frame, the lowest point of its axis and radius, first angle, turn, length and
                # growth, what of its normal points away from the axis, and along it
                kind[which], lowest = SIDE_REGION, region.center + region.heights[0] * region.axis
                numbers[which, :13] = [*region.frame.ravel(), *(lowest / unit), region.radii[0] / unit]
                numbers[which, 13:15] = region.angles[0], region.turn
                numbers[which, 15:17] = region.length / unit, region.growth / unit
                numbers[which, 17:] = region.length / region.slant, -region.growth / region.slant
            case _:
                raise TypeError(type(region))
    return Regions(
        hand=kind[b:].copy(),
        object=kind[:b].copy(),
        center=center,
        axis=axis,
        radius=radius,
        cone=cone,
        sign=sign,
        degree=degree,
        first=first,
        points=np.vstack(points),
        numbers=numbers,
        face=np.array([region.sign for region in surfaces]),
    )
