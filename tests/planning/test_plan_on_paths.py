"""Plans whose grasps hold every load on its path: first the squeeze, then the load."""

from __future__ import annotations

import pytest

from handfast import InputError
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.planning.evaluation.attempt import Attempts
from handfast.planning.evaluation.preload_search import held, held_again
from handfast.planning.question import PlanLimits, PlanOptions, TaskGraspOptions
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Settings
from tests.support.jaws_on_paths import FIRST, jaw

ALONG = PlanLimits(loading=FIRST)
LOADS = Loads(("back",), [[-0.6, 0.6, 0, 0, 0, 0]])


def test_a_preload_is_looked_for_and_asked_again_on_paths() -> None:
    """Of the jaw 0.9 N hold the load after the squeeze, and 1.2 N together."""
    found = held(jaw(), LOADS, ALONG, Settings(gap=1e-2), least=False)
    assert found.preload == {"jaw": pytest.approx(0.9, rel=1e-2)}
    assert found.loading == FIRST
    known = {"jaw": 1.0}, 0.0, 1.0
    again = held_again(jaw(), LOADS, ALONG, Settings(), known, 0)
    assert again is not None
    assert again.loading == FIRST
    assert again.verify().ok
    assert held_again(jaw(), LOADS, PlanLimits(), Settings(), known, 0) is None


def test_the_loading_is_part_of_the_question() -> None:
    hand, body = load_hand("parallel-gripper"), Body.of([Shape("box", (0.04,) * 3)], mass=0.05)
    asked = [Attempts(hand, body, LOADS, PlanOptions(limits=x)).question for x in (PlanLimits(), ALONG)]
    assert asked[0] != asked[1]


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match="'preload-first' or 'together'"):
        PlanLimits(loading="later")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="plan knows it"):
        TaskGraspOptions(limits=ALONG)
