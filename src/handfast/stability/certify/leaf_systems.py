"""The proofs of many leaves as padded systems of numbers, and a bound on how far multipliers are from cancelling.

The rows of a leaf and the equations of the model, in floating point: see `farkas`, whose first way this is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.model.grasp import Grasp
from handfast.stability.certify.certificate import Certificate, Columns, ContactState, Integers, Question, Row
from handfast.stability.certify.leaf_rows import UNIT, ContactMaps, LeafRows, equations, missed

NEGLIGIBLE = 1e-13  # relative: multipliers of equalities below this are taken for 0
LEAST = 1e-4  # a small multiplier may change by this share of what an equality's may, relative to the rows' size
TILT = 1e-16  # relative, of a diagonal: enough for an inverse to exist, which may be useless


@dataclass(frozen=True, eq=False)
class SharedSystem:
    """What all leaves share.

    Attributes:
        E, h: (p, n), (p,) equalities, E rounded.
        slack, growth: (p,) what a witness may miss them by is slack + |scalar| growth.
        Z: (3m+a+s, n) motions (d, t, turning) over x, rounded.
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
    def of(cls, question: Question) -> SharedSystem:
        """The equations (1), (2), couplings, locked actuators, and (3)."""
        g, at = question.plain, Columns.of(question)
        E, h, Z = equations(question, ContactMaps.of(g))
        E_size, _, Z_size = (np.abs(a) for a in equations(question, sizes(g)))
        largest = np.maximum(np.abs(E).max(axis=0, initial=0.0), np.abs(Z).max(axis=0, initial=0.0))
        scale: Array = np.exp2(-np.round(np.log2(np.where(largest > 0, largest, 1.0))))
        scale[at.c] = 1.0
        return cls(E * scale, h, *missed(question, len(h)), E_size * scale, Z * scale, Z_size * scale, scale, 64 * UNIT)


def sizes(grasp: Grasp) -> ContactMaps:
    """Sums of the absolute values of what the entries of the maps are made of."""
    out = ContactMaps.none(grasp)
    G, J = out.G, out.J

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
    for k, i in enumerate(grasp.soft):
        normal = grasp.levers[k] * np.abs(grasp.contacts[i].frame[:, 0])
        out.twist_map[3:, k] = normal
        for j, joint in enumerate(grasp.joints):
            if i in joint.moves and joint.type == "revolute":
                out.twist_jacobian[k, j] = normal @ np.abs(joint.axis)
    return out


@dataclass(frozen=True, eq=False)
class LeafSystems:
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
        cls,
        c: Certificate,
        rows: LeafRows,
        system: SharedSystem,
        cases: Integers,
        chosen: Integers,
        *,
        whole: bool = False,
    ) -> LeafSystems:
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
        closed[:, at.twist] = ~opened[:, g.soft]
        shape = len(chosen), p, n
        B = np.concatenate([F, np.broadcast_to(system.E, shape)], axis=1) * closed[:, None]
        size = np.concatenate([F_size, np.broadcast_to(system.E_size, shape)], axis=1) * closed[:, None]
        free = np.concatenate([there & rows.either[index], np.ones((len(chosen), p), bool)], axis=1)
        b = np.concatenate([np.where(there, rows.b[index], 0.0), np.broadcast_to(system.h, (len(chosen), p))], axis=1)
        none = np.zeros((len(chosen), k))
        slack, growth = (
            np.concatenate([none, np.broadcast_to(x, (len(chosen), p))], axis=1) for x in (system.slack, system.growth)
        )
        up = there & (c.kind[index] == Row.BOUND_UP) & (c.index[index] == at.scalar.start)
        first = np.concatenate([up, np.zeros((len(chosen), p), bool)], axis=1)
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
        """(L, K) which rows count: inequalities with a multiplier above 0, equalities with more than a tiny one."""
        size = np.abs(self.w)
        enough: Mask = size > np.where(self.free, NEGLIGIBLE * size.max(axis=1, initial=0.0)[:, None], 0.0)
        return enough & (self.free | (self.w > 0))

    def index_of_all(self) -> Integers:
        """(L, K) `index`, -1 for the equalities."""
        p = self.B.shape[1] - self.index.shape[1]
        return np.concatenate([self.index, np.full((len(self.w), p), -1)], axis=1)

    def some(self, chosen: Integers) -> LeafSystems:
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
