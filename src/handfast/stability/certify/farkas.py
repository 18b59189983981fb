"""The proof of a leaf without any bound on motions or forces: multipliers that cancel every unknown exactly.

A leaf's case and the equations of the model say, of the unknowns x (see `certificate.Columns`),

    F x >= b,   E x = h.

The leaf is empty if there are y (>= 0 where a row is an inequality) and v with y F + v E = 0 and y b + v h > 0. A
sum that is only nearly 0 proves nothing, as motions have no bound. A file has y as rounded numbers, and v follows
from it by least squares; `proved_margins` shows that multipliers near them cancel exactly:

- In floating point, all leaves at once: where the rows that are involved have full rank, a correction of
  bounded size exists (`enclosed_margins`). A right inverse P and |B P - 1| < 1 show the rank.
- In rational arithmetic, leaf by leaf, where ranks are lost: two fingertips that stick do not keep an object
  from turning about the line through them, and rounded numbers do not show it (`exact_margin`).

All of F, b, E, h but the grasp map and the Jacobian are floating-point numbers taken as they are. G and J come
from the file's positions, axes and contact frames exactly. Rows of the friction cone are wider than the cone by
`WIDER`, which covers directions and frames that are of unit length, and at right angles, to rounding only.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from flint import fmpq, fmpq_mat

from handfast.core.arrays import Array, Mask
from handfast.core.rational import rational, rational_cross, rounded
from handfast.model.grasp import Grasp
from handfast.stability.certify.certificate import Certificate, Columns, ContactState, Integers, Question, Row
from handfast.stability.certify.leaf_rows import UNIT, LeafRows, bounds, equations, missed, rows_of

CHUNK, NUMBERS = 256, 1_000_000  # leaves, and numbers of their systems, in memory at a time
SLIGHT = 1e-10  # relative: a contradiction no larger than this is one of rounding, in the question's own numbers
DUST = 1e-13  # relative: multipliers of equalities below this are taken for 0
LEAST = 1e-4  # a small multiplier may change by this share of what an equality's may, relative to the rows' size
TILT = 1e-16  # relative, of a diagonal: enough for an inverse to exist, which may be useless
RANK = 1e-9  # relative: what is smaller does not count for the rank, until shown exactly


@dataclass(frozen=True, eq=False)
class System:
    """What all leaves share.

    Attributes:
        E, h: (p, n), (p,) equalities, E rounded.
        slack, growth: (p,) what a witness may miss them by is slack + |scalar| growth.
        Z: (3m+a, n) motions (d, t) over x, rounded.
        E_size, Z_size: sums of absolute values: |rounded - exact| <= error * size.
        scale: (n,) powers of two by which unknowns are scaled.
        error: relative error of every sum.
    """

    E: Array
    h: Array
    slack: Array
    growth: Array
    E_size: Array
    Z: Array
    Z_size: Array
    scale: Array
    error: float

    @classmethod
    def of(cls, question: Question) -> System:
        """The equations (1), (2), couplings, locked actuators, and (3)."""
        g, at = question.grasp, Columns.of(question)
        E, h, Z = equations(question, g.G, g.J)
        G, J = sizes(g)
        E_size, _, Z_size = (np.abs(a) for a in equations(question, G, J))
        largest = np.maximum(np.abs(E).max(axis=0, initial=0.0), np.abs(Z).max(axis=0, initial=0.0))
        scale: Array = np.exp2(-np.round(np.log2(np.where(largest > 0, largest, 1.0))))
        scale[at.c] = 1.0
        return cls(E * scale, h, *missed(question, len(h)), E_size * scale, Z * scale, Z_size * scale, scale, 64 * UNIT)


def sizes(grasp: Grasp) -> tuple[Array, Array]:
    """(6, 3m), (3m, l): sums of the absolute values of what the entries of G and J are made of."""
    G, J = np.zeros((6, 3 * grasp.m)), np.zeros((3 * grasp.m, grasp.l))

    def crossed(a: Array, b: Array) -> Array:
        return np.array([a[1] * b[2] + a[2] * b[1], a[2] * b[0] + a[0] * b[2], a[0] * b[1] + a[1] * b[0]])

    for i, c in enumerate(grasp.contacts):
        frame, p = np.abs(c.frame), np.abs(c.position)
        G[:3, 3 * i : 3 * i + 3] = frame
        for k in range(3):
            G[3:, 3 * i + k] = crossed(p, frame[:, k])
        for j, joint in enumerate(grasp.joints):
            if i in joint.moves:
                axis = np.abs(joint.axis)
                speed = axis if joint.type == "prismatic" else crossed(axis, p + np.abs(joint.origin))
                J[3 * i : 3 * i + 3, j] = frame.T @ speed
    return G, J


# --- the proof of each leaf -------------------------------------------------------------------------


class Late(Exception):
    """It was to end before."""


def proved_margins(
    certificate: Certificate, cases: Integers, known: dict[bytes, float] | None = None, until: float = np.inf
) -> Array:
    """(L,) y b + v h of every leaf, relative to its terms; positive is a proof, -inf is none.

    A margin below `SLIGHT` is none: two contacts hold no torque about their line, and a load that was computed misses
    what they do hold by 1e-17. A witness may miss the equations by 1e-9.

    cases: (L, m+a, 3) of `verify.leaf_cases`.
    known: leaves of this question and range that were judged before, and their margins; those judged now are added.
    until: [s] of `time.monotonic`, after which `Late` is raised.
    """
    c, q = certificate, certificate.question
    known = {} if known is None else known
    names = [_name(c, cases, k) for k in range(len(c.leaves))]
    new = np.array([name not in known for name in names], dtype=bool)
    system, (lo, hi) = System.of(q), bounds(q, c.scalar)
    counts = np.diff(c.start)
    margins = np.full(len(c.leaves), -np.inf)
    order = np.argsort(counts, kind="stable")  # leaves of like size together: little is wasted on padding
    order = order[new[order]]
    exact: Exact | None = None
    size = (int(counts.max(initial=0)) + len(system.E)) * system.E.shape[1]
    chunk = max(1, min(CHUNK, NUMBERS // size))
    for begin in range(0, len(order), chunk):
        if begin and time.monotonic() > until:
            raise Late
        chosen = order[begin : begin + chunk]
        some, case = c.some(chosen), cases[chosen]
        rows = rows_of(some, np.repeat(case[:, :, 0], counts[chosen], axis=0), lo, hi)
        leaves = Leaves.of(some, rows, system, case, np.arange(len(chosen)))
        margins[chosen] = leaves.margins()
        for k in np.flatnonzero(~(margins[chosen] > 0)):
            if time.monotonic() > until:
                raise Late
            exact = exact or Exact.of(q)
            margins[chosen[k]] = exact.margin(leaves, int(k), rows)
    known |= {name: float(margin) for name, margin, fresh in zip(names, margins, new, strict=True) if fresh}
    margins = np.array([known[name] for name in names])
    return np.where(margins > SLIGHT, margins, -np.inf)


def _name(c: Certificate, cases: Integers, leaf: int) -> bytes:
    """All that a leaf's proof is made of."""
    rows = slice(c.start[leaf], c.start[leaf + 1])
    of_energy = c.kind[rows] == Row.ENERGY
    index = np.where(of_energy, 0, c.index[rows])
    parts = cases[leaf], c.kind[rows], index, c.a[rows], c.b[rows], c.multiplier[rows]
    return b"".join(x.tobytes() for x in (*parts, c.references[c.index[rows][of_energy]]))


