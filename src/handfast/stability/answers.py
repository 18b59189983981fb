"""What every answer about one disturbance has: verdict, witness, proof, cost; it saves and checks itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from handfast.core.answer import Stop, Verdict, header
from handfast.core.errors import InputError
from handfast.core.files import validate
from handfast.stability import saved_answer
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.posed import Posed
from handfast.stability.query import Query, SavedAnswer
from handfast.stability.refinement import RefinementStep
from handfast.stability.verification import Verified
from handfast.stability.witness import Witness

if TYPE_CHECKING:
    from handfast.stability.search.proof import Proof


@dataclass(frozen=True, eq=False)
class Answer(ABC):
    """What every query answers.

    Attributes:
        query: what kind of answer it is.
        verdict: HOLDS with a valid witness; SLIPS if every case is refuted; else UNDECIDED.
        stop: why the search ended.
        seconds, nodes: its cost: wall time, nodes of the tree. steps: those of Algorithm 1.
        found: the exact solution behind `verdict` or `lower`, as it was found; see `witness`.
        proof: what the other bound rests on; Algorithm 1 has none.
        posed: the problem and the goal of the search.
        verified: was everything that it says replayed, the proof by the independent checker?
        as_found: is the solution one that was read, to be judged as it stands? Then `witness` is no other.
    """

    query: ClassVar[Query[Any]]

    verdict: Verdict
    stop: Stop
    seconds: float
    nodes: int
    steps: tuple[RefinementStep, ...]
    found: Witness | None
    proof: Proof | None = field(repr=False)
    posed: Posed | None = field(default=None, kw_only=True, repr=False)
    verified: bool = field(default=False, kw_only=True)
    as_found: bool = field(default=False, kw_only=True, repr=False)

    @cached_property
    def witness(self) -> Witness | None:
        """The exact solution that is shown, drawn and saved: `least_motion` of the one that was found."""
        if self.found is None or self.posed is None or self.as_found:
            return self.found
        from handfast.stability.least_motion import least_motion  # needs the engine, which verifying must not

        p = self.posed.problem
        return least_motion(self.found, p.torque_limits, p.force_limit)

    @cached_property
    def certificate(self) -> Certificate | None:
        """The proof of SLIPS, or of the bound that no state was found for, for `verify`; None without."""
        return self.proof.certificate if self.proof else None

    @cached_property
    def question(self) -> Question | None:
        """What was asked, as certificates and result files say it."""
        return self.posed.question if self.posed else None

    @abstractmethod
    def said(self) -> dict[str, Any]:
        """The keys of its query's JSON."""

    def proof_json(self) -> dict[str, Any]:
        """Keys of every answer: is there a certificate, was all replayed, and up to which motions [N] if not all?"""
        cap = self.proof.cap if self.proof else None
        return {"certified": self.certificate is not None, "verified": self.verified, "motion_cap": cap}

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return header(self, self.query.name) | self.proof_json() | self.said()

    def saved(self) -> SavedAnswer[Any]:
        """The answer as a file has it; `InputError` if it does not know its question."""
        if self.question is None:
            raise InputError("does not know its question; save what a query returned", field="answer")
        said = self.to_json()
        return SavedAnswer(
            self.query, self.question, validate(self.query.entry, said), said, self.witness, self.certificate
        )

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/result/2` file: question, answer, witness, certificate. For `handfast.verify`.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        saved_answer.save_answer(self.saved(), path, force=force)

    def verify(self) -> Verified:
        """Is everything that it claims proved? Replayed without the engine and without any solver.

        Raises:
            InputError: it does not know its question.
        """
        return self.saved().verify()


def finite(x: float) -> float | None:
    """JSON has no infinity: None."""
    return float(x) if np.isfinite(x) else None
