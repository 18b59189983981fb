"""Replays what backs an answer: the witness in the equations, the certificate in its checker, both against its words.

Nothing of the engine and no solver is needed, only `model`, `verify` and the question. An answer has exactly the keys
of its query, and what it says under each of them is worked out again from question, witness and certificate, but
for `UNPROVED`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.answer import Checked, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import SAME, read_json
from handfast.stability import asked, model, problem, result_file
from handfast.stability.certify import arc, certificate_file
from handfast.stability.certify import verify as checker
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.certify.certificate import Goal as Claimed
from handfast.stability.certify.certificate_file import question_to_dict
from handfast.stability.certify.claim import caps
from handfast.stability.certify.ranges import Known, known, slip_range
from handfast.stability.goal import NEAR_END, STRONGEST, search_end, unit
from handfast.stability.result_file import CheckEntry, MaxEntry, Result, TorquesEntry
from handfast.stability.witness import KEYS, VALID, Witness

if TYPE_CHECKING:
    from handfast.stability.answers import Answer


RESULTS = ("handfast/result/1", "handfast/result/2")
CERTIFICATES = ("handfast/certificate/1", "handfast/certificate/2")
LIMIT, TURNED = 1e-5, 1e-3  # relative, of a limit that is followed again; of its motion
UNPROVED = ("stop", "seconds", "nodes", "verified")  # the course of the search: recorded, not proved
# certificates of version 1: 10^4 force scales of motion and of lambda, ends of a search by a scale that was defined
# slightly otherwise. What they cover exactly is in their claim.
FIRST_SHARE = 4.0
FIRST_CAP = FIRST_HIGHEST = 1e4 / FIRST_SHARE


class Refused(Exception):
    """Why something is not proved."""


@dataclass(frozen=True)
class WitnessCheck:
    """A replayed witness: what it stands for, its worst residual, and why it is refused ('' if it is not)."""

    claim: str
    residual: float
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        return {"claim": self.claim, "residual": _number(self.residual), "ok": not self.reason, "reason": self.reason}


@dataclass(frozen=True)
class CertificateCheck:
    """A replayed certificate.

    Attributes:
        claim: what it stands for.
        motion: virtual translations of the object that it covers [N]; None for all, as of version 2.
        leaves, margin: of its proof, see `verify.Verification`.
        reason: why it is refused, '' if it is not.
    """

    claim: str
    motion: float | None
    leaves: int
    margin: float
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        return {
            "claim": self.claim,
            "motion_cap": self.motion,
            "leaves": self.leaves,
            "margin": _number(self.margin),
            "ok": not self.reason,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class IntervalCheck:
    """Which smaller magnitudes are resisted, replayed.

    Attributes:
        claim: what is claimed.
        arcs, residual: ranges with states, and the worst residual that any of these may have.
        slips: ranges with certificates.
        reason: why it is refused, '' if it is not.
    """

    claim: str
    arcs: int
    residual: float
    slips: int
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        return {
            "claim": self.claim,
            "arcs": self.arcs,
            "residual": _number(self.residual),
            "slips": self.slips,
            "ok": not self.reason,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class Verified(Checked):
    """What was claimed and replayed; a part that is None was neither claimed nor there.

    Attributes:
        seconds: wall time.
        reason: why it is not all proved: one line; '' if it is.
    """

    witness: WitnessCheck | None
    certificate: CertificateCheck | None
    seconds: float
    reason: str
    interval: IntervalCheck | None = None

    def to_json(self) -> dict[str, Any]:
        return self._json(
            {
                "witness": self.witness.to_json() if self.witness else None,
                "certificate": self.certificate.to_json() if self.certificate else None,
                "interval": self.interval.to_json() if self.interval else None,
            }
        )


def verify(what: str | Path | Answer | Result | Certificate) -> Verified:
    """Is everything that an answer claims proved? Replayed without the engine and without any solver.

    Args:
        what: a `handfast/result/2` or `handfast/certificate/2` file, or an answer, or a certificate.

    Raises:
        InputError: the file cannot be read, or is neither.
    """
    start = time.monotonic()
    if isinstance(what, str | Path):
        what = load(what)
    elif not isinstance(what, Certificate | Result):
        what = Result.of(what)
    if isinstance(what, Certificate):
        done = _replay_certificate(what, claim_text(what))
        return Verified(None, done, time.monotonic() - start, done.reason and f"certificate: {done.reason}")
    witness, certificate, interval, reason = None, None, None, ""
    try:
        witness, certificate, interval = _witness(what), _certificate(what), _interval(what)
        for name, part in (("witness", witness), ("certificate", certificate), ("interval", interval)):
            if part and part.reason and not reason:
                reason = f"{name}: {part.reason}"
        if not reason:
            _compare(what, certificate)
    except Refused as fault:
        reason = f"answer: {fault}"
    return Verified(witness, certificate, time.monotonic() - start, reason, interval)


def load(path: str | Path) -> Result | Certificate:
    """What a result file or a certificate file holds; `InputError` if it is neither."""
    data = read_json(path, "result")
    try:
        return from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None


def from_dict(data: Any) -> Result | Certificate:
    """What the parsed JSON of one holds; `InputError` if it is neither."""
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema in CERTIFICATES:
        return certificate_file.from_dict(data)
    if schema in RESULTS:
        return result_file.from_dict(data)
    needed = f"{RESULTS[-1]} or {CERTIFICATES[-1]} is needed"
    raise InputError(f"is missing; {needed}" if schema is None else f"is '{schema}'; {needed}", field="schema")


# --- the witness ----------------------------------------------------------------------------------


def _witness(result: Result) -> WitnessCheck | None:
    q, answer, w = result.question, result.answer, result.witness
    holds = answer.verdict is Verdict.HOLDS
    if w is None:
        if holds:
            raise Refused("HOLDS without a witness")
        return None
    if not holds:
        raise Refused(f"{answer.verdict.upper()} with a witness")
    wrench, command, claim = q.wrench, q.grasp.command, "the disturbance is resisted"
    if isinstance(answer, MaxEntry):
        constant, direction = _load(q)
        wrench, claim = constant + answer.lower * direction, f"{answer.lower:.6g} times the direction is resisted"
    if isinstance(answer, TorquesEntry):
        command, claim = w.grasp.command, f"commands of {answer.upper or 0.0:.6g} suffice"
    reason = _state_fault(q, w, wrench, command)
    if not reason and isinstance(answer, TorquesEntry):
        reason = _commands_fault(q, w, answer)
    found = model.residuals(q.grasp, wrench, w.state, eta=q.eta, command=command, mdp=q.mdp).worst
    if not reason and not found <= VALID:
        reason = f"the residual is {found:.1e}, above {VALID:g}"
    return WitnessCheck(claim, found, reason)


def _state_fault(q: Question, w: Witness, wrench: Array, command: Array) -> str:
    """Is the witness's load the claimed one, and are the limits kept?"""
    if not _close(w.wrench, wrench):
        return "it is a state under another disturbance"
    if not _close(w.grasp.command, command):
        return "it is a state with other commands"
    scale = SAME * model.force_scale(wrench, w.state.c)
    lever = model.actuator_arms(q.grasp)
    for i, name in enumerate(q.grasp.mechanism.actuators):
        if abs(w.state.f[i]) > q.torque_limits.get(name, np.inf) + scale * lever[i]:
            return f"{name} carries more than its limit"
    if q.force_limit is not None and w.state.c[0::3].max() > q.force_limit + scale:
        return "a normal force is above its limit"
    return ""


