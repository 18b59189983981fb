"""What answers say, in sentences: verdicts, bounds, why a search stopped, what a HOLDS leans on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.pictures import words
from handfast.pictures.words import count, listed, magnitude, num
from handfast.proofs.answers import EACH_TIME
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.load_path import LoadPath

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.proofs.certificate import Certificate
    from handfast.stability.answers.answer import Answer
    from handfast.stability.answers.margin import Flip, Margin
    from handfast.stability.problem.settings import Settings
    from handfast.stability.problem.witness import Witness
    from handfast.stability.studies.hold import HoldAnswer
    from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer

CREATED = 1e-6  # friction that feeds in a larger share of the work than this is called unphysical


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


def verdict_word(answer: Answer) -> str:
    """'HOLDS', 'HOLDS, FRAGILE' or 'HOLDS?': of a state that is not physical."""
    return answer.verdict.upper() + ("?" if unphysical(answer.witness) else ", FRAGILE" * fragile(answer))


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
    return f"Fragile: it leans on {listed([words.LEANS[w] for w in margin.why])}."


def up_to(answer: Answer) -> str:
    """', with virtual motions up to 10000 N' where a claim is not proved beyond; else ''."""
    if answer.motion_cap is None:
        return ""
    each = EACH_TIME if isinstance(answer, MaxAnswer) and answer.caps_each_time else ""
    return f", with virtual motions up to {num(answer.motion_cap)} N{each}"


def check_sentence(answer: CheckAnswer, load: str) -> str:
    if isinstance(answer.path, LoadPath):
        return _path_sentence(answer, answer.path, load)
    match answer.verdict:
        case Verdict.HOLDS if unphysical(answer.witness):
            return f"{load} is balanced, but only by friction that creates energy: that is not physical."
        case Verdict.HOLDS:
            return f"The grasp resists {load} passively: an exact equilibrium was found and checked."
        case Verdict.SLIPS:
            return f"The object slips under {load}: no contact forces obey the model{up_to(answer)}."
        case _:
            return f"It was not decided whether the grasp resists {load}."


def _path_sentence(answer: CheckAnswer, path: LoadPath, load: str) -> str:
    """Of a load that comes after the squeeze."""
    steps = count(len(path.steps) - 1, "step")
    if answer.verdict is Verdict.HOLDS:
        lead = "leads" if len(path.steps) == 2 else "lead"
        return f"After the squeeze {steps} {lead} to {load}, each to an exact equilibrium that was found and checked."
    if answer.verdict is Verdict.SLIPS and path.reached is None:
        return f"The commands alone are in no balance, so that no path leads to {load}{up_to(answer)}."
    reached = f"{num(100 * (path.reached or 0.0))} %"
    if answer.verdict is Verdict.SLIPS and path.slips_at is not None:
        at = f"{num(100 * path.slips_at)} %"
        return f"After the squeeze the path to {load} ends: from {reached} of it, {at} are not reached{up_to(answer)}."
    return f"After the squeeze {reached} of {load} are reached; how the path goes on was not decided."


def _end_sentence(answer: MaxAnswer, path: LoadPath, what: str, factor: float, unit: str) -> str:
    """Of a load that grows after the squeeze."""
    lower, upper = (f"{num(factor * x)} {unit}" for x in (answer.lower, answer.upper))
    if answer.unbounded:
        return f"After the squeeze a {what} may grow to any size, as far as was looked: up to {lower}."
    if answer.upper == 0 and path.reached is not None:
        return f"No {what} is resisted, however small{up_to(answer)}."
    if path.reached is None:
        known = "are in no balance" if answer.verdict is Verdict.SLIPS else "may be in no balance"
        return f"The commands alone {known}, so that no path begins{up_to(answer)}."
    if not np.isfinite(answer.upper):
        return f"After the squeeze a {what} may grow to {lower}; how its path goes on was not decided."
    return f"After the squeeze a {what} may grow to {lower}: from there {upper} are not reached{up_to(answer)}."


def max_sentence(answer: MaxAnswer, direction: Sequence[float] | Array) -> str:
    factor, unit = magnitude(direction)
    what = words.direction_text(direction)
    if isinstance(answer.path, LoadPath):
        return _end_sentence(answer, answer.path, what, factor, unit)
    if unphysical(answer.witness):
        return f"Solutions exist for a {what}, but friction creates energy in them: they are not physical."
    if answer.unbounded:
        looked = answer.question is not None and answer.question.has_scalar  # else what holds at one size does at all
        far = f", as far as was looked: up to {num(factor * answer.lower)} {unit}" if looked else ""
        return f"A {what} of any size is resisted{far}."
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
    return words.sentence("; ".join(parts))


def torques_sentence(answer: TorquesAnswer, load: str, objective: str = "max") -> str:
    goal = "largest command" if objective == "max" else "sum of commands"
    if answer.sought is not None:
        return _found_sentence(answer, load, goal)
    if answer.verdict is Verdict.SLIPS:
        return f"No commands of these actuators resist {load}{up_to(answer)}."
    if answer.preload is None:
        return f"No commands were found yet that resist {load}."
    if answer.upper == 0:
        return f"{load} is resisted with every actuator locked: no command is needed."
    lower, upper = num(answer.lower), num(answer.upper)
    limit = "" if lower == upper else f", and none below {lower} suffices{up_to(answer)}"
    grasp = answer.witness.grasp if answer.witness else None
    units = {words.actuator_unit(grasp, name) for name, f in answer.preload.items() if f} if grasp else {"N·m"}
    return f"The {goal} that {load} needs is {upper} {' or '.join(sorted(units))}{limit}."


def _found_sentence(answer: TorquesAnswer, load: str, goal: str) -> str:
    """Of commands before the load: they were found, and nobody says that they are the least."""
    if answer.verdict is Verdict.SLIPS:
        return f"No commands of these actuators hold {load} on any path after the squeeze."
    lower = num(answer.lower)
    if answer.preload is None:
        known = f"; it is at least {lower}" if answer.lower > 0 else ""
        return f"No commands were found that hold {load} after the squeeze{known}."
    if answer.upper == 0:
        return f"{load} is held with every actuator locked: no command is needed."
    known = f"none below {lower} holds it on any path" if answer.lower > 0 else "no lower bound above 0 is known"
    grasp = answer.witness.grasp if answer.witness else None
    units = {words.actuator_unit(grasp, name) for name, f in answer.preload.items() if f} if grasp else {"N·m"}
    at_most = f"{num(answer.upper)} {' or '.join(sorted(units))}"
    return f"Commands were found that hold {load} after the squeeze, their {goal} {at_most}; {known}."


def reason(answer: Answer, settings: Settings) -> str:
    """Why an answer is not complete, and what helps; '' if it is."""
    match answer.stop:
        case Stop.COMPLETE:
            return ""
        case Stop.TIME:
            limit = num(settings.timeout)
            return f"The time limit of {limit} s was hit; a larger --timeout may decide it."
        case Stop.NODES:
            return f"The node limit of {num(settings.nodes)} was hit; a larger --nodes may decide it."
        case Stop.INTERRUPTED:
            return "It was interrupted; these are the bounds so far."
        case _ if answer.verdict is Verdict.HOLDS:
            return f"The bounds have not met to {num(100 * settings.gap)} %: the numbers did not suffice for all cases."
        case _:
            return "The search ended without an answer: the numbers did not suffice for all cases."


def work(answer: Answer) -> str:
    """How an answer was found, and what proves it."""
    parts = [f"{count(answer.nodes, 'node')}, {num(answer.seconds, 2)} s"]
    if answer.motion is not None:
        state = "an exact state" if answer.exact else "a state to 1e-9 of the load"
        parts.append(f"{state}, with virtual motions of {num(answer.motion)} N")
    if answer.certificate:
        parts.append(certified(answer.certificate, answer.verified))
    return "; ".join(parts)


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


def actuators_that_turn(witness: Witness) -> list[bool]:
    """Which actuators move in a witness's virtual motion, by more than rounding."""
    from handfast.stability.problem import model

    grasp = witness.grasp
    moved = np.abs(model.actuator_motion(grasp, witness.state.q)) * model.actuator_arms(grasp)
    return list(moved > 1e-9 * model.force_scale(witness.wrench, witness.state.c))


