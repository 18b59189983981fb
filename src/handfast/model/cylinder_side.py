"""Parts of the sides of cylinders and cones: of a handle, a can, a finger's shaft, a cup."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, require_positive
from handfast.core.schema import Vector3
from handfast.model.region import MIN_DIRECTION_LENGTH, Region, unit_direction

FARTHEST_TURN = 100.0  # [rad]
FULL_TURN = 2 * np.pi * (1 + 1e-12)  # [rad] with room for a file's rounding


class RoundSide(Region):
    """Part of the side of a cylinder or a cone: what both have in common.

    The parameters u and v go from 0 to 1 over the angles and over the heights.

    Attributes:
        center: (3,) [m] a point of the axis, where the height is 0; frame of the link or object.
        radii: [m] at the lowest and at the highest height.
        axis: (3,) unit, the way in which heights grow.
        x_axis: (3,) unit, across the axis: the direction in which the angle is 0. What is given need only not be
            parallel to the axis; angles grow counterclockwise as seen from the tip of the axis.
        angles: [rad] the first and the last, at most a full turn apart, within 100 rad.
        heights: [m] the lowest and the highest.
        flip: the outward normal points to the axis (a hollow) instead of away from it.

    Raises:
        InputError: directions of no length or parallel ones, ranges that are empty, not finite, or more than a full
            turn.
    """

    center: Array
    axis: Array
    x_axis: Array
    angles: tuple[float, float]
    heights: tuple[float, float]

    radii: Any  # of a cylinder's side a property
    _radii: ClassVar[str]  # the field that gives them

    def __post_init__(self) -> None:
        def put(name: str, value: object) -> None:
            object.__setattr__(self, name, value)

        put("center", frozen(self.center, (3,), "center"))
        for radius in self.radii:
            require_positive(radius, self._radii, "it must be positive [m]")
        axis = unit_direction(self.axis, "axis")
        across = unit_direction(self.x_axis, "x_axis")
        across = across - axis * (axis @ across)
        if np.linalg.norm(across) < MIN_DIRECTION_LENGTH:
            raise InputError("is parallel to axis; a direction across it is needed", field="x_axis")
        put("axis", frozen(axis, (3,), "axis"))
        put("x_axis", unit_direction(across, "x_axis"))
        for name, unit in (("angles", "rad"), ("heights", "m")):
            lo, hi = frozen(getattr(self, name), (2,), name).tolist()
            if not lo < hi:
                problem = f"is [{lo:g}, {hi:g}]; the lower one comes first [{unit}]"
                raise InputError(problem, field=name)
            put(name, (lo, hi))
        if not self.turn <= FULL_TURN:
            problem = f"is {self.turn:g} wide; a full turn is {2 * np.pi:.9g} [rad]"
            raise InputError(problem, field="angles")
        if max(map(abs, self.angles)) > FARTHEST_TURN:  # whose sines lose the digits that proofs need
            problem = (
                f"is [{self.angles[0]:g}, {self.angles[1]:g}]; at most {FARTHEST_TURN:g} rad either way is possible"
            )
            raise InputError(problem, field="angles")

    @property
    def turn(self) -> float:
        """[rad] from the first to the last angle."""
        return self.angles[1] - self.angles[0]

    @property
    def length(self) -> float:
        """[m] from the lowest to the highest."""
        return self.heights[1] - self.heights[0]

    @property
    def growth(self) -> float:
        """[m] of the radius, from the lowest to the highest."""
        return self.radii[1] - self.radii[0]

    @property
    def slant(self) -> float:
        """[m] from the lowest to the highest, along the side."""
        return float(np.hypot(self.length, self.growth))

    @cached_property
    def frame(self) -> Array:
        """(3, 3) rotation with the columns x_axis, the direction of a right angle, and axis."""
        columns = [self.x_axis, np.cross(self.axis, self.x_axis), self.axis]
        return frozen(np.column_stack(columns), (3, 3), "frame")

    def at(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        u, v = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(v, dtype=float))
        angle = self.angles[0] + self.turn * u + du * np.pi / 2  # a wave's derivative is a quarter ahead
        height = {(0, 0): self.heights[0] + self.length * v, (0, 1): self.length}.get((du, dv), 0.0)
        around = {0: self.radii[0] + self.growth * v, 1: self.growth}.get(dv, 0.0) * self.turn**du
        local = np.stack([around * np.cos(angle), around * np.sin(angle), height + 0 * v], axis=-1)
        out: Array = local @ self.frame.T
        return self.center + out if du == dv == 0 else out

    @property
    def amid(self) -> Array:
        middle: Array = self.center + sum(self.heights) / 2 * self.axis
        return middle

    @property
    def outermost(self) -> float:
        ends = zip(self.heights, self.radii, strict=True)
        return max(float(np.linalg.norm(self.center + height * self.axis)) + radius for height, radius in ends)

    @property
    def extent(self) -> float:
        across = max(self.radii) * float(np.sin(min(self.turn / 2, np.pi / 2)))
        return min(across, self.slant / 2)

    @property
    def longest_normal(self) -> float:
        return max(self.radii) * self.turn * self.slant

    def derivative_bounds(self, cells: int) -> tuple[Array, Array]:
        """Everywhere the same: the point goes round on a circle, and straight along the side."""
        around, shape = np.array([self.turn, 0.0, self.turn**2, 0.0, 0.0]), (cells, cells, 5)
        along = np.array([0.0, self.slant, 0.0, abs(self.growth) * self.turn, 0.0])
        normal = self.length / self.slant * around
        return np.broadcast_to(max(self.radii) * around + along, shape).copy(), np.broadcast_to(normal, shape).copy()


@dataclass(frozen=True, eq=False)
class CylinderSide(RoundSide):
    """The points of a cylinder's side within ranges of the angle about its axis and of the height along it.

    Attributes:
        center, axis, x_axis, angles, heights, flip: see `RoundSide`.
        radius: [m].

    Raises:
        InputError: a radius that is not positive, and what `RoundSide` refuses.
    """

    kind, _radii = "cylinder_side", "radius"

    center: Vector3
    radius: float
    axis: Vector3
    x_axis: Vector3
    angles: tuple[float, float]
    heights: tuple[float, float]
    flip: bool = False

    @property
    def radii(self) -> tuple[float, float]:
        return self.radius, self.radius


@dataclass(frozen=True, eq=False)
class ConeSide(RoundSide):
    """The points of a cone's side, without its tip, within ranges of the angle about its axis and the height along it.

    Attributes:
        center, axis, x_axis, angles, heights, flip: see `RoundSide`.
        radii: [m] at the lowest and at the highest height.

    Raises:
        InputError: a radius that is not positive, and what `RoundSide` refuses.
    """

    kind, _radii = "cone_side", "radii"

    center: Vector3
    radii: tuple[float, float]
    axis: Vector3
    x_axis: Vector3
    angles: tuple[float, float]
    heights: tuple[float, float]
    flip: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", tuple(frozen(self.radii, (2,), "radii").tolist()))
        super().__post_init__()
