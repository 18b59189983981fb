"""A question to a search in the words of certificates and result files."""

from __future__ import annotations

import numpy as np

from handfast.stability import problem
from handfast.stability.certify.certificate import Goal as Claimed
from handfast.stability.certify.certificate import Question
from handfast.stability.goal import Goal
from handfast.stability.problem import Problem

CLAIMS = {
    Goal.EXISTS: Claimed.CHECK,
    Goal.SMALLEST_PRELOAD: Claimed.SMALLEST_PRELOAD,
    Goal.LARGEST: Claimed.LARGEST,
    Goal.SMALLEST_MAX_TORQUE: Claimed.TORQUES,
    Goal.SMALLEST_SUM_TORQUE: Claimed.TORQUES,
}


def question(p: Problem, goal: Goal) -> Question:
    """What a search with this goal is asked."""
    claimed = CLAIMS[goal]
    homogeneous = claimed is Claimed.SMALLEST_PRELOAD
    names = p.grasp.mechanism.actuators
    return Question(
        grasp=p.grasp,
        goal=claimed,
        wrench=np.zeros(6) if homogeneous else p.wrench,
        direction=p.along if homogeneous or claimed is Claimed.LARGEST else None,
        eta=p.eta,
        mdp=p.mdp,
        torque_limits=p.torque_limits,
        force_limit=p.force_limit,
        driven=[n for n, d in zip(names, p.driven, strict=True) if d],
        objective="sum" if goal is Goal.SMALLEST_SUM_TORQUE else "max",
    )


def posed(q: Question) -> tuple[Problem, Goal]:
    """The other way round: the scaled problem and the goal of a search."""
    p = problem.build(
        q.grasp,
        q.wrench,
        q.direction,
        eta=q.eta,
        mdp=q.mdp,
        torque_limits=q.torque_limits,
        force_limit=q.force_limit,
        driven=q.is_driven if q.goal is Claimed.TORQUES else None,
    )
    if q.goal is Claimed.TORQUES:
        return p, Goal.SMALLEST_SUM_TORQUE if q.objective == "sum" else Goal.SMALLEST_MAX_TORQUE
    return p, {c: g for g, c in CLAIMS.items()}[q.goal]
