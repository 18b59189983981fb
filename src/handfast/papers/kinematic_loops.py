"""The kinematic loops of a task: rigid bodies between palm and contacts, and the joints that assemble them.

The hand model has one degree of freedom per joint. Here consecutive ones become the joint that they are
together where the body between them carries nothing else (synthesis paper, 3.2): two revolutes with crossing
perpendicular axes a universal joint, a revolute and a prismatic one along one axis a cylindrical joint, three
unlimited revolutes through one point with consecutive axes perpendicular a spherical joint. (With limits the
last is a universal and a revolute joint, which is the same mechanism.) Joints that cannot move, because
their limits are equal or a coupling holds them, and fixed links make bodies one. Fingers without a contact
do not occur; a coupling to a joint outside of the loops passes that joint's limits on if it is the driver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.hand.coupling import driver_ranges, drivers
from handfast.model.hand.hand import Hand, Joint
from handfast.synthesis.task import Task

# [m, unit vectors] axes that miss, or differ in direction, by less are taken for one point or line
AXIS_TOLERANCE = 1e-9
MIN_JOINT_RANGE = 1e-12  # [rad, m] a range narrower than this is none
FULL_TURN = 2 * np.pi - 1e-12  # [rad] a range from here on limits nothing


class Kind(StrEnum):
    """How two bodies are assembled."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    UNIVERSAL = "universal"
    CYLINDRICAL = "cylindrical"
    SPHERICAL = "spherical"


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint that can move: the child's frame in the parent's is place @ joint.motion(value)."""

    joint: int
    place: Array


@dataclass(frozen=True, eq=False)
class Angle:
    """A joint's angle as that between a vector of the parent and one of the child, both normal to its axis.

    One of the two is chosen once and for all; the other one, on the side that turns, depends on the value at
    which the two shall agree.

    Attributes:
        joint: index in the hand.
        lower, upper: [rad] what limits and couplings leave.
        parent_turns: the turning side is the parent's frame, else the child's.
        fixed: (3,) unit, the vector of the other side, in its frame.
        start: (3,) unit, the turning vector for the value `ref`.
        axis: (3,) unit, `start` turns about it by the joint's angle beyond `ref` [rad].
    """

    joint: int
    lower: float
    upper: float
    parent_turns: bool
    fixed: Array
    start: Array
    axis: Array
    ref: float

    def turning(self, value: float) -> Array:
        """(3,) the turning vector that agrees with the fixed one when the joint stands at `value` [rad]."""
        return Joint("", "revolute", self.axis, np.zeros(3), 0.0, 0.0, self.ref).motion(value)[:3, :3] @ self.start

    def vectors(self, value: float) -> tuple[Array, Array]:
        """The parent's and the child's vector (3,) that agree at `value` [rad]."""
        return (self.turning(value), self.fixed) if self.parent_turns else (self.fixed, self.turning(value))

    @property
    def middle(self) -> float:
        """[rad] of the range."""
        return (self.lower + self.upper) / 2


@dataclass(frozen=True, eq=False)
class Assembly:
    """Two bodies and the joint between them.

    Attributes:
        kind: of the joint.
        parent, child: bodies.
        motions: the hand's joints that it stands for, from the palm outwards.
        p, q: (3,) [m] the points that coincide, parent and child frame (along a slide: that differ by it).
        aligned: pairs of unit vectors (parent, child frame) that agree.
        crossed: pairs that are perpendicular.
        slide: index of the joint that travels, along the first aligned vector; None if none does.
        angles: those with limits.
    """

    kind: Kind
    parent: int
    child: int
    motions: tuple[Motion, ...]
    p: Array
    q: Array
    aligned: tuple[tuple[Array, Array], ...] = ()
    crossed: tuple[tuple[Array, Array], ...] = ()
    slide: int | None = None
    angles: tuple[Angle, ...] = ()


@dataclass(frozen=True, eq=False)
class Loops:
    """What closes loops through the object.

    Attributes:
        hand: the task's.
        bodies: names of links, palm first, parents before children; a body's frame is its link's after the last moving
            joint of it.
        assemblies: one per body but the palm, in the order of the bodies.
        carriers: per contact its body and the (4, 4) pose of the touched link in it.
        ranges: (l, 2) what limits and couplings leave to each joint.
        coupled: (joint, driver, ratio, offset): q[joint] = ratio q[driver] + offset, both moving, in the loops.
    """

    hand: Hand
    bodies: tuple[str, ...]
    assemblies: tuple[Assembly, ...]
    carriers: tuple[tuple[int, Array], ...]
    ranges: Array
    coupled: tuple[tuple[int, int, float, float], ...]

    def body_poses(self, q: Array) -> Array:
        """(bodies, 4, 4) frames in the palm frame at a configuration q (l,)."""
        poses = np.tile(np.eye(4), (len(self.bodies), 1, 1))
        for a in self.assemblies:
            T = poses[a.parent]
            for m in a.motions:
                T = T @ m.place @ self.hand.joints[m.joint].motion(q[m.joint])
            poses[a.child] = T
        return poses

    def count(self, kind: Kind) -> int:
        """Number of joints of a kind."""
        return sum(a.kind is kind for a in self.assemblies)


def loops(task: Task) -> Loops:
    """The loops of a task.

    Raises:
        InputError: joints whose limits and couplings leave nothing, by name.
    """
    hand, involved = task.hand, set(task.involved.tolist())
    ranges, follows = _ranges(hand, involved), drivers(hand)
    moving = [j for j in sorted(involved) if ranges[j, 1] - ranges[j, 0] > MIN_JOINT_RANGE]
    needed = {0}
    for end in task.links:
        while end >= 0:
            needed.add(end)
            end = hand.links[end].parent

    names, above = [hand.links[0].name], [-1]
    motions: list[Motion | None] = [None]  # of each body against the one above
    carried: dict[int, tuple[int, Array]] = {}  # link: body, pose in it
    for i in sorted(needed):
        link = hand.links[i]
        body, T = (0, np.eye(4)) if link.parent < 0 else carried[link.parent]
        T = T @ link.pose if link.parent >= 0 else T
        own = [j for j in link.joints if j in moving]
        for j in link.joints:
            if j not in moving:
                T = T @ hand.joints[j].motion(float(ranges[j].mean()))
                continue
            names.append(link.name if j == own[-1] else f"{link.name} before {hand.joints[own[own.index(j) + 1]].name}")
            above.append(body)
            motions.append(Motion(j, T))
            body, T = len(names) - 1, np.eye(4)
        carried[i] = body, T

    touched = {carried[i][0] for i in task.links}
    below = {b: [c for c in range(len(names)) if above[c] == b] for b in range(len(names))}
    bare = {b for b in below if b and b not in touched and len(below[b]) == 1}
    kept, assemblies = {0: 0}, []
    for child in range(1, len(names)):
        if above[child] not in kept:
            continue  # inside of a joint made of several
        chain = [child]
        while chain[-1] in bare and len(chain) < 3:
            chain += below[chain[-1]]
        for n in range(len(chain), 0, -1):
            steps = [m for c in chain[:n] if (m := motions[c]) is not None]
            made = _assembly(hand, ranges, kept[above[child]], len(kept), steps)
            if made is not None:
                kept[chain[n - 1]] = len(kept)
                assemblies.append(made)
                break
    carriers = tuple((kept[carried[i][0]], carried[i][1]) for i in task.links)
    coupled = []
    for n, j in enumerate(moving):
        for k in moving[:n]:
            if follows[j][0] == follows[k][0]:
                ratio = follows[j][1] / follows[k][1]
                coupled.append((j, k, ratio, follows[j][2] - ratio * follows[k][2]))
                break
    return Loops(hand, tuple(names[b] for b in kept), tuple(assemblies), carriers, ranges, tuple(coupled))


def _ranges(hand: Hand, involved: set[int]) -> Array:
    """(l, 2) of each joint: its limits, its driver's and those of all joints with the same driver."""
    follows, names = drivers(hand), hand.joint_names
    ranges = np.array(hand.limits)
    for j, ends in driver_ranges(hand).items():
        ranges[j] = ends
    for j in range(hand.l):
        driver, ratio, offset = follows[j]
        if driver < 0 or not ratio:
            value = offset + (ratio * ranges[driver].mean() if driver >= 0 else 0.0)
            low, high = hand.limits[j]
            if j in involved and not low - MIN_JOINT_RANGE <= value <= high + MIN_JOINT_RANGE:
                raise InputError(f"excludes {value:g}, at which a coupling holds it", field=f"limits.{names[j]}")
            ranges[j] = value
        elif driver != j:
            ranges[j] = np.sort(ratio * ranges[driver] + offset)
    return ranges


