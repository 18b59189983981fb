"""What an answer about one disturbance claims, and its replay: check (20), maximum (23), least commands (26).

A `handfast/result/1` file holds the question, the answer, the state behind HOLDS (the *witness*) and the proof behind
SLIPS or a bound (the *certificate*); of a maximum also arcs of states and certificates of smaller magnitudes. Every key
of the answer is worked out again from these, but for `COURSE_KEYS`, and none is there that its query does not have.

HOLDS and SLIPS exclude each other: HOLDS is an exact state of the numbers in the file, or, where the answer says so,
one for a load and joint torques that differ by 1e-9 of the load; SLIPS says that there is neither. A SLIPS up to a
`motion_cap` says so of states that move by no more: a HOLDS of the same question has a `motion` that is larger.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.proofs import checker, ranges
from handfast.proofs.certificate import Certificate, read_certificate
from handfast.proofs.constants import END_TOLERANCE
from handfast.proofs.existence import FORCE_DEVIATION, Proved, prove
from handfast.proofs.fields import EQUALITY_TOLERANCE, Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import CHECK, SMALLEST_PRELOAD, TORQUES, Question, Range, read_question
from handfast.proofs.ranges import Known, known
from handfast.proofs.replay import SEARCH_STOPS, Figure, Refused, Replay, down, up
from handfast.proofs.states import ContactMode, Problem, State, read_state
from handfast.proofs.tolerance import (
    COMPLETE_CAP,
    UNBOUNDED_FACTOR,
    drives,
    farthest,
    in_play,
    load_scale,
    motion_size,
    no_magnitude,
    size_of,
)

SCHEMA = "handfast/result/1"
VERDICTS = "holds", "slips", "undecided"
COURSE_KEYS = "stop", "seconds", "nodes", "verified"  # the course of the search: recorded, and nothing rests on it
ANSWER_NOT_REPLAYED = f"{', '.join(COURSE_KEYS)}: the course of the search is recorded, and nothing rests on it"
RESIDUAL_ROUNDING = 1e-12  # of residuals: they are made of it
SUM_ROUNDING = 1e-14  # relative to the sum of the terms' sizes: more than rounding in another order
UPPER_BOUND_FACTOR = 2.0  # times an upper bound: up to there at least nothing is resisted
LIMIT_CLAIM = "that the largest magnitude is only approached, and by which motion; its limit lies between the bounds"
EACH_TIME = " for each time of the direction"
UNBOUNDED_CLAIM = f"unbounded: that more is resisted than is shown, at least {UNBOUNDED_FACTOR:g} times what else acts"
OF_INTERVAL = "holds_from_zero_upper", "holes", "unproved", "resolution"  # keys beside `holds_from_zero_to`


@dataclass(frozen=True, eq=False)
class SavedWitness:
    """A state and what it answers for: wrench (6,) and commands (a,)."""

    wrench: Array
    command: Array
    state: State


@dataclass(frozen=True, eq=False)
class SavedAnswer:
    """A result file, read.

    Attributes:
        question: what was asked.
        said: the answer, as JSON.
        witness, certificate: what backs it; None without.
        arcs, slips: states and certificates of smaller magnitudes.
    """

    question: Question
    said: Mapping[str, Any]
    witness: SavedWitness | None
    certificate: Certificate | None
    arcs: tuple[ranges.Arc, ...] = ()
    slips: tuple[Certificate, ...] = ()

    @property
    def holds(self) -> bool:
        return self.said["verdict"] == "holds"

    def number(self, key: str) -> float | None:
        """A number of the answer, None for null; `Refused` for what is none."""
        x = self.said.get(key)
        if x is not None and (isinstance(x, bool) or not isinstance(x, int | float)):
            raise Refused(f"{key} is {x!r}, no number")
        return None if x is None else float(x)


def read_answer(data: Any, place: str = "") -> SavedAnswer:
    """A parsed `handfast/result/1` object. Raises `BadFile`."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    question = read_question(f.take("question"), f.at("question"))
    said = read_said(f, QUERIES)
    witness, certificate = read_proofs(f, question)
    of_arcs = tuple(ranges.read_arc(x, question) for x in f.objects("arcs", []))
    of_slips = tuple(read_certificate(x, place, question) for x, place in f.items("slips", []))
    f.done()
    return SavedAnswer(question, said, witness, certificate, of_arcs, of_slips)


