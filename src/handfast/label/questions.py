"""The questions that a label asks the engine, all of them: largest disturbances, loads held, smallest commands.

Whatever answers many questions at once belongs here, and nothing else of this package knows how they are asked.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.stability.answers import Answer
from handfast.stability.many import Case, Options, maxima
from handfast.stability.queries import MaxAnswer, check, torques
from handfast.stability.scaled_problem import beyond_range
from handfast.stability.settings import Settings

LEAST = 1e-3  # [s] that a question has where no time is left,
FEWEST = 64  # and nodes


@dataclass(frozen=True)
class LargestLoad:
    """Up to where a disturbance is resisted, as a multiple of it: witnessed, and proved (inf: no end was shown)."""

    lower: float
    upper: float
    unbounded: bool


@dataclass
class Questions:
    """Asks about one grasp, and counts what it cost.

    Attributes:
        grasp: with the preload in force.
        settings: of each question but for its time, and for its nodes where these come to an end.
        seconds: [s] for all questions together. budget: nodes for all of them.
        nodes: spent so far. open: questions that a limit left open. stop: the last limit that was hit.
    """

    grasp: Grasp
    settings: Settings
    seconds: float
    budget: float
    nodes: int = 0
    open: int = 0
    stop: Stop = Stop.COMPLETE
    _begin: float = field(default_factory=time.monotonic)

    def largest(self, directions: list[Array]) -> list[LargestLoad]:
        """The largest multiple of each disturbance (6,) that is resisted; each helps the next."""
        zero, asked = np.zeros(6), [not self._beyond(d) for d in directions]
        cases = [Case(self.grasp, d, zero) for d, is_asked in zip(directions, asked, strict=True) if is_asked]
        answers = iter(maxima(cases, Options(settings=self._limited(len(cases)), proofs=self.settings.verify), 1))
        return [self._largest(next(answers)) if is_asked else LargestLoad(0.0, 0.0, False) for is_asked in asked]

    def _largest(self, answer: MaxAnswer | None) -> LargestLoad:
        if answer is None:  # Ctrl-C came first
            raise KeyboardInterrupt
        self._count(answer, answer.unbounded or answer.verdict is Verdict.SLIPS or np.isfinite(answer.upper))
        return LargestLoad(answer.lower, answer.upper, answer.unbounded)

    def held(self, wrench: Array) -> Verdict:
        """Is a disturbance (6,) resisted?"""
        if self._beyond(wrench):
            return Verdict.SLIPS
        answer = check(self.grasp, wrench, settings=self._limited(1))
        self._count(answer, answer.verdict is not Verdict.UNDECIDED)
        return answer.verdict

    def commands(self, wrench: Array) -> tuple[dict[str, float] | None, float, float]:
        """Smallest commands that resist a disturbance (6,), by actuator; bounds of the largest, inf for none."""
        if self._beyond(wrench) or not self.grasp.mechanism.a:
            return None, np.inf, np.inf
        answer = torques(self.grasp, wrench, settings=self._limited(1))
        self._count(answer, answer.verdict is not Verdict.UNDECIDED)
        return answer.preload, answer.lower, answer.upper

    def _limited(self, count: int) -> Settings:
        """The settings with an equal share of the time that is left, and of the nodes if these are fewer."""
        left = (self.seconds - (time.monotonic() - self._begin)) / max(count, 1)
        nodes = max((self.budget - self.nodes) / max(count, 1), FEWEST)
        return replace(self.settings, time_limit=max(left, LEAST), node_limit=min(self.settings.node_limit, nodes))

    def _count(self, answer: Answer, closed: bool) -> None:
        if answer.stop is Stop.INTERRUPTED:  # half a label is none
            raise KeyboardInterrupt
        self.nodes += answer.nodes
        if answer.stop is not Stop.COMPLETE:
            self.stop = answer.stop
        if not closed or answer.stop in (Stop.TIME, Stop.NODES):
            self.open += 1

    def _beyond(self, wrench: Array) -> bool:
        """Can no forces whatever at these contacts balance it? Questions would refuse that as input."""
        size = np.array([1.0] * 3 + [1 / self.grasp.size] * 3)
        return beyond_range(size[:, None] * self.grasp.G, size * wrench) is not None
