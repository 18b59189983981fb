"""From a task to the chains of joints and the regions that the compiled kernels take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from handfast.core.arrays import Array
from handfast.model.cylinder_side import CylinderSide
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Hand
from handfast.model.region import Bezier, Cap
from handfast.synthesis.task import Task
from handfast.synthesis.task_groups import CAP, CYLINDER, PATCH, PRISMATIC, REVOLUTE, Chains, Regions

NUMBERS = 16  # of a surface that is no patch, at most


class _Chain(NamedTuple):
    motions: list[Array]  # rigid motions (4, 4): before each joint, and after the last
    joints: list[tuple[int, int, float, float]]  # kind, coordinate, ratio, offset


def chains_of(task: Task, free: tuple[int, ...], fixed: Array, unit: float) -> Chains:
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


def regions_of(task: Task, unit: float) -> Regions:
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
    first, numbers = np.zeros(2 * b, dtype=np.intp), np.zeros((2 * b, NUMBERS))
    points: list[Array] = [np.zeros((1, 3))]
    for which, region in enumerate(surfaces):
        match region:
            case Bezier():
                kind[which], degree[which], first[which] = PATCH, region.degree, sum(len(p) for p in points)
                points.append(region.points.reshape(-1, 3) / unit)
            case Cap():  # its frame row by row, its centre and radius
                kind[which] = CAP
                numbers[which, :13] = [*region.frame.ravel(), *(region.center / unit), region.radius / unit]
            case CylinderSide():  # its frame, the lowest point of its axis and radius, first angle, turn and length
                kind[which], lowest = CYLINDER, region.center + region.heights[0] * region.axis
                numbers[which, :13] = [*region.frame.ravel(), *(lowest / unit), region.radius / unit]
                numbers[which, 13:16] = region.angles[0], region.turn, region.length / unit
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
