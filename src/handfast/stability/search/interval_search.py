"""Which magnitudes below the largest are resisted? They need not be an interval (section VII-B).

Whatever is said is said of ranges. Of a range that is resisted: an `Arc`, a state for each of its magnitudes, solved by
Newton's method at some of them and judged between them. Of a hole: a certificate that none of its magnitudes is
resisted. A range that neither shows is halved, down to the resolution, and what is left is reported as unproved.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.answer import Stop
from handfast.core.arrays import Array
from handfast.proofs import near, ranges
from handfast.proofs.certificate import Certificate
from handfast.proofs.ranges import Arc, Known, known
from handfast.proofs.states import State
from handfast.proofs.tolerance import no_magnitude
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.model import scaled
from handfast.stability.problem.objective import ANY_STATE, INF, LARGEST_MAGNITUDE, Objective, Range
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import VALID, Witness
from handfast.stability.search import engine
from handfast.stability.search.proof import Outcome
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.search.search import SearchWorker, exact_solution


@dataclass(frozen=True)
class ResistedInterval:
    """Which magnitudes are resisted, with the proofs.

    Attributes:
        holds_from_zero_to: every magnitude up to it is resisted, see `ranges.Known`.
        upper: a magnitude that slips; between the two it is not known.
        holes: (first, last) magnitudes between which all slip, though more is resisted.
        unproved: ranges of which nothing was shown.
        resolution: relative: the ends of holes lie no farther than this outside them, as a share of the magnitude
            or, if that is more, of the other forces in play.
        arcs: states of the magnitudes that are resisted; none where magnitudes make no difference.
        slips: certificates of the holes.
        interrupted: Ctrl-C came before all was looked at.
    """

    holds_from_zero_to: float
    upper: float
    holes: tuple[Range, ...]
    unproved: tuple[Range, ...]
    resolution: float
    arcs: tuple[Arc, ...]
    slips: tuple[Certificate, ...]
    interrupted: bool = False

    def to_json(self) -> dict[str, Any]:
        """Its keys in the answer of `max`, beside `holds_from_zero_to`."""
        return {
            "holds_from_zero_upper": self.upper if np.isfinite(self.upper) else None,
            "holes": [list(r) for r in self.holes],
            "unproved": [list(r) for r in self.unproved],
            "resolution": self.resolution,
        }


ARC_DEGREE = 6  # of arcs, where a straight line does not do
MIN_RANGE_SHARE = 1e-8  # of the resolution: narrower ranges are not halved
SWITCH = 1e-14  # relative: contacts and actuators change their modes between two magnitudes as near as this at least
SHARED_STATE_WIDTH = 1e-8  # relative: so near each other a state may do for both
# where on an arc its state is judged before a proof is tried, and what it may miss there: many times what is allowed
JUDGED_AT, MAX_MISSED = 0.375, 10 * VALID
JOINING_DISTANCE = 1e-6  # relative: so near each other states of different modes may be joined
NO_FORCE = 1e-9  # (scaled) forces and motions that are none
MIN_SEARCH_GAP = 1e-6  # relative gap of searches
MAX_RANGES = 4000  # ranges that are looked at


def resisted(
    p: ScaledProblem,
    goal: Objective,
    largest: float,
    upper: float,
    state: State,
    settings: Settings,
    least: Callable[[Witness], State] = lambda found: found.state,
) -> ResistedInterval:
    """Which magnitudes are resisted, of a maximum.

    Args:
        p, goal: the maximum's problem and how it is posed.
        largest, upper: its bounds; state: the witness of `largest`.
        least: a state of the same question that moves little: large motions beside small forces leave too much rounding
            in an arc.
    """
    if not goal.has_scalar:  # what is resisted at one magnitude is resisted at all
        return ResistedInterval(largest, INF, (), (), settings.gap, (), ())
    shown = _Magnitudes(p, goal, settings, least)
    interrupted = False
    try:
        shown.cover(largest, state)
    except KeyboardInterrupt:  # what was shown until then stays
        interrupted = True
    said = shown.known(largest, upper)
    proofs = tuple(shown.arcs), tuple(shown.slips)
    return ResistedInterval(said.to, said.upper, said.holes, said.unproved, settings.gap, *proofs, interrupted)


class _Magnitudes:
    """The disturbances base + s direction, and what is shown of them so far."""

    def __init__(
        self, p: ScaledProblem, goal: Objective, settings: Settings, least: Callable[[Witness], State]
    ) -> None:
        self.p, self.goal, self.settings, self.least = p, goal, settings, least
        self.arcs: list[Arc] = []
        self.slips: list[Certificate] = []
        self.r: Reduced = reduce(p, LARGEST_MAGNITUDE)
        self.worker = SearchWorker.of(self.r)
        self.question = BoundProblem(p, LARGEST_MAGNITUDE).question
        self.start = time.monotonic()

    def known(self, largest: float, upper: float) -> Known:
        """The ranges together."""
        good, bad = [(a.first, a.last) for a in self.arcs], [self._magnitudes(c) for c in self.slips]
        return known(good, bad, largest, upper, self.settings.gap, no_magnitude(self.question))

    def _magnitudes(self, c: Certificate) -> Range:
        """Which slip by a certificate."""
        return c.question.magnitudes(c.scalar)

    def cover(self, largest: float, state: State) -> None:
        """Show as much as possible of all magnitudes from 0 to the largest."""
        last = self._exact(largest, state)
        first, z = 0.0, self._zero
        if z is None:
            above = self._next(0.0, largest)
            if above is None:
                return
            low, first, z = above
            self._slip(0.0, low)
        self._settle(first, z, largest, last)

    @cached_property
    def _zero(self) -> Array | None:
        """A point at magnitude 0; None if nothing holds there or it is not known."""
        if not self.p.w0.any() and not self.p.f_c.any():
            return np.zeros(len(self.r.cost))
        found = self._search(self.p, ANY_STATE, self._quick())
        return None if found.witness is None else self._exact(0.0, self.least(found.witness))

    # --- what is resisted

    def _settle(self, a: float, za: Array, b: float, zb: Array) -> None:
        """Show as much as possible of the magnitudes between two that are resisted, with their points."""
        todo = [(a, za, b, zb)]
        for _ in range(MAX_RANGES):
            if not todo or time.monotonic() - self.start > self.settings.timeout:
                return
            a, za, b, zb = todo.pop(max(range(len(todo)), key=lambda i: todo[i][2] - todo[i][0]))
            if a >= b or self._joined(a, za, b, zb):
                continue
            switch = self._switch(a, za, b, zb)
            if switch:
                u, zu, v, zv = switch
                todo += [(v, zv, b, zb), (a, za, u, zu)]
                continue
            if b - a < MIN_RANGE_SHARE * self.settings.gap * max(b, self.p.unit_magnitude) or self._branches(
                a, za, b, zb
            ):
                continue
            m = (a + b) / 2 if b < 4 * a or a == 0 else np.sqrt(a * b)
            zm = self._at(m, za + (m - a) / (b - a) * (zb - za))
            if zm is not None:
                todo += [(m, zm, b, zb), (a, za, m, zm)]
                continue
            below = self._last(a, m)
            if below is None:
                continue
            c, zc, high = below
            if high is None and c - a < (m - a) / 2:
                continue  # no progress
            if zc is not None and a < c:
                todo.append((a, za, c, zc))
            if zc is not None and high is None:
                todo.append((c, zc, b, zb))
            above = None if high is None else self._next(m, b)
            if above is not None and high is not None:
                low, d, zd = above
                self._slip(high, low)
                todo.append((d, zd, b, zb))

    def _at(self, s: float, start: Array) -> Array | None:
        """A point (n,) near another that solves the model at a magnitude."""
        r = replace(self.r, lo=np.r_[-s / self.p.direction_scale, self.r.lo[1:]])
        return exact_solution(r, start, hold=True, worker=self.worker)

    def _exact(self, s: float, state: State) -> Array:
        """The point (n,) of a state at a magnitude, solved again with what the magnitude is."""
        z = self.r.at_magnitude(state, s)
        solved = self._at(s, z)
        return z if solved is None else solved

    def _joined(self, a: float, za: Array, b: float, zb: Array) -> bool:
        """Is there an arc between two points that solves the model all along? It is kept."""
        if self._arc(a, b, [za, zb]):
            return True
        if b - a < SHARED_STATE_WIDTH * b and (self._arc(a, b, [za, za]) or self._arc(a, b, [zb, zb])):
            return True  # states of different kinds, nearer than any witness can tell
        if self._modes(za) != self._modes(zb):
            return False
        points = []
        for t in near.nodes(ARC_DEGREE):
            z = za if t == 0 else zb if t == 1 else self._at(a + t * (b - a), za + t * (zb - za))
            if z is None:
                return False
            points.append(z)
        return self._arc(a, b, points)

    def _arc(self, a: float, b: float, points: list[Array]) -> bool:
        controls = near.controls_of(len(points) - 1) @ np.array(points)
        inside = near.bernstein(len(points) - 1, np.array([JUDGED_AT]))[0] @ controls
        if self._missed(a + JUDGED_AT * (b - a), inside) > MAX_MISSED:
            return False  # most that are none are found here, in a tenth of the time
        arc = Arc(a, b, tuple(self._state(z) for z in controls))
        if ranges.replayed(self.question, arc)[0]:
            return False
        self.arcs.append(arc)
        return True

    def _missed(self, s: float, z: Array) -> float:
        """What the state of a point misses at a magnitude, relative to load and commands."""
        p, w = self.p, self.question.wrench + s * self.question.direction
        return float(Witness(p.grasp, w, self._state(z), p.limits.eta, p.mdp).residuals.worst)

    def _branches(self, a: float, za: Array, b: float, zb: Array) -> bool:
        """Does the state of either end go on to the other, though that was found with another state?"""
        there, back = self._at(b, za), self._at(a, zb)
        return bool(
            (there is not None and _apart(there, zb) and self._joined(a, za, b, there))
            or (back is not None and _apart(back, za) and self._joined(a, back, b, zb))
        )

    def _switch(self, a: float, za: Array, b: float, zb: Array) -> tuple[float, Array, float, Array] | None:
        """Where the modes of the first point end, if the states are joined there; with the points before and after."""
        modes = self._modes(za)
        if modes == self._modes(zb):
            return None
        while b - a > SWITCH * b:
            if b - a < JOINING_DISTANCE * b and self._arc(a, b, [za, zb]):
                return a, za, b, zb
            m = (a + b) / 2
            z = self._at(m, za + (m - a) / (b - a) * (zb - za)) if a < m < b else None
            if z is None:
                return None
            if self._modes(z) == modes:
                a, za = m, z
            else:
                b, zb = m, z
        return None

    def _modes(self, z: Array) -> bytes:
        """Which contacts are closed, which slide, which actuators turn."""
        r = self.r
        m, active, _ = r.sizes
        c = (r.C @ z + r.off[: len(r.C)])[: 3 * m].reshape(m, 3)
        motions = r.D @ z
        d = motions[: 3 * m].reshape(m, 3)
        tiny = NO_FORCE * max(1.0, float(np.abs(c).max(initial=0.0)))
        slides = np.hypot(d[:, 1], d[:, 2]) > tiny
        return np.r_[c[:, 0] > tiny, slides & (c[:, 0] > tiny), motions[3 * m : 3 * m + active] > tiny].tobytes()

    def _state(self, z: Array) -> State:
        return self.p.unscale(self.r.point(z))

    # --- what slips

    def _quick(self, share: float = INF) -> Settings:
        """Of searches whose proofs nobody asks for; share: relative width of the range."""
        gap = max(min(self.settings.gap / 2, share / 8), MIN_SEARCH_GAP)
        return replace(self.settings, verify=False, gap=gap, timeout=self._left)

    def _search(self, p: ScaledProblem, goal: Objective, settings: Settings, within: Range | None = None) -> Outcome:
        """Without a cap: states beyond it count as well. Raises KeyboardInterrupt, which `engine.search` does not."""
        found = engine.search(p, goal, settings, within=within, capped=False)
        if found.stop is Stop.INTERRUPTED:
            raise KeyboardInterrupt
        return found

    @property
    def _left(self) -> float:
        return max(self.settings.timeout - (time.monotonic() - self.start), 1e-3)

    def _within(self, a: float, b: float) -> Range:
        """Magnitudes from a to b as bounds of what the goal makes small."""
        lo, hi = sorted(self.goal.objective(self.goal.at_magnitude(self.p, s)) for s in (a, b))
        return lo, hi

    def _last(self, a: float, m: float) -> tuple[float, Array | None, float | None] | None:
        """The largest resisted magnitude from a to m, its point, and above which none is; None if unknown.

        No point if none is resisted, no magnitude above which none is if m itself is.
        """
        if m - a < 8 * MIN_SEARCH_GAP * m:  # no search tells the two apart
            a = m
        found = self._search(self.p, self.goal, self._quick((m - a) / m), self._within(a, m))
        if found.bound == INF:
            return a, None, a
        if found.witness is None:
            return None
        s, high = self.goal.bounds(self.p, found.value, found.bound)
        state = self.least(found.witness)
        if self.goal.homogeneous:
            state = scaled(state, s / self.p.direction_scale)
        s = min(s, m)
        return s, self._exact(s, state), high if high < m else None

    def _next(self, m: float, b: float) -> tuple[float, float, Array] | None:
        """Below which magnitude none from m on is resisted, the smallest that is, and its point; None if unknown."""
        p = self.p
        back = replace(p, direction=-p.direction, along=-p.along)
        found = self._search(
            back, LARGEST_MAGNITUDE, self._quick((b - m) / b), (m / p.direction_scale, b / p.direction_scale)
        )
        if found.witness is None:
            return None
        s, low = found.value * p.direction_scale, found.bound * p.direction_scale
        return (max(low, m), s, self._exact(s, self.least(found.witness))) if s < b else None

    def _slip(self, a: float, b: float) -> None:
        """Certify that every magnitude from a to b slips."""
        if not a < b:
            return
        settings = replace(self.settings, timeout=self._left)
        found = self._search(self.p, self.goal, settings, self._within(a, b))
        if found.bound == INF and found.proof is not None and found.proof.cap is None and found.proof.certificate:
            self.slips.append(found.proof.certificate)


def _apart(a: Array, b: Array) -> bool:
    """Are two points different solutions?"""
    return float(np.abs(a - b).max()) > JOINING_DISTANCE * float(np.abs(b).max())
