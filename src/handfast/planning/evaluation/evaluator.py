"""Certified configurations evaluated as grasps.

What is wrong with a candidate is a number, its cost: how deep the hand is in the object and in itself, and what
share of the loads no friction forces could balance. What follows from one that holds (`Derived`) is said by the search
and again by the replay of a file: what differs is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.geometry.collision import Clearances, Collisions, Requested
from handfast.geometry.contacts import grasp_of
from handfast.geometry.curvature import rim_depth
from handfast.geometry.dexterity import Dexterity, dexterity
from handfast.model.configuration import Configuration
from handfast.model.grasp import Contact, Grasp
from handfast.planning.filters.balance import circumscribed, friction_margin, imbalance
from handfast.planning.filters.non_contacting import NonContactingFingers
from handfast.planning.question import Allowed
from handfast.planning.search import RejectionReason
from handfast.stability.problem.loads import Loads
from handfast.synthesis.search.starts import Certified
from handfast.synthesis.solution import Solution, relative_curvatures
from handfast.synthesis.task_problem import TaskProblem

COST_DEPTH = 0.01  # [m] of penetration that costs 1
EVALUATION_CUTOFF = 1e-3  # [m] distances beyond this are not looked at in the search
FRICTION_SHARES = (1.0, 0.6)  # of the friction with which loads should balance, beside that with which they must


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """A certified configuration as a grasp.

    Attributes:
        certified: the coordinates. solution: the same in SI units, with the proof.
        q: (l,) all joints, those of non-contacting fingers placed.
        clearances: of the hand to the object and to itself, as far as `EVALUATION_CUTOFF`.
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


class Evaluator:
    """Turns certified configurations of one task into candidates."""

    def __init__(
        self,
        problem: TaskProblem,
        collisions: Collisions,
        loads: Loads,
        friction: float,
        allowed: Allowed,
        torsion: float = 0.0,
    ) -> None:
        self.problem, self.task, self.collisions = problem, problem.task, collisions
        self.loads, self.friction, self.torsion, self.allowed = loads, friction, torsion, allowed
        self.shares = (circumscribed(soft=torsion > 0), *FRICTION_SHARES)
        self.fingers = NonContactingFingers(self.task, collisions)
        self.evaluated = 0

    def candidate(self, certified: Certified, below: float = np.inf) -> GraspCandidate | None:
        """The candidate of a configuration; None if its cost is not below what is asked."""
        self.evaluated += 1
        solution = Solution.of(self.task, certified.existence(self.problem))
        contacts = contacts_at(solution, self.friction, self.torsion)
        alone = Grasp(contacts)  # statics asks for no joints
        shares = [float(imbalance(alone, self.loads.wrenches, f).max()) for f in self.shares]
        if sum(shares[1:]) >= below:
            return None
        requested = requests(solution)
        clearances = self.collisions.clearances(solution.q, solution.pose, requested)
        if self._depths(self.fingers.without(clearances)) / COST_DEPTH + sum(shares[1:]) >= below:
            return None
        q, clearances = self.fingers.placed(solution, clearances, requested)
        depths, rim = self._depths(clearances), 0.0
        if not (depths or shares[0]):  # asked last, it is the rarest fault
            rim = -float(rim_depth(relative_curvatures(solution), self.collisions.radius).max())
            depths = max(0.0, -rim - self.allowed.at_contacts)
        cost = float(depths / COST_DEPTH + sum(shares[1:]))
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


# --- what follows from a certified configuration -----------------------------------------------------


def requests(solution: Solution) -> list[Requested]:
    """The contacts of a configuration, for the collision check."""
    return [
        Requested(t.link, p, n)
        for t, p, n in zip(solution.task.contact_pairs, solution.points, solution.normals, strict=True)
    ]


def contacts_at(solution: Solution, friction: float, torsion: float = 0.0) -> tuple[Contact, ...]:
    """The certified contacts, object frame; torsion: [m] of soft fingers."""
    R, p = solution.pose[:3, :3], solution.pose[:3, 3]
    points, normals = (solution.points - p) @ R, solution.normals @ R
    links = [pair.link for pair in solution.task.contact_pairs]
    how = {"torsion": torsion}
    return tuple(Contact(x, n, friction, link, **how) for x, n, link in zip(points, normals, links, strict=True))


def grasp_at(solution: Solution, q: Array, contacts: Sequence[Contact]) -> Grasp:
    """The grasp of the task's hand at q (l,), object frame; nothing commanded."""
    task = solution.task
    return grasp_of(task.hand, q, contacts, solution.pose, name=task.name or None)


@dataclass(frozen=True, eq=False)
class Derived:
    """What is said of a grasp beside its proofs, computed from the configuration, the preload and the loads alone.

    Attributes:
        configuration: as a file, with the preload.
        preload: actuator -> command [N m or N], 0 is locked.
        friction_margin: share of the friction without which forces could still balance every load.
        curvatures: (b,) [1/m] relative curvature at the contacts, negative where they curve into each other.
        dexterity: manipulability and distance to the joint limits.
    """

    configuration: Configuration
    preload: Mapping[str, float]
    friction_margin: float
    curvatures: Array
    dexterity: Dexterity

    @classmethod
    def of(cls, solution: Solution, q: Array, grasp: Grasp, preload: Mapping[str, float], loads: Loads) -> Derived:
        """Of a grasp (`grasp_at`, with its preload) at joints q (l,)."""
        task = solution.task
        named = {"hand": task.hand.source or task.hand.name, "object": task.object}
        return cls(
            Configuration.of(task.hand, q, solution.pose, preload=grasp.preload or None, **named),
            preload,
            friction_margin(grasp, loads.wrenches),
            relative_curvatures(solution),
            dexterity(task.hand, q, [t.link for t in task.contact_pairs], solution.points, grasp),
        )

    @property
    def command(self) -> float:
        """The largest command [N m or N]."""
        return max(map(abs, self.preload.values()), default=0.0)

    def to_json(self) -> dict[str, Any]:
        return {
            "preload": dict(self.preload),
            "upper": self.command,
            "configuration": self.configuration.model_dump(by_alias=True, exclude_none=True, mode="json"),
            "spare_friction": self.friction_margin,
            "curvatures": self.curvatures.tolist(),
            "dexterity": self.dexterity.to_json(),
        }
