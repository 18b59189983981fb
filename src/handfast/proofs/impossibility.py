"""Shows with interval arithmetic alone that some contacts cannot be made together: nothing of the search.

Whatever the object's pose, a rigid motion keeps lengths and angles. At a contact (see `contact_equations`) the hand's
point P and direction A in the palm frame, and the object's point O and direction N in its own, are

    a hand cap with centre c, axis a, half angle h:  P = p_k + R_k c,  A = R_k a,  O = o + g r n,  N = -g n,
    any other one with point h, normal m:            P = p_k + R_k h,  A = R_k m,  O = o,          N = -n, with h = 0,

and R O + p = P while R N is within the angle h of A. So for any two of them, with dP = P - P' and dO = O - O',

    |dP|^2 = |dO|^2,   |A.A' - N.N'| <= 2 sin((h + h') / 2),   |A.dP - N.dO| <= 2 sin(h / 2) |dP|.

The object's origin, where it is bounded, is a contact without a direction (P = p, O = 0), and an axis of the object
that is bounded a direction without a contact (A the middle of its bounds, N the axis). Boxes of the joints and the
parameters are narrowed, discarded or halved by these conditions, each taken with its derivatives over the box.
If none is left, the task has no configuration. The conditions say less than the search knows: of three contacts they
see only each two; so not each NONE of the search can be shown here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from handfast.proofs.contact_equations import Sides
from handfast.proofs.fields import Array, Integers, Mask
from handfast.proofs.intervals import MACHINE_EPSILON, UNDERFLOW_BOUND, Dual, Interval, dot, join, sqr, sqrt
from handfast.proofs.tasks import TaskData

REFUTATION_BOXES = 20_000  # that are looked at before the question is left open
REFUTATION_BATCH = 64  # boxes that are looked at together
MANY_DERIVATIVES = 2_000  # derivatives of all conditions, beyond which boxes and batches are fewer
MOST_DERIVATIVES = 1_000_000  # beyond which nothing is tried: hundreds of contacts
MIN_BOX_SHARE = 1e-6  # of the whole: a box with no longer side could be halved for ever
BOUND_INFLATION = 1 + 1e-9  # over the rounding of a bound
CONE_ROUNDING = 1e-9  # more than the rounding of a cone about the bounds of an axis


@dataclass(frozen=True)
class Impossibility:
    """What became of the boxes.

    Attributes:
        shown: is none left? Then the contacts cannot be made together.
        boxes: how many were looked at.
        discarded: share of the space that no configuration is in.
        axes: are bounds of the object's axes among the conditions?
    """

    shown: bool
    boxes: int
    discarded: float
    axes: bool = False


def impossible(
    task: TaskData, contacts: Sequence[int], *, origin: bool = False, boxes: int = REFUTATION_BOXES
) -> Impossibility:
    """Can it be shown that these contacts of the task, and the bounds of the object's origin, exclude each other?

    Raises:
        Refused: couplings and limits that contradict each other, links that do not stand at rotations.
    """
    with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which discards nothing
        conditions = Conditions.of(task.part(contacts), origin)
        stack, share = [conditions.root], [1.0]
        seen, discarded = 0, 0.0
        whole = np.ptp(conditions.root, axis=1)
        count = sum(index.shape[1] for index in (conditions.two, conditions.directed, conditions.line))
        if not count or len(whole) * count > MOST_DERIVATIVES:
            return Impossibility(False, 0, 0.0)  # a contact alone excludes nothing
        more = max(1.0, len(whole) * count / MANY_DERIVATIVES)
        boxes, batch = int(boxes / more), max(1, int(REFUTATION_BATCH / more))
        while stack and seen < boxes:
            part = np.array(stack[-batch:])
            shares = share[-batch:]
            del stack[-batch:], share[-batch:]
            seen += len(part)
            alive, part, reach = conditions.narrowed(part)
            sides = np.ptp(part, axis=2) / np.where(whole > 0, whole, 1.0)
            if (sides[alive] <= MIN_BOX_SHARE).all(axis=1).any():
                return Impossibility(False, seen, discarded)
            # the side that changes a condition most; where that is not known, the longest one
            cut = np.where(np.isfinite(reach), reach, sides[..., None]).max(axis=2).argmax(axis=1)
            for box, k, its, left in zip(part, cut.tolist(), shares, alive.tolist(), strict=True):
                if not left:
                    discarded += its
                    continue
                low, high = box.copy(), box.copy()
                low[k, 1] = high[k, 0] = box[k].mean()
                stack += [low, high]
                share += [its / 2] * 2
        return Impossibility(not stack, seen, 1.0 if not stack else discarded, conditions.axes.size > 0)


@dataclass(frozen=True, eq=False)
class _ConditionValues:
    """C conditions over N boxes: |value| <= tolerance.

    Attributes:
        value: (N, C) with their derivatives (n, N, C).
        middle: (N, C) the values in the middles (N, n) of the boxes, exact ones.
        tolerance: (N, C).
        possible: (N,) whether all joints may be within their limits.
    """

    value: Dual
    middle: Interval
    at: Array
    tolerance: Array
    possible: Mask


@dataclass(frozen=True, eq=False)
class Conditions:
    """Those of a set of contacts, their constants prepared.

    Attributes:
        root: (n, 2) where coordinates can be: joints, position of the origin if it counts, parameters.
        limits: (J, 2) of the moving joints.
        place: columns of the position; () without.
        axes: (2, L, 3) A and N of the axes that are bounded.
        half: (K + L,) [rad] the angles h.
        size: [m] how far a point of the hand can be from the palm's origin, to compare lengths with angles.
        two: (2, .) each two contacts, the origin last; directed: (2, .) each two directions, the axes last.
        line: (2, .) a direction, and which of `two` its contact is one of; an axis goes with each of them.
    """

    root: Array
    limits: Array
    place: list[int]
    sides: Sides
    axes: Array
    half: Array
    size: float
    two: Integers
    directed: Integers
    line: Integers

    @classmethod
    def of(cls, task: TaskData, origin: bool) -> Conditions:
        sides, K = Sides.of(task, [f"position:{i}" for i in range(3)] if origin else []), len(task.links)
        place = [sides.column[f"position:{i}"] for i in range(3)] if origin else []
        root = whole(task, sides)
        root[place] = task.position[: len(place)]
        two, (axes, around_axes) = list(combinations(range(K + origin), 2)), _cones(task.axes)
        along = [(k, n) for n, t in enumerate(two) for k in t if k < K]
        along += [(K + i, n) for n in range(len(two)) for i in range(len(around_axes))]
        made = cls(
            root,
            task.hand.limits[list(sides.drive.joints)].reshape(-1, 2),
            place,
            sides,
            axes,
            np.array([*(hand.half_angle if hand.ball else 0.0 for hand in task.on_hand), *around_axes]),
            1.0,
            np.array(two, dtype=np.int64).reshape(-1, 2).T,
            np.array(list(combinations(range(K + len(around_axes)), 2)), dtype=np.int64).reshape(-1, 2).T,
            np.array(along, dtype=np.int64).reshape(-1, 2).T,
        )
        return made._sized()

    @property
    def position(self) -> Array:
        """(3, 2) where the origin can be, if it counts."""
        return self.root[self.place]

    def _sized(self) -> Conditions:
        """With its size, and a finite place of the origin: no farther than a contact on the hand and on the object."""
        x = Interval.between(self.root[None, :, 0], self.root[None, :, 1])
        on_hand, _ = self.sides.on_hand(x, 0)
        away, out = (sqrt(sqr(y.value).sum()).hi for y in (on_hand, self.sides.object.at(x).point))
        far, root = (away + out + np.abs(self.sides.radius[:, 0])).min() * BOUND_INFLATION, self.root.copy()
        root[self.place] = np.clip(root[self.place], -far, far)
        return replace(self, root=root, size=max(float(away.max()), 1e-6))

    def _contacts(self, x: Interval, n: int) -> tuple[Dual, Dual, Dual, Dual]:
        """P, A, O, N (N, ., 3) of the contacts; P and O of the origin if it has a place, A and N of the axes."""
        sides, m = self.sides, len(x.ends)
        P, A = sides.on_hand(x, n)
        at = sides.object.at(x)
        point, normal = (sides.object.spread(a, n) for a in (at.point, at.normal))
        lifted = point + normal * sides.radius
        # a patch's point needs no normal, which has no bounds over a wide box
        O = join([(lifted if r else point)[..., k : k + 1, :] for k, r in enumerate(sides.radius[:, 0])], -2)
        if self.place:
            slope = np.zeros((n, m, 1, 3, 2))
            slope[self.place if n else []] = np.eye(3)[:n, None, None, :, None] * [-1.0, 1.0]
            P = join([P, Dual(x[..., self.place].reshape(m, 1, 3), Interval(slope))], -2)
            O = join([O, Dual.constant(Interval(np.zeros((m, 1, 3, 2))), n)], -2)
        N = normal * sides.sign
        if self.axes.size:
            fixed = (Interval(np.broadcast_to(Interval.of(a).ends, (m, *a.shape, 2))) for a in self.axes)
            A, N = (join([y, Dual.constant(f, n)], -2) for y, f in zip((A, N), fixed, strict=True))
        return P, A, O, N

    def _rows(self, x: Interval, n: int) -> tuple[Dual, Interval]:
        """(N, C) the conditions, lengths first, with n derivatives or none; (N, T) the lengths |dP|."""
        P, A, O, N = self._contacts(x, n)
        (i, j), (a, b), (k, at) = self.two, self.directed, self.line
        dP, dO = P[..., i, :] - P[..., j, :], O[..., i, :] - O[..., j, :]
        lengths = sqr(dP).sum()
        angles = dot(A[..., a, :], A[..., b, :]) - dot(N[..., a, :], N[..., b, :])
        lines = dot(A[..., k, :], dP[..., at, :]) - dot(N[..., k, :], dO[..., at, :])
        return join([lengths - sqr(dO).sum(), angles, lines], -1), sqrt(lengths.value)

    def at(self, box: Array) -> _ConditionValues:
        """The conditions over boxes (N, n, 2)."""
        over, middle = Interval.between(box[..., 0], box[..., 1]), box.mean(axis=2)
        q = self.sides.drive.at(over)
        value, length = self._rows(over, box.shape[1])
        here, _ = self._rows(Interval.of(middle), 0)
        (a, b), (k, at) = self.directed, self.line
        most = [
            np.zeros((len(box), self.two.shape[1])),
            np.tile(2 * np.sin(np.minimum(self.half[a] + self.half[b], np.pi) / 2) * BOUND_INFLATION, (len(box), 1)),
            2 * np.sin(self.half[k] / 2) * length.hi[:, at] * BOUND_INFLATION,
        ]
        possible = ~((q.lo > self.limits[:, 1]) | (q.hi < self.limits[:, 0])).any(axis=1)
        return _ConditionValues(value, here.value, middle, np.concatenate(most, axis=1), np.asarray(possible))

    def narrowed(self, box: Array) -> tuple[Mask, Array, Array]:
        """Which of boxes (N, n, 2) may hold a configuration; where in them; what each side changes (N, n, C)."""
        rows = self.at(box)
        slope = Interval(rows.value.slope.ends.swapaxes(0, 1))  # (N, n, C)
        within = Interval.between(-rows.tolerance, rows.tolerance)
        alive, kept, reach = narrowed_by(box, rows.at, rows.value.value, rows.middle, slope, within)
        alive &= rows.possible
        kept = np.where(alive[:, None, None], kept, box)
        C, T, S = (index.shape[1] for index in (self.two, self.directed, self.line))
        unit = np.repeat([self.size**2, 1.0, self.size], [C, T, S])
        return alive, kept, reach / unit


def whole(task: TaskData, sides: Sides) -> Array:
    """(n, 2) where joints and parameters can be; 0 for what the object's pose has."""
    root = np.zeros((len(sides.column), 2))
    root[: len(task.free)] = task.hand.limits[list(task.free)].reshape(-1, 2)
    for side, regions in ((sides.object, task.on_object), (sides.hand, task.on_hand)):
        for its, region in zip(side.columns, regions, strict=True):
            root[its[its >= 0]] = region.ends[its >= 0]
    return root


