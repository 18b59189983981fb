"""Two contacts and one load: balance is an equation, which is solved; what comes of it holds and is called fragile."""

from __future__ import annotations

import numpy as np
import pytest

from handfast import InputError, Reach, check, grasp_for, load_body, load_task
from handfast.planning.evaluation.steps import ARM_TOLERANCE, LineBalance
from handfast.stability.problem.loads import Loads
from handfast.synthesis.search.starts import Starts, Walks
from handfast.synthesis.solution import Solution, verify_existence
from handfast.synthesis.task_problem import TaskProblem

LID = "teapot-lid-lifting"
BODY = load_body("teapot")
DOWN = Loads.gravity(BODY, ["-y"])


@pytest.fixture(scope="module")
def walks() -> Walks:
    return Walks(Starts(TaskProblem.of(load_task(LID)), 0))


def test_configurations_are_moved_to_where_the_load_has_no_arm(walks: Walks) -> None:
    line, problem = LineBalance(walks, DOWN), walks.problem
    solved = 0
    for start in walks.starts.run(8):
        end = line.balanced(start)
        if end is start:
            continue
        solved += 1
        solution = Solution.of(problem.task, end.existence(problem))
        assert verify_existence(problem.task, solution.existence).ok
        R, p = solution.pose[:3, :3], solution.pose[:3, 3]
        a, b = (solution.points - p) @ R - BODY.center_of_mass
        assert abs(np.cross(a, b)[1]) / np.linalg.norm(b - a) < 1e-12  # [m] of a weight along y
        assert line.balanced(end) is end
    assert solved >= 5


def test_only_loads_that_are_multiples_of_one_are_one_equation(walks: Walks) -> None:
    start = walks.starts.run(1)[0]
    for loads, is_one in (
        (Loads.gravity(BODY, ["-y", "+y"]), True),
        (DOWN + Loads(("half",), 0.5 * DOWN.wrenches), True),
        (Loads.gravity(BODY, ["-y", "+x"]), False),
        (Loads.gravity(BODY), False),
        (Loads.wrench([0, 0, 0, 0, 0, 1]), False),  # a torque has no arm
    ):
        line = LineBalance(walks, loads)
        assert (line.load is not None) == is_one
        if not is_one:
            assert line.balanced(start) is start
    three = Walks(Starts(TaskProblem.of(load_task("teapot-service")), 0))
    assert LineBalance(three, DOWN).load is None


def test_arm_of_a_weight_is_its_distance_across_the_line(walks: Walks) -> None:
    """At the middles of both regions, by the moment about the centre of mass."""
    line = LineBalance(walks, DOWN)
    a, b = (pair.object.middle[0] - BODY.center_of_mass for pair in walks.problem.task.contact_pairs)
    arm = np.array([0.0, -1.0, 0.0]) @ np.cross(a, b) / np.linalg.norm(b - a)
    assert line.arm(np.full(4, 0.5)) == pytest.approx(arm, abs=ARM_TOLERANCE)


@pytest.mark.slow
def test_lid_is_lifted_and_the_grasp_is_called_fragile() -> None:
    answer = grasp_for(load_task(LID), BODY, DOWN, count=1, timeout=120, jobs=1)
    assert answer.verdict is Reach.FOUND
    assert answer.balance is None
    (best,) = answer.grasps
    assert best.fragile
    assert answer.verify().ok
    assert check(best.grasp, DOWN.wrenches[0]).verdict == "holds"
    with pytest.raises(InputError, match="cannot be balanced by any forces at these 2 contacts"):
        check(best.grasp, Loads.gravity(BODY, ["-x"]).wrenches[0])
    assert answer.to_json()["grasps"][0]["fragile"] is True
