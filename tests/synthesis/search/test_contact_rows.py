"""Rows of a contact added up: they keep every planted solution, and discard only what exact arithmetic excludes."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.arrays import Array
from handfast.core.groups import Block
from handfast.synthesis.search.boxes import PoseSpace
from handfast.synthesis.search.kernel.narrowing import RADIAN
from handfast.synthesis.search.kernel.taylor import HAND_DIRECTION, HAND_POINT
from handfast.synthesis.search.workspace import PoseWork, pose_work
from handfast.synthesis.task_groups import POSE
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import pinch
from tests.support.synthesis_pieces import Row, Together, ask

CONE = 0.5  # [rad] of a cap
Z = np.array([0.0, 0.0, 1.0])
NO_BOUNDS = np.zeros((2, 2, 1, 1, 10))


@cache
def task() -> TaskProblem:
    return TaskProblem.of(pinch())


class Rows:
    """Random derivatives of a contact's rows in a box about zero, of a cap or a patch, whose values are to be set."""

    def __init__(self, seed: int, patch: bool, size: float) -> None:
        flat, self.rng = task().flat, np.random.default_rng(seed)
        self.blocks = [Block(layout) for layout in pose_work(flat, PoseSpace(task(), NO_BOUNDS).question, 4)]
        self.work = PoseWork(*(block.arrays() for block in self.blocks))
        for block in self.blocks:
            block.memory[:] = 0.0
        n, self.patch = len(flat.coordinates.lower), patch
        self.position = int(flat.coordinates.parameter[0]) - POSE
        self.use = np.sort(self.rng.choice(n, 8, replace=False))
        box = self.work.box
        box.half[self.use] = size * self.rng.uniform(0.1, 1, 8)
        box.low[:], box.high[:] = -box.half, box.half
        self.work.polynomials.tolerance[0] = self.tolerance
        self.count = 6 if patch else 4
        self.work.turned.gradient[: self.count, self.use] = self.rng.normal(0, 1, (self.count, 8))
        self.work.turned.direction[:] = Z

    @property
    def tolerance(self) -> float:
        return 0.0 if self.patch else CONE

    @property
    def slopes(self) -> Array:
        return self.work.turned.gradient[: self.count, self.use].copy()

    def set(self, values: Array) -> Array:
        """Values of the rows in the middle, as near as the cosine of an angle can come to them."""
        value = self.work.polynomials.value[0]
        value[HAND_POINT] = values[:3]
        if self.patch:
            value[HAND_DIRECTION] = Z + values[3:]
            return np.append(values[:3], value[HAND_DIRECTION] - Z)
        cosine = np.clip(values[3] + np.cos(CONE), -1, 1)
        value[HAND_DIRECTION] = np.sqrt(1 - cosine**2), 0.0, cosine
        return np.append(values[:3], cosine - np.cos(CONE))

    def bent(self, at: Array) -> Array:
        """(3,) what second derivatives of the finger, random ones, add at a place of the box; they are set."""
        chains, d, out = task().flat.chains, np.zeros(len(self.work.box.half)), np.zeros(3)
        d[self.use] = at
        bend = self.work.polynomials.bend[0]
        bend[:] = self.rng.normal(0, 1, bend.shape)
        for i, j in combinations_with_replacement(range(chains.joints[0]), 2):
            both = d[chains.coordinate[0, i]] * d[chains.coordinate[0, j]]
            out += bend[i, j] * both * (0.5 if i == j else 1.0)
        return out

    def keeps(self, points: float, directions: float, others: float | None = None) -> bool:
        rows = Together(self.use, np.array([points, points if others is None else others, directions]))
        return bool(ask("together", self.position, rows, *task().flat, *self.work))


