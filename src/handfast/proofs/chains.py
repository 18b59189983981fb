"""Joints and links in interval arithmetic: from coordinates to where a contact's link is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handfast.proofs.fields import Array, Integers
from handfast.proofs.intervals import (
    MACHINE_EPSILON,
    UNDERFLOW_BOUND,
    Dual,
    Interval,
    cos,
    crossing,
    join,
    orthonormal,
    sin,
    unit,
)
from handfast.proofs.replay import Refused
from handfast.proofs.tasks import CouplingData, HandData, TaskData

LINK_ROTATION_ERROR = 1e-12  # by which the floats of a link's rotation may miss a rotation


@dataclass(frozen=True, eq=False)
class Drive:
    """How the coordinates set the moving joints: value = gain * coordinate + shift.

    Attributes:
        joints: (J,) indices into the hand's joints.
        column: (J,) the coordinate; where the gain is 0, any.
        gain, shift: (J,).
    """

    joints: tuple[int, ...]
    column: Integers
    gain: Interval
    shift: Interval

    @classmethod
    def of(cls, task: TaskData, column: Mapping[str, int]) -> Drive:
        """`Refused` if a joint that its limits fix would have to move or to stand elsewhere."""
        none = Interval.of(np.zeros(0))
        driven = [(0, none, none), *(_driven(task, j, path, column) for j, path in task.moving.items())]
        lead, gain, shift = zip(*driven, strict=True)
        return cls(tuple(task.moving), np.array(lead[1:], dtype=np.int64), join(gain, -1), join(shift, -1))

    def at(self, x: Interval) -> Interval:
        """(N, J) joint values at coordinates (N, n)."""
        return x[..., self.column] * self.gain + self.shift


def _driven(
    task: TaskData, j: int, path: Sequence[CouplingData], column: Mapping[str, int]
) -> tuple[int, Interval, Interval]:
    """Column, gain (1,) and shift (1,) of a joint that the couplings of `path` tie to the one that drives it."""
    hand, driver = task.hand, path[-1].driver if path else j
    (lower, upper), name = hand.limits[j].tolist(), hand.joints[j]
    gain, shift, size = Interval.of([1.0]), Interval.of([0.0]), 0.0
    for c in path:  # q = gain q' + shift and q' = ratio q" + offset
        shift = gain * c.offset + shift
        size += float(gain.mag[0]) * abs(c.offset)
        gain = gain * c.ratio
    if driver >= 0:
        lead, first = hand.joints[driver], float(hand.limits[driver, 0])
        if f"joint:{lead}" in column:
            if lower == upper:
                raise Refused(f"joint {name} is fixed by its limits, but follows {lead}, which is free")
            return column[f"joint:{lead}"], gain, shift
        shift = gain * first + shift
        size += float(gain.mag[0]) * abs(first)
    if lower == upper and path:
        rounding = 16 * MACHINE_EPSILON * size + 16 * UNDERFLOW_BOUND
        if not (np.abs(shift.mid[0] - lower) <= rounding and (shift - lower).mag[0] <= task.tolerance(j)):
            stands = f"{lower:.9g} by its limits, at {shift.mid[0]:.9g} by its coupling"
            raise Refused(f"joint {name} is fixed at {stands}")
        # the two agree but for rounding: whichever is meant, a solution exists
        shift = Interval.between(np.minimum(shift.lo, lower), np.maximum(shift.hi, lower))
    return 0, Interval.of([0.0]), shift if path else Interval.of([lower])


def joint_rates(hand: HandData, own: Array) -> Interval:
    """(N, l) how fast all joints move where those that no coupling drives move at own (N, l); exactly 0 where none do.

    What own says of coupled joints does not count.
    """
    out = []
    for j in range(len(hand.joints)):
        path = hand.driving(j)
        rate = Interval.of(own[:, path[-1].driver if path else j] * (not path or path[-1].driver >= 0))
        still = (rate.ends == 0).all(axis=1) | any(c.ratio == 0 for c in path)
        for c in path:
            rate = rate * c.ratio
        out.append(Interval(np.where(still[:, None], 0.0, rate.ends))[:, None])
    return join(out, -1)


@dataclass(frozen=True, eq=False)
class Arms:
    """The links of the contacts, as chains of S different steps: a fixed frame, then a joint's motion.

    A step moves x, in a link, to frame (anchor + turned (x - anchor) + by * slide) + p, where the joint is at
    ref + by, and turned is 1 + sin(by) T + (1 - cos(by)) T T with the cross product matrix T of its axis.

    Attributes:
        chain: (K, D) steps from the palm outwards; step 0 stands still and fills up short chains.
        joint: (S,) column of the joint's value in (N, J). ref: (S,) its value at which it stands at the frame.
        frame, first, second: (S, 3, 3) rotation of the frame, frame T, frame T T; the last two 0 for a prismatic joint.
        anchor: (S, 3, 1) a point of a revolute joint's axis; else 0.
        axis: (S, 3, 3) frame T, turned back: the cross product matrix of a revolute joint's axis after the frame.
        slide: (S, 3, 1) a prismatic joint's axis after the frame; else 0.
        place: (S, 3, 1) frame anchor + p.
        gain: (K, D, n) by which each coordinate moves the joint of each step.
    """

    chain: Integers
    joint: Integers
    ref: Array
    frame: Interval
    first: Interval
    second: Interval
    anchor: Array
    axis: Interval
    slide: Interval
    place: Interval
    gain: Interval

    @classmethod
    def of(cls, task: TaskData, drive: Drive, n: int) -> Arms:
        """For n coordinates; `Refused` for a link whose frame is not rotated rigidly."""
        hand = task.hand
        paths = [[i for i in hand.path(end) if hand.links[i].parent >= 0 or hand.links[i].joints] for end in task.links]
        steps: dict[tuple[int, int], int] = {(-1, -1): 0}  # a link with its frame, or -1, and a joint, or -1
        chains = []
        for path in paths:
            chain: list[int] = []
            for link in path:
                passed = hand.links[link].joints or (-1,)
                for m, j in enumerate(passed):
                    # the base's own pose moves nothing: the palm frame is the base's
                    framed = link if m == 0 and hand.links[link].parent >= 0 else -1
                    chain.append(steps.setdefault((framed, j), len(steps)))
            chains.append(chain)
        links, joints = np.array(list(steps)).T
        frame, p = frames(hand, links)
        depth = max(len(chain) for chain in chains)
        moved, S = joints >= 0, len(joints)
        axis, anchor, ref, column = np.zeros((S, 3)), np.zeros((S, 3)), np.zeros(S), np.zeros(S, dtype=np.int64)
        revolute = np.zeros(S, dtype=bool)
        if moved.any():
            its = joints[moved]
            axis[moved], ref[moved], revolute[moved] = hand.axes[its], hand.ref[its], hand.revolute[its]
            column[moved] = [drive.joints.index(j) for j in its.tolist()]
            anchor[revolute] = hand.anchors[joints[revolute]]
        direction = unit_or_zero(axis)
        turning, sliding = (Interval(direction.ends * some[:, None, None]) for some in (revolute, ~revolute))
        first = frame @ crossing(turning)
        steps_of = np.array([c + [0] * (depth - len(c)) for c in chains], dtype=np.int64).reshape(len(chains), depth)
        gain = np.zeros((*steps_of.shape, n, 2))
        k, d = np.nonzero(moved[steps_of])
        led = column[steps_of[k, d]]
        gain[k, d, drive.column[led]] = drive.gain.ends[led]
        after = first @ frame.swapped()
        turns = frame, first, after @ first, anchor[..., None], after
        return cls(
            steps_of, column, ref, *turns, frame @ sliding[..., None], frame @ anchor[..., None] + p, Interval(gain)
        )

    def carry(self, joints: Interval, point: Dual, vector: Dual, n: int) -> tuple[Dual, Dual, Interval]:
        """Points and vectors (N, K, 3) of the contacts' links in the palm frame, at joint values (N, J).

        Returns:
            Both, with derivatives (2, N, K, 3) by what they depend on in the link; (2, n, N, K, 3) the derivatives of
            both by the n coordinates, as far as these move joints; by none for n = 0.
        """
        R, by = self.frame[None], Interval(np.zeros((1, len(self.ref), 2)))
        if joints.shape[1]:
            by = joints[..., self.joint] - self.ref
            s, c = sin(by)[..., None, None], cos(by)[..., None, None]
            R = self.frame + s * self.first + (1.0 - c) * self.second
        out = (by[..., None, None] * self.slide + self.place)[:, self.chain]
        R, axis, slide = R[:, self.chain], self.axis[self.chain], self.slide[self.chain]
        # from one step's anchor to the next one's
        nearer = self.anchor[np.pad(self.chain, ((0, 0), (1, 0)))]
        shift = out - nearer[:, :-1]
        # columns: the point, the vector, both by the two parameters, both by the joint of each step so far
        parts = [a[..., None] for a in (point.value, vector.value)]
        parts += [Interval(np.moveaxis(a.slope.ends, 0, -2)) for a in (point, vector)]
        x, D = join([parts[0] - nearer[:, -1], *parts[1:]], -1), self.chain.shape[1]
        for d in reversed(range(D)):
            x = R[:, :, d] @ x
            turned = axis[:, d] @ x[..., :2]
            x = join([x[..., :1] + shift[:, :, d], x[..., 1:], turned[..., :1] + slide[:, d], turned[..., 1:]], -1)
        local = Interval(np.moveaxis(x.ends[..., 2:6, :], -2, 0))
        steps = x.ends[..., 6:, :].reshape(*x.shape[:3], D, 2, 2)[..., ::-1, :, :]  # (N, K, 3, D, 2) from the palm
        by_all = Interval(np.moveaxis(steps, -2, 0)) @ self.gain[..., :n]  # (2, N, K, 3, n)
        by_all = Interval(np.moveaxis(by_all.ends, -2, 1))
        return Dual(x[..., 0], local[:2]), Dual(x[..., 1], local[2:]), by_all


@dataclass(frozen=True, eq=False)
class Pose:
    """Frames of N boxes: rotation (N, 3, 3) and place (N, 3), with derivatives."""

    rotation: Dual
    place: Dual

    @classmethod
    def fixed(cls, rotation: Interval, place: Array, N: int, n: int) -> Pose:
        """One (3, 3), (3,) that depends on none of n variables, N times."""
        return cls(_tiled(rotation, N, n), _tiled(Interval.of(place), N, n))

    def then(self, other: Pose) -> Pose:
        """The frame that stands at `other` in this one."""
        return Pose(self.rotation @ other.rotation, self.moved(other.place))

    @property
    def inverse(self) -> Pose:
        """This frame's parent, as it stands in this one."""
        back = self.rotation.swapped()
        return Pose(back, -rotated(back, self.place))

    def moved(self, x: Dual) -> Dual:
        """Points (N, 3) of this frame in its parent."""
        return rotated(self.rotation, x) + self.place

    def some(self, its: Integers) -> Pose:
        """Of some of the boxes."""
        return Pose(self.rotation.some(its), self.place.some(its))


