"""Discard boxes of the object's pose, compiled: given the pose, the fingers decouple.

Coordinates are those of the problem, except that the quaternion has one component 1 and the others in [-1, 1]
(four charts hold all rotations) and that the position is that of a point m of the object, amid its regions,
p + R m: turns then move the contacts little. A box of pose (and of joints that several contacts share) is
discarded if some contact cannot be made in it: an inner branch and prune over that contact's own joints and
region parameters finds no box in which

    C - R (O - m) - (p + R m) = 0,    angle(hand direction, R object direction) <= slack

(a patch on the hand: directions equal) can hold for a pose of the box. C, O, R and the directions are the
Taylor polynomials of `engine.taylor` and `engine.pose`, their remainders bounds over the whole box; `PAD` and
`ROUNDING` cover what rounds. Newton steps only tell sooner where a contact can be made; they discard nothing.
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
from handfast.synthesis.search.kernel.object_pose import Work, apart, gaps, lever, times, turning
from handfast.synthesis.search.kernel.taylor import ROUNDING, WIDER, norm, spread, workspace

FINE = 0.35  # own coordinates are split until they stray by less than this share of what the pose does
DEEP = 400  # boxes on an inner stack
SPIN = 0.15  # units of length that a radian of the pose counts for beside the lever of the contact
STEPS = 12  # of Newton towards a guess
NEAR = 0.05  # of what the pose strays: a guess that is as near will do
INNER = 3000  # boxes of an inner search, after which the contact is taken to be possible


@inner
def contact(k, box, use, flat, bend, m, slack, S):  # type: ignore[no-untyped-def]
    """Narrow a box (n, 2) by contact k, which the coordinates `use` concern. False if nothing is left.

    S: workspace, which holds the polynomials afterwards.
    """
    x, h, low, high, V, D, E, y, z, G = S.x, S.h, S.low, S.high, S.V, S.D, S.E, S.y, S.z, S.G
    at = flat.params[0] - 4
    for _ in range(LOOKS):
        center(box, use, x, h, low, high)
        theta, curve = gaps(k, use, flat, bend, m, S)
        stray = spread(D[2], h, use) + E[2]
        error = (E[0] + E[2] + curve * norm(y) + theta * stray + ROUNDING) * WIDER
        value = 0.0
        for c in range(3):
            gap = V[0, c] - y[c] - x[at - 3 + c]
            value += z[c] * gap
            if not narrow(gap, G[c], -error, error, low, high, use):
                return False
        # along the normal, where the parameters of the region drop out
        for i in use:
            G[6, i] = z[0] * G[0, i] + z[1] * G[1, i] + z[2] * G[2, i]
        if not narrow(value, G[6], -error * WIDER, error * WIDER, low, high, use):
            return False
        turned = spread(D[3], h, use) + E[3]
        error = (E[1] + E[3] + curve + theta * turned + ROUNDING) * WIDER
        if slack[k] <= 0:
            for c in range(3):
                if not narrow(V[1, c] - z[c], G[3 + c], -error, error, low, high, use):
                    return False
        elif slack[k] < np.pi:
            tilt = spread(D[1], h, use) + E[1]
            off, gap = swept(1.0, tilt) + swept(1.0, turned) + theta, angle(V[1], z)
            if gap - off > slack[k] + PAD:
                return False
            if gap + off > slack[k]:
                error = (error + tilt * (turned + theta)) * WIDER
                value = apart(V, z, use, G) - np.cos(slack[k])
                if not narrow(value, G[3], -np.inf, error, low, high, use):
                    return False
        shrunk = taken(box, use, x, h, low, high)
        if shrunk < 0:
            return False
        if shrunk > AGAIN:
            break
    return True


@inner
def settle(k, box, spot, use, hub, sway, flat, bend, m, slack, M, S):  # type: ignore[no-untyped-def]
    """A guess where in a box contact k is made, by Newton steps from `spot` (n,), in and out. True: it is.

    Steps are the least in units of the box, and end at its sides.
    """
    x, h, low, V, y, z, G = S.x, S.h, S.low, S.V, S.y, S.z, S.G
    at = flat.params[0] - 4
    for o in range(use.shape[0]):
        i = use[o]
        x[i] = 0.5 * (box[i, 0] + box[i, 1]) if o < hub else min(max(spot[i], box[i, 0]), box[i, 1])
        h[i] = 0.0
        low[i] = 0.5 * (box[i, 1] - box[i, 0])
    found = False
    for _ in range(STEPS):
        gaps(k, use, flat, bend, m, S)
        size, rows = 0.0, 3
        for c in range(3):
            M[c, 6] = V[0, c] - y[c] - x[at - 3 + c]
            size += M[c, 6] * M[c, 6]
        if slack[k] <= 0:
            rows = 6
            for c in range(3):
                M[3 + c, 6] = V[1, c] - z[c]
                size += M[3 + c, 6] * M[3 + c, 6] * TURN * TURN
        elif slack[k] < np.pi:
            over = apart(V, z, use, G) - np.cos(slack[k])
            if over < 0:
                rows = 4
                M[3, 6] = over
                size += over * over * TURN * TURN
        if size <= NEAR * NEAR * sway * sway:
            found = True
            break
        least(M, rows, low, use, G)
        for i in use:
            step = 0.0
            for a in range(rows):
                step += M[a, 6] * G[a, i]
            to = x[i] - step * low[i] * low[i]
            x[i] = min(max(to, box[i, 0]), box[i, 1])
            # who has come to an end leaves the next steps to the others
            low[i] = min(10 * low[i], 0.5 * (box[i, 1] - box[i, 0])) if x[i] == to else 0.1 * low[i]
    for i in use[hub:]:
        spot[i] = x[i]
    return found


@inner
def least(M, rows, side, use, G):  # type: ignore[no-untyped-def]
    """Solve (G H^2 G') a = r, r in M[:, 6] where a goes; H: `side`."""
    for a in range(rows):
        for b in range(a + 1):
            total = 0.0
            for i in use:
                total += G[a, i] * G[b, i] * side[i] * side[i]
            M[a, b] = M[b, a] = total
    for a in range(rows):
        M[a, a] += 1e-9 * M[a, a] + 1e-15
    for a in range(rows):
        for b in range(a + 1, rows):
            f = M[b, a] / M[a, a]
            for c in range(a, rows):
                M[b, c] -= f * M[a, c]
            M[b, 6] -= f * M[a, 6]
    for back in range(rows):
        a = rows - 1 - back
        for c in range(a + 1, rows):
            M[a, 6] -= M[a, c] * M[c, 6]
        M[a, 6] /= M[a, a]


@inner
def longest(box, use, flat, S):  # type: ignore[no-untyped-def]
    """Of `use` the coordinate that moves the contact most, and how far [units]."""
    D, w, y = S.D, S.w, S.y
    at = flat.params[0] - 4
    best, worst = -1, 0.0
    for i in use:
        if at <= i < at + 4:
            moved = norm(w[i - at]) * (norm(y) + SPIN)
        elif at - 3 <= i < at:
            moved = 1.0
        else:
            moved = max(norm(D[0, i]) + TURN * norm(D[1, i]), norm(D[2, i]) + TURN * norm(D[3, i]))
        moved *= 0.5 * (box[i, 1] - box[i, 0])
        if moved > worst:
            best, worst = i, moved
    return best, worst


@inner
def possible(k, box, spot, use, hub, flat, bend, m, slack, stack, M, S):  # type: ignore[no-untyped-def]
    """Can contact k be made in a box of poses, as far as an inner search tells? Narrows the box.

    spot (n,): where its own coordinates could be last time, in and out. stack (., n, 2), M (6, 7): work.
    Returns (that, coordinate of the hub that moves the contact most, how far, boxes examined).
    """
    own = use[hub:]
    count, nodes = 0, 0
    split, sway, here = -1, 0.0, box
    while True:
        nodes += 1
        if contact(k, here, use, flat, bend, m, slack, S):
            if nodes == 1:
                split, sway = longest(box, use[:hub], flat, S)
            worst, stray = longest(here, own, flat, S)
            if stray <= FINE * sway or nodes > INNER or count + 2 > stack.shape[0]:
                for i in own:
                    spot[i] = 0.5 * (here[i, 0] + here[i, 1])
                return True, split, sway, nodes
            if nodes == 1:
                if settle(k, box, spot, use, hub, sway, flat, bend, m, slack, M, S):
                    return True, split, sway, 2
                for i in use:
                    stack[0, i, 0], stack[0, i, 1] = box[i, 0], box[i, 1]
                here = stack[0]
            middle = 0.5 * (here[worst, 0] + here[worst, 1])
            for i in use:
                stack[count + 1, i, 0], stack[count + 1, i, 1] = here[i, 0], here[i, 1]
            # the half with the guess first
            upper = 1 if spot[worst] > middle else 0
            stack[count + upper, worst, 1] = middle
            stack[count + 1 - upper, worst, 0] = middle
            count += 2
        if count == 0:
            return False, split, sway, nodes
        count -= 1
        here = stack[count]


@inner
def bounded(box, pose, flat, m, near, S):  # type: ignore[no-untyped-def]
    """Narrow a box by the bounds of the pose; near (3, 2): of the origin's position. False if nothing is left."""
    x, h, low, high, R, w, y, t, G = S.x, S.h, S.low, S.high, S.R, S.w, S.y, S.t, S.G
    at = flat.params[0] - 4
    center(box, pose, x, h, low, high)
    _, curve = turning(x, h, at, R, w)
    G[:3] = 0.0
    for k in range(4):  # the object's axes, and the way from m to its origin
        for c in range(3):
            t[c] = -m[c] if k == 3 else 1.0 * (c == k)
        times(R, t, y)
        lever(w, y, 1.0, at, G)
        for c in range(3):
            error, value = curve * norm(t) + ROUNDING, y[c]
            least, most = flat.axes[3 * k + c] if k < 3 else near[c]
            if k == 3:
                value += x[at - 3 + c]
                G[c, at - 3 + c] = 1.0
            if not narrow(value, G[c], -most - error, -least + error, low, high, pose):
                return False
    return taken(box, pose, x, h, low, high) >= 0


@kernel
def explore(stack, share, count, flat, use, sizes, hub, bend, m, near, budget, resolution, kept, kept_share):  # type: ignore[no-untyped-def]
    """Depth first from `count` boxes in stack (., n, 2), in place, until it is empty or `budget` boxes are spent.

    use (b, .): coordinates that concern each contact, sizes (b,) of them; the first `hub` are the pose and the
    shared joints. m (3,): the point of the object; near (3, 2): bounds of its origin's position. Boxes of
    poses in which nothing strays by `resolution` [units] go to `kept` (., n, 2).
    Returns (boxes on the stack, kept, boxes examined, those of inner searches too).
    """
    n, b = stack.shape[1], flat.steps.shape[0]
    slack = np.zeros(b)
    for k in range(b):
        slack[k] = cone_of(k, flat)
    S = Work(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((4, 3)), np.zeros((4, n, 3)), np.zeros(4),
        workspace(flat), np.zeros((3, 3)), np.zeros((4, 3)), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((7, n)),
    )  # fmt: skip
    work, M = np.empty((DEEP, n, 2)), np.empty((6, 7))
    spots, last = np.empty((stack.shape[0], n)), np.zeros(stack.shape[0], dtype=np.intp)
    for i in range(count):
        for j in range(n):
            spots[i, j] = 0.5 * (stack[i, j, 0] + stack[i, j, 1])
    pose = use[0, :hub]
    nodes, found = 0, 0
    while count > 0 and nodes < budget and count + 2 < stack.shape[0] and found < kept.shape[0]:
        count -= 1
        nodes += 1
        box = stack[count]
        if not bounded(box, pose, flat, m, near, S):
            continue
        split, stray = -1, 0.0
        ok = True
        for a in range(b):
            k = last[count] if a == 0 else (a - 1 if a <= last[count] else a)
            ok, way, sway, spent = possible(
                k, box, spots[count], use[k, : sizes[k]], hub, flat, bend, m, slack, work, M, S
            )
            nodes += spent
            if not ok:
                if count > 0:  # the next box is a near one
                    last[count - 1] = k
                break
            if sway > stray:
                split, stray = way, sway
        if not ok:
            continue
        if stray < resolution:
            copy(box, kept[found])
            kept_share[found] = share[count]
            found += 1
            continue
        halve(stack, share, count, split)
        for i in range(n):
            spots[count + 1, i] = spots[count, i]
        last[count + 1] = last[count]
        count += 2
    return count, found, nodes