def _commands_fault(q: Question, w: Witness, answer: TorquesEntry) -> str:
    """Are the commands those that the answer gives, and do they cost what it says?"""
    command, names = w.grasp.command, q.grasp.mechanism.actuators
    if (command[~q.is_driven] != 0).any():
        return "an actuator is commanded that was to stay locked"
    if (q.sense * command < 0).any():
        return "a command has the wrong sense"
    said = answer.preload or {}
    if set(said) != {n for n, d in zip(names, q.is_driven, strict=True) if d}:
        return "the answer's commands are of other actuators"
    if not all(_close(np.array([said.get(n, 0.0)]), x) for n, x in zip(names, command[:, None], strict=True)):
        return "the answer gives other commands"
    cost = np.abs(command).max(initial=0.0) if q.objective == "max" else np.abs(command).sum()
    if answer.upper is None or not _close(np.array([answer.upper]), np.array([cost])):
        return f"its commands cost {cost:.6g}; the answer says {answer.upper}"
    return ""


# --- the certificate --------------------------------------------------------------------------------


def _certificate(result: Result) -> CertificateCheck | None:
    q, c = result.question, result.certificate
    need = _needed(q, result)
    if need is None:
        if c is not None:
            raise Refused("has a certificate, but claims nothing that needs one")
        return None
    claim, lo, hi = need
    if c is None:
        raise Refused(f"{claim}: no certificate")
    if result.first and c.scalar is not None:
        claim, (lo, hi) = claim_text(c), _first_range(q, lo, hi)
    reason = ""
    if question_to_dict(c.question) != question_to_dict(q):
        reason = "it answers another question"
    elif c.capped and not result.first:
        reason = "it has caps on motions; an answer of this version is about all of them"
    elif c.scalar is not None and not (c.scalar[0] <= lo + SAME * abs(lo) and c.scalar[1] >= hi * (1 - SAME)):
        reason = f"it covers {c.scalar[0]:.9g} to {c.scalar[1]:.9g}; the answer needs {lo:.9g} to {hi:.9g}"
    return _replay_certificate(c, claim, reason)


