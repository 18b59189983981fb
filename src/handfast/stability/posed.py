"""A question as a search takes it, and as certificates and result files put it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from handfast.stability import scaled_problem
from handfast.stability.certify.certificate import Question
from handfast.stability.goal import Goal
from handfast.stability.scaled_problem import ScaledProblem


class Posed(NamedTuple):
    """What a search is asked: the scaled problem, and what is sought."""

    problem: ScaledProblem
    goal: Goal

    @property
    def question(self) -> Question:
        """The same in the grasp's own units."""
        p, goal = self
        driven = zip(p.equivalent.plain.mechanism.actuators, p.driven, strict=True)
        return Question(
            grasp=p.grasp,
            goal=goal,
            wrench=np.zeros(6) if goal.homogeneous else p.wrench,
            direction=p.along if goal.has_direction else None,
            eta=p.eta,
            mdp=p.mdp,
            torque_limits=p.torque_limits,
            force_limit=p.force_limit,
            driven=[name for name, is_driven in driven if is_driven],
        )

    @classmethod
    def of(cls, q: Question) -> Posed:
        """The other way round."""
        limits = {"torque_limits": q.torque_limits, "force_limit": q.force_limit}
        driven = q.sought if q.goal.seeks_commands else None
        p = scaled_problem.build(q.grasp, q.wrench, q.direction, eta=q.eta, mdp=q.mdp, driven=driven, **limits)  # type: ignore[arg-type]
        return cls(p, q.goal)
