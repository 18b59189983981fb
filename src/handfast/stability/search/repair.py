"""A leaf's ray in the middle of all that there are, where the one found sits on an edge.

The simplex ends at a vertex: most multipliers are 0, and where a contact has no part in the contradiction rounding
decides on which side of 0 they are. For the few leaves whose ray the checker refuses for that reason, a linear
program over every row that holds in the leaf's case finds multipliers that are as far from 0 as they can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.certify import checker, leaf_rows
from handfast.stability.certify.certificate import (
    ROW_ARRAYS,
    TURN,
    ActuatorState,
    Certificate,
    ContactState,
    Integers,
    Row,
)
from handfast.stability.certify.leaf_systems import LeafSystems, SharedSystem

TANGENTS = 8  # directions, besides those that the leaf's own ray has
ROOM = 1.01  # by which a multiplier grows faster than what may be missed
AWAY = 1e-3  # from 0, in rays whose contradiction is 1


def repaired(certificate: Certificate, leaves: Sequence[int]) -> Certificate:
    """The certificate with other rays for these leaves, where there are better ones."""
    c = certificate
    cases, system, ends = checker.leaf_cases(c), SharedSystem.of(c.question), leaf_rows.bounds(c.question, c.scalar)
    found = {leaf: _ray(c, leaf, cases[leaf], system, *ends) for leaf in leaves}
    parts: list[Array | Integers] = []
    counts = np.diff(c.start)
    for leaf in range(len(c.leaves)):
        ray = found.get(leaf)
        if ray is None:
            ray = tuple(getattr(c, name)[c.start[leaf] : c.start[leaf + 1]] for name in ROW_ARRAYS[1:])
        parts.append(np.column_stack([np.asarray(x, dtype=float) for x in ray]))
        counts[leaf] = len(ray[0])
    rows = np.concatenate(parts)
    whole = {name: rows[:, k].astype(np.int64) for k, name in enumerate(ROW_ARRAYS[1:-1])}
    start = np.concatenate([[0], np.cumsum(counts)])
    return replace(c, start=start, multiplier=rows[:, -1], **whole)  # type: ignore[arg-type]


def _ray(
    c: Certificate, leaf: int, case: Integers, system: SharedSystem, lo: Array, hi: Array
) -> tuple[Array | Integers, ...] | None:
    """Kind, index, a, b, multiplier of the rows of a better ray; None if there is none.

    system, lo, hi: the equalities, and bounds (n,) of the unknowns.
    """
    kind, index, a, b = _candidates(c, leaf, case, lo, hi)
    some = replace(
        c,
        leaves=c.leaves[leaf : leaf + 1],
        start=np.array([0, len(kind)]),
        kind=kind,
        index=index,
        a=a,
        b=b,
        multiplier=np.zeros(len(kind)),
    )
    allowed = checker.legal(some, np.repeat(case[None], len(kind), axis=0), lo, hi)
    kept = {name: getattr(some, name)[allowed] for name in ROW_ARRAYS[1:]}
    some = replace(some, start=np.array([0, int(allowed.sum())]), **kept)
    count = len(some.kind)
    rows = leaf_rows.rows_of(some, np.repeat(case[None, :, 0], count, axis=0), lo, hi)
    leaves = LeafSystems.of(some, rows, system, case[None], np.array([0]), whole=True)  # v has to follow from y
    ways = (True, False) if leaves.growth.any() else (None,)
    w = next((x for x in (_multipliers(leaves, way) for way in (*ways, None)) if x is not None), None)
    if w is None:
        return None
    w, free = (w / leaves.unit[0])[:count], leaves.free[0]
    w = np.where(free[:count], w, np.maximum(w, 0.0))
    kinds = np.array([OPPOSITE.get(int(k), int(k)) if y < 0 else int(k) for k, y in zip(some.kind, w, strict=True)])
    used = w != 0
    return tuple(x[used] for x in (kinds, some.index, some.a, some.b, np.abs(w)))


def _multipliers(leaves: LeafSystems, pushed: bool | None) -> Array | None:
    """(K,) multipliers of the only leaf, as far from 0 as they can be; None if there are none.

    pushed: what a witness may miss grows with the scalar, and is to take half of the contradiction at most: at the
    scalar's first end if its multiplier there grows faster, else at the last; None if that is not asked.
    """
    from scipy.optimize import linprog  # slow to import, and seldom needed

    B, right, free = leaves.B[0], leaves.b[0], leaves.free[0]
    alive = (B != 0).any(axis=0)
    strict = np.flatnonzero(~free & ((B != 0).any(axis=1) | (right != 0)))
    missed = np.flatnonzero((leaves.slack[0] > 0) | (leaves.growth[0] > 0))
    end = float(leaves.end(np.array(bool(pushed))))
    if pushed is not None and not np.isfinite(end):
        return None
    # the unknowns are w (K), how far each inequality's is from 0, at most AWAY, and sizes of those that may be missed
    K, S, A = len(B), len(strict), len(missed)
    equal = np.zeros((int(alive.sum()) + 1, K + S + A))
    equal[:-1, :K] = B[:, alive].T
    equal[-1, :K] = right
    apart, above, below = np.zeros((S, K + S + A)), np.zeros((A, K + S + A)), np.zeros((A, K + S + A))
    apart[np.arange(S), strict], apart[np.arange(S), K + np.arange(S)] = -1.0, 1.0
    above[np.arange(A), missed], below[np.arange(A), missed] = 1.0, -1.0
    above[np.arange(A), K + S + np.arange(A)] = below[np.arange(A), K + S + np.arange(A)] = -1.0
    rows, ends = [apart], [np.zeros(S)]
    if pushed is not None:
        half, faster = np.zeros((2, 1, K + S + A))
        half[0, K + S :] = leaves.slack[0, missed] + end * leaves.growth[0, missed]
        faster[0, K + S :] = ROOM * leaves.growth[0, missed]
        faster[0, :K] = np.where(leaves.first[0], -1.0 / leaves.unit[0], 0.0)
        rows += [above, below, half, *([faster] if pushed else [])]
        ends += [np.zeros(2 * A), np.array([0.5]), *([np.zeros(1)] if pushed else [])]
    found = linprog(
        np.r_[np.zeros(K), -np.ones(S), np.zeros(A)],
        A_ub=np.vstack(rows),
        b_ub=np.concatenate(ends),
        A_eq=equal,
        b_eq=np.r_[np.zeros(len(equal) - 1), 1.0],
        bounds=[(None, None) if f else (0, None) for f in free] + [(0, AWAY)] * S + [(0, None)] * A,
        method="highs",
    )
    return None if found.x is None else np.asarray(found.x[:K])


# the other inequality of an equation
OPPOSITE = {
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
    steps = range(0, TURN, TURN // TANGENTS)
    rows = [(int(Row.SOFT_TANGENT), i, a, b) for a in steps for b in (-TURN // 8 % TURN, 0, TURN // 8)]
    rows += [(int(Row.SOFT_TANGENT), i, 0, b) for b in (TURN // 4, 3 * TURN // 4)]
    if state == ContactState.STICK:
        rows.append((int(Row.TURN_UP), i, 0, 0))
    if state == ContactState.SLIDE:
        rows.append((int(Row.SOFT_CHORD), i, number, 0))
        rows += [(int(kind), i, number, side) for kind in (Row.C_SIDE, Row.D_SIDE) for side in range(3)]
    return rows


def _candidates(
    c: Certificate, leaf: int, case: Integers, lo: Array, hi: Array
) -> tuple[Integers, Integers, Integers, Integers]:
    """Kind, index, a, b of every row that may hold in the leaf, of equations only one side; and those it has."""
    q, m = c.question, c.question.grasp.m
    rows: list[tuple[int, int, int, int]] = []
    for i, (state, left, right) in enumerate(case[:m].tolist()):
        rows += [(Row.CN_UP, i, 0, 0)]
        if q.grasp.contacts[i].torsion > 0:
            rows += _of_soft_finger(i, state, left)
        rows += [(Row.TANGENT, i, k * TURN // TANGENTS, 0) for k in range(TANGENTS)]
        if state == ContactState.OPEN:
            rows += [(Row.DN_UP, i, left, right), (Row.CN_DOWN, i, 0, 0)]
            continue
        rows.append((Row.GAP_UP, i, left, right))
        if state == ContactState.STICK:
            rows += [(Row.STILL_1_UP, i, 0, 0), (Row.STILL_2_UP, i, 0, 0)]
        if state == ContactState.SLIDE:
            rows += [(Row.CHORD, i, left, right), (Row.TANGENT, i, (left + right) // 2, 0)]
        if left != right:
            rows += [(Row.D_LEFT, i, left, 0), (Row.D_RIGHT, i, 0, right)]
        if left != right and state >= ContactState.CLOSED:
            rows += [(Row.C_LEFT, i, left, 0), (Row.C_RIGHT, i, 0, right)]
        if state >= ContactState.CLOSED and q.eta > 0:
            rows += [(Row.GAP_DOWN, i, k * TURN // TANGENTS, 0) for k in range(TANGENTS)]
    for j, state in enumerate(case[m:, 0].tolist()):
        rows += [(Row.T_UP, j, 0, 0), (Row.E_UP, j, 0, 0), (Row.S_UP, j, 0, 0)]
        if state == ActuatorState.LOCKED or not q.may_move[j]:
            rows.append((Row.T_DOWN, j, 0, 0))
    rows += [(Row.BOUND_UP, int(k), 0, 0) for k in np.flatnonzero(np.isfinite(lo))]
    rows += [(Row.BOUND_DOWN, int(k), 0, 0) for k in np.flatnonzero(np.isfinite(hi))]
    known = set(rows)
    for r in range(c.start[leaf], c.start[leaf + 1]):
        row = int(c.kind[r]), int(c.index[r]), int(c.a[r]), int(c.b[r])
        if row not in known and (OPPOSITE.get(row[0], row[0]), *row[1:]) not in known:
            rows.append(row)
    kind, index, a, b = np.array(rows, dtype=np.int64).T
    return kind, index, a, b
