"""What is known of all magnitudes up to the largest, from ranges that are shown to be resisted or to slip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from handfast.proofs.question import Range


@dataclass(frozen=True)
class Known:
    """Of the magnitudes from 0 to the largest that is resisted.

    Attributes:
        to: every magnitude from 0 to here is resisted; 0 if that is not shown of any.
        upper: a magnitude that slips: where the first hole begins, or above the largest; inf if neither is known.
        holes: (first, last): every magnitude from the first to the last slips; more is resisted.
        unproved: ranges of which not all is shown. Not among them are those between a hole and what is resisted
            beside it that are as narrow as the resolution. Such as lie nearer to each other than that are one.
    """

    to: float
    upper: float
    holes: tuple[Range, ...]
    unproved: tuple[Range, ...]


def known(
    resisted: Iterable[Range], slips: Iterable[Range], largest: float, upper: float, resolution: float, unit: float
) -> Known:
    """What the ranges say together.

    Args:
        resisted, slips: ranges of magnitudes of which that was shown.
        largest: the largest magnitude that is resisted; upper: none above it is.
        resolution, unit: a hole's end may lie in a gap as wide as the resolution times its magnitude, or the unit.

    Raises:
        ValueError: something is shown to be resisted and to slip.
    """
    good, bad = merged(resisted), merged(slips)
    parts = sorted([(*r, True) for r in good] + [(*r, False) for r in bad])
    for (_, end, _), (begin, _, _) in pairwise(parts):
        if begin < end:
            raise ValueError(f"{begin:.9g} is shown to be resisted, and to slip")
    holes = tuple((a, b) for a, b in bad if a < largest)
    if any(b > largest for _, b in holes):
        raise ValueError(f"{largest:.9g} is shown to be resisted, and to slip")
    unproved: list[Range] = []
    at, before = 0.0, True
    for first, last, held in [*parts, (largest, largest, True)]:
        end = min(first, largest)
        fine = resolution * max(end, min(unit, largest))
        if end > at and (end - at > fine or held == before):
            if unproved and at - unproved[-1][1] < fine and all(not unproved[-1][1] <= a < at for a, _ in holes):
                unproved[-1] = unproved[-1][0], end
            else:
                unproved.append((at, end))
        at, before = max(at, last), held
    to = next((last for first, last in good if first <= 0), 0.0)
    return Known(min(to, largest), holes[0][0] if holes else upper, holes, tuple(unproved))


def merged(ranges: Iterable[Range]) -> tuple[Range, ...]:
    """The same magnitudes as few ranges, in order."""
    out: list[Range] = []
    for first, last in sorted(ranges):
        if out and first <= out[-1][1]:
            out[-1] = out[-1][0], max(out[-1][1], last)
        else:
            out.append((first, last))
    return tuple(out)
