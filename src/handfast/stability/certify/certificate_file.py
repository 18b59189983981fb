"""The `handfast/certificate/2` file: a claim and its proof, numbers to the last bit. Version 1, with caps, is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.arrays import frozen
from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate, write_text
from handfast.model import grasp_file
from handfast.stability.certify.certificate import NODE_ARRAYS, ROW_ARRAYS, Certificate, Question
from handfast.stability.goal import named

Int = Annotated[int, Field(strict=True, ge=-(2**31), lt=2**31)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class CertificateQuestionEntry(Strict):
    grasp: dict[str, Any]
    goal: Literal["check", "smallest preload", "largest", "torques"]
    wrench: Six
    direction: Six | None = None
    eta: float = 0.0
    mdp: bool = True
    torque_limits: dict[str, float] = Field(default_factory=dict)
    force_limit: float | None = None
    driven: list[str] = Field(default_factory=list)
    objective: Literal["max", "sum"] = "max"


class CertificateNodesEntry(Strict):
    parent: Annotated[list[Int], Field(min_length=1)]
    part: list[Int]
    state: list[Int]
    left: list[Int]
    right: list[Int]


class CertificateRowsEntry(Strict):
    start: Annotated[list[Int], Field(min_length=1)]
    kind: list[Int]
    index: list[Int]
    a: list[Int]
    b: list[Int]
    multiplier: list[float]


class CertificateFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/certificate/2"] = Field(alias="schema")
    question: CertificateQuestionEntry
    scalar: tuple[float, float | None] | None = None
    nodes: CertificateNodesEntry
    leaves: list[Int]
    rows: CertificateRowsEntry
    references: list[list[float]] = Field(default_factory=list)


class FirstCertificateFile(CertificateFile):
    """Version 1: the claim holds for motions inside a cap."""

    format: Literal["handfast/certificate/1"] = Field(alias="schema")  # type: ignore[assignment]
    cap_r: Six
    cap_q: list[float]


def question_to_dict(q: Question) -> dict[str, Any]:
    """The question as it stands in certificates and result files; numbers come back exactly."""
    return {
        "grasp": grasp_file.to_dict(q.grasp),
        "goal": q.goal.word,
        "wrench": q.wrench.tolist(),
        "direction": None if q.direction is None else q.direction.tolist(),
        "eta": float(q.eta),
        "mdp": bool(q.mdp),
        "torque_limits": dict(q.torque_limits),
        "force_limit": None if q.force_limit is None else float(q.force_limit),
        "driven": list(q.driven),
        "objective": q.goal.effort,
    }


def question_of(entry: CertificateQuestionEntry) -> Question:
    """The question of a file's entry; raises `InputError` with fields from `question` on."""
    asked = entry.model_dump()
    try:
        asked["grasp"] = grasp_file.from_dict(asked["grasp"])
    except InputError as fault:
        raise fault.within("question.grasp") from None
    asked["goal"] = named(asked["goal"], asked.pop("objective"))
    return Question(**asked)


def to_dict(certificate: Certificate) -> dict[str, Any]:
    """The certificate as a `handfast/certificate/2` object (1 if it has caps); numbers come back exactly."""
    c = certificate
    caps = {} if c.cap_r is None or c.cap_q is None else {"cap_r": c.cap_r.tolist(), "cap_q": c.cap_q.tolist()}
    return {
        "schema": "handfast/certificate/1" if c.capped else "handfast/certificate/2",
        "question": question_to_dict(c.question),
        **caps,
        "scalar": None if c.scalar is None else [x if np.isfinite(x) else None for x in c.scalar],
        "nodes": {name: getattr(c, name).tolist() for name in NODE_ARRAYS},
        "leaves": c.leaves.tolist(),
        "rows": {name: getattr(c, name).tolist() for name in ROW_ARRAYS},
        "references": c.references.tolist(),
    }


def from_dict(data: Any) -> Certificate:
    """The certificate in a parsed object; raises `InputError` as `load_certificate` does."""
    first = isinstance(data, dict) and data.get("schema") == "handfast/certificate/1"
    entry = validate(FirstCertificateFile if first else CertificateFile, data)
    question = question_of(entry.question)
    shape = (len(entry.references), question.grasp.m + 1)
    caps = {"cap_r": entry.cap_r, "cap_q": entry.cap_q} if isinstance(entry, FirstCertificateFile) else {}
    scalar = None if entry.scalar is None else (entry.scalar[0], np.inf if entry.scalar[1] is None else entry.scalar[1])
    return Certificate(
        question=question,
        scalar=scalar,
        leaves=np.array(entry.leaves, dtype=np.int64),
        **entry.nodes.model_dump(),
        **entry.rows.model_dump(),
        references=frozen(entry.references, shape, "references"),
        **{name: np.array(cap, dtype=float) for name, cap in caps.items()},
    )


def load_certificate(path: str | Path) -> Certificate:
    """Read a `handfast/certificate/1` file. Raises `InputError`: one line with file, field and fault."""
    data = read_json(path, "certificate")
    try:
        return from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None


def save_certificate(certificate: Certificate, path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(certificate), allow_nan=False) + "\n", force=force)
