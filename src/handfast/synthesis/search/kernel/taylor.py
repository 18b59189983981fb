"""Where a contact can be over a box of coordinates, compiled: Taylor polynomials of degree one with remainders.

Remainders bound the second derivatives over the whole box: for chains of joints by the distances to the axes,
for patches by constants that Bernstein coefficients give (`synthesis.bends.bounds`). Middles are plain
floating point. A chain of s joints and a patch of degree (M, N) make them within `ROUNDING` of the exact
values: at most 30 (s + M + N) roundings of 1.2e-16, on numbers of at most a few units, is below 1e-13.
"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import PATCH, PRISMATIC

ROUNDING = 1e-11  # units and units per radian
WIDER = 1.0 + 1e-12


@inner
def norm(v):  # type: ignore[no-untyped-def]
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inner
def spread(g, h, use):  # type: ignore[no-untyped-def]
    """Bound of |sum_i g_i d_i| for |d_i| <= h_i: g (n, 3), use: coordinates."""
    total = 0.0
    for c in range(3):
        reach = 0.0
        for i in use:
            reach += abs(g[i, c]) * h[i]
        total += reach * reach
    return np.sqrt(total) * WIDER


@inner
def workspace(flat):  # type: ignore[no-untyped-def]
    """Arrays for `element`: pose, axes and points on them, two surfaces, weights, constants of a surface."""
    most, degree = flat.var.shape[1], 1
    for i in range(flat.degree.shape[0]):
        degree = max(degree, flat.degree[i, 0], flat.degree[i, 1])
    pose, axes, spots = np.empty((2, 3, 4)), np.empty((most + 1, 3)), np.empty((most + 1, 3))
    return pose, axes, spots, np.empty((9, 3)), np.empty((9, 3)), np.empty((2, 4, degree + 1)), np.empty(10)


@inner
def chain(k, x, flat, pose, axes, spots):  # type: ignore[no-untyped-def]
    """Pose of the link of contact k, (R, p) in pose[0] (3, 4), its joints' axes and points on them (., 3)."""
    T, U = pose[0], pose[1]
    for i in range(3):
        for j in range(3):
            T[i, j] = flat.turn[k, 0, i, j]
        T[i, 3] = flat.shift[k, 0, i]
    for step in range(flat.steps[k]):
        value = flat.ratio[k, step] * x[flat.var[k, step]] + flat.offset[k, step]
        for i in range(3):
            axes[step, i], spots[step, i] = T[i, 2], T[i, 3]
        if flat.kind[k, step] == PRISMATIC:
            for i in range(3):
                T[i, 3] += value * T[i, 2]
        else:
            s, c = np.sin(value), np.cos(value)
            for i in range(3):
                a, b = T[i, 0], T[i, 1]
                T[i, 0], T[i, 1] = c * a + s * b, c * b - s * a
        M, v = flat.turn[k, step + 1], flat.shift[k, step + 1]
        for i in range(3):
            for j in range(3):
                U[i, j] = T[i, 0] * M[0, j] + T[i, 1] * M[1, j] + T[i, 2] * M[2, j]
            T[i, 3] += T[i, 0] * v[0] + T[i, 1] * v[1] + T[i, 2] * v[2]
        for i in range(3):
            for j in range(3):
                T[i, j] = U[i, j]


@inner
def weights(degree, x, out):  # type: ignore[no-untyped-def]
    """Weights of the control points: out[0] of the value, out[1] and out[2] of the derivatives (., degree+1)."""
    y = 1.0 - x
    low, first = out[3], out[1]
    for order in range(2, -1, -1):
        d = degree - order
        target = out[order]
        if d < 0:
            target[:] = 0.0
            continue
        low[0] = 1.0
        for k in range(1, d + 1):
            low[k] = x * low[k - 1]
            for i in range(k - 1, 0, -1):
                low[i] = x * low[i - 1] + y * low[i]
            low[0] *= y
        many = 1.0
        for i in range(order):
            many *= degree - i
        for i in range(degree + 1):
            here = low[i] if i <= d else 0.0
            before = low[i - 1] if 1 <= i <= d + 1 else 0.0
            if order == 0:
                target[i] = here
            elif order == 1:
                first[i] = many * (before - here)
            else:
                last = low[i - 2] if 2 <= i <= d + 2 else 0.0
                target[i] = many * (last - 2 * before + here)


