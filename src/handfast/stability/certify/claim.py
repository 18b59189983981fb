"""Certificates of version 1: a leaf is refuted for motions inside a cap, in floating point.

With rows F x >= b, multipliers y >= 0, equalities E x = h and any v, every x of the leaf has

    y b + v h <= (y F + v E) x <= sum over k of max(rho_k lo_k, rho_k hi_k),   rho = y F + v E,

so the leaf is empty if the left end is larger than the right one. Which v is used does not matter for soundness:
least squares makes rho small. Floating-point errors are bounded from above throughout. Bounds of forces follow from
those of motions, which the file gives: proofs without any cap are in `farkas`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.stability.certify.certificate import HALF, Certificate, Columns, Question, Row, directions
from handfast.stability.certify.leaf_rows import UNIT, ContactMaps, equations, missed, rows_of
from handfast.stability.model import joint_arms

UNDERFLOW = 1e-300  # above anything that underflow can lose


def caps(grasp: Grasp, cap: float) -> tuple[Array, Array]:
    """(6,) and (l,) how far object and joints may move where contacts may move by a cap [N at unit stiffness]."""
    return cap * np.array([1.0] * 3 + [1.0 / grasp.size] * 3), cap / joint_arms(grasp)


@dataclass(frozen=True, eq=False)
class Claim:
    """Bounds lo <= x <= hi, equalities E x = h, and the motions z = (d, t) = Z x.

    Attributes:
        columns: of x.
        lo, hi, reach: (n,) bounds, rounded outwards, and the larger of |lo|, |hi|.
        E, h: (p, n), (p,) equalities; without those that meet an unknown that nothing bounds.
        slack, growth: (p,) what a witness may miss them by is slack + |scalar| growth.
        Z: (3m+a+s, n) relative motions d (3m), then mirrored actuator motions t (a), turning of soft fingers (s).
        error: relative error that covers every sum of this size.
        unbounded: actuators whose force has no bound, for the complaint.
    """

    columns: Columns
    lo: Array
    hi: Array
    E: Array
    h: Array
    slack: Array
    growth: Array
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
        q, g = certificate.question, certificate.question.plain
        at, R, A = Columns.of(q), q.sense[:, None] * g.mechanism.R, g.mechanism.A
        # 8 (n + 3m) + rows exceeds the terms of any sum here; 256 covers coefficients, see `verify`
        k = 256 + 8 * (at.n + 3 * g.m) + int(np.diff(certificate.start).max(initial=0))
        error = k * UNIT / (1 - k * UNIT)

        hi = np.full(at.n, np.inf)
        hi[at.r], hi[at.q] = certificate.cap_r, certificate.cap_q
        d = (np.abs(g.G.T) @ hi[at.r] + np.abs(g.J) @ hi[at.q]) * (1 + error) + UNDERFLOW
        normal = np.minimum(d[0::3], np.inf if q.force_limit is None else q.force_limit)  # c_n <= |d_n|
        if q.mdp:
            normal = np.minimum(normal, np.sqrt(_work(q, certificate, hi[at.r], hi[at.q]) * (1 + error) + UNDERFLOW))
        c = np.column_stack([normal, g.mu * normal, g.mu * normal]).reshape(-1) * (1 + error)
        hi[at.c] = c
        hi[at.twist] = twist = (g.mu * normal * (1 + error))[g.soft]
        limit = np.array([q.torque_limits.get(name, np.inf) for name in g.mechanism.actuators])
        z = np.concatenate([limit, np.full(len(A), np.inf)])
        torques = np.abs(g.J.T) @ c + np.abs(g.twist_jacobian.T) @ twist
        K, load = np.hstack([R.T, A.T]), (torques + _given(q, certificate)) * (1 + error)
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

        E, h, Z = equations(q, ContactMaps.of(g))
        usable = ~(E[:, ~np.isfinite(hi)] != 0).any(axis=1)
        names = [*g.mechanism.actuators, *(f"coupling {i}" for i in range(len(A)))]
        unbounded = tuple(n for n, v in zip(names, z, strict=True) if not np.isfinite(v))
        slack, growth = (x[usable] for x in missed(q, len(h)))
        return cls(at, lo, hi, E[usable], h[usable], slack, growth, Z, error, unbounded)


def _work(q: Question, certificate: Certificate, r: Array, q_: Array) -> float:
    """Upper bound on w . r + f_c . t + torque . q, hence on every c_n^2: friction only takes (needs (6), (7))."""
    top = 0.0 if certificate.scalar is None else max(abs(v) for v in certificate.scalar)
    load = q.load
    command = np.where(q.is_driven, top, load.f_a + top * load.f_b)
    given = _given(q, certificate) @ q_
    work = (np.abs(load.w_a) + top * np.abs(load.w_b)) @ r + command @ (np.abs(q.plain.mechanism.R) @ q_)
    return float(work + given)


def _given(q: Question, certificate: Certificate) -> Array:
    """(l,) upper bound on the size of what is given to joints."""
    top = 0.0 if certificate.scalar is None else max(abs(v) for v in certificate.scalar)
    out: Array = np.abs(q.load.g_a) + top * np.abs(q.load.g_b)
    return out


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
    return (z + 2 * delta * z.max(initial=0.0)) / size * (1 + 4 * error) + UNDERFLOW  # delta / (1 - delta) < 2 delta


# --- the proof of each leaf ---------------------------------------------------------------------


def leaf_margins(certificate: Certificate, claim: Claim) -> Array:
    """(L,) how far each leaf's rows contradict the bounds, of the numbers involved; positive is a proof."""
    n, eps = claim.columns.n, claim.error
    S, size, rhs, rhs_size = weighed_rows(certificate, claim)
    rho0 = S[:, :n] + S[:, n:] @ claim.Z
    error = eps * (size[:, :n] + size[:, n:] @ np.abs(claim.Z))

    v = equality_multipliers(rho0, claim)
    rho = rho0 + v @ claim.E
    error = error + eps * (np.abs(rho0) + np.abs(v) @ np.abs(claim.E)) + UNDERFLOW
    bounded = np.isfinite(claim.reach)
    lo, hi, reach = (np.where(bounded, b, 0.0) for b in (claim.lo, claim.hi, claim.reach))
    most = np.maximum(rho * lo, rho * hi).sum(axis=1)
    gap = rhs + v @ claim.h - most
    involved = rhs_size + np.abs(v) @ np.abs(claim.h) + np.abs(rho) @ reach
    gap -= 2 * (error @ reach + eps * involved + UNDERFLOW)
    gap -= np.abs(v) @ claim.slack * (1 + eps) + _grown(certificate, claim, np.abs(v) @ claim.growth * (1 + eps))
    # an unknown without bound may occur nowhere, not even by rounding
    gap[(size[:, :n][:, ~bounded] != 0).any(axis=1)] = -np.inf
    return np.asarray(gap / np.maximum(involved, UNDERFLOW))


