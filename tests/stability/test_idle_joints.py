"""A finger in the air that is pulled and held by nothing: no load makes a difference."""

from collections.abc import Mapping
from typing import Any

import pytest

from handfast import Grasp, GraspJoint, Verdict, check, maximum
from handfast.model.mechanism import Mechanism
from handfast.stability.idle_joints import runs_away
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
