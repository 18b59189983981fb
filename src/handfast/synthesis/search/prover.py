"""Prover: that no configuration exists, shown by discarding every box.

Any set of contacts that cannot be made together settles the task, so each pair, each triple and the whole set
is searched on its own, in turns, over the joints and region parameters that concern it; the object's pose is
eliminated (`kernel.set_search`). Where the task bounds the object's position, its origin counts as a contact.
With three contacts and more the poses are searched too: one at a time the fingers decouple (`kernel.pose_search`).
Every solution's coordinates lie in a box that was not discarded.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.answer import SearchLimits
from handfast.core.arrays import Array
from handfast.core.branch import BranchAndPrune
from handfast.core.errors import InputError
from handfast.core.files import Strict, validate
from handfast.synthesis.search.boxes import KEPT_BOXES, STEP_NODES, BoxDomain, ContactSet, PoseSpace, SearchPart
from handfast.synthesis.search.starts import Starts
from handfast.synthesis.task import PoseBounds, Task
from handfast.synthesis.task_problem import TaskProblem

# boxes before another search has its turn: at the very beginning, and then
FIRST_SLICE_BOXES, SLICE_BOXES = 2 * STEP_NODES, 20 * STEP_NODES
LONGER = 4  # turns grow to this fraction of what a search has had so far
LEAVES = 64  # small boxes of all contacts after which these are searched no further
POSES = "poses"  # name of the pose-space search
LIKELY_WEIGHT = 8  # times as much for the searches that are likely to succeed as for all others together
MAX_LIKELY_CONTACTS = 2  # contacts of a set that may be one of those
CELLS = 8  # each way, of a region: each has constants of its own
DERIVATIVE_INFLATION = 1.0 + 1e-9  # over the rounding of `derivative_bounds`
FROM = 3  # contacts, for the pose-space search: with two of them the pose is too free


@dataclass(frozen=True, eq=False)
class Disproof:
    """What a prover found out so far.

    Attributes:
        empty: every box of some set of contacts was discarded by verified arithmetic: no configuration exists.
        by: which search, in words: the empty one, or the one of which the largest share is discarded.
        nodes: boxes examined, of all searches, inner ones too.
        discarded: largest share of a search that is discarded.
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

    schema_: Literal["handfast/prover/1"] = Field(alias="schema")
    sets: dict[str, Any]


