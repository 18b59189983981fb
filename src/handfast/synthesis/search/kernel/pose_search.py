"""Discard boxes of the object's pose, compiled: given the pose, the fingers decouple.

Coordinates are those of the problem, except that the quaternion has one component 1 and the others in [-1, 1]
(four charts hold all rotations) and that the position is that of a point m of the object, amid its regions,
p + R m: turns then move the contacts little. A box of pose (and of joints that several contacts share) is
discarded if some contact cannot be made in it: an inner branch and prune over that contact's own joints and
region parameters finds no box in which

    C - R (O - m) - (p + R m) = 0,    angle(hand direction, R object direction) <= tolerance

(a patch on the hand: directions equal) can hold for a pose of the box. C, O, R and the directions are the
Taylor polynomials of `taylor` and `object_pose`, their remainders bounds over the whole box; `PAD` and
`TAYLOR_ROUNDING` cover what rounds. The rows count one by one, and in the sum of them that says most
(`contact_rows`). Newton steps only tell sooner where a contact can be made; they discard nothing.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.contact_rows import directions_meet, least_step, not_apart, points_meet
from handfast.synthesis.search.kernel.narrowing import (
    BOX_LOOKS,
    RADIAN,
    REPEAT_SHARE,
    center,
    cut,
    halve,
    narrow,
    set_aside,
    tolerance_of,
)
from handfast.synthesis.search.kernel.object_pose import (
    cosine_of_directions,
    gaps,
    rotated,
    turn_derivatives,
    turning,
)
from handfast.synthesis.search.kernel.taylor import (
    HAND_DIRECTION,
    HAND_POINT,
    OBJECT_DIRECTION,
    OBJECT_POINT,
    TAYLOR_ROUNDING,
    norm,
)
from handfast.synthesis.search.workspace import LEFT, NODES, SMALL, PoseWork
from handfast.synthesis.task_groups import POSE, QUATERNION, Flat

STRAY_SHARE = 0.5  # own coordinates are split until they stray by less than this share of what the pose does
SPIN = 0.15  # units of length that a radian of the pose counts for beside the moment arm of the contact
GUESS_STEPS = 12  # of Newton towards a guess
GUESS_DISTANCE = 0.3  # of what the pose strays: a guess that is as near will do
MOST_INNER = 3000  # boxes of an inner search, after which the contact is taken to be possible


@inner
def _contact(k, bounds, use, task, question, work):
    """Narrow a box (n, 2) by contact k, which the coordinates `use` concern. False if nothing is left.

    `work` holds the polynomials afterwards.
    """
    for _ in range(BOX_LOOKS):
        center(bounds, use, work.box)
        theta, curve = gaps(k, use, task, question, work)
        tolerance, position = work.polynomials.tolerance[k], task.coordinates.parameter[0] - POSE
        fits, points, others = points_meet(k, use, theta, curve, position, task.chains, work)
        if not fits:
            return False
        fits, directions = directions_meet(tolerance, use, theta, curve, work)
        if not fits or not not_apart(k, use, position, (points, others, directions), task, work):
            return False
        shrunk = cut(bounds, use, work.box)
        if shrunk < 0:
            return False
        if shrunk > REPEAT_SHARE:
            break
    return True


@inner
def _settle(k, bounds, guess, use, sway, task, question, work):
    """A guess where in a box contact k is made, by Newton steps from `guess` (n,), in and out. True: it is.

    The shared ones of the coordinates `use` begin in the middle. Steps are the least in units of the box, and end
    at its sides. sway: how far the pose moves the contact in the box.
    """
    box, gradient, newton = work.box, work.turned.gradient, work.inner.newton
    x, side = box.middle, box.low
    for o in range(use.shape[0]):
        i = use[o]
        middle = 0.5 * (bounds[i, 0] + bounds[i, 1])
        x[i] = middle if o < question.shared else min(max(guess[i], bounds[i, 0]), bounds[i, 1])
        box.half[i] = 0.0
        side[i] = 0.5 * (bounds[i, 1] - bounds[i, 0])
    found = False
    for _ in range(GUESS_STEPS):
        gaps(k, use, task, question, work)
        rows, size = _missing(k, use, task.coordinates.parameter[0] - POSE, work)
        if size <= GUESS_DISTANCE * GUESS_DISTANCE * sway * sway:
            found = True
            break
        least_step(newton, rows, side, use, gradient)
        for i in use:
            step = 0.0
            for a in range(rows):
                step += newton[a, 6] * gradient[a, i]
            to = x[i] - step * side[i] * side[i]
            x[i] = min(max(to, bounds[i, 0]), bounds[i, 1])
            # who has come to an end leaves the next steps to the others
            side[i] = min(10 * side[i], 0.5 * (bounds[i, 1] - bounds[i, 0])) if x[i] == to else 0.1 * side[i]
    for i in use[question.shared :]:
        guess[i] = x[i]
    return found


@inner
def _missing(k, use, position, work):
    """What a contact lacks in the middle of `work.box`, into column 6 of work.inner.newton; its rows and its square."""
    value, tolerance, newton, here = (
        work.polynomials.value[0], work.polynomials.tolerance[k], work.inner.newton, work.turned,
    )  # fmt: skip
    size, rows = 0.0, 3
    for c in range(3):
        newton[c, 6] = value[HAND_POINT, c] - here.point[c] - work.box.middle[position + c]
        size += newton[c, 6] * newton[c, 6]
    if tolerance <= 0:
        rows = 6
        for c in range(3):
            newton[3 + c, 6] = value[HAND_DIRECTION, c] - here.direction[c]
            size += newton[3 + c, 6] * newton[3 + c, 6] * RADIAN * RADIAN
    elif tolerance < np.pi:
        over = cosine_of_directions(use, work) - np.cos(tolerance)
        if over < 0:
            rows = 4
            newton[3, 6] = over
            size += over * over * RADIAN * RADIAN
    return rows, size


@inner
def _longest(bounds, use, quaternion, work):
    """Of `use` the coordinate that moves the contact most, and how far [units]."""
    slope, y, turn = work.polynomials.slope[0], work.turned.point, work.turned.turn
    best, worst = -1, 0.0
    for i in use:
        if quaternion <= i < quaternion + QUATERNION:
            moved = norm(turn[i - quaternion]) * (norm(y) + SPIN)
        elif quaternion - 3 <= i < quaternion:
            moved = 1.0
        else:
            on_hand = norm(slope[HAND_POINT, i]) + RADIAN * norm(slope[HAND_DIRECTION, i])
            on_object = norm(slope[OBJECT_POINT, i]) + RADIAN * norm(slope[OBJECT_DIRECTION, i])
            moved = max(on_hand, on_object)
        moved *= 0.5 * (bounds[i, 1] - bounds[i, 0])
        if moved > worst:
            best, worst = i, moved
    return best, worst


@inner
def _possible(k, bounds, guess, place, use, task, question, work):
    """Can contact k be made in a box of poses, as far as an inner search tells? Narrows the box.

    guess (n,): where its own coordinates could be last time, in and out; place: of the box on the stack, where the
    boxes of its own coordinates that are left stand, in and out. The shared ones of `use` are split by the search of
    the poses. Returns (that, the one of them that moves the contact most, how far, boxes examined).
    """
    own, waiting = use[question.shared :], work.inner.box
    left, many = work.inner.left[place, k], work.inner.many[place]
    quaternion = task.coordinates.parameter[0] - QUATERNION
    if not _contact(k, bounds, use, task, question, work):
        return False, -1, 0.0, 1
    split, sway = _longest(bounds, use[: question.shared], quaternion, work)
    worst, stray = _longest(bounds, own, quaternion, work)
    if stray <= STRAY_SHARE * sway:
        for i in own:
            guess[i] = 0.5 * (bounds[i, 0] + bounds[i, 1])
        return True, split, sway, 1
    if _settle(k, bounds, guess, use, sway, task, question, work):
        return True, split, sway, 2
    nodes, count = 2, _begin(bounds, left, many[k], use, question.shared, waiting)
    while count > 0:
        count -= 1
        nodes += 1
        here = waiting[count]
        if not _contact(k, here, use, task, question, work):
            continue
        worst, stray = _longest(here, own, quaternion, work)
        if stray <= STRAY_SHARE * sway or nodes > MOST_INNER or count + 3 > waiting.shape[0]:
            for i in own:
                guess[i] = 0.5 * (here[i, 0] + here[i, 1])
            if count < left.shape[0]:  # all others hold none: so do they for the halves of this box
                many[k] = count + 1
                for m in range(count + 1):
                    for o in range(own.shape[0]):
                        left[m, o, 0], left[m, o, 1] = waiting[m, own[o], 0], waiting[m, own[o], 1]
            return True, split, sway, nodes
        middle = 0.5 * (here[worst, 0] + here[worst, 1])
        for i in use:
            waiting[count + 1, i, 0], waiting[count + 1, i, 1] = here[i, 0], here[i, 1]
        # the half with the guess first
        upper = 1 if guess[worst] > middle else 0
        waiting[count + upper, worst, 1] = middle
        waiting[count + 1 - upper, worst, 0] = middle
        count += 2
    return False, split, sway, nodes


@inner
def _begin(bounds, left, many, use, shared, waiting):
    """The boxes with which an inner search begins, into `waiting`: those left, cut to `bounds`; their number."""
    count = 0
    for m in range(max(many, 1)):
        for i in use:
            waiting[count, i, 0], waiting[count, i, 1] = bounds[i, 0], bounds[i, 1]
        fits = True
        for o in range(use.shape[0] - shared if many > 0 else 0):
            i = use[shared + o]
            low, high = max(bounds[i, 0], left[m, o, 0]), min(bounds[i, 1], left[m, o, 1])
            waiting[count, i, 0], waiting[count, i, 1] = low, high
            fits = fits and low <= high
        count += fits
    return count


@inner
def _hand_on(place, question, work):
    """What is left of the contacts' own coordinates for a box of poses, to the one behind it."""
    left, many = work.left, work.many
    for k in range(many.shape[1]):
        many[place + 1, k] = many[place, k]
        for m in range(many[place, k]):
            for o in range(question.sizes[k] - question.shared):
                for end in range(2):
                    left[place + 1, k, m, o, end] = left[place, k, m, o, end]


