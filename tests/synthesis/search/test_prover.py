"""The prover: nothing is lost around a solution, what cannot be is discarded, and a search goes on where it stopped."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handfast.core.branch import BranchAndPrune, Discarded
from handfast.core.errors import InputError
from handfast.model.region import Bezier, Cap
from handfast.synthesis.search.boxes import BoxDomain, PoseSpace, SearchPart
from handfast.synthesis.search.prover import CELLS, LEAVES, POSES, Prover
from handfast.synthesis.search.starts import Starts
from handfast.synthesis.search.workspace import CenteredBox
from handfast.synthesis.task import PoseBounds, Task
from handfast.synthesis.task_file import load_task
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import grip, pinch
from tests.support.planted import bump
from tests.support.synthesis_kernel import coordinates, everything
from tests.support.synthesis_pieces import Turned, ask

TASKS = ("scalpel-handling", "teapot-service", "guitar-holding")


def about(domain: BoxDomain, x: np.ndarray, size: float, rng: np.random.Generator) -> SearchPart:
    """A box around x, in the domain's coordinates, which lies anywhere in it."""
    root = next(p.box for p in domain.roots if ((p.box[:, 0] <= x) & (x <= p.box[:, 1]))[domain.use].all())
    lower = np.maximum(root[:, 0], x - size * rng.random(len(x)))
    return SearchPart(np.column_stack([lower, np.minimum(root[:, 1], x + size * rng.random(len(x)))]), 1.0)


def kept(prover: Prover, x: np.ndarray, size: float, rng: np.random.Generator, budget: int) -> bool:
    """Does every search keep the solution x?"""
    for domain in prover.domains.values():
        y = domain.coordinates(x)
        left = getattr(domain.examine(about(domain, y, size, rng), budget=budget), "children", ())
        use = domain.concern
        if not any(((p.box[use, 0] <= y[use]) & (y[use] <= p.box[use, 1])).all() for p in left):
            return False
    return True


@pytest.mark.parametrize("name", TASKS)
def test_never_discards_a_box_around_a_solution(name: str):
    problem = TaskProblem.of(load_task(name))
    prover, rng = Prover(problem, workers=1), np.random.default_rng(1)
    found = Starts(problem, 0).run(20)
    assert len(found) == 20
    for certified in found:
        for size in (2.0, 0.3, 0.05, 1e-3):
            assert kept(prover, certified.x, size, rng, budget=40)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.slow
def test_never_discards_a_planted_solution_with_every_kind_of_joint_and_region(seed: int):
    planted = everything(seed)
    bound = planted.pose[:3, 3, None] + [-0.01, 0.01]
    axes = np.clip(planted.pose[:3, :3].T[..., None] + [-0.2, 0.1], -1, 1)
    task = replace(planted.task, pose=PoseBounds(bound, axes))
    problem = TaskProblem.of(task)
    prover, rng = Prover(problem, workers=1), np.random.default_rng(seed)
    assert len(prover.domains) == 2**6 - 1 - 6 + 1  # five contacts and the object's origin, and the poses
    x = coordinates(replace(planted, task=task), problem)
    assert all(kept(prover, x, size, rng, budget=20) for size in (1.0, 0.1, 1e-3))


def moved(task: Task, k: int, by: list[float]) -> Task:
    pairs = list(task.contact_pairs)
    region = pairs[k].object
    pairs[k] = replace(pairs[k], object=Bezier(region.points + by, region.flip))
    return replace(task, contact_pairs=tuple(pairs))


def test_a_block_wider_than_the_gripper_opens():
    done = Prover(TaskProblem.of(grip(0.082)), workers=1).run(nodes=4000)
    assert done.empty
    assert done.by == "contacts 0 and 1"


def test_a_block_a_little_narrower_than_the_gripper_opens():
    problem = TaskProblem.of(grip(0.079))
    (found,) = Starts(problem, 0).run(1)
    prover = Prover(problem, workers=1)
    done = prover.run(nodes=4000)
    assert not done.empty
    assert done.nodes < 4000  # it ended by itself: there are small boxes that nothing excludes
    assert len(prover.leaves()) >= LEAVES
    assert kept(Prover(problem, workers=1), found.x, 1.0, np.random.default_rng(0), budget=40)


