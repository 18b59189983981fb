"""Numbers, loads, hands and grasps in the words that a lab engineer uses, for tables and pages alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.model.body import Body
    from handfast.model.grasp import Grasp
    from handfast.model.hand.hand import Hand
    from handfast.model.hand.joint_law import JointLaw
    from handfast.planning.evaluation.quality import GraspQuality

AXIS_LETTERS = "xyz"
STOP_TEXTS = {"lower": "cannot open further", "upper": "cannot close further", "both": "cannot move"}
NAMED_JOINTS = 4  # joints that are named
USUAL_JOINT_TEXT = "–"  # a joint stops at its limits and has nothing else
BEST_FIRST = "robust before fragile, then the larger margin, then the smaller command"
LEANS = {"motion": "a large motion", "friction": "its friction", "tilt": "its normals"}  # what a HOLDS leans on
MARGIN_TEXT = "how many times each load, as it was given, is held under the preload (certified)"


def num(x: float, digits: int = 4) -> str:
    """A number with a few digits, a true minus sign, no exponent where it can be helped, no -0."""
    if not np.isfinite(x):
        return "∞" if x > 0 else "−∞" if x < 0 else "?"
    if x == 0 or abs(x) < 1e-9:
        return "0"
    if 1e-4 <= abs(x) < 10**digits:
        text = f"{x:.{digits}g}"
    else:
        text = f"{x:.0f}" if 1 <= abs(x) < 1e7 else f"{x:.2e}"
    return text.replace("-", "−")


def vector(v: Sequence[float] | Array, digits: int = 3) -> str:
    """(1, 0, −2)."""
    least = 10.0 ** -(digits + 1) * float(np.abs(v).max())  # below this a component is rounding beside the others
    return "(" + ", ".join(num(float(x), digits) if abs(x) > least else "0" for x in v) + ")"


def along(v: Sequence[float] | Array) -> str:
    """'+y' for a multiple of an axis, otherwise the unit vector."""
    u = np.asarray(v, dtype=float) / np.abs(v).max()  # squares of tiny numbers are none
    u /= np.linalg.norm(u)
    k = int(np.abs(u).argmax())
    if abs(u[k]) > 1 - 1e-12:
        return ("+" if u[k] > 0 else "−") + AXIS_LETTERS[k]
    return vector(u)


def load_text(w: Sequence[float] | Array) -> str:
    """A disturbance: '2.2 N along +y'."""
    w = np.asarray(w, dtype=float)
    force, torque = math.hypot(*w[:3]), math.hypot(*w[3:])
    parts = []
    if force:
        parts.append(f"{num(force)} N along {along(w[:3])}")
    if torque > 1e-12 * force:  # a millionth of a micrometre: rounding
        parts.append(f"{num(torque)} N·m about {along(w[3:])}")
    return " with ".join(parts) or "no load"


def place_text(at: Sequence[float] | Array) -> str:
    """Where a force acts: 'at the object's origin', 'at (0, 20, −5) mm'."""
    point = 1e3 * np.asarray(at, dtype=float)
    return f"at {vector(point, 4)} mm" if point.any() else "at the object's origin"


def direction_text(d: Sequence[float] | Array) -> str:
    """What kind of disturbance a direction is: 'force along +y', 'torque about −x'."""
    d = np.asarray(d, dtype=float)
    if not d[3:].any() and d[:3].any():
        return f"force along {along(d[:3])}"
    if not d[:3].any() and d[3:].any():
        return f"torque about {along(d[3:])}"
    if _is_force(d):
        return f"force along {along(d[:3])} {place_text(np.cross(d[:3], d[3:]) / (d[:3] @ d[:3]))}"
    return f"load along {vector(d)}"


def magnitude(d: Sequence[float] | Array) -> tuple[float, str]:
    """(factor, unit) of a multiple of the direction: N of a force, wherever it acts, N·m, or a bare number."""
    d = np.asarray(d, dtype=float)
    force, torque = float(np.linalg.norm(d[:3])), float(np.linalg.norm(d[3:]))
    if _is_force(d):
        return force, "N"
    if torque and not force:
        return torque, "N·m"
    return 1.0, "× the direction"


def _is_force(d: Array) -> bool:
    """Is a wrench (6,) a force on some line, as a weight is, without a torque along it?"""
    force, torque = float(np.linalg.norm(d[:3])), float(np.linalg.norm(d[3:]))
    return force > 0 and abs(float(d[:3] @ d[3:])) <= 1e-9 * force * torque


def actuator_unit(grasp: Grasp, actuator: str) -> str:
    """N·m for a motor on revolute joints, N for tendons and slides."""
    i = grasp.mechanism.actuators.index(actuator)
    if grasp.mechanism.tendon[i]:
        return "N"
    moved = [j.type for j, r in zip(grasp.joints, grasp.mechanism.R[i], strict=True) if r]
    return "N·m" if "revolute" in moved else "N"


def beyond_text(hand: Hand, preload: Mapping[str, float]) -> str:
    """'; more than its file states of finger_1_prox', for commands beyond the strength of motors; '' if none is."""
    beyond = [name for name, f in preload.items() if abs(f) > hand.strengths.get(name, math.inf)]
    return f"; more than the hand's file states of {listed(beyond)}" if beyond else ""


def times_text(safety: float) -> str:
    """'1.5 times each of ', before names of loads; '' where each is to be held as it is."""
    return "" if safety == 1 else f"{safety:g} times each of "


def margin_figure(factor: float) -> str:
    """How many times a load is held: '1.52', 'any size'."""
    return "any size" if factor == math.inf else num(factor, 3)


