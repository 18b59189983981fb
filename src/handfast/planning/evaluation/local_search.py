"""The unit of work of `grasp_for`: a few random starts, the best of them improved until they hold or are given up.

Units are numbered and independent: what one finds depends on the seed and its number alone, so that any number of
cores finds the same.
"""

from __future__ import annotations

import multiprocessing
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.core.parallel import START
from handfast.model.grasp import Contact, Grasp
from handfast.planning.evaluation.evaluator import Candidate, Judge, Reason, Steps
from handfast.planning.evaluation.refinement import Polish
from handfast.planning.results.search_file import Find
from handfast.stability.hold import HoldAnswer, hold, moderate
from handfast.stability.queries import check
from handfast.stability.settings import Settings
from handfast.synthesis.search.diverse import Walks
from handfast.synthesis.search.starts import BLOCK, Certified, Starts

RAW = 16  # certified random starts of a unit
CLIMBED = 3  # of them, those with the least cost are improved
STEPS = 40  # rounds of steps that one may take
PATIENCE = 6  # rounds without progress after which it is given up
AWAY = (0.02, 0.05, 0.1, 0.2)  # lengths of steps away from what penetrates, in the measure of `distance`
ANYWHERE = 0.2  # of the first steps in random directions; it adapts
LONGEST, SHORTEST = 0.6, 0.005
PROGRESS = 1e-4  # of the cost
EQUAL = 1e-9  # nothing is left to improve: another with nothing wrong will do
LEAST = 20.0  # [s] in which the least preload of one grasp is looked for
NEAR_MISSES = 6  # possible candidates of one climb that may fail to hold


@dataclass(frozen=True, eq=False)
class Unit:
    """What a unit of work came to.

    Attributes:
        number: of the unit.
        found: those that hold every load, with whether they were improved first.
        fates: what became of its starts.
        judged: candidates that were looked at. starts, unproved: of the local search.
        whole: was it done before the time was up?
    """

    number: int
    found: tuple[tuple[Certified, bool], ...]
    fates: Counter[Reason]
    judged: int
    starts: int
    unproved: int
    whole: bool


