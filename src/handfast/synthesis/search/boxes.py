"""What the prover searches: boxes of a set of contacts without the pose, and boxes of the pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array, Indices
from handfast.core.branch import Discarded, Outcome, Split, Unfinished
from handfast.core.errors import InputError
from handfast.core.files import Strict, validate
from handfast.core.groups import Block, table
from handfast.synthesis.search.library import LIBRARY
from handfast.synthesis.search.workspace import (
    LEFT,
    NODES,
    SMALL,
    PoseQuestion,
    SetQuestion,
    pose_work,
    set_work,
    stack,
)
from handfast.synthesis.task_groups import POSE
from handfast.synthesis.task_problem import TaskProblem

STEP_NODES, STEP_POSES = 2000, 10_000  # nodes of one call of a kernel; that of the poses learns within one
RESOLUTION = 1e-5  # [m] a box within which no point strays farther is set aside, undecided
MAX_STACK_BOXES, DEEPEST_POSES = 4000, 256  # boxes on a kernel's stack; each of poses holds some of its contacts, too
KEPT_BOXES = 256  # small boxes of one call, where they are wanted


@dataclass(frozen=True, eq=False)
class SearchPart:
    """A box of one search.

    Attributes:
        box: (n, 2) of all coordinates; those that do not concern the search are not used.
        share: of the whole.
        small: at the resolution already.
    """

    box: Array
    share: float
    small: bool = False


class PartEntry(Strict):
    """A part as JSON-able data."""

    box: list[tuple[float, float]]
    share: Annotated[float, Field(ge=0, le=1)]
    small: bool


class BoxDomain:
    """A search domain of boxes (n, 2): everything but the kernel.

    Attributes:
        problem: the task in minimal coordinates.
        use: the coordinates that are split.
        concern: those and the ones that are narrowed.
        words: which contacts it is about, for people.
        roots: everything.
        deepest, step: boxes on the stack, and nodes, of one call.
        kept: small boxes after which a call ends.
    """

    problem: TaskProblem
    use: Indices
    concern: Indices
    words: str
    roots: tuple[SearchPart, ...]
    deepest: int = MAX_STACK_BOXES
    step: int = STEP_NODES
    kept: int = 1  # which shows that this search cannot become empty

    def explore(self, waiting: Indices, budget: int) -> None:
        """Depth first from the first box of a `Stack`, given by its table, up to `budget` nodes."""
        raise NotImplementedError

    def coordinates(self, x: Array) -> Array:
        """(n,) the problem's coordinates in those of the boxes."""
        return x

    def examine(self, part: SearchPart, budget: int | None = None) -> Outcome[SearchPart]:
        """One call of the kernel on a box: up to `budget` nodes depth first, `step` without one."""
        if part.small:
            return Unfinished(part, 0)
        block = Block(stack(self.problem.n, self.deepest, self.kept))
        boxes = block.arrays()
        boxes.box[0], boxes.share[0] = part.box, part.share
        self.explore(block.table, self.step if budget is None else budget)
        count, found, nodes = (int(boxes.counts[place]) for place in (LEFT, SMALL, NODES))
        if count == found == 0:
            return Discarded(nodes=nodes)
        left = [SearchPart(boxes.box[i].copy(), float(boxes.share[i])) for i in reversed(range(count))]
        small = [SearchPart(boxes.small[i].copy(), float(boxes.small_share[i]), True) for i in range(found)]
        return Split([*small, *left], nodes=nodes)

    def share(self, part: SearchPart) -> float:
        return part.share

    def encode(self, part: SearchPart) -> Any:
        return {"box": part.box.tolist(), "share": part.share, "small": part.small}

    def decode(self, data: Any) -> SearchPart:
        entry = validate(PartEntry, data)
        if len(entry.box) != self.problem.n:
            raise InputError(f"has {len(entry.box)} intervals, needs {self.problem.n}", field="box")
        return SearchPart(np.array(entry.box), entry.share, entry.small)


