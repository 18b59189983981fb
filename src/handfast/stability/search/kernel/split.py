"""Which part of a node is split, and into what, compiled.

Every contact or actuator whose state is open to question has a violation in the node's point: by how much the
model is missed there. The sum of all ranks the node; the one to be split is chosen by energy, so that a small
misfit of a fast contact that carries much counts for more than a large one of a contact that hardly carries.

The state of a node is one row of integers: m contacts, m left sector ends or patches, m right ends, the actuators.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner, larger, length, smaller
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    CLOSED,
    FREE,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN_DIRECTIONS,
    UNDECIDED,
)
from handfast.stability.search.arrays import LARGEST_EFFORT
from handfast.stability.search.rows import FINEST_PATCH, MIN_SECTOR_WIDTH

VIOLATION = 0.1  # of the tolerance of cones: a smaller violation of a complementarity is none
# in place of MIN_SECTOR_WIDTH, in proportion, where the tolerance of cones is finer: but none below this
MIN_FINE_SECTOR = 4.0
# and none below this where nothing is violated, so that Newton's method should have succeeded
COARSE_SECTOR = TURN_DIRECTIONS // 256
CONE_TOLERANCE = 1e-6  # friction may leave its cone by as much in a program: fewer tangents, and no more nodes,
CONE_GAP_SHARE = 1e-3  # or by this share of a smaller gap,
MIN_CONE_TOLERANCE = 2e-9  # but not by less: rows are met to 1e-9
# cosine of an angle; no sector below is parted; no direction of less
PARTING_COSINE, EIGHTH, MIN_SLIDE = 0.5, TURN_DIRECTIONS // 8, 1e-9
DECIDE = 1e9  # added to the energy that an undecided part misses: it is split before any sector
# how much more that energy counts where a contact, or an actuator, is undecided, and the share of its friction in it;
# it counts once where nodes are split by what their children leave
CONTACT_WEIGHT, ACTUATOR_WEIGHT, FRICTION = 20.0, 100.0, 0.1


@inner
def select(question, node, c, d, cone, loose):
    """Where to split, by the point's forces c and motions d: contact i or m + actuator j; -1 if all is decided.

    Of what is violated, the part where the balance of energy misses most: c_n (c_n + d_n) of (4), |c_t| |d_t| +
    c_t . d_t and (mu c_n - |c_t|) |d_t| of (7), t (f - f_c) of (8). That of undecided parts counts more, by
    `CONTACT_WEIGHT` and `ACTUATOR_WEIGHT`; where normals are uncertain they always come first. Where nothing is
    violated, an undecided part or the widest sector. node.violation says whether anything is.

    cone, loose: by how much friction may leave its cone where all is nearly met, and in the point at hand.
    """
    m = question.m
    none = VIOLATION * loose
    narrow = larger(MIN_SECTOR_WIDTH * cone / CONE_TOLERANCE, MIN_FINE_SECTOR)
    first = DECIDE if question.sin > 0.0 else 0.0
    most = -1.0
    pick = -1
    total = 0.0
    spare = 0.0
    fallback = -1
    touches = 1.0 if question.tries else CONTACT_WEIGHT
    turns = 1.0 if question.tries else ACTUATOR_WEIGHT
    for i in range(m + question.a):
        node.missing[i] = -1.0
    for i in range(m):
        state = node.state[i]
        width = node.state[2 * m + i] - node.state[m + i]
        soft = question.soft[i] >= 0
        if state == STICK or (state == SLIDE and (node.state[m + i] >= FINEST_PATCH if soft else width <= narrow)):
            continue
        amount, missing, rank = contact(i, question, node, c, d, loose, narrow)
        total += larger(amount, 0.0)
        if state == UNDECIDED:
            missing = touches * missing + first
        if amount > none:
            node.missing[i] = missing
        if amount > none and missing > most:
            most = missing
            pick = i
        if rank > spare:
            spare = rank
            fallback = i
    for j in range(question.a):
        moves = node.state[3 * m + j]
        if moves not in (FREE, BELOW, ABOVE):
            continue
        k = 3 * m + 2 * j
        t = d[3 * m + j]
        slack = larger(larger(-c[k], -c[k + 1]), 0.0) if question.driven[j] else c[k]  # complementary to t
        amount = smaller(t, slack)
        total += larger(amount, 0.0)
        missing = turns * t * slack + first
        if amount > none:
            node.missing[m + j] = missing
        if amount > none and missing > most:
            most = missing
            pick = m + j
        if spare < 2.5:
            spare = 2.5
            fallback = m + j
    node.violation[0] = total
    node.violation[1] = 1.0 if pick >= 0 else 0.0
    return pick if pick >= 0 else fallback


@inner
def contact(i, question, node, c, d, cone, narrow):
    """By how much contact i misses the model, by how much energy, and its rank where nothing is missed."""
    m = question.m
    state = node.state[i]
    width = node.state[2 * m + i] - node.state[m + i]
    k = 3 * i
    cn = c[k]
    d1 = d[k + 1]
    d2 = d[k + 2]
    soft = question.soft[i]
    c3 = c[question.twist + soft] if soft >= 0 else 0.0
    d3 = d[question.turning + soft] if soft >= 0 else 0.0
    speed = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
    gap = question.cos * d[k] + question.sin * speed
    amount = 0.0
    missing = 0.0
    rank = 0.0
    if state == OPEN:
        if question.sin > 0.0 and (width == 0 or width > narrow):
            amount = -gap
            missing = gap * gap
        return amount, missing, rank
    if state == UNDECIDED:
        amount = larger(smaller(cn, cn + gap), -(cn + gap))
        rank = 3.0
    else:
        amount = abs(cn + gap)
        rank = 2.0 if question.dissipation else 0.0
        if state == SLIDE:
            rank = width / TURN_DIRECTIONS if width > COARSE_SECTOR else 0.0
            if soft >= 0:
                rank = extent(node.state[m + i])
    missing = cn * larger(cn + gap, 0.0) - gap * larger(-cn - gap, 0.0)
    if question.dissipation:
        w = question.mu[i] * cn
        x = c[k + 1] * speed + w * d1
        y = c[k + 2] * speed + w * d2
        z = c3 * speed + w * d3
        size = np.sqrt(c[k + 1] * c[k + 1] + c[k + 2] * c[k + 2] + c3 * c3)
        rubbed = size * speed + c[k + 1] * d1 + c[k + 2] * d2 + c3 * d3 + larger(w - size - cone, 0.0) * speed
        missing += rubbed * (FRICTION if state == UNDECIDED else 1.0)
        if amount < VIOLATION * cone and cn > 1e-9:  # (4) holds: what about (7)?
            amount = np.sqrt(x * x + y * y + z * z) / larger(speed, 1.0) - cone
            if state == UNDECIDED:
                amount *= 0.5
    return amount, missing, rank


@inner
def extent(number):
    """Of a patch, in turns, as the rank of a sector of that width; 0 where it is small."""
    size = 0.25
    while number >= 16:
        number >>= 1
        size *= 0.7071067811865476
    return size if size * TURN_DIRECTIONS > COARSE_SECTOR else 0.0


@inner
def split(question, node, c, d, pick):
    """States and sector ends of the part `pick` in the children into node.children; returns how many they are.

    A command up to the largest is as good where its actuator rests. So an actuator whose command is sought rests on one
    side of 0 to the largest, or its command is between them, and no state is in two children.
    """
    m = question.m
    child = node.children
    for k in range(child.shape[0]):
        for b in range(3):
            child[k, b] = 0
    if pick >= m:
        child[0, 0] = LOCKED
        child[1, 0] = MOVES
        if question.driven[pick - m] and question.objective == LARGEST_EFFORT:
            k = m + 2 * pick  # its force; the next is what is left up to the largest
            moves = node.state[2 * m + pick]
            over = moves == ABOVE or (moves == FREE and c[k + 1] < c[k])
            child[0, 0] = HIGH if over else LOW
            if moves == FREE:
                child[1, 0] = BELOW if over else ABOVE
        return 2
    state = node.state[pick]
    if state == UNDECIDED:
        child[0, 0] = CLOSED
        child[1, 0] = OPEN
        return 2
    if question.soft[pick] >= 0:
        return split_patch(node.state[m + pick], child)
    left = node.state[m + pick]
    width = node.state[2 * m + pick] - left
    along = direction(state, c, d, pick)
    if state == CLOSED and question.sin == 0.0:
        return split_closed(left, width, node, c, d, pick)
    if width == 0:  # stick, or one of three sectors, the middle of one at -d_t
        count = 0
        if state == CLOSED:
            child[0, 0] = STICK
            count = 1
        third = TURN_DIRECTIONS // 3
        for s in range(3):
            begin = (along + third // 2 + s * third) % TURN_DIRECTIONS
            child[count, 0] = SLIDE if state == CLOSED else OPEN
            child[count, 1] = begin
            child[count, 2] = begin + (third if s < 2 else TURN_DIRECTIONS - 2 * third)
            count += 1
        return count
    cut = left + share(along, left, width)
    child[0, 0] = state
    child[0, 1] = left
    child[0, 2] = cut
    child[1, 0] = state
    child[1, 1] = cut
    child[1, 2] = left + width
    return 2


@inner
def split_patch(number, child):
    """The same of a soft finger that is closed, or slides in patch `number`."""
    if number == 0:
        child[0, 0] = STICK
        for k in range(8):
            child[1 + k, 0] = SLIDE
            child[1 + k, 1] = 8 + k
        return 9
    for k in range(2):
        child[k, 0] = SLIDE
        child[k, 1] = 2 * number + k
    return 2


@inner
def split_closed(left, width, node, c, d, pick):
    """The same of a closed contact whose normal is exact.

    Its friction and -d_t lie on the same side of any line through the contact, (7), whether it slides or sticks. So it
    is parted by the line that has them on different sides in the point at hand, into two half turns, and again
    between them, as long as they are far `PARTING_COSINE`; then into stick and slide.
    """
    child = node.children
    k = 3 * pick
    speed = larger(length(d[k + 1], d[k + 2]), 1e-12)
    force = larger(length(c[k + 1], c[k + 2]), 1e-12)
    x = c[k + 1] / force
    y = c[k + 2] / force
    u = -d[k + 1] / speed
    v = -d[k + 2] / speed
    if width == 0:
        begin = (angle(x - u, y - v) - TURN_DIRECTIONS // 4) % TURN_DIRECTIONS
        for s in range(2):
            child[s, 0] = CLOSED
            child[s, 1] = (begin + s * (TURN_DIRECTIONS // 2)) % TURN_DIRECTIONS
            child[s, 2] = child[s, 1] + TURN_DIRECTIONS // 2
        return 2
    right = left + width
    if x * u + y * v < PARTING_COSINE and width > EIGHTH and speed > MIN_SLIDE and force > MIN_SLIDE:
        child[0, 0] = child[1, 0] = CLOSED
        child[0, 1] = left
        child[0, 2] = child[1, 1] = left + share(angle(x + u, y + v), left, width)
        child[1, 2] = right
        return 2
    child[0, 0] = STICK
    child[0, 1] = left
    child[0, 2] = right
    child[1, 0] = child[2, 0] = SLIDE
    child[1, 1] = left
    if width <= TURN_DIRECTIONS // 3:
        child[1, 2] = right
        return 2
    child[1, 2] = child[2, 1] = left + width // 2  # the chord of more says little
    child[2, 2] = right
    return 3


@inner
def angle(x, y):
    """Of a vector in the plane, in grid steps."""
    return int(np.rint(np.arctan2(y, x) * TURN_DIRECTIONS / (2 * np.pi))) % TURN_DIRECTIONS


@inner
def share(along, left, width):
    """Where to cut a sector: at a direction, but not too near to its ends; from its left end."""
    ahead = (along - left) % TURN_DIRECTIONS
    if ahead > (width + TURN_DIRECTIONS) // 2:
        ahead = 0  # behind the sector's start
    step = int(smaller(larger(ahead / width, 0.15), 0.85) * width)
    return step if step > 0 else 1


@inner
def direction(state, c, d, pick):
    """Against the motion of a contact; where it slides or rests, between that and its friction."""
    k = 3 * pick
    speed = larger(length(d[k + 1], d[k + 2]), 1e-12)
    force = larger(length(c[k + 1], c[k + 2]), 1e-12)
    x = -d[k + 1] / speed
    y = -d[k + 2] / speed
    if (state == SLIDE) or (state == CLOSED and speed < 1e-9):
        x += c[k + 1] / force
        y += c[k + 2] / force
    return angle(x, y)
