"""What certificates are made of: the rows that hold in cases of contacts and actuators (`kinds`).

A row says: value >= 0, of the unknowns x (`Columns`) and the motions they make. Which rows hold in which case is
`legal`; what they say as numbers is `row_values`. U_a is the unit vector of direction a, a whole number, 2^24 to the
turn; a *sector* is a pair left < right of them. A soft finger slides in a patch of the sphere of directions instead
(`cases`), whose number stands in the place of the sector's left end. Actuators are mirrored into the sense of their
command, so that (8) reads t >= 0, f >= |f_c| everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from handfast.proofs.cases import HALF_TURN, contains, patch
from handfast.proofs.fields import Array, Integers, Mask
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    BOUND_DOWN,
    BOUND_UP,
    C_LEFT,
    C_RIGHT,
    C_SIDE,
    CHORD,
    CLOSED,
    CN_DOWN,
    CN_UP,
    CONE_WIDENING,
    D_LEFT,
    D_RIGHT,
    D_SIDE,
    DN_UP,
    E_DOWN,
    E_UP,
    ENERGY,
    GAP_DOWN,
    GAP_UP,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    S_DOWN,
    S_UP,
    SLIDE,
    SOFT_CHORD,
    SOFT_TANGENT,
    STICK,
    STILL_1_DOWN,
    STILL_1_UP,
    STILL_2_DOWN,
    STILL_2_UP,
    T_DOWN,
    T_UP,
    TANGENT,
    TURN_DIRECTIONS,
    TURN_DOWN,
    TURN_UP,
    ActuatorState,
    Row,
)
from handfast.proofs.question import LARGEST_GOAL, TORQUES, Question, Range
from handfast.proofs.tolerance import EPS, UNIT_ROUNDOFF, load_scale

MAX_CHORD_SECTOR = (
    HALF_TURN - TURN_DIRECTIONS // 128
)  # of a sector whose chord is used: nearly half a turn, it would say nothing

ROW_KINDS = frozenset(map(int, Row))
OF_CONTACT = np.isin(np.arange(32), [k for k in ROW_KINDS if k <= STILL_2_DOWN or ENERGY < k < S_DOWN])
OF_ACTUATOR = np.isin(np.arange(32), [*range(T_UP, BOUND_UP), S_DOWN])
STILL_ACTUATORS = LOCKED, HIGH, LOW  # t = 0
IS_STILL = np.isin(np.arange(len(ActuatorState)), STILL_ACTUATORS)
IS_KIND = np.isin(np.arange(32), list(ROW_KINDS))


def directions(k: Integers) -> Array:
    """(n, 2) the vectors U_k = (cos, sin)(2 pi k / 2^24) as floats; quarter turns rotate them exactly."""
    quarter, rest = np.divmod(np.mod(k, TURN_DIRECTIONS), TURN_DIRECTIONS // 4)
    x, y = np.cos(rest * (2 * np.pi / TURN_DIRECTIONS)), np.sin(rest * (2 * np.pi / TURN_DIRECTIONS))
    return np.column_stack([np.choose(quarter, [x, -y, -x, y]), np.choose(quarter, [y, x, -y, -x])])


@dataclass(frozen=True)
class Columns:
    """Where the unknowns are in x = (r, q, c, f, coupling, scalar, e, twist); motions are first.

    f is mirrored, e one effort per actuator, twist the torsion of each soft finger over its lever [N].
    """

    r: slice
    q: slice
    c: slice
    f: slice
    coupling: slice
    scalar: slice  # empty for a check
    e: slice  # empty unless the sum of commands is sought
    twist: slice  # empty without soft fingers
    n: int

    @property
    def motions(self) -> int:
        """How many unknowns are motions."""
        return self.q.stop

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, q: Question) -> Columns:
        """The columns of a question."""
        a, efforts = q.actuators, q.actuators if q.goal == TORQUES and q.sums else 0
        sizes = (6, q.joints, 3 * q.grasp.m, a, len(q.equivalent.A), int(q.has_scalar), efforts, len(q.grasp.soft))
        ends = np.cumsum([0, *sizes]).tolist()
        r, q_, c, f, coupling, scalar, e, twist = (slice(i, j) for i, j in pairwise(ends))
        return cls(r, q_, c, f, coupling, scalar, e, twist, ends[-1])


@dataclass(frozen=True, eq=False)
class LeafRows:
    """The rows of some leaves, one entry a row.

    Attributes:
        kind, index, a, b: (R,) a `Row`, of which contact, actuator, column or reference, and its directions.
        leaf: (R,) whose it is.
        references: (K, m+1) normal forces [N] at which the balance of energy has tangents, and the scalar that f_c is
            taken at.
    """

    kind: Integers
    index: Integers
    a: Integers
    b: Integers
    leaf: Integers
    references: Array


def bounds(q: Question, scalar: Range | None) -> tuple[Array, Array]:
    """(n,) each: what BOUND rows may say of the unknowns; infinite where nothing is known."""
    at = Columns.of(q)
    lo, hi = np.full(at.n, -np.inf), np.full(at.n, np.inf)
    lo[at.c][0::3], hi[at.c][0::3] = 0.0, q.force_limit
    lo[at.f], hi[at.f] = -q.limit, q.limit
    if scalar is not None:
        lo[at.scalar], hi[at.scalar] = scalar
        lo[at.e] = 0.0
        hi[at.e] = np.where(q.is_driven, scalar[1], np.inf)[: at.e.stop - at.e.start]
    return lo, hi


# --- which rows hold --------------------------------------------------------------------------------


def known(q: Question, rows: LeafRows) -> Mask:
    """(R,) bool: is there such a kind, and the contact, actuator, column or reference that it is about?"""
    real = (rows.kind >= 0) & (rows.kind < 32)
    kind = np.where(real, rows.kind, 22)
    ends = np.where(OF_CONTACT[kind], q.grasp.m, np.where(OF_ACTUATOR[kind], q.actuators, Columns.of(q).n))
    ends = np.where(kind == ENERGY, len(rows.references), ends)
    return np.asarray(IS_KIND[kind] & (rows.index >= 0) & (rows.index < ends))


def legal(q: Question, scalar: Range | None, rows: LeafRows, cases: Integers) -> Mask:
    """(R,) bool: is each row, all `known`, true of every state in the case (L, m+a, 3) of its leaf?"""
    m, kind, a, b = q.grasp.m, rows.kind, rows.a, rows.b
    if not len(kind):
        return np.zeros(0, dtype=bool)
    of_contact, of_actuator = OF_CONTACT[kind], OF_ACTUATOR[kind]
    index = np.where(of_contact | of_actuator, rows.index, 0)
    part = np.where(of_actuator, m + index, np.where(of_contact, index, 0))
    state, left, right = cases[rows.leaf, part].T

    def inside(a: Integers, b: Integers) -> Mask:
        """Is the sector within [a, b]? Both may be written with any number of full turns added."""
        return np.asarray((left < right) & (np.mod(left - a, TURN_DIRECTIONS) + (right - left) <= b - a))

    still, slides, opens, moves = state == STICK, state == SLIDE, state == OPEN, state == MOVES
    pressed = (state == CLOSED) | still | slides
    within = inside(a, b) & (b - a < MAX_CHORD_SECTOR)
    chord = within | (q.eta == 0)  # g is not needed where eta = 0
    leftish, rightish = inside(a, a + HALF_TURN), inside(b - HALF_TURN, b)
    soft = np.append(q.soft_fingers >= 0, False)[np.where(of_contact, index, m)]
    patched = soft & slides
    if patched.any():
        patched &= contains(a, left)
    driven, may_move = (
        np.append(x, False)[np.where(of_actuator, index, q.actuators)] for x in (q.is_driven, q.may_move)
    )
    commanded = may_move & ~driven
    always = np.ones(len(kind), dtype=bool)
    out, cited = np.zeros(len(kind), dtype=bool), np.bincount(kind, minlength=32).tolist()

    def put(condition: Mask, *kinds: int) -> None:
        for k in kinds:
            if cited[k]:
                np.copyto(out, condition, where=kind == k)

    put(always, CN_UP, TANGENT, T_UP)
    put(opens, CN_DOWN)
    put(still | chord, GAP_UP)
    put(pressed, GAP_DOWN)
    put(opens & chord, DN_UP)
    put(slides & within, CHORD)
    put(pressed & leftish, C_LEFT)
    put(pressed & rightish, C_RIGHT)
    put(still | leftish, D_LEFT)
    put(still | rightish, D_RIGHT)
    put(still, STILL_1_UP, STILL_1_DOWN, STILL_2_UP, STILL_2_DOWN)
    put(IS_STILL[state] | ~may_move, T_DOWN)
    put(commanded | (driven & (moves | (state == ABOVE))), E_UP)
    put((commanded & moves) | (driven & (state == LOW)), E_DOWN)
    put(driven & (moves | (state == BELOW)), S_UP)
    put(driven & (state == HIGH) & (not q.sums), S_DOWN)
    for bound, k in zip(bounds(q, scalar), (BOUND_UP, BOUND_DOWN), strict=True):
        put(np.isfinite(bound)[np.where(kind == k, rows.index, 0)], k)
    put(_energy_holds(q, scalar, rows), ENERGY)
    put(soft, SOFT_TANGENT)
    put(patched, SOFT_CHORD)
    put(patched & (b >= 0) & (b < 3), C_SIDE, D_SIDE)
    put(soft & still, TURN_UP, TURN_DOWN)
    return out


def _energy_holds(q: Question, scalar: Range | None, rows: LeafRows) -> Mask:
    """(R,) does the balance of energy hold: w . r + f_c . t + g . q = sum of c_n^2 and what (6), (7) take?

    With a scalar, larger commands put in more, as t >= 0; what acts on joints takes energy, or is not said. Without
    commands the scalar makes no difference. Where it multiplies the load, or commands are sought, the work put in is no
    linear function of the unknowns.
    """
    if not q.mdp or q.goal in (LARGEST_GOAL, TORQUES) or (q.homogeneous and q.equivalent.drives):
        return np.zeros(len(rows.kind), dtype=bool)
    if scalar is None or not len(rows.references) or not q.load.f_b.any():
        return np.ones(len(rows.kind), dtype=bool)
    top = rows.references[np.where(rows.kind == ENERGY, rows.index, 0), q.grasp.m]
    return np.asarray(top >= scalar[1])


def equalities(q: Question, rows: LeafRows, cases: Integers) -> Mask:
    """(R,) bool: is the row 0 in its case (L, m+a, 3), so that its multiplier may have any sign?"""
    m, kind, a = q.grasp.m, rows.kind, q.actuators
    of_contact, of_actuator = OF_CONTACT[kind], OF_ACTUATOR[kind]
    j = np.where(of_actuator, rows.index, a)
    state = cases[rows.leaf, np.where(of_contact, rows.index, np.where(of_actuator, m + rows.index, 0)), 0]
    may_move, driven = np.append(q.may_move, False)[j], np.append(q.is_driven, False)[j]
    still = ((kind >= STILL_1_UP) & (kind <= STILL_2_DOWN)) | (kind == TURN_UP) | (kind == TURN_DOWN)
    gap = ((kind == GAP_UP) | (kind == GAP_DOWN)) & (q.eta == 0) & (state >= CLOSED)
    fixed = ((kind == T_UP) | (kind == T_DOWN)) & (IS_STILL[state] | ~may_move)
    given = ((kind == E_UP) | (kind == E_DOWN)) & (state == MOVES) & ~driven
    return np.asarray(still | gap | fixed | given)


def zeros(q: Question, cases: Integers) -> Mask:
    """(L, n) bool: unknowns that are 0 in a case (L, m+a, 3): forces of open contacts, joints that are locked."""
    at, m = Columns.of(q), q.grasp.m
    opened, locked = cases[:, :m, 0] == OPEN, IS_STILL[cases[:, m:, 0]] | ~q.may_move
    locked = locked & (q.equivalent.slack == 0)  # else t = -slack
    alone = np.flatnonzero((q.equivalent.R != 0).sum(axis=1) == 1)  # t = R_j q_j
    out = np.zeros((len(cases), at.n), dtype=bool)
    out[:, at.c], out[:, at.twist] = np.repeat(opened, 3, axis=1), opened[:, q.grasp.soft]
    for row, joint in zip(alone, np.nonzero(q.equivalent.R[alone])[1], strict=True):
        out[:, 6 + joint] |= locked[:, row]
    return out


# --- what they say ----------------------------------------------------------------------------------


def different(rows: LeafRows) -> tuple[LeafRows, Integers]:
    """Each row once, whatever its leaf; (R,) which of these each row is."""
    about, ends = (rows.kind << 32) | rows.index, (rows.a << 32) | (rows.b & 0xFFFFFFFF)
    order = np.lexsort((ends, about))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(about[order]) != 0) | (np.diff(ends[order]) != 0)
    which = np.zeros(len(order), dtype=np.int64)
    which[order] = np.cumsum(new) - 1
    first = order[new]
    return replace(rows, **{name: getattr(rows, name)[first] for name in ("kind", "index", "a", "b", "leaf")}), which


def row_values(q: Question, scalar: Range | None, rows: LeafRows) -> tuple[Array, Array]:
    """(R, n+3m+a+1+s) coefficients of x and of `Equations.Z`; (R,) right-hand sides: value >= right.

    These are the numbers that a proof is about, taken as they are. Directions are rounded, and contact frames are of
    unit length and at right angles but for rounding: rows of the friction cone and bounds on |d_t| give way by
    `CONE_WIDENING`, relative, which covers that. Sides of sectors do not: a case says on which side of a direction, as
    its numbers are, friction and -d_t lie. cos(eta) is the rounded number.
    """
    at, m, a = Columns.of(q), q.grasp.m, q.actuators
    kind, index, count = rows.kind, rows.index, len(rows.kind)
    cos, sin = float(np.cos(q.eta)), float(np.sin(q.eta))
    value, right = np.zeros((count, at.n + 3 * m + a + 1 + len(q.grasp.soft))), np.zeros(count)
    if not count:
        return value, right
    Ua, Ub = directions(rows.a), directions(rows.b)
    both = 1.0 + (Ua * Ub).sum(axis=1)
    mu = np.append(q.grasp.mu, 0.0)[np.where(OF_CONTACT[kind], index, m)]
    force, motion = at.c.start + 3 * index, at.n + 3 * index
    t, f = at.n + 3 * m + index, at.f.start + index
    ones = np.ones(count)

    order = np.argsort(kind.astype(np.int8), kind="stable")
    ends = np.searchsorted(kind[order], np.arange(33))

    def put(coefficient: Array, column: Integers, *kinds: int) -> None:
        for k in kinds:
            here = order[ends[k] : ends[k + 1]]
            if len(here):
                value[here, column[here]] += coefficient[here]

    put(ones, force, CN_UP, GAP_UP)
    put(-ones, force, CN_DOWN, GAP_DOWN)
    put(mu * (1 + CONE_WIDENING), force, TANGENT)
    put(-mu * (both / 2 - CONE_WIDENING), force, CHORD)
    put(cos * ones, motion, GAP_UP, DN_UP)
    put(-cos * ones, motion, GAP_DOWN)
    for k in (0, 1):
        put(-Ua[:, k], force + 1 + k, TANGENT)
        put((Ua + Ub)[:, k] / 2, force + 1 + k, CHORD)
        turned = (-1, 1)[k]  # U x c = U_1 c_2 - U_2 c_1
        put(turned * Ua[:, 1 - k], force + 1 + k, C_LEFT)
        put(-turned * Ub[:, 1 - k], force + 1 + k, C_RIGHT)
        put(-turned * Ua[:, 1 - k], motion + 1 + k, D_LEFT)
        put(turned * Ub[:, 1 - k], motion + 1 + k, D_RIGHT)
        if sin > 0:
            wide = (Ua + Ub)[:, k] / np.where(both > 0, both, 1.0)
            put(-sin * (1 + CONE_WIDENING) * wide, motion + 1 + k, GAP_UP, DN_UP)
            put(sin * (1 - CONE_WIDENING) * Ua[:, k], motion + 1 + k, GAP_DOWN)
    put(ones, motion + 1, STILL_1_UP)
    put(-ones, motion + 1, STILL_1_DOWN)
    put(ones, motion + 2, STILL_2_UP)
    put(-ones, motion + 2, STILL_2_DOWN)
    put(ones, t, T_UP)
    put(-ones, t, T_DOWN)
    put(ones, f, E_UP)
    put(ones, f, S_DOWN)
    put(-ones, 0 * index + at.scalar.start, S_DOWN)
    put(-ones, f, E_DOWN, S_UP)
    put(ones, at.e.start + index if at.e.stop > at.e.start else 0 * index + at.scalar.start, S_UP)
    put(ones, index, BOUND_UP)
    put(-ones, index, BOUND_DOWN)
    j = np.where(OF_ACTUATOR[kind], index, a)
    if q.has_scalar:  # commands lambda f_c
        per_scalar, column = np.append(q.load.f_b, 0.0)[j], 0 * index + at.scalar.start
        put(-per_scalar, column, E_UP)
        put(per_scalar, column, E_DOWN)
    (lo, hi), f_c, gap, slack = bounds(q, scalar), q.load.f_a, q.grasp.gaps, q.equivalent.slack
    of_forces = (E_UP, f_c), (E_DOWN, -f_c), (BOUND_UP, lo), (BOUND_DOWN, -hi)
    of_gaps = (GAP_UP, -gap), (DN_UP, -gap), (GAP_DOWN, gap)  # whole motions begin before the step
    for k, of_index in (*of_forces, *of_gaps, (T_UP, -slack), (T_DOWN, slack)):
        here = order[ends[k] : ends[k + 1]]
        right[here] = of_index[index[here]]
    _put_soft(q, rows, value)
    _put_energy(q, rows, value, right)
    return value, right


def _put_soft(q: Question, rows: LeafRows, value: Array) -> None:
    """The rows of soft fingers, over c_n, c_f and d_f."""
    here = np.flatnonzero((rows.kind > ENERGY) & (rows.kind < S_DOWN))
    if not len(here):
        return
    at, kind, i, a, b = Columns.of(q), rows.kind[here], rows.index[here], rows.a[here], rows.b[here]
    s, mu = q.soft_fingers[i], q.grasp.mu[i]
    normal, force, motion = np.zeros(len(here)), np.zeros((len(here), 3)), np.zeros((len(here), 3))
    tangent = np.flatnonzero(kind == SOFT_TANGENT)
    flat, up = directions(a[tangent]), directions(b[tangent])
    normal[tangent], force[tangent] = mu[tangent] * (1 + CONE_WIDENING), -np.column_stack([up[:, :1] * flat, up[:, 1]])
    for k in np.flatnonzero((kind >= SOFT_CHORD) & (kind <= D_SIDE)):
        part = patch(int(a[k]))
        if kind[k] == SOFT_CHORD:
            normal[k], force[k] = -mu[k] * (part.reach - CONE_WIDENING), part.middle
        elif kind[k] == C_SIDE:
            normal[k], force[k] = mu[k] * CONE_WIDENING, part.planes[b[k]]
        else:
            motion[k] = -part.planes[b[k]]
    motion[:, 2] += (kind == TURN_UP).astype(float) - (kind == TURN_DOWN)
    first, turning = at.n + 3 * i, at.n + 3 * q.grasp.m + q.actuators + 1 + s
    value[here, at.c.start + 3 * i] += normal
    for axis in (0, 1):
        value[here, at.c.start + 3 * i + 1 + axis] += force[:, axis]
        value[here, first + 1 + axis] += motion[:, axis]
    value[here, at.twist.start + s] += force[:, 2]
    value[here, turning] += motion[:, 2]


def _put_energy(q: Question, rows: LeafRows, value: Array, right: Array) -> None:
    """The balances of energy, rounded so that they say less than (6) does: t >= 0."""
    here = np.flatnonzero(rows.kind == ENERGY)
    if not len(here):
        return
    at, m, a = Columns.of(q), q.grasp.m, q.actuators
    x, f_c, per_scalar = rows.references[rows.index[here]], q.load.f_a, q.load.f_b
    value[here, at.r], value[here, at.n + 3 * m + a] = q.load.w_a, float(q.load.g_a.any())
    slip = EPS * (1 + 1e-6) * load_scale(q.grasp, q.load.w_a)  # of which friction and pressure make work
    pressure = -2 * x[:, :m] + slip * (1 + q.grasp.mu)
    if q.grasp.gaps.any():  # c_n^2 + gap c_n, over cos(eta), is what springs take in a step
        before = q.grasp.gaps / np.cos(q.eta)
        pressure += 8 * UNIT_ROUNDOFF * (2 * np.abs(x[:, :m]) + np.abs(before)) - before
    value[here[:, None], np.arange(at.c.start, at.c.stop, 3)] = pressure
    value[here[:, None], np.arange(at.n + 3 * m, at.n + 3 * m + a)] = (f_c + x[:, m:] * per_scalar) * (
        1 + 4 * UNIT_ROUNDOFF
    )
    right[here] = -(x[:, :m] ** 2).sum(axis=1) * (1 + 2 * m * UNIT_ROUNDOFF)
