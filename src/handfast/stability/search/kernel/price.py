"""Which row of a node's program is violated most, compiled: rows are named here and made by `values`."""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner, larger
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    BOUND_DOWN,
    BOUND_UP,
    C_LEFT,
    C_RIGHT,
    C_SIDE,
    CHORD,
    CLOSED,
    CN_DOWN,
    CN_UP,
    D_LEFT,
    D_RIGHT,
    D_SIDE,
    DN_UP,
    E_DOWN,
    E_UP,
    GAP_DOWN,
    GAP_UP,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    S_DOWN,
    S_UP,
    SLIDE,
    SOFT_CHORD,
    SOFT_TANGENT,
    STICK,
    STILL_1_UP,
    T_DOWN,
    T_UP,
    TANGENT,
    TURN_DIRECTIONS,
    TURN_DOWN,
    TURN_UP,
)
from handfast.stability.search.kernel.patch import MIDDLE, REACH, patch
from handfast.stability.search.rows import ANGLE, INDEX, KIND_SHIFT, SIDE_SHIFT

ROW_TOLERANCE = 1e-9  # a row that is violated by less is met


@inner
def trigonometry(question, node):
    """Sector ends as unit vectors, cos and sin of the left end, of the right end; patches of soft fingers."""
    turn = 2 * np.pi / TURN_DIRECTIONS
    m = question.m
    for i in range(m):
        if question.soft[i] >= 0:
            if node.state[i] == SLIDE:
                patch(node.state[m + i], node.trig[i], 0)
            continue
        for k in range(2 if node.state[2 * m + i] > node.state[m + i] else 0):
            angle = node.state[(k + 1) * m + i] * turn
            node.trig[i, 2 * k] = np.cos(angle)
            node.trig[i, 2 * k + 1] = np.sin(angle)


@inner
def price(question, hi, node, c, d, tolerance, cone):
    """The id of the row that forces c and motions d violate most, -1 if none is by more than `tolerance`.

    Round ones by more than `cone`. The rows of part k (contact, actuator, plain value) are left out if node.skip[k].
    """
    m = question.m
    worst = tolerance
    found = -1
    for i in range(m):
        if not node.skip[i]:
            worst, found = contact(i, question, node, c, d, cone - ROW_TOLERANCE, worst, found)
    for j in range(question.a):
        if not node.skip[m + j]:
            worst, found = actuator(j, question, node, c, d, worst, found)
    for k in range(question.lo.shape[0]):
        if not node.skip[m + question.a + k]:
            worst, found = plain(k, question, hi, c, d, worst, found)
    kind = found >> KIND_SHIFT
    if kind == SOFT_TANGENT:
        i = (found >> INDEX) & 255
        s = c[question.twist + question.soft[i]]
        steps = TURN_DIRECTIONS // 4 if node.state[i] == OPEN else 1
        around = int(np.rint(np.arctan2(c[3 * i + 2], c[3 * i + 1]) * (TURN_DIRECTIONS / (2 * np.pi * steps)))) * steps
        flat = np.sqrt(c[3 * i + 1] * c[3 * i + 1] + c[3 * i + 2] * c[3 * i + 2])
        up = int(np.rint(np.arctan2(s, flat) * (TURN_DIRECTIONS / (2 * np.pi * steps)))) * steps
        found |= ((around % TURN_DIRECTIONS) << ANGLE) | (up % TURN_DIRECTIONS)
    elif found >= 0 and (kind == TANGENT or (kind == GAP_DOWN and question.sin > 0.0)):  # where it is violated most
        i = (found >> INDEX) & 255
        k = 3 * i
        x = c[k + 1] if kind == TANGENT else -d[k + 1]
        y = c[k + 2] if kind == TANGENT else -d[k + 2]
        steps = (
            TURN_DIRECTIONS // 4 if node.state[i] == OPEN else 1
        )  # tangents along the axes bring c_t to zero at once
        angle = int(np.rint(np.arctan2(y, x) * (TURN_DIRECTIONS / (2 * np.pi * steps)))) * steps
        found |= (angle % TURN_DIRECTIONS) << ANGLE
    return found


