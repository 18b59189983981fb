"""The question of synthesis: can the hand take this hold?

Random starts first, since most tasks that can be met are met within milliseconds; then the search for a
contradiction in turns with more starts. Both are exact in what they claim: a configuration counts only if the
Krawczyk test proves it, and there is none only if every part of the space was discarded by verified arithmetic.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.answer import Reach, SearchLimits, Stop
from handfast.core.errors import InputError, kinds_checked
from handfast.synthesis.distance import farthest, features_of
from handfast.synthesis.embedded_task import fingerprint, task_to_dict
from handfast.synthesis.search.starts import START_BLOCK, Certified, Starts, Walks
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Searched, Synthesis
from handfast.synthesis.task import Task
from handfast.synthesis.task_problem import TaskProblem

if TYPE_CHECKING:
    from handfast.synthesis.search.prover import Disproof, Prover

FIRST_BLOCKS = 2  # blocks of starts before the prover has its first turn
BETWEEN = 2  # blocks between two of its turns
LAST_BLOCKS = 8  # blocks after it has come to its resolution and can show no more
FIRST_TURN_SECONDS, MAX_TURN_SECONDS = 1.0, 60.0  # [s] its first turn and its longest one, each twice the one before
POOL, SMALLEST_POOL = 8, 128  # configurations from which each that is asked for is chosen; and at least
POOL_DOUBLINGS = 4  # times that a pool is doubled where too few in it differ


@dataclass(frozen=True)
class SynthesisProgress:
    """Where a synthesis is.

    Attributes:
        starts: random starts so far. found: certified configurations. wanted: to choose from.
        nodes, depth, pending, discarded: of the search for a contradiction, see `Searched`.
    """

    starts: int
    found: int
    wanted: int
    nodes: int = 0
    depth: int = 0
    pending: int = 0
    discarded: float = 0.0


OnStep = Callable[[SynthesisProgress], None]


@kinds_checked
def synthesize(
    task: Task,
    *,
    count: int = 1,
    seed: int = 0,
    timeout: float | None = 60.0,
    nodes: int | None = None,
    jobs: int = 2,
    resume: Synthesis | str | Path | None = None,
    on_progress: OnStep | None = None,
) -> Synthesis:
    """Can the hand bring every region onto its object region, within all limits?

    Args:
        count: of configurations that differ; see `distance` for how much.
        seed: of the random starts; the same seed finds the same configurations.
        timeout: [s] after start-up; None searches until the question is answered.
        nodes: boxes of the search for a contradiction in this call; None: any number.
        jobs: cores of that search.
        resume: an UNDECIDED answer or its file, to go on from; its seed is taken over.
        on_progress: called while it runs.

    Raises:
        InputError: count, seed or a limit out of range; limits and couplings that leave nothing; an answer
            to resume that is of another task, or not undecided.
    """
    _refuse_numbers(count, seed, timeout, nodes, jobs)
    limits = SearchLimits(timeout, nodes)
    state = _state_of(task, resume) if resume is not None else {}
    with limits.paused():  # it compiles
        starts = Starts(TaskProblem.of(task), int(state.get("seed", seed)), int(state.get("block", 0)))
    run = _Run(starts, count, limits, jobs, state.get("prover") or None, on_progress)
    try:
        run.search()
    except KeyboardInterrupt:
        run.stop = Stop.INTERRUPTED
    return run.answer()


class _Run:
    """One call: what was found so far, and the limits."""

    def __init__(
        self,
        starts: Starts,
        count: int,
        limits: SearchLimits,
        jobs: int,
        state: dict[str, Any] | None,
        on_progress: OnStep | None,
    ) -> None:
        self.starts, self.problem, self.count = starts, starts.problem, count
        self.limits, self.jobs, self.on_progress = limits, jobs, on_progress
        self.state = state
        self.pool: list[Certified] = []
        self.chosen: list[Certified] = []
        self.disproof: Disproof | None = None
        self.prover: Prover | None = None
        self.stop = Stop.TIME

    def search(self) -> None:
        """Until it is answered or a limit is hit; sets `stop`."""
        if not self.state:
            self._some_starts(FIRST_BLOCKS)
        if not self.pool:
            self._contradiction()
        if self.count == 1 and self.pool:
            self.stop = Stop.COMPLETE
        elif self.pool:
            self._several()

    def answer(self) -> Synthesis:
        """As far as it came."""
        found = self.chosen or self._differing()
        empty = self.disproof is not None and self.disproof.empty
        verdict = Reach.FOUND if found else Reach.NONE if empty else Reach.UNDECIDED
        task, starts = self.problem.task, self.starts
        state: dict[str, Any] = {}
        if verdict is Reach.UNDECIDED:
            prover = self.prover.save() if self.prover else self.state or {}
            mark = fingerprint(task_to_dict(task))
            state = {"fingerprint": mark, "seed": starts.seed, "block": starts.block, "prover": prover}
        return Synthesis(
            task,
            verdict,
            self.stop,
            time.monotonic() - self.limits.begin,
            starts.count,
            starts.unproved,
            tuple(Solution.of(task, c.existence(self.problem)) for c in found),
            _searched(self.disproof) if self.disproof else None,
            starts.seed,
            state,
        )

    # --- a first configuration, or that there is none ---

    def _some_starts(self, blocks: int) -> None:
        """Blocks of starts until one of them finds something."""
        for _ in range(blocks):
            self.pool += self.starts.run(1 if self.count == 1 else START_BLOCK)
            self._tell()
            if self.pool or self.limits.late:
                return

    def _contradiction(self) -> None:
        """The prover and more starts, in turns."""
        if self.limits.late:
            return
        from handfast.synthesis.search.prover import Prover

        prover, turn, last = Prover(self.problem, workers=self.jobs), 0.0, LAST_BLOCKS
        if self.state:
            _restore(prover, self.state)
        self.prover, begin = prover, prover.nodes
        while not self.pool:
            before = prover.nodes
            seconds, left = min(turn, self.limits.seconds_left), self.limits.nodes_left(before - begin)
            with nullcontext() if turn else self.limits.paused():  # the first turn compiles
                self.disproof = prover.run(seconds=seconds, nodes=left, on_progress=self._tell)
            if self.disproof.interrupted:
                raise KeyboardInterrupt
            last -= BETWEEN if prover.nodes == before else 0
            if self.disproof.empty:
                self.stop = Stop.COMPLETE
            elif self.limits.nodes_left(prover.nodes - begin) == 0:
                self.stop = Stop.NODES
            elif last <= 0:
                self.stop = Stop.RESOLUTION
            elif not self.limits.late:
                self.pool += self.starts.near(prover.leaves())
                if not self.pool:
                    self._some_starts(BETWEEN)
                turn = min(2 * turn, MAX_TURN_SECONDS) or FIRST_TURN_SECONDS
                continue
            return

    # --- several ---

    def _several(self) -> None:
        """`count` configurations that differ, from a pool; sets `chosen`."""
        wanted = max(POOL * self.count, SMALLEST_POOL)
        with self.limits.paused():  # it compiles
            walks = Walks(self.starts)
        for _ in range(POOL_DOUBLINGS):
            self._grow(walks, wanted)
            self.chosen = self._differing()
            if len(self.chosen) == self.count:
                self.stop = Stop.COMPLETE
                return
            if self.limits.late:
                return
            wanted *= 2
        self.stop = Stop.RESOLUTION

    def _differing(self) -> list[Certified]:
        """Those of the pool that differ most, at most `count`."""
        if self.count == 1 or not self.pool:
            return self.pool[:1]
        rows = np.array([c.x for c in self.pool]) * self.problem.lengths
        order = farthest(features_of(self.problem.task, rows), self.count)
        return [self.pool[i] for i in order]

    def _grow(self, walks: Walks, wanted: int) -> None:
        """Fill the pool, by halves from random starts and from steps, as long as there is time."""
        blocks = rounds = 2 * -(-wanted // START_BLOCK)
        while len(self.pool) < wanted / 2 and blocks and not self.limits.late:
            self.pool += self.starts.run()
            self._tell(wanted=wanted)
            blocks -= 1
        while len(self.pool) < wanted and rounds and not self.limits.late:
            self.pool += walks.run(self.pool)
            self._tell(wanted=wanted)
            rounds -= 1

    # --- limits and progress ---

    def _tell(self, disproof: Disproof | None = None, *, wanted: int = 1) -> None:
        if self.on_progress is None:
            return
        d = disproof or self.disproof
        far = (d.nodes, d.depth, d.pending, d.discarded) if d else ()
        self.on_progress(SynthesisProgress(self.starts.count, len(self.pool), wanted, *far))


def _refuse_numbers(count: int, seed: int, timeout: float | None, nodes: int | None, jobs: int) -> None:
    for name, value, least in (("count", count, 1), ("seed", seed, 0), ("jobs", jobs, 1), ("nodes", nodes, 1)):
        if value is not None and value < least:
            raise InputError(f"is {value}; a number from {least} on is needed", field=name)
    if timeout is not None and not timeout > 0:
        raise InputError(f"is {timeout:g} s; a positive number is needed", field="timeout")


def _state_of(task: Task, resume: Synthesis | str | Path) -> Mapping[str, Any]:
    """The state to go on from; `InputError` if there is none for this task."""
    source = None
    if not isinstance(resume, Synthesis):
        from handfast.synthesis.synthesis_file import load_synthesis

        source, resume = str(resume), load_synthesis(resume)
    if resume.verdict is not Reach.UNDECIDED:
        problem = f"is answered, {resume.verdict.upper()}; only an UNDECIDED one can go on"
        raise InputError(problem, source=source, field="resume")
    if resume.state.get("fingerprint") != fingerprint(task_to_dict(task)):
        problem = "is of another task: its hand, limits, bounds or regions differ from this one's"
        raise InputError(problem, source=source, field="resume")
    return resume.state


def _restore(prover: Prover, state: dict[str, Any]) -> None:
    try:
        prover.restore(state)
    except InputError as fault:
        raise InputError(fault.problem, field=f"resume.{fault.field or 'state'}") from None


def _searched(d: Disproof) -> Searched:
    # shares add up to 1 but for rounding where what is left is tiny
    discarded = d.discarded if d.empty else min(d.discarded, float(np.nextafter(1.0, 0.0)))
    return Searched(d.by, d.nodes, discarded, d.depth, d.pending, d.smallest, d.largest)
