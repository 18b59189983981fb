"""Chains of joints, surfaces and rotations in balls, compiled.

Points of radius zero give what a search needs, boxes give enclosures for a proof.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.balls import (
    add,
    cosine,
    cross,
    div,
    dot,
    get,
    mul,
    put,
    root,
    scale,
    sine,
    sub,
    times,
)
from handfast.synthesis.task_groups import CAP, CYLINDER, PRISMATIC

EXACT = 2e-15  # of the rigid motions between joints: rounding when they were multiplied together
ORDERS = np.array([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])  # of the derivatives in a surface's rows
NORMAL = 6  # row of a surface's unit outward normal; then its derivatives by s and t


@inner
def chain(k, x, chains, work):
    """Pose of the link of contact k in the palm frame, the axes of its joints and points on them, into `work`.

    x (n, 2): coordinates; work: `ContactBalls`.
    """
    R, p = work.link_rotation, work.link_position
    for i in range(3):
        for j in range(3):
            R[i, j, 0], R[i, j, 1] = chains.rotation[k, 0, i, j], EXACT
        p[i, 0], p[i, 1] = chains.translation[k, 0, i], EXACT
    for step in range(chains.joints[k]):
        value = add(scale(chains.ratio[k, step], get(x, chains.coordinate[k, step])), (chains.offset[k, step], 0.0))
        axis, point = work.joint_axis[step], work.joint_point[step]
        for i in range(3):
            axis[i, 0], axis[i, 1] = R[i, 2, 0], R[i, 2, 1]
            point[i, 0], point[i, 1] = p[i, 0], p[i, 1]
        if chains.kind[k, step] == PRISMATIC:
            for i in range(3):
                put(p, i, add(get(p, i), mul(value, get(R[i], 2))))
        else:
            s, c = sine(value), cosine(value)
            for i in range(3):
                a, b = get(R[i], 0), get(R[i], 1)
                put(R[i], 0, add(mul(c, a), mul(s, b)))
                put(R[i], 1, sub(mul(c, b), mul(s, a)))
        _follow(chains.rotation[k, step + 1], chains.translation[k, step + 1], work)


@inner
def _follow(rotation, translation, work):
    """Multiply the link's pose by the rigid motion behind a joint, (3, 3) and (3,)."""
    R, p, row, moved = work.link_rotation, work.link_position, work.next_rotation, work.next_position
    for i in range(3):
        m, r = p[i, 0], p[i, 1]
        size = abs(m)
        for j in range(3):
            t = translation[j]
            m += R[i, j, 0] * t
            size += abs(R[i, j, 0] * t)
            r += R[i, j, 1] * (abs(t) + EXACT) + EXACT * abs(R[i, j, 0])
        moved[i, 0], moved[i, 1] = m, r * (1 + 2e-15) + 1e-15 * size
        for j in range(3):
            m, r, size = 0.0, 0.0, 0.0
            for l in range(3):
                t = rotation[l, j]
                m += R[i, l, 0] * t
                size += abs(R[i, l, 0] * t)
                r += R[i, l, 1] * (abs(t) + EXACT) + EXACT * abs(R[i, l, 0])
            row[i, j, 0], row[i, j, 1] = m, r * (1 + 2e-15) + 1e-15 * size
    for i in range(3):
        p[i, 0], p[i, 1] = moved[i, 0], moved[i, 1]
        for j in range(3):
            R[i, j, 0], R[i, j, 1] = row[i, j, 0], row[i, j, 1]


@inner
def _bernstein(degree, x, out):
    """Bernstein polynomials of a degree at x into `out` (degree+1, 2)."""
    y = sub((1.0, 0.0), x)
    put(out, 0, (1.0, 0.0))
    for d in range(1, degree + 1):
        put(out, d, mul(x, get(out, d - 1)))
        for i in range(d - 1, 0, -1):
            put(out, i, add(mul(x, get(out, i - 1)), mul(y, get(out, i))))
        put(out, 0, mul(y, get(out, 0)))


@inner
def _weights(degree, x, out, lower):
    """Weights of the control points for the value and two derivatives at x: out (3, degree+1, 2); lower: work."""
    _bernstein(degree, x, out[0])
    for order in range(1, 3):
        if degree < order:
            for i in range(degree + 1):
                put(out[order], i, (0.0, 0.0))
            continue
        _bernstein(degree - order, x, lower)
        # derivative of the polynomial as weights of the control points
        many = float(degree) if order == 1 else float(degree * (degree - 1))
        for i in range(degree + 1):
            m = (0.0, 0.0)
            for j in range(order + 1):
                if 0 <= i - j <= degree - order:
                    sign = many * (1.0 if (order - j) % 2 == 0 else -1.0)
                    if order == 2 and j == 1:
                        sign *= 2.0
                    m = add(m, scale(sign, get(lower, i - j)))
            put(out[order], i, m)


@inner
def _patch(points, M, N, s, t, out, work):
    """A Bezier patch and its derivatives: rows 0 to 5 of `out` are p, p_s, p_t, p_ss, p_st, p_tt.

    points: ((M+1)(N+1), 3), exact.
    """
    _weights(M, s, work.weights[0], work.lower_weights)
    _weights(N, t, work.weights[1], work.lower_weights)
    for o in range(6):
        by_s, by_t = ORDERS[o, 0], ORDERS[o, 1]
        for c in range(3):
            put(out[o], c, (0.0, 0.0))
        for i in range(M + 1):
            for j in range(N + 1):
                w = mul(get(work.weights[0, by_s], i), get(work.weights[1, by_t], j))
                for c in range(3):
                    # from a corner: the weights sum to 1 or 0, and boxes far from the origin stay small
                    away = sub((points[i * (N + 1) + j, c], 0.0), (points[0, c], 0.0))
                    put(out[o], c, add(get(out[o], c), mul(w, away)))
    for c in range(3):
        put(out[0], c, add(get(out[0], c), (points[0, c], 0.0)))


