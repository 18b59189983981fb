"""Regions of a surface that are to touch: what every kind knows, Bezier patches of any degree, spherical caps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import FaultsOf, InputError, require_positive
from handfast.core.schema import InFiles, Vector3, written
from handfast.core.transforms import cross_rows, normal_frame
from handfast.model.bernstein import (
    differences,
    evaluate,
    hull_box,
    largest_derivatives,
    least_length,
    product,
    restrict,
)

MAX_PATCH_HALVINGS = 6  # halvings in each parameter before a patch whose normal cannot be told from zero is refused
MIN_DIRECTION_LENGTH = 1e-9  # length of a direction below which it is none
VANISHES = 1e-9  # a normal this much shorter than the longest one is none


def unit_direction(vector: object, field: str) -> Array:
    """(3,) of length 1; `InputError` if it has none."""
    a = frozen(vector, (3,), field)
    length = float(np.linalg.norm(a))
    if length < MIN_DIRECTION_LENGTH:
        raise InputError("is zero; a direction is needed", field=field)
    return frozen(a / length, (3,), field)


class Region(InFiles, ABC):
    """A surface with outward normals over two parameters, in the frame of the link or object that carries it.

    Each kind of region is a subclass: a frozen dataclass, which refuses bad numbers with `InputError`.

    Attributes:
        kind: its key in files, where what stands under it are its numbers.
        flip: the outward normals point to the other side.
    """

    kind: ClassVar[str]
    flip: bool

    @classmethod
    def of(cls, numbers: Any, flip: bool) -> Self:
        """From the numbers that a file has for it; the inverse of `numbers`. `InputError` names the field."""
        from handfast.core.files import validate  # pydantic, slow to import

        with FaultsOf(field=cls.kind):
            if "flip" in numbers:
                raise InputError("stands beside the region, not in it", field="flip")
            return validate(cls, numbers | {"flip": flip})

    def numbers(self) -> Any:
        """All of it but `flip`, as JSON-able data."""
        return {name: value for name, value in written(self).items() if name != "flip"}

    @property
    def sign(self) -> float:
        """-1 if the normals are flipped, else 1."""
        return -1.0 if self.flip else 1.0

    @property
    def ball(self) -> Cap | None:
        """The region itself if it is part of a sphere, where a contact on a hand needs no parameters but the normal."""
        return None

    # --- the surface ------------------------------------------------------------------------------

    @property
    def bounds(self) -> Array:
        """(2, 2) lower and upper end of each parameter; over these each point is there once, but for edges."""
        return np.array([[0.0, 1.0], [0.0, 1.0]])

    @property
    def search_bounds(self) -> Array:
        """(2, 2) the same for a search: a parameter that goes all around goes further, so that it meets no end."""
        return self.bounds

    @abstractmethod
    def at(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        """(..., 3) [m] the derivative of order (du, dv) at parameters u, v of one shape; the point for (0, 0)."""

    def normal(self, u: object, v: object) -> Array:
        """(..., 3) outward normal, not normalised: p_u x p_v (2), reversed if flipped."""
        return self.sign * cross_rows(self.at(u, v, 1, 0), self.at(u, v, 0, 1))

    def outward(self, u: object, v: object) -> Array:
        """(..., 3) outward unit normal."""
        normal = self.normal(u, v)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    @property
    def middle(self) -> tuple[Array, Array]:
        """The point (3,) [m] in its middle and the outward unit normal (3,) there."""
        u, v = self.bounds.mean(axis=1).tolist()
        return self.at(u, v), self.outward(u, v)

    # --- its size ---------------------------------------------------------------------------------

    @property
    @abstractmethod
    def amid(self) -> Array:
        """(3,) [m] a point amid the region, on it or not."""

    @property
    @abstractmethod
    def outermost(self) -> float:
        """[m] no point of the region lies farther from the origin of its frame."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """[m] half of its width, roughly."""

    @property
    @abstractmethod
    def longest_normal(self) -> float:
        """No value of `normal` is longer."""

    @abstractmethod
    def derivative_bounds(self, cells: int) -> tuple[Array, Array]:
        """Bounds in each of cells x cells equal parts of its parameters, over `bounds`.

        Returns:
            (cells, cells, 5) of |p_u|, |p_v|, |p_uu|, |p_uv|, |p_vv| [m], and the same of the unit normal.
        """


@dataclass(frozen=True, eq=False)
class Bezier(Region):
    """A Bezier patch p(u, v), 0 <= u, v <= 1, of degree M x N (synthesis paper, equation (3)).

    Attributes:
        points: (M+1, N+1, 3) [m] control points in the frame of the link or object that carries it.
        flip: the outward normal is -(p_u x p_v) instead of p_u x p_v (2).

    Raises:
        InputError: fewer than 2 x 2 points, not finite, or a normal that vanishes somewhere.
    """

    kind = "bezier"

    points: Array
    flip: bool = False

    @classmethod
    def of(cls, numbers: Any, flip: bool) -> Self:
        return cls(np.array(numbers), flip)

    def numbers(self) -> Any:
        return self.points.tolist()

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if len(shape) != 3 or shape[2] != 3 or min(shape[:2]) < 2:
            raise InputError(
                f"has points of shape {shape}; at least 2 x 2 points of three coordinates are needed", field="bezier"
            )
        object.__setattr__(self, "points", frozen(self.points, shape, "bezier"))
        self._refuse_degenerate()

    @property
    def degree(self) -> tuple[int, int]:
        """(M, N)."""
        return self.points.shape[0] - 1, self.points.shape[1] - 1

    def at(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        """(..., 3) the derivative of p of order (du, dv) at parameters u, v of one shape; p itself for (0, 0)."""
        return evaluate(differences(self.points, du, dv), u, v)

    @cached_property
    def normal_points(self) -> Array:
        """(2M, 2N, 3) control points of the outward normal as a patch of degree (2M-1) x (2N-1) (19)."""
        return self.sign * product(differences(self.points, 1, 0), differences(self.points, 0, 1))

    def restricted(self, u: tuple[float, float], v: tuple[float, float]) -> Bezier:
        """The part over a rectangle of parameters, its own parameters again from 0 to 1."""
        return Bezier(restrict(self.points, u, v), self.flip)

    def enclosure(self) -> Array:
        """(2, 3) [m] lower and upper corner of a box that holds the patch (convex hull property)."""
        return hull_box(self.points)

    @property
    def amid(self) -> Array:
        middle: Array = self.points.reshape(-1, 3).mean(axis=0)
        return middle

    @property
    def outermost(self) -> float:
        return float(np.linalg.norm(self.points, axis=2).max())

    @property
    def extent(self) -> float:
        across = [np.linalg.norm(self.at(*a) - self.at(*b)) for a, b in (((0, 0.5), (1, 0.5)), ((0.5, 0), (0.5, 1)))]
        return float(min(across)) / 2

    @property
    def longest_normal(self) -> float:
        return float(np.linalg.norm(self.normal_points, axis=2).max())

    def derivative_bounds(self, cells: int) -> tuple[Array, Array]:
        """From Bernstein coefficients: a polynomial lies in the hull of them.

        With n the normal, not normalised, and f' and f'' its derivatives, those of n / |n| are at most |f'| / |n| and
        |f''| / |n| + (2 / sqrt 3) |f'|^2 / |n|^2 (mixed ones alike).
        """
        surface, normal = np.zeros((2, cells, cells, 5))
        cuts = list(pairwise(np.linspace(0, 1, cells + 1).tolist()))
        curve = 2 / np.sqrt(3)
        for i, j in np.ndindex(cells, cells):
            points, n = (restrict(p, cuts[i], cuts[j]) for p in (self.points, self.normal_points))
            surface[i, j], least = largest_derivatives(points, cells), least_length(n)
            f = largest_derivatives(n, cells) / least
            normal[i, j] = f + curve * np.array([0, 0, f[0] ** 2, f[0] * f[1], f[1] ** 2])
        return surface, normal

    def _refuse_degenerate(self) -> None:
        """Raise unless the normal is shown to vanish nowhere, by the convex hull of its control points."""
        normal = self.normal_points
        longest = np.linalg.norm(normal, axis=2).max()
        todo = [((0.0, 1.0), (0.0, 1.0), normal, 0)]
        while todo:
            u, v, n, depth = todo.pop()
            along = n.reshape(-1, 3).mean(axis=0)
            size = np.linalg.norm(along)
            if size > 0 and (n @ along).min() > VANISHES * longest * size:
                continue
            if depth == MAX_PATCH_HALVINGS:
                spot = f"near u = {sum(u) / 2:.3g}, v = {sum(v) / 2:.3g}"
                problem = "an edge or a corner collapses, or its sides are parallel"
                raise InputError(f"is degenerate: the normal vanishes {spot} ({problem})", field="bezier")
            (u0, u1), (v0, v1) = u, v
            um, vm = (u0 + u1) / 2, (v0 + v1) / 2
            for a, b in ((0.0, 0.5), (0.5, 1.0)):
                for c, d in ((0.0, 0.5), (0.5, 1.0)):
                    part = restrict(n, (a, b), (c, d))
                    wide = (u0, um) if a == 0 else (um, u1)
                    high = (v0, vm) if c == 0 else (vm, v1)
                    todo.append((wide, high, part, depth + 1))


@dataclass(frozen=True, eq=False)
class Cap(Region):
    """A spherical cap: the points of a sphere within an angle of an axis.

    Attributes:
        center: (3,) [m] of the sphere, frame of the link or object.
        radius: [m].
        axis: (3,) unit, from the centre to the middle of the cap.
        half_angle: [rad], in (0, pi].
        flip: the outward normal points to the centre (a hollow) instead of away from it.

    Raises:
        InputError: a radius that is not positive, an axis of no length, a half angle out of (0, pi].
    """

    kind = "cap"

    center: Vector3
    radius: float
    axis: Vector3
    half_angle: float
    flip: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (3,), "center"))
        object.__setattr__(self, "axis", unit_direction(self.axis, "axis"))
        require_positive(self.radius, "radius", "it must be positive [m]")
        if not 0 < self.half_angle <= np.pi + 1e-12:
            raise InputError(f"is {self.half_angle:g}; it lies in (0, pi] [rad]", field="half_angle")
        object.__setattr__(self, "half_angle", float(min(self.half_angle, np.pi)))

    @property
    def ball(self) -> Cap | None:
        return self

    @cached_property
    def frame(self) -> Array:
        """(3, 3) rotation whose third column is the axis; the other two are tangents of `normal_frame`, negated."""
        axis, t1, t2 = normal_frame(self.axis).T
        return frozen(np.column_stack([-t1, -t2, axis]), (3, 3), "frame")

    def point(self, direction: object) -> Array:
        """(..., 3) [m] the surface point in a unit direction (..., 3) from the centre."""
        return self.center + self.radius * np.asarray(direction, dtype=float)

    # --- with parameters: the angle from the axis, and the angle around it from the frame's first column ------------

    @property
    def bounds(self) -> Array:
        return np.array([[0.0, self.half_angle], [-np.pi, np.pi]])

    @property
    def search_bounds(self) -> Array:
        return np.array([[0.0, self.half_angle], [-4.0, 4.0]])

    def at(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        direction = self._direction(u, v, du, dv)
        return self.point(direction) if du == dv == 0 else self.radius * direction

    def outward(self, u: object, v: object) -> Array:
        return self.sign * self._direction(u, v)

    def _direction(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        """(..., 3) the derivative of order (du, dv) of the direction from the centre: waves, a quarter on."""
        polar, around = np.asarray(u) + du * np.pi / 2, np.asarray(v) + dv * np.pi / 2
        along = np.cos(polar) * (dv == 0) + 0 * around
        local = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), along], axis=-1)
        direction: Array = local @ self.frame.T
        return direction

    @property
    def middle(self) -> tuple[Array, Array]:
        return self.point(self.axis), self.sign * self.axis

    @property
    def amid(self) -> Array:
        return self.center

    @property
    def outermost(self) -> float:
        return float(np.linalg.norm(self.center)) + self.radius

    @property
    def extent(self) -> float:
        return self.radius * float(np.sin(min(self.half_angle, np.pi / 2)))

    @property
    def longest_normal(self) -> float:
        return self.radius**2

    def derivative_bounds(self, cells: int) -> tuple[Array, Array]:
        """Everywhere the same."""
        shape = (cells, cells, 5)
        return np.full(shape, self.radius), np.ones(shape)
