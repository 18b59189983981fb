"""The `handfast/grasps/2` file: the grasps of a task with all their proofs, for `handfast verify`.

Primary are the task with its hand, the hand's motors, the question, and of each grasp the configuration with its
proof of existence, all joints, the preload and a witness for each load. `grasp` and `answer` follow from these: a
replay computes them again. `record` is what the search noted that nothing here can prove: its course, clearances,
scores. `checksum` is that of all the rest; it tells of damage, not of forgery.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.answer import Reach
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, Vector, read_json, validate, write_text
from handfast.model import grasp_file
from handfast.model.grasp import Grasp
from handfast.model.grasp_file import ActuatorEntry
from handfast.model.hand.hand import Hand, coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.planning.tasks.asked import Asked
from handfast.stability.certify.certificate_file import Six
from handfast.stability.loads import Loads, Weight
from handfast.stability.model import State
from handfast.synthesis.certify.existence import existence_to_dict
from handfast.synthesis.embedded import digest, refuse_broken, sealed, task_from_dict, task_to_dict
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_file import solution_of
from handfast.synthesis.task import Task

if TYPE_CHECKING:
    from handfast.planning.tasks.proved import Grasps, ProvedGrasp

SCHEMA, FIRST = "handfast/grasps/2", "handfast/grasps/1"
Sense = Annotated[int, Field(ge=-1, le=1)]


class MotorsEntry(Strict):
    """What the task's hand does not say: the rows of R, and the sense in which each joint closes."""

    actuators: list[ActuatorEntry]
    closing: dict[str, Sense]


class WeightEntry(Strict):
    along: Vector
    g: Finite
    factor: Finite


class LoadEntry(Strict):
    """Either a wrench as it was given, or the object's weight."""

    wrench: Six | None = None
    weight: WeightEntry | None = None


class ObjectEntry(Strict):
    name: str
    mass: Finite | None
    center_of_mass: Vector


class QuestionEntry(Strict):
    """`eta` in radians."""

    object: ObjectEntry
    loads: dict[str, LoadEntry]
    friction: Finite
    actuators: list[str]
    eta: Finite
    torque_limits: dict[str, Finite]
    force_limit: Finite | None
    command_limit: Finite | None


class StateEntry(Strict):
    """As `State`."""

    r: Six
    q: list[Finite]
    c: list[Finite]
    f: list[Finite]
    coupling: list[Finite]


class GraspEntry(Strict):
    """`joints` are all of the hand, `grasp` a `handfast/grasp/1` object, `witnesses` by the names of the loads."""

    existence: dict[str, Any]
    joints: dict[str, Finite]
    grasp: dict[str, Any]
    witnesses: dict[str, StateEntry]


class AnswerEntry(Strict):
    """`question`: SHA-256 of what it answers, see `asked_digest`. `grasps`: what follows from each (`Follows`)."""

    format: Literal["handfast/answer/1"] = Field(alias="schema")
    query: Literal["grasp"]
    question: str
    verdict: Reach
    loads: dict[str, Six]
    grasps: list[dict[str, Any]]


class GraspsFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/grasps/2"] = Field(alias="schema")
    checksum: str
    task: dict[str, Any]
    motors: MotorsEntry
    question: QuestionEntry
    answer: AnswerEntry
    record: dict[str, Any]
    grasps: list[GraspEntry]


@dataclass(frozen=True, eq=False)
class SavedGrasp:
    """A grasp as it stands in a file.

    Attributes:
        solution: of its proof.
        joints: all of the hand.
        grasp: with its preload; `said`: the JSON that it was read from.
        witnesses: name of a load -> its state.
        answer: what the answer says of it, JSON.
    """

    solution: Solution
    joints: dict[str, float]
    grasp: Grasp
    said: dict[str, Any]
    witnesses: dict[str, State]
    answer: dict[str, Any]

    @property
    def q(self) -> Array:
        """(l,) the joints in the hand's order."""
        return np.array([self.joints[name] for name in self.solution.task.hand.joint_names])


