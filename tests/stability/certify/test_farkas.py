"""Proofs of leaves without any bound on motions: exact arithmetic, ranks, and attacks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.certify import checker, farkas
from handfast.stability.certify.certificate import Question, Row
from handfast.stability.queries import check, maximum
from tests.support.certificates import (
    CASES,
    MOVES,
    PULL_Y,
    STICK,
    empty,
    proof,
    prove,
)
from tests.support.farkas_proofs import (
    ONE_IN_A_THOUSAND,
    SEEDS,
    bounded,
    certificates,
    compare,
    exact_margin,
    refused,
    slips,
)
from tests.support.problems import pinch


@pytest.mark.parametrize("name", CASES)
def test_proofs_of_the_prover_are_proofs_in_exact_arithmetic(name: str) -> None:
    assert compare(proof(name)) > 0


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_proofs_of_the_engine_are_proofs_in_exact_arithmetic(m: int, seed: int) -> None:
    for c in (bounded(m, seed)[1].certificate, slips(m, seed)):
        if c is not None:
            assert compare(c) > 0


@pytest.mark.parametrize("name", ["smallest preload", "max", "sum", "max of turned"])
def test_where_a_proof_ends(name: str) -> None:
    """The largest range that the multipliers still prove: exact arithmetic agrees on this side and just beyond."""
    c, cases = proof(name), checker.leaf_cases(proof(name))
    good, bad = c.scalar[1], 2 * c.scalar[1]
    for _ in range(50):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if checker.verify(replace(c, scalar=(0.0, middle))).ok else (good, middle)
    leaves = range(len(c.leaves))
    here, beyond = (replace(c, scalar=(0.0, end)) for end in (good, good * (1 + 1e-6)))
    assert min(exact_margin(here, leaf, cases) for leaf in leaves) >= 0
    assert min(exact_margin(beyond, leaf, cases) for leaf in leaves) < 0


# --- ranks --------------------------------------------------------------------------------------------


def two_points(apart: float = 0.0) -> Grasp:
    """Two fixed fingertips on the x axis press on nothing that moves them; the second may be a little off."""
    ends = np.array([[0.03, 0.01, 0.02], [-0.03, 0.01, 0.02 + apart]])
    return Grasp([Contact(p, np.array([-np.sign(p[0]), 0.0, 0.0]), 0.5) for p in ends], name="two points")


@cache
def turning(apart: float = 0.0):
    """Two contacts that stick: the object turns about the line through them, so that 6 rows have rank 5."""
    weight = np.r_[0.0, 0.0, -1.0, 0.0, 0.0, 0.0] + np.r_[np.zeros(3), np.cross([0.0, 0.01, 0.02], [0.0, 0.0, -1.0])]
    return prove(Question(two_points(apart), wrench=weight), eager=False)


def test_lost_ranks_are_found() -> None:
    """Without a preload nothing is held; in the case that both stick the motion about their line is left over."""
    c = turning()
    assert c is not None
    assert checker.verify(c).ok
    cases = checker.leaf_cases(c)
    both = np.flatnonzero((cases[:, :2, 0] == STICK).all(axis=1))
    assert len(both)
    for leaf in both.tolist():
        assert exact_margin(c, leaf, cases) > 0


def sticking(apart: float):
    """Both stick and carry: rows of a case in which ranks are lost, with multipliers for them that cancel."""
    c = turning()
    grasp = two_points(apart)
    return replace(c, question=replace(c.question, grasp=grasp))


@pytest.mark.parametrize("apart", [1e-16, 1e-14, 1e-12, 1e-9])
def test_a_contact_that_is_moved_a_little(apart: float) -> None:
    """Where the line goes through other points the same multipliers may prove it or not, but arithmetics agree."""
    c = sticking(apart)
    cases = checker.leaf_cases(c)
    with np.errstate(all="ignore"):
        margins = farkas.proved_margins(c, cases)
    for leaf in np.flatnonzero(margins > 0).tolist():
        exact = exact_margin(c, leaf, cases)
        assert exact is not None
        assert exact > 0
    found = checker.verify(c)
    assert found.unproved == tuple(np.flatnonzero(~(margins > 0)).tolist())
    assert (found.cap is None and found.ok) == (not found.unproved)  # the others up to some motion, if at all


@pytest.mark.parametrize("shift", [0.0, 1.0, 1e3])
def test_equations_that_contradict_each_other(shift: float) -> None:
    """A tendon pulls two joints alike that lie 20 and 30 mm below a fingertip: a force across would need 2 : 3."""
    tips, contacts, joints = (0.03 + shift, -0.03 + shift), [], []
    for i, x in enumerate(tips):
        contacts.append(Contact([x, 0.0, 0.0], [2.0 * i - 1.0, 0.0, 0.0], 0.5))
        joints += [GraspJoint(f"j{i}{k}", [0.0, 0.0, 1.0], [x, -0.02 - 0.01 * k, 0.0], (i,)) for k in range(2)]
    R = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    grasp = Grasp(contacts, joints, Mechanism(("a", "b"), R, np.zeros((0, 4)), (True, True)), {"a": 0.1, "b": 0.1})
    across = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    answer = check(grasp, across)
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    assert len(answer.certificate.leaves) == 1
    assert not len(answer.certificate.kind)
    most = maximum(grasp, across)
    assert (most.verdict, most.stop, most.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    refused(replace(answer.certificate, question=replace(answer.question, wrench=np.zeros(6))), "is not proved")


def test_two_points_hold_no_weight() -> None:
    """Fixed as they are, they press only if something pushes the object against both: nothing does."""
    answer = check(two_points(), turning().question.wrench)
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    near = check(two_points(1e-12), turning().question.wrench)
    assert near.verdict is not Verdict.HOLDS  # numbers may not suffice to tell


def test_ranks_that_matter_are_not_made_up() -> None:
    """A multiplier of what sticks does not cancel by itself: a force along the line is held."""
    along = Question(two_points(), wrench=np.r_[1.0, 0, 0, 0, 0.02, -0.01])
    assert check(along.grasp, along.wrench).verdict is Verdict.HOLDS
    c = replace(turning(), question=along)
    refused(c, "is not proved")


def holding(m: int, seed: int):
    """A question that is answered by a witness, and certificates that more is not resisted."""
    case, answer = bounded(m, seed)
    if answer.unbounded or answer.lower == 0:
        return None
    load = 0.999 * answer.lower
    held = check(case.grasp, load * case.direction, settings=ONE_IN_A_THOUSAND)
    if held.verdict is not Verdict.HOLDS:  # what is resisted need not be an interval
        return None
    assert held.witness.valid
    return case, load, held.question


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_what_holds_is_not_refuted(m: int, seed: int) -> None:
    """Certificates of slightly larger loads, with the load that holds put into them, and multipliers shaken."""
    found = holding(m, seed)
    if found is None:
        pytest.skip("resists everything, or nothing")
    case, _, question = found
    rng = np.random.default_rng(seed)
    accepted = []
    for factor in (1.003, 1.01, 1.1, 2.0):
        c = check(
            case.grasp, factor * bounded(m, seed)[1].upper * case.direction, settings=ONE_IN_A_THOUSAND
        ).certificate
        if c is None:
            continue
        forged = replace(c, question=question)
        tries = [
            forged,
            *(replace(forged, multiplier=shaken(c.multiplier, rng, by)) for by in (1e-12, 1e-6, 1e-3, 0.1)),
        ]
        accepted += [checker.verify(other).ok for other in tries]
    assert accepted
    assert not any(accepted)


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_a_maximum_is_not_lowered(m: int, seed: int) -> None:
    """The range of the smallest preload stretched to the load that holds: no multipliers near prove it."""
    found = holding(m, seed)
    if found is None:
        pytest.skip("resists everything, or nothing")
    _, load, _ = found
    c = bounded(m, seed)[1].certificate
    rng = np.random.default_rng(seed)
    wider = replace(c, scalar=(c.scalar[0], 1 / load))
    for other in (wider, *(replace(wider, multiplier=shaken(c.multiplier, rng, by)) for by in (1e-9, 1e-4, 0.1))):
        refused(other, "is not proved")
    refused(replace(c, scalar=(c.scalar[0], np.inf)), "is not proved|does not hold")


def shaken(y, rng, by):
    """Multipliers changed by a share each, at random."""
    return np.abs(y * (1 + by * rng.normal(size=len(y))))


def test_random_multipliers_refute_nothing() -> None:
    """Of every row that a case allows, in a state that is true: the pinch holds half of what it can."""
    rng = np.random.default_rng(0)
    question = Question(pinch(), wrench=0.5 * PULL_Y)
    base = replace(proof("check"), question=question)
    for _ in range(50):
        y = rng.exponential(size=len(base.multiplier)) ** rng.integers(1, 8)
        refused(replace(base, multiplier=y), "is not proved")
    refused(empty(question), "is not proved")


def test_the_sample_has_bounds() -> None:
    assert len(certificates()) >= 6
    kinds = {kind for c in certificates() for kind in c.kind.tolist()}
    assert {Row.CHORD, Row.GAP_UP, Row.STILL_1_UP, Row.TANGENT, Row.CN_UP, Row.BOUND_DOWN} <= kinds
    assert any((checker.leaf_cases(c)[:, c.question.grasp.m :, 0] == MOVES).any() for c in certificates())
