"""Certificates with something changed, and margins of version 1 in exact arithmetic."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np

from handfast.stability.certify import checker
from handfast.stability.certify.claim import Claim, equality_multipliers, weighed_rows
from tests.support.certificates import (
    UNIT_LENGTHS,
    row,
)


def refused(certificate, match):
    answer = checker.verify(certificate)
    assert not answer.ok
    assert "\n" not in answer.reason
    assert re.search(match, answer.reason), answer.reason


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
    cases = checker.leaf_cases(c)
    leaf = int(np.flatnonzero(cases[:, part, 0] == state)[0])
    return leaf, *cases[leaf, part, 1:].tolist()