@dataclass(frozen=True, eq=False)
class SavedGrasps:
    """The grasps of a task as they stand in a file.

    Attributes:
        task: its hand has the file's motors and closing senses.
        object: name, mass and centre of mass.
        loads, asked: the question.
        grasps: best first.
        answer: what is said of them all.
        record: what the search noted; nothing of it is proved.
        checksum: of the file. question: SHA-256 of task, motors and question as they stand in it.
    """

    task: Task
    object: ObjectEntry
    loads: Loads
    asked: Asked
    grasps: tuple[SavedGrasp, ...]
    answer: AnswerEntry
    record: dict[str, Any]
    checksum: str
    question: str


# --- writing ----------------------------------------------------------------------------------------


def to_dict(answer: Grasps) -> dict[str, Any]:
    """The answer as a `handfast/grasps/2` object; numbers come back exactly."""
    asked, body = answer.asked, answer.body
    record = {k: v for k, v in answer.noted.items() if k not in ("schema", "query", "verdict")}
    primary = {
        "task": task_to_dict(answer.task),
        "motors": motors_to_dict(answer.task.hand),
        "question": {
            "object": {
                "name": body.name,
                "mass": None if body.mass is None else float(body.mass),
                "center_of_mass": np.asarray(body.center_of_mass, dtype=float).tolist(),
            },
            "loads": loads_to_dict(answer.loads),
            "friction": float(asked.friction),
            "actuators": list(asked.actuators),
            "eta": float(asked.eta),
            "torque_limits": {n: float(v) for n, v in asked.torque_limits.items()},
            "force_limit": None if asked.force_limit is None else float(asked.force_limit),
            "command_limit": None if asked.command_limit is None else float(asked.command_limit),
        },
    }
    data = {
        "schema": SCHEMA,
        "answer": {
            "schema": "handfast/answer/1",
            "query": "grasp",
            "question": asked_digest(primary),
            "verdict": str(answer.verdict),
            "loads": answer.loads.by_name,
            "grasps": [g.follows.to_json() for g in answer.grasps],
        },
        "record": record | {"count": answer.count, "grasps": [g.noted for g in answer.grasps]},
        "grasps": [_entry(g) for g in answer.grasps],
    }
    return sealed(primary | data)


def asked_digest(data: dict[str, Any]) -> str:
    """SHA-256 of what is asked in a `handfast/grasps/2` object: task, motors, question."""
    return digest({key: data[key] for key in ("task", "motors", "question")})


def motors_to_dict(hand: Hand) -> dict[str, Any]:
    """What drives a hand, and the sense in which its joints close."""
    m, names = hand.mechanism, hand.joint_names
    return {
        "actuators": [
            {"name": n, "joints": {j: float(v) for j, v in zip(names, row, strict=True) if v}, "tendon": t}
            for n, row, t in zip(m.actuators, m.R, m.tendon, strict=True)
        ],
        "closing": {n: int(s) for n, s in zip(names, hand.closing, strict=True)},
    }


def loads_to_dict(loads: Loads) -> dict[str, Any]:
    """Each load by its name: the wrench, or what makes it of the object's weight."""
    return {
        name: {"wrench": wrench}
        if weight is None
        else {"weight": {"along": weight.along.tolist(), "g": float(weight.g), "factor": float(weight.factor)}}
        for (name, wrench), weight in zip(loads.by_name.items(), loads.weights, strict=True)
    }


def _entry(g: ProvedGrasp) -> dict[str, Any]:
    states = {n: a.witness.state for n, a in zip(g.answer.loads.names, g.answer.checks, strict=True) if a.witness}
    return {
        "existence": existence_to_dict(g.solution.existence),
        "joints": g.solution.task.hand.values(g.q),
        "grasp": grasp_file.to_dict(g.grasp),
        "witnesses": {n: {k: getattr(s, k).tolist() for k in StateEntry.model_fields} for n, s in states.items()},
    }


