"""Where a contact can be over a box of coordinates, compiled: Taylor polynomials of degree one with remainders.

Remainders bound the second derivatives over the whole box: for chains of joints by the distances to the axes,
for regions by constants of theirs (`prover.derivative_bounds`). Middles are plain
floating point. A chain of s joints and a patch of degree (M, N) make them within `TAYLOR_ROUNDING` of the exact
values: at most 30 (s + M + N) roundings of 1.2e-16, on numbers of at most a few units, is below 1e-13.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.kinematics import OF_REALS
from handfast.synthesis.task_groups import CAP_REGION, POSE, PRISMATIC

chain, surface = OF_REALS

HAND_POINT, HAND_DIRECTION, OBJECT_POINT, OBJECT_DIRECTION = 0, 1, 2, 3  # what there are polynomials of
TAYLOR_ROUNDING = 1e-11  # units and units per radian
TAYLOR_INFLATION = 1.0 + 1e-12


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
    return np.sqrt(total) * TAYLOR_INFLATION


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
def element(k, row, task, derivative_bounds, whole):
    """Taylor polynomials of contact k about the middle of a box, `whole.box`, into a row of `whole.polynomials`.

    Of HAND_POINT, the point of its region or the centre of its cap, HAND_DIRECTION, OBJECT_POINT, on the surface moved
    out by the cap's radius, and OBJECT_DIRECTION (the one that R takes to the hand's direction). derivative_bounds
    (b, 2, g, g, 10): of the object's and the hand's regions, see `worst`. k = b: the object's origin, which is a point
    on both bodies too, where the task bounds its position; it has no direction.
    """
    box, polynomials, work = whole.box, whole.polynomials, whole.taylor
    slope = polynomials.slope[row]
    slope[:, :, :] = 0.0
    if k == task.chains.joints.shape[0]:
        value, remainder = polynomials.value[row], polynomials.remainder[row]
        value[:, :] = 0.0
        remainder[:] = polynomials.rest[row] = TAYLOR_ROUNDING
        for i in range(3):
            v = task.coordinates.parameter[0] - POSE + i
            value[HAND_POINT, i], slope[HAND_POINT, v, i] = box.middle[v], 1.0
        return
    first, bounds = task.coordinates.parameter[k], derivative_bounds[k]
    chain(k, box.middle, task.chains, work)
    _on_object(k, row, first, box, task.regions, bounds[0], polynomials, work)
    # how far point and direction move in the link, and what their polynomials leave out
    in_link = _in_link(k, row, first, box, task.regions, bounds[1], polynomials, work)
    _on_hand(k, row, in_link, box.half, task.chains, polynomials, work)


@inner
def _on_object(k, row, first, box, regions, bounds, polynomials, work):
    """The object's point and direction of contact k; first: of its parameters."""
    value, slope, remainder = polynomials.value[row], polynomials.slope[row], polynomials.remainder[row]
    rows, largest = work.object_surface, work.largest
    s, t, half_s, half_t = box.middle[first], box.middle[first + 1], box.half[first], box.half[first + 1]
    surface(k, k, s, t, regions, rows, work)
    rolls = regions.hand[k] == CAP_REGION
    out = regions.radius[k] if rolls else 0.0
    faces = -regions.sign[k] if rolls else -1.0
    for i in range(3):
        value[OBJECT_POINT, i] = rows[0, i] + out * rows[6, i]
        value[OBJECT_DIRECTION, i] = faces * rows[6, i]
        for way in range(2):
            slope[OBJECT_POINT, first + way, i] = rows[1 + way, i] + out * rows[7 + way, i]
            slope[OBJECT_DIRECTION, first + way, i] = faces * rows[7 + way, i]
    worst(bounds, s, half_s, t, half_t, largest)
    remainder[OBJECT_POINT] = (_second(largest, 2, half_s, half_t) + TAYLOR_ROUNDING) * TAYLOR_INFLATION
    remainder[OBJECT_DIRECTION] = (_second(largest, 7, half_s, half_t) + TAYLOR_ROUNDING) * TAYLOR_INFLATION


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

    From the tip to the palm: how far the point can be from each joint's axis bounds the derivatives of its path. Its
    second derivatives in the middle go into `bend`. A turn by q about an axis K takes w + v, with v of order one and
    more, to w + v + q K (w + v) + q^2 / 2 K^2 (w + v) and at most q^3 / 6 |K (w + v)|; of these terms those up to order
    two are in slopes and bends, the others in `rest`.
    """
    value, slope, remainder = polynomials.value[row], polynomials.slope[row], polynomials.remainder[row]
    slide, tilt, curve, bow = in_link
    bend, steps = polynomials.bend[row], chains.joints[k]
    turned, strayed = 0.0, slide  # how far the point strays as seen from the joint at hand
    left, rest = curve, curve  # what the polynomials of degree one and two of that leave out
    for back in range(steps):
        step = steps - 1 - back
        v, ratio = chains.coordinate[k, step], chains.ratio[k, step]
        reach = abs(ratio) * half[v]
        axis, path = work.joint_axis[step], bend[step, step]
        if chains.kind[k, step] == PRISMATIC:
            for c in range(3):
                slope[HAND_POINT, v, c] += ratio * axis[c]
                path[c] = ratio * axis[c]
            strayed += reach
        else:
            spot, d = work.joint_point[step], value[HAND_DIRECTION]
            for c in range(3):
                work.arm[c] = value[HAND_POINT, c] - spot[c]
            across(axis, work.arm, ratio, path)
            for c in range(3):
                slope[HAND_POINT, v, c] += path[c]
            slope[HAND_DIRECTION, v, 0] += ratio * (axis[1] * d[2] - axis[2] * d[1])
            slope[HAND_DIRECTION, v, 1] += ratio * (axis[2] * d[0] - axis[0] * d[2])
            slope[HAND_DIRECTION, v, 2] += ratio * (axis[0] * d[1] - axis[1] * d[0])
            away = norm(path) / max(abs(ratio), 1e-300) + strayed
            rest += reach * (slide + left) + 0.5 * reach * reach * (strayed + away * reach / 3)
            left += reach * (strayed + 0.5 * away * reach)
            turned += reach
            strayed += away * reach
        for before in range(step):
            if chains.kind[k, before] == PRISMATIC:
                for c in range(3):
                    bend[before, step, c] = 0.0
            else:
                across(work.joint_axis[before], path, chains.ratio[k, before], bend[before, step])
    for step in range(steps):
        if chains.kind[k, step] == PRISMATIC:
            for c in range(3):
                bend[step, step, c] = 0.0
        else:
            for c in range(3):
                work.arm[c] = bend[step, step, c]
            across(work.joint_axis[step], work.arm, chains.ratio[k, step], bend[step, step])
    extra = TAYLOR_ROUNDING * (1.0 + turned)
    polynomials.rest[row] = (rest + extra * (1.0 + turned)) * TAYLOR_INFLATION
    remainder[HAND_POINT] = (left + extra) * TAYLOR_INFLATION
    remainder[HAND_DIRECTION] = (0.5 * turned * turned + turned * tilt + bow + extra) * TAYLOR_INFLATION


@inner
def across(axis, arm, ratio, out):
    """ratio axis x arm into `out` (3,)."""
    out[0] = ratio * (axis[1] * arm[2] - axis[2] * arm[1])
    out[1] = ratio * (axis[2] * arm[0] - axis[0] * arm[2])
    out[2] = ratio * (axis[0] * arm[1] - axis[1] * arm[0])


@inner
def _in_link(k, row, first, box, regions, bounds, polynomials, work):
    """The hand's point and direction in the palm, with their derivatives by the region's parameters.

    Returns how far the point and the direction move in the link, and what their polynomials leave out.
    """
    value, slope, R = polynomials.value[row], polynomials.slope[row], work.link_rotation
    rows, largest = work.hand_surface, work.largest
    for i in range(3):
        value[HAND_POINT, i], value[HAND_DIRECTION, i] = work.link_position[i], 0.0
    if regions.hand[k] == CAP_REGION:
        for i in range(3):
            for j in range(3):
                value[HAND_POINT, i] += R[i, j] * regions.center[k, j]
                value[HAND_DIRECTION, i] += R[i, j] * regions.axis[k, j]
        return 0.0, 0.0, 0.0, 0.0
    s, t, half_s, half_t = box.middle[first + 2], box.middle[first + 3], box.half[first + 2], box.half[first + 3]
    surface(regions.hand.shape[0] + k, k, s, t, regions, rows, work)
    worst(bounds, s, half_s, t, half_t, largest)
    for i in range(3):
        for j in range(3):
            value[HAND_POINT, i] += R[i, j] * rows[0, j]
            value[HAND_DIRECTION, i] += R[i, j] * rows[6, j]
            for way in range(2):
                slope[HAND_POINT, first + 2 + way, i] += R[i, j] * rows[1 + way, j]
                slope[HAND_DIRECTION, first + 2 + way, i] += R[i, j] * rows[7 + way, j]
    slide, tilt = largest[0] * half_s + largest[1] * half_t, largest[5] * half_s + largest[6] * half_t
    return slide, tilt, _second(largest, 2, half_s, half_t), _second(largest, 7, half_s, half_t)
