"""Where a contact can be over a box of coordinates, compiled: Taylor polynomials of degree one with remainders.

Remainders bound the second derivatives over the whole box: for chains of joints by the distances to the axes,
for regions by constants of theirs (`prover.derivative_bounds`). Middles are plain
floating point. A chain of s joints and a patch of degree (M, N) make them within `ROUNDING` of the exact
values: at most 30 (s + M + N) roundings of 1.2e-16, on numbers of at most a few units, is below 1e-13.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.kinematics import OF_REALS
from handfast.synthesis.task_groups import CAP, POSE, PRISMATIC

chain, surface = OF_REALS

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
        remainder[:] = ROUNDING
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
    rolls = regions.hand[k] == CAP
    out = regions.radius[k] if rolls else 0.0
    faces = -regions.sign[k] if rolls else -1.0
    for i in range(3):
        value[OBJECT_POINT, i] = rows[0, i] + out * rows[6, i]
        value[OBJECT_DIRECTION, i] = faces * rows[6, i]
        for way in range(2):
            slope[OBJECT_POINT, first + way, i] = rows[1 + way, i] + out * rows[7 + way, i]
            slope[OBJECT_DIRECTION, first + way, i] = faces * rows[7 + way, i]
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
    value, slope, R = polynomials.value[row], polynomials.slope[row], work.link_rotation
    rows, largest = work.hand_surface, work.largest
    for i in range(3):
        value[HAND_POINT, i], value[HAND_DIRECTION, i] = work.link_position[i], 0.0
    if regions.hand[k] == CAP:
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
