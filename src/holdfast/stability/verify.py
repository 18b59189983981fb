"""Checks a certificate with arithmetic alone: no solver, nothing of the search that wrote it.

Four things are checked: the tree's splits leave out no case; every row that a leaf cites holds in the
leaf's case; no multiplier is negative; and the rows, weighed by their multipliers, contradict the
equilibrium and the bounds. For the last, with rows F x >= b, multipliers y >= 0, equalities E x = h and
any v, every x of the leaf has

    y b + v h <= (y F + v E) x <= sum over k of max(rho_k lo_k, rho_k hi_k),   rho = y F + v E,

so the leaf is empty if the left end is larger than the right one. Which v is used does not matter for
soundness: least squares makes rho small. Floating-point errors are bounded from above throughout.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from holdfast.mechanism import Array, Mask
from holdfast.stability.certificate import (
    HALF,
    TURN,
    ActuatorState,
    Certificate,
    ContactState,
    Goal,
    Integers,
    Question,
    Row,
    directions,
)
from holdfast.stability.claim import TINY, UNIT, Claim

FREE, LOCKED, MOVES = ActuatorState
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = ContactState


@dataclass(frozen=True)
class Verification:
    """What the checker found.

    Attributes:
        ok: is the claim proved?
        leaves: how many cases the proof has.
        margin: the smallest relative margin by which a leaf is proved; -inf if it did not come to that.
        reason: empty if ok, else one line: which node, leaf or row, and what is wrong with it.
    """

    ok: bool
    leaves: int
    margin: float
    reason: str


class Refused(Exception):
    """Why a certificate proves nothing."""


def verify(certificate: Certificate) -> Verification:
    """Does the certificate prove its claim?"""
    leaves = len(certificate.leaves)
    try:
        cases = leaf_cases(certificate)
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
            claim = Claim.of(certificate)
            check_rows(certificate, claim, cases)
            margins = leaf_margins(certificate, claim)
    except Refused as fault:
        return Verification(False, leaves, -np.inf, str(fault))
    bad = np.flatnonzero(~(margins > 0))
    margin = float(np.where(np.isnan(margins), -np.inf, margins).min())
    if not len(bad):
        return Verification(True, leaves, margin, "")
    reason = f"leaf {bad[0]} (node {certificate.leaves[bad[0]]}) is not proved: margin {margins[bad[0]]:.3g}"
    if claim.unbounded:
        reason += f"; nothing bounds the force of {', '.join(claim.unbounded)}"
    return Verification(False, leaves, margin, reason)


# --- the tree -----------------------------------------------------------------------------------


def leaf_cases(certificate: Certificate) -> Integers:
    """(L, m+a, 3) state, left and right of every part in every leaf; `Refused` if the tree has a gap."""
    c, m = certificate, certificate.question.grasp.m
    parent, part = c.parent.tolist(), c.part.tolist()
    change = list(zip(c.state.tolist(), c.left.tolist(), c.right.tolist(), strict=True))
    parts = m + certificate.question.grasp.mechanism.a
    cases = np.zeros((len(parent), parts, 3), dtype=np.int64)  # the root: UNDECIDED and FREE everywhere
    children = defaultdict(list)
    for node in range(len(parent)):
        if not (parent[node] == -1 if node == 0 else 0 <= parent[node] < node):
            raise Refused(f"node {node} has parent {parent[node]}; the root has -1, the others an earlier node")
        if node == 0:
            continue
        if not 0 <= part[node] < parts:
            raise Refused(f"node {node} changes part {part[node]}; there are {parts}")
        children[parent[node]].append(node)
        cases[node] = cases[parent[node]]
        cases[node, part[node]] = change[node]
    for node, kids in children.items():
        changed = part[kids[0]]
        if any(part[kid] != changed for kid in kids):
            raise Refused(f"node {node} is split in several parts at once")
        new = [change[kid] for kid in kids]
        fault = _split_fault(certificate.question, changed, cases[node, changed].tolist(), new)
        if fault:
            what = f"contact {changed}" if changed < m else f"actuator {changed - m}"
            raise Refused(f"node {node}, split of {what}: {fault}")
    listed = c.leaves.tolist()
    if sorted(listed) != [node for node in range(len(parent)) if node not in children]:
        missing = set(range(len(parent))) - set(children) - set(listed)
        raise Refused(
            f"node {min(missing)} is neither split nor a leaf" if missing else "a leaf is split, repeated or no node"
        )
    return cases[c.leaves]


def _split_fault(question: Question, part: int, old: list[int], new: list[tuple[int, int, int]]) -> str:
    """What is wrong with a split; empty if the new cases cover the old one."""
    m = question.grasp.m
    state, left, right = old
    plain = sorted(s for s, a, b in new if a == b == 0)
    sectors = sorted((a, b, s) for s, a, b in new if not a == b == 0)
    if part >= m:
        if state != FREE or not question.may_move[part - m]:
            return "it is decided already, or cannot move"
        return "" if plain == [LOCKED, MOVES] and not sectors else "needs LOCKED and MOVES"
    if state == UNDECIDED:
        return "" if plain == [OPEN, CLOSED] and not sectors else "needs OPEN and CLOSED"
    if not question.mdp or state == STICK or (state == OPEN and question.eta == 0):
        return "it is decided already"
    if plain != ([STICK] if state == CLOSED else []):
        return "needs STICK and sectors" if state == CLOSED else "needs sectors only"
    kind = OPEN if state == OPEN else SLIDE
    for a, b, s in sectors:
        if s != kind or not a < b < a + HALF:
            return f"[{a}, {b}] is no sector, or not of state {kind.name}"
    for (_, end, _), (begin, _, _) in pairwise(sectors):
        if end != begin:
            return f"the sectors {'leave a gap' if end < begin else 'overlap'} between {end} and {begin}"
    if not sectors:
        return "needs sectors"
    first, last = sectors[0][0], sectors[-1][1]
    if left == right:
        return "" if last - first == TURN else f"the sectors from {first} to {last} are not a full turn"
    return "" if (first, last) == (left, right) else f"the sectors [{first}, {last}] are not [{left}, {right}]"


# --- the rows -----------------------------------------------------------------------------------


def check_rows(certificate: Certificate, claim: Claim, cases: Integers) -> None:
    """`Refused` for the first row with a wrong number, an illegal multiplier, or that need not hold in its leaf."""
    c, q = certificate, certificate.question
    leaf = np.repeat(np.arange(len(c.leaves)), np.diff(c.start))

    def refuse(bad: Mask, why: str) -> None:
        if bad.any():
            r = int(np.flatnonzero(bad)[0])
            place = f"leaf {leaf[r]} (node {c.leaves[leaf[r]]}), row {r - c.start[leaf[r]]}"
            name = Row(c.kind[r]).name if 0 <= c.kind[r] < len(Row) else c.kind[r]
            raise Refused(f"{place}, {name} {c.index[r]} [{c.a[r]}, {c.b[r]}]: {why}")

    refuse((c.kind < 0) | (c.kind >= len(Row)), "no such kind")
    of = [c.kind <= Row.STILL_2_DOWN, c.kind <= Row.S_UP, c.kind <= Row.BOUND_DOWN]
    ends = np.select(of, [q.grasp.m, q.grasp.mechanism.a, claim.columns.n], len(c.references))
    refuse((c.index < 0) | (c.index >= ends), "no such contact, actuator, column or reference")
    refuse(~(np.isfinite(c.multiplier) & (c.multiplier >= 0)), "the multiplier is negative or not finite")
    refuse(~legal(certificate, claim, cases[leaf]), "does not hold in this case")


def legal(certificate: Certificate, claim: Claim, cases: Integers) -> Mask:
    """(R,) bool: is each row true of every state in the case (R, m+a, 3) of its leaf?"""
    c, q, m = certificate, certificate.question, certificate.question.grasp.m
    of_bound, of_part = (c.kind == Row.BOUND_UP) | (c.kind == Row.BOUND_DOWN), c.kind < Row.BOUND_UP
    part = np.where(of_part, c.index + np.where(c.kind >= Row.T_UP, m, 0), 0)
    state, left, right = cases[np.arange(len(part)), part].T
    j = np.where((c.kind >= Row.T_UP) & of_part, c.index, 0)
    k = np.where(of_bound, c.index, 0)

    def inside(a: Integers, b: Integers) -> Mask:
        """Is the sector within [a, b]? Both may be written with any number of full turns added."""
        return (left < right) & (np.mod(left - a, TURN) + (right - left) <= b - a)

    still, slides, opens = state == STICK, state == SLIDE, state == OPEN
    within = inside(c.a, c.b) & (c.b - c.a < HALF)
    chord = within | (np.full(len(part), q.eta == 0))  # g is not needed where eta = 0
    leftish, rightish = inside(c.a, c.a + HALF), inside(c.b - HALF, c.b)
    driven, may_move = (np.append(v, False)[j] for v in (q.is_driven, q.may_move))
    moves, commanded = state == MOVES, may_move & ~driven
    always = np.ones(len(part), dtype=bool)
    # friction takes energy by (6), (7) alone; larger commands put in more, as t >= 0
    balanced = np.full(len(part), q.mdp and q.goal in (Goal.CHECK, Goal.SMALLEST_PRELOAD))
    if certificate.scalar is not None and len(c.references):
        top = c.references[np.where(c.kind == Row.ENERGY, c.index, 0), m]
        balanced &= top >= certificate.scalar[1]
    cases_of: dict[Row, Mask] = {
        Row.CN_UP: always,
        Row.CN_DOWN: opens,
        Row.GAP_UP: still | chord,
        Row.GAP_DOWN: (state == CLOSED) | still | slides,
        Row.DN_UP: opens & chord,
        Row.TANGENT: always,
        Row.CHORD: slides & within,
        Row.C_LEFT: slides & leftish,
        Row.C_RIGHT: slides & rightish,
        Row.D_LEFT: still | leftish,
        Row.D_RIGHT: still | rightish,
        **dict.fromkeys((Row.STILL_1_UP, Row.STILL_1_DOWN, Row.STILL_2_UP, Row.STILL_2_DOWN), still),
        Row.T_UP: may_move,
        Row.T_DOWN: (state == LOCKED) | ~may_move,
        Row.E_UP: commanded | (driven & moves),
        Row.E_DOWN: commanded & moves,
        Row.S_UP: driven & moves,
        **dict.fromkeys((Row.BOUND_UP, Row.BOUND_DOWN), np.isfinite(claim.reach[k])),
        Row.ENERGY: balanced,
    }
    return np.select([c.kind == row for row in cases_of], list(cases_of.values()), False)


# --- the proof of each leaf ---------------------------------------------------------------------


def leaf_margins(certificate: Certificate, claim: Claim) -> Array:
    """(L,) how far each leaf's rows contradict the bounds, of the numbers involved; positive is a proof."""
    n, eps = claim.columns.n, claim.error
    S, size, rhs, rhs_size = weighed_rows(certificate, claim)
    rho0 = S[:, :n] + S[:, n:] @ claim.Z
    error = eps * (size[:, :n] + size[:, n:] @ np.abs(claim.Z))

    v = equality_multipliers(rho0, claim)
    rho = rho0 + v @ claim.E
    error = error + eps * (np.abs(rho0) + np.abs(v) @ np.abs(claim.E)) + TINY
    bounded = np.isfinite(claim.reach)
    lo, hi, reach = (np.where(bounded, b, 0.0) for b in (claim.lo, claim.hi, claim.reach))
    most = np.maximum(rho * lo, rho * hi).sum(axis=1)
    gap = rhs + v @ claim.h - most
    involved = rhs_size + np.abs(v) @ np.abs(claim.h) + np.abs(rho) @ reach
    gap -= 2 * (error @ reach + eps * involved + TINY)
    # an unknown without bound may occur nowhere, not even by rounding
    gap[(size[:, :n][:, ~bounded] != 0).any(axis=1)] = -np.inf
    return np.asarray(gap / np.maximum(involved, TINY))


