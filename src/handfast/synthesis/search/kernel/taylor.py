"""Where a contact can be over a box of coordinates, compiled: Taylor polynomials of degree one with remainders.

Remainders bound the second derivatives over the whole box: for chains of joints by the distances to the axes,
for regions by constants of theirs (`prover.derivative_bounds`). Middles are plain
floating point. A chain of s joints and a patch of degree (M, N) make them within `ROUNDING` of the exact
values: at most 30 (s + M + N) roundings of 1.2e-16, on numbers of at most a few units, is below 1e-13.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.task_groups import CAP, CYLINDER, POSE, PRISMATIC

HAND_POINT, HAND_DIRECTION, OBJECT_POINT, OBJECT_DIRECTION = 0, 1, 2, 3  # what there are polynomials of
ROUNDING = 1e-11  # units and units per radian
WIDER = 1.0 + 1e-12


@inner
def norm(v):
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inner
def spread(slope, half, use):
    """Bound of |sum_i g_i d_i| for |d_i| <= half_i, with g_i the rows of slope (n, 3); use: coordinates."""
    total = 0.0
    for c in range(3):
        reach = 0.0
        for i in use:
            reach += abs(slope[i, c]) * half[i]
        total += reach * reach
    return np.sqrt(total) * WIDER


@inner
def _chain(k, x, chains, work):
    """Pose of the link of contact k, (R, p) in work.pose[0], its joints' axes and points on them."""
    T, U = work.pose[0], work.pose[1]
    for i in range(3):
        for j in range(3):
            T[i, j] = chains.rotation[k, 0, i, j]
        T[i, 3] = chains.translation[k, 0, i]
    for step in range(chains.joints[k]):
        value = chains.ratio[k, step] * x[chains.coordinate[k, step]] + chains.offset[k, step]
        for i in range(3):
            work.joint_axis[step, i], work.joint_point[step, i] = T[i, 2], T[i, 3]
        if chains.kind[k, step] == PRISMATIC:
            for i in range(3):
                T[i, 3] += value * T[i, 2]
        else:
            s, c = np.sin(value), np.cos(value)
            for i in range(3):
                a, b = T[i, 0], T[i, 1]
                T[i, 0], T[i, 1] = c * a + s * b, c * b - s * a
        M, v = chains.rotation[k, step + 1], chains.translation[k, step + 1]
        for i in range(3):
            for j in range(3):
                U[i, j] = T[i, 0] * M[0, j] + T[i, 1] * M[1, j] + T[i, 2] * M[2, j]
            T[i, 3] += T[i, 0] * v[0] + T[i, 1] * v[1] + T[i, 2] * v[2]
        for i in range(3):
            for j in range(3):
                T[i, j] = U[i, j]


@inner
def _weights(degree, x, out):
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
def _surface(which, k, s, t, regions, out, weight):
    """Rows of out (9, 3): p, p_s, p_t, then three of work, then the unit normal n, n_s, n_t; weight: work."""
    sign = regions.face[which]
    kind, numbers = regions.object[k] if which == k else regions.hand[k], regions.numbers[which]
    if kind == CAP:
        ss, cs, st, ct, radius = np.sin(s), np.cos(s), np.sin(t), np.cos(t), numbers[12]
        for i in range(3):
            e1, e2, e3 = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
            d = ss * (ct * e1 + st * e2) + cs * e3
            ds, dt = cs * (ct * e1 + st * e2) - ss * e3, ss * (ct * e2 - st * e1)
            out[0, i], out[1, i], out[2, i] = numbers[9 + i] + radius * d, radius * ds, radius * dt
            out[6, i], out[7, i], out[8, i] = sign * d, sign * ds, sign * dt
        return
    if kind == CYLINDER:
        turn, length, radius = numbers[14], numbers[15], numbers[12]
        sa, ca = np.sin(numbers[13] + turn * s), np.cos(numbers[13] + turn * s)
        for i in range(3):
            e1, e2, e3 = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
            d, ds = ca * e1 + sa * e2, turn * (ca * e2 - sa * e1)
            out[0, i], out[1, i], out[2, i] = numbers[9 + i] + radius * d + t * length * e3, radius * ds, length * e3
            out[6, i], out[7, i], out[8, i] = sign * d, sign * ds, 0.0
        return
    M, N, first = regions.degree[which, 0], regions.degree[which, 1], regions.first[which]
    _weights(M, s, weight[0])
    _weights(N, t, weight[1])
    u, v = weight[0], weight[1]
    out[:6] = 0.0
    for i in range(M + 1):
        for j in range(N + 1):
            at = first + i * (N + 1) + j
            w0, w1, w2 = u[0, i] * v[0, j], u[1, i] * v[0, j], u[0, i] * v[1, j]
            w3, w4, w5 = u[2, i] * v[0, j], u[1, i] * v[1, j], u[0, i] * v[2, j]
            for c in range(3):
                q = regions.points[at, c]
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
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inner
def worst(bounds, s, hs, t, ht, out):
    """Largest constants over a box of a surface's parameters, into out (10,).

    bounds (g, g, 10): for each of g x g cells of the unit square |p_s|, |p_t|, |p_ss|, |p_st|, |p_tt| of the
    (moved out) surface, and the same of its unit normal. NaN in the second cell: the first holds everywhere.
    """
    g = bounds.shape[0]
    i0, i1 = max(0, int((s - hs) * g - 1e-9)), min(g - 1, int((s + hs) * g + 1e-9))
    j0, j1 = max(0, int((t - ht) * g - 1e-9)), min(g - 1, int((t + ht) * g + 1e-9))
    if g == 1 or np.isnan(bounds[0, 1, 0]):
        i0 = i1 = j0 = j1 = 0
    out[:] = 0.0
    for i in range(min(i0, g - 1), i1 + 1):
        for j in range(min(j0, g - 1), j1 + 1):
            for c in range(10):
                out[c] = max(out[c], bounds[i, j, c])