class Worker:
    """Runs units of one question; made once, then copied into every process."""

    def __init__(
        self,
        judge: Judge,
        seed: int,
        actuators: tuple[str, ...],
        limits: Mapping[str, Any],
        command_limit: float | None,
        settings: Settings,
    ) -> None:
        self.judge, self.seed, self.actuators = judge, seed, actuators
        self.limits, self.command_limit, self.settings = dict(limits), command_limit, settings
        self.starts = Starts(judge.problem, seed)
        self.walks = Walks(self.starts)
        self.end = np.inf  # of the monotonic clock
        self.stopped = multiprocessing.get_context(START).Event()  # shared by the copies

    def warm(self) -> None:
        """Compile what the units need, before the clock starts and before processes are made."""
        simple = Contact(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5)
        check(Grasp([simple]), [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])

    def run(self, number: int) -> Unit:
        """Unit `number`."""
        starts = self.starts
        starts.block, starts.count, starts.unproved = number, number * BLOCK, 0
        steps = Steps(self.judge, self.walks, np.random.default_rng([self.seed, number, 2]))
        polish, before = Polish(self.judge, steps), self.judge.judged
        raw = sorted(self.candidates(starts.run(RAW)), key=_cost)
        used = starts.count - number * BLOCK
        fates: Counter[Reason] = Counter()
        found = []
        for k, start in enumerate(raw):
            if self.late():
                break
            end, reason = (
                self.climb(start, steps) if k < CLIMBED or start.possible else (start, self.judge.fault(start))
            )
            fates[reason] += 1
            if reason is Reason.HOLDS:
                better = polish.polished(end)
                holds = better is not end and self.passive(better.grasp) is Reason.HOLDS
                found.append(((better if holds else end).certified, end is not start))
        return Unit(number, tuple(found), fates, self.judge.judged - before, used, starts.unproved, not self.late())

    def climb(self, start: Candidate, steps: Steps) -> tuple[Candidate, Reason]:
        """Improve a candidate until it holds, or no step helps."""
        now, length, fails, missed = start, ANYWHERE, 0, 0
        reason, asked = self.judge.fault(start), None
        for round_ in range(STEPS):
            if now is not asked:
                asked, reason = now, self.passive(now.grasp) if now.possible else self.judge.fault(now)
                missed += now.possible
                if reason is Reason.HOLDS or missed == NEAR_MISSES:
                    break
            if fails == PATIENCE or self.late():
                break
            new = steps.away(now, AWAY) if round_ % 2 == 0 else []
            new += steps.anywhere(now, (0.3 * length, 0.6 * length, length))
            better = min(self.candidates(new, now.cost - PROGRESS if now.cost else EQUAL), key=_cost, default=None)
            if better:
                now, fails, length = better, 0, min(1.3 * length, LONGEST)
            else:
                fails, length = fails + 1, max(0.5 * length, SHORTEST)
        return now, reason

    def candidates(self, found: Iterable[Certified], below: float = np.inf) -> list[Candidate]:
        """Those whose cost is below what is asked."""
        return [c for c in (self.judge.candidate(f, below) for f in found) if c]

    def passive(self, grasp: Grasp) -> Reason:
        """Whether some preload holds every load."""
        left = None if np.isinf(self.end) else max(self.end - time.monotonic(), 0.0)
        a = self.held(grasp, least=False, timeout=left)
        return {Verdict.HOLDS: Reason.HOLDS, Verdict.SLIPS: Reason.SLIPS}.get(a.verdict, Reason.UNDECIDED)

    def held(self, grasp: Grasp, *, least: bool, timeout: float | None) -> HoldAnswer:
        """What `hold` says of a grasp, with the actuators and limits of this question."""
        loads, most = self.judge.loads, self.command_limit
        return hold(
            grasp,
            loads,
            actuators=self.driven(grasp),
            least=least,
            command_limit=moderate(grasp, loads) if most is None else most,
            settings=self.settings,
            timeout=timeout,
            **self.limits,
        )

    def proof(self, certified: Certified) -> HoldAnswer:
        """The least preload that is found for a grasp that holds."""
        (c,) = self.candidates([certified])
        answer = self.held(c.grasp, least=True, timeout=LEAST)
        if answer.verdict is not Verdict.HOLDS:  # the short way found one
            answer = self.held(c.grasp, least=False, timeout=None)
        return answer

    def held_again(self, certified: Certified, find: Find, field: str) -> HoldAnswer:
        """What was found of a grasp before, every load asked again under its preload; `field` is where it stands.

        Raises:
            InputError: it is no grasp of this question, or does not hold.
        """
        candidates, loads = self.candidates([certified]), self.judge.loads
        if not (candidates and candidates[0].possible):
            raise InputError("collides, or cannot balance a load", field=field)
        grasp = candidates[0].grasp
        grasp = grasp.with_preload(grasp.mechanism.commands(find.preload, field=f"{field}.preload"))
        checks = tuple(check(grasp, w, settings=self.settings, **self.limits) for w in loads.wrenches)
        if any(a.verdict is not Verdict.HOLDS for a in checks):
            raise InputError("does not hold every load", field=f"{field}.preload")
        bounds = find.preload, find.lower, find.upper
        return HoldAnswer(Verdict.HOLDS, Stop.COMPLETE, 0.0, find.nodes, loads, *bounds, checks)

    def driven(self, grasp: Grasp) -> list[str]:
        """The actuators that may be commanded: those asked for that move this grasp."""
        return [n for n in self.actuators if n in grasp.mechanism.actuators]

    def late(self) -> bool:
        """Whether a unit should come to its end."""
        return self.stopped.is_set() or time.monotonic() >= self.end


def _cost(c: Candidate) -> float:
    return c.cost
