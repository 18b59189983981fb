"""Rows and splits of soft fingers: true of every state of their case, and nothing else passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.soft_fingers import random_grasp, random_load
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import TURN, Columns, Question, Row
from handfast.stability.certify.leaf_rows import bounds, rows_of
from handfast.stability.certify.patches import LAST, OCTANTS, contains, patch
from handfast.stability.queries import check
from tests.support.certificates import CLOSED, OPEN, SLIDE, STICK, empty
from tests.support.soft_fingers import coin

QUESTION = Question(coin(), wrench=np.array([0, 0, 0, 0, 0, 0.1]))
SOFT = [kind for kind in Row if kind > Row.ENERGY]


def random_patch(rng: np.random.Generator) -> int:
    number = int(rng.integers(8, 16))
    for _ in range(int(rng.integers(0, 27))):
        number = 2 * number + int(rng.integers(2))
    return number


def inside(number: int, rng: np.random.Generator) -> np.ndarray:
    """A direction of a patch, mostly near its rim."""
    x = rng.choice([1e-6, 1e-3, 1.0], size=3) @ patch(number).corners
    return np.asarray(x / np.linalg.norm(x))


@pytest.mark.parametrize("seed", range(200))
def test_patches(seed: int) -> None:
    """Directions of a patch are on the right side of its planes and beyond its reach, and in one of its halves."""
    rng = np.random.default_rng(seed)
    number = random_patch(rng)
    x, whole = inside(number, rng), patch(number)
    assert (whole.planes @ x >= 0).all()
    assert whole.middle @ x >= whole.reach - 1e-15
    assert whole.reach > 0.57
    assert (np.abs(np.linalg.norm(whole.planes, axis=1) - 1) < 1e-15).all()
    if 2 * number + 1 <= LAST:
        halves = [patch(2 * number), patch(2 * number + 1)]
        assert any((half.planes @ x >= 0).all() for half in halves)
        np.testing.assert_array_equal(halves[0].planes[2], -halves[1].planes[2])  # nothing lies between them
        kept = [plane.tolist() for half in halves for plane in half.planes[:2]]
        assert all(plane in whole.planes.tolist() for plane in kept)  # no other side is new
    above = number >> int(rng.integers(0, number.bit_length() - 3))
    assert contains(np.array([above]), np.array([number]))[0]
    assert not contains(np.array([number ^ 1]), np.array([number]))[0]


@pytest.mark.parametrize("seed", range(60))
def test_rows_hold_in_true_states(seed: int) -> None:
    """At a soft finger that slides, sticks or is open, all rows that the checker accepts; wrong ones are refused."""
    rng = np.random.default_rng([3, seed])
    state = [SLIDE, STICK, OPEN][seed % 3]
    number = random_patch(rng) if state == SLIDE else 0
    mu, c_n = QUESTION.grasp.mu[0], rng.uniform(0.1, 20)
    x = inside(number, rng) if number else rng.normal(size=3)
    c_f = mu * c_n * x / np.linalg.norm(x) * (1.0 if state == SLIDE else rng.random())
    d_f = -rng.uniform(0, 1e4) * x if state == SLIDE else np.zeros(3)
    if state == OPEN:
        c_n, c_f, d_f = 0.0, np.zeros(3), rng.normal(size=3)
    names = [(kind, 0, *_numbers(kind, number, rng)) for kind in SOFT for _ in range(20)]
    c = empty(QUESTION, None, names, np.ones(len(names)))
    case = np.zeros((1, 3, 3), dtype=np.int64)
    case[0, 0] = state, number, 0
    lo, hi = bounds(QUESTION, None)
    good = checker.legal(c, np.repeat(case, len(names), axis=0), lo, hi)
    kinds = {kind for (kind, *_), ok in zip(names, good, strict=True) if ok}
    expected = {
        SLIDE: {Row.SOFT_TANGENT, Row.SOFT_CHORD, Row.C_SIDE, Row.D_SIDE},
        STICK: {Row.SOFT_TANGENT, Row.TURN_UP, Row.TURN_DOWN},
        OPEN: {Row.SOFT_TANGENT},
    }
    assert kinds == expected[state]
    legal = [name for name, ok in zip(names, good, strict=True) if ok]
    rows = rows_of(empty(QUESTION, None, legal, np.ones(len(legal))), np.zeros((len(legal), 3), np.int64), lo, hi)
    at = Columns.of(QUESTION)
    point = np.zeros(rows.value.shape[1])
    point[at.c][:3], point[at.twist][0] = [c_n, *c_f[:2]], c_f[2]
    point[at.n : at.n + 3], point[at.n + 3 * 2 + 1] = [-c_n, *d_f[:2]], d_f[2]
    values = rows.value @ point - rows.b
    assert (values >= 0).all()
    if state == SLIDE:
        elsewhere = -point
        elsewhere[at.c.start] = c_n
        assert (rows.value @ elsewhere - rows.b).min() < 0  # friction along the motion


def _numbers(kind: Row, number: int, rng: np.random.Generator) -> tuple[int, int]:
    if kind == Row.SOFT_TANGENT:
        return int(rng.integers(TURN)), int(rng.integers(TURN))
    if number and rng.random() < 0.7:
        number >>= int(rng.integers(0, number.bit_length() - 3))
    elif number:
        number = random_patch(rng) | 1 << 31 if rng.random() < 0.2 else number ^ 1
    return number & (2**31 - 1), int(rng.integers(-1, 4)) if kind in (Row.C_SIDE, Row.D_SIDE) else 0


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ((CLOSED, 0, 0), [(STICK, 0, 0), *((SLIDE, k, 0) for k in OCTANTS)], ""),
        ((CLOSED, 0, 0), [(STICK, 0, 0), *((SLIDE, k, 0) for k in range(8, 15))], "needs the patches 8 to 15"),
        ((CLOSED, 0, 0), [(SLIDE, k, 0) for k in OCTANTS], "needs STICK"),
        ((CLOSED, 0, 0), [(STICK, 0, 0), *((SLIDE, k, 1) for k in OCTANTS)], "needs the patches 8 to 15"),
        ((CLOSED, 0, 0), [(STICK, 0, 0), (SLIDE, 0, TURN // 2), (SLIDE, TURN // 2, TURN)], "needs the patches"),
        ((SLIDE, 9, 0), [(SLIDE, 18, 0), (SLIDE, 19, 0)], ""),
        ((SLIDE, 9, 0), [(SLIDE, 18, 0), (SLIDE, 18, 0)], "needs the patches 18 to 19"),
        ((SLIDE, 9, 0), [(SLIDE, 18, 0), (SLIDE, 20, 0)], "needs the patches 18 to 19"),
        ((SLIDE, 9, 0), [(SLIDE, 19, 0)], "needs the patches 18 to 19"),
        ((SLIDE, 1 << 30, 0), [(SLIDE, 1 << 31, 0), (SLIDE, (1 << 31) + 1, 0)], "needs the patches"),
        ((STICK, 0, 0), [(SLIDE, 8, 0)], "decided already"),
    ],
)
def test_splits(old: tuple[int, int, int], new: list[tuple[int, int, int]], fault: str) -> None:
    found = checker._split_fault(QUESTION, 0, list(old), new)
    assert found.startswith(fault) if fault == "" else fault in found
    assert bool(found) == bool(fault)


def test_soft_rows_of_a_point_contact_are_refused() -> None:
    hard = Question(coin(torsion=0.0), wrench=np.array([30.0, 0, 0, 0, 0, 0]))
    for kind in SOFT:
        c = empty(hard, None, [(kind, 0, 8, 0)], np.ones(1))
        case = np.zeros((1, 3, 3), dtype=np.int64)
        case[0, 0] = SLIDE, 8, 0
        assert not checker.legal(c, case, *bounds(hard, None)).any()


def test_a_certificate_that_is_changed() -> None:
    """Every patch, side, direction and multiplier of soft rows matters."""
    rng = np.random.default_rng([5, 99])
    c = check(random_grasp(rng), random_load(rng)).certificate
    assert checker.verify(c).ok
    soft = np.flatnonzero(c.kind > Row.ENERGY)
    assert {Row.SOFT_TANGENT, Row.SOFT_CHORD, Row.C_SIDE, Row.D_SIDE} <= {Row(k) for k in c.kind[soft]}
    refused = 0
    for r in soft:
        for name, change in (("multiplier", lambda x: 1.5 * x), ("a", lambda x: x ^ 1), ("b", lambda x: (x + 1) % 3)):
            if (name == "b" and c.kind[r] not in (Row.C_SIDE, Row.D_SIDE)) or c.kind[r] == Row.SOFT_TANGENT:
                continue
            value = getattr(c, name).copy()
            value[r] = change(value[r])
            refused += not checker.verify(replace(c, **{name: value})).ok
    assert refused > 0
    slides = np.flatnonzero((c.state == SLIDE) & (c.left > 0))
    assert len(slides)
    for node in slides:
        left = c.left.copy()
        left[node] ^= 1
        assert not checker.verify(replace(c, left=left)).ok