class Prover:
    """Searches for a set of contacts that cannot be made together.

    Args:
        problem: the task in minimal coordinates.
        workers: threads.
    """

    def __init__(self, problem: TaskProblem, *, workers: int = 2) -> None:
        self.problem, self.workers = problem, workers
        b = len(problem.task.contact_pairs)
        points = b + bool(np.isfinite(problem.task.pose.position).any())  # the last one: the object's origin
        sizes = range(2, points + 1) if points > 1 else range(1, 2)
        subsets = [s for size in sizes for s in combinations(range(points), size)]
        rates, bounds = derivative_bounds(problem), cones(problem)
        self.domains: dict[str, BoxDomain] = {
            "-".join(map(str, s)): ContactSet(problem, s, rates, bounds, kept=KEPT_BOXES if s == subsets[-1] else 1)
            for s in subsets
        }
        self.whole = next(reversed(self.domains))
        if b >= FROM:
            self.domains[POSES] = PoseSpace(problem, rates)
        self.searches: dict[str, BranchAndPrune[SearchPart]] = {
            name: BranchAndPrune(d, d.roots, workers=workers) for name, d in self.domains.items()
        }
        self._ready: set[type[BoxDomain]] = set()
        self._limits = SearchLimits()  # of the latest run

    def run(
        self,
        *,
        seconds: float | None = None,
        nodes: int | None = None,
        on_progress: Callable[[Disproof], None] | None = None,
        state: dict[str, Any] | None = None,
    ) -> Disproof:
        """Go on until a search is empty, each has come to the resolution somewhere, or a limit is hit.

        Raises:
            InputError: a state that is not one, or of another task.
        """
        if state:
            self.restore(state)
        before, interrupted = self.nodes, False
        self._limits = SearchLimits(seconds, nodes)
        try:
            with closing(self._turns()) as turns:  # Ctrl-C while threads end would be lost in a collected generator
                for _ in turns:
                    if self._empty() is not None:
                        break
                    if on_progress is not None:
                        on_progress(self._standing())
                    if self._limits.stop(self.nodes - before):
                        break
            if self._empty() is None:
                self.compile()  # a later run may have a limit from without
        except KeyboardInterrupt:
            interrupted = True
        return self._standing(sizes=True, interrupted=interrupted)

    def compile(self) -> None:
        """Compile every kernel now; `run` does it before a kernel's first turn, beside its time limit."""
        for domain in self.domains.values():
            self._compile(domain)

    @property
    def nodes(self) -> int:
        """Boxes examined so far."""
        return sum(s.state.nodes for s in self.searches.values())

    def restore(self, state: dict[str, Any]) -> None:
        """Take up a saved state; `InputError` if it is not one of this task."""
        saved = validate(StateFile, state)
        if set(saved.sets) != set(self.searches):
            missing = sorted(set(self.searches) - set(saved.sets))
            what = f"it lacks {', '.join(missing)}" if missing else "it has too many"
            raise InputError(f"has other searches than this task needs: {what}; start anew", field="state.sets")
        for name, domain in self.domains.items():
            self.searches[name] = BranchAndPrune.restored(domain, saved.sets[name], workers=self.workers)

    def save(self) -> dict[str, Any]:
        """The state, JSON-able."""
        return {"schema": "handfast/prover/1", "sets": {name: x.save() for name, x in self.searches.items()}}

    def _turns(self) -> Generator[None, None, None]:
        """Step by step: short turns for each search, and after each for the set that has come farthest.

        They settle what is far from possible. Then turns go to the search that has had least of its share. A search
        with a small box left can no longer become empty and has no more turns; the set of all contacts has some,
        since its small boxes are where configurations may be.
        """
        for boxes in (FIRST_SLICE_BOXES, SLICE_BOXES):
            for name in [s for s, x in self.searches.items() if x.state.nodes < boxes]:
                sets = [s for s in self.searches if s != POSES and self._open(s)]
                farthest = max(sets, key=lambda s: self.searches[s].state.discarded, default=name)
                for turn in dict.fromkeys((name, farthest)):
                    yield from self._turn(turn, boxes)
        while any(map(self._open, self._shares)):
            name = min(filter(self._open, self._shares), key=lambda s: self._spent(s) / self._shares[s])
            yield from self._turn(name, max(SLICE_BOXES, self.searches[name].state.nodes // LONGER))

    def _spent(self, name: str) -> int:
        """What a search has taken so far: its boxes, those of sets times the contacts, by which they take longer."""
        return self.searches[name].state.nodes * (1 if name == POSES else 1 + name.count("-"))

    @cached_property
    def _shares(self) -> dict[str, float]:
        """How much of the time each search is to have, without the sets that nothing can show impossible.

        Of two contacts it is quick to tell that they cannot be made together, if they are the reason. Else it is the
        poses that see what three and more want of each other.
        """
        names = {tuple(map(int, name.split("-"))): name for name in self.searches if name != POSES}
        with self._limits.paused():
            may = suspects(self.problem.task, list(names))
        pairs = [names[s] for s, least in may.items() if least and len(s) <= MAX_LIKELY_CONTACTS]
        rest = [names[s] for s in may if names[s] not in pairs]
        parts = (
            (pairs, LIKELY_WEIGHT),
            ([POSES] if POSES in self.searches else [], 1 if pairs else LIKELY_WEIGHT),
            (rest, 1),
        )
        return {name: part / len(group) for group, part in parts for name in group}

    def _turn(self, name: str, boxes: int) -> Generator[None, None, None]:
        if name in self.searches and self._open(name):
            self._compile(self.domains[name])
            end = self.searches[name].state.nodes + boxes
            with closing(iter(self.searches[name])) as search:
                for state in search:
                    yield
                    if state.nodes >= end or not self._open(name):
                        break

    def _compile(self, domain: BoxDomain) -> None:
        """Compiled before its first turn, at nobody's expense."""
        if type(domain) not in self._ready:
            with self._limits.paused():
                domain.examine(domain.roots[0], budget=0)
            self._ready.add(type(domain))

    def _open(self, name: str) -> bool:
        state = self.searches[name].state
        return state.pending > 0 and len(state.unfinished) < (LEAVES if name == self.whole else 1)

    def leaves(self) -> Array:
        """(k, n) middles of the small boxes of all contacts together: where to look for configurations."""
        unfinished = self.searches[self.whole].state.unfinished
        return np.array([part.box.mean(axis=1) for part in unfinished]).reshape(-1, self.problem.n)

    def _empty(self) -> str | None:
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
            self.domains[best].words,
            self.nodes,
            1.0 if empty is not None else states[best].discarded,
            max(s.depth for s in states.values()),
            0 if empty is not None else states[best].pending + len(states[best].unfinished),
            min(widths),
            max(widths),
            interrupted,
        )


def suspects(task: Task, subsets: Sequence[tuple[int, ...]]) -> dict[tuple[int, ...], bool]:
    """The sets of contacts that may be impossible, and of each whether it has no other of them within it.

    A set of which one block of local searches proves a configuration is left out: nothing can show it impossible. The
    last set is not looked for. This only says where to search; no proof rests on it.

    Args:
        subsets: smaller ones first, all contacts last; in them the number of contacts stands for the object's origin.
    """
    out: dict[tuple[int, ...], bool] = {}
    for subset in subsets:
        if any(set(other) <= set(subset) for other in out):
            out[subset] = False
        elif subset == subsets[-1] or not _possible(task, subset):
            out[subset] = True
    return out


def _possible(task: Task, subset: tuple[int, ...]) -> bool:
    """Do local searches find a configuration of these contacts alone?"""
    b = len(task.contact_pairs)
    position = task.pose.position if b in subset else PoseBounds.none().position
    pairs = tuple(task.contact_pairs[k] for k in subset if k < b)
    part = replace(task, contact_pairs=pairs, pose=PoseBounds(position, task.pose.axes))
    return bool(Starts(TaskProblem.of(part), 0).run(1))


def derivative_bounds(problem: TaskProblem) -> Array:
    """(b, 2, CELLS, CELLS, 10) constants of the object's and the hand's regions, see `taylor.worst`; units."""
    out = np.zeros((len(problem.task.contact_pairs), 2, CELLS, CELLS, 10))
    for k, pair in enumerate(problem.task.contact_pairs):
        radius = pair.hand.ball.radius if pair.hand.ball else 0.0
        for i, region in enumerate((pair.object, pair.hand)):
            if not region.ball or i == 0:
                surface, normal = region.derivative_bounds(CELLS)
                outward = radius * normal if i == 0 else 0.0
                out[k, i] = np.concatenate([(surface + outward) / problem.unit, normal], axis=2) * DERIVATIVE_INFLATION
                if region.ball:  # its parameters are no fractions; the constants hold everywhere
                    out[k, i, 0, 1] = np.nan
    return out


def cones(problem: TaskProblem) -> Array:
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
