"""Searches for a proof that no commands below a bound hold a load on its path, as `proofs/path_commands.py` checks it.

Branch and bound over the cases, the least bound first: each node is a linear program with tangents of the friction
cones where its solution leaves them. Wherever it ends, the leaves that it has are a proof of the least of their bounds.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import count

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, hstack, vstack

from handfast.core.answer import SearchLimits
from handfast.core.arrays import Array, Indices
from handfast.proofs.path_commands import (
    CLOSED,
    LOCKED,
    MOVED,
    OPEN,
    PathBound,
    PathCommands,
    PathLeaf,
    PathRow,
    leaf_bound,
)

PATH_TREE_NODES = 400  # of the tree at most
TANGENT_ROUNDS = 12  # rounds of tangents at a node
MAX_CONE_EXCESS = 1e-5  # relative to a contact's normal force: friction that is so little outside of its cone is inside
MULTIPLIER_CUTOFF = 1e-11  # of the largest multiplier: those below this are left out
MIN_BOUND_RAISE = 1e-6  # relative: a bound that tangents raise by less has come to its end
MULTIPLIER_ROUNDING = 1e-16  # of the largest multiplier: what is left of one that is none
VIOLATED = 1e-6  # of the load: contacts that press and gape by less are either closed or open
FIRST_TANGENTS = 8  # directions of tangents in each contact's plane at first


@dataclass(frozen=True, eq=False)
class _Node:
    case: dict[int, int]
    bound: float
    leaf: PathLeaf
    x: Array | None  # (n,) of a solution; None where there is none


@dataclass(eq=False)
class _Tree:
    parent: list[int] = field(default_factory=lambda: [-1])
    part: list[int] = field(default_factory=lambda: [0])
    case: list[int] = field(default_factory=lambda: [0])


def path_bound(of: PathCommands, limits: SearchLimits, enough: float = np.inf) -> tuple[float, PathBound | None, int]:
    """A lower bound of the measure of commands [N m or N], its proof, and nodes; 0 and None where none was found.

    inf where no commands hold the load. enough: a bound that need not be exceeded.
    """
    if not of.known:
        return 0.0, None, 0
    return _BoundSearch(of).run(limits, enough)


class _BoundSearch:
    def __init__(self, of: PathCommands) -> None:
        self.of, self.rows = of, of.rows
        self.units = of.units * of.scale  # unknowns in these units are of like size
        self.tangents: list[tuple[int, int, tuple[float, ...]]] = []
        self.table, self.right = self._matrix(self.rows)
        largest = abs(self.table).max(axis=1).toarray().ravel()
        self.size = np.where(largest > 0, largest, 1.0)
        g = of.question.grasp
        soft = set(g.soft.tolist())
        turns = 2 * np.pi * np.arange(FIRST_TANGENTS) / FIRST_TANGENTS
        flat = [(float(np.cos(a)), float(np.sin(a))) for a in turns]
        for x in range(of.states):
            for i in range(g.m):
                for u in flat:
                    self.tangents.append((x, i, (*u, 0.0) if i in soft else u))
                self.tangents += [(x, i, (0.0, 0.0, s)) for s in (1.0, -1.0) if i in soft]
        self.cones, _ = self._matrix([of.tangent(x, i, np.array(u)) for x, i, u in self.tangents])

    def _matrix(self, rows: list[PathRow]) -> tuple[csr_array, Array]:
        """Rows over unknowns in `units`."""
        entries = [(k, c, float(v.p) / float(v.q)) for k, row in enumerate(rows) for c, v in row.terms.items()]
        at, columns, values = (np.array(x) for x in zip(*entries, strict=True))
        table = coo_array((values * self.units[columns], (at, columns)), shape=(len(rows), self.of.n)).tocsr()
        return table, np.array([float(row.right.p) / float(row.right.q) for row in rows])

    def run(self, limits: SearchLimits, enough: float) -> tuple[float, PathBound | None, int]:
        """See `path_bound`. Of nodes with one bound the newest comes first: where the least is 0 that ends soon."""
        tree, order, nodes = _Tree(), count(0, -1), 1
        heap = [(0.0, 0, 0, self.node({}))]
        done: dict[int, _Node] = {}
        while heap and nodes < PATH_TREE_NODES and not limits.late and heap[0][0] < enough:
            bound, _, k, node = heapq.heappop(heap)
            if node.x is None:
                done[k] = node
                continue
            part = self.split(node)
            if part is None:
                finer = self.node(node.case, TANGENT_ROUNDS, node)
                part = self.split(finer) if finer.x is not None else None
                if finer.x is not None and (part is not None or finer.bound > bound * (1 + MIN_BOUND_RAISE)):
                    heapq.heappush(heap, (finer.bound, next(order), k, finer))
                    continue
                done[k] = finer
                if finer.x is None:
                    continue
                break
            for case in self.likelier_last(node, part):
                child = self.node(node.case | {part: case}, 1, node)
                tree.parent.append(k)
                tree.part.append(part)
                tree.case.append(case)
                nodes += 1
                place = len(tree.parent) - 1
                if child.x is None:
                    done[place] = child
                else:
                    heapq.heappush(heap, (child.bound, next(order), place, child))
        done |= {k: node for _, _, k, node in heap}
        lower = min(node.bound for node in done.values())
        if not lower > 0:
            return 0.0, None, nodes
        leaves = tuple(done[k].leaf for k in sorted(done))
        return lower, PathBound(tuple(tree.parent), tuple(tree.part), tuple(tree.case), leaves), nodes

    def likelier_last(self, node: _Node, part: int) -> tuple[int, int]:
        """Both cases of a part, the one that the node's solution is nearer to last."""
        g = self.of.question.grasp
        if part >= self.of.states * g.m:
            return MOVED, LOCKED
        assert node.x is not None
        pressed, gap = self.pressed_and_gap(node.x, *divmod(part, g.m))
        return (OPEN, CLOSED) if pressed > gap else (CLOSED, OPEN)

    def pressed_and_gap(self, x: Array, state: int, i: int) -> tuple[float, float]:
        """c_n and c_n + d_n of a contact, in units of the load."""
        of, g = self.of, self.of.question.grasp
        motion = np.concatenate([x[of.at(state, 0) : of.at(state, 0) + 6], x[of.at(state, 1) : of.at(state, 1) + g.l]])
        pressed = x[of.at(state, 2, 3 * i)] / of.scale
        return pressed, pressed + float(g.rows[0][3 * i] @ motion) / of.scale

    def split(self, node: _Node) -> int | None:
        """The part to decide next: an actuator, else the contact that presses and gapes most; None if none does."""
        of, g = self.of, self.of.question.grasp
        first = of.states * g.m
        for part in range(first, of.parts):
            if part not in node.case:
                return part
        assert node.x is not None
        worst, where = VIOLATED, None
        for part in range(first):
            if part not in node.case:
                least = min(self.pressed_and_gap(node.x, *divmod(part, g.m)))
                worst, where = (least, part) if least > worst else (worst, where)
        return where

    def node(self, case: dict[int, int], cuts: int = 1, before: _Node | None = None) -> _Node:
        """A case with the bound that its multipliers show, or those of a node before it, which holds there, too."""
        holds = np.array([r.condition is None or case.get(r.condition[0]) == r.condition[1] for r in self.rows])
        equal = np.array([r.equal for r in self.rows])
        for left in range(cuts, -1, -1):
            x, y = self.solved(np.flatnonzero(holds & equal), np.flatnonzero(holds & ~equal))
            if x is None or not self.cut(x) or not left:
                break
        leaf = self.leaf(y)
        bound = leaf_bound(self.of, self.rows, case, leaf)
        if before is not None and before.bound >= bound:
            return _Node(case, before.bound, before.leaf, x)
        return _Node(case, bound, leaf, x)

    def solved(self, equal: Indices, more: Indices) -> tuple[Array | None, Array]:
        """(n,) unknowns of the least measure, None if there are none, and (rows + tangents,) multipliers."""
        n = self.of.n
        E, F = self.table[equal] * (1 / self.size[equal])[:, None], self.table[more] * (1 / self.size[more])[:, None]
        h, b = self.right[equal] / self.size[equal], self.right[more] / self.size[more]
        cost = np.zeros(n)
        cost[self.of.measure] = 1.0
        F = vstack([F, self.cones], format="csr")
        b = np.concatenate([b, np.zeros(self.cones.shape[0])])
        found = linprog(cost, A_ub=-F, b_ub=-b, A_eq=E, b_eq=h, bounds=(None, None), method="highs-ds")
        y = np.zeros(len(self.rows) + len(self.tangents))
        places = np.concatenate([more, len(self.rows) + np.arange(len(self.tangents))])
        if found.status == 0:
            y[places], y[equal] = -found.ineqlin.marginals, found.eqlin.marginals
            return found.x * self.units, self.polished(y, equal, more, F, E)
        # what contradicts itself: by how much all rows have to give way
        wide, ones = csr_array(np.ones((E.shape[0], 1))), csr_array(np.ones((F.shape[0], 1)))
        table = vstack([hstack([-F, -ones]), hstack([E, -wide]), hstack([-E, -wide])], format="csr")
        right = np.concatenate([-b, h, -h])
        ends = [(None, None)] * n + [(0, None)]
        found = linprog(np.r_[np.zeros(n), 1.0], A_ub=table, b_ub=right, bounds=ends, method="highs-ds")
        if found.status == 0:
            all_of = -found.ineqlin.marginals
            k = F.shape[0]
            y[places] = all_of[:k]
            y[equal] = all_of[k + len(equal) :] - all_of[k : k + len(equal)]
            y = self.polished(y, equal, more, F, E)
        return None, y

    def polished(self, y: Array, equal: Indices, more: Indices, F: csr_array, E: csr_array) -> Array:
        """Multipliers of rows as they are, whose sums vanish but for rounding."""
        count = len(self.rows)
        places = np.concatenate([more, count + np.arange(len(self.tangents))])
        of_F, of_E = y[places], y[equal]
        top = max(np.abs(of_F).max(initial=0.0), np.abs(of_E).max(initial=0.0), 1e-300)
        of_F = np.where(of_F > MULTIPLIER_CUTOFF * top, of_F, 0.0)
        used = np.flatnonzero(of_F)
        basis = np.vstack([F[used].toarray(), E.toarray()])
        target = np.zeros(self.of.n)
        target[self.of.measure] = 1.0 if abs((of_F @ F + of_E @ E)[self.of.measure]) > 1e-9 * top else 0.0
        z = np.concatenate([of_F[used], of_E])
        for _ in range(2):
            z = z + np.linalg.lstsq(basis.T, target - z @ basis, rcond=1e-13)[0]
        z = np.where(np.abs(z) > MULTIPLIER_ROUNDING * np.abs(z).max(initial=0.0), z, 0.0)
        of_F[used], of_E = np.maximum(z[: len(used)], 0.0), z[len(used) :]
        out = np.zeros_like(y)
        out[places] = of_F
        out[equal] = of_E
        out[:count] /= self.size
        return out

    def leaf(self, y: Array) -> PathLeaf:
        """The multipliers that are not 0."""
        count = len(self.rows)
        rows = tuple((int(k), float(y[k])) for k in np.flatnonzero(y[:count]))
        return PathLeaf(rows, tuple((*self.tangents[k], float(y[count + k])) for k in np.flatnonzero(y[count:])))

    def cut(self, x: Array) -> bool:
        """Tangents where friction is outside of its cone; were there any?"""
        of, g, new = self.of, self.of.question.grasp, []
        places = {int(i): s for s, i in enumerate(g.soft)}
        for k in range(of.states):
            for i in range(g.m):
                first = of.at(k, 2, 3 * i)
                along = x[first + 1 : first + 3]
                if i in places:
                    along = np.append(along, x[of.at(k, 3, places[i])])
                size, most = float(np.linalg.norm(along)), g.mu[i] * max(float(x[first]), 0.0)
                if size - most > MAX_CONE_EXCESS * max(most, of.scale):
                    new.append((k, i, tuple((along / size).tolist())))
        if new:
            more, _ = self._matrix([of.tangent(k, i, np.array(u)) for k, i, u in new])
            self.tangents += new
            self.cones = vstack([self.cones, more], format="csr")
        return bool(new)
