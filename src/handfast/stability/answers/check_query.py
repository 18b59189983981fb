"""Does the grasp resist this disturbance? Stability paper, section VII-A, (20)-(22)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.stability.answers.answer import Answer, any_state
from handfast.stability.answers.load_path import LoadPath, StepAnswer, check_path, comes_after
from handfast.stability.answers.margin import Margin
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Loading, OnStep, Settings
from handfast.stability.search.solve import clock_of, time_left

FIRST_NORMAL_FORCE = 10.0  # (scaled) normal forces tried first when nothing else bounds them


@dataclass(frozen=True, eq=False)
class CheckAnswer(Answer):
    """Is this disturbance resisted?

    Attributes:
        margin: how much a HOLDS leans on, if that was asked: `handfast.margin`.
    """

    query = "check"

    margin: Margin | None = field(default=None, kw_only=True)

    def said(self) -> dict[str, Any]:
        out = self.state_json() | {"margin": self.margin.to_json() if self.margin else None}
        if not isinstance(self.path, LoadPath):
            return out
        return out | {"reached": self.path.reached, "slips_at": self.path.slips_at}

    def to_file(self) -> dict[str, Any]:
        """Without the margin, which nothing in a file would prove; `Margin.verify` replays it."""
        return Answer.to_file(self if self.margin is None else replace(self, margin=None))


def ask(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    loading: Loading = "together",
    settings: Settings | None = None,
    on_progress: OnStep | None = None,
) -> CheckAnswer:
    """What a search answers to `handfast.check`, whose arguments and errors these are."""
    settings = settings or Settings()
    after = comes_after(loading, mdp)
    p = scaled_problem.build(grasp, wrench, limits=limits, mdp=mdp)
    if after:
        return check_along(p, settings, on_progress)
    if not mdp:  # moderate forces first: without dissipation nothing bounds them, and small ones are easier to read
        clock = clock_of(settings)
        modest = any_state(CheckAnswer, replace(p, cn_max=min(p.cn_max, FIRST_NORMAL_FORCE)), settings, on_progress)
        if modest.verdict is Verdict.HOLDS:
            return modest
        settings = time_left(settings, clock)
    return any_state(CheckAnswer, p, settings, on_progress)


def check_along(
    p: ScaledProblem, settings: Settings, on_progress: OnStep | None = None, rest: StepAnswer | None = None
) -> CheckAnswer:
    """The answer on the path to the load of a built problem; rest: as of `check_path`."""
    start = time.monotonic()
    return _of_path(check_path(p, settings, on_progress, rest), time.monotonic() - start)


def _of_path(path: LoadPath, seconds: float) -> CheckAnswer:
    """The answer at the end of a path; a state is shown where that is the whole load."""
    backing = path.backing(seconds)
    if backing["verdict"] is not Verdict.HOLDS:
        backing |= {"found": None, "posed": path.whole}
    return CheckAnswer(**backing)