def answer_sentence(answer: Answer, direction: Sequence[float] | Array | None = None, objective: str = "") -> str:
    """What the answer to a check, a maximum or least commands says.

    Args:
        direction: (6,) of a maximum as it was asked about; that of its question by default.
        objective: of least commands, "max" or "sum"; that of its question by default.
    """
    posed = answer.posed
    if isinstance(answer, MaxAnswer):
        if direction is None:
            direction = posed.problem.along if posed else np.eye(6)[0]
        said = max_sentence(answer, direction), interval_sentence(answer, direction)
        return " ".join(s for s in said if s)
    wrench = state_of(answer)[0]
    load = "this load" if wrench is None else words.load_text(wrench)
    if isinstance(answer, TorquesAnswer):
        return torques_sentence(answer, load, objective or ("sum" if answer.sums_commands else "max"))
    assert isinstance(answer, CheckAnswer)
    return check_sentence(answer, load)


def state_of(answer: Answer) -> tuple[Array | None, Witness | None]:
    """The disturbance that an answer is about, and the equilibrium under it, as far as there are any."""
    if answer.witness is not None:
        return answer.witness.wrench, answer.witness
    if answer.posed is None or isinstance(answer, MaxAnswer):
        return None, None
    return answer.posed.problem.wrench, None


