"""Close a hand on an object the way a gripper does: until every finger touches or reaches a limit.

Where one motor pulls at several joints of a finger, the inner ones wait at their stops until the outer ones stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, kinds_checked
from handfast.core.presented import Presented
from handfast.geometry.contacts import THRESHOLD, find_contacts
from handfast.geometry.scene import Indices, PoseLike, Scene, checked_joints, checked_pose
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.hand.hand import Hand
from handfast.proofs.motors import STOP_ANGLE, STOP_TRAVEL

TOUCH_GAP = 2e-5  # [m] a link nearer than this touches; bisection stops between 0 and this
OVERLAP = 1e-4  # [m] a start deeper than this is refused
SLIDE_SPEED = 0.1  # [m/s] of a prismatic joint while revolute ones turn 1 rad/s
MIN_CLOSING_STEP = 2e-3  # [s] smallest step between looks; the distances say how much larger it may be
MAX_CLOSING_STEP = 0.1  # [s] the largest while loops change how joints follow
STUCK = 1e-9  # [rad, m] by which a joint that drives a loop is behind where its linkage ends
CLOSING_CUTOFF = 0.03  # [m] beyond this, distances are not computed
CLOSING_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Closed(Presented):
    """Where a hand came to rest.

    Attributes:
        q: (l,) configuration [rad, m].
        contacts: with the object, object frame, as `find_contacts` gives them.
        stopped: for each joint that was closing, why it stopped: "<link> touches" the object, "<link>
            meets <link>" of the hand, "limit", "follows <joint>" to which it is coupled, or "loop": its linkage
            lets it go no further.
        touching: names of the links that touch the object, in the order in which they arrived.
    """

    q: Array
    contacts: tuple[Contact, ...]
    stopped: dict[str, str]
    touching: tuple[str, ...]

    @property
    def penetration(self) -> float:
        """Largest penetration [m]; 0 if there is none."""
        return max([0.0] + [c.depth for c in self.contacts])


@kinds_checked
def close(
    hand: Hand,
    q0: Array | Mapping[str, float],
    body: Body,
    object_pose: PoseLike,
    closing: Mapping[str, int] | None = None,
    *,
    threshold: float = THRESHOLD,
    breakaway: bool | None = None,
    scene: Scene | None = None,
) -> Closed:
    """Close the hand from q0 on an object that does not move.

    Every closing joint advances, revolute ones at 1 rad/s and prismatic ones at 0.1 m/s. When a link
    touches the object, the joints between it and the base stop; those further out go on. A mimic joint
    moves at its ratio with its driver. If the driver is stopped by a contact of a link between the two,
    the mimic joint goes on alone if `breakaway`, and stops if not. Fingers that meet each other or the
    palm stop too; links that are neighbours or that overlap at the start are allowed to. Joints that follow
    from loops go where the others take them, and stop these where they are stopped themselves. Where one motor
    pulls at several joints of a finger, those that start at the stop to which they open wait there until the joints
    further out are stopped (`handfast.planning.closing`). Deterministic:
    links end between 0 and 0.02 mm from what they touch, up to what the start already had.

    Args:
        q0: (l,) start, or values by joint name; the others follow `Hand.configuration`.
        object_pose: of the object in the hand's base frame: (4, 4), or position (3,) [m] and quaternion (w, x, y, z).
        closing: senses of named joints (-1, 0, 1), in place of `hand.closing`.
        threshold: [m] for the contacts that are returned.
        breakaway: in place of `hand.breakaway`.
        scene: a `Scene` of the same hand and object, to save compiling one.

    Raises:
        InputError: a start deeper than 0.1 mm in the object (the link and the depth are named), no joint
            that closes, a pose that is not rigid.
    """
    hand = hand.with_closing(closing) if closing else hand
    pose = checked_pose(object_pose)
    q0 = checked_joints(hand, q0, "q0")
    scene = scene or Scene(hand, body)
    links, between = scene.clearances(q0, pose, CLOSING_CUTOFF)
    worst = int(links.argmin())
    if links[worst] < -OVERLAP:
        raise InputError(
            f"the hand starts {-links[worst] * 1e3:.3g} mm inside the object at {hand.links[worst].name}; "
            "open it or move the object",
            field="q0",
        )
    motion = _Motion(hand, q0, (links, between), hand.breakaway if breakaway is None else breakaway)
    watched = np.flatnonzero(between > TOUCH_GAP)  # those that meet already are allowed to
    motion.arrive(links, between, scene.self_pairs, watched)
    while motion.rate.any():
        motion.advance(scene, pose, watched)
    contacts = find_contacts(hand, motion.q, body, pose, threshold, scene=scene)
    return Closed(motion.q, contacts, motion.stopped, tuple(motion.touching))


class _Motion:
    """The state of a closing hand: q, the distances seen there, the joint rates now, and what has stopped."""

    def __init__(self, hand: Hand, q: Array, seen: tuple[Array, Array], breakaway: bool) -> None:
        self.hand, self.q, self.seen, self.breakaway = hand, np.array(q, dtype=float), seen, breakaway
        self.chains = [hand.moved_by(i) for i in range(len(hand.links))]
        self.moved = np.array([[j in chain for j in range(hand.l)] for chain in self.chains])  # (n_links, l)
        self.speed = np.array([SLIDE_SPEED if j.type == "prismatic" else 1.0 for j in hand.joints])
        self.couplings = {c.joint: c for c in hand.couplings if c.driver >= 0}
        self.stopped: dict[str, str] = {}
        self.touching: list[str] = []
        self._still: set[int] = set()  # stopped joints
        self._clutched: set[int] = set()  # mimic joints that go on alone
        self.closes = [j for j in range(hand.l) if hand.closing[j] and j not in hand.idle]
        if not self.closes:
            raise InputError("no joint of the hand closes; give a closing sense", field="closing")
        self.waits = {j: inner for j, inner in waiting(hand).items() if stands_open(hand, j, q[j])}
        self.rate = self._rates()

    def arrive(self, links: Array, between: Array, pairs: list[tuple[int, int]], watched: Indices) -> None:
        """Stop what has reached something, and what hangs on that; then set the rates anew."""
        for i in np.flatnonzero(links <= TOUCH_GAP):
            name = self.hand.links[i].name
            if name not in self.touching:
                self.touching.append(name)
                self._stop(self.chains[i], f"{name} touches")
        for k in watched:
            if between[k] <= TOUCH_GAP:
                first, second = pairs[k]
                a, b = (self.hand.links[i].name for i in (first, second))
                self._stop(self._apart(first, second), f"{a} meets {b}")
        self._limits()
        self.rate = self._rates()

    def advance(self, scene: Scene, pose: Array, watched: Indices) -> None:
        """One step: as far as the distances allow, to the first touch or limit at the latest."""
        start = self.q
        links, between = self.seen
        pairs = scene.self_pairs
        fast = self._link_speeds(scene)
        moves = fast > 0
        first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
        meet = fast[first] + fast[second]
        apart = self.moved[first[watched]] ^ self.moved[second[watched]]  # joints that move one against the other
        live = watched[(apart & (self.rate != 0)).any(axis=1)]
        free = np.concatenate([(links - TOUCH_GAP)[moves] / fast[moves], (between - TOUCH_GAP)[live] / meet[live]])
        step = min(max(MIN_CLOSING_STEP, free.min(initial=np.inf)), self._time_to_limit())
        step = min(step, MAX_CLOSING_STEP) if self.hand.loops else step

        def ahead(t: float) -> tuple[float, Array, Array]:
            d, m = scene.clearances(self._at(start, t), pose, CLOSING_CUTOFF)
            return min([np.inf, *d[moves], *m[live]]), d, m

        least, links, between = ahead(step)
        if least < 0:
            before, after = 0.0, step
            while not 0 <= least <= TOUCH_GAP and after - before > CLOSING_ROUNDING:
                step = (before + after) / 2
                least, links, between = ahead(step)
                before, after = (step, after) if least > TOUCH_GAP else (before, step)
            if least < 0:  # it was touching from the start of the step
                step = before
                least, links, between = ahead(step)
        self.q = self._at(start, step)
        lower, upper = self.hand.limits.T
        inside = self.rate != 0
        self.q[inside] = np.clip(self.q, np.minimum(lower, start), np.maximum(upper, start))[inside]
        self.seen = links, between
        if self.hand.loops:
            led = [*self.hand.dependent, *self.couplings]
            behind = np.delete(np.abs(start + step * self.rate - self.q), led)
            if behind.max(initial=0.0) > STUCK:  # what drives the loops did not get where it was sent
                self._stop(set(self._moving()), "loop")
        stop_at = links.copy()
        stop_at[~moves] = np.inf
        self.arrive(stop_at, between, pairs, live)

    def _at(self, start: Array, t: float) -> Array:
        """(l,) where the joints are after a time t at their rates."""
        return self.hand.closed(start + t * self.rate, start, as_far_as_possible=True)

    def _apart(self, first: int, second: int) -> set[int]:
        """Joints that move one of two links against the other."""
        return set(self.chains[first]) ^ set(self.chains[second])

    def _stop(self, joints: tuple[int, ...] | set[int], why: str) -> None:
        for j in sorted(joints):
            if j in self._still:
                continue
            self._still.add(j)
            if self.hand.closing[j]:
                self.stopped[self.hand.joints[j].name] = why

    def _limits(self) -> None:
        for j in self._moving():
            if j not in self._still and self._room(j) <= CLOSING_ROUNDING:
                self._stop({j}, "limit")

    def _moving(self) -> list[int]:
        return [int(j) for j in np.flatnonzero(self.rate)]

    def _room(self, j: int) -> float:
        joint = self.hand.joints[j]
        return joint.upper - self.q[j] if self.rate[j] > 0 else self.q[j] - joint.lower

    def _time_to_limit(self) -> float:
        times = [self._room(j) / abs(self.rate[j]) for j in self._moving()]
        return max(0.0, min(times, default=np.inf))

    def _rates(self) -> Array:
        """(l,) joint speeds now, after stopping what a stopped partner holds."""
        changed = True
        while changed:
            changed = False
            for j, c in self.couplings.items():
                if j in self._clutched or (j in self._still) == (c.driver in self._still):
                    continue
                changed = True
                alone = self.breakaway and self._same_finger(c.driver, j)
                if alone:
                    self._clutched.add(j)  # the clutch has opened: each goes its own way
                else:
                    follower, stopped = (j, c.driver) if c.driver in self._still else (c.driver, j)
                    self._stop({follower}, f"follows {self.hand.joints[stopped].name}")
            for j, moved_by in self._followed().items():
                if j in self._still and moved_by - self._still:
                    changed = True
                    self._stop(moved_by - self._still, f"follows {self.hand.joints[j].name}")
        rate = np.zeros(self.hand.l)
        for j in self.closes:
            led = j in self.hand.dependent or (j in self.couplings and j not in self._clutched)
            waits = any(i not in self._still for i in self.waits.get(j, ()))
            if j not in self._still and not led and not waits:
                rate[j] = self.hand.closing[j] * self.speed[j]
        for _ in self.couplings:
            for j, c in self.couplings.items():
                if j not in self._still and j not in self._clutched:
                    rate[j] = c.ratio * rate[c.driver]
        if self.hand.loops:
            own = list(self.hand.dependent)
            rate[own] = 0.0
            rate[own] = -(self._loop_rows() @ rate)
        return rate

    def _loop_rows(self) -> Array:
        """(k, l) the loops' rows of A at q."""
        return self.hand.loop_rows(self.q, refuse=False)

    def _followed(self) -> dict[int, set[int]]:
        """For each joint that follows from loops: the closing joints that move it at q."""
        if not self.hand.loops:
            return {}
        closes = set(self.closes) - set(self.hand.dependent)
        rows = zip(self.hand.dependent, self._loop_rows(), strict=True)
        return {j: set(np.flatnonzero(row).tolist()) & closes for j, row in rows}

    def _same_finger(self, inner: int, outer: int) -> bool:
        return any(inner in chain and outer in chain for chain in self.chains)

    def _link_speeds(self, scene: Scene) -> Array:
        """(n_links,) an upper bound of the speed of any point of each link [m/s]."""
        poses = scene.placed  # where the distances were seen last, at q
        origins = np.zeros((self.hand.l, 3))
        for i, link in enumerate(self.hand.links):
            if len(link.joints) > 1:  # the joints between see each other's motion
                origins = self.hand.joint_axes(self.q)[1]
                break
            for j in link.joints:  # turning about its axis, a joint leaves the points on it where they are
                origins[j] = poses[i][:3, :3] @ self.hand.joints[j].anchor + poses[i][:3, 3]
        places = poses[: len(self.hand.links), :3, 3]
        arm = np.linalg.norm(places[:, None] - origins, axis=2) + scene.link_radius[:, None]
        arm[:, [joint.type == "prismatic" for joint in self.hand.joints]] = 1.0
        return np.asarray((self.moved * arm) @ np.abs(self.rate))


