"""Fingers, palm, wrist and closing senses of any hand, from its links and how they move: heuristics.

A fingertip is the last part with a solid at the end of a chain of joints. Joints that move every fingertip are the
wrist's, or an arm's: they move the hand as a whole and close nothing. A finger begins at the first joint that not all
fingertips share, and the palm is the last link that all fingers hang on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import coupled, drivers
from handfast.model.hand.hand import Hand

JOINT_LOOKS = 9  # values of a joint, from limit to limit, at which the fingertips are looked at
AGAINST = 0.3  # of the way that a tip goes, by how much it has to come nearer for a sense against the limits' hint
CLOSES = 0.1  # .. for a sense of which the limits say nothing, if the joint moves further than spreads do ..
SURELY = 0.8  # .. and if it does not
MAX_SPREAD_RANGE = np.radians(140)  # range of a joint that is no spread or abduction
FLEXION = np.radians(90)  # .. or of one that turns about the same direction as one further out that closes
PARALLEL = 0.95  # least cosine of two such directions
HYPEREXTENDED = np.radians(30)  # an open finger is bent back by at most this from the hand's rest
LOPSIDED = 1.5  # times as far as it closes, from rest: a joint that goes further back than that is not straight at rest
MIDWAY = 0.5  # of the closing ranges, where the other joints are while one is looked at
ANATOMY_ROUNDS = 3
MIN_FINGER_MOTION = 1e-6  # [m, rad] a fingertip, or a joint, that moves less stays where it is
CLOSING_INCREMENT = 0.05  # of the closing ranges
REVOLUTION = np.pi  # [rad] what a joint without limits is looked at within, each way


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Which parts of a hand are what.

    Attributes:
        hand: the hand.
        tips: links at the fingers' ends, by index; () if no solid is moved by a joint.
        wrist: joints that move every fingertip, base first; () with a single fingertip.
        palm: links with solids that move as one with the last link that all fingers hang on; where that has none,
            of the nearest link towards the base that has some; () if there are none.
    """

    hand: Hand
    tips: tuple[int, ...]
    wrist: tuple[int, ...]
    palm: tuple[int, ...]

    @classmethod
    def of(cls, hand: Hand) -> Anatomy:
        """From links and joints alone."""
        group = rigid_groups(hand)
        solid = [i for i, link in enumerate(hand.links) if link.shapes]
        inner = {group[k] for i in solid for k in above(hand, i) if group[k] != group[i]}
        below = {k for i in solid for k in above(hand, i)}
        ends = [i for i in solid if group[i] not in inner and i not in below and hand.moved_by(i)]
        tips = list({group[i]: i for i in ends}.values())  # of several ends that move as one the last
        chains = [hand.moved_by(i) for i in tips]
        wrist = tuple(j for j in chains[0] if all(j in c for c in chains)) if len(tips) > 1 else ()
        found = cls(hand, tuple(tips), wrist, _palm(hand, group, tips, wrist))
        return replace(found, tips=found._outermost()) if hand.loops else found

    def _outermost(self) -> tuple[int, ...]:
        """Of the fingertips that a loop ties together, as a jaw and the rod that guides it, the one farthest out."""
        at = self.middles(self.neutral, self.tips)
        palm = self.middles(self.neutral, self.palm).mean(axis=0) if self.palm else np.zeros(3)
        out = dict(zip(self.tips, np.linalg.norm(at - palm, axis=1).tolist(), strict=True))
        fingers: dict[int, list[int]] = {}
        for i in self.tips:
            fingers.setdefault(self.finger(i), []).append(i)
        tied = {self.finger(k) for loop in self.hand.loops for k in (loop.first, loop.second)}
        best = {f: max(some, key=out.__getitem__) for f, some in fingers.items()}
        return tuple(i for i in self.tips if self.finger(i) not in tied or best[self.finger(i)] == i)

    def finger(self, link: int) -> int:
        """The first joint of the finger that a link belongs to; -1 for the palm and what is below it.

        Chains that a loop ties together are one finger.
        """
        return self._fingers[link]

    @cached_property
    def _fingers(self) -> list[int]:
        chains = map(self.hand.moved_by, range(len(self.hand.links)))
        first = [next((j for j in chain if j not in self.wrist), -1) for chain in chains]
        for loop in self.hand.loops:  # what a pin holds together is one finger
            ends = {first[loop.first], first[loop.second]} - {-1}
            first = [min(ends) if f in ends else f for f in first]
        return first

    @cached_property
    def neutral(self) -> Array:
        """(l,) the hand at rest: every joint at 0 or at the limit next to it, couplings kept as far as limits go."""
        return self.within(np.clip(0.0, *self.hand.limits.T))

    def ends(self, closing: Array) -> tuple[Array, Array]:
        """(l,) and (l,) the open and the closed hand for closing senses (l,), couplings kept as far as limits go.

        Open is a joint at the limit that it closes from, but bent back by no more than 30 degrees from the hand's
        rest if that is within its range, unless it goes back much further than it closes: then it is not straight at
        rest. Joints that do not close are at rest, or in the middle of a range that
        begins there, as a spread has it; those of a loop that no motor moves are at rest, where springs hold them.
        """
        lower, upper = self.hand.limits.T
        inside = (lower < self.neutral) & (self.neutral < upper)
        fixed = np.isin(np.arange(self.hand.l), [*self.wrist, *self.hand.idle])
        still = np.where(inside | fixed, self.neutral, (lower + upper) / 2)
        turns = np.array([joint.type == "revolute" for joint in self.hand.joints], dtype=bool)
        behind = np.where(closing > 0, self.neutral - lower, upper - self.neutral)
        ahead = np.where(closing > 0, upper - self.neutral, self.neutral - lower)
        straight = behind <= LOPSIDED * ahead
        back = np.where(inside & turns & straight, HYPEREXTENDED, np.inf)
        near, far = np.maximum(lower, self.neutral - back), np.minimum(upper, self.neutral + back)
        opened = np.where(closing > 0, near, np.where(closing < 0, far, still))
        closed = np.where(closing > 0, upper, np.where(closing < 0, lower, still))
        return self.within(opened), self.within(closed)

    def within(self, q: Array) -> Array:
        """q (..., l) with the coupled joints where their drivers put them, within the limits."""
        return np.clip(coupled(self.hand, q), *self.hand.limits.T)

    def middles(self, q: Array, links: tuple[int, ...]) -> Array:
        """(k, ..., 3) [m] middles of some links' solids at q (..., l), base frame."""
        poses = self.hand.link_poses(q)
        centers = [np.mean([s.centroid for s in self.hand.links[i].shapes], axis=0) for i in links]
        return np.array([poses[i][..., :3, :3] @ c + poses[i][..., :3, 3] for i, c in zip(links, centers, strict=True)])


