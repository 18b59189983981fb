"""How far two configurations are apart, and which of many differ most.

The distance of two configurations is the Euclidean distance of their `features`: the free joint angles [rad],
the object's orientation (2 sin of half the angle between the two), and, divided by LENGTH, the travels of
prismatic joints, the object's position in the palm frame and the contact points in the object's frame. So
0.1 m counts as much as one radian.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.proofs.constants import RADIAN_LENGTH
from handfast.synthesis.solution import Solution
from handfast.synthesis.task import Task
from handfast.synthesis.task_groups import POSE

DISTINCT_DISTANCE = 1e-3  # configurations nearer than this are the same one


def features(solutions: Sequence[Solution]) -> Array:
    """(N, .) one row for each configuration of one task."""
    if not solutions:
        return np.zeros((0, 1))
    rows = np.array([list(s.existence.coordinates.values()) for s in solutions])
    return features_of(solutions[0].task, rows)


def features_of(task: Task, coordinates: Array) -> Array:
    """(N, .) from coordinates (N, n) in SI units, in the order of a proof's labels."""
    names = task.free
    nj = len(names)
    straight = np.array([task.hand.joints[task.hand.joint(n)].type == "prismatic" for n in names], dtype=bool)
    joints = coordinates[:, :nj] / np.where(straight, RADIAN_LENGTH, 1.0)
    position = coordinates[:, nj : nj + 3] / RADIAN_LENGTH
    turn = _rotations(coordinates[:, nj + 3 : nj + POSE]).reshape(-1, 9) / np.sqrt(2)
    spots, column = [], nj + POSE
    for pair in task.contact_pairs:
        spots.append(pair.object.at(coordinates[:, column], coordinates[:, column + 1]) / RADIAN_LENGTH)
        column += 2 if pair.hand.ball else 4
    return np.hstack([joints, position, turn, *spots])


def farthest(at: Array, count: int) -> Indices:
    """Indices of at most `count` of the points (N, .): the first, then each time the one farthest from all chosen.

    Points nearer than `DISTINCT_DISTANCE` to a chosen one are left out.
    """
    chosen = [0]
    gap = np.linalg.norm(at - at[0], axis=1)
    while len(chosen) < count:
        next_one = int(gap.argmax())
        if gap[next_one] < DISTINCT_DISTANCE:
            break
        chosen.append(next_one)
        gap = np.minimum(gap, np.linalg.norm(at - at[next_one], axis=1))
    return np.array(chosen, dtype=np.intp)


def _rotations(quaternions: Array) -> Array:
    """(N, 3, 3) of quaternions (N, 4) w, x, y, z of any length."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions, scalar_first=True).as_matrix())
