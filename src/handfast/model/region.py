"""Regions of a surface that are to touch: Bezier patches of any degree and spherical caps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame

DEEPEST = 6  # halvings in each parameter before a patch whose normal cannot be told from zero is refused
VANISHES = 1e-9  # a normal this much shorter than the longest one is none
PADDING = 1e-13  # of the size of a patch: more than the rounding of a subdivision


@dataclass(frozen=True, eq=False)
class Bezier:
    """A Bezier patch p(u, v), 0 <= u, v <= 1, of degree M x N (synthesis paper, equation (3)).

    Attributes:
        points: (M+1, N+1, 3) [m] control points in the frame of the link or object that carries it.
        flip: the outward normal is -(p_u x p_v) instead of p_u x p_v (2).

    Raises:
        InputError: fewer than 2 x 2 points, not finite, or a normal that vanishes somewhere.
    """

    points: Array
    flip: bool = False

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

    @property
    def sign(self) -> float:
        """-1 if the normal is flipped, else 1."""
        return -1.0 if self.flip else 1.0

    def at(self, u: object, v: object, du: int = 0, dv: int = 0) -> Array:
        """(..., 3) the derivative of p of order (du, dv) at parameters u, v of one shape; p itself for (0, 0)."""
        return evaluate(differences(self.points, du, dv), u, v)

    def normal(self, u: object, v: object) -> Array:
        """(..., 3) outward normal [m^2], not normalised: p_u x p_v (2), reversed if flipped."""
        return self.sign * np.cross(self.at(u, v, 1, 0), self.at(u, v, 0, 1))

    @cached_property
    def normal_points(self) -> Array:
        """(2M, 2N, 3) control points of the outward normal as a patch of degree (2M-1) x (2N-1) (19)."""
        return self.sign * _cross(differences(self.points, 1, 0), differences(self.points, 0, 1))

    def restricted(self, u: tuple[float, float], v: tuple[float, float]) -> Bezier:
        """The part over a rectangle of parameters, its own parameters again from 0 to 1."""
        return Bezier(restrict(self.points, u, v), self.flip)

    def enclosure(self) -> Array:
        """(2, 3) [m] lower and upper corner of a box that holds the patch (convex hull property)."""
        return hull_box(self.points)

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
            if depth == DEEPEST:
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
class Cap:
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

    center: Array
    radius: float
    axis: Array
    half_angle: float
    flip: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (3,), "cap.center"))
        axis = frozen(self.axis, (3,), "cap.axis")
        length = float(np.linalg.norm(axis))
        if length < 1e-9:
            raise InputError("is zero; a direction is needed", field="cap.axis")
        object.__setattr__(self, "axis", frozen(axis / length, (3,), "cap.axis"))
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise InputError(f"is {self.radius:g}; it must be positive [m]", field="cap.radius")
        if not 0 < self.half_angle <= np.pi + 1e-12:
            raise InputError(f"is {self.half_angle:g}; it lies in (0, pi] [rad]", field="cap.half_angle")
        object.__setattr__(self, "half_angle", float(min(self.half_angle, np.pi)))

    @property
    def sign(self) -> float:
        """-1 if the normal points to the centre, else 1."""
        return -1.0 if self.flip else 1.0

    @cached_property
    def frame(self) -> Array:
        """(3, 3) rotation whose third column is the axis; the other two are tangents of `normal_frame`, negated."""
        axis, t1, t2 = normal_frame(self.axis).T
        return frozen(np.column_stack([-t1, -t2, axis]), (3, 3), "cap.frame")

    def point(self, direction: object) -> Array:
        """(..., 3) [m] the surface point in a unit direction (..., 3) from the centre."""
        return self.center + self.radius * np.asarray(direction, dtype=float)


Region = Bezier | Cap


# --- polynomials in Bernstein form: (M+1, N+1, ...) coefficients -----------------------------------


def evaluate(points: Array, u: object, v: object) -> Array:
    """The polynomial with Bernstein coefficients `points` (M+1, N+1, k) at u, v: (..., k)."""
    a = bernstein(points.shape[0] - 1, np.asarray(u, dtype=float))
    b = bernstein(points.shape[1] - 1, np.asarray(v, dtype=float))
    return np.einsum("...i,...j,ijk->...k", a, b, points)


def bernstein(degree: int, x: Array) -> Array:
    """(..., degree+1) the Bernstein polynomials B_i(x) of a degree."""
    i = np.arange(degree + 1)
    x = np.asarray(x)[..., None]
    return np.array([comb(degree, k) for k in i]) * x**i * (1 - x) ** (degree - i)


def differences(points: Array, du: int, dv: int) -> Array:
    """Bernstein coefficients of a derivative: (M+1-du, N+1-dv, k); zeros (1, ...) beyond the degree."""
    out = points
    for _ in range(du):
        out = (out.shape[0] - 1) * np.diff(out, axis=0) if out.shape[0] > 1 else 0 * out
    for _ in range(dv):
        out = (out.shape[1] - 1) * np.diff(out, axis=1) if out.shape[1] > 1 else 0 * out
    return out


def restrict(points: Array, u: tuple[float, float], v: tuple[float, float]) -> Array:
    """Bernstein coefficients of the polynomial over a rectangle of parameters (blossoming)."""
    return _restrict_first(_restrict_first(points, *u).swapaxes(0, 1), *v).swapaxes(0, 1)


def hull_box(points: Array) -> Array:
    """(2, k) box about all values of a polynomial over the unit square, padded against rounding."""
    flat = points.reshape(-1, points.shape[-1])
    pad = PADDING * np.abs(flat).max(initial=0.0)
    return np.array([flat.min(axis=0) - pad, flat.max(axis=0) + pad])


def _restrict_first(points: Array, a: float, b: float) -> Array:
    """Over [a, b] in the first parameter: coefficient k is the blossom at k times b and the rest a."""
    degree = len(points) - 1
    out = np.empty_like(points)
    for k in range(degree + 1):
        level = points
        for x in [b] * k + [a] * (degree - k):
            level = (1 - x) * level[:-1] + x * level[1:]
        out[k] = level[0]
    return out


def _cross(a: Array, b: Array) -> Array:
    """Bernstein coefficients of the cross product of two vector polynomials (Yamaguchi 1997)."""
    a, b = a * _binomials(a)[:, :, None], b * _binomials(b)[:, :, None]
    out = np.zeros((a.shape[0] + b.shape[0] - 1, a.shape[1] + b.shape[1] - 1, 3))
    for i, j in np.ndindex(*a.shape[:2]):
        out[i : i + b.shape[0], j : j + b.shape[1]] += np.cross(a[i, j], b)
    return out / _binomials(out)[:, :, None]


def _binomials(points: Array) -> Array:
    """(M+1, N+1) products of the binomial coefficients of a polynomial's degrees."""
    rows, columns = (np.array([float(comb(n - 1, k)) for k in range(n)]) for n in points.shape[:2])
    return np.outer(rows, columns)
