"""Joints and links in interval arithmetic: from coordinates to where a contact's link is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.model.hand.hand import Coupling
from handfast.synthesis.certify.existence import ProofRefused, moving_joints
from handfast.synthesis.certify.interval_arithmetic import (
    TINY,
    ULP,
    Dual,
    Interval,
    columns,
    cos,
    cross,
    dot,
    join,
    sin,
    unit,
)
from handfast.synthesis.task import Task

CROOKED = 1e-12  # by which the floats of a link's rotation may miss a rotation


@dataclass(frozen=True, eq=False)
class Drive:
    """How the coordinates set the moving joints: value = gain * coordinate + shift.

    Attributes:
        joints: (J,) indices into the hand's joints.
        column: (J,) the coordinate; where the gain is 0, any.
        gain, shift: (J,).
    """

    joints: tuple[int, ...]
    column: Indices
    gain: Interval
    shift: Interval

    @classmethod
    def of(cls, task: Task, column: Mapping[str, int]) -> Drive:
        """`ProofRefused` if a joint that its limits fix would have to move or to stand elsewhere."""
        if not len(task.involved):
            return cls((), np.zeros(0, dtype=np.intp), Interval.of(np.zeros(0)), Interval.of(np.zeros(0)))
        moving = moving_joints(task)
        lead, gain, shift = zip(*(_driven(task, j, path, column) for j, path in moving.items()), strict=True)
        return cls(tuple(moving), np.array(lead, dtype=np.intp), join(gain, -1), join(shift, -1))

    def at(self, x: Dual) -> Dual:
        """(N, J) joint values at coordinates (N, n)."""
        return x[..., self.column] * self.gain + self.shift


def _driven(task: Task, j: int, path: Sequence[Coupling], column: Mapping[str, int]) -> tuple[int, Interval, Interval]:
    """Column, gain (1,) and shift (1,) of a joint that the couplings of `path` tie to the one that drives it."""
    joint, driver = task.hand.joints[j], path[-1].driver if path else j
    gain, shift, size = Interval.of([1.0]), Interval.of([0.0]), 0.0
    for c in path:  # q = gain q' + shift and q' = ratio q" + offset
        shift = gain * c.offset + shift
        size += float(gain.mag[0]) * abs(c.offset)
        gain = gain * c.ratio
    if driver >= 0:
        first = task.hand.joints[driver]
        if f"joint:{first.name}" in column:
            if joint.lower == joint.upper:
                raise ProofRefused(
                    f"joint {joint.name} is fixed by its limits, but follows {first.name}, which is free"
                )
            return column[f"joint:{first.name}"], gain, shift
        shift = gain * first.lower + shift
        size += float(gain.mag[0]) * abs(first.lower)
    if joint.lower == joint.upper:
        if not np.abs(shift.mid[0] - joint.lower) <= 16 * ULP * size + 16 * TINY:
            stands = f"{joint.lower:.9g} by its limits, at {shift.mid[0]:.9g} by its coupling"
            raise ProofRefused(f"joint {joint.name} is fixed at {stands}")
        # the two agree but for rounding: whichever is meant, a solution exists
        shift = Interval(np.minimum(shift.lo, joint.lower), np.maximum(shift.hi, joint.lower))
    return 0, Interval.of([0.0]), shift if path else Interval.of([joint.lower])


@dataclass(frozen=True, eq=False)
class Arms:
    """The links of the contacts, as chains of S different steps: a fixed frame, then a joint's motion.

    Attributes:
        chain: (K, D) steps from the palm outwards; step 0 stands still and fills up short chains.
        joint: (S,) column of the joint's value in (N, J).
        ref: (S,) its value at which it stands at the frame.
        R, p: (S, 3, 3), (S, 3, 1) the frame in the one before.
        turn, turn_twice: (S, 3, 3) cross product matrix of a revolute joint's axis and its square; else 0.
        slide: (S, 3, 1) a prismatic joint's axis; else 0.
        anchor: (S, 3, 1) a point of a revolute joint's axis; else 0.
    """

    chain: Indices
    joint: Indices
    ref: Array
    R: Interval
    p: Interval
    turn: Interval
    turn_twice: Interval
    slide: Interval
    anchor: Array

    @classmethod
    def of(cls, task: Task, joints: Sequence[int]) -> Arms:
        """`ProofRefused` for a link whose frame is not rotated rigidly."""
        hand, frames = task.hand, _frames(task)
        steps: dict[tuple[int, int], int] = {(-1, -1): 0}  # a joint and -1, or -1 and the link that ends a chain
        identity = Interval.of(np.eye(4)[:3])
        poses, chains = [identity], []
        for end in task.links:
            path, link = [], end
            while link >= 0:
                path.append(link)
                link = hand.links[link].parent
            pose, chain = identity, []
            for link in reversed(path):
                pose = _compose(pose, frames[link]) if link in frames else pose
                passed = [(j, -1) for j in hand.links[link].joints]
                if link == end and not passed and pose is not identity:
                    passed = [(-1, end)]
                for step in passed:
                    if step not in steps:
                        steps[step] = len(steps)
                        poses.append(pose)
                    chain.append(steps[step])
                    pose = identity
            chains.append(chain)
        depth = max(len(chain) for chain in chains)
        turning, sliding, anchor = (np.zeros((len(steps), 3)) for _ in range(3))
        ref, column = np.zeros(len(steps)), np.zeros(len(steps), dtype=np.intp)
        for (j, _), n in steps.items():
            if j >= 0:
                joint, revolute = hand.joints[j], hand.joints[j].type == "revolute"
                (turning if revolute else sliding)[n] = joint.axis
                anchor[n] = joint.anchor if revolute else 0.0
                ref[n], column[n] = joint.ref, joints.index(j)
        axis, pose = _unit_or_zero(turning), join([p[None] for p in poses], -3)
        turn = cross(axis[:, None, :], Interval.of(np.eye(3))).swapped()  # columns axis x e_i
        return cls(
            np.array([chain + [0] * (depth - len(chain)) for chain in chains], dtype=np.intp),
            column,
            ref,
            pose[..., :3],
            pose[..., 3:],
            turn,
            turn @ turn,
            _unit_or_zero(sliding)[..., None],
            anchor[..., None],
        )

    def carry(self, joints: Dual, point: Dual, vector: Dual) -> Dual:
        """(N, K, 3, 2) points and vectors (N, K, 3) of the contacts' links, in the palm frame."""
        if joints.value.shape[1]:
            by = joints[..., self.joint] - self.ref
            s, c = sin(by)[..., None, None], cos(by)[..., None, None]
            motion = s * self.turn + (1.0 - c) * self.turn_twice + np.eye(3)
            away = self.anchor - motion @ self.anchor + by[..., None, None] * self.slide
            R, p = self.R @ motion, self.R @ away + self.p
        else:
            n = joints.slope.shape[0]
            R, p = (Dual.constant(a.reshape(1, *a.shape), n) for a in (self.R, self.p))
        carried = columns([point, vector])
        for d in reversed(range(self.chain.shape[1])):
            at = self.chain[:, d]
            carried = R[..., at, :, :] @ carried + p[..., at, :, :] * np.array([1.0, 0.0])
        return carried


