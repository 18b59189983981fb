"""Rows, equalities and bounds that leaves may cite: every number, against the same written out a second time."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from handfast.stability.certify.certificate import HALF, WIDER, Columns, Question, Row
from handfast.stability.certify.leaf_rows import UNIT, ContactMaps, bounds, equations, missed, rows_of
from handfast.stability.goal import LARGEST, SMALLEST_SUM_OF_COMMANDS
from tests.support.certificates import (
    AS_WRITTEN,
    CLOSED,
    FREE,
    LOCKED,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN,
    UNDECIDED,
    Known,
    empty,
    exact_equations,
    row,
)
from tests.support.farkas_proofs import is_equation
from tests.support.rounding_edges import BOTH, QUESTIONS, REFERENCES, W, hand

POINT_ROWS = [kind for kind in Row if kind <= Row.ENERGY]  # those of soft fingers are in test_soft_rows.py


def every_row(question: Question, scalar: tuple[float, float] | None) -> list[tuple[Row, int, int, int]]:
    """All kinds of each point contact, actuator, bounded unknown and reference, in sectors of several widths."""
    g, (lo, hi), names = question.grasp, bounds(question, scalar), []
    sectors = [(5, TURN // 5), (-TURN // 7, TURN // 9), (TURN // 3, TURN // 3 + 1), (99, 99 + TURN // 3)]
    for kind in POINT_ROWS:
        if kind is Row.ENERGY:
            names += [(kind, i, 0, 0) for i in range(len(REFERENCES) if question.goal.bounds_energy else 0)]
        elif kind >= Row.BOUND_UP:
            names += [(kind, k, 0, 0) for k in np.flatnonzero(np.isfinite(lo if kind == Row.BOUND_UP else hi)).tolist()]
        elif kind >= Row.T_UP:
            if kind is not Row.S_UP or question.goal.seeks_commands:
                names += [(kind, j, 0, 0) for j in range(g.mechanism.a)]
        else:
            names += [(kind, i, a, b) for i in range(g.m) for a, b in sectors]
    return names


@pytest.mark.parametrize("name", QUESTIONS)
def test_every_coefficient(name: str) -> None:
    """Within a few roundings of exact arithmetic, which alone knows how far cones give way (2^-40)."""
    question, scalar = QUESTIONS[name]
    names = every_row(question, scalar)
    c = empty(question, scalar, names, np.ones(len(names)), REFERENCES)
    known, (lo, hi) = Known.of(c), bounds(question, scalar)
    states = np.zeros((len(names), 6), dtype=np.int64)
    found = rows_of(c, states, lo, hi)
    plain = rows_of(c, states, lo, hi, wider=0.0)
    assert found.value.shape == (len(names), known.columns.n + 3 * 3 + 3)
    for r, of in enumerate(names):
        entries, b = row(c, known, *of, AS_WRITTEN)
        exact = np.zeros(found.value.shape[1])
        for place, value in entries.items():
            exact[place] = float(value)
        size = np.abs(exact).max()
        np.testing.assert_allclose(found.value[r], exact, rtol=0, atol=8 * UNIT * size, err_msg=str(of))
        np.testing.assert_allclose(found.b[r], float(b), rtol=8 * UNIT, err_msg=str(of))
        gives_way = Row.GAP_UP <= of[0] <= Row.CHORD and not (Row.GAP_UP <= of[0] <= Row.DN_UP and not question.eta)
        assert (np.abs(found.value[r] - plain.value[r]).max() > 0.05 * WIDER) == gives_way, of


def test_rows_of_sectors_as_wide_as_half_a_turn() -> None:
    """Where a row does not look at its directions they may be anything, opposite ones too."""
    question, _ = QUESTIONS["check"]
    names = [(kind, 0, 0, HALF) for kind in (Row.GAP_UP, Row.DN_UP, Row.CHORD)]
    c = empty(question, None, names, np.ones(3))
    found = rows_of(c, np.zeros((3, 6), dtype=np.int64), *bounds(question, None))
    at = Columns.of(question)
    assert np.isfinite(found.value).all()
    assert [found.value[r, at.n] for r in (0, 1)] == [1.0, 1.0]
    assert found.value[0, at.c.start] == 1.0


def test_balances_of_energy_say_less_than_is_so() -> None:
    """The smallest of what rounding allows, on both sides: commands too large, squares too large."""
    question, scalar = QUESTIONS["preload"]
    names = [(Row.ENERGY, i, 0, 0) for i in (0, 1)]
    c = empty(question, scalar, names, [1.0, 1.0], REFERENCES)
    found = rows_of(c, np.zeros((2, 6), dtype=np.int64), *bounds(question, scalar))
    at, command = Columns.of(question), np.abs(question.grasp.command)
    for r, (*normal, top) in enumerate(REFERENCES.tolist()):
        for j, f_c in enumerate(command.tolist()):
            exact, here = Fraction(top) * Fraction(f_c), Fraction(float(found.value[r, at.n + 9 + j]))
            assert exact <= here <= exact * (1 + Fraction(9 * UNIT))
        squares = sum(Fraction(x) ** 2 for x in normal)
        assert squares < -Fraction(float(found.b[r])) < squares * (1 + Fraction(12 * UNIT))
        assert [float(x) for x in found.value[r, at.c][0::3]] == [-2 * x for x in normal]
        assert not found.value[r, at.c].reshape(-1, 3)[:, 1:].any()


STATES = (UNDECIDED, OPEN, CLOSED, STICK, SLIDE)


@pytest.mark.parametrize("name", QUESTIONS)
@pytest.mark.parametrize("state", STATES)
def test_which_rows_are_equations(name: str, state: int) -> None:
    """What stands still, what touches, what is locked or gives all of its command: of this part, not of another."""
    question, scalar = QUESTIONS[name]
    names = every_row(question, scalar)
    c = empty(question, scalar, names, np.ones(len(names)), REFERENCES)
    for actuator in (FREE, LOCKED, MOVES):
        for place in range(3):
            case = np.zeros((6, 3), dtype=np.int64)
            case[place, 0], case[3 + place, 0] = state, actuator
            states = np.repeat(case[None, :, 0], len(names), axis=0)
            found = rows_of(c, states, *bounds(question, scalar)).either
            assert found.tolist() == [
                kind < Row.BOUND_UP and is_equation(question, kind, index, case) for kind, index, *_ in names
            ]


@pytest.mark.parametrize("name", QUESTIONS)
def test_equalities_and_motions(name: str) -> None:
    question, _ = QUESTIONS[name]
    g = question.grasp
    E, h, Z = equations(question, ContactMaps.of(g))
    exact_E, exact_h, exact_Z = exact_equations(question)
    assert h.tolist() == [float(x) for x in exact_h]
    for found, exact in ((E, exact_E), (Z, exact_Z)):
        full = np.zeros((len(exact), Columns.of(question).n))
        for r, entries in enumerate(exact):
            for k, value in entries.items():
                full[r, k] = float(value)
        assert found.shape == full.shape
        np.testing.assert_allclose(found, full, rtol=0, atol=8 * UNIT)


def test_what_a_witness_may_miss() -> None:
    """1e-9 of the largest force of the load or the commands, moments by its size; of the scalar's load apart."""
    commanded, idle = hand(), hand().with_preload(None)
    size = idle.size
    force, turn = np.r_[0.0, 3.0, 4.0, size, 0.0, 0.0], np.r_[0.6, 0, 0, size * np.array([1.2, 1.6, 0.0])]
    arms = np.linalg.norm(idle.J, axis=0)
    most = 0.4 / (arms[:2] / [1.0, 0.5]).min()  # [N] of motor m; the tendon pulls less
    for g, least in ((idle, 0.0), (commanded, most)):
        for base, direction in ((force, turn), (turn, force)):
            five, two = (5.0, 2.0) if base is force else (2.0, 5.0)
            slack, growth = missed(Question(g, LARGEST, base, direction), 11)
            for found, largest in ((slack, max(five, least)), (growth, two)):
                np.testing.assert_allclose(found[:3], 1e-9 * largest, rtol=1e-12)
                np.testing.assert_allclose(found[3:6], 1e-9 * largest * size, rtol=1e-12)
                assert found.shape == (11,)
                assert not found[6:].any()
    slack, growth = missed(Question(idle, wrench=force), 11)
    assert slack.any()
    assert not growth.any()
    assert missed(Question(commanded), 11)[0][:6].all()


