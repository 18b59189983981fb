"""The contact equations written again, with other formulas, for float arrays and for balls of any precision."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.cylinder_side import RoundSide
from handfast.model.hand import Hand
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.task import Task


def contact_equations(task: Task, labels: list[str], x: Array) -> Array:
    """(B, E) at coordinates (B, N) in the order of `labels`; floats or, in object arrays, balls."""
    hand, one = task.hand, x[:, 0] * 0 + 1
    at = {label: x[:, n] for n, label in enumerate(labels)}
    poses = link_poses(hand, joint_values(hand, at, one), one)
    w, *v = (at[f"quaternion:{i}"] for i in range(4))
    length = w * w + sum(c * c for c in v)
    # R y = y + 2 w v x y + 2 v x (v x y) for a unit quaternion
    V = _cross_matrix(np.stack(v, -1))
    R = np.eye(3) + 2 * (_times(V, w) + V @ V) / length[:, None, None]
    position = np.stack([at[f"position:{i}"] for i in range(3)], -1)
    out = []
    for k, pair in enumerate(task.contact_pairs):
        R_k, p_k = poses[task.links[k]]
        o, n, tangents = surface_at(pair.object, at[f"contact:{k}:s"], at[f"contact:{k}:t"])
        if isinstance(pair.hand, Cap):
            here = pair.hand.center + one[:, None] * 0
            there = o + pair.hand.sign * pair.hand.radius * n
        else:
            here, m, _ = surface_at(pair.hand, at[f"contact:{k}:u"], at[f"contact:{k}:v"])
            there = o
        out += [*(_apply(R_k, here) + p_k - position - _apply(R, there)).T]
        if not isinstance(pair.hand, Cap):
            out += [(_apply(R_k, m) * _apply(R, tangent)).sum(axis=-1) for tangent in tangents]
    return np.stack(out, -1)


def joint_values(hand: Hand, at: dict, one: Array) -> dict[int, Array]:
    q = {}
    for j, joint in enumerate(hand.joints):
        if f"joint:{joint.name}" in at:
            q[j] = at[f"joint:{joint.name}"]
        elif joint.lower == joint.upper:
            q[j] = joint.lower * one
    q |= {c.joint: c.offset * one for c in hand.couplings if c.driver < 0}
    for _ in hand.couplings:
        q |= {c.joint: c.ratio * q[c.driver] + c.offset for c in hand.couplings if c.driver in q}
    return q


def link_poses(hand: Hand, q: dict[int, Array], one: Array) -> list[tuple[Array, Array] | None]:
    eye, poses = np.eye(3) * one[:, None, None], []
    for link in hand.links:
        if not set(link.joints) <= set(q) or (link.parent >= 0 and poses[link.parent] is None):  # no contact there
            poses.append(None)
            continue
        R, p = poses[link.parent] if link.parent >= 0 else (eye, eye[:, 0] * 0)
        if link.parent >= 0:
            p = p + _apply(R, link.pose[:3, 3])
            x, y = (link.pose[:3, i] * one[:, None] for i in (0, 1))
            x = _normalised(x)
            y = _normalised(y - _times(x, (x * y).sum(axis=-1)))
            R = R @ np.stack([x, y, _product(x, y)], -1)
        for j in link.joints:
            joint, axis = hand.joints[j], _normalised(hand.joints[j].axis * one[:, None])
            value = q[j] - joint.ref
            if joint.type == "prismatic":
                p = p + _apply(R, _times(axis, value))
                continue
            # in the axis and across it, instead of with the squared cross product matrix
            along = axis[:, :, None] * axis[:, None, :]
            turn = _times(eye - along, np.cos(value)) + along + _times(_cross_matrix(axis), np.sin(value))
            p = p + _apply(R, joint.anchor - _apply(turn, joint.anchor))
            R = R @ turn
        poses.append((R, p))
    return poses


def surface_at(region: Region, s: Array, t: Array) -> tuple[Array, Array, list[Array]]:
    """Point, outward unit normal and two tangents."""
    if isinstance(region, Bezier):
        return patch_at(region.points, region.sign, s, t)
    if isinstance(region, RoundSide):
        return side_at(region, s, t)
    axis = _normalised(region.axis + 0 * s[:, None])
    e1 = region.frame[:, 0] + 0 * s[:, None]
    e1 = _normalised(e1 - _times(axis, (axis * e1).sum(axis=-1)))
    e2 = _product(axis, e1)
    out = _times(e1, np.cos(t)) + _times(e2, np.sin(t))
    direction = _times(out, np.sin(s)) + _times(axis, np.cos(s))
    tangents = [_times(out, np.cos(s)) - _times(axis, np.sin(s)), _times(e2, np.cos(t)) - _times(e1, np.sin(t))]
    return region.center + region.radius * direction, region.sign * direction, tangents


def side_at(side: RoundSide, s: Array, t: Array) -> tuple[Array, Array, list[Array]]:
    axis = _normalised(side.axis + 0 * s[:, None])
    e1 = side.x_axis + 0 * s[:, None]
    e1 = _normalised(e1 - _times(axis, (axis * e1).sum(axis=-1)))
    (first, last), (low, high) = side.angles, side.heights
    angle, height = first * (1 - s) + last * s, low * (1 - t) + high * t
    around = _times(_product(axis, e1), np.sin(angle))
    out = _times(e1, np.cos(angle)) + around
    foot, (start, end) = side.center + _times(axis, height), side.radii
    up = (high - low) * axis + (end - start) * out
    normal = _normalised((high - low) * out - (end - start) * axis)
    return foot + _times(out, start * (1 - t) + end * t), side.sign * normal, [_product(axis, out), up]


def patch_at(points: Array, sign: float, s: Array, t: Array) -> tuple[Array, Array, list[Array]]:
    points = points + 0 * s[:, None, None, None]
    first, second = ((points.shape[a] - 1) * np.diff(points, axis=a) for a in (1, 2))
    tangents = [_casteljau(p, s, t) for p in (first, second)]
    return _casteljau(points, s, t), sign * _normalised(_product(*tangents)), tangents


def _casteljau(points: Array, s: Array, t: Array) -> Array:
    while points.shape[1] > 1:
        points = points[:, :-1] + _times(np.diff(points, axis=1), s)
    while points.shape[2] > 1:
        points = points[:, :, :-1] + _times(np.diff(points, axis=2), t)
    return points[:, 0, 0]


def _times(a: Array, factor: Array) -> Array:
    """(B, ...) times (B,)."""
    return a * factor.reshape(-1, *[1] * (a.ndim - 1))


def _apply(R: Array, x: Array) -> Array:
    return (R * np.broadcast_to(x, (len(R), 3))[:, None, :]).sum(axis=-1)


def _product(a: Array, b: Array) -> Array:
    return np.stack([a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)], -1)


def _cross_matrix(a: Array) -> Array:
    x, y, z = a.T
    return np.stack([np.stack(row, -1) for row in ((0 * x, -z, y), (z, 0 * x, -x), (-y, x, 0 * x))], -2)


def _normalised(a: Array) -> Array:
    return a / np.sqrt((a * a).sum(axis=-1))[:, None]
