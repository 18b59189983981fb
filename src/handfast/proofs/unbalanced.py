"""Shows that no contact forces balance a load, wherever in their regions the contacts are: nothing of the search.

A placement says where on its object region each contact is: two parameters each, whatever the hand. A twist (v, omega)
of the object moves the contact at p by u = v + omega x p. If, with n the normal into the object and mu the friction,

    n.u >= mu |u_t|  at every contact,   and   v.F + omega.M > 0  for a load (F, M) at the object's origin,

then neither the load nor any force in a friction cone does negative work, and the load does some: together they are not
in balance (Farkas' lemma). The load may be a sum of several with weights that are not negative: if forces balance each
of them, they balance the sum. A twist may be constant in a box of placements, or that of turning about the line through
two contacts, wherever these are: both then rest, and only the others have to meet the first condition.

A soft finger resists torsion, too: |c_t|^2 / mu^2 + tau^2 / mu_tau^2 <= c_n^2. The least work of its forces is that of
c_n times n.u - sqrt(mu^2 |u_t|^2 + mu_tau^2 (omega.n)^2), which takes the place of n.u - mu |u_t| everywhere: with the
lever mu_tau / mu the turning about the normal is one more component of u_t. Contacts on the line about which the object
turns do not rest then; they do not move, but turn.

Where the normal force at a contact is at most f, the first condition may be missed there: forces then do no less work
than -f (mu |u_t| - n.u), and the load has to do more than all of these. Where motors limit f, a state that holds may
miss joint torques, and f is larger by what that makes (`ForceLimits`). Of a sum of loads f counts as often as all of
them: the sum of what balances each, by its weight, is no larger. So there is a factor on the loads from which on a
twist refutes a box: the proof with a factor says that no placement holds the loads so many times, or more.

The twist may come with motions of the hand's joints, where it is known how the hand stands (`HandMotion`). With u the
motion of the object relative to the hand's point, and omega its turning relative to the link, the load then has to do
more work than motors and what else holds the joints can do against them (equation (2), virtual work).

A proof is a tree of boxes, halved until each has such a twist. Every box is checked in interval arithmetic. The
load may be missed by as much as a state that holds may miss it (`tolerance`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handfast.proofs.contact_force_limits import ForceLimits
from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, refuse_unknown
from handfast.proofs.grasp import LENGTH_ROUNDING
from handfast.proofs.intervals import Dual, Interval, cross, dot, join, sqr, sqrt, unit
from handfast.proofs.regions import ContactSide, RegionData
from handfast.proofs.replay import Figure, Refused, Replay, down, up
from handfast.proofs.tolerance import EPS, MIN_FORCE_SCALE

LINE_BATCH = 64  # boxes that are looked at together
LINE_BOXES = 8000  # for the distance from the line through two contacts
LINE_BOUND_RATIO = 0.95  # of the least distance that was met: a bound that is good enough
MAX_TREE_ENTRIES = 2_000_000  # entries of a tree at most
DISTANCE_INFLATION = 1 + 1e-14  # over the rounding of a bound that is computed in a few steps
LOAD_FACTORS = (1e-6, 1e6)  # on the loads: between them the least is looked for that refutes a box
FACTOR_HALVINGS = 30  # of their logarithm


@dataclass(frozen=True, eq=False)
class Motions:
    """Twists that refute boxes, one for each of N boxes.

    Attributes:
        weights: (N, k) of the loads, of which the sum does work on it.
        line: (N, 2) the two contacts about whose line it turns, from the first to the second; -1 if it is constant.
        twist: (N, 6) v [m/s] of the object's origin and omega [rad/s] if it is constant, else 0. Any size will do.
        joints: (N, l) motions of the hand's joints beside it [rad/s, m/s], 0 of those that couplings drive; (N, 0)
            where none move.
    """

    weights: Array
    line: Integers
    twist: Array
    joints: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not self.joints.size:
            object.__setattr__(self, "joints", np.zeros((len(self.weights), 0)))

    def __getitem__(self, key: Any) -> Motions:
        return Motions(self.weights[key], self.line[key], self.twist[key], self.joints[key])

    @property
    def moved(self) -> Mask:
        """(N,) which come with motions of joints."""
        return np.asarray((self.joints != 0).any(axis=1))

    def with_more(self, new: Motions) -> Motions:
        """These, and others behind them."""
        l = max(self.joints.shape[1], new.joints.shape[1])
        moved = [np.hstack([m.joints, np.zeros((len(m), l - m.joints.shape[1]))]) for m in (self, new)]
        both = [(self.weights, new.weights), (self.line, new.line), (self.twist, new.twist), moved]
        return Motions(*(np.concatenate(pair) for pair in both))

    def __len__(self) -> int:
        return len(self.weights)

    @classmethod
    def read(cls, f: Fields, names: Sequence[str], contacts: int, joints: Sequence[str] = ()) -> Motions:
        """From the field `motions`; `BadFile` for what cannot be one of such loads and contacts.

        joints: of the hand; those that may not move are ''.
        """
        weights, line, twist, moved = [], [], [], []
        for motion in f.objects("motions"):
            weighed = motion.named("loads")
            for name, x in weighed.items():
                refuse_unknown(name, names, "load", motion.at("loads"))
                if x < 0:
                    raise BadFile(f"is {x:g}; 0 or more is needed", f"{motion.at('loads')}.{name}")
            both = motion.has("line"), motion.has("twist")
            if both[0] == both[1]:
                raise BadFile("needs either a line or a twist", motion.place)
            ends = motion.numbers("line", (2,)) if both[0] else np.full(2, -1.0)
            pair = ends.astype(np.int64).tolist()
            if both[0] and not ((ends == pair).all() and set(pair) <= {*range(contacts)} and pair[0] != pair[1]):
                raise BadFile(f"is {pair}; two of the contacts 0 to {contacts - 1} are needed", motion.at("line"))
            weights.append([weighed.get(name, 0.0) for name in names])
            line.append(pair)
            twist.append(motion.numbers("twist", (6,)).tolist() if both[1] else [0.0] * 6)
            rates = motion.named("joints") if motion.has("joints") else {}
            for joint in rates:
                refuse_unknown(joint, [name for name in joints if name], "joint", motion.at("joints"))
            moved.append([rates.get(joint, 0.0) for joint in joints])
            motion.done()
        pairs, rows = np.array(line, dtype=np.int64).reshape(-1, 2), np.array(moved).reshape(len(moved), len(joints))
        return cls(np.array(weights).reshape(-1, len(names)), pairs, np.array(twist).reshape(-1, 6), rows)

    def to_json(self, names: Sequence[str], joints: Sequence[str] = ()) -> list[dict[str, Any]]:
        """Each with the weights of its loads, by name, and the motions of joints, where there are any."""
        out = []
        for weights, line, twist, moved in zip(
            *(a.tolist() for a in (self.weights, self.line, self.twist, self.joints)), strict=True
        ):
            said: dict[str, Any] = {"loads": {name: x for name, x in zip(names, weights, strict=True) if x}}
            rates = {name: x for name, x in zip(joints, moved, strict=True) if x} if any(moved) else {}
            out.append(
                said | ({"twist": twist} if line[0] < 0 else {"line": line}) | ({"joints": rates} if rates else {})
            )
        return out


@dataclass(frozen=True, eq=False)
class MovedJoint:
    """A joint in N boxes.

    Attributes:
        rates: (N,) [rad/s, m/s]. axis, anchor: (N, 3) its direction and a point on it, object frame. revolute: else it
            slides. contacts: that it moves.
    """

    rates: Interval
    axis: Dual
    anchor: Dual
    revolute: bool
    contacts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class HandMotion:
    """Motions of the joints of a hand in N boxes, beside twists of the object.

    Attributes:
        joints: that move, over the boxes. middle: the same in their middles.
        resisted: (N,) the most that motors, and what else holds the joints, can do against their motions.
        turned, slid: (N,) sums of the sizes of their motions, of revolute and prismatic ones.
    """

    joints: tuple[MovedJoint, ...]
    middle: tuple[MovedJoint, ...]
    resisted: Array
    turned: Array
    slid: Array

    def some(self, its: Integers) -> HandMotion:
        """Of some of the boxes."""
        over, middle = (tuple(_some_joint(j, its) for j in joints) for joints in (self.joints, self.middle))
        return HandMotion(over, middle, self.resisted[its], self.turned[its], self.slid[its])

    def velocity(self, point: Dual, about: Array, *, middle: bool) -> Dual:
        """(N, K, 3) of the hand's points of the contacts at `point` (N, K, 3), from (N, 3) on."""
        parts: list[list[Dual]] = [[] for _ in range(point.value.shape[1])]
        for joint in self.middle if middle else self.joints:
            for k in joint.contacts:
                along = joint.axis
                if joint.revolute:
                    along = cross(along, point[..., k, :] - (joint.anchor - about))
                parts[k].append(along * joint.rates[:, None])
        none = point[..., 0, :] * 0.0
        return join([sum(each, none)[..., None, :] for each in parts], -2)

    def turning(self, contacts: int, none: Dual, *, middle: bool) -> Dual:
        """(N, K, 3) [rad/s] of the links of the K contacts, as far as joints turn them; none: (N, 3) of zeros."""
        parts: list[list[Dual]] = [[] for _ in range(contacts)]
        for joint in self.middle if middle else self.joints:
            for k in joint.contacts if joint.revolute else ():
                parts[k].append(joint.axis * joint.rates[:, None])
        return join([sum(each, none)[..., None, :] for each in parts], -2)


