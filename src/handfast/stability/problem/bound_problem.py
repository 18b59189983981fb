"""A question as a search takes it, and as proofs and result files state it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.schema import written
from handfast.proofs.question import Question
from handfast.readers import grasp_file
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.objective import Objective
from handfast.stability.problem.scaled_problem import ScaledProblem


@dataclass(frozen=True, eq=False)
class BoundProblem:
    """What a search is asked: the scaled problem, and what is sought.

    Attributes:
        source: the problem, or what builds it, where it is wanted only if somebody looks at the question.
    """

    source: ScaledProblem | Callable[[], ScaledProblem]
    goal: Objective

    @cached_property
    def problem(self) -> ScaledProblem:
        """The scaled problem."""
        return self.source if isinstance(self.source, ScaledProblem) else self.source()

    def __iter__(self) -> Iterator[Any]:
        return iter((self.problem, self.goal))

    @property
    def question(self) -> Question:
        """The same in the grasp's own units."""
        p, goal = self
        return Question(
            grasp=grasp_data(p.grasp),
            goal=goal.word,
            sums=goal.sums_commands,
            wrench=np.zeros(6) if goal.homogeneous else p.wrench,
            direction=p.along if goal.has_direction else np.zeros(6),
            eta=p.limits.eta,
            mdp=p.mdp,
            torque_limits=p.limits.torque_limits,
            force_limit=p.limits.largest_normal_force,
            driven=self.driven,
        )

    @property
    def driven(self) -> tuple[str, ...]:
        """Actuators whose commands are sought."""
        p = self.problem
        return tuple(n for n, sought in zip(p.equivalent.plain.mechanism.actuators, p.driven, strict=True) if sought)

    def to_json(self) -> dict[str, Any]:
        """The question as it stands in files."""
        p, q = self.problem, self.question
        said = {
            "grasp": grasp_file.to_dict(p.grasp),
            "goal": q.goal,
            "objective": "sum" if q.sums else "max",
            "wrench": q.wrench.tolist(),
            "direction": q.direction.tolist() if self.goal.has_direction else None,
            "mdp": q.mdp,
            "driven": list(q.driven),
        }
        said |= {} if p.grasp.start is None else {"from": written(p.grasp.start)}
        return said | p.limits.to_json()
