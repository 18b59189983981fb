"""A kind of question about one disturbance: what an answer to it claims, and how that is replayed.

An answer that was saved has exactly the keys of its query, and what it says under each of them is worked out again
from question, witness and certificate, but for `UNPROVED`. The replay is the same for all queries; what differs, each
`Query` says of itself.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeVar

import numpy as np
from pydantic import ConfigDict, Field

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.files import SAME, Strict
from handfast.stability import model
from handfast.stability.certify.arc import Arc
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.certify.certificate_file import question_to_dict
from handfast.stability.goal import Range
from handfast.stability.json_match import matches
from handfast.stability.posed import Posed
from handfast.stability.verification import CertificateCheck, IntervalCheck, Verified, WitnessCheck, first_range
from handfast.stability.witness import VALID, Witness

UNPROVED = ("stop", "seconds", "nodes", "verified")  # the course of the search: recorded, not proved


class ClaimRefused(Exception):
    """Why what an answer claims is not proved."""


class ResultAnswerEntry(Strict):
    """What every answer says in a `handfast/result/2` file; the other keys are compared with what backs them."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False, populate_by_name=True)

    format: Literal["handfast/answer/1"] = Field(alias="schema")
    verdict: Verdict
    stop: Stop
    seconds: Annotated[float, Field(ge=0)]
    nodes: Annotated[int, Field(ge=0)]
    certified: bool
    verified: bool = False  # none in version 1


Entry = TypeVar("Entry", bound=ResultAnswerEntry)


@dataclass(frozen=True, eq=False)
class SavedAnswer(Generic[Entry]):
    """An answer as it stands in a file.

    Attributes:
        query: the kind of question.
        question: what was asked, as certificates say it.
        answer: what was answered; `said`: all of it, as JSON.
        witness: the state behind it; None without.
        certificate: the proof behind it; None without.
        first: is it of version 1, whose certificates have caps?
        arcs, slips: what shows which smaller magnitudes are resisted and which slip, if that was asked of a maximum.
    """

    query: Query[Entry]
    question: Question
    answer: Entry
    said: dict[str, Any]
    witness: Witness | None
    certificate: Certificate | None
    first: bool = False
    arcs: tuple[Arc, ...] = ()
    slips: tuple[Certificate, ...] = ()

    @property
    def holds(self) -> bool:
        return self.answer.verdict is Verdict.HOLDS

    def verify(self) -> Verified:
        """Is everything that it claims proved? Replayed without the engine and without any solver."""
        return self.query.verified(self)


@dataclass(frozen=True, eq=False)
class WitnessClaim:
    """What a witness has to be: the state under a disturbance (6,), with commands (a,); in words."""

    words: str
    wrench: Array
    command: Array


@dataclass(frozen=True)
class CertificateClaim:
    """What a certificate has to show: in words, and the range of its scalar."""

    words: str
    scalar: Range