def read_said(f: Fields, queries: Collection[str]) -> Mapping[str, Any]:
    """The answer in a file, as JSON: to one of these queries, and with its course. Raises `BadFile`."""
    answer = f.take("answer")
    said = Fields(answer, f.at("answer"))
    said.text("schema", among=["handfast/answer/1"])
    for name, among in (("query", queries), ("verdict", VERDICTS), ("stop", SEARCH_STOPS)):
        said.text(name, among=tuple(among))
    said.number("seconds", least=0.0)
    said.whole("nodes")
    said.flag("verified")
    return dict(answer)


def read_proofs(f: Fields, q: Question) -> tuple[SavedWitness | None, Certificate | None]:
    """What is in a file for and against a question; None for what is not there, or null. Raises `BadFile`."""
    witness = _read_witness(f.object("witness"), q) if f.has("witness") else None
    place = f.at("certificate")
    return witness, read_certificate(f.take("certificate"), place, q) if f.has("certificate") else None


def _read_witness(f: Fields, q: Question) -> SavedWitness:
    wrench, by_name = f.numbers("wrench", (6,)), f.named("command")
    if set(by_name) != set(q.grasp.actuators):
        raise BadFile(f"are not those of the actuators {', '.join(q.grasp.actuators)}", f.at("command"))
    command = q.grasp.commands(by_name, f.at("command"))
    witness = SavedWitness(wrench, command, read_state(f, q.grasp))
    f.done()
    return witness


def replay(saved: SavedAnswer) -> Replay:
    """Is everything that an answer claims proved?"""
    query = QUERIES[saved.said["query"]]
    parts: list[Replay] = []
    try:
        proved = None
        if saved.witness is not None or saved.holds:
            proved, part = _witness(saved, query)
            parts.append(part)
        part_of_certificate, cap = _certificate(saved, query)
        parts += part_of_certificate
        parts += query.smaller(saved)
        reason = ""
        if not any(part.reason for part in parts):
            _compare(saved, query, proved, cap)
    except Refused as fault:
        reason = f"answer: {fault}"
    said = ("limit", LIMIT_CLAIM), ("unbounded", UNBOUNDED_CLAIM)
    more = [claim for key, claim in said if saved.said.get(key) not in (None, False)]
    return Replay(saved.said["query"], "", reason, parts=tuple(parts), not_replayed=(*more, ANSWER_NOT_REPLAYED))


def _witness(saved: SavedAnswer, query: Query) -> tuple[Proved | None, Replay]:
    q, w = saved.question, saved.witness
    if w is None:
        raise Refused("HOLDS without a witness")
    if not saved.holds:
        raise Refused(f"{saved.said['verdict'].upper()} with a witness")
    claim, base, along, magnitude, command = query.held(saved, w)
    if not close(w.command, command):
        return None, Replay("witness", claim, "it is a state with other commands")
    found = prove(Problem.of(q, command, base, along, magnitude), w.state, least=query.least(saved))
    return found, held("witness", claim, found, query.held_fault(saved, w, found))


def held(name: str, claim: str, found: Proved, fault: str = "") -> Replay:
    """The claim that a state exists, from what is proved of it; fault: what else is wrong with it, "" if nothing."""
    reason = found.reason if not (found.exact or found.tolerant) else fault
    claim += f", with virtual motions of {found.motion:.6g} N" if not reason else ""
    claim += "" if found.exact else ", to 1e-9 of the load"
    figures = {"residual": found.residual, "exact": found.exact, "radius": found.radius, "motion": found.motion}
    return Replay(name, claim, reason, figures)


def refuted(claim: str, c: Certificate, magnitude: float | None, motion: Array | None, complete: bool) -> Replay:
    """The claim that no state exists, from its certificate.

    magnitude, motion: as of `cap_fault`, which is asked if it is to count as complete; None of a load alone.
    """
    found = checker.verify(c, to_the_end=False)
    reason, q, cap = found.reason, c.question, found.cap
    if cap is not None and not reason:
        reason = cap_fault(q, cap, magnitude or 0.0, motion) if complete else ""
        cap = told_cap(q, cap, magnitude or 0.0)
        claim += f", up to virtual motions of {down(cap)} N"
        claim += EACH_TIME if magnitude == 0 and (q.homogeneous or not q.has_scalar) else ""
    figures = {"motion_cap": cap, "leaves": found.leaves, "margin": found.margin}
    return Replay("certificate", claim, reason, figures)


