"""What the evaluator finds wrong with a configuration whose distances and curvatures are known by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from handfast.core.transforms import transform
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap
from handfast.model.shape import Shape
from handfast.planning.evaluation.evaluator import COST_DEPTH, Evaluator, GraspCandidate
from handfast.planning.evaluation.steps import Steps
from handfast.planning.question import Allowed
from handfast.planning.search import RejectionReason
from handfast.stability.problem.loads import Loads
from handfast.synthesis.search.starts import Certified
from handfast.synthesis.task import ContactPair, Task
from handfast.synthesis.task_problem import TaskProblem

X, Y, Z = np.eye(3)
UP = Loads.wrench([0, 0, 1, 0, 0, 0], "up")  # onto the fingertip
BALL = 0.004  # [m] radius of the solids
APART = -1e-3  # [m] deep: not at all
IN = 2e-3


def groove(radius: float) -> Bezier:
    """A hollow of this radius along y in an object's upper side, its bottom in the origin: z = x^2 / (2 radius)."""
    ends = np.array([-0.01, 0.0, 0.01])
    height = np.array([1.0, -1.0, 1.0]) * 0.01**2 / (2 * radius)
    x, y = np.meshgrid(ends, ends, indexing="ij")
    return Bezier(np.stack([x, y, np.tile(height[:, None], 3)], axis=2))


def bench(
    allowed: Allowed, tip: float = 0.004, hollow: float = 0.005, itself: float = APART, body: float = APART, load=UP
) -> tuple[Evaluator, Certified]:
    """A ball of radius `tip` lies in a hollow; its finger slides along x.

    The finger's ball is `itself` deep in another link, and a third link's is `body` deep in the object.
    """
    slide = Joint("slide", "prismatic", X, np.zeros(3), -0.1, 0.1)
    wall = transform([2 * BALL - itself, 0, 0.03])
    arm = transform([0, 0.05, BALL - body])  # the object's upper face is where the tip touches it, 50 mm aside
    links = (
        Link("palm", -1, np.eye(4)),
        Link("tip", 0, np.eye(4), (0,), (Shape("sphere", BALL, transform([0, 0, 0.03])),)),
        Link("wall", 0, np.eye(4), (), (Shape("sphere", BALL, wall),)),
        Link("arm", 0, np.eye(4), (), (Shape("sphere", BALL, arm),)),
    )
    hand = Hand("slider", links, (slide,), Mechanism.direct(["slide"]), (), np.zeros(1))
    task = Task.of(hand, (ContactPair("tip", Cap([0, 0, tip], tip, -Z, np.pi), groove(hollow)),))
    problem = TaskProblem.of(task)
    value = {"quaternion:0": 1.0, "contact:0:s": 0.5, "contact:0:t": 0.5}
    x = np.array([value.get(label, 0.0) for label in problem.labels]) / problem.lengths
    solid = Body.of([Shape("box", (0.02, 0.02, 0.02), transform([0, 0.05, -0.01]))])
    collisions = Collisions(Scene(hand, solid), cutoff=5e-3, left_out=())
    return Evaluator(problem, collisions, load, 0.5, allowed), Certified(x, np.zeros(0, dtype=np.intp), np.zeros(0))


def evaluated(allowed: Allowed, **where: float) -> tuple[Evaluator, GraspCandidate]:
    evaluator, certified = bench(allowed, **where)
    found = evaluator.candidate(certified)
    assert found is not None
    return evaluator, found


def test_what_fits_is_possible_and_costs_nothing() -> None:
    _, found = evaluated(Allowed())
    assert (found.possible, found.cost, found.rim) == (True, 0.0, 0.0)
    assert found.clearances.least_between == pytest.approx(1e-3, abs=1e-6)
    assert found.clearances.least_to_object == pytest.approx(1e-3, abs=1e-6)


