"""Cases of a certificate: the splits of its tree leave out none, and the patches that soft fingers slide in.

Patches of the sphere of directions (t1, t2, twist) in which a soft finger slides, as certificates name them.

Patches 8 to 15 are the octants: bit 0 of the number is set where t1 < 0, bit 1 for t2, bit 2 for twist. Patch k is
halved into 2k, on the side of its second corner, and 2k + 1, on that of the third, by the plane through its first
corner and the middle of its other two; the new middle is the first corner of both. Each is what its parent is on one
side of a plane, so that all directions of a patch, however planes are rounded, are in one of its halves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from handfast.proofs.fields import Array, Integers, Mask
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
    ActuatorState,
    ContactState,
)
from handfast.proofs.question import Question

HALF_TURN = TURN_DIRECTIONS // 2  # a sector is narrower than this
STATES = max(len(ContactState), len(ActuatorState))
DECIDED = "it is decided already, or cannot move"
MIN_PATCH, MAX_PATCH = 8, 2**31 - 1  # numbers of patches
OCTANTS = range(8, 16)


@dataclass(frozen=True, eq=False)
class SlidingPatch:
    """A spherical triangle.

    Attributes:
        corners: (3, 3) unit rows.
        planes: (3, 3) unit rows n, n . x >= 0 for all directions x of it; each across from the corner in its place.
    """

    corners: Array
    planes: Array

    @cached_property
    def middle(self) -> Array:
        """(3,) the unit vector that is as far from all corners, but for rounding."""
        first, second, third = self.corners
        normal = np.cross(second - first, third - first)
        return np.asarray(normal * np.sign(normal @ first) / np.linalg.norm(normal))

    @cached_property
    def reach(self) -> float:
        """The least of middle . x over its directions x: at a corner, since caps are convex."""
        return float((self.corners @ self.middle).min())


@lru_cache(maxsize=1 << 16)
def patch(number: int) -> SlidingPatch:
    """The patch with a number from `MIN_PATCH` to `MAX_PATCH`; others raise `ValueError`."""
    if not MIN_PATCH <= number <= MAX_PATCH:
        raise ValueError(f"{number} is no patch")
    if number in OCTANTS:
        signs = [-1.0 if number >> k & 1 else 1.0 for k in range(3)]
        corners = np.diag(signs)[[2, 0, 1]]
        return SlidingPatch(corners, corners)
    whole = patch(number // 2)
    first, *others = whole.corners
    middle = others[0] + others[1]
    middle /= np.linalg.norm(middle)
    plane = np.cross(first, middle)
    plane /= np.linalg.norm(plane)
    if plane @ others[0] < 0:
        plane = -plane
    if number % 2:
        return SlidingPatch(np.array([middle, first, others[1]]), np.array([whole.planes[1], whole.planes[0], -plane]))
    return SlidingPatch(np.array([middle, first, others[0]]), np.array([whole.planes[2], whole.planes[0], plane]))


def contains(outer: Integers, inner: Integers) -> Mask:
    """(n,) is each patch `outer` one of which `inner` was made, or itself? False for what is no patch."""
    some = (outer >= MIN_PATCH) & (outer <= MAX_PATCH) & (inner >= outer) & (inner <= MAX_PATCH)
    depth = np.floor(np.log2(np.where(some, inner, 1))) - np.floor(np.log2(np.where(some, outer, 1)))
    return np.asarray(some & (inner >> depth.astype(np.int64) == outer))


# --- splits ----------------------------------------------------------------------------------------


class BadCertificate(Exception):
    """Why a certificate proves nothing."""


def leaf_cases(q: Question, parent: Integers, part: Integers, change: Integers) -> Integers:
    """(L, m+a, 3) state, left and right of every part in every leaf, the nodes that are not split in their order.

    Args:
        q: the question.
        parent, part: (N,) of nodes: their parents, smaller numbers; which part is changed: contacts, then actuators.
        change: (N, 3) its state, left and right.

    Raises:
        BadCertificate: the tree has a gap: the node, and what is wrong.
    """
    nodes, parts = np.arange(len(parent)), q.grasp.m + q.actuators
    stray = np.where(nodes == 0, parent != -1, (parent < 0) | (parent >= nodes))
    _refuse(stray, lambda k: f"node {k} has parent {parent[k]}; the root has -1, the others an earlier node")
    strange = (nodes > 0) & ((part < 0) | (part >= parts))
    _refuse(strange, lambda k: f"node {k} changes part {part[k]}; there are {parts}")
    cases = _cases(parent, part, change, parts)
    first = np.full(len(parent), -1)  # of the children of each node
    first[parent[:0:-1]] = nodes[:0:-1]
    mixed = np.zeros(len(parent), dtype=bool)
    mixed[1:] = part[1:] != part[first[parent[1:]]]
    _refuse(mixed, lambda k: f"node {parent[k]} is split in several parts at once")
    is_split = first >= 0
    if is_split.any():
        _check_splits(q, parent, np.where(is_split, part[first], 0), change, cases)
    return cases[~is_split]


def _cases(parent: Integers, part: Integers, change: Integers, parts: int) -> Integers:
    """(N, parts, 3) of all nodes: the root is UNDECIDED and FREE everywhere."""
    last = np.where(part[:, None] == np.arange(parts), np.arange(len(parent))[:, None], 0)  # node that changed a part
    last[0], above = 0, np.maximum(parent, 0)
    while above.any():
        last = np.where(last > 0, last, last[above])
        above = above[above]
    return np.where((last > 0)[:, :, None], change[last], 0)


def _refuse(bad: Mask, why: Callable[[int], str]) -> None:
    if bad.any():
        raise BadCertificate(why(int(np.flatnonzero(bad)[0])))


def _check_splits(q: Question, parent: Integers, split: Integers, change: Integers, cases: Integers) -> None:
    """`BadCertificate` for the first node whose children do not cover its case; split: (N,) the part that is split.

    The same faults in the same order as for one node: what may be split at all, which states its children have, and
    that their sectors join without a gap.
    """
    m, nodes = q.grasp.m, np.arange(len(parent))
    state, left, right = cases[nodes, split].T
    of = parent[1:]
    new, a, b = change[1:].T
    plain = (a == 0) & (b == 0)

    def count(which: Mask) -> Integers:
        """(N,) how many of a node's children are so."""
        return np.bincount(of[which], minlength=len(parent))

    named = np.where((new >= 0) & (new < STATES), new, STATES)
    tally = np.bincount((STATES + 1) * of + named, minlength=(STATES + 1) * len(parent)).reshape(-1, STATES + 1)
    children, bare = tally.sum(axis=1), count(plain)
    is_split, of_actuator = children > 0, split >= m
    soft = ~of_actuator & (np.append(q.soft_fingers >= 0, False)[np.where(of_actuator, m, split)])
    may_move = np.append(q.may_move, False)[np.where(of_actuator, split - m, q.actuators)]
    two = (children == 2) & (bare == 2)
    weighed = (
        of_actuator & (np.append(q.is_driven, False)[np.where(of_actuator, split - m, q.actuators)]) & (not q.sums)
    )

    def both(one: int, other: int) -> Mask:
        return two & (tally[:, one] == 1) & (tally[:, other] == 1)

    undecided = ~of_actuator & (state == UNDECIDED)
    later = ~of_actuator & ~undecided
    decided = later & ((state == STICK) | ((state == OPEN) & (q.eta == 0)) | (not q.mdp))
    sliding, closing = later & ~decided & soft, later & ~decided & ~soft

    def refuse(bad: Mask, why: str) -> None:
        if (bad & is_split).any():
            k = int(np.flatnonzero(bad & is_split)[0])
            what = f"actuator {split[k] - m}" if of_actuator[k] else f"contact {split[k]}"
            raise BadCertificate(f"node {k}, split of {what}: {why}")

    # where the largest command is sought: a command beyond it, or below 0, is none, and the actuator is locked
    lower, upper = weighed & (state == BELOW), weighed & (state == ABOVE)
    parted = weighed & (state == FREE) & (both(HIGH, BELOW) | both(LOW, ABOVE))
    refuse(of_actuator & ~((state == FREE) | lower | upper) | (of_actuator & ~may_move), DECIDED)
    refuse(lower & ~both(LOW, MOVES), "needs LOW and MOVES")
    refuse(upper & ~both(HIGH, MOVES), "needs HIGH and MOVES")
    refuse(of_actuator & (state == FREE) & ~parted & ~both(LOCKED, MOVES), "needs LOCKED and MOVES")
    refuse(undecided & ~both(OPEN, CLOSED), "needs OPEN and CLOSED")
    refuse(decided, "it is decided already")

    # a soft finger sticks or slides in one of eight octants, a patch is halved
    if sliding.any():
        whole, half = sliding & (state == CLOSED), sliding & (state == SLIDE)
        base = np.where(whole, OCTANTS[0], 2 * left)
        place = a - base[of]
        patches = (new == SLIDE) & (b == 0) & (place >= 0) & (place < np.where(whole, len(OCTANTS), 2)[of])
        distinct = np.zeros(len(parent), dtype=np.int64)
        np.bitwise_or.at(distinct, of[patches], 1 << place[patches])
        stuck = (new == STICK) & plain
        octants = (children == 9) & (distinct == 255) & (count(stuck) == 1)
        halves = (children == 2) & (distinct == 3) & (2 * left + 1 <= MAX_PATCH)
        refuse(whole & ~octants, f"needs STICK and the patches {OCTANTS[0]} to {OCTANTS[-1]}")
        refuse(sliding & ~whole & ~(half & halves), "needs the two halves of its patch")

    # sectors: of an open contact, of one that slides, of one that is closed: by (7) friction and -d_t are then on one
    # side of any line; or it sticks, in all of its sector, or slides
    all_closed = closing & (state == CLOSED) & (tally[:, CLOSED] == children)
    sticks = closing & (state == CLOSED) & ~all_closed
    kind = np.select([all_closed, closing & (state == OPEN)], [int(CLOSED), int(OPEN)], int(SLIDE))
    is_stuck = (new == STICK) & sticks[of]
    entire = plain | ((a == left[of]) & (b == right[of]))
    refuse(sticks & ~((count(is_stuck) == 1) & (count(is_stuck & entire) == 1)), "needs STICK and sectors")
    sector = closing[of] & ~is_stuck
    widest = np.where(all_closed, HALF_TURN, HALF_TURN - 1)[of]
    good = (new == kind[of]) & (a < b) & (b <= a + widest)
    refuse(count(sector & ~good) > 0, "a child is no sector, or not of the right state")
    refuse(closing & (count(sector) == 0), "needs sectors")
    chosen = np.flatnonzero(sector)
    chosen = chosen[np.lexsort((a[chosen], of[chosen]))]
    starts = np.flatnonzero(np.diff(of[chosen], prepend=-1))
    joined = (a[chosen][1:] == b[chosen][:-1]) | (of[chosen][1:] != of[chosen][:-1])
    refuse(np.bincount(of[chosen][1:][~joined], minlength=len(parent)) > 0, "the sectors leave a gap, or overlap")
    low, high = left.copy(), right.copy()
    if len(chosen):
        low[of[chosen][starts]] = a[chosen][starts]
        high[of[chosen][starts]] = b[chosen][np.append(starts[1:], len(chosen)) - 1]
    turn = np.where(left == right, high - low == TURN_DIRECTIONS, (low == left) & (high == right))
    refuse(closing & ~turn, "the sectors are not those of the node, or a full turn")
