"""The checker of certificates: no planted fault passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import HALF, TURN, Question, Row, directions
from handfast.stability.certify.claim import Claim
from handfast.stability.search import cases
from tests.support.altered_certificates import exact_margins, leaf_where, put, refused, with_row, without_leaf
from tests.support.certificates import (
    CAPS,
    CASES,
    CLOSED,
    LOCKED,
    MOVES,
    OPEN,
    PULL_Y,
    SLIDE,
    STICK,
    UNDECIDED,
    capped_proof,
    empty,
    prove,
)
from tests.support.problems import pinch

HUNDRED = CAPS, np.full(2, 100.0)  # caps of questions with two joints


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
        assert checker.verify(other).ok == (min(exact_margins(other)) > 0)


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
        return checker._split_fault(CASES[name][0], part, list(old), [(k, a, b) for k, a, b in new])

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
    halves = [(CLOSED, 9, 9 + HALF), (CLOSED, 9 + HALF, 9 + TURN)]
    assert not fault((CLOSED, *none), halves)
    assert not fault((CLOSED, 5, 5 + HALF), [(CLOSED, 5, 9), (CLOSED, 9, 5 + HALF)])
    assert not fault((CLOSED, 5, 9), [(STICK, 5, 9), (SLIDE, 5, 7), (SLIDE, 7, 9)])
    assert not fault((CLOSED, 5, 9), [(STICK, *none), (SLIDE, 5, 9)])
    assert "gap between 8 and 9" in fault((CLOSED, 5, 12), [(CLOSED, 5, 8), (CLOSED, 9, 12)])
    assert "not a full turn" in fault((CLOSED, *none), halves[:1])
    assert "not a full turn" in fault((CLOSED, *none), [halves[0], (CLOSED, 9 + HALF, 8 + TURN)])
    assert "no sector" in fault((CLOSED, *none), [(CLOSED, 0, HALF + 1), (CLOSED, HALF + 1, TURN)])
    assert "are not [5, 9]" in fault((CLOSED, 5, 9), [(STICK, 5, 9), (SLIDE, 5, 8)])
    assert "needs STICK" in fault((CLOSED, 5, 9), [(STICK, 5, 8), (SLIDE, 5, 9)])
    assert "needs STICK" in fault((CLOSED, 5, 9), [(SLIDE, 5, 9)])
    assert "needs STICK" in fault((CLOSED, 5, 9), [(STICK, 5, 9), (STICK, 5, 9), (SLIDE, 5, 9)])
    assert "needs STICK" in fault((CLOSED, 5, 9), [(STICK, 5, 9), (CLOSED, *none), (SLIDE, 5, 9)])
    assert "no sector" in fault((CLOSED, 5, 9), [(STICK, 5, 9), (CLOSED, 5, 7), (SLIDE, 7, 9)])
    assert "no sector" in fault((SLIDE, 5, 9), [(CLOSED, 5, 7), (CLOSED, 7, 9)])
    assert "needs OPEN" in fault((UNDECIDED, *none), halves)
    assert "decided" in fault((STICK, 5, 9), [(STICK, 5, 7), (STICK, 7, 9)])
    assert "decided" in fault((CLOSED, *none), halves, name="no dissipation")
    assert "decided" in fault((OPEN, *none), opened, name="nest")
    assert "decided" in fault((STICK, *none), ring)
    assert "decided" in fault((CLOSED, *none), [*ring, (STICK, *none)], name="no dissipation")
    assert "decided" in fault((LOCKED, *none), [(LOCKED, *none), (MOVES, *none)], name="check", part=2)


def test_what_leaves_are_split_into_leaves_out_nothing() -> None:
    for old in ((CLOSED, 0, 0), (CLOSED, 5, 5 + HALF), (CLOSED, TURN - 5, TURN + 9), (SLIDE, 5, 900)):
        state = np.array([old[0], STICK, old[1], 0, old[2], 0])  # of two contacts
        part, children = cases.split(state, 2, True, False, np.zeros(2, bool))
        new = [tuple(child[[0, 2, 4]].tolist()) for child in children]
        assert part == 0
        assert not checker._split_fault(CASES["nest"][0], 0, list(old), new)


def test_no_state_is_in_neither_half() -> None:
    """Where a contact slides or sticks, the rows of one half turn hold, wherever the line is; not those of both."""
    ends = np.random.default_rng(3).integers(0, TURN, 1000)
    assert (directions(ends + HALF) == -directions(ends)).all()  # to the last bit: no wedge is left out
    rng = np.random.default_rng(4)
    for _ in range(200):
        friction = rng.normal(size=2)
        motion = -rng.random() * friction * rng.integers(2)  # -d_t along friction, or none
        held = []
        for left in np.array([0.0, np.pi]) + rng.uniform(0, 2 * np.pi):
            along = np.array([np.cos(left), np.sin(left)])  # of a half turn, both ends say the same
            held.append(all(along[0] * x[1] - along[1] * x[0] >= 0 for x in (friction, -motion)))
        assert sum(held) == 1


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
        assert checker.verify(with_row(c, leaf, (Row.CHORD, 0, left - 5 + turns, right + 5 + turns))).ok
        assert checker.verify(with_row(c, leaf, (Row.C_LEFT, 0, right - HALF + turns, 0))).ok


def test_rows_that_are_none(proof_of) -> None:
    c = proof_of("check")
    refused(with_row(c, 0, (29, 0, 0, 0)), "no such kind")
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
    assert checker.verify(c).ok
    refused(replace(c, cap_q=4 * small), "is not proved")


@pytest.mark.parametrize("size", [1e-150, 1e300])
def test_absurd_numbers(size: float, proof_of) -> None:
    """Multipliers may have any scale until they vanish."""
    c = proof_of("check")
    assert checker.verify(replace(c, multiplier=size * c.multiplier)).ok
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
    assert checker.verify(prove(limited, caps=HUNDRED)).ok
    for question in (free, limited):  # without a cap neither needs a limit: what two motors share cancels
        assert checker.verify(prove(question)).ok
