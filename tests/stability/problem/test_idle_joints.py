"""A finger that is pulled away and held by nothing: no load makes a difference."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from handfast import Contact, Grasp, GraspJoint, Verdict, check, max_many, maximum
from handfast.model.mechanism import Mechanism
from handfast.stability.problem.equivalent_grasp import runs_away
from tests.support.law_grasps import OPENS, jaw


def beside(preload: Mapping[str, float], *, tendon: bool = False, **laws: Any) -> Grasp:
    """A locked jaw, and a finger in the air with a motor of its own."""
    idle = GraspJoint("idle", [0, -1, 0], [0.5, 0, 0], (), **laws)
    motors = Mechanism(("hinge", "idle"), [[1.0, 0.0], [0.0, 2.0]], [], (False, tendon))  # type: ignore[arg-type]
    return Grasp([*jaw().contacts], [jaw().joints[0], idle], motors, preload)


@pytest.mark.parametrize(
    ("grasp", "away"),
    [
        (beside({}), False),
        (beside({"idle": 0.05}), True),
        (beside({"idle": 0.05}, friction=0.05), True),  # 0.1 N m against 0.05
        (beside({"idle": 0.05}, friction=0.15), False),
        (beside({"idle": 0.05}, stop="upper"), False),
        (beside({"idle": 0.05}, stop="lower"), True),
        (beside({"idle": 0.05}, torque=-0.2), False),  # the spring holds it, and the gears hold the spring
        (beside({}, torque=0.1), False),  # locked
        (beside({}, torque=0.1, tendon=True), True),  # a tendon cannot push
        (beside({}, torque=0.1, friction=0.1, tendon=True), False),
        (beside({"hinge": 0.1}), False),
    ],
)
def test_what_runs_away_is_seen_and_slips(grasp: Grasp, away: bool) -> None:
    """Before, loads ten thousand times what pulls it were called resisted, for rounding."""
    assert runs_away(grasp) == away
    found = maximum(grasp, OPENS)
    verified = found.verify()
    assert verified.ok, verified.reason
    assert found.verdict is (Verdict.SLIPS if away else Verdict.HOLDS)
    assert check(grasp, OPENS).verdict is found.verdict


@pytest.mark.parametrize("friction", [0.0, 0.1])
@pytest.mark.parametrize("backdrivable", [False, True])
def test_a_finger_that_leaves_its_contact_runs_away_under_every_load(friction: float, backdrivable: bool) -> None:
    """A table, and a finger beside it whose motor pulls it off: 0.2 N m against friction of 0.1 at most.

    Loads 10^10 times as large as the pull were called resisted, where 0.2 N m are less than rounding.
    """
    table = [Contact([0.01 * np.cos(t), 0.01 * np.sin(t), 0], [0, 0, 1], 0.5) for t in (0, 2, 4)]
    finger = GraspJoint("finger", [0, -1, 0], [0.02, 0, -0.1], (3,), friction=friction)
    motor = Mechanism(("finger",), [[1.0]], np.zeros((0, 1)), (False,), (backdrivable,))  # type: ignore[arg-type]
    grasp = Grasp([*table, Contact([0.02, 0, 0.01], [-1, 0, 0], 0.5)], [finger], motor, {"finger": -0.2})
    down = [0, 0, -1]
    found = maximum(grasp, down)
    assert (found.verdict, found.lower, found.upper) == (Verdict.SLIPS, 0, 0)
    assert found.verify().ok
    assert check(grasp, down).verdict is Verdict.SLIPS
    assert max_many(grasp, [down]).verdict[0] == "slips"
    pressed = grasp.with_preload({"finger": 0.2})
    assert maximum(pressed, down).unbounded
    assert check(pressed, [0, 0, -100]).verdict is Verdict.HOLDS  # 0.2 / 0.11 N sideways, against 50 N of friction
