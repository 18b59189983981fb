"""What moves and holds the joints of a hand under a grasp: its motors and commands, springs, dry friction and stops."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.core.errors import InputError
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.hand.hand import Hand
from handfast.model.hand.joint_law import LAWS, JointLaw
from handfast.model.mechanism import Mechanism

FIELDS = {"stops": "stop", "friction": "friction", "springs": "torque"}  # of a grasp's joint, by law
DRIVE_TOLERANCE = 1e-6  # relative difference of numbers that are the same but for rounding


@dataclass(frozen=True, eq=False)
class MotorDrive:
    """What motors do, over all joints of a hand, in the senses in which commands close.

    Attributes:
        rows: (a, l) displacement of each actuator by joint values; closing is positive.
        command: (a,) [N m, N].
        moves: (a,) bool: commanded, a tendon that may go slack, or backdrivable; the others are locked.
        holds: (a,) bool: does not turn back.
        direct: is there a motor for each joint, named like it, in place of the hand's own?
        held: (n, l) joints that are locked whatever the motors do.
    """

    names: tuple[str, ...]
    rows: Array
    command: Array
    moves: Mask
    holds: Mask
    direct: bool
    held: Array

    @classmethod
    def of(
        cls,
        hand: Hand,
        preload: Mapping[str, float],
        mechanism: Literal["hand", "direct"],
        backdrivable: Collection[str] = (),
        lock: Collection[str] = (),
    ) -> MotorDrive:
        """The hand's motors with commands as a grasp has them: positive ones close.

        Args:
            backdrivable: motors that give their command whichever way they turn, lock: joints that stand still.

        Raises:
            InputError: an unknown actuator or joint.
        """
        direct = mechanism == "direct"
        whole = Mechanism.direct(hand.joint_names) if direct else hand.mechanism
        command = whole.commands(dict(preload))
        turns = np.array([name in backdrivable for name in whole.actuators], dtype=bool)
        tendon = np.array(whole.tendon, dtype=bool) & ~turns
        sense = np.where((whole.R @ hand.closing < 0) & ~tendon, -1.0, 1.0)
        rows = sense[:, None] * whole.R
        held = np.eye(hand.l)[[hand.joint(name, field="lock") for name in lock]]
        return cls(whole.actuators, rows, command, (command != 0) | tendon | turns, ~turns, direct, held)


def locked_joints(grasp: Grasp) -> list[str]:
    """Joints that the grasp holds rigidly, each by a coupling of its own."""
    alone = [row for row in grasp.mechanism.A if np.count_nonzero(row) == 1]
    return [grasp.joints[int(np.flatnonzero(row)[0])].name for row in alone]


def backdrivable_motors(grasp: Grasp) -> list[str]:
    """Its motors that give what they are commanded and no more."""
    m = grasp.mechanism
    return [name for name, turns in zip(m.actuators, m.backdrivable, strict=True) if turns]


def motors_of(grasp: Grasp, hand: Hand) -> Literal["hand", "direct"]:
    """Whose motors the grasp has: the hand's own, or one for each joint.

    Raises `InputError` if its actuators are neither.
    """
    names, real = grasp.mechanism.actuators, [j.name in hand.joint_names for j in grasp.joints]
    own = set(names) <= set(hand.mechanism.actuators)
    ties = any(np.count_nonzero(row) > 1 and all(np.array(real)[row != 0]) for row in grasp.mechanism.A)
    if own and (ties or not (hand.couplings or hand.loops) or not set(names) <= set(hand.joint_names)):
        return "hand"
    if set(names) <= set(hand.joint_names):
        return "direct"
    raise InputError("has actuators that its hand does not have", source=grasp.name, field="mechanism")


def with_laws_of(hand: Hand, grasp: Grasp, q: Array, pose: Array) -> Hand:
    """The hand with those laws of its joints that the grasp was made with, and with the grasp's friction in joints.

    A kind of law of which joints of the grasp would have something at q (l,), pose (4, 4), and none has, does not
    count: the grasp was made without it.
    """
    there = _made_of(hand, grasp, q, pose)
    if there is None:
        return hand
    own = {joint.name: joint for joint in grasp.joints}
    kept = [law for law in LAWS if _counts(FIELDS[law], there, own)]
    hand = hand.with_laws(",".join(kept) or "none")
    joints = [
        replace(j, law=replace(j.law, friction=own[j.name].friction)) if j.name in own else j for j in hand.joints
    ]
    return replace(hand, joints=tuple(joints))


def _counts(field: str, there: Grasp, own: dict[str, GraspJoint]) -> bool:
    having = [j.name for j in there.joints if getattr(j, field) and j.name in own]
    return not having or any(getattr(own[name], field) for name in having)


def other_joints(hand: Hand, grasp: Grasp, q: Array, pose: Array) -> list[str]:
    """What of the joints and motors of a grasp is not what the hand has at q, in words; the grasp at rest has that."""
    there = _made_of(hand, grasp, q, pose)
    if there is None:
        return []
    theirs = {joint.name: joint for joint in there.joints}
    found = []
    for joint in grasp.joints:
        other = theirs.get(joint.name)
        if other is None:
            found.append(f"the joint {joint.name}")
            continue
        if joint.stop != other.stop:
            found.append(f"the stop of {joint.name}")
        if not np.isclose(joint.torque, other.torque, rtol=DRIVE_TOLERANCE, atol=1e-9):
            found.append(f"the given torque of {joint.name}")
    if [j.name for j in grasp.joints] == list(theirs) and not _same_drives(grasp, there):
        found.append("the motors or couplings")
    return found


def _same_drives(one: Grasp, other: Grasp) -> bool:
    """Have they the same motors, and couplings that allow the same motions?"""
    a, b = one.mechanism, other.mechanism
    if a.actuators != b.actuators or a.tendon != b.tendon or a.backdrivable != b.backdrivable:
        return False
    if not np.allclose(a.R, b.R, rtol=DRIVE_TOLERANCE, atol=1e-12):
        return False
    ranks = [np.linalg.matrix_rank(A) if len(A) else 0 for A in (a.A, b.A, np.vstack([a.A, b.A]))]
    return ranks[0] == ranks[1] == ranks[2]


def _made_of(hand: Hand, grasp: Grasp, q: Array, pose: Array) -> Grasp | None:
    """The grasp's contacts on the hand at q; None if they are on links that it does not have."""
    hand = hand.with_backdrivable(backdrivable_motors(grasp))
    try:
        return grasp_of(hand, q, grasp.contacts, pose, lock=locked_joints(grasp), mechanism=motors_of(grasp, hand))
    except InputError:
        return None


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
