"""Which way a configuration has to change for two bodies to come apart: distances, to first order.

The distance d = n . (p_b - p_a) of two nearest points, n the direction from a to b, changes with the joints that
move either link and with the object's pose; the region parameters of the contacts do not change it, the contact
equations tie them to the rest.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import drivers
from handfast.synthesis.task_problem import TaskProblem


class Gradients:
    """Derivatives of distances with respect to the coordinates x (n,) of a problem."""

    def __init__(self, problem: TaskProblem) -> None:
        self.problem, hand = problem, problem.task.hand
        driven = drivers(hand)
        self._joint = np.zeros((hand.l, problem.n))  # dq/dx: drivers and the joints that mimic them
        for column, driver in enumerate(problem.free):
            for j, (first, ratio, _) in driven.items():
                if first == driver:
                    self._joint[j, column] = ratio * problem.lengths[column]
        self._pose = len(problem.free)

    def link(self, link: int, point: Array, q: Array) -> Array:
        """(3, n) of a point (3,) [m], base frame, fixed to a link of the hand at q (l,)."""
        return np.asarray(self.problem.task.hand.jacobian(link, point, q) @ self._joint)

    def object(self, point: Array, x: Array) -> Array:
        """(3, n) of a point (3,) [m], base frame, fixed to the object, at coordinates x (n,)."""
        first, unit = self._pose, self.problem.unit
        J = np.zeros((3, self.problem.n))
        J[:, first : first + 3] = unit * np.eye(3)
        arm = point - unit * x[first : first + 3]
        w, v = x[first + 3], x[first + 4 : first + 7]
        size = w * w + v @ v
        # omega = 2 vec(dq conj(q)) / |q|^2, and the point moves with omega x arm
        turn = np.zeros((3, 4))
        turn[:, 0] = -v
        turn[:, 1:] = w * np.eye(3) + _cross(v)
        J[:, first + 3 : first + 7] = -_cross(arm) @ (2 / size * turn)
        return J


def _cross(v: Array) -> Array:
    """(3, 3) with _cross(v) @ u = v x u."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
