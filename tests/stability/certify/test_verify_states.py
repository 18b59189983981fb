"""The checker of certificates against true states: what it accepts holds in them, and none is ever denied."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.model.grasp import Grasp, GraspJoint
from handfast.stability import model
from handfast.stability.certify import checker, farkas
from handfast.stability.certify.certificate import HALF, TURN, Question, Row
from handfast.stability.certify.claim import Claim, leaf_margins
from handfast.stability.goal import WORDS, named
from tests.support.certificates import (
    CLOSED,
    FREE,
    LOCKED,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    UNDECIDED,
    dense,
    empty,
    known,
    multipliers,
    row,
)
from tests.support.problems import solved

STEADY = settings(max_examples=60, deadline=None, derandomize=True)
SEEDS = st.integers(0, 10_000)


def around(angle, width, rng):
    """A random sector (left, right) with a direction [rad] inside."""
    k = int(np.floor(angle / (2 * np.pi) * TURN)) % TURN
    left = k - int(rng.integers(1, max(2, width)))
    return left, min(k + 2 + int(rng.integers(0, max(1, width))), left + HALF - 1)


def planted(seed, goal, capped):
    """(certificate of a root, x, case): a question, a true state of it as x, and the case that the state is in."""
    rng = np.random.default_rng(seed)
    m, eta = int(rng.integers(2, 5)), float(rng.choice([0.0, 0.05, 0.3]))
    s = solved(seed, m, eta, stick=bool(rng.integers(2)))
    grasp, r, q, f = s.grasp, s.state.r, s.state.q, s.state.f
    if rng.integers(2):
        joints = [GraspJoint(j.name, -j.axis, j.origin, j.moves) for j in grasp.joints]
        grasp, q, f = Grasp(grasp.contacts, joints, preload=-grasp.command), -q, -f
    if goal == "torques" and not grasp.preload:
        goal = "check"
    d = model.relative_motion(grasp, r, q).reshape(-1, 3)
    moves = np.abs(q) > 0
    scalar, objective, efforts = [2.0], "max", []
    if goal == "check":
        question, scalar = Question(grasp, wrench=s.wrench, eta=eta), []
    elif goal == "smallest preload":
        question = Question(grasp.with_preload(grasp.command / 2), named(goal), direction=s.wrench, eta=eta)
    elif goal == "largest":
        direction = rng.normal(size=6)
        question = Question(grasp, named(goal), s.wrench - 2 * direction, direction, eta)
    else:
        objective = str(rng.choice(["max", "sum"]))
        used = np.where(moves, np.abs(f), 0.0)
        scalar, efforts = ([used.max()], []) if objective == "max" else ([used.sum()], used)
        driven = tuple(grasp.preload)
        question = Question(grasp, named(goal, objective), s.wrench, eta=eta, driven=driven)
    x = np.concatenate([r, q, s.state.c, question.sense * f, scalar, efforts])
    ends = (0.0, 1.5 * scalar[0]) if scalar else None
    references = np.column_stack([s.state.c[0::3] * rng.uniform(0, 2, (3, m)), [2.9, 3.0, 4.0]])
    caps = (1.5 * np.abs(r), 1.5 * np.abs(q)) if capped else None
    certificate = empty(question, ends, references=references, caps=caps)

    case = []
    for di, ci in zip(d, s.state.c.reshape(-1, 3), strict=True):
        sector = around(np.arctan2(-di[2], -di[1]), TURN // int(rng.choice([3, 20, 1000])), rng)
        still = np.linalg.norm(di[1:]) < 1e-9
        if rng.random() < 0.1:
            case.append((UNDECIDED, 0, 0))
        elif ci[0] == 0:
            case.append((OPEN, *(sector if eta and not still else (0, 0))))
        elif rng.random() < 0.1:
            case.append((CLOSED, 0, 0))
        else:
            case.append((STICK, 0, 0) if still else (SLIDE, *sector))
    for may, moving in zip(question.may_move, moves, strict=True):
        case.append(((MOVES if moving else LOCKED) if may and rng.random() < 0.9 else FREE, 0, 0))
    return certificate, x, case, rng


def like(c, names, y):
    """A root with the same claim and other rows."""
    return empty(c.question, c.scalar, names, y, c.references, (c.cap_r, c.cap_q) if c.capped else None)


def legal_rows(certificate, claim, case, rng):
    """Random names of rows that the checker accepts in a case, directions near the sectors' ends."""
    q, names = certificate.question, []
    for kind in (kind for kind in Row if kind <= Row.ENERGY):
        count = claim.columns.n if kind >= Row.BOUND_UP else q.grasp.mechanism.a if kind >= Row.T_UP else q.grasp.m
        count = len(certificate.references) if kind is Row.ENERGY else count
        for i in range(count):
            l, r = case[i][1:] if kind < Row.T_UP else (0, 0)
            for width in (1, 1000, TURN // 10, TURN // 3) if kind < Row.T_UP else (1,):
                a, b = (int(e + rng.integers(-width, width + 1)) for e in (l, r))
                names += [(kind, i, a, b), (kind, i, l - abs(l - a), r + abs(r - b))]
    tried = like(certificate, names, np.ones(len(names)))
    good = checker.legal(tried, np.repeat([case], len(names), axis=0), claim.lo, claim.hi)
    return [name for name, ok in zip(names, good, strict=True) if ok]


@STEADY
@given(SEEDS, st.sampled_from(WORDS), st.booleans())
def test_rows_bounds_and_equalities_hold_in_true_states(seed: int, goal: str, capped: bool) -> None:
    certificate, x, case, rng = planted(seed, goal, capped)
    claim = known(certificate)
    scale = 1 + np.abs(x).max()
    assert (claim.lo - 1e-12 * scale <= x).all()
    assert (x <= claim.hi + 1e-12 * scale).all()
    np.testing.assert_allclose(claim.E @ x, claim.h, atol=1e-10 * scale)
    names = legal_rows(certificate, claim, case, rng)
    assert len(names) > 20
    for name in names:
        entries, b = row(certificate, claim, *name)
        a = dense(claim, entries)
        assert a @ x - b >= -1e-9 * scale * max(1.0, np.abs(a).max()), Row(name[0]).name


@STEADY
@given(SEEDS, st.sampled_from(WORDS), st.booleans(), st.booleans())
def test_no_true_state_is_denied(seed: int, goal: str, best: bool, capped: bool) -> None:
    """Neither random multipliers nor the best there are prove the case empty that a true state is in."""
    certificate, _, case, rng = planted(seed, goal, capped)
    claim = known(certificate)
    names = legal_rows(certificate, claim, case, rng)
    y = multipliers(certificate, claim, names)[1] if best else rng.exponential(size=len(names)) ** 3
    full = like(certificate, names, np.abs(y))
    with np.errstate(all="ignore"):
        margins = leaf_margins(full, Claim.of(full)) if capped else farkas.proved_margins(full, np.array([case]))
    assert not (margins > 0).any()
    undecided = legal_rows(certificate, claim, [(0, 0, 0)] * len(case), rng)
    y = rng.exponential(size=len(undecided)) ** 3
    root = like(full, undecided, y)
    answer = checker.verify(root)
    assert not answer.ok
    assert answer.reason.startswith("leaf 0 (node 0) is not proved")


@pytest.mark.parametrize("capped", [False, True])
def test_every_kind_of_row_was_tried(capped: bool) -> None:
    seen = set()
    for seed in range(40):
        certificate, _, case, rng = planted(seed, WORDS[seed % 4], capped)
        seen |= {name[0] for name in legal_rows(certificate, known(certificate), case, rng)}
    assert seen == {kind for kind in Row if kind <= Row.ENERGY}  # soft fingers: test_soft_rows.py
