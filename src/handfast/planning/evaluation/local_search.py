"""The unit of work of `grasp_for`: a few random starts, the best of them improved until they hold or are given up.

Units are numbered and independent: what one finds depends on the seed and its number alone, so that any number of
cores finds the same.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp
from handfast.planning.evaluation.evaluator import Evaluator, GraspCandidate
from handfast.planning.evaluation.preload_search import held, held_again
from handfast.planning.evaluation.steps import GraspRefinement, LineBalance, Steps
from handfast.planning.question import Requirements
from handfast.planning.search import RejectionReason, Tally, UnitResult, of_verdict
from handfast.stability.answers import check
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.hold import HoldAnswer, moderate
from handfast.synthesis.search.starts import BLOCK, Certified, Starts, Walks

SETTINGS = Settings(nodes=4000)  # nodes, not seconds: the same seed finds the same grasps
RAW = 16  # certified random starts of a unit
IMPROVED = 3  # of them, those with the least cost are improved
STEPS = 40  # rounds of steps that one may take
PATIENCE = 6  # rounds without progress after which it is given up
AWAY = (0.02, 0.05, 0.1, 0.2)  # lengths of steps away from what penetrates, in the measure of `distance`
ANYWHERE = 0.2  # of the first steps in random directions; it adapts
LONGEST, SHORTEST = 0.6, 0.005
PROGRESS = 1e-4  # of the cost
EQUAL = 1e-9  # nothing is left to improve: another with nothing wrong will do
LEAST = 20.0  # [s] in which the least preload of one grasp is looked for
NEAR_MISSES = 6  # possible candidates of one local search that may fail to hold


@dataclass(frozen=True, eq=False)
class Improved:
    """A configuration that holds every load, with the first preload that did.

    Attributes:
        repaired: was it improved from a start that did not hold?
        first: the answer, of which the commands are not the least.
    """

    certified: Certified
    repaired: bool
    first: HoldAnswer


@dataclass(frozen=True, eq=False)
class ConfigurationUnit(UnitResult[Improved]):
    """What a unit of work came to.

    Attributes:
        evaluated: candidates that were looked at. starts, unproved: of synthesis.
        whole: was it done before the time was up?
    """

    evaluated: int
    starts: int
    unproved: int
    whole: bool


class LocalSearch:
    """Runs units of one question; made once, then copied into every process."""

    def __init__(
        self, evaluator: Evaluator, seed: int, requirements: Requirements, seconds_left: float = np.inf
    ) -> None:
        self.evaluator, self.seed, self.requirements = evaluator, seed, requirements
        self.starts = Starts(evaluator.problem, seed)
        self.walks = Walks(self.starts)
        self.line = LineBalance(self.walks, evaluator.loads)
        self.end = time.monotonic() + seconds_left  # of the monotonic clock

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is sent to another machine, with a clock and machine code of its own."""
        return LocalSearch, (self.evaluator, self.seed, self.requirements, self.end - time.monotonic())

    def warm(self) -> None:
        """Compile what the units need, before the clock starts and before processes are made."""
        simple = Contact(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5)
        check(Grasp([simple]), [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])

    def run(self, number: int) -> ConfigurationUnit:
        """Unit `number`."""
        starts, tally, found = self.starts, Tally(), []
        starts.block, starts.count, starts.unproved = number, number * BLOCK, 0
        steps = Steps(self.evaluator, self.walks, np.random.default_rng([self.seed, number, 2]))
        refinement, before = GraspRefinement(self.evaluator, steps), self.evaluator.evaluated
        raw = sorted(self.candidates(starts.run(RAW)), key=_cost)
        used = starts.count - number * BLOCK
        for k, start in enumerate(raw):
            if self.late():
                break
            improved = k < IMPROVED or start.possible
            end, said = self.improve(start, steps) if improved else (start, self.evaluator.rejection(start))
            tally.add(None if isinstance(said, HoldAnswer) else said)
            if isinstance(said, HoldAnswer):
                better = refinement.refined(end)
                again = said if better is end else self.first(better.grasp)
                best, first = (better, again) if again.verdict is Verdict.HOLDS else (end, said)
                found.append(Improved(best.certified, end is not start, first))
        evaluated = self.evaluator.evaluated - before
        return ConfigurationUnit(tally, tuple(found), evaluated, used, starts.unproved, not self.late())

    def improve(self, start: GraspCandidate, steps: Steps) -> tuple[GraspCandidate, HoldAnswer | RejectionReason]:
        """Improve a candidate until it holds, or no step helps: the answer that holds, or why there is none."""
        now, length, fails, missed = start, ANYWHERE, 0, 0
        asked: GraspCandidate | None = None
        said: HoldAnswer | RejectionReason = RejectionReason.UNDECIDED
        for round_ in range(STEPS):
            if now is not asked:
                asked, said = now, self.judged(now)
                missed += now.possible
                if isinstance(said, HoldAnswer) or missed == NEAR_MISSES:
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
        return now, said

    def candidates(self, found: Iterable[Certified], below: float = np.inf) -> list[GraspCandidate]:
        """Those whose cost is below what is asked; two contacts where the load has no moment about their line."""
        balanced = map(self.line.balanced, found)
        return [c for c in (self.evaluator.candidate(f, below) for f in balanced) if c]

    def judged(self, candidate: GraspCandidate) -> HoldAnswer | RejectionReason:
        """The answer with a preload that holds every load, or why there is none."""
        if not candidate.possible:
            return self.evaluator.rejection(candidate)
        answer = self.first(candidate.grasp)
        return of_verdict(answer.verdict) or answer

    def first(self, grasp: Grasp) -> HoldAnswer:
        """The first preload that holds every load, in the time that is left."""
        left = None if np.isinf(self.end) else max(self.end - time.monotonic(), 0.0)
        return self.answer(grasp, least=False, timeout=left)

    def answer(self, grasp: Grasp, *, least: bool, timeout: float | None) -> HoldAnswer:
        """What `hold` says of a grasp, with the actuators and limits of this question."""
        r, loads = self.requirements, self.evaluator.loads
        limit = moderate(grasp, loads) if r.command_limit is None else r.command_limit
        how = {"actuators": r.driven(grasp), "least": least, "command_limit": limit, "timeout": timeout}
        return held(grasp, loads, r, SETTINGS, **how)

    def proof(self, certified: Certified) -> HoldAnswer:
        """The least preload that is found for a grasp that holds."""
        (c,) = self.candidates([certified])
        answer = self.answer(c.grasp, least=True, timeout=LEAST)
        if answer.verdict is not Verdict.HOLDS:  # the short way found one
            answer = self.answer(c.grasp, least=False, timeout=None)
        return answer

    def answer_again(
        self, certified: Certified, known: tuple[dict[str, float], float, float], nodes: int, field: str
    ) -> HoldAnswer:
        """What was found of a grasp before, every load asked again under its preload.

        Args:
            known: preload, lower and upper bound of its largest command; `nodes`: of the search that found it.
            field: where it stands.

        Raises:
            InputError: it is no grasp of this question, or does not hold.
        """
        candidates = self.candidates([certified])
        if not (candidates and candidates[0].possible):
            raise InputError("collides, or cannot balance a load", field=field)
        grasp = candidates[0].grasp
        grasp = grasp.with_preload(grasp.mechanism.commands(known[0], field=f"{field}.preload"))
        answer = held_again(grasp, self.evaluator.loads, self.requirements, SETTINGS, known, nodes)
        if answer is None:
            raise InputError("does not hold every load", field=f"{field}.preload")
        return answer

    def numbers(self, first: int) -> Iterator[int]:
        """Numbers of units, from one on until it is late."""
        while not self.late():
            yield first
            first += 1

    def late(self) -> bool:
        """Whether a unit should come to its end."""
        return time.monotonic() >= self.end


def _cost(c: GraspCandidate) -> float:
    return c.cost
