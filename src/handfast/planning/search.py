"""Searches of numbered units of work: what became of their candidates, what is kept, and who is told."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from handfast.planning.rejection import RejectionReason, Tally

Found = TypeVar("Found")
State = TypeVar("State")


@dataclass(frozen=True, eq=False)
class UnitResult(Generic[Found]):
    """What a unit of work came to. Units are numbered; what one comes to depends on its number and the seed alone.

    Attributes:
        tally: what became of its candidates.
        found: those that passed.
    """

    tally: Tally
    found: tuple[Found, ...]


class Gathering(Generic[Found]):
    """What units found, as long as it differs from what was found before.

    Args:
        most: how many are kept.
        alike: whether two of them are.
        tally, kept: of a search that is gone on with.
    """

    def __init__(
        self,
        most: int,
        alike: Callable[[Found, Found], bool],
        tally: Tally | None = None,
        kept: Iterable[Found] = (),
    ) -> None:
        self.most, self.alike = most, alike
        self.tally, self.kept = tally.copy() if tally else Tally(), list(kept)
        self.beyond = False  # were some that differ not kept, as there were enough?

    @property
    def enough(self) -> bool:
        return len(self.kept) >= self.most

    def take(self, unit: UnitResult[Found]) -> bool:
        """Count a unit's candidates and keep what differs; was anything kept?"""
        before = len(self.kept)
        self.tally.add_all(unit.tally)
        for one in unit.found:
            if any(self.alike(one, other) for other in self.kept):
                self.tally.recount(RejectionReason.ALIKE)
            elif self.enough:
                self.beyond = True
            else:
                self.kept.append(one)
        return len(self.kept) > before


class Journal(Generic[State]):
    """Hears how far a search has come. This one keeps nothing; `handfast.planning.results.folder` has one that does.

    Args:
        on_progress: called after each unit of work with the answer so far.

    Attributes:
        source: the file that says how far an earlier search has come.
    """

    source = ""

    def __init__(self, on_progress: Callable[[State], None] | None = None) -> None:
        self.on_progress = on_progress

    def earlier(self, question: Any) -> Any:
        """What to go on from; None to begin.

        Raises:
            InputError: what was kept is broken, or of another question.
        """
        return None

    def note(self, state: State, *, new: bool) -> None:
        """The search goes on; `new`: something was found."""
        if self.on_progress:
            self.on_progress(state)

    def close(self, state: State) -> None:
        """The search has ended."""
