"""Plan grasps: many random starts, closed and evaluated on all cores, until enough that differ hold their loads."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from handfast.core.answer import Stop
from handfast.core.errors import InputError, kinds_checked
from handfast.core.parallel import Workers, workers_of
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.planning.evaluation.attempt import Attempts, PlannedGrasp, Runner
from handfast.planning.question import PlanOptions, compared, link_pairs, refuse_another, refuse_no_cone
from handfast.planning.ranking import best_first, difference, most_different
from handfast.planning.results.plan import Plan
from handfast.planning.search import Gathering, Journal, fruitless
from handfast.stability.problem.loads import Loads

START_FACTOR = 4  # times the starts that as many grasps took as asked for: so long robust ones are looked for


@kinds_checked
def plan(
    hand: Hand,
    body: Body,
    *,
    loads: Loads | None = None,
    options: PlanOptions | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    journal: Journal[Plan] | None = None,
    **changes: Any,
) -> Plan:
    """Grasps of a hand on an object that hold every load under one preload, and differ from each other.

    The palm is put before a random point of the surface, pushed up, stepped back, and the fingers close. What
    touches with two fingers or more (or one and the palm), overlaps nowhere by more than 1 mm and passes
    `hold` for the loads is kept, unless it is like one that was kept (see `ranking.difference`). Attempts
    are numbered: the same seed gives the same grasps whatever the number of cores, as far as the time goes.
    Where it is shown that so few contacts as allowed cannot hold, wherever on the surface they are, nothing is tried.
    Robust grasps are looked for: until there are as many as asked for, or `START_FACTOR` times the starts were tried
    that so many of any kind took; fragile ones fill up what is missing then. The best come first: see
    `ranking.best_first`. A heuristic: what it does not find may exist.

    Args:
        loads: what each grasp must hold, `options.safety` times; the weight from all six axis directions of the object
            if absent.
        options: see `PlanOptions`.
        jobs: processes; by default one per core.
        scheduler: address of a Dask scheduler, whose workers take the place of processes here.
        journal: hears of the plan so far after each attempt. It may give a plan that was cut short, to go on from;
            `attempts` are counted from its first.
        changes: options by name, in place of those of `options`: `plan(hand, body, count=5, seed=1)`.

    Raises:
        InputError: the mass is unknown and no loads are given, loads that are all zero, no joint that closes, options
            that are out of range, an ignored link that the hand does not have, an object a hundred times larger or
            smaller than the hand, an earlier plan of another question, and whatever `hold` raises.
    """
    o, journal = replace(options or PlanOptions(), **changes), journal or Journal()
    compared(hand, body)
    refuse_no_cone(body.friction, o.torsion)
    o.limits.refuse_unknown(hand)
    loads = Loads.gravity(body) if loads is None else loads
    if not loads.wrenches.any():
        raise InputError("are all zero; a force or torque to hold is needed", field="loads")
    asked = Attempts(hand, body, loads.scaled(o.safety), replace(o, ignored=link_pairs(hand, o.ignored)))
    begin, question = time.monotonic(), asked.question
    before = journal.earlier(asked)
    if before:
        refuse_another(before.question, question)
    first: float | None = before.first if before else None
    prismatic = np.array([j.type == "prismatic" for j in hand.joints])

    def alike(a: PlannedGrasp, b: PlannedGrasp) -> bool:
        return difference(a, b, prismatic) < 1

    wanted = max(o.count, o.pool or 0)
    gathered = Gathering(o.attempts, alike, *((before.tally, before.found) if before else ()))

    def so_far(stop: Stop, chosen: list[PlannedGrasp]) -> Plan:
        chosen = best_first(chosen)
        others = tuple(g for g in gathered.kept if g not in chosen)
        return Plan(asked, o.count, tuple(chosen), gathered.tally.copy(), stop, spent(), question, others, first)

    def spent() -> float:
        return time.monotonic() - begin + (before.seconds if before else 0.0)

    def done() -> bool:
        kept = gathered.kept
        if fruitless(gathered.tally, o.give_up) or sum(g.robust for g in kept) >= wanted:
            return True
        return len(kept) >= wanted and gathered.tally.total >= START_FACTOR * (
            sorted(g.index for g in kept)[wanted - 1] + 1
        )

    def measure(workers: Workers[Runner]) -> None:
        bare = [(k, g) for k, g in enumerate(gathered.kept) if g.quality is None]
        found = workers.map(Runner.measured, [g for _, g in bare], until=end)
        for (k, _), g in zip(bare, found, strict=False):  # fewer where the time is up
            gathered.kept[k] = g

    if asked.impossible:
        answer = so_far(Stop.COMPLETE, [])
        journal.close(answer)
        return answer
    end, stop = np.inf if o.timeout is None else begin + o.timeout, Stop.NODES
    try:
        with workers_of(Runner(asked, end), jobs, scheduler) as workers:
            numbers = range(gathered.tally.total, o.attempts)
            measure(workers)
            units = iter(()) if done() else workers.map(Runner.run, numbers, until=end)
            for unit in units:
                new = gathered.take(unit)
                first = spent() if new and first is None else first
                journal.note(so_far(Stop.INTERRUPTED, best_first(gathered.kept)[: o.count]), new=new)
                if done():
                    break
            else:
                stop = Stop.TIME if time.monotonic() >= end else Stop.NODES
            stop = Stop.FRUITLESS if fruitless(gathered.tally, o.give_up) else stop
    except KeyboardInterrupt:
        stop = Stop.INTERRUPTED
    best = best_first(gathered.kept)
    robust = [g for g in best if g.robust]
    best = robust if len(robust) >= o.count else best[: o.count]
    chosen = most_different(best, o.count, prismatic) if o.pool else best[: o.count]
    answer = so_far(Stop.COMPLETE if len(chosen) >= o.count else stop, chosen)
    journal.close(answer)
    return answer