@dataclass(frozen=True, eq=False)
class Leaves:
    """Some leaves as padded systems: w B = 0 is to be shown for w near the given one.

    Attributes:
        B: (L, K, n) rows of the leaf, then equalities; zero where a contact is open, whose force is zero.
        size: (L, K, n) sums of absolute values behind B.
        w: (L, K) multipliers. free: (L, K) bool, may have any sign. b: (L, K) right-hand sides; slack: (L, K) by
            how much they may be missed, growth: (L, K) by how much more for each unit of the scalar.
        first: (L, K) bool: rows that the scalar is not below the first of its ends: ends (2,).
        unit: (L, K) powers of two that rows were divided by.
        index: (L, k) which rows of the certificate, -1 for padding; the last p of K are the equalities.
        closed: (L, n) bool: unknowns that are not known to be zero.
        error: relative error of sums.
    """

    B: Array
    size: Array
    w: Array
    free: Mask
    b: Array
    slack: Array
    growth: Array
    first: Mask
    ends: tuple[float, float]
    unit: Array
    index: Integers
    closed: Mask
    error: float

    @classmethod
    def of(
        cls, c: Certificate, rows: LeafRows, system: System, cases: Integers, chosen: Integers, *, whole: bool = False
    ) -> Leaves:
        """The systems of the chosen leaves, with v by least squares; whole: forces of open contacts included."""
        at, g = Columns.of(c.question), c.question.grasp
        counts = np.diff(c.start)[chosen]
        k, p, n = int(counts.max(initial=0)), len(system.E), at.n
        index = np.full((len(chosen), k), -1)
        for i, leaf in enumerate(chosen):
            index[i, : counts[i]] = np.arange(c.start[leaf], c.start[leaf + 1])
        there = index >= 0
        value = np.where(there[..., None], rows.value[index], 0.0)
        x, motions = value[..., :n] * system.scale, value[..., n:]
        F, F_size = x + motions @ system.Z, np.abs(x) + np.abs(motions) @ system.Z_size
        y = np.where(there, c.multiplier[index], 0.0)
        y = y / np.maximum(y.max(axis=1, initial=0.0), 1e-300)[:, None]

        norms = np.linalg.norm(system.E, axis=1)
        unit = np.exp2(-np.round(np.log2(np.where(norms > 0, norms, 1.0))))[:, None]
        E, h = unit * system.E, unit[:, 0] * system.h
        inverse = np.linalg.pinv(E, rcond=1e-12)
        rest = np.einsum("lk,lkn->ln", y, F)
        v = -(rest @ inverse)
        alone = counts == 0  # the equilibrium contradicts itself
        v[alone] = h - E @ (inverse @ h)
        v -= (rest + v @ E) @ inverse  # once more for what rounding left
        v *= unit[:, 0]

        closed = np.ones((len(chosen), n), bool)
        opened = (cases[chosen, : g.m, 0] == ContactState.OPEN) & (not whole)
        closed[:, at.c] = ~np.repeat(opened, 3, axis=1)
        shape = len(chosen), p, n
        B = np.concatenate([F, np.broadcast_to(system.E, shape)], axis=1) * closed[:, None]
        size = np.concatenate([F_size, np.broadcast_to(system.E_size, shape)], axis=1) * closed[:, None]
        free = np.concatenate([there & rows.either[index], np.ones((len(chosen), p), bool)], axis=1)
        b = np.concatenate([np.where(there, rows.b[index], 0.0), np.broadcast_to(system.h, (len(chosen), p))], axis=1)
        none = np.zeros((len(chosen), k))
        slack, growth = (
            np.concatenate([none, np.broadcast_to(x, (len(chosen), p))], axis=1) for x in (system.slack, system.growth)
        )
        down = there & (c.kind[index] == Row.BOUND_DOWN) & (c.index[index] == at.scalar.start)
        first = np.concatenate([down, np.zeros((len(chosen), p), bool)], axis=1)
        w = np.concatenate([y, v], axis=1)
        # rows to a like size, so that a multiplier says how much its row counts
        most = np.abs(B).max(axis=2, initial=0.0)
        divisor: Array = np.exp2(np.round(np.log2(np.where(most > 0, most, 1.0))))
        B, size, w = B / divisor[..., None], size / divisor[..., None], w * divisor
        b, slack, growth = b / divisor, slack / divisor, growth / divisor
        ends = c.scalar or (0.0, 0.0)
        terms = 4 * (k + p + n + 3 * g.m)
        error = system.error + terms * UNIT
        return cls(B, size, w, free, b, slack, growth, first, ends, divisor, index, closed, error)

    def margins(self) -> Array:
        """(L,) by enclosure, first with what counts only, then with all equalities; -inf where ranks are lost."""
        used = self.used
        out = self._enclosed(used)
        again = np.flatnonzero(~(out > 0))
        if len(again):
            out[again] = self.some(again)._enclosed((used | (self.free & (self.index_of_all() < 0)))[again])
        return out

    @property
    def used(self) -> Mask:
        """(L, K) which rows count: inequalities with a multiplier above 0, equalities with one that is not dust."""
        size = np.abs(self.w)
        enough: Mask = size > np.where(self.free, DUST * size.max(axis=1, initial=0.0)[:, None], 0.0)
        return enough & (self.free | (self.w > 0))

    def index_of_all(self) -> Integers:
        """(L, K) `index`, -1 for the equalities."""
        p = self.B.shape[1] - self.index.shape[1]
        return np.concatenate([self.index, np.full((len(self.w), p), -1)], axis=1)

    def some(self, chosen: Integers) -> Leaves:
        """Of these leaves only."""
        names = ("B", "size", "w", "free", "b", "slack", "growth", "first", "unit", "index", "closed")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def end(self, pushed: Mask) -> Array:
        """(L,) the size of the scalar at which what may be missed counts.

        It grows with the scalar. Where the multiplier of the scalar's first end grows faster (pushed), the first end
        is the worst; else the farther one is.
        """
        lo, hi = np.abs(self.ends)
        return np.where(pushed, lo, max(lo, hi))

    def _enclosed(self, used: Mask) -> Array:
        """(L,) a lower bound on w b for a w that cancels exactly, using some rows (L, K) only; relative.

        With D what a multiplier may change by, and P = D^2 B (B^T D^2 B)^-1 rounded: |B^T P - 1| < 1 shows that
        w + P z cancels for some z, no larger than `z` below.
        """
        w = np.where(used, self.w, 0.0)
        B, size = self.B * used[..., None], self.size * used[..., None]
        alive = (size != 0).any(axis=1)  # (L, n); the others are zero in every row that is used
        most = np.maximum(np.abs(w).max(axis=1, initial=0.0), 1e-300)[:, None]
        D = np.where(self.free, 1.0, np.clip(np.sqrt(np.abs(w) / most), LEAST, 1.0)) * used
        DB = D[..., None] * B
        M = DB.transpose(0, 2, 1) @ DB
        n = M.shape[1]
        M[:, np.arange(n), np.arange(n)] += ~alive + TILT * M.max(axis=(1, 2), initial=0.0)[:, None]
        ok = np.isfinite(M).all(axis=(1, 2))
        M[~ok] = np.eye(n)
        try:
            X = np.linalg.inv(M)
        except np.linalg.LinAlgError:  # some leaf's is singular, in spite of the tilt
            return np.full(len(M), -np.inf)
        P = D[..., None] * (DB @ (X * alive[:, None, :]))
        PT, BT = np.abs(P), B.transpose(0, 2, 1)
        off = BT @ P
        off[:, np.arange(n), np.arange(n)] -= alive
        e = np.abs(off) + self.error * (size.transpose(0, 2, 1) @ PT)
        miss = e.sum(axis=2)
        worst = miss.max(axis=1, initial=0.0)
        r = np.abs(np.einsum("lkn,lk->ln", B, w)) + self.error * np.einsum("lkn,lk->ln", size, np.abs(w))
        r = (r + 1e-300) * alive
        z = r + miss * (r.max(axis=1, initial=0.0) / np.maximum(1 - worst, 1e-300))[:, None]
        change = np.einsum("lkn,ln->lk", PT, z) * (1 + 1e-9)
        terms = np.abs(w * self.b)
        value = (w * self.b).sum(axis=1) - (change * np.abs(self.b)).sum(axis=1) * (1 + 1e-9)
        most_w = np.abs(w) + change
        grows = (most_w * self.growth).sum(axis=1) * (1 + 1e-9)
        pushes = (np.where(self.first, w - change, 0.0) / self.unit).sum(axis=1) * (1 - 1e-9)
        value -= (most_w * self.slack).sum(axis=1) * (1 + 1e-9)
        value -= np.multiply(grows, self.end(pushes >= grows), out=np.zeros_like(grows), where=grows > 0)
        value -= self.error * terms.sum(axis=1)
        out = value / np.maximum(terms.sum(axis=1), 1e-300)
        kept = (self.free | (w >= change)).all(axis=1)
        return np.where(ok & (worst < 0.5) & kept & np.isfinite(out), out, -np.inf)


