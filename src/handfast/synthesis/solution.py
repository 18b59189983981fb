"""A configuration that meets a task, and the proof that an exact one is next to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.presented import Presented
from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.curvature import curvature_at, relative_curvature
from handfast.model.configuration import Configuration
from handfast.model.hand.coupling import coupled, driver_ranges
from handfast.proofs.configurations import Existence, check_configuration, read_existence
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import Task


@dataclass(frozen=True, eq=False)
class Solution(Presented):
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


def relative_curvatures(solution: Solution) -> Array:
    """(b,) [1/m] the relative curvature at each contact of a configuration; negative: the surfaces interpenetrate.

    Raises:
        InputError: a patch without a normal at a contact (the contact is named).
    """
    task, proof = solution.task, solution.existence
    links, out = task.hand.link_poses(solution.q), []
    for k, (pair, spot, n) in enumerate(zip(task.contact_pairs, proof.contacts, solution.normals, strict=True)):
        hand, its = links[task.hand.link(pair.link), :3, :3], solution.pose[:3, :3]
        try:
            K_hand = curvature_at(pair.hand, spot.hand, hand, n)
            K_object = curvature_at(pair.object, spot.object, its, n)
        except InputError as fault:
            raise fault.within(f"contacts[{k}]") from None
        out.append(relative_curvature(K_hand, K_object, n))
    return frozen(out, (len(out),), "curvature")


def whole(task: Task, joints: Mapping[str, float]) -> Array:
    """(l,) all joint values from those of the free joints; unused joints as near to 0 as their limits allow."""
    hand, free = task.hand, task.free
    q = np.zeros(hand.l)
    for j, (lower, upper) in driver_ranges(hand).items():
        name = hand.joint_names[j]
        q[j] = joints[name] if name in free else np.clip(0.0, lower, upper)
    return coupled(hand, q)


# --- proofs beside tasks: read from files, and checked by `proofs/` on the numbers that a file would hold ---


def verify_existence(task: Task, proof: Existence) -> Replay:
    """Does an exact configuration of the task exist in the box of the proof? See `check_configuration`."""
    try:
        return check_configuration(_equations_of(task), proof)
    except Refused as fault:
        return Replay("configuration", refused=str(fault))


def misplaced(task: Task, joints: Mapping[str, float], proof: Existence) -> str:
    """Which of all joints of the hand is not where it is proved, or breaks a limit or a coupling; '' if none."""
    return _equations_of(task).task.misplaced(joints, proof.joints)


def existence_from_dict(data: Any) -> Existence:
    """The proof in a parsed object; raises `InputError` with field and fault."""
    try:
        return read_existence(data)
    except BadFile as fault:
        raise InputError(fault.problem, field=fault.field or None) from None


@lru_cache(maxsize=16)
def _equations_of(task: Task) -> ContactEquations:
    return ContactEquations.of(read_task(task_to_dict(task)))
