"""One preload for many loads: what a `handfast/hold/1` file claims, put together from answers about single loads.

HOLDS needs a `check` of every load under the preload, a lower bound of the largest command the `torques` of one load.
A margin is the `max` of a load under the preload. Where the loads come after the commands both are paths, and no
commands are claimed to be the least. SLIPS needs a load that no commands resist, or none within the limit
of commands; or one that no forces at the contacts and of the motors balance, whatever they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.proofs import answers, checker, path_steps
from handfast.proofs.answers import SavedAnswer
from handfast.proofs.certificate import Certificate
from handfast.proofs.fields import EQUALITY_TOLERANCE, Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import TORQUES, Question, read_question
from handfast.proofs.replay import SEARCH_STOPS, Refused, Replay, down
from handfast.proofs.tolerance import UNBOUNDED_FACTOR

SCHEMA = "handfast/hold/1"
HOLD_NOT_REPLAYED = "hardest, stop, seconds, nodes: the course of the search is recorded, and nothing rests on it"
ENDLESS = UNBOUNDED_FACTOR * (1 - EQUALITY_TOLERANCE)  # times a load, from which on its margin may be of any size
HOLD_KEYS = ("schema", "query", "verdict", "stop", "seconds", "nodes", "loads", "preload", "lower", "upper", "hardest")


@dataclass(frozen=True, eq=False)
class SavedHold:
    """A hold file, read.

    Attributes:
        question: of the first load, whose limits and actuators are those of all; its goal is `TORQUES`.
        loads: by name, (6,) [N, N m].
        command_limit: [N m or N] the largest command that is allowed; inf for none.
        said: the answer, as JSON.
        checks, margins: by the names of loads. bounding, refuted: name and answer; None without.
        along: do the loads come after the commands?
    """

    question: Question
    loads: Mapping[str, Array]
    command_limit: float
    said: Mapping[str, Any]
    checks: Mapping[str, SavedAnswer]
    bounding: tuple[str, SavedAnswer | None] | None
    refuted: tuple[str, SavedAnswer | None] | None
    margins: Mapping[str, SavedAnswer]
    along: bool = False


def read_hold(data: Any, place: str = "") -> SavedHold:
    """A parsed `handfast/hold/1` object. Raises `BadFile`."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    asked = f.object("question")
    loads = asked.object("loads")
    by_name = {name: loads.numbers(name, (6,)) for name in dict(data["question"]["loads"])}
    if not by_name:
        raise BadFile("is empty; at least one load is needed", asked.at("loads"))
    limit = asked.number("command_limit", least=0.0) if asked.has("command_limit") else np.inf
    one = {name: asked.take(name) for name in ("grasp", "eta", "torque_limits", "force_limit")}
    one |= {"goal": TORQUES, "wrench": next(iter(by_name.values())), "driven": asked.take("actuators")}
    along = asked.has("loading") and bool(asked.text("loading", among=[path_steps.LOADING]))
    asked.done()
    question = read_question(one, asked.place)
    said = f.take("answer")
    _refuse_kinds(Fields(said, f.at("answer")))
    read = path_steps.read_path if along else answers.read_answer
    checks = f.object("checks")
    of_loads = {name: read(checks.take(name), checks.at(name)) for name in by_name if checks.has(name)}
    checks.done()
    parts = [_part(f, name) for name in ("bounding", "refuted")]
    margins = {}
    if f.has("margins"):
        more = f.object("margins")
        margins = {name: read(more.take(name), more.at(name)) for name in by_name if more.has(name)}
        more.done()
    f.done()
    return SavedHold(question, by_name, limit, said, of_loads, parts[0], parts[1], margins, along)


def _refuse_kinds(f: Fields) -> None:
    """`BadFile` for what of an answer is of another kind than in any answer; which keys there are is compared later."""
    f.text("query", among=["hold"])
    f.text("verdict", "")
    f.text("stop", SEARCH_STOPS[0], among=SEARCH_STOPS)
    f.whole("nodes", 0)
    f.number("seconds", 0.0, least=0.0)
    for name, read in (("hardest", f.text), ("lower", f.number), ("upper", f.number), ("preload", f.named)):
        if f.has(name):
            read(name)


