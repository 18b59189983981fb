"""Answers in words that a lab engineer uses, for tables and pages alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.answer import Stop, Verdict

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.model.grasp import Grasp
    from handfast.proofs.certificate import Certificate
    from handfast.stability.answers import Answer
    from handfast.stability.maps import Curve
    from handfast.stability.margin import Flip, Margin
    from handfast.stability.queries import CheckAnswer, MaxAnswer, TorquesAnswer
    from handfast.stability.settings import Settings
    from handfast.stability.witness import Witness

CREATED = 1e-6  # friction that feeds in a larger share of the work than this is called unphysical
AXES = "xyz"


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
        return ("+" if u[k] > 0 else "−") + AXES[k]
    return vector(u)


def load_text(w: Sequence[float] | Array) -> str:
    """A disturbance: '2.2 N along +y'."""
    w = np.asarray(w, dtype=float)
    force, moment = math.hypot(*w[:3]), math.hypot(*w[3:])
    parts = []
    if force:
        parts.append(f"{num(force)} N along {along(w[:3])}")
    if moment > 1e-12 * force:  # a millionth of a micrometre: rounding
        parts.append(f"{num(moment)} N·m about {along(w[3:])}")
    return " with ".join(parts) or "no load"


def place_text(at: Sequence[float] | Array) -> str:
    """Where a force acts: 'at the object's origin', 'at (0, 20, −5) mm'."""
    point = 1e3 * np.asarray(at, dtype=float)
    return f"at {vector(point, 4)} mm" if point.any() else "at the object's origin"


def direction_text(d: Sequence[float] | Array) -> str:
    """What kind of disturbance a direction is: 'force along +y', 'moment about −x'."""
    d = np.asarray(d, dtype=float)
    if not d[3:].any() and d[:3].any():
        return f"force along {along(d[:3])}"
    if not d[:3].any() and d[3:].any():
        return f"moment about {along(d[3:])}"
    return f"load along {vector(d)}"


def magnitude(d: Sequence[float] | Array) -> tuple[float, str]:
    """(factor, unit) of a multiple of the direction: N, N·m, or a bare number if it is both."""
    d = np.asarray(d, dtype=float)
    force, moment = float(np.linalg.norm(d[:3])), float(np.linalg.norm(d[3:]))
    if force and not moment:
        return force, "N"
    if moment and not force:
        return moment, "N·m"
    return 1.0, "× the direction"


def actuator_unit(grasp: Grasp, actuator: str) -> str:
    """N·m for a motor on revolute joints, N for tendons and slides."""
    i = grasp.mechanism.actuators.index(actuator)
    if grasp.mechanism.tendon[i]:
        return "N"
    moved = [j.type for j, r in zip(grasp.joints, grasp.mechanism.R[i], strict=True) if r]
    return "N·m" if "revolute" in moved else "N"


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


def actuators_that_turn(witness: Witness) -> list[bool]:
    """Which actuators move in a witness's virtual motion, by more than rounding."""
    from handfast.stability import model

    grasp = witness.grasp
    moved = np.abs(model.actuator_motion(grasp, witness.state.q)) * model.actuator_arms(grasp)
    return list(moved > 1e-9 * model.force_scale(witness.wrench, witness.state.c))


# --- verdicts -----------------------------------------------------------------------------------


def unphysical(witness: Witness | None) -> bool:
    """Does friction push along the motion anywhere, so that energy comes out of nothing?"""
    if witness is None or witness.mdp:
        return False
    e = witness.energy
    return e.created > CREATED * (abs(e.disturbance) + abs(e.preload) + abs(e.stored))


def fragile(answer: Answer) -> bool:
    """Was it asked what a HOLDS leans on, and is that little?"""
    margin: Margin | None = getattr(answer, "margin", None)
    return margin is not None and margin.fragile


def margin_rows(margin: Margin) -> list[tuple[str, str, str]]:
    """What a HOLDS leans on: the thing, the number, and what it means."""
    squeezed = f"the most loaded pad alone gives way by {num(margin.squeeze, 3)} mm"
    rows = [(f"motion at {num(margin.stiffness)} N/m", f"{num(margin.motion, 3)} mm", squeezed)]
    for flip, what in ((margin.less, "less"), (margin.more, "more")):
        rows.append((f"{what} friction", *_flip(flip, 100.0, " %")))
    number, meaning = _flip(margin.tilt, 1.0, "°")
    if len(margin.tilt.contacts) == 1:
        meaning += f"; of contact {margin.tilt.contacts[0]} alone"
    elif margin.tilt.contacts:
        meaning += "; of several at once"
    return [*rows, ("normals tilted", number, meaning)]