def with_guessed_senses(hand: Hand) -> Hand:
    """The hand with `closing` as its geometry suggests, where that says more than the limits do.

    A joint closes in the sense that brings the fingertips which it moves nearer to the others and to the palm, the
    other joints half closed. Where they come no nearer for the way they go, as with a spread, it does not close, nor
    does the wrist. Joints of one finger about parallel axes bend it, and close together: where the limits of one say
    nothing and its range is wide, those further out give the hint. Joints that move no fingertip keep what the limits
    suggest, and so does a hand without solids.
    """
    anatomy = Anatomy.of(hand)
    if not anatomy.tips:
        return hand
    follows = drivers(hand)
    limits = np.where([j in anatomy.wrist for j in range(hand.l)], 0.0, hand.closing)
    closing = limits.copy()
    free = [j for j in range(hand.l) if follows[j][0] == j and j not in {*anatomy.wrist, *hand.dependent}]
    free = [j for j in free if hand.joints[j].lower < hand.joints[j].upper]
    for _ in range(ANATOMY_ROUNDS):
        before = closing.copy()
        for j in free:
            closing[j] = _sense(anatomy, closing, j, limits[j] or _bends(anatomy, closing, j))
        for j, (driver, ratio, _) in follows.items():
            if driver != j:
                closing[j] = np.sign(ratio) * closing[driver] if driver >= 0 else 0.0
        closing[list(hand.dependent)] = np.sign(_with_loops(anatomy, closing))[list(hand.dependent)]
        if (closing == before).all():
            break
    return replace(hand, closing=closing)


