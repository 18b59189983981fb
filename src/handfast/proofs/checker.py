"""Checks a certificate with arithmetic alone: no solver, nothing of the search that wrote it.

Four things are checked: the tree's splits leave out no case (`cases`); every row that a leaf cites holds in the leaf's
case (`rows`); no multiplier is negative; and the rows, weighed by their multipliers, contradict the equilibrium
(`leaves`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.proofs import rows
from handfast.proofs.cases import BadCertificate, leaf_cases
from handfast.proofs.certificate import CHECKED_LEAVES, Certificate
from handfast.proofs.equations import RightSide, equations_of
from handfast.proofs.fields import Integers, Mask
from handfast.proofs.kinds import Row
from handfast.proofs.leaves import CitedRows, Late, LeafSystems, in_time
from handfast.proofs.rows import Columns, LeafRows, zeros
from handfast.proofs.tolerance import ENOUGH_CAP, MIN_FORCE_SCALE, MIN_SIZE, TOO_SMALL, drives, in_play, size_of

LEAF_BATCH = CHECKED_LEAVES  # leaves whose rows are in memory at a time
NO_TIME = "there was no time to check it all"


@dataclass(frozen=True)
class Checked:
    """What the checker found.

    Attributes:
        ok: is the claim proved?
        leaves: how many cases the proof has.
        margin: the smallest relative margin by which a leaf is proved; -inf if it did not come to that.
        reason: empty if ok, else one line: which node, leaf or row, and what is wrong with it.
        unproved, capped: places of the leaves that are not proved, and that are up to a cap, if all else is right.
        cap: [N] the claim is proved for virtual motions up to here only; None without any end. The file has no say
            in it.
    """

    ok: bool
    leaves: int
    margin: float
    reason: str
    unproved: tuple[int, ...] = ()
    capped: tuple[int, ...] = ()
    cap: float | None = None


def verify(
    certificate: Certificate,
    until: float = np.inf,
    *,
    quick: bool = False,
    among: Integers | None = None,
    to_the_end: bool = True,
) -> Checked:
    """Does the certificate prove its claim?

    Args:
        certificate: what is to be checked.
        until: [s] of `time.monotonic`, when it is to give up.
        quick: refuse what floating-point arithmetic does not show at once.
        among: places of the leaves that are looked at, for a search: the others may be wrong. By default all.
        to_the_end: look at all leaves, for a search, though some are not proved; a wrong file is refused sooner.
    """
    c, q = certificate, certificate.question
    leaves = len(c.start) - 1
    asked = np.arange(leaves) if among is None else among
    try:
        in_time(until)
        cases = leaf_cases(q, c.parent, c.part, np.column_stack([c.state, c.left, c.right]))
        if len(cases) != leaves:
            raise BadCertificate(f"has rows for {leaves} leaves; the tree has {len(cases)}")
        in_time(until)
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
            equations = equations_of(q)
            right = RightSide.of(q, c.scalar, len(equations.E))
            if 0 < right.scale < MIN_FORCE_SCALE or q.grasp.size < MIN_SIZE:
                raise BadCertificate(TOO_SMALL)
            if q.homogeneous and not (c.scalar or (0.0,))[0] > 0:
                raise BadCertificate("covers no commands at all, with which actuators are locked")
            far = max((x for x in c.scalar or () if np.isfinite(x)), key=abs, default=0.0)
            # where states are multiples of each other the scalar is 1 / magnitude, and the load the direction itself
            acts = max(size_of(q.grasp, q.direction), far * drives(q)) if q.homogeneous else in_play(q, far)
            margins, caps = np.full(leaves, -np.inf), np.full(leaves, np.inf)

            def systems(some: Integers) -> LeafSystems:
                in_time(until)
                return LeafSystems(equations, right, checked_rows(c, cases, some), until)

            for some in _batches(asked):
                made = systems(some)
                margins[some] = made.proved()
                if quick and not (margins[some] > 0).all():
                    break
            left = asked[~(margins[asked] > 0)]
            if len(left) and not quick:
                for some in _batches(left if len(asked) > LEAF_BATCH else asked):
                    made = systems(some) if len(asked) > LEAF_BATCH else made
                    margins[some], caps[some] = made.more_exactly(margins[some], float(caps.min()), ENOUGH_CAP * acts)
                    if not to_the_end and not (margins[some] > 0).all():
                        break
    except BadCertificate as fault:
        return Checked(False, leaves, -np.inf, str(fault))
    except Late:
        return Checked(False, leaves, -np.inf, NO_TIME)
    bad, cap = asked[~(margins[asked] > 0)], float(caps[asked].min(initial=np.inf))
    reason = f"leaf {bad[0]} (node {c.leaves[bad[0]]}) is not proved: margin {margins[bad[0]]:.3g}" if len(bad) else ""
    limit = cap if cap < np.inf and not len(bad) else None
    capped = tuple(asked[caps[asked] < np.inf].tolist())
    return Checked(
        not len(bad), leaves, float(margins[asked].min(initial=np.inf)), reason, tuple(bad.tolist()), capped, limit
    )


def _batches(leaves: Integers) -> list[Integers]:
    return [leaves[k : k + LEAF_BATCH] for k in range(0, len(leaves), LEAF_BATCH)]


def checked_rows(c: Certificate, cases: Integers, leaves: Integers) -> CitedRows:
    """The rows of some leaves as numbers, cases of all.

    `BadCertificate` for the first row that is none, or need not hold, or has no multiplier >= 0.
    """
    q, first, cases = c.question, c.start[leaves], cases[leaves]
    count = c.start[leaves + 1] - first
    start, leaf = np.append(0, np.cumsum(count)), np.repeat(np.arange(len(leaves)), count)
    cited = (first - start[:-1])[leaf] + np.arange(start[-1])
    kind, index, a, b = (x[cited] for x in (c.kind, c.index, c.a, c.b))
    multiplier = c.multiplier[cited]
    some = LeafRows(kind, index, a, b, leaf, c.references)

    def refuse(bad: Mask, why: str) -> None:
        if bad.any():
            r = int(np.flatnonzero(bad)[0])
            k = leaves[leaf[r]]
            place = f"leaf {k} (node {c.leaves[k]}), row {r - start[leaf[r]]}"
            name = Row(kind[r]).name if kind[r] in rows.ROW_KINDS else kind[r]
            raise BadCertificate(f"{place}, {name} {index[r]} [{a[r]}, {b[r]}]: {why}")

    refuse(~rows.known(q, some), "no such kind, contact, actuator, column or reference")
    refuse(~(np.isfinite(multiplier) & (multiplier >= 0)), "the multiplier is negative or not finite")
    refuse(~rows.legal(q, c.scalar, some, cases), "does not hold in this case")
    once, which = rows.different(some)
    value, right = rows.row_values(q, c.scalar, once)
    at = Columns.of(q)
    return CitedRows(
        value=value,
        right=right,
        which=which,
        either=rows.equalities(q, some, cases),
        y=multiplier.astype(np.float64),
        start=start,
        zero=zeros(q, cases),
        first=(kind == Row.BOUND_UP) & (index == at.scalar.start) & q.has_scalar,
        energy=kind == Row.ENERGY,
    )