def _flip(flip: Flip, factor: float, unit: str) -> tuple[str, str]:
    """The number at which a verdict flips, and how far that is known."""

    def size(x: float) -> str:
        return f"{num(factor * x)}{unit}"

    held = f"held in every sample up to {size(flip.holds)}" if flip.holds else "no smaller sample held"
    if flip.undecided:
        held += f", {count(flip.undecided, 'sample')} undecided"
    if flip.slips is None:
        return "no flip found", held
    return f"slips at {size(flip.slips)}", f"that is {'' if flip.certified else 'not '}proved; {held}"


def margin_note(margin: Margin) -> str:
    """What the numbers are, in a sentence or two."""
    cut = " It was interrupted." if margin.stop is not Stop.COMPLETE else ""
    return (
        f"By {margin.checks} further checks; between samples nothing is shown. The motion is the least that was "
        f"found.{cut}"
    )


def fragile_text(margin: Margin) -> str:
    """Why it is called fragile."""
    named = {"motion": "a large motion", "friction": "its friction", "tilt": "its normals"}
    return f"Fragile: it leans on {listed([named[w] for w in margin.why])}."


def up_to(answer: Answer) -> str:
    """', with virtual motions up to 10000 N' where a claim is not proved beyond; else ''."""
    proof = getattr(answer, "proof", None)
    return "" if proof is None or proof.cap is None else f", with virtual motions up to {num(proof.cap)} N"


def check_sentence(answer: CheckAnswer, load: str) -> str:
    match answer.verdict:
        case Verdict.HOLDS if unphysical(answer.witness):
            return f"{load} is balanced, but only by friction that creates energy: that is not physical."
        case Verdict.HOLDS:
            return f"The grasp resists {load} passively: an exact equilibrium was found and checked."
        case Verdict.SLIPS:
            return f"The object slips under {load}: no contact forces obey the model{up_to(answer)}."
        case _:
            return f"It was not decided whether the grasp resists {load}."


def max_sentence(answer: MaxAnswer, direction: Sequence[float] | Array) -> str:
    factor, unit = magnitude(direction)
    what = direction_text(direction)
    if unphysical(answer.witness):
        return f"Solutions exist for a {what}, but friction creates energy in them: they are not physical."
    if answer.unbounded:
        return f"A {what} of any size is resisted."
    if answer.verdict is Verdict.SLIPS:
        return f"No {what} is resisted, however small{up_to(answer)}."
    lower, upper = num(factor * answer.lower), num(factor * answer.upper)
    if answer.lower <= 0:
        above = f"; nothing above {upper} {unit} is{up_to(answer)}" if np.isfinite(answer.upper) else ""
        return f"It is not known yet whether any {what} is resisted{above}."
    if not np.isfinite(answer.upper):
        return f"A {what} of {lower} {unit} is resisted; whether more is, was not decided."
    if lower == upper:
        return f"The largest {what} that is resisted is {lower} {unit}{up_to(answer)}."
    return f"The largest {what} that is resisted is {lower} {unit}; none above {upper} {unit} is{up_to(answer)}."


def interval_sentence(answer: MaxAnswer, direction: Sequence[float] | Array) -> str:
    """Which smaller magnitudes are resisted; '' if that was not asked."""
    i = answer.interval
    if i is None:
        return ""
    factor, unit = magnitude(direction)

    def ranges(pairs: Sequence[tuple[float, float]]) -> str:
        return listed([f"{num(factor * a)} to {num(factor * b)} {unit}" for a, b in pairs])

    parts = [f"everything from 0 to {num(factor * i.holds_from_zero_to)} {unit} is resisted"]
    if i.holds_from_zero_to <= 0:
        parts = ["it is not shown that small magnitudes are resisted"]
        if i.holes and i.holes[0][0] <= 0:
            parts = ["magnitudes just above 0 are not resisted"]
    if i.holes:
        parts.append(f"it slips from {ranges(i.holes)}, though more is resisted")
    if i.unproved:
        parts.append(f"from {ranges(i.unproved)} not all is decided")
    text = "; ".join(parts) + "."
    return text[0].upper() + text[1:]


