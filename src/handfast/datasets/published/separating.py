"""A published grasp made one that can be: hand and object taken apart, and fingers closed onto the object.

Published hands stand some millimetres inside their objects, because they were drawn with soft contacts or other
shapes. Each step linearises the distances of all pairs that are near and solves a least distance problem: the smallest
motion after which none of them is negative. Sizes are lengths: the object's translation, its rotation times its
radius, a joint's motion times the reach of what it moves. Fingers that are short of the object are closed towards where
their motors push them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import cross, nearest_rotation, transform
from handfast.geometry.contacts import THRESHOLD
from handfast.geometry.scene import HandObjectPair, Scene, SelfCollisionPair
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Hand

PAIR_DISTANCE = 2e-3  # [m] pairs nearer than this are watched in a step
TOUCH_DISTANCE = 1e-5  # [m] two surfaces are taken to this distance, so that rounding leaves them apart
CLEAR_DEPTH = 5e-6  # [m] penetration that counts as none
SEPARATION_STEPS = 30
MAX_SEPARATION_STEP = 5e-3  # [m] of a step: further away, the linearised distances say little
FINGER_TOUCH = 2e-5  # [m] a finger this near touches
SEPARATION_CUTOFF = 0.05  # [m] beyond this, distances are not computed
TARGET_LOOKS = 24  # along the way to the target; the search for the touch halves one of these steps
TOUCH_HALVINGS = 14
MAX_LINK_OVERLAP = 1e-4  # [m] by which two links may go deeper into each other
MAX_PUSH = 0.05  # [m] that a gripper pushes an object before it


@dataclass(frozen=True, eq=False)
class Separation:
    """What was done to take a hand and an object apart.

    Attributes:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame.
        before, after: [m] the deepest penetration.
        object_moved: [m] of the object's centre; object_turned: [rad].
        joints_moved: [rad, m] the most that any joint moved.
        surface_moved: [m] the most that any joint's motion moved the hand's surface, at most.
    """

    q: Array
    pose: Array
    before: float
    after: float
    object_moved: float
    object_turned: float
    joints_moved: float
    surface_moved: float

    @property
    def apart(self) -> bool:
        """Whether no penetration is left."""
        return self.after <= CLEAR_DEPTH


class Separator:
    """Takes one hand and one object apart, as often as asked. Not thread-safe; deterministic.

    Attributes:
        scene: of the two.
        reach: (l,) [m] how far what a joint moves is from its axis at most, 1 for a prismatic joint.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, hand = scene, scene.hand
        follows = drivers(hand)
        self.free = [j for j in range(hand.l) if follows[j][0] == j]
        self.spread = np.array([[follows[j][1] * (follows[j][0] == k) for k in self.free] for j in range(hand.l)])
        self.spread = self.spread.reshape(hand.l, len(self.free))
        self.reach = reaches(hand, scene.link_radius)
        body = scene.body
        self.center = body.center_of_mass
        self.radius = float(np.linalg.norm(body.vertices - self.center, axis=1).max())
        lever = np.array([np.linalg.norm(self.reach * self.spread[:, k]) for k in range(len(self.free))])
        self.size = np.r_[np.ones(3), np.full(3, self.radius), np.maximum(lever, 1e-4)]

    def separated(self, q: Array, pose: Array, *, joints: bool = True) -> Separation:
        """The hand at q (l,) and the object at `pose` (4, 4), base frame, moved until nothing penetrates.

        Args:
            joints: whether they may move; else the object alone does.
        """
        start, first = (q, pose), None
        depth = 0.0
        for step in range(SEPARATION_STEPS + 1):
            near, own = self.scene.pairs(q, pose, PAIR_DISTANCE)
            depth = max([0.0, *(-n.distance for n in near)])
            first = depth if first is None else first
            if depth <= CLEAR_DEPTH or step == SEPARATION_STEPS:
                break
            q, pose = self._moved(q, pose, self._step(q, pose, near, own if joints else (), joints))
        moved = np.abs(q - start[0])
        there, here = (p @ np.append(self.center, 1) for p in (pose, start[1]))
        return Separation(
            q,
            pose,
            first or 0.0,
            depth,
            float(np.linalg.norm(there - here)),
            _angle(pose[:3, :3] @ start[1][:3, :3].T),
            float(moved.max(initial=0.0)),
            float((moved * self.reach).max(initial=0.0)),
        )

    def _step(
        self,
        q: Array,
        pose: Array,
        near: Sequence[HandObjectPair],
        own: Sequence[SelfCollisionPair],
        joints: bool,
    ) -> Array:
        """The smallest motion, object's velocity and turn and then the free joints, that is to open all gaps."""
        hand, center = self.scene.hand, pose[:3, :3] @ self.center + pose[:3, 3]
        axes, origins = hand.joint_axes(q)
        rows, least = [], []
        for n in near:
            of_joints = n.normal @ hand.jacobian_about(n.link, n.on_hand, axes, origins) @ self.spread
            rows.append(np.r_[n.normal, cross(n.on_object - center, n.normal), -of_joints * joints])
            least.append(TOUCH_DISTANCE - n.distance)
        for s in own:
            first, second = (
                hand.jacobian_about(link, point, axes, origins)
                for link, point in ((s.first, s.on_first), (s.second, s.on_second))
            )
            rows.append(np.r_[np.zeros(6), s.normal @ (second - first) @ self.spread])
            least.append(min(0.0, -s.distance))  # what overlaps need not part, but goes no deeper
        lower, upper = hand.limits.T
        for k, j in enumerate(self.free):
            for sign, room in ((1.0, q[j] - lower[j]), (-1.0, upper[j] - q[j])):
                rows.append(sign * np.eye(len(self.size))[6 + k])
                least.append(-max(float(room), 0.0))
        x = least_distance(np.array(rows) / self.size, np.array(least))
        largest = float(np.abs(x).max(initial=0.0))
        return x * min(1.0, MAX_SEPARATION_STEP / max(largest, 1e-12)) / self.size

    def _moved(self, q: Array, pose: Array, x: Array) -> tuple[Array, Array]:
        from scipy.spatial.transform import Rotation

        lower, upper = self.scene.hand.limits.T
        q = np.clip(q + self.spread @ x[6:], lower, upper)
        center = pose[:3, :3] @ self.center + pose[:3, 3]
        turn = Rotation.from_rotvec(x[3:6]).as_matrix()
        R = nearest_rotation(turn @ pose[:3, :3])  # many turns in a row drift
        return q, transform(center + x[:3] - R @ self.center, R)


