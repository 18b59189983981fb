"""Constants of a problem for the prover: bounds of its regions' derivatives, and cones that hold the object's axes."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.synthesis.task_problem import TaskProblem

CELLS = 8  # each way, of a region: each has constants of its own
UP = 1.0 + 1e-9  # over the rounding of the constants below


def derivative_bounds(problem: TaskProblem) -> Array:
    """(b, 2, CELLS, CELLS, 10) constants of the object's and the hand's regions, see `taylor.worst`; units."""
    out = np.zeros((len(problem.task.contact_pairs), 2, CELLS, CELLS, 10))
    for k, pair in enumerate(problem.task.contact_pairs):
        radius = pair.hand.ball.radius if pair.hand.ball else 0.0
        for i, region in enumerate((pair.object, pair.hand)):
            if not region.ball or i == 0:
                surface, normal = region.derivative_bounds(CELLS)
                outward = radius * normal if i == 0 else 0.0
                out[k, i] = np.concatenate([(surface + outward) / problem.unit, normal], axis=2) * UP
                if region.ball:  # its parameters are no fractions; the constants hold everywhere
                    out[k, i, 0, 1] = np.nan
    return out


def cones(problem: TaskProblem) -> Array:
    """(m, 5) bounds of the object's axes: index of the axis, unit direction in the palm frame, angle from it."""
    rows = []
    for k, box in enumerate(problem.task.pose.axes):
        tries = [*np.eye(3), *-np.eye(3)]
        middle = box.mean(axis=1)
        if np.linalg.norm(middle) > 1e-6:
            tries.append(middle / np.linalg.norm(middle))
        for c in tries:
            # no vector within the bounds has a smaller component along c
            least = float(np.minimum(c * box[:, 0], c * box[:, 1]).sum())
            if least > -1:
                rows.append([k, *c, np.arccos(min(least, 1.0)) + 1e-9])
    return np.array(rows).reshape(-1, 5)