class ContactSet(BoxDomain):
    """One set of contacts: can these be made together, in any pose of the object?"""

    def __init__(
        self, problem: TaskProblem, subset: tuple[int, ...], derivative_bounds: Array, cones: Array, kept: int
    ) -> None:
        coordinates, b = problem.flat.coordinates, len(problem.flat.chains.joints)
        self.problem, self.kept = problem, kept
        use = {int(coordinates.parameter[0]) - POSE + i for i in range(3)} if b in subset else set()
        for k in subset:
            if k < b:
                use |= _joints(problem, k) | _parameters(problem, k)
        self.use = self.concern = np.array(sorted(use), dtype=np.intp)
        self.question = SetQuestion(np.array(subset, dtype=np.intp), self.use, derivative_bounds, cones)
        self._task, self._asked = [table(group) for group in problem.flat], table(self.question)
        self._work = set_work(problem.flat, self.question)
        self.roots = (SearchPart(np.column_stack([coordinates.lower, coordinates.upper]), 1.0),)
        *most, last = [str(k) if k < b else "the object's position" for k in subset]
        many = "s" * (len(subset) > 2 or b not in subset)
        self.words = f"contact{many} {', '.join(most)} and {last}" if most else f"contact {last}"

    def explore(self, waiting: Indices, budget: int) -> None:
        work = [Block(layout) for layout in self._work]
        resolution = RESOLUTION / self.problem.unit
        LIBRARY.functions.explore_set(
            *self._task, waiting, self._asked, *(block.table for block in work), budget, resolution
        )


class PoseSpace(BoxDomain):
    """The object's pose: is there one in which each contact can be made, whatever the other fingers do?

    The coordinates are those of `kernel.pose_search`: four charts of the rotation, and the position of a point amid
    the object's regions. Only the pose and joints that several contacts share are split; what a box holds of the
    other coordinates is where they can be for poses of the box.
    """

    deepest, step = DEEPEST_POSES, STEP_POSES

    def __init__(self, problem: TaskProblem, derivative_bounds: Array) -> None:
        coordinates, b = problem.flat.coordinates, len(problem.task.contact_pairs)
        self.problem = problem
        self.at = at = int(coordinates.parameter[0]) - POSE
        joints = [_joints(problem, k) for k in range(b)]
        shared = {j for k in range(b) for l in range(k) for j in joints[k] & joints[l]}
        pose = [*sorted(shared), *range(at, at + POSE)]
        rows = [[*pose, *sorted((joints[k] | _parameters(problem, k)) - shared)] for k in range(b)]
        sizes = np.array([len(row) for row in rows], dtype=np.intp)
        each = np.zeros((b, max(map(len, rows))), dtype=np.intp)
        for k, row in enumerate(rows):
            each[k, : len(row)] = row
        self.use, self.concern = np.array(pose, dtype=np.intp), np.arange(problem.n)
        self.words = "all contacts, pose by pose"
        self.middle = np.mean([t.object.amid for t in problem.task.contact_pairs], axis=0) / problem.unit
        box = np.column_stack([coordinates.lower, coordinates.upper])
        near = box[at : at + 3].copy()
        self.question = PoseQuestion(each, sizes, derivative_bounds, self.middle, near, len(pose))
        self._task, self._asked = [table(group) for group in problem.flat], table(self.question)
        self._work = pose_work(problem.flat, self.question, self.deepest)
        far = float(np.linalg.norm(self.middle)) * (1 + 1e-9)
        box[at : at + 3] += [-far, far]
        box[at + 3 : at + POSE] = [-1.0, 1.0]
        self.roots = tuple(SearchPart(_with_one(box, at + 3 + chart), 0.25) for chart in range(4))

    def coordinates(self, x: Array) -> Array:
        from scipy.spatial.transform import Rotation

        at, y = self.at, np.array(x)
        q = y[at + 3 : at + POSE]
        y[at : at + 3] += Rotation.from_quat(q, scalar_first=True).apply(self.middle)
        y[at + 3 : at + POSE] = q / q[np.abs(q).argmax()]
        return y

    def explore(self, waiting: Indices, budget: int) -> None:
        work = [Block(layout) for layout in self._work]
        resolution = RESOLUTION / self.problem.unit
        LIBRARY.functions.explore_poses(
            *self._task, waiting, self._asked, *(block.table for block in work), budget, resolution
        )


def _joints(problem: TaskProblem, k: int) -> set[int]:
    return set(problem.flat.chains.coordinate[k, : problem.flat.chains.joints[k]].tolist())


def _parameters(problem: TaskProblem, k: int) -> set[int]:
    return {int(problem.flat.coordinates.parameter[k]) + i for i in range(4 if problem.flat.regions.hand[k] else 2)}


def _with_one(box: Array, i: int) -> Array:
    out = box.copy()
    out[i] = 1.0
    return out
