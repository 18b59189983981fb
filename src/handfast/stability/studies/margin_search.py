"""How much a HOLDS leans on: on motion at a real contact stiffness, on its friction, on its normals.

The model's springs have unit stiffness; a real pad gives way by the virtual motion over its stiffness. And a verdict
belongs to one friction and to one set of normals, which nobody knows exactly: others near by are asked, too, each by
`check`, so that every flip that is reported has the proof of its SLIPS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError, kinds_checked
from handfast.core.transforms import cross
from handfast.model.grasp import Contact, Grasp
from handfast.stability.answers import CheckAnswer
from handfast.stability.answers.check_query import ask as check
from handfast.stability.answers.margin import FRAGILE_FRICTION, FRAGILE_TILT, Flip, Margin, rubbed, tilted
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.scaled_problem import as_wrench
from handfast.stability.problem.settings import Settings

# [N/m] of a rubber fingertip pad. A sphere of radius R pressed with F against a flat gives way by
# (3 F / (4 E* sqrt R))^(2/3) (Hertz; K. L. Johnson, Contact Mechanics, 1985, section 4.2). With R = 10 mm, F = 3 N and
# rubber of E = 3 MPa, nu = 0.5, E* = E / (1 - nu^2) = 4 MPa, that is 0.32 mm: 9.5 N/mm.
RUBBER_PAD = 1e4

FRICTION_CHANGES = 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0  # shares by which all friction is lessened and raised
FRICTION_RESOLUTION = 1e-3
TILTS = 0.5, 1.0, 2.0, 4.0, 8.0, 15.0  # [degrees] by which normals are tilted
TILT_RESOLUTION = 0.05  # [degrees]

CHECK_TIME_LIMIT = 2.0  # [s] of each check of a changed grasp, unless the settings have a limit of their own

MIN_TILT_SHARE = 0.1  # a vector with a smaller share across a normal gives no direction for tilting it

OnSample = Callable[[str], None]


@kinds_checked
def margin(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    stiffness: float = RUBBER_PAD,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: Settings | None = None,
    answer: CheckAnswer | None = None,
    on_progress: OnSample | None = None,
) -> Margin | None:
    """How much does a HOLDS lean on? None unless `check` answers HOLDS.

    Searched are, each change decided by a `check` of its own:

    - all friction coefficients times 1 - x and 1 + x, for the x in `FRICTION_CHANGES`;
    - normals tilted by the angles in `TILTS`: each contact's alone towards four sides, and all contacts' at once
      towards the first, second, third or fourth side of each, and outwards and inwards. The first side is where the
      load pulls, see `sides`.

    The first change that slips is brought nearer to the last that held, to a resolution of `FRICTION_RESOLUTION` and
    `TILT_RESOLUTION`. Nothing is said of changes that were not tried: holding is not monotone, neither in friction nor
    in tilts, and other patterns of tilts may slip sooner.

    Args:
        stiffness: [N/m] of every contact; by default a rubber fingertip pad's.
        settings: of every check, limits included; without a time limit each changed grasp has `CHECK_TIME_LIMIT`.
        answer: that of `check` to the same question, if it is known already.
        on_progress: told in words what is asked next.

    The other arguments and errors are those of `check`.

    Raises:
        InputError: a stiffness that is not positive and finite.
    """
    if not (np.isfinite(stiffness) and stiffness > 0):
        raise InputError(f"is {stiffness:g}; a positive number is needed", field="stiffness")
    options = {"limits": limits, "mdp": mdp, "settings": settings}
    return _searched(grasp, wrench, stiffness, options, answer, on_progress)


def why_fragile(grasp: Grasp, wrench: Array, limits: GraspLimits, settings: Settings) -> tuple[str, ...] | None:
    """`Margin.why` alone, without the changes that it does not take; None unless `check` answers HOLDS."""
    options, until = {"limits": limits, "settings": settings}, (FRAGILE_FRICTION, FRAGILE_TILT)
    found = _searched(grasp, wrench, RUBBER_PAD, options, until=until)
    return found.why if found else None


def _searched(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    stiffness: float,
    options: dict[str, Any],
    answer: CheckAnswer | None = None,
    on_progress: OnSample | None = None,
    until: tuple[float | None, float | None] = (None, None),
) -> Margin | None:
    """options: of every check; until: of friction and of tilts, see `_Ask.flip`. Otherwise as `margin`."""
    answer = answer or check(grasp, wrench, **options)
    if answer.verdict is not Verdict.HOLDS or answer.witness is None:
        return None
    w = as_wrench(wrench)
    own = options["settings"] or Settings()
    limited = own if np.isfinite(own.timeout) else replace(own, timeout=CHECK_TIME_LIMIT)
    ask = _Ask(w, options | {"settings": limited}, on_progress)
    friction, tilts = until
    less = ask.flip(
        "friction", FRICTION_CHANGES, FRICTION_RESOLUTION, lambda x: [_Change(rubbed(grasp, 1 - x))], friction
    )
    more = ask.flip(
        "friction", FRICTION_CHANGES, FRICTION_RESOLUTION, lambda x: [_Change(rubbed(grasp, 1 + x))], friction
    )
    patterns = list(_patterns(sides(grasp, w)))
    tilt = ask.flip(
        "tilt", TILTS, TILT_RESOLUTION, lambda x: [_tilted(grasp, p, np.radians(x)) for p in patterns], tilts
    )
    return Margin(float(stiffness), answer, less, more, tilt, ask.count, ask.stop, options["limits"])


def sides(grasp: Grasp, wrench: Array) -> Array:
    """(m, 5, 3) unit vectors across each contact's normal: four sides, and outwards (zero where there is no outwards).

    The first side is where the load pulls at the contact: its force, or else its torque about the middle of the
    contacts; where neither does, it is outwards from that middle, or along the axis of a joint behind the contact.
    Then come the opposite side and the two at right angles. None of it depends on the axes of the object's frame,
    unless there is nothing else to tell sides by.
    """
    middle = grasp.middle
    out = np.zeros((grasp.m, 5, 3))
    for i, c in enumerate(grasp.contacts):
        arm = c.position - middle
        turn = cross(wrench[3:] - cross(middle, wrench[:3]), arm)
        axes = [j.axis for j in grasp.joints if i in j.moves]
        told = [t for v in (wrench[:3], turn, arm, *axes) if (t := _across(c, v)) is not None]
        first = told[0] if told else c.frame[:, 1]
        second = cross(c.normal, first)
        outwards = _across(c, arm)
        out[i] = first, -first, second, -second, np.zeros(3) if outwards is None else outwards
    return out


def _across(c: Contact, v: Array) -> Array | None:
    """(3,) the unit vector across the normal that a vector points to; None if it is zero or along the normal."""
    t = v - (v @ c.normal) * c.normal
    length = float(np.linalg.norm(t))
    return t / length if length > MIN_TILT_SHARE * float(np.linalg.norm(v)) else None


# --- changed grasps -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Change:
    """A changed grasp; of tilts, which contacts and where to (k, 3)."""

    grasp: Grasp
    contacts: tuple[int, ...] = ()
    towards: Array | None = None


def _patterns(side: Array) -> Iterator[Array]:
    """(m, 3) where to each normal tilts, zero where it does not: all contacts first, then one at a time."""
    m = len(side)
    together = [side[:, k] for k in range(4)] + [side[:, 4], -side[:, 4]]
    if m > 1:
        yield from (t for t in together if t.any())
    for i in range(m):
        for k in range(4):
            alone = np.zeros((m, 3))
            alone[i] = side[i, k]
            yield alone


def _tilted(grasp: Grasp, towards: Array, angle: float) -> _Change:
    """With normals tilted by an angle [rad]."""
    moved = tuple(int(i) for i in np.flatnonzero(towards.any(axis=1)))
    sides = towards[list(moved)]
    return _Change(tilted(grasp, moved, sides, angle), moved, sides)


class _Ask:
    """Asks `check` about changed grasps, and counts."""

    def __init__(self, wrench: Array, options: dict[str, Any], on_progress: OnSample | None) -> None:
        self.wrench, self.options, self.on_progress = wrench, options, on_progress
        self.count, self.stop = 0, Stop.COMPLETE

    def flip(
        self,
        what: str,
        changes: Sequence[float],
        resolution: float,
        made: Callable[[float], Sequence[_Change]],
        until: float | None = None,
    ) -> Flip:
        """Where the first of the changed grasps slips: `made` makes those of one size, always in the same order.

        until: only whether one slips by this size is asked.
        """
        holds, undecided, certain = 0.0, 0, True
        first = 0  # what slipped last is asked first: it is likely to slip again
        slips, found, change = None, None, None
        ahead = list(changes)
        skip: set[int] = set()  # a pattern that was undecided once is not asked again: it may take as long each time
        while ahead and self.stop is Stop.COMPLETE:
            size = ahead.pop(0)
            if self.on_progress:
                self.on_progress(f"{what} changed by {size:.3g}")
            asked = made(size)
            verdict, which, answer = self._any_slips(asked, first, skip)
            if verdict is Verdict.SLIPS:
                slips, found, first, change, ahead = size, answer, which, asked[which], []
            elif verdict is Verdict.UNDECIDED:
                undecided, certain = undecided + 1, False
            elif certain:
                holds = size
            if slips is not None and certain and slips - holds > resolution:
                ahead = [0.5 * (holds + slips)]
            if until is not None and (size <= until if verdict is Verdict.SLIPS else size >= until):
                break
        where = (change.contacts, change.towards) if change else ()
        return Flip(holds, slips, changes[-1], undecided, found, *where)

    def _any_slips(
        self, asked: Sequence[_Change], first: int, skip: set[int]
    ) -> tuple[Verdict, int, CheckAnswer | None]:
        """SLIPS with the number and the answer of the first that slips; HOLDS if all hold."""
        out = Verdict.UNDECIDED if skip else Verdict.HOLDS
        for k in sorted(set(range(len(asked))) - skip, key=lambda k: k != first):
            self.count += 1
            answer = check(asked[k].grasp, self.wrench, **self.options)
            if answer.stop is Stop.INTERRUPTED:
                self.stop = Stop.INTERRUPTED
                return Verdict.UNDECIDED, k, None
            if answer.verdict is Verdict.SLIPS:
                return Verdict.SLIPS, k, answer
            if answer.verdict is Verdict.UNDECIDED:
                out = Verdict.UNDECIDED
                if len(asked) > 1:
                    skip.add(k)
        return out, first, None
