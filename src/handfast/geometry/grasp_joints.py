"""The joints behind the contacts of a grasp, with what acts on them, and the mechanism that drives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import GraspJoint
from handfast.model.hand.hand import Hand, Joint
from handfast.model.hand.joint_law import PassiveTendon
from handfast.model.mechanism import Mechanism
from handfast.proofs.motors import STOP_ANGLE, STOP_TRAVEL

TENDON = "tendon "  # begins the name of a joint that stands for the length of one
OPPOSITE_STOP = {"lower": "upper", "upper": "lower"}
PARTED = 1e-4  # [rad, m] by which a joint is off its coupling where the clutch has opened
NEGLIGIBLE_TORQUE = 1e-9  # [N m, N] of a spring that stands at its rest but for rounding


def joints_and_mechanism(
    hand: Hand,
    q: Array,
    object_pose: Array,
    moving: Sequence[tuple[int, ...]],
    *,
    held: frozenset[int] = frozenset(),
    mechanism: Literal["hand", "direct"] = "hand",
) -> tuple[list[GraspJoint], Mechanism]:
    """Joints and mechanism of a grasp, object frame: what moves a contact, and what is tied to it.

    Joints and actuators are turned so that they close positively, and so are what a spring gives and the stop at which
    a joint stands. A tendon that has friction, a spring or a stop that acts at q is one more joint, "tendon NAME",
    which moves no contact and is coupled to the joints that it runs over: its value is the tendon's length. A joint
    whose clutch has opened stands at no stop: it would hold its driver, which goes on without it.

    Args:
        q: (l,) configuration; object_pose: (4, 4) in the hand's base frame.
        moving: of each contact, the joints that move it.
        held: joints to lock.
        mechanism: as for `contact_grasp`.
    """
    tendons = [(t, _laws(t, float(t.row @ q))) for t in hand.tendons]
    acting = [(t, law) for t, law in tendons if any(law)]
    whole = _with_tendons(_driving(hand, q, mechanism), [t for t, _ in acting])
    kept = _connected({j for chain in moving for j in chain}, whole)
    sign = np.where(hand.closing < 0, -1.0, 1.0)
    loose = _loose(hand, q)
    axes, origins = hand.joint_axes(q)
    to_object = np.linalg.inv(object_pose)
    joints = []
    for j in kept:
        if j >= hand.l:
            tendon, law = acting[j - hand.l]
            joints.append(GraspJoint(TENDON + tendon.name, np.eye(3)[0], np.zeros(3), (), "prismatic", *law))
            continue
        joint = hand.joints[j]
        axis, origin = sign[j] * to_object[:3, :3] @ axes[j], to_object[:3, :3] @ origins[j] + to_object[:3, 3]
        contacts = tuple(i for i, chain in enumerate(moving) if j in chain)
        friction, torque, stop = _laws(joint, float(q[j]))
        stop = "" if j in loose else stop
        if sign[j] < 0:
            torque, stop = -torque, OPPOSITE_STOP.get(stop, stop)  # type: ignore[assignment]
        joints.append(GraspJoint(joint.name, axis, origin, contacts, joint.type, friction, torque, stop))
    none = np.zeros(len(acting))
    return joints, _restricted(whole, kept, np.r_[sign, none + 1], np.r_[hand.closing != 0, none != 0], held)


def _laws(of: Joint | PassiveTendon, value: float) -> tuple[float, float, Literal["", "lower", "upper", "both"]]:
    """Friction, given torque and stop at a value, in its own sense."""
    near = STOP_ANGLE if isinstance(of, Joint) and of.type == "revolute" else STOP_TRAVEL
    torque = of.law.torque(value)
    return of.law.friction, torque if abs(torque) > NEGLIGIBLE_TORQUE else 0.0, of.law.stop(value, near)


def _loose(hand: Hand, q: Array) -> set[int]:
    """The joints that a clutch has parted from their drivers."""
    if not hand.breakaway:
        return set()
    led = [c for c in hand.couplings if c.driver >= 0]
    return {c.joint for c in led if abs(q[c.joint] - c.ratio * q[c.driver] - c.offset) > PARTED}


def _driving(hand: Hand, q: Array, mechanism: Literal["hand", "direct"]) -> Mechanism:
    """The hand's mechanism at q, or a motor for each joint; loops are no motor's."""
    whole = hand.mechanism_at(q)
    if mechanism == "hand":
        return whole
    free = {n for n, yes in zip(whole.actuators, whole.backdrivable, strict=True) if yes}
    strange = sorted(free - set(hand.joint_names))
    if strange:
        problem = f"is backdrivable, and with one motor per joint there is no '{strange[0]}'; name joints"
        raise InputError(problem, field=f"mechanism.{strange[0]}")
    direct = Mechanism.direct(hand.joint_names)
    return replace(direct, A=whole.A[len(hand.couplings) :], backdrivable=tuple(n in free for n in direct.actuators))


def _with_tendons(whole: Mechanism, tendons: Sequence[PassiveTendon]) -> Mechanism:
    """With a joint for each tendon after the others, coupled to be its length."""
    if not tendons:
        return whole
    n = len(tendons)
    lengths = np.hstack([-np.array([t.row for t in tendons]), np.eye(n)])
    A = np.vstack([np.hstack([whole.A, np.zeros((len(whole.A), n))]), lengths])
    return replace(whole, R=np.hstack([whole.R, np.zeros((whole.a, n))]), A=A)


def _connected(joints: set[int], mechanism: Mechanism) -> list[int]:
    """The joints and all that share an actuator or a coupling with them, directly or not, in order."""
    rows = np.vstack([mechanism.R, mechanism.A]) != 0
    while True:
        touched = rows[rows[:, sorted(joints)].any(axis=1)].any(axis=0) if joints else np.zeros(0, bool)
        more = joints | {int(j) for j in np.flatnonzero(touched)}
        if more == joints:
            return sorted(joints)
        joints = more


def _restricted(whole: Mechanism, kept: list[int], sign: Array, closes: Array, held: frozenset[int]) -> Mechanism:
    """The mechanism of the kept joints, turned so that they and the actuators close positively."""
    R, A = (whole.R * sign)[:, kept], (whole.A * sign)[:, kept]
    rows = np.flatnonzero(R.any(axis=1))
    R = R[rows]
    tendon = tuple(whole.tendon[i] for i in rows)
    for i, row in enumerate(R):
        if not tendon[i] and row @ closes[kept] < 0:
            R[i] = -row
    locks = [np.eye(len(kept))[kept.index(j)] for j in sorted(held) if j in kept]
    A = np.vstack([A[A.any(axis=1)], *locks]) if locks else A[A.any(axis=1)]
    return Mechanism(tuple(whole.actuators[i] for i in rows), R, A, tendon, tuple(whole.backdrivable[i] for i in rows))
