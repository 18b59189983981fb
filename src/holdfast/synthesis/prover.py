"""Prover: that no configuration exists, shown by discarding every box.

Any set of contacts that cannot be made together settles the task, so each pair, each triple and the whole set
is searched on its own, in turns, over the joints and region parameters that concern it; the object's pose is
eliminated (`engine.exclude`). Where the task bounds the object's position, its origin counts as a contact.
Every solution's coordinates lie in a box that was not discarded.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from holdfast.branch import Discarded, Outcome, Search, Split, Unfinished
from holdfast.errors import InputError
from holdfast.files import Strict, validate
from holdfast.mechanism import Array, Indices
from holdfast.region import Bezier, Cap, Region, differences, restrict
from holdfast.synthesis.engine.exclude import explore
from holdfast.synthesis.problem import Problem

STEP = 2000  # nodes of one call of the kernel
SLICE = 20  # calls before another set of contacts has its turn, doubled each time round
RESOLUTION = 1e-5  # [m] a box within which no point strays farther is set aside, undecided
LEAVES = 64  # small boxes of all contacts after which these are searched no further
DEEPEST = 4000  # boxes on a kernel's stack
KEPT = 256  # small boxes of one call
CELLS = 8  # each way, of a region: each has constants of its own
UP = 1.0 + 1e-9  # over the rounding of the constants below


@dataclass(frozen=True, eq=False)
class Part:
    """A box of one set of contacts.

    Attributes:
        box: (n, 2) of all coordinates; those that do not concern the set are not used.
        share: of the set's whole box.
        small: at the resolution already.
    """

    box: Array
    share: float
    small: bool = False


class PartEntry(Strict):
    """A part as JSON-able data."""

    box: list[tuple[float, float]]
    share: Annotated[float, Field(ge=0, le=1)]
    small: bool


class Together:
    """The search domain of one set of contacts: can these be made together, in any pose of the object?"""

    def __init__(self, problem: Problem, subset: tuple[int, ...], bend: Array, cones: Array) -> None:
        flat = problem.flat
        self.problem, self.subset, self.bend, self.cones = problem, np.array(subset, dtype=np.intp), bend, cones
        b = len(flat.steps)
        use = {int(flat.params[0]) - 7 + i for i in range(3)} if b in subset else set()
        for k in subset:
            if k < b:
                use |= {int(v) for v in flat.var[k, : flat.steps[k]]}
                use |= {int(flat.params[k]) + i for i in range(4 if flat.hand[k] else 2)}
        self.use: Indices = np.array(sorted(use), dtype=np.intp)

    @property
    def root(self) -> Part:
        """Everything."""
        flat = self.problem.flat
        return Part(np.column_stack([flat.lower, flat.upper]), 1.0)

    def examine(self, part: Part, budget: int = STEP) -> Outcome[Part]:
        """One call of the kernel on a box: up to `budget` nodes depth first."""
        if part.small:
            return Unfinished(part, 0)
        n = self.problem.n
        stack, share = np.empty((DEEPEST, n, 2)), np.empty(DEEPEST)
        stack[0], share[0] = part.box, part.share
        kept, kept_share = np.empty((KEPT, n, 2)), np.empty(KEPT)
        resolution = RESOLUTION / self.problem.unit
        flat, use = self.problem.flat, self.use
        count, found, nodes = explore(
            stack, share, 1, flat, self.subset, use, self.bend, self.cones, budget, resolution, kept, kept_share
        )
        if count == found == 0:
            return Discarded(nodes=nodes)
        left = [Part(stack[i].copy(), float(share[i])) for i in reversed(range(count))]
        small = [Part(kept[i].copy(), float(kept_share[i]), True) for i in range(found)]
        return Split([*small, *left], nodes=nodes)

    def share(self, part: Part) -> float:
        return part.share

    def encode(self, part: Part) -> Any:
        return {"box": part.box.tolist(), "share": part.share, "small": part.small}

    def decode(self, data: Any) -> Part:
        entry = validate(PartEntry, data)
        if len(entry.box) != self.problem.n:
            raise InputError(f"has {len(entry.box)} intervals, needs {self.problem.n}", field="box")
        return Part(np.array(entry.box), entry.share, entry.small)


@dataclass(frozen=True, eq=False)
class Disproof:
    """What a prover found out so far.

    Attributes:
        empty: every box of some set of contacts was discarded by verified arithmetic: no configuration exists.
        by: which set, in words: the empty one, or the one of which the largest share is discarded.
        nodes: boxes examined, of all sets.
        discarded: largest share of a set's box that is discarded.
        depth: of the search tree in calls of the kernel.
        pending: boxes left of the set that has the fewest share left, small ones included.
        smallest, largest: [rad, -] widest side of the smallest and of the largest of these, at the end of a run.
        interrupted: by Ctrl-C.
    """

    empty: bool
    by: str
    nodes: int
    discarded: float
    depth: int
    pending: int
    smallest: float
    largest: float
    interrupted: bool = False


class StateFile(Strict):
    """A prover's state."""

    schema_: Literal["holdfast/prover/1"] = Field(alias="schema")
    sets: dict[str, Any]