# --- what consecutive joints are together -----------------------------------------------------------


def _assembly(hand: Hand, ranges: Array, parent: int, child: int, motions: Sequence[Motion]) -> Assembly | None:
    """The joint that one, two or three moving joints are together; None if they are none."""
    moved = [hand.joints[m.joint] for m in motions]
    match [joint.type for joint in moved]:
        case ["revolute"]:
            return _revolute(ranges, parent, child, motions[0], moved[0])
        case ["prismatic"]:
            return _prismatic(parent, child, motions[0], moved[0])
        case ["revolute", "revolute"]:
            return _universal(ranges, parent, child, motions, moved)
        case ["revolute", "revolute", "revolute"]:
            return _spherical(ranges, parent, child, motions, moved)
        case ["revolute", "prismatic"] | ["prismatic", "revolute"]:
            return _cylindrical(ranges, parent, child, motions, moved)
    return None


def _revolute(ranges: Array, parent: int, child: int, motion: Motion, joint: Joint) -> Assembly:
    R, p = motion.place[:3, :3], _moved(motion.place, joint.anchor)
    e = -normal_frame(joint.axis)[:, 1]
    angle = _angle(ranges, motion.joint, joint, True, e, R @ e, R @ joint.axis)
    return Assembly(
        Kind.REVOLUTE, parent, child, (motion,), p, joint.anchor, ((R @ joint.axis, joint.axis),), angles=angle
    )