# --- fingers with one motor over several joints ------------------------------------------------------


def waiting(hand: Hand) -> dict[int, tuple[int, ...]]:
    """Which joints wait, each with the joints further out for which it waits.

    A motor that pulls at several joints of a finger gives them the same torque and leaves their difference free. A
    fingertip's contact has a longer arm about the inner joint, so that it opens that one and closes the outer one,
    whatever the motor pulls, until one of the two stands at a stop: the inner one open, or the outer one closed. A
    finger that closes in this order, the outer joint first and to its stop, rests wherever its tip touches. Those
    are the inner joints that wait: they close, driven by one motor that drives a closing joint further out, follow from
    no other, and have a stop at the end to which they open. Without stops nothing waits.
    """
    R, led = hand.mechanism.R != 0, {c.joint for c in hand.couplings} | set(hand.dependent)
    chains = [hand.moved_by(i) for i in range(len(hand.links))]
    out: dict[int, tuple[int, ...]] = {}
    for j in np.flatnonzero((R.sum(axis=0) == 1) & (hand.closing != 0)).tolist():
        row = R[R[:, j].argmax()]
        outer = {i for c in chains if j in c for i in c[c.index(j) + 1 :] if row[i] and hand.closing[i]}
        if outer and not led & {j, *outer} and np.isfinite(open_stop(hand, j)):
            out[j] = tuple(sorted(outer))
    return out


def open_stop(hand: Hand, joint: int) -> float:
    """The value beyond which something keeps a joint from opening; infinite if nothing does."""
    return hand.joints[joint].law.stops[0 if hand.closing[joint] > 0 else 1]


def stands_open(hand: Hand, joint: int, value: float) -> bool:
    """Whether a joint stands at the stop to which it opens."""
    near = STOP_ANGLE if hand.joints[joint].type == "revolute" else STOP_TRAVEL
    return bool(hand.closing[joint] * (value - open_stop(hand, joint)) <= near)