def least_distance(rows: Array, least: Array) -> Array:
    """(n,) the shortest x with rows (m, n) @ x >= least (m,), or nearly so where there is none.

    Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23: one problem with non-negative unknowns.
    """
    from scipy.optimize import nnls

    m, n = rows.shape
    if m == 0 or (least <= 0).all():
        return np.zeros(n)
    scale = float(np.abs(least).max())  # lengths of micrometres are near the solver's tolerance
    E = np.vstack([rows.T, least[None] / scale])
    try:
        u, _ = nnls(E, np.r_[np.zeros(n), 1.0], maxiter=20 * m)
    except RuntimeError:  # it went round in circles
        return _softened(rows, least)
    r = E @ u - np.r_[np.zeros(n), 1.0]
    if abs(r[-1]) < 1e-9:
        return _softened(rows, least)
    return np.asarray(-r[:-1] / r[-1] * scale)


def _softened(rows: Array, least: Array) -> Array:
    """Where no motion opens all gaps: the least squares of what is missing, with a price on the motion."""
    wanted = least > 0
    A = np.vstack([rows[wanted], 0.1 * np.eye(rows.shape[1])])
    return np.asarray(np.linalg.lstsq(A, np.r_[least[wanted], np.zeros(rows.shape[1])], rcond=None)[0])


def reaches(hand: Hand, radius: Array) -> Array:
    """(l,) [m] how far from a hinge's axis what it moves can be, whatever the others do; 1 for a prismatic joint.

    Lengths along the chain are added up, with twice the offset of an axis about which a link's origin turns, and with
    the travel of prismatic joints.

    Args:
        radius: (n_links,) [m] of a sphere about each link's origin that holds its shapes.
    """
    along = np.zeros(len(hand.links))  # from the base to the links' origins
    before = np.zeros(len(hand.links))  # the same, without the link's own joints
    out = np.zeros(hand.l)
    for i, link in enumerate(hand.links):
        if link.parent >= 0:
            before[i] = along[link.parent] + float(np.linalg.norm(link.pose[:3, 3]))
        along[i] = before[i]
        for j in link.joints:
            joint = hand.joints[j]
            slides = joint.type == "prismatic"
            travel = max(abs(joint.lower - joint.ref), abs(joint.upper - joint.ref))
            along[i] += travel if slides else 2 * float(np.linalg.norm(joint.anchor))
    for i in range(len(hand.links)):
        k = i
        while k >= 0:
            for j in hand.links[k].joints:
                anchor = float(np.linalg.norm(hand.joints[j].anchor))
                out[j] = max(out[j], along[i] - before[k] + anchor + radius[i])
            k = hand.links[k].parent
    return np.where([j.type == "prismatic" for j in hand.joints], 1.0, np.maximum(out, 1e-3))


def _angle(R: Array) -> float:
    from scipy.spatial.transform import Rotation

    return float(Rotation.from_matrix(R).magnitude())


@dataclass(frozen=True, eq=False)
class GapsClosed:
    """Where the fingers are that did not touch.

    Attributes:
        q: (l,) configuration.
        closed: [m] the gap of each finger that now touches, by the name of its last link.
        open: [m] the gap of each finger that does not meet the object on its way, or another finger first, as it was.
    """

    q: Array
    closed: dict[str, float]
    open: dict[str, float]


