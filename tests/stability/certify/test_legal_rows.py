"""Which rows hold in which case, every kind in every state and at the ends of sectors; and what a verdict says."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import HALF, TURN, Certificate, Question, Row
from handfast.stability.certify.leaf_rows import bounds
from handfast.stability.goal import LARGEST, SMALLEST_PRELOAD
from tests.support.certificates import (
    CLOSED,
    FREE,
    LOCKED,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    UNDECIDED,
    capped_proof,
    empty,
    proof,
)
from tests.support.problems import pinch
from tests.support.rounding_edges import QUESTIONS, REFERENCES, D, W, hand

CHORDS = HALF - TURN // 128  # the widest sector whose chord says something
FORCES = {Row.CN_UP, Row.TANGENT}
SECTORS = [(0, 0), (100, 900), (TURN - 50, TURN + 70), (5, 5 + TURN // 3), (7, 7 + HALF)]


def holds(kind: Row, a: int, b: int, state: int, left: int, right: int, eta: float, capped: bool) -> bool:
    """Of a contact, by what the row says: see `Row`."""
    turns = (-2 * TURN, -TURN, 0, TURN, 2 * TURN)
    sector = left < right

    def within(begin: int, end: int) -> bool:
        return sector and any(begin <= left + t and right + t <= end for t in turns)

    narrow = within(a, b) and b - a < (HALF if capped else CHORDS)
    if kind in FORCES:
        return True
    if kind is Row.CN_DOWN:
        return state == OPEN
    if kind is Row.GAP_UP:  # c_n >= -d_n whatever the case is
        return eta == 0 or state == STICK or narrow
    if kind is Row.DN_UP:
        return state == OPEN and (eta == 0 or narrow)
    if kind is Row.GAP_DOWN:
        return state in (CLOSED, STICK, SLIDE)
    if kind is Row.CHORD:
        return state == SLIDE and narrow
    side = (a, a + HALF) if kind in (Row.C_LEFT, Row.D_LEFT) else (b - HALF, b)
    if kind in (Row.C_LEFT, Row.C_RIGHT):
        return state in (CLOSED, STICK, SLIDE) and within(*side)
    if kind in (Row.D_LEFT, Row.D_RIGHT):
        return state == STICK or within(*side)
    return state == STICK  # d_t = 0


@pytest.mark.parametrize("capped", [False, True])
@pytest.mark.parametrize("name", ["check", "turned"])
def test_rows_of_contacts(name: str, capped: bool) -> None:
    """One direction more or less than a sector's end, than half a turn, than the widest chord; turns added."""
    question, _ = QUESTIONS[name]
    names, cases, expected = [], [], []
    for (left, right), state, kind in product(SECTORS, (UNDECIDED, OPEN, CLOSED, STICK, SLIDE), Row):
        if kind >= Row.T_UP:
            continue
        pairs = [(left + i, right + j) for i, j in product((-1, 0, 1), repeat=2)]
        pairs += [(left + t, right + t) for t in (-TURN, TURN)]
        pairs += [(left, left + width + i) for width in (HALF, CHORDS) for i in (-1, 0)]
        pairs += [(right - HALF + i, left + HALF - i) for i in (-1, 0, 1)]
        for a, b in pairs:
            case = np.zeros((6, 3), dtype=np.int64)
            case[1] = state, left, right
            names.append((kind, 1, a, b))
            cases.append(case)
            expected.append(holds(kind, a, b, state, left, right, question.eta, capped))
    c = empty(question, None, names, np.ones(len(names)), caps=(np.ones(6), np.ones(3)) if capped else None)
    found = checker.legal(c, np.array(cases), *bounds(question, None))
    wrong = [(names[k], cases[k][1]) for k in np.flatnonzero(found != expected)]
    assert not wrong, wrong[:3]
    assert 0.2 < np.mean(expected) < 0.8


