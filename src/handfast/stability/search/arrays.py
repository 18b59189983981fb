"""What Python and the compiled kernel have in common: the named groups of a search, and the numbers that stand in them.

Sizes: m contacts, a actuators that may move, n unknowns, F base values that are forces, P plain base values (`rows`).
Forces and motions are over the force scale, without unit. "Filled up" is with zeros, to whole vectors of the processor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

from handfast.core.arrays import Indices
from handfast.core.groups import (
    Block,
    Flags,
    Layout,
    RealMatrices,
    RealMatrix,
    Reals,
    Shape,
    WholeMatrix,
    Wholes,
    whole_vectors,
)

# what became of a node
WAITING, SPLIT, EMPTY, UNRESOLVED = 0, 1, 2, 3
# why a run of the kernel ended
EXHAUSTED, ENOUGH, ROOM, FOUND, ENDLESS = 0, 1, 2, 3, 4
# what is sought
ANY, SCALAR, LARGEST_EFFORT, SUM_OF_EFFORTS = 0, 1, 2, 3
# places in `WorkerState.counts`
WORKER_COUNTS = NODES, EXCHANGES, DROPS, RESTARTS, NEWTONS, HITS, USED, HEAP, FAILURES, SETTLED = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    9,
)

# what became of a row that is one of many, see `kernel.batch_loop`
UNASKED, HELD, NONE, HARD, LIMITED = 0, 1, 2, 3, 4

# working sets of nodes that wait, those made last; in one more place, that of the node being split
KEPT_WORKING_SETS = 64
PATCH_SIZE = 22  # numbers of a patch, see `kernel.patch`
PREFERENCE = 1e-6  # small contact forces among equals: their points are near exact states, and nodes close sooner
MANY_ACTUATORS = 12  # that may move, from which on the children of several parts are tried where proofs are replayed
TRIED_SPLITS = 8  # parts whose children are tried before a node is split at one of them, where commands are sought
CHILDREN = 9  # of a node at most: a soft finger sticks, or slides in one of eight octants


class KernelQuestion(NamedTuple):
    """What is asked, as the kernel takes it; see `Reduced`."""

    m: int  # contacts
    a: int  # actuators that may move
    F: int  # base values that are forces
    cos: float  # of the uncertainty of the normals, equation (17)
    sin: float
    dissipation: bool  # does the maximum dissipation principle (7) hold?
    objective: int  # what is sought: `ANY` to `SUM_OF_EFFORTS`
    capped: bool  # the box holds for motions up to a cap, and rays may cite it
    C: RealMatrix  # (F, n) forces are C z + off
    D: RealMatrix  # (motions, n) see `before`
    CT: RealMatrix  # (unknown forces, F filled up) C transposed, without the unknowns that are zero in it
    DT: RealMatrix  # (unknown motions, motions filled up) D transposed, likewise
    off: Reals  # (F filled up)
    before: Reals  # (motions filled up) motions are D z + before: how far springs, stops and tendons had come
    mu: Reals  # (m,) coefficients of friction
    soft: Wholes  # (m,) which soft finger a contact is, -1 for a point contact
    twist: int  # where torsions over levers begin among the forces, which they end
    turning: int  # where turning times levers begins among the motions
    lo: Reals  # (P,) lower bounds of the plain base values
    cost: Reals  # (n,) what is minimised, over z
    box: Reals  # (n,) |z| where programs begin
    driven: Flags  # (a,) whose command is sought
    least: float  # command of an actuator that turns, at least, where commands are sought
    tries: bool  # are nodes split at what their children leave least, see `tree.tried`?


class WorkerState(NamedTuple):
    """What a worker changes besides the tree."""

    hi: Reals  # (P,) upper bounds of the plain base values, of which the first is the cut
    best: Reals  # (2,) smallest objective found, and the violation below which Newton's method is tried
    best_z: Reals  # (n,) the incumbent
    counts: Wholes  # (10,) see `WORKER_COUNTS`
    guesses: RealMatrix  # (., n) points to start Newton's method from, at the root
    heap: Wholes  # the nodes that wait, smallest rank first


class Pool(NamedTuple):
    """The tree, one row per node; a row without a parent, but for the first, is no node."""

    states: WholeMatrix  # (., 3m + a) what its contacts are, left and right ends of their sectors, its actuators
    ids: WholeMatrix  # (., n + 1) its working set, and the row that enters in the ray of an empty node
    data: RealMatrix  # (., n + 1) its point and the cut then, while it waits or is split; empty: multipliers of `ids`
    key: Reals  # rank: the smallest is split next
    bound: Reals  # no solution in it has a smaller objective
    parent: Wholes
    part: Wholes  # of the parent that was split: contact i or m + actuator j
    status: Wholes  # what became of it, `WAITING` to `UNRESOLVED`


class Kept(NamedTuple):
    """Working sets to be gone on from, in `KEPT_WORKING_SETS` + 1 places; see `WorkingSet`."""

    owner: WholeMatrix  # (2, .) whose it is, and its age
    ids: WholeMatrix  # (., n)
    rhs: RealMatrix  # (., n)
    matrix: RealMatrices  # (., n, n)
    inverse: RealMatrices  # (., n, n filled up)


class NodeAtHand(NamedTuple):
    """The node at hand."""

    state: Wholes  # (3m + a,) see `Pool.states`
    children: WholeMatrix  # (CHILDREN, 3) state and sector ends of the part that is split
    skip: Wholes  # (m + a + P,) parts whose rows are left out
    trig: RealMatrix  # (m, 22) cos and sin of each sector's left end, and of its right end, or a patch
    violation: Reals  # (3,) the sum of what the model is missed by, 1 if it is missed anywhere, and by how much
    # friction may leave its cone in the program that was solved
    normal: Reals  # (m,) normal forces at the parent's point
    missing: Reals  # (m + a,) by how much energy each part misses the model in the point, -1 where it may not be split
    tried: Wholes  # (TRIED,) the parts of which it misses most
    share: Reals  # (TRIED,) how much each of these misses


class WorkingSet(NamedTuple):
    """n independent rows of a program that hold with equality, and room for exchanging one."""

    ids: Wholes  # (n + 1,) their names; last, the row that enters in a ray
    rhs: Reals  # (n,) right-hand sides
    matrix: RealMatrix  # (n, n) coefficients
    inverse: RealMatrix  # (n, n filled up)
    age: Wholes  # (1,) exchanges since the inverse was made
    order: Wholes  # (n,) room for the inverse
    y: Reals  # (n + 1,) multipliers
    z: Reals  # (n,) the point
    c: Reals  # (F filled up) its forces
    d: Reals  # (motions filled up) its motions
    entering: Reals  # (n,) coefficients of the row that enters
    column: Reals  # (n,) by how much the point moves
    pivot: Reals  # (2n filled up) room for the inverse, and for a ray's sum and size
    delta: Reals  # (n filled up) the entering row in terms of the working set
    gradient: Reals  # (8 + 22,) a row over its base values: three forces, three motions, torsion and turning; and
    # room for a patch


class Refinement(NamedTuple):
    """Room for Newton's method."""

    start: Reals  # (n,) where it begins
    z: Reals  # (n,) the exact solution
    c: Reals  # (F filled up) its forces
    d: Reals  # (motions filled up) its motions
    modes: Wholes  # (m,) what contacts do
    drives: Wholes  # (a,) what actuators do
    side: Wholes  # (F - 3m - 2a,) plain forces at a bound: 1 the upper, -1 the lower
    gradients: RealMatrix  # (5, 8) of one part's equations over its base values
    jacobian: RealMatrix  # (5m + 2a + P, n) of all equations over z
    residuals: Reals  # (5m + 2a + P,)
    sizes: Reals  # (5m + 2a + P,) squared lengths of the gradients
    rest: Reals  # (5m + 2a + P,) of their independent parts
    step: Reals  # (n,)
    trial: Reals  # (n,)
    unit: Reals  # (n,)
    first: Reals  # (n,) the solution in the modes that the start shows


