"""Rows about the commands of a path: what each says of any unknowns, written down anew from the maps of the grasp."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.path_commands import CLOSED, LOCKED, MOVED, OPEN, PathCommands, PathRow
from handfast.proofs.question import read_question
from tests.support.small_grasp import small_grasp

LOAD = np.array([1.0, 2, 3, 4, 5, 6])


def small(sums: bool) -> PathCommands:
    """Of pull, a tendon, and push, in its negative sense; "back" carries 1/2."""
    grasp = small_grasp() | {"preload": {"push": -0.75, "pull": 3, "back": 0.5}}
    asked = {"goal": "check", "wrench": LOAD.tolist(), "force_limit": 8, "torque_limits": {"push": 2}}
    return PathCommands(read_question({"grasp": grasp} | asked, "q"), np.array([1.0, -1, 0]), sums)


def said(row: PathRow, z: Array) -> float:
    """By how much more than its right side."""
    return float(sum(int(v.p) / int(v.q) * z[k] for k, v in row.terms.items()) - int(row.right.p) / int(row.right.q))


def parts(of: PathCommands, z: Array, x: int) -> tuple[Array, ...]:
    """Of state x: the motion (r, q), forces of `GraspData.rows`, and motions of these."""
    g = of.question.grasp
    own = z[of.at(x, 0) : of.at(x + 1, 0)]
    v, phi = own[: 6 + g.l], np.append(own[6 + g.l :], 0.0)
    return v, phi, g.rows[0] @ v


def of_state(of: PathCommands, z: Array, x: int) -> list[tuple[float, bool]]:
    """All rows of a state, and which are equalities, in their order."""
    g = of.question.grasp
    v, phi, d = parts(of, z, x)
    actuators, joints = g.parts[2], g.parts[4]
    given = phi.copy()
    given[actuators.start + 2] = 0.5  # backdrivable
    share = z[of.share(x)] if x else 1.0
    missed = g.rows[0].T @ given + np.r_[share * LOAD, g.torque]
    q, f, reaction = v[6:], phi[actuators], phi[joints]
    out = [(y, True) for y in [*missed[:6], *-missed[6:], 3 * q[1] - q[2]]]
    for i in range(2):
        c = phi[3 * i : 3 * i + 3]
        gap = d[3 * i] + c[0]
        out += [(c[0], False), (gap, False), *((y, True) for y in [*c, *phi[6:7][i:]]), (gap, True), (8 - c[0], False)]
    laws = [reaction[0] + 0.25, 0.25 - reaction[0], reaction[1], -reaction[1], -q[2], -reaction[2]]
    pulled = 2 * q[0] - q[1], f[0]
    return out + [(y, False) for y in [*laws, *pulled, f[1] + 2, 2 - f[1]]]


def of_commands(of: PathCommands, z: Array) -> list[tuple[float, bool]]:
    (f0, m0), (f1, m1), (f2, m2) = ((p[1][7:10], p[2][7:10]) for p in (parts(of, z, x) for x in range(3)))
    cost = [z[of.effort(k)] if of.sums else z[of.measure] for k in (1, 2)]
    share = z[of.share(1)], z[of.share(2)]
    out = [(m1[0] - m0[0], True)]  # the tendon closed as far as at the end; where it moves, forces are no less
    out += [(y, False) for y in (f0[0] - f1[0], f2[0] - f1[0], m0[0] - m2[0], f1[0], cost[0] - f1[0])]
    out += [(share[0], False), (1 - share[0], False), (m0[1] - m2[1], True)]
    for f, m in ((f0, m0), (f1, m1), (f2, m2)):
        out += [(-m[1], False), (-m[1], True)]
        if f is not f2:
            out.append((f2[1] - f[1], False))
        if f is f1:
            out.append((m1[1] - m0[1], False))
    out += [(y, False) for y in (-f2[1], cost[1] + f2[1], share[1], 1 - share[1])]
    if of.sums:
        out += [(z[of.measure] - cost[0] - cost[1], True), (cost[0], False), (cost[1], False)]
    return [*out, (z[of.measure], False)]


@pytest.mark.parametrize("sums", [False, True])
def test_what_every_row_says_of_any_unknowns(sums: bool) -> None:
    of = small(sums)
    z = np.random.default_rng(0).integers(-8, 9, of.n).astype(float)
    rows = of.rows
    wanted = [*(row for x in range(3) for row in of_state(of, z, x)), *of_commands(of, z)]
    assert [row.equal for row in rows] == [equal for _, equal in wanted]
    np.testing.assert_allclose([said(row, z) for row in rows], [y for y, _ in wanted], rtol=1e-14, atol=1e-13)
    held = [row.condition for row in rows if row.condition]
    contacts = [(x * 2 + i, OPEN) for x in range(3) for i in (0, 1) for _ in range(4 - i)]
    assert [c for c in held if c[0] < 6 and c[1] == OPEN] == contacts
    assert [c for c in held if c[0] < 6 and c[1] == CLOSED] == [(k, CLOSED) for k in range(6)]
    assert [c for c in held if c[0] >= 6] == [(6, MOVED)] * 5 + [
        *((7, c) for c in (LOCKED, MOVED, LOCKED, MOVED, MOVED, LOCKED, MOVED, MOVED))
    ]


def test_what_a_tangent_says() -> None:
    """Friction (-0.6, 0.8) 5 and 2 of torsion, times 12 over the lever, along (3, 4, 12): 13 mu c_n and no more."""
    of = small(False)
    for x, i in ((0, 0), (1, 0), (2, 1)):
        z = np.zeros(of.n)
        z[of.at(x, 2, 3 * i) : of.at(x, 2, 3 * i) + 3] = 8.0, -3.0, 4.0
        z[of.at(x, 3)] = 2.0
        along = np.array([3.0, 4, 12]) if i == 0 else np.array([3.0, 4])
        row = of.tangent(x, i, along)
        assert not row.equal
        assert said(row, z) == pytest.approx(0.5 * 13 * 8 - 7 - 24 if i == 0 else 0.75 * 5 * 8 - 7, rel=1e-9)
