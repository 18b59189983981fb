"""Which row of a node's program is violated most, compiled: rows are named here and made by `rows`."""

from __future__ import annotations

import numpy as np

from handfast.stability.search.kernel.compiled import inner, larger
from handfast.stability.search.rows import (
    ANGLE,
    C_LEFT,
    C_RIGHT,
    CHORD,
    CLOSED,
    CN_DOWN,
    CN_UP,
    D_LEFT,
    D_RIGHT,
    DN_UP,
    E_DOWN,
    E_UP,
    GAP_DOWN,
    GAP_UP,
    INDEX,
    KIND,
    LOCKED,
    MOVES,
    OPEN,
    PLAIN_DOWN,
    PLAIN_UP,
    S_UP,
    SLIDE,
    STICK,
    STILL,
    T_DOWN,
    T_UP,
    TANGENT,
    TURN,
)

FEASIBLE = 1e-9  # a row that is violated by less is met


@inner
def trigonometry(m, state, trig):  # type: ignore[no-untyped-def]
    """Sector ends as unit vectors into trig (m, 4): cos and sin of the left end, of the right end."""
    turn = 2 * np.pi / TURN
    for i in range(m):
        for k in range(2 if state[2 * m + i] > state[m + i] else 0):
            angle = state[(k + 1) * m + i] * turn
            trig[i, 2 * k] = np.cos(angle)
            trig[i, 2 * k + 1] = np.sin(angle)


@inner
def price(m, a, F, cos, sin, mu, lo, hi, driven, state, trig, c, d, tol, cone, skip):  # type: ignore[no-untyped-def]
    """The id of the row of the node that is violated most, -1 if none is by more than `tol` (round ones: `cone`).

    The rows of part k (contact, actuator, plain value) are left out if skip[k].
    """
    worst = tol
    found = -1
    loose = cone - FEASIBLE  # what is made where it is violated may be missed by a little more
    for i in range(m):
        if skip[i]:
            continue
        touch = state[i]
        la = state[m + i]
        lb = state[2 * m + i]
        k = 3 * i
        cn = c[k]
        c1 = c[k + 1]
        c2 = c[k + 2]
        d1 = d[k + 1]
        d2 = d[k + 2]
        here = i << INDEX
        gap = cos * d[k]
        if -cn > worst:
            worst = -cn
            found = here | (CN_UP << KIND)
        x = np.sqrt(c1 * c1 + c2 * c2) - mu[i] * cn - loose
        if x > worst:
            worst = x
            found = here | (TANGENT << KIND)
        reach = 0.0  # sin(eta) |d_t|, from above
        if lb > la:
            xa = trig[i, 0]
            ya = trig[i, 1]
            xb = trig[i, 2]
            yb = trig[i, 3]
            h = 1.0 + xa * xb + ya * yb
            x = xa * d2 - ya * d1
            if x > worst:
                worst = x
                found = here | (D_LEFT << KIND) | (la << ANGLE)
            x = yb * d1 - xb * d2
            if x > worst:
                worst = x
                found = here | (D_RIGHT << KIND) | lb
            reach = -sin * ((xa + xb) * d1 + (ya + yb) * d2) / h
            if touch == SLIDE:
                x = 0.5 * (mu[i] * h * cn - (xa + xb) * c1 - (ya + yb) * c2)
                if x > worst:
                    worst = x
                    found = here | (CHORD << KIND) | (la << ANGLE) | lb
                x = ya * c1 - xa * c2
                if x > worst:
                    worst = x
                    found = here | (C_LEFT << KIND) | (la << ANGLE)
                x = xb * c2 - yb * c1
                if x > worst:
                    worst = x
                    found = here | (C_RIGHT << KIND) | lb
        elif touch == STICK:
            reach = -sin * d1  # d_t = 0 there: any direction will do
        if sin == 0.0 or lb > la or touch == STICK:
            kind = GAP_UP
            x = -cn - gap - reach
            if touch == OPEN:
                kind = DN_UP
                x = -gap - reach
            if x > worst:
                worst = x
                found = here | (kind << KIND) | (la << ANGLE) | lb
        if touch == OPEN:
            if cn > worst:
                worst = cn
                found = here | (CN_DOWN << KIND)
        elif touch >= CLOSED:
            x = cn + gap
            if sin > 0.0:
                x += sin * np.sqrt(d1 * d1 + d2 * d2) - loose
            if x > worst:
                worst = x
                found = here | (GAP_DOWN << KIND)
            if touch == STICK:
                x = larger(abs(d1), abs(d2))
                if x > worst:
                    worst = x
                    kind = STILL + (0 if abs(d1) == x else 2)
                    kind += 1 if (d1 if abs(d1) == x else d2) > 0.0 else 0
                    found = here | (kind << KIND)
    for j in range(a):
        if skip[m + j]:
            continue
        moves = state[3 * m + j]
        k = 3 * m + 2 * j
        t = d[3 * m + j]
        here = j << INDEX
        if -t > worst:
            worst = -t
            found = here | (T_UP << KIND)
        if moves == LOCKED and t > worst:
            worst = t
            found = here | (T_DOWN << KIND)
        if (moves == MOVES or not driven[j]) and -c[k] > worst:
            worst = -c[k]
            found = here | (E_UP << KIND)
        if moves == MOVES:
            x = -c[k + 1] if driven[j] else c[k]
            if x > worst:
                worst = x
                found = here | ((S_UP if driven[j] else E_DOWN) << KIND)
    for k in range(lo.shape[0]):
        if skip[m + a + k]:
            continue
        at = 3 * m + 2 * a + k
        x = c[at] if at < F else d[at - F + 3 * m + a]
        if lo[k] - x > worst:
            worst = lo[k] - x
            found = (k << INDEX) | (PLAIN_UP << KIND)
        if x - hi[k] > worst:
            worst = x - hi[k]
            found = (k << INDEX) | (PLAIN_DOWN << KIND)
    kind = found >> KIND
    if found >= 0 and (kind == TANGENT or (kind == GAP_DOWN and sin > 0.0)):  # where it is violated most
        i = (found >> INDEX) & 255
        k = 3 * i
        x = c[k + 1] if kind == TANGENT else -d[k + 1]
        y = c[k + 2] if kind == TANGENT else -d[k + 2]
        steps = TURN // 4 if state[i] == OPEN else 1  # tangents along the axes bring c_t to zero at once
        angle = int(np.rint(np.arctan2(y, x) * (TURN / (2 * np.pi * steps)))) * steps
        found |= (angle % TURN) << ANGLE
    return found
