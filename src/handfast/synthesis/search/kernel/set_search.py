"""Discard boxes, compiled: what no object pose can bring together, told without the pose.

Whatever the object's pose (R, p), a rigid motion keeps distances and angles. With C_k(q) the centre of the
hand's cap (or the point of its patch) and O_k(s, t) the point of the object's region, moved out by the cap's
radius, contacts k and l need

    |C_k - C_l| = |O_k - O_l|,

and for every two directions, one on each body, that R must bring together up to a tolerance (a cap's axis and the
contact normal, to the cone; a patch's normal, exactly; C_k - C_l, exactly; bounds of the object's axes) the
angles between them agree up to both tolerances: the triangle inequality on the sphere.

Over a box every quantity is its Taylor polynomial of degree one about the middle and a remainder
(`taylor`). `ROW_PADDING` covers the rounding of the few operations on them. Each condition is a linear row with
an interval, narrows the box, or discards it.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.angle_terms import (
    I_J,
    LINE_I,
    LINE_J,
    OBJECT_OFFSET,
    TRIPLE,
    Direction,
    agree,
    direction,
    product,
    triple,
    twist,
    unit,
)
from handfast.synthesis.search.kernel.narrowing import (
    BOX_LOOKS,
    REPEAT_SHARE,
    ROW_PADDING,
    angle,
    center,
    cut,
    halve,
    narrow,
    set_aside,
    swept,
    tolerance_of,
)
from handfast.synthesis.search.kernel.spins import between, spins
from handfast.synthesis.search.kernel.taylor import (
    HAND_DIRECTION,
    HAND_POINT,
    OBJECT_DIRECTION,
    OBJECT_POINT,
    TAYLOR_INFLATION,
    element,
    norm,
    spread,
)
from handfast.synthesis.search.workspace import LEFT, NODES, SMALL, SetWork
from handfast.synthesis.task_groups import Flat

DIRECTION_LENGTH = 0.12  # units of length that one of a direction counts for when a coordinate is chosen to split


@inner
def _length(a, b, question, task, work):
    """Narrow by the distance of contacts a and b. False if impossible.

    Then remainders of the lines on hand and object, and how far these stray.
    """
    use, box, polynomials, line = question.use, work.box, work.polynomials, work.line
    value, slope, remainder = polynomials.value, polynomials.slope, polynomials.remainder
    d, e, P, Q, g = line.line[0], line.line[1], line.slope[0], line.slope[1], line.gradient
    for i in use:
        for c in range(3):
            P[i, c] = slope[a, HAND_POINT, i, c] - slope[b, HAND_POINT, i, c]
            Q[i, c] = slope[a, OBJECT_POINT, i, c] - slope[b, OBJECT_POINT, i, c]
    for c in range(3):
        d[c] = value[a, HAND_POINT, c] - value[b, HAND_POINT, c]
        e[c] = value[a, OBJECT_POINT, c] - value[b, OBJECT_POINT, c]
    d_error = (remainder[a, HAND_POINT] + remainder[b, HAND_POINT]) * TAYLOR_INFLATION
    e_error = (remainder[a, OBJECT_POINT] + remainder[b, OBJECT_POINT]) * TAYLOR_INFLATION
    d_size, e_size = norm(d), norm(e)
    d_stray, e_stray = spread(P, box.half, use) + d_error, spread(Q, box.half, use) + e_error
    for i in use:
        g[i] = 2 * (d[0] * P[i, 0] + d[1] * P[i, 1] + d[2] * P[i, 2])
        g[i] -= 2 * (e[0] * Q[i, 0] + e[1] * Q[i, 1] + e[2] * Q[i, 2])
    low, high = _bend(a, b, d_error, d_stray, question, task, work)
    pad = ROW_PADDING * (d_size * d_size + e_size * e_size + abs(low) + abs(high))
    least = low - (2 * e_size * e_error + e_stray * e_stray) * TAYLOR_INFLATION - pad
    most = high + 2 * e_size * e_error * TAYLOR_INFLATION + pad
    fits = narrow(d_size * d_size - e_size * e_size, g, least, most, box, use)
    return fits, d_error, e_error, d_stray, e_stray


@inner
def _bend(a, b, error, stray, question, task, work):
    """Bounds of what the polynomial of degree one of the squared length of the line leaves out, on the hand.

    With d its vector, that is 2 d . d'' + |d'|^2 and what second derivatives leave out. Both quadratic forms are
    bounded together, and apart, since |d'|^2 is never negative. error, stray: of the vector, as in `_length`.
    """
    use, polynomials, form, half = question.use, work.polynomials, work.line.form, work.box.half
    d, P, chains = work.line.line[0], work.line.slope[0], task.chains
    size = norm(d)
    rest = 2 * size * (polynomials.rest[a] + polynomials.rest[b]) * TAYLOR_INFLATION
    for i in use:
        for j in use:
            form[i, j] = 0.0
    for end in range(2):
        row, sign = (a, 1.0) if end == 0 else (b, -1.0)
        k = question.contacts[row]
        if k == chains.joints.shape[0]:  # the object's origin
            continue
        for i in range(chains.joints[k]):
            v = chains.coordinate[k, i]
            for j in range(i, chains.joints[k]):
                w, bend = chains.coordinate[k, j], polynomials.bend[row, i, j]
                both = sign * (d[0] * bend[0] + d[1] * bend[1] + d[2] * bend[2])
                form[v, w] += both
                if i < j:
                    form[w, v] += both
    low, high = _ends(form, half, use)
    far = 2 * size * error * TAYLOR_INFLATION
    least, most = max(low - rest, -far), min(high + rest, far) + stray * stray * TAYLOR_INFLATION
    for i in use:
        for j in use:
            form[i, j] += P[i, 0] * P[j, 0] + P[i, 1] * P[j, 1] + P[i, 2] * P[j, 2]
    low, high = _ends(form, half, use)
    rest += (2 * (stray - error) * error + error * error) * TAYLOR_INFLATION
    return max(least, low - rest), min(most, high + rest)


@inner
def _ends(form, half, use):
    """Bounds of a quadratic form, symmetric (n, n), over a box about 0."""
    low, high = 0.0, 0.0
    for i in use:
        for j in use:
            both = form[i, j] * half[i] * half[j]
            low += min(both, 0.0) if i == j else -abs(both)
            high += max(both, 0.0) if i == j else abs(both)
    return low, high


@inner
def _line(a, b, question, task, work):
    """Narrow by the line between contacts a and b: its length, and the spins about it. False if impossible."""
    use, box, polynomials, line, terms = question.use, work.box, work.polynomials, work.line, work.terms
    tolerance, swing, arcs, bound = polynomials.tolerance, polynomials.swing, line.arcs, line.unit_bound
    fits, d_error, e_error, d_stray, e_stray = _length(a, b, question, task, work)
    if not fits:
        return False
    stray = swept(norm(line.line[0]), d_stray) + swept(norm(line.line[1]), e_stray)
    if stray > 1.0:
        return True
    if not spins(stray, polynomials, line):
        return False
    ready = False
    for i in range(tolerance.shape[0]):
        off = abs(arcs[i, 0] - arcs[i, 1]) + stray + swing[i, HAND_DIRECTION] + swing[i, OBJECT_DIRECTION]
        if tolerance[i] >= np.pi or off < tolerance[i]:
            continue
        if not ready:
            unit(0, d_error, d_stray, box.half, use, line)
            unit(1, e_error, e_stray, box.half, use, line)
            if not (bound[0, 0] < 1 and bound[1, 0] < 1):
                return True
            ready = True
        if not _spin(i, use, box, polynomials, line, terms):
            return False
    return True


@inner
def _spin(i, use, box, polynomials, line, terms):
    """Narrow by direction i and the line: their angle, and the spins that suit i and one before it."""
    tolerance, arcs, half = polynomials.tolerance, line.arcs, box.half
    for body in range(2):
        along, first = _along(body, line), direction(i, HAND_DIRECTION + 2 * body, polynomials)
        product(LINE_I + OBJECT_OFFSET * body, along, first, half, use, terms)
    if not agree(LINE_I, tolerance[i], box, use, terms):
        return False
    for j in range(i):
        # only where the middle has no spin for both
        if tolerance[j] >= np.pi or arcs[i, 3] + arcs[j, 3] >= np.pi:
            continue
        if min(arcs[i, 3], arcs[j, 3]) < 0 or between(arcs[i, 2], arcs[j, 2]) < arcs[i, 3] + arcs[j, 3]:
            continue
        for body in range(2):
            along, first = _along(body, line), direction(i, HAND_DIRECTION + 2 * body, polynomials)
            second = direction(j, HAND_DIRECTION + 2 * body, polynomials)
            product(LINE_J + OBJECT_OFFSET * body, along, second, half, use, terms)
            product(I_J + OBJECT_OFFSET * body, first, second, half, use, terms)
            triple(TRIPLE + OBJECT_OFFSET * body, along, first, second, half, use, terms)
        if not twist(tolerance[i], tolerance[j], box, use, terms):
            return False
    return True


@inner
def _along(body, line):
    """The unit vector along a line as a direction."""
    return Direction(line.unit[body], line.unit_slope[body], line.unit_bound[body, 0], line.unit_bound[body, 1])


@inner
def _pair(i, j, use, box, polynomials, terms):
    """Narrow by the angle between directions i and j. False if impossible."""
    value, swing = polynomials.value, polynomials.swing
    both = polynomials.tolerance[i] + polynomials.tolerance[j]
    off = swing[i, HAND_DIRECTION] + swing[i, OBJECT_DIRECTION] + swing[j, HAND_DIRECTION] + swing[j, OBJECT_DIRECTION]
    if both + off >= np.pi:
        return True
    on_hand, on_object = angle(value[i, 1], value[j, 1]), angle(value[i, 3], value[j, 3])
    if abs(on_hand - on_object) + off < both:
        return True
    for body in range(2):
        first = direction(i, HAND_DIRECTION + 2 * body, polynomials)
        second = direction(j, HAND_DIRECTION + 2 * body, polynomials)
        product(I_J + OBJECT_OFFSET * body, first, second, box.half, use, terms)
    return agree(I_J, both, box, use, terms)


@inner
def _narrowed(bounds, task, question, work):
    """Narrow a box (n, 2), `bounds`, for the contacts of a set. False if nothing is left."""
    contacts, use = question.contacts, question.use
    box, polynomials, terms = work.box, work.polynomials, work.terms
    count = contacts.shape[0]
    for _ in range(BOX_LOOKS):
        center(bounds, use, box)
        for a in range(count):
            element(contacts[a], a, task, question.derivative_bounds, work)
            for which in range(HAND_DIRECTION, OBJECT_DIRECTION + 1, 2):
                stray = spread(polynomials.slope[a, which], box.half, use) + polynomials.remainder[a, which]
                polynomials.swing[a, which] = swept(1.0, stray)
        for a in range(count):
            for b in range(a):
                if not _line(a, b, question, task, work):
                    return False
        for i in range(polynomials.tolerance.shape[0]):
            for j in range(min(i, count)):
                if not _pair(i, j, use, box, polynomials, terms):
                    return False
        shrunk = cut(bounds, use, box)
        if shrunk < 0:
            return False
        if shrunk > REPEAT_SHARE:
            break
    return True


@inner
def _longest(box, question, slope):
    """The coordinate that moves a contact most, and how far [units]."""
    best, worst = -1, -1.0
    for i in question.use:
        half = 0.5 * (box[i, 1] - box[i, 0])
        stray = 0.0
        for a in range(question.contacts.shape[0]):
            on_hand = norm(slope[a, HAND_POINT, i]) + DIRECTION_LENGTH * norm(slope[a, HAND_DIRECTION, i])
            on_object = norm(slope[a, OBJECT_POINT, i]) + DIRECTION_LENGTH * norm(slope[a, OBJECT_DIRECTION, i])
            stray = max(stray, max(on_hand, on_object) * half)
        if stray > worst:
            best, worst = i, stray
    return best, worst


@inner
def _prepare(regions, question, polynomials):
    """Tolerances of all directions, and the polynomials of the object's axes, which no coordinate moves."""
    contacts, cones = question.contacts, question.cones
    count = contacts.shape[0]
    for a in range(count):
        origin = contacts[a] == regions.hand.shape[0]
        polynomials.tolerance[a] = np.pi if origin else tolerance_of(contacts[a], regions)
    polynomials.value[count:] = 0.0
    polynomials.slope[count:] = 0.0
    polynomials.remainder[count:] = 0.0
    polynomials.swing[:] = 0.0
    for c in range(cones.shape[0]):
        for i in range(3):
            polynomials.value[count + c, HAND_DIRECTION, i] = cones[c, 1 + i]
        polynomials.value[count + c, OBJECT_DIRECTION, int(cones[c, 0])] = 1.0
        polynomials.tolerance[count + c] = cones[c, 4]


@inner
def explore_set(
    chains, regions, coordinates, stack, question, box, polynomials, taylor, line, terms, budget, resolution
):
    """Depth first from the first box of a `Stack`, in place, until it is empty or `budget` nodes are spent.

    question: `SetQuestion`. Boxes that stray by less than `resolution` [units] are set aside.
    """
    task, work = Flat(chains, regions, coordinates), SetWork(box, polynomials, taylor, line, terms)
    _prepare(regions, question, polynomials)
    count, nodes, small, again = 1, 0, 0, False
    while count > 0 and nodes < budget and count + 2 < stack.share.shape[0] and small < stack.small_share.shape[0]:
        count -= 1
        nodes += 1
        second, again = again, False
        here = stack.box[count]
        if not _narrowed(here, task, question, work):
            continue
        split, stray = _longest(here, question, polynomials.slope)
        if split < 0:
            continue
        if stray < resolution and not second:  # rows that made it small may discard what they have left
            again = True
            count += 1
            continue
        if stray < resolution:
            set_aside(stack, count, small)
            small += 1
            continue
        halve(stack, count, split)
        count += 2
    stack.counts[LEFT], stack.counts[SMALL], stack.counts[NODES] = count, small, nodes
    return 0
