"""What a synthesis answers: configurations with their proofs, or that there is none, or neither."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Checked, Reach, Stop, header
from handfast.core.files import write_text
from handfast.synthesis.certify.verify_existence import Report
from handfast.synthesis.distance import features
from handfast.synthesis.embedded import sealed, task_to_dict
from handfast.synthesis.solution import Solution
from handfast.synthesis.task import Task


@dataclass(frozen=True)
class Searched:
    """How far the search for a contradiction came.

    Attributes:
        by: the contacts that cannot go together, or those that are nearest to that, in words.
        nodes: boxes examined.
        discarded: share of the space that no configuration is in, by verified arithmetic.
        depth: of the search tree.
        pending: boxes left.
        smallest, largest: [rad, -] widest side of the smallest and of the largest of them.
    """

    by: str
    nodes: int
    discarded: float
    depth: int
    pending: int
    smallest: float
    largest: float

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class ReplayedSynthesis(Checked):
    """Proofs of existence that were checked.

    Attributes:
        reports: one for each configuration.
        seconds: wall time.
        reason: why it is not all proved: one line; '' if it is.
    """

    reports: tuple[Report, ...]
    seconds: float
    reason: str

    def to_json(self) -> dict[str, Any]:
        return self._json(
            {
                "configurations": [
                    {
                        "ok": r.ok,
                        "contraction": _finite(r.contraction),
                        "gap": _finite(r.gap),
                        "reason": r.reasons[0] if r.reasons else "",
                    }
                    for r in self.reports
                ],
            }
        )


@dataclass(frozen=True, eq=False)
class Synthesis:
    """Can the hand take the hold?

    Attributes:
        task: the question.
        verdict: FOUND with certified configurations; NONE if every part of the space was discarded; else
            UNDECIDED.
        stop: why the search ended.
        seconds: wall time.
        starts: random starts of the local search; unproved: candidates that could not be certified and are
            not returned.
        solutions: the configurations; several are ordered so that each differs most from those before it.
        searched: of the search for a contradiction; None if it did not come to that.
        seed: of the random numbers.
        state: what a later call needs to go on if UNDECIDED, else {}.
    """

    task: Task = field(repr=False)
    verdict: Reach
    stop: Stop
    seconds: float
    starts: int
    unproved: int
    solutions: tuple[Solution, ...] = field(repr=False)
    searched: Searched | None
    seed: int
    state: Mapping[str, Any] = field(repr=False)

    @property
    def nodes(self) -> int:
        """Boxes that the search for a contradiction examined."""
        return self.searched.nodes if self.searched else 0

    @cached_property
    def spread(self) -> float | None:
        """The smallest distance of two of the configurations, see `distance`; None for fewer than two."""
        at = features(self.solutions)
        gaps = [np.linalg.norm(at[i] - at[:i], axis=1).min() for i in range(1, len(at))]
        return float(min(gaps)) if gaps else None

    def verify(self) -> ReplayedSynthesis:
        """Every proof of existence, checked by `verify_existence` and nothing else."""
        start = time.monotonic()
        reports = tuple(solution.verify() for solution in self.solutions)
        refused = [(i, r.reasons[0]) for i, r in enumerate(reports) if not r.ok]
        reason = f"configuration {refused[0][0]}: {refused[0][1]}" if refused else ""
        if self.verdict is Reach.FOUND and not reports:
            reason = "FOUND without a configuration"
        elif self.verdict is not Reach.FOUND and reports:
            reason = f"{self.verdict.upper()} with a configuration"
        elif self.verdict is Reach.NONE:
            reason = "NONE has no proof that can be replayed: it rests on the search itself, ask it again"
        return ReplayedSynthesis(reports, time.monotonic() - start, reason)

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return header(self, "synthesize") | {
            "starts": self.starts,
            "unproved": self.unproved,
            "seed": self.seed,
            "spread": self.spread,
            "configurations": [solution.to_json() for solution in self.solutions],
            "searched": self.searched.to_json() if self.searched else None,
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/synthesis/1` file, for `handfast.verify` and for going on.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        write_text(path, json.dumps(self.to_file(), allow_nan=False) + "\n", force=force)

    def to_file(self) -> dict[str, Any]:
        """The `handfast/synthesis/1` object; numbers come back exactly."""
        task, state = task_to_dict(self.task), dict(self.state) or None
        return sealed({"schema": "handfast/synthesis/1", "task": task, "answer": self.to_json(), "state": state})


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
