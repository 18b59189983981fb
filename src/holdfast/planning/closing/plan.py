"""Plan grasps: many random starts, closed and judged on all cores, until enough that differ hold their loads."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from holdfast.answer import Stop, Verdict, header
from holdfast.body import Body
from holdfast.errors import InputError
from holdfast.hand.model import Hand
from holdfast.planning.closing.attempt import Attempts, Fate, Held, Runner
from holdfast.planning.closing.distinct import difference, most_different
from holdfast.planning.closing.palm_poses import STANDARD, Sampling, palm_of
from holdfast.stability.loads import Loads
from holdfast.stability.many import START, default_jobs
from holdfast.stability.settings import Settings

OnAttempt = Callable[[int, int], None]  # attempts done, grasps kept
WAIT = 0.2  # [s] between looks at the clock


@dataclass(frozen=True, eq=False)
class Plan:
    """The grasps that were found, and what became of the other attempts.

    Attributes:
        hand, body, loads: as asked; count: how many grasps were asked for. seed: of the attempts.
        grasps: those that hold every load and differ from each other, in the order in which they were found;
            with a `pool` the one farthest from the others next.
        fates: how many attempts ended how, every `Fate` in order; the sum is `tried`.
        stop: COMPLETE; TIME, NODES (the attempts were used up) or INTERRUPTED if fewer were found.
        seconds: wall time.
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

    @property
    def tried(self) -> int:
        """Number of attempts."""
        return sum(self.fates.values())

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
            "grasps": [
                {
                    "attempt": g.index,
                    "contacts": g.grasp.m,
                    "links": sorted({c.link for c in g.grasp.contacts}),
                    "preload": g.grasp.preload,
                    "penetration": g.penetration,
                    "self_penetration": g.self_penetration,
                    "residual": max(a.witness.residuals.worst for a in g.answer.checks if a.witness),
                }
                for g in self.grasps
            ],
        }


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
        on_attempt: called with (attempts done, grasps kept).

    Raises:
        InputError: the mass is unknown and no loads are given, no joint that closes, a count, a time or a
            number of attempts that is not positive, and whatever `hold` raises.
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
    kept: list[Held] = []
    fates: Counter[Fate] = Counter()
    stop = Stop.NODES
    outcomes = _outcomes(asked, attempts, jobs or default_jobs(), begin + timeout)
    try:
        for outcome in outcomes:
            if outcome is None:
                stop = Stop.TIME
                break
            fate, held = outcome
            if held and any(difference(held, other, prismatic) < 1 for other in kept):
                fate = Fate.ALIKE
            elif held:
                kept.append(held)
            fates[fate] += 1
            if on_attempt:
                on_attempt(fates.total(), len(kept))
            if len(kept) >= wanted:
                break
    except KeyboardInterrupt:
        stop = Stop.INTERRUPTED
    finally:
        outcomes.close()
    chosen = most_different(kept, count, prismatic) if len(kept) > count else kept
    stop = Stop.COMPLETE if len(chosen) >= count else stop
    seconds = time.monotonic() - begin
    table = {fate: fates[fate] for fate in Fate}
    return Plan(hand, body, loads, count, seed, tuple(chosen), table, stop, seconds)


# --- many attempts ------------------------------------------------------------------------------

Outcome = tuple[Fate, Held | None]
_runner: Runner | None = None  # one a process


def _outcomes(asked: Attempts, attempts: int, jobs: int, end: float) -> Generator[Outcome | None, None, None]:
    """The outcomes of the attempts in order; None once the time is up."""
    if jobs <= 1 or START != "fork":
        runner = asked.begin()
        for i in range(attempts):
            if time.monotonic() >= end:
                yield None
                return
            yield _light(runner.run(i))
        return
    # workers leave Ctrl-C to the parent, which then ends them
    with multiprocessing.get_context(START).Pool(jobs, initializer=_begin, initargs=(asked,)) as workers:
        outcomes = workers.imap(_attempt, range(attempts))
        for _ in range(attempts):
            while True:
                if time.monotonic() >= end:
                    yield None
                    return
                try:
                    yield outcomes.next(timeout=WAIT)
                    break
                except multiprocessing.TimeoutError:
                    continue


def _begin(asked: Attempts) -> None:
    global _runner
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