def _certificate(saved: SavedAnswer, query: Query) -> tuple[list[Replay], float | None]:
    """What its certificate shows, as parts, and the cap on motions that it is proved up to."""
    q, c = saved.question, saved.certificate
    need = query.refuted(saved)
    if need is None:
        if c is not None:
            raise Refused("has a certificate, but claims nothing that needs one")
        return [], None
    claim, magnitude, (lo, hi) = need
    if c is None:
        raise Refused(f"{claim}: no certificate")
    if c.scalar is not None and not (c.scalar[0] <= lo and c.scalar[1] >= hi):
        reason = f"it covers {c.scalar[0]:.9g} to {c.scalar[1]:.9g}; the answer needs {lo:.9g} to {hi:.9g}"
        return [Replay("certificate", claim, reason)], None
    if saved.said["query"] == "max":
        claim += f", up to {down(q.magnitudes(c.scalar)[1])} times the direction" if c.scalar is not None else ""
    complete = saved.said["stop"] == "complete" or saved.said["verdict"] == "slips"
    bounded = None if saved.said["query"] == "check" else magnitude
    part = refuted(claim, c, bounded, saved.witness.state.motion if saved.witness else None, complete)
    return [part], motion_cap(part)


def motion_cap(part: Replay) -> float | None:
    """[N] up to which virtual motions a certificate is proved, see `refuted`; None without any end."""
    cap = part.figures["motion_cap"]
    return cap if isinstance(cap, float) else None


def told_cap(q: Question, cap: float, magnitude: float) -> float:
    """[N] the cap on motions at a magnitude of the direction, from that of a certificate.

    Where states are multiples of each other a certificate is about those of the direction itself: the cap is then in
    proportion to the magnitude, and stays that for each time of the direction where the magnitude is 0.
    """
    return cap * magnitude if q.homogeneous and magnitude else cap


def cap_fault(q: Question, cap: float, magnitude: float, motion: Array | None) -> str:
    """Why a bound that is proved for motions inside a cap [N] does not count as complete; "" if it does.

    The cap has to be far above every force in play at the bound, a magnitude of the direction or commands that are
    sought, and beyond motion (6 + l,), what the answer's own witness moves by. Where nothing of a direction is
    resisted, and states are multiples of each other, at the magnitude at which it is as large as what else is in play.
    """
    if q.homogeneous and not magnitude:
        magnitude = drives(q) / size_of(q.grasp, q.direction) or 1.0
    most, cap = in_play(q, magnitude), told_cap(q, cap, magnitude)
    moved = 0.0 if motion is None else motion_size(q.grasp, motion)
    said = f"it is proved for motions up to {cap:.3g} N only, "
    if cap < COMPLETE_CAP * most:
        return f"{said}not {COMPLETE_CAP:g} times the forces in play, {most:.3g} N"
    return f"{said}and its own witness moves by {moved:.3g} N" if cap < moved else ""


def _compare(saved: SavedAnswer, query: Query, proved: Proved | None, cap: float | None) -> None:
    """`Refused` if an answer has other keys than its query's, or says else than what was replayed."""
    said = saved.said
    shown: dict[str, Any] = {key: said[key] for key in ("schema", "query", "verdict")}
    shown |= {"certified": saved.certificate is not None, "motion_cap": cap}
    shown |= {"exact": None if proved is None else proved.exact, "motion": None if proved is None else proved.motion}
    shown |= query.shown(saved, proved)
    w = saved.witness
    compare(said, shown, COURSE_KEYS, None if w is None else described_rounding(saved.question.grasp, w.state))


