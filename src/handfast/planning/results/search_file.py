"""The `handfast/search/1` file: how far a search for the grasps of a task has come, so that it can go on.

It holds what was found, with the proofs that the configurations exist and the preloads; `handfast verify` wants the
`handfast/grasps/1` file that is written beside it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate, write_text
from handfast.planning.rejection import RejectionReason, Tally
from handfast.proofs.configurations import Existence
from handfast.synthesis.synthesis_file import solution_of
from handfast.synthesis.task import Task

REASONS = (  # that the file counts
    RejectionReason.OBJECT,
    RejectionReason.ITSELF,
    RejectionReason.CURVED,
    RejectionReason.UNBALANCED,
    RejectionReason.SLIPS,
    RejectionReason.UNDECIDED,
    RejectionReason.ALIKE,
)
Count = Annotated[int, Field(ge=0)]


@dataclass(frozen=True, eq=False)
class FoundGrasp:
    """A grasp as it is remembered: where it is, whether it was improved, the preload and the bounds of its command."""

    existence: Existence
    repaired: bool
    preload: dict[str, float]
    lower: float
    upper: float
    nodes: int = 0


@dataclass(frozen=True, eq=False)
class SavedSearch:
    """How far a search has come.

    Attributes:
        question: the fingerprint of what was asked, but for how many and how long.
        units: of work that were done, from the first. tally, evaluated, starts, unproved: what became of them.
        found: those that differ from each other, in the order in which they were found.
        seconds: spent.
        source: the file that it was read from.
    """

    question: str
    units: int = 0
    tally: Tally = field(default_factory=Tally)
    evaluated: int = 0
    starts: int = 0
    unproved: int = 0
    found: tuple[FoundGrasp, ...] = ()
    seconds: float = 0.0
    source: str = ""


class FoundEntry(Strict):
    existence: dict[str, Any]
    repaired: bool
    preload: dict[str, float]
    lower: Annotated[float, Field(ge=0)]
    upper: Annotated[float, Field(ge=0)]
    nodes: Count


class SearchFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/search/1"] = Field(alias="schema")
    question: str
    units: Count
    fates: dict[str, Count]
    judged: Count
    starts: Count
    unproved: Count
    seconds: float
    found: list[FoundEntry]


def save_search(search: SavedSearch, path: str | Path) -> None:
    """Write the file, over an older one; numbers come back exactly."""
    data = {
        "schema": "handfast/search/1",
        "question": search.question,
        "units": search.units,
        "fates": search.tally.to_json("holds", REASONS),
        "judged": search.evaluated,
        "starts": search.starts,
        "unproved": search.unproved,
        "seconds": search.seconds,
        "found": [
            {
                "existence": f.existence.to_json(),
                "repaired": f.repaired,
                "preload": f.preload,
                "lower": f.lower,
                "upper": f.upper,
                "nodes": f.nodes,
            }
            for f in search.found
        ],
    }
    write_text(path, json.dumps(data, allow_nan=False) + "\n", force=True)


def load_search(path: str | Path, task: Task) -> SavedSearch:
    """What a file says of a search for grasps of a task; its proofs are not replayed.

    Raises:
        InputError: one line with file, field and fault; a proof that cannot be one of the task.
    """
    try:
        entry = validate(SearchFile, read_json(path, "handfast/search/1"))
        tally = Tally.from_json(entry.fates, "holds", REASONS)
        found = []
        for i, f in enumerate(entry.found):
            proof = solution_of(task, f.existence, f"found[{i}].existence").existence
            found.append(FoundGrasp(proof, f.repaired, f.preload, f.lower, f.upper, f.nodes))
    except InputError as fault:
        raise fault.at(str(path)) from None
    numbers = entry.units, tally, entry.judged, entry.starts, entry.unproved, tuple(found), entry.seconds, str(path)
    return SavedSearch(entry.question, *numbers)
