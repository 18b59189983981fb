"""The checker of certificates: proofs pass in every arithmetic, planted faults are named."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.stability.certify import verify
from handfast.stability.certify.certificate import HALF, TURN, Question, Row
from handfast.stability.certify.claim import Claim, equality_multipliers, leaf_margins, weighed_rows
from tests.support.certificates import (
    CAPS,
    CASES,
    CLOSED,
    LOCKED,
    MOVES,
    OPEN,
    PULL_Y,
    PULL_Z,
    SLIDE,
    STICK,
    UNIT_LENGTHS,
    capped_proof,
    empty,
    proof,
    prove,
    row,
    turned,
)
from tests.support.problems import pinch, table

HUNDRED = CAPS, np.full(2, 100.0)  # caps of questions with two joints


@pytest.fixture(params=[proof, capped_proof], ids=["all motions", "capped"])
def proof_of(request):
    """The proofs of the cases, in both versions."""
    return request.param


def refused(certificate, match):
    answer = verify.verify(certificate)
    assert not answer.ok
    assert "\n" not in answer.reason
    assert re.search(match, answer.reason), answer.reason


@pytest.mark.parametrize("name", CASES)
def test_proofs_are_accepted(name: str, proof_of) -> None:
    answer = verify.verify(proof_of(name))
    assert answer.ok, answer.reason
    assert answer.reason == ""
    assert answer.leaves == len(proof_of(name).leaves)
    assert answer.margin > 1e-6


def test_bounds_of_friction() -> None:
    """|c_t| <= mu c_n, also where mu is more than 1."""
    claim = Claim.of(capped_proof("nest"))
    c = claim.hi[claim.columns.c].reshape(-1, 3)
    assert (c[:, 1:] >= 2 * c[:, :1]).all()
    assert (claim.lo[claim.columns.c].reshape(-1, 3) == -c * [0, 1, 1]).all()


def test_energy_bounds_normal_forces() -> None:
    """Every c_n^2 <= w . r + f_c . t, below |d_n|: 2 x 0.1 N m x 1000 for the pinch, 4 N x 100 for the table."""
    fingers, press = (np.zeros(6), np.full(2, 1e3)), (100 * np.eye(6)[2], np.zeros(0))
    for question, scalar, caps, work in (
        (Question(pinch()), None, fingers, 200.0),
        (Question(turned(pinch())), None, fingers, 200.0),
        (Question(pinch(), "smallest preload", direction=PULL_Y), (0.0, 1.0), fingers, 200.0),
        (Question(pinch(), "torques", PULL_Y, driven=("left", "right")), (0.0, 0.1), fingers, 200.0),
        (Question(table(), wrench=-4 * PULL_Z), None, press, 400.0),
        (Question(table(), "largest", -2 * PULL_Z, direction=-PULL_Z), (-1.0, 2.0), press, 400.0),
    ):
        claim = Claim.of(empty(question, scalar, caps=caps))
        np.testing.assert_allclose(claim.hi[claim.columns.c][0::3], np.sqrt(work), rtol=1e-9)
    # friction that need not oppose the motion can feed energy in: |d_n| alone bounds then
    claim = Claim.of(empty(Question(table(), mdp=False), caps=press))
    np.testing.assert_allclose(claim.hi[claim.columns.c][0::3], 100.0)


def test_the_balance_of_energy_is_a_proof() -> None:
    """4 N on four contacts store at least 4 (1 N)^2: their weight has to sink by 1 N, no less."""
    question, sink = Question(table(), wrench=-4 * PULL_Z), np.array([100.0, 100.0, 1.0, 1e4, 1e4, 1e4])

    def root(cap, references=((1.0, 1.0, 1.0, 1.0, 0.0),), question=question):
        caps = sink * [1, 1, cap, 1, 1, 1], np.zeros(0)
        return empty(question, None, [(Row.ENERGY, 0, 0, 0)], [2.0], references, caps)

    c = root(0.99)
    assert verify.verify(c).ok
    assert 0 < leaf_margins(c, Claim.of(c))[0] <= exact_margins(c)[0]
    refused(root(1.01), "is not proved")
    refused(replace(c, multiplier=np.zeros(1)), "is not proved")
    for x in (0.5, 1.5):  # tangents elsewhere are weaker
        refused(root(0.99, ((x, x, x, x, 0.0),)), "is not proved")
    refused(root(0.99, question=replace(question, mdp=False)), "ENERGY 0 .*does not hold")


def test_where_the_balance_of_energy_holds(proof_of) -> None:
    """With commands of at least the largest scalar, without a disturbance that grows, for commands that are known."""
    reference = np.array([[1.0, 1.0, 0.95]])
    for name in ("check", "smallest preload", "turned", "coupled", "tendons", "torque limit", "eta"):
        c = replace(proof_of(name), references=reference)
        assert verify.verify(with_row(c, 0, (Row.ENERGY, 0, 0, 0))).ok, name
    for name in ("largest", "max", "sum", "no dissipation"):
        c = replace(proof_of(name), references=reference)
        refused(with_row(c, 0, (Row.ENERGY, 0, 0, 0)), "ENERGY 0 .*does not hold in this case")
    c = replace(proof_of("smallest preload"), references=reference - [0, 0, 1e-9])
    refused(with_row(c, 0, (Row.ENERGY, 0, 0, 0)), "ENERGY 0 .*does not hold in this case")
    refused(with_row(c, 0, (Row.ENERGY, 1, 0, 0)), "no such contact, actuator, column or reference")


# --- exact arithmetic, version 1 ----------------------------------------------------------------


def exact_margins(certificate):
    """The relative margins with the checker's v, in rational numbers and with directions of exact length."""
    c, claim = certificate, Claim.of(certificate)
    n = claim.columns.n
    S = weighed_rows(c, claim)[0]
    v = equality_multipliers(S[:, :n] + S[:, n:] @ claim.Z, claim)
    lo, hi, h = ([Fraction(t) for t in u.tolist()] for u in (claim.lo, claim.hi, claim.h))
    E, Z = ([{k: Fraction(t) for k, t in enumerate(u) if t} for u in M.tolist()] for M in (claim.E, claim.Z))
    margins = []
    for leaf in range(len(c.leaves)):
        rho, gap, involved = [Fraction(0)] * n, Fraction(0), Fraction(0)

        def add(k, value, rho=rho):
            if k < n:
                rho[k] += value
            else:
                for j, z in Z[k - n].items():
                    rho[j] += value * z

        for r in range(c.start[leaf], c.start[leaf + 1]):
            y = Fraction(float(c.multiplier[r]))
            entries, b = row(c, claim, *(int(u[r]) for u in (c.kind, c.index, c.a, c.b)), UNIT_LENGTHS)
            for k, value in entries.items():
                add(k, y * Fraction(value))
            gap += y * Fraction(b)
            involved += abs(y * Fraction(b))
        for i, vi in enumerate(Fraction(float(t)) for t in v[leaf]):
            for k, value in E[i].items():
                add(k, vi * value)
            gap += vi * h[i]
            involved += abs(vi * h[i])
        gap -= sum(max(x * l, x * u) for x, l, u in zip(rho, lo, hi, strict=True))
        involved += sum(abs(x) * max(abs(l), abs(u)) for x, l, u in zip(rho, lo, hi, strict=True))
        margins.append(gap / involved)
    return margins


