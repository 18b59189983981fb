"""Regions in interval arithmetic: points, normals and tangents with their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array, Indices
from handfast.model.cylinder_side import CylinderSide
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.certify.chains import orthonormal
from handfast.synthesis.certify.interval_arithmetic import Dual, Interval, columns, cos, cross, join, sin, unit

ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # the derivatives of a patch that F and F' need


class _Surfaces(Protocol):
    """Regions of one kind."""

    def at(self, x: Dual) -> tuple[Dual, ...]:
        """As `ContactSide.at`."""


@dataclass(frozen=True, eq=False)
class ContactSide:
    """The regions of one side of the contacts, each kind apart.

    Attributes:
        parts: of each kind that there is, see `SURFACES`.
        order: (K,) of the contacts, in one part after the other.
    """

    parts: tuple[_Surfaces, ...]
    order: Indices

    @classmethod
    def of(cls, regions: Sequence[Region], names: str, column: Mapping[str, int], *, still: bool) -> ContactSide:
        """With parameters of these names; `still`: of a cap only its centre and axis are wanted."""
        parts: list[_Surfaces] = []
        order: list[int] = []
        for kind, surfaces in SURFACES.items():
            its = {k: region for k, region in enumerate(regions) if type(region) is kind}
            stands = still and kind is Cap
            at = [[column[f"contact:{k}:{name}"] for name in names] for k in its if not stands]
            if its:
                make: Callable[[Sequence[Any], Indices], _Surfaces] = _Centres.of if stands else surfaces
                parts.append(make(list(its.values()), np.array(at, dtype=np.intp).T))
            order += its
        return cls(tuple(parts), np.argsort(order))

    def at(self, x: Dual) -> tuple[Dual, ...]:
        """(N, K, 3) each at (N, n): point, outward unit normal (axis of a cap that stands still), two tangents."""
        parts = [part.at(x) for part in self.parts]
        return tuple(join(list(p), -2)[..., self.order, :] for p in zip(*parts, strict=True))


@dataclass(frozen=True, eq=False)
class _Centres:
    """Hand caps: centre and axis, constant in the link."""

    centre: Interval
    axis: Interval

    @classmethod
    def of(cls, caps: Sequence[Cap], at: Indices) -> _Centres:
        return cls(
            Interval.of([c.center for c in caps]),
            unit(Interval.of([c.axis for c in caps])),
        )

    def at(self, x: Dual) -> tuple[Dual, ...]:
        centre, axis = (Dual.constant(a.repeated(x.value.shape[0]), x.slope.shape[0]) for a in (self.centre, self.axis))
        return centre, axis, axis, axis  # a cap's equations have no tangents


@dataclass(frozen=True, eq=False)
class _Caps:
    """Object caps (C): rotations of their frames, centres, radii and signs; columns (2, C) of s and t."""

    parameters: Indices
    frame: Interval
    centre: Array
    radius: Array
    sign: Array

    @classmethod
    def of(cls, caps: Sequence[Cap], at: Indices) -> _Caps:
        frame = np.array([c.frame for c in caps])
        R = orthonormal(frame[:, :, 2], frame[:, :, 0])[..., [1, 2, 0]]  # the axis exactly, e1 near its float
        centre, radius, sign = (np.array([getattr(c, name) for c in caps]) for name in ("center", "radius", "sign"))
        return cls(at, R, centre, radius[:, None], sign[:, None])

    def at(self, x: Dual) -> tuple[Dual, ...]:
        s, t = x[..., self.parameters[0]], x[..., self.parameters[1]]
        sin_s, cos_s, sin_t, cos_t = sin(s), cos(s), sin(t), cos(t)
        zero = 0.0 * sin_t
        local = [(sin_s * cos_t, sin_s * sin_t, cos_s), (cos_s * cos_t, cos_s * sin_t, -sin_s), (-sin_t, cos_t, zero)]
        turned = self.frame @ columns([join([a[..., None] for a in v], -1) for v in local])
        direction = turned[..., 0]
        return direction * self.radius + self.centre, direction * self.sign, turned[..., 1], turned[..., 2]


@dataclass(frozen=True, eq=False)
class _CylinderSides:
    """Sides of cylinders (C): rotations of their frames, points of their axes, radii and signs; columns (2, C) of u, v.

    Attributes:
        angles, heights: the first of each (C,) and how far it is to the last.
    """

    parameters: Indices
    frame: Interval
    centre: Array
    radius: Array
    sign: Array
    angles: tuple[Interval, Interval]
    heights: tuple[Interval, Interval]

    @classmethod
    def of(cls, sides: Sequence[CylinderSide], at: Indices) -> _CylinderSides:
        R = orthonormal(np.array([c.axis for c in sides]), np.array([c.x_axis for c in sides]))[..., [1, 2, 0]]
        angles, heights = (Interval.of([getattr(c, name) for c in sides]) for name in ("angles", "heights"))
        centre, radius, sign = (np.array([getattr(c, name) for c in sides]) for name in ("center", "radius", "sign"))
        ranges = ((ends[:, 0], ends[:, 1] - ends[:, 0]) for ends in (angles, heights))
        return cls(at, R, centre, radius[:, None], sign[:, None], *ranges)

    def at(self, x: Dual) -> tuple[Dual, ...]:
        (u, v), (first, turn), (lowest, length) = (x[..., k] for k in self.parameters), self.angles, self.heights
        angle, height = u * turn + first, v * length + lowest
        sine, cosine = sin(angle), cos(angle)
        zero = 0.0 * sine
        local = [(cosine, sine, zero), (-sine, cosine, zero), (zero, zero, height), (zero, zero, zero + 1.0)]
        turned = self.frame @ columns([join([a[..., None] for a in w], -1) for w in local])
        direction = turned[..., 0]
        point = direction * self.radius + turned[..., 2] + self.centre
        return point, direction * self.sign, turned[..., 1], turned[..., 3]


@dataclass(frozen=True, eq=False)
class _Patches:
    """Bezier patches (P) of any degrees, as control points of their derivatives filled up with 0.

    Attributes:
        parameters: (2, P) columns of u and v.
        sign: (P, 1) of the normal.
        base: (P, 6, 3) a point amid the control points of each of the derivatives in ORDERS.
        points: (P, 6, I * J, 3) these control points less the base: the polynomials sum to 1, and small
            points lose little to the width of the polynomials.
        weights: for u and for v the Bernstein polynomials of degree M, M-1, M-2: coefficient (P, 3, I),
            power of u and of 1-u.
    """

    parameters: Indices
    sign: Array
    base: Array
    points: Interval
    weights: tuple[tuple[Interval, NDArray[np.intp], NDArray[np.intp]], ...]

    @classmethod
    def of(cls, patches: Sequence[Bezier], at: Indices) -> _Patches:
        size = [max(p.points.shape[axis] for p in patches) for axis in (0, 1)]
        points, bases = [], []
        for patch in patches:
            for du, dv in ORDERS:
                derived = Interval.of(patch.points)
                for _ in range(du):
                    derived = float(derived.shape[0] - 1) * (derived[1:] - derived[:-1])
                for _ in range(dv):
                    derived = float(derived.shape[1] - 1) * (derived[:, 1:] - derived[:, :-1])
                bases.append(derived.mid.sum(axis=(0, 1)) / max(1, derived.shape[0] * derived.shape[1]))
                derived = derived - bases[-1]
                fill = [(0, n - m) for n, m in zip(size, derived.shape[:2], strict=True)] + [(0, 0)]
                points.append(Interval(np.pad(derived.lo, fill), np.pad(derived.hi, fill)))
        all_points = join([p.reshape(1, -1, 3) for p in points], -3).reshape(len(patches), 6, -1, 3)
        weights = tuple(_weights([p.degree[axis] for p in patches], size[axis]) for axis in (0, 1))
        base = np.array(bases).reshape(len(patches), 6, 3)
        return cls(at, np.array([[p.sign] for p in patches]), base, all_points, weights)

    def at(self, x: Dual) -> tuple[Dual, ...]:
        uv = [x[..., column] for column in self.parameters]
        u, v = (_bernstein(w.value, *weights) for w, weights in zip(uv, self.weights, strict=True))
        du, dv = (list(order) for order in zip(*ORDERS, strict=True))
        weight = u[..., du, :, None] * v[..., dv, None, :]  # (N, P, 6, I, J)
        d = (weight.reshape(*weight.shape[:3], 1, -1) @ self.points)[..., 0, :] + self.base  # (N, P, 6, 3)
        by_u, by_v = (w.slope[..., None, None] for w in uv)
        jet = Dual(d[..., [0, 1, 2], :], by_u * d[..., [1, 3, 4], :] + by_v * d[..., [2, 4, 5], :])
        first, second = jet[..., 1, :], jet[..., 2, :]
        return jet[..., 0, :], unit(cross(first, second)) * self.sign, first, second


# kinds of regions: how several of one are made, from them and the columns (2, .) of their parameters
SURFACES: Mapping[type[Region], Callable[[Sequence[Any], Indices], _Surfaces]] = {
    Bezier: _Patches.of,
    Cap: _Caps.of,
    CylinderSide: _CylinderSides.of,
}


def _weights(degrees: Sequence[int], size: int) -> tuple[Interval, NDArray[np.intp], NDArray[np.intp]]:
    """(P, 3, size) binomials of degrees M, M-1, M-2 of P patches, powers of u and of 1-u; 0 beyond the degree."""
    shape = (len(degrees), 3, size)
    binomials, up, down = np.zeros(shape), np.zeros(shape, dtype=np.intp), np.zeros(shape, dtype=np.intp)
    for p, degree in enumerate(degrees):
        for less in range(min(3, degree + 1)):
            for i in range(degree - less + 1):
                binomials[p, less, i] = comb(degree - less, i)
                up[p, less, i], down[p, less, i] = i, degree - less - i
    exact = Interval.of(binomials)
    return (exact if binomials.max() < 2.0**53 else exact * 1.0), up, down


def _bernstein(u: Interval, binomials: Interval, up: NDArray[np.intp], down: NDArray[np.intp]) -> Interval:
    """(N, P, 3, I) Bernstein polynomials at u (N, P)."""
    patch = np.arange(u.shape[1])[:, None, None]
    return _powers(u, up.shape[-1])[..., patch, up] * _powers(1.0 - u, up.shape[-1])[..., patch, down] * binomials


def _powers(u: Interval, count: int) -> Interval:
    """(N, P, count) powers 0, 1, .. of u."""
    powers = [Interval.of(np.ones(u.shape))]
    for _ in range(count - 1):
        powers.append(powers[-1] * u if len(powers) > 1 else u)
    return join([p[..., None] for p in powers], -1)