def map_sentence(answer: MapAnswer) -> str:
    """In how many directions something is resisted."""
    parts = []
    for name, curve in (("without preload", answer.passive), ("with it", answer.preloaded)):
        if curve is not None:
            states, lower = curve_states(curve), np.nan_to_num(curve.lower)
            some = sum(bool(u or x > 0) for u, x in zip(curve.unbounded, lower, strict=True))
            text = f"{name}, some force is resisted in {some} of {len(states)} directions"
            unknown = sum(s == "open" and not x > 0 for s, x in zip(states, lower, strict=True))
            text += f", {unknown} not decided" if unknown else ""
            if more := states.count("open") - unknown:
                text += f"; how much more is resisted in {more} of them was not decided"
            parts.append(text)
    return words.sentence("; ".join(parts))


def share_word(answer: MapAnswer | SweepAnswer) -> str:
    """The verdict, and of how many cases it is, where it is not that of all: 'slips in 3 of 21'."""
    of, cases = answer.verdicts.count(answer.verdict), len(answer.verdicts)
    return str(answer.verdict) + ("" if of == cases else f" in {of} of {cases}")


def cases_text(answer: MapAnswer | SweepAnswer) -> str:
    """In how many cases something is resisted."""
    held, cases = answer.verdicts.count(Verdict.HOLDS), len(answer.verdicts)
    return f"something is resisted in {held} of {count(cases, 'case')}"


def sweep_sentence(answer: SweepAnswer) -> str:
    """What varies, and in how many cases something is resisted."""
    return f"The command of {answer.actuator} varies: {cases_text(answer)}."


def hold_sentence(answer: HoldAnswer) -> str:
    """What the verdict about one preload for all loads says."""
    loads = count(len(answer.loads), "load")
    if answer.verdict is Verdict.HOLDS:
        if answer.upper == 0:
            return f"Every actuator may stay locked: {loads} resisted, no command needed."
        below = f"; none below {num(answer.lower)} suffices" if answer.lower > 0 else ""
        loads += ", each on its path after the squeeze" if answer.loading != "together" else ""
        return f"One preload holds {loads}; its largest command is {command_text(answer)}{below}."
    if answer.verdict is Verdict.SLIPS and answer.refuted:
        name, proof = answer.refuted
        if proof is None:
            return f"No preload holds {name}: no forces at the contacts balance it."
        if np.isfinite(answer.command_limit) and proof.verdict is not Verdict.SLIPS:
            return f"No preload of commands up to {num(answer.command_limit)} holds {name}."
        return f"No preload of these actuators holds {name}."
    return f"It was not decided whether one preload holds {loads}."


def command_text(answer: HoldAnswer) -> str:
    """'0.12 N·m', of the largest command; 'locked' where none is needed."""
    if answer.preload is None or answer.grasp is None:
        return "–"
    name = max(answer.preload, key=lambda n: abs((answer.preload or {})[n]), default="")
    if not name or not answer.preload[name]:
        return "locked"
    return f"{num(answer.upper)} {words.actuator_unit(answer.grasp, name)}"
