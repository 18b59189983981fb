"""What ideas for smaller trees would give, on the finished trees of grasps that nothing was tuned on.

    python -m benchmarks.tree_ideas [--contacts 4 5 6] [--grasps 6] [--sampled 40] [--pads 16]

The largest pull of random grasps (`grasps.random_case`, seeds from `FIRST` on) is searched, in one thread, as `maximum`
does. Then, of each tree:

- *Conflict clauses.* A leaf's ray needs the decisions about the parts that it cites, or only that a contact is closed;
  a node that was split needs what its children need, without the part at which it was split. Such a clause closes each
  node that it holds in. `programs` are nodes whose program need not be solved since a clause of what was finished
  before they were made closes them; `nodes` are those below split nodes that a clause closes.
- *Cone program.* At split nodes of depth `DEPTHS`, `--sampled` of each tree, the program with round friction cones and
  the whole balance of energy, sum c_n^2 <= w . r + f_c . t, under the last cut, by Clarabel; beside it the program as
  the search has it, with the balance's tangent at the parent's point, under that cut too.
- *Propagation.* The same with lower bounds on c_n from cone programs, for c_n beside |d_t| in
  sum c_n^2 + sum mu c_n |d_t| <= w . r + f_c . t, and as a reason for the contact to be closed; twice.
- *Pads.* Grasps of three contacts, and the same with two points 3 mm apart in place of each: nodes, and in how many of
  them a pad has one point open and one closed. A pad that is decided as a whole first cannot save these.

Statuses are the solver's word: this counts, and proves nothing. `saved` are the nodes below those sampled nodes that
are closed, over the nodes below all that were sampled. Results are kept in results/tree_ideas.json.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from benchmarks.grasps import presses, random_case
from benchmarks.machine import describe
from handfast.core.arrays import Array, Indices
from handfast.model.grasp import Grasp
from handfast.proofs import kinds
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.objective import SMALLEST_PRELOAD
from handfast.stability.search import arrays, rows
from handfast.stability.search.cases import CLOSED, OPEN
from handfast.stability.search.reduced import reduce
from handfast.stability.search.search import Search

RESULTS = Path(__file__).parent / "results" / "tree_ideas.json"
FIRST = 8_300_000  # seeds from here on
DEPTHS = range(4, 11)
NODES = 5_000  # of a tree; a grasp with more is left out
SURE = 1e-3  # what a bound on a normal force gives up: more than the solver is off by
SMALL = 1e-9  # multipliers over the largest below which a row is not cited
EVERYWHERE = {kinds.CN_UP, kinds.TANGENT, kinds.GAP_UP, kinds.T_UP}  # kinds of rows that hold in every state
ENOUGH = -1  # a need: the contact is closed
Need = tuple[int, ...]
Clause = dict[int, Need]


def searched(contacts: int, seed: int) -> Search | None:
    """The finished, trimmed search for the largest pull; None where the preload does not press, or none is finite."""
    case = random_case(contacts, seed)
    return searched_along(case.grasp, case.direction) if presses(case.grasp) else None


def searched_along(grasp: Grasp, direction: Array) -> Search | None:
    """The same of any grasp."""
    r = reduce(scaled_problem.build(grasp, np.zeros(6), direction), SMALLEST_PRELOAD)
    s = Search(
        r.beginning(r.boxes[0]), gap=1e-3, gap_absolute=1e-9, workers=1, node_limit=NODES
    )  # the largest pull is the least multiple of the preload for a pull of 1
    for _ in s:
        pass
    s.trim()
    closed = not np.isin(s.pool.status, (arrays.WAITING, arrays.UNRESOLVED)).any()
    return s if closed and s.best < np.inf and len(s.pool.status) > 8 else None


# --- pads ---------------------------------------------------------------------------------------


def with_pads(grasp: Grasp) -> Grasp:
    """Two points 3 mm apart in place of each contact."""
    contacts = []
    for c in grasp.contacts:
        side = np.cross(c.normal, np.eye(3)[np.abs(c.normal).argmin()])
        side *= 1.5e-3 / np.linalg.norm(side)
        contacts += [replace(c, position=c.position + side), replace(c, position=c.position - side)]
    joints = [replace(j, moves=tuple(k for i in j.moves for k in (2 * i, 2 * i + 1))) for j in grasp.joints]
    return Grasp(contacts, joints, preload=grasp.preload)


def pads(seed: int) -> dict[str, Any] | None:
    """Nodes with a point for each of three contacts, with two, and in how many of these both are decided apart."""
    case = random_case(3, seed)
    if not presses(case.grasp) or not presses(doubled := with_pads(case.grasp)):
        return None
    one, two = (searched_along(g, case.direction) for g in (case.grasp, doubled))
    if one is None or two is None:
        return None
    states = two.pool.states[:, :6].reshape(-1, 3, 2)
    apart = ((states == OPEN).any(axis=2) & (states >= CLOSED).any(axis=2)).any(axis=1)
    return {"seed": seed, "nodes": len(one.pool.status), "of_pads": len(apart), "apart": int(apart.sum())}


# --- conflict clauses ---------------------------------------------------------------------------


class Tree:
    """A trimmed tree: children and depth of each node, how many nodes are below it, and the last of them."""

    def __init__(self, s: Search) -> None:
        self.s, self.pool, self.m = s, s.pool, s.reduced.sizes[0]
        parent, count = s.pool.parent, len(s.pool.parent)
        self.children: list[list[int]] = [[] for _ in range(count)]
        self.depth, self.below, self.last = np.zeros(count, int), np.zeros(count, int), np.arange(count)
        for k in range(1, count):
            self.children[parent[k]].append(k)
            self.depth[k] = self.depth[parent[k]] + 1
        for k in range(count - 1, 0, -1):
            self.below[parent[k]] += 1 + self.below[k]
            self.last[parent[k]] = max(self.last[parent[k]], self.last[k])

    def state(self, node: int, part: int) -> Need:
        """State and sector of a contact, or the state of an actuator."""
        x, m = self.pool.states[node], self.m
        return (int(x[part]), int(x[m + part]), int(x[2 * m + part])) if part < m else (int(x[2 * m + part]),)

    def of_leaf(self, leaf: int) -> Clause:
        """What its ray needs."""
        ids, y = self.pool.ids[leaf], self.pool.data[leaf]
        out: Clause = {}
        for name in ids[y > SMALL * y.max()].tolist():
            kind, index = name >> rows.KIND_SHIFT, (name >> rows.INDEX) & 255
            if kind in EVERYWHERE or kind in (kinds.ENERGY, rows.BOX_UP, rows.BOX_DOWN):
                continue
            if kinds.BOUND_UP <= kind <= kinds.BOUND_DOWN:
                continue
            of_actuator = kinds.T_UP <= kind <= kinds.S_UP or kind == kinds.S_DOWN
            part = self.m + index if of_actuator else index
            if kind == kinds.GAP_DOWN:
                out.setdefault(part, (ENOUGH,))
            elif not (of_actuator and self.state(leaf, part) == (kinds.FREE,)):
                out[part] = self.state(leaf, part)
        return out

    def clauses(self) -> list[Clause]:
        """Of all nodes."""
        out: list[Clause] = [{} for _ in self.children]
        for k in range(len(out) - 1, -1, -1):
            if not self.children[k]:
                out[k] = self.of_leaf(k)
                continue
            split = int(self.pool.part[self.children[k][0]])
            for child in self.children[k]:
                for part, need in out[child].items():
                    if part != split and out[k].get(part, (ENOUGH,)) == (ENOUGH,):
                        out[k][part] = need
            whole = self.state(k, split)
            if whole[0] not in (kinds.UNDECIDED, kinds.FREE):
                out[k][split] = whole
        return out

    def meets(self, node: int, clause: Clause) -> bool:
        """Is all that a clause needs so in a node?"""
        return all(within(self.state(node, part), need) for part, need in clause.items())

    def closed_by_clauses(self) -> tuple[int, int]:
        """Nodes whose program need not be solved, and nodes below split ones that need not be searched."""
        clauses = self.clauses()
        # a node's clause is known when all below it is finished: after its last node was made
        known = sorted(range(1, len(clauses)), key=lambda k: int(self.last[k]))
        programs, saved, gone = 0, 0, np.zeros(len(clauses), bool)
        for k in range(1, len(clauses)):
            parent = int(self.pool.parent[k])
            gone[k] = gone[parent]
            if gone[k]:
                continue
            first = self.children[parent][0]  # it was made when its parent was split
            if any(self.last[c] < first and self.meets(k, clauses[c]) for c in known if self.last[c] < first):
                programs += 1
            elif self.children[k]:
                begun = self.children[k][0]  # when it is split more is known
                if any(self.last[c] < begun and self.meets(k, clauses[c]) for c in known if self.last[c] < begun):
                    saved += int(self.below[k])
                    gone[k] = True
        return programs, saved


def within(state: Need, need: Need) -> bool:
    """Does what is known of a part say all that is needed?"""
    if need == (ENOUGH,):
        return state[0] in (kinds.CLOSED, kinds.STICK, kinds.SLIDE)
    if len(need) == 1 or state[0] != need[0]:
        return state == need
    wide, inner = need[2] - need[1], state[2] - state[1]
    return wide == 0 or (inner > 0 and (state[1] - need[1]) % kinds.TURN_DIRECTIONS + inner <= wide)


# --- cone programs ------------------------------------------------------------------------------


class ConeProgram:
    """The rows of a node: z (n,) and u (m,) >= |d_t|, as A x + s = b with s in a product of cones."""

    def __init__(self, s: Search, node: int) -> None:
        self.r, self.pool, self.node, self.cut = s.reduced, s.pool, node, float(s.hi[0])
        self.m, self.a, self.n = self.r.sizes[0], self.r.sizes[1], len(self.r.cost)
        self.size = self.n + self.m
        self.equal: list[tuple[Array, float]] = []
        self.least: list[tuple[Array, float]] = []  # a . x >= b
        self.cones: list[tuple[Array, Array]] = []  # A x + b in a second-order cone
        for i in range(self.m):
            self._contact(i)
        self._actuators()
        self._plain()

    def c(self, k: int) -> tuple[Array, float]:
        """A force over x, and its constant."""
        return np.r_[self.r.C[k], np.zeros(self.m)], float(self.r.off[k])

    def d(self, k: int) -> tuple[Array, float]:
        return np.r_[self.r.D[k], np.zeros(self.m)], float(self.r.before[k])

    def u(self, i: int) -> Array:
        return np.eye(1, self.size, self.n + i)[0]

    def at_least(self, *terms: tuple[float, tuple[Array, float]], bound: float = 0.0) -> None:
        self.least.append((sum((x * v for x, (v, _) in terms)), bound - sum(x * b for x, (_, b) in terms)))

    def is_equal(self, *terms: tuple[float, tuple[Array, float]]) -> None:
        self.equal.append((sum((x * v for x, (v, _) in terms)), -sum(x * b for x, (_, b) in terms)))

    def _contact(self, i: int) -> None:
        states, m, mu = self.pool.states[self.node], self.m, float(self.r.p.mu[i])
        state, left, right = (int(states[k * m + i]) for k in range(3))
        cn, ct = self.c(3 * i), (self.c(3 * i + 1), self.c(3 * i + 2))
        dn, dt = self.d(3 * i), (self.d(3 * i + 1), self.d(3 * i + 2))
        self.cones.append((np.stack([mu * cn[0], ct[0][0], ct[1][0]]), np.array([mu * cn[1], ct[0][1], ct[1][1]])))
        self.cones.append((np.stack([self.u(i), dt[0][0], dt[1][0]]), np.array([0.0, dt[0][1], dt[1][1]])))
        if state == kinds.OPEN:
            for x in (cn, *ct):
                self.is_equal((1.0, x))
            self.at_least((1.0, dn))
            return
        (self.at_least if state == kinds.UNDECIDED else self.is_equal)((1.0, cn), (1.0, dn))
        if state == kinds.STICK:
            for x in dt:
                self.is_equal((1.0, x))
        if right > left:
            (xa, ya), (xb, yb) = (
                (np.cos(t), np.sin(t)) for t in np.array([left, right]) * 2 * np.pi / kinds.TURN_DIRECTIONS
            )
            for sign, (one, two) in ((1.0, ct), (-1.0, dt)):
                self.at_least((-sign * ya, one), (sign * xa, two))
                self.at_least((sign * yb, one), (-sign * xb, two))
            if state == kinds.SLIDE:
                h = 1.0 + xa * xb + ya * yb
                self.at_least((xa + xb, ct[0]), (ya + yb, ct[1]), (-mu * h, cn))

    def _actuators(self) -> None:
        for j in range(self.a):
            state, t, slack = (
                self.pool.states[self.node, 3 * self.m + j],
                self.d(3 * self.m + j),
                self.c(3 * self.m + 2 * j),
            )
            (self.is_equal if state == kinds.LOCKED else self.at_least)((1.0, t))
            (self.is_equal if state == kinds.MOVES else self.at_least)((1.0, slack))

    def _plain(self) -> None:
        objective = self.c(3 * self.m + 2 * self.a)
        self.at_least((1.0, objective), bound=float(self.r.lo[0]))
        self.at_least((-1.0, objective), bound=-self.cut)
        work, commands = self.d(len(self.r.D) - 2), self.d(len(self.r.D) - 1)
        self.energy = work[0] + self.cut * commands[0], work[1] + self.cut * commands[1]

    def tangent(self) -> None:
        """The balance of energy as the search has it, at the parent's point."""
        parent = int(self.pool.parent[self.node])
        z, cut = self.pool.data[parent, : self.n], float(self.pool.data[parent, self.n])
        x = [float(self.r.C[3 * i] @ z + self.r.off[3 * i]) for i in range(self.m)]
        work, commands = self.d(len(self.r.D) - 2), self.d(len(self.r.D) - 1)
        terms = [(-2.0 * x[i], self.c(3 * i)) for i in range(self.m)]
        self.at_least((1.0, work), (cut, commands), *terms, bound=-sum(v * v for v in x))

    def balance(self, least: Array) -> None:
        """The balance of energy with lower bounds on normal forces (m,) beside |d_t|."""
        v, b = self.energy
        v = v - sum((float(self.r.p.mu[i]) * least[i] * self.u(i) for i in range(self.m)), np.zeros(self.size))
        normal = [self.c(3 * i) for i in range(self.m)]
        A = np.stack([v / 2, v / 2, *(x for x, _ in normal)])
        self.cones.append((A, np.array([b / 2 + 0.5, b / 2 - 0.5, *(c for _, c in normal)])))

    def solved(self, cost: Array | None = None) -> tuple[str, float]:
        """`empty`, `solved` or another word of the solver, and the least cost . x."""
        blocks, right, cones = [], [], []
        for some, cone in ((self.equal, clarabel.ZeroConeT), (self.least, clarabel.NonnegativeConeT)):
            if some:
                A, b = np.stack([v for v, _ in some]), np.array([x for _, x in some])
                scale = np.maximum(np.abs(A).max(axis=1), 1e-12)
                blocks.append(-A / scale[:, None])
                right.append(-b / scale)
                cones.append(cone(len(some)))
        for A, b in self.cones:
            blocks.append(-A)
            right.append(b)
            cones.append(clarabel.SecondOrderConeT(len(b)))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        q = np.zeros(self.size) if cost is None else cost
        P, A = sparse.csc_matrix((self.size, self.size)), sparse.csc_matrix(np.concatenate(blocks))
        found = clarabel.DefaultSolver(P, q, A, np.concatenate(right), cones, settings).solve()
        status = str(found.status)
        return ("empty" if status == "PrimalInfeasible" else status), float(found.obj_val)