@dataclass(frozen=True, eq=False)
class JointStep:
    """A joint in the frame of its link; `turn` and `twice`: its axis as a cross product matrix, and that squared."""

    ref: float
    revolute: bool
    axis: Interval
    turn: Interval
    twice: Interval
    anchor: Array

    @classmethod
    def of(cls, hand: HandData, j: int) -> JointStep:
        axis = unit(Interval.of(hand.axes[j][None]))[0]
        turn = crossing(axis)
        return cls(float(hand.ref[j]), bool(hand.revolute[j]), axis, turn, turn @ turn, hand.anchors[j])

    def pose(self, value: Dual, *, back: bool = False) -> Pose:
        """Where the joint at values (N,) has moved its link, in the frame before it; back: that frame in the link's."""
        n, N = value.slope.shape[0], value.value.shape[0]
        by = self.ref - value if back else value - self.ref
        eye = Interval.of(np.eye(3))
        if not self.revolute:
            return Pose(_tiled(eye, N, n), by[..., None] * self.axis)
        s, c = sin(by)[..., None, None], cos(by)[..., None, None]
        rotation, anchor = s * self.turn + (1.0 - c) * self.twice + eye, _tiled(Interval.of(self.anchor), N, n)
        return Pose(rotation, anchor - rotated(rotation, anchor))

    def seen(self, at: Pose) -> tuple[Dual, Dual]:
        """(N, 3) the direction of its axis, and a point on it, in the parent of a frame."""
        n, N = at.place.slope.shape[0], at.place.value.shape[0]
        return rotated(at.rotation, _tiled(self.axis, N, n)), at.moved(_tiled(Interval.of(self.anchor), N, n))