def compare(
    said: Mapping[str, Any],
    shown: Mapping[str, Any],
    course: Collection[str],
    rounding: Mapping[str, Any] | None = None,
) -> None:
    """`Refused` if an answer has other keys than those that are shown, but for `course`, or says otherwise.

    rounding: by key how far numbers may be off, of those of a state; see `described_rounding`.
    """
    for key in said:
        if key not in shown and key not in course:
            raise Refused(f"{key} is nothing that it can say; leave it out")
    for key, value in shown.items():
        if key not in said:
            raise Refused(f"{key} is missing")
        numbers = _is_number(said[key]) and isinstance(value, float)
        within = {"residual": RESIDUAL_ROUNDING, "motion": FORCE_DEVIATION * value}.get(key, 0.0) if numbers else 0.0
        rounds = numbers and abs(said[key] - value) <= within and said[key] >= 0
        says_less = numbers and key == "motion_cap" and 0 <= said[key] <= value
        if rounding and key in rounding and value is not None:
            equal = alike(said[key], value, rounding[key])
        else:
            equal = said[key] == value if key == "preload" else matches(said[key], value)
        if not (rounds or says_less or equal):
            raise Refused(f"{key} is not what the rest of the file shows")


# --- the queries ----------------------------------------------------------------------------------

Held = tuple[str, Array, Array | None, float, Array]  # claim, load, direction of an unknown magnitude, commands
Refuted = tuple[str, float, Range]  # claim, magnitude or commands, range of the scalar that is to be covered


class Query:
    """`check`: does the grasp resist the load?"""

    def held(self, saved: SavedAnswer, w: SavedWitness) -> Held:
        """What the witness of an answer that HOLDS has to be."""
        q = saved.question
        if not close(w.wrench, q.wrench):
            raise Refused("witness: it is a state under another disturbance")
        claim = "the disturbance is resisted" + ("" if q.grasp.start is None else " from the state before")
        return claim, q.wrench, None, 0.0, q.grasp.command

    def least(self, saved: SavedAnswer) -> float:
        """The magnitude that its witness has to reach; -inf without one."""
        return -np.inf

    def held_fault(self, saved: SavedAnswer, w: SavedWitness, found: Proved) -> str:
        """What else is wrong with a witness that is proved; "" if nothing."""
        return ""

    def refuted(self, saved: SavedAnswer) -> Refuted | None:
        """What the certificate has to show; None if nothing needs one."""
        q = saved.question
        if q.goal != CHECK:
            raise Refused(f"is of a check, its question of '{q.goal}'")
        return (q.claim(None), 0.0, (0.0, 0.0)) if saved.said["verdict"] == "slips" else None

    def smaller(self, saved: SavedAnswer) -> list[Replay]:
        """The replay of what is said of smaller magnitudes."""
        if saved.arcs or saved.slips:
            raise Refused("has states or certificates of smaller magnitudes, but claims nothing of them")
        return []

    def shown(self, saved: SavedAnswer, proved: Proved | None) -> dict[str, Any]:
        """What it has to say by key, beside what every answer says."""
        w, g = saved.witness, saved.question.grasp
        state = UNPROVED_STATE if w is None or proved is None else described(g, w.state, proved)
        return state | {"margin": None}  # nothing in the file shows a margin