@inner
def surface(which, k, s, t, flat, out, W):  # type: ignore[no-untyped-def]
    """Rows of out (9, 3): p, p_s, p_t, then three of work, then the unit normal n, n_s, n_t."""
    sign = flat.face[which]
    if which == k and flat.object[k] != PATCH:
        ss, cs, st, ct = np.sin(s), np.cos(s), np.sin(t), np.cos(t)
        radius = flat.ball[k, 12]
        for i in range(3):
            e1, e2, e3 = flat.ball[k, 3 * i], flat.ball[k, 3 * i + 1], flat.ball[k, 3 * i + 2]
            d = ss * (ct * e1 + st * e2) + cs * e3
            ds, dt = cs * (ct * e1 + st * e2) - ss * e3, ss * (ct * e2 - st * e1)
            out[0, i], out[1, i], out[2, i] = flat.ball[k, 9 + i] + radius * d, radius * ds, radius * dt
            out[6, i], out[7, i], out[8, i] = sign * d, sign * ds, sign * dt
        return
    M, N, first = flat.degree[which, 0], flat.degree[which, 1], flat.first[which]
    weights(M, s, W[0])
    weights(N, t, W[1])
    out[:6] = 0.0
    for i in range(M + 1):
        for j in range(N + 1):
            at = first + i * (N + 1) + j
            w0, w1, w2 = W[0, 0, i] * W[1, 0, j], W[0, 1, i] * W[1, 0, j], W[0, 0, i] * W[1, 1, j]
            w3, w4, w5 = W[0, 2, i] * W[1, 0, j], W[0, 1, i] * W[1, 1, j], W[0, 0, i] * W[1, 2, j]
            for c in range(3):
                q = flat.points[at, c]
                out[0, c] += w0 * q
                out[1, c] += w1 * q
                out[2, c] += w2 * q
                out[3, c] += w3 * q
                out[4, c] += w4 * q
                out[5, c] += w5 * q
    _cross(out[1], out[2], out[6])
    size = norm(out[6])
    f = sign / size
    for i in range(3):
        out[6, i] *= f
    for way in range(2):
        # derivative of the unit normal: (f - n (n . f)) / |n| with f = p_ss x p_t + p_s x p_st, and so on
        a, b, target = out[3 + way], out[4 + way], out[7 + way]
        for i in range(3):
            j, l = (i + 1) % 3, (i + 2) % 3
            target[i] = f * (a[j] * out[2, l] - a[l] * out[2, j] + out[1, j] * b[l] - out[1, l] * b[j])
        along = target[0] * out[6, 0] + target[1] * out[6, 1] + target[2] * out[6, 2]
        for i in range(3):
            target[i] -= along * out[6, i]


@inner
def _cross(a, b, out):  # type: ignore[no-untyped-def]
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inner
def worst(bend, s, hs, t, ht, out):  # type: ignore[no-untyped-def]
    """Largest constants over a box of a surface's parameters, into out (10,).

    bend (g, g, 10): for each of g x g cells of the unit square |p_s|, |p_t|, |p_ss|, |p_st|, |p_tt| of the
    (moved out) surface, and the same of its unit normal. NaN in the second cell: the first holds everywhere.
    """
    g = bend.shape[0]
    i0, i1 = max(0, int((s - hs) * g - 1e-9)), min(g - 1, int((s + hs) * g + 1e-9))
    j0, j1 = max(0, int((t - ht) * g - 1e-9)), min(g - 1, int((t + ht) * g + 1e-9))
    if g == 1 or np.isnan(bend[0, 1, 0]):
        i0 = i1 = j0 = j1 = 0
    out[:] = 0.0
    for i in range(min(i0, g - 1), i1 + 1):
        for j in range(min(j0, g - 1), j1 + 1):
            for c in range(10):
                out[c] = max(out[c], bend[i, j, c])


