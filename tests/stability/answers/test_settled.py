"""Answers whose witness cannot be proved claim nothing of it, and what is left of them is replayed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handfast import load_grasp
from handfast.core.answer import Stop, Verdict
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.check_query import ask as check
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum, torques

UP, ONE = [0, 1, 0, 0, 0, 0], Settings(jobs=1)


def spoilt(answer: Answer) -> Answer:
    """With forces that are 1 % too large, and a motion of the object that is reversed: nothing leads back from it."""
    assert answer.found is not None
    state = answer.found.state
    state = replace(state, c=1.01 * state.c, r=-state.r)
    return replace(answer, found=replace(answer.found, state=state))


@cache
def refused(ask: Callable[..., Answer]) -> Answer:
    """A spoilt answer, after everything was tried to prove it: which takes seconds."""
    return spoilt(ask(load_grasp("fig1"), UP, settings=ONE)).settled()


@pytest.mark.parametrize("ask", [check, maximum, torques])
@pytest.mark.slow
def test_undecided_without_a_witness_that_is_proved(ask) -> None:
    answer = ask(load_grasp("fig1"), UP, settings=ONE)
    assert answer.verdict is Verdict.HOLDS
    assert answer.settled().verdict is Verdict.HOLDS
    bad = refused(ask)
    assert (bad.verdict, bad.stop, bad.witness, bad.exact) == (Verdict.UNDECIDED, Stop.NUMERICAL, None, None)
    done = bad.verify()
    assert done.ok, done.reason


def test_bounds_of_what_is_not_proved() -> None:
    best = refused(maximum)
    assert (best.lower, best.unbounded) == (0.0, False)
    assert best.upper == pytest.approx(2.2268, abs=1e-3)
    least = refused(torques)
    assert (least.preload, least.upper) == (None, np.inf)


def test_where_what_was_found_is_between_modes_the_least_motion_is_proved_instead() -> None:
    best = maximum(load_grasp("fig1"), UP, settings=replace(ONE, verify=False))
    settled = best.settled()
    assert best.found is not None
    assert settled.exact
    assert settled.witness is settled.found
    assert settled.found.largest_motion < best.found.largest_motion
    assert settled.lower == pytest.approx(best.lower, rel=1e-8)
    assert not best._proved(best.found, tries=1).exact  # what was found is not shown at once
