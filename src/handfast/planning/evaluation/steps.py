"""Steps from one candidate to a better one, along the set of certified configurations.

They go where the distances grow (`Gradients`), off the limits (`GraspRefinement`), to where a load has no moment about
two contacts (`LineBalance`), or anywhere; each is certified anew before it counts. That a better grasp still holds is
for the caller to decide anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.geometry.collision import SeparationVector
from handfast.model.hand.coupling import drivers
from handfast.planning.evaluation.evaluator import COST_DEPTH, Evaluator, GraspCandidate, requests
from handfast.planning.filters.balance import MIN_TORQUE_ARM
from handfast.stability.problem.loads import Loads
from handfast.synthesis.search.starts import Certified, Walks
from handfast.synthesis.task_problem import TaskProblem

AIR = 5e-4  # [m] further apart than allowed: where a step away aims
BOUND_SLACK = 2e-3  # room to every bound below which a step does not press on it; in coordinates
LINE_LENGTHS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # of steps in the measure of `distance`, up to the first beyond it
LINE_ROUNDS = 40  # of steps between two that are on either side of it
ARM_TOLERANCE = 1e-14  # of the regions' distance from the origin and of each other: an arm that is none
PROPORTIONAL = 1e-12  # relative: loads that are multiples of one another
PARAMETER_STEP = 1e-6  # of a parameter, for differences


class Steps:
    """Steps from a candidate, most of them downhill."""

    def __init__(self, evaluator: Evaluator, walks: Walks, rng: np.random.Generator) -> None:
        self.evaluator, self.walks, self.rng = evaluator, walks, rng
        self.gradients = Gradients(evaluator.problem)

    def away(self, c: GraspCandidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps that take apart what penetrates; [] if nothing does."""
        direction = self.direction(c)
        return [] if direction is None else self.along(c, direction, lengths)

    def along(self, c: GraspCandidate, direction: Array, lengths: Sequence[float]) -> list[Certified]:
        """Steps along what is tangent of a direction (n,), in coordinates times the weights of `Walks`."""
        m = len(lengths)
        return self.walks.steps(np.tile(c.certified.x, (m, 1)), np.tile(direction, (m, 1)), np.array(lengths))

    def anywhere(self, c: GraspCandidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps in random directions."""
        begin = np.tile(c.certified.x, (len(lengths), 1))
        return self.walks.steps(begin, self.rng.standard_normal(begin.shape), np.array(lengths))

    def direction(self, c: GraspCandidate) -> Array | None:
        """(n,) downhill for the penetrations, in coordinates times the weights of `Walks`; None if there are none."""
        allowed, x = self.evaluator.allowed, c.certified.x
        limit = {True: AIR - allowed.depth, False: AIR - allowed.self_depth}
        g = np.zeros(len(x))
        for p in self.evaluator.collisions.separations(c.q, c.solution.pose, requests(c.solution), margin=AIR):
            short = limit[p.link_b is None] - p.distance
            if short > 0:
                g += short / COST_DEPTH * self.slope(p, c)
        if not g.any():
            return None
        flat = self.evaluator.problem.flat
        low, high = x - flat.coordinates.lower < BOUND_SLACK, flat.coordinates.upper - x < BOUND_SLACK
        g = np.where((low & (g < 0)) | (high & (g > 0)), 0.0, g)
        return np.asarray(g / self.walks.weight)

    def slope(self, p: SeparationVector, c: GraspCandidate) -> Array:
        """(n,) of the distance of two points."""
        g = self.gradients
        a = g.link(p.link_a, p.point_a, c.q)
        b = g.object(p.point_b, c.certified.x) if p.link_b is None else g.link(p.link_b, p.point_b, c.q)
        return np.asarray(p.direction @ (a - b))


# --- which way bodies come apart ---------------------------------------------------------------------


class Gradients:
    """Derivatives of distances with respect to the coordinates x (n,) of a problem."""

    def __init__(self, problem: TaskProblem) -> None:
        self.problem, hand = problem, problem.task.hand
        driven = drivers(hand)
        self._joint = np.zeros((hand.l, problem.n))  # dq/dx: drivers and the joints that mimic them
        for column, driver in enumerate(problem.free):
            for j, (first, ratio, _) in driven.items():
                if first == driver:
                    self._joint[j, column] = ratio * problem.lengths[column]
        self._pose = len(problem.free)

    def link(self, link: int, point: Array, q: Array) -> Array:
        """(3, n) of a point (3,) [m], base frame, fixed to a link of the hand at q (l,)."""
        return np.asarray(self.problem.task.hand.jacobian(link, point, q) @ self._joint)

    def object(self, point: Array, x: Array) -> Array:
        """(3, n) of a point (3,) [m], base frame, fixed to the object, at coordinates x (n,)."""
        first, unit = self._pose, self.problem.unit
        J = np.zeros((3, self.problem.n))
        J[:, first : first + 3] = unit * np.eye(3)
        arm = point - unit * x[first : first + 3]
        w, v = x[first + 3], x[first + 4 : first + 7]
        size = w * w + v @ v
        # omega = 2 vec(dq conj(q)) / |q|^2, and the point moves with omega x arm
        turn = np.zeros((3, 4))
        turn[:, 0] = -v
        turn[:, 1:] = w * np.eye(3) + np.cross(np.eye(3), v)  # the matrix of v x
        J[:, first + 3 : first + 7] = -np.cross(np.eye(3), arm) @ (2 / size * turn)
        return J


# --- a grasp that holds, made a better one -----------------------------------------------------------

QUALITY_ROUNDS = 12
LENGTHS = (0.02, 0.06, 0.15)  # of the steps, in the measure of `distance`
QUALITY_PROGRESS = 1e-3  # in the quality, at least
ENOUGH_ROOM = 0.15  # of the range between a joint's limits, or of a patch's side: more room than that is not asked for
OVERLAP_UNIT = 1e-3  # [m] of overlap, or share of friction short, that weighs as much as `ENOUGH_ROOM` of room


class GraspRefinement:
    """Improves candidates that nothing forbids.

    Args:
        value: of a candidate, to be made as large as it gets; by default room to the limits.
    """

    def __init__(
        self, evaluator: Evaluator, steps: Steps, value: Callable[[GraspCandidate], float] | None = None
    ) -> None:
        self.evaluator, self.steps, self.quality = evaluator, steps, value or self.room_quality
        problem = evaluator.problem
        self.width = problem.flat.coordinates.upper - problem.flat.coordinates.lower
        self.bounded: Mask = np.array(
            [
                k.startswith("joint:") or (k.startswith("contact:") and w <= 1.0)
                for k, w in zip(problem.labels, self.width, strict=True)
            ]
        )

    def refined(self, c: GraspCandidate) -> GraspCandidate:
        """The best candidate on the way, which may be the first."""
        now, least, fails = c, self.quality(c) + QUALITY_PROGRESS, 0
        for round_ in range(QUALITY_ROUNDS):
            inwards = self.inwards(now) if round_ % 2 == 0 else None
            new = self.steps.anywhere(now, LENGTHS) if inwards is None else self.steps.along(now, inwards, LENGTHS)
            found = [k for k in (self.evaluator.candidate(x) for x in new) if k and k.possible]
            value, best = max(((self.quality(k), k) for k in found), key=lambda of: of[0], default=(-np.inf, now))
            if value > least:
                now, least, fails = best, value + QUALITY_PROGRESS, 0
            else:
                fails += 1
                if fails == 4:
                    break
        return now

    def room_quality(self, c: GraspCandidate) -> float:
        """Room to the limits, up to enough of it, less overlap and friction that is missing at a smaller share."""
        overlap = min(c.clearances.least_to_object, c.clearances.least_between, 0.0)
        return (
            min(float(self.room(c).min(initial=ENOUGH_ROOM)), ENOUGH_ROOM) / ENOUGH_ROOM
            + overlap / OVERLAP_UNIT
            - c.cost
        )

    def room(self, c: GraspCandidate) -> Array:
        """Distance of each bounded coordinate to its nearer bound, as a share of its range."""
        flat, x = self.evaluator.problem.flat, c.certified.x
        room = np.minimum(x - flat.coordinates.lower, flat.coordinates.upper - x)[self.bounded]
        return np.asarray(room / self.width[self.bounded])

    def inwards(self, c: GraspCandidate) -> Array | None:
        """(n,) away from the bounds that are near, in coordinates times the weights of `Walks`; None if none is."""
        flat, x = self.evaluator.problem.flat, c.certified.x
        g = np.zeros(len(x))
        short = np.maximum(0.0, ENOUGH_ROOM - self.room(c))
        middle = (flat.coordinates.lower + flat.coordinates.upper)[self.bounded] / 2
        g[self.bounded] = short * np.sign(middle - x[self.bounded]) / self.width[self.bounded]
        return np.asarray(g / self.steps.walks.weight) if g.any() else None


# --- two contacts under a load ---


class LineBalance:
    """The equation of two contacts, and its solution.

    Forces at two points have no moment about the line between them, so the load must have none. That is an equation of
    the task beside those of the contacts, which random starts and steps never meet. It is solved along a step on the
    set of certified configurations, by regula falsi and bisection on the step's length.

    Attributes:
        load: (6,) of which all loads are multiples; None if there is no such equation to solve.
    """

    def __init__(self, walks: Walks, loads: Loads) -> None:
        self.walks, self.load = walks, None
        pairs = walks.problem.task.contact_pairs
        self.regions = [pair.object for pair in pairs]
        largest = loads.wrenches[np.abs(loads.wrenches).max(axis=1).argmax()]
        shares = loads.wrenches @ largest / (largest @ largest)
        rest = np.abs(loads.wrenches - shares[:, None] * largest).max()
        if len(pairs) == 2 and largest[:3].any() and rest <= PROPORTIONAL * np.abs(largest).max():
            self.load = largest / np.linalg.norm(largest[:3])
        labels = walks.problem.labels
        self.columns = [labels.index(f"contact:{k}:{name}") for k in range(len(pairs)) for name in "st"]
        self.size = max(region.outermost for region in self.regions)

    def arm(self, parameters: Array) -> float:
        """[m] of the load about the line through both contacts, at the parameters (4,) of their regions."""
        first, second = (r.at(*parameters[2 * k : 2 * k + 2]) for k, r in enumerate(self.regions))
        turn = second - first
        assert self.load is not None
        moment = self.load[:3] @ np.cross(first, second) + self.load[3:] @ turn
        return float(moment / max(float(np.linalg.norm(turn)), MIN_TORQUE_ARM))

    def balanced(self, certified: Certified) -> Certified:
        """Near a certified configuration one without an arm; itself where none is found or no equation is to solve."""
        if self.load is None:
            return certified
        here = certified.x[self.columns]
        low, at_low, high, at_high = 0.0, self.arm(here), 0.0, 0.0
        if abs(at_low) <= ARM_TOLERANCE * self.size:
            return certified
        sides = PARAMETER_STEP * np.eye(4)
        slope = np.zeros(len(certified.x))
        slope[self.columns] = [(self.arm(here + d) - self.arm(here - d)) / (2 * PARAMETER_STEP) for d in sides]
        direction = -np.sign(at_low) * slope / self.walks.weight
        for length in LINE_LENGTHS:
            found = self._step(certified, direction, length)
            if found is None:
                return certified
            value = self.arm(found.x[self.columns])
            if value * at_low <= 0:
                high, at_high = length, value
                break
            low, at_low = length, value
        for k in range(LINE_ROUNDS if high else 0):
            between = (low + high) / 2 if k % 4 == 3 else high - at_high * (high - low) / (at_high - at_low)
            found = self._step(certified, direction, between)
            if found is None:
                return certified
            value = self.arm(found.x[self.columns])
            if abs(value) <= ARM_TOLERANCE * self.size:
                return found
            if value * at_low > 0:
                low, at_low = between, value
            else:
                high, at_high = between, value
        return certified

    def _step(self, certified: Certified, direction: Array, length: float) -> Certified | None:
        found = self.walks.steps(certified.x[None], direction[None], np.array([length]))
        return found[0] if found else None
