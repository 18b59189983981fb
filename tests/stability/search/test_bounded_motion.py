"""Bounds up to a cap on motions are none where a state that moves more does better."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.grasps import random_case
from benchmarks.no_cap import question
from handfast.core.answer import Verdict
from handfast.readers.grasp_file import load_grasp
from handfast.stability.answers.check_query import ask as check
from handfast.stability.studies.questions import maximum, torques

DATA = Path(__file__).parents[2] / "data"


def test_a_capped_bound_that_more_motion_beats_is_not_given() -> None:
    """Up to motions of 18,000 N this grasp resists 8.2066 N; with 2e8 N it resists 8.23 N, as `check` says."""
    _, grasp, direction, options = question(897, 700_000)
    above = check(grasp, options["base"] + 8.2148 * direction)
    assert above.verdict is Verdict.HOLDS
    assert above.witness is not None
    assert above.witness.valid

    answer = maximum(grasp, direction, **options)

    assert answer.upper >= 8.2148
    assert answer.witness is not None
    assert answer.witness.valid
    assert answer.lower > 8.2066


def test_a_bound_that_a_plain_order_of_cases_shows_up_to_a_cap_only() -> None:
    """Where contacts are split by lines, no cap is needed."""
    _, grasp, direction, options = question(588, 700_000)
    answer = maximum(grasp, direction, **options)
    assert answer.proof is not None
    assert answer.proof.cap is None
    assert answer.upper - answer.lower <= 1e-3 * answer.upper
    for factor in np.geomspace(1.0001, 3.0, 6):
        assert check(grasp, factor * answer.upper * direction).verdict is Verdict.SLIPS


def test_least_commands_that_only_a_farther_cap_shows() -> None:
    """A Barrett hand holds an egg's weight with 0.1114 N m; with motions of 39,000 N at most it needs 0.1535 N m."""
    grasp = load_grasp(DATA / "egg-83.json")
    assert grasp.mass is not None
    answer = torques(grasp, [0, 0, 9.81 * grasp.mass])
    assert answer.verdict is Verdict.HOLDS
    assert answer.upper <= 0.1115
    assert answer.lower >= 0.1112
    assert answer.witness is not None
    assert answer.witness.valid
    assert answer.preload is not None
    more = grasp.with_commands({name: 1.01 * command for name, command in answer.preload.items()})
    assert check(more, [0, 0, 9.81 * grasp.mass]).verdict is Verdict.HOLDS


def test_what_a_maximum_holds_slips_in_no_check() -> None:
    """The witness of this maximum moves 8e5 N; up to 7e4 N nothing holds it, and the search without a cap is lost."""
    case = random_case(4, 8_800_435)
    base = np.array([0.36844, -0.474608, 0.115529, -0.0037204, -0.0029699, -0.0033886])
    most = maximum(case.grasp, case.direction, base=base)
    assert most.lower == pytest.approx(6.713, rel=1e-3)
    for share in (1.0, 1 - 1e-8, 1 - 1e-5):
        there = check(case.grasp, base + share * most.lower * case.direction)
        assert there.verdict is not Verdict.SLIPS
    assert check(case.grasp, base + 0.999 * most.lower * case.direction).verdict is Verdict.HOLDS
