"""A region as the canonical system writes it: points and unnormalised normals over two parameters in [0, 1].

A Bezier patch is its control points and those of its normal (19), here divided by the longest of them, which
changes no direction: mu is then a number near 1 instead of an area.

A cap is no polynomial patch. Its outward normal is one, up to length: with rho^2 = U^2 + V^2 and the angle
theta from the axis

    theta = 2 atan rho:  (2 U, 2 V, 1 - rho^2),                                       norm  1 + rho^2
    theta = 4 atan rho:  (4 U (1 - rho^2), 4 V (1 - rho^2), 1 - 6 rho^2 + rho^4),     norm (1 + rho^2)^2

(the real and imaginary parts of (1 + i rho)^2 and ^4), turned to the cap's axis. Both cover each direction
within the half angle exactly once; the first one, the stereographic map, has degree 2 x 2 and serves up to a
right angle, the second one 4 x 4 and serves up to the whole sphere (whose last point is a circle of
parameters). The square |U|, |V| <= T, T the tangent of a half or a quarter of the half angle and never above
1, is the square of parameters; the bound on the norm mu cuts the disc rho <= T out of it. The points are
center + radius times the unit normal, which is linear. A contact has as many variables and equations as one
of Bezier patches.

The side of a cylinder takes the same two maps with V = 0: half of its angles is what the half angle is to a cap, U is
its only parameter, and the height is linear in the other one.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.bernstein import evaluate, hull_box
from handfast.model.cylinder_side import CylinderSide
from handfast.model.region import Bezier, Cap, Region

STEEP = np.pi / 2 + 1e-9  # [rad] half angles above this take the second map
COEFFICIENT_ROUNDING = 1e-12  # relative; more than the rounding of the coefficients moves a value


@dataclass(frozen=True, eq=False)
class PatchForm:
    """One region, frame of the body that carries it, lengths in units.

    Attributes:
        name: for people.
        normals: (M+1, N+1, 3) Bernstein coefficients of the outward normal (24), (25), not of unit length.
        points: (M+1, N+1, 3) those of the point (17), (18), or None: it is center + v along + radius * unit normal.
        center, along, radius: (3,), (3,) and signed (negative where the normal points to the centre); 0 if points.
        norm: lower and upper bound of the normal's length, the upper one part of a cap's definition.
        point_box, normal_box, unit_box: (2, 3) bounds of point, normal and unit normal.
    """

    name: str
    normals: Array
    points: Array | None
    center: Array
    along: Array
    radius: float
    norm: tuple[float, float]
    point_box: Array
    normal_box: Array
    unit_box: Array

    @classmethod
    def of(cls, region: Region, pose: Array, unit: float) -> PatchForm:
        """A region whose frame has the (4, 4) pose [m] in the body's, lengths divided by `unit` [m]."""
        match region:
            case Bezier():
                return _of_bezier(region, pose, unit)
            case Cap():
                return _of_cap(region, pose, unit)
            case CylinderSide():
                return _of_cylinder_side(region, pose, unit)
        raise InputError("cannot be written as the canonical system has regions; take patches", field=region.kind)

    def at(self, u: float, v: float, normal: Array) -> Array:
        """(3,) the point at parameters u, v, where the unit normal is `normal` (3,)."""
        if self.points is not None:
            return evaluate(self.points, u, v)
        return self.center + v * self.along + self.radius * normal


def _of_bezier(region: Bezier, pose: Array, unit: float) -> PatchForm:
    R = pose[:3, :3]
    points = (region.points @ R.T + pose[:3, 3]) / unit
    normals = region.normal_points @ R.T
    normals = normals / np.linalg.norm(normals, axis=2).max()
    flat = normals.reshape(-1, 3)
    along = flat.mean(axis=0)
    size = float(np.linalg.norm(along))
    # no value is shorter than the shortest shadow of a control point on one direction
    shortest = float((flat @ along).min()) / size if size > 0 else 0.0
    norm = (max(shortest - COEFFICIENT_ROUNDING, 0.0), 1.0 + COEFFICIENT_ROUNDING)
    unit_box = np.array([-np.ones(3), np.ones(3)])
    name, nothing = "x".join(str(n - 1) for n in points.shape[:2]) + " patch", np.zeros(3)
    return PatchForm(name, normals, points, nothing, nothing, 0.0, norm, hull_box(points), hull_box(normals), unit_box)


def _of_cap(cap: Cap, pose: Array, unit: float) -> PatchForm:
    R, center = pose[:3, :3], (pose[:3, :3] @ cap.center + pose[:3, 3]) / unit
    radius = cap.sign * cap.radius / unit
    steep, T = _map(cap.half_angle)
    # by powers of U and V; rho^2 = U^2 + V^2
    x = np.zeros((5, 5, 3) if steep else (3, 3, 3))
    if steep:
        x[1, 0, 0], x[3, 0, 0], x[1, 2, 0] = 4, -4, -4
        x[0, 1, 1], x[0, 3, 1], x[2, 1, 1] = 4, -4, -4
        x[0, 0, 2], x[2, 0, 2], x[0, 2, 2] = 1, -6, -6
        x[4, 0, 2], x[2, 2, 2], x[0, 4, 2] = 1, 2, 1
    else:
        x[1, 0, 0], x[0, 1, 1] = 2, 2
        x[0, 0, 2], x[2, 0, 2], x[0, 2, 2] = 1, -1, -1
    S = _to_bernstein(len(x) - 1, T)
    normals = np.einsum("ai,bj,ijk,lk->abl", S, S, x, cap.sign * R @ cap.frame)
    unit_box = _directions(cap.sign * R @ cap.axis, cap.half_angle)
    return _of_round("cap", normals, (center, np.zeros(3), radius), (steep, T), unit_box)