def equality_multipliers(rho0: Array, claim: Claim) -> Array:
    """(L, p) v that makes rho0 + v E small, each unknown weighed by its reach; any v would be sound."""
    weight = np.where(np.isfinite(claim.reach), claim.reach, 0.0)
    weight /= max(weight.max(), TINY)
    weight[np.isfinite(claim.reach)] += 1e-9  # rows still say v where the reach is 0: no friction
    norms = np.linalg.norm(claim.E * weight, axis=1)
    scale = np.where(norms > 0, 1.0 / np.where(norms > 0, norms, 1.0), 0.0)[:, None]
    inverse = np.linalg.pinv(claim.E * weight * scale)
    v = -((rho0 * weight) @ inverse) * scale.T
    return v - (((rho0 + v @ claim.E) * weight) @ inverse) * scale.T  # once more for what rounding left


def weighed_rows(certificate: Certificate, claim: Claim) -> tuple[Array, Array, Array, Array]:
    """Rows weighed by multipliers: S (L, n+3m+a) on (x, d, t), the sum of sizes, b (L,), its sum of sizes.

    The sizes times `Claim.error` bound all errors: of rounding, and of float directions U = (1 + e) unit,
    |e| < 10 u. Those make g wrong by less than 80 u |d_t| / (1 + U_a . U_b)^1.5, the chord by as much times
    mu c_n, `TANGENT` by 10 u mu c_n, `GAP_DOWN` by 10 u |d_t|: added to the sizes as `more`, for 256 u.
    `C_LEFT` and the like are exact: U_(a + half a turn) = -U_a.
    """
    c, q, at = certificate, certificate.question, claim.columns
    m, width = q.grasp.m, at.n + len(claim.Z)
    leaf = np.repeat(np.arange(len(c.leaves)), np.diff(c.start))
    force, motion = at.c.start + 3 * c.index, at.n + 3 * c.index
    t, f = at.n + 3 * m + c.index, at.f.start + c.index
    cos, sin = np.cos(q.eta), np.sin(q.eta)
    U = directions(np.concatenate([c.a, c.b]))
    if not (np.abs((U * U).sum(axis=1) - 1) < 16 * UNIT).all():
        raise Refused("the directions of this computer are not of unit length")
    Ua, Ub = U[: len(leaf)], U[len(leaf) :]
    needs_both = np.isin(c.kind, (Row.GAP_UP, Row.DN_UP, Row.CHORD)) & (np.abs(c.b - c.a) < HALF)
    both = np.where(needs_both, 1 + (Ua * Ub).sum(axis=1), 1.0)
    g, wide = (Ua + Ub) / both[:, None], both**-1.5
    mu = np.append(q.grasp.mu, 0.0)[np.minimum(c.index, m)]
    constant, per_scalar = (np.append(f_c, 0.0)[np.minimum(c.index, len(f_c))] for f_c in q.commands)
    rows = [np.flatnonzero(c.kind == kind) for kind in Row]
    flat, value, sizes = [], [], []
    b = np.zeros(len(leaf))

    def put(kinds: tuple[Row, ...], column: Integers, coefficient: Array | float, more: Array | float = 0.0) -> None:
        here = np.concatenate([rows[kind] for kind in kinds])
        x, extra = (v[here] if isinstance(v, np.ndarray) else v for v in (coefficient, more))
        flat.append(leaf[here] * width + column[here])
        value.append(c.multiplier[here] * x)
        sizes.append(c.multiplier[here] * (np.abs(x) + extra))

    put((Row.CN_UP, Row.GAP_UP), force, 1.0)
    put((Row.CN_DOWN, Row.GAP_DOWN), force, -1.0)
    put((Row.TANGENT,), force, mu, mu)
    put((Row.CHORD,), force, -mu * both / 2, mu * wide)
    put((Row.GAP_UP, Row.DN_UP), motion, cos)
    put((Row.GAP_DOWN,), motion, -cos)
    for axis in (0, 1):
        put((Row.TANGENT,), force + 1 + axis, -Ua[:, axis])
        put((Row.CHORD,), force + 1 + axis, (Ua + Ub)[:, axis] / 2)
        put((Row.GAP_UP, Row.DN_UP), motion + 1 + axis, -sin * g[:, axis], sin * wide)
        put((Row.GAP_DOWN,), motion + 1 + axis, sin * Ua[:, axis], sin)
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
    put((Row.T_UP,), t, 1.0)
    put((Row.T_DOWN,), t, -1.0)
    put((Row.E_UP,), f, 1.0)
    put((Row.E_DOWN, Row.S_UP), f, -1.0)
    put((Row.S_UP,), at.e.start + c.index if at.e.stop > at.e.start else np.full_like(f, at.scalar.start), 1.0)
    put((Row.BOUND_UP,), c.index, 1.0)
    put((Row.BOUND_DOWN,), c.index, -1.0)
    if at.scalar.stop > at.scalar.start:  # commands lambda f_c
        put((Row.E_UP,), np.full_like(f, at.scalar.start), -per_scalar)
        put((Row.E_DOWN,), np.full_like(f, at.scalar.start), per_scalar)
    energy = rows[Row.ENERGY]
    if len(energy):
        x = np.zeros((len(leaf), m + 1))
        x[energy] = c.references[c.index[energy]]
        here = np.zeros_like(c.index)
        w, (f_c, per_s) = q.loads[0], q.commands
        for axis in range(6):
            put((Row.ENERGY,), here + at.r.start + axis, w[axis])
        for i in range(m):
            put((Row.ENERGY,), here + at.c.start + 3 * i, -2 * x[:, i])
        for i in range(len(f_c)):
            put((Row.ENERGY,), here + at.n + 3 * m + i, f_c[i] + x[:, m] * per_s[i])
        b -= (x[:, :m] ** 2).sum(axis=1)
    b += np.where(c.kind == Row.E_UP, constant, 0.0) - np.where(c.kind == Row.E_DOWN, constant, 0.0)
    column = np.minimum(c.index, at.n - 1)
    b += np.where(c.kind == Row.BOUND_UP, claim.lo[column], 0.0)
    b -= np.where(c.kind == Row.BOUND_DOWN, claim.hi[column], 0.0)

    def total(where: Integers, what: Array, length: int) -> Array:
        return np.bincount(where, weights=what, minlength=length).astype(float)

    L, where = len(c.leaves), np.concatenate(flat)
    S, size = (total(where, np.concatenate(v), L * width).reshape(L, width) for v in (value, sizes))
    y = c.multiplier
    return S, size, total(leaf, y * b, L), total(leaf, np.abs(y * b), L)
