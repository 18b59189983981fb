"""Plan grasps: many random starts, closed and judged on all cores, until enough that differ hold their loads."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from handfast.core.answer import Stop, Verdict, header
from handfast.core.errors import InputError
from handfast.core.parallel import START, default_jobs
from handfast.core.parallel import end_with as serve
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.planning.candidates.palm_poses import STANDARD, Sampling, palm_of
from handfast.planning.evaluation.attempt import Attempts, Fate, Held, Runner
from handfast.planning.question import refuse_another
from handfast.planning.ranking.distinct import difference, most_different
from handfast.stability.loads import Loads
from handfast.stability.settings import Settings

WAIT = 0.2  # [s] between looks at the clock


@dataclass(frozen=True, eq=False)
class Plan:
    """The grasps that were found, and what became of the other attempts.

    Attributes:
        hand, body, loads: as asked; count: how many grasps were asked for. seed: of the attempts.
        grasps: those that hold every load and differ from each other, in the order in which they were found;
            with a `pool` the one farthest from the others next. others: of a pool, those that were left out.
        fates: how many attempts ended how, every `Fate` in order; the sum is `tried`.
        stop: COMPLETE; TIME, NODES (the attempts were used up) or INTERRUPTED if fewer were found.
        seconds: wall time.
        question: the fingerprint of what was asked, but for how many and how long.
    """

    hand: Hand
    body: Body
    loads: Loads
    count: int
    seed: int
    grasps: tuple[Held, ...]
    fates: dict[Fate, int]
    stop: Stop
    seconds: float
    question: str = ""
    others: tuple[Held, ...] = ()

    @property
    def tried(self) -> int:
        """Number of attempts."""
        return sum(self.fates.values())

    @property
    def found(self) -> list[Held]:
        """All that differ from each other, in the order in which they were found."""
        return sorted((*self.grasps, *self.others), key=lambda g: g.index)

    def number(self, grasp: Held) -> int:
        """Of one of those found, from 0."""
        return [g.index for g in self.found].index(grasp.index)

    @property
    def verdict(self) -> Verdict:
        """HOLDS if as many were found as asked for, else UNDECIDED: others may exist."""
        return Verdict.HOLDS if len(self.grasps) >= self.count else Verdict.UNDECIDED

    @property
    def nodes(self) -> int:
        """Of the searches that hold the grasps."""
        return sum(g.answer.nodes for g in self.grasps)

    def to_json(self) -> dict[str, Any]:
        """The keys that the command line prints and writes to plan.json, beside the files' names."""
        return header(self, "plan") | {
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
            "loads": self.loads.by_name,
            "tried": self.tried,
            "fates": {f.name.lower(): n for f, n in self.fates.items()},
            "question": self.question,
            "grasps": [_entry(g) for g in self.grasps],
            "others": [_entry(g) for g in self.others],
        }


def _entry(g: Held) -> dict[str, Any]:
    return {
        "attempt": g.index,
        "nodes": g.answer.nodes,
        "contacts": g.grasp.m,
        "links": sorted({c.link for c in g.grasp.contacts}),
        "preload": g.grasp.preload,
        "penetration": g.penetration,
        "self_penetration": g.self_penetration,
        "residual": max(a.witness.residuals.worst for a in g.answer.checks if a.witness),
    }


OnAttempt = Callable[[Plan], None]