def _some_joint(joint: MovedJoint, its: Integers) -> MovedJoint:
    axis, anchor = (Dual(a.value[its], Interval(a.slope.ends[:, its])) for a in (joint.axis, joint.anchor))
    return replace(joint, rates=joint.rates[its], axis=axis, anchor=anchor)


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """What is known of N boxes over n parameters, each with a claim: here a twist.

    Attributes:
        refuted: (N,) does the claim hold everywhere in the box? Of a twist: no forces balance its load there.
        reach: (N, n) what each parameter changes in what is not shown; NaN where that is not known.
        missing: (N,) by how much the claim is not shown, 0 where it is, NaN where nothing is known. Of a twist a share:
            of the work that the load could do on it at most, or of the motion of a contact.
        near: (N,) 1 where it is shown, 0 where it does not even hold in the middle; between, the share of its sides to
            which the box has to shrink, to first order.
    """

    refuted: Mask
    reach: Array
    missing: Array
    near: Array

    @classmethod
    def unknown(cls, boxes: int, n: int) -> BoxBounds:
        """To be filled in."""
        return cls(np.zeros(boxes, dtype=bool), np.full((boxes, n), np.nan), np.full(boxes, np.nan), np.zeros(boxes))

    def put(self, its: Integers, found: BoxBounds) -> None:
        """What is found of some of the boxes."""
        self.refuted[its], self.reach[its] = found.refuted, found.reach
        self.missing[its], self.near[its] = found.missing, found.near