def _replay_certificate(c: Certificate, claim: str, reason: str = "") -> CertificateCheck:
    if c.capped:
        reason = reason or _cap_fault(c)
    found = checker.verify(c)
    if found.cap is not None:
        claim = f"{claim}, up to virtual motions of {found.cap:.6g} N"
    return CertificateCheck(claim, found.cap, found.leaves, found.margin, reason or found.reason)


def _first_range(q: Question, lo: float, hi: float) -> tuple[float, float]:
    """What a certificate of version 1 has to cover at least: its searches ended a little earlier or later."""
    if q.goal is Claimed.SMALLEST_PRELOAD:
        return FIRST_SHARE * lo, min(hi, FIRST_HIGHEST / asked.posed(q)[0].stretch)
    return lo, max(lo, hi / FIRST_SHARE)


def _cap_fault(c: Certificate) -> str:
    """What is wrong with the caps of version 1: they are a matter of the question, not of the file."""
    p, _ = asked.posed(c.question)
    q = c.question
    least = FIRST_CAP * p.force / (p.stretch if q.goal is Claimed.SMALLEST_PRELOAD else 1.0)
    if c.cap_r is None or c.cap_q is None:
        return ""
    least_r, least_q = caps(q.grasp, least)
    if (c.cap_r >= least_r).all() and (c.cap_q >= least_q).all():
        return ""
    return f"it covers motions up to {c.cap_r[:3].min():.6g} N only; this question's begin to matter at {least:.6g} N"


def _needed(q: Question, result: Result) -> tuple[str, float, float] | None:
    """What a certificate has to show: in words, and as the range of its scalar; None if nothing needs one."""
    answer, slips = result.answer, result.answer.verdict is Verdict.SLIPS
    p, _ = asked.posed(q)
    if isinstance(answer, MaxEntry):
        return _needed_of_max(q, answer, result.first)
    if isinstance(answer, TorquesEntry):
        if q.goal is not Claimed.TORQUES:
            raise Refused(f"is of torques, its question of '{q.goal}'")
        if slips:
            if answer.lower is not None or answer.upper is not None:
                raise Refused("SLIPS with bounds")
            lever = np.abs(p.command(np.ones(len(p.R))))[q.is_driven]
            end = STRONGEST * float(lever.max(initial=0.0) or 1.0) * (1 - NEAR_END) if result.first else np.inf
            return "no commands suffice", 0.0, end
        if answer.lower is None:
            raise Refused("has no lower bound")
        if not answer.lower >= 0:
            raise Refused(f"a lower bound of {answer.lower:.6g}")
        if answer.upper is not None and answer.lower > answer.upper:
            raise Refused(f"its lower bound {answer.lower:.9g} is above its upper bound {answer.upper:.9g}")
        return (f"no commands below {answer.lower:.6g} suffice", 0.0, answer.lower) if answer.lower > 0 else None
    if q.goal is not Claimed.CHECK:
        raise Refused(f"is of a check, its question of '{q.goal}'")
    return ("the disturbance is not resisted", 0.0, 0.0) if slips else None


