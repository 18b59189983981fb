"""Candidates: certified configurations judged as grasps, and steps from one to a better one.

What is wrong with a candidate is a number, its cost: how deep the hand is in the object and in itself, and what
share of the loads no friction forces could balance. Steps along the set of solutions go where the distances
grow (`gradient`) or anywhere, and each is certified anew before it counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array
from handfast.geometry.collision import Clearances, Collisions, Push, Requested
from handfast.geometry.curvature import rim_depth
from handfast.model.grasp import Contact, Grasp
from handfast.planning.tasks.follows import contacts_at, grasp_at
from handfast.planning.tasks.gradient import Gradients
from handfast.planning.tasks.unused import Unused
from handfast.stability.loads import Loads
from handfast.stability.statics import BALANCED, CIRCUMSCRIBED, imbalance
from handfast.synthesis.answers import Solution
from handfast.synthesis.curvatures import relative_curvatures
from handfast.synthesis.problem import Problem
from handfast.synthesis.search.diverse import Walks
from handfast.synthesis.search.starts import Certified

DEEP = 0.01  # [m] of penetration that costs 1
NEAR = 1e-3  # [m] distances beyond this are not looked at in the search
AIR = 5e-4  # [m] further apart than allowed: where a step away aims
SHARES = (CIRCUMSCRIBED, 1.0, 0.6)  # of the friction: loads must balance with the first, should with the others
SLACK = 2e-3  # room to every bound below which a step does not press on it; in coordinates


class Reason(StrEnum):
    """What became of a start."""

    HOLDS = "holds"
    OBJECT = "penetrates the object"
    ITSELF = "the hand meets itself"
    CURVED = "curves into the object at a contact"
    UNBALANCED = "no friction forces balance a load"
    SLIPS = "slips passively"
    UNDECIDED = "no preload was found"
    ALIKE = "like another that holds"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A certified configuration as a grasp.

    Attributes:
        certified: the coordinates. solution: the same in SI units, with the proof.
        q: (l,) all joints, unused fingers placed.
        clearances: of the hand to the object and to itself, as far as `NEAR`.
        rim: [m] where surfaces curve into each other at a contact, how far apart they are at the edge of its disc,
            to second order: negative; 0 if none do, or if something else forbids the candidate already.
        possible: nothing forbids that it holds: free of collision, and friction forces balance every load.
        cost: what a step should lower; 0 if the loads balance with less friction too.
        contacts: object frame.
    """

    certified: Certified
    solution: Solution
    q: Array
    clearances: Clearances
    rim: float
    possible: bool
    cost: float
    contacts: tuple[Contact, ...] = field(repr=False)

    @cached_property
    def grasp(self) -> Grasp:
        """At the certified contacts, object frame; nothing commanded."""
        return grasp_at(self.solution, self.q, self.contacts)


@dataclass(frozen=True)
class Allowed:
    """How deep solids may be in each other [m]: link and object, at the requested contacts, link and link."""

    depth: float = 1e-3
    at_contacts: float = 1e-3
    self_depth: float = 1e-3