class Prover:
    """Searches for a set of contacts that cannot be made together.

    Args:
        problem: the task in minimal coordinates.
        workers: threads.
    """

    def __init__(self, problem: Problem, *, workers: int = 2) -> None:
        self.problem, self.workers = problem, workers
        b = len(problem.task.touches)
        points = b + bool(np.isfinite(problem.task.pose.position).any())  # the last one: the object's origin
        sizes = range(2, points + 1) if points > 1 else range(1, 2)
        subsets = [s for size in sizes for s in combinations(range(points), size)]
        bend, cones = _bends(problem), _cones(problem)
        self.domains = {s: Together(problem, s, bend, cones) for s in subsets}
        self.searches: dict[tuple[int, ...], Search[Part]] = {
            s: Search(d, [d.root], workers=workers) for s, d in self.domains.items()
        }
        for domain in self.domains.values():
            domain.examine(domain.root, budget=0)  # compiled before any time limit begins
            break

    def run(
        self,
        *,
        seconds: float | None = None,
        nodes: int | None = None,
        on_step: Callable[[Disproof], None] | None = None,
        state: dict[str, Any] | None = None,
    ) -> Disproof:
        """Go on until a set is empty, each has come to the resolution somewhere, or a limit is hit.

        Raises:
            InputError: a state that is not one, or of another task.
        """
        if state:
            self.restore(state)
        end = None if seconds is None else time.monotonic() + seconds
        before = self.nodes
        interrupted = False
        try:
            for _ in self._turns():
                if self._empty() is not None:
                    break
                if on_step is not None:
                    on_step(self._standing())
                if end is not None and time.monotonic() >= end:
                    break
                if nodes is not None and self.nodes - before >= nodes:
                    break
        except KeyboardInterrupt:
            interrupted = True
        return self._standing(sizes=True, interrupted=interrupted)

    @property
    def nodes(self) -> int:
        """Boxes examined so far."""
        return sum(s.state.nodes for s in self.searches.values())

    def restore(self, state: dict[str, Any]) -> None:
        """Take up a saved state; `InputError` if it is not one of this task."""
        saved = validate(StateFile, state)
        if set(saved.sets) != {_name(s) for s in self.searches}:
            raise InputError("is of another task: its sets of contacts differ", field="state.sets")
        for s, domain in self.domains.items():
            self.searches[s] = Search.restored(domain, saved.sets[_name(s)], workers=self.workers)

    def save(self) -> dict[str, Any]:
        """The state, JSON-able."""
        return {"schema": "holdfast/prover/1", "sets": {_name(s): x.save() for s, x in self.searches.items()}}

    def _turns(self) -> Iterator[None]:
        """Step by step: each set of contacts in its turn, and after each the one that has come farthest.

        A set with a small box left can no longer become empty and has no more turns; the set of all contacts
        has some, since its small boxes are where configurations may be.
        """
        steps = SLICE
        while open_ones := [s for s in self.searches if self._open(s)]:
            for subset in open_ones:
                for s in dict.fromkeys((subset, max(open_ones, key=lambda s: self.searches[s].state.discarded))):
                    for done, _ in enumerate(self.searches[s]):
                        yield
                        if done + 1 >= steps or not self._open(s):
                            break
            steps *= 2

    def _open(self, subset: tuple[int, ...]) -> bool:
        state = self.searches[subset].state
        everything = len(subset) == max(map(len, self.searches))
        return state.pending > 0 and len(state.unfinished) < (LEAVES if everything else 1)

    def leaves(self) -> Array:
        """(k, n) middles of the small boxes of all contacts together: where to look for configurations."""
        n, whole = self.problem.n, max(self.searches, key=len)
        return np.array([part.box.mean(axis=1) for part in self.searches[whole].state.unfinished]).reshape(-1, n)

    def _words(self, subset: tuple[int, ...]) -> str:
        b = len(self.problem.task.touches)
        *most, last = [str(k) if k < b else "the object's position" for k in subset]
        if not most:
            return f"contact {last}"
        return f"contact{'s' * (len(subset) > 2 or b not in subset)} {', '.join(most)} and {last}"

    def _empty(self) -> tuple[int, ...] | None:
        done = (s for s, x in self.searches.items() if not x.state.pending and not x.state.unfinished)
        return next(done, None)

    def _standing(self, *, sizes: bool = False, interrupted: bool = False) -> Disproof:
        empty = self._empty()
        states = {s: x.state for s, x in self.searches.items()}
        best = empty if empty is not None else max(states, key=lambda s: states[s].discarded)
        widths = [0.0]
        if sizes and empty is None:
            open_ones = [*self.searches[best].pending, *states[best].unfinished]
            use = self.domains[best].use
            widths = [float(np.ptp(part.box[use], axis=1).max()) for part in open_ones] or [0.0]
        return Disproof(
            empty is not None,
            self._words(best),
            self.nodes,
            1.0 if empty is not None else states[best].discarded,
            max(s.depth for s in states.values()),
            0 if empty is not None else states[best].pending + len(states[best].unfinished),
            min(widths),
            max(widths),
            interrupted,
        )