def _needed_of_max(q: Question, answer: MaxEntry, first: bool) -> tuple[str, float, float] | None:
    """For a maximum: no magnitude from the upper bound to the end of the search."""
    slips, holds = answer.verdict is Verdict.SLIPS, answer.verdict is Verdict.HOLDS
    end = _end(q)
    if not answer.lower >= 0:
        raise Refused(f"a largest magnitude of {answer.lower:.6g}")
    if holds and not answer.unbounded and answer.lower == 0 and not (q.direction is not None and q.wrench.any()):
        raise Refused("HOLDS without a magnitude that is resisted")
    if not holds and answer.lower != 0:
        raise Refused(f"{answer.verdict.upper()} with a magnitude that is resisted")
    if slips and answer.upper != 0:
        raise Refused("SLIPS with bounds above 0")
    if answer.unbounded:
        if answer.upper is not None or not holds:
            raise Refused("unbounded, with a bound")
        least = end / FIRST_SHARE if first else end * (1 - 2 * NEAR_END)
        if not answer.lower >= least:
            raise Refused(f"unbounded, but shown up to {answer.lower:.6g} only; a search goes to {least:.6g}")
        return None
    if answer.upper is None:
        return None
    if answer.lower > answer.upper:
        raise Refused(f"its lower bound {answer.lower:.9g} is above its upper bound {answer.upper:.9g}")
    to = "" if q.goal is Claimed.CHECK else f", up to {end:.6g} times it"
    what = "nothing" if slips else f"nothing above {answer.upper:.6g} times the direction"
    claim = f"{what} is resisted{to}"
    if q.goal is Claimed.CHECK:  # homogeneous: what slips at one magnitude slips at all
        if not slips:
            raise Refused("has an upper bound where magnitudes make no difference")
        return claim, 0.0, 0.0
    if q.goal is Claimed.SMALLEST_PRELOAD:  # its scalar is 1 / s
        return claim, (1 + NEAR_END) / end, 1.0 / answer.upper if answer.upper > 0 else np.inf
    return claim, answer.upper, end * (1 - NEAR_END)


def _end(q: Question) -> float:
    """The magnitude at which the search for a maximum ends."""
    _, direction = _load(q)
    p = asked.posed(q)[0] if q.direction is not None else problem.build(q.grasp, np.zeros(6), direction)
    return p.stretch * search_end(p)


def _load(q: Question) -> tuple[Array, Array]:
    """(6,) each: the disturbance of a maximum is the first plus s times the second; `Refused` if it is none."""
    if q.direction is not None:
        return q.wrench, q.direction
    if q.goal is not Claimed.CHECK or q.grasp.command.any() or q.torque_limits or q.force_limit is not None:
        raise Refused(f"is of a maximum, its question of '{q.goal}'")
    return np.zeros(6), q.wrench


# --- which smaller magnitudes --------------------------------------------------------------------------


def _interval(result: Result) -> IntervalCheck | None:
    q, answer = result.question, result.answer
    if not isinstance(answer, MaxEntry) or answer.holds_from_zero_to is None:
        if result.arcs or result.slips:
            raise Refused("has states or certificates of smaller magnitudes, but claims nothing of them")
        if isinstance(answer, MaxEntry) and (answer.holes or answer.unproved or answer.holds_from_zero_upper):
            raise Refused("has holes, but does not say up to where everything is resisted")
        return None
    if result.first:
        raise Refused("what version 1 says of smaller magnitudes rests on samples; ask again")
    holes = ", ".join(f"{a:.6g} to {b:.6g}" for a, b in answer.holes)
    claim = f"everything up to {answer.holds_from_zero_to:.6g} times the direction is resisted"
    claim += f", nothing at {holes}" if holes else ""
    residual = max((arc.excess(q, a) for a in result.arcs), default=0.0)
    reason = "" if residual <= VALID else f"states between two magnitudes are off by {residual:.1e}, above {VALID:g}"
    reason = reason or _interval_fault(result, answer)
    return IntervalCheck(claim, len(result.arcs), residual, len(result.slips), reason)