def nearness(lower: Array, middle: Array) -> Array:
    """(N, R) of R functions, which are to be positive over N boxes, as `BoxBounds.near`; lower bounds of them over the
    boxes and in their middles.
    """
    inside = np.maximum(np.nan_to_num(middle, nan=0.0, posinf=0.0), 0.0)
    short = np.maximum(-np.nan_to_num(lower, nan=-np.inf), 0.0)
    return np.where(short > 0, inside / (inside + short), 1.0)


@dataclass(frozen=True, eq=False)
class Placements:
    """Where K contacts can be on an object, and the loads that it bears.

    Attributes:
        side: the regions. root: (2 K, 2) the whole range of the parameters, two for each contact.
        loads: (k, 6) forces [N] and torques [N m] at the object's origin. friction: coefficient at every contact.
        limits: of the normal force at each contact.
        torsion: [m] coefficient of torsional friction at every contact; 0 for point contacts.
        factor: so many times each load is to be balanced.

    Raises:
        ValueError: torsion without friction.
    """

    side: ContactSide
    root: Array
    loads: Array
    friction: float
    limits: ForceLimits
    torsion: float = 0.0
    factor: float = 1.0

    def __post_init__(self) -> None:
        if self.torsion and not self.friction:
            raise ValueError("soft fingers need friction")

    @classmethod
    def of(
        cls,
        regions: Sequence[RegionData],
        loads: Array,
        friction: float,
        force_limits: ForceLimits | Array | float = np.inf,
        torsion: float = 0.0,
        factor: float = 1.0,
    ) -> Placements:
        """Of the object regions of a task; one limit of forces for all contacts, or (K,) of each."""
        columns = np.arange(2 * len(regions)).reshape(-1, 2)
        root = np.concatenate([region.ends for region in regions])
        side = ContactSide.of(regions, columns, still=False)
        limits = force_limits if isinstance(force_limits, ForceLimits) else ForceLimits.of(force_limits, len(regions))
        return cls(side, root, np.asarray(loads, dtype=float), friction, limits, torsion, factor)

    @property
    def count(self) -> int:
        """K."""
        return len(self.side.columns)

    @property
    def reach(self) -> float:
        """[m] from the object's origin to the farthest point of the regions, at least."""
        everywhere = self.side.over(Interval.between(*self.root.T[:, None]))
        return float(np.linalg.norm(everywhere.point.value.mag, axis=-1).max())

    @property
    def force_limits(self) -> Array:
        """(K,) [N] largest normal force at each contact; inf for none."""
        return self.limits.most

    @property
    def lever(self) -> float:
        """[m] torsional friction over friction, rounded upwards; 0 for point contacts."""
        return self.torsion / self.friction * DISTANCE_INFLATION if self.torsion else 0.0

    @property
    def limited(self) -> Mask:
        """(K,) at which contacts there is a largest normal force."""
        return np.isfinite(self.force_limits)

    @property
    def sine(self) -> float:
        """Of the friction angle, rounded upwards."""
        return self.friction / np.hypot(1.0, self.friction) * DISTANCE_INFLATION

    def at(self, parameters: Array) -> tuple[Array, Array]:
        """Points and normals into the object (N, K, 3) at parameters (N, 2 K): rounded, for a search."""
        at = self.side.at(Interval.of(parameters))
        return at.point.value.mid, -at.normal.value.mid

    def examined(self, boxes: Array, motions: Motions, hand: HandMotion | None = None) -> BoxBounds:
        """What the twists show of boxes (N, 2 K, 2), or with the motions of a hand of boxes in which it stands."""
        out = BoxBounds.unknown(*boxes.shape[:2])
        for some, bounds in self._bounds(boxes, motions, hand):
            out.put(some, bounds.shown(np.full(len(some), self.factor)))
        return out

    def least_factors(self, boxes: Array, motions: Motions) -> tuple[Array, Array]:
        """(N,) the factor on the loads from which on the twists refute boxes (N, 2 K, 2), inf where none is; the reach.

        `factor` does not count. Found by bisection between `LOAD_FACTORS`.
        """
        found, reach = np.full(len(boxes), np.inf), np.full(boxes.shape[:2], np.nan)
        for some, bounds in self._bounds(boxes, motions):
            low, high = (np.full(len(some), np.log(x)) for x in LOAD_FACTORS)
            for _ in range(FACTOR_HALVINGS):
                middle = 0.5 * (low + high)
                shown = bounds.shown(np.exp(middle)).refuted
                low, high = np.where(shown, low, middle), np.where(shown, middle, high)
            at_high = bounds.shown(np.exp(high))
            found[some], reach[some] = np.where(at_high.refuted, np.exp(high), np.inf), at_high.reach
        return found, reach

    def _bounds(
        self, boxes: Array, motions: Motions, hand: HandMotion | None = None
    ) -> Iterator[tuple[Integers, _WorkBounds]]:
        """What is computed once for boxes, some of them at a time, with their numbers."""
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which shows nothing
            for line in np.unique(motions.line, axis=0):
                its = np.flatnonzero((motions.line == line).all(axis=1))
                for some in _batches(its):
                    over, at = Interval.between(*np.moveaxis(boxes[some], 2, 0)), boxes[some].mean(axis=2)
                    moved = motions[some], tuple(line.tolist()), hand and hand.some(some)
                    works = self._works(over, *moved, boxes.shape[1]), self._works(Interval.of(at), *moved, 0)
                    yield some, _WorkBounds(*works, over - at)

    def _works(self, x: Interval, motions: Motions, line: tuple[int, int], hand: HandMotion | None, n: int) -> _Works:
        """At parameters (N, 2 K), with n derivatives or none."""
        at = self.side.over(x) if n else self.side.at(x)
        point, normal = (self.side.spread(a, n) for a in (at.point, at.normal))
        loads = (Interval.of(motions.weights)[:, None] @ self.loads)[:, 0]
        force, torque = loads[:, :3], loads[:, 3:]
        about = point.value.mid.mean(axis=1)  # amid the contacts: large numbers that cancel make wide intervals
        point, torque = point - about[:, None], torque - cross(Interval.of(about), force)
        if line[0] < 0:
            turn = Interval.of(motions.twist[:, 3:])
            moves = cross(turn, Interval.of(about)) + motions.twist[:, :3]
            v, omega = (Dual.constant(a, n) for a in (moves, turn))
        else:
            first, second = (point[..., k, :] for k in line)
            omega = second - first
            v = cross(first, omega)
        u = v[..., None, :] + cross(omega[..., None, :], point)
        spin = omega[..., None, :]
        if hand is not None:
            u = u - hand.velocity(point, about, middle=not n)
            spin = spin - hand.turning(point.value.shape[1], point[..., 0, :] * 0.0, middle=not n)
        moving = {k for joint in hand.joints for k in joint.contacts} if hand else {}
        rest = [k for k in line if k >= 0 and k not in moving]
        if rest and self.torsion:  # exactly
            u = u * np.where(np.isin(np.arange(point.value.shape[1]), rest), 0.0, 1.0)[:, None]
        work = dot(v, Dual.constant(force, n)) + dot(omega, Dual.constant(torque, n))
        pushed = dot(-normal, u)
        scales = self._scales(point.value, about, motions.weights)
        largest = scales.work((v.value, omega.value), line)
        missed = scales.missed(largest, hand)
        rest = [] if self.torsion else rest
        bounded, free = (
            [k for k in np.flatnonzero(these).tolist() if k not in rest] for these in (self.limited, ~self.limited)
        )
        resisted, cones, speeds = None, None, np.zeros((len(largest), 0))
        twisted = sqr(dot(normal, spin) * self.lever) if self.torsion else None
        together = Interval.of(motions.weights).sum()  # forces of each load, by its weight, add up to as much
        if bounded:
            slip, whole = sqr(u + pushed[..., None] * normal).sum(), sqr(u.value).sum()
            if twisted is not None:
                slip, whole = slip + twisted, whole + sqr(sqrt(sqr(spin.value).sum()) * self.lever)
            most = sqrt(whole).hi * (np.hypot(1.0, self.friction) * DISTANCE_INFLATION)  # whatever the normal is
            short = _positive(sqrt(slip) * self.friction - pushed, most)[..., bounded]
            missed = missed + scales.of_forces(short.value.hi, self.limits, bounded)
            resisted = (short * self.force_limits[bounded]).sum() * Dual.constant(together, n)
        if hand is not None:
            by_motors = Dual.constant(Interval.of(hand.resisted) * together, n)
            resisted = by_motors if resisted is None else resisted + by_motors
        if free:
            its, size = pushed[..., free], sqr(u[..., free, :]).sum()
            size = size if twisted is None else size + twisted[..., free]
            cones = its - sqrt(size) * self.sine if self.friction else its
            speeds = sqrt(size.value).hi
        return _Works(work, resisted, cones, missed, largest, speeds)

    def _scales(self, p: Interval, about: Array, weights: Array) -> _Scales:
        """Of the loads, by their weights, at contacts p (N, K, 3), which are given from points (N, 3).

        The torque of a load is about the centroid c of the contacts, their size the largest distance from it. A single
        contact has no size. How much a state may miss then follows from where the hand's joints are (`GraspData.size`),
        but for the force at a point contact: of a soft finger, and of twists that turn, nothing is shown.
        """
        c = p.swapped().sum() / float(p.shape[1])
        away = sqrt(sqr(p - c[..., None, :]).sum())
        smallest, largest = away.lo.max(axis=1), away.hi.max(axis=1)
        force, torque = Interval.of(self.loads[:, :3]), Interval.of(self.loads[:, 3:])
        each = force, torque - cross((c + about)[:, None], force)  # (k, 3), (N, k, 3)
        f, moment = ((weights * sqrt(sqr(a).sum()).hi).sum(axis=1) * (1 + weights.shape[1] * 1e-14) for a in each)
        of_force = f if p.shape[1] == 1 else f + moment / smallest
        enough = np.maximum(f, moment) > MIN_FORCE_SCALE
        far = (p + about[:, None]).mag.max(axis=(1, 2))  # contacts in one place have no size either
        enough &= (smallest > 2 * LENGTH_ROUNDING * far) if p.shape[1] > 1 else not self.torsion
        return _Scales(c, of_force, f * largest + moment, p.shape[1], enough)

    def line_distance(self, center: Array) -> float:
        """[m] what a point (3,) is at least away from the line through two contacts, wherever these are.

        By boxes of its own, the one with the least bound first, until the bound is `LINE_BOUND_RATIO` or `LINE_BOXES`
        were looked at.
        """
        boxes, bounds, least, seen = self.root[None], np.zeros(1), np.inf, 0
        while seen < LINE_BOXES and bounds.min() < LINE_BOUND_RATIO * least:
            first = np.argsort(bounds, kind="stable")[:LINE_BATCH]
            with np.errstate(all="ignore"):
                new, middle, reach = self._line_distances(boxes[first], center)
            new, least, seen = np.fmax(new, bounds[first]), min(least, middle.min()), seen + len(first)
            both = [half for box, k in zip(boxes[first], reach.argmax(axis=1), strict=True) for half in halves(box, k)]
            boxes = np.concatenate([np.delete(boxes, first, axis=0), both])
            bounds = np.concatenate([np.delete(bounds, first), np.repeat(new, 2)])
        return float(bounds.min())

    def _line_distances(self, boxes: Array, center: Array) -> tuple[Array, Array, Array]:
        """Lower bounds (N,) in boxes, distances in their middles, and (N, n) what each parameter changes.

        The distance is the length of the moment m of the unit vector along the line; it is at least m.a for a unit
        vector a, that of m in the middle.
        """
        over, at = Interval.between(*np.moveaxis(boxes, 2, 0)), boxes.mean(axis=2)
        moment, middle = (
            self._moments(self.side.spread(points, boxes.shape[1]), center)
            for points in (self.side.over(over).point, self.side.at(Interval.of(at)).point)
        )
        along = middle.value.mid
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / (np.maximum(length, MIN_FORCE_SCALE) * DISTANCE_INFLATION)  # no longer than 1
        direction = Dual.constant(Interval.of(along), at.shape[1])
        rows, here = (dot(m, direction)[..., None] for m in (moment, middle))
        lower, _ = _mean_value(rows, here, over - at)
        reach = np.nan_to_num(_changes(rows, over - at).mag[:, 0], posinf=0.0)
        wide = ~reach.any(axis=1)
        reach[wide] = np.ptp(boxes[wide], axis=2) / np.ptp(self.root, axis=1)
        return np.nan_to_num(lower[:, 0], nan=0.0, neginf=0.0), length[:, 0], reach

    def _moments(self, points: Dual, center: Array) -> Dual:
        """(N, 3) of the unit vector from one contact to the other, of points (N, 2, 3), about a point."""
        first, second = (points[..., k, :] for k in (0, 1))
        return cross(first - center, unit(second - first))