# --- in rational arithmetic -------------------------------------------------------------------------

Sparse = dict[int, fmpq]  # an unknown's number, its coefficient


@dataclass(frozen=True, eq=False)
class Exact:
    """The equalities E and the motions Z of `equations` over x, as rational numbers: one dictionary per row."""

    E: list[Sparse]
    Z: list[Sparse]
    n: int

    @classmethod
    def of(cls, question: Question) -> Exact:
        """From the positions, axes and contact frames as they are."""
        g, at = question.grasp, Columns.of(question)
        E, _, Z = (
            [{int(j): rational(row[j]) for j in np.flatnonzero(row)} for row in np.atleast_2d(a)]
            for a in equations(question, np.zeros((6, 3 * g.m)), np.zeros((3 * g.m, g.l)))
        )
        for i, contact in enumerate(g.contacts):
            p = [rational(x) for x in contact.position]
            frame = [[rational(x) for x in column] for column in contact.frame.T]
            for k, direction in enumerate(frame, start=3 * i):
                for row, x in enumerate([*direction, *rational_cross(p, direction)]):
                    E[row][at.c.start + k] = Z[k][at.r.start + row] = x
            for j, joint in enumerate(g.joints):
                if i not in joint.moves:
                    continue
                speed = [rational(x) for x in joint.axis]
                if joint.type != "prismatic":
                    speed = rational_cross(speed, [x - rational(o) for x, o in zip(p, joint.origin, strict=True)])
                for k, direction in enumerate(frame, start=3 * i):
                    x = _sum(a * b for a, b in zip(direction, speed, strict=True))
                    E[6 + j][at.c.start + k], Z[k][at.q.start + j] = x, -x
        return cls(E, Z, at.n)

    def margin(self, leaves: Leaves, k: int, rows: LeafRows) -> float:
        """y b + v h, relative, of multipliers that cancel exactly, near those of leaf k; -inf if none are found."""
        w, free = leaves.w[k], leaves.free[k]
        if not np.isfinite(leaves.B[k]).all() or not np.isfinite(w).all():
            return -np.inf
        used = leaves.used[k]
        equations_ = free & (leaves.index_of_all()[k] < 0) & (leaves.B[k] != 0).any(axis=1)
        for chosen in (used, used | equations_):
            out = self._solved(leaves, k, rows, np.flatnonzero(chosen))
            if out > 0:
                return out
        return -np.inf

    def _solved(self, leaves: Leaves, k: int, rows: LeafRows, used: Integers) -> float:
        """The same with these rows of the leaf's system only."""
        B, w, free = leaves.B[k][used], leaves.w[k][used], leaves.free[k][used]
        alive = np.flatnonzero((leaves.size[k][used] != 0).any(axis=0))
        exact = [self._row(rows, leaves.index_of_all()[k, j], int(j), leaves.B.shape[1]) for j in used]
        y = [rational(x) / rational(unit) for x, unit in zip(w, leaves.unit[k][used], strict=True)]
        if len(alive):
            # solve for the multipliers that may change most, by as many independent unknowns
            weight = np.where(free, 1.0, np.clip(np.sqrt(np.abs(w) / np.abs(w).max()), LEAST, 1.0))
            basis = _independent((B[:, alive] * weight[:, None]).T)
            others = [j for j in range(len(B)) if j not in basis]
            unknowns = alive[_independent(B[basis][:, alive])].tolist()
            rank = len(basis)
            if len(unknowns) < rank:
                return -np.inf
            zero = fmpq(0)
            matrix = fmpq_mat(rank, rank, [exact[j].get(i, zero) for i in unknowns for j in basis])
            right = [-_sum(y[j] * exact[j][i] for j in others if i in exact[j]) for i in unknowns]
            try:
                found = matrix.solve(fmpq_mat(rank, 1, right))
            except ZeroDivisionError:  # singular
                return -np.inf
            for place, j in enumerate(basis):
                y[j] = found[place, 0]
        if any(x < 0 for x, any_sign in zip(y, free, strict=True) if not any_sign):
            return -np.inf
        opened = ~leaves.closed[k]
        total: Sparse = {}
        for x, row in zip(y, exact, strict=True):
            for i, coefficient in row.items():
                if not opened[i]:
                    total[i] = total.get(i, fmpq(0)) + x * coefficient
        if any(x != 0 for x in total.values()):
            return -np.inf
        b = [rational(x) * rational(unit) for x, unit in zip(leaves.b[k][used], leaves.unit[k][used], strict=True)]
        terms = [x * right for x, right in zip(y, b, strict=True)]
        size = _sum(abs(x) for x in terms)

        def total_of(per_row: Array) -> fmpq:
            parts = zip(y, per_row[k][used], leaves.unit[k][used], strict=True)
            return _sum(abs(x) * rational(s) * rational(unit) for x, s, unit in parts)

        grows = total_of(leaves.growth)
        pushes = _sum(x for x, first in zip(y, leaves.first[k][used], strict=True) if first)
        end = float(leaves.end(np.array(bool(pushes >= grows)))) if grows != 0 else 0.0
        if size == 0 or not np.isfinite(end):
            return -np.inf
        return float(_ratio(_sum(terms) - total_of(leaves.slack) - grows * rational(end), size))

    def _row(self, rows: LeafRows, number: int, place: int, K: int) -> Sparse:
        """A row of a leaf's system over x: of the certificate, or the equality at a place of K."""
        if number < 0:
            return self.E[place - (K - len(self.E))]
        value = rows.value[number]
        out = {int(i): rational(value[i]) for i in np.flatnonzero(value[: self.n])}
        for j in np.flatnonzero(value[self.n :]):
            factor = rational(value[self.n + j])
            for i, x in self.Z[j].items():
                out[i] = out.get(i, fmpq(0)) + factor * x
        return out


def _independent(A: Array) -> list[int]:
    """As many independent columns of A as there are, the largest first: Gram-Schmidt with pivoting."""
    A, chosen = A.copy(), []
    first = 0.0
    for _ in range(min(A.shape)):
        norms = np.sqrt((A * A).sum(axis=0))
        j = int(norms.argmax())
        first = first or norms[j]
        if not norms[j] > RANK * first:
            break
        chosen.append(j)
        along = A[:, j] / norms[j]
        for _again in range(2):  # once more for what rounding left
            A -= np.outer(along, along @ A)
        A[:, j] = 0.0
    return chosen


def _sum(terms: Iterable[fmpq]) -> fmpq:
    return sum(terms, fmpq(0))


def _ratio(x: fmpq, y: fmpq) -> float:
    """x / y rounded; integers of any length."""
    return rounded(x / y)
