"""Best-first search over contact and actuator states: node programs by `kernel`, incumbents by exact Newton."""

from __future__ import annotations

import heapq
import itertools
import time
from dataclasses import dataclass, field

import kernel
import numpy as np

from holdfast.mechanism import Array
from holdfast.stability import exact, relaxation, witness
from holdfast.stability.exact import Point
from holdfast.stability.problem import Problem
from holdfast.stability.relaxation import Goal
from holdfast.stability.witness import Witness

BOX = 1e5  # |z_j| <= BOX follows from the motion cap; the first working set is a corner of this box
PERTURBATION = 1e-7  # of the cost, against ties; nodes are pruned by infeasibility only, which it does not touch
HIGHEST = 1e5  # of lambda
VIOLATION = 1e-7  # (scaled) a smaller violation of a complementarity is none
Basis = tuple[Array, Array, Array, Array]


@dataclass(eq=False)
class Node:
    """States of contacts (with sector ends) and actuators, and the parent's working set."""

    touch: Array
    left: Array
    right: Array
    motor: Array
    basis: Basis

    def child(self, basis: Basis) -> Node:
        return Node(self.touch.copy(), self.left.copy(), self.right.copy(), self.motor.copy(), basis)


@dataclass
class Result:
    """What a search found and what it cost."""

    magnitude: float  # the best witnessed s, 0 if none
    witness: Witness | None
    finished: bool  # the tree is exhausted: nothing is left above magnitude * (1 + gap)
    nodes: int = 0
    unresolved: int = 0  # leaves that neither their program nor Newton settled
    restarts: int = 0
    newtons: int = 0
    seconds: dict[str, float] = field(default_factory=lambda: {"programs": 0.0, "newton": 0.0, "all": 0.0})


class Reduced:
    """The model with its equations eliminated: x = x0 + N z, and the base rows that `kernel` builds from."""

    def __init__(self, p: Problem, goal: Goal) -> None:
        m, l, a, k = p.sizes
        self.p, self.m, self.a, self.motions = p, m, a, 6 + l
        self.load = relaxation.load(p, goal)
        C, F, L = 6 + l, 6 + l + 3 * m, 6 + l + 3 * m + a  # where c, f and the couplings' multipliers begin
        self.cuts = (C, F, L)
        n = L + k + 1
        E, h = np.zeros((6 + l + k, n)), np.zeros(6 + l + k)
        E[:6, C:F], E[:6, -1], h[:6] = p.G, self.load.w_b, -self.load.w_a  # (1)
        E[6 : 6 + l, C:F], E[6 : 6 + l, F:L], E[6 : 6 + l, L:-1] = p.J.T, -p.R.T, -p.A.T  # (2)
        E[6 + l :, 6:C] = p.A
        locked = np.zeros((int((~p.moves).sum()), n))
        locked[:, 6:C] = p.R[~p.moves]
        E, h = np.vstack([E, locked]), np.r_[h, np.zeros(len(locked))]
        self.x0 = np.linalg.lstsq(E, h, rcond=1e-12)[0]
        _, sv, Vt = np.linalg.svd(E)
        self.N = Vt[int((sv > 1e-10 * sv[0]).sum()) :].T
        self.solvable = bool(np.abs(E @ self.x0 - h).max() < 1e-9)

        rows, offset = [], []
        for i in range(m):
            for b in range(3):
                rows.append(np.eye(n)[C + 3 * i + b])
            for b in range(3):
                rows.append(np.r_[p.G[:, 3 * i + b], -p.J[3 * i + b], np.zeros(n - C)])
        offset += [0.0] * (6 * m)
        for j in range(a):
            rows.append(np.r_[np.zeros(6), p.R[j], np.zeros(n - C)])
            excess = np.eye(n)[F + j]
            excess[-1] -= self.load.f_b[j]
            rows.append(excess)
            offset += [0.0, -self.load.f_a[j]]
        rows += [np.eye(n)[-1], *np.eye(n)[: self.motions]]
        offset += [0.0] * (1 + self.motions)
        B = np.array(rows)
        self.base = np.ascontiguousarray(B @ self.N)
        self.offset = B @ self.x0 + np.array(offset)
        self.lam = 6 * m + 2 * a
        self.low = 1.0 / relaxation.search_end(p) if p.f_c.any() else 0.0
        cost = self.base[self.lam]
        sign = np.where(cost >= 0, 1.0, -1.0)
        noise = 1 + np.random.default_rng(0).random(len(cost))
        self.cost = cost + sign * PERTURBATION * noise
        corner = np.where(sign > 0, kernel.BOX_UP, kernel.BOX_DOWN).astype(np.int64)
        size = len(cost)
        basis = (corner, np.arange(size), np.zeros(size), np.zeros(size))
        self.root = Node(np.zeros(m, np.int64), np.zeros(m), np.zeros(m), np.zeros(a, np.int64), basis)

    def solve(self, node: Node, basis: Basis, cutoff: float) -> tuple[int, Array, Basis]:
        """Status, point and final working set of a node's program."""
        working = tuple(b.copy() for b in basis)
        z = np.zeros(len(self.cost))
        status, _ = kernel.solve_node(
            self.base, self.offset, self.p.mu, self.m, self.a, self.lam, self.motions, self.p.moves,
            self.low, min(HIGHEST, max(cutoff, self.low)), relaxation.MOTION_CAP, BOX, self.cost,
            node.touch, node.left, node.right, node.motor, *working, z,
        )  # fmt: skip
        return status, z, working  # type: ignore[return-value]

    def point(self, z: Array) -> Point:
        """The model's (scaled) unknowns."""
        x = self.x0 + self.N @ z
        C, F, L = self.cuts
        return Point(x[:6], x[6:C], x[C:F], x[F:L], x[L:-1], float(x[-1]))

    def children(self, node: Node, z: Array, basis: Basis) -> tuple[list[Node], float]:
        """Split on the largest violation; no children where nothing is violated. Also their sum."""
        v = self.base @ z + self.offset
        contact = v[: 6 * self.m].reshape(-1, 6)
        worst, pick, total = VIOLATION, -1, 0.0
        for i, (cn, c1, c2, dn, d1, d2) in enumerate(contact):
            state = node.touch[i]
            if state in (kernel.OPEN, kernel.STICK):
                continue
            amount = min(cn, cn + dn) if state == kernel.UNDECIDED else 0.0
            if amount < VIOLATION and cn > 1e-9:  # (4) holds: what about (7)?
                speed = np.hypot(d1, d2)
                amount = np.hypot(c1 * speed + self.p.mu[i] * cn * d1, c2 * speed + self.p.mu[i] * cn * d2)
                amount /= max(speed, 1.0) * (2.0 if state == kernel.UNDECIDED else 1.0)
            total += max(amount, 0.0)
            if amount > worst:
                worst, pick = amount, i
        motor = v[6 * self.m : self.lam].reshape(-1, 2).min(axis=1)
        for j in np.flatnonzero(self.p.moves & (node.motor == kernel.FREE)):
            total += max(float(motor[j]), 0.0)
            if motor[j] > worst:
                worst, pick = float(motor[j]), self.m + int(j)
        if pick < 0:
            return [], total
        if pick >= self.m:
            return [self._motor(node, pick - self.m, s, basis) for s in (kernel.LOCKED, kernel.MOVES)], total
        return self._contact(node, pick, contact[pick], basis), total

    def _motor(self, node: Node, j: int, state: int, basis: Basis) -> Node:
        child = node.child(basis)
        child.motor[j] = state
        return child

    def _contact(self, node: Node, i: int, values: Array, basis: Basis) -> list[Node]:
        _, c1, c2, _, d1, d2 = values

        def become(state: int, left: float = 0.0, right: float = 0.0) -> Node:
            child = node.child(basis)
            child.touch[i], child.left[i], child.right[i] = state, left, right
            return child

        if node.touch[i] == kernel.UNDECIDED:
            return [become(kernel.CLOSED), become(kernel.OPEN)]
        force, slide = np.hypot(c1, c2), np.hypot(d1, d2)
        if node.touch[i] == kernel.CLOSED:  # stick, or one of three sectors with a border along the motion
            a = np.arctan2(-d2, -d1) if slide > 1e-9 else np.arctan2(c2, c1)
            third = 2 * np.pi / 3
            sectors = [become(kernel.SLIDE, a + s * third, a + (s + 1) * third) for s in range(3)]
            return [become(kernel.STICK), *sectors]
        a, b = node.left[i], node.right[i]
        between = np.arctan2(
            c2 / max(force, 1e-12) - d2 / max(slide, 1e-12), c1 / max(force, 1e-12) - d1 / max(slide, 1e-12)
        )
        cut = a + np.clip(((between - a) % (2 * np.pi)) / (b - a), 0.15, 0.85) * (b - a)
        return [become(kernel.SLIDE, a, cut), become(kernel.SLIDE, cut, b)]


