"""Certified configurations evaluated as grasps.

What is wrong with a candidate is a number, its cost: how deep the hand is in the object and in itself, and what
share of the loads no friction forces could balance.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.geometry.collision import Clearances, Collisions, Requested
from handfast.geometry.curvature import rim_depth
from handfast.model.grasp import Contact, Grasp
from handfast.planning.evaluation.derived import contacts_at, grasp_at
from handfast.planning.filters.balance import CIRCUMSCRIBED, imbalance
from handfast.planning.filters.non_contacting import NonContactingFingers
from handfast.planning.rejection import RejectionReason
from handfast.stability.loads import Loads
from handfast.synthesis.curvatures import relative_curvatures
from handfast.synthesis.search.starts import Certified
from handfast.synthesis.solution import Solution
from handfast.synthesis.task_problem import TaskProblem

DEEP = 0.01  # [m] of penetration that costs 1
NEAR = 1e-3  # [m] distances beyond this are not looked at in the search
SHARES = (CIRCUMSCRIBED, 1.0, 0.6)  # of the friction: loads must balance with the first, should with the others


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """A certified configuration as a grasp.

    Attributes:
        certified: the coordinates. solution: the same in SI units, with the proof.
        q: (l,) all joints, those of non-contacting fingers placed.
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
    """How deep solids may be in each other [m]: link and object, at the requested contacts, link and link.

    Raises:
        InputError: a depth below 0, or none.
    """

    depth: float = 1e-3
    at_contacts: float = 1e-3
    self_depth: float = 1e-3

    def __post_init__(self) -> None:
        for field_, value in vars(self).items():
            if not value >= 0:
                raise InputError(f"is {value:g} m; 0 or more is needed", field=field_)


class Evaluator:
    """Turns certified configurations of one task into candidates."""

    def __init__(
        self, problem: TaskProblem, collisions: Collisions, loads: Loads, friction: float, allowed: Allowed
    ) -> None:
        self.problem, self.task, self.collisions = problem, problem.task, collisions
        self.loads, self.friction, self.allowed = loads, friction, allowed
        self.fingers = NonContactingFingers(self.task, collisions)
        self.evaluated = 0

    def candidate(self, certified: Certified, below: float = np.inf) -> GraspCandidate | None:
        """The candidate of a configuration; None if its cost is not below what is asked."""
        self.evaluated += 1
        solution = Solution.of(self.task, certified.existence(self.problem))
        contacts = contacts_at(solution, self.friction)
        alone = Grasp(contacts)  # statics asks for no joints
        shares = [float(imbalance(alone, self.loads.wrenches, f).max()) for f in SHARES]
        if sum(shares[1:]) >= below:
            return None
        requested = requests(solution)
        clearances = self.collisions.clearances(solution.q, solution.pose, requested)
        if self._depths(self.fingers.without(clearances)) / DEEP + sum(shares[1:]) >= below:
            return None
        q, clearances = self.fingers.placed(solution, clearances, requested)
        depths, rim = self._depths(clearances), 0.0
        if not (depths or shares[0]):  # asked last, it is the rarest fault
            rim = -float(rim_depth(relative_curvatures(solution), self.collisions.radius).max())
            depths = max(0.0, -rim - self.allowed.at_contacts)
        cost = float(depths / DEEP + sum(shares[1:]))
        possible = not (depths or shares[0])
        return (
            GraspCandidate(certified, solution, q, clearances, rim, possible, cost, contacts) if cost < below else None
        )

    def rejection(self, c: GraspCandidate) -> RejectionReason:
        """What is wrong with a candidate that is not possible."""
        depths = {
            RejectionReason.OBJECT: min(c.clearances.least_to_object + self.allowed.depth, 0.0),
            RejectionReason.ITSELF: min(c.clearances.least_between + self.allowed.self_depth, 0.0),
            RejectionReason.CURVED: min(c.clearances.least_at_contacts, c.rim) + self.allowed.at_contacts,
        }
        worst = min(depths, key=lambda r: depths[r])
        return worst if depths[worst] < 0 else RejectionReason.UNBALANCED

    def _depths(self, c: Clearances) -> float:
        """How much deeper than allowed [m] links and pairs are, in all."""
        a = self.allowed
        over = [-c.to_object - a.depth, -c.at_contacts - a.at_contacts, -c.between - a.self_depth]
        return float(np.maximum(0.0, np.concatenate(over)).sum())


def requests(solution: Solution) -> list[Requested]:
    """The contacts of a configuration, for the collision check."""
    return [
        Requested(t.link, p, n)
        for t, p, n in zip(solution.task.contact_pairs, solution.points, solution.normals, strict=True)
    ]