class Maximum(Query):
    """`max`: which is the largest magnitude of a direction that is resisted?"""

    def held(self, saved: SavedAnswer, w: SavedWitness) -> Held:
        base, along, lower = *line(saved), saved.number("lower") or 0.0
        magnitude = 0.0 if saved.number("lower") == 0 else self._magnitude(saved, w)
        if not close(w.wrench, base + magnitude * along) or magnitude < lower:
            raise Refused("witness: it is a state under another disturbance")
        claim = f"{down(lower)} times the direction is resisted, or more" if lower > 0 else "the base load is resisted"
        return claim, base, (along if lower > 0 else None), magnitude, saved.question.grasp.command

    def least(self, saved: SavedAnswer) -> float:
        return saved.number("lower") or 0.0

    def _magnitude(self, saved: SavedAnswer, w: SavedWitness) -> float:
        """That of the load that a witness says it is under."""
        base, along = line(saved)
        return max(float((w.wrench - base) @ along / (along @ along)), 0.0)

    def held_fault(self, saved: SavedAnswer, w: SavedWitness, found: Proved) -> str:
        if found.magnitude is None:
            return ""
        (low, high), said = found.magnitude, self._magnitude(saved, w)
        if not found.reaches(self.least(saved)):
            return f"it is proved from a magnitude of {low:.15g} on"
        q, along = saved.question, line(saved)[1]
        off = max(said - low, high - said) * size_of(q.grasp, along)
        near = off <= FORCE_DEVIATION * max(load_scale(q.grasp, w.wrench), drives(q))
        return "" if near else f"it is proved at a magnitude of {low:.9g}, not at {said:.9g}"

    def refuted(self, saved: SavedAnswer) -> Refuted | None:
        q, end = saved.question, self._end(saved)
        if not end > 0:
            raise Refused("what else acts is nothing beside its direction")
        self._check_bounds(saved, end)
        lower, upper = saved.number("lower") or 0.0, saved.number("upper")
        if upper is None:
            return None
        end = max(end, UPPER_BOUND_FACTOR * upper)
        if lower > upper:
            raise Refused(f"its lower bound {lower:.9g} is above its upper bound {upper:.9g}")
        slips = saved.said["verdict"] == "slips"
        claim = f"{'nothing' if slips else f'nothing above {up(upper)} times the direction'} is resisted"
        if not q.has_scalar:  # homogeneous: what slips at one magnitude slips at all
            if not slips:
                raise Refused("has an upper bound where magnitudes make no difference")
            return claim, 0.0, (0.0, 0.0)
        if q.homogeneous:  # its scalar is 1 / s
            return claim, upper, ((1 + END_TOLERANCE) / end, (1 - EQUALITY_TOLERANCE) / upper if upper > 0 else np.inf)
        return claim, upper, (upper * (1 + EQUALITY_TOLERANCE), end * (1 - END_TOLERANCE))

    def _end(self, saved: SavedAnswer) -> float:
        q = saved.question
        return farthest(q) if q.has_scalar else farthest(_with_direction(q))

    def _check_bounds(self, saved: SavedAnswer, end: float) -> None:
        """`Refused` if verdict and bounds contradict each other."""
        verdict, unbounded = saved.said["verdict"], saved.said.get("unbounded")
        lower, upper = saved.number("lower"), saved.number("upper")
        if lower is None or not lower >= 0:
            raise Refused(f"a largest magnitude of {lower}")
        base, _ = line(saved)
        if verdict == "holds" and not unbounded and lower == 0 and not base.any():
            raise Refused("HOLDS without a magnitude that is resisted")
        if verdict != "holds" and lower != 0:
            raise Refused(f"{verdict.upper()} with a magnitude that is resisted")
        if verdict == "slips" and upper != 0:
            raise Refused("SLIPS with bounds above 0")
        if unbounded and (upper is not None or verdict != "holds"):
            raise Refused("unbounded, with a bound")
        if unbounded and not lower >= end * (1 - 2 * END_TOLERANCE):
            raise Refused(f"unbounded, but shown up to {lower:.6g} only; {end:.6g} is needed")

    def smaller(self, saved: SavedAnswer) -> list[Replay]:
        to = saved.number("holds_from_zero_to")
        if to is None:
            if any(saved.said.get(key) for key in OF_INTERVAL[:3]):
                raise Refused("has holes, but does not say up to where everything is resisted")
            return super().smaller(saved)
        holes = _pairs(saved, "holes")
        shown = [f"everything up to {down(to)} times the direction is resisted"] if to > 0 else []
        if holes:
            shown.append(f"nothing at {', '.join(f'{up(a)} to {down(b)}' for a, b in holes)}")
        claim = ", ".join(shown) or "of magnitudes from 0 on nothing is said"
        if holes:
            claim += f" but for {saved.number('resolution') or 0.0:g} of the magnitude at the ends"
        bounds = [ranges.replayed(saved.question, arc) for arc in saved.arcs]
        reason = next((fault for fault, _ in bounds if fault), "") or _slips_fault(saved) or _ranges_fault(saved, holes)
        figures: dict[str, Figure] = {"arcs": len(saved.arcs), "slips": len(saved.slips)}
        figures |= {"residual": max((off for _, off in bounds), default=0.0)}
        return [Replay("interval", claim + ", to 1e-9 of load and commands", reason, figures)]

    def shown(self, saved: SavedAnswer, proved: Proved | None) -> dict[str, Any]:
        """The bounds are those that witness and certificate were held against."""
        lower, upper, said = saved.number("lower") or 0.0, saved.number("upper"), saved.said
        gap = 0.0 if said.get("unbounded") or upper == 0 else None
        if gap is None and upper is not None and lower > 0:
            gap = (upper - lower) / lower
        out: dict[str, Any] = {"lower": lower, "upper": upper, "gap": gap, "unbounded": bool(said.get("unbounded"))}
        out["holds_from_zero_to"] = said.get("holds_from_zero_to")  # held against states and certificates
        if out["holds_from_zero_to"] is not None:
            out |= {name: said.get(name) for name in OF_INTERVAL}
        limit = said.get("limit")
        out |= {"attained": limit is None, "limit": limit}
        if limit is not None:
            value = limit.get("value") if isinstance(limit, Mapping) else None
            if not isinstance(value, float) or upper is None or not lower <= value <= upper * (1 + EQUALITY_TOLERANCE):
                raise Refused("its limit lies outside of its bounds")
        return out