def _part(f: Fields, name: str) -> tuple[str, SavedAnswer | None] | None:
    if not f.has(name):
        return None
    part = f.object(name)
    load = part.text("load")
    found = answers.read_answer(part.take("result"), part.at("result")) if part.has("result") else None
    part.done()
    return load, found


def replay(saved: SavedHold) -> Replay:
    """Is everything that it claims proved?"""
    parts = [_replayed(answer, name) for name, answer in saved.checks.items()]
    said, reason = saved.said, ""
    try:
        if said.get("verdict") == "slips":
            parts += _refuted(saved)
        else:
            if saved.refuted is not None:
                raise Refused("says of a load that no preload holds it, and is no SLIPS")
            parts += _bounding(saved)
            if said.get("verdict") == "holds":
                _held(saved)
            elif said.get("verdict") != "undecided" or saved.checks or said.get("preload") is not None:
                raise Refused(f"{said.get('verdict')} with a preload")
        parts += _margins(saved)
        _compare(saved)
    except Refused as fault:
        reason = f"answer: {fault}"
    endless = [answers.UNBOUNDED_CLAIM] if any(a.said.get("unbounded") for a in saved.margins.values()) else []
    return Replay("hold", _claim(saved), reason, parts=tuple(parts), not_replayed=(*endless, HOLD_NOT_REPLAYED))


def _replayed(answer: SavedAnswer, name: str) -> Replay:
    done = path_steps.replay(answer) if isinstance(answer, path_steps.SavedPath) else answers.replay(answer)
    return replace(done, name=name)


def _claim(saved: SavedHold) -> str:
    verdict, loads = saved.said.get("verdict"), f"{len(saved.loads)} loads"
    if verdict == "slips":
        limit = f" with commands up to {down(saved.command_limit)}" if np.isfinite(saved.command_limit) else ""
        return f"no preload holds {saved.refuted[0] if saved.refuted else 'some load'}{limit}"
    when = ", on the path of each" if saved.along else ""
    return f"one preload holds {loads}{when}" if verdict == "holds" else ""


def _held(saved: SavedHold) -> None:
    """`Refused` unless every load has an answer that says it is resisted, under the one preload."""
    preload = saved.said.get("preload")
    if not isinstance(preload, Mapping) or set(preload) != set(saved.question.driven):
        raise Refused(f"its preload is not of the actuators {', '.join(saved.question.driven)}")
    command = _command(saved)
    if (_senses(saved.question.grasp) * command < 0)[saved.question.sought].any():
        raise Refused("its preload has another sense than the grasp's commands")
    for name in saved.loads:
        if name not in saved.checks:
            raise Refused(f"{name} has no answer")
        answer = saved.checks[name]
        if answer.said["query"] != "check" or not answer.holds:
            raise Refused(f"{name} is not resisted")
        _same_question(saved, name, answer)
        if (answer.question.grasp.command != command).any():
            raise Refused(f"{name}: the answer is about another preload")
    upper = max(map(abs, preload.values()), default=0.0)
    if upper != saved.said.get("upper"):
        raise Refused(f"its largest command is {upper:.6g}, not {saved.said.get('upper')}")
    if upper > saved.command_limit:
        raise Refused(f"its largest command is {upper:.6g}; the limit is {saved.command_limit:.6g}")


def _command(saved: SavedHold) -> Array:
    """(a,) the commands of the preload, with those of backdrivable motors."""
    g = saved.question.grasp
    back = {name: f for name, f, b in zip(g.actuators, g.command.tolist(), g.backdrivable, strict=True) if b}
    return g.commands(back | dict(saved.said["preload"]), "answer.preload")