def propagated(s: Search, node: int) -> bool:
    """Is a node empty once lower bounds of its normal forces are in its balance of energy?"""
    m, least = s.reduced.sizes[0], np.zeros(s.reduced.sizes[0])
    for _ in range(2):
        program = ConeProgram(s, node)
        program.balance(least)
        for i in np.flatnonzero(least > SURE).tolist():
            program.is_equal((1.0, program.c(3 * i)), (1.0, program.d(3 * i)))
        if program.solved()[0] == "empty":
            return True
        for i in range(m):
            v, b = program.c(3 * i)
            status, value = program.solved(v)
            if status == "empty":
                return True
            if status == "Solved":
                least[i] = max(least[i], (value + b) * (1 - SURE) - 0.1 * SURE)
    program = ConeProgram(s, node)
    program.balance(least)
    for i in np.flatnonzero(least > SURE).tolist():
        program.is_equal((1.0, program.c(3 * i)), (1.0, program.d(3 * i)))
    return program.solved()[0] == "empty"


def closed_by(s: Search, node: int) -> dict[str, bool]:
    """Which programs of a node are empty."""
    linear, cone = ConeProgram(s, node), ConeProgram(s, node)
    linear.tangent()
    cone.balance(np.zeros(s.reduced.sizes[0]))
    out = {"linear": linear.solved()[0] == "empty", "cone": cone.solved()[0] == "empty"}
    return out | {"propagated": out["cone"] or propagated(s, node)}