def narrowed_by(
    box: Array, at: Array, value: Interval, middle: Interval, slope: Interval, within: Interval
) -> tuple[Mask, Array, Array]:
    """Boxes (N, n, 2) where C rows are within bounds (N, C), which may be infinite: which may be, and where in them.

    And what each side changes of each row, (N, n, C).

    Args:
        value: (N, C) of the rows over the boxes. at: (N, n) points in them. middle: (N, C) of the rows there.
        slope: (N, n, C) their derivatives over the boxes.
    """
    away = Interval.between(box[..., 0], box[..., 1]) - at
    by = slope * away[..., None]
    total = by.ends.sum(axis=1)
    loss = (by.mag.sum(axis=1) * ((box.shape[1] + 4) * MACHINE_EPSILON) + UNDERFLOW_BOUND)[..., None]
    linear = middle + Interval(total + loss)
    low, high = np.fmax(value.lo, linear.lo), np.fmin(value.hi, linear.hi)
    alive = ~((low > within.hi) | (high < within.lo)).any(axis=1)
    # what a row leaves of a side when the others may be anything in the box
    rest = Interval((total + loss)[:, None] - by.ends)
    left = ((within - middle)[:, None] - rest) / slope  # (N, n, C)
    new = left + at[..., None]
    lower = np.fmax(box[..., 0], np.fmax.reduce(new.lo, axis=2))
    upper = np.fmin(box[..., 1], np.fmin.reduce(new.hi, axis=2))
    alive &= ~(lower > upper).any(axis=1)
    return np.asarray(alive), np.stack([lower, upper], axis=2), by.mag


def _cones(axes: Array) -> tuple[Array, list[float]]:
    """(2, L, 3) of the axes that are bounded: unit vectors of the palm frame, the axes; L angles [rad] between them."""
    found = []
    for axis, bounds in zip(np.eye(3), axes, strict=True):
        middle = bounds.mean(axis=1)
        length = float(np.linalg.norm(middle))
        least = float(np.minimum(middle * bounds[:, 0], middle * bounds[:, 1]).sum()) - CONE_ROUNDING
        if length > CONE_ROUNDING and least > -length:
            found.append((middle / length, axis, float(np.arccos(least / length)) + CONE_ROUNDING))
    vectors = np.array([pair for *pair, _ in found]).reshape(-1, 2, 3)
    return vectors.swapaxes(0, 1), [angle for *_, angle in found]