def grown(lower: float, unbounded: bool) -> float:
    """The margin of a load that holds, of the `max` of it: inf where it is unbounded, shown up to many times the load.

    Under small commands a load may be unbounded beside these, and be shown little farther than itself.
    """
    return np.inf if unbounded and lower >= ENDLESS else max(lower, 1.0)


def margins_json(found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The keys `margin` and `margins`, from the bounds of the `max` of each load; a margin of null is any size."""
    least = min(grown(a["lower"], a["unbounded"]) for a in found.values())
    return {"margin": None if least == np.inf else least, "margins": dict(found)}


def _bounds(a: SavedAnswer) -> dict[str, Any]:
    return {
        "lower": a.number("lower") or 0.0,
        "upper": a.number("upper"),
        "unbounded": a.said.get("unbounded") is True,
    }


def _margins(saved: SavedHold) -> list[Replay]:
    """How much of each load is resisted under the preload."""
    if saved.margins and saved.said.get("verdict") != "holds":
        raise Refused("has margins of loads without a preload that holds")
    for name, answer in saved.margins.items():
        if answer.said["query"] != "max" or answer.said["verdict"] == "slips":
            raise Refused(f"{name}: the answer does not say how much of it is resisted")
        _same_question(saved, name, answer)
        if (answer.question.grasp.command != _command(saved)).any():
            raise Refused(f"{name}: its margin is that of another preload")
    left = {name for name, load in saved.loads.items() if load.any()} - set(saved.margins)
    if saved.margins and left:
        raise Refused(f"has no margin of {min(left)}, and the least is that of all")
    return [_replayed(answer, f"{name}, margin") for name, answer in saved.margins.items()]


def _bounding(saved: SavedHold) -> list[Replay]:
    """What is behind the lower bound of the largest command."""
    lower, upper = saved.said.get("lower"), saved.said.get("upper")
    if lower == 0 and saved.bounding is None:
        return []
    if lower is None:
        raise Refused("has no lower bound, of 0 where nothing is shown")
    name, answer = saved.bounding or ("", None)
    if answer is None or saved.along:
        raise Refused(f"nothing is there that shows the bound {lower}{' on paths' if saved.along else ''}")
    _same_question(saved, name, answer)
    if answer.said["query"] != "torques" or answer.said.get("lower") != lower or answer.question.sums:
        raise Refused(f"the bound {lower} is not that of {name}")
    _all_commands(saved, name, answer)
    if upper is not None and lower > upper:
        raise Refused(f"the bound {lower:.6g} is above the command {upper:.6g}")
    return [replace(_reaching(name, answer), name=f"{name}, least commands")]


def _refuted(saved: SavedHold) -> list[Replay]:
    """Why no preload holds some load."""
    if saved.refuted is None or saved.checks or saved.bounding is not None:
        raise Refused("SLIPS without a load that no preload resists, or with a preload")
    name, answer = saved.refuted
    if name not in saved.loads:
        raise Refused(f"'{name}' is none of its loads")
    if answer is None:
        return [_unbalanced(saved, name)]
    if saved.along:
        raise Refused(f"{name}: what no commands resist together with the load is not shown of its path")
    _same_question(saved, name, answer)
    _all_commands(saved, name, answer)
    more = isinstance(answer.said.get("lower"), float) and answer.said["lower"] > saved.command_limit
    more &= not answer.question.sums  # a sum is more than the largest of them
    if answer.said["query"] != "torques" or (answer.said["verdict"] != "slips" and not more):
        raise Refused(f"{name}: the answer does not say that it slips")
    return [replace(_reaching(name, answer), name=f"{name}, no commands")]


def _reaching(name: str, answer: SavedAnswer) -> Replay:
    """The replay of the `torques` of a load; `Refused` if its bound is proved up to too small motions."""
    done = answers.replay(answer)
    for cap in (answers.motion_cap(part) for part in done.parts if part.name == "certificate" and not part.reason):
        if cap is not None and (fault := answers.cap_fault(answer.question, cap, answer.number("lower") or 0.0, None)):
            raise Refused(f"{name}: {fault}")
    return done


def _unbalanced(saved: SavedHold, name: str) -> Replay:
    """That no forces balance a load: the equations (1) and (2) contradict themselves."""
    q = replace(saved.question, wrench=saved.loads[name])
    found = checker.verify(Certificate.of_root(q, (0.0, np.inf)))
    claim = f"no forces at the contacts and of the motors balance {name} and what acts on the joints"
    reason = "forces at the contacts may balance it" if found.reason else ""
    if found.cap is not None and not reason:
        claim += f", up to virtual motions of {down(found.cap)} N"
        reason = answers.cap_fault(q, found.cap, 0.0, None)
    return Replay(f"{name}, no forces", claim, reason)


def _same_question(saved: SavedHold, name: str, answer: SavedAnswer) -> None:
    """`Refused` unless an answer is about this load and about the grasp and the limits of all."""
    q, asked = answer.question, saved.question
    of_line = answer.said["query"] == "max" and not isinstance(answer, path_steps.SavedPath)
    base, load = answers.line(answer) if of_line else (np.zeros(6), q.wrench)
    if name not in saved.loads or not np.array_equal(load, saved.loads[name]) or base.any():
        raise Refused(f"{name}: the answer is about another load")
    limits = ("eta", "mdp", "torque_limits", "force_limit")
    if any(getattr(q, field) != getattr(asked, field) for field in limits):
        raise Refused(f"{name}: the answer is within other limits, or of another law of friction")
    if not q.grasp.same_but_commands(asked.grasp):
        raise Refused(f"{name}: the answer is about another grasp")
    if q.grasp.start is not None or asked.grasp.start is not None:
        raise Refused(f"{name}: the answer is about a step from another state, not from rest")
    back = asked.grasp.backdrivable & ~asked.sought
    if (q.grasp.command[back] != asked.grasp.command[back]).any():
        raise Refused(f"{name}: the answer is about other commands of backdrivable actuators")


def _all_commands(saved: SavedHold, name: str, answer: SavedAnswer) -> None:
    if set(answer.question.driven) != set(saved.question.driven):
        raise Refused(f"{name}: the answer is not about all commands that were sought")
    _same_senses(saved.question.grasp, answer.question, name)


def _same_senses(g: GraspData, q: Question, name: str) -> None:
    """`Refused` if an answer seeks commands in another sense than that of the grasp's."""
    if (_senses(g) != _senses(q.grasp))[q.sought].any():
        raise Refused(f"{name}: the answer seeks commands in another sense")


def _senses(g: GraspData) -> Array:
    """(a,) in which commands are sought: 1 unless the grasp's is negative."""
    return np.where(g.command < 0, -1.0, 1.0)


def _compare(saved: SavedHold) -> None:
    """`Refused` if the answer says else than the file shows."""
    said = saved.said
    loads = {name: load.tolist() for name, load in saved.loads.items()}
    of_margins = margins_json({name: _bounds(a) for name, a in saved.margins.items()}) if saved.margins else {}
    keys = *HOLD_KEYS, *of_margins, *(["loading"] if saved.along else [])
    if set(said) - {"residuals", "exact"} != set(keys):
        raise Refused(f"has other keys than {', '.join(keys)}")
    if not answers.alike(said["loads"], loads, 0.0):
        raise Refused("loads are not those of the question")
    shown: dict[str, Any] = {"residuals": [a.said.get("residual") for a in saved.checks.values()]}
    shown |= {"loading": path_steps.LOADING} if saved.along else {}
    shown |= of_margins | {"exact": all(a.said.get("exact") for a in saved.checks.values()) if saved.checks else None}
    for key, value in shown.items():
        if key in said and said[key] != value:
            raise Refused(f"{key} is not what the rest of the file shows")
    if said["verdict"] == "slips" and said["lower"] is not None:
        raise Refused("SLIPS with a bound")
    if said["verdict"] != "holds" and (said["preload"] is not None or said["upper"] is not None):
        raise Refused(f"{said['verdict'].upper()} with a preload")
