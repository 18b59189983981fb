"""What a synthesis answers: configurations with their proofs, or that there is none, or neither."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Reach, Stop, header
from handfast.core.errors import InputError
from handfast.core.files import write_text
from handfast.core.presented import Presented
from handfast.core.schema import InFiles, written
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Replay
from handfast.proofs.synthesis import replay
from handfast.synthesis.distance import features
from handfast.synthesis.embedded_task import sealed, task_to_dict
from handfast.synthesis.solution import Solution
from handfast.synthesis.task import Task


@dataclass(frozen=True)
class Searched(InFiles):
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

    def __post_init__(self) -> None:
        for name in ("nodes", "depth", "pending"):
            if getattr(self, name) < 0:
                raise InputError(f"is {getattr(self, name)}; 0 or more is needed", field=name)


def replayed(data: Any) -> Replay:
    """The replay of a parsed `handfast/synthesis/1` file; `InputError` if it is none."""
    try:
        return replay(data)
    except BadFile as fault:
        raise InputError(fault.problem, field=fault.field or None) from None


@dataclass(frozen=True, eq=False)
class Synthesis(Presented):
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

    def verify(self) -> Replay:
        """What a file of it would claim, replayed: each configuration, and of a NONE as much as can be shown anew."""
        return replayed(self._unsealed())

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return header(self, "synthesize") | {
            "starts": self.starts,
            "unproved": self.unproved,
            "seed": self.seed,
            "spread": self.spread,
            "configurations": [solution.to_json() for solution in self.solutions],
            "searched": written(self.searched),
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/synthesis/1` file, for `handfast.verify` and for going on.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        write_text(path, json.dumps(self.to_file(), allow_nan=False) + "\n", force=force)

    def to_file(self) -> dict[str, Any]:
        """The `handfast/synthesis/1` object; numbers come back exactly."""
        return sealed(self._unsealed())

    def _unsealed(self) -> dict[str, Any]:
        task, state = task_to_dict(self.task), dict(self.state) or None
        return {"schema": "handfast/synthesis/1", "task": task, "answer": self.to_json(), "state": state}
