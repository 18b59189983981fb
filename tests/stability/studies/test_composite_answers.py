"""`verify()` of answers that are made of others: all of their parts are replayed, and planted faults are refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np

from handfast import verify
from handfast.core.answer import Verdict
from handfast.stability.answers.margin import Margin, rubbed
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.model import scaled
from handfast.stability.studies.maps import sweep
from handfast.stability.studies.margin_search import margin
from handfast.stability.studies.questions import check, force_map, hold
from tests.support.problems import pinch

UP, SIDE = np.array([0, 1.0, 0, 0, 0, 0]), np.array([0.2, 0, 0, 0, 0, 0])
LOADS = Loads(("up", "side"), np.array([UP, SIDE]))


@cache
def leaning() -> Margin:
    found = margin(pinch(), 0.05 * UP)
    assert found is not None
    return found


def test_flips_of_a_margin_are_replayed() -> None:
    m = leaning()
    done = verify(m)
    assert done.ok, done.reason
    assert m.less.answer is not None
    less = done.part("less friction")
    assert done.part("motion") is not None
    assert less is not None
    assert less.part("certificate") is not None
    assert any(line.startswith("holds: ") for line in done.not_replayed)
    wider = replace(m, less=replace(m.less, holds=0.0, slips=0.5 * (m.less.slips or 1.0)))
    assert wider.verify().reason == "less friction: the answer is about another change"
    bare = replace(m, less=replace(m.less, answer=None))
    assert bare.verify().reason == "less friction: without an answer that it slips"
    crossed = replace(m, less=replace(m.less, holds=0.99)).verify()
    assert re.fullmatch(r"less friction: it slips at \S+, and holds up to 0.99", crossed.reason)
    tight = check(rubbed(pinch(), 0.99), 0.05 * UP, limits=GraspLimits(force_limit=1e-3))
    assert tight.verdict is Verdict.SLIPS
    forged = replace(m, less=replace(m.less, holds=0.0, slips=0.01, answer=tight))
    assert forged.verify().reason == "less friction: the answer is about another change"
    found = replace(m.held.found, state=scaled(m.witness.state, 2.0))
    moved = replace(m, held=replace(m.held, found=found))
    assert moved.verify().reason.startswith("motion: witness: ")


def test_maps_and_sweeps_say_that_nothing_is_replayed() -> None:
    for answer in (force_map(pinch(), steps=2), sweep(pinch(), "right", [0.1], [UP])):
        done = verify(answer)
        assert not done.ok
        assert done.reason.startswith("maps and sweeps keep no witnesses and certificates")
        assert done.replayed == ()
        assert any(line.startswith("lower, upper") for line in done.not_replayed)


def test_a_hold_says_of_a_state_that_is_none_what_its_check_says() -> None:
    """Twice the motions and forces of a state hold twice the load: that its proof fails is the fault that is told."""
    answer = hold(pinch(), LOADS)
    first = answer.checks[0]
    assert first.found is not None
    wrong = replace(first, found=replace(first.found, state=scaled(first.found.state, 2.0)))
    done = replace(answer, checks=(wrong, *answer.checks[1:])).verify()
    assert done.reason.startswith("up: witness: "), done.reason
