"""The prover: nothing is lost around a solution, what cannot be is discarded, and a search goes on where it stopped."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from holdfast.branch import Discarded, Search
from holdfast.errors import InputError
from holdfast.region import Bezier, Cap
from holdfast.synthesis.problem import Problem
from holdfast.synthesis.prover import CELLS, Part, Prover, bounds
from holdfast.synthesis.starts import Starts
from holdfast.synthesis.task import PoseBounds, Task
from holdfast.synthesis.task_file import load_task
from holds import grip, pinch
from planted import bump
from test_synthesis_kernel import coordinates, everything

TASKS = ("scalpel-handling", "teapot-service", "guitar-holding")


def about(problem: Problem, x: np.ndarray, size: float, rng: np.random.Generator) -> Part:
    """A box around x, which lies anywhere in it."""
    flat = problem.flat
    lower = np.maximum(flat.lower, x - size * rng.random(problem.n))
    return Part(np.column_stack([lower, np.minimum(flat.upper, x + size * rng.random(problem.n))]), 1.0)


def kept(prover: Prover, x: np.ndarray, part: Part, budget: int) -> bool:
    """Does every set of contacts keep the solution x?"""
    for domain in prover.domains.values():
        left = getattr(domain.examine(part, budget=budget), "children", ())
        use = domain.use
        if not any(((p.box[use, 0] <= x[use]) & (x[use] <= p.box[use, 1])).all() for p in left):
            return False
    return True


@pytest.mark.parametrize("name", TASKS)
def test_never_discards_a_box_around_a_solution(name: str):
    problem = Problem.of(load_task(name))
    prover, rng = Prover(problem, workers=1), np.random.default_rng(1)
    found = Starts(problem, 0).run(20)
    assert len(found) == 20
    for certified in found:
        for size in (2.0, 0.3, 0.05, 1e-3):
            assert kept(prover, certified.x, about(problem, certified.x, size, rng), budget=40)


@pytest.mark.parametrize("seed", range(10))
def test_never_discards_a_planted_solution_with_every_kind_of_joint_and_region(seed: int):
    planted = everything(seed)
    bound = planted.pose[:3, 3, None] + [-0.01, 0.01]
    axes = np.clip(planted.pose[:3, :3].T[..., None] + [-0.2, 0.1], -1, 1)
    task = replace(planted.task, pose=PoseBounds(bound, axes))
    problem = Problem.of(task)
    prover, rng = Prover(problem, workers=1), np.random.default_rng(seed)
    assert len(prover.domains) == 2**6 - 1 - 6  # five contacts and the object's origin
    x = coordinates(replace(planted, task=task), problem)
    assert all(kept(prover, x, about(problem, x, size, rng), budget=20) for size in (1.0, 0.1, 1e-3))


def moved(task: Task, k: int, by: list[float]) -> Task:
    touches = list(task.touches)
    region = touches[k].object
    touches[k] = replace(touches[k], object=Bezier(region.points + by, region.flip))
    return replace(task, touches=tuple(touches))


def test_a_block_wider_than_the_gripper_opens():
    for width, empty in ((0.082, True), (0.079, False)):
        done = Prover(Problem.of(grip(width)), workers=1).run(nodes=4000)
        assert done.empty is empty
        assert done.by == "contacts 0 and 1"


def test_an_object_out_of_reach():
    far = PoseBounds(np.array([[0.5, 0.6], [-0.1, 0.1], [-0.1, 0.1]]), PoseBounds.none().axes)
    done = Prover(Problem.of(pinch(pose=far)), workers=2).run(nodes=200_000)
    assert done.empty
    assert done.by == "contact 0 and the object's position"
    near = PoseBounds(np.array([[-0.6, 0.6], [-0.6, 0.6], [-0.6, 0.6]]), PoseBounds.none().axes)
    assert not Prover(Problem.of(pinch(pose=near)), workers=2).run(nodes=20_000).empty


def test_normals_that_face_the_same_way():
    task = grip(0.05)
    a, b = task.touches
    turned = replace(b, object=Bezier(b.object.points, not b.object.flip))
    assert Prover(Problem.of(replace(task, touches=(a, turned))), workers=1).run(nodes=20_000).empty


def test_joint_limits_that_keep_the_fingers_apart():
    task = pinch(0.03)
    apart = {j: (0.0, 0.25) for f in ("index", "thumb") for j in (f"{f}_proximal", f"{f}_middle", f"{f}_distal")}
    tight = Task.of(task.hand, task.touches, limits=apart)
    assert not Starts(Problem.of(tight), 0).run(1)
    assert Prover(Problem.of(tight), workers=2).run(nodes=200_000).empty


def test_an_axis_that_cannot_point_there():
    # each jaw touches along its own y: the object's y cannot point along the palm's z
    axes = np.array(PoseBounds.none().axes)
    axes[1, 2] = [0.9, 1.0]
    pose_bounds = PoseBounds(PoseBounds.none().position, axes)
    assert Prover(Problem.of(grip(0.05, pose=pose_bounds)), workers=1).run(nodes=20_000).empty


def test_goes_on_from_a_saved_state_to_the_same_end():
    problem = Problem.of(moved(pinch(0.03), 0, [0, 0.14, 0]))
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
    other = Prover(Problem.of(grip(0.05)), workers=1)
    with pytest.raises(InputError, match=r"box: has \d+ intervals, needs \d+|of another task"):
        other.restore(state)


def test_small_boxes_are_set_aside_undecided():
    # exactly as wide as the gripper opens: neither there nor excluded
    done = Prover(Problem.of(grip(0.08)), workers=1).run(nodes=50_000)
    assert not done.empty
    assert done.pending > 0


def test_the_share_that_is_discarded_adds_up():
    domain = next(iter(Prover(Problem.of(moved(pinch(0.03), 0, [0, 0.14, 0])), workers=1).domains.values()))
    search = Search(domain, [domain.root])
    for state in search:
        left = sum(p.share for p in search.pending)
        assert state.discarded + left == pytest.approx(1.0, abs=1e-12)
    assert isinstance(state.outcome, Discarded)


@pytest.mark.parametrize("seed", range(12))
def test_constants_bound_the_derivatives_of_regions(seed: int):
    rng = np.random.default_rng(seed)
    region = bump(rng, tuple(rng.integers(1, 5, 2)), flip=bool(seed % 2))
    surfaces, normals = bounds(region)
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
    assert bounds(cap)[0].max() == 0.02
