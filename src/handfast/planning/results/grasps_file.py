"""The `handfast/grasps/1` file: the grasps of a task with all their proofs, for `handfast verify`.

Primary are the task with its hand, the hand's motors, the question, and of each grasp the configuration with its
proof of existence, all joints, the preload and a witness for each load. `grasp` and `answer` follow from these: a
replay computes them again. `none` is the proof that there is no grasp, where that is answered; it may need the
question's `solids`, of hand and object. `record` is what the search noted that nothing here can prove: its course,
clearances, scores. `checksum` is that of all the rest; it tells of damage, not of forgery.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.answer import Reach
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Six, Strict, Vector, validate, write_text
from handfast.core.schema import written
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand, coupling_rows
from handfast.model.hand.joint_law import NO_LAW, JointLaw, PassiveTendon
from handfast.planning.question import Requirements
from handfast.proofs.states import State
from handfast.readers import grasp_file
from handfast.readers.grasp_file import ActuatorEntry, actuators_to_dict, by_joint, mechanism_of
from handfast.stability.answers.answer import state_json
from handfast.stability.problem.loads import Loads, Weight
from handfast.stability.problem.model import state_of
from handfast.synthesis.embedded_task import digest, refuse_broken, sealed, task_from_dict, task_to_dict
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_file import solution_of
from handfast.synthesis.task import Task

SCHEMA = "handfast/grasps/1"
Sense = Annotated[int, Field(ge=-1, le=1)]

# --- the file on disk -------------------------------------------------------------------------------


class WeightEntry(Strict):
    """As `Weight`."""

    along: Vector
    g: Finite
    factor: Finite


class LoadEntry(Strict):
    """Either a wrench as it was given, or the object's weight."""

    wrench: Six | None = None
    weight: WeightEntry | None = None

    def load(self, mass: float | None, center_of_mass: Vector) -> tuple[Array, Weight | None]:
        """(6,) the wrench, that of a weight computed from the object's."""
        if (self.wrench is None) == (self.weight is None):
            raise InputError("needs either a wrench or a weight")
        if self.weight is None:
            return np.array(self.wrench), None
        weight = Weight(np.array(self.weight.along), self.weight.g, self.weight.factor)
        return weight.wrench(mass or 0.0, np.array(center_of_mass)), weight


class ObjectEntry(Strict):
    name: str
    mass: Finite | None
    center_of_mass: Vector


class GraspsQuestionEntry(Strict):
    """`eta` in radians."""

    object: ObjectEntry
    loads: dict[str, LoadEntry]
    friction: Finite
    actuators: list[str]
    eta: Finite
    torque_limits: dict[str, Finite]
    force_limit: Finite | None
    command_limit: Finite | None
    torsion: Finite = 0.0
    solids: dict[str, Any] | None = None


class LoadWitnessEntry(Strict):
    """As `state_json` writes it."""

    r: Six
    q: list[Finite]
    c: list[Finite]
    f: list[Finite]
    coupling: list[Finite]
    reaction: list[Finite] | None = None
    torsion: list[Finite] | None = None


class StrengthEntry(Strict):
    """So many times each load is held under the same preload: a witness by the names of the loads."""

    factor: Annotated[float, Field(ge=1)]
    witnesses: dict[str, LoadWitnessEntry]


class GraspEntry(Strict):
    """`joints` are all of the hand, `grasp` a `handfast/grasp/1` object, `witnesses` by the names of the loads."""

    existence: dict[str, Any]
    joints: dict[str, Finite]
    grasp: dict[str, Any]
    witnesses: dict[str, LoadWitnessEntry]
    strength: StrengthEntry | None = None


class GraspsAnswerEntry(Strict):
    """`question`: SHA-256 of what it answers, see `asked_digest`. `grasps`: what follows from each (`Derived`)."""

    format: Literal["handfast/answer/1"] = Field(alias="schema")
    query: Literal["grasp"]
    question: str
    verdict: Reach
    loads: dict[str, Six]
    grasps: list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class TendonEntry(JointLaw):
    """A tendon with laws of its own: its length by joint, and these."""

    joints: dict[str, Finite]

    @property
    def law(self) -> JointLaw:
        return JointLaw(self.friction, self.stiffness, self.rest, self.stops)


class MotorsEntry(Strict):
    """What the task's hand does not say: the rows of R, the senses in which joints close, and the joints' laws."""

    actuators: list[ActuatorEntry]
    closing: dict[str, Sense]
    laws: dict[str, JointLaw] = Field(default_factory=dict)
    tendons: dict[str, TendonEntry] = Field(default_factory=dict)


class GraspsFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/grasps/1"] = Field(alias="schema")
    checksum: str
    task: dict[str, Any]
    motors: MotorsEntry
    question: GraspsQuestionEntry
    answer: GraspsAnswerEntry
    record: dict[str, Any]
    grasps: list[GraspEntry]
    none: dict[str, Any] | None = None
    bound: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class SavedGrasp:
    """A grasp as it stands in a file.

    Attributes:
        solution: of its proof.
        joints: all of the hand.
        grasp: with its preload; `said`: the JSON that it was read from.
        witnesses: name of a load -> its state.
        answer: what the answer says of it, JSON.
        strength: a factor on the loads and a state for each of these; None where that was not asked.
    """

    solution: Solution
    joints: dict[str, float]
    grasp: Grasp
    said: dict[str, Any]
    witnesses: dict[str, State]
    answer: dict[str, Any]
    strength: tuple[float, dict[str, State]] | None = None

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
        loads, requirements: the question.
        grasps: best first.
        answer: what is said of them all.
        record: what the search noted; nothing of it is proved.
        question: SHA-256 of task, motors and question as they stand in the file.
        none: the proof that there is no grasp; None without one.
        bound: the proof that no placement holds the loads so many times; None without one.
        solids: of hand and object, what that is about (`solids_to_dict`); None where it needs none.
    """

    task: Task
    object: ObjectEntry
    loads: Loads
    requirements: Requirements
    grasps: tuple[SavedGrasp, ...]
    answer: GraspsAnswerEntry
    record: dict[str, Any]
    question: str
    none: Mapping[str, Any] | None = None
    bound: Mapping[str, Any] | None = None
    solids: Mapping[str, Any] | None = None

    @classmethod
    def of(
        cls,
        task: Task,
        object: ObjectEntry,
        loads: Loads,
        requirements: Requirements,
        verdict: Reach,
        grasps: Sequence[SavedGrasp],
        record: dict[str, Any],
        **proofs: Mapping[str, Any] | None,
    ) -> SavedGrasps:
        """An answer as a file would hold it; proofs: `none`, `bound` and `solids`."""
        question = asked_digest(_primary(task, object, loads, requirements, proofs.get("solids")))
        answer = GraspsAnswerEntry(
            schema="handfast/answer/1",
            query="grasp",
            question=question,
            verdict=verdict,
            loads=loads.by_name,
            grasps=[g.answer for g in grasps],
        )
        return cls(task, object, loads, requirements, tuple(grasps), answer, record, question, **proofs)


# --- writing ----------------------------------------------------------------------------------------


def to_dict(saved: SavedGrasps) -> dict[str, Any]:
    """A `handfast/grasps/1` object; numbers come back exactly."""
    data = {
        "schema": SCHEMA,
        "answer": saved.answer.model_dump(by_alias=True, mode="json"),
        "record": saved.record,
        "grasps": [_entry(g) for g in saved.grasps],
    }
    data |= {name: dict(proof) for name, proof in (("none", saved.none), ("bound", saved.bound)) if proof is not None}
    return sealed(_primary(saved.task, saved.object, saved.loads, saved.requirements, saved.solids) | data)


def _primary(
    task: Task, thing: ObjectEntry, loads: Loads, r: Requirements, solids: Mapping[str, Any] | None
) -> dict[str, Any]:
    """What is asked."""
    return {
        "task": task_to_dict(task),
        "motors": motors_to_dict(task.hand),
        "question": {
            "object": thing.model_dump(mode="json"),
            "loads": loads_to_dict(loads),
            "friction": float(r.friction),
            "actuators": list(r.actuators),
            "eta": float(r.eta),
            "torque_limits": {n: float(v) for n, v in (r.torque_limits or {}).items()},
            "force_limit": None if r.force_limit is None else float(r.force_limit),
            "command_limit": None if r.command_limit is None else float(r.command_limit),
        }
        | ({"torsion": float(r.torsion)} if r.torsion else {})
        | ({} if solids is None else {"solids": dict(solids)}),
    }


def asked_digest(data: dict[str, Any]) -> str:
    """SHA-256 of what is asked in a `handfast/grasps/1` object: task, motors, question."""
    return digest({key: data[key] for key in ("task", "motors", "question")})


def loads_to_dict(loads: Loads) -> dict[str, Any]:
    """Each load by its name: the wrench, or what makes it of the object's weight."""
    return {
        name: {"wrench": wrench}
        if weight is None
        else {"weight": {"along": weight.along.tolist(), "g": float(weight.g), "factor": float(weight.factor)}}
        for (name, wrench), weight in zip(loads.by_name.items(), loads.weights, strict=True)
    }


def _entry(g: SavedGrasp) -> dict[str, Any]:
    strength: dict[str, Any] = {}
    if g.strength:
        factor, states = g.strength
        strength = {"strength": {"factor": factor, "witnesses": {name: state_json(s) for name, s in states.items()}}}
    return strength | {
        "existence": g.solution.existence.to_json(),
        "joints": g.joints,
        "grasp": g.said,
        "witnesses": {name: state_json(state) for name, state in g.witnesses.items()},
    }


