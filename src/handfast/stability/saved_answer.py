"""The `handfast/result/2` file: an answer with its question and what backs it, for `handfast verify`.

Version 1 is read: its answers speak of motions up to a cap.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model

from handfast.core.errors import InputError
from handfast.core.files import Strict, validate, write_text
from handfast.stability.certify import certificate_file
from handfast.stability.certify.arc import Arc
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.certify.certificate_file import CertificateQuestionEntry, Six, question_of, question_to_dict
from handfast.stability.model import State
from handfast.stability.query import Query, ResultAnswerEntry, SavedAnswer
from handfast.stability.witness import Witness

FIRST, SCHEMA = "handfast/result/1", "handfast/result/2"


class ResultStateEntry(Strict):
    r: Six
    q: list[float]
    c: list[float]
    f: list[float]
    coupling: list[float]
    reaction: list[float] = Field(default_factory=list)
    torsion: list[float] = Field(default_factory=list)


class ResultWitnessEntry(ResultStateEntry):
    wrench: Six
    command: dict[str, float]


class ResultArcEntry(Strict):
    first: float
    last: float
    controls: list[ResultStateEntry]


class ResultFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/result/1", "handfast/result/2"] = Field(alias="schema")
    question: CertificateQuestionEntry
    answer: Any  # the entry of one of the queries, see `file_model`
    witness: ResultWitnessEntry | None
    certificate: dict[str, Any] | None
    arcs: list[ResultArcEntry] = Field(default_factory=list)
    slips: list[dict[str, Any]] = Field(default_factory=list)


@cache
def file_model(entries: tuple[type[ResultAnswerEntry], ...]) -> type[ResultFile]:
    """The file with answers of these kinds."""
    kinds: Any = reduce(or_, entries)
    kind: Any = Annotated[kinds, Field(discriminator="query")]
    return create_model("ResultFile", __base__=ResultFile, answer=(kind, ...))


def state_dict(s: State) -> dict[str, Any]:
    """A state as files have it: `reaction` and `torsion` only where joints and contacts have one."""
    arrays = {"r": s.r, "q": s.q, "c": s.c, "f": s.f, "coupling": s.coupling}
    if s.reaction.any():
        arrays["reaction"] = s.reaction
    if s.torsion.any():
        arrays["torsion"] = s.torsion
    return {name: value.tolist() for name, value in arrays.items()}


def _witness_dict(w: Witness) -> dict[str, Any]:
    return {
        "wrench": np.asarray(w.wrench).tolist(),
        "command": dict(zip(w.grasp.mechanism.actuators, w.grasp.command.tolist(), strict=True)),
        **state_dict(w.state),
    }


def _arc_dict(a: Arc) -> dict[str, Any]:
    return {"first": a.first, "last": a.last, "controls": [state_dict(s) for s in a.controls]}


def to_dict(result: SavedAnswer[Any]) -> dict[str, Any]:
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


def from_dict(data: Any, queries: Mapping[str, Query[Any]]) -> SavedAnswer[Any]:
    """The answer in a parsed object, to one of these queries; raises `InputError` with field and fault."""
    entry = validate(file_model(tuple(query.entry for query in queries.values())), data)
    question = question_of(entry.question)
    return SavedAnswer(
        query=queries[data["answer"]["query"]],
        question=question,
        answer=entry.answer,
        said=data["answer"],
        witness=_witness(entry.witness, question) if entry.witness else None,
        certificate=None if entry.certificate is None else _certificate(entry.certificate, "certificate"),
        first=entry.format == FIRST,
        arcs=tuple(_arc(a, question, f"arcs[{i}]") for i, a in enumerate(entry.arcs)),
        slips=tuple(_certificate(c, f"slips[{i}]") for i, c in enumerate(entry.slips)),
    )


def _certificate(data: dict[str, Any], place: str) -> Certificate:
    try:
        return certificate_file.from_dict(data)
    except InputError as fault:
        raise fault.within(place) from None


def _read_state(entry: ResultStateEntry, question: Question, place: str) -> State:
    g = question.grasp
    sizes = {"q": g.l, "c": 3 * g.m, "f": g.mechanism.a, "coupling": len(g.mechanism.A)}
    for name, size in sizes.items():
        if len(getattr(entry, name)) != size:
            raise InputError(f"has {len(getattr(entry, name))} numbers, needs {size}", field=f"{place}.{name}")
    if entry.reaction and len(entry.reaction) != g.l:
        raise InputError(f"has {len(entry.reaction)} numbers, needs {g.l}", field=f"{place}.reaction")
    if entry.torsion and len(entry.torsion) != g.m:
        raise InputError(f"has {len(entry.torsion)} numbers, needs {g.m}", field=f"{place}.torsion")
    own = {
        "reaction": np.array(entry.reaction or np.zeros(g.l), dtype=float),
        "torsion": np.array(entry.torsion or np.zeros(g.m), dtype=float),
    }
    return State(**{name: np.array(getattr(entry, name), dtype=float) for name in ("r", *sizes)}, **own)


def _witness(entry: ResultWitnessEntry, question: Question) -> Witness:
    state, g = _read_state(entry, question, "witness"), question.grasp
    command = g.mechanism.commands(entry.command, field="witness.command")
    return Witness(g.with_preload(command), np.array(entry.wrench), state, question.eta, question.mdp)


def _arc(entry: ResultArcEntry, question: Question, place: str) -> Arc:
    controls = enumerate(entry.controls)
    states = tuple(_read_state(s, question, f"{place}.controls[{i}]") for i, s in controls)
    try:
        return Arc(entry.first, entry.last, states)
    except InputError as fault:
        raise fault.within(place) from None


def save_answer(result: SavedAnswer[Any], path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(result), allow_nan=False) + "\n", force=force)
