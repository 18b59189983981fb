"""What a load's path claims, and its replay: first the squeeze, then the load in steps; see docs/load-path.md.

A `handfast/path/1` file holds the question, the answer, and a chain of steps. State 0 is one of the commands alone.
Each step after it has a larger multiple of the load, the state that it starts from (`start.Start`), and a state of its
own, proved as the witness of any answer is (`existence.prove`). What a step starts from is where the state before came
to, but for rounding: so each step is exact from the numbers that the step before wrote down. Where the path
ends there is a certificate: from the last state no state exists at the next multiple. That is a proof about this path,
not about all ways in which a hand may come to its load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.proofs.answers import (
    ANSWER_NOT_REPLAYED,
    COURSE_KEYS,
    UNBOUNDED_CLAIM,
    UNPROVED_STATE,
    SavedAnswer,
    SavedWitness,
    close,
    compare,
    described,
    described_rounding,
    held,
    motion_cap,
    read_proofs,
    read_said,
    refuted,
)
from handfast.proofs.certificate import Certificate
from handfast.proofs.existence import FORCE_DEVIATION, Proved, prove
from handfast.proofs.fields import EQUALITY_TOLERANCE, BadFile, Fields
from handfast.proofs.grasp import GraspData, StartData, read_start
from handfast.proofs.path_commands import DRIFT, PathBound, PathCommands, read_bound, read_sought
from handfast.proofs.question import CHECK, Question, read_question
from handfast.proofs.replay import Refused, Replay, down
from handfast.proofs.states import Problem, State, acting, came_from
from handfast.proofs.tolerance import farthest, left_behind, load_scale, travel

SCHEMA = "handfast/path/1"
LOADING = "preload-first"
PATH_KEYS = "by_steps", "other_choice", "resolution"  # keys that tell of other paths
OTHER_PATHS = f"{', '.join(PATH_KEYS)}: paths of other steps, and of other states where a step has several"
QUERIES = "check", "max", "torques"


@dataclass(frozen=True, eq=False)
class Step:
    """One state of a path, or that there is none; its question is at a magnitude of the load, from where it starts."""

    magnitude: float
    question: Question
    witness: SavedWitness | None
    certificate: Certificate | None


@dataclass(frozen=True, eq=False)
class SavedPath(SavedAnswer):
    """A path file, read: what was asked of the whole load, the answer as JSON, the steps in their order.

    Where commands are sought also which, and what bounds them: the commands of the question are those that were found.
    """

    steps: tuple[Step, ...] = ()
    sought: PathCommands | None = None
    bound: PathBound | None = None

    @property
    def reached(self) -> float:
        """The largest magnitude that has a state; -inf without any."""
        return max((s.magnitude for s in self.steps if s.witness is not None), default=-np.inf)


def read_path(data: Any, place: str = "") -> SavedPath:
    """A parsed `handfast/path/1` object. Raises `BadFile`."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    question = read_question(f.take("question"), f.at("question"))
    if question.goal != CHECK or question.grasp.start is not None or not question.mdp:
        raise BadFile("is no check from rest with the dissipation principle", f.at("question"))
    said = read_said(f, QUERIES)
    Fields(said, f.at("answer")).text("loading", among=[LOADING])
    steps = tuple(_read_step(x, question) for x in f.objects("steps"))
    sought, bound = None, None
    if said["query"] == "torques":
        sought = read_sought(f.object("sought"), question)
        bound = read_bound(f.object("bound")) if f.has("bound") else None
        f.take("bound", None)
    f.done()
    return SavedPath(question, said, None, None, steps=steps, sought=sought, bound=bound)


def _read_step(f: Fields, q: Question) -> Step:
    magnitude, g = f.number("magnitude", least=0.0), q.grasp
    if f.has("from"):
        g = read_start(f, g)
    own = replace(q, grasp=g, wrench=magnitude * q.wrench)
    witness, certificate = read_proofs(f, own)
    f.done()
    return Step(magnitude, own, witness, certificate)


