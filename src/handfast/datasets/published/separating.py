"""A published grasp made one that can be: the object and the joints moved by as little as takes them apart.

Published hands stand some millimetres inside their objects, because they were drawn with soft contacts or other
shapes. Each step linearises the distances of all pairs that are near and solves a least distance problem: the smallest
motion after which none of them is negative. Sizes are lengths: the object's translation, its rotation times its
radius, a joint's motion times the reach of what it moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import cross, transform
from handfast.geometry.scene import HandObjectPair, Scene, SelfCollisionPair
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Hand

NEAR = 2e-3  # [m] pairs nearer than this are watched in a step
TOUCH = 1e-5  # [m] two surfaces are taken to this distance, so that rounding leaves them apart
CLEAR = 5e-6  # [m] penetration that counts as none
STEPS = 30
LARGEST = 5e-3  # [m] of a step: further away, the linearised distances say little


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
        return self.after <= CLEAR


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
        for step in range(STEPS + 1):
            near, own = self.scene.pairs(q, pose, NEAR)
            depth = max([0.0, *(-n.distance for n in near)])
            first = depth if first is None else first
            if depth <= CLEAR or step == STEPS:
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
            least.append(TOUCH - n.distance)
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
        return x * min(1.0, LARGEST / max(largest, 1e-12)) / self.size

    def _moved(self, q: Array, pose: Array, x: Array) -> tuple[Array, Array]:
        from scipy.spatial.transform import Rotation

        lower, upper = self.scene.hand.limits.T
        q = np.clip(q + self.spread @ x[6:], lower, upper)
        center = pose[:3, :3] @ self.center + pose[:3, 3]
        turn = Rotation.from_rotvec(x[3:6]).as_matrix()
        R = turn @ pose[:3, :3]
        u, _, vt = np.linalg.svd(R)  # many turns in a row drift
        R = u @ vt
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
