"""Which smaller magnitudes are resisted too: samples with witnesses, holes with certificates."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from holdfast.answer import Verdict
from holdfast.stability.queries import check, maximum
from holdfast.stability.verify import verify
from problems import pinch, table

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from grasps import random_case

Y6 = np.array([0, 1.0, 0, 0, 0, 0])


def test_a_pinch_resists_everything_below_its_maximum() -> None:
    answer = maximum(pinch(), Y6, interval=True)
    assert answer.interval.holds_from_zero_to == answer.lower
    assert answer.interval.holes == ()
    assert answer.to_json()["holds_from_zero_to"] == answer.lower
    assert answer.to_json()["holes"] == []


def test_not_asked_is_null() -> None:
    answer = maximum(pinch(), Y6)
    assert answer.to_json()["holds_from_zero_to"] is None
    assert "holes" not in answer.to_json()


def test_with_a_base_load() -> None:
    answer = maximum(table(), [1, 0, 0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0], interval=True)
    assert answer.interval.holds_from_zero_to == pytest.approx(4.0, rel=1e-3)


def test_a_hole_is_a_hole() -> None:
    """A grasp that resists 4.7 N, but slips at 2 to 3 N: the paper's warning in section VII-B."""
    case = random_case(3, 510)
    answer = maximum(case.grasp, case.direction, interval=True)
    to, (hole,) = answer.interval.holds_from_zero_to, answer.interval.holes
    assert to < hole[0] < hole[1] < answer.lower
    inside = check(case.grasp, (hole[0] + hole[1]) / 2 * case.direction)
    assert inside.verdict is Verdict.SLIPS
    assert verify(inside.certificate).ok
    assert check(case.grasp, 0.5 * to * case.direction).verdict is Verdict.HOLDS
    beyond = check(case.grasp, 0.999 * answer.lower * case.direction)
    assert beyond.verdict is Verdict.HOLDS
    assert beyond.witness.valid


def test_unbounded_maxima_are_sampled_in_equal_ratios() -> None:
    answer = maximum(pinch(), [1, 0, 0, 0, 0, 0], interval=True)
    assert answer.unbounded
    assert answer.interval.holds_from_zero_to == answer.lower