@inner
def _ball(numbers, s, t, sign, out):
    """A cap by polar angle s and azimuth t; rows as in `surface`."""
    ss, cs, st, ct = sine(s), cosine(s), sine(t), cosine(t)
    radius = numbers[12]
    for i in range(3):
        e1, e2, e3 = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
        around = add(scale(e1, ct), scale(e2, st))
        turned = sub(scale(e2, ct), scale(e1, st))
        d = add(mul(ss, around), scale(e3, cs))
        ds = sub(mul(cs, around), scale(e3, ss))
        dt = mul(ss, turned)
        put(out[0], i, add((numbers[9 + i], 0.0), scale(radius, d)))
        put(out[1], i, scale(radius, ds))
        put(out[2], i, scale(radius, dt))
        put(out[3], i, scale(-radius, d))
        put(out[4], i, scale(radius, mul(cs, turned)))
        put(out[5], i, sub((0.0, 0.0), scale(radius, mul(ss, around))))
        put(out[NORMAL], i, scale(sign, d))
        put(out[NORMAL + 1], i, scale(sign, ds))
        put(out[NORMAL + 2], i, scale(sign, dt))


@inner
def _cylinder(numbers, s, t, sign, out):
    """Part of a cylinder's side by the shares s of its angles and t of its heights; rows as in `surface`."""
    radius, turn, length = numbers[12], numbers[14], numbers[15]
    angle = add((numbers[13], 0.0), scale(turn, s))
    sa, ca = sine(angle), cosine(angle)
    for i in range(3):
        e1, e2, axis = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
        d = add(scale(e1, ca), scale(e2, sa))
        ds = scale(turn, sub(scale(e2, ca), scale(e1, sa)))
        up = scale(length, scale(axis, t))
        put(out[0], i, add(add((numbers[9 + i], 0.0), up), scale(radius, d)))
        put(out[1], i, scale(radius, ds))
        put(out[2], i, scale(length, (axis, 0.0)))
        put(out[3], i, scale(-radius * turn * turn, d))
        put(out[4], i, (0.0, 0.0))
        put(out[5], i, (0.0, 0.0))
        put(out[NORMAL], i, scale(sign, d))
        put(out[NORMAL + 1], i, scale(sign, ds))
        put(out[NORMAL + 2], i, (0.0, 0.0))


@inner
def surface(which, k, s, t, regions, out, work):
    """A region at its parameters, out (9, 3, 2): p, p_s, p_t, p_ss, p_st, p_tt, unit outward normal n, n_s, n_t.

    which: k for the object region of contact k, b + k for its hand region.
    """
    sign = regions.face[which]
    kind = regions.object[k] if which == k else regions.hand[k]
    if kind == CAP:
        _ball(regions.numbers[which], s, t, sign, out)
        return
    if kind == CYLINDER:
        _cylinder(regions.numbers[which], s, t, sign, out)
        return
    _patch(regions.points[regions.first[which] :], regions.degree[which, 0], regions.degree[which, 1], s, t, out, work)
    normal = out[NORMAL]
    raw, a, b = work.raw_normal[0], work.raw_normal[1], work.raw_normal[2]
    cross(out[1], out[2], raw)
    size = root(dot(raw, raw))
    for i in range(3):
        put(normal, i, scale(sign, div(get(raw, i), size)))
    for way in range(2):
        # derivative of the unit normal: (n' - n (n . n')) / |n|
        cross(out[3 + way], out[2], a)
        cross(out[1], out[4 + way], b)
        for i in range(3):
            put(a, i, scale(sign, add(get(a, i), get(b, i))))
        along = dot(normal, a)
        for i in range(3):
            put(out[NORMAL + 1 + way], i, div(sub(get(a, i), mul(along, get(normal, i))), size))


@inner
def rotation(x, first, out):
    """Rotation of the unnormalised quaternion x[first:first+4] and its derivatives: out (5, 3, 3, 2)."""
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
                put(out[d, i], j, (0.0, 0.0))
            put(out[1 + i + 1, i], j, scale(2.0, vj))
            put(out[1 + j + 1, i], j, add(get(out[1 + j + 1, i], j), scale(2.0, vi)))
            if i == j:
                entry = add(entry, square)
                put(out[1, i], j, scale(2.0, w))
                for d in range(3):
                    put(out[2 + d, i], j, sub(get(out[2 + d, i], j), scale(2.0, get(x, first + 1 + d))))
            else:
                l = 3 - i - j
                sign = -2.0 if (i + 1) % 3 == j else 2.0
                vl = get(x, first + 1 + l)
                entry = add(entry, scale(sign, mul(w, vl)))
                put(out[1, i], j, scale(sign, vl))
                put(out[2 + l, i], j, add(get(out[2 + l, i], j), scale(sign, w)))
            put(out[0, i], j, mul(entry, inverse))
            for d in range(4):
                part = scale(2.0, mul(get(x, first + d), get(out[0, i], j)))
                put(out[1 + d, i], j, mul(sub(get(out[1 + d, i], j), part), inverse))


@inner
def turned(rotations, y, out, slope):
    """R y into `out` (3, 2) and its derivatives by the quaternion into `slope` (4, 3, 2)."""
    times(rotations[0], y, out)
    for d in range(4):
        times(rotations[1 + d], y, slope[d])
