"""What older methods say of a grasp, held against the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.stability.problem import judge
from handfast.stability.problem.model import State
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem

SLIDES = 1e-6  # of the force scale: motions and forces above have a direction


@dataclass(frozen=True, eq=False)
class BaselineState:
    """What a baseline says of a grasp under a load. Never proved.

    Attributes:
        verdict: HOLDS or SLIPS by the method's own measure; UNDECIDED where it ends without either.
        state: its motions and forces; None if it found none.
        unbalanced: the part of the load that its forces leave over, relative to the force scale.
        turns: programs that were solved.
        residuals: how far the state is from the model; None without one.
        friction_errors: (m,) [rad] angle between friction and the direction against the slip; NaN where a contact
            does not slide or carries nothing.
    """

    verdict: Verdict
    state: State | None
    unbalanced: float
    turns: int
    residuals: judge.Residuals | None
    friction_errors: Array

    @classmethod
    def of(
        cls, p: ScaledProblem, verdict: Verdict, point: ScaledPoint | None, unbalanced: float, turns: int
    ) -> BaselineState:
        """With the errors of a scaled point, if there is one."""
        errors = np.full(len(p.mu), np.nan)
        if point is None:
            return cls(verdict, None, unbalanced, turns, None, errors)
        state = p.unscale(point)
        c, d = point.c.reshape(-1, 3), p.relative_motion(point.r, point.q)
        for i, (force, motion) in enumerate(zip(c[:, 1:], d[:, 1:], strict=True)):
            if np.hypot(*force) > SLIDES and np.hypot(*motion) > SLIDES:
                a, b = force, -motion
                errors[i] = abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
        return cls(verdict, state, unbalanced, turns, judge.residuals(p.grasp, p.wrench, state), errors)


def with_torques(p: ScaledProblem, x: ScaledPoint) -> ScaledPoint:
    """The point with the actuator forces and multipliers that carry its joint torques best."""
    if not len(p.R) + len(p.A):
        return x
    found = np.linalg.lstsq(np.vstack([p.R, p.A]).T, p.J.T @ x.c, rcond=None)[0]
    carried = np.asarray(found, dtype=np.float64)
    return ScaledPoint(x.r, x.q, x.c, carried[: len(p.R)], carried[len(p.R) :])
