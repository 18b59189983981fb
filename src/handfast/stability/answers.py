"""What the queries return: verdict, bounds, witness, cost; each as the JSON object of the command line."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.answer import Stop, Verdict, header
from handfast.core.arrays import Array
from handfast.stability import asked
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.goal import Goal
from handfast.stability.paper.program import INF
from handfast.stability.problem import Problem
from handfast.stability.witness import KEYS, Witness

if TYPE_CHECKING:
    from handfast.stability.interval import Interval
    from handfast.stability.limit import Supremum
    from handfast.stability.margin import Margin
    from handfast.stability.paper.algorithm1 import Step
    from handfast.stability.search.proof import Proof


@dataclass(frozen=True, eq=False)
class Answer:
    """What every query answers.

    Attributes:
        verdict: HOLDS with a valid witness; SLIPS if every case is refuted; else UNDECIDED.
        stop: why the search ended.
        seconds, nodes: its cost: wall time, nodes of the tree. steps: those of Algorithm 1.
        witness: the exact solution behind `verdict` or `lower`.
        proof: what the other bound rests on; Algorithm 1 has none.
        posed: the problem and the goal of the search.
        verified: was everything that it says replayed, the proof by the independent checker?
    """

    verdict: Verdict
    stop: Stop
    seconds: float
    nodes: int
    steps: tuple[Step, ...]
    witness: Witness | None
    proof: Proof | None = field(repr=False)
    posed: tuple[Problem, Goal] | None = field(default=None, kw_only=True, repr=False)
    verified: bool = field(default=False, kw_only=True)

    @cached_property
    def certificate(self) -> Certificate | None:
        """The proof of SLIPS, or of the bound that no state was found for, for `verify`; None without."""
        return self.proof.certificate if self.proof else None

    @cached_property
    def question(self) -> Question | None:
        """What was asked, as certificates and result files say it."""
        return asked.question(*self.posed) if self.posed else None

    def proof_json(self) -> dict[str, Any]:
        """Keys of every answer: is there a certificate, was all replayed, and up to which motions [N] if not all?"""
        cap = self.proof.cap if self.proof else None
        return {"certified": self.certificate is not None, "verified": self.verified, "motion_cap": cap}

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        raise NotImplementedError

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/result/2` file: question, answer, witness, certificate. For `handfast.verify`.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        from handfast.stability import result_file

        result_file.save_result(result_file.Result.of(self), path, force=force)


@dataclass(frozen=True, eq=False)
class CheckAnswer(Answer):
    """Is this disturbance resisted?

    Attributes:
        margin: how much a HOLDS leans on, if that was asked: `handfast.margin`.
    """

    margin: Margin | None = field(default=None, kw_only=True)

    def to_json(self) -> dict[str, Any]:
        state = self.witness.to_json() if self.witness else dict.fromkeys(KEYS)
        leans = {"margin": self.margin.to_json() if self.margin else None}
        return header(self, "check") | self.proof_json() | state | leans


@dataclass(frozen=True, eq=False)
class MaxAnswer(Answer):
    """How large a disturbance is resisted?

    Attributes:
        lower: the largest magnitude that was witnessed, 0 if none.
        upper: no larger magnitude is possible; inf if that could not be shown.
        unbounded: resisted as far as the search goes, ten thousand times the preload (or the base load,
            or the limits); `lower` is that magnitude and its witness, `upper` is inf.
        interval: which magnitudes below are resisted too, if that was asked.
        point: (n,) the witness in the engine's unknowns.
    """

    lower: float
    upper: float
    unbounded: bool
    interval: Interval | None = field(default=None, kw_only=True)
    point: Array | None = field(default=None, kw_only=True, repr=False)

    @cached_property
    def limit(self) -> Supremum | None:
        """What the magnitudes tend to as the virtual motion grows without end, where no state attains the largest.

        None where nothing shows that.
        """
        if self.posed is None or self.witness is None or not (self.lower > 0 and np.isfinite(self.upper)):
            return None
        from handfast.stability.limit import limit_from

        return limit_from(*self.posed, self.witness.state, self.lower, self.upper)

    @property
    def attained(self) -> bool:
        """False if the largest magnitude is shown to be approached only, by states that move ever farther."""
        return self.limit is None

    @property
    def gap(self) -> float:
        """(upper - lower) / lower; 0 if unbounded or both are 0, inf if one bound is missing."""
        if self.unbounded or self.upper == 0:
            return 0.0
        return (self.upper - self.lower) / self.lower if self.lower > 0 else INF

    def to_json(self) -> dict[str, Any]:
        return (
            header(self, "max")
            | self.proof_json()
            | {
                "lower": self.lower,
                "upper": finite(self.upper),
                "gap": finite(self.gap),
                "unbounded": self.unbounded,
                "attained": self.attained,
                "limit": self.limit.to_json() if self.limit else None,
                "holds_from_zero_to": self.interval.holds_from_zero_to if self.interval else None,
            }
            | (self.interval.to_json() if self.interval else {})
        )


@dataclass(frozen=True, eq=False)
class TorquesAnswer(Answer):
    """Which commands resist a disturbance with the least effort?

    Attributes:
        preload: actuator name -> command [N m or N]; None without a witness. 0 is a locked actuator.
        lower, upper: certified and witnessed bound on the objective [N m or N].
    """

    preload: dict[str, float] | None
    lower: float
    upper: float

    def to_json(self) -> dict[str, Any]:
        return (
            header(self, "torques")
            | self.proof_json()
            | {
                "preload": self.preload,
                "lower": finite(self.lower),
                "upper": finite(self.upper),
            }
        )


def finite(x: float) -> float | None:
    """JSON has no infinity: None."""
    return float(x) if np.isfinite(x) else None
