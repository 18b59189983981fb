"""Algorithm 1 as the method of a query: the paper's, kept as the reference for the engine.

Every relaxation's result is tried as the start of an exact one, so a value is witnessed here too; bounds
rest on the mixed-integer solver's word.
"""

from __future__ import annotations

import time

from handfast.core.answer import Stop
from handfast.papers import algorithm1
from handfast.stability.goal import INF, NEAR_END, Goal
from handfast.stability.refinement import RefinementStep, SolverStatus
from handfast.stability.scaled_problem import ScaledPoint, ScaledProblem
from handfast.stability.search import exact
from handfast.stability.search.outcome import Outcome
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.settings import OnStep, Progress, Settings
from handfast.stability.witness import Witness

MODE_TOLERANCES = (1e-6, 1e-4, 1e-2)  # (scaled) below which a motion or force is tried as zero
STOPS = {
    SolverStatus.OPTIMAL: Stop.COMPLETE,
    SolverStatus.INFEASIBLE: Stop.COMPLETE,
    SolverStatus.UNBOUNDED: Stop.COMPLETE,
    SolverStatus.TIME: Stop.TIME,
    SolverStatus.INTERRUPTED: Stop.INTERRUPTED,
    SolverStatus.FAILED: Stop.NUMERICAL,
}


def search(p: ScaledProblem, goal: Goal, settings: Settings, on_step: OnStep | None = None) -> Outcome:
    """Refine by Algorithm 1 until value and bound are as near as asked; Ctrl-C leaves what was reached."""
    start = time.monotonic()
    r = reduce(p, goal)
    end = float(r.lo[0]) if goal.has_direction else -INF  # of the search
    last = end + NEAR_END * abs(end) if end > -INF else -INF
    found: Witness | None = None
    value, bound = INF, -INF
    steps: list[RefinementStep] = []
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
            if step.result.status is SolverStatus.INFEASIBLE:
                bound = INF
            elif goal.has_scalar and step.bound > last:
                bound = max(bound, step.bound)
            if step.point is not None:
                at_end = end > -INF and goal.objective(step.point.scalar) <= last
                hit = find(r, step.point, hold=True) if at_end else None
                hit = hit or find(r, step.point)
                if hit and end > -INF and goal.objective(hit[1].scalar) < end:  # past it: is there one right there?
                    hit = find(r, hit[1], hold=True)
                if hit:
                    achieved = goal.achieved(hit[0], hit[1].scalar)
                    if achieved < value:
                        value, found = achieved, hit[0]
            if on_step:
                on_step(Progress(*goal.bounds(p, value, bound), sum(s.result.nodes for s in steps), step))
            if ((found and not goal.has_scalar) or value <= last or goal.near(value, bound, settings.gap)) and (
                not settings.as_printed
            ):
                break
    except KeyboardInterrupt:
        interrupted = True
    stop = Stop.INTERRUPTED if interrupted or not steps else STOPS[steps[-1].result.status]
    done = value <= last or goal.near(value, bound, settings.gap) or (found is not None and not goal.has_scalar)
    if (bound == INF and found is None) or done:
        stop = Stop.COMPLETE
    elif stop is Stop.COMPLETE:
        stop = Stop.RESOLUTION
    seconds, nodes = time.monotonic() - start, sum(s.result.nodes for s in steps)
    if bound == INF:  # no state at all: whatever an earlier step seemed to find
        value, found = INF, None
    bound = min(bound, value)  # it holds within the motion cap, which Newton's method may leave
    return Outcome(value, bound, found, stop, seconds, nodes, tuple(steps))


def find(r: Reduced, start: ScaledPoint, *, hold: bool = False) -> tuple[Witness, ScaledPoint] | None:
    """A valid witness near a relaxation's solution, with its scaled point; None if Newton finds none.

    hold: at the end of the search for a maximum.
    """
    for tol in MODE_TOLERANCES:
        z = exact.solve(r, r.z(start), tolerance=tol, hold=hold)
        if z is None:
            continue
        x = r.point(z)
        witness = r.witness(x)
        if witness.valid:
            return witness, x
    return None