def save_grasps(answer: Grasps, path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(answer), allow_nan=False) + "\n", force=force)


# --- reading ----------------------------------------------------------------------------------------


def from_dict(data: Any) -> SavedGrasps:
    """The grasps in a parsed object; raises `InputError` with field and fault."""
    if isinstance(data, dict) and data.get("schema") == FIRST:
        problem = f"is '{FIRST}', which says neither friction nor gearing, so that nothing can be computed again; "
        raise InputError(problem + f"find the grasps anew, '{SCHEMA}' is needed", field="schema")
    entry = validate(GraspsFile, data)
    refuse_broken(data)
    try:
        task = task_from_dict(entry.task)
    except InputError as fault:
        raise fault.within("task") from None
    task = replace(task, hand=_driven(task.hand, entry.motors))
    q, said = entry.question, entry.answer
    if len(said.grasps) != len(entry.grasps):
        raise InputError(f"has {len(said.grasps)} entries for {len(entry.grasps)} grasps", field="answer.grasps")
    asked = Asked(q.friction, tuple(q.actuators), q.eta, q.torque_limits, q.force_limit, q.command_limit)
    grasps = tuple(
        _grasp(task, e, answer, f"grasps[{i}]")
        for i, (e, answer) in enumerate(zip(entry.grasps, said.grasps, strict=True))
    )
    return SavedGrasps(task, q.object, _loads(q), asked, grasps, said, entry.record, entry.checksum, asked_digest(data))


def _driven(hand: Hand, motors: MotorsEntry) -> Hand:
    """The task's hand with what drives it."""
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
        )
    except InputError as fault:
        raise fault.within("motors") from None
    return replace(hand, mechanism=mechanism, closing=np.array([motors.closing[j] for j in names]))


def _loads(q: QuestionEntry) -> Loads:
    """The loads with their wrenches, those of weights computed from the object's."""
    wrenches: list[Array] = []
    weights: list[Weight | None] = []
    for name, e in q.loads.items():
        field = f"question.loads.{name}"
        if (e.wrench is None) == (e.weight is None):
            raise InputError("needs either a wrench or a weight", field=field)
        if e.weight is None:
            wrenches.append(np.array(e.wrench))
            weights.append(None)
            continue
        if q.object.mass is None:
            raise InputError("is null, but a load is its weight", field="question.object.mass")
        weight = Weight(np.array(e.weight.along), e.weight.g, e.weight.factor)
        try:
            wrenches.append(weight.wrench(q.object.mass, np.array(q.object.center_of_mass)))
        except InputError as fault:
            raise fault.within(field) from None
        weights.append(weight)
    try:
        return Loads(tuple(q.loads), np.array(wrenches).reshape(-1, 6), tuple(weights))
    except InputError as fault:
        raise fault.within("question") from None


def _grasp(task: Task, e: GraspEntry, answer: dict[str, Any], field: str) -> SavedGrasp:
    solution = solution_of(task, e.existence, f"{field}.existence")
    try:
        if set(e.joints) != set(task.hand.joint_names):
            raise InputError(f"are not those of the hand: {', '.join(task.hand.joint_names)}", field="joints")
        witnesses = {n: State(**{k: np.array(v) for k, v in s.model_dump().items()}) for n, s in e.witnesses.items()}
        try:
            grasp = grasp_file.from_dict(e.grasp)
        except InputError as fault:
            raise fault.within("grasp") from None
        return SavedGrasp(solution, e.joints, grasp, e.grasp, witnesses, answer)
    except InputError as fault:
        raise fault.within(field) from None


def load_grasps(path: str | Path) -> SavedGrasps:
    """The grasps in a file; `InputError` if it is none, or was damaged after it was written."""
    try:
        return from_dict(read_json(path, "grasps"))
    except InputError as fault:
        raise fault.at(str(path)) from None