def _interval_fault(result: Result, answer: MaxEntry) -> str:
    """What is wrong with what is said of smaller magnitudes, if all its states are right."""
    q = result.question
    for c in result.slips:
        if question_to_dict(c.question) != question_to_dict(q):
            return "a certificate answers another question"
        if c.capped:
            return "a certificate has caps on motions"
        found = checker.verify(c)
        if not found.ok:
            return f"{claim_text(c)}: {found.reason}"
        if found.cap is not None:
            return f"{claim_text(c)}: proved up to virtual motions of {found.cap:.6g} N only"
    upper = np.inf if answer.upper is None else answer.upper
    if q.goal is Claimed.CHECK:  # magnitudes make no difference
        if result.slips:
            return "it has certificates where magnitudes make no difference"
        shown = Known(answer.lower, upper, (), ())
    elif answer.resolution is None:
        return "it states no resolution"
    else:
        good, bad = [(a.first, a.last) for a in result.arcs], [slip_range(c) for c in result.slips]
        try:
            shown = known(good, bad, answer.lower, upper, answer.resolution, unit(asked.posed(q)[0]))
        except ValueError as fault:
            return str(fault)
    said = Known(
        answer.holds_from_zero_to or 0.0,
        np.inf if answer.holds_from_zero_upper is None else answer.holds_from_zero_upper,
        tuple(answer.holes),
        tuple(answer.unproved),
    )
    return "" if said == shown else f"it says {said}; what is shown is {shown}"


def claim_text(c: Certificate) -> str:
    """What a certificate claims, in words."""
    q, at = c.question, "" if c.scalar is None else f"{c.scalar[0]:.6g} to {c.scalar[1]:.6g}"
    return {
        Claimed.CHECK: "the disturbance is not resisted",
        Claimed.SMALLEST_PRELOAD: f"the direction is not resisted with {at} times the preload",
        Claimed.LARGEST: f"{at} times the direction is not resisted",
        Claimed.TORQUES: f"no commands of {at} suffice",
    }[q.goal]


# --- all that an answer says --------------------------------------------------------------------------


def _compare(result: Result, replayed: CertificateCheck | None) -> None:
    """`Refused` if the answer has other keys than its query's, or says something else than what was replayed."""
    said, shown = result.said, _shown(result, replayed)
    unproved = set(UNPROVED) - ({"verified"} if result.first else set())
    for key in said:
        if key not in shown and key not in unproved:
            raise Refused(f"{key} is nothing that it can say; leave it out")
    for key in [*shown, *unproved]:
        if key not in said:
            raise Refused(f"{key} is missing")
    for key, value in shown.items():
        if not _same(said[key], value):
            raise Refused(f"{key} is not what the rest of the file shows")


def _shown(result: Result, replayed: CertificateCheck | None) -> dict[str, Any]:
    """What an answer has to say, by key: from its question, its witness and its certificate, all replayed."""
    answer, c = result.answer, result.certificate
    always: dict[str, Any] = {
        "schema": answer.format,
        "query": answer.query,
        "verdict": str(answer.verdict),
        "certified": c is not None,
    }
    if result.first:
        always["motion_cap"] = None if c is None or c.cap_r is None else float(c.cap_r[0])
    else:
        always["motion_cap"] = replayed.motion if replayed else None
    return always | SHOWN[type(answer)](result)


def _shown_of_check(result: Result) -> dict[str, Any]:
    state = result.witness.to_json() if result.witness else dict.fromkeys(KEYS)
    return state if result.first else state | {"margin": None}  # nothing in the file shows one


