"""The checker of certificates: what it accepts, and that rounding never flatters."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from handfast.stability.certify import checker
from handfast.stability.certify.certificate import Question, Row
from handfast.stability.certify.claim import Claim, leaf_margins
from handfast.stability.goal import LARGEST, SMALLEST_LARGEST_COMMAND, SMALLEST_PRELOAD
from tests.support.altered_certificates import exact_margins, refused, with_row
from tests.support.certificates import (
    CAPS,
    CASES,
    PULL_Y,
    PULL_Z,
    capped_proof,
    empty,
    turned,
)
from tests.support.problems import pinch, table

HUNDRED = CAPS, np.full(2, 100.0)  # caps of questions with two joints


@pytest.mark.parametrize("name", CASES)
def test_proofs_are_accepted(name: str, proof_of) -> None:
    answer = checker.verify(proof_of(name))
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
        (Question(pinch(), SMALLEST_PRELOAD, direction=PULL_Y), (0.0, 1.0), fingers, 200.0),
        (Question(pinch(), SMALLEST_LARGEST_COMMAND, PULL_Y, driven=("left", "right")), (0.0, 0.1), fingers, 200.0),
        (Question(table(), wrench=-4 * PULL_Z), None, press, 400.0),
        (Question(table(), LARGEST, -2 * PULL_Z, direction=-PULL_Z), (-1.0, 2.0), press, 400.0),
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
    assert checker.verify(c).ok
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
        assert checker.verify(with_row(c, 0, (Row.ENERGY, 0, 0, 0))).ok, name
    for name in ("largest", "max", "sum", "no dissipation"):
        c = replace(proof_of(name), references=reference)
        refused(with_row(c, 0, (Row.ENERGY, 0, 0, 0)), "ENERGY 0 .*does not hold in this case")
    c = replace(proof_of("smallest preload"), references=reference - [0, 0, 1e-9])
    refused(with_row(c, 0, (Row.ENERGY, 0, 0, 0)), "ENERGY 0 .*does not hold in this case")
    refused(with_row(c, 0, (Row.ENERGY, 1, 0, 0)), "no such contact, actuator, column or reference")


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
        good, bad = (middle, bad) if checker.verify(replace(c, scalar=(0.0, middle))).ok else (good, middle)
    assert min(exact_margins(replace(c, scalar=(0.0, good)))) >= 0
    assert min(exact_margins(replace(c, scalar=(0.0, good * (1 + 1e-6))))) < 0
