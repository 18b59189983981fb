"""What a certificate claims, as numbers: bounds, equalities and motions in the unknowns x. For `verify`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from holdfast.mechanism import Array
from holdfast.stability.certificate import Certificate, Columns, Question

UNIT = 2.0**-53  # relative error of one rounded operation
TINY = 1e-300  # above anything that underflow can lose


@dataclass(frozen=True, eq=False)
class Claim:
    """Bounds lo <= x <= hi, equalities E x = h, and the motions z = (d, t) = Z x.

    Attributes:
        columns: of x.
        lo, hi, reach: (n,) bounds, rounded outwards, and the larger of |lo|, |hi|.
        E, h: (p, n), (p,) equalities; without those that meet an unknown that nothing bounds.
        Z: (3m+a, n) relative motions d (3m), then mirrored actuator motions t (a).
        error: relative error that covers every sum of this size.
        unbounded: actuators whose force has no bound, for the complaint.
    """

    columns: Columns
    lo: Array
    hi: Array
    E: Array
    h: Array
    Z: Array
    error: float
    unbounded: tuple[str, ...]

    @property
    def reach(self) -> Array:
        """(n,) the largest |x| within the bounds."""
        return np.maximum(np.abs(self.lo), np.abs(self.hi))

    @classmethod
    def of(cls, certificate: Certificate) -> Claim:
        """The claim of a certificate."""
        q, g = certificate.question, certificate.question.grasp
        at, R, A = Columns.of(q), q.sense[:, None] * g.mechanism.R, g.mechanism.A
        # 8 (n + 3m) + rows exceeds the terms of any sum here; 256 covers coefficients, see `verify`
        k = 256 + 8 * (at.n + 3 * g.m) + int(np.diff(certificate.start).max(initial=0))
        error = k * UNIT / (1 - k * UNIT)

        hi = np.full(at.n, np.inf)
        hi[at.r], hi[at.q] = certificate.cap_r, certificate.cap_q
        d = (np.abs(g.G.T) @ hi[at.r] + np.abs(g.J) @ hi[at.q]) * (1 + error) + TINY
        normal = np.minimum(d[0::3], np.inf if q.force_limit is None else q.force_limit)  # c_n <= |d_n|
        if q.mdp:
            normal = np.minimum(normal, np.sqrt(_work(q, certificate, hi[at.r], hi[at.q]) * (1 + error) + TINY))
        c = np.column_stack([normal, g.mu * normal, g.mu * normal]).reshape(-1) * (1 + error)
        hi[at.c] = c
        limit = np.array([q.torque_limits.get(name, np.inf) for name in g.mechanism.actuators])
        z = np.concatenate([limit, np.full(len(A), np.inf)])
        K, load = np.hstack([R.T, A.T]), np.abs(g.J.T) @ c * (1 + error)
        z = np.minimum(z, _solution_bound(K, load, error))
        open_ = ~np.isfinite(z)  # dependent columns; those without limits may be independent of each other
        carried = load + np.abs(K[:, ~open_]) @ z[~open_] * (1 + error)
        z[open_] = _solution_bound(K[:, open_], carried, error)
        hi[at.f], hi[at.coupling] = z[: len(R)], z[len(R) :]
        lo = -hi
        lo[at.c][0::3] = 0.0
        if certificate.scalar is not None:
            lo[at.scalar], hi[at.scalar] = certificate.scalar
            lo[at.e] = 0.0
            hi[at.e] = np.where(q.is_driven, certificate.scalar[1], 0.0)[: at.e.stop - at.e.start]

        locked = np.flatnonzero(~q.may_move)
        sizes = (6, g.l, len(A), len(locked), int(at.e.stop > at.e.start))
        b1, b2, b3, b4, p = np.cumsum(sizes).tolist()
        E, h = np.zeros((p, at.n)), np.zeros(p)
        E[:b1, at.c] = g.G  # (1)
        constant, per_scalar = q.loads
        h[:b1] = -constant
        E[:b1, at.scalar] = per_scalar[:, None]
        E[b1:b2, at.c], E[b1:b2, at.f], E[b1:b2, at.coupling] = g.J.T, -R.T, -A.T  # (2)
        E[b2:b3, at.q] = A
        E[b3:b4, at.q] = R[locked]  # (8) where nothing is commanded
        if p > b4:
            E[b4:, at.scalar], E[b4:, at.e] = 1.0, -q.is_driven.astype(float)
        usable = ~(E[:, ~np.isfinite(hi)] != 0).any(axis=1)
        Z = np.zeros((3 * g.m + len(R), at.n))
        Z[: 3 * g.m, at.r], Z[: 3 * g.m, at.q], Z[3 * g.m :, at.q] = g.G.T, -g.J, R  # (3)
        names = [*g.mechanism.actuators, *(f"coupling {i}" for i in range(len(A)))]
        unbounded = tuple(n for n, v in zip(names, z, strict=True) if not np.isfinite(v))
        return cls(at, lo, hi, E[usable], h[usable], Z, error, unbounded)


def _work(q: Question, certificate: Certificate, r: Array, q_: Array) -> float:
    """Upper bound on w . r + f_c . t, hence on every c_n^2: by energy, friction only takes (needs (6), (7))."""
    top = 0.0 if certificate.scalar is None else max(abs(v) for v in certificate.scalar)
    (w, per_w), (f, per_f) = q.loads, q.commands
    command = np.where(q.is_driven, top, f + top * per_f)
    return float((np.abs(w) + top * np.abs(per_w)) @ r + command @ (np.abs(q.grasp.mechanism.R) @ q_))


def _solution_bound(K: Array, load: Array, error: float) -> Array:
    """Upper bound on |z| of every z with |K z| <= load; inf where the columns of K are not independent.

    With P K = I - D and |D| <= delta < 1 in the maximum norm, z = P K z + D z gives the bound.
    """
    if not K.shape[1]:
        return np.zeros(0)
    size = np.linalg.norm(K, axis=0)
    size = 2.0 ** np.round(np.log2(np.where(size > 0, size, 1.0)))  # powers of two: scaling rounds nothing
    P = np.linalg.pinv(K / size)
    D = np.abs(np.eye(K.shape[1]) - P @ (K / size)) + error * (1 + np.abs(P) @ np.abs(K / size))
    delta = float(D.sum(axis=1).max()) * (1 + error)
    if not delta < 0.5:
        return np.full(K.shape[1], np.inf)
    z = np.abs(P) @ load * (1 + error)
    return (z + 2 * delta * z.max(initial=0.0)) / size * (1 + 4 * error) + TINY  # delta / (1 - delta) < 2 delta