class Torques(Query):
    """`torques`: which commands resist the load with the least effort?"""

    def held(self, saved: SavedAnswer, w: SavedWitness) -> Held:
        if not close(w.wrench, saved.question.wrench):
            raise Refused("witness: it is a state under another disturbance")
        upper = saved.number("upper")
        return f"commands of {up(upper or 0.0)} suffice", saved.question.wrench, None, 0.0, w.command

    def held_fault(self, saved: SavedAnswer, w: SavedWitness, found: Proved) -> str:
        """Are the commands those that the answer gives, and do they cost what it says?"""
        q, g = saved.question, saved.question.grasp
        given = np.where(g.backdrivable, g.command, 0.0)
        if (w.command[~q.sought] != given[~q.sought]).any():
            return "an actuator is commanded that was to stay locked, or a backdrivable one otherwise"
        if (np.where(g.command < 0, -1.0, 1.0) * w.command < 0)[q.sought].any():
            return "a command has the wrong sense"
        sizes = np.abs(w.command[~g.backdrivable])
        cost = float(sizes.sum() if q.sums else sizes.max(initial=0.0))
        upper = saved.number("upper")
        same = upper is not None and abs(upper - cost) <= EQUALITY_TOLERANCE * cost
        return "" if same else f"its commands cost {cost:.6g}; the answer says {upper}"

    def refuted(self, saved: SavedAnswer) -> Refuted | None:
        q, lower, upper = saved.question, saved.number("lower"), saved.number("upper")
        if q.goal != TORQUES:
            raise Refused(f"is of torques, its question of '{q.goal}'")
        if (q.sought & q.grasp.backdrivable).any():
            raise Refused("a backdrivable motor is sought: its command is given")
        if saved.said["verdict"] == "slips":
            if lower is not None or upper is not None:
                raise Refused("SLIPS with bounds")
            return "no commands suffice", 0.0, (0.0, np.inf)
        if lower is None or not lower >= 0:
            raise Refused(f"a lower bound of {lower}")
        if upper is not None and lower > upper:
            raise Refused(f"its lower bound {lower:.9g} is above its upper bound {upper:.9g}")
        return (f"no commands below {down(lower)} suffice", lower, (0.0, lower)) if lower > 0 else None

    def shown(self, saved: SavedAnswer, proved: Proved | None) -> dict[str, Any]:
        w, q = saved.witness, saved.question
        commands = None if w is None else dict(zip(q.grasp.actuators, w.command.tolist(), strict=True))
        preload = None if commands is None else {name: commands[name] for name in q.driven}
        return {
            "preload": preload,
            "lower": saved.number("lower"),
            "upper": None if w is None else saved.number("upper"),
        }


QUERIES: dict[str, Query] = {"check": Query(), "max": Maximum(), "torques": Torques()}


# --- parts of them --------------------------------------------------------------------------------


