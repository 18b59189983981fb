"""What a file of grasps says of a hand beside its task: motors, closing senses, and the laws of joints and tendons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict
from handfast.model.hand.hand import Hand, coupling_rows
from handfast.model.hand.joint_law import NO_LAW, JointLaw, PassiveTendon
from handfast.model.mechanism import Mechanism
from handfast.readers.grasp_file import ActuatorEntry

Sense = Annotated[int, Field(ge=-1, le=1)]


class LawEntry(Strict):
    """As `JointLaw`; null where nothing stops it."""

    friction: Finite = 0.0
    stiffness: Finite = 0.0
    rest: tuple[Finite, Finite] = (0.0, 0.0)
    stops: tuple[Finite | None, Finite | None] = (None, None)

    def law(self, field: str) -> JointLaw:
        low, high = self.stops
        ends = (-np.inf if low is None else low, np.inf if high is None else high)
        try:
            return JointLaw(self.friction, self.stiffness, self.rest, ends)
        except InputError as fault:
            raise fault.within(field) from None


class TendonEntry(LawEntry):
    """A tendon with laws of its own: its length by joint, and these."""

    joints: dict[str, Finite]


class MotorsEntry(Strict):
    """What the task's hand does not say: the rows of R, the senses in which joints close, and the joints' laws."""

    actuators: list[ActuatorEntry]
    closing: dict[str, Sense]
    laws: dict[str, LawEntry] = Field(default_factory=dict)
    tendons: dict[str, TendonEntry] = Field(default_factory=dict)


def driven(hand: Hand, motors: MotorsEntry) -> Hand:
    """The task's hand with what drives it; `InputError` with the field of what is wrong."""
    names = hand.joint_names
    for i, a in enumerate(motors.actuators):
        for j in a.joints:
            hand.joint(j, field=f"motors.actuators[{i}].joints")
    if set(motors.closing) != set(names):
        raise InputError(f"is not of the hand's joints: {', '.join(names)}", field="motors.closing")
    try:
        mechanism = Mechanism(
            tuple(a.name for a in motors.actuators),
            np.array([[a.joints.get(j, 0.0) for j in names] for a in motors.actuators]).reshape(-1, hand.l),
            coupling_rows(hand.couplings, hand.l),
            tuple(a.tendon for a in motors.actuators),
            tuple(a.backdrivable for a in motors.actuators),
        )
    except InputError as fault:
        raise fault.within("motors") from None
    for j in motors.laws:
        hand.joint(j, field="motors.laws")
    for n, e in motors.tendons.items():
        for j in e.joints:
            hand.joint(j, field=f"motors.tendons.{n}.joints")
    laws = {n: e.law(f"motors.laws.{n}") for n, e in motors.laws.items()}
    joints = tuple(replace(j, law=laws.get(j.name, NO_LAW)) for j in hand.joints)
    tendons = tuple(
        PassiveTendon(n, np.array([e.joints.get(j, 0.0) for j in names]), e.law(f"motors.tendons.{n}"))
        for n, e in motors.tendons.items()
    )
    closing = np.array([motors.closing[j] for j in names])
    return replace(hand, joints=joints, tendons=tendons, mechanism=mechanism, closing=closing)


def motors_to_dict(hand: Hand) -> dict[str, Any]:
    """What drives a hand, and the sense in which its joints close."""
    m, names = hand.mechanism, hand.joint_names
    laws = {
        "laws": {j.name: j.law.to_json() for j in hand.joints if j.law.any},
        "tendons": {t.name: t.law.to_json() | {"joints": _named(t.row, names)} for t in hand.tendons},
    }
    return {
        "actuators": [
            {"name": n, "joints": _named(row, names), "tendon": t} | ({"backdrivable": True} if free else {})
            for n, row, t, free in zip(m.actuators, m.R, m.tendon, m.backdrivable, strict=True)
        ],
        "closing": {n: int(s) for n, s in zip(names, hand.closing, strict=True)},
    } | {name: of for name, of in laws.items() if of}


def _named(row: Array, joints: Sequence[str]) -> dict[str, float]:
    return {j: float(v) for j, v in zip(joints, row, strict=True) if v}
