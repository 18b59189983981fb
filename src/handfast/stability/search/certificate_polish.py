"""A leaf's ray in the middle of all that there are, where the one found sits on an edge.

The simplex ends at a vertex: most multipliers are 0, and where a contact has no part in the contradiction rounding
decides on which side of 0 they are. For the few leaves whose ray the checker refuses for that reason, a linear
program over every row that holds in the leaf's case finds multipliers that are as far from 0 as they can be.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.proofs import rows
from handfast.proofs.cases import leaf_cases
from handfast.proofs.certificate import ROW_ARRAYS, Certificate
from handfast.proofs.equations import Equations, RightSide, equations_of
from handfast.proofs.fields import Integers
from handfast.proofs.kinds import TURN_DIRECTIONS, ActuatorState, ContactState, Row
from handfast.proofs.rows import STILL_ACTUATORS, Columns, LeafRows

TANGENTS = 8  # directions, besides those that the leaf's own ray has
MULTIPLIER_GROWTH = 1.01  # by which a multiplier grows faster than what may be missed
MAX_RAY_SLACK = 1e-3  # from 0, in rays whose contradiction is 1

Rays = tuple[Integers, Integers, Integers, Integers, Array]  # kind, index, a, b, multiplier


def rays_of(c: Certificate) -> list[Rays]:
    """The ray of each leaf."""
    ends = [slice(first, last) for first, last in pairwise(c.start.tolist())]
    return [(c.kind[x], c.index[x], c.a[x], c.b[x], c.multiplier[x].astype(np.float64)) for x in ends]


def with_rays(c: Certificate, rays: Sequence[Rays]) -> Certificate:
    """The certificate with a ray for each of its leaves; multipliers of 32 bits if these say all."""
    start = np.cumsum([0, *(len(ray[0]) for ray in rays)])
    *columns, y = (np.concatenate(column) for column in zip(*rays, strict=True))
    short = y.astype(np.float32)
    return replace(
        c,
        start=start,
        multiplier=short if np.array_equal(short, y) else y,
        **dict(zip(ROW_ARRAYS, columns, strict=True)),  # type: ignore[arg-type]
    )


def repaired(c: Certificate, leaves: Sequence[int], until: float = np.inf) -> dict[int, Rays]:
    """Other rays for some of these leaves, where there are better ones.

    until: [s] of `time.monotonic`, from which on no more are sought.
    """
    q = c.question
    cases = leaf_cases(q, c.parent, c.part, np.column_stack([c.state, c.left, c.right]))
    equations = equations_of(q)
    side = RightSide.of(q, c.scalar, len(equations.E))
    out: dict[int, Rays] = {}
    for leaf in leaves:
        ray = _ray(c, leaf, cases[leaf], equations, side) if time.monotonic() < until else None
        if ray is not None:
            out[leaf] = ray
    return out


def _ray(c: Certificate, leaf: int, case: Integers, equations: Equations, side: RightSide) -> Rays | None:
    """Kind, index, a, b, multiplier of the rows of a better ray; None if there is none."""
    q = c.question
    kind, index, a, b = _candidates(c, leaf, case)
    some = LeafRows(kind, index, a, b, np.zeros(len(kind), np.int64), c.references)
    k = rows.legal(q, c.scalar, some, case[None])
    some = LeafRows(kind[k], index[k], a[k], b[k], np.zeros(int(k.sum()), np.int64), c.references)
    value, right = rows.row_values(q, c.scalar, some)
    n, scale = equations.columns.n, equations.scale
    F = (value[:, :n] + value[:, n:] @ equations.Z) * scale
    unit = np.exp2(np.round(np.log2(np.maximum(np.abs(F).max(axis=1, initial=0.0), 1e-300))))
    touching = [*range(n, n + 3 * q.grasp.m), *range(value.shape[1] - len(q.grasp.soft), value.shape[1])]
    slips = value[:, touching].T / unit
    first = (some.kind == Row.BOUND_UP) & (some.index == Columns.of(q).scalar.start) & q.has_scalar
    program = _Program(
        B=np.concatenate([F / unit[:, None], equations.E * scale / equations.unit[:, None]]),
        right=np.concatenate([right / unit, side.h / equations.unit]),
        free=np.concatenate([rows.equalities(q, some, case[None]), np.ones(len(side.h), dtype=bool)]),
        about=np.block(
            [
                [np.zeros((len(side.h), len(F))), equations.about / equations.unit],
                [slips, np.zeros((len(slips), len(side.h)))],
            ]
        ),
        slack=np.append(side.slack, np.full(len(slips), side.slip)),
        growth=np.append(side.growth, np.full(len(slips), side.slip_growth)),
        first=np.concatenate([np.where(first, 1 / unit, 0.0), np.zeros(len(side.h))]),
        ends=c.scalar or (0.0, 0.0),
    )
    ways = (True, False) if side.growth.any() else (None,)
    w = next((x for x in (program.multipliers(way) for way in (*ways, None)) if x is not None), None)
    if w is None:
        return None
    w, free = w[: len(F)] / unit, program.free[: len(F)]
    w = np.where(free, w, np.maximum(w, 0.0))
    kinds = np.array(
        [OPPOSITE_KINDS.get(int(k), int(k)) if y < 0 else int(k) for k, y in zip(some.kind, w, strict=True)]
    )
    used = w != 0
    return kinds[used], some.index[used], some.a[used], some.b[used], np.abs(w)[used]


@dataclass(frozen=True, eq=False)
class _Program:
    """Scaled rows and equalities of one leaf.

    Attributes:
        B, right: (K, n), (K,). free: (K,) multipliers of any sign.
        about: (p', K) from multipliers to those that slack and growth (p',) are for, see `equations.RightSide`.
        first: (K,) how much each multiplier pushes the scalar's first end. ends: of the scalar.
    """

    B: Array
    right: Array
    free: Mask
    about: Array
    slack: Array
    growth: Array
    first: Array
    ends: tuple[float, float]

    def multipliers(self, pushed: bool | None) -> Array | None:
        """(K,) multipliers, as far from 0 as they can be; None if there are none.

        pushed: what a witness may miss grows with the scalar, and is to take half of the contradiction at most: at
        the scalar's first end if its multiplier there grows faster, else at the last; None if that is not asked.
        """
        from scipy.optimize import linprog  # slow to import, and seldom needed

        B, right, free = self.B, self.right, self.free
        alive = (B != 0).any(axis=0)
        strict = np.flatnonzero(~free & ((B != 0).any(axis=1) | (right != 0)))
        missed = np.flatnonzero((self.slack > 0) | (self.growth > 0))
        end = abs(self.ends[0]) if pushed else max(abs(self.ends[0]), abs(self.ends[1]))
        if pushed is not None and not np.isfinite(end):
            return None
        # unknowns: w (K), how far each inequality's is from 0, at most AWAY, and sizes of those that may be missed
        K, S, A = len(B), len(strict), len(missed)
        equal = np.zeros((int(alive.sum()) + 1, K + S + A))
        equal[:-1, :K] = B[:, alive].T
        equal[-1, :K] = right
        apart, above, below = np.zeros((S, K + S + A)), np.zeros((A, K + S + A)), np.zeros((A, K + S + A))
        apart[np.arange(S), strict], apart[np.arange(S), K + np.arange(S)] = -1.0, 1.0
        above[:, :K], below[:, :K] = self.about[missed], -self.about[missed]
        above[np.arange(A), K + S + np.arange(A)] = below[np.arange(A), K + S + np.arange(A)] = -1.0
        bounded, ends = [apart], [np.zeros(S)]
        if pushed is not None:
            half, faster = np.zeros((2, 1, K + S + A))
            half[0, K + S :] = self.slack[missed] + end * self.growth[missed]
            faster[0, K + S :], faster[0, :K] = MULTIPLIER_GROWTH * self.growth[missed], -self.first
            bounded += [above, below, half, *([faster] if pushed else [])]
            ends += [np.zeros(2 * A), np.array([0.5]), *([np.zeros(1)] if pushed else [])]
        found = linprog(
            np.r_[np.zeros(K), -np.ones(S), np.zeros(A)],
            A_ub=np.vstack(bounded),
            b_ub=np.concatenate(ends),
            A_eq=equal,
            b_eq=np.r_[np.zeros(len(equal) - 1), 1.0],
            bounds=[(None, None) if f else (0, None) for f in free] + [(0, MAX_RAY_SLACK)] * S + [(0, None)] * A,
            method="highs",
        )
        return None if found.x is None else np.asarray(found.x[:K])


# the other inequality of an equation
OPPOSITE_KINDS = {
    int(x): int(y)
    for p, q in (
        (Row.GAP_UP, Row.GAP_DOWN),
        (Row.STILL_1_UP, Row.STILL_1_DOWN),
        (Row.STILL_2_UP, Row.STILL_2_DOWN),
        (Row.TURN_UP, Row.TURN_DOWN),
        (Row.T_UP, Row.T_DOWN),
        (Row.E_UP, Row.E_DOWN),
    )
    for x, y in ((p, q), (q, p))
}


def _of_soft_finger(i: int, state: int, number: int) -> list[tuple[int, int, int, int]]:
    """Kind, index, a, b of the rows that soft finger i has besides, in patch `number` where it slides."""
    steps = range(0, TURN_DIRECTIONS, TURN_DIRECTIONS // TANGENTS)
    rows = [
        (int(Row.SOFT_TANGENT), i, a, b)
        for a in steps
        for b in (-TURN_DIRECTIONS // 8 % TURN_DIRECTIONS, 0, TURN_DIRECTIONS // 8)
    ]
    rows += [(int(Row.SOFT_TANGENT), i, 0, b) for b in (TURN_DIRECTIONS // 4, 3 * TURN_DIRECTIONS // 4)]
    if state == ContactState.STICK:
        rows.append((int(Row.TURN_UP), i, 0, 0))
    if state == ContactState.SLIDE:
        rows.append((int(Row.SOFT_CHORD), i, number, 0))
        rows += [(int(kind), i, number, side) for kind in (Row.C_SIDE, Row.D_SIDE) for side in range(3)]
    return rows


def _candidates(c: Certificate, leaf: int, case: Integers) -> tuple[Integers, Integers, Integers, Integers]:
    """Kind, index, a, b of every row that may hold in the leaf, of equations only one side; and those it has."""
    q, m, n = c.question, c.question.grasp.m, Columns.of(c.question).n
    out: list[tuple[int, int, int, int]] = []
    for i, (state, left, right) in enumerate(case[:m].tolist()):
        out += [(Row.CN_UP, i, 0, 0)]
        if q.grasp.lever[i] > 0:
            out += _of_soft_finger(i, state, left)
        out += [(Row.TANGENT, i, k * TURN_DIRECTIONS // TANGENTS, 0) for k in range(TANGENTS)]
        if state == ContactState.OPEN:
            out += [(Row.DN_UP, i, left, right), (Row.CN_DOWN, i, 0, 0)]
            continue
        out.append((Row.GAP_UP, i, left, right))
        if state == ContactState.STICK:
            out += [(Row.STILL_1_UP, i, 0, 0), (Row.STILL_2_UP, i, 0, 0)]
        if state == ContactState.SLIDE:
            out += [(Row.CHORD, i, left, right), (Row.TANGENT, i, (left + right) // 2, 0)]
        if left != right:
            out += [(Row.D_LEFT, i, left, 0), (Row.D_RIGHT, i, 0, right)]
        if left != right and state >= ContactState.CLOSED:
            out += [(Row.C_LEFT, i, left, 0), (Row.C_RIGHT, i, 0, right)]
        if state >= ContactState.CLOSED and q.eta > 0:
            out += [(Row.GAP_DOWN, i, k * TURN_DIRECTIONS // TANGENTS, 0) for k in range(TANGENTS)]
    for j, state in enumerate(case[m:, 0].tolist()):
        out += [(Row.T_UP, j, 0, 0), (Row.E_UP, j, 0, 0), (Row.S_UP, j, 0, 0)]
        if state in STILL_ACTUATORS or not q.may_move[j]:
            out.append((Row.T_DOWN, j, 0, 0))
        if state == ActuatorState.LOW:
            out.append((Row.E_DOWN, j, 0, 0))
        if state == ActuatorState.HIGH:
            out.append((Row.S_DOWN, j, 0, 0))
    out += [(kind, k, 0, 0) for kind in (Row.BOUND_UP, Row.BOUND_DOWN) for k in range(n)]
    known = set(out)
    for r in range(c.start[leaf], c.start[leaf + 1]):
        row = int(c.kind[r]), int(c.index[r]), int(c.a[r]), int(c.b[r])
        if row not in known and (OPPOSITE_KINDS.get(row[0], row[0]), *row[1:]) not in known:
            out.append(row)
    kind, index, a, b = np.array(out, dtype=np.int64).T
    return kind, index, a, b
