"""Plan grasps: many random starts, closed and evaluated on all cores, until enough that differ hold their loads."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np

from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.core.parallel import WorkerPool, default_jobs
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.planning.candidates.palm_poses import STANDARD, Sampling, palm_of
from handfast.planning.evaluation.attempt import Attempts, PlannedGrasp, Runner
from handfast.planning.fruitless import GIVE_UP, fruitless
from handfast.planning.gathering import Gathering
from handfast.planning.journal import Journal
from handfast.planning.question import refuse_another, refuse_negative
from handfast.planning.ranking.distinct import difference, most_different
from handfast.planning.requirements import Limits, link_pairs
from handfast.planning.results.planned import Plan
from handfast.planning.sizes import compared
from handfast.stability.loads import Loads


def plan(  # each argument is an option of the command line
    hand: Hand,
    body: Body,
    *,
    count: int = 20,
    loads: Loads | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    timeout: float = 300.0,
    attempts: int = 100_000,
    pool: int | None = None,
    sampling: Sampling = STANDARD,
    jobs: int | None = None,
    journal: Journal[Plan] | None = None,
    ignored: Sequence[tuple[str, str]] = (),
    give_up: int = GIVE_UP,
) -> Plan:
    """Grasps of a hand on an object that hold every load under one preload, and differ from each other.

    The palm is put before a random point of the surface, pushed up, stepped back, and the fingers close. What
    touches with two fingers or more (or one and the palm), overlaps nowhere by more than 1 mm and passes
    `hold` for the loads is kept, unless it is like one that was kept (see `distinct.difference`). Attempts
    are numbered: the same seed gives the same grasps whatever the number of cores, as far as the time goes.
    A heuristic: what it does not find may exist.

    Args:
        count: grasps asked for.
        loads: what each must hold; the weight from all six axis directions of the object if absent.
        limits: of commands and forces, see `Attempts`. By default a query has some hundred to thousand nodes, so that
            the outcome does not hang on the clock (but no grasp is thought about for more than 30 s).
        timeout: [s] wall time. attempts: largest number of attempts.
        pool: gather so many that differ, then return the `count` that differ most.
        sampling: how the starts are drawn.
        jobs: processes; by default one per core.
        ignored: pairs of links, by name, that may overlap: where the collision shapes do and the real links do not.
        give_up: the search ends after so many attempts of which none came through the filters, or after three tenths
            of these if one reason rejected all of them.
        journal: hears of the plan so far after each attempt. It may give a plan that was cut short, to go on from;
            `attempts` are counted from its first.

    Raises:
        InputError: the mass is unknown and no loads are given, loads that are all zero, no joint that closes, a count,
            a time or a number of attempts that is not positive, a negative seed, an ignored link that the hand does
            not have, an object a hundred times larger or smaller than the hand, an earlier plan of another question,
            and whatever `hold` raises.
    """
    limits, journal = limits or Limits(), journal or Journal()
    _refuse_no_positive(
        {"count": count, "timeout": timeout, "attempts": attempts, "give_up": give_up}
        | {"command_limit": limits.command_limit, "pool": pool}
    )
    refuse_negative(seed)
    compared(hand, body)
    loads = Loads.gravity(body) if loads is None else loads
    if not loads.wrenches.any():
        raise InputError("are all zero; a force or torque to hold is needed", field="loads")
    pairs = link_pairs(hand, ignored)
    asked = Attempts(hand, body, palm_of(hand, sampling.approach), loads, seed, limits, sampling, pairs)
    begin, question = time.monotonic(), asked.question
    before = journal.earlier(asked)
    if before:
        refuse_another(before.question, question)
    prismatic = np.array([j.type == "prismatic" for j in hand.joints])

    def alike(a: PlannedGrasp, b: PlannedGrasp) -> bool:
        return difference(a, b, prismatic) < 1

    gathered = Gathering(max(count, pool or 0), alike, *((before.tally, before.found) if before else ()))

    def so_far(stop: Stop, chosen: list[PlannedGrasp]) -> Plan:
        seconds = time.monotonic() - begin + (before.seconds if before else 0.0)
        others = tuple(g for g in gathered.kept if g not in chosen)
        return Plan(asked, count, tuple(chosen), gathered.tally.copy(), stop, seconds, question, others)

    end, stop = begin + timeout, Stop.NODES
    try:
        with WorkerPool(Runner(asked), jobs or default_jobs()) as workers:
            numbers = range(gathered.tally.total, attempts)
            done = gathered.enough or fruitless(gathered.tally, give_up)
            units = iter(()) if done else workers.map(Runner.run, numbers, until=end)
            for unit in units:
                new = gathered.take(unit)
                journal.note(so_far(Stop.INTERRUPTED, gathered.kept), new=new)
                if gathered.enough or fruitless(gathered.tally, give_up):
                    break
            else:
                stop = Stop.TIME if time.monotonic() >= end else Stop.NODES
            stop = Stop.FRUITLESS if fruitless(gathered.tally, give_up) else stop
    except KeyboardInterrupt:
        stop = Stop.INTERRUPTED
    chosen = most_different(gathered.kept, count, prismatic) if len(gathered.kept) > count else gathered.kept
    answer = so_far(Stop.COMPLETE if len(chosen) >= count else stop, chosen)
    journal.close(answer)
    return answer


def _refuse_no_positive(numbers: Mapping[str, float | None]) -> None:
    for name, value in numbers.items():
        if value is not None and not value > 0:
            raise InputError(f"is {value:g}; a positive number is needed", field=name)
