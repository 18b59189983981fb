"""What is sought, as one number to make small, and how far the search for it goes.

The maximum (23) is posed as its homogeneous twin where nothing breaks homogeneity: minimise lambda with
w = d and commands lambda f_c, s = 1 / lambda. In the limit lambda = 0 grasps can resist what they resist at
no finite magnitude, so the search ends at `search_end`, and a maximum there counts as unbounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.problem import Problem

ENDLESS = 1e4  # a disturbance this many times the other forces in play counts as unbounded
STRONGEST = 1e3  # (scaled) commands that are sought go as far
NEAR_END = 1e-6  # relative: what is so near the end of a search is at it


class Goal(StrEnum):
    """What is sought."""

    EXISTS = "exists"  # any solution, objective (20)
    SMALLEST_PRELOAD = "smallest preload"  # lambda, the homogeneous form of (23)
    LARGEST = "largest"  # s of w0 + s d, (23); what is made small is -s
    SMALLEST_MAX_TORQUE = "smallest max torque"  # (26)
    SMALLEST_SUM_TORQUE = "smallest sum of torques"


@dataclass(frozen=True, eq=False)
class Load:
    """The right-hand side, affine in one scalar: w = w_a + sigma w_b, f_c = f_a + sigma f_b."""

    w_a: Array
    w_b: Array
    f_a: Array
    f_b: Array


@dataclass(frozen=True, eq=False)
class Point:
    """Scaled unknowns (shapes as in `Problem`) and the scalar sigma of the load."""

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    sigma: float = 0.0


def load(p: Problem, goal: Goal) -> Load:
    """The loads of a goal, affine in its scalar (s itself for `LARGEST`)."""
    zero_w, zero_f = np.zeros(6), np.zeros(len(p.f_c))
    if goal is Goal.SMALLEST_PRELOAD:
        return Load(p.direction, zero_w, zero_f, p.f_c)
    if goal is Goal.LARGEST:
        return Load(p.w0, p.direction, p.f_c, zero_f)
    if goal is Goal.EXISTS:
        return Load(p.w0, zero_w, p.f_c, zero_f)
    return Load(p.w0, zero_w, zero_f, zero_f)  # commands are what is sought


def search_end(p: Problem) -> float:
    """The magnitude s / stretch at which the search for a maximum ends: `ENDLESS` times the other forces in play."""
    return ENDLESS * p.strongest / (p.stretch * p.size_of(p.along))


def unit(p: Problem) -> float:
    """The magnitude at which a disturbance that is sought is as large as the other forces in play."""
    return p.stretch * search_end(p) / ENDLESS


def interval(p: Problem, goal: Goal, value: float, bound: float) -> tuple[float, float]:
    """(lower, upper) of what the user asked about, from a value achieved and a bound on it, inf without."""
    if goal is Goal.SMALLEST_PRELOAD:
        return p.stretch / value if value > 0 else np.inf, p.stretch / bound if bound > 0 else np.inf
    if goal is Goal.LARGEST:
        return max(0.0, -value * p.stretch), max(0.0, -bound * p.stretch)  # of equals the first: no -0
    return bound, value
