"""Checks grasps again: existence, what follows from it, and every load under the preload.

Nothing of the search is needed: the independent checker for the proofs of existence, the hand's kinematics and the
question for the grasp that they make, the equations of the model for the witnesses. All that is said of the grasps is
computed again from these and compared; what cannot be stands in a file's `record`, of which nothing is claimed.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import Any, ClassVar

from handfast.core.answer import Checked, Reach, Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import SAME
from handfast.model import grasp_file
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.derived import Derived, contacts_at, grasp_at
from handfast.planning.requirements import Requirements
from handfast.planning.results.grasps_file import SavedGrasp, SavedGrasps, loads_to_dict
from handfast.planning.results.motors import motors_to_dict
from handfast.stability.certify.certificate import Question
from handfast.stability.loads import Loads
from handfast.stability.model import State
from handfast.stability.posed import Posed
from handfast.stability.queries import CheckAnswer
from handfast.stability.witness import Witness
from handfast.synthesis.embedded import digest, fingerprint, task_to_dict
from handfast.synthesis.existence import misplaced

LONG = 60  # characters of a value that are shown
SMALL = 1e-3  # what is computed in several steps has an error of this size times `SAME`, however small it is


class NotProved(Exception):
    """Why a grasp is not proved."""


REPLAYED = ("existence, joints, contacts, mechanism, preload, every load's equilibrium, and what follows from these",)
NOT_REPLAYED = ("clearances, scores, lower bounds and the course of the search",)


@dataclass(frozen=True)
class ReplayedGrasp(Checked):
    """A grasp that was checked.

    Attributes:
        residuals: of the witness of each load.
        seconds: wall time.
        reason: why it is not proved: one line; '' if it is.
        replayed, not_replayed: what of it was checked, and what cannot be.
    """

    residuals: tuple[float, ...]
    seconds: float
    reason: str
    replayed: ClassVar[tuple[str, ...]] = REPLAYED
    not_replayed: ClassVar[tuple[str, ...]] = NOT_REPLAYED

    def to_json(self) -> dict[str, Any]:
        return self._json({"witnesses": len(self.residuals), "residual": max(self.residuals, default=0.0)})


@dataclass(frozen=True)
class ReplayedGrasps(Checked):
    """Grasps that were checked.

    Attributes:
        question: what was proved of them, and relative to what, see `question_of`.
        reasons: for each grasp why it is not proved: one line; '' if it is.
        loads: how many witnesses were replayed. residual: the worst of them.
        seconds: wall time.
        reason: why not all is proved: one line; '' if it is.
        replayed, not_replayed: what of each grasp was checked, and what cannot be.
    """

    question: dict[str, Any]
    reasons: tuple[str, ...]
    loads: int
    residual: float
    seconds: float
    reason: str
    replayed: ClassVar[tuple[str, ...]] = REPLAYED
    not_replayed: ClassVar[tuple[str, ...]] = NOT_REPLAYED

    def to_json(self) -> dict[str, Any]:
        return self._json(
            {
                "question": self.question,
                "grasps": [{"ok": not r, "reason": r} for r in self.reasons],
                "witnesses": self.loads,
                "residual": self.residual,
            }
        )


def verify(saved: SavedGrasps) -> ReplayedGrasps:
    """Does every grasp exist, is it what is said of it, and does it hold every load under its preload?"""
    start = time.monotonic()
    done = [verify_grasp(g, saved.loads, saved.requirements) for g in saved.grasps]
    residuals = [r for d in done for r in d.residuals]
    reasons = tuple(d.reason for d in done)
    wrong = [f"grasp {i}: {r}" for i, r in enumerate(reasons, start=1) if r] or [_answer_fault(saved)]
    worst, seconds = max(residuals, default=0.0), time.monotonic() - start
    return ReplayedGrasps(question_of(saved), reasons, len(residuals), worst, seconds, wrong[0])


def verify_grasp(g: SavedGrasp, loads: Loads, requirements: Requirements) -> ReplayedGrasp:
    """Does one grasp exist, is it what is said of it, and does it hold every load under its preload?"""
    start = time.monotonic()
    try:
        residuals, reason = tuple(_replayed(g, loads, requirements)), ""
    except (NotProved, InputError) as fault:
        residuals, reason = (), str(fault)
    return ReplayedGrasp(residuals, time.monotonic() - start, reason)


def question_of(saved: SavedGrasps) -> dict[str, Any]:
    """What the grasps of a file are proved for, and which hand, object and task that is relative to; JSON.

    Names are labels; what they stand for is told apart by its `sha256`: of a hand links, joints without limits,
    couplings, motors and closing senses; of an object the regions to touch, mass and centre of mass; of a task hand,
    limits, regions and bounds.
    """
    task, thing, asked = task_to_dict(saved.task), saved.object, saved.requirements
    joints = [{key: value for key, value in j.items() if key != "limits"} for j in task["hand"]["joints"]]
    hand = {key: task["hand"][key] for key in ("links", "couplings")} | {"joints": joints}
    hand |= {"motors": motors_to_dict(saved.task.hand)}
    body: dict[str, Any] = {"mass": thing.mass, "center_of_mass": list(thing.center_of_mass)}
    shape = [{"region": c["object"]} for c in task["contacts"]]
    made = loads_to_dict(saved.loads)
    return {
        "sha256": saved.question,
        "hand": {"name": saved.task.hand.name, "sha256": digest(hand)},
        "object": {"name": thing.name, **body, "sha256": digest(body | {"regions": shape})},
        "task": {"name": saved.task.name, "sha256": fingerprint(task)},
        "loads": {n: {"wrench": w, "weight": made[n].get("weight")} for n, w in saved.loads.by_name.items()},
        "friction": asked.friction,
        "actuators": list(asked.actuators),
        "eta": asked.eta,
        "torque_limits": dict(asked.torque_limits or {}),
        "force_limit": asked.force_limit,
        "command_limit": asked.command_limit,
        "mdp": True,
        "preloads": [g.grasp.preload for g in saved.grasps],
    }


def _answer_fault(saved: SavedGrasps) -> str:
    """What the answer as a whole says that does not follow; '' if nothing."""
    answer = saved.answer
    if answer.verdict is not Reach.FOUND:
        rest = "with a grasp" if saved.grasps else "has no grasp to prove: it rests on the search itself"
        return f"{answer.verdict.upper()} {rest}"
    if not saved.grasps:
        return "FOUND without a grasp"
    if answer.question != saved.question:
        return "the answer is to another question: task, motors or question were changed"
    return difference(saved.loads.by_name, answer.loads, "answer.loads", small=0.0)


def _replayed(g: SavedGrasp, loads: Loads, requirements: Requirements) -> list[float]:
    """The residual of each load's witness; `NotProved` or `InputError` if something of the grasp is not proved."""
    _require(g.solution.verify().fault)
    _require(misplaced(g.solution.task, g.joints, g.solution.existence))
    bare = grasp_at(g.solution, g.q, contacts_at(g.solution, requirements.friction))
    _require(difference(grasp_file.to_dict(bare) | {"preload": g.said.get("preload")}, g.said, "grasp"))
    grasp, driven = bare.with_preload(g.grasp.preload), requirements.driven(bare)
    _require(difference(grasp.preload, g.said["preload"], "grasp.preload", small=0.0))
    _require(_commands_fault(grasp, driven, requirements))
    preload = {name: grasp.preload.get(name, 0.0) for name in driven}
    _require(difference(preload, g.answer.get("preload"), "answer.preload", small=0.0))
    _require(difference(Derived.of(g.solution, g.q, grasp, preload, loads).to_json(), g.answer, "answer"))
    if g.witnesses.keys() != set(loads.names):
        raise NotProved(f"has witnesses for {len(g.witnesses)} loads, not for each of {', '.join(loads.names)}")
    residuals = []
    for name, wrench in zip(loads.names, loads.wrenches, strict=True):
        try:
            residuals.append(_held(grasp, wrench, g.witnesses[name], requirements))
        except (NotProved, InputError) as fault:
            raise NotProved(f"{name}: {fault}") from None
    return residuals


