"""Maxima of many disturbances at once, on all cores, each helped by its neighbour.

Consecutive cases of one grasp share the reduced problem, and each search begins with the solution and the tree before
it (`search/neighbour`). Cores work in processes, for half of an easy case is Python; in threads where processes cannot
be forked or few cases do not pay for them: the engine's kernel holds no interpreter lock.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Event
from typing import Any

import numpy as np

from handfast.core import parallel
from handfast.core.answer import Stop
from handfast.core.arrays import Array
from handfast.core.parallel import WorkerPool, default_jobs
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.goal import SMALLEST_PRELOAD
from handfast.stability.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.queries.max_query import MaxAnswer, largest, max_goal, with_interval
from handfast.stability.scaled_problem import ScaledProblem
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.search.warm_start import WarmStart
from handfast.stability.settings import Settings

OnItem = Callable[[int, int], None]  # done, total
BLOCK = 30  # cases that a worker takes at a time: neighbours
FEW = 60  # cases for which no process is made


@dataclass(frozen=True, eq=False)
class Case:
    """One maximum: of which grasp, in which direction (6,), above which base load (6,)."""

    grasp: Grasp
    direction: Array
    base: Array


@dataclass(frozen=True, eq=False)
class Options:
    """What all cases share, as in `maximum`; proofs: are witnesses, states and certificates wanted, too?"""

    limits: GraspLimits = NO_LIMITS
    mdp: bool = True
    settings: Settings | None = None
    proofs: bool = True
    interval: bool = False

    @property
    def algorithm1(self) -> bool:
        """Is it Algorithm 1 that is asked?"""
        return self.settings is not None and self.settings.method == "algorithm1"

    @property
    def gap(self) -> float:
        """Relative distance of the two bounds at which a number is exact enough."""
        return (self.settings or Settings()).gap

    def to_json(self) -> dict[str, Any]:
        """What was asked, as files of answers have it beside the grasp."""
        return self.limits.to_json() | {"mdp": self.mdp, "gap": self.gap}

    def build(self, case: Case) -> ScaledProblem:
        return scaled_problem.build(case.grasp, case.base, case.direction, limits=self.limits, mdp=self.mdp)


def max_answers(
    grasp: Grasp,
    directions: Sequence[Sequence[float]] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: Settings | None = None,
    jobs: int | None = None,
    on_item: OnItem | None = None,
) -> list[MaxAnswer | None]:
    """`maximum` in many directions; faster than one by one, in particular if neighbours follow each other.

    Args:
        directions: (n, 6) forces [N] and torques [N m], or (n, 3) forces.
        jobs: cores to use; by default all.
        on_item: called with (done, total).

    The other arguments and errors are those of `maximum`.

    Returns:
        One answer per direction, in order; None where Ctrl-C came first.
    """
    options = Options(limits, mdp, settings)
    w0 = np.zeros(6) if base is None else scaled_problem.as_wrench(base, "base")
    towards = [scaled_problem.as_wrench(d, "direction") for d in np.atleast_2d(np.asarray(directions, float))]
    return maxima([Case(grasp, d, w0) for d in towards], options, jobs, on_item)


def maxima(
    cases: Sequence[Case], options: Options, jobs: int | None = None, on_item: OnItem | None = None
) -> list[MaxAnswer | None]:
    """One answer per case, in order; None from the first one that Ctrl-C prevented."""
    if cases:
        options.build(cases[0])  # bad input's one line is raised here, not in a worker
    forked = parallel.START == "fork" and (options.algorithm1 or len(cases) > FEW)
    if options.algorithm1 and not forked:  # its solvers are not for threads
        jobs = 1
    size = 1 if options.algorithm1 else BLOCK  # its cases take long, and no neighbour helps
    blocks = [cases[i : i + size] for i in range(0, len(cases), size)]
    stopped = Event()
    done: list[MaxAnswer | None] = []
    jobs = min(jobs or default_jobs(), max(len(cases), 1))
    with WorkerPool((options, stopped), jobs, threads=not forked) as pool:
        try:
            for answers in pool.map(_sent if pool.forked else _block, blocks):
                for answer in answers:
                    done.append(answer)
                    if on_item:
                        on_item(len(done), len(cases))
                    if answer.stop is Stop.INTERRUPTED:  # Ctrl-C during a solve ends in an answer
                        raise KeyboardInterrupt
        except KeyboardInterrupt:
            pass
        finally:
            stopped.set()
    return done + [None] * (len(cases) - len(done))


def _block(shared: tuple[Options, Event], cases: Sequence[Case]) -> list[MaxAnswer]:
    """Cases in turn, each with what the one before left, until it is stopped."""
    options, stopped = shared
    settings = options.settings or Settings()
    # cores are for cases; a map keeps no proofs, and replays none
    settings = replace(settings, workers=1, verify=settings.verify and options.proofs)
    out: list[MaxAnswer] = []
    last: Case | None = None
    p: ScaledProblem | None = None
    reduced: Reduced | None = None
    before: WarmStart | None = None
    for case in cases:
        if stopped.is_set():
            break
        same = last is not None and last.grasp is case.grasp and last.base is case.base
        p = p.towards(case.direction) if same and p is not None else options.build(case)
        hints: dict[str, Any] = {}
        if settings.method == "engine" and max_goal(p) == SMALLEST_PRELOAD:
            reduced = reduced.redirected(p) if same and reduced is not None else reduce(p, SMALLEST_PRELOAD)
            hints = {"reduced": reduced, "before": before if same else None}
        else:
            reduced = None
        answer = largest(p, settings, None, **hints)
        before = _left(answer, before if same else None)
        last = case
        out.append(with_interval(answer, settings) if options.interval else answer)
        if out[-1].stop is Stop.INTERRUPTED:
            break
    return out


def _left(answer: MaxAnswer, before: WarmStart | None) -> WarmStart | None:
    """What an answer leaves to its neighbour."""
    if answer.point is None:
        return None
    points = (answer.point, before.points[0]) if before else (answer.point,)
    closed = answer.proof is not None and answer.stop is Stop.COMPLETE
    return WarmStart(points, answer.unbounded, answer.proof.pool if closed and answer.proof else None)


def _sent(shared: tuple[Options, Event], cases: Sequence[Case]) -> list[MaxAnswer]:
    """The answers without what nobody asks for and the history of Algorithm 1: a thousand travel between processes."""
    proofs = shared[0].proofs
    left: dict[str, Any] = {"steps": ()} | (
        {} if proofs else {"found": None, "proof": None, "posed": None, "point": None}
    )
    answers = [replace(answer, **left) for answer in _block(shared, cases)]
    if proofs:
        return answers
    return [a if a.interval is None else replace(a, interval=replace(a.interval, arcs=(), slips=())) for a in answers]
