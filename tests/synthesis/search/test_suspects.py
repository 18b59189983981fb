"""Sets of contacts that may be impossible, and how much of the prover's time they have."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from handfast.synthesis.search.boxes import STEP_NODES
from handfast.synthesis.search.prover import POSES, Prover, suspects
from handfast.synthesis.task import PoseBounds
from handfast.synthesis.task_file import load_task
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import pinch
from tests.synthesis.search.test_small_boxes import far


def sets(points: int) -> list[tuple[int, ...]]:
    return [s for size in range(2, points + 1) for s in combinations(range(points), size)]


def test_two_contacts_that_are_too_far_apart_are_suspected_and_all_sets_that_hold_them():
    assert suspects(far(), sets(3)) == {(1, 2): True, (0, 1, 2): False}


def test_of_a_task_that_is_possible_only_the_whole_is_left():
    assert suspects(load_task("scalpel-incision"), sets(4)) == {(0, 1, 2, 3): True}


def test_the_bounds_of_the_position_belong_to_the_origin_alone():
    out = PoseBounds(np.array([[0.5, 0.6], [-0.1, 0.1], [-0.1, 0.1]]), PoseBounds.none().axes)
    assert suspects(pinch(pose=out), sets(3)) == {(0, 2): True, (1, 2): True, (0, 1, 2): False}


@pytest.mark.slow
def test_two_contacts_that_are_suspected_have_most_of_the_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handfast.synthesis.search.prover.SLICE_BOXES", STEP_NODES)
    prover = Prover(TaskProblem.of(far()), workers=1)
    prover.run(nodes=200_000)
    boxes = {name: search.state.nodes for name, search in prover.searches.items()}
    assert boxes["1-2"] > 0.6 * sum(boxes.values())
    assert min(boxes[POSES], boxes["0-1-2"]) > 2500  # which have their shares too
    # but not the sets of which a configuration is known: these had the short turns before that, no more
    assert max(boxes["0-1"], boxes["0-2"]) < 0.1 * sum(boxes.values())


@pytest.mark.slow
def test_poses_have_most_of_the_time_where_no_two_contacts_are_suspected(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handfast.synthesis.search.prover.SLICE_BOXES", STEP_NODES)
    prover = Prover(TaskProblem.of(load_task("scalpel-incision")), workers=1)
    prover.run(nodes=200_000)
    assert prover.searches[POSES].state.nodes > 0.6 * prover.nodes
    assert prover.searches[prover.whole].state.nodes > 1000