def replay(saved: SavedPath) -> Replay:
    """Is everything that the answer claims of its path proved?"""
    parts: list[Replay] = []
    reason, before = "", None
    last: Proved | None = None
    exact, motion, cap, apart = True, 0.0, None, 0.0
    end = max(saved.reached, 0.0) or (saved.steps[-1].magnitude if saved.steps else 0.0)
    most = may_drift(saved.question, end)
    try:
        for k, step in enumerate(saved.steps):
            apart += _linked(saved, k, step, before)
            if step.witness is None:
                part, cap = _none(saved, k, step, before)
                part = replace(part, refused=part.refused or _drifted(apart, most))
                parts.append(part)
                continue
            last, part = _state(k, step)
            apart += off_by(_problem(step), last)
            parts.append(replace(part, refused=part.refused or _drifted(apart, most)))
            exact, before, motion = exact and last.exact, step, max(motion, last.motion)
        lowest = 0.0
        if saved.sought is not None:
            lowest, more = _bounded(saved, saved.sought)
            parts += more
        if not any(part.reason for part in parts):
            own = {"exact": None, "motion": None} if last is None else {"exact": exact, "motion": motion}
            _compare(saved, before, last, own | {"motion_cap": cap}, lowest)
    except Refused as fault:
        reason = f"answer: {fault}"
    endless = [UNBOUNDED_CLAIM] if saved.said.get("unbounded") is True else []
    missing = *endless, OTHER_PATHS, ANSWER_NOT_REPLAYED
    return Replay(saved.said["query"], "", reason, parts=tuple(parts), not_replayed=missing)


def _linked(saved: SavedPath, k: int, step: Step, before: Step | None) -> float:
    """[N] how far a step's start is from the state before. `Refused` if it is none from there."""
    start = step.question.grasp.start
    if k == 0:
        if start is not None or step.magnitude != 0:
            raise Refused("step 0: is not of the commands alone, from rest")
        return 0.0
    if before is None or before is not saved.steps[k - 1]:
        raise Refused(f"step {k}: the one before it has no state")
    if not step.magnitude > before.magnitude:
        raise Refused(f"step {k}: its load is not larger than the one before")
    if start is None:
        raise Refused(f"step {k}: does not say where it starts from")
    apart, fault = _apart(before, start)
    if fault:
        raise Refused(f"step {k}: {fault}")
    return apart


def _apart(before: Step, start: StartData) -> tuple[float, str]:
    """[N] how far a start is from the state of the step before; and what it is not of that state, "" if nothing."""
    assert before.witness is not None
    p = _problem(before)
    came, room, most = came_from(p, before.witness.state)
    _, _, actuators, _, joints = p.grasp.parts
    units = {"gaps": np.ones(p.grasp.m), "stops": p.grasp.row_units[joints], "slack": p.grasp.row_units[actuators]}
    for name, unit in units.items():
        off, allowed = np.abs(getattr(start, name) - getattr(came, name)), getattr(room, name)
        if not (off <= allowed).all():
            return most, f"its {name} are not those to which the state before came"
        most = max(most, float((off / unit).max(initial=0.0)))
    return leverage(p.grasp) * most, ""


def _problem(step: Step) -> Problem:
    q = step.question
    return Problem.of(q, q.grasp.command, q.wrench)


def may_drift(q: Question, magnitude: float) -> float:
    """[N] how far all steps together may go on from states that are proved, up to a magnitude: as bounds allow."""
    return DRIFT * load_scale(q.grasp, magnitude * q.wrench)


def off_by(p: Problem, found: Proved) -> float:
    """[N] by how much a step's state is off: how far the proved one is, as contacts feel it, and what that misses."""
    return leverage(p.grasp) * found.radius + (0.0 if found.exact else found.residual * p.scale)


def leverage(g: GraspData) -> float:
    """How many times farther than `row_units` say contacts move with a joint that has a stop, or a tendon; 1 or more.

    A joint that itself moves none may drive others, see `travel`.
    """
    _, _, actuators, _, joints = g.parts
    units, slack = g.row_units, g.tendon & (g.command == 0)
    own = np.concatenate([units[joints][g.stop != 0], units[actuators][slack]])
    return float((travel(g, np.vstack([np.eye(g.l)[g.stop != 0], g.R[slack]])) * own).max(initial=1.0))