@pytest.mark.parametrize("name", CASES)
def test_rounding_never_flatters(name: str) -> None:
    c = capped_proof(name)
    for found, exact in zip(leaf_margins(c, Claim.of(c)), exact_margins(c), strict=True):
        assert 0 < found <= exact
        assert exact - Fraction(found) < 1e-6


@pytest.mark.parametrize("name", ["smallest preload", "max", "sum", "max of turned"])
def test_where_the_proof_ends(name: str) -> None:
    """The largest range that the multipliers still prove: exact arithmetic agrees on this side and just beyond."""
    c = capped_proof(name)
    good, bad = c.scalar[1], 2 * c.scalar[1]
    for _ in range(60):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if verify.verify(replace(c, scalar=(0.0, middle))).ok else (good, middle)
    assert min(exact_margins(replace(c, scalar=(0.0, good)))) >= 0
    assert min(exact_margins(replace(c, scalar=(0.0, good * (1 + 1e-6))))) < 0


# --- planted faults -----------------------------------------------------------------------------


def put(array, i, value):
    out = array.copy()
    out[i] = value
    return out


def without_leaf(c, i, node_too=False):
    """The certificate without its leaf i, and without the node of it."""
    keep = np.repeat(np.arange(len(c.leaves)), np.diff(c.start)) != i
    rows = {k: getattr(c, k)[keep] for k in ("kind", "index", "a", "b", "multiplier")}
    start = np.concatenate([[0], np.cumsum(np.delete(np.diff(c.start), i))])
    leaves, node = np.delete(c.leaves, i), c.leaves[i]
    if not node_too:
        return replace(c, leaves=leaves, start=start, **rows)
    tree = {k: np.delete(getattr(c, k), node) for k in ("part", "state", "left", "right")}
    parent = np.delete(c.parent, node)
    parent, leaves = parent - (parent > node), leaves - (leaves > node)
    return replace(c, leaves=leaves, start=start, parent=parent, **tree, **rows)