def _grown(certificate: Certificate, claim: Claim, grows: Array) -> Array:
    """(L,) what may be missed for the scalar's sake, less what the multiplier of its first end grows meanwhile."""
    c, at = certificate, claim.columns
    if c.scalar is None or not grows.any():
        return np.zeros(len(grows))
    lo, hi = c.scalar
    up = (c.kind == Row.BOUND_UP) & (c.index == at.scalar.start)
    leaf = np.repeat(np.arange(len(grows)), np.diff(c.start))
    pushes = np.bincount(leaf, np.where(up, c.multiplier, 0.0), len(grows)) * (1 - claim.error)
    return np.maximum(grows * abs(lo), grows * abs(hi) - pushes * (hi - lo))


def equality_multipliers(rho0: Array, claim: Claim) -> Array:
    """(L, p) v that makes rho0 + v E small, each unknown weighed by its reach; any v would be sound."""
    weight = np.where(np.isfinite(claim.reach), claim.reach, 0.0)
    weight /= max(weight.max(), UNDERFLOW)
    weight[np.isfinite(claim.reach)] += 1e-9  # rows still say v where the reach is 0: no friction
    norms = np.linalg.norm(claim.E * weight, axis=1)
    scale = np.where(norms > 0, 1.0 / np.where(norms > 0, norms, 1.0), 0.0)[:, None]
    inverse = np.linalg.pinv(claim.E * weight * scale)
    v = -((rho0 * weight) @ inverse) * scale.T
    return v - (((rho0 + v @ claim.E) * weight) @ inverse) * scale.T  # once more for what rounding left