@inner
def _bounded(bounds, pose, coordinates, question, work):
    """Narrow a box by the bounds of the pose. False if nothing is left; pose: the shared coordinates."""
    box, here = work.box, work.turned
    gradient, y, offset = here.gradient, here.point, here.offset
    quaternion = coordinates.parameter[0] - QUATERNION
    center(bounds, pose, box)
    _, curve = turning(box, quaternion, here.rotation, here.turn)
    gradient[:3] = 0.0
    for k in range(4):  # the object's axes, and the way from its middle to its origin
        for c in range(3):
            offset[c] = -question.middle[c] if k == 3 else 1.0 * (c == k)
        rotated(here.rotation, offset, y)
        turn_derivatives(here.turn, y, 1.0, quaternion, gradient)
        for c in range(3):
            error, value = curve * norm(offset) + TAYLOR_ROUNDING, y[c]
            ends = coordinates.axes[3 * k + c] if k < 3 else question.near[c]
            if k == 3:
                value += box.middle[quaternion - 3 + c]
                gradient[c, quaternion - 3 + c] = 1.0
            if not narrow(value, gradient[c], -ends[1] - error, -ends[0] + error, box, pose):
                return False
    return cut(bounds, pose, box) >= 0


@inner
def _examine(box, count, task, question, work):
    """Can every contact be made in a box of poses, number `count` of the stack? Narrows it.

    Begins with the contact that discarded a box near by. Returns (that, coordinate to split, how far it moves a
    contact, boxes examined).
    """
    guess, last = work.inner.guess[count], work.inner.last
    nodes, split, stray = 0, -1, 0.0
    for a in range(task.chains.joints.shape[0]):
        k = last[count] if a == 0 else (a - 1 if a <= last[count] else a)
        use = question.use[k, : question.sizes[k]]
        fits, way, sway, spent = _possible(k, box, guess, count, use, task, question, work)
        nodes += spent
        if not fits:
            if count > 0:  # the next box is a near one
                last[count - 1] = k
            return False, split, stray, nodes
        if sway > stray:
            split, stray = way, sway
    return True, split, stray, nodes


