"""Configurations that meet their task, stored as data, and how far a configuration misses one.

Written for the tests alone, from the definition of a contact (equal points, opposite normals), so that it
shares nothing with the search.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.core.transforms import transform
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.task import Task


@dataclass(frozen=True)
class Feasible:
    """Joint values by name [rad], the object's pose (4, 4) in the palm frame, parameters of each contact.

    Parameters: (s, t) on the object's patch, then (u, v) if the hand's region is a patch too.
    """

    joints: dict[str, float]
    pose: Array
    parameters: list[list[float]]

    @classmethod
    def of(cls, data: dict[str, Any]) -> Feasible:
        turn = Rotation.from_quat(data["quaternion"], scalar_first=True).as_matrix()
        return cls(data["joints"], transform(data["position"], turn), data["parameters"])

    def q(self, task: Task) -> Array:
        """(l,) every joint."""
        return np.array([self.joints[name] for name in task.hand.joint_names])

    def points(self, task: Task) -> Array:
        """(b, 3) [m] contacts on the object, palm frame."""
        pairs = zip(task.contact_pairs, self.parameters, strict=True)
        local = np.array([surface(t.object, p[:2])[0] for t, p in pairs])
        return local @ self.pose[:3, :3].T + self.pose[:3, 3]

    def normals(self, task: Task) -> Array:
        """(b, 3) unit normals of the hand at the contacts, into the object, palm frame."""
        pairs = zip(task.contact_pairs, self.parameters, strict=True)
        return -np.array([surface(t.object, p[:2])[1] for t, p in pairs]) @ self.pose[:3, :3].T

    def slack(self, task: Task) -> float:
        """How far the nearest bound is away: limits of the joints that matter [rad], pose, parameters, cones [rad].

        A joint that moves no contact has only to be within its limits; minus infinity if it is not.
        """
        q, hand = self.q(task), task.hand
        room = [np.inf]
        for j, (lo, hi) in enumerate(hand.limits):
            if j in task.involved and hi > lo:
                room += [q[j] - lo, hi - q[j]]
            elif not lo - 1e-12 <= q[j] <= hi + 1e-12:
                return -np.inf
        at = self.pose[:3, 3]
        for i, (lo, hi) in enumerate(task.pose.position):
            room += [at[i] - lo, hi - at[i]]
        for k, bounds in enumerate(task.pose.axes):
            for i, (lo, hi) in enumerate(bounds):
                room += [self.pose[i, k] - lo] if lo > -1 else []
                room += [hi - self.pose[i, k]] if hi < 1 else []
        for pair, parameters, normal in zip(task.contact_pairs, self.parameters, self.normals(task), strict=True):
            room += [x for p in parameters for x in (p, 1 - p)]
            if isinstance(pair.hand, Cap):
                axis = hand.link_poses(q)[hand.link(pair.link)][:3, :3] @ pair.hand.axis
                room.append(pair.hand.half_angle - np.arccos(np.clip(axis @ normal, -1, 1)))
        return float(min(room))


def missed(task: Task, found: Feasible) -> float:
    """How far the contacts are from met: gaps between the points [m] and sines between the normals, the largest.

    Normals that agree instead of opposing, and couplings that are not kept, count as 1.
    """
    q, hand = found.q(task), task.hand
    poses, worst = hand.link_poses(q), 0.0
    for c in hand.couplings:
        worst = max(worst, abs(q[c.joint] - c.ratio * q[c.driver] - c.offset))
    for pair, parameters, point, normal in zip(
        task.contact_pairs, found.parameters, found.points(task), found.normals(task), strict=True
    ):
        pose = poses[hand.link(pair.link)]
        if isinstance(pair.hand, Cap):  # the cap's point with that normal
            local = pair.hand.center + pair.hand.sign * pair.hand.radius * (pose[:3, :3].T @ normal)
            mine = normal
        else:
            local, n = surface(pair.hand, parameters[2:])
            mine = pose[:3, :3] @ n
        gap = float(np.linalg.norm(pose[:3, :3] @ local + pose[:3, 3] - point))
        sine = float(np.linalg.norm(np.cross(mine, normal))) if mine @ normal > 0 else 1.0
        worst = max(worst, gap, sine)
    return worst


def surface(region: Region, parameters: Any) -> tuple[Array, Array]:
    """Point and unit outward normal of a patch, its own frame."""
    assert isinstance(region, Bezier)
    n = region.normal(*parameters)
    return region.at(*parameters), n / np.linalg.norm(n)
