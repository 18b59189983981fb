"""What a synthesis answers: configurations with their proofs, or that there is none, or neither."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from handfast.core.answer import Checked, Reach, Stop, header
from handfast.core.arrays import Array, frozen
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.configuration import Configuration
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.certify.existence import Existence, existence_to_dict, moving_joints
from handfast.synthesis.certify.verify_existence import Report, verify_existence
from handfast.synthesis.distance import features
from handfast.synthesis.placed import whole
from handfast.synthesis.task import Task


@dataclass(frozen=True, eq=False)
class Solution:
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
        for touch, spot in zip(task.touches, proof.contacts, strict=True):
            point, normal = point_and_normal(touch.object, *spot.object)
            points.append(pose[:3, :3] @ point + pose[:3, 3])
            normals.append(-pose[:3, :3] @ normal)
        b = len(task.touches)
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

        "joint:NAME" [rad, m], "position:0" [m], "x_axis:0" [-, a component], "contact:0:s" [-, of a patch's
        side; rad on a cap], "contact:0:cone" [rad].
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

    def verify(self) -> Report:
        """The proof, checked with interval arithmetic by code that knows nothing of the search."""
        return verify_existence(self.task, self.existence)

    def to_json(self) -> dict[str, Any]:
        placed = self.configuration.object_pose
        return {
            "joints": self.joints,
            "object_pose": {"position": list(placed.position), "quaternion": list(placed.quaternion)},
            "contacts": [
                {"link": t.link, "point": p, "normal": n}
                for t, p, n in zip(self.task.touches, self.points.tolist(), self.normals.tolist(), strict=True)
            ],
            "slacks": dict(self.slacks),
            "existence": existence_to_dict(self.existence),
        }


@dataclass(frozen=True)
class Searched:
    """How far the search for a contradiction came.

    Attributes:
        by: the contacts that cannot go together, or those that are nearest to that, in words.
        nodes: boxes examined.
        discarded: share of the space that no configuration is in, by verified arithmetic.
        depth: of the search tree.
        pending: boxes left.
        smallest, largest: [rad, -] widest side of the smallest and of the largest of them.
    """

    by: str
    nodes: int
    discarded: float
    depth: int
    pending: int
    smallest: float
    largest: float

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class Replayed(Checked):
    """Proofs of existence that were checked.

    Attributes:
        reports: one for each configuration.
        seconds: wall time.
        reason: why it is not all proved: one line; '' if it is.
    """

    reports: tuple[Report, ...]
    seconds: float
    reason: str

    def to_json(self) -> dict[str, Any]:
        return self._json(
            {
                "configurations": [
                    {
                        "ok": r.ok,
                        "contraction": _finite(r.contraction),
                        "gap": _finite(r.gap),
                        "reason": r.reasons[0] if r.reasons else "",
                    }
                    for r in self.reports
                ],
            }
        )


@dataclass(frozen=True, eq=False)
class Synthesis:
    """Can the hand take the hold?

    Attributes:
        task: the question.
        verdict: FOUND with certified configurations; NONE if every part of the space was discarded; else
            UNDECIDED.
        stop: why the search ended.
        seconds: wall time.
        starts: random starts of the local search; unproved: candidates that could not be certified and are
            not returned.
        solutions: the configurations; several are ordered so that each differs most from those before it.
        searched: of the search for a contradiction; None if it did not come to that.
        seed: of the random numbers.
        state: what a later call needs to go on if UNDECIDED, else {}.
    """

    task: Task = field(repr=False)
    verdict: Reach
    stop: Stop
    seconds: float
    starts: int
    unproved: int
    solutions: tuple[Solution, ...] = field(repr=False)
    searched: Searched | None
    seed: int
    state: Mapping[str, Any] = field(repr=False)

    @property
    def nodes(self) -> int:
        """Boxes that the search for a contradiction examined."""
        return self.searched.nodes if self.searched else 0

    @cached_property
    def spread(self) -> float | None:
        """The smallest distance of two of the configurations, see `distance`; None for fewer than two."""
        at = features(self.solutions)
        gaps = [np.linalg.norm(at[i] - at[:i], axis=1).min() for i in range(1, len(at))]
        return float(min(gaps)) if gaps else None

    def verify(self) -> Replayed:
        """Every proof of existence, checked by `verify_existence` and nothing else."""
        start = time.monotonic()
        reports = tuple(solution.verify() for solution in self.solutions)
        refused = [(i, r.reasons[0]) for i, r in enumerate(reports) if not r.ok]
        reason = f"configuration {refused[0][0]}: {refused[0][1]}" if refused else ""
        if self.verdict is Reach.FOUND and not reports:
            reason = "FOUND without a configuration"
        elif self.verdict is not Reach.FOUND and reports:
            reason = f"{self.verdict.upper()} with a configuration"
        elif self.verdict is Reach.NONE:
            reason = "NONE has no proof that can be replayed: it rests on the search itself, ask it again"
        return Replayed(reports, time.monotonic() - start, reason)

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return header(self, "synthesize") | {
            "starts": self.starts,
            "unproved": self.unproved,
            "seed": self.seed,
            "spread": self.spread,
            "configurations": [solution.to_json() for solution in self.solutions],
            "searched": self.searched.to_json() if self.searched else None,
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/synthesis/1` file, for `handfast.verify` and for going on.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        from handfast.synthesis import result_file

        result_file.save_synthesis(self, path, force=force)


# --- geometry ---------------------------------------------------------------------------------------


def point_and_normal(region: Region, s: float, t: float) -> tuple[Array, Array]:
    """(3,) [m] and (3,) outward unit normal of a region at its parameters."""
    if isinstance(region, Bezier):
        normal = region.normal(s, t)
        return region.at(s, t), normal / np.linalg.norm(normal)
    direction = region.frame @ [np.sin(s) * np.cos(t), np.sin(s) * np.sin(t), np.cos(s)]
    return region.point(direction), region.sign * direction


def _slacks(task: Task, proof: Existence, q: Array, pose: Array, normals: Array) -> dict[str, float]:
    hand, out = task.hand, {}
    for j in moving_joints(task):
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
    for n, (touch, spot) in enumerate(zip(task.touches, proof.contacts, strict=True)):
        for region, names, values in ((touch.object, "st", spot.object), (touch.hand, "uv", spot.hand)):
            if isinstance(region, Bezier) and values is not None:
                out |= {f"contact:{n}:{name}": min(x, 1 - x) for name, x in zip(names, values, strict=True)}
        if isinstance(touch.object, Cap) and touch.object.half_angle < np.pi:
            out[f"contact:{n}:s"] = touch.object.half_angle - abs(spot.object[0])
        if isinstance(touch.hand, Cap) and touch.hand.half_angle < np.pi:
            axis = links[hand.link(touch.link), :3, :3] @ touch.hand.axis
            out[f"contact:{n}:cone"] = touch.hand.half_angle - _angle(axis, touch.hand.sign * normals[n])
    return {label: float(slack) for label, slack in out.items()}


def _angle(a: Array, b: Array) -> float:
    """[rad] between two unit vectors."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
