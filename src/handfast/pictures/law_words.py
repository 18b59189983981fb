"""What joints have besides their motors, in words: friction, springs, stops, backdrivable motors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from handfast.pictures.words import count, joint_unit, listed, num

if TYPE_CHECKING:
    from handfast.model.grasp import Grasp
    from handfast.model.hand.hand import Hand
    from handfast.model.hand.joint_law import JointLaw

STOPS = {"lower": "cannot open further", "upper": "cannot close further", "both": "cannot move"}
MANY = 4  # names in a line
USUAL = "–"  # a joint stops at its limits and has nothing else


def laws_text(grasp: Grasp) -> str:
    """'Joint laws: friction 0.01 N·m at a and b; a cannot open further; backdrivable: m.'; '' if there are none."""
    said = [*_shared(grasp, "friction", "friction {} at {}"), *_shared(grasp, "torque", "given torque {} at {}")]
    for stop, words in STOPS.items():
        names = [j.name for j in grasp.joints if j.stop == stop]
        said += [f"{_few(names)} {words}"] if names else []
    mech = grasp.mechanism
    free = [n for n, yes in zip(mech.actuators, mech.backdrivable, strict=True) if yes]
    said += [f"backdrivable: {_few(free)}"] if free else []
    return f"Joint laws: {'; '.join(said)}." if said else ""


def joint_text(grasp: Grasp, joint: int) -> str:
    """Of one joint of a grasp: 'friction 0.01 N·m, given torque 0.02 N·m, cannot open further'; '' for nothing."""
    j, unit = grasp.joints[joint], joint_unit(grasp, joint)
    said = [f"friction {num(j.friction)} {unit}"] if j.friction else []
    said += [f"given torque {num(j.torque)} {unit}"] if j.torque else []
    return ", ".join([*said, STOPS[j.stop]] if j.stop else said)


def hand_joint_text(hand: Hand, joint: int) -> str:
    """Of one joint of a hand: 'friction 0.01 N·m, spring 0.05 N·m/rad, slack at 2.62 rad'; `USUAL` for no more."""
    j = hand.joints[joint]
    return _law_text(j.law, (j.lower, j.upper), *(("N·m", "rad") if j.type == "revolute" else ("N", "m")))


def tendon_rows(hand: Hand) -> list[list[str]]:
    """Of each tendon with laws of its own: name, length, laws."""
    rows = []
    for t in hand.tendons:
        length = " + ".join(f"{num(float(r))} × {n}" for n, r in zip(hand.joint_names, t.row, strict=True) if r)
        rows.append([t.name, length, _law_text(t.law, (-np.inf, np.inf), "N", "m")])
    return rows


def hand_laws_text(hand: Hand) -> str:
    """What the joints of a hand have, counted: 'of 24 joints 24 have stops, 24 friction (0.01 N·m), none a spring'."""
    joints = hand.joints
    stops = sum(bool(np.isfinite(j.law.stops).any()) for j in joints)
    rubs = [j for j in joints if j.law.friction]
    springs = sum(j.law.springs for j in joints)
    sizes = sorted({f"{num(j.law.friction)} {'N·m' if j.type == 'revolute' else 'N'}" for j in rubs})
    size = f" ({sizes[0]})" if len(sizes) == 1 else " (of different sizes)" if sizes else ""
    own = f", {count(len(hand.tendons), 'tendon')} with laws of their own" if hand.tendons else ""
    of = f"of {len(joints)} joints {stops or 'none'} {'has' if stops == 1 else 'have'} stops"
    return f"{of}, {len(rubs) or 'none'} friction{size}, {springs or 'none'} a spring{own}"


def _law_text(law: JointLaw, limits: tuple[float, float], force: str, way: str) -> str:
    said = []
    if law.stops != limits:
        ends = [num(end) for end in law.stops if np.isfinite(end)]
        said.append(f"stops at {listed(ends)} {way}" if ends else "no stops")
    said += [f"friction {num(law.friction)} {force}"] if law.friction else []
    if law.springs:
        rest = " to ".join(dict.fromkeys(num(end) for end in law.rest))
        said.append(f"spring {num(law.stiffness)} {force}/{way}, slack at {rest} {way}")
    return ", ".join(said) or USUAL


def _shared(grasp: Grasp, what: str, text: str) -> list[str]:
    """Joints by the size of something that they have."""
    groups: dict[str, list[str]] = {}
    for i, j in enumerate(grasp.joints):
        if value := getattr(j, what):
            groups.setdefault(f"{num(value)} {joint_unit(grasp, i)}", []).append(j.name)
    return [text.format(value, _few(names)) for value, names in groups.items()]


def _few(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= MANY else f"{len(names)} joints"
