"""Polynomials of degree two at most in numbered variables, as sums of monomials."""

from __future__ import annotations

import numpy as np

Polynomial = dict[tuple[int, ...], float]  # (): constant, (i,): of q_i, (i, j) with i <= j: of q_i q_j


def monomial(i: int | np.intp, j: int | np.intp, value: float = 1.0) -> Polynomial:
    """value q_i q_j."""
    return {(min(int(i), int(j)), max(int(i), int(j))): float(value)}


def scaled(p: Polynomial, value: float) -> Polynomial:
    """value p."""
    return {m: value * v for m, v in p.items()}


def total(*terms: Polynomial) -> Polynomial:
    """Their sum."""
    out: Polynomial = {}
    for term in terms:
        for m, v in term.items():
            out[m] = out.get(m, 0.0) + float(v)
    return out


def multiplied(p: Polynomial, q: Polynomial) -> Polynomial:
    """Their product; each of degree one at most."""
    return total(*({tuple(sorted(m + n)): v * w} for m, v in p.items() for n, w in q.items()))
