"""What a grasp says of its joints beside its hand's file: which laws count, who is locked, who turns back."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.hand.hand import Hand
from handfast.model.hand.joint_law import LAWS

FIELDS = {"stops": "stop", "friction": "friction", "springs": "torque"}  # of a grasp's joint, by law
SAME = 1e-6  # relative difference of numbers that are the same but for rounding


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
        if not np.isclose(joint.torque, other.torque, rtol=SAME, atol=1e-9):
            found.append(f"the given torque of {joint.name}")
    if [j.name for j in grasp.joints] == list(theirs) and not _same_drives(grasp, there):
        found.append("the motors or couplings")
    return found


def _same_drives(one: Grasp, other: Grasp) -> bool:
    """Have they the same motors, and couplings that allow the same motions?"""
    a, b = one.mechanism, other.mechanism
    if a.actuators != b.actuators or a.tendon != b.tendon or a.backdrivable != b.backdrivable:
        return False
    if not np.allclose(a.R, b.R, rtol=SAME, atol=1e-12):
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