def _shown_of_max(result: Result) -> dict[str, Any]:
    """The bounds are those that witness and certificate were held against."""
    answer = result.answer
    assert isinstance(answer, MaxEntry)
    gap = 0.0 if answer.unbounded or answer.upper == 0 else None
    if gap is None and answer.upper is not None and answer.lower > 0:
        gap = (answer.upper - answer.lower) / answer.lower
    bounds = {"lower": answer.lower, "upper": answer.upper, "gap": gap, "unbounded": answer.unbounded}
    smaller: dict[str, Any] = {"holds_from_zero_to": answer.holds_from_zero_to}  # held against states and certificates
    if answer.holds_from_zero_to is not None:
        names = ("holds_from_zero_upper", "holes", "unproved", "resolution")
        smaller |= {name: answer.model_dump(mode="json")[name] for name in names}
    out = bounds | smaller
    return out if result.first else out | _shown_limit(result, answer)


def _shown_limit(result: Result, answer: MaxEntry) -> dict[str, Any]:
    """The limit, followed again from the witness if one is said; that there is none claims nothing."""
    said, w = result.said.get("limit"), result.witness
    if said is None:
        return {"limit": None, "attained": True}
    if w is None or answer.upper is None or answer.unbounded:
        raise Refused("limit is none of a largest magnitude")
    from handfast.stability.limit import limit_from  # linear algebra alone: nothing is searched

    p, goal = asked.posed(result.question)
    found = limit_from(p, goal, w.state, answer.lower, answer.upper)
    if found is None:
        raise Refused("no limit is found from its witness")
    shown = found.to_json()
    value = said.get("value") if isinstance(said, dict) else None
    if not isinstance(value, float) or not answer.lower <= value <= answer.upper * (1 + SAME):
        raise Refused("its limit lies outside of its bounds")
    if abs(value - found.value) > LIMIT * abs(found.value):
        raise Refused(f"its limit is {value:.9g}; from its witness it is {found.value:.9g}")
    motion = said.get("object_motion")
    near = isinstance(motion, list) and len(motion) == 6 and all(map(_is_number, motion))
    if not near or np.abs(np.array(motion) - found.motion).max() > TURNED:
        raise Refused("object_motion of its limit is not where its witness leads")
    return {"limit": shown | {"value": value, "object_motion": motion}, "attained": False}


def _shown_of_torques(result: Result) -> dict[str, Any]:
    """The bounds are those that witness and certificate were held against."""
    answer, q, w = result.answer, result.question, result.witness
    assert isinstance(answer, TorquesEntry)
    commands = None if w is None else {n: w.grasp.preload.get(n, 0.0) for n in q.driven}
    return {"preload": commands, "lower": answer.lower, "upper": None if w is None else answer.upper}


SHOWN = {CheckEntry: _shown_of_check, MaxEntry: _shown_of_max, TorquesEntry: _shown_of_torques}


def _same(said: Any, shown: Any) -> bool:
    """The same JSON; numbers within `SAME` of the largest under the same key, a number alone of at least 1."""
    if isinstance(shown, list) and shown and isinstance(shown[0], dict):  # an object for each contact: key by key
        if not isinstance(said, list) or [x.keys() for x in said if isinstance(x, dict)] != [x.keys() for x in shown]:
            return False
        return all(_same([x[key] for x in said], [x[key] for x in shown]) for key in shown[0])
    return _alike(
        said, shown, SAME * (_largest(shown) if isinstance(shown, list | dict) else max(1.0, _largest(shown)))
    )


def _alike(said: Any, shown: Any, within: float) -> bool:
    """The same JSON, numbers within a tolerance; neither texts nor truth values are numbers."""
    if isinstance(shown, dict):
        there = isinstance(said, dict) and said.keys() == shown.keys()
        return there and all(_alike(said[key], shown[key], within) for key in shown)
    if isinstance(shown, list):
        there = isinstance(said, list) and len(said) == len(shown)
        return there and all(_alike(x, y, within) for x, y in zip(said, shown, strict=True))
    if _is_number(shown):
        return _is_number(said) and bool(abs(said - shown) <= within)
    return type(said) is type(shown) and bool(said == shown)


def _largest(x: Any) -> float:
    """The largest number in some JSON, without its sign; 0 if there is none."""
    parts = x.values() if isinstance(x, dict) else x if isinstance(x, list) else ()
    return abs(x) if _is_number(x) else max(map(_largest, parts), default=0.0)


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _close(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) <= SAME * np.abs(b).max(initial=0.0))


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
