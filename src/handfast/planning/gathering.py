"""Units of work one after the other: what became of their candidates, and those that passed and differ."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from handfast.planning.rejection import RejectionReason, Tally

Found = TypeVar("Found")


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