def with_row(c, leaf, name, y=1e-9):
    """The certificate with one row more in a leaf."""
    at = c.start[leaf]
    rows = {k: np.insert(getattr(c, k), at, v) for k, v in zip(("kind", "index", "a", "b"), name, strict=True)}
    start = c.start + (np.arange(len(c.start)) > leaf)
    return replace(c, start=start, multiplier=np.insert(c.multiplier, at, y), **rows)


def leaf_where(c, part, state):
    """(leaf, left, right) of the first leaf with a part in a state."""
    cases = verify.leaf_cases(c)
    leaf = int(np.flatnonzero(cases[:, part, 0] == state)[0])
    return leaf, *cases[leaf, part, 1:].tolist()


@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf])
def test_wrong_multipliers(value: float, proof_of) -> None:
    c = proof_of("check")
    refused(replace(c, multiplier=put(c.multiplier, 30, value)), r"^leaf \d+ .*row \d+, .*: the multiplier is negative")


def test_multipliers_matter() -> None:
    """One per cent more of what a moving motor gives, and 0.2 % over the limit is not proved; exactly so."""
    c = prove(Question(pinch(), wrench=1.002 * PULL_Y), caps=HUNDRED)
    for r in np.flatnonzero(c.kind == Row.E_DOWN):
        refused(replace(c, multiplier=put(c.multiplier, r, 1.01 * c.multiplier[r])), r"^leaf \d+ .* is not proved")
    for r in range(0, len(c.kind), 10):
        other = replace(c, multiplier=put(c.multiplier, r, 1.01 * c.multiplier[r]))
        assert verify.verify(other).ok == (min(exact_margins(other)) > 0)


def test_leaves_and_nodes_left_out(proof_of) -> None:
    c = proof_of("nest")
    for i in range(len(c.leaves)):
        refused(without_leaf(c, i), rf"^node {c.leaves[i]} is neither split nor a leaf")
        refused(without_leaf(c, i, node_too=True), r"needs OPEN and CLOSED|needs STICK|leave a gap|are not")
    refused(replace(c, leaves=put(c.leaves, 0, c.leaves[1])), "neither split nor a leaf")
    refused(replace(c, leaves=put(c.leaves, 0, 0)), "neither split nor a leaf")
    refused(replace(c, parent=put(c.parent, 1, 2)), "^node 1 has parent 2")
    refused(replace(c, parent=put(c.parent, 1, -1)), "^node 1 has parent -1")
    refused(replace(c, part=put(c.part, 1, 9)), "^node 1 changes part 9; there are 3")
    refused(replace(c, part=put(c.part, 1, 1)), "several parts at once")
    c = proof_of("check")
    moves = np.flatnonzero((c.part >= 2) & (c.state == MOVES))[0]
    refused(replace(c, state=put(c.state, moves, LOCKED)), "split of actuator 0: needs LOCKED and MOVES")
    refused(replace(c, state=put(c.state, moves, 99)), "split of actuator 0: needs LOCKED and MOVES")


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("step", [-1, 1])
def test_sectors_moved(side: str, step: int, proof_of) -> None:
    c = proof_of("nest")
    for node in np.flatnonzero(c.state == SLIDE):
        moved = put(getattr(c, side), node, getattr(c, side)[node] + step)
        refused(replace(c, **{side: moved}), r"gap|overlap|not a full turn|are not \[|is no sector")