def weighed_rows(certificate: Certificate, claim: Claim) -> tuple[Array, Array, Array, Array]:
    """Rows weighed by multipliers: S (L, n+3m+a+s) on (x, d, t, turning), the sum of sizes, b (L,), its sum of sizes.

    The sizes times `Claim.error` bound all errors, of rounding and of float directions.
    """
    c, g, L = certificate, certificate.question.plain, len(certificate.leaves)
    any_case = np.zeros((len(c.kind), g.m + g.mechanism.a), dtype=np.int64)
    rows = rows_of(c, any_case, claim.lo, claim.hi, wider=0.0)
    y, leaf = c.multiplier, np.repeat(np.arange(L), np.diff(c.start))

    def total(what: Array) -> Array:
        out = np.zeros((L, *what.shape[1:]))
        np.add.at(out, leaf, what)
        return out

    b = y * rows.b
    size = np.abs(rows.value) + _of_directions(c, claim.columns)
    return total(y[:, None] * rows.value), total(y[:, None] * size), total(b), total(np.abs(b))


def _of_directions(c: Certificate, at: Columns) -> Array:
    """(R, n+3m+a+s) what float directions U = (1 + e) unit, |e| < 10 u, add to the sizes, for 256 u.

    They make g wrong by less than 80 u |d_t| / (1 + U_a . U_b)^1.5, the chord by as much times mu c_n, `TANGENT` by
    10 u mu c_n, `GAP_DOWN` by 10 u |d_t|. `C_LEFT` and the like are exact: U_(a + half a turn) = -U_a. Of soft fingers
    the tangent's direction and a patch's middle are wrong by less than 40 u; its sides are what they are.
    """
    q, m = c.question, c.question.grasp.m
    U = directions(np.concatenate([c.a, c.b]))
    if not (np.abs((U * U).sum(axis=1) - 1) < 16 * UNIT).all():
        raise ValueError("the directions of this computer are not of unit length")
    Ua, Ub = U[: len(c.kind)], U[len(c.kind) :]
    needs_both = np.isin(c.kind, (Row.GAP_UP, Row.DN_UP, Row.CHORD)) & (np.abs(c.b - c.a) < HALF)
    wide = np.where(needs_both, 1 + (Ua * Ub).sum(axis=1), 1.0) ** -1.5
    mu, sin = np.append(q.grasp.mu, 0.0)[np.minimum(c.index, m)], np.sin(q.eta)
    out = np.zeros((len(c.kind), at.n + 3 * m + q.plain.mechanism.a + len(q.grasp.soft)))
    for kinds, first, columns, more in (
        ((Row.TANGENT, Row.SOFT_TANGENT, Row.SOFT_CHORD), at.c.start, 1, mu),
        ((Row.CHORD,), at.c.start, 1, mu * wide),
        ((Row.GAP_UP, Row.DN_UP), at.n + 1, 2, sin * wide),
        ((Row.GAP_DOWN,), at.n + 1, 2, np.full(len(wide), sin)),
    ):
        here = np.flatnonzero(np.isin(c.kind, kinds))
        for k in range(columns):
            out[here, first + 3 * c.index[here] + k] = more[here]
    return out
