"""Discard boxes, compiled: what no object pose can bring together, told without the pose.

Whatever the object's pose (R, p), a rigid motion keeps distances and angles. With C_k(q) the centre of the
hand's cap (or the point of its patch) and O_k(s, t) the point of the object's region, moved out by the cap's
radius, contacts k and l need

    |C_k - C_l| = |O_k - O_l|,

and for every two directions, one on each body, that R must bring together up to a slack (a cap's axis and the
contact normal, to the cone; a patch's normal, exactly; C_k - C_l, exactly; bounds of the object's axes) the
angles between them agree up to both slacks: the triangle inequality on the sphere.

Over a box every quantity is its Taylor polynomial of degree one about the middle and a remainder
(`engine.taylor`). `PAD` covers the rounding of the few operations on them. Each condition is a linear row with
an interval, narrows the box, or discards it.
"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import inner, kernel
from handfast.synthesis.search.kernel.narrowing import (
    AGAIN,
    LOOKS,
    PAD,
    TURN,
    angle,
    center,
    cone_of,
    copy,
    halve,
    narrow,
    swept,
    taken,
)
from handfast.synthesis.search.kernel.spins import between, spins
from handfast.synthesis.search.kernel.taylor import WIDER, element, norm, spread, workspace

TWIST = (  # slots of `twist`: the sum of the product of the second and third, and of the last (-1: none)
    (8, 0, 1, 4), (9, 2, 3, 5), (10, 8, 9, -1), (10, 6, 7, 10), (11, 0, 0, -1), (12, 2, 2, -1),
    (13, 11, 12, 10), (11, 1, 1, -1), (12, 3, 3, -1), (14, 11, 12, 13), (13, 0, 2, 14), (14, 1, 3, 13),
)  # fmt: skip


@inner
def unit(f, g, rem, dev, h, use, out, grow, marks):  # type: ignore[no-untyped-def]
    """The Taylor polynomial of f / |f|: value into out (3,), derivatives into grow (n, 3).

    marks (2,): remainder and how far it strays, infinite if f may vanish. Along a straight path the second
    derivative of f / |f| is at most 2/sqrt(3) |f'|^2 / |f|^2; the remainder of f itself adds at most its
    share of |f|.
    """
    size = norm(f)
    least = (size - dev) * (2.0 - WIDER)
    if not least > 0.2 * size:
        marks[0] = marks[1] = np.inf
        return
    for c in range(3):
        out[c] = f[c] / size
    for i in use:
        along = g[i, 0] * out[0] + g[i, 1] * out[1] + g[i, 2] * out[2]
        for c in range(3):
            grow[i, c] = (g[i, c] - along * out[c]) / size
    straight = dev - rem
    marks[0] = (rem / least + 0.578 * straight * straight / (least * least) + PAD) * WIDER
    marks[1] = spread(grow, h, use) + marks[0]


@inner
def scalar(slot, value, rem, h, use, X, GX):  # type: ignore[no-untyped-def]
    """Finish the polynomial in a slot, X[slot] = value, remainder, how far it strays; GX[slot] is there."""
    reach = 0.0
    for i in use:
        reach += abs(GX[slot, i]) * h[i]
    X[slot, 0] = value
    X[slot, 1] = rem * WIDER + PAD * (abs(value) + reach)
    X[slot, 2] = reach * WIDER + X[slot, 1]


@inner
def product(slot, va, ga, ea, sa, vb, gb, eb, sb, h, use, X, GX):  # type: ignore[no-untyped-def]
    """Scalar product of unit vectors a, b: derivatives (n, 3), remainders and how far they stray."""
    for i in use:
        total = 0.0
        for c in range(3):
            total += va[c] * gb[i, c] + vb[c] * ga[i, c]
        GX[slot, i] = total
    value = va[0] * vb[0] + va[1] * vb[1] + va[2] * vb[2]
    scalar(slot, value, ea + eb + sa * sb, h, use, X, GX)


@inner
def triple(slot, u, gu, mu, v, gv, ev, sv, w, gw, ew, sw, h, use, X, GX):  # type: ignore[no-untyped-def]
    """u . (v x w) of unit vectors."""
    vw0, vw1, vw2 = v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]
    wu0, wu1, wu2 = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
    uv0, uv1, uv2 = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    for i in use:
        GX[slot, i] = (
            gu[i, 0] * vw0 + gu[i, 1] * vw1 + gu[i, 2] * vw2
            + gv[i, 0] * wu0 + gv[i, 1] * wu1 + gv[i, 2] * wu2
            + gw[i, 0] * uv0 + gw[i, 1] * uv1 + gw[i, 2] * uv2
        )  # fmt: skip
    both = mu[1] * sv + sv * sw + mu[1] * sw
    value = u[0] * vw0 + u[1] * vw1 + u[2] * vw2
    scalar(slot, value, mu[0] + ev + ew + both + mu[1] * sv * sw, h, use, X, GX)


@inner
def combine(slot, f, x, y, g, z, constant, h, use, X, GX):  # type: ignore[no-untyped-def]
    """Slot = f (x y) + g z + constant, of slots x, y, z; z may be -1."""
    for i in use:
        total = f * (X[x, 0] * GX[y, i] + X[y, 0] * GX[x, i])
        if z >= 0:  # which may be the slot itself
            total += g * GX[z, i]
        GX[slot, i] = total
    rem = abs(f) * (abs(X[x, 0]) * X[y, 1] + abs(X[y, 0]) * X[x, 1] + X[x, 2] * X[y, 2])
    value = f * X[x, 0] * X[y, 0] + constant
    if z >= 0:
        rem += abs(g) * X[z, 1]
        value += g * X[z, 0]
    scalar(slot, value, rem, h, use, X, GX)


@inner
def directions(hand, own, slack, low, high, h, use, X, GX):  # type: ignore[no-untyped-def]
    """Narrow by: angles agree up to the slack; slots `hand` and `own` hold the cosines. False if impossible.

    With c the object's cosine and s = sqrt(1 - c^2) <= s0 / 2 + (1 - c^2) / (2 s0), the hand's must lie
    between c cos(slack) -+ s sin(slack).
    """
    c = X[own, 0]
    inner_end = max(-1.0, min(1.0, c - X[own, 2])), max(-1.0, min(1.0, c + X[own, 2]))
    phi_most, phi_least = np.arccos(inner_end[0]) + 1e-7, np.arccos(inner_end[1]) - 1e-7
    if slack <= 0:
        for i in use:
            GX[15, i] = GX[hand, i] - GX[own, i]
        error = X[hand, 1] + X[own, 1]
        return narrow(X[hand, 0] - c, GX[15], -error, error, low, high, use)
    s0 = np.sqrt(max(1e-4, 1 - c * c))
    cosine, sine = np.cos(slack), np.sin(slack)
    error = X[hand, 1] + X[own, 1] * abs(cosine) + PAD
    # s <= s0 / 2 + (1 - c^2) / (2 s0): value, derivative and remainder
    value = 0.5 * s0 + (1 - c * c) / (2 * s0)
    error += abs(sine) * (abs(c) * X[own, 1] + X[own, 2] * X[own, 2]) / s0
    for side in range(2):
        if (side == 0 and phi_most + slack >= np.pi) or (side == 1 and phi_least <= slack):
            continue
        sign = 1.0 if side == 0 else -1.0
        for i in use:
            GX[15, i] = sign * (GX[hand, i] - cosine * GX[own, i]) - sine * c / s0 * GX[own, i]
        if not narrow(sign * (X[hand, 0] - cosine * c) + sine * value, GX[15], -np.inf, error, low, high, use):
            return False
    return True


@inner
def balance(a, b, p2, q2, pq):  # type: ignore[no-untyped-def]
    """The weight w in [0, 1] for which w a + (1 - w) b + |w p + (1 - w) q| is least (it is convex)."""
    left, right = 0.0, 1.0
    for _ in range(14):
        w = 0.5 * (left + right)
        v = 1 - w
        size = np.sqrt(max(1e-30, w * w * p2 + v * v * q2 + 2 * w * v * pq))
        if a - b + (w * p2 - v * q2 + (v - w) * pq) / size > 0:
            right = w
        else:
            left = w
    return 0.5 * (left + right)


@inner
def twist(slack_i, slack_j, low, high, h, use, X, GX):  # type: ignore[no-untyped-def]
    """Narrow by: one spin of the object about a line suits two directions i and j. False if impossible.

    Slots: 0, 1 cosines of i and j with the line on the hand; 2, 3 on the object; 4, 5 of i with j; 6, 7 line .
    (i x j). For any weights w_i + w_j = 1 the spins satisfy, at best, with p and q the parts across the line
    multiplied as complex numbers,

        w_i c_i + w_j c_j + |w_i p + w_j q| >= w_i cos(slack_i) + w_j cos(slack_j).
    """
    a, b, c, d = X[0, 0], X[1, 0], X[2, 0], X[3, 0]
    across_hand, across_own = X[4, 0] - a * b, X[5, 0] - c * d
    p2, q2 = (1 - a * a) * (1 - c * c), (1 - b * b) * (1 - d * d)
    pq = across_hand * across_own + X[6, 0] * X[7, 0]
    ci, cj = a * c - np.cos(slack_i), b * d - np.cos(slack_j)
    w = balance(ci, cj, p2, q2, pq)
    v = 1 - w
    n2 = w * w * p2 + v * v * q2 + 2 * w * v * pq
    if not n2 > 1e-8 or w * ci + v * cj + np.sqrt(n2) > 0:
        return True
    n0 = np.sqrt(n2)
    f = 1 / (2 * n0)
    weight = (
        (-1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0),
        (f * w * w, 2 * f * w * v, 0.5 * n0), (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (f * v * v, 1.0, 0.0),
        (w, 1.0, 0.0), (v, 1.0, -w * np.cos(slack_i) - v * np.cos(slack_j)),
    )  # fmt: skip
    for row in range(12):
        slot, x, y, z = TWIST[row]
        first, second, constant = weight[row]
        combine(slot, first, x, y, second, z, constant, h, use, X, GX)
    return narrow(X[14, 0], GX[14], -np.inf, X[14, 1], low, high, use)


@inner
def line(a, b, count, V, D, E, swing, slack, low, high, h, use, S):  # type: ignore[no-untyped-def]
    """Narrow by the line between contacts a and b: its length, and the spins about it. False if impossible."""
    P, Q, g, u, gu, mu, X, GX, arcs = S
    many = slack.shape[0]
    for i in use:
        for c in range(3):
            P[i, c] = D[a, 0, i, c] - D[b, 0, i, c]
            Q[i, c] = D[a, 2, i, c] - D[b, 2, i, c]
    d, e = V[a, 0] - V[b, 0], V[a, 2] - V[b, 2]
    ed, ee = (E[a, 0] + E[b, 0]) * WIDER, (E[a, 2] + E[b, 2]) * WIDER
    ld, le = norm(d), norm(e)
    sd, se = spread(P, h, use) + ed, spread(Q, h, use) + ee
    for i in use:
        g[i] = 2 * (d[0] * P[i, 0] + d[1] * P[i, 1] + d[2] * P[i, 2])
        g[i] -= 2 * (e[0] * Q[i, 0] + e[1] * Q[i, 1] + e[2] * Q[i, 2])
    pad = PAD * (ld * ld + le * le)
    lo, hi = -2 * ld * ed - 2 * le * ee - se * se - pad, 2 * ld * ed + sd * sd + 2 * le * ee + pad
    if not narrow(ld * ld - le * le, g, lo * WIDER, hi * WIDER, low, high, use):
        return False
    stray = swept(ld, sd) + swept(le, se)
    if stray > 1.0:
        return True
    if not spins(d, e, stray, V, swing, slack, arcs):
        return False
    ready = False
    for i in range(many):
        if slack[i] >= np.pi or abs(arcs[i, 0] - arcs[i, 1]) + stray + swing[i, 1] + swing[i, 3] < slack[i]:
            continue
        if not ready:
            unit(d, P, ed, sd, h, use, u[0], gu[0], mu[0])
            unit(e, Q, ee, se, h, use, u[1], gu[1], mu[1])
            if not (mu[0, 0] < 1 and mu[1, 0] < 1):
                return True
            ready = True
        for side in range(2):
            m = 1 + 2 * side
            product(2 * side, u[side], gu[side], mu[side, 0], mu[side, 1], V[i, m], D[i, m], E[i, m], swing[i, m],
                    h, use, X, GX)  # fmt: skip
        if not directions(0, 2, slack[i], low, high, h, use, X, GX):
            return False
        for j in range(i):
            # only where the middle has no spin for both
            if slack[j] >= np.pi or arcs[i, 3] + arcs[j, 3] >= np.pi:
                continue
            if min(arcs[i, 3], arcs[j, 3]) < 0 or between(arcs[i, 2], arcs[j, 2]) < arcs[i, 3] + arcs[j, 3]:
                continue
            for side in range(2):
                m = 1 + 2 * side
                product(1 + 2 * side, u[side], gu[side], mu[side, 0], mu[side, 1], V[j, m], D[j, m], E[j, m],
                        swing[j, m], h, use, X, GX)  # fmt: skip
                product(4 + side, V[i, m], D[i, m], E[i, m], swing[i, m], V[j, m], D[j, m], E[j, m], swing[j, m],
                        h, use, X, GX)  # fmt: skip
                triple(6 + side, u[side], gu[side], mu[side], V[i, m], D[i, m], E[i, m], swing[i, m],
                       V[j, m], D[j, m], E[j, m], swing[j, m], h, use, X, GX)  # fmt: skip
            if not twist(slack[i], slack[j], low, high, h, use, X, GX):
                return False
    return True


@inner
def examine(box, flat, subset, use, bend, slack, S):  # type: ignore[no-untyped-def]
    """Narrow a box (n, 2) for the contacts of a subset; returns the coordinate to split, -1 if it is empty.

    slack: of each direction, the contacts' first. Second result: how far the worst point still strays in the
    box [units]. S: workspace, see `explore`.
    """
    x, h, low, high, V, D, E, swing, W, L = S
    X, GX = L[6], L[7]
    count, many = subset.shape[0], slack.shape[0]
    for _ in range(LOOKS):
        center(box, use, x, h, low, high)
        for a in range(count):
            element(subset[a], x, h, flat, bend, V[a], D[a], E[a], W)
            for c in (1, 3):
                swing[a, c] = swept(1.0, spread(D[a, c], h, use) + E[a, c])
        for a in range(count):
            for b in range(a):
                if not line(a, b, count, V, D, E, swing, slack, low, high, h, use, L):
                    return -1, 0.0
        for i in range(many):
            for j in range(min(i, count)):
                both = slack[i] + slack[j]
                off = swing[i, 1] + swing[i, 3] + swing[j, 1] + swing[j, 3]
                if both + off >= np.pi or abs(angle(V[i, 1], V[j, 1]) - angle(V[i, 3], V[j, 3])) + off < both:
                    continue
                for side in range(2):
                    m = 1 + 2 * side
                    product(4 + side, V[i, m], D[i, m], E[i, m], swing[i, m], V[j, m], D[j, m], E[j, m],
                            swing[j, m], h, use, X, GX)  # fmt: skip
                if not directions(4, 5, both, low, high, h, use, X, GX):
                    return -1, 0.0
        shrunk = taken(box, use, x, h, low, high)
        if shrunk < 0:
            return -1, 0.0
        if shrunk > AGAIN:
            break
    best, worst = -1, -1.0
    for i in use:
        half = 0.5 * (box[i, 1] - box[i, 0])
        stray = 0.0
        for a in range(count):
            moved = max(norm(D[a, 0, i]) + TURN * norm(D[a, 1, i]), norm(D[a, 2, i]) + TURN * norm(D[a, 3, i]))
            stray = max(stray, moved * half)
        if stray > worst:
            best, worst = i, stray
    return best, worst


@kernel
def explore(stack, share, count, flat, subset, use, bend, cones, budget, resolution, kept, kept_share):  # type: ignore[no-untyped-def]
    """Depth first from `count` boxes in stack (., n, 2), in place, until it is empty or `budget` nodes are spent.

    cones (m, 5): bounds of the object's axes: index of the axis, direction of the palm frame, and the angle
    from it that is allowed. Boxes that stray by less than `resolution` [units] go to `kept` (., n, 2).
    Returns (boxes on the stack, kept, nodes).
    """
    n, contacts, many = stack.shape[1], subset.shape[0], subset.shape[0] + cones.shape[0]
    V, D, E, swing = np.zeros((many, 4, 3)), np.zeros((many, 4, n, 3)), np.zeros((many, 4)), np.zeros((many, 4))
    slack = np.zeros(many)
    for a in range(contacts):
        k = subset[a]
        slack[a] = np.pi if k == flat.steps.shape[0] else cone_of(k, flat)
    for c in range(cones.shape[0]):
        for i in range(3):
            V[contacts + c, 1, i] = cones[c, 1 + i]
        V[contacts + c, 3, int(cones[c, 0])] = 1.0
        slack[contacts + c] = cones[c, 4]
    L = (
        np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros((2, 3)), np.zeros((2, n, 3)), np.zeros((2, 2)),
        np.zeros((16, 3)), np.zeros((16, n)), np.zeros((many, 5)),
    )  # fmt: skip
    S = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), V, D, E, swing, workspace(flat), L)
    nodes, found = 0, 0
    while count > 0 and nodes < budget and count + 2 < stack.shape[0] and found < kept.shape[0]:
        count -= 1
        nodes += 1
        box = stack[count]
        split, stray = examine(box, flat, subset, use, bend, slack, S)
        if split < 0:
            continue
        if stray < resolution:
            copy(box, kept[found])
            kept_share[found] = share[count]
            found += 1
            continue
        halve(stack, share, count, split)
        count += 2
    return count, found, nodes