def _with_loops(anatomy: Anatomy, closing: Array) -> Array:
    """(l,) how joints move when the hand, half closed, closes a little more: those that follow from loops with it."""
    opened, closed = anatomy.ends(np.where(np.isin(np.arange(len(closing)), anatomy.hand.dependent), 0.0, closing))
    less, more = (anatomy.within(opened + share * (closed - opened)) for share in (MIDWAY, MIDWAY + CLOSING_INCREMENT))
    moved = more - less
    return np.asarray(np.where(np.abs(moved) > MIN_FINGER_MOTION, moved, 0.0))


def _sense(anatomy: Anatomy, closing: Array, j: int, hint: float) -> float:
    """-1, 0 or 1 for a joint that drives, the others as they close now; `hint`: what the limits suggest."""
    joint, gain = anatomy.hand.joints[j], approach_gain(anatomy, closing, j)
    if hint:
        return -hint if gain * hint < -AGAINST else hint
    wide = joint.type == "prismatic" or joint.upper - joint.lower > MAX_SPREAD_RANGE
    return float(np.sign(gain)) if abs(gain) > (CLOSES if wide else SURELY) else 0.0


def _bends(anatomy: Anatomy, closing: Array, j: int) -> float:
    """-1 or 1 if a joint bends a finger together with one further out that closes so, about a parallel axis; else 0."""
    hand = anatomy.hand
    joint = hand.joints[j]
    if joint.type == "prismatic" or joint.upper - joint.lower <= FLEXION:
        return 0.0
    axes, _ = hand.joint_axes(anatomy.neutral)
    for chain in (c for c in map(hand.moved_by, anatomy.tips) if j in c):
        for k in chain[chain.index(j) + 1 :]:
            along = float(axes[j] @ axes[k])
            if closing[k] and hand.joints[k].type == "revolute" and abs(along) > PARALLEL:
                return float(np.sign(along) * closing[k])
    return 0.0


def approach_gain(anatomy: Anatomy, closing: Array, j: int) -> float:
    """By how much fingertips come nearer to the others and to the palm as a joint grows, over the way they go.

    0 for a joint that moves no fingertip.
    """
    hand = anatomy.hand
    opened, closed = anatomy.ends(closing)
    q = np.tile(opened + MIDWAY * (closed - opened), (JOINT_LOOKS, 1))
    first, last = np.clip(hand.limits[j], -REVOLUTION, REVOLUTION).tolist()
    q[:, j] = np.linspace(first, last, JOINT_LOOKS)
    q = anatomy.within(q)
    at = anatomy.middles(q, anatomy.tips)  # (tips, looks, 3)
    palm = anatomy.middles(q, anatomy.palm).mean(axis=0) if anatomy.palm else None
    fingers = [anatomy.finger(t) for t in anatomy.tips]
    gain = way = 0.0
    for k in range(len(anatomy.tips)):
        others = [i for i, f in enumerate(fingers) if f != fingers[k]]
        parts = [np.linalg.norm(at[k] - at[others], axis=2).mean(axis=0)] if others else []
        parts += [np.linalg.norm(at[k] - palm, axis=1)] if palm is not None else []
        apart = np.mean(parts, axis=0) if parts else np.zeros(JOINT_LOOKS)
        moved = float(np.linalg.norm(np.diff(at[k], axis=0), axis=1).sum())
        if moved > MIN_FINGER_MOTION:
            gain, way = gain + float(apart[0] - apart[-1]), way + moved
    return gain / way if way else 0.0


def _palm(hand: Hand, group: list[int], tips: list[int], wrist: tuple[int, ...]) -> tuple[int, ...]:
    """Links with solids that make the palm, by index."""
    if not tips:
        return ()
    common = [k for k in (tips[0], *above(hand, tips[0])) if all(k in (t, *above(hand, t)) for t in tips)]
    if len(tips) == 1:  # what its first joint turns on
        common = [k for k in common if not hand.moved_by(k)]
    for k in common:
        solid = tuple(i for i, link in enumerate(hand.links) if link.shapes and group[i] == group[k])
        if solid:
            return solid
    return ()


def rigid_groups(hand: Hand) -> list[int]:
    """For each link the first of those that move as one with it."""
    group: list[int] = []
    for i, link in enumerate(hand.links):
        group.append(i if link.joints or link.parent < 0 else group[link.parent])
    return group


def above(hand: Hand, link: int) -> list[int]:
    """Links between a link and the base, the nearest first."""
    out = []
    while hand.links[link].parent >= 0:
        link = hand.links[link].parent
        out.append(link)
    return out