def test_an_object_out_of_reach():
    far = PoseBounds(np.array([[0.5, 0.6], [-0.1, 0.1], [-0.1, 0.1]]), PoseBounds.none().axes)
    done = Prover(TaskProblem.of(pinch(pose=far)), workers=2).run(nodes=200_000)
    assert done.empty
    assert done.by == "contact 0 and the object's position"


def test_an_object_within_reach():
    near = PoseBounds(np.array([[-0.6, 0.6], [-0.6, 0.6], [-0.6, 0.6]]), PoseBounds.none().axes)
    problem = TaskProblem.of(pinch(pose=near))
    (found,) = Starts(problem, 0).run(1)
    prover, rng = Prover(problem, workers=2), np.random.default_rng(0)
    assert all(kept(prover, found.x, size, rng, budget=40) for size in (2.0, 0.3, 1e-3))
    assert not prover.run(nodes=20_000).empty
    boxes = [p.box for p in prover.searches[prover.whole].pending]
    at = prover.domains[prover.whole]
    x, use = at.coordinates(found.x), at.concern
    assert any(((b[use, 0] <= x[use]) & (x[use] <= b[use, 1])).all() for b in boxes)


def test_a_finger_that_bends_comes_no_farther():
    """Counted in boxes: 15,765 when second derivatives of a finger had no signs; then 7,967."""
    task = moved(load_task("guitar-tuning"), 1, [0.0, 0.0, 0.2])
    done = Prover(TaskProblem.of(task), workers=1).run()
    assert done.empty
    assert 3000 < done.nodes < 11_000


def test_normals_that_face_the_same_way():
    task = grip(0.05)
    a, b = task.contact_pairs
    turned = replace(b, object=Bezier(b.object.points, not b.object.flip))
    assert Prover(TaskProblem.of(replace(task, contact_pairs=(a, turned))), workers=1).run(nodes=20_000).empty


def test_joint_limits_that_keep_the_fingers_apart():
    task = pinch(0.03)
    apart = {j: (0.0, 0.25) for f in ("index", "thumb") for j in (f"{f}_proximal", f"{f}_middle", f"{f}_distal")}
    tight = Task.of(task.hand, task.contact_pairs, limits=apart)
    assert not Starts(TaskProblem.of(tight), 0).run(1)
    assert Prover(TaskProblem.of(tight), workers=2).run(nodes=200_000).empty


def test_an_axis_that_cannot_point_there():
    # each jaw touches along its own y: the object's y cannot point along the palm's z
    axes = np.array(PoseBounds.none().axes)
    axes[1, 2] = [0.9, 1.0]
    pose_bounds = PoseBounds(PoseBounds.none().position, axes)
    assert Prover(TaskProblem.of(grip(0.05, pose=pose_bounds)), workers=1).run(nodes=20_000).empty


def test_goes_on_from_a_saved_state_to_the_same_end():
    problem = TaskProblem.of(moved(pinch(0.03), 0, [0, 0.14, 0]))
    whole = Prover(problem, workers=1).run()
    assert whole.empty
    assert whole.nodes > 4000
    stopped = Prover(problem, workers=1)
    first, state = stopped.run(nodes=2000), json.loads(json.dumps(stopped.save()))
    assert not first.empty
    assert 0 < first.smallest <= first.largest
    second = Prover(problem, workers=1).run(state=state)
    assert second.empty
    assert second.nodes == whole.nodes
    other = Prover(TaskProblem.of(grip(0.05)), workers=1)
    with pytest.raises(InputError, match=r"box: has \d+ intervals, needs \d+|has other searches"):
        other.restore(state)


@pytest.mark.filterwarnings("error")
def test_an_interruption_while_threads_end_is_heard(monkeypatch: pytest.MonkeyPatch):
    """A search ends its threads with every turn; what is raised there was lost when its loop was only collected."""

    class Interrupted(ThreadPoolExecutor):
        def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
            super().shutdown(wait, cancel_futures=cancel_futures)
            raise KeyboardInterrupt

    prover = Prover(TaskProblem.of(load_task("scalpel-handling")), workers=2)
    monkeypatch.setattr("handfast.core.branch.ThreadPoolExecutor", Interrupted)
    assert prover.run(nodes=100).interrupted
    assert prover.run(nodes=100_000).interrupted  # at the end of the first turn
    assert prover.nodes < 10_000


