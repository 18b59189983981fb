"""Planted faults in proofs of leaves without any bound on motions: none passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.stability.certify import checker, leaf_rows
from handfast.stability.certify.certificate import Columns, Question, Row
from handfast.stability.goal import SMALLEST_PRELOAD
from tests.support.certificates import (
    CASES,
    CLOSED,
    OPEN,
    PULL_Y,
    PULL_Z,
    SLIDE,
    STICK,
    TURN,
    proof,
    prove,
)
from tests.support.farkas_proofs import exact_margin, refused
from tests.support.problems import nest


def put(array, i, value):
    out = array.copy()
    out[i] = value
    return out


def without_row(c, r):
    """The certificate without one row."""
    start = c.start - (c.start > r)
    return replace(
        c, start=start, **{k: np.delete(getattr(c, k), r) for k in ("kind", "index", "a", "b", "multiplier")}
    )


def with_row(c, leaf, name, y):
    """The certificate with one row more in a leaf."""
    at = c.start[leaf]
    rows = {k: np.insert(getattr(c, k), at, v) for k, v in zip(("kind", "index", "a", "b"), name, strict=True)}
    start = c.start + (np.arange(len(c.start)) > leaf)
    return replace(c, start=start, multiplier=np.insert(c.multiplier, at, y), **rows)


def agree(c) -> None:
    """The checker's word and exact arithmetic: what is accepted is proved."""
    if checker.verify(c).ok:
        cases = checker.leaf_cases(c)
        margins = [exact_margin(c, leaf, cases) for leaf in range(len(c.leaves))]
        assert all(margin is not None and margin > 0 for margin in margins)


def test_a_row_dropped() -> None:
    """Where the others do not prove the leaf it is refused, and sometimes they do."""
    c = proof("check")
    answers = []
    for r in range(0, len(c.kind), 11):
        other = without_row(c, r)
        agree(other)
        answers.append(checker.verify(other).ok)
    assert not all(answers)


def test_a_leaf_without_rows() -> None:
    c, cases = proof("check"), checker.leaf_cases(proof("check"))
    for leaf in range(len(c.leaves)):
        other = c
        for _ in range(c.start[leaf + 1] - c.start[leaf]):
            other = without_row(other, c.start[leaf])
        margin = exact_margin(other, leaf, cases)
        assert not checker.verify(other).ok or (margin is not None and margin > 0)


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.01, 1e6, 1e150, 1e300])
def test_a_multiplier_changed(factor: float) -> None:
    """The checker makes multipliers exact: it may find others, and then they are a proof."""
    c = proof("check")
    for r in range(0, len(c.kind), 17):
        agree(replace(c, multiplier=put(c.multiplier, r, factor * c.multiplier[r])))


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (np.nan, r"the multiplier is negative or not finite"),
        (np.inf, r"the multiplier is negative or not finite"),
        (-1e-300, r"the multiplier is negative or not finite"),
    ],
)
def test_absurd_multipliers(value: float, reason: str) -> None:
    c = proof("check")
    refused(replace(c, multiplier=put(c.multiplier, 3, value)), reason)
    refused(replace(c, multiplier=np.full_like(c.multiplier, value)), reason)


@pytest.mark.parametrize("state", [OPEN, CLOSED, STICK, SLIDE])
def test_the_case_of_a_leaf_changed(state: int) -> None:
    """A leaf's rows do not hold in another case, or the tree has a gap."""
    c = proof("nest")
    for leaf in range(len(c.leaves)):
        node = c.leaves[leaf]
        if c.state[node] != state:
            refused(replace(c, state=put(c.state, node, state)), "needs|no sector|does not hold|not a full turn")


@pytest.mark.parametrize("side", ["a", "b"])
def test_rows_of_other_sectors(side: str) -> None:
    """The chord of a narrower sector, or the end of another, need not hold."""
    c = proof("nest")
    chords = np.flatnonzero(c.kind == Row.CHORD)
    assert len(chords)
    step = 1 if side == "a" else -1
    for r in chords.tolist():
        refused(replace(c, **{side: put(getattr(c, side), r, getattr(c, side)[r] + step)}), "does not hold in this")
        turned = {k: put(getattr(c, k), r, getattr(c, k)[r] + TURN // 3) for k in ("a", "b")}
        refused(replace(c, **turned), "CHORD .*does not hold in this case")


def test_bounds_of_what_has_none() -> None:
    """Motions, forces of actuators without a limit, and tangential forces have no bound to cite."""
    c = proof("check")
    at = Columns.of(c.question)
    lo, hi = leaf_rows.bounds(c.question, c.scalar)
    for column in range(at.n):
        for kind, end in ((Row.BOUND_UP, lo), (Row.BOUND_DOWN, hi)):
            other = with_row(c, 0, (kind, column, 0, 0), 1e-9)
            if not np.isfinite(end[column]):
                refused(other, f"{kind.name} {column} .*does not hold in this case")
    assert not np.isfinite(np.r_[lo[at.r], hi[at.r], lo[at.q], hi[at.q], lo[at.f], hi[at.f]]).any()
    assert not np.isfinite(hi[at.c]).any()
    assert (lo[at.c][0::3] == 0).all()


@pytest.mark.parametrize(
    ("name", "scalar"),
    [
        ("smallest preload", (0.0, 1.001)),
        ("smallest preload", (0.0, np.inf)),
        ("largest", (0.79, 3.0)),
        ("max", (0.0, 0.101)),
        ("sum", (0.0, 0.101)),
        ("max of turned", (0.0, 0.101)),
    ],
)
def test_ranges_wider_than_what_is_true(name: str, scalar: tuple[float, float]) -> None:
    """The pinch resists 1 N with 0.1 N m: no multipliers whatever prove more."""
    refused(replace(proof(name), scalar=scalar), "is not proved|BOUND_DOWN .*does not hold in this case")


def test_a_range_without_end_needs_a_proof_without_end() -> None:
    """The nest cannot pull, at any preload; a proof that uses the end of its range does not reach farther."""
    q = replace(CASES["smallest preload"][0], direction=PULL_Z, grasp=nest(0.0).with_preload(None))
    c = prove(Question(q.grasp, SMALLEST_PRELOAD, direction=PULL_Z), (0.0, np.inf))
    assert c is not None
    assert checker.verify(c).ok
    c = proof("smallest preload")
    assert (c.kind == Row.BOUND_DOWN).any()
    refused(replace(c, scalar=(c.scalar[0], np.inf)), "does not hold|is not proved")


def moved(grasp: Grasp, by: float) -> Grasp:
    """With its first contact elsewhere."""
    first, *others = grasp.contacts
    there = first.position + by * np.array([0.0, 1.0, 0.0])
    return Grasp([replace(first, position=there), *others], grasp.joints, preload=grasp.preload, name=grasp.name)


@pytest.mark.parametrize(
    "change",
    [
        lambda q: replace(q, grasp=q.grasp.with_friction(0.56)),
        lambda q: replace(q, grasp=q.grasp.with_preload({"left": 0.12, "right": 0.12})),
        lambda q: replace(q, wrench=0.999 * PULL_Y),
        lambda q: replace(q, wrench=-q.wrench),
        lambda q: replace(q, grasp=moved(q.grasp, 0.03)),
    ],
)
def test_the_question_changed_afterwards(change) -> None:
    refused(replace(proof("check"), question=change(proof("check").question)), "is not proved")
