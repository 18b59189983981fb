"""What is known of all magnitudes up to the largest, from ranges that are shown to be resisted or to slip.

What is resisted are arcs: states over a whole range of magnitudes, all of which hold to `tolerance.EPS` of load and
commands. An arc is a Bezier curve in the unknowns of `State` while the load goes along a straight line, see `near`.
That an exact state exists at each of its magnitudes is not claimed. With two controls an arc is all convex
combinations of two states.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from handfast.proofs.fields import Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.near import along, least_norm, near
from handfast.proofs.question import LARGEST_GOAL, SMALLEST_PRELOAD, Question, Range
from handfast.proofs.states import Problem, State, read_state
from handfast.proofs.tolerance import EPS, MIN_FORCE_SCALE, TOO_SMALL, load_scale

MAX_ARC_DEGREE = 12  # at most


@dataclass(frozen=True, eq=False)
class Arc:
    """A state for every magnitude from `first` to `last`.

    Attributes:
        first, last: magnitudes, first < last.
        controls: at first + (last - first) t the state is sum of comb(k, i) t^i (1 - t)^(k - i) controls[i].

    Raises:
        BadFile: no range, too few or too many controls.
    """

    first: float
    last: float
    controls: tuple[State, ...]

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.last < np.inf:
            raise BadFile(f"goes from {self.first:g} to {self.last:g}; a range of magnitudes is needed", "arc")
        if not 2 <= len(self.controls) <= MAX_ARC_DEGREE + 1:
            raise BadFile(f"has {len(self.controls)} controls; 2 to {MAX_ARC_DEGREE + 1} are possible", "arc")

    def table(self, name: str) -> Array:
        """(k+1, n) one of the unknowns, control by control."""
        return np.array([getattr(control, name) for control in self.controls])


def read_arc(f: Fields, q: Question) -> Arc:
    """The arc in an object of a file. Raises `BadFile`."""
    first, last = f.number("first", least=0.0), f.number("last")
    states = []
    for control in f.objects("controls"):
        states.append(read_state(control, q.grasp))
        control.done()
    f.done()
    try:
        return Arc(first, last, tuple(states))
    except BadFile as fault:
        raise BadFile(fault.problem, f.place) from None


def replayed(q: Question, arc: Arc) -> tuple[str, float]:
    """Why an arc does not show what it claims, "" if it does; and what its states miss, relative to load and commands.

    The load is w0 + s d, the commands are the grasp's. An arc that begins at rest without any load has multiples of
    its last state, which miss as much.
    """
    p = Problem.of(q, q.grasp.command, q.wrench, q.direction, arc.last)
    x, s = {f.name: arc.table(f.name) for f in fields(State)}, np.linspace(arc.first, arc.last, len(arc.controls))
    given = [q.wrench + arc.first * q.direction, q.grasp.command, q.grasp.torque, q.grasp.friction]
    if len(s) == 2 and not any(part.any() for part in (*given, *(table[0] for table in x.values()))):
        if not p.scale >= MIN_FORCE_SCALE:
            return TOO_SMALL, np.inf
        found = near(p, arc.controls[-1])
    else:
        F = least_scale(q.grasp, q.wrench + s[:, None] * q.direction)
        if not F >= MIN_FORCE_SCALE:
            return f"there may be no load from {arc.first:.6g} to {arc.last:.6g}", np.inf
        found = along(p, s, x, F)
    if found.shown and q.goal in (LARGEST_GOAL, SMALLEST_PRELOAD):
        return "", found.missed
    reason = f"{found.where} is missed by {found.missed:.1e} of load and commands, above {EPS:g}"
    return f"states from {arc.first:.6g} to {arc.last:.6g}: {reason}", found.missed


def least_scale(g: GraspData, w: Array) -> float:
    """[N] of commands and any load between the controls w (k+1, 6), the least; 0 where one may be none."""
    torque = w[:, 3:] - np.cross(g.centroid, w[:, :3])
    drives = load_scale(g, np.zeros(6)) if g.command.any() or g.torque.any() else 0.0
    return float(max(drives, least_norm(w[:, None, :3])[0], least_norm(torque[:, None])[0] / g.size))


# --- together ---------------------------------------------------------------------------------------


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
        fine = width_at(end, resolution, min(unit, largest))
        if end > at and (end - at > fine or held == before):
            if unproved and at - unproved[-1][1] < fine and all(not unproved[-1][1] <= a < at for a, _ in holes):
                unproved[-1] = unproved[-1][0], end
            else:
                unproved.append((at, end))
        at, before = max(at, last), held
    to = next((last for first, last in good if first <= 0), 0.0)
    return Known(min(to, largest), holes[0][0] if holes else upper, holes, tuple(unproved))


def width_at(magnitude: float, resolution: float, unit: float) -> float:
    """How wide a gap between a hole and what is resisted may be, at a magnitude; unit: which counts as none."""
    return resolution * max(magnitude, unit)


def merged(ranges: Iterable[Range]) -> tuple[Range, ...]:
    """The same magnitudes as few ranges, in order."""
    out: list[Range] = []
    for first, last in sorted(ranges):
        if out and first <= out[-1][1]:
            out[-1] = out[-1][0], max(out[-1][1], last)
        else:
            out.append((first, last))
    return tuple(out)
