"""Boxes that a search sets aside: what has become small in one look is looked at once more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.core.branch import Discarded
from handfast.model.region import Bezier
from handfast.synthesis.search.boxes import SearchPart
from handfast.synthesis.search.prover import Prover
from handfast.synthesis.task import Task
from handfast.synthesis.task_file import load_task
from handfast.synthesis.task_problem import TaskProblem

PARTS = {  # of the range of a coordinate
    "joint:index_proximal": (0.0, 0.5),
    "joint:thumb_base": (0.25, 0.5),
    "joint:thumb_proximal": (0.0, 0.25),
    "joint:thumb_middle": (0.0, 0.25),
    "contact:1:t": (0.5, 1.0),
    "contact:1:v": (0.5, 1.0),
    "contact:2:s": (0.5, 1.0),
    "contact:2:t": (0.5, 1.0),
}


def far() -> Task:
    """The teapot's third region 0.195 m farther from the others than it is."""
    task = load_task("teapot-service")
    *others, last = task.contact_pairs
    assert isinstance(last.object, Bezier)
    away = Bezier(last.object.points + np.array([-0.05089123, 0.16352372, -0.09418319]), last.object.flip)
    return replace(task, contact_pairs=(*others, replace(last, object=away)))


@pytest.fixture(scope="module")
def problem() -> TaskProblem:
    return TaskProblem.of(far())


def test_rows_that_make_a_box_small_at_once_may_discard_what_they_left(problem: TaskProblem):
    """Here they cut a box of radians and decimetres to 10 micrometres, where nothing can be by 4 cm."""
    lower, upper = problem.flat.coordinates.lower, problem.flat.coordinates.upper
    ends = np.array([PARTS.get(label, (0.0, 1.0)) for label in problem.labels])
    box = lower[:, None] + (upper - lower)[:, None] * ends
    domain, small = Prover(problem, workers=1).domains["1-2"], []
    parts = [SearchPart(box, 1.0)]
    for _ in range(100):
        left = getattr(domain.examine(parts.pop()), "children", ())
        small += [part for part in left if part.small]
        parts += [part for part in left if not part.small]
        if not parts:
            break
    assert not parts
    assert not any(isinstance(domain.examine(SearchPart(part.box, 1.0)), Discarded) for part in small)
