"""The compiled kernel of synthesis at planted solutions."""

from __future__ import annotations

import numpy as np

from handfast.core.groups import Block
from handfast.model.hand.hand import Coupling
from handfast.model.region import Cap
from handfast.synthesis.search.workspace import (
    Interior,
    LocalWork,
    SetQuestion,
    SetWork,
    local_work,
    set_work,
)
from handfast.synthesis.task_problem import TaskProblem
from tests.support.planted import Planted, bump, chain, joint, plant, pose, turn
from tests.support.synthesis_pieces import Balls, Dependents, ask

X, Y, Z = np.eye(3)


def everything(seed: int) -> Planted:
    """A hand with every kind of joint, and every pair of regions; one contact on the palm."""
    rng = np.random.default_rng(seed)
    a, b = turn(rng) @ Z, turn(rng) @ Z
    hand = chain(
        ("near", "palm", pose(rng.normal(0, 0.03, 3), turn(rng)), [joint("j0", a), joint("j1", b, anchor=0.01 * a)]),
        ("far", "near", pose(np.array([0.05, 0, 0])), [joint("j2", Y, -0.3, 0.9)]),
        ("tip", "far", pose(np.array([0.04, 0, 0])), [joint("j3", Y, -0.2, 0.6)]),
        ("slide", "palm", pose(np.array([0, 0.05, 0])), [joint("j4", X, -0.02, 0.03, type="prismatic")]),
        ("wrist", "slide", pose(np.array([0.01, 0, 0])), [joint("j5", Z, ref=0.1)]),
        couplings=[Coupling(3, 2, 0.5, 0.05)],
    )
    cap = Cap([0.01, 0.002, 0], 0.012, [1, 0, 0.2], 1.2)
    ball = Cap([0, 0, 0.01], 0.03, [0, 1, 1], 1.0)
    pairs = [
        ("tip", cap, bump(rng, (3, 2))),
        ("wrist", bump(rng, (2, 1), flip=True), bump(rng, (1, 2))),
        ("far", bump(rng), ball),
        ("palm", Cap([0, 0, 0], 0.02, Z, np.pi, flip=True), bump(rng, (1, 1))),
        ("tip", cap, ball),
    ]
    return plant(hand, pairs, rng)


def coordinates(p: Planted, problem: TaskProblem) -> np.ndarray:
    """(n,) of the planted solution."""
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(p.pose[:3, :3]).as_quat(scalar_first=True)
    value = {f"joint:{n}": q for n, q in zip(p.task.hand.joint_names, p.q, strict=True)}
    value |= {f"position:{i}": p.pose[i, 3] for i in range(3)} | {f"quaternion:{i}": quaternion[i] for i in range(4)}
    for k, (on_hand, on_object) in enumerate(p.spots):
        region = p.task.contact_pairs[k].object
        if isinstance(region, Cap):
            d = region.frame.T @ on_object
            on_object = np.array([np.arccos(np.clip(d[2], -1, 1)), np.arctan2(d[1], d[0])])
        value |= {f"contact:{k}:s": on_object[0], f"contact:{k}:t": on_object[1]}
        if not isinstance(p.task.contact_pairs[k].hand, Cap):
            value |= {f"contact:{k}:u": on_hand[0], f"contact:{k}:v": on_hand[1]}
    return np.array([value[name] for name in problem.labels]) / problem.lengths


def at(problem: TaskProblem, x: np.ndarray, radius: np.ndarray | float = 0.0) -> tuple[np.ndarray, ...]:
    work = LocalWork(*(Block(x).arrays() for x in local_work(problem.flat, problem.equations)))
    point = Balls(np.column_stack([x, np.zeros(problem.n) + radius]))
    ask("evaluated", point, *problem.flat, work.here, work.contact)
    return tuple(array.copy() for array in work.here)


def polynomials(k: int, x: np.ndarray, half: np.ndarray, problem: TaskProblem, bounds: np.ndarray) -> tuple:
    """Value (4, 3), derivatives (4, n, 3) and remainders (4,) of contact k about x; of the hand's point also `bend` and
    `rest`."""
    question = SetQuestion(np.array([k]), np.arange(problem.n), bounds, np.zeros((0, 5)))
    work = SetWork(*(Block(x).arrays() for x in set_work(problem.flat, question)))
    work.box.middle[:], work.box.half[:] = x, half
    ask("taken", k, *problem.flat, question, *work)
    out = work.polynomials
    return out.value[0].copy(), out.slope[0].copy(), out.remainder[0].copy(), out.bend[0].copy(), float(out.rest[0])


def certified(problem: TaskProblem, x: np.ndarray, lower: np.ndarray | None = None, upper: np.ndarray | None = None):
    """Dependent coordinates and the radii of their box if a solution is proved at x between these bounds, else None."""
    flat, e = problem.flat, problem.equations
    out = Dependents(np.zeros(e, dtype=np.int64), np.zeros(e))
    limits = flat.coordinates
    bounds = Interior(limits.lower if lower is None else lower, limits.upper if upper is None else upper)
    work = LocalWork(*(Block(x).arrays() for x in local_work(flat, e)))
    proved = ask("certified", Balls(np.column_stack([x, 0 * x])), *flat, bounds, *work, out)
    return tuple(out) if proved else None