def test_a_ball_wider_than_its_hollow_curves_into_it() -> None:
    """10 mm in a hollow of 5 mm: 1/10 - 1/5 per mm, so 100 x^2 / 2 deep at the edge of a disc of x = 5 mm."""
    evaluator, found = evaluated(Allowed(at_contacts=1e-3), tip=0.010)
    assert found.rim == pytest.approx(-1.25e-3)
    assert not found.possible
    assert found.cost == pytest.approx(0.25e-3 / COST_DEPTH)
    assert evaluator.rejection(found) is RejectionReason.CURVED


def test_it_may_curve_as_deep_as_is_allowed_at_contacts_and_no_other_allowance_counts() -> None:
    _, found = evaluated(Allowed(at_contacts=1.3e-3), tip=0.010)
    assert (found.possible, found.cost) == (True, 0.0)
    assert found.rim == pytest.approx(-1.25e-3)
    _, found = evaluated(Allowed(depth=9e-3, self_depth=9e-3), tip=0.010)
    assert not found.possible


@pytest.mark.parametrize(
    ("where", "fault"),
    [({"itself": IN}, RejectionReason.ITSELF), ({"body": IN}, RejectionReason.OBJECT)],
    ids=["itself", "object"],
)
def test_each_kind_of_depth_has_its_own_allowance(where: dict[str, float], fault: RejectionReason) -> None:
    """2 mm deep, of which 0.5 mm or 5 mm are let pass, while the other kind is let pass 5 mm or 0.5 mm."""
    strict = {RejectionReason.ITSELF: Allowed(5e-3, 5e-3, 0.5e-3), RejectionReason.OBJECT: Allowed(0.5e-3, 5e-3, 5e-3)}
    evaluator, found = evaluated(strict[fault], **where)
    assert not found.possible
    assert found.cost == pytest.approx(1.5e-3 / COST_DEPTH, rel=1e-3)
    assert evaluator.rejection(found) is fault
    generous = {
        RejectionReason.ITSELF: strict[RejectionReason.OBJECT],
        RejectionReason.OBJECT: strict[RejectionReason.ITSELF],
    }
    _, found = evaluated(generous[fault], **where)
    assert (found.possible, found.cost) == (True, 0.0)


def test_the_worst_excess_is_named() -> None:
    """Both 2 mm deep: what counts is by how much each is deeper than allowed."""
    for allowed, fault in (
        (Allowed(0.5e-3, 1e-3, 1e-3), RejectionReason.OBJECT),
        (Allowed(1e-3, 1e-3, 0.5e-3), RejectionReason.ITSELF),
    ):
        evaluator, found = evaluated(allowed, itself=IN, body=IN)
        assert found.cost == pytest.approx(2.5e-3 / COST_DEPTH, rel=1e-3)
        assert evaluator.rejection(found) is fault


def test_a_load_that_nothing_balances() -> None:
    evaluator, certified = bench(Allowed(), load=Loads.wrench([0, 0, -1, 0, 0, 0], "off"))
    found = evaluator.candidate(certified)
    assert found is not None
    assert not found.possible
    assert found.rim == 0.0
    assert evaluator.rejection(found) is RejectionReason.UNBALANCED


def test_a_step_presses_on_what_is_deeper_than_its_own_allowance() -> None:
    """The finger is 2 mm deep in the wall, which lies along +x: downhill is -x, by the slide or by the object."""
    for self_depth, depth, moves in ((1e-3, 9e-3, True), (3e-3, 0.1e-3, False)):
        evaluator, found = evaluated(Allowed(depth, 1e-3, self_depth), itself=IN)
        n = evaluator.problem.n
        steps = Steps(evaluator, SimpleNamespace(weight=np.ones(n)), np.random.default_rng(0))  # type: ignore[arg-type]
        direction = steps.direction(found)
        assert (direction is not None) == moves
        if direction is not None:
            slide = evaluator.problem.labels.index("joint:slide")
            assert direction[slide] < 0
            assert not np.delete(direction, slide).any()
