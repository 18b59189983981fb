"""What joints and tendons of a hand do by themselves while it moves slowly: springs and dry friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.hand import Hand
from handfast.model.hand.joint_law import JointLaw


@dataclass(frozen=True, eq=False)
class JointResistance:
    """The laws of joints and passive tendons that have friction or a spring, in the senses of their own values.

    Attributes:
        laws: of each.
        rows: (k, l) what each moves by per joint value: a joint's own, or a tendon's length.
    """

    laws: Sequence[JointLaw]
    rows: Array

    @classmethod
    def of(cls, hand: Hand) -> JointResistance:
        """Those of a hand; without friction and spring there are none."""
        each = [(joint.law, row) for joint, row in zip(hand.joints, np.eye(hand.l), strict=True)]
        each += [(tendon.law, tendon.row) for tendon in hand.tendons]
        found = [(law, row) for law, row in each if law.friction or law.springs]
        return cls([law for law, _ in found], np.array([row for _, row in found]).reshape(len(found), hand.l))

    def springs(self, q: Array) -> tuple[Array, Array]:
        """(l,) what springs give at q [N m, N], and (l, l) by how much less per motion: their stiffness there."""
        torques = np.array([law.torque(value) for law, value in zip(self.laws, self.rows @ q, strict=True)])
        stretched = np.array([law.stiffness for law in self.laws]) * (torques != 0)
        return self.rows.T @ torques, self.rows.T @ (stretched[:, None] * self.rows)

    @property
    def friction(self) -> Array:
        """(k,) the most that each takes [N m, N]."""
        return np.array([law.friction for law in self.laws])
