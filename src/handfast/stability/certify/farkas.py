"""The proof of a leaf without any bound on motions or forces: multipliers that cancel every unknown exactly.

A leaf's case and the equations of the model say, of the unknowns x (see `certificate.Columns`),

    F x >= b,   E x = h.

The leaf is empty if there are y (>= 0 where a row is an inequality) and v with y F + v E = 0 and y b + v h > 0. A
sum that is only nearly 0 proves nothing, as motions have no bound. A file has y as rounded numbers, and v follows
from it by least squares; `proved_margins` shows that multipliers near them cancel exactly:

- In floating point, all leaves at once: where the rows that are involved have full rank, a correction of
  bounded size exists (`leaf_systems`). A right inverse P and |B P - 1| < 1 show the rank.
- In rational arithmetic, leaf by leaf, where ranks are lost: two fingertips that stick do not keep an object
  from turning about the line through them, and rounded numbers do not show it (`rational`).

All of F, b, E, h but the grasp map and the Jacobian are floating-point numbers taken as they are. G and J come
from the file's positions, axes and contact frames exactly. Rows of the friction cone are wider than the cone by
`WIDER`, which covers directions and frames that are of unit length, and at right angles, to rounding only. Sides of
sectors are not: a case says on which side of a direction, as its numbers are, friction and -d_t lie.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.certify.certificate import Certificate, Integers, Row
from handfast.stability.certify.leaf_rows import bounds, rows_of
from handfast.stability.certify.leaf_systems import LeafSystems, SharedSystem

CHUNK, NUMBERS = 256, 1_000_000  # leaves, and numbers of their systems, in memory at a time
SLIGHT = 1e-10  # relative: a contradiction no larger than this is one of rounding, in the question's own numbers


class Late(Exception):
    """It was to end before."""


def proved_margins(
    certificate: Certificate, cases: Integers, known: dict[bytes, float] | None = None, until: float = np.inf
) -> Array:
    """(L,) y b + v h of every leaf, relative to its terms; positive is a proof, -inf is none.

    A margin below `SLIGHT` is none: two contacts hold no torque about their line, and a load that was computed misses
    what they do hold by 1e-17. A witness may miss the equations by 1e-9.

    cases: (L, m+a, 3) of `verify.leaf_cases`.
    known: leaves of this question and range that were judged before, and their margins; those judged now are added.
    until: [s] of `time.monotonic`, after which `Late` is raised.
    """
    c, q = certificate, certificate.question
    known = {} if known is None else known
    names = [_name(c, cases, k) for k in range(len(c.leaves))]
    new = np.array([name not in known for name in names], dtype=bool)
    system, (lo, hi) = SharedSystem.of(q), bounds(q, c.scalar)
    counts = np.diff(c.start)
    margins = np.full(len(c.leaves), -np.inf)
    order = np.argsort(counts, kind="stable")  # leaves of like size together: little is wasted on padding
    order = order[new[order]]
    exact: Any = None  # `ExactRows`, slow to import
    size = (int(counts.max(initial=0)) + len(system.E)) * system.E.shape[1]
    chunk = max(1, min(CHUNK, NUMBERS // size))
    for begin in range(0, len(order), chunk):
        if begin and time.monotonic() > until:
            raise Late
        chosen = order[begin : begin + chunk]
        some, case = c.some(chosen), cases[chosen]
        rows = rows_of(some, np.repeat(case[:, :, 0], counts[chosen], axis=0), lo, hi)
        leaves = LeafSystems.of(some, rows, system, case, np.arange(len(chosen)))
        margins[chosen] = leaves.margins()
        for k in np.flatnonzero(~(margins[chosen] > 0)):
            if time.monotonic() > until:
                raise Late
            if exact is None:
                from handfast.stability.certify.exact_rows import ExactRows

                exact = ExactRows.of(q)
            margins[chosen[k]] = exact.margin(leaves, int(k), rows)
    known |= {name: float(margin) for name, margin, fresh in zip(names, margins, new, strict=True) if fresh}
    margins = np.array([known[name] for name in names])
    return np.where(margins > SLIGHT, margins, -np.inf)


def _name(c: Certificate, cases: Integers, leaf: int) -> bytes:
    """All that a leaf's proof is made of."""
    rows = slice(c.start[leaf], c.start[leaf + 1])
    of_energy = c.kind[rows] == Row.ENERGY
    index = np.where(of_energy, 0, c.index[rows])
    parts = cases[leaf], c.kind[rows], index, c.a[rows], c.b[rows], c.multiplier[rows]
    return b"".join(x.tobytes() for x in (*parts, c.references[c.index[rows][of_energy]]))
