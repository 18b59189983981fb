"""What position servos command: from targets and gains to the forces and torques that a grasp is asked about with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, require_positive, unknown_name
from handfast.model.hand.hand import Hand
from handfast.model.mechanism import Mechanism


def servo_commands(
    hand: Hand,
    q: Array | Mapping[str, float],
    targets: Mapping[str, float],
    gains: float | Mapping[str, float],
    *,
    largest: float | Mapping[str, float] | None = None,
    mechanism: Literal["hand", "direct"] = "hand",
) -> dict[str, float]:
    """The commands of proportional position servos at rest, as the preload of a grasp.

    A servo pushes with f = kp (target - t): t is where its actuator stands, R q, which is the joint's own value for a
    motor that drives one joint directly. So torque = kp (target - q), in the hand's own sense of that joint: a target
    beyond the contact, in the sense in which the joint value grows, gives a positive torque on the joint. A grasp
    counts otherwise: there positive commands close. A motor whose closing lowers its joints' values, by the
    `closing` senses of the hand, is turned round, as `contact_grasp` turns it, and the command changes its sign with
    it; tendons keep theirs. What is returned is for `contact_grasp(..., preload=...)` with the same hand and
    mechanism.

    Two things are assumed, as everywhere here: nothing moves (no damping, no integral part), and actuators do not turn
    backwards, unless the hand has them backdrivable. A servo that stands at its target pushes with nothing, and its
    actuator counts as locked, or, if it is backdrivable, swings freely.

    What the joints have besides is no part of a command: dry friction takes from the torque that reaches the contacts
    while a finger closes, and adds to what holds it; a spring adds its own. The grasp knows both (`Joint.law`).

    Args:
        q: (l,) where the hand stands, or values by joint name; the others follow `Hand.configuration`.
        targets: by the name of an actuator, in its own displacement, or by the name of the one joint that an actuator
            drives, in the joint's value [rad, m]. Actuators without a target are left out, and so locked.
        gains: kp of every actuator, or by name of an actuator or joint as in `targets`: force of the actuator over
            its displacement [N m/rad, N/m].
        largest: the forces at which the servos saturate [N m, N], for all or by name; none unless given.
        mechanism: as in `contact_grasp`: "direct" is one motor per joint, named like it.

    Raises:
        InputError: an unknown actuator or joint, a joint that no actuator drives alone, an actuator named twice, a
            target without gain, a gain or limit that is not positive, a number that is not finite, a tendon that would
            have to push.
    """
    if mechanism not in ("hand", "direct"):
        raise InputError(f"is '{mechanism}'; 'hand' or 'direct' is needed", field="mechanism")
    whole = Mechanism.direct(hand.joint_names) if mechanism == "direct" else hand.mechanism
    at = hand.configuration(q) if isinstance(q, Mapping) else np.asarray(q, dtype=float)
    if at.shape != (hand.l,) or not np.isfinite(at).all():
        raise InputError(f"needs {hand.l} finite joint values, in the order of the hand's joints", field="q")
    wanted = _by_actuator(hand, whole, targets, "targets")
    kp = _numbers(hand, whole, gains, "gains")
    most = {} if largest is None else _numbers(hand, whole, largest, "largest")
    out: dict[str, float] = {}
    for i, (target, per) in wanted.items():
        name, row = whole.actuators[i], whole.R[i]
        if not np.isfinite(target):
            raise InputError(f"is {target}; a finite number is needed", field=f"targets.{name}")
        if i not in kp:
            raise InputError("is missing; every target needs one", field=f"gains.{name}")
        force = kp[i] * (per * target - float(row @ at))
        force = float(np.clip(force, -most[i], most[i])) if i in most else force
        if whole.tendon[i] and force < 0:
            raise InputError(f"asks its tendon to push with {-force:.4g} N; it can only pull", field=f"targets.{name}")
        opens = not whole.tendon[i] and row @ hand.closing < 0
        out[name] = -force if opens else force
    return out


def _by_actuator(
    hand: Hand, mechanism: Mechanism, named: Mapping[str, float], field: str
) -> dict[int, tuple[float, float]]:
    """Values by the index of the actuator, each with what makes a joint's value the actuator's displacement."""
    out: dict[int, tuple[float, float]] = {}
    for name, value in named.items():
        i, per = _actuator(hand, mechanism, name, field)
        if i in out:
            raise InputError(f"'{name}' is the actuator '{mechanism.actuators[i]}', which has a value", field=field)
        out[i] = float(value), per
    return out


def _actuator(hand: Hand, mechanism: Mechanism, name: str, field: str) -> tuple[int, float]:
    if name in mechanism.actuators:
        return mechanism.actuators.index(name), 1.0
    if name not in hand.joint_names:
        raise unknown_name("actuator", name, mechanism.actuators, field=field)
    j = hand.joint_names.index(name)
    alone = [i for i, row in enumerate(mechanism.R) if row[j] and np.count_nonzero(row) == 1]
    if len(alone) != 1:
        raise InputError(f"'{name}' is a joint that no actuator drives alone; name an actuator", field=field)
    return alone[0], float(mechanism.R[alone[0], j])


def _numbers(hand: Hand, mechanism: Mechanism, given: float | Mapping[str, float], field: str) -> dict[int, float]:
    """Positive numbers by the index of the actuator."""
    if isinstance(given, Mapping):
        found = {i: value for i, (value, _) in _by_actuator(hand, mechanism, given, field).items()}
    else:
        found = dict.fromkeys(range(mechanism.a), float(given))
    for i, value in found.items():
        where = f"{field}.{mechanism.actuators[i]}" if isinstance(given, Mapping) else field
        require_positive(value, where, "a positive number is needed")
    return found