class Query(ABC, Generic[Entry]):
    """One kind of question; see the modules in `queries`.

    Attributes:
        name: in JSON under `query`.
        entry: what an answer says in a result file, beside what every answer says.
    """

    name: ClassVar[str]
    entry: ClassVar[type[ResultAnswerEntry]]

    @abstractmethod
    def witness_claim(self, saved: SavedAnswer[Entry], witness: Witness) -> WitnessClaim:
        """What the witness of an answer that HOLDS stands for; raises `ClaimRefused`."""

    @abstractmethod
    def certificate_claim(self, saved: SavedAnswer[Entry]) -> CertificateClaim | None:
        """What its certificate has to show, None if nothing needs one; `ClaimRefused` if it contradicts itself."""

    @abstractmethod
    def shown(self, saved: SavedAnswer[Entry]) -> dict[str, Any]:
        """What an answer has to say, by key, beside what every answer says: from what was replayed."""

    def witness_fault(self, saved: SavedAnswer[Entry], witness: Witness) -> str:
        """What else is wrong with a witness; '' if nothing."""
        return ""

    def interval(self, saved: SavedAnswer[Entry]) -> IntervalCheck | None:
        """The replay of what is said of smaller magnitudes."""
        if saved.arcs or saved.slips:
            raise ClaimRefused("has states or certificates of smaller magnitudes, but claims nothing of them")
        return None

    def verified(self, saved: SavedAnswer[Entry]) -> Verified:
        """Is everything that an answer claims proved?"""
        start = time.monotonic()
        witness, certificate, interval, reason = None, None, None, ""
        try:
            witness, certificate, interval = self._witness(saved), self._certificate(saved), self.interval(saved)
            for name, part in (("witness", witness), ("certificate", certificate), ("interval", interval)):
                if part and part.reason and not reason:
                    reason = f"{name}: {part.reason}"
            if not reason:
                self._compare(saved, certificate)
        except ClaimRefused as fault:
            reason = f"answer: {fault}"
        return Verified(witness, certificate, time.monotonic() - start, reason, interval)

    def _witness(self, saved: SavedAnswer[Entry]) -> WitnessCheck | None:
        q, w = saved.question, saved.witness
        if w is None:
            if saved.holds:
                raise ClaimRefused("HOLDS without a witness")
            return None
        if not saved.holds:
            raise ClaimRefused(f"{saved.answer.verdict.upper()} with a witness")
        claim = self.witness_claim(saved, w)
        reason = _state_fault(q, w, claim) or self.witness_fault(saved, w)
        found = model.residuals(q.grasp, claim.wrench, w.state, eta=q.eta, command=claim.command, mdp=q.mdp).worst
        if not reason and not found <= VALID:
            reason = f"the residual is {found:.1e}, above {VALID:g}"
        return WitnessCheck(claim.words, found, reason)

    def _certificate(self, saved: SavedAnswer[Entry]) -> CertificateCheck | None:
        q, c = saved.question, saved.certificate
        Posed.of(q)  # raises for what is no question
        need = self.certificate_claim(saved)
        if need is None:
            if c is not None:
                raise ClaimRefused("has a certificate, but claims nothing that needs one")
            return None
        words, (lo, hi) = need.words, need.scalar
        if c is None:
            raise ClaimRefused(f"{words}: no certificate")
        if saved.first and c.scalar is not None:
            words, (lo, hi) = c.claim, first_range(q, lo, hi)
        reason = ""
        if question_to_dict(c.question) != question_to_dict(q):
            reason = "it answers another question"
        elif c.capped and not saved.first:
            reason = "it has caps on motions; an answer of this version is about all of them"
        elif c.scalar is not None and not (c.scalar[0] <= lo + SAME * abs(lo) and c.scalar[1] >= hi * (1 - SAME)):
            reason = f"it covers {c.scalar[0]:.9g} to {c.scalar[1]:.9g}; the answer needs {lo:.9g} to {hi:.9g}"
        return CertificateCheck.of(c, words, reason)

    def _compare(self, saved: SavedAnswer[Entry], replayed: CertificateCheck | None) -> None:
        """`ClaimRefused` if an answer has other keys than its query's, or says else than what was replayed."""
        answer, c = saved.answer, saved.certificate
        shown: dict[str, Any] = {
            "schema": answer.format,
            "query": self.name,
            "verdict": str(answer.verdict),
            "certified": c is not None,
        }
        if saved.first:
            shown["motion_cap"] = None if c is None or c.cap_r is None else float(c.cap_r[0])
        else:
            shown["motion_cap"] = replayed.motion if replayed else None
        shown |= self.shown(saved)
        unproved = set(UNPROVED) - ({"verified"} if saved.first else set())
        for key in saved.said:
            if key not in shown and key not in unproved:
                raise ClaimRefused(f"{key} is nothing that it can say; leave it out")
        for key in [*shown, *unproved]:
            if key not in saved.said:
                raise ClaimRefused(f"{key} is missing")
        for key, value in shown.items():
            if not matches(saved.said[key], value):
                raise ClaimRefused(f"{key} is not what the rest of the file shows")


def _state_fault(q: Question, w: Witness, claim: WitnessClaim) -> str:
    """Is the witness's load the claimed one, and are the limits kept?"""
    if not close(w.wrench, claim.wrench):
        return "it is a state under another disturbance"
    if not close(w.grasp.command, claim.command):
        return "it is a state with other commands"
    allowed = SAME * model.force_scale(claim.wrench, w.state.c)
    arms = model.actuator_arms(q.grasp)
    for i, name in enumerate(q.grasp.mechanism.actuators):
        if abs(w.state.f[i]) > q.torque_limits.get(name, np.inf) + allowed * arms[i]:
            return f"{name} carries more than its limit"
    if q.force_limit is not None and w.state.c[0::3].max() > q.force_limit + allowed:
        return "a normal force is above its limit"
    return ""


def close(a: Array, b: Array) -> bool:
    """The same numbers but for rounding."""
    return bool(np.abs(a - b).max(initial=0.0) <= SAME * np.abs(b).max(initial=0.0))
