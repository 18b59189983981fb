"""The `handfast/result/2` file: an answer with its question and what backs it, for `handfast verify`.

Version 1 is read: its answers speak of motions up to a cap.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.core.files import Strict, validate, write_text
from handfast.stability.certify import certificate_file
from handfast.stability.certify.arc import Arc
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.certify.certificate_file import QuestionEntry, Six, question_of, question_to_dict
from handfast.stability.model import State
from handfast.stability.witness import Witness

if TYPE_CHECKING:
    from handfast.stability.answers import Answer


FIRST, SCHEMA = "handfast/result/1", "handfast/result/2"


class AnswerEntry(Strict):
    """What every answer says; the other keys are compared with what backs them, see `replay`."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, populate_by_name=True)

    format: Literal["handfast/answer/1"] = Field(alias="schema")
    verdict: Verdict
    stop: Stop
    seconds: Annotated[float, Field(ge=0)]
    nodes: Annotated[int, Field(ge=0)]
    certified: bool
    verified: bool = False  # none in version 1


class CheckEntry(AnswerEntry):
    query: Literal["check"]


class MaxEntry(AnswerEntry):
    query: Literal["max"]
    lower: float
    upper: float | None
    gap: float | None
    unbounded: bool
    holds_from_zero_to: float | None = None
    holds_from_zero_upper: float | None = None
    holes: list[tuple[float, float]] = Field(default_factory=list)
    unproved: list[tuple[float, float]] = Field(default_factory=list)
    resolution: Annotated[float, Field(ge=0)] | None = None


class TorquesEntry(AnswerEntry):
    query: Literal["torques"]
    preload: dict[str, float] | None
    lower: float | None
    upper: float | None


class StateEntry(Strict):
    r: Six
    q: list[float]
    c: list[float]
    f: list[float]
    coupling: list[float]


class WitnessEntry(StateEntry):
    wrench: Six
    command: dict[str, float]


class ArcEntry(Strict):
    first: float
    last: float
    controls: list[StateEntry]


class ResultFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/result/1", "handfast/result/2"] = Field(alias="schema")
    question: QuestionEntry
    answer: Annotated[CheckEntry | MaxEntry | TorquesEntry, Field(discriminator="query")]
    witness: WitnessEntry | None
    certificate: dict[str, Any] | None
    arcs: list[ArcEntry] = Field(default_factory=list)
    slips: list[dict[str, Any]] = Field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Result:
    """An answer as it stands in a file.

    Attributes:
        question: what was asked, as certificates say it.
        answer: what was answered; `said`: all of it, as JSON.
        witness: the state behind it; None without.
        certificate: the proof behind it; None without.
        first: is it of version 1, whose certificates have caps?
        arcs, slips: what shows which smaller magnitudes are resisted and which slip, if that was asked of a maximum.
    """

    question: Question
    answer: CheckEntry | MaxEntry | TorquesEntry
    said: dict[str, Any]
    witness: Witness | None
    certificate: Certificate | None
    first: bool = False
    arcs: tuple[Arc, ...] = ()
    slips: tuple[Certificate, ...] = ()

    @classmethod
    def of(cls, answer: Answer) -> Result:
        """The result of a query; `InputError` for an answer that does not know its question."""
        if answer.question is None:
            raise InputError("does not know its question; save what a query returned", field="answer")
        said = answer.to_json()
        if said["query"] == "check":  # nothing in the file would prove a margin
            said["margin"] = None
        bare = {"schema": SCHEMA, "question": question_to_dict(answer.question), "answer": said}
        entry = validate(ResultFile, bare | {"witness": None, "certificate": None})
        interval = getattr(answer, "interval", None)
        shown = {"arcs": interval.arcs, "slips": interval.slips} if interval else {}
        return cls(answer.question, entry.answer, said, answer.witness, answer.certificate, **shown)


def _state(s: State) -> dict[str, Any]:
    arrays = {"r": s.r, "q": s.q, "c": s.c, "f": s.f, "coupling": s.coupling}
    return {name: value.tolist() for name, value in arrays.items()}


def _witness_dict(w: Witness) -> dict[str, Any]:
    return {
        "wrench": np.asarray(w.wrench).tolist(),
        "command": dict(zip(w.grasp.mechanism.actuators, w.grasp.command.tolist(), strict=True)),
        **_state(w.state),
    }


def _arc_dict(a: Arc) -> dict[str, Any]:
    return {"first": a.first, "last": a.last, "controls": [_state(s) for s in a.controls]}


def to_dict(result: Result) -> dict[str, Any]:
    """The result as a `handfast/result/2` object (1 if it was read from one); numbers come back exactly."""
    smaller: dict[str, Any] = {}
    if result.arcs:
        smaller["arcs"] = [_arc_dict(a) for a in result.arcs]
    if result.slips:
        smaller["slips"] = [certificate_file.to_dict(c) for c in result.slips]
    return {
        "schema": FIRST if result.first else SCHEMA,
        "question": question_to_dict(result.question),
        "answer": result.said,
        "witness": None if result.witness is None else _witness_dict(result.witness),
        "certificate": None if result.certificate is None else certificate_file.to_dict(result.certificate),
        **smaller,
    }


def from_dict(data: Any) -> Result:
    """The result in a parsed object; raises `InputError` with field and fault."""
    entry = validate(ResultFile, data)
    question = question_of(entry.question)
    certificate = None if entry.certificate is None else _certificate(entry.certificate, "certificate")
    witness = _witness(entry.witness, question) if entry.witness else None
    arcs = tuple(_arc(a, question, f"arcs[{i}]") for i, a in enumerate(entry.arcs))
    slips = tuple(_certificate(c, f"slips[{i}]") for i, c in enumerate(entry.slips))
    return Result(question, entry.answer, data["answer"], witness, certificate, entry.format == FIRST, arcs, slips)


def _certificate(data: dict[str, Any], place: str) -> Certificate:
    try:
        return certificate_file.from_dict(data)
    except InputError as fault:
        raise fault.within(place) from None


def _read_state(entry: StateEntry, question: Question, place: str) -> State:
    g = question.grasp
    sizes = {"q": g.l, "c": 3 * g.m, "f": g.mechanism.a, "coupling": len(g.mechanism.A)}
    for name, size in sizes.items():
        if len(getattr(entry, name)) != size:
            raise InputError(f"has {len(getattr(entry, name))} numbers, needs {size}", field=f"{place}.{name}")
    return State(**{name: np.array(getattr(entry, name), dtype=float) for name in ("r", *sizes)})


def _witness(entry: WitnessEntry, question: Question) -> Witness:
    state, g = _read_state(entry, question, "witness"), question.grasp
    command = g.mechanism.commands(entry.command, field="witness.command")
    return Witness(g.with_preload(command), np.array(entry.wrench), state, question.eta, question.mdp)


def _arc(entry: ArcEntry, question: Question, place: str) -> Arc:
    controls = enumerate(entry.controls)
    states = tuple(_read_state(s, question, f"{place}.controls[{i}]") for i, s in controls)
    try:
        return Arc(entry.first, entry.last, states)
    except InputError as fault:
        raise fault.within(place) from None


def save_result(result: Result, path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(result), allow_nan=False) + "\n", force=force)