def gaps_closed(scene: Scene, q: Array, pose: Array, target: Array) -> GapsClosed:
    """Move each finger that does not touch along the straight way to its target until it does; else leave it.

    A finger's joints all move in proportion. One that touches with any link stays as it is, and so does one that would
    meet another link of the hand.

    Args:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame.
        target: (l,) configuration, the squeeze of the file or of the mapping.
    """
    hand = scene.hand
    fingers = [f for f in fingers_of(hand) if any(hand.links[i].shapes for i in f[1])]
    joints = [list(j) for j, _ in fingers]
    links = [list(i) for _, i in fingers]
    names = [hand.links[i[-1]].name for i in links]
    way = target - q

    def gaps(t: Array) -> Array:
        at = q.copy()
        for own, share in zip(joints, t, strict=True):
            at[own] += share * way[own]
        distance = scene.distance(at, pose, SEPARATION_CUTOFF)
        return np.array([distance[own].min() for own in links])

    count = len(fingers)
    first = gaps(np.zeros(count)) if count else np.zeros(0)
    moving = np.array(
        [bool(first[k] > FINGER_TOUCH and np.abs(way[joints[k]]).max() > 0) for k in range(count)], dtype=bool
    )
    low, high = np.zeros(count), np.full(count, np.nan)
    for step in range(1, TARGET_LOOKS + 1):
        if not (moving & np.isnan(high)).any():
            break
        t = np.where(moving & np.isnan(high), step / TARGET_LOOKS, 0.0)
        met = (gaps(t) <= FINGER_TOUCH) & (t > 0)
        high[met] = t[met]
        low = np.where((t > 0) & ~met, t, low)
    met = ~np.isnan(high)
    for _ in range(TOUCH_HALVINGS if met.any() else 0):
        middle = np.where(met, (low + high) / 2, 0.0)
        found = gaps(middle)
        low, high = np.where(met & (found > 0), middle, low), np.where(met & (found <= 0), middle, high)
    while True:
        out = q.copy()
        for k in np.flatnonzero(met):
            out[joints[k]] += low[k] * way[joints[k]]
        meeting = _meeting(scene, q, out, pose) if met.any() else set()
        into = met & np.array([bool(meeting.intersection(own)) for own in links], dtype=bool)
        if not into.any():
            break
        met &= ~into
    short = [k for k in range(count) if first[k] > FINGER_TOUCH]
    return GapsClosed(
        out,
        {names[k]: float(first[k]) for k in short if met[k]},
        {names[k]: float(first[k]) for k in short if not met[k]},
    )


def _meeting(scene: Scene, before: Array, after: Array, pose: Array) -> set[int]:
    """Links of pairs of the hand that one configuration puts deeper into each other than another one did."""
    was, now = (scene.clearances(x, pose, MAX_LINK_OVERLAP)[1] for x in (before, after))
    deeper = now < np.minimum(was, 0.0) - MAX_LINK_OVERLAP
    return {link for pair, yes in zip(scene.self_pairs, deeper, strict=True) if yes for link in pair}


def pushed_on(separator: Separator, q: Array, pose: Array, target: Array) -> tuple[Array, Array, float]:
    """A gripper closed on, from where it first touches: it pushes the object before it until that is held.

    The joints go straight towards their target in steps that are halved where the object cannot give way; it gives
    way by the least motion. What was pushed to the target without being held by a second link stays where it was.

    Args:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame; target: (l,).

    Returns:
        configuration, object's pose, and how far its centre was pushed [m].
    """
    scene, first = separator.scene, (q, pose)
    if (scene.distance(q, pose, SEPARATION_CUTOFF) <= THRESHOLD).sum() != 1:
        return q, pose, 0.0
    way, t, step, moved = target - q, 0.0, 1 / TARGET_LOOKS, 0.0
    while step > 2.0**-TOUCH_HALVINGS and t < 1 and moved < MAX_PUSH:
        further = q + min(1.0, t + step) * way
        done = separator.separated(further, pose, joints=False)
        if done.apart:
            t, pose = min(1.0, t + step), done.pose
            moved += done.object_moved
        else:
            step /= 2
    held = (scene.distance(q + t * way, pose, SEPARATION_CUTOFF) <= THRESHOLD).sum() > 1
    return (q + t * way, pose, moved) if held else (*first, 0.0)


def fingers_of(hand: Hand) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Joints and links of each finger; one begins at the first joint that not all of them share.

    Fingers whose joints are coupled, or driven by one motor, count as one.
    """
    chains = [hand.moved_by(i) for i in range(len(hand.links))]
    moving = [i for i, chain in enumerate(chains) if chain]
    last = [i for i in moving if not any(hand.links[k].parent == i for k in moving)]
    shared = set(chains[last[0]]).intersection(*(chains[i] for i in last)) if len(last) > 1 else set()
    groups = [set(chains[i]) - shared for i in last]
    rows = np.vstack([hand.mechanism.R, hand.mechanism.A]) != 0
    groups += [{int(j) for j in np.flatnonzero(row)} - shared for row in rows]
    merged: list[set[int]] = []
    for group in groups:
        joined = [g for g in merged if g & group]
        merged = [g for g in merged if not g & group] + [group.union(*joined)]
    found = []
    for group in sorted((g for g in merged if g), key=min):
        own = tuple(i for i in moving if set(chains[i]) & group)
        if own:
            found.append((tuple(sorted(group)), own))
    return found