def _drifted(apart: float, most: float) -> str:
    """What is wrong where steps went on [N] so far apart from what is proved, `most` at most; "" if nothing."""
    far = f"all steps together go on from numbers {apart:.1e} N from the states that are proved"
    return "" if apart <= most else far


def _state(k: int, step: Step) -> tuple[Proved, Replay]:
    """Is the state of a step proved?"""
    w, q = step.witness, step.question
    assert w is not None
    claim = f"{step.magnitude:.6g} times the load is resisted from the state before"
    claim = claim if k else "the commands alone are in balance"
    if not (close(w.command, q.grasp.command) and close(w.wrench, q.wrench)):
        raise Refused(f"step {k}: its witness is a state under another load, or with other commands")
    if step.certificate is not None:
        raise Refused(f"step {k}: has a witness and a certificate")
    problem = _problem(step)
    found = prove(problem, w.state, within=near_enough(problem, w.state))
    return found, held(f"step {k}", claim, found)


def near_enough(p: Problem, x: State) -> float:
    """[N] how far from a step's state x the one that is proved may be for a path to go on from x: see `prove`."""
    return FORCE_DEVIATION * acting(p, x)


def _none(saved: SavedPath, k: int, step: Step, before: Step | None) -> tuple[Replay, float | None]:
    """Is it proved that a step, the last one, has no state?"""
    if step.certificate is None or k != len(saved.steps) - 1:
        raise Refused(f"step {k}: has neither a witness nor, as the last one, a certificate")
    claim = "the commands alone are in no balance"
    if before is not None:
        claim = f"{step.magnitude:.6g} times the load is not resisted from the state at {before.magnitude:.6g} times"
    part = refuted(claim, step.certificate, None, None, complete=True)
    cap, of_all = motion_cap(part), saved.said["query"] == "max" and before is not None and not before.magnitude
    if cap is not None and of_all and is_scale_free(saved.question, step.question.grasp):  # told for each time of it
        cap /= step.magnitude
    return part, cap


def _bounded(saved: SavedPath, sought: PathCommands) -> tuple[float, list[Replay]]:
    """The bound of the commands of all paths that is proved, and its part of the replay."""
    if saved.bound is None:
        return 0.0, []
    try:
        lowest, reason = saved.bound.lower(sought), ""
    except BadFile as fault:
        return 0.0, [Replay("bound", f"no commands of {sought.words} are enough", str(fault))]
    lower = np.inf if saved.said["verdict"] == "slips" else saved.number("lower") or 0.0
    claim = f"no commands of {sought.words} hold the load on a path"
    claim += "" if lower == np.inf else f" below {down(lower)}"
    claim += f", with forces and motions up to {down(sought.reach)} N"
    if not lowest >= lower:
        reason = f"its cases show {lowest:.9g}, the answer says {lower:.9g}"
    return lowest, [Replay("bound", claim, reason, {"leaves": len(saved.bound.leaves), "lower": lowest})]


def _compare(
    saved: SavedPath, last: Step | None, proved: Proved | None, of_steps: dict[str, Any], lowest: float
) -> None:
    """`Refused` if the answer says else than its steps show; lowest: the bound of commands that is proved."""
    said = saved.said
    ended = bool(saved.steps) and saved.steps[-1].witness is None
    shown: dict[str, Any] = {key: said[key] for key in ("schema", "query", "verdict")}
    shown |= {"loading": LOADING, "steps": sum(s.magnitude > 0 for s in saved.steps)}
    shown |= {"certified": ended} | of_steps
    if saved.sought is not None:
        shown |= _torques(saved, saved.sought, last, ended, lowest)
    else:
        shown |= (_check if said["query"] == "check" else _max)(saved, last, proved, ended)
    w = last and last.witness
    rounding = described_rounding(last.question.grasp, w.state) if last and w else None
    compare(said, shown, (*COURSE_KEYS, *PATH_KEYS), rounding)


