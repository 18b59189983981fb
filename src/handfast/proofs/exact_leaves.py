"""The proof of one leaf in rational arithmetic, where rounding does not show it: the second way of `leaves`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq, fmpq_mat

from handfast.proofs.rational import ZERO, dot, rational, rounded

if TYPE_CHECKING:
    from handfast.proofs.leaves import LeafSystems


NONE = -np.inf, np.inf


def exact_margin(systems: LeafSystems, leaf: int) -> tuple[float, float]:
    """y b + v h less the slack, relative, of multipliers that cancel exactly and are near a leaf's; -inf if none are.

    The multipliers of the basis are solved for in the kept columns; then all columns have to cancel but those that are
    left over, which make the second number: [N] the cap on motions that leaves half of the margin, inf if none does.
    """
    s, q, exact = systems, systems.equations, systems.equations.exact
    own = np.arange(s.rows.start[leaf], s.rows.start[leaf + 1])
    own = own[s.used[own]]
    ties = np.flatnonzero(s.v[leaf])
    y, v = s.y[own] / s.unit[own], s.v[leaf, ties] / q.unit[ties]
    if not (np.isfinite(y).all() and np.isfinite(v).all()):
        return NONE
    rows = [*(exact.row(s.rows.value[k]) for k in own), *(exact.E[k] for k in ties)]
    table = [row for row, _ in rows]
    w = [rational(x) / factor for x, (_, factor) in zip([*y, *v], rows, strict=True)]  # of rows in whole numbers
    basis = np.flatnonzero(np.concatenate([s.basis[own], s.basis_E[leaf, ties]])).tolist()
    columns = np.flatnonzero(s.columns[leaf]).tolist()
    if len(basis) != len(columns):
        return NONE
    if basis:
        others = sorted(set(range(len(table))) - set(basis))
        matrix = fmpq_mat(len(basis), len(basis), [fmpq(table[j].get(i, 0)) for i in columns for j in basis])
        right = [-dot((w[j] for j in others), (fmpq(table[j].get(i, 0)) for j in others)) for i in columns]
        try:
            found = matrix.solve(fmpq_mat(len(basis), 1, right))
        except ZeroDivisionError:  # singular
            return NONE
        for place, j in enumerate(basis):
            w[j] = found[place, 0]
    free = np.concatenate([s.rows.either[own], np.ones(len(ties), dtype=bool)])
    if any(x < 0 for x, any_sign in zip(w, free, strict=True) if not any_sign):
        return NONE
    total = {i: dot(w, (fmpq(row.get(i, 0)) for row in table)) for i in np.flatnonzero(s.alive[leaf]).tolist()}
    if any(x != 0 and not s.left[leaf, i] for i, x in total.items()):
        return NONE

    w = [x * factor for x, (_, factor) in zip(w, rows, strict=True)]  # of rows as they are
    idle = [k for k in range(s.rows.start[leaf], s.rows.start[leaf + 1]) if not s.used[k]]
    terms = [x * rational(b) for x, b in zip(w, [*s.rows.right[own], *s.side.h[ties]], strict=True)]
    terms += [rational(s.rows.y[k]) * rational(s.rows.right[k]) for k in idle]
    size = sum((abs(x) for x in terms), ZERO)
    if size == 0:
        return NONE
    multipliers = np.zeros((1, len(s.E)))
    multipliers[0, ties] = [rounded(x) for x in w[len(own) :]]
    slack, grows = s.side.costs(q.about, multipliers, np.zeros_like(multipliers))
    pushes, energy = (
        rounded(sum((x for x, k in zip(w, own, strict=False) if which[k]), ZERO))
        for which in (s.rows.first, s.rows.energy)
    )
    cost = (slack[0] + energy * s.side.energy) * (1 + 1e-9) + s.side.grown(grows, np.array([pushes * (1 - 1e-9)]))[0]
    if not np.isfinite(cost):
        return NONE
    value = sum(terms, ZERO) - rational(cost)
    rest = np.zeros((1, len(s.alive[leaf])))
    rest[0, list(total)] = [rounded(x) for x in total.values()]
    weight = float(q.reach(rest, np.abs(rest) * 1e-9)[0])
    cap = max(rounded(value), 0.0) / (2 * weight) if weight > 0 else np.inf
    return rounded(value / size), cap
