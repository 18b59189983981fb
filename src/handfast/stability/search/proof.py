"""What a finished search returns: its outcome, and its certificate: the tree, with a ray for every leaf."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from handfast.core.answer import Stop
from handfast.core.arrays import Array, Indices
from handfast.proofs import checker, kinds
from handfast.proofs.certificate import Certificate
from handfast.proofs.rows import Columns
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.witness import Witness
from handfast.stability.search import arrays, rows
from handfast.stability.search.arrays import Pool
from handfast.stability.search.certificate_polish import Rays, rays_of, repaired, with_rays
from handfast.stability.search.reduced import Reduced

MAX_RAY_LEAVES = 200  # leaves for which another ray is sought


@dataclass(frozen=True, eq=False)
class Proof:
    """What a finished search leaves: every leaf of its tree is closed by a ray, under the cut in force at its end.

    Attributes:
        reduced: the question; pool: the tree, trimmed; cut: the upper bound of the objective.
        cap: [N] virtual motions beyond which it proves nothing; None if there is no such end.
    """

    reduced: Reduced
    pool: Pool
    cut: float
    cap: float | None = None

    @cached_property
    def certificate(self) -> Certificate | None:
        """The certificate; None if nodes are left that no ray closes."""
        r, pool, hi = self.reduced, self.pool, self.cut
        status = pool.status
        if np.isin(status, (arrays.UNRESOLVED, arrays.WAITING)).any():
            return None
        p = r.p
        # where everything is homogeneous, w = d is the search's w = direction_scale d, divided
        force, unit = r.goal.force_unit(p), r.goal.scalar_unit(p)
        scalar = None
        if r.objective:
            first, last = r.goal.scalar_range(float(r.lo[0]), hi)
            scalar = first * unit, last * unit
        question = BoundProblem(p, r.goal).question
        leaves = np.flatnonzero(status == arrays.EMPTY)
        start, entries = self._rows(leaves, Columns.of(question), force, unit)
        part, m = pool.part, len(p.mu)
        moved = np.maximum(part - m, 0)
        states = pool.states
        at = np.arange(len(status))
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
            scalar=scalar,
            parent=pool.parent,
            part=part,
            state=state,
            left=left,
            right=right,
            start=start,
            **entries,
        )

    def checked(self, until: float, known: dict[bytes, Rays]) -> tuple[Proof, bool, Indices]:
        """The proof, does the independent checker accept it, and if not, which nodes of the tree are not proved.

        With other rays for leaves that rounded ones do not prove: in the middle of all, or as they were found. In later
        rounds, where the tree has changed, leaves that are known are asked at the end, with all others.

        until: [s] of `time.monotonic`, when there is no more time for it.
        known: the best rays that were accepted for `_named` leaves of this search, of which it gets more.
        """
        none, whole = np.zeros(0, int), self.certificate
        if whole is None:
            return self, False, none
        found, again, every = whole.rounded(), bool(known), np.arange(len(whole.leaves))
        names = self._named(whole) if again else []
        if again:
            found = with_rays(whole, [known.get(name, ray) for name, ray in zip(names, rays_of(found), strict=True)])
            every = np.array([k for k in every.tolist() if names[k] not in known], dtype=np.int64)
        told = checker.verify(found, until, among=every if again else None)
        if not told.ok:
            if not told.unproved:
                return self, False, none  # there was no time, or the tree is wrong
            left, names = list(told.unproved), names or self._named(whole)
            rays, again = rays_of(found), True
            known |= {names[k]: rays[k] for k in {*every.tolist()}.difference(left)}
            as_found = rays_of(whole)
            better = {k: as_found[k] for k in left}
            if len(left) <= MAX_RAY_LEAVES and self.reduced.cap == np.inf:
                better |= repaired(found, left, until)
            found = with_rays(whole, [better.get(k, ray) for k, ray in enumerate(rays)])
            told = checker.verify(found, until, among=np.array(left, dtype=np.int64))
            known |= {names[k]: ray for k, ray in better.items() if told.ok or k not in (told.unproved or left)}
            if not told.ok:
                return self, False, whole.leaves[list(told.unproved)]
        if again:  # caps are those of all of them together
            told = checker.verify(found, until)
        mended = replace(self, cap=told.cap)
        mended.__dict__["certificate"] = found
        return mended, told.ok, whole.leaves[list(told.unproved)]

    def _named(self, c: Certificate) -> list[bytes]:
        """What is claimed of each leaf, and its ray."""
        states = self.pool.states[self.pool.status == arrays.EMPTY]
        energy = np.where(c.kind == kinds.ENERGY, c.index, -1)
        points = np.where(energy[:, None] >= 0, c.references[energy], 0.0) if len(c.references) else energy[:, None]
        of_rows = np.column_stack([c.kind, c.index, c.a, c.b, points, np.asarray(c.multiplier, dtype=np.float64)])
        ends = pairwise(c.start.tolist())
        own = (of_rows[first:last].tobytes() for first, last in ends)
        return [repr(c.scalar).encode() + state.tobytes() + ray for state, ray in zip(states, own, strict=True)]

    def under(self, wrench: Array, until: float = np.inf) -> Proof | None:
        """The same cases and rows for another load (6,), if the independent checker accepts them without a cap."""
        if self.certificate is None:
            return None
        certificate = replace(self.certificate, question=replace(self.certificate.question, wrench=wrench))
        found = checker.verify(certificate, until, quick=True)
        if not found.ok or found.cap is not None:
            return None
        out = replace(self, cap=None)
        out.__dict__["certificate"] = certificate
        return out

    def _rows(self, leaves: Indices, at: Columns, force: float, unit: float) -> tuple[Indices, dict[str, Any]]:
        """Row pointers and entries of the leaves' rays, multipliers for rows in the grasp's units.

        force, unit: [N] and units of the scalar, per scaled one.
        """
        r, p, pool = self.reduced, self.reduced.p, self.pool
        ids, y = pool.ids[leaves], pool.data[leaves].copy()
        kind = ids >> rows.KIND_SHIFT
        box = (kind == rows.BOX_UP) | (kind == rows.BOX_DOWN)
        index = (ids >> rows.INDEX) & 255
        of_motion = np.array([*(name == "motion" for name, _ in r.names), False])[np.minimum(index, len(r.names))]
        plain = (kind == kinds.BOUND_UP) | (kind == kinds.BOUND_DOWN)
        used = (y > 0) & ~box & ~(plain & of_motion)  # the checker has bounds of its own, or none
        start = np.r_[0, np.cumsum(used.sum(axis=1))]
        ids, kind, index, y = ids[used], kind[used], index[used], y[used]
        a, b = (ids >> rows.ANGLE) & (2 * kinds.TURN_DIRECTIONS - 1), ids & (2 * kinds.TURN_DIRECTIONS - 1)

        # a scaled row is the row in the grasp's units over the force scale, times these
        arms = p.command_units / p.force
        actuator = ((kind >= kinds.T_UP) & (kind <= kinds.S_UP)) | (kind == kinds.S_DOWN)
        if actuator.any():
            moved = r.active[index[actuator]]
            of = kind[actuator]
            effort = p.force / r.scale
            forces = np.where(of <= kinds.E_DOWN, 1 / arms[moved], effort)
            y[actuator] *= np.where(of <= kinds.T_DOWN, arms[moved], forces)
            index[actuator] = moved
        energy = kind == kinds.ENERGY
        nodes, index[energy] = np.unique(ids[energy] & rows.NODE, return_inverse=True)
        a[energy] = b[energy] = 0
        y[energy] /= force
        n = len(r.cost)
        normal = slice(0, 3 * len(p.mu), 3)
        points = force * (pool.data[nodes, :n] @ r.C[normal].T + r.off[normal])
        references = np.column_stack([points, unit * pool.data[nodes, n]])

        flip = np.zeros(len(kind), bool)
        columns, factors = np.zeros(len(r.names), int), np.ones(len(r.names))
        for k, (name, i) in enumerate(r.names):
            if name == "scalar":
                columns[k] = at.scalar.start
                factors[k] = force / unit
            elif name == "normal":
                columns[k] = at.c.start + 3 * i
            elif name == "force":
                columns[k], factors[k] = at.f.start + i, 1 / arms[i]
            elif name == "effort":
                columns[k], factors[k] = at.e.start + i, p.force / r.scale
        plain = (kind == kinds.BOUND_UP) | (kind == kinds.BOUND_DOWN)
        if r.goal.maximised:
            flip = plain & (index == 0)
        y[plain] *= factors[index[plain]]
        index[plain] = columns[index[plain]]
        kind = np.where(flip, kinds.BOUND_UP + kinds.BOUND_DOWN - kind, kind)
        patched = (kind == kinds.SOFT_CHORD) | (kind == kinds.C_SIDE) | (kind == kinds.D_SIDE)
        a[patched], b[patched] = ids[patched] & ((1 << rows.SIDE_SHIFT) - 1), (ids[patched] >> rows.SIDE_SHIFT) & 3
        return start, {"kind": kind, "index": index, "a": a, "b": b, "multiplier": y, "references": references}


# --- what a search returns ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of a search for a small objective (see `objective.py`), or for any state at all.

    Attributes:
        value: the smallest objective that was witnessed; inf if none was.
        bound: no state has a smaller one; inf if there is no state at all, -inf if nothing was shown.
        witness: the state that achieves `value`.
        stop: why it ended.
        seconds, nodes: wall time, programs solved.
        proof: of `bound`, where there is one; verified: it was replayed and holds.
        point: (n,) the witness in the engine's unknowns, a start for neighbouring questions.
    """

    value: float
    bound: float
    witness: Witness | None
    stop: Stop
    seconds: float
    nodes: int
    proof: Proof | None = None
    point: Array | None = None
    verified: bool = False

    @property
    def cost(self) -> tuple[float, int]:
        """Seconds and nodes, as answers have them."""
        return self.seconds, self.nodes

    @property
    def backed(self) -> bool:
        """Was everything replayed? Witnesses always are."""
        return self.verified or self.proof is None

    def after(self, other: Outcome) -> Outcome:
        """With the cost of another search beside its own."""
        return replace(self, seconds=self.seconds + other.seconds, nodes=self.nodes + other.nodes)