def test_small_boxes_are_set_aside_undecided():
    # exactly as wide as the gripper opens: neither proved to be there nor excluded
    problem = TaskProblem.of(grip(0.08))
    prover = Prover(problem, workers=1)
    done = prover.run(nodes=50_000)
    assert not done.empty
    assert done.nodes < 50_000
    assert len(prover.leaves()) >= LEAVES
    assert done.smallest < 1e-5
    assert not Starts(problem, 0).run(1)


def test_the_share_that_is_discarded_adds_up():
    domain = next(iter(Prover(TaskProblem.of(moved(pinch(0.03), 0, [0, 0.14, 0])), workers=1).domains.values()))
    search = BranchAndPrune(domain, domain.roots)
    for state in search:
        left = sum(p.share for p in search.pending)
        assert state.discarded + left == pytest.approx(1.0, abs=1e-12)
    assert isinstance(state.outcome, Discarded)


@pytest.mark.parametrize("seed", range(12))
def test_constants_bound_the_derivatives_of_regions(seed: int):
    rng = np.random.default_rng(seed)
    region = bump(rng, tuple(rng.integers(1, 5, 2)), flip=bool(seed % 2))
    surfaces, normals = region.derivative_bounds(CELLS)
    orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    step = 1e-4

    def unit(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        n = region.normal(u, v)
        return n / np.linalg.norm(n, axis=1)[:, None]

    for i, j in ((0, 0), (3, 5), (7, 2)):
        u, v = (np.array([[i], [j]]) + rng.random((2, 200))) / CELLS
        for k, order in enumerate(orders):
            length = np.linalg.norm(region.at(u, v, *order), axis=1).max()
            assert length <= surfaces[i, j, k] * (1 + 1e-9)
            a, b = (step * np.array(o) for o in ((1, 0), (0, 1)))
            d = a if order[0] else b
            if sum(order) == 1:
                slope = (unit(u + d[0], v + d[1]) - unit(u - d[0], v - d[1])) / (2 * step)
            elif order == (1, 1):
                along = unit(u + step, v + step) + unit(u - step, v - step)
                slope = (along - unit(u + step, v - step) - unit(u - step, v + step)) / (4 * step**2)
            else:
                slope = (unit(u + d[0], v + d[1]) - 2 * unit(u, v) + unit(u - d[0], v - d[1])) / step**2
            largest = np.linalg.norm(slope, axis=1).max()
            assert largest <= normals[i, j, k] * (1 + 1e-3) + 1e-5
            assert length >= 0.3 * surfaces[i, j, k] or sum(order) == 2  # bounds, but not idle ones
    cap = Cap([0, 0, 0], 0.02, [0, 0, 1], 1.0)
    assert cap.derivative_bounds(CELLS)[0].max() == 0.02


# --- pose by pose ---------------------------------------------------------------------------------


def alone(prover: Prover, state: dict | None = None, calls: int | None = None) -> BranchAndPrune:
    """The search of the poses alone, to its end or for some calls."""
    domain = prover.domains[POSES]
    search = BranchAndPrune.restored(domain, state) if state else BranchAndPrune(domain, domain.roots)
    for n, _ in enumerate(search):
        if n + 1 == calls or search.state.unfinished:
            break
    return search


def impossible() -> Task:
    """A region of an incision far from where it can be."""
    return moved(load_task("scalpel-incision"), 3, [0.0, 0.0, 0.4])


def test_the_poses_alone_show_that_a_hold_is_impossible():
    problem = TaskProblem.of(impossible())
    search = alone(Prover(problem, workers=1))
    assert search.state.pending == 0
    assert not search.state.unfinished
    assert search.state.discarded == pytest.approx(1.0)
    whole = Prover(problem, workers=1)
    whole.searches = {POSES: whole.searches[POSES]}
    done = whole.run()
    assert done.empty
    assert done.by == "all contacts, pose by pose"


def test_the_poses_go_on_from_the_middle():
    prover = Prover(TaskProblem.of(impossible()), workers=1)
    whole = alone(prover)
    stopped = alone(prover, calls=3)
    assert stopped.state.pending
    again = alone(prover, json.loads(json.dumps(stopped.save())))
    assert not again.state.pending
    assert (again.state.nodes, again.state.steps) == (whole.state.nodes, whole.state.steps)


def test_the_poses_of_a_possible_hold_are_not_discarded():
    problem = TaskProblem.of(load_task("scalpel-handling"))
    prover = Prover(problem, workers=1)
    search, domain = alone(prover, calls=30), prover.domains[POSES]
    assert 0 < search.state.discarded < 1
    boxes = [part.box for part in (*search.pending, *search.state.unfinished)]
    found = Starts(problem, 0).run(20)
    assert len(found) == 20
    for certified in found:
        y = domain.coordinates(certified.x)[domain.concern]
        assert any(((b[domain.concern, 0] <= y) & (y <= b[domain.concern, 1])).all() for b in boxes)


def test_states_of_other_searches_are_refused():
    prover = Prover(TaskProblem.of(impossible()), workers=1)
    state = prover.save()
    del state["sets"][POSES]
    with pytest.raises(InputError, match="it lacks poses; start anew"):
        prover.restore(state)


def test_boxes_of_poses_hand_on_what_is_left_of_each_contact():
    """Counted in boxes: 135,337 when each began anew, and a finger's second derivatives had no signs; then 75,986."""
    task = moved(load_task("scalpel-incision"), 3, [0.0, 0.0, 0.2])
    search = alone(Prover(TaskProblem.of(task), workers=1))
    assert not search.state.pending
    assert not search.state.unfinished
    assert 30_000 < search.state.nodes < 100_000


def test_two_contacts_have_no_search_of_poses():
    assert POSES not in Prover(TaskProblem.of(pinch()), workers=1).domains


@cache
def posed() -> tuple[TaskProblem, PoseSpace]:
    problem = TaskProblem.of(impossible())
    return problem, PoseSpace(problem, np.zeros((4, 2, 1, 1, 10)))


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_charts_hold_every_pose(q: list[float]):
    problem, domain = posed()
    x = 0.5 * (problem.flat.coordinates.lower + problem.flat.coordinates.upper)
    x[domain.at + 3 : domain.at + 7] = q
    y = domain.coordinates(x)
    inside = [bool(((p.box[:, 0] <= y) & (y <= p.box[:, 1])).all()) for p in domain.roots]
    assert sum(inside) >= 1
    back, there = (Rotation.from_quat(v[domain.at + 3 : domain.at + 7], scalar_first=True) for v in (x, y))
    np.testing.assert_allclose(back.as_matrix(), there.as_matrix(), atol=1e-12)
    origin = y[domain.at : domain.at + 3] - there.apply(domain.middle)
    np.testing.assert_allclose(origin, x[domain.at : domain.at + 3], atol=1e-12)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1.0, 0.3, 0.03, 1e-3]), st.integers(0, 3))