def test_splits() -> None:
    def fault(old, new, name="nest with eta", part=0):
        return verify._split_fault(CASES[name][0], part, list(old), [(k, a, b) for k, a, b in new])

    third, none = TURN // 3, (0, 0)
    ring = [(SLIDE, 0, third), (SLIDE, third, 2 * third), (SLIDE, 2 * third, TURN)]
    opened = [(OPEN, a, b) for _, a, b in ring]
    assert not fault((CLOSED, *none), [*ring, (STICK, *none)])
    assert not fault((CLOSED, *none), [(STICK, *none), *((k, a + 99, b + 99) for k, a, b in ring)])
    assert not fault((OPEN, *none), opened)
    assert not fault((OPEN, 5, 9), [(OPEN, 7, 9), (OPEN, 5, 7)])
    assert not fault((SLIDE, TURN - 5, TURN + 9), [(SLIDE, TURN - 5, TURN + 1), (SLIDE, TURN + 1, TURN + 9)])
    assert "needs STICK" in fault((CLOSED, *none), ring)
    assert "needs STICK" in fault((CLOSED, *none), [*ring, (STICK, *none), (STICK, *none)])
    assert "needs sectors" in fault((CLOSED, *none), [(STICK, *none)])
    assert "no sector" in fault((CLOSED, *none), [(STICK, *none), (SLIDE, 0, HALF), (SLIDE, HALF, TURN)])
    assert "no sector" in fault((CLOSED, *none), [*opened, (STICK, *none)])
    assert "no sector" in fault((SLIDE, 5, 9), [(SLIDE, 5, 9), (SLIDE, 9, 9)])
    assert "overlap" in fault((SLIDE, 5, 9), [(SLIDE, 5, 8), (SLIDE, 7, 9)])
    assert "are not [5, 9]" in fault((SLIDE, 5, 9), [(SLIDE, 5, 8)])
    assert "decided" in fault((OPEN, *none), opened, name="nest")
    assert "decided" in fault((STICK, *none), ring)
    assert "decided" in fault((CLOSED, *none), [*ring, (STICK, *none)], name="no dissipation")
    assert "decided" in fault((LOCKED, *none), [(LOCKED, *none), (MOVES, *none)], name="check", part=2)


@pytest.mark.parametrize(
    "name, part, state, wrong",
    [
        ("nest", 0, SLIDE, lambda l, r: (Row.CHORD, 0, l + 1, r)),
        ("nest", 0, SLIDE, lambda l, r: (Row.CHORD, 0, l, r - 1)),
        ("nest", 0, SLIDE, lambda l, r: (Row.CHORD, 0, l, l + HALF)),
        ("nest", 0, SLIDE, lambda l, r: (Row.C_LEFT, 0, l + 1, 0)),
        ("nest", 0, SLIDE, lambda l, r: (Row.C_LEFT, 0, r - HALF - 1, 0)),
        ("nest", 0, SLIDE, lambda l, r: (Row.C_RIGHT, 0, 0, r - 1)),
        ("nest", 0, SLIDE, lambda l, r: (Row.D_LEFT, 0, l + 1, 0)),
        ("nest", 0, SLIDE, lambda l, r: (Row.D_RIGHT, 0, 0, l + HALF + 1)),
        ("nest", 0, SLIDE, lambda l, r: (Row.STILL_1_UP, 0, 0, 0)),
        ("nest with eta", 0, SLIDE, lambda l, r: (Row.GAP_UP, 0, l + 1, r)),
        ("nest with eta", 0, OPEN, lambda l, r: (Row.DN_UP, 0, 0, 100)),
        ("nest with eta", 0, OPEN, lambda l, r: (Row.GAP_UP, 0, 0, 100)),
        ("nest", 0, STICK, lambda l, r: (Row.CN_DOWN, 0, 0, 0)),
        ("nest", 0, STICK, lambda l, r: (Row.CHORD, 0, 0, 100)),
        ("nest", 0, STICK, lambda l, r: (Row.DN_UP, 0, 0, 0)),
        ("nest", 0, OPEN, lambda l, r: (Row.GAP_DOWN, 0, 0, 0)),
        ("check", 2, LOCKED, lambda l, r: (Row.E_DOWN, 0, 0, 0)),
        ("check", 2, MOVES, lambda l, r: (Row.T_DOWN, 0, 0, 0)),
        ("check", 2, MOVES, lambda l, r: (Row.S_UP, 0, 0, 0)),
        ("max", 2, LOCKED, lambda l, r: (Row.E_UP, 0, 0, 0)),
        ("max", 2, LOCKED, lambda l, r: (Row.S_UP, 0, 0, 0)),
        ("max", 2, MOVES, lambda l, r: (Row.E_DOWN, 0, 0, 0)),
    ],
)
def test_rows_that_need_not_hold(name: str, part: int, state: int, wrong, proof_of) -> None:
    c = proof_of(name)
    leaf, left, right = leaf_where(c, part, state)
    kind, index, a, b = wrong(left, right)
    refused(with_row(c, leaf, (kind, index, a, b)), rf"^leaf {leaf} .*{kind.name} {index} .*does not hold in this case")


def test_rows_that_hold_in_a_wider_sector_too(proof_of) -> None:
    c = proof_of("nest")
    leaf, left, right = leaf_where(c, 0, SLIDE)
    for turns in (-TURN, 0, TURN):
        assert verify.verify(with_row(c, leaf, (Row.CHORD, 0, left - 5 + turns, right + 5 + turns))).ok
        assert verify.verify(with_row(c, leaf, (Row.C_LEFT, 0, right - HALF + turns, 0))).ok


