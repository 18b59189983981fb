"""Bounds up to a cap on motions are none where a state that moves more does better."""

from __future__ import annotations

import numpy as np

from benchmarks.no_cap import question
from handfast.core.answer import Verdict
from handfast.stability.queries import check, maximum
from handfast.stability.settings import Settings


def test_a_capped_bound_that_more_motion_beats_is_not_given() -> None:
    """Up to motions of 18,000 N this grasp resists 8.2066 N; with 2e8 N it resists 8.23 N, as `check` says."""
    _, grasp, direction, options = question(897, 700_000)
    quick = Settings(time_limit=60.0)
    above = check(grasp, options["base"] + 8.2148 * direction, settings=quick)
    assert above.verdict is Verdict.HOLDS
    assert above.witness is not None
    assert above.witness.valid

    answer = maximum(grasp, direction, settings=quick, **options)

    assert answer.upper >= 8.2148
    assert answer.witness is not None
    assert answer.witness.valid
    assert answer.lower > 8.2066


def test_a_capped_bound_that_nothing_beats_is_given_with_its_cap() -> None:
    _, grasp, direction, options = question(588, 700_000)
    answer = maximum(grasp, direction, settings=Settings(time_limit=60.0), **options)
    assert answer.proof is not None
    assert answer.proof.cap is not None
    assert answer.upper - answer.lower <= 1e-3 * answer.upper
    for factor in np.geomspace(1.0001, 3.0, 6):
        assert check(grasp, factor * answer.upper * direction).verdict is Verdict.SLIPS
