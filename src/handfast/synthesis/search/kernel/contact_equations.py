"""Where hand and object touch, compiled, in balls: chains of joints, surfaces, and the problem's equations.

`evaluate` fills the equations F and inequalities G of `synthesis.problem` with their derivatives. Points of
radius zero give what a search needs, boxes give enclosures for a proof.
"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.balls import (
    add,
    cosine,
    cross,
    div,
    dot,
    get,
    inner,
    mul,
    put,
    root,
    scale,
    sine,
    sub,
    times,
)

PATCH = 1
PRISMATIC = 1
EXACT = 2e-15  # of the rigid motions between joints: rounding when they were multiplied together


@inner
def chain(k, x, flat, R, p, axes, spots):  # type: ignore[no-untyped-def]
    """Pose of the link of contact k in the palm frame, and the axes of its joints.

    x (n, 2) coordinates. Out: R (3, 3, 2), p (3, 2); for each joint of the chain the unit axis (., 3, 2) and
    a point on it (., 3, 2).
    """
    row, moved = np.empty((3, 3, 2)), np.empty((3, 2))
    for i in range(3):
        for j in range(3):
            R[i, j, 0], R[i, j, 1] = flat.turn[k, 0, i, j], EXACT
        p[i, 0], p[i, 1] = flat.shift[k, 0, i], EXACT
    for step in range(flat.steps[k]):
        v = flat.var[k, step]
        value = add(scale(flat.ratio[k, step], get(x, v)), (flat.offset[k, step], 0.0))
        for i in range(3):
            axes[step, i, 0], axes[step, i, 1] = R[i, 2, 0], R[i, 2, 1]
            spots[step, i, 0], spots[step, i, 1] = p[i, 0], p[i, 1]
        if flat.kind[k, step] == PRISMATIC:
            for i in range(3):
                put(p, i, add(get(p, i), mul(value, get(R[i], 2))))
        else:
            s, c = sine(value), cosine(value)
            for i in range(3):
                a, b = get(R[i], 0), get(R[i], 1)
                put(R[i], 0, add(mul(c, a), mul(s, b)))
                put(R[i], 1, sub(mul(c, b), mul(s, a)))
        for i in range(3):
            m, r = p[i, 0], p[i, 1]
            size = abs(m)
            for j in range(3):
                t = flat.shift[k, step + 1, j]
                m += R[i, j, 0] * t
                size += abs(R[i, j, 0] * t)
                r += R[i, j, 1] * (abs(t) + EXACT) + EXACT * abs(R[i, j, 0])
            moved[i, 0], moved[i, 1] = m, r * (1 + 2e-15) + 1e-15 * size
            for j in range(3):
                m, r, size = 0.0, 0.0, 0.0
                for l in range(3):
                    t = flat.turn[k, step + 1, l, j]
                    m += R[i, l, 0] * t
                    size += abs(R[i, l, 0] * t)
                    r += R[i, l, 1] * (abs(t) + EXACT) + EXACT * abs(R[i, l, 0])
                row[i, j, 0], row[i, j, 1] = m, r * (1 + 2e-15) + 1e-15 * size
        R[:, :, :] = row
        p[:, :] = moved


@inner
def basis(degree, x, out):  # type: ignore[no-untyped-def]
    """Bernstein polynomials of a degree at x into `out` (degree+1, 2)."""
    y = sub((1.0, 0.0), x)
    put(out, 0, (1.0, 0.0))
    for d in range(1, degree + 1):
        put(out, d, mul(x, get(out, d - 1)))
        for i in range(d - 1, 0, -1):
            put(out, i, add(mul(x, get(out, i - 1)), mul(y, get(out, i))))
        put(out, 0, mul(y, get(out, 0)))


@inner
def patch(points, M, N, s, t, out):  # type: ignore[no-untyped-def]
    """A Bezier patch and its derivatives: `out` (6, 3, 2) is p, p_s, p_t, p_ss, p_st, p_tt.

    points: ((M+1)(N+1), 3), exact.
    """
    A, B = np.zeros((3, M + 1, 2)), np.zeros((3, N + 1, 2))
    for which in range(2):
        degree, x, W = (M, s, A) if which == 0 else (N, t, B)
        low = np.zeros((degree + 1, 2))
        basis(degree, x, W[0])
        for order in range(1, 3):
            if degree < order:
                continue
            basis(degree - order, x, low)
            # derivative of the polynomial as weights of the control points
            many = float(degree) if order == 1 else float(degree * (degree - 1))
            for i in range(degree + 1):
                m = (0.0, 0.0)
                for j in range(order + 1):
                    if 0 <= i - j <= degree - order:
                        sign = many * (1.0 if (order - j) % 2 == 0 else -1.0)
                        if order == 2 and j == 1:
                            sign *= 2.0
                        m = add(m, scale(sign, get(low, i - j)))
                put(W[order], i, m)
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    for o in range(6):
        du, dv = orders[o]
        for c in range(3):
            out[o, c, 0] = 0.0
            out[o, c, 1] = 0.0
        for i in range(M + 1):
            for j in range(N + 1):
                w = mul(get(A[du], i), get(B[dv], j))
                for c in range(3):
                    # from a corner: the weights sum to 1 or 0, and boxes far from the origin stay small
                    arm = sub((points[i * (N + 1) + j, c], 0.0), (points[0, c], 0.0))
                    put(out[o], c, add(get(out[o], c), mul(w, arm)))
    for c in range(3):
        put(out[0], c, add(get(out[0], c), (points[0, c], 0.0)))


@inner
def surface(which, k, s, t, flat, out, n, ns, nt):  # type: ignore[no-untyped-def]
    """A region at its parameters: `out` (6, 3, 2) as in `patch`, unit outward normal n and its derivatives (3, 2).

    which: k for the object region of contact k, b + k for its hand region.
    """
    if which == k and flat.object[k] != PATCH:
        # a cap by polar angle s and azimuth t
        ss, cs, st, ct = sine(s), cosine(s), sine(t), cosine(t)
        zero = (0.0, 0.0)
        radius, sign = flat.ball[k, 12], flat.face[which]
        for i in range(3):
            e1, e2, e3 = flat.ball[k, 3 * i], flat.ball[k, 3 * i + 1], flat.ball[k, 3 * i + 2]
            around = add(scale(e1, ct), scale(e2, st))
            turned = sub(scale(e2, ct), scale(e1, st))
            d = add(mul(ss, around), scale(e3, cs))
            ds = sub(mul(cs, around), scale(e3, ss))
            dt = mul(ss, turned)
            put(out[0], i, add((flat.ball[k, 9 + i], 0.0), scale(radius, d)))
            put(out[1], i, scale(radius, ds))
            put(out[2], i, scale(radius, dt))
            put(out[3], i, scale(-radius, d))
            put(out[4], i, scale(radius, mul(cs, turned)))
            put(out[5], i, sub(zero, scale(radius, mul(ss, around))))
            put(n, i, scale(sign, d))
            put(ns, i, scale(sign, ds))
            put(nt, i, scale(sign, dt))
        return
    M, N, first = flat.degree[which, 0], flat.degree[which, 1], flat.first[which]
    patch(flat.points[first:], M, N, s, t, out)
    sign = flat.face[which]
    a, b, raw = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2))
    cross(out[1], out[2], raw)
    size = root(dot(raw, raw))
    for i in range(3):
        put(n, i, scale(sign, div(get(raw, i), size)))
    for which_way in range(2):
        # derivative of the unit normal: (n' - n (n . n')) / |n|
        first_one = out[3] if which_way == 0 else out[4]
        second_one = out[4] if which_way == 0 else out[5]
        cross(first_one, out[2], a)
        cross(out[1], second_one, b)
        for i in range(3):
            put(a, i, scale(sign, add(get(a, i), get(b, i))))
        along = dot(n, a)
        target = ns if which_way == 0 else nt
        for i in range(3):
            put(target, i, div(sub(get(a, i), mul(along, get(n, i))), size))


@inner
def rotation(x, first, Q):  # type: ignore[no-untyped-def]
    """Rotation of the unnormalised quaternion x[first:first+4] and its derivatives: Q (5, 3, 3, 2)."""
    size = (0.0, 0.0)
    for i in range(4):
        size = add(size, mul(get(x, first + i), get(x, first + i)))
    inverse = div((1.0, 0.0), size)
    w = get(x, first)
    square = mul(w, w)
    for i in range(3):
        square = sub(square, mul(get(x, first + 1 + i), get(x, first + 1 + i)))
    for i in range(3):
        vi = get(x, first + 1 + i)
        for j in range(3):
            vj = get(x, first + 1 + j)
            entry = scale(2.0, mul(vi, vj))
            for d in range(5):
                put(Q[d, i], j, (0.0, 0.0))
            put(Q[1 + i + 1, i], j, scale(2.0, vj))
            put(Q[1 + j + 1, i], j, add(get(Q[1 + j + 1, i], j), scale(2.0, vi)))
            if i == j:
                entry = add(entry, square)
                put(Q[1, i], j, scale(2.0, w))
                for d in range(3):
                    put(Q[2 + d, i], j, sub(get(Q[2 + d, i], j), scale(2.0, get(x, first + 1 + d))))
            else:
                l = 3 - i - j
                sign = -2.0 if (i + 1) % 3 == j else 2.0
                vl = get(x, first + 1 + l)
                entry = add(entry, scale(sign, mul(w, vl)))
                put(Q[1, i], j, scale(sign, vl))
                put(Q[2 + l, i], j, add(get(Q[2 + l, i], j), scale(sign, w)))
            put(Q[0, i], j, mul(entry, inverse))
            for d in range(4):
                part = scale(2.0, mul(get(x, first + d), get(Q[0, i], j)))
                put(Q[1 + d, i], j, mul(sub(get(Q[1 + d, i], j), part), inverse))


@inner
def turned(Q, y, out, jac):  # type: ignore[no-untyped-def]
    """R y into `out` (3, 2) and its derivatives with respect to the quaternion into `jac` (4, 3, 2)."""
    times(Q[0], y, out)
    for d in range(4):
        times(Q[1 + d], y, jac[d])


@inner
def evaluate(x, flat, F, J, G, H):  # type: ignore[no-untyped-def]
    """Equations, inequalities and their derivatives at x (n, 2), a point or a box.

    Out: F (e, 2), J (e, n, 2); G (b + 18, 2) which must be positive, H (b + 18, n, 2): one for each contact
    (within the cone, or normals that oppose), and 18 for the bounds of the object's axes.
    """
    b = flat.steps.shape[0]
    joints = flat.params[0] - 7
    most = flat.var.shape[1]
    quaternion = joints + 3
    J[:, :, :] = 0.0
    H[:, :, :] = 0.0
    Q = np.empty((5, 3, 3, 2))
    rotation(x, quaternion, Q)
    R, p = np.empty((3, 3, 2)), np.empty((3, 2))
    axes, spots = np.empty((most + 1, 3, 2)), np.empty((most + 1, 3, 2))
    o, h = np.empty((6, 3, 2)), np.empty((6, 3, 2))
    normal, ns, nt = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2))
    m, mu, mv = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2))
    y, ry, dy = np.empty((3, 2)), np.empty((3, 2)), np.empty((4, 3, 2))
    rn, dn = np.empty((3, 2)), np.empty((4, 3, 2))
    rs, ds = np.empty((3, 2)), np.empty((4, 3, 2))
    rt = np.empty((3, 2))
    a, c, lever, t1 = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2))
    for k in range(b):
        row, first = flat.rows[k], flat.params[k]
        chain(k, x, flat, R, p, axes, spots)
        surface(k, k, get(x, first), get(x, first + 1), flat, o, normal, ns, nt)
        rolls = flat.hand[k] != PATCH
        if rolls:
            for i in range(3):
                put(h[0], i, (flat.center[k, i], 0.0))
                put(m, i, (flat.axis[k, i], 0.0))
                put(y, i, add(get(o[0], i), scale(flat.radius[k], get(normal, i))))
        else:
            surface(b + k, k, get(x, first + 2), get(x, first + 3), flat, h, m, mu, mv)
            y[:, :] = o[0]
        times(R, h[0], c)
        for i in range(3):
            put(c, i, add(get(c, i), get(p, i)))
        times(R, m, a)  # the cap's axis, or the patch's normal, in the palm frame
        turned(Q, y, ry, dy)
        turned(Q, normal, rn, dn)
        # points
        for i in range(3):
            put(F, row + i, sub(sub(get(c, i), get(x, joints + i)), get(ry, i)))
            put(J[row + i], joints + i, (-1.0, 0.0))
            for j in range(4):
                put(J[row + i], quaternion + j, (-dy[j, i, 0], dy[j, i, 1]))
        for which in range(2):
            grow = ns if which == 0 else nt
            for i in range(3):
                put(t1, i, get(o[1 + which], i))
                if rolls:
                    put(t1, i, add(get(t1, i), scale(flat.radius[k], get(grow, i))))
            times(Q[0], t1, rs)
            for i in range(3):
                put(J[row + i], first + which, (-rs[i, 0], rs[i, 1]))
        for which in range(0 if rolls else 2):
            times(R, h[1 + which], t1)
            for i in range(3):
                put(J[row + i], first + 2 + which, get(t1, i))
        for step in range(flat.steps[k]):
            v, ratio = flat.var[k, step], flat.ratio[k, step]
            if flat.kind[k, step] == PRISMATIC:
                t1[:, :] = axes[step]
            else:
                for i in range(3):
                    put(lever, i, sub(get(c, i), get(spots[step], i)))
                cross(axes[step], lever, t1)
            for i in range(3):
                put(J[row + i], v, add(get(J[row + i], v), scale(ratio, get(t1, i))))
        # directions
        if rolls:
            # cos of the angle between axis and contact, -sign a . R n, must exceed that of the cone
            sign = flat.sign[k]
            put(G, k, sub(scale(-sign, dot(a, rn)), (flat.cone[k], 0.0)))
            _along(k, H[k], -sign, a, rn, dn, flat, axes, quaternion)
            for which in range(2):
                times(Q[0], ns if which == 0 else nt, rs)
                put(H[k], first + which, scale(-sign, dot(a, rs)))
            continue
        put(G, k, scale(-1.0, dot(a, rn)))
        _along(k, H[k], -1.0, a, rn, dn, flat, axes, quaternion)
        times(Q[0], ns, rs)
        put(H[k], first, scale(-1.0, dot(a, rs)))
        times(Q[0], nt, rt)
        put(H[k], first + 1, scale(-1.0, dot(a, rt)))
        for which in range(2):
            times(R, mu if which == 0 else mv, t1)
            put(H[k], first + 2 + which, scale(-1.0, dot(t1, rn)))
        for which in range(2):
            r = row + 3 + which
            turned(Q, o[1 + which], rs, ds)
            put(F, r, dot(a, rs))
            _along(k, J[r], 1.0, a, rs, ds, flat, axes, quaternion)
            times(Q[0], o[3 + which], rt)
            put(J[r], first, dot(a, rt))
            times(Q[0], o[4 + which], rt)
            put(J[r], first + 1, dot(a, rt))
            for other in range(2):
                times(R, mu if other == 0 else mv, t1)
                put(J[r], first + 2 + other, dot(t1, rs))
    for l in range(3):
        for i in range(3):
            g = b + 2 * (3 * l + i)
            put(G, g, sub(get(Q[0, i], l), (flat.axes[3 * l + i, 0], 0.0)))
            put(G, g + 1, sub((flat.axes[3 * l + i, 1], 0.0), get(Q[0, i], l)))
            for j in range(4):
                put(H[g], quaternion + j, get(Q[1 + j, i], l))
                put(H[g + 1], quaternion + j, (-Q[1 + j, i, l, 0], Q[1 + j, i, l, 1]))


@inner
def _along(k, out, sign, a, b, db, flat, axes, quaternion):  # type: ignore[no-untyped-def]
    """Derivatives of sign a . b into `out` (n, 2): a is fixed in the link of contact k, b in the object."""
    t = np.empty((3, 2))
    for step in range(flat.steps[k]):
        if flat.kind[k, step] == PRISMATIC:
            continue
        v = flat.var[k, step]
        cross(axes[step], a, t)
        put(out, v, add(get(out, v), scale(sign * flat.ratio[k, step], dot(t, b))))
    for j in range(4):
        put(out, quaternion + j, scale(sign, dot(a, db[j])))