def test_bounds_of_each_unknown() -> None:
    question = Question(
        hand(), SMALLEST_SUM_OF_COMMANDS, W, driven=BOTH, force_limit=3.0, torque_limits={"n": 0.9, "t": 0.4}
    )
    at, (lo, hi) = Columns.of(question), bounds(question, (0.2, 0.5))
    inf = np.inf
    for part, below, above in (
        (at.r, [-inf] * 6, [inf] * 6),
        (at.q, [-inf] * 3, [inf] * 3),
        (at.c, [0.0, -inf, -inf] * 3, [3.0, inf, inf] * 3),
        (at.f, [-inf, -0.9, -0.4], [inf, 0.9, 0.4]),
        (at.coupling, [-inf], [inf]),
        (at.scalar, [0.2], [0.5]),
        (at.e, [0.0] * 3, [0.5, 0.5, inf]),
    ):
        assert (lo[part].tolist(), hi[part].tolist()) == (below, above)
    at, (lo, hi) = Columns.of(Question(hand(), wrench=W)), bounds(Question(hand(), wrench=W), None)
    assert (lo[at.c].tolist(), hi[at.c].tolist()) == ([0.0, -inf, -inf] * 3, [inf] * 9)
    assert (at.scalar.start, at.e.start, at.n) == (22, 22, 22)