@inner
def contact(i, question, node, c, d, loose, worst, found):
    """The worst violation so far and its row, with those of contact i.

    loose: by how much more a row that is made where it is violated may be missed.
    """
    m = question.m
    state = node.state[i]
    la = node.state[m + i]
    lb = node.state[2 * m + i]
    k = 3 * i
    cn = c[k]
    c1 = c[k + 1]
    c2 = c[k + 2]
    d1 = d[k + 1]
    d2 = d[k + 2]
    mu = question.mu[i]
    sin = question.sin
    here = i << INDEX
    gap = question.cos * d[k]
    if -cn > worst:
        worst = -cn
        found = here | (CN_UP << KIND_SHIFT)
    soft = question.soft[i] >= 0
    if soft:
        worst, found = twisting(i, question, node, c, d, loose, worst, found)
    else:
        x = np.sqrt(c1 * c1 + c2 * c2) - mu * cn - loose
        if x > worst:
            worst = x
            found = here | (TANGENT << KIND_SHIFT)
    reach = 0.0  # sin(eta) |d_t|, from above
    if lb > la and not soft:
        worst, found, reach = sector(i, question, node, c, d, worst, found)
    elif state == STICK:
        reach = -sin * d1  # d_t = 0 there: any direction will do
    if sin == 0.0 or lb > la or state == STICK:
        kind = GAP_UP
        x = -cn - gap - reach
        if state == OPEN:
            kind = DN_UP
            x = -gap - reach
        if x > worst:
            worst = x
            found = here | (kind << KIND_SHIFT)
            if not soft:
                found |= (la << ANGLE) | lb
    if state == OPEN:
        if cn > worst:
            worst = cn
            found = here | (CN_DOWN << KIND_SHIFT)
    elif state >= CLOSED:
        x = cn + gap
        if sin > 0.0:
            x += sin * np.sqrt(d1 * d1 + d2 * d2) - loose
        if x > worst:
            worst = x
            found = here | (GAP_DOWN << KIND_SHIFT)
        if state == STICK:
            x = larger(abs(d1), abs(d2))
            if x > worst:
                worst = x
                kind = STILL_1_UP + (0 if abs(d1) == x else 2)
                kind += 1 if (d1 if abs(d1) == x else d2) > 0.0 else 0
                found = here | (kind << KIND_SHIFT)
    return worst, found


@inner
def twisting(i, question, node, c, d, loose, worst, found):
    """The same with the rows of a soft finger's friction: in the ellipsoid, and in the patch in which it slides."""
    m = question.m
    k = 3 * i
    c1 = c[k + 1]
    c2 = c[k + 2]
    c3 = c[question.twist + question.soft[i]]
    d1 = d[k + 1]
    d2 = d[k + 2]
    d3 = d[question.turning + question.soft[i]]
    here = i << INDEX
    x = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3) - question.mu[i] * c[k] - loose
    if x > worst:
        worst = x
        found = here | (SOFT_TANGENT << KIND_SHIFT)
    if node.state[i] == STICK:
        x = abs(d3)
        if x > worst:
            worst = x
            found = here | ((TURN_DOWN if d3 > 0.0 else TURN_UP) << KIND_SHIFT)
    elif node.state[i] == SLIDE:
        here |= node.state[m + i]
        out = node.trig[i]
        x = question.mu[i] * out[REACH] * c[k] - out[MIDDLE] * c1 - out[MIDDLE + 1] * c2 - out[MIDDLE + 2] * c3
        if x > worst:
            worst = x
            found = here | (SOFT_CHORD << KIND_SHIFT)
        for side in range(3):
            n1 = out[3 * side]
            n2 = out[3 * side + 1]
            n3 = out[3 * side + 2]
            x = n1 * d1 + n2 * d2 + n3 * d3
            if x > worst:
                worst = x
                found = here | (side << SIDE_SHIFT) | (D_SIDE << KIND_SHIFT)
            x = -n1 * c1 - n2 * c2 - n3 * c3
            if x > worst:
                worst = x
                found = here | (side << SIDE_SHIFT) | (C_SIDE << KIND_SHIFT)
    return worst, found


