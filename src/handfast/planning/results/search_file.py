"""The `handfast/search/1` file: how far a search for the grasps of a task has come, so that it can go on.

It holds what was found, with the proofs that the configurations exist and the preloads; `handfast verify` wants the
`handfast/grasps/1` file that is written beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate, write_text
from handfast.planning.search import RejectionReason, Tally
from handfast.proofs.configurations import Existence
from handfast.synthesis.synthesis_file import solution_of
from handfast.synthesis.task import Task

COUNTED_REASONS = (  # that the file counts
    RejectionReason.OBJECT,
    RejectionReason.ITSELF,
    RejectionReason.CURVED,
    RejectionReason.UNBALANCED,
    RejectionReason.SLIPS,
    RejectionReason.UNDECIDED,
    RejectionReason.ALIKE,
)
Count = Annotated[int, Field(ge=0)]
Bound = Annotated[float, Field(ge=0)]
Factor = Annotated[float, Field(ge=1)]


class FoundEntry(Strict):
    """A grasp as it is remembered: where it is, whether it was improved, the preload and the bounds of its command.

    `factor`: so many times the loads it was found to hold; None where that was not asked.
    """

    existence: dict[str, Any]
    repaired: bool
    preload: dict[str, float]
    lower: Bound
    upper: Bound
    nodes: Count
    factor: Factor | None = None

    def proof(self, task: Task, field: str) -> Existence:
        """That its configuration exists, not replayed; `InputError` if it cannot be one of the task."""
        return solution_of(task, self.existence, f"{field}.existence").existence


class SavedSearch(Strict):
    """How far a search has come: the file as it stands on disk.

    Attributes:
        question: the fingerprint of what was asked, but for how many and how long.
        units: of work that were done, from the first. fates, judged, starts, unproved: what became of them.
        found: those that differ from each other, in the order in which they were found.
        seconds: spent.
        balance: boxes of the search for a proof that no forces balance the loads, while it is going on.
        bound: boxes of the search for what no placement can hold, with the factor.
        joined: boxes of the search for a proof with several reasons, of each set of contacts that is not done.
    """

    format: Literal["handfast/search/1"] = Field(alias="schema")
    question: str
    units: Count
    fates: dict[str, Count]
    judged: Count
    starts: Count
    unproved: Count
    seconds: float
    found: list[FoundEntry]
    balance: dict[str, Any] | None = None
    bound: dict[str, Any] | None = None
    joined: list[dict[str, Any]] | None = None

    @property
    def tally(self) -> Tally:
        """What became of the certified starts."""
        return Tally.from_json(self.fates, "holds", COUNTED_REASONS)


def save_search(search: SavedSearch, path: str | Path) -> None:
    """Write the file, over an older one; numbers come back exactly."""
    write_text(path, search.model_dump_json(by_alias=True) + "\n", force=True)


def load_search(path: str | Path, task: Task) -> SavedSearch:
    """What a file says of a search for grasps of a task; its proofs are not replayed.

    Raises:
        InputError: one line with file, field and fault; a proof that cannot be one of the task.
    """
    try:
        search = validate(SavedSearch, read_json(path, "handfast/search/1"))
        for i, found in enumerate(search.found):
            found.proof(task, f"found[{i}]")
    except InputError as fault:
        raise fault.at(str(path)) from None
    return search