def _tiled(x: Interval, N: int, n: int) -> Dual:
    """The same N times, with n derivatives of 0."""
    return Dual.constant(Interval(np.broadcast_to(x.ends, (N, *x.ends.shape))), n)


def rotated(R: Dual, x: Dual) -> Dual:
    """(N, 3) vectors turned by matrices (N, 3, 3)."""
    return (R * x[..., None, :]).sum()


def frames(hand: HandData, links: Array) -> tuple[Interval, Interval]:
    """(S, 3, 3) and (S, 3, 1) of the frames of links; at its place for a link that is -1."""
    poses = np.where((links >= 0)[:, None, None], hand.poses[links], np.eye(4))
    R = orthonormal(poses[:, :3, 0], poses[:, :3, 1])
    crooked = np.abs(R.mid - poses[:, :3, :3]).max(axis=(1, 2))
    for i, by in zip(links.tolist(), crooked.tolist(), strict=True):
        if not by <= LINK_ROTATION_ERROR:
            raise Refused(f"link {hand.links[i].name} does not stand at a rotation, but {by:.3g} off one")
    upright = (poses[:, :3, :3] == np.eye(3)).all(axis=(1, 2))[:, None, None, None]
    return Interval(np.where(upright, Interval.of(np.eye(3)).ends, R.ends)), Interval.of(poses[:, :3, 3:])


def unit_or_zero(a: Array) -> Interval:
    """(n, 3) unit vectors along the rows of a, 0 where they are 0."""
    zero = (a == 0).all(axis=1, keepdims=True)
    u = unit(Interval.of(np.where(zero, 1.0, a)))
    return Interval(np.where(zero[..., None], 0.0, u.ends))