@dataclass(frozen=True, eq=False)
class _Scales:
    """How large the loads of N boxes are; a state that holds may miss `EPS` of that, see `tolerance`.

    Attributes:
        center: (N, 3) centroid of the contacts.
        force, torque: (N,) [N, N m] upper bounds of their scale, and of it times the contacts' size.
        contacts: K. enough: (N,) are they large enough that anything is proved of them?
    """

    center: Interval
    force: Array
    torque: Array
    contacts: int
    enough: Mask

    def work(self, twist: tuple[Interval, Interval], line: tuple[int, int]) -> Array:
        """(N,) an upper bound of what loads of their size can do; v in the twist is that of the points from which the
        contacts are given.
        """
        v, omega = twist
        moves, turns = (sqrt(sqr(a).sum()).hi for a in (v + cross(omega, self.center), omega))
        if self.contacts == 2 and line[0] >= 0:
            moves = np.zeros(len(moves))  # the centroid is on the line
        of_turns = self.torque * turns
        if self.contacts == 1:  # it has no size: how much torque may be missed follows from the joints
            of_turns = np.where(omega.mag.any(axis=1), np.inf, 0.0)
        return np.where(moves > 0, self.force * moves, 0.0) + of_turns

    def missed(self, work: Array, hand: HandMotion | None) -> Array:
        """(N,) an upper bound of the work of what a state misses of load and joint torques; work: as of `work`."""
        missed = np.where(self.enough, EPS * work * DISTANCE_INFLATION**8, np.inf)
        return missed if hand is None else missed + self.of_joints(hand.turned, hand.slid)

    def of_joints(self, turned: Array, slid: Array) -> Array:
        """The most that is missed of the torques of joints, as work on motions of revolute and of prismatic ones.

        turned, slid: sums of their sizes, (N,) or one for all boxes.
        """
        if self.contacts == 1:  # it has no size
            return np.where(np.asarray(turned + slid) > 0, np.inf, np.zeros(len(self.force)))
        of_slides, of_turns = (
            np.where(motions > 0, each * motions, 0.0) for each, motions in ((self.force, slid), (self.torque, turned))
        )
        return EPS * (of_slides + of_turns) * DISTANCE_INFLATION**8

    def of_forces(self, short: Array, limits: ForceLimits, contacts: Sequence[int]) -> Array:
        """(N,) the most that forces beyond their limits do, for what is missed of joint torques, where they fall short
        by (N, c) of the first condition at some contacts.
        """
        out = np.zeros(len(short))
        for column, k in enumerate(contacts):
            more = self.of_joints(limits.turned[k], limits.slid[k])
            out += np.where((more > 0) & (short[:, column] > 0), short[:, column] * more, 0.0)
        return out * DISTANCE_INFLATION**8


