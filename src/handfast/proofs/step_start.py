"""The state that a step of a load's path starts from, as far as the step knows it.

A hand squeezes, then the load comes and grows; see docs/load-path.md. In each step friction and commanded gearing know
what moves in that step alone. Springs of contacts, stops, and tendons that nobody commands know the whole motion, of
which these numbers are the part from before. They are taken as they are: what a step proves is about exactly them. The
step after has those of the witness, but for `ALIKE` of the load (`states.came_from`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handfast.proofs.fields import Array, BadFile, Fields

ALIKE = 1e-9  # relative to the scale of the load: a witness is a state to as much; motions below are none


@dataclass(frozen=True, eq=False)
class StartData:
    """How far a state has come.

    Attributes:
        gaps: (m,) [N] d_n of the contacts at unit stiffness; negative where a spring is pressed.
        stops: (l,) >= 0, of joints away from their stop. slack: (a,) >= 0, t of tendons that nobody commands.
    """

    gaps: Array
    stops: Array
    slack: Array


def read_start(data: Any, place: str, sizes: tuple[int, int, int]) -> StartData:
    """From a parsed file; sizes: m, l, a. Raises `BadFile`."""
    f = Fields(data, place)
    names = ("gaps", "stops", "slack")
    out = StartData(*(f.numbers(name, (n,)) for name, n in zip(names, sizes, strict=True)))
    f.done()
    for name in ("stops", "slack"):
        if (getattr(out, name) < 0).any():
            raise BadFile("has a negative number; 0 or more is needed", f.at(name))
    return out