def _held(grasp: Grasp, wrench: Array, state: State, asked: Requirements) -> float:
    """The residual of a state that holds a load; `NotProved` if it does not."""
    sizes = {"r": 6, "q": grasp.l, "c": 3 * grasp.m, "f": grasp.mechanism.a, "coupling": len(grasp.mechanism.A)}
    sizes |= {"reaction": grasp.l}
    for key, size in sizes.items():
        if len(getattr(state, key)) != size:
            raise NotProved(f"its witness has {len(getattr(state, key))} numbers for {key}, needs {size}")
    question = Question(
        grasp, wrench=wrench, eta=asked.eta, torque_limits=asked.torque_limits or {}, force_limit=asked.force_limit
    )
    witness = Witness(grasp, wrench, state, asked.eta, mdp=True)
    known = Verdict.HOLDS, Stop.COMPLETE, 0.0, 0, (), witness, None
    done = CheckAnswer(*known, posed=Posed.of(question), as_found=True).verify()
    if not done.ok or done.witness is None:
        raise NotProved(done.reason)
    return done.witness.residual


def _commands_fault(grasp: Grasp, driven: list[str], asked: Requirements) -> str:
    """Which command was not allowed; '' if all were."""
    for name, value in grasp.preload.items():
        if name not in driven:
            return f"{name} is commanded, which was not asked for"
        if asked.command_limit is not None and abs(value) > asked.command_limit * (1 + SAME):
            return f"{name} is commanded {value:g}; the limit is {asked.command_limit:g}"
    return ""


def _require(reason: str) -> None:
    if reason:
        raise NotProved(reason)


def difference(due: Any, said: Any, at: str, small: float = SMALL) -> str:
    """Where JSON is not what it should be: its path and both values, one line; '' if nowhere but for rounding.

    Numbers are compared by their difference: as a share of the largest in their list, or of `small` if that is larger.
    """
    if isinstance(due, dict) and isinstance(said, dict):
        for key in [*due, *said]:
            if key not in said:
                return f"{at}.{key} is missing"
            if key not in due:
                return f"{at}.{key} follows from nothing in the file"
        return next(filter(None, (difference(due[key], said[key], f"{at}.{key}", small) for key in due)), "")
    if isinstance(due, list) and isinstance(said, list):
        if len(due) != len(said):
            return f"{at} has {len(said)} entries, not {len(due)}"
        pairs = enumerate(zip(due, said, strict=True))
        small = max([small, *(abs(x) for x in due if _is_number(x))])
        return next(filter(None, (difference(a, b, f"{at}[{i}]", small) for i, (a, b) in pairs)), "")
    if _is_number(due) and _is_number(said):
        same = abs(due - said) <= SAME * max(small, abs(due))
    else:
        same = type(due) is type(said) and due == said
    return "" if same else f"{at} is {_shown(said)}; of hand, configuration and question it is {_shown(due)}"


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _shown(x: Any) -> str:
    text = json.dumps(x)
    return text if len(text) <= LONG else f"{text[:LONG]}..."