@dataclass(frozen=True, eq=False)
class _Works:
    """What N twists do, with derivatives or none.

    Attributes:
        work: (N,) of the loads, by their weights.
        resisted: (N,) what the forces at contacts where they are limited can do against it at most; None if there are
            none that move.
        cones: (N, c) n.u - sin |u| of the other contacts that move; None if there are none.
        missed: (N,) how much work at most the load does that a state may miss.
        largest: (N,) about how much work loads of this size can do at most. speeds: (N, c) |u| of `cones`, at most.
    """

    work: Dual
    resisted: Dual | None
    cones: Dual | None
    missed: Array
    largest: Array
    speeds: Array

    def balance(self, factor: Array) -> Dual:
        """(N, 1) the work of so many times the load, less what is done against it."""
        work = self.work if (factor == 1).all() else self.work * factor
        return (work if self.resisted is None else work - self.resisted)[..., None]


@dataclass(frozen=True, eq=False)
class _WorkBounds:
    """Of N boxes with a twist each: what it does over the box and in its middle, and how far (N, n) the box reaches."""

    over: _Works
    middle: _Works
    away: Interval

    def shown(self, factor: Array) -> BoxBounds:
        """Which boxes are refuted where so many times (N,) the loads are to be balanced."""
        over, at = self.over.balance(factor), self.middle.balance(factor)
        lower, _ = _mean_value(over, at, self.away)
        due = (factor * self.over.missed * DISTANCE_INFLATION)[:, None]
        shown, sizes = lower > due, _changes(over, self.away).mag
        rows, middle, size = lower - due, at.value.lo - due, (factor * self.over.largest)[:, None]
        if self.over.cones is not None and self.middle.cones is not None:
            lower, _ = _mean_value(self.over.cones, self.middle.cones, self.away)
            shown = np.hstack([shown, lower >= 0])
            sizes = np.concatenate([sizes, _changes(self.over.cones, self.away).mag], axis=1)
            rows, middle = np.hstack([rows, lower]), np.hstack([middle, self.middle.cones.value.lo])
            size = np.hstack([size, self.over.speeds])
        share = sizes / sizes.sum(axis=2, keepdims=True)
        missing = np.where(shown, 0.0, np.maximum(-rows, 0.0) / size).max(axis=1)
        near = np.where(shown, 1.0, nearness(rows, middle)).min(axis=1)
        reach = np.where(shown[..., None], 0.0, share).sum(axis=1)
        return BoxBounds(np.asarray(shown.all(axis=1)), reach, missing, near)


