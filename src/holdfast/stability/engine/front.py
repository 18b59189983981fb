"""The engine as the method of a query: reduce, search, judge the witness."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from holdfast.answer import Stop
from holdfast.mechanism import Array
from holdfast.stability import witness
from holdfast.stability.engine.neighbour import Neighbour
from holdfast.stability.engine.proof import Proof
from holdfast.stability.engine.reduced import Reduced, reduce
from holdfast.stability.engine.search import Search
from holdfast.stability.goal import NEAR_END, Goal, interval
from holdfast.stability.outcome import INF, Outcome
from holdfast.stability.problem import Problem
from holdfast.stability.settings import OnStep, Progress, Settings, default_jobs

TINY = 1e-10  # magnitudes, in other forces in play, that count as none
ZERO = 1e-9  # [N m or N] torques below this count as none
FINER = 1e-4, 1e-5, 1e-6  # what a search leaves unresolved is tried with smaller gaps in turn,
LEAST = 1e-3  # [s] in the time that is left, or this
PAUSE = 0.05  # [s] between two reports of progress


def search(
    p: Problem,
    goal: Goal,
    settings: Settings,
    on_step: OnStep | None = None,
    *,
    reduced: Reduced | None = None,
    guess: Sequence[Array] = (),
    before: Neighbour | None = None,
) -> Outcome:
    """Branch and bound until value and bound are as near as asked; Ctrl-C leaves what was reached.

    Args:
        reduced: the reduced problem, if it is known already.
        guess: reduced points (n,) to start Newton from.
        before: what the question before this one left; it wants `reduced`.
    """
    start = time.monotonic()
    r = reduced or reduce(p, goal, settings.motion_cap)
    out = _search(p, goal, settings, on_step, r, guess, before)
    if out.stop is Stop.NUMERICAL and before is not None:
        # Newton is tried where a leaf is made, not where it opens again: from the root, then
        out = _search(p, goal, settings, on_step, r)
    for gap in (g for g in FINER if g < settings.gap):  # the tolerances of programs go with the gap
        left = max(settings.time_limit - (time.monotonic() - start), LEAST)
        nodes = settings.node_limit - out.nodes
        if out.stop is not Stop.NUMERICAL or nodes <= 0:
            break
        finer = replace(settings, gap=gap, time_limit=left, node_limit=nodes)
        out = _better(out, _search(p, goal, finer, on_step, r, guess))
    return replace(out, seconds=time.monotonic() - start)


def _better(a: Outcome, b: Outcome) -> Outcome:
    """What two searches of the same question, the second more finely, have shown together."""
    nodes = a.nodes + b.nodes
    if b.stop is Stop.COMPLETE:
        return replace(b, nodes=nodes)
    low, high = (b if b.value <= a.value else a), (b if b.bound >= a.bound else a)
    return replace(low, bound=high.bound, proof=high.proof, stop=b.stop, nodes=nodes)


def _search(
    p: Problem,
    goal: Goal,
    settings: Settings,
    on_step: OnStep | None,
    r: Reduced,
    guess: Sequence[Array] = (),
    before: Neighbour | None = None,
) -> Outcome:
    """One search."""
    start = time.monotonic()
    gap = settings.gap * (1 - 1e-5)  # leaves room for rounding
    if goal is Goal.SMALLEST_PRELOAD:
        gap /= 1 + gap
    s = Search(
        r,
        gap=gap,
        gap_absolute=(0.0 if goal is Goal.SMALLEST_PRELOAD else TINY if goal is Goal.LARGEST else ZERO / r.scale),
        node_limit=settings.node_limit,
        time_limit=settings.time_limit,
        workers=settings.workers or default_jobs(),
        guess=guess,
    )
    if before is not None:
        before.start(s)
    try:
        shown, bound = start, -INF
        for state in s:
            if on_step and (state.stop or time.monotonic() - shown > PAUSE):
                shown = time.monotonic()
                bound = min(max(bound, state.bound), state.best)  # the end is proved to the gap only, points say more
                on_step(Progress(*interval(p, goal, state.best * r.scale, bound * r.scale), state.nodes))
    except KeyboardInterrupt:
        s.stop = Stop.INTERRUPTED
    stop = s.stop or Stop.INTERRUPTED
    found = None if s.z is None else witness.as_witness(r, r.point(s.z))
    refused = found is not None and not found.valid
    if refused:  # the judge has the last word; everything the search cut off by it is open again
        return Outcome(INF, -INF, None, Stop.NUMERICAL, time.monotonic() - start, s.nodes)
    torques = goal in (Goal.SMALLEST_MAX_TORQUE, Goal.SMALLEST_SUM_TORQUE)
    value = s.best * r.scale
    shown = float(s.hi[0]) if found else INF
    bound = r.scale * (shown if stop is Stop.COMPLETE else s.close())
    if goal is Goal.EXISTS:
        value, bound = (0.0, -INF) if found else (INF, bound)
    elif found and not torques and s.best <= r.lo[0] + NEAR_END * abs(r.lo[0]):
        bound = -INF  # unbounded, as far as the search goes
    proof = None
    if bound > -INF:
        s.trim()
        proof = Proof(r, s.pool, float(s.hi[0]))
    if torques:
        bound = max(bound, 0.0)
    return Outcome(value, bound, found, stop, time.monotonic() - start, s.nodes, proof=proof, point=s.z)