class Judge:
    """Turns certified configurations of one task into candidates."""

    def __init__(
        self, problem: Problem, collisions: Collisions, loads: Loads, friction: float, allowed: Allowed
    ) -> None:
        self.problem, self.task, self.collisions = problem, problem.task, collisions
        self.loads, self.friction, self.allowed = loads, friction, allowed
        self.unused = Unused(self.task, collisions)
        self.judged = 0

    def candidate(self, certified: Certified, below: float = np.inf) -> Candidate | None:
        """The candidate of a configuration; None if its cost is not below what is asked."""
        self.judged += 1
        solution = Solution.of(self.task, certified.existence(self.problem))
        contacts = contacts_at(solution, self.friction)
        alone = Grasp(contacts)  # statics asks for no joints
        shares = [float(imbalance(alone, self.loads.wrenches, f).max()) for f in SHARES]
        shares = [s if s > BALANCED else 0.0 for s in shares]
        if sum(shares[1:]) >= below:
            return None
        requested = requests(solution)
        clearances = self.collisions.clearances(solution.q, solution.pose, requested)
        if self._depths(self.unused.without(clearances)) / DEEP + sum(shares[1:]) >= below:
            return None
        q, clearances = self.unused.placed(solution, clearances, requested)
        depths, rim = self._depths(clearances), 0.0
        if not (depths or shares[0]):  # asked last, it is the rarest fault
            rim = -float(rim_depth(relative_curvatures(solution), self.collisions.radius).max())
            depths = max(0.0, -rim - self.allowed.at_contacts)
        cost = float(depths / DEEP + sum(shares[1:]))
        possible = not (depths or shares[0])
        return Candidate(certified, solution, q, clearances, rim, possible, cost, contacts) if cost < below else None

    def fault(self, c: Candidate) -> Reason:
        """What is wrong with a candidate that is not possible."""
        depths = {
            Reason.OBJECT: min(c.clearances.least_to_object + self.allowed.depth, 0.0),
            Reason.ITSELF: min(c.clearances.least_between + self.allowed.self_depth, 0.0),
            Reason.CURVED: min(c.clearances.least_at_contacts, c.rim) + self.allowed.at_contacts,
        }
        worst = min(depths, key=lambda r: depths[r])
        return worst if depths[worst] < 0 else Reason.UNBALANCED

    def _depths(self, c: Clearances) -> float:
        """How much deeper than allowed [m] links and pairs are, in all."""
        a = self.allowed
        over = [-c.to_object - a.depth, -c.at_contacts - a.at_contacts, -c.between - a.self_depth]
        return float(np.maximum(0.0, np.concatenate(over)).sum())


class Steps:
    """Steps from a candidate, most of them downhill."""

    def __init__(self, judge: Judge, walks: Walks, rng: np.random.Generator) -> None:
        self.judge, self.walks, self.rng = judge, walks, rng
        self.gradients = Gradients(judge.problem)

    def away(self, c: Candidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps that take apart what penetrates; [] if nothing does."""
        direction = self.direction(c)
        return [] if direction is None else self.along(c, direction, lengths)

    def along(self, c: Candidate, direction: Array, lengths: Sequence[float]) -> list[Certified]:
        """Steps along what is tangent of a direction (n,), in coordinates times the weights of `Walks`."""
        m = len(lengths)
        return self.walks.steps(np.tile(c.certified.x, (m, 1)), np.tile(direction, (m, 1)), np.array(lengths))

    def anywhere(self, c: Candidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps in random directions."""
        begin = np.tile(c.certified.x, (len(lengths), 1))
        return self.walks.steps(begin, self.rng.standard_normal(begin.shape), np.array(lengths))

    def direction(self, c: Candidate) -> Array | None:
        """(n,) downhill for the penetrations, in coordinates times the weights of `Walks`; None if there are none."""
        allowed, x = self.judge.allowed, c.certified.x
        limit = {True: AIR - allowed.depth, False: AIR - allowed.self_depth}
        g = np.zeros(len(x))
        for p in self.judge.collisions.pushes(c.q, c.solution.pose, requests(c.solution), margin=AIR):
            short = limit[p.link_b is None] - p.distance
            if short > 0:
                g += short / DEEP * self.slope(p, c)
        if not g.any():
            return None
        flat = self.judge.problem.flat
        low, high = x - flat.coordinates.lower < SLACK, flat.coordinates.upper - x < SLACK
        g = np.where((low & (g < 0)) | (high & (g > 0)), 0.0, g)
        return np.asarray(g / self.walks.weight)

    def slope(self, p: Push, c: Candidate) -> Array:
        """(n,) of the distance of two points."""
        g = self.gradients
        a = g.link(p.link_a, p.point_a, c.q)
        b = g.object(p.point_b, c.certified.x) if p.link_b is None else g.link(p.link_b, p.point_b, c.q)
        return np.asarray(p.direction @ (a - b))


def requests(solution: Solution) -> list[Requested]:
    """The contacts of a configuration, for the collision check."""
    touches = solution.task.touches
    return [Requested(t.link, p, n) for t, p, n in zip(touches, solution.points, solution.normals, strict=True)]