@inner
def sector(i, question, node, c, d, worst, found):
    """The same with the rows that the sector of contact i brings, and how far it lets normals reach, sin(eta) |d_t|."""
    m = question.m
    la = node.state[m + i]
    lb = node.state[2 * m + i]
    k = 3 * i
    c1 = c[k + 1]
    c2 = c[k + 2]
    d1 = d[k + 1]
    d2 = d[k + 2]
    here = i << INDEX
    xa = node.trig[i, 0]
    ya = node.trig[i, 1]
    xb = node.trig[i, 2]
    yb = node.trig[i, 3]
    h = 1.0 + xa * xb + ya * yb
    x = xa * d2 - ya * d1
    if x > worst:
        worst = x
        found = here | (D_LEFT << KIND_SHIFT) | (la << ANGLE)
    x = yb * d1 - xb * d2
    if x > worst:
        worst = x
        found = here | (D_RIGHT << KIND_SHIFT) | lb
    reach = -question.sin * ((xa + xb) * d1 + (ya + yb) * d2) / h if question.sin > 0.0 else 0.0
    if node.state[i] == SLIDE:
        x = 0.5 * (question.mu[i] * h * c[k] - (xa + xb) * c1 - (ya + yb) * c2)
        if x > worst:
            worst = x
            found = here | (CHORD << KIND_SHIFT) | (la << ANGLE) | lb
    if node.state[i] != OPEN:
        x = ya * c1 - xa * c2
        if x > worst:
            worst = x
            found = here | (C_LEFT << KIND_SHIFT) | (la << ANGLE)
        x = xb * c2 - yb * c1
        if x > worst:
            worst = x
            found = here | (C_RIGHT << KIND_SHIFT) | lb
    return worst, found, reach


@inner
def actuator(j, question, node, c, d, worst, found):
    """The worst violation so far and its row, with those of actuator j."""
    m = question.m
    moves = node.state[3 * m + j]
    driven = question.driven[j]
    k = 3 * m + 2 * j
    t = d[3 * m + j]
    here = j << INDEX
    if -t > worst:
        worst = -t
        found = here | (T_UP << KIND_SHIFT)
    if moves in (LOCKED, HIGH, LOW) and t > worst:
        worst = t
        found = here | (T_DOWN << KIND_SHIFT)
    if (moves in (MOVES, ABOVE) or not driven) and -c[k] > worst:
        worst = -c[k]
        found = here | (E_UP << KIND_SHIFT)
    if (moves == LOW or (moves == MOVES and not driven)) and c[k] > worst:
        worst = c[k]
        found = here | (E_DOWN << KIND_SHIFT)
    if driven and moves in (MOVES, BELOW) and -c[k + 1] > worst:
        worst = -c[k + 1]
        found = here | (S_UP << KIND_SHIFT)
    if moves == HIGH and c[k + 1] > worst:
        worst = c[k + 1]
        found = here | (S_DOWN << KIND_SHIFT)
    return worst, found


@inner
def plain(k, question, hi, c, d, worst, found):
    """The worst violation so far and its row, with those of the k-th plain value."""
    at = 3 * question.m + 2 * question.a + k
    x = c[at] if at < question.F else d[at - question.F + 3 * question.m + question.a]
    if question.lo[k] - x > worst:
        worst = question.lo[k] - x
        found = (k << INDEX) | (BOUND_UP << KIND_SHIFT)
    if x - hi[k] > worst:
        worst = x - hi[k]
        found = (k << INDEX) | (BOUND_DOWN << KIND_SHIFT)
    return worst, found