@settings(max_examples=300, derandomize=True, deadline=None)
@given(
    st.integers(0, 10**6),
    st.booleans(),
    st.sampled_from([1.0, 0.1, 1e-3]),
    st.sampled_from([0.0, 0.1, 1.0]),
    st.booleans(),
)
def test_a_planted_solution_is_kept(seed: int, patch: bool, size: float, error: float, bent: bool):
    rows = Rows(seed, patch, size)
    rng, half = rows.rng, rows.work.box.half[rows.use]
    at = half * rng.choice([-1.0, 1.0, 0.0, *rng.uniform(-1, 1, 5)], 8)  # often at ends
    wrong = rng.normal(0, 1, rows.count)
    points, directions = (error * size * x for x in rng.uniform(0, 1, 2))
    wrong[:3] *= points / np.linalg.norm(wrong[:3])
    wrong[3:] *= directions / np.linalg.norm(wrong[3:])
    values = wrong - rows.slopes @ at
    values[:3] -= rows.bent(at) if bent else 0.0
    if not patch:
        values[3] += rng.choice([0.0, 0.3])  # inside the cone is fine
        values[3] = np.clip(values[3], -1.8, 0.12)
        directions += max(0.0, -(values[3] + rows.slopes[3] @ at))  # what clipping took away
    rows.set(values)
    # bent rows miss by no more than `points` beside the bend, whose bounds are not given
    assert rows.keeps(1e6 if bent else points + 1e-11, directions + 1e-11, points + 1e-11)
    box = rows.work.box
    assert (box.low[rows.use] <= at + 1e-12).all()
    assert (at - 1e-12 <= box.high[rows.use]).all()


def excluded(rows: Rows, values: Array, factors: Array, points: float, directions: float) -> bool:
    """In exact arithmetic: is the sum of the rows with these factors positive in all of the box, errors included?"""
    f = [Fraction(float(x)) for x in factors]
    total = sum(x * Fraction(float(v)) for x, v in zip(f, values, strict=True))
    for i, half in zip(range(8), rows.work.box.half[rows.use], strict=True):
        slope = sum(x * Fraction(float(g)) for x, g in zip(f, rows.slopes[:, i], strict=True))
        total -= abs(slope) * Fraction(float(half))
    for part, most in ((factors[:3], points), (factors[3:], directions)):
        size = Fraction(float(np.linalg.norm(part))) * (1 + Fraction(1, 10**12))
        total -= size * Fraction(most)
    return total > 0 and (rows.patch or f[3] <= 0)


def test_what_is_discarded_is_excluded_by_exact_arithmetic():
    """Discarded boxes of random rows: the factors prove it, those of the opposite sign do not; many need the sum."""
    discarded = only_together = 0
    for seed in range(400):
        rows = Rows(seed, bool(seed % 2), 0.1)
        values = rows.set(rows.rng.normal(0, 0.4, rows.count) * ([1, 1, 1] + [0.5] * (rows.count - 3)))
        points, directions = 0.02, 0.02
        box, g = rows.work.box, rows.work.turned.gradient
        low, high = box.low.copy(), box.high.copy()
        if rows.keeps(points, directions):
            continue
        factors = rows.work.inner.newton[: rows.count, 6].copy()
        if not rows.patch and values[3] >= 0:
            factors[3] = 0.0  # the cosine was none of the rows
        discarded += 1
        assert excluded(rows, values, factors, points, directions)
        assert not excluded(rows, values, -factors, points, directions)
        assert not excluded(rows, -values, factors, points, directions)
        box.low[:], box.high[:] = low, high
        ends = [(-points, points)] * 3 + [(-directions, directions) if rows.patch else (-np.inf, directions)] * 3
        each = zip(values, g, ends, strict=False)
        only_together += all(ask("narrowed", v, *end, Row(row, rows.use), box) for v, row, end in each)
    assert discarded > 60
    assert only_together > 3


def test_a_cap_may_tilt_less_than_its_cone_but_not_more():
    rows = Rows(1, False, 0.01)
    rows.work.turned.gradient[:3] = 0.0
    rows.set(np.array([0.0, 0.0, 0.0, 0.1]))
    assert rows.keeps(1e-6, 1e-6)
    rows.set(np.array([0.0, 0.0, 0.0, -0.5]))
    assert not rows.keeps(1e-6, 1e-6)
    assert rows.work.inner.newton[3, 6] == pytest.approx(-0.5 * RADIAN**2, rel=0.1)