def torques_sentence(answer: TorquesAnswer, load: str, objective: str = "max") -> str:
    goal = "largest command" if objective == "max" else "sum of commands"
    if answer.verdict is Verdict.SLIPS:
        return f"No commands of these actuators resist {load}{up_to(answer)}."
    if answer.preload is None:
        return f"No commands were found yet that resist {load}."
    if answer.upper == 0:
        return f"{load} is resisted with every actuator locked: no command is needed."
    lower, upper = num(answer.lower), num(answer.upper)
    limit = "" if lower == upper else f", and none below {lower} suffices{up_to(answer)}"
    grasp = answer.witness.grasp if answer.witness else None
    units = {actuator_unit(grasp, name) for name, f in answer.preload.items() if f} if grasp else {"N·m"}
    return f"The {goal} that {load} needs is {upper} {' or '.join(sorted(units))}{limit}."


def reason(answer: Answer, settings: Settings) -> str:
    """Why an answer is not complete, and what helps; '' if it is."""
    match answer.stop:
        case Stop.COMPLETE:
            return ""
        case Stop.TIME:
            limit = num(settings.time_limit)
            return f"The time limit of {limit} s was hit; a larger --time-limit may decide it."
        case Stop.NODES:
            return f"The node limit of {num(settings.node_limit)} was hit; a larger --node-limit may decide it."
        case Stop.INTERRUPTED:
            return "It was interrupted; these are the bounds so far."
        case _ if settings.method == "engine" and answer.verdict is Verdict.HOLDS:
            return f"The bounds have not met to {num(100 * settings.gap)} %: the numbers did not suffice for all cases."
        case _ if settings.method == "engine":
            return "The search ended without an answer: the numbers did not suffice for all cases."
        case _ if answer.verdict is Verdict.HOLDS and settings.sectors < 2048:
            return (
                f"The bounds have not met to {num(100 * settings.gap)} % with {settings.sectors} sectors "
                f"({num(360 / settings.sectors)}° each); more --sectors bring them closer."
            )
        case _ if answer.verdict is Verdict.HOLDS:
            gap = num(100 * settings.gap)
            return f"The bounds have not met to {gap} %; more --sectors may bring them closer."
        case _ if answer.steps and answer.steps[-1].finished:
            return (
                f"The relaxed model has a solution at the finest of {settings.sectors} sectors, but no exact "
                "one was found near it; more --sectors may decide it."
            )
        case _:
            return "The search ended without an answer: the solver's numbers did not suffice."


def work(answer: Answer, settings: Settings) -> str:
    """How an answer was found, and what proves it."""
    seconds = f"{num(answer.seconds, 2)} s"
    if settings.method == "algorithm1":
        return f"Algorithm 1 on {settings.solver}: {count(len(answer.steps), 'program')}, {seconds}"
    found = f"{count(answer.nodes, 'node')}, {seconds}"
    return f"{found}; {certified(answer.certificate, answer.verified)}" if answer.certificate else found


def certified(certificate: Certificate, verified: bool) -> str:
    """'certificate of 4 leaves, replayed'."""
    leaves = count(len(certificate.leaves), "leaf")
    return f"certificate of {leaves}, {'replayed' if verified else 'not replayed yet'}"


def curve_states(curve: Curve) -> list[str]:
    """Per case 'unbounded', 'resisted', 'slips' or 'open' (bounds far apart or case not reached)."""
    out = []
    for lower, upper, unbounded, verdict in zip(curve.lower, curve.upper, curve.unbounded, curve.verdicts, strict=True):
        if unbounded:
            out.append("unbounded")
        elif verdict is Verdict.SLIPS:
            out.append("slips")
        elif verdict is Verdict.UNDECIDED or not upper <= 1.05 * lower:
            out.append("open")
        else:
            out.append("resisted")
    return out


def weight_states(curve: Curve, weight: float) -> list[str]:
    """Per direction "enough" (a force of at least the weight is resisted), "weak" (none is) or "open"."""
    enough = curve.unbounded | (np.nan_to_num(curve.lower) >= weight)
    weak = np.nan_to_num(curve.upper, nan=np.inf) < weight
    return ["enough" if a else "weak" if b else "open" for a, b in zip(enough, weak, strict=True)]


def weight_sentence(curve: Curve, weight: float) -> str:
    """'A weight of 5 N: 30 of 36 directions resist as much, 6 less.'"""
    states = weight_states(curve, weight)
    text = f"A weight of {num(weight)} N: {states.count('enough')} of {len(states)} directions resist as much"
    text += f", {states.count('weak')} less" if "weak" in states else ""
    return text + (f", {states.count('open')} not decided." if "open" in states else ".")
