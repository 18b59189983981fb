"""Wrenches in one unit: how torques are compared with forces, and the wrenches of the edges of friction cones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import cross
from handfast.model.grasp import Grasp

WRENCH_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True, eq=False)
class WrenchScale:
    """Wrenches as six numbers of one unit, N: the force, and the torque about a point divided by a length.

    A measure that is the size of a set of wrenches depends on both choices. Ferrari and Canny (1992) leave the
    length open; Li and Sastry (1988) and Pollard (1994) take one of the object's size.

    Attributes:
        about: (3,) [m] the point, object frame.
        length: [m] the characteristic length.
    """

    about: Array
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "about", frozen(self.about, (3,), "about"))
        if not (np.isfinite(self.length) and self.length > 0):
            raise InputError(f"is {self.length:g}; a length above 0 [m] is needed", field="length")

    @classmethod
    def of(cls, grasp: Grasp, about: object = None, length: float | None = None) -> WrenchScale:
        """The scale of a grasp.

        Args:
            about: (3,) [m]; the centre of mass if the grasp knows it, otherwise the middle of the contacts.
            length: [m]; the largest distance of a contact from that point, as GraspIt! has it.

        Raises:
            InputError: a point that is not three finite numbers, or a length that is not above 0.
        """
        if about is None:
            known = grasp.center_of_mass
            about = grasp.middle if known is None else known
        point = frozen(about, (3,), "about")
        if length is None:
            farthest = float(np.linalg.norm(grasp.positions - point, axis=1).max())
            length = farthest if farthest > 1e-9 else 1.0
        return cls(point, float(length))

    def scaled(self, wrenches: Array) -> Array:
        """(6, ...) wrenches at the object's origin [N, N m] as six numbers of one unit [N]."""
        force, torque = wrenches[:3], wrenches[3:]
        moved = torque - np.cross(self.about, force, axisb=0, axisc=0)
        return np.concatenate([force, moved / self.length])

    def wrench(self, scaled: Array) -> Array:
        """(6,) [N, N m] the wrench at the object's origin behind six numbers of one unit."""
        out: Array = np.r_[scaled[:3], self.length * scaled[3:] + cross(self.about, scaled[:3])]
        return out

    def grasp_map(self, grasp: Grasp) -> Array:
        """(6, 3m) the grasp map of contact forces (n, t1, t2 each) in this scale."""
        return self.scaled(grasp.G)

    def axes(self) -> tuple[tuple[str, ...], Array]:
        """Twelve wrenches that are units here: names, and (12, 6) [N, N m] at the object's origin.

        Forces through the point along the object's axes both ways, then torques about them.
        """
        units = np.repeat(np.eye(6), 2, axis=0)
        units[1::2] *= -1
        names = tuple(f"{kind} {axis}" for kind in ("force", "torque") for axis in WRENCH_AXES)
        return names, np.array([self.wrench(u) for u in units]) + 0.0  # no -0


CONE_EDGES = 8  # of a cone, as in GraspIt! and the benchmarks of dexterous grasps
MIN_CONE_EDGES, MAX_CONE_EDGES = 3, 64


def edge_forces(mu: float, edges: int) -> Array:
    """(edges, 3) contact forces (n, t1, t2) along the edges of a cone's pyramid, each with normal part 1.

    The pyramid lies inside the cone; its first edge leans towards t1.

    Raises:
        InputError: fewer than 3 edges, or more than 64.
    """
    if not MIN_CONE_EDGES <= edges <= MAX_CONE_EDGES:
        raise InputError(
            f"is {edges}; {MIN_CONE_EDGES} to {MAX_CONE_EDGES} edges of a friction cone are possible", field="edges"
        )
    angle = 2 * np.pi * np.arange(edges) / edges
    return np.column_stack([np.ones(edges), mu * np.cos(angle), mu * np.sin(angle)])


def edge_wrenches(grasp: Grasp, scale: WrenchScale, edges: int = CONE_EDGES) -> Array:
    """(m, edges, 6) wrenches of these forces at each contact, in a scale."""
    maps = scale.grasp_map(grasp).T.reshape(grasp.m, 3, 6)
    return np.array([edge_forces(mu, edges) @ part for mu, part in zip(grasp.mu, maps, strict=True)])