def _of_cylinder_side(side: CylinderSide, pose: Array, unit: float) -> PatchForm:
    R, lowest = pose[:3, :3], side.center + side.heights[0] * side.axis
    center, along = (R @ lowest + pose[:3, 3]) / unit, R @ side.axis * side.length / unit
    radius = side.sign * side.radius / unit
    steep, T = _map(side.turn / 2)
    # by powers of U, from the middle of the angles
    x = np.array([[1, 0], [0, 4], [-6, 0], [0, -4], [1, 0]] if steep else [[1, 0], [0, 2], [-1, 0]])
    middle = sum(side.angles) / 2
    to_middle = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    turn = side.sign * R @ side.frame[:, :2] @ to_middle  # (3, 2)
    row = _to_bernstein(len(x) - 1, T) @ x @ turn.T
    normals = np.stack([row, row], axis=1)
    # each component is a wave of the angle, whose crest is so far from the middle
    high, crest = np.hypot(*turn.T), np.abs(np.arctan2(turn[:, 1], turn[:, 0]))
    ends = np.minimum(crest + side.turn / 2, np.pi), np.maximum(crest - side.turn / 2, 0.0)
    unit_box = np.array([high * np.cos(ends[0]) - COEFFICIENT_ROUNDING, high * np.cos(ends[1]) + COEFFICIENT_ROUNDING])
    return _of_round("cylinder side", normals, (center, along, radius), (steep, T), unit_box)


def _of_round(
    name: str, normals: Array, surface: tuple[Array, Array, float], mapped: tuple[bool, float], unit_box: Array
) -> PatchForm:
    """With the boxes of a surface of center, along and radius, whose normals go through one of the two maps."""
    (center, along, radius), (steep, T) = surface, mapped
    longest = (1 + T**2) ** (2 if steep else 1) * (1 + COEFFICIENT_ROUNDING)
    spots = np.array([center + v * along + radius * end for v in (0, 1) for end in unit_box])
    point_box = np.array([spots.min(axis=0) - COEFFICIENT_ROUNDING, spots.max(axis=0) + COEFFICIENT_ROUNDING])
    normal_box = np.array([np.maximum(-longest, hull_box(normals)[0]), np.minimum(longest, hull_box(normals)[1])])
    norm = (1.0 - COEFFICIENT_ROUNDING, longest)
    return PatchForm(name, normals, None, center, along, radius, norm, point_box, normal_box, unit_box)


def cap_parameters(cap: Cap, direction: Array) -> tuple[float, float]:
    """Parameters u, v in [0, 1] of the cap's point in a unit direction (3,) from its centre, cap's frame.

    Directions outside of the cap get parameters of which one or both lie outside of [0, 1], or within the
    square's corners, where mu is out of its bounds.
    """
    x, y, z = cap.frame.T @ direction
    steep, T = _map(cap.half_angle)
    across = float(np.hypot(x, y))
    rho = np.tan(np.arctan2(across, z) / (4 if steep else 2))
    cos, sin = (x / across, y / across) if across > 0 else (1.0, 0.0)
    return float(rho * cos / T + 1) / 2, float(rho * sin / T + 1) / 2


def cylinder_parameters(side: CylinderSide, u: float, v: float) -> tuple[float, float]:
    """Parameters in [0, 1] here of a point of a cylinder's side that has the parameters u and v there."""
    steep, T = _map(side.turn / 2)
    return float(np.tan((u - 0.5) * side.turn / (4 if steep else 2)) / T + 1) / 2, v


def _map(half_angle: float) -> tuple[bool, float]:
    """Is it the second map, and T."""
    steep = half_angle > STEEP
    return steep, float(np.tan(half_angle / (4 if steep else 2)))


def _directions(axis: Array, half_angle: float) -> Array:
    """(2, 3) box of the unit vectors within an angle of an axis."""
    angle = np.arccos(np.clip(axis, -1, 1))
    low, high = np.cos(np.minimum(angle + half_angle, np.pi)), np.cos(np.maximum(angle - half_angle, 0.0))
    return np.clip([low - COEFFICIENT_ROUNDING, high + COEFFICIENT_ROUNDING], -1, 1)


def _to_bernstein(degree: int, T: float) -> Array:
    """(degree+1, degree+1) column a: Bernstein coefficients over x in [0, 1] of (T (2 x - 1))^a."""
    out = np.zeros((degree + 1, degree + 1))
    for a in range(degree + 1):
        for k in range(a + 1):  # the power x^k in it
            power = comb(a, k) * 2.0**k * (-1.0) ** (a - k) * T**a
            for i in range(k, degree + 1):
                out[i, a] += power * comb(i, k) / comb(degree, k)
    return out