def incumbent(r: Reduced, z: Array) -> tuple[Witness, float] | None:
    """An exact solution near a node's point, with its lambda."""
    start = r.point(z)
    x = exact.solve(r.p, r.load, start, exact.read_modes(r.p, start))
    if x is None:
        return None
    found = witness.as_witness(r.p, r.load, x)
    return (found, x.sigma) if found.valid else None


def search(p: Problem, *, gap: float = 1e-3, limit: float = 60.0) -> Result:
    """The largest s, by the homogeneous form: minimise lambda = 1 / s."""
    start = time.perf_counter()
    r = Reduced(p, Goal.SMALLEST_PRELOAD)
    out = Result(0.0, None, True)
    best = np.inf
    count = itertools.count()
    heap = [(0.0, next(count), r.root)] if r.solvable else []
    while heap and time.perf_counter() - start < limit and best > r.low * (1 + gap):
        node = heapq.heappop(heap)[2]
        out.nodes += 1
        clock = time.perf_counter()
        try:
            status, z, basis = r.solve(node, node.basis, best / (1 + gap))
        except np.linalg.LinAlgError:  # the parent's working set has become singular
            out.restarts += 1
            status, z, basis = r.solve(node, r.root.basis, best / (1 + gap))
        out.seconds["programs"] += time.perf_counter() - clock
        if status == kernel.INFEASIBLE:
            continue
        if status == kernel.FAILED:
            out.unresolved += 1
            continue
        children, violation = r.children(node, z, basis)
        if out.nodes <= 8 or out.nodes % 8 == 0 or not children:
            clock = time.perf_counter()
            out.newtons += 1
            hit = incumbent(r, z)
            out.seconds["newton"] += time.perf_counter() - clock
            if hit and hit[1] < best:
                out.witness, best = hit
        bound = r.point(z).sigma
        if not children:
            out.unresolved += best > bound * (1 + gap)
        for child in children:
            heapq.heappush(heap, (bound + 1e-3 * violation, next(count), child))
    out.finished = not heap or best <= r.low * (1 + gap)
    out.magnitude = 1.0 / max(best, r.low) if best < np.inf and max(best, r.low) > 0 else 0.0
    out.seconds["all"] = time.perf_counter() - start
    return out