def test_the_polynomial_of_a_rotation_holds_its_points(seed: int, size: float, chart: int):
    rng = np.random.default_rng(seed)
    ends = np.sort(np.clip(rng.uniform(-1, 1, (4, 1)) + size * rng.uniform(-1, 1, (4, 2)), -1, 1), axis=1)
    ends[chart] = 1.0
    x, h, R, w = ends.mean(axis=1), np.ptp(ends, axis=1) / 2, np.zeros((3, 3)), np.zeros((4, 3))
    ask("turned", CenteredBox(x, h, -h, h), found := Turned(R, w, np.zeros(2)))
    theta, curve = found.bounds
    np.testing.assert_allclose(R, Rotation.from_quat(x, scalar_first=True).as_matrix(), atol=1e-14)
    point = rng.normal(size=3)
    d = h * rng.choice([-1.0, 1.0, *rng.uniform(-1, 1, 3)], (50, 4))
    turned = Rotation.from_quat(x + d, scalar_first=True).apply(point)
    linear = R @ point + d @ np.cross(w, R @ point)
    assert (np.linalg.norm(turned - linear, axis=1) <= curve * np.linalg.norm(point)).all()
    assert (np.linalg.norm(turned - R @ point, axis=1) <= theta * np.linalg.norm(point)).all()
