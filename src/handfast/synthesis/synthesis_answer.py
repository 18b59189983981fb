"""What a synthesis answers: configurations with their proofs, or that there is none, or neither."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Checked, Reach, Stop, header
from handfast.core.files import write_text
from handfast.synthesis.certify.existence import ProofRefused
from handfast.synthesis.certify.impossibility import impossible
from handfast.synthesis.certify.verify_existence import Report, verify_existence
from handfast.synthesis.distance import features
from handfast.synthesis.embedded import sealed, task_to_dict
from handfast.synthesis.solution import Solution
from handfast.synthesis.task import Task

COURSE = "the course of the search: starts, boxes and seconds"


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

    def contacts(self, count: int) -> tuple[tuple[int, ...], bool] | None:
        """Those of `count` contacts that `by` names, and whether the object's position is among them; None if none."""
        named = re.fullmatch(r"contacts? (\d+(?:, \d+)*)(?: and (\d+|the object's position))?", self.by)
        if not named:
            return None
        numbers = [int(n) for n in re.findall(r"\d+", self.by)]
        fits = numbers == sorted(set(numbers)) and numbers[-1] < count
        return (tuple(numbers), named[2] is not None and not named[2].isdigit()) if fits else None

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class ReplayedSynthesis(Checked):
    """What of a synthesis was checked.

    Attributes:
        reports: of the proof of existence of each configuration.
        seconds: wall time.
        reason: why it is not all proved: one line; '' if it is.
        replayed: what was replayed and found right, a line each.
        not_replayed: what the answer says that cannot be replayed, and why, a line each.
    """

    reports: tuple[Report, ...]
    seconds: float
    reason: str
    replayed: tuple[str, ...] = ()
    not_replayed: tuple[str, ...] = ()

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
        """Every proof of existence, and of a NONE as much as `impossible` can show by itself: nothing of the search."""
        start = time.monotonic()
        reports = tuple(verify_existence(self.task, solution.existence) for solution in self.solutions)
        refused = [(i, r.reasons[0]) for i, r in enumerate(reports) if not r.ok]
        refused += [(i, fault) for i, s in enumerate(self.solutions) if (fault := s.fault(self.task))]
        reason = f"configuration {refused[0][0]}: {refused[0][1]}" if refused else ""
        replayed = tuple(f"configuration {i}: an exact one exists in its box" for i, r in enumerate(reports) if r.ok)
        missing: tuple[str, ...] = ()
        if self.verdict is Reach.FOUND and not reports:
            reason = "FOUND without a configuration"
        elif self.verdict is not Reach.FOUND and reports:
            reason = f"{self.verdict.upper()} with a configuration"
        elif self.verdict is Reach.NONE:
            shown, said = self._impossible()
            replayed, missing, reason = ((said,), (), "") if shown else ((), (said,), said)
        if self.searched and self.verdict is Reach.UNDECIDED:
            share = f"{100 * self.searched.discarded:.4g} % of the space"
            missing = (f"{share} holds no configuration: the boxes that were discarded are not kept",)
        return ReplayedSynthesis(reports, time.monotonic() - start, reason, replayed, (*missing, COURSE))

    def _impossible(self) -> tuple[bool, str]:
        """Whether the checker shows a NONE by itself, and what it shows or why it does not, in a line."""
        ask = "NONE rests on the search itself, ask it again"
        named = self.searched.contacts(len(self.task.contact_pairs)) if self.searched else None
        if not self.searched or named is None:
            return False, f"{ask}: a search pose by pose cannot be replayed"
        by, (contacts, origin) = self.searched.by, named
        try:
            done = impossible(self.task, contacts, origin=origin)
        except ProofRefused as fault:
            return False, f"{ask}: {fault}"
        if done.shown:
            return True, f"{by} exclude each other, by {_boxes(done.boxes)} of the checker's own"
        share = f"{100 * done.discarded:.3g} % of the space in {_boxes(done.boxes)}"
        return False, f"{ask}: of {by} the checker by itself could discard {share}"

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


def _boxes(boxes: int) -> str:
    return "1 box" if boxes == 1 else f"{boxes} boxes"


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
