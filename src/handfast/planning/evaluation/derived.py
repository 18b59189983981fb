"""What follows from a certified configuration: its contacts, its grasp, and all that is said of that without a search.

The search says it with these functions, and the replay of a file says it again: what differs is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from handfast.core.arrays import Array
from handfast.geometry.contacts import grasp_of
from handfast.geometry.dexterity import Dexterity, dexterity
from handfast.model.configuration import Configuration
from handfast.model.grasp import Contact, Grasp
from handfast.planning.filters.balance import friction_margin
from handfast.stability.loads import Loads
from handfast.synthesis.curvatures import relative_curvatures
from handfast.synthesis.solution import Solution


def contacts_at(solution: Solution, friction: float) -> tuple[Contact, ...]:
    """The certified contacts, object frame."""
    R, p = solution.pose[:3, :3], solution.pose[:3, 3]
    points, normals = (solution.points - p) @ R, solution.normals @ R
    links = [pair.link for pair in solution.task.contact_pairs]
    return tuple(Contact(x, n, friction, link) for x, n, link in zip(points, normals, links, strict=True))


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
