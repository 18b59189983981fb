"""Algorithm 1 as the method of a query: the paper's, kept as the reference for the engine.

Every relaxation's solution is tried as the start of an exact one, so a value is witnessed here too; bounds
rest on the mixed-integer solver's word.
"""

from __future__ import annotations

import time

import numpy as np

from handfast.core.answer import Stop
from handfast.stability.goal import NEAR_END, Goal, Point, interval
from handfast.stability.outcome import INF, Outcome
from handfast.stability.paper import algorithm1
from handfast.stability.paper.algorithm1 import Step
from handfast.stability.paper.program import Status
from handfast.stability.problem import Problem
from handfast.stability.search import exact
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.settings import OnStep, Progress, Settings
from handfast.stability.witness import Witness, as_witness

MODE_TOLERANCES = (1e-6, 1e-4, 1e-2)  # (scaled) below which a motion or force is tried as zero
STOPS = {
    Status.OPTIMAL: Stop.COMPLETE,
    Status.INFEASIBLE: Stop.COMPLETE,
    Status.UNBOUNDED: Stop.COMPLETE,
    Status.TIME: Stop.TIME,
    Status.INTERRUPTED: Stop.INTERRUPTED,
    Status.FAILED: Stop.NUMERICAL,
}


def search(p: Problem, goal: Goal, settings: Settings, on_step: OnStep | None = None) -> Outcome:
    """Refine by Algorithm 1 until value and bound are as near as asked; Ctrl-C leaves what was reached."""
    start = time.monotonic()
    r = reduce(p, goal)
    end = float(r.lo[0]) if goal in (Goal.SMALLEST_PRELOAD, Goal.LARGEST) else -INF  # of the search
    last = end + NEAR_END * abs(end) if end > -INF else -INF
    found: Witness | None = None
    value, bound = INF, -INF
    steps: list[Step] = []
    interrupted = False
    run = algorithm1.run(
        p,
        goal,
        q=settings.q,
        solver=settings.solver,
        full=settings.full,
        printed_robustness=settings.as_printed,
        time_limit=settings.time_limit,
    )
    try:
        for step in run:
            steps.append(step)
            if step.solution.status is Status.INFEASIBLE:
                bound = INF
            elif goal is not Goal.EXISTS and step.bound > last:
                bound = max(bound, step.bound)
            if step.point is not None:
                at_end = end > -INF and _cost(goal, step.point) <= last
                hit = find(r, step.point, hold=True) if at_end else None
                hit = hit or find(r, step.point)
                if hit and end > -INF and _cost(goal, hit[1]) < end:  # past it: is there one right there?
                    hit = find(r, hit[1], hold=True)
                if hit:
                    achieved = _achieved(goal, *hit)
                    if achieved < value:
                        value, found = achieved, hit[0]
            if on_step:
                on_step(Progress(*interval(p, goal, value, bound), sum(s.solution.nodes for s in steps), step))
            if ((goal is Goal.EXISTS and found) or value <= last or _near(goal, value, bound, settings.gap)) and (
                not settings.as_printed
            ):
                break
    except KeyboardInterrupt:
        interrupted = True
    stop = Stop.INTERRUPTED if interrupted or not steps else STOPS[steps[-1].solution.status]
    done = value <= last or _near(goal, value, bound, settings.gap) or (goal is Goal.EXISTS and found is not None)
    if (bound == INF and found is None) or done:
        stop = Stop.COMPLETE
    elif stop is Stop.COMPLETE:
        stop = Stop.RESOLUTION
    seconds, nodes = time.monotonic() - start, sum(s.solution.nodes for s in steps)
    if bound == INF:  # no state at all: whatever an earlier step seemed to find
        value, found = INF, None
    bound = min(bound, value)  # it holds within the motion cap, which Newton's method may leave
    return Outcome(value, bound, found, stop, seconds, nodes, tuple(steps))


def find(r: Reduced, start: Point, *, hold: bool = False) -> tuple[Witness, Point] | None:
    """A valid witness near a relaxation's solution, with its scaled point; None if Newton finds none.

    hold: at the end of the search for a maximum.
    """
    for tol in MODE_TOLERANCES:
        z = exact.solve(r, r.z(start), tolerance=tol, hold=hold)
        if z is None:
            continue
        x = r.point(z)
        witness = as_witness(r, x)
        if witness.valid:
            return witness, x
    return None


def _cost(goal: Goal, x: Point) -> float:
    return -x.sigma if goal is Goal.LARGEST else x.sigma


def _achieved(goal: Goal, w: Witness, x: Point) -> float:
    """The objective of an exact state."""
    if goal is Goal.EXISTS:
        return 0.0
    if goal is Goal.SMALLEST_MAX_TORQUE:
        return float(np.abs(w.grasp.command).max(initial=0.0))
    if goal is Goal.SMALLEST_SUM_TORQUE:
        return float(np.abs(w.grasp.command).sum())
    return _cost(goal, x)


def _near(goal: Goal, value: float, bound: float, gap: float) -> bool:
    """Are value and bound as near as asked, relative to the smaller magnitude, or the larger torque?"""
    if not np.isfinite(value) or goal is Goal.EXISTS:
        return False
    scale = abs(value) if goal is not Goal.SMALLEST_PRELOAD else abs(bound)
    return value - bound <= gap * scale + (1e-9 if goal is not Goal.SMALLEST_PRELOAD else 0.0)