def quality_text(quality: GraspQuality) -> str:
    """'margin 1.52 (gravity +x), robust, clearance 3.2 mm'."""
    where = f" ({quality.weakest})" if quality.weakest else ""
    sure = f"fragile: leans on {listed([LEANS[w] for w in quality.leans_on])}" if quality.fragile else "robust"
    return f"margin {margin_figure(quality.margin)}{where}, {sure}, clearance {num(1e3 * quality.clearance, 3)} mm"


def clearance_text(clearance: float) -> str:
    """'clearance 0.4 mm', or 'overlaps by 0.4 mm' where it is below zero; clearance [m]."""
    size = f"{abs(1e3 * clearance):.1f}"
    return f"overlaps by {size} mm" if clearance < 0 and float(size) > 0 else f"clearance {size} mm"


def sentence(text: str) -> str:
    """A phrase with a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"


def command_text(grasp: Grasp, i: int) -> str:
    """Of one actuator of a grasp: '0.1 N·m', 'locked', 'no torque'."""
    idle = "no torque" if grasp.mechanism.backdrivable[i] else "locked"
    unit = actuator_unit(grasp, grasp.mechanism.actuators[i])
    return f"{num(grasp.command[i])} {unit}" if grasp.command[i] else idle


def joint_unit(grasp: Grasp, joint: int) -> str:
    """Unit of a joint's torque or force."""
    return "N·m" if grasp.joints[joint].type == "revolute" else "N"


def preload_text(grasp: Grasp) -> str:
    """'0.1 N·m at left and right', 'none: every actuator is locked'."""
    if not grasp.preload:
        return "none: every actuator is locked" if grasp.mechanism.a else "none: there are no actuators"
    groups: dict[str, list[str]] = {}
    for name, value in grasp.preload.items():
        groups.setdefault(f"{num(value)} {actuator_unit(grasp, name)}", []).append(name)
    return "; ".join(f"{value} at {listed(names)}" for value, names in groups.items())


def listed(names: Sequence[str]) -> str:
    """'a, b and c'."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def grasp_text(grasp: Grasp) -> str:
    """'4 contacts, 2 joints, friction 1'."""
    mus = sorted({c.friction for c in grasp.contacts})
    mu = num(mus[0]) if len(mus) == 1 else f"{num(mus[0])} to {num(mus[-1])}"
    soft = f" ({len(grasp.soft)} soft)" if len(grasp.soft) else ""
    return f"{count(grasp.m, 'contact')}{soft}, {count(grasp.l, 'joint')}, friction {mu}"


def count(n: int, thing: str) -> str:
    plural = f"{thing[:-1]}ves" if thing.endswith("f") else f"{thing}s"
    return f"{n} {thing if n == 1 else plural}"


def hand_text(hand: Hand) -> str:
    """'22 links, 16 joints, 16 actuators, no couplings'."""
    kinds = [(len(hand.links), "link"), (hand.l, "joint"), (hand.mechanism.a, "actuator")]
    return ", ".join(f"{n or 'no'} {word}{'s' * (n != 1)}" for n, word in [*kinds, (len(hand.couplings), "coupling")])


def body_text(body: Body) -> str:
    """'66 × 66 × 102 mm, 1 convex piece, 0.35 kg, friction 0.5'."""
    sides = " × ".join(num(1e3 * float(x), 3) for x in np.ptp(body.vertices, axis=0))
    mass = "mass not stated" if body.mass is None else f"{num(body.mass)} kg"
    return f"{sides} mm, {count(len(body.pieces), 'convex piece')}, {mass}, friction {num(body.friction)}"


# --- what joints have besides their motors: friction, springs, stops, backdrivable motors ---


def laws_text(grasp: Grasp) -> str:
    """'Joint laws: friction 0.01 N·m at a and b; a cannot open further; backdrivable: m.'; '' if there are none."""
    said = [*_shared(grasp, "friction", "friction {} at {}"), *_shared(grasp, "torque", "given torque {} at {}")]
    for stop, text in STOP_TEXTS.items():
        names = [j.name for j in grasp.joints if j.stop == stop]
        said += [f"{_few(names)} {text}"] if names else []
    mech = grasp.mechanism
    free = [n for n, yes in zip(mech.actuators, mech.backdrivable, strict=True) if yes]
    said += [f"backdrivable: {_few(free)}"] if free else []
    return f"Joint laws: {'; '.join(said)}." if said else ""


def joint_text(grasp: Grasp, joint: int) -> str:
    """Of one joint of a grasp: 'friction 0.01 N·m, given torque 0.02 N·m, cannot open further'; '' for nothing."""
    j, unit = grasp.joints[joint], joint_unit(grasp, joint)
    said = [f"friction {num(j.friction)} {unit}"] if j.friction else []
    said += [f"given torque {num(j.torque)} {unit}"] if j.torque else []
    return ", ".join([*said, STOP_TEXTS[j.stop]] if j.stop else said)


def hand_joint_text(hand: Hand, joint: int) -> str:
    """Of one joint of a hand: 'friction 0.01 N·m, spring 0.05 N·m/rad, slack at 2.62 rad'; `USUAL_JOINT_TEXT` for no
    more."""
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
    return ", ".join(said) or USUAL_JOINT_TEXT


def _shared(grasp: Grasp, what: str, text: str) -> list[str]:
    """Joints by the size of something that they have."""
    groups: dict[str, list[str]] = {}
    for i, j in enumerate(grasp.joints):
        if value := getattr(j, what):
            groups.setdefault(f"{num(value)} {joint_unit(grasp, i)}", []).append(j.name)
    return [text.format(value, _few(names)) for value, names in groups.items()]


def _few(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= NAMED_JOINTS else f"{len(names)} joints"
