"""Ranks of grasps for a task by several terms at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

BETTER = {"command": -1, "friction_margin": 1, "clearance": 1, "from_limits": 1, "manipulability": 1}


def rank(terms: Sequence[Mapping[str, float]]) -> list[float]:
    """A score for each of some grasps by its terms: the mean rank share over them, 1 best, equal ones alike.

    Every term counts the same, in ranks rather than amounts, so that no unit has to be weighed against
    another: the largest command (smaller is better), the friction margin, the clearance, the distance to the
    joint limits and the manipulability (larger is better).
    """
    if len(terms) < 2:
        return [1.0] * len(terms)
    shares = []
    for name, sense in BETTER.items():
        x = sense * np.array([t[name] for t in terms])
        worse = (x[None] < x[:, None]).sum(axis=1)
        better = (x[None] > x[:, None]).sum(axis=1)
        shares.append((worse + (len(x) - 1 - worse - better) / 2) / (len(x) - 1))
    return np.mean(shares, axis=0).tolist()