@pytest.mark.parametrize("name", ["check", "preload", "largest", "max", "sum"])
def test_rows_of_actuators(name: str) -> None:
    """t >= 0 always, and t = 0 where it is locked or cannot move; f as the command has it, or the limit sought."""
    question, scalar = QUESTIONS[name]
    for state, j, kind in product(
        (FREE, LOCKED, MOVES), range(3), (Row.T_UP, Row.T_DOWN, Row.E_UP, Row.E_DOWN, Row.S_UP)
    ):
        case = np.zeros((1, 6, 3), dtype=np.int64)
        case[0, 3 + j, 0] = state
        driven, may_move = bool(question.is_driven[j]), bool(question.may_move[j])
        commanded = may_move and not driven
        expected = {
            Row.T_UP: True,
            Row.T_DOWN: state == LOCKED or not may_move,
            Row.E_UP: commanded or (driven and state == MOVES),
            Row.E_DOWN: commanded and state == MOVES,
            Row.S_UP: driven and state == MOVES,
        }[kind]
        c = empty(question, scalar, [(kind, j, 0, 0)], [1.0])
        assert checker.legal(c, case, *bounds(question, scalar)).tolist() == [expected], (kind, j, state)


def test_rows_of_bounds_and_of_energy() -> None:
    """What is known of an unknown, at each end; energy where it is balanced, and with enough of the commands."""
    question, scalar = QUESTIONS["largest"]
    lo, hi = bounds(question, scalar)
    case = np.zeros((1, 6, 3), dtype=np.int64)
    for kind, end in ((Row.BOUND_UP, lo), (Row.BOUND_DOWN, hi)):
        for k in range(len(end)):
            c = empty(question, scalar, [(kind, k, 0, 0)], [1.0])
            assert checker.legal(c, case, lo, hi).tolist() == [bool(np.isfinite(end[k]))]
    for name, top, expected in (
        ("check", 0.0, True),
        ("preload", 0.7, True),
        ("preload", float(np.nextafter(0.7, 0.0)), False),
        ("preload", 5.0, True),
        ("largest", 5.0, False),
        ("max", 5.0, False),
    ):
        question, scalar = QUESTIONS[name]
        references = np.array([[1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, top]])
        c = empty(question, scalar, [(Row.ENERGY, 1, 0, 0)], [1.0], references)
        assert checker.legal(c, case, *bounds(question, scalar)).tolist() == [expected], (name, top)
    loose = replace(QUESTIONS["check"][0], mdp=False)
    c = empty(loose, None, [(Row.ENERGY, 0, 0, 0)], [1.0], REFERENCES)
    assert checker.legal(c, case, *bounds(loose, None)).tolist() == [False]


def test_the_first_row_that_is_wrong_is_named() -> None:
    question, _ = QUESTIONS["check"]
    names = [(Row.CN_UP, 0, 0, 0), (Row.TANGENT, 2, 7, 9), (Row.CN_UP, 1, 0, 0), (Row.CN_DOWN, 1, 3, 4)]
    c = replace(empty(question, None, names, np.ones(4)), leaves=np.array([0, 0]), start=np.array([0, 2, 4]))
    cases = np.zeros((2, 6, 3), dtype=np.int64)

    def fault(**change: object) -> str:
        with pytest.raises(checker.BadCertificate) as why:
            checker.check_rows(replace(c, **change), cases, *bounds(question, None))
        return str(why.value)

    place = "leaf 1 (node 0), row 1"
    assert fault() == f"{place}, CN_DOWN 1 [3, 4]: does not hold in this case"
    for kind in (-1, 29, 99):
        assert fault(kind=np.array([0, 5, 0, kind])) == f"{place}, {kind} 1 [3, 4]: no such kind"
    none = "no such contact, actuator, column or reference"
    for kind, ends in ((Row.CN_UP, 3), (Row.STILL_2_DOWN, 3), (Row.T_UP, 3), (Row.S_UP, 3), (Row.BOUND_UP, 22)):
        for index in (-1, ends):
            said = fault(kind=np.array([0, 5, 0, kind]), index=np.array([0, 2, 1, index]))
            assert said == f"{place}, {kind.name} {index} [3, 4]: {none}"
    assert fault(kind=np.array([0, 5, 0, Row.ENERGY]), index=np.zeros(4)).endswith(none)
    assert fault(kind=np.array([0, 5, 0, Row.BOUND_DOWN]), index=np.array([0, 0, 0, 21])).endswith("this case")
    for y in (-1e-300, np.nan, np.inf):
        said = fault(multiplier=np.array([1.0, y, 1.0, 1.0]))
        assert said == "leaf 0 (node 0), row 1, TANGENT 2 [7, 9]: the multiplier is negative or not finite"