@inner
def explore_poses(
    chains, regions, coordinates, stack, question, box, polynomials, taylor, turned, inner_work, budget, resolution
):
    """Depth first from the first box of a `Stack`, in place, until it is empty or `budget` boxes are spent.

    question: `PoseQuestion`. Boxes of poses in which nothing strays by `resolution` [units] are set aside. Nodes are
    boxes, those of inner searches too.
    """
    task, work = Flat(chains, regions, coordinates), PoseWork(box, polynomials, taylor, turned, inner_work)
    guess, last, n = inner_work.guess, inner_work.last, stack.box.shape[1]
    for k in range(chains.joints.shape[0]):
        polynomials.tolerance[k] = tolerance_of(k, task.regions)
    for i in range(n):
        guess[0, i] = 0.5 * (stack.box[0, i, 0] + stack.box[0, i, 1])
    last[:] = 0
    inner_work.many[0] = 0
    pose = question.use[0, : question.shared]
    count, nodes, small, again = 1, 0, 0, False
    while count > 0 and nodes < budget and count + 2 < stack.share.shape[0] and small < stack.small_share.shape[0]:
        count -= 1
        nodes += 1
        second, again = again, False
        here = stack.box[count]
        if not _bounded(here, pose, task.coordinates, question, work):
            continue
        fits, split, stray, spent = _examine(here, count, task, question, work)
        nodes += spent
        if not fits:
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
        for i in range(n):
            guess[count + 1, i] = guess[count, i]
        last[count + 1] = last[count]
        _hand_on(count, question, inner_work)
        count += 2
    stack.counts[LEFT], stack.counts[SMALL], stack.counts[NODES] = count, small, nodes
    return 0
