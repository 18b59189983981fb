"""A table or figure of a paper: its name, how finely it is made, and a table as text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from handfast.core.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from handfast.papers.mixed_integer import Solver


@dataclass(frozen=True)
class MakingOptions:
    """How finely an exhibit is made.

    Attributes:
        steps: directions of a map, commands of a sweep; None for the exhibit's own number.
        count: of random directions and wrenches (Table II), of levels (Table I); None for what takes about a minute.
        timeout: [s] for each question.
        solver: of mixed-integer programs, where Algorithm 1 is asked; None for whichever is installed, SCIP first.
    """

    steps: int | None = None
    count: int | None = None
    timeout: float = 20.0
    solver: Solver | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "count"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"is {value}; 1 or more is needed", field=name)
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a positive number is needed", field="timeout")


@dataclass(frozen=True)
class TextTable:
    """A table as text: heads and cells, and what is to be said below it."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        """The table as Markdown."""
        lines = [self.heads, ("---",) * len(self.heads), *self.rows]
        text = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        return "\n\n".join([text, *self.notes]) + "\n"


Maker = Callable[[MakingOptions], "Figure | TextTable"]


@dataclass(frozen=True)
class Exhibit:
    """A table or a figure of a paper.

    Attributes:
        name: what `handfast paper` calls it.
        paper: title, authors and year.
        title: what the paper shows there.
        seconds: about how long it takes.
        make: makes it; None for a sketch that holds no data.
        instead: of a sketch: where what it explains is.
    """

    name: str
    paper: str
    title: str
    seconds: int = 1
    make: Maker | None = None
    instead: str = ""
