"""The synthesis paper's solver: box shrinking by linear programs, then bisection (4.2, 4.3). The reference.

A step is one pass: for every variable the programs LP1 and LP2 over Lambda and the polytopes of Psi, each
bound entering at once. Passes are repeated while they reduce the sum of the side lengths by more than a given
part; then the box is bisected across its longest side, unless all sides are below sigma: a solution box.
Solution boxes hold every solution; that one holds a solution is not shown.

Nothing rests on the solver: a bound counts as far as the multipliers prove it (`dual_bound`), and a box is
discarded on a Farkas ray that stands up to the same arithmetic or on proved bounds that contradict each other.
A program that ends at a limit, or whose ray proves nothing, leaves the box as it is.

Where the paper is silent: the longest side is the largest number, whatever it counts, lengths in the system's
unit (the paper's tables are in millimetres) and directions, cosines, parameters and monomials as they are. By
default the sides of x in (29), monomials included, are what is shrunk, split and compared with sigma, to the
letter; `over="original"` takes the variables q of (26) instead and lets the monomials follow by interval
arithmetic, which is far cheaper.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.branch import BranchAndPrune, Discarded, Final, Order, Outcome, Split
from handfast.core.errors import InputError
from handfast.core.files import Strict, validate
from handfast.papers.canonical_system import Canonical
from handfast.papers.linear_programs import DualBound, LinearProgram, highspy, polytopes


class Over(StrEnum):
    """Which variables are shrunk by programs, split, and held against sigma."""

    ALL = "all"  # x: the original ones and the monomials
    ORIGINAL = "original"  # q


@dataclass(frozen=True)
class ShrinkingSettings:
    """How the search is made.

    Attributes:
        sigma: side length below which a box is a solution box.
        significant: a pass that reduces the sum of the sides by less than this part is the last before bisection.
        over: see `Over`.
        narrow: sides below this part of sigma are not shrunk any more; programs on them are slow and gain nothing.
        slack: to which every equation holds, in units; more than the rounding of its coefficients.
        iterations, seconds: limits of one linear program.
    """

    sigma: float = 0.1
    significant: float = 0.05
    over: Over = Over.ALL
    narrow: float = 1e-4
    slack: float = 1e-9
    iterations: int = 20_000
    seconds: float = 2.0

    def __post_init__(self) -> None:
        for name in ("sigma", "slack", "iterations", "seconds"):
            if not getattr(self, name) > 0:
                raise InputError(f"is {getattr(self, name):g}; it must be positive", field=name)
        for name in ("significant", "narrow"):
            if not 0 < getattr(self, name) < 1:
                raise InputError(f"is {getattr(self, name):g}; it lies in (0, 1)", field=name)


@dataclass(frozen=True, eq=False)
class SystemBox:
    """A box of x.

    Attributes:
        lower, upper: (n_x,).
        share: of the root, halved by every bisection.
    """

    lower: Array
    upper: Array
    share: float = 1.0

    @property
    def sides(self) -> Array:
        """(n_x,) lengths of the sides."""
        return self.upper - self.lower

    def holds(self, x: Array, tolerance: float = 0.0) -> bool:
        """Is a point (n_x,) in it?"""
        return bool((x >= self.lower - tolerance).all() and (x <= self.upper + tolerance).all())


@dataclass(frozen=True, eq=False)
class Emptiness:
    """Why a box holds no solution.

    Attributes:
        box: the box at the time, already shrunk by proved bounds.
        start: the box at the beginning of the pass: the polytopes are those over it.
        multipliers: of the rows of `polytopes(start)`.
        column, sign: of the variable whose proved bound contradicts the box; None for a Farkas ray.
        margin: by how much, at least.
    """

    box: SystemBox
    start: SystemBox
    multipliers: Array
    column: int | None
    sign: float
    margin: float


@dataclass
class Statistics:
    """What a search spent; times in seconds of all threads together."""

    boxes: int = 0
    passes: int = 0
    programs: int = 0
    unproved: int = 0  # programs that gave no multipliers, or such that prove nothing
    seconds: float = 0.0
    program_seconds: float = 0.0

    @property
    def boxes_per_second(self) -> float:
        """Boxes discarded, split or final, per second."""
        return self.boxes / self.seconds if self.seconds else 0.0

    @property
    def program_share(self) -> float:
        """Part of the time that went into linear programs, checks not counted."""
        return self.program_seconds / self.seconds if self.seconds else 0.0


class SystemBoxEntry(Strict):
    """A box as JSON-able data."""

    lower: list[float]
    upper: list[float]
    share: float


@dataclass
class PaperSolver:
    """The domain of the search: boxes of a canonical system.

    Attributes:
        system: what is solved.
        settings: how.
        statistics: what was spent so far.
        end: on the monotonic clock; a pass ends then with the bounds that it has, and is to be gone on with.
    """

    system: Canonical
    settings: ShrinkingSettings = field(default_factory=ShrinkingSettings)
    statistics: Statistics = field(default_factory=Statistics)
    end: float = float("inf")

    def __post_init__(self) -> None:
        highspy()  # missing: say so before the search begins
        self._lock = threading.Lock()

    @property
    def root(self) -> SystemBox:
        """The initial box of (29)."""
        x = self.system.expanded
        return SystemBox(x.lower, x.upper)

    def search(self, order: Order = Order.DEPTH) -> BranchAndPrune[SystemBox]:
        """For solution boxes: depth first for one of them, breadth first for all (4.2)."""
        return BranchAndPrune(self, [self.root], order=order)

    @property
    def width(self) -> int:
        """How many of the variables of x, the first ones, are shrunk, split and held against sigma."""
        return self.system.expanded.n if self.settings.over is Over.ALL else self.system.n_v

    @property
    def late(self) -> bool:
        """Is the time over?"""
        return time.monotonic() >= self.end

    def examine(self, region: SystemBox) -> Outcome[SystemBox]:
        """One pass over a box, then what it calls for: another pass, bisection, or the end."""
        begun, n = time.perf_counter(), self.width
        after = self.shrink(region)
        out: Outcome[SystemBox]
        if isinstance(after, Emptiness):
            out = Discarded(after)
        elif after.sides[:n].max() <= self.settings.sigma:
            out = Final(after)
        elif self.late or after.sides[:n].sum() < (1 - self.settings.significant) * region.sides[:n].sum():
            out = Split((after,), nodes=0)
        else:
            out = Split(bisect(after, n))
        with self._lock:
            self.statistics.seconds += time.perf_counter() - begun
            self.statistics.boxes += out.nodes
        return out

    def shrink(self, start: SystemBox) -> SystemBox | Emptiness:
        """One pass of LP1 and LP2 over the variables (4.3): a box that holds all solutions of `start`, or why none."""
        s, x = self.settings, self.system.expanded
        lower, upper = start.lower.copy(), start.upper.copy()
        rows = polytopes(x, lower, upper, s.slack)
        dual = DualBound(rows)
        program = LinearProgram(rows, lower, upper, iterations=s.iterations, seconds=s.seconds)
        programs = unproved = 0
        spent = 0.0
        empty: Emptiness | None = None
        for k in range(self.width):
            for sign in (1.0, -1.0):
                if empty or self.late or upper[k] - lower[k] <= s.narrow * s.sigma:
                    continue
                begun = time.perf_counter()
                tried = program.multipliers(k, sign)
                spent += time.perf_counter() - begun
                programs += 1
                unproved += not tried
                box = SystemBox(lower.copy(), upper.copy(), start.share)
                for y in tried:
                    margin = dual.below(y, lower, upper)
                    if margin > 0:
                        empty = Emptiness(box, start, y, None, 1.0, margin)
                        break
                    bound = dual.below(y, lower, upper, k, sign)
                    end = upper[k] if sign > 0 else -lower[k]
                    if bound > end:
                        empty = Emptiness(box, start, y, k, sign, bound - end)
                        break
                    if sign > 0:
                        lower[k] = max(lower[k], bound)
                    else:
                        upper[k] = min(upper[k], -bound)
                program.bound(k, lower[k], upper[k])
        with self._lock:
            self.statistics.passes += 1
            self.statistics.programs += programs
            self.statistics.unproved += unproved
            self.statistics.program_seconds += spent
        if empty:
            return empty
        if self.settings.over is Over.ORIGINAL:
            self._follow(lower, upper)
        return SystemBox(lower, upper, start.share)

    def _follow(self, lower: Array, upper: Array) -> None:
        """Monomials within what interval arithmetic makes of their factors; never empties a box."""
        x = self.system.expanded
        k, i = x.squares.T
        kk, ii, jj = x.products.T
        ends = np.array([lower[i] * lower[i], upper[i] * upper[i]])
        low = np.where((lower[i] <= 0) & (upper[i] >= 0), 0.0, ends.min(axis=0))
        corners = np.array([a[ii] * b[jj] for a in (lower, upper) for b in (lower, upper)])
        columns = np.concatenate([k, kk])
        low = np.nextafter(np.concatenate([low, corners.min(axis=0)]), -np.inf)
        high = np.nextafter(np.concatenate([ends.max(axis=0), corners.max(axis=0)]), np.inf)
        low, high = np.maximum(lower[columns], low), np.minimum(upper[columns], high)
        good = low <= high  # where not there is no solution, which the next pass has to prove by a ray
        lower[columns[good]], upper[columns[good]] = low[good], high[good]

    def share(self, region: SystemBox) -> float:
        """See `branch.Domain`."""
        return region.share

    def encode(self, region: SystemBox) -> Any:
        """See `branch.Domain`."""
        return {"lower": region.lower.tolist(), "upper": region.upper.tolist(), "share": region.share}

    def decode(self, data: Any) -> SystemBox:
        """See `branch.Domain`; `InputError` for a box of another system."""
        saved = validate(SystemBoxEntry, data)
        n = self.system.expanded.n
        if not len(saved.lower) == len(saved.upper) == n:
            raise InputError(
                f"has {len(saved.lower)} lower and {len(saved.upper)} upper ends; {n} are needed", field="box"
            )
        box = SystemBox(np.array(saved.lower), np.array(saved.upper), saved.share)
        if (box.lower > box.upper).any():
            raise InputError("has a lower end above the upper one", field="box")
        return box


def bisect(box: SystemBox, n: int) -> tuple[SystemBox, SystemBox]:
    """The two halves across the longest of the first n sides."""
    k = int(box.sides[:n].argmax())
    middle = (box.lower[k] + box.upper[k]) / 2
    upper, lower = box.upper.copy(), box.lower.copy()
    upper[k] = lower[k] = middle
    half = box.share / 2
    return replace(box, upper=upper, share=half), replace(box, lower=lower, share=half)