def test_rows_that_are_none(proof_of) -> None:
    c = proof_of("check")
    refused(with_row(c, 0, (23, 0, 0, 0)), "no such kind")
    refused(with_row(c, 0, (Row.ENERGY, 0, 0, 0)), "no such contact, actuator, column or reference")
    refused(with_row(c, 0, (Row.CN_UP, 2, 0, 0)), "no such contact")
    refused(with_row(c, 0, (Row.T_UP, -1, 0, 0)), "no such contact, actuator")
    refused(with_row(c, 0, (Row.BOUND_UP, 99, 0, 0)), "no such contact, actuator, column or reference")


@pytest.mark.parametrize(
    "name, change",
    [
        ("smallest preload", {"scalar": (0.0, 1.05)}),
        ("largest", {"scalar": (0.75, 3.0)}),
        ("max", {"scalar": (0.0, 0.105)}),
        ("sum", {"scalar": (0.0, 0.105)}),
    ],
)
def test_ranges_wider_than_proved(name: str, change: dict, proof_of) -> None:
    refused(replace(proof_of(name), **change), "is not proved")


def test_caps_wider_than_proved() -> None:
    """The pinch resists 0.5 N, but not while its fingers close by less than their springs need."""
    small = np.full(2, 5.0)
    c = prove(Question(pinch(), wrench=0.5 * PULL_Y), caps=(CAPS, small))
    assert verify.verify(c).ok
    refused(replace(c, cap_q=4 * small), "is not proved")


@pytest.mark.parametrize("size", [1e-150, 1e300])
def test_absurd_numbers(size: float, proof_of) -> None:
    """Multipliers may have any scale until they vanish."""
    c = proof_of("check")
    assert verify.verify(replace(c, multiplier=size * c.multiplier)).ok
    refused(replace(c, multiplier=0.0 * c.multiplier), "is not proved")


def test_absurd_caps() -> None:
    """Caps that overflow prove nothing."""
    c = capped_proof("check")
    refused(replace(c, cap_r=np.full(6, 1e300)), "is not proved")
    refused(replace(c, cap_r=np.full(6, 1e308)), "does not hold|is not proved")


def test_other_questions(proof_of) -> None:
    c = proof_of("check")
    q = c.question
    refused(replace(c, question=replace(q, grasp=q.grasp.with_friction(0.6))), "is not proved")
    refused(replace(c, question=replace(q, grasp=q.grasp.with_preload({"left": 0.2, "right": 0.2}))), "is not proved")
    refused(replace(c, question=replace(q, wrench=0.9 * PULL_Y)), "is not proved")
    c = proof_of("torque limit")
    refused(replace(c, question=replace(c.question, torque_limits={"right": 0.14})), "is not proved")
    refused(replace(c, question=replace(c.question, torque_limits={})), "is not proved|BOUND_DOWN .*does not hold")
    c = proof_of("nest")  # without (6) friction may push along: nothing but the split itself can be wrong
    refused(replace(c, question=replace(c.question, mdp=False)), "decided already")


def test_forces_without_bound() -> None:
    """Two motors on one joint: what one carries more the other carries less. Limits make a proof possible."""
    g = pinch()
    two = Mechanism(("a", "b", "c"), np.array([[1.0, 0], [1, 0], [0, 1]]), np.zeros((0, 2)), (False,) * 3)
    g = Grasp(g.contacts, g.joints, two, preload={"c": 0.1})
    free, limited = Question(g, wrench=5 * PULL_Y), Question(g, wrench=5 * PULL_Y, torque_limits={"a": 9.0, "b": 9.0})
    refused(empty(free, caps=HUNDRED), "nothing bounds the force of a, b, c")
    force = Claim.of(empty(free, caps=HUNDRED)).columns.f.start

    def cites(row):
        return empty(free, names=[row], y=[1.0], caps=HUNDRED)

    refused(cites((Row.BOUND_UP, 0, 0, 0)), "is not proved")
    refused(cites((Row.BOUND_UP, force, 0, 0)), "does not hold")
    refused(cites((Row.E_UP, 2, 0, 0)), "is not proved: margin -inf")
    assert np.isfinite(Claim.of(empty(limited, caps=HUNDRED)).reach).all()
    assert verify.verify(prove(limited, caps=HUNDRED)).ok
    for question in (free, limited):  # without a cap neither needs a limit: what two motors share cancels
        assert verify.verify(prove(question)).ok