CONTACT_WORDS = {  # of contacts
    ContactMode.OPEN: "open",
    ContactMode.TOUCHES: "open",
    ContactMode.STICKS: "stick",
    ContactMode.SLIDES: "slide",
    ContactMode.RUBS: "slide",
    ContactMode.LEANS: "slide",
}
UNPROVED_STATE = dict.fromkeys(
    ("residual", "contacts", "joint_torques", "actuator_forces", "object_motion", "joint_motion")
)


def described(g: GraspData, x: State, proved: Proved) -> dict[str, Any]:
    """What `check` says of a state by key; `UNPROVED_STATE` of one that is not proved."""
    if not (proved.exact or proved.tolerant):
        return dict(UNPROVED_STATE)
    motions = g.rows[0] @ x.motion
    assert proved.modes is not None
    states = proved.modes.contact.tolist()
    c, d = x.c.reshape(-1, 3), motions[: 3 * g.m].reshape(-1, 3)
    contacts = [
        {
            "link": g.links[i],
            "position": g.positions[i].tolist(),
            "force": (g.frames[i] @ c[i]).tolist(),
            "normal_force": float(c[i, 0]),
            "friction_force": float(np.linalg.norm(c[i, 1:])),
            "motion": (g.frames[i] @ d[i]).tolist(),
            "state": CONTACT_WORDS[states[i]],
        }
        | ({"torsion": float(x.torsion[i])} if g.lever[i] > 0 else {})
        for i in range(g.m)
    ]
    soft = g.soft
    torques = g.J.T @ x.c + g.twist_jacobian.T @ (x.torsion[soft] / g.lever[soft])
    out = {"joint_reactions": dict(zip(g.joints, x.reaction.tolist(), strict=True))} if g.has_laws else {}
    return out | {
        "residual": proved.residual,
        "contacts": contacts,
        "joint_torques": dict(zip(g.joints, torques.tolist(), strict=True)),
        "actuator_forces": dict(zip(g.actuators, x.f.tolist(), strict=True)),
        "object_motion": x.r.tolist(),
        "joint_motion": dict(zip(g.joints, x.q.tolist(), strict=True)),
    }


def described_rounding(g: GraspData, x: State) -> dict[str, Any]:
    """By how much numbers of `described` may be off where sums are rounded otherwise; what is copied may not be."""
    c, moved = np.abs(x.c).reshape(-1, 3), np.abs(g.rows[1] @ np.abs(x.motion))[: 3 * g.m].reshape(-1, 3)
    twist = np.abs(x.torsion[g.soft] / g.lever[g.soft])
    torques = SUM_ROUNDING * (np.abs(g.J).T @ np.abs(x.c) + np.abs(g.twist_jacobian).T @ twist)
    of_contacts = [
        {"force": SUM_ROUNDING * float(c[i].sum()), "friction_force": SUM_ROUNDING * float(c[i, 1:].sum())}
        | {"motion": 2 * SUM_ROUNDING * float(moved[i].sum())}
        for i in range(g.m)
    ]
    exact = dict.fromkeys(("joint_reactions", "actuator_forces", "object_motion", "joint_motion"), 0.0)
    return exact | {"contacts": of_contacts, "joint_torques": dict(zip(g.joints, torques.tolist(), strict=True))}


def line(saved: SavedAnswer) -> tuple[Array, Array]:
    """(6,) each: the disturbance is the first plus s times the second; `Refused` if it is that of no maximum."""
    q = saved.question
    if q.has_scalar and not q.seeks_commands:
        return q.wrench, q.direction
    limited = bool(q.torque_limits) or np.isfinite(q.force_limit)
    other = limited or q.grasp.command.any() or q.equivalent.torque.any() or q.grasp.start is not None
    if q.goal != CHECK or other or not q.wrench.any():
        raise Refused(f"is of a maximum, its question of '{q.goal}'")
    return np.zeros(6), q.wrench


def _with_direction(q: Question) -> Question:
    """A maximum of which magnitudes make no difference, its load as the direction."""
    return replace(q, goal=SMALLEST_PRELOAD, direction=q.wrench, wrench=np.zeros(6))


