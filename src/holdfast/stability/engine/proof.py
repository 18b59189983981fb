"""From a finished search to its certificate: the tree, and a ray for every leaf, in the grasp's own units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from holdfast.mechanism import Indices
from holdfast.stability.certificate import Certificate, Columns, Question
from holdfast.stability.certificate import Goal as Claimed
from holdfast.stability.engine import rows, tree
from holdfast.stability.engine.search import Search
from holdfast.stability.goal import Goal

CLAIMS = {
    Goal.EXISTS: Claimed.CHECK,
    Goal.SMALLEST_PRELOAD: Claimed.SMALLEST_PRELOAD,
    Goal.LARGEST: Claimed.LARGEST,
    Goal.SMALLEST_MAX_TORQUE: Claimed.TORQUES,
    Goal.SMALLEST_SUM_TORQUE: Claimed.TORQUES,
}


@dataclass(eq=False)
class Proof:
    """A finished search: every leaf of its tree is closed by a ray, under the cut in force at its end."""

    search: Search

    def certificate(self) -> Certificate | None:
        """The certificate; None if nodes are left that no ray closes."""
        s, r = self.search, self.search.reduced
        assert s.pool is not None
        used = int(s.stats[tree.USED])
        status = s.pool.status[:used]
        if not r.solvable or np.isin(status, (tree.UNRESOLVED, tree.WAITING)).any():
            return None
        p, hi = r.p, float(s.hi[0])
        scalar = None
        if r.objective:
            lo = float(r.lo[0])
            scalar = (-hi, -lo) if r.goal is Goal.LARGEST else (lo * r.scale, hi * r.scale)
        lengths = p.force * np.array([1.0] * 3 + [1.0 / p.length] * 3)
        question = self._question()
        leaves = np.flatnonzero(status == tree.EMPTY)
        start, entries = self._rows(leaves, Columns.of(question))
        parent = s.pool.parent[:used].copy()
        part, m = s.pool.part[:used].copy(), len(p.mu)
        moved = np.maximum(part - m, 0)
        states = s.pool.states[:used]
        at = np.arange(used)
        contact = part < m
        i = np.minimum(part, m - 1)
        state = states[at, i]
        left, right = states[at, m + i], states[at, 2 * m + i]
        if len(r.active):
            state = np.where(contact, state, states[at, 3 * m + moved])
            part = np.where(contact, part, m + r.active[moved])
        left, right = np.where(contact, left, 0), np.where(contact, right, 0)
        return Certificate(
            question=question,
            cap_r=r.cap * lengths,
            cap_q=r.cap * p.force / p.joint_scale,
            scalar=scalar,
            parent=parent,
            part=part,
            state=state,
            left=left,
            right=right,
            leaves=leaves,
            start=start,
            **entries,
        )

    def _question(self) -> Question:
        r, p = self.search.reduced, self.search.reduced.p
        claimed = CLAIMS[r.goal]
        homogeneous = claimed is Claimed.SMALLEST_PRELOAD
        names = p.grasp.mechanism.actuators
        return Question(
            grasp=p.grasp,
            goal=claimed,
            wrench=np.zeros(6) if homogeneous else p.wrench,
            direction=p.along if homogeneous or claimed is Claimed.LARGEST else None,
            eta=p.eta,
            mdp=p.mdp,
            torque_limits=p.torque_limits,
            force_limit=p.force_limit,
            driven=[n for n, d in zip(names, p.driven, strict=True) if d],
            objective="sum" if r.goal is Goal.SMALLEST_SUM_TORQUE else "max",
        )

    def _rows(self, leaves: Indices, at: Columns) -> tuple[Indices, dict[str, Any]]:
        """Row pointers and entries of the leaves' rays, multipliers for rows in the grasp's units."""
        s, r, p = self.search, self.search.reduced, self.search.reduced.p
        assert s.pool is not None
        ids, y = s.pool.ids[leaves], s.pool.data[leaves].copy()
        kind = ids >> rows.KIND
        used = (y > 0) & (kind < rows.BOX_UP)  # a bound on z itself says nothing about x: the caps stand in for it
        start = np.r_[0, np.cumsum(used.sum(axis=1))]
        ids, kind, y = ids[used], kind[used], y[used]
        index = (ids >> rows.INDEX) & 255
        a, b = (ids >> rows.ANGLE) & (2 * rows.TURN - 1), ids & (2 * rows.TURN - 1)

        # a scaled row is the row in the grasp's units over the force scale, times these
        lever = np.abs(p.command(np.ones(len(p.R)))) / p.force
        actuator = (kind >= rows.T_UP) & (kind <= rows.S_UP)
        if actuator.any():
            moved = r.active[index[actuator]]
            of = kind[actuator]
            effort = p.force / r.scale
            forces = np.where(of <= rows.E_DOWN, 1 / lever[moved], effort)
            y[actuator] *= np.where(of <= rows.T_DOWN, lever[moved], forces)
            index[actuator] = moved
        flip = np.zeros(len(kind), bool)
        columns, factors = np.zeros(len(r.names), int), np.ones(len(r.names))
        for k, (name, i) in enumerate(r.names):
            if name == "scalar":
                columns[k], factors[k] = at.scalar.start, p.force / r.scale
            elif name == "motion":
                columns[k] = at.r.start + i
                factors[k] = (1.0 if i < 3 else p.length) if i < 6 else p.joint_scale[i - 6]
            elif name == "normal":
                columns[k] = at.c.start + 3 * i
            elif name == "force":
                columns[k], factors[k] = at.f.start + i, 1 / lever[i]
            else:
                columns[k], factors[k] = at.e.start + i, p.force / r.scale
        plain = kind >= rows.PLAIN_UP
        if r.goal is Goal.LARGEST:
            flip = plain & (index == 0)
        y[plain] *= factors[index[plain]]
        index[plain] = columns[index[plain]]
        kind = np.where(flip, rows.PLAIN_UP + rows.PLAIN_DOWN - kind, kind)
        return start, {"kind": kind, "index": index, "a": a, "b": b, "multiplier": y}