def _mean_value(over: Dual, middle: Dual, away: Interval) -> tuple[Array, Array]:
    """Lower and upper bounds (N, R) of R functions over N boxes; NaN where the boxes are too wide.

    Args:
        over, middle: their values with derivatives over the boxes, and in the middles.
        away: (N, n) of the boxes from their middles.
    """
    linear = middle.value + _changes(over, away).sum()
    return np.fmax(over.value.lo, linear.lo), np.fmin(over.value.hi, linear.hi)


def _changes(over: Dual, away: Interval) -> Interval:
    """(N, R, n) of R functions by each variable, from the middles of N boxes."""
    return Interval(over.slope.ends.transpose(1, 2, 0, 3)) * away[:, None]


# --- proofs in files --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class UnbalancedTree:
    """Boxes in order: a tree that halves the whole, the lower half first.

    Attributes:
        motions: that refute boxes.
        entries: of each box the parameter in whose middle it is halved; -1 - r: it is refuted by motion r; None: open.
    """

    motions: Motions
    entries: tuple[int | None, ...]

    @classmethod
    def read(cls, f: Fields, names: Sequence[str], contacts: int) -> UnbalancedTree:
        """As it stands in a file; `BadFile` for what cannot be one of such loads and contacts."""
        motions = Motions.read(f, names, contacts)
        entries = f.take("tree")
        if not isinstance(entries, list) or not 0 < len(entries) <= MAX_TREE_ENTRIES:
            raise BadFile(f"is no list of 1 to {MAX_TREE_ENTRIES} entries", f.at("tree"))
        for k, x in enumerate(entries):
            if x is not None and (type(x) is not int or not -len(motions) <= x < 2 * contacts):
                need = f"a parameter below {2 * contacts}, a motion or null is needed"
                raise BadFile(f"is {x!r}; {need}", f"{f.at('tree')}[{k}]")
        f.done()
        return cls(motions, tuple(entries))

    def leaves(self, root: Array) -> tuple[Array, list[int | None]]:
        """(L, n, 2) the boxes that are not halved, and the motion of each, None where one is open.

        Raises:
            Refused: the tree leaves out a box, or goes on after its last one.
        """
        stack, boxes, closed = [root], [], []
        for k, entry in enumerate(self.entries):
            if not stack:
                raise Refused(f"the tree goes on after its last box, at entry {k}")
            box = stack.pop()
            if entry is None or entry < 0:
                boxes.append(box)
                closed.append(None if entry is None else -1 - entry)
            else:
                low, high = halves(box, entry)
                if not box[entry, 0] < low[entry, 1] < box[entry, 1]:
                    raise Refused(f"the tree halves a box that is too small, at entry {k}")
                stack += [high, low]
        if stack:
            raise Refused(f"the tree leaves out {len(stack)} boxes")
        return np.array(boxes).reshape(-1, *root.shape), closed

    def checked(self, placements: Placements) -> int:
        """How many boxes are open; all others are refuted.

        Raises:
            Refused: the tree does not cover all placements, or a box of it is not refuted by its motion.
        """
        boxes, closed = self.leaves(placements.root)
        boxes, which = boxes[[m is not None for m in closed]], [m for m in closed if m is not None]
        wrong = np.flatnonzero(~placements.examined(boxes, self.motions[which]).refuted)
        if len(wrong):
            raise Refused(f"{len(wrong)} of {len(boxes)} boxes are not refuted, the first is leaf {wrong[0]}")
        return len(closed) - len(which)