class QuestionRows(NamedTuple):
    """Questions about one grasp that differ in their loads, and what was found."""

    load: RealMatrix  # (k, 6) by which rows are near each other
    off: RealMatrix  # (k, F filled up) as in `KernelQuestion`,
    lo: RealMatrix  # (k, P)
    hi: RealMatrix  # (k, P)
    energy: RealMatrices  # (k, 2, unknown motions) the last two rows of D where there are such, else (k, 0, .)
    column: RealMatrix  # (k, F) what a row adds to C, times `mix`, else (k, 0)
    mix: Reals  # (unknown forces,)
    plain: RealMatrix  # (F, unknown forces) C without it
    noise: Reals  # (unknown forces,) what it prefers among equals
    status: Wholes  # (k,) `UNASKED` to `LIMITED`
    nodes: Wholes  # (k,)
    z: RealMatrix  # (k, n) the solution
    best: Reals  # (k,) its objective
    cut: Reals  # (k,) no solution has a smaller one
    at_end: Flags  # (k,) is the objective at the end of its range?


@lru_cache(maxsize=64)
def worker_layout(P: int, n: int, guesses: int, heap: int) -> Layout[WorkerState]:
    """heap: how many nodes may wait."""
    shapes: dict[str, Shape] = {"hi": (P,), "best": (2,), "best_z": (n,), "counts": (len(WORKER_COUNTS),)}
    return Layout(WorkerState, shapes | {"guesses": (guesses, n), "heap": (heap,)})