@inner
def element(k, row, box, chains, regions, coordinates, derivative_bounds, polynomials, work):
    """Taylor polynomials of contact k about the middle of a box (`CenteredBox`), into a row of `polynomials`.

    Of HAND_POINT, the point of its region or the centre of its cap, HAND_DIRECTION, OBJECT_POINT, on the surface moved
    out by the cap's radius, and OBJECT_DIRECTION (the one that R takes to the hand's direction). derivative_bounds
    (b, 2, g, g, 10): of the object's and the hand's regions, see `worst`. k = b: the object's origin, which is a point
    on both bodies too, where the task bounds its position; it has no direction.
    """
    slope = polynomials.slope[row]
    slope[:, :, :] = 0.0
    if k == chains.joints.shape[0]:
        value, remainder = polynomials.value[row], polynomials.remainder[row]
        value[:, :] = 0.0
        remainder[:] = ROUNDING
        for i in range(3):
            v = coordinates.parameter[0] - POSE + i
            value[HAND_POINT, i], slope[HAND_POINT, v, i] = box.middle[v], 1.0
        return
    first, bounds = coordinates.parameter[k], derivative_bounds[k]
    _chain(k, box.middle, chains, work)
    _on_object(k, row, first, box, regions, bounds[0], polynomials, work)
    # how far point and direction move in the link, and what their polynomials leave out
    in_link = _in_link(k, row, first, box, regions, bounds[1], polynomials, work)
    _on_hand(k, row, in_link, box.half, chains, polynomials, work)


@inner
def _on_object(k, row, first, box, regions, bounds, polynomials, work):
    """The object's point and direction of contact k; first: of its parameters."""
    value, slope, remainder = polynomials.value[row], polynomials.slope[row], polynomials.remainder[row]
    surface, largest = work.object_surface, work.largest
    s, t, half_s, half_t = box.middle[first], box.middle[first + 1], box.half[first], box.half[first + 1]
    _surface(k, k, s, t, regions, surface, work.weights)
    rolls = regions.hand[k] == CAP
    out = regions.radius[k] if rolls else 0.0
    faces = -regions.sign[k] if rolls else -1.0
    for i in range(3):
        value[OBJECT_POINT, i] = surface[0, i] + out * surface[6, i]
        value[OBJECT_DIRECTION, i] = faces * surface[6, i]
        for way in range(2):
            slope[OBJECT_POINT, first + way, i] = surface[1 + way, i] + out * surface[7 + way, i]
            slope[OBJECT_DIRECTION, first + way, i] = faces * surface[7 + way, i]
    worst(bounds, s, half_s, t, half_t, largest)
    remainder[OBJECT_POINT] = (_second(largest, 2, half_s, half_t) + ROUNDING) * WIDER
    remainder[OBJECT_DIRECTION] = (_second(largest, 7, half_s, half_t) + ROUNDING) * WIDER


@inner
def _second(largest, first, half_s, half_t):
    """What second derivatives of at most largest[first:first+3] add over a box of parameters."""
    bend = (
        largest[first] * half_s * half_s
        + 2 * largest[first + 1] * half_s * half_t
        + largest[first + 2] * half_t * half_t
    )
    return 0.5 * bend