# --- verdicts -------------------------------------------------------------------------------------------------


def test_what_a_verdict_says() -> None:
    c = proof("check")
    answer = checker.verify(c)
    assert (answer.ok, answer.reason, answer.unproved, answer.cap) == (True, "", (), None)
    assert answer.leaves == len(c.leaves)
    margins = answer.margin
    every = checker.farkas.proved_margins(c, checker.leaf_cases(c))
    assert margins == every.min() > 0


def test_what_a_verdict_of_version_1_says() -> None:
    """The cap of forces is the smallest of the object's: here the third, and a joint's may be smaller still."""
    c = capped_proof("check")
    answer = checker.verify(c)
    assert (answer.ok, answer.reason, answer.unproved, answer.cap) == (True, "", (), 50.0)
    smaller = replace(c, cap_r=np.array([50.0, 49.0, 31.0, 30.0, 29.0, 28.0]), cap_q=np.array([3.0, 2.0]))
    assert checker.verify(smaller).cap == 31.0
    assert isinstance(checker.verify(smaller).cap, float)


def test_what_is_refused_has_no_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor has a number that is none, in whichever leaf."""
    c = proof("check")
    refused = checker.verify(replace(c, multiplier=-c.multiplier))
    assert (refused.ok, refused.margin, refused.unproved, refused.cap) == (False, -np.inf, (), None)
    assert refused.leaves == len(c.leaves)
    margins = np.ones(len(capped_proof("check").leaves))
    margins[1] = np.nan
    monkeypatch.setattr(checker, "leaf_margins", lambda *of: margins)
    none = checker.verify(capped_proof("check"))
    assert (none.ok, none.margin, none.unproved) == (False, -np.inf, (1,))
    assert none.reason.startswith("leaf 1 (node ")


def test_which_leaf_is_not_proved() -> None:
    """The first; the margin is the smallest, and a leaf that says nothing has none."""
    c = proof("check")
    last = len(c.leaves) - 1
    y = c.multiplier.copy()
    for leaf in (last, last - 1):
        y[c.start[leaf] : c.start[leaf + 1]] = 0.0
        answer = checker.verify(replace(c, multiplier=y))
        assert not answer.ok
        assert answer.reason == f"leaf {leaf} (node {c.leaves[leaf]}) is not proved: margin -inf"
        assert (answer.margin, answer.leaves, answer.cap) == (-np.inf, last + 1, None)
    assert answer.unproved == (last - 1, last)
    root = empty(Question(pinch(), LARGEST, 0.2 * D, direction=D), (0.0, np.inf))
    assert checker.verify(root).unproved == (0,)


def test_the_largest_force_of_a_question() -> None:
    """Of its loads, moments by the grasp's size, and of its commands at a contact; 1 where there is none."""
    g = hand()
    push, turn = np.r_[3.0, 4.0, 0.0, 0.0, 0.0, 0.0], np.r_[np.zeros(3), np.array([2.0, 0.0, 1.5]) * g.size]
    none = g.with_preload(None)
    assert checker._force(Question(none, wrench=push)) == pytest.approx(5.0)
    assert checker._force(Question(none, wrench=turn)) == pytest.approx(2.5)
    assert checker._force(Question(none, LARGEST, turn, push)) == pytest.approx(5.0)
    assert checker._force(Question(none, LARGEST, push, turn)) == pytest.approx(5.0)
    assert checker._force(Question(none, SMALLEST_PRELOAD, direction=turn)) == pytest.approx(2.5)
    assert checker._force(Question(none)) == 1.0
    arms = np.sqrt((g.J**2).sum(axis=0))
    commands = 0.4 / min(arms[0], arms[1] / 0.5), 0.15 / min(arms[1] / 0.7, arms[2] / 0.4)
    assert checker._force(Question(g)) == pytest.approx(max(commands), rel=1e-12)
    assert checker._force(Question(hand(-1.0))) == pytest.approx(max(commands), rel=1e-12)
    assert checker._force(Question(g, wrench=100 * W)) == pytest.approx(
        100 * max(np.linalg.norm(W[:3]), np.linalg.norm(W[3:]) / g.size), rel=1e-12
    )


