"""What certificates are made of: the equalities of the model, and the rows that a leaf may cite, as numbers.

Both checkers weigh the same rows over the unknowns x (see `certificate.Columns`) and the motions (d, t) = Z x:
`farkas` without any cap on motions, `claim` up to one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.model.grasp import Grasp
from handfast.stability.certify.certificate import (
    HALF,
    WIDER,
    ActuatorState,
    Certificate,
    Columns,
    ContactState,
    Integers,
    Question,
    Row,
    directions,
)
from handfast.stability.certify.patches import patch
from handfast.stability.model import actuator_arms, joint_arms
from handfast.stability.witness import VALID

UNIT = 2.0**-53  # relative error of one rounded operation


@dataclass(frozen=True, eq=False)
class LeafRows:
    """Rows of leaves over (x, d, t): value . (x, d, t) >= b, or = b where `either`.

    Attributes:
        value: (R, n+3m+a+s); b: (R,): numbers as they are, not rounded ones of others.
        either: (R,) bool: an equation in its case, so that its multiplier may have any sign.
    """

    value: Array
    b: Array
    either: Mask


@dataclass(frozen=True, eq=False)
class ContactMaps:
    """Grasp map and Jacobian, and those of torsions over levers, or bounds of their rounding.

    Attributes:
        G, J: (6, 3m), (3m, l). twist_map, twist_jacobian: (6, s), (s, l).
    """

    G: Array
    J: Array
    twist_map: Array
    twist_jacobian: Array

    @classmethod
    def of(cls, grasp: Grasp) -> ContactMaps:
        return cls(grasp.G, grasp.J, grasp.twist_map, grasp.twist_jacobian)

    @classmethod
    def none(cls, grasp: Grasp) -> ContactMaps:
        """Zero."""
        m, l, s = grasp.m, grasp.l, len(grasp.soft)
        return cls(np.zeros((6, 3 * m)), np.zeros((3 * m, l)), np.zeros((6, s)), np.zeros((s, l)))


def equations(question: Question, maps: ContactMaps) -> tuple[Array, Array, Array]:
    """E (p, n), h (p,) and Z (3m+a+s, n): motions d, t and turning of the soft fingers."""
    q, g, at = question, question.plain, Columns.of(question)
    R, A = q.sense[:, None] * g.mechanism.R, g.mechanism.A
    locked = np.flatnonzero(~q.may_move)
    sizes = (6, g.l, len(A), len(locked), int(at.e.stop > at.e.start))
    b1, b2, b3, b4, p = np.cumsum(sizes).tolist()
    E, h = np.zeros((p, at.n)), np.zeros(p)
    E[:b1, at.c], E[:b1, at.twist], h[:b1] = maps.G, maps.twist_map, -q.load.w_a  # (1)
    E[:b1, at.scalar] = q.load.w_b[:, None]
    E[b1:b2, at.c], E[b1:b2, at.f], E[b1:b2, at.coupling] = maps.J.T, -R.T, -A.T  # (2)
    E[b1:b2, at.twist] = maps.twist_jacobian.T
    E[b1:b2, at.scalar], h[b1:b2] = -q.load.g_b[:, None], q.load.g_a
    E[b2:b3, at.q] = A
    E[b3:b4, at.q] = R[locked]  # (8) where nothing is commanded
    if p > b4:
        E[b4:, at.scalar], E[b4:, at.e] = 1.0, -q.is_driven.astype(float)
    c, t = 3 * g.m, 3 * g.m + len(R)
    Z = np.zeros((t + len(g.soft), at.n))
    Z[:c, at.r], Z[:c, at.q], Z[c:t, at.q] = maps.G.T, -maps.J, R  # (3)
    Z[t:, at.r], Z[t:, at.q] = maps.twist_map.T, -maps.twist_jacobian
    return E, h, Z


def missed(question: Question, p: int) -> tuple[Array, Array]:
    """(p,) each: what a witness may miss the equalities by is the first plus |scalar| times the second.

    Loads in special positions are not proved to slip for their rounding: a jaw holds no torque about the line through
    its two contacts, and a direction that was computed has one of 1e-17. Neither are commands, where contacts without
    friction face each other but for rounding.
    """
    g, size, out = question.plain, question.grasp.size, np.zeros((2, p))
    own = np.concatenate([question.load.f_a / actuator_arms(g), np.abs(question.load.g_a) / joint_arms(g)])
    # no growth with commands: where they grow without end beside a load, all of it would be missed
    for x, load, least in zip(out, (question.load.w_a, question.load.w_b), (own.max(initial=0.0), 0.0), strict=True):
        force = max(np.linalg.norm(load[:3]), np.linalg.norm(load[3:]) / size, least)
        x[:6] = VALID * force * np.repeat([1.0, size], 3)
    return out[0], out[1]


def rows_of(certificate: Certificate, states: Integers, lo: Array, hi: Array, wider: float = WIDER) -> LeafRows:
    """The rows of all leaves; states (R, m+a): what contacts and actuators are where a row stands.

    lo, hi: (n,) the bounds that BOUND rows cite. wider: by how much rows of the friction cone give way.
    """
    c, q, at = certificate, certificate.question, Columns.of(certificate.question)
    g, count = q.plain, len(c.kind)
    m, a = g.m, g.mechanism.a
    cos, sin = float(np.cos(q.eta)), float(np.sin(q.eta))
    value, b = np.zeros((count, at.n + 3 * m + a + len(g.soft))), np.zeros(count)
    Ua, Ub = directions(c.a), directions(c.b)
    two_sided = np.isin(c.kind, (Row.GAP_UP, Row.DN_UP, Row.CHORD)) & (np.abs(c.b - c.a) < HALF)
    both = np.where(two_sided, 1 + (Ua * Ub).sum(axis=1), 1.0)
    wide = (Ua + Ub) / both[:, None]
    contact = np.minimum(c.index, m - 1)
    mu = g.mu[contact]
    force, motion = at.c.start + 3 * c.index, at.n + 3 * c.index
    t, f = at.n + 3 * m + c.index, at.f.start + c.index

    of_kind = [np.flatnonzero(c.kind == kind) for kind in Row]

    def put(kinds: tuple[Row, ...], column: Integers | int, coefficient: Array | float) -> None:
        here = np.concatenate([of_kind[kind] for kind in kinds])
        columns = column[here] if isinstance(column, np.ndarray) else column
        value[here, columns] += coefficient[here] if isinstance(coefficient, np.ndarray) else coefficient

    put((Row.CN_UP, Row.GAP_UP), force, 1.0)
    put((Row.CN_DOWN, Row.GAP_DOWN), force, -1.0)
    put((Row.TANGENT,), force, mu * (1 + wider))
    put((Row.CHORD,), force, -mu * (both / 2 - wider))
    put((Row.GAP_UP, Row.DN_UP), motion, cos)
    put((Row.GAP_DOWN,), motion, -cos)
    for axis in (0, 1):
        put((Row.TANGENT,), force + 1 + axis, -Ua[:, axis])
        put((Row.CHORD,), force + 1 + axis, (Ua + Ub)[:, axis] / 2)
        if sin > 0:
            put((Row.GAP_UP, Row.DN_UP), motion + 1 + axis, -sin * (1 + wider) * wide[:, axis])
            put((Row.GAP_DOWN,), motion + 1 + axis, sin * (1 - wider) * Ua[:, axis])
    put((Row.C_LEFT,), force + 1, -Ua[:, 1])
    put((Row.C_LEFT,), force + 2, Ua[:, 0])
    put((Row.C_RIGHT,), force + 1, Ub[:, 1])
    put((Row.C_RIGHT,), force + 2, -Ub[:, 0])
    put((Row.D_LEFT,), motion + 1, Ua[:, 1])
    put((Row.D_LEFT,), motion + 2, -Ua[:, 0])
    put((Row.D_RIGHT,), motion + 1, -Ub[:, 1])
    put((Row.D_RIGHT,), motion + 2, Ub[:, 0])
    put((Row.STILL_1_UP,), motion + 1, 1.0)
    put((Row.STILL_1_DOWN,), motion + 1, -1.0)
    put((Row.STILL_2_UP,), motion + 2, 1.0)
    put((Row.STILL_2_DOWN,), motion + 2, -1.0)
    if len(g.soft):
        _put_soft(c, value, wider)
    put((Row.T_UP,), t, 1.0)
    put((Row.T_DOWN,), t, -1.0)
    put((Row.E_UP,), f, 1.0)
    put((Row.E_DOWN, Row.S_UP), f, -1.0)
    put((Row.S_UP,), at.e.start + c.index if at.e.stop > at.e.start else at.scalar.start, 1.0)
    put((Row.BOUND_UP,), c.index, 1.0)
    put((Row.BOUND_DOWN,), c.index, -1.0)
    constant, per_scalar = (np.append(x, 0.0)[np.minimum(c.index, a)] for x in (q.load.f_a, q.load.f_b))
    if at.scalar.stop > at.scalar.start:  # commands lambda f_c
        put((Row.E_UP,), at.scalar.start, -per_scalar)
        put((Row.E_DOWN,), at.scalar.start, per_scalar)
    b += np.where(c.kind == Row.E_UP, constant, 0.0) - np.where(c.kind == Row.E_DOWN, constant, 0.0)
    column = np.minimum(c.index, at.n - 1)
    b += np.where(c.kind == Row.BOUND_UP, lo[column], 0.0) - np.where(c.kind == Row.BOUND_DOWN, hi[column], 0.0)

    _put_energy(c, value, b)
    return LeafRows(value, b, _equations_in_case(c, states))


def _put_soft(c: Certificate, value: Array, wider: float) -> None:
    """The rows of soft fingers, over c_n, c_f and d_f."""
    here = np.flatnonzero((c.kind >= Row.SOFT_TANGENT) & (c.kind <= Row.TURN_DOWN))
    q, at = c.question, Columns.of(c.question)
    kind, i, a, b = c.kind[here], c.index[here], c.a[here], c.b[here]
    s, mu = q.soft_fingers[i], q.grasp.mu[i]
    normal, force, motion = np.zeros(len(here)), np.zeros((len(here), 3)), np.zeros((len(here), 3))
    tangent = np.flatnonzero(kind == Row.SOFT_TANGENT)
    flat, up = directions(a[tangent]), directions(b[tangent])
    normal[tangent], force[tangent] = mu[tangent] * (1 + wider), -np.column_stack([up[:, :1] * flat, up[:, 1]])
    for k in np.flatnonzero((kind >= Row.SOFT_CHORD) & (kind <= Row.D_SIDE)):
        part = patch(int(a[k]))
        if kind[k] == Row.SOFT_CHORD:
            normal[k], force[k] = -mu[k] * (part.reach - wider), part.middle
        elif kind[k] == Row.C_SIDE:
            normal[k], force[k] = mu[k] * wider, part.planes[b[k]]
        else:
            motion[k] = -part.planes[b[k]]
    motion[:, 2] += (kind == Row.TURN_UP).astype(float) - (kind == Row.TURN_DOWN)
    first, turning = at.n + 3 * i, at.n + 3 * q.grasp.m + q.plain.mechanism.a + s
    value[here, at.c.start + 3 * i] += normal
    for axis in (0, 1):
        value[here, at.c.start + 3 * i + 1 + axis] += force[:, axis]
        value[here, first + 1 + axis] += motion[:, axis]
    value[here, at.twist.start + s] += force[:, 2]
    value[here, turning] += motion[:, 2]


def _put_energy(c: Certificate, value: Array, b: Array) -> None:
    """The balances of energy among the rows, rounded so that they say less than (6) does: t >= 0."""
    energy, q, at = np.flatnonzero(c.kind == Row.ENERGY), c.question, Columns.of(c.question)
    if not len(energy):
        return
    m, a = q.plain.m, q.plain.mechanism.a
    x, f_c, per_s = c.references[c.index[energy]], q.load.f_a, q.load.f_b
    value[energy, at.r] = q.load.w_a
    value[energy, at.q] = q.load.g_a
    value[energy[:, None], np.arange(at.c.start, at.c.stop, 3)] = -2 * x[:, :m]
    value[energy[:, None], np.arange(at.n + 3 * m, at.n + 3 * m + a)] = (f_c + x[:, m:] * per_s) * (1 + 4 * UNIT)
    b[energy] = -(x[:, :m] ** 2).sum(axis=1) * (1 + 2 * m * UNIT)


def _equations_in_case(c: Certificate, states: Integers) -> Mask:
    """(R,) which rows are equations where they stand, by what contacts and actuators are there (R, m+a)."""
    q, m, a = c.question, c.question.grasp.m, c.question.plain.mechanism.a
    contact = np.minimum(c.index, m - 1)
    soft = (c.kind >= Row.SOFT_TANGENT) & (c.kind <= Row.TURN_DOWN)
    part = np.where((c.kind >= Row.T_UP) & ~soft, np.minimum(m + c.index, m + a - 1), contact) if m + a else contact
    state = states[np.arange(len(c.kind)), part]
    moves = np.append(q.may_move, False)[np.minimum(c.index, a)]
    driven = np.append(q.is_driven, False)[np.minimum(c.index, a)]
    still = (c.kind >= Row.STILL_1_UP) & (c.kind <= Row.STILL_2_DOWN)
    still |= (c.kind == Row.TURN_UP) | (c.kind == Row.TURN_DOWN)
    gap = ((c.kind == Row.GAP_UP) | (c.kind == Row.GAP_DOWN)) & (q.eta == 0) & (state >= ContactState.CLOSED)
    turn = ((c.kind == Row.T_UP) | (c.kind == Row.T_DOWN)) & ((state == ActuatorState.LOCKED) | ~moves)
    slack = ((c.kind == Row.E_UP) | (c.kind == Row.E_DOWN)) & (state == ActuatorState.MOVES) & ~driven
    return still | gap | turn | slack


def bounds(question: Question, scalar: tuple[float, float] | None) -> tuple[Array, Array]:
    """(n,) each: what BOUND rows may say of the unknowns; infinite where nothing is known."""
    q, at = question, Columns.of(question)
    lo, hi = np.full(at.n, -np.inf), np.full(at.n, np.inf)
    lo[at.c][0::3] = 0.0
    if q.force_limit is not None:
        hi[at.c][0::3] = q.force_limit
    limit = np.array([q.torque_limits.get(name, np.inf) for name in q.plain.mechanism.actuators])
    lo[at.f], hi[at.f] = -limit, limit
    if scalar is not None:
        lo[at.scalar], hi[at.scalar] = scalar
        lo[at.e] = 0.0
        hi[at.e] = np.where(q.is_driven, scalar[1], np.inf)[: at.e.stop - at.e.start]
    return lo, hi