def plan(
    hand: Hand,
    body: Body,
    *,
    count: int = 20,
    loads: Loads | None = None,
    seed: int = 0,
    timeout: float = 300.0,
    attempts: int = 100_000,
    pool: int | None = None,
    approach: object = None,
    command_limit: float | None = None,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    eta: float = 0.0,
    settings: Settings | None = None,
    sampling: Sampling | None = None,
    jobs: int | None = None,
    earlier: Callable[[Attempts], Plan | None] | None = None,
    on_attempt: OnAttempt | None = None,
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
        timeout: [s] wall time. attempts: largest number of attempts.
        pool: gather so many that differ, then return the `count` that differ most.
        approach: (3,) direction in which the palm approaches, hand's base frame; guessed if absent.
        command_limit: largest command [N m or N] of a kept grasp; ten times the largest load at the size of
            the grasp if absent.
        torque_limits: as in `check`, like force_limit and eta.
        settings: of each query; by default some hundred to thousand nodes, so that the outcome does not hang on
            the clock (but no grasp is thought about for more than 30 s).
        sampling: how the starts are drawn.
        jobs: processes; by default one per core.
        earlier: given what is asked, a plan that was cut short, to go on from; `attempts` are counted from its first.
        on_attempt: called after each with the plan so far.

    Raises:
        InputError: the mass is unknown and no loads are given, no joint that closes, a count, a time or a
            number of attempts that is not positive, an earlier plan of another question, and whatever `hold` raises.
    """
    limits = {"count": count, "timeout": timeout, "attempts": attempts, "command_limit": command_limit}
    for name, value in limits.items():
        if value is not None and not value > 0:
            raise InputError(f"is {value:g}; a positive number is needed", field=name)
    loads = Loads.gravity(body) if loads is None else loads
    asked = Attempts(
        hand,
        body,
        palm_of(hand, approach),
        loads,
        seed,
        command_limit,
        torque_limits,
        force_limit,
        eta,
        settings,
        sampling or STANDARD,
    )
    begin = time.monotonic()
    wanted = max(count, pool or 0)
    prismatic = np.array([j.type == "prismatic" for j in hand.joints])
    question = asked.question
    before = earlier(asked) if earlier else None
    if before:
        refuse_another(before.question, question)
    kept = before.found if before else []
    fates: Counter[Fate] = Counter(before.fates if before else {})

    def so_far(stop: Stop, chosen: list[Held]) -> Plan:
        seconds = time.monotonic() - begin + (before.seconds if before else 0.0)
        others = tuple(g for g in kept if g not in chosen)
        table = {fate: fates[fate] for fate in Fate}
        return Plan(hand, body, loads, count, seed, tuple(chosen), table, stop, seconds, question, others)

    stop = Stop.NODES
    outcomes = _outcomes(asked, range(fates.total(), attempts), jobs or default_jobs(), begin + timeout)
    try:
        while len(kept) < wanted:
            outcome = next(outcomes, Stop.NODES)
            if isinstance(outcome, Stop):
                stop = outcome
                break
            fate, held = outcome
            if held and any(difference(held, other, prismatic) < 1 for other in kept):
                fate = Fate.ALIKE
            elif held:
                kept.append(held)
            fates[fate] += 1
            if on_attempt:
                on_attempt(so_far(Stop.INTERRUPTED, kept))
    except KeyboardInterrupt:
        stop = Stop.INTERRUPTED
    finally:
        outcomes.close()
    chosen = most_different(kept, count, prismatic) if len(kept) > count else kept
    return so_far(Stop.COMPLETE if len(chosen) >= count else stop, chosen)


# --- many attempts ------------------------------------------------------------------------------

Outcome = tuple[Fate, Held | None]
_runner: Runner | None = None  # one a process


def _outcomes(
    asked: Attempts, numbers: range, jobs: int, end: float
) -> Generator[Outcome | Literal[Stop.TIME], None, None]:
    """The outcomes of the attempts of some numbers, in order; TIME once the time is up."""
    if jobs <= 1 or START != "fork":
        runner = asked.begin()
        for i in numbers:
            if time.monotonic() >= end:
                yield Stop.TIME
                return
            yield _light(runner.run(i))
        return
    with multiprocessing.get_context(START).Pool(jobs, _begin, (asked, os.getpid())) as workers:
        outcomes = workers.imap(_attempt, numbers)
        for _ in numbers:
            while True:
                if time.monotonic() >= end:
                    yield Stop.TIME
                    return
                try:
                    yield outcomes.next(timeout=WAIT)
                    break
                except multiprocessing.TimeoutError:
                    continue


def _begin(asked: Attempts, parent: int) -> None:
    global _runner
    serve(parent)
    _runner = asked.begin()


def _attempt(index: int) -> Outcome:
    assert _runner is not None
    return _light(_runner.run(index))


def _light(outcome: Outcome) -> Outcome:
    """Without the searches' histories: grasps travel between processes."""
    fate, held = outcome
    if held is None:
        return outcome
    checks = tuple(replace(a, steps=(), proof=None) for a in held.answer.checks)
    return fate, replace(held, answer=replace(held.answer, checks=checks))