@inner
def _on_hand(k, row, in_link, half, chains, polynomials, work):
    """The hand's point and direction of contact k; in_link: as from `_in_link`, half (n,): widths of the box.

    From the tip to the palm: how far the point can be from each joint's axis bounds the second derivatives of its path.
    """
    value, slope, remainder = polynomials.value[row], polynomials.slope[row], polynomials.remainder[row]
    slide, tilt, curve, bow = in_link
    point, turned, before = 0.0, 0.0, 0.0
    strayed = slide  # how far the point strays as seen from the joint at hand
    for i in range(chains.joints[k]):
        if chains.kind[k, i] != PRISMATIC:
            before += abs(chains.ratio[k, i]) * half[chains.coordinate[k, i]]
    for back in range(chains.joints[k]):
        step = chains.joints[k] - 1 - back
        v, ratio = chains.coordinate[k, step], chains.ratio[k, step]
        reach = abs(ratio) * half[v]
        axis = work.joint_axis[step]
        if chains.kind[k, step] == PRISMATIC:
            for c in range(3):
                slope[HAND_POINT, v, c] += ratio * axis[c]
            point += before * reach
            strayed += reach
            continue
        before -= reach  # turns of the joints before this one
        a0, a1, a2 = axis[0], axis[1], axis[2]
        spot = work.joint_point[step]
        l0, l1, l2 = value[HAND_POINT, 0] - spot[0], value[HAND_POINT, 1] - spot[1], value[HAND_POINT, 2] - spot[2]
        c0, c1, c2 = a1 * l2 - a2 * l1, a2 * l0 - a0 * l2, a0 * l1 - a1 * l0
        slope[HAND_POINT, v, 0] += ratio * c0
        slope[HAND_POINT, v, 1] += ratio * c1
        slope[HAND_POINT, v, 2] += ratio * c2
        d0, d1, d2 = value[HAND_DIRECTION, 0], value[HAND_DIRECTION, 1], value[HAND_DIRECTION, 2]
        slope[HAND_DIRECTION, v, 0] += ratio * (a1 * d2 - a2 * d1)
        slope[HAND_DIRECTION, v, 1] += ratio * (a2 * d0 - a0 * d2)
        slope[HAND_DIRECTION, v, 2] += ratio * (a0 * d1 - a1 * d0)
        away = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2) + strayed
        point += away * reach * (0.5 * reach + max(before, 0.0))
        turned += reach
        strayed += away * reach
    remainder[HAND_POINT] = (point + turned * slide + curve + ROUNDING * (1.0 + turned)) * WIDER
    remainder[HAND_DIRECTION] = (0.5 * turned * turned + turned * tilt + bow + ROUNDING * (1.0 + turned)) * WIDER


@inner
def _in_link(k, row, first, box, regions, bounds, polynomials, work):
    """The hand's point and direction in the palm, with their derivatives by the region's parameters.

    Returns how far the point and the direction move in the link, and what their polynomials leave out.
    """
    value, slope, T = polynomials.value[row], polynomials.slope[row], work.pose[0]
    surface, largest = work.hand_surface, work.largest
    for i in range(3):
        value[HAND_POINT, i], value[HAND_DIRECTION, i] = T[i, 3], 0.0
    if regions.hand[k] == CAP:
        for i in range(3):
            for j in range(3):
                value[HAND_POINT, i] += T[i, j] * regions.center[k, j]
                value[HAND_DIRECTION, i] += T[i, j] * regions.axis[k, j]
        return 0.0, 0.0, 0.0, 0.0
    s, t, half_s, half_t = box.middle[first + 2], box.middle[first + 3], box.half[first + 2], box.half[first + 3]
    _surface(regions.hand.shape[0] + k, k, s, t, regions, surface, work.weights)
    worst(bounds, s, half_s, t, half_t, largest)
    for i in range(3):
        for j in range(3):
            value[HAND_POINT, i] += T[i, j] * surface[0, j]
            value[HAND_DIRECTION, i] += T[i, j] * surface[6, j]
            for way in range(2):
                slope[HAND_POINT, first + 2 + way, i] += T[i, j] * surface[1 + way, j]
                slope[HAND_DIRECTION, first + 2 + way, i] += T[i, j] * surface[7 + way, j]
    slide, tilt = largest[0] * half_s + largest[1] * half_t, largest[5] * half_s + largest[6] * half_t
    return slide, tilt, _second(largest, 2, half_s, half_t), _second(largest, 7, half_s, half_t)