def _prismatic(parent: int, child: int, motion: Motion, joint: Joint) -> Assembly:
    R, e = motion.place[:3, :3], -normal_frame(joint.axis)[:, 1]
    pairs = ((R @ joint.axis, joint.axis), (R @ e, e))
    p = motion.place[:3, 3]
    return Assembly(Kind.PRISMATIC, parent, child, (motion,), p, np.zeros(3), pairs, slide=motion.joint)


def _universal(
    ranges: Array, parent: int, child: int, motions: Sequence[Motion], joints: Sequence[Joint]
) -> Assembly | None:
    first, second = motions
    axis = first.place[:3, :3] @ joints[0].axis, second.place[:3, :3] @ joints[1].axis  # parent, middle frame
    center = _crossing(joints[0], axis[1], _moved(second.place, joints[1].anchor))  # middle frame
    if center is None:
        return None
    u, v = axis[0], joints[1].axis
    turned = (
        # the second axis, fixed to the child, turns about the first one with the first angle
        _angle(ranges, first.joint, joints[0], True, v, first.place[:3, :3] @ axis[1], u),
        # the first axis, fixed to the parent, turns backwards about the second one with the second angle
        _angle(ranges, second.joint, joints[1], False, u, second.place[:3, :3].T @ joints[0].axis, -v),
    )
    p, q = _moved(first.place, center), _moved_back(second.place, center)
    motion = (first, second)
    return Assembly(Kind.UNIVERSAL, parent, child, motion, p, q, crossed=((u, v),), angles=turned[0] + turned[1])


def _spherical(
    ranges: Array, parent: int, child: int, motions: Sequence[Motion], joints: Sequence[Joint]
) -> Assembly | None:
    centers = []
    for n in (0, 1):
        place = motions[n + 1].place
        axis = place[:3, :3] @ joints[n + 1].axis
        centers.append(_crossing(joints[n], axis, _moved(place, joints[n + 1].anchor)))
    limited = any(ranges[m.joint, 1] - ranges[m.joint, 0] < FULL_TURN for m in motions)
    if limited or centers[0] is None or centers[1] is None:
        return None
    inward = _moved(motions[1].place, centers[1])  # the second crossing, in the frame of the first
    if np.linalg.norm(inward - centers[0]) > AXIS_TOLERANCE:
        return None
    p, q = _moved(motions[0].place, inward), _moved_back(motions[2].place, centers[1])
    return Assembly(Kind.SPHERICAL, parent, child, tuple(motions), p, q)


def _cylindrical(
    ranges: Array, parent: int, child: int, motions: Sequence[Motion], joints: Sequence[Joint]
) -> Assembly | None:
    first, second = motions
    turn = 0 if joints[0].type == "revolute" else 1
    far = second.place[:3, :3].T @ joints[0].axis  # the first axis in the child's frame
    sign = float(np.sign(far @ joints[1].axis))
    if np.linalg.norm(far - sign * joints[1].axis) > AXIS_TOLERANCE:
        return None
    place = first.place @ second.place
    R = place[:3, :3]
    revolute = joints[turn]
    e = -normal_frame(joints[1].axis)[:, 1]
    # of the turning axis, which has the same direction in every position: a point in the parent's frame, at
    # no travel, and in the child's
    p = _moved(first.place if turn == 0 else place, revolute.anchor)
    q = revolute.anchor if turn else _moved_back(second.place, revolute.anchor)
    along = far if turn else joints[1].axis  # the direction of travel, child frame
    about = far if turn == 0 else joints[1].axis
    angle = _angle(ranges, motions[turn].joint, revolute, True, e, R @ e, R @ about)
    slide = motions[1 - turn].joint
    return Assembly(
        Kind.CYLINDRICAL, parent, child, (first, second), p, q, ((R @ along, along),), slide=slide, angles=angle
    )


def _angle(
    ranges: Array, j: int, joint: Joint, parent_turns: bool, fixed: Array, start: Array, axis: Array
) -> tuple[Angle, ...]:
    """The angle of a joint, none if it has no limits."""
    lower, upper = (float(x) for x in ranges[j])
    if upper - lower >= FULL_TURN:
        return ()
    return (Angle(j, lower, upper, parent_turns, fixed, start, axis, joint.ref),)


def _crossing(joint: Joint, direction: Array, point: Array) -> Array | None:
    """(3,) where the joint's axis meets another line at a right angle; None if it does not."""
    if abs(joint.axis @ direction) > AXIS_TOLERANCE:
        return None
    between = point - joint.anchor
    if abs(between @ np.cross(joint.axis, direction)) > AXIS_TOLERANCE:
        return None
    return joint.anchor + (between @ joint.axis) * joint.axis


def _moved(T: Array, point: Array) -> Array:
    """(3,) a point through a (4, 4) pose."""
    return T[:3, :3] @ point + T[:3, 3]


def _moved_back(T: Array, point: Array) -> Array:
    """(3,) a point through the inverse of a (4, 4) pose."""
    return T[:3, :3].T @ (point - T[:3, 3])