def save_grasps(saved: SavedGrasps, path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(saved), allow_nan=False) + "\n", force=force)


# --- reading ----------------------------------------------------------------------------------------


def from_dict(data: Any) -> SavedGrasps:
    """The grasps in a parsed object; raises `InputError` with field and fault."""
    entry = validate(GraspsFile, data)
    refuse_broken(data)
    try:
        task = task_from_dict(entry.task)
    except InputError as fault:
        raise fault.within("task") from None
    task = replace(task, hand=driven(task.hand, entry.motors))
    q, said = entry.question, entry.answer
    if len(said.grasps) != len(entry.grasps):
        raise InputError(f"has {len(said.grasps)} entries for {len(entry.grasps)} grasps", field="answer.grasps")
    stated = q.model_dump(exclude={"object", "loads", "actuators", "solids"})
    requirements = Requirements(actuators=tuple(q.actuators), **stated)
    grasps = tuple(
        _grasp(task, e, answer, f"grasps[{i}]")
        for i, (e, answer) in enumerate(zip(entry.grasps, said.grasps, strict=True))
    )
    proofs = {"none": entry.none, "bound": entry.bound, "solids": q.solids}
    return SavedGrasps(
        task, q.object, _loads(q), requirements, grasps, said, entry.record, asked_digest(data), **proofs
    )


def _loads(q: GraspsQuestionEntry) -> Loads:
    """The loads with their wrenches."""
    made = []
    for name, e in q.loads.items():
        if e.weight and q.object.mass is None:
            raise InputError("is null, but a load is its weight", field="question.object.mass")
        try:
            made.append(e.load(q.object.mass, q.object.center_of_mass))
        except InputError as fault:
            raise fault.within(f"question.loads.{name}") from None
    wrenches, weights = np.array([w for w, _ in made]).reshape(-1, 6), tuple(weight for _, weight in made)
    try:
        return Loads(tuple(q.loads), wrenches, weights)
    except InputError as fault:
        raise fault.within("question") from None


def _grasp(task: Task, e: GraspEntry, answer: dict[str, Any], field: str) -> SavedGrasp:
    solution = solution_of(task, e.existence, f"{field}.existence")
    try:
        if set(e.joints) != set(task.hand.joint_names):
            raise InputError(f"are not those of the hand: {', '.join(task.hand.joint_names)}", field="joints")
        witnesses = _states(e.witnesses)
        strength = (e.strength.factor, _states(e.strength.witnesses)) if e.strength else None
        try:
            grasp = grasp_file.from_dict(e.grasp)
        except InputError as fault:
            raise fault.within("grasp") from None
        return SavedGrasp(solution, e.joints, grasp, e.grasp, witnesses, answer, strength)
    except InputError as fault:
        raise fault.within(field) from None


def _states(entries: Mapping[str, LoadWitnessEntry]) -> dict[str, State]:
    states = {n: s.model_dump(exclude_none=True) for n, s in entries.items()}
    return {n: state_of(**{k: np.array(v) for k, v in s.items()}) for n, s in states.items()}


# --- motors -----------------------------------------------------------------------------------------


def driven(hand: Hand, motors: MotorsEntry) -> Hand:
    """The task's hand with what drives it; `InputError` with the field of what is wrong."""
    names = hand.joint_names
    if set(motors.closing) != set(names):
        raise InputError(f"is not of the hand's joints: {', '.join(names)}", field="motors.closing")
    try:
        mechanism = mechanism_of(motors.actuators, coupling_rows(hand.couplings, hand.l), names, "actuators")
    except InputError as fault:
        raise fault.within("motors") from None
    for j in motors.laws:
        hand.joint(j, field="motors.laws")
    for n, e in motors.tendons.items():
        for j in e.joints:
            hand.joint(j, field=f"motors.tendons.{n}.joints")
    joints = tuple(replace(j, law=motors.laws.get(j.name, NO_LAW)) for j in hand.joints)
    tendons = tuple(
        PassiveTendon(n, np.array([e.joints.get(j, 0.0) for j in names]), e.law) for n, e in motors.tendons.items()
    )
    closing = np.array([motors.closing[j] for j in names])
    return replace(hand, joints=joints, tendons=tendons, mechanism=mechanism, closing=closing)


def motors_to_dict(hand: Hand) -> dict[str, Any]:
    """What drives a hand, and the sense in which its joints close."""
    names = hand.joint_names
    laws = {
        "laws": {j.name: written(j.law) for j in hand.joints if j.law.any},
        "tendons": {t.name: written(t.law) | {"joints": by_joint(t.row, names)} for t in hand.tendons},
    }
    return {
        "actuators": actuators_to_dict(hand.mechanism, names),
        "closing": {n: int(s) for n, s in zip(names, hand.closing, strict=True)},
    } | {name: of for name, of in laws.items() if of}