def _frames(task: Task) -> dict[int, Interval]:
    """(3, 4) of the links between the palm and the contacts, those exactly at their parent's left out."""
    hand, links = task.hand, set()
    for end in task.links:
        while end >= 0 and end not in links:
            links.add(end)
            end = hand.links[end].parent
    # the base's own pose moves nothing: the palm frame is the base's
    moved = [i for i in sorted(links) if hand.links[i].parent >= 0 and (hand.links[i].pose != np.eye(4)).any()]
    if not moved:
        return {}
    pose = np.array([hand.links[i].pose for i in moved])
    R = orthonormal(pose[:, :3, 0], pose[:, :3, 1])
    crooked = np.abs(R.mid - pose[:, :3, :3]).max(axis=(1, 2))
    for i, by in zip(moved, crooked, strict=True):
        if not by <= CROOKED:
            raise ProofRefused(f"link {hand.links[i].name} does not stand at a rotation, but {by:.3g} off one")
    frames = join([R, Interval.of(pose[:, :3, 3:])], -1)
    return {i: frames[n] for n, i in enumerate(moved)}


def _compose(a: Interval, b: Interval) -> Interval:
    """(3, 4) frame b in frame a."""
    return join([a[:, :3] @ b[:, :3], a[:, :3] @ b[:, 3:] + a[:, 3:]], -1)


def orthonormal(first: Array, second: Array) -> Interval:
    """(n, 3, 3) rotations with column 0 along `first` (n, 3), column 1 as near to `second` as can be."""
    x, y = unit(Interval.of(first)), Interval.of(second)
    y = unit(y - dot(x, y)[:, None] * x)
    return columns([x, y, cross(x, y)])


def _unit_or_zero(a: Array) -> Interval:
    """(n, 3) unit vectors along the rows of a, 0 where they are 0."""
    zero = (a == 0).all(axis=1, keepdims=True)
    u = unit(Interval.of(np.where(zero, 1.0, a)))
    return Interval(np.where(zero, 0.0, u.lo), np.where(zero, 0.0, u.hi))
