"""A configuration that meets a task, and the proof that an exact one is next to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.shown import Shown
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.configuration import Configuration
from handfast.proofs.configurations import Existence
from handfast.proofs.replay import Replay
from handfast.synthesis.existence import verify_existence
from handfast.synthesis.placed import whole
from handfast.synthesis.task import Task


@dataclass(frozen=True, eq=False)
class Solution(Shown):
    """A configuration of the hand and the object, and the proof that an exact one is next to it.

    Attributes:
        task: the question.
        existence: the floats, and the box about them that contains an exact configuration.
        q: (l,) every joint of the hand [rad, m]; those that move no contact are as near to 0 as their
            limits allow.
        pose: (4, 4) of the object in the palm frame.
        points: (b, 3) [m] the contacts, palm frame.
        normals: (b, 3) outward unit normals of the hand there, palm frame: they point into the object.
    """

    task: Task = field(repr=False)
    existence: Existence = field(repr=False)
    q: Array
    pose: Array
    points: Array
    normals: Array

    @classmethod
    def of(cls, task: Task, proof: Existence) -> Solution:
        """The configuration at the floats of a proof."""
        q = whole(task, proof.joints)
        pose = transform(proof.position, quaternion_matrix(proof.quaternion / np.linalg.norm(proof.quaternion)))
        points, normals = [], []
        for pair, spot in zip(task.contact_pairs, proof.contacts, strict=True):
            points.append(pose[:3, :3] @ pair.object.at(*spot.object) + pose[:3, 3])
            normals.append(-pose[:3, :3] @ pair.object.outward(*spot.object))
        b = len(task.contact_pairs)
        return cls(
            task,
            proof,
            frozen(q, (task.hand.l,), "q"),
            frozen(pose, (4, 4), "pose"),
            frozen(points, (b, 3), "points"),
            frozen(normals, (b, 3), "normals"),
        )

    @cached_property
    def slacks(self) -> Mapping[str, float]:
        """How far each bound is away, by label.

        "joint:NAME" [rad, m], "position:0" [m], "x_axis:0" [-, a component], "contact:0:s" [-, a share
        of the region's side; rad on a cap], "contact:0:cone" [rad].
        """
        return MappingProxyType(_slacks(self.task, self.existence, self.q, self.pose, self.normals))

    @property
    def joints(self) -> dict[str, float]:
        """`q` by joint name [rad, m]."""
        return self.task.hand.values(self.q)

    @property
    def configuration(self) -> Configuration:
        """The same as a `handfast/configuration/1` file, ready to be saved."""
        named = {"hand": self.task.hand.source or self.task.hand.name, "object": self.task.object}
        return Configuration.of(self.task.hand, self.q, self.pose, **named)

    def verify(self) -> Replay:
        """The proof, checked with interval arithmetic by code that knows nothing of the search."""
        return verify_existence(self.task, self.existence)

    def to_json(self) -> dict[str, Any]:
        placed = self.configuration.object_pose
        return {
            "joints": self.joints,
            "object_pose": {"position": list(placed.position), "quaternion": list(placed.quaternion)},
            "contacts": [
                {"link": t.link, "point": p, "normal": n}
                for t, p, n in zip(self.task.contact_pairs, self.points.tolist(), self.normals.tolist(), strict=True)
            ],
            "slacks": dict(self.slacks),
            "existence": self.existence.to_json(),
        }


def _slacks(task: Task, proof: Existence, q: Array, pose: Array, normals: Array) -> dict[str, float]:
    hand, out = task.hand, {}
    for j in task.moving:
        joint = hand.joints[j]
        if joint.lower < joint.upper:
            out[f"joint:{joint.name}"] = min(q[j] - joint.lower, joint.upper - q[j])
    for i, (lo, hi) in enumerate(task.pose.position):
        if np.isfinite(lo) or np.isfinite(hi):
            out[f"position:{i}"] = min(pose[i, 3] - lo, hi - pose[i, 3])
    for k, bounds in enumerate(task.pose.axes):
        for i, (lo, hi) in enumerate(bounds.tolist()):
            ends = [pose[i, k] - lo] * (lo > -1) + [hi - pose[i, k]] * (hi < 1)
            if ends:
                out[f"{'xyz'[k]}_axis:{i}"] = min(ends)
    links = hand.link_poses(q)
    for n, (pair, spot) in enumerate(zip(task.contact_pairs, proof.contacts, strict=True)):
        for region, names, values in ((pair.object, "st", spot.object), (pair.hand, "uv", spot.hand)):
            if not region.ball and values is not None:
                out |= {f"contact:{n}:{name}": min(x, 1 - x) for name, x in zip(names, values, strict=True)}
        if (ball := pair.object.ball) and ball.half_angle < np.pi:
            out[f"contact:{n}:s"] = ball.half_angle - abs(spot.object[0])
        if (ball := pair.hand.ball) and ball.half_angle < np.pi:
            axis = links[hand.link(pair.link), :3, :3] @ ball.axis
            out[f"contact:{n}:cone"] = ball.half_angle - _angle(axis, ball.sign * normals[n])
    return {label: float(slack) for label, slack in out.items()}


def _angle(a: Array, b: Array) -> float:
    """[rad] between two unit vectors."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