def wedge(reach: float, load: float = 3.0, **more: Any) -> Certificate:
    """A frictionless wedge that a load presses into its gap: it gives in by `reach` times the load, no less.

    Flanks at an angle d carry c = load / (2 sin d) each, which takes 2 c^2 of energy: load . r >= load^2 / 2 sin^2 d.
    Energy with tangents at c, weighed by 1; the balance along the load by 2 c / sin d, as -2 c c_n has to vanish; and
    c_t = 0 by what that balance has of c_t.
    """
    sin = np.sqrt(0.5 / reach)
    cos, c = np.sqrt(1 - sin * sin), load / (2 * sin)
    contacts = [Contact([x, 0.0, 0.0], [-x * cos, sin, 0.0], 0.0) for x in (-1.0, 1.0)]
    rows, y = [(Row.ENERGY, 0, 0, 0)], [1.0]
    for i, contact in enumerate(contacts):
        u, v = contact.frame.T[1:, 1] / cos
        rows.append((Row.TANGENT, i, int(np.round(np.arctan2(v, u) / (2 * np.pi) * TURN)), 0))
        y.append(2 * c / sin * cos)
    question = Question(Grasp(contacts), wrench=-load * np.eye(6)[1], **more)
    return empty(question, None, rows, y, [[c, c, 0.0]])


@pytest.mark.parametrize("factor", checker.CAPS)
def test_up_to_which_motions_a_proof_goes(factor: float) -> None:
    """What it would take more motion than that for; none below a thousand times the load is of use."""
    answer = checker.verify(wedge(1.01 * factor))
    assert (answer.ok, answer.reason, answer.unproved, answer.cap) == (True, "", (0,), pytest.approx(3.0 * factor))
    assert isinstance(answer.cap, float)
    assert 0 < answer.margin < 0.01
    less = checker.verify(wedge(0.99 * factor))
    lower = [f for f in checker.CAPS if f < factor]
    assert less.ok == bool(lower)
    assert less.cap == (pytest.approx(3.0 * max(lower)) if lower else None)
    assert lower or less.reason.startswith("leaf 0 (node 0) is not proved: margin -")


def test_leaves_that_are_proved_to_different_caps() -> None:
    """A tangent at 1.9 c shows 1 - 0.9^2 of the energy only: 0.19 x 2e5 is more than 1e4. The smaller cap counts."""
    c = wedge(2e5)
    references, shares = np.outer([1.0, 1.9, 3.0], c.references[0]), (1.0, 1.9, 3.0)
    rows = {name: np.tile(getattr(c, name), 3) for name in ("kind", "a", "b")}
    rows |= {"index": np.r_[0, 0, 1, 1, 0, 1, 2, 0, 1], "start": np.array([0, 3, 6, 9]), "references": references}
    y = np.concatenate([c.multiplier * [1.0, share, share] for share in shares])
    three = replace(c, leaves=np.array([0, 0, 0]), multiplier=y, **rows)
    for leaves, expected in (([0], 1e5), ([1], 1e4), ([0, 1], 1e4), ([1, 0], 1e4), ([2], None), ([0, 2], None)):
        cap, margins = checker._largest_cap(three, np.array(leaves))
        assert cap == (expected and pytest.approx(3.0 * expected))
        assert margins.shape == (len(leaves),)
        assert (margins > 0).all() if expected else (margins == -np.inf).all()
    endless = empty(Question(c.question.grasp, LARGEST, direction=np.eye(6)[1]), (0.0, np.inf))
    cap, margins = checker._largest_cap(endless, np.array([0]))
    assert (cap, margins.tolist()) == (None, [-np.inf])