def _check(saved: SavedPath, last: Step | None, proved: Proved | None, ended: bool) -> dict[str, Any]:
    """What a check along a path has to say besides."""
    verdict = saved.said["verdict"]
    if verdict == "holds" and (last is None or ended or last.magnitude != 1.0):
        raise Refused("HOLDS, but the whole load is not reached")
    if verdict == "slips" and (not ended or saved.steps[-1].magnitude > 1.0):
        raise Refused("SLIPS, but no step of the load is shown to have no state")
    if verdict == "undecided" and ended:
        raise Refused("UNDECIDED with a certificate")
    held = verdict == "holds" and last is not None and last.witness is not None and proved is not None
    state = described(last.question.grasp, last.witness.state, proved) if held else UNPROVED_STATE  # type: ignore[union-attr, arg-type]
    reached = last.magnitude if last is not None else None
    return state | {"margin": None, "reached": reached, "slips_at": saved.steps[-1].magnitude if ended else None}


def _max(saved: SavedPath, last: Step | None, proved: Proved | None, ended: bool) -> dict[str, Any]:
    """What the end of a path has to say besides."""
    verdict, lower = saved.said["verdict"], last.magnitude if last is not None else 0.0
    upper, unbounded = saved.steps[-1].magnitude if ended else None, bool(saved.said.get("unbounded"))
    if upper is not None and not lower and is_scale_free(saved.question, saved.steps[-1].question.grasp):
        upper = 0.0
    if (verdict == "holds") != (lower > 0) or (verdict == "slips") != (upper == 0):
        raise Refused(f"{verdict.upper()} is not what its steps show")
    if unbounded and (ended or not lower >= _end(saved.question) * (1 - EQUALITY_TOLERANCE)):
        raise Refused("unbounded, but its path ends")
    gap = 0.0 if unbounded or upper == 0 else (upper - lower) / lower if upper is not None and lower > 0 else None
    bounds: dict[str, Any] = {"lower": lower, "upper": upper, "gap": gap, "unbounded": unbounded}
    return bounds | {"attained": True, "limit": None, "holds_from_zero_to": None}


def _torques(saved: SavedPath, sought: PathCommands, last: Step | None, ended: bool, lowest: float) -> dict[str, Any]:
    """What commands that hold on a path have to say besides."""
    verdict, g, lower = saved.said["verdict"], saved.question.grasp, saved.number("lower")
    none: dict[str, Any] = {"certified": saved.bound is not None, "preload": None, "upper": None}
    if verdict != "holds":
        if saved.steps or g.command[sought.sought].any():
            raise Refused(f"{verdict.upper()} with commands, or with a path")
        if verdict == "slips":
            if lowest < np.inf:
                raise Refused("SLIPS, but it is not shown that no commands hold the load")
            return none | {"lower": None}
        if lower is None or not 0 <= lower <= lowest:
            raise Refused(f"a lower bound of {lower}; {lowest:.9g} is shown")
        return none | {"lower": lower}
    if last is None or ended or last.magnitude != 1.0:
        raise Refused("HOLDS, but the whole load is not reached")
    upper = sought.cost(g.command)
    if (sought.senses * g.command < 0).any():
        raise Refused("a command has the wrong sense")
    if lower is None or not 0 <= lower <= min(lowest, upper):
        raise Refused(f"a lower bound of {lower}; {min(lowest, upper):.9g} is shown")
    far = sought.size_of([s.witness.state for s in saved.steps if s.witness is not None])
    if lower > 0 and not far <= sought.reach:
        raise Refused(f"its path has forces or motions of {far:.3g} N, of which its bound says nothing")
    preload = {g.actuators[j]: float(g.command[j]) for j in sought.sought.tolist()}
    return none | {"preload": preload, "lower": lower, "upper": upper}


def is_scale_free(q: Question, begun: GraspData) -> bool:
    """Is there nothing but the load, so that states of it times any number are states of so much of it?

    begun: the grasp in its first step: from where nothing was left behind.
    """
    g = q.grasp
    acts = g.command.any() or g.torque.any() or g.friction.any() or g.start is not None
    return not (acts or q.torque_limits or q.force_limit < np.inf or left_behind(begun))


def _end(q: Question) -> float:
    """The magnitude at which a path without end is left."""
    return farthest(replace(q, direction=q.wrench, wrench=np.zeros(6)))
