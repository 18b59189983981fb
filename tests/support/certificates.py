"""Certificates for tests: questions, rows and equations written out a second time, a small prover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise

import numpy as np
from handfast.stability.certify import leaf_rows
from handfast.stability.certify.certificate import (
    TURN,
    WIDER,
    ActuatorState,
    Certificate,
    Columns,
    ContactState,
    Question,
    Row,
)
from handfast.stability.certify.certificate import directions as float_directions
from handfast.stability.certify.claim import Claim
from scipy.optimize import linprog

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.goal import (
    ANY_STATE,
    LARGEST,
    SMALLEST_LARGEST_COMMAND,
    SMALLEST_PRELOAD,
    SMALLEST_SUM_OF_COMMANDS,
)
from tests.support.problems import nest, pinch

FREE, LOCKED, MOVES = ActuatorState
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = ContactState
ROUNDED = Fraction(1, 2**53)


# --- the rows, in three arithmetics ---------------------------------------------------------------


def float_direction(k):
    return [float(v) for v in float_directions(np.array([k]))[0]]


def written_direction(k):
    """The vector of floats that stands for direction k, as it is."""
    return [Fraction(v) for v in float_direction(k)]


def exact_direction(k):
    """A rational vector of exactly unit length, within rounding of direction k."""
    quarter, rest = divmod(k % TURN, TURN // 4)
    x, y = half_angle(2 * np.pi * rest / TURN)
    return [(x, y), (-y, x), (-x, -y), (y, -x)][quarter]


def half_angle(angle):
    """Rational cosine and sine of (nearly) an angle."""
    t = Fraction(float(np.tan(angle / 2)))
    return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)


@dataclass(frozen=True)
class Arithmetic:
    """In which numbers a row is written: what they are, directions, cosine and sine of eta, how far cones give way."""

    number: Callable
    direction: Callable
    turn: Callable
    wider: object = 0


def cosine_and_sine(angle):
    return float(np.cos(angle)), float(np.sin(angle))


FLOATS = Arithmetic(float, float_direction, cosine_and_sine)
UNIT_LENGTHS = Arithmetic(Fraction, exact_direction, half_angle)  # whatever directions are meant
AS_WRITTEN = Arithmetic(  # floats as they are; rows are wider by what these are wrong
    Fraction, written_direction, lambda eta: [Fraction(v) for v in cosine_and_sine(eta)], Fraction(WIDER)
)


def row(certificate, claim, kind, index, a, b, arithmetic=FLOATS):
    """{place in (x, d, t): coefficient}, rhs of one row. Written from `Row` alone."""
    q, at = certificate.question, claim.columns
    number, more = arithmetic.number, arithmetic.wider
    Ua, Ub = arithmetic.direction(a), arithmetic.direction(b)
    cos, sin = arithmetic.turn(q.eta)
    kind, c, d = Row(kind), at.c.start + 3 * index, at.n + 3 * index
    t, f = at.n + 3 * q.grasp.m + index, at.f.start + index
    dot = 1 + Ua[0] * Ub[0] + Ua[1] * Ub[1]
    if kind in (Row.BOUND_UP, Row.BOUND_DOWN):
        up = kind is Row.BOUND_UP
        return {index: 1 if up else -1}, number(claim.lo[index]) if up else -number(claim.hi[index])
    if kind is Row.ENERGY:
        *normal, scalar = (number(v) for v in certificate.references[index].tolist())
        scalar = (scalar if q.goal == SMALLEST_PRELOAD else 1) * (1 + 4 * ROUNDED if more else 1)
        entries = {at.r.start + k: number(w) for k, w in enumerate(q.load.w_a.tolist())}
        entries |= {at.c.start + 3 * i: -2 * x for i, x in enumerate(normal)}
        commands = np.abs(q.grasp.command).tolist()
        entries |= {at.n + 3 * q.grasp.m + j: scalar * number(f_c) for j, f_c in enumerate(commands)}
        return entries, -sum(x * x for x in normal) * (1 + 2 * q.grasp.m * ROUNDED if more else 1)
    if kind in (Row.E_UP, Row.E_DOWN, Row.S_UP, Row.T_UP, Row.T_DOWN):
        if kind in (Row.T_UP, Row.T_DOWN):
            return {t: 1 if kind is Row.T_UP else -1}, 0
        if kind is Row.S_UP:
            return {f: -1, (at.scalar.start if not q.goal.sums_commands else at.e.start + index): 1}, 0
        sign = 1 if kind is Row.E_UP else -1
        f_c = 0 if q.goal.seeks_commands else number(abs(q.grasp.command[index]))
        if q.goal == SMALLEST_PRELOAD:
            return {f: sign, at.scalar.start: -sign * f_c}, 0
        return {f: sign}, sign * f_c
    mu = number(q.grasp.mu[index])
    worst = {d: cos}
    if q.eta and dot:
        worst |= {d + 1 + k: -sin * (1 + more) * (Ua[k] + Ub[k]) / dot for k in (0, 1)}
    return {
        Row.CN_UP: {c: 1},
        Row.CN_DOWN: {c: -1},
        Row.GAP_UP: {c: 1} | worst,
        Row.GAP_DOWN: {c: -1, d: -cos, **{d + 1 + k: sin * (1 - more) * Ua[k] for k in (0, 1)}},
        Row.DN_UP: worst,
        Row.TANGENT: {c: mu * (1 + more), c + 1: -Ua[0], c + 2: -Ua[1]},
        Row.CHORD: {c: -mu * (dot / 2 - more), c + 1: (Ua[0] + Ub[0]) / 2, c + 2: (Ua[1] + Ub[1]) / 2},
        Row.C_LEFT: {c + 1: -Ua[1], c + 2: Ua[0]},
        Row.C_RIGHT: {c + 1: Ub[1], c + 2: -Ub[0]},
        Row.D_LEFT: {d + 1: Ua[1], d + 2: -Ua[0]},
        Row.D_RIGHT: {d + 1: -Ub[1], d + 2: Ub[0]},
        Row.STILL_1_UP: {d + 1: 1},
        Row.STILL_1_DOWN: {d + 1: -1},
        Row.STILL_2_UP: {d + 2: 1},
        Row.STILL_2_DOWN: {d + 2: -1},
    }[kind], 0


# --- what else is known of the unknowns -----------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Known:
    """Bounds, equations E x = h and motions (d, t) = Z x without any cap, in floats: as `Claim` has them with caps."""

    columns: Columns
    lo: Array
    hi: Array
    E: Array
    h: Array
    Z: Array

    @classmethod
    def of(cls, certificate):
        E, h, Z = exact_equations(certificate.question)
        at = Columns.of(certificate.question)
        E, Z = ([[float(r.get(k, 0)) for k in range(at.n)] for r in rows] for rows in (E, Z))
        lo, hi = leaf_rows.bounds(certificate.question, certificate.scalar)
        shape = -1, at.n
        return cls(at, lo, hi, np.array(E).reshape(shape), np.array([float(v) for v in h]), np.array(Z).reshape(shape))

    @property
    def scale(self):
        """(n,) what unknowns are divided by."""
        size = np.maximum(np.abs(self.E).max(axis=0, initial=0.0), np.abs(self.Z).max(axis=0, initial=0.0))
        return 1 / np.where(size > 0, size, 1.0)


def known(certificate):
    """What bounds and equations a certificate of either version has."""
    return Claim.of(certificate) if certificate.capped else Known.of(certificate)


def crossed(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def exact_equations(q):
    """E, h, Z: (1), (2), couplings, locks, the sum of efforts; (3). Rows are {column: Fraction}, of the floats as
    they are: positions, axes and the contacts' frames."""
    g, at = q.grasp, Columns.of(q)
    mechanism, turned_ = g.mechanism, q.sense.astype(int).tolist()
    R = [[Fraction(v) * sign for v in r] for r, sign in zip(mechanism.R.tolist(), turned_, strict=True)]
    A = [[Fraction(v) for v in r] for r in mechanism.A.tolist()]
    wrench, torque = [{} for _ in range(6)], [{} for _ in range(g.l)]
    Z = [{} for _ in range(3 * g.m)]
    for i, contact in enumerate(g.contacts):
        p, frame = ([Fraction(v) for v in u] for u in (contact.position.tolist(), contact.frame.T.reshape(-1).tolist()))
        for k in range(3):
            axis = frame[3 * k : 3 * k + 3]
            for row_, value in enumerate([*axis, *crossed(p, axis)]):
                wrench[row_][at.c.start + 3 * i + k] = value
                Z[3 * i + k][at.r.start + row_] = value
            for j, joint in enumerate(g.joints):
                if i in joint.moves:
                    turn, origin = ([Fraction(v) for v in u.tolist()] for u in (joint.axis, joint.origin))
                    arm = [a - b for a, b in zip(p, origin, strict=True)]
                    speed = turn if joint.type == "prismatic" else crossed(turn, arm)
                    value = sum(a * b for a, b in zip(axis, speed, strict=True))
                    torque[j][at.c.start + 3 * i + k] = value
                    Z[3 * i + k][at.q.start + j] = -value
    constant, per_scalar = q.load.w_a, q.load.w_b
    if q.goal != ANY_STATE:
        for k in range(6):
            wrench[k][at.scalar.start] = Fraction(float(per_scalar[k]))
    for j in range(g.l):
        torque[j] |= {at.f.start + i: -r[j] for i, r in enumerate(R)}
        torque[j] |= {at.coupling.start + i: -r[j] for i, r in enumerate(A)}
    moved = [{at.q.start + j: v for j, v in enumerate(r)} for r in R]
    E = wrench + torque + [{at.q.start + j: v for j, v in enumerate(r)} for r in A]
    E += [r for r, may in zip(moved, q.may_move, strict=True) if not may]
    if at.e.stop > at.e.start:
        E.append(
            {at.scalar.start: Fraction(1)} | {at.e.start + j: Fraction(-int(d)) for j, d in enumerate(q.is_driven)}
        )
    h = [-Fraction(v) for v in constant.tolist()] + [Fraction(0)] * (len(E) - 6)
    return E, h, Z + moved


