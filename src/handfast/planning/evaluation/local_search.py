"""The unit of work of `grasp_for`: a few random starts, the best of them improved until they hold or are given up.

Units are numbered and independent: what one finds depends on the seed and its number alone, so that any number of
cores finds the same.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp
from handfast.planning.evaluation.evaluator import Evaluator, GraspCandidate
from handfast.planning.evaluation.preload_search import held, held_again
from handfast.planning.evaluation.steps import GraspRefinement, LineBalance, Steps
from handfast.planning.filters.balance import least_load_factor
from handfast.planning.question import Requirements
from handfast.planning.search import RejectionReason, Tally, UnitResult, of_verdict
from handfast.proofs.contact_force_limits import ForceLimits
from handfast.stability.answers import CheckAnswer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.hold import HoldAnswer, moderate
from handfast.stability.studies.questions import check
from handfast.synthesis.search.starts import START_BLOCK, Certified, Starts, Walks

SETTINGS = Settings(nodes=4000)  # nodes, not seconds: the same seed finds the same grasps
RAW = 16  # certified random starts of a unit
IMPROVED = 3  # of them, those with the least cost are improved
SEARCH_ROUNDS = 40  # rounds of steps that one may take
IDLE_ROUNDS = 6  # rounds without progress after which it is given up
RETREAT_LENGTHS = (0.02, 0.05, 0.1, 0.2)  # lengths of steps away from what penetrates, in the measure of `distance`
ANYWHERE = 0.2  # of the first steps in random directions; it adapts
MAX_SEARCH_STEP, MIN_SEARCH_STEP = 0.6, 0.005
COST_PROGRESS = 1e-4  # of the cost
EQUAL = 1e-9  # nothing is left to improve: another with nothing wrong will do
PRELOAD_SECONDS = 20.0  # [s] in which the least preload of one grasp is looked for
RATED_GRASPS = 2  # grasps of a unit of which it is asked how many times the loads they hold
QUESTIONS = 8  # about each
GROWING = 10.0  # [s] for each, at most
FACTOR_RATIO = 1.01  # factors on the loads that are as near to each other are not told apart
NEAR_MISSES = 6  # possible candidates of one local search that may fail to hold


@dataclass(frozen=True, eq=False)
class Improved:
    """A configuration that holds every load, with the first preload that did.

    Attributes:
        repaired: was it improved from a start that did not hold?
        first: the answer, of which the commands are not the least.
        strength: what the same preload holds; None unless the largest was asked for.
    """

    certified: Certified
    repaired: bool
    first: HoldAnswer
    strength: Strength | None = None


@dataclass(frozen=True, eq=False)
class Strength:
    """What a grasp holds under its preload: `factor` times every load, each alone, with an answer for each."""

    factor: float
    checks: tuple[CheckAnswer, ...]


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
        self,
        evaluator: Evaluator,
        seed: int,
        requirements: Requirements,
        seconds_left: float = np.inf,
        best: str | None = None,
        force_limits: ForceLimits | None = None,
    ) -> None:
        self.evaluator, self.seed, self.requirements, self.best = evaluator, seed, requirements, best
        self.force_limits = force_limits or ForceLimits.of(np.inf, len(evaluator.task.contact_pairs))
        self.starts = Starts(evaluator.problem, seed)
        self.walks = Walks(self.starts)
        self.line = LineBalance(self.walks, evaluator.loads)
        self.end = time.monotonic() + seconds_left  # of the monotonic clock

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is sent to another machine, with a clock and machine code of its own."""
        return LocalSearch, (
            self.evaluator,
            self.seed,
            self.requirements,
            self.end - time.monotonic(),
            self.best,
            self.force_limits,
        )

    def warm(self) -> None:
        """Compile what the units need, before the clock starts and before processes are made."""
        simple = Contact(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5)
        check(Grasp([simple]), [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])

    def run(self, number: int) -> ConfigurationUnit:
        """Unit `number`."""
        starts, tally, found = self.starts, Tally(), list[tuple[GraspCandidate, bool, HoldAnswer]]()
        starts.block, starts.count, starts.unproved = number, number * START_BLOCK, 0
        steps = Steps(self.evaluator, self.walks, np.random.default_rng([self.seed, number, 2]))
        limited = self.best is not None and np.isfinite(self.force_limits.most).any()
        refinement = GraspRefinement(self.evaluator, steps, self.factor_of_forces if limited else None)
        before = self.evaluator.evaluated
        raw = sorted(self.candidates(starts.run(RAW)), key=_cost)
        used = starts.count - number * START_BLOCK
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
                found.append((best, end is not start, first))
        evaluated = self.evaluator.evaluated - before
        return ConfigurationUnit(tally, self.strengths(found), evaluated, used, starts.unproved, not self.late())

    def improve(self, start: GraspCandidate, steps: Steps) -> tuple[GraspCandidate, HoldAnswer | RejectionReason]:
        """Improve a candidate until it holds, or no step helps: the answer that holds, or why there is none."""
        now, length, fails, missed = start, ANYWHERE, 0, 0
        asked: GraspCandidate | None = None
        said: HoldAnswer | RejectionReason = RejectionReason.UNDECIDED
        for round_ in range(SEARCH_ROUNDS):
            if now is not asked:
                asked, said = now, self.judged(now)
                missed += now.possible
                if isinstance(said, HoldAnswer) or missed == NEAR_MISSES:
                    break
            if fails == IDLE_ROUNDS or self.late():
                break
            new = steps.away(now, RETREAT_LENGTHS) if round_ % 2 == 0 else []
            new += steps.anywhere(now, (0.3 * length, 0.6 * length, length))
            better = min(self.candidates(new, now.cost - COST_PROGRESS if now.cost else EQUAL), key=_cost, default=None)
            if better:
                now, fails, length = better, 0, min(1.3 * length, MAX_SEARCH_STEP)
            else:
                fails, length = fails + 1, max(0.5 * length, MIN_SEARCH_STEP)
        return now, said

    def candidates(self, found: Iterable[Certified], below: float = np.inf) -> list[GraspCandidate]:
        """Those whose cost is below what is asked; two contacts where the load has no moment about their line, soft
        fingers, which may hold one, where they are as well.
        """
        soft, tried = self.evaluator.torsion > 0, list[Certified]()
        for one in found:
            balanced = self.line.balanced(one)
            tried += [one] if soft and balanced is not one else []
            tried.append(balanced)
        return [c for c in (self.evaluator.candidate(f, below) for f in tried) if c]

    def candidate(self, certified: Certified) -> GraspCandidate:
        """A configuration as it is."""
        found = self.evaluator.candidate(certified)
        assert found is not None  # of any cost
        return found

    def judged(self, candidate: GraspCandidate) -> HoldAnswer | RejectionReason:
        """The answer with a preload that holds every load, or why there is none."""
        if not candidate.possible:
            return self.evaluator.rejection(candidate)
        answer = self.first(candidate.grasp)
        return of_verdict(answer.verdict) or answer

    def first(self, grasp: Grasp) -> HoldAnswer:
        """The first preload that holds every load, in the time that is left."""
        return self.answer(grasp, least=False, timeout=self.left())

    def answer(self, grasp: Grasp, *, least: bool, timeout: float | None, factor: float = 1.0) -> HoldAnswer:
        """What `hold` says of a grasp and so many times the loads, with the actuators and limits of this question."""
        r, loads = self.requirements, self.evaluator.loads
        limit = moderate(grasp, loads) if r.command_limit is None else r.command_limit
        how = {"actuators": r.driven(grasp), "least": least, "command_limit": limit, "timeout": timeout}
        return held(grasp, loads if factor == 1 else loads.scaled(factor), r, SETTINGS, **how)

    def factor_of_forces(self, c: GraspCandidate, friction: float = 1.0) -> float:
        """How many times forces alone can hold the loads at a candidate's contacts.

        friction: factor on it and on torsion.
        """
        p, n = (np.array([getattr(contact, name) for contact in c.contacts]) for name in ("position", "normal"))
        e = self.evaluator
        limits, loads, torsion = self.force_limits.most, e.loads.wrenches, friction * e.torsion
        return least_load_factor(p, n, friction * e.friction, limits, loads, torsion=torsion)

    def strengths(self, found: Sequence[tuple[GraspCandidate, bool, HoldAnswer]]) -> tuple[Improved, ...]:
        """What a unit found; where the largest loads are asked for, these of the grasps whose forces can do most."""
        if self.best is None:
            return tuple(Improved(c.certified, repaired, first) for c, repaired, first in found)
        out = []
        for k, (c, repaired, first) in enumerate(sorted(found, key=lambda f: -self.factor_of_forces(f[0]))):
            answer, strength = self.strongest(c, first) if k < RATED_GRASPS else (first, Strength(1.0, first.checks))
            out.append(Improved(c.certified, repaired, answer, strength))
        return tuple(out)

    def strength_again(self, answer: HoldAnswer, factor: float, field: str) -> Strength:
        """Asks so many times the loads again under the preload of an answer that holds them; `InputError` if not."""
        known = answer.preload or {}, answer.lower, answer.upper
        assert answer.grasp is not None
        more = held_again(answer.grasp, self.evaluator.loads.scaled(factor), self.requirements, SETTINGS, known, 0)
        if more is None:
            raise InputError(f"is not held {factor:g} times", field=field)
        return Strength(factor, more.checks)

    def strongest(self, c: GraspCandidate, first: HoldAnswer) -> tuple[HoldAnswer, Strength]:
        """The largest factor on the loads that is found to hold: the answers under one preload, to the loads themselves
        and to so many times these. By bisection up to what forces alone can do.
        """
        low, high = 1.0, self.factor_of_forces(c, self.evaluator.shares[0])
        answer, best = first, Strength(1.0, first.checks)
        for k in range(QUESTIONS):
            if self.late() or high < FACTOR_RATIO * low:
                break
            between = 2 * low if np.isinf(high) else high / FACTOR_RATIO if k == 0 else float(np.sqrt(low * high))
            more = self.answer(c.grasp, least=False, timeout=self.left(GROWING), factor=between)
            again = None
            if more.verdict is Verdict.HOLDS:
                known = more.preload or {}, 0.0, more.upper
                loaded = c.grasp.with_commands(more.preload or {})
                again = held_again(loaded, self.evaluator.loads, self.requirements, SETTINGS, known, more.nodes)
            if again is None:
                high = between
            else:
                low, answer, best = between, replace(again, actuators=more.actuators), Strength(between, more.checks)
        return answer, best

    def left(self, most: float = np.inf) -> float | None:
        """[s] that are left, up to so many; None without an end."""
        seconds = min(most, self.end - time.monotonic())
        return None if np.isinf(seconds) else max(seconds, 0.0)

    def proof(self, certified: Certified) -> HoldAnswer:
        """The least preload that is found for a grasp that holds."""
        c = self.candidate(certified)
        answer = self.answer(c.grasp, least=True, timeout=PRELOAD_SECONDS)
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
        candidate = self.candidate(certified)
        if not candidate.possible:
            raise InputError("collides, or cannot balance a load", field=field)
        grasp = candidate.grasp
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