@lru_cache(maxsize=64)
def pool_layout(rows: int, width: int, n: int) -> Layout[Pool]:
    """For so many nodes; width: of their states."""
    shapes: dict[str, Shape] = {"states": (rows, width), "ids": (rows, n + 1), "data": (rows, n + 1)}
    return Layout(Pool, shapes | dict.fromkeys(("key", "bound", "parent", "part", "status"), (rows,)))


@dataclass(frozen=True)
class WorkspaceLayout:
    """Of what the kernel alone writes and reads."""

    kept: Layout[Kept]
    node: Layout[NodeAtHand]
    working_set: Layout[WorkingSet]
    refinement: Layout[Refinement]

    @classmethod
    @lru_cache(maxsize=64)
    def of(cls, m: int, a: int, F: int, n: int, forces: int, motions: int, P: int) -> WorkspaceLayout:
        """forces, motions: how many there are with what fills them up."""
        N, most, places = whole_vectors(n), 5 * m + 2 * a + P, KEPT_WORKING_SETS + 1
        values: dict[str, Shape] = {"z": (n,), "c": (forces,), "d": (motions,)}
        kept: dict[str, Shape] = {"owner": (2, places), "ids": (places, n), "rhs": (places, n)}
        node: dict[str, Shape] = {"state": (3 * m + a,), "children": (CHILDREN, 3), "skip": (m + a + P,)}
        of_parts: dict[str, Shape] = {"missing": (m + a,), "tried": (TRIED_SPLITS,), "share": (TRIED_SPLITS,)}
        rows: dict[str, Shape] = {"ids": (n + 1,), "rhs": (n,), "matrix": (n, n), "inverse": (n, N), "y": (n + 1,)}
        room: dict[str, Shape] = {
            "age": (1,),
            "order": (n,),
            "pivot": (2 * N,),
            "delta": (N,),
            "gradient": (8 + PATCH_SIZE,),
        }
        modes: dict[str, Shape] = {"modes": (m,), "drives": (a,), "side": (F - 3 * m - 2 * a,)}
        equations: dict[str, Shape] = {"gradients": (5, 8), "jacobian": (most, n)}
        equations |= dict.fromkeys(("residuals", "sizes", "rest"), (most,))
        vectors: dict[str, Shape] = dict.fromkeys(("start", "step", "trial", "unit", "first"), (n,))
        return cls(
            kept=Layout(Kept, kept | {"matrix": (places, n, n), "inverse": (places, n, N)}),
            node=Layout(NodeAtHand, node | {"trig": (m, PATCH_SIZE), "violation": (3,), "normal": (m,)} | of_parts),
            working_set=Layout(WorkingSet, values | rows | room | {"entering": (n,), "column": (n,)}),
            refinement=Layout(Refinement, values | modes | equations | vectors),
        )


class Workspace:
    """What the kernel alone writes and reads; made when it is wanted first."""

    def __init__(self, layout: WorkspaceLayout) -> None:
        self._layout = layout

    @cached_property
    def refinement(self) -> Block[Refinement]:
        return Block(self._layout.refinement)

    @cached_property
    def working_set(self) -> Block[WorkingSet]:
        return Block(self._layout.working_set)

    @cached_property
    def tables(self) -> tuple[Indices, ...]:
        """Of all its groups, in the order in which the kernel takes them."""
        self._kept, self._node = Block(self._layout.kept), Block(self._layout.node)
        self._kept.array("owner")[:] = -1  # no working set is kept
        return self._kept.table, self._node.table, self.working_set.table, self.refinement.table
