"""Pieces of the kernel of synthesis that tests ask one by one: compiled once for all of them, as kernels are."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

from handfast.core.groups import RealMatrix, Reals, Wholes
from handfast.core.machine_code import EntryPoint, Library
from handfast.synthesis.search import library
from handfast.synthesis.search import workspace as w
from tests.support.pieces import asked


class Balls(NamedTuple):
    """Middles and radii."""

    ball: RealMatrix  # (n, 2)


class Dependents(NamedTuple):
    """Out: what `certify` proves."""

    chosen: Wholes  # (e,) coordinates
    radii: Reals  # (e,) of their box


class Operations(NamedTuple):
    """Balls of numbers."""

    of: RealMatrix  # (2, 2) in: a and b
    result: RealMatrix  # (8, 2) out: a + b, a - b, a b, a / b, root, sine and cosine of a, 3.7 a


class Row(NamedTuple):
    """A row by which a box is narrowed, and the coordinates that it has."""

    gradient: Reals  # (n,)
    use: Wholes  # (u,)


class Together(NamedTuple):
    """The rows of a contact that are added up."""

    use: Wholes  # (u,) coordinates
    errors: Reals  # (3,) of points, of other points, of directions


class Turned(NamedTuple):
    """Out: what `turning` says of the quaternions in a box."""

    rotation: RealMatrix  # (3, 3)
    turn: RealMatrix  # (4, 3)
    bounds: Reals  # (2,) the largest angle, and what the polynomial leaves out


HERE = Path(__file__).parent
PIECES = f"{__package__}.synthesis_pieces_compiled"
TAYLOR, POSES = (*library.TAYLOR, w.LineWork, w.AngleTerms), (*library.TAYLOR, w.TurnWork, w.InnerWork)
LIBRARY = Library(
    name="synthesis-pieces",
    module=__name__,
    entries={
        name: EntryPoint(PIECES, takes)
        for name, takes in {
            "evaluated": (Balls, *library.TASK, w.SystemValues, w.ContactBalls),
            "taken": (int, *library.TASK, w.SetQuestion, *TAYLOR),
            "certified": (Balls, *library.TASK, w.Interior, *library.LOCAL, Dependents),
            "operated": (Operations,),
            "narrowed": (float, float, float, Row, w.CenteredBox),
            "together": (int, Together, *library.TASK, *POSES),
            "turned": (w.CenteredBox, Turned),
            "unit_line": (float, float, w.CenteredBox, Row, w.LineWork),
            "multiplied": (w.Polynomials, w.CenteredBox, Row, w.AngleTerms),
        }.items()
    },
    sources=(
        HERE / "pieces.py",
        HERE / "synthesis_pieces.py",
        HERE / "synthesis_pieces_compiled.py",
        *library.LIBRARY.sources,
    ),
)

ask = partial(asked, LIBRARY)
