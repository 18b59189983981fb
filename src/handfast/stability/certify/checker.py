"""Checks a certificate with arithmetic alone: no solver, nothing of the search that wrote it.

Four things are checked: the tree's splits leave out no case; every row that a leaf cites holds in the
leaf's case; no multiplier is negative; and the rows, weighed by their multipliers, contradict the
equilibrium (`farkas`; for version 1, with its caps on motions, `claim`).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.stability.certify import farkas
from handfast.stability.certify.certificate import (
    HALF,
    TURN,
    ActuatorState,
    Certificate,
    ContactState,
    Integers,
    Question,
    Row,
)
from handfast.stability.certify.claim import Claim, caps, leaf_margins
from handfast.stability.certify.leaf_rows import bounds
from handfast.stability.certify.patches import LAST, OCTANTS, contains
from handfast.stability.model import actuator_arms, joint_arms

CAPS = (1e12, 1e11, 1e10, 1e9, 1e8, 1e7, 1e6, 1e5, 1e4, 3e3, 1e3)  # force scales
WIDEST = HALF - TURN // 128  # of a sector whose chord is used: nearly half a turn, it would say nothing
FREE, LOCKED, MOVES = ActuatorState
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = ContactState


@dataclass(frozen=True)
class CheckedCertificate:
    """What the checker found.

    Attributes:
        ok: is the claim proved?
        leaves: how many cases the proof has.
        margin: the smallest relative margin by which a leaf is proved; -inf if it did not come to that.
        reason: empty if ok, else one line: which node, leaf or row, and what is wrong with it.
        unproved: leaves whose multipliers do not cancel every motion exactly, if all else is right.
        cap: [N] the claim is proved for virtual motions up to here only; None without any end. The file has no say
            in it but in version 1.
    """

    ok: bool
    leaves: int
    margin: float
    reason: str
    unproved: tuple[int, ...] = ()
    cap: float | None = None


class BadCertificate(Exception):
    """Why a certificate proves nothing."""


def verify(
    certificate: Certificate, known: dict[bytes, float] | None = None, until: float = np.inf
) -> CheckedCertificate:
    """Does the certificate prove its claim?

    known: leaves that this process has judged before, for another tree of the same claim; until: [s] of
    `time.monotonic`, when it is to give up; see `farkas.proved_margins`.
    """
    leaves = len(certificate.leaves)
    try:
        cases = leaf_cases(certificate)
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
            if certificate.capped:
                claim = Claim.of(certificate)
                check_rows(certificate, cases, claim.lo, claim.hi)
                margins = leaf_margins(certificate, claim)
            else:
                check_rows(certificate, cases, *bounds(certificate.question, certificate.scalar))
                margins = farkas.proved_margins(certificate, cases, known, until)
    except BadCertificate as fault:
        return CheckedCertificate(False, leaves, -np.inf, str(fault))
    except farkas.Late:
        return CheckedCertificate(False, leaves, -np.inf, "there was no time to check it all")
    bad, cap = np.flatnonzero(~(margins > 0)), None
    if certificate.cap_r is not None:
        cap = float(certificate.cap_r[:3].min())
    elif len(bad):
        cap, margins[bad] = _largest_cap(certificate, bad)
    left = np.flatnonzero(~(margins > 0))
    margin = float(np.where(np.isnan(margins), -np.inf, margins).min())
    if not len(left):
        return CheckedCertificate(True, leaves, margin, "", tuple(bad.tolist()), cap)
    reason = f"leaf {left[0]} (node {certificate.leaves[left[0]]}) is not proved: margin {margins[left[0]]:.3g}"
    if certificate.capped and claim.unbounded:
        reason += f"; nothing bounds the force of {', '.join(claim.unbounded)}"
    return CheckedCertificate(False, leaves, margin, reason, tuple(bad.tolist()))


def _largest_cap(certificate: Certificate, leaves: Integers) -> tuple[float | None, Array]:
    """[N] the largest of some motions up to which these leaves are proved, and their margins; None if there is none.

    For numbers that are in a special position but for rounding: points on a circle, parallel walls. What would cancel
    exactly in that position leaves 1e-17 of a motion, and only motions of 1e10 force scales make a force of that.
    """
    q, none = certificate.question, np.full(len(leaves), -np.inf)
    if certificate.scalar is not None and not np.isfinite(certificate.scalar[1]):
        return None, none
    some = certificate.some(leaves)
    force = _force(q)
    for factor in CAPS:
        cap = factor * force
        cap_r, cap_q = caps(q.plain, cap)
        capped = replace(some, cap_r=cap_r, cap_q=cap_q)
        with np.errstate(all="ignore"):
            margins = leaf_margins(capped, Claim.of(capped))
        if (margins > 0).all():
            return float(cap), margins
    return None, none


def _force(q: Question) -> float:
    """[N] the largest force of a question: its loads and its commands at a contact."""
    commands = np.abs(q.plain.command) / actuator_arms(q.plain)
    given = np.abs(q.plain.given_torques) / joint_arms(q.plain)
    loads = [max(np.linalg.norm(w[:3]), np.linalg.norm(w[3:]) / q.grasp.size) for w in (q.load.w_a, q.load.w_b)]
    return float(max([*loads, *commands, *given])) or 1.0


# --- the tree -----------------------------------------------------------------------------------


def leaf_cases(certificate: Certificate) -> Integers:
    """(L, m+a, 3) state, left and right of every part in every leaf; `BadCertificate` if the tree has a gap."""
    c, m = certificate, certificate.question.grasp.m
    parent, part = c.parent.tolist(), c.part.tolist()
    change = list(zip(c.state.tolist(), c.left.tolist(), c.right.tolist(), strict=True))
    parts = m + certificate.question.plain.mechanism.a
    cases = np.zeros((len(parent), parts, 3), dtype=np.int64)  # the root: UNDECIDED and FREE everywhere
    children = defaultdict(list)
    for node in range(len(parent)):
        if not (parent[node] == -1 if node == 0 else 0 <= parent[node] < node):
            raise BadCertificate(f"node {node} has parent {parent[node]}; the root has -1, the others an earlier node")
        if node == 0:
            continue
        if not 0 <= part[node] < parts:
            raise BadCertificate(f"node {node} changes part {part[node]}; there are {parts}")
        children[parent[node]].append(node)
        cases[node] = cases[parent[node]]
        cases[node, part[node]] = change[node]
    for node, kids in children.items():
        changed = part[kids[0]]
        if any(part[kid] != changed for kid in kids):
            raise BadCertificate(f"node {node} is split in several parts at once")
        new = [change[kid] for kid in kids]
        fault = _split_fault(certificate.question, changed, cases[node, changed].tolist(), new)
        if fault:
            what = f"contact {changed}" if changed < m else f"actuator {changed - m}"
            raise BadCertificate(f"node {node}, split of {what}: {fault}")
    listed = c.leaves.tolist()
    if sorted(listed) != [node for node in range(len(parent)) if node not in children]:
        missing = set(range(len(parent))) - set(children) - set(listed)
        raise BadCertificate(
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
    soft = question.grasp.contacts[part].torsion > 0
    if state == UNDECIDED:
        return "" if plain == [OPEN, CLOSED] and not sectors else "needs OPEN and CLOSED"
    if not question.mdp or state == STICK or (state == OPEN and question.eta == 0):
        return "it is decided already"
    if soft:
        return _patches_fault(state, left, new)
    kind, widest = (OPEN if state == OPEN else SLIDE), HALF - 1
    if state == CLOSED and all(s == CLOSED for s, _, _ in new):  # by (7) friction and -d_t are on one side of any line
        kind, widest = CLOSED, HALF
    elif state == CLOSED:
        stuck = [(a, b) for s, a, b in new if s == STICK]
        if len(stuck) != 1 or stuck[0] not in ((0, 0), (left, right)):
            return "needs STICK and sectors"
        sectors = [x for x in sectors if x[2] != STICK]
    if any(s != STICK or state != CLOSED for s in plain):
        return "needs STICK and sectors" if state == CLOSED else "needs sectors only"
    for a, b, s in sectors:
        if s != kind or not a < b <= a + widest:
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


def _patches_fault(state: int, number: int, new: list[tuple[int, int, int]]) -> str:
    """The same of a soft finger that is closed, or slides in a patch."""
    stuck = [(STICK, 0, 0)] if state == CLOSED else []
    if sorted(x for x in new if x[0] != SLIDE) != stuck:
        return "needs STICK and patches" if stuck else "needs patches only"
    halves = list(OCTANTS) if state == CLOSED else [2 * number, 2 * number + 1]
    right_ones = halves[-1] <= LAST and sorted(x for x in new if x[0] == SLIDE) == [(SLIDE, k, 0) for k in halves]
    return "" if right_ones else f"needs the patches {halves[0]} to {halves[-1]}"


# --- the rows -----------------------------------------------------------------------------------


def check_rows(certificate: Certificate, cases: Integers, lo: Array, hi: Array) -> None:
    """`BadCertificate` for the first row with a wrong number, an illegal multiplier, or that need not hold in its leaf.

    lo, hi: (n,) what is known of the unknowns, for BOUND rows.
    """
    c, q = certificate, certificate.question
    leaf = np.repeat(np.arange(len(c.leaves)), np.diff(c.start))

    def refuse(bad: Mask, why: str) -> None:
        if bad.any():
            r = int(np.flatnonzero(bad)[0])
            place = f"leaf {leaf[r]} (node {c.leaves[leaf[r]]}), row {r - c.start[leaf[r]]}"
            name = Row(c.kind[r]).name if 0 <= c.kind[r] < len(Row) else c.kind[r]
            raise BadCertificate(f"{place}, {name} {c.index[r]} [{c.a[r]}, {c.b[r]}]: {why}")

    refuse((c.kind < 0) | (c.kind >= len(Row)), "no such kind")
    of = [c.kind <= Row.STILL_2_DOWN, c.kind <= Row.S_UP, c.kind <= Row.BOUND_DOWN, c.kind == Row.ENERGY]
    ends = np.select(of, [q.grasp.m, q.plain.mechanism.a, len(lo), len(c.references)], q.grasp.m)
    refuse((c.index < 0) | (c.index >= ends), "no such contact, actuator, column or reference")
    refuse(~(np.isfinite(c.multiplier) & (c.multiplier >= 0)), "the multiplier is negative or not finite")
    refuse(~legal(certificate, cases[leaf], lo, hi), "does not hold in this case")


def legal(certificate: Certificate, cases: Integers, lo: Array, hi: Array) -> Mask:
    """(R,) bool: is each row true of every state in the case (R, m+a, 3) of its leaf?"""
    c, q, m = certificate, certificate.question, certificate.question.grasp.m
    of_bound, of_part = (c.kind == Row.BOUND_UP) | (c.kind == Row.BOUND_DOWN), c.kind < Row.BOUND_UP
    twists = c.kind > Row.ENERGY
    part = np.where(of_part, c.index + np.where(c.kind >= Row.T_UP, m, 0), np.where(twists, c.index, 0))
    state, left, right = cases[np.arange(len(part)), part].T
    j = np.where((c.kind >= Row.T_UP) & of_part, c.index, 0)
    k = np.where(of_bound, c.index, 0)

    def inside(a: Integers, b: Integers) -> Mask:
        """Is the sector within [a, b]? Both may be written with any number of full turns added."""
        return (left < right) & (np.mod(left - a, TURN) + (right - left) <= b - a)

    still, slides, opens = state == STICK, state == SLIDE, state == OPEN
    within = inside(c.a, c.b) & (c.b - c.a < (HALF if c.capped else WIDEST))
    chord = within | (np.full(len(part), q.eta == 0))  # g is not needed where eta = 0
    leftish, rightish = inside(c.a, c.a + HALF), inside(c.b - HALF, c.b)
    soft = np.append(q.soft_fingers >= 0, False)[np.where(twists, c.index, m)]
    patched = soft & slides & contains(c.a, left)
    sided = patched & (c.b >= 0) & (c.b < 3)
    pressed = (state == CLOSED) | still | slides
    driven, may_move = (np.append(v, False)[j] for v in (q.is_driven, q.may_move))
    moves, commanded = state == MOVES, may_move & ~driven
    always = np.ones(len(part), dtype=bool)
    # friction takes energy by (6), (7) alone; larger commands put in more, as t >= 0
    drives = q.goal.homogeneous and q.equivalent.drives  # springs that are turned back take in more, the larger
    balanced = np.full(len(part), q.mdp and q.goal.bounds_energy and not drives)
    if certificate.scalar is not None and len(c.references):
        top = c.references[np.where(c.kind == Row.ENERGY, c.index, 0), m]
        balanced &= top >= certificate.scalar[1]
    cases_of: dict[Row, Mask] = {
        Row.CN_UP: always,
        Row.CN_DOWN: opens,
        Row.GAP_UP: still | chord,
        Row.GAP_DOWN: pressed,
        Row.DN_UP: opens & chord,
        Row.TANGENT: always,
        Row.CHORD: slides & within,
        Row.C_LEFT: pressed & leftish,
        Row.C_RIGHT: pressed & rightish,
        Row.D_LEFT: still | leftish,
        Row.D_RIGHT: still | rightish,
        **dict.fromkeys((Row.STILL_1_UP, Row.STILL_1_DOWN, Row.STILL_2_UP, Row.STILL_2_DOWN), still),
        Row.T_UP: always,
        Row.T_DOWN: (state == LOCKED) | ~may_move,
        Row.E_UP: commanded | (driven & moves),
        Row.E_DOWN: commanded & moves,
        Row.S_UP: driven & moves,
        Row.BOUND_UP: np.isfinite(lo[k]),
        Row.BOUND_DOWN: np.isfinite(hi[k]),
        Row.ENERGY: balanced,
        Row.SOFT_TANGENT: soft,
        Row.SOFT_CHORD: patched,
        Row.C_SIDE: sided,
        Row.D_SIDE: sided,
        **dict.fromkeys((Row.TURN_UP, Row.TURN_DOWN), soft & still),
    }
    return np.select([c.kind == row for row in cases_of], list(cases_of.values()), False)
