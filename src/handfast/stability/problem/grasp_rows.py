"""Many grasps of one shape as arrays, so that the equations are about all of them at once."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.transforms import cross_rows, normal_frames
from handfast.model.grasp import NO_LENGTH, Grasp, GraspJoint

NO_SOFT_FINGERS: Indices = np.zeros(0, dtype=np.intp)


class MechanismRows(NamedTuple):
    """As `Mechanism`: R (k, a, l), A (k, c, l); what pulls only and what can be driven back is the same of all."""

    R: Array
    A: Array
    tendon: tuple[bool, ...]
    backdrivable: tuple[bool, ...]

    @property
    def a(self) -> int:
        return self.R.shape[1]


def shape_of(grasp: Grasp) -> Hashable | None:
    """Equal for grasps that differ in numbers alone; None for one that has to stand by itself.

    By themselves stand grasps with laws of joints, soft fingers or a start.
    """
    if grasp.start is not None or grasp.has_laws or any(c.torsion for c in grasp.contacts):
        return None
    mech = grasp.mechanism
    places = (mech.R != 0).tobytes(), (mech.A != 0).tobytes(), (grasp.command != 0).tobytes()
    return grasp.m, tuple(joint.type for joint in grasp.joints), len(mech.A), mech.tendon, places


@dataclass(frozen=True, eq=False)
class GraspRows:
    """k grasps of one `shape_of`, with the names that `Grasp` has for the same, and one more axis in front.

    Attributes:
        grasps: k of them.
        positions: (k, m, 3); mu: (k, m); command: (k, a); G: (k, 6, 3 m); J: (k, 3 m, l), both but for rounding.
    """

    grasps: tuple[Grasp, ...]
    positions: Array
    mu: Array
    mechanism: MechanismRows
    command: Array
    G: Array
    J: Array

    has_laws = False
    start = None
    soft = NO_SOFT_FINGERS
    levers = np.zeros(0)
    twist_map = np.zeros((6, 0))

    @classmethod
    def of(cls, grasps: Sequence[Grasp]) -> GraspRows:
        """From grasps of one shape."""
        k, m, l = len(grasps), grasps[0].m, grasps[0].l
        contacts = [c for g in grasps for c in g.contacts]
        joints = [j for g in grasps for j in g.joints]
        p, n = (
            np.concatenate([getattr(c, name) for c in contacts]).reshape(k, m, 3) for name in ("position", "normal")
        )
        F = normal_frames(n)
        G = np.empty((k, 6, 3 * m))
        columns = F.swapaxes(2, 3)  # contact, direction, coordinate
        for rows, of_columns in ((slice(3), columns), (slice(3, 6), cross_rows(p[:, :, None], columns))):
            G[:, rows] = of_columns.transpose(0, 3, 1, 2).reshape(k, 3, 3 * m)
        return cls(
            grasps=tuple(grasps),
            positions=p,
            mu=np.array([c.friction for c in contacts]).reshape(k, m),
            mechanism=MechanismRows(
                np.stack([g.mechanism.R for g in grasps]),
                np.stack([g.mechanism.A for g in grasps]),
                grasps[0].mechanism.tendon,
                grasps[0].mechanism.backdrivable,
            ),
            command=np.stack([g.command for g in grasps]),
            G=G,
            J=_jacobian(joints, p, F, l),
        )

    @property
    def m(self) -> int:
        """Number of contacts."""
        return self.positions.shape[1]

    @property
    def joints(self) -> tuple[GraspJoint, ...]:
        """Of the first, whose types are those of all."""
        return self.grasps[0].joints

    @property
    def l(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def middle(self) -> Array:
        """(k, 3) [m] as `Grasp.middle`."""
        out: Array = self.positions.mean(axis=1)
        return out

    @cached_property
    def size(self) -> Array:
        """(k,) [m] as `Grasp.size`."""
        p = self.positions
        r = np.sqrt(((p - self.middle[:, None]) ** 2).sum(axis=2)).max(axis=1)
        for i in np.flatnonzero(r <= NO_LENGTH * np.abs(p).max(axis=(1, 2))):
            r[i] = self.grasps[i].size
        return r

    @cached_property
    def spacing(self) -> Array:
        """(k,) [m] as `Grasp.spacing`."""
        p = self.positions
        apart = np.sqrt(((p[:, :, None] - p[:, None]) ** 2).sum(axis=3))
        nearest = np.where(apart > 0, apart, np.inf).min(axis=(1, 2))
        for i in np.flatnonzero(np.isinf(nearest)):
            nearest[i] = self.grasps[i].spacing
        return nearest

    @cached_property
    def touches(self) -> Mask:
        """(k, l) bool: which joints move a contact."""
        return np.asarray(self.J.any(axis=1))

    @property
    def twist_jacobian(self) -> Array:
        """Of soft fingers, which there are none of."""
        return np.zeros((0, self.l))

    @property
    def given_torques(self) -> Array:
        """(l,) zeros."""
        return np.zeros(self.l)

    @property
    def joint_friction(self) -> Array:
        """(l,) zeros."""
        return np.zeros(self.l)

    def rows(self, which: Mask | Indices) -> GraspRows:
        """Some of them."""
        mech = self.mechanism
        return GraspRows(
            tuple(self.grasps[i] for i in np.arange(len(self.grasps))[which]),
            self.positions[which],
            self.mu[which],
            mech._replace(R=mech.R[which], A=mech.A[which]),
            self.command[which],
            self.G[which],
            self.J[which],
        )


AnyGrasp = Grasp | GraspRows


def grasp_of(grasp: AnyGrasp, row: int = 0) -> Grasp:
    """The grasp of a row."""
    return grasp.grasps[row] if isinstance(grasp, GraspRows) else grasp


def _jacobian(joints: list[GraspJoint], p: Array, frames: Array, l: int) -> Array:
    """(k, 3m, l) of k times l joints that move contacts at p (k, m, 3) in their frames (k, m, 3, 3)."""
    k, m = p.shape[:2]
    if not l:
        return np.zeros((k, 3 * m, 0))
    axes, origins = (
        np.concatenate([getattr(j, name) for j in joints]).reshape(k, 1, l, 3) for name in ("axis", "origin")
    )
    turns = np.array([j.type == "revolute" for j in joints[:l]])[:, None]
    speeds = np.where(turns, cross_rows(axes, p[:, :, None] - origins), axes)  # (k, m, l, 3)
    moved = np.zeros((k, m, l))
    where = [(i // l, contact, i % l) for i, j in enumerate(joints) for contact in j.moves]
    moved[tuple(np.array(where, dtype=int).reshape(-1, 3).T)] = 1.0
    out: Array = (frames.swapaxes(2, 3) @ (speeds * moved[..., None]).swapaxes(2, 3)).reshape(k, 3 * m, l)
    return out