def _name(subset: tuple[int, ...]) -> str:
    return "-".join(map(str, subset))


# --- constants ------------------------------------------------------------------------------------


def _bends(problem: Problem) -> Array:
    """(b, 2, CELLS, CELLS, 10) constants of the object's and the hand's regions, see `taylor.worst`; units."""
    out = np.zeros((len(problem.task.touches), 2, CELLS, CELLS, 10))
    for k, touch in enumerate(problem.task.touches):
        radius = touch.hand.radius if isinstance(touch.hand, Cap) else 0.0
        for i, region in enumerate((touch.object, touch.hand)):
            if isinstance(region, Bezier) or i == 0:
                surface, normal = bounds(region)
                outward = radius * normal if i == 0 else 0.0
                out[k, i] = np.concatenate([(surface + outward) / problem.unit, normal], axis=2) * UP
                if isinstance(region, Cap):  # its parameters are no fractions; the constants hold everywhere
                    out[k, i, 0, 1] = np.nan
    return out


def bounds(region: Region) -> tuple[Array, Array]:
    """Bounds (CELLS, CELLS, 5) in each cell of |p_s|, |p_t|, |p_ss|, |p_st|, |p_tt| [m], and of the unit normal's.

    From Bernstein coefficients: a polynomial lies in the hull of them. With n the normal, not normalised,
    and f' and f'' its derivatives, those of n / |n| are at most |f'| / |n| and |f''| / |n| + (2 / sqrt 3)
    |f'|^2 / |n|^2 (mixed ones alike).
    """
    shape = (CELLS, CELLS, 5)
    if isinstance(region, Cap):
        return np.full(shape, region.radius), np.ones(shape)
    surface, normal = np.zeros(shape), np.zeros(shape)
    cuts = list(pairwise(np.linspace(0, 1, CELLS + 1).tolist()))
    curve = 2 / np.sqrt(3)
    for i, j in np.ndindex(CELLS, CELLS):
        points, n = (restrict(p, cuts[i], cuts[j]) for p in (region.points, region.normal_points))
        surface[i, j], least = _largest(points), _least(n)
        f = _largest(n) / least
        normal[i, j] = f + curve * np.array([0, 0, f[0] ** 2, f[0] * f[1], f[1] ** 2])
    return surface, normal


def _largest(points: Array) -> Array:
    """(5,) bounds of a polynomial's derivatives over a cell, in the parameters of the whole."""
    orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    return np.array([CELLS ** sum(o) * np.linalg.norm(differences(points, *o), axis=2).max() for o in orders])


def _least(n: Array, depth: int = 0) -> float:
    """A positive lower bound of |n| over a patch of normals (its regularity is known)."""
    along = n.reshape(-1, 3).mean(axis=0)
    along /= np.linalg.norm(along)
    value = float((n @ along).min())
    if value > 0 or depth == 8:
        return max(value, 1e-30)
    halves = ((0.0, 0.5), (0.5, 1.0))
    return min(_least(restrict(n, u, v), depth + 1) for u in halves for v in halves)


def _cones(problem: Problem) -> Array:
    """(m, 5) bounds of the object's axes: index of the axis, unit direction in the palm frame, angle from it."""
    rows = []
    for k, box in enumerate(problem.task.pose.axes):
        tries = [*np.eye(3), *-np.eye(3)]
        middle = box.mean(axis=1)
        if np.linalg.norm(middle) > 1e-6:
            tries.append(middle / np.linalg.norm(middle))
        for c in tries:
            # no vector within the bounds has a smaller component along c
            least = float(np.minimum(c * box[:, 0], c * box[:, 1]).sum())
            if least > -1:
                rows.append([k, *c, np.arccos(min(least, 1.0)) + 1e-9])
    return np.array(rows).reshape(-1, 5)