@inner
def element(k, x, h, flat, bend, V, D, E, work):  # type: ignore[no-untyped-def]
    """Taylor polynomials of contact k about the middle of a box.

    x (n,): the middle; h (n,): half widths. Out, V (4, 3) middles of C, hand direction, O, object direction
    (the one that R takes to the hand direction); D (4, n, 3) their derivatives; E (4,) remainders.
    bend (b, 2, g, g, 10): constants of the object's and the hand's regions, see `worst`. k = b: the object's
    origin, which is a point on both bodies too, where the task bounds its position; it has no direction.
    """
    pose, axes, spots, o, f, W, a = work
    T = pose[0]
    D[:, :, :] = 0.0
    if k == flat.steps.shape[0]:
        V[:, :] = 0.0
        E[:] = ROUNDING
        for i in range(3):
            v = flat.params[0] - 7 + i
            V[0, i], D[0, v, i] = x[v], 1.0
        return
    chain(k, x, flat, pose, axes, spots)
    first = flat.params[k]
    rolls = flat.hand[k] != PATCH
    surface(k, k, x[first], x[first + 1], flat, o, W)
    out = flat.radius[k] if rolls else 0.0
    faces = -flat.sign[k] if rolls else -1.0
    hs, ht = h[first], h[first + 1]
    for i in range(3):
        V[2, i], V[3, i] = o[0, i] + out * o[6, i], faces * o[6, i]
        D[2, first, i], D[2, first + 1, i] = o[1, i] + out * o[7, i], o[2, i] + out * o[8, i]
        D[3, first, i], D[3, first + 1, i] = faces * o[7, i], faces * o[8, i]
    worst(bend[k, 0], x[first], hs, x[first + 1], ht, a)
    E[2] = (0.5 * (a[2] * hs * hs + 2 * a[3] * hs * ht + a[4] * ht * ht) + ROUNDING) * WIDER
    E[3] = (0.5 * (a[7] * hs * hs + 2 * a[8] * hs * ht + a[9] * ht * ht) + ROUNDING) * WIDER
    # the hand's side
    slide, tilt, curve, bow = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        V[0, i], V[1, i] = T[i, 3], 0.0
    if rolls:
        for i in range(3):
            for j in range(3):
                V[0, i] += T[i, j] * flat.center[k, j]
                V[1, i] += T[i, j] * flat.axis[k, j]
    else:
        surface(flat.steps.shape[0] + k, k, x[first + 2], x[first + 3], flat, f, W)
        hu, hv = h[first + 2], h[first + 3]
        worst(bend[k, 1], x[first + 2], hu, x[first + 3], hv, a)
        slide, tilt = a[0] * hu + a[1] * hv, a[5] * hu + a[6] * hv
        curve = 0.5 * (a[2] * hu * hu + 2 * a[3] * hu * hv + a[4] * hv * hv)
        bow = 0.5 * (a[7] * hu * hu + 2 * a[8] * hu * hv + a[9] * hv * hv)
        for i in range(3):
            for j in range(3):
                V[0, i] += T[i, j] * f[0, j]
                V[1, i] += T[i, j] * f[6, j]
                for way in range(2):
                    D[0, first + 2 + way, i] += T[i, j] * f[1 + way, j]
                    D[1, first + 2 + way, i] += T[i, j] * f[7 + way, j]
    # joints from the tip to the palm: how far the point can be from each axis bounds what bends its path
    point, turned, before = 0.0, 0.0, 0.0
    strayed = slide  # how far the point strays as seen from the joint at hand
    for i in range(flat.steps[k]):
        if flat.kind[k, i] != PRISMATIC:
            before += abs(flat.ratio[k, i]) * h[flat.var[k, i]]
    for back in range(flat.steps[k]):
        step = flat.steps[k] - 1 - back
        v, ratio = flat.var[k, step], flat.ratio[k, step]
        reach = abs(ratio) * h[v]
        a0, a1, a2 = axes[step, 0], axes[step, 1], axes[step, 2]
        if flat.kind[k, step] == PRISMATIC:
            D[0, v, 0] += ratio * a0
            D[0, v, 1] += ratio * a1
            D[0, v, 2] += ratio * a2
            point += before * reach
            strayed += reach
            continue
        before -= reach  # turns of the joints before this one
        l0, l1, l2 = V[0, 0] - spots[step, 0], V[0, 1] - spots[step, 1], V[0, 2] - spots[step, 2]
        c0, c1, c2 = a1 * l2 - a2 * l1, a2 * l0 - a0 * l2, a0 * l1 - a1 * l0
        D[0, v, 0] += ratio * c0
        D[0, v, 1] += ratio * c1
        D[0, v, 2] += ratio * c2
        D[1, v, 0] += ratio * (a1 * V[1, 2] - a2 * V[1, 1])
        D[1, v, 1] += ratio * (a2 * V[1, 0] - a0 * V[1, 2])
        D[1, v, 2] += ratio * (a0 * V[1, 1] - a1 * V[1, 0])
        away = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2) + strayed
        point += away * reach * (0.5 * reach + max(before, 0.0))
        turned += reach
        strayed += away * reach
    E[0] = (point + turned * slide + curve + ROUNDING * (1.0 + turned)) * WIDER
    E[1] = (0.5 * turned * turned + turned * tilt + bow + ROUNDING * (1.0 + turned)) * WIDER