def dense(claim, entries):
    """(n,) a row's coefficients on x."""
    full = np.zeros(claim.columns.n + len(claim.Z))
    for place, value in entries.items():
        full[place] = value
    return full[: claim.columns.n] + full[claim.columns.n :] @ claim.Z


def rows_of(question, claim, case):
    """Names of rows that hold in a case [(state, left, right) per part], enough of them for a proof."""
    m, ring = question.grasp.m, [k * TURN // 8 for k in range(8)]
    names = []
    for i, (state, l, r) in enumerate(case[:m]):
        around = [*ring, l, r] if l < r else ring
        names += [(Row.CN_UP, i, 0, 0), *((Row.TANGENT, i, a, 0) for a in around)]
        if question.eta == 0:
            names.append((Row.GAP_UP, i, 0, 0))
        if state == OPEN:
            names.append((Row.CN_DOWN, i, 0, 0))
            if l < r or question.eta == 0:
                names.append((Row.DN_UP, i, l, r))
        if state in (CLOSED, STICK, SLIDE):
            names += [(Row.GAP_DOWN, i, a, 0) for a in around]
        if state == STICK:
            names += [(Row.GAP_UP, i, 0, 1), *((Row(k), i, 0, 0) for k in range(Row.STILL_1_UP, Row.T_UP))]
        if l < r:
            names += [(Row.D_LEFT, i, l, 0), (Row.D_RIGHT, i, 0, r), (Row.GAP_UP, i, l, r)]
        if state == SLIDE:
            names += [(Row.CHORD, i, l, r), (Row.C_LEFT, i, l, 0), (Row.C_RIGHT, i, 0, r)]
    for j, (state, *_) in enumerate(case[m:]):
        driven, moves = question.is_driven[j], state == MOVES
        if question.may_move[j]:
            names.append((Row.T_UP, j, 0, 0))
        if state == LOCKED:
            names.append((Row.T_DOWN, j, 0, 0))
        if question.may_move[j] and (moves or not driven):
            names.append((Row.E_UP, j, 0, 0))
        if moves:
            names.append((Row.S_UP if driven else Row.E_DOWN, j, 0, 0))
    for kind, end in ((Row.BOUND_UP, claim.lo), (Row.BOUND_DOWN, claim.hi)):
        names += [(kind, k, 0, 0) for k in np.flatnonzero(np.isfinite(end)).tolist()]
    return names


def claim_scale(claim):
    """(n,) what unknowns are divided by in a program."""
    return claim.scale if isinstance(claim, Known) else np.where(claim.reach > 0, claim.reach, 1.0)


def multipliers(certificate, claim, names):
    """(margin, y) with the largest y b + v h where y F + v E = 0: Farkas' lemma as a program."""
    F, b = zip(*(row(certificate, claim, *name) for name in names), strict=True)
    A = np.vstack([*(dense(claim, f) for f in F), claim.E])
    A, rhs = A * claim_scale(claim), np.array([*b, *claim.h], dtype=float)
    size = np.maximum(np.linalg.norm(A, axis=1), 1e-12)
    A, rhs = A / size[:, None], rhs / size
    bounds = [(0, 1)] * len(F) + [(-1e3, 1e3)] * len(claim.E)
    result = linprog(-rhs, A_eq=A.T, b_eq=np.zeros(A.shape[1]), bounds=bounds, method="highs")
    assert result.status == 0, result.message
    return -result.fun, (result.x / size)[: len(F)]


def empty(question, scalar=None, names=(), y=(), references=(), caps=None):
    """A certificate whose tree is a root alone, with the given rows; with caps (cap_r, cap_q), of version 1."""
    kind, index, a, b = np.array(names, dtype=np.int64).reshape(-1, 4).T
    none = np.zeros(1, dtype=np.int64)
    return Certificate(
        question, scalar, none - 1, none, none, none, none, none, np.array([0, len(kind)]),
        kind, index, a, b, np.array(y, dtype=float), references, *(caps or ()),
    )  # fmt: skip


def prove(question, scalar=None, caps=None, slices=3, limit=3000, eager=True):
    """A certificate by plain case distinction: contacts, actuators, then ever narrower sectors. None if it fails.

    eager: a case is proved as soon as it can be; otherwise when every contact is open, sticks, or slides.
    """
    m, a = question.grasp.m, question.grasp.mechanism.a
    root = empty(question, scalar, caps=caps)
    claim = known(root)
    nodes, leaves, proofs = [(-1, 0, 0, 0, 0)], [], []
    waiting = [(0, [(0, 0, 0)] * (m + a))]
    while waiting:
        node, case = waiting.pop()
        names = rows_of(question, claim, case)
        decided = eager or not any(state in (UNDECIDED, CLOSED) for state, *_ in case[:m])
        margin, y = multipliers(root, claim, names) if decided else (0.0, None)
        if margin > 1e-5:
            keep = [i for i in range(len(y)) if y[i] > (1e-13 if caps else 1e-10) * y.max()]
            leaves.append(node)
            proofs.append(([names[i] for i in keep], y[keep]))
            continue
        part, states = split(question, case, slices)
        if part is None or len(nodes) > limit:
            return None
        for state in states:
            waiting.append((len(nodes), [*case[:part], state, *case[part + 1 :]]))
            nodes.append((node, part, *state))
    names = np.array([name for rows, _ in proofs for name in rows], dtype=np.int64).reshape(-1, 4)
    start = np.cumsum([0, *(len(rows) for rows, _ in proofs)])
    tree = np.array(nodes, dtype=np.int64).T
    y = np.concatenate([y for _, y in proofs])
    return Certificate(question, scalar, *tree, np.array(leaves), start, *names.T, y, (), *(caps or ()))


def split(question, case, slices):
    """(part, new states) of the next case distinction; (None, []) if there is none left."""
    m, width = question.grasp.m, TURN // 1000
    chosen = None
    for i, (state, l, r) in enumerate(case):
        if i >= m and state == FREE and question.may_move[i - m]:
            return i, [(LOCKED, 0, 0), (MOVES, 0, 0)]
        if i >= m or not (question.mdp or state == UNDECIDED):
            continue
        if state == UNDECIDED:
            return i, [(OPEN, 0, 0), (CLOSED, 0, 0)]
        if state == CLOSED or (state == OPEN and question.eta and l == r):
            return i, ([(STICK, 0, 0)] if state == CLOSED else []) + [
                (SLIDE if state == CLOSED else OPEN, u, w)
                for u, w in pairwise(k * TURN // slices for k in range(slices + 1))
            ]
        if r - l > width:
            chosen, width = i, r - l
    if chosen is None:
        return None, []
    state, l, r = case[chosen]
    return chosen, [(state, l, (l + r) // 2), (state, (l + r) // 2, r)]


# --- questions with a proof ---------------------------------------------------------------------

PUSH_X, PULL_Y, PULL_Z = np.eye(6)[:3]
CAPS = np.array([50.0] * 3 + [2000.0] * 3)  # far more than the pinch's 1 N moves its object


def turned(grasp: Grasp) -> Grasp:
    """The same grasp with joints counted the other way: commands are negative."""
    joints = [GraspJoint(j.name, -j.axis, j.origin, j.moves, j.type) for j in grasp.joints]
    return Grasp(grasp.contacts, joints, preload=-grasp.command)


def coupled(grasp: Grasp) -> Grasp:
    """One motor for both fingers, coupled rigidly: half of its 0.2 N m each."""
    mechanism = Mechanism(("motor",), np.array([[1.0, 0.0]]), np.array([[1.0, -1.0]]), (False,))
    return Grasp(grasp.contacts, grasp.joints, mechanism, preload={"motor": 0.2})


def slack(grasp: Grasp) -> Grasp:
    """Driven by tendons that are not pulled."""
    return Grasp(grasp.contacts, grasp.joints, Mechanism(("a", "b"), np.eye(2), np.zeros((0, 2)), (True, True)))


BOTH = ("left", "right")
CASES = {  # question, range of the scalar; the pinch resists 1 N, the nest with mu > sqrt(3) only without (6)
    "check": (Question(pinch(), wrench=1.1 * PULL_Y), None),
    "smallest preload": (Question(pinch(), SMALLEST_PRELOAD, direction=PULL_Y), (0.0, 0.95)),
    "largest": (Question(pinch(), LARGEST, 0.2 * PULL_Y, direction=PULL_Y), (0.85, 3.0)),
    "max": (Question(pinch(), SMALLEST_LARGEST_COMMAND, PULL_Y, driven=BOTH), (0.0, 0.095)),
    "sum": (Question(pinch(), SMALLEST_SUM_OF_COMMANDS, PULL_Y, driven=BOTH), (0.0, 0.095)),
    "max of turned": (Question(turned(pinch()), SMALLEST_LARGEST_COMMAND, PULL_Y, driven=BOTH), (0.0, 0.095)),
    "eta": (Question(pinch(), wrench=1.1 * PULL_Y, eta=0.05), None),
    "no dissipation": (Question(pinch(), wrench=1.1 * PULL_Y, mdp=False), None),
    "turned": (Question(turned(pinch()), wrench=1.1 * PULL_Y), None),
    "coupled": (Question(coupled(pinch()), wrench=1.1 * PULL_Y), None),
    "tendons": (Question(slack(pinch()), wrench=0.3 * PULL_Y), None),
    "torque limit": (Question(pinch(), wrench=0.3 * PUSH_X, torque_limits={"right": 0.12}), None),  # 0.13 needed
    "nest": (Question(nest(2.0), wrench=PULL_Z), None),
    "nest with eta": (Question(nest(2.0), wrench=PULL_Z, eta=0.02), None),
    "force limit": (Question(nest(), wrench=-10 * PULL_Z, force_limit=1.0), None),
}


@cache
def proof(name):
    """The proof of a case, about all motions."""
    return _proof(name, None)


@cache
def capped_proof(name):
    """The proof of a case of version 1, about motions inside caps."""
    return _proof(name, (CAPS, np.full(CASES[name][0].grasp.l, 100.0)))


def _proof(name, caps):
    question, scalar = CASES[name]
    found = prove(question, scalar, caps)
    assert found is not None
    return found