def row(s: Search, contacts: int, seed: int, sampled: int) -> dict[str, Any]:
    """What one tree shows."""
    tree = Tree(s)
    programs, saved = tree.closed_by_clauses()
    out: dict[str, Any] = {"contacts": contacts, "seed": seed, "nodes": len(tree.children)}
    out |= {"clause_programs": programs, "clause_nodes": saved}
    medium = [k for k, below in enumerate(tree.children) if below and tree.depth[k] in DEPTHS]
    rng = np.random.default_rng(seed)
    chosen: Indices = rng.permutation(medium)[:sampled]
    out |= {"sampled": len(chosen), "below": int(tree.below[chosen].sum())}
    found = {int(k): closed_by(s, int(k)) for k in chosen}
    for name in ("linear", "cone", "propagated"):
        closed = [k for k, word in found.items() if word[name]]
        out |= {name: len(closed), f"{name}_below": int(tree.below[closed].sum())}
    return out


def table(found: list[dict[str, Any]]) -> str:
    """Shares by number of contacts, as Markdown."""
    lines = [
        "| contacts | trees | nodes | programs that a clause closes | nodes below split ones that one closes "
        "| sampled nodes | empty at the last cut | by the cone program | with propagation | nodes below these three |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for m in sorted({r["contacts"] for r in found}):
        some = [r for r in found if r["contacts"] == m]
        total = {k: sum(r[k] for r in some) for k in some[0]}
        shares = [f"{total[k] / total['nodes']:.3f}" for k in ("clause_programs", "clause_nodes")]
        names = ("linear", "cone", "propagated")
        closed = [f"{total[k] / total['sampled']:.3f}" for k in names]
        below = ", ".join(f"{total[f'{k}_below'] / max(total['below'], 1):.3f}" for k in names)
        cells = [str(m), str(len(some)), f"{total['nodes']:,}", *shares, str(total["sampled"]), *closed, below]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--contacts", nargs="+", type=int, default=[4, 5, 6])
    parser.add_argument("--grasps", type=int, default=6, help="trees of each size")
    parser.add_argument("--sampled", type=int, default=40, help="nodes of each tree")
    parser.add_argument("--pads", type=int, default=16, help="grasps of three contacts whose points are doubled")
    options = parser.parse_args()
    doubled = [row for seed in range(FIRST, FIRST + 10 * options.pads) if (row := pads(seed))][: options.pads]
    found: list[dict[str, Any]] = []
    for m in options.contacts:
        seed = FIRST
        while sum(r["contacts"] == m for r in found) < options.grasps:
            s = searched(m, seed)
            if s is not None:
                found.append(row(s, m, seed, options.sampled))
                print(json.dumps(found[-1]), flush=True)
            seed += 1
    kept = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    kept |= {"machine": describe(), "pads": doubled} | ({"trees": found} if found else {})
    RESULTS.write_text(json.dumps(kept, indent=1) + "\n")
    print(*doubled, table(found), sep="\n")


if __name__ == "__main__":
    main()