def _pairs(saved: SavedAnswer, key: str) -> list[Range]:
    """Ranges of the answer, none for null; `Refused` for what is none."""
    said = saved.said.get(key)
    said = [] if said is None else said
    pairs = isinstance(said, list) and all(isinstance(x, list) and len(x) == 2 for x in said)
    if not pairs or not all(_is_number(end) for x in said for end in x):
        raise Refused(f"{key} is no list of pairs of numbers")
    return [(float(a), float(b)) for a, b in said]


def _slips_fault(saved: SavedAnswer) -> str:
    """What is wrong with the certificates of smaller magnitudes; "" if nothing."""
    for c in saved.slips:
        found = checker.verify(c, to_the_end=False)
        if not found.ok:
            return f"{saved.question.claim(c.scalar)}: {found.reason}"
        if found.cap is not None:
            return f"{saved.question.claim(c.scalar)}: proved up to virtual motions of {down(found.cap)} N only"
    return ""


def _ranges_fault(saved: SavedAnswer, holes: Sequence[Range]) -> str:
    """What is wrong with what is said of smaller magnitudes, if all its states and certificates are right."""
    q, lower, upper = saved.question, saved.number("lower") or 0.0, saved.number("upper")
    top = np.inf if upper is None else upper
    resolution = saved.number("resolution")
    if resolution is None or not 0 < resolution <= 1:
        return f"its resolution is {resolution}; a number above 0, of 1 at most, is needed"
    if not q.has_scalar:  # magnitudes make no difference
        if saved.slips or saved.arcs:
            return "it has states or certificates where magnitudes make no difference"
        shown = Known(lower, top, (), ())
    else:
        good, bad = [(a.first, a.last) for a in saved.arcs], [q.magnitudes(c.scalar) for c in saved.slips]
        if any(first < 0 for first, _ in bad):
            return "a certificate is about magnitudes below 0"
        if len(set(good)) < len(good):
            return "an arc is there twice"
        try:
            shown = known(good, bad, lower, top, resolution, no_magnitude(q))
        except ValueError as fault:
            return str(fault)
    above = saved.number("holds_from_zero_upper")
    unproved = tuple(_pairs(saved, "unproved"))
    to = saved.number("holds_from_zero_to") or 0.0
    said = Known(to, np.inf if above is None else above, tuple(holes), unproved)
    return "" if said == shown else f"it says {said}; what is shown is {shown}"


def close(a: Array, b: Array) -> bool:
    """The same numbers but for rounding."""
    return bool(np.abs(a - b).max(initial=0.0) <= EQUALITY_TOLERANCE * np.abs(b).max(initial=0.0))


def matches(said: Any, shown: Any) -> bool:
    """The same JSON; numbers within `EQUALITY_TOLERANCE` of the largest under the same key, of each list of objects key
    by key."""
    if isinstance(shown, list) and shown and isinstance(shown[0], dict):
        if not isinstance(said, list) or [_keys(x) for x in said] != [_keys(x) for x in shown]:
            return False
        every = set().union(*shown)  # some contacts have a torsion, others none
        return all(matches(*([x[key] for x in there if key in x] for there in (said, shown))) for key in every)
    return alike(said, shown, EQUALITY_TOLERANCE * _largest(shown))


def _keys(x: Any) -> set[str] | None:
    return set(x) if isinstance(x, Mapping) else None


def alike(said: Any, shown: Any, within: Any) -> bool:
    """Numbers to within so much: one for all, or by key and place; 0 where nothing is said of a key."""
    if isinstance(shown, Mapping):
        there = isinstance(said, Mapping) and said.keys() == shown.keys()
        each = within if isinstance(within, Mapping) else dict.fromkeys(shown, within)
        return there and all(alike(said[key], shown[key], each.get(key, 0.0)) for key in shown)
    if isinstance(shown, list | tuple):
        there = isinstance(said, list | tuple) and len(said) == len(shown)
        each_ = within if isinstance(within, list) else [within] * len(shown)
        return there and all(alike(*three) for three in zip(said, shown, each_, strict=True))
    if _is_number(shown):
        return _is_number(said) and bool(abs(said - shown) <= within)
    return type(said) is type(shown) and bool(said == shown)


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _largest(x: Any) -> float:
    parts = x.values() if isinstance(x, Mapping) else x if isinstance(x, list | tuple) else ()
    return abs(x) if _is_number(x) else max(map(_largest, parts), default=0.0)