def _positive(x: Dual, most: Array) -> Dual:
    """The larger of 0 and x, which is at most `most`, with its generalised derivative."""
    low, high = x.value.lo, np.fmin(x.value.hi, most)
    slope = Interval.between(np.minimum(x.slope.lo, 0.0), np.maximum(x.slope.hi, 0.0))
    ends = np.where((high <= 0)[..., None], 0.0, np.where((low >= 0)[..., None], x.slope.ends, slope.ends))
    return Dual(Interval.between(np.fmax(low, 0.0), np.maximum(high, 0.0)), Interval(ends))


def _batches(its: Integers) -> Iterator[Integers]:
    return (its[k : k + LINE_BATCH] for k in range(0, len(its), LINE_BATCH))


def halves(box: Array, k: int) -> tuple[Array, Array]:
    """A box (n, 2) cut in the middle of its side k, the lower half first."""
    low, high = box.copy(), box.copy()
    low[k, 1] = high[k, 0] = 0.5 * (box[k, 0] + box[k, 1])
    return low, high


def replay_unbalanced(
    regions: Sequence[RegionData],
    loads: Mapping[str, Array],
    friction: float,
    force_limits: ForceLimits | Array | float,
    center: Array | None,
    f: Fields,
    factor: float = 1.0,
    torsion: float = 0.0,
) -> Replay:
    """The claim that no contact forces balance all of some loads, each alone, wherever the contacts are.

    Args:
        regions: of the object, one for each contact. loads: (6,) by name.
        force_limits: [N] largest normal force at any contact, or (K,) at each; inf for none.
        torsion: [m] of soft fingers; 0 for point contacts.
        center: (3,) the object's centre of mass if its distance from the line through two contacts is wanted.
        factor: that so many times these loads are not balanced, nor more.

    Raises:
        BadFile: what is wrong with the file.
    """
    names = list(loads)
    tree = UnbalancedTree.read(f, names, len(regions))
    placements = Placements.of(regions, np.array(list(loads.values())), friction, force_limits, torsion, factor)
    used = [name for i, name in enumerate(names) if tree.motions.weights[:, i].any()]
    each = placements.force_limits.tolist()
    same = each[:1] if len(set(each)) == 1 else each
    most = ", ".join(down(x) if np.isfinite(x) else "any" for x in same)
    limit = f" and normal forces up to {most} N" if placements.limited.any() else ""
    soft = f", a torsion of {down(1e3 * torsion)} mm" if torsion else ""
    claim = f"wherever in their regions the {len(regions)} contacts are, with a friction of {down(friction)}"
    claim += f"{soft}{limit} no contact "
    times = "" if factor == 1 else f"{up(factor, 3)} times or more "
    claim += f"forces balance {times}{'all of ' if len(used) > 1 else ''}{', '.join(used)}"
    figures: dict[str, Figure] = {"boxes": len(tree.entries)}
    try:
        left = tree.checked(placements)
    except Refused as why:
        return Replay("balance", claim, str(why), figures)
    if left:
        return Replay("balance", claim, f"{left} boxes are open", figures)
    if center is not None and len(regions) == 2:
        least = placements.line_distance(center)
        figures["line_distance"] = least
        claim += (
            f"; the line through them is at least {down(1e3 * least, 3)} mm from the centre of mass" if least else ""
        )
    return Replay("balance", claim, "", figures)
