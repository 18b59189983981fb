"""Proofs of the engine, and their leaves worked out in exact arithmetic by other code than the checker's."""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache

import numpy as np

from benchmarks.grasps import random_case
from handfast.core.answer import Stop
from handfast.stability.certify import checker, farkas
from handfast.stability.certify.certificate import Columns, Row
from handfast.stability.queries import check, maximum
from handfast.stability.settings import Settings
from tests.support.certificates import (
    AS_WRITTEN,
    CLOSED,
    LOCKED,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    Known,
    exact_equations,
    row,
)

SEEDS = [(3, 1), (3, 2), (3, 3), (4, 1)]  # contacts, seed
ONE_IN_A_THOUSAND = Settings(gap=1e-3)


def refused(certificate, match: str) -> None:
    answer = checker.verify(certificate)
    assert not answer.ok
    assert "\n" not in answer.reason
    assert re.search(match, answer.reason), answer.reason


@cache
def bounded(m: int, seed: int):
    """The largest load of a random grasp, with its certificate."""
    case = random_case(m, seed)
    answer = maximum(case.grasp, case.direction, settings=ONE_IN_A_THOUSAND)
    assert answer.stop is Stop.COMPLETE
    return case, answer


@cache
def slips(m: int, seed: int):
    """The certificate that a little more than the largest load is not resisted; None where there is no largest."""
    case, answer = bounded(m, seed)
    if answer.unbounded:
        return None
    return check(case.grasp, 1.01 * answer.upper * case.direction, settings=ONE_IN_A_THOUSAND).certificate


def certificates():
    """Of the engine, for random grasps: one of each kind of question."""
    return [c for key in SEEDS for c in (bounded(*key)[1].certificate, slips(*key)) if c is not None]


def exact_margin(c, leaf, cases):
    """y b + v h over its terms, of multipliers near the file's that cancel exactly; None if no such are found.

    Rows and equations are those of `certificates`, all numbers are fractions. Forces of open contacts are 0. Where
    the equations alone contradict each other, the multipliers do not matter.
    """
    q, at = c.question, Columns.of(c.question)
    E, h, Z = exact_equations(q)
    known, m = Known.of(c), q.grasp.m
    zero = {k for i in range(m) if cases[leaf, i, 0] == OPEN for k in range(at.c.start + 3 * i, at.c.start + 3 * i + 3)}
    rows, right, w, free = [], [], [], []
    for r in range(c.start[leaf], c.start[leaf + 1]):
        name = tuple(int(u[r]) for u in (c.kind, c.index, c.a, c.b))
        entries, b = row(c, known, *name, AS_WRITTEN)
        x = {}
        for place, value in entries.items():
            terms = {place: 1} if place < at.n else Z[place - at.n]
            for k, z in terms.items():
                x[k] = x.get(k, Fraction(0)) + Fraction(value) * z
        rows.append(x)
        right.append(Fraction(b))
        w.append(float(c.multiplier[r]))
        free.append(is_equation(q, Row(name[0]), name[1], cases[leaf]))
    count = len(rows)
    rows, right, free = rows + E, right + h, free + [True] * len(E)
    rows = [{k: v for k, v in x.items() if v and k not in zero} for x in rows]
    A = np.array([[float(x.get(k, 0)) for k in range(at.n)] for x in rows])
    b = np.array([float(x) for x in h])
    near = np.linalg.lstsq(A[count:].T, -(np.array(w) @ A[:count]), rcond=1e-10)[0] if count else 0 * b
    found = []
    for y, v in ((w, near), (0 * np.array(w), b - A[count:] @ np.linalg.lstsq(A[count:], b, rcond=1e-10)[0])):
        exact = cancelled(rows, [Fraction(float(x)) for x in [*y, *v]], free, known.scale)
        if exact is None or any(x < 0 and not any_sign for x, any_sign in zip(exact, free, strict=True)):
            continue
        terms = [x * r for x, r in zip(exact, right, strict=True)]
        size = sum(abs(t) for t in terms)
        found.append(sum(terms) / size if size else Fraction(0))
    return next((margin for margin in found if margin > 0), found[0] if found else None)


def is_equation(q, kind, index, case) -> bool:
    """Does this inequality hold with equality in its case, so that its multiplier may have any sign?"""
    contact = case[index, 0] if index < q.grasp.m else -1
    actuator = case[q.grasp.m + index, 0] if index < q.grasp.mechanism.a else -1
    if kind in (Row.GAP_UP, Row.GAP_DOWN):
        return bool(q.eta == 0 and contact in (CLOSED, STICK, SLIDE))
    if kind in (Row.T_UP, Row.T_DOWN):
        return bool(actuator == LOCKED or not q.may_move[index])
    if kind in (Row.E_UP, Row.E_DOWN):
        return bool(actuator == MOVES and not q.is_driven[index])
    return Row.STILL_1_UP <= kind <= Row.STILL_2_DOWN


def cancelled(rows, w, free, scale):
    """Multipliers near w whose sum of rows is exactly 0: what is missing is made up by equations first, then by the
    inequalities that count most. Rows that differ from others by little more than rounding are left as they are, as
    long as the others do. None if the rows do not allow it."""

    def size(x):
        return max((abs(float(v)) * scale[k] for k, v in x.items()), default=0.0)

    order = sorted(range(len(rows)), key=lambda j: (not free[j], -abs(float(w[j])) * size(rows[j])))
    missing = {}
    for y, x in zip(w, rows, strict=True):
        for k, v in x.items():
            missing[k] = missing.get(k, Fraction(0)) + y * v
    basis, out = [], list(w)  # (pivot, row, of which rows it is made): echelon form
    for least in (1e-6, 0.0):
        left = []
        for j in order:
            entries, made = dict(rows[j]), {j: Fraction(1)}
            for pivot, other, parts in basis:
                if entries.get(pivot):
                    factor = entries[pivot] / other[pivot]
                    add(entries, other, -factor)
                    add(made, parts, -factor)
            entries = {k: v for k, v in entries.items() if v}
            if size(entries) <= least * size(rows[j]):
                left.append(j)
                continue
            pivot = max(entries, key=lambda k: abs(float(entries[k])) * scale[k])
            basis.append((pivot, entries, made))
            if missing.get(pivot):
                factor = missing[pivot] / entries[pivot]
                add(missing, entries, -factor)
                for k, v in made.items():
                    out[k] -= factor * v
        if not any(missing.values()):
            return out
        order = left
    return None


def add(x, y, factor) -> None:
    """x += factor * y, as sparse rows."""
    for k, v in y.items():
        x[k] = x.get(k, Fraction(0)) + factor * v


def compare(c, most: int = 15) -> int:
    """Every leaf that the checker accepts is proved in exact arithmetic too; returns how many were compared."""
    cases = checker.leaf_cases(c)
    margins = farkas.proved_margins(c, cases)
    assert (margins > 0).all()
    chosen = np.random.default_rng(0).permutation(len(margins))[:most]
    for leaf in chosen.tolist():
        exact = exact_margin(c, leaf, cases)
        assert exact is not None, f"leaf {leaf}: no multipliers near those of the file cancel"
        assert exact > 0, f"leaf {leaf}"
    return len(chosen)
