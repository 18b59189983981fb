"""Regions in interval arithmetic: points, normals and tangents with their derivatives.

A region of a new kind is a class here, with `read` and `at`, and a line in `SURFACES`. If contacts on a hand need
no parameters on it, as on a cap, it is its `ball` too, and `contact_equations` has to know.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb, nextafter, pi
from typing import NamedTuple, Protocol

import numpy as np

from handfast.proofs.fields import Array, BadFile, Fields, Integers
from handfast.proofs.intervals import Dual, Interval, columns, cos, cross, join, orthonormal, sin, unit

DERIVATIVE_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # the derivatives of a patch that F and F' need
MAX_PATCH_DEGREE = 100  # of a patch, at most
MAX_NARROWED_DEGREE = 9  # degree of a patch, above which parts of it are not worked out: their weights are many
MOST_WEIGHTS = 1 << 16  # of control points of patches that are worked out together
REGION_PARTS = 3  # that a box is cut into along each of a region's two parameters, to be narrow
PARAMETER_RANGE = 3.2  # [rad] more than half a turn: as far as a parameter goes either way
WHOLE_ANGLE = nextafter(pi, 4.0)  # [rad] the float after half a turn: the one before is `pi`, which misses the pole
PADDED_TURN = 2 * pi * (1 + 1e-12)  # [rad] a full turn, with room for a file's rounding


@dataclass(frozen=True, eq=False)
class RegionData:
    """A region as it stands in a file.

    Attributes:
        kind: a key of `SURFACES`. numbers: by the names of its fields. sign: -1 if its normals are flipped, else 1.
        ball: is it part of a sphere? Then s is an angle from its axis, and of the hand's only the centre counts.
        ends: (2, 2) where its parameters are, each point there at least once.
    """

    kind: str
    numbers: Mapping[str, Array]
    sign: float
    ball: bool
    ends: Array

    @property
    def radius(self) -> float:
        """[m] of a cap."""
        return float(self.numbers["radius"])

    @property
    def half_angle(self) -> float:
        """[rad] of a cap; pi is a whole sphere."""
        return float(self.numbers["half_angle"])

    @property
    def places(self) -> Array:
        """(n, 3) [m] its control points, or points of it that are about as far apart as any."""
        if self.kind == "bezier":
            return self.numbers["bezier"].reshape(-1, 3)
        first, second = (np.linspace(lo, hi, 5) for lo, hi in self.ends.tolist())
        grid = np.stack(np.meshgrid(first, second), axis=-1).reshape(-1, 1, 2)
        return SURFACES[self.kind].of([self]).at(Interval.of(grid)).point.value.mid[:, 0]


class Surface(NamedTuple):
    """(N, P, 3) each, with derivatives (2, N, P, 3) by their own parameters."""

    point: Dual
    normal: Dual
    first: Dual
    second: Dual


class Surfaces(Protocol):
    """P regions of one kind; each kind has `read`, the numbers of one in a file, and `of`, which makes several."""

    def at(self, parameters: Interval) -> Surface:
        """Point, outward unit normal (axis of a cap's centre), two tangents at parameters (N, P, 2)."""

    def over(self, parameters: Interval) -> Surface:
        """The same, made to be narrow over boxes and not at points."""


@dataclass(frozen=True, eq=False)
class ContactSide:
    """The regions of one side of the contacts, each kind and degree apart.

    Attributes:
        parts: of each kind that there is, and the columns (P, 2) of its parameters.
        order: (K,) of the contacts, in one part after the other; None if it is theirs.
        columns: (K, 2) of their parameters; -1 where there are none.
    """

    parts: tuple[tuple[Surfaces, Integers], ...]
    order: Integers | None
    columns: Integers

    @classmethod
    def of(cls, regions: Sequence[RegionData], its: Integers, *, still: bool) -> ContactSide:
        """With parameters in the columns `its` (K, 2); `still`: of a cap only its centre and axis are wanted."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for k, region in enumerate(regions):
            shape = region.numbers["bezier"].shape if region.kind == "bezier" else ()
            groups.setdefault((region.kind, shape), []).append(k)
        parts: list[tuple[Surfaces, Integers]] = []
        for at in groups.values():
            some = [regions[k] for k in at]
            parts.append((_Centres.of(some) if still and some[0].ball else SURFACES[some[0].kind].of(some), its[at]))
        order = np.argsort([k for at in groups.values() for k in at])
        return cls(tuple(parts), None if len(parts) == 1 else order, its)

    def at(self, x: Interval) -> Surface:
        """(N, K, 3) each at coordinates (N, n)."""
        return self._joined([part.at(x[..., its]) for part, its in self.parts])

    def over(self, x: Interval) -> Surface:
        """The same, made to be narrow over boxes and not at points; each contact has parameters.

        The box of each contact's own two parameters is cut into `REGION_PARTS` by `REGION_PARTS`. As `at` with a patch
        of a degree above `MAX_NARROWED_DEGREE`.
        """
        if any(isinstance(part, _Patches) and max(part.degrees) > MAX_NARROWED_DEGREE for part, _ in self.parts):
            return self.at(x)
        own, where = self._own(x)
        found = self._cut(own)
        its = where, np.arange(len(self.columns))
        return Surface(*(Dual(Interval(d.value.ends[its]), Interval(d.slope.ends[:, *its])) for d in found))

    def _own(self, x: Interval) -> tuple[Interval, Integers]:
        """Each contact's boxes of its own two parameters, one of those that are the same: (U, n) one contact beside the
        other, and (N, K) the row of each in it. Halves of a box differ in one contact alone.
        """
        N, K = len(x.ends), len(self.columns)
        all_ = x.ends[:, self.columns].reshape(N, K, 4)
        each = [np.unique(all_[:, k], axis=0, return_index=True, return_inverse=True)[1:] for k in range(K)]
        rows = np.zeros((max(len(first) for first, _ in each), x.shape[1]), dtype=np.int64)
        for (first, _), its in zip(each, self.columns, strict=True):
            rows[: len(first), its] = first[:, None]
        own = Interval(x.ends[rows, np.arange(x.shape[1])])
        return own, np.stack([inverse.ravel() for _, inverse in each], axis=1)

    def _cut(self, x: Interval) -> Surface:
        """As `over`, of boxes whatever they share."""
        cuts = x.lo[:, None] + (x.hi - x.lo)[:, None] * (np.arange(1, REGION_PARTS)[:, None] / REGION_PARTS)
        cuts = np.clip(np.concatenate([x.lo[:, None], cuts, x.hi[:, None]], axis=1), x.lo[:, None], x.hi[:, None])
        first, second = (a.ravel() for a in np.meshgrid(*[np.arange(REGION_PARTS)] * 2, indexing="ij"))
        which = np.zeros((REGION_PARTS**2, x.shape[1]), dtype=np.int64)
        which[:, self.columns[:, 0]], which[:, self.columns[:, 1]] = first[:, None], second[:, None]
        n = np.arange(x.shape[1])
        parts = Interval.between(cuts[:, which, n], cuts[:, which + 1, n])  # (N, PARTS^2, n)
        found = self._over(parts.reshape(-1, x.shape[1]))
        return Surface(*(Dual(*(_hull(a, len(x.ends)) for a in (d.value, d.slope))) for d in found))

    def _over(self, x: Interval) -> Surface:
        """As `over`, uncut."""
        found, middle = self._joined([part.over(x[..., its]) for part, its in self.parts]), x.mid
        here, away = self.at(Interval.of(middle)), Interval(np.moveaxis((x - middle)[..., self.columns].ends, 2, 0))
        return Surface(*(_narrowed(a, b.value, away[..., None]) for a, b in zip(found, here, strict=True)))

    def _joined(self, found: Sequence[Surface]) -> Surface:
        if self.order is None:
            return found[0]
        return Surface(*(join(list(p), -2)[..., self.order, :] for p in zip(*found, strict=True)))

    def spread(self, a: Dual, n: int) -> Dual:
        """(N, K, 3) with derivatives by n coordinates, or none, instead of the two of each contact."""
        ends = np.zeros((n, *a.value.ends.shape))
        for k, its in enumerate(self.columns.tolist()):
            if n and its[0] >= 0:
                ends[its, :, k] = a.slope.ends[:, :, k]
        return Dual(a.value, Interval(ends))


@dataclass(frozen=True, eq=False)
class _Centres:
    """Hand caps: centre and axis (P, 3), constant in the link."""

    centre: Interval
    axis: Interval

    @classmethod
    def of(cls, caps: Sequence[RegionData]) -> _Centres:
        return cls(Interval.of(_stacked(caps, "center")), unit(Interval.of(_stacked(caps, "axis"))))

    def at(self, parameters: Interval) -> Surface:
        shape = (parameters.shape[0], *self.centre.ends.shape)
        centre, axis = (Dual.constant(Interval(np.broadcast_to(a.ends, shape)), 2) for a in (self.centre, self.axis))
        return Surface(centre, axis, axis, axis)  # a cap's equations have no tangents

    over = at


@dataclass(frozen=True, eq=False)
class _Caps:
    """Spherical caps: rotations (P, 3, 3) with the axis as third column, centres, radii, signs."""

    frame: Interval
    centre: Array
    radius: Array
    sign: Array

    @classmethod
    def read(cls, f: Fields) -> dict[str, Array]:
        out = {"center": f.numbers("center", (3,)), "axis": f.numbers("axis", (3,))}
        out |= {"radius": np.array(_positive(f, "radius")), "half_angle": np.array(_positive(f, "half_angle"))}
        if not out["half_angle"] <= pi:
            raise BadFile(f"is {out['half_angle']:g}; pi or less is needed [rad]", f.at("half_angle"))
        return out

    @classmethod
    def of(cls, caps: Sequence[RegionData]) -> _Caps:
        axis = _stacked(caps, "axis")
        least = np.eye(3)[np.abs(axis).argmin(axis=1)]
        R = orthonormal(axis, -np.cross(axis, least))[..., [1, 2, 0]]
        return cls(R, _stacked(caps, "center"), _stacked(caps, "radius")[:, None], _signs(caps))

    def at(self, parameters: Interval) -> Surface:
        s, t = _variables(parameters)
        sin_s, cos_s, sin_t, cos_t = sin(s), cos(s), sin(t), cos(t)
        zero = 0.0 * sin_t
        local = [(sin_s * cos_t, sin_s * sin_t, cos_s), (cos_s * cos_t, cos_s * sin_t, -sin_s), (-sin_t, cos_t, zero)]
        turned = self.frame @ columns([join([a[..., None] for a in v], -1) for v in local])
        direction = turned[..., 0]
        return Surface(direction * self.radius + self.centre, direction * self.sign, turned[..., 1], turned[..., 2])

    over = at


@dataclass(frozen=True, eq=False)
class _CylinderSides:
    """Sides of cylinders or cones: rotations (P, 3, 3) with x_axis and axis as first and third column, centres, signs.

    Attributes:
        first, turn: (P,) [rad] the first angle and how far it is to the last. lowest, length: [m] of the heights.
        radius, growth: (P,) [m] at the lowest height, and from there to the highest.
        across, along: (P,) what of the unit normal points away from the axis, and along it.
    """

    frame: Interval
    centre: Array
    sign: Array
    first: Array
    turn: Interval
    lowest: Array
    length: Interval
    radius: Array
    growth: Interval
    across: Interval
    along: Interval

    @classmethod
    def read(cls, f: Fields) -> dict[str, Array]:
        out = {name: f.numbers(name, (3,)) for name in ("center", "axis", "x_axis")}
        out |= cls.read_radii(f)
        for name in ("angles", "heights"):
            lo, hi = out[name] = f.numbers(name, (2,))
            if not lo < hi or (name == "angles" and not hi - lo <= PADDED_TURN):
                raise BadFile(f"is [{lo:g}, {hi:g}]; the lower one first, at most a full turn", f.at(name))
        return out

    @classmethod
    def read_radii(cls, f: Fields) -> dict[str, Array]:
        radius = _positive(f, "radius")
        return {"radius": np.array(radius), "radii": np.array([radius, radius])}

    @classmethod
    def of(cls, sides: Sequence[RegionData]) -> _CylinderSides:
        R = orthonormal(_stacked(sides, "axis"), _stacked(sides, "x_axis"))[..., [1, 2, 0]]
        ends = [_stacked(sides, name).T for name in ("angles", "heights", "radii")]
        (first, turn), (lowest, length), (radius, growth) = ((lo, Interval.of(hi) - lo) for lo, hi in ends)
        normal = unit(join([length[..., None], -growth[..., None]], -1))
        ranges = first, turn, lowest, length, radius, growth, normal[..., 0], normal[..., 1]
        return cls(R, _stacked(sides, "center"), _signs(sides), *ranges)

    def at(self, parameters: Interval) -> Surface:
        u, v = _variables(parameters)
        angle, height, radius = u * self.turn + self.first, v * self.length + self.lowest, v * self.growth + self.radius
        sine, cosine = sin(angle), cos(angle)
        zero = 0.0 * sine
        local = [
            (radius * cosine, radius * sine, height),
            (cosine * self.across, sine * self.across, zero + self.along),
            (-sine, cosine, zero),
            (zero - cosine * self.along, zero - sine * self.along, zero + self.across),
        ]
        turned = self.frame @ columns([join([a[..., None] for a in w], -1) for w in local])
        return Surface(turned[..., 0] + self.centre, turned[..., 1] * self.sign, turned[..., 2], turned[..., 3])

    over = at


class _ConeSides(_CylinderSides):
    @classmethod
    def read_radii(cls, f: Fields) -> dict[str, Array]:
        radii = f.numbers("radii", (2,))
        if not radii.min() > 0:
            raise BadFile(f"has {radii.min():g}; radii are positive", f.at("radii"))
        return {"radii": radii}


@dataclass(frozen=True, eq=False)
class _Patches:
    """Bezier patches of one degree (M, N), as control points of their derivatives filled up with 0.

    Attributes:
        base: (P, 6, 3) a point amid the control points of each of the derivatives in ORDERS.
        points: (P, 6, I * J, 3) these control points less the base: the polynomials sum to 1, and small
            points lose little to the width of the polynomials.
        degrees: M, N.
        binomials: (2, 1, 3, I) for u and for v those of degree M, M-1, M-2, 0 beyond. up, down: powers of u and 1-u.
        sign: (P, 1) of the normal.
    """

    base: Array
    points: Interval
    degrees: tuple[int, int]
    binomials: Interval
    up: Integers
    down: Integers
    sign: Array

    @classmethod
    def read(cls, f: Fields) -> dict[str, Array]:
        points = f.numbers("bezier", (-1, -1, 3))
        if not all(2 <= n <= MAX_PATCH_DEGREE + 1 for n in points.shape[:2]):
            shape = " x ".join(map(str, points.shape[:2]))
            raise BadFile(
                f"has {shape} points; 2 x 2 to {MAX_PATCH_DEGREE + 1} x {MAX_PATCH_DEGREE + 1} are possible",
                f.at("bezier"),
            )
        return {"bezier": points}

    @classmethod
    def of(cls, patches: Sequence[RegionData]) -> _Patches:
        points = _stacked(patches, "bezier")
        P, I, J, _ = points.shape
        size = max(I, J)
        filled, base = np.zeros((P, 6, size, size, 3, 2)), np.zeros((P, 6, 3))
        derived = {(0, 0): Interval.of(points)}
        for n, (du, dv) in enumerate(DERIVATIVE_ORDERS):
            if du:
                a = derived[du - 1, dv]
                derived[du, dv] = (a[:, 1:] - a[:, :-1]) * float(I - du)
            elif dv:
                a = derived[du, dv - 1]
                derived[du, dv] = (a[:, :, 1:] - a[:, :, :-1]) * float(J - dv)
            a = derived[du, dv]
            filled[:, n, : a.shape[1], : a.shape[2]] = a.ends
            base[:, n] = a.mid.sum(axis=(1, 2)) / max(1, a.shape[1] * a.shape[2])
        less = Interval(filled) - base[:, :, None, None]
        degrees = I - 1, J - 1
        return cls(base, less.reshape(P, 6, size**2, 3), degrees, *_weights(degrees, size), _signs(patches))

    def at(self, parameters: Interval) -> Surface:
        N, (P, _, weights, _) = parameters.shape[0], self.points.shape
        step = max(1, MOST_WEIGHTS // (P * weights))
        parts = [self._sums(parameters[k : k + step]).ends for k in range(0, N, step)]
        return self._surface(Interval(np.concatenate(parts)))

    def _sums(self, parameters: Interval) -> Interval:
        """(N, P, 6, 3) the derivatives in ORDERS at parameters (N, P, 2)."""
        w = Interval(np.moveaxis(parameters.ends, -2, 0))  # (2, N, P)
        u, v = _powers(w, self.up.shape[-1]), _powers(1.0 - w, self.up.shape[-1])
        which = np.arange(2)[:, None, None]
        weight = Interval(u.ends[which, :, :, self.up]) * Interval(v.ends[which, :, :, self.down])
        weight = weight * self.binomials  # (2, 3, I, N, P)
        du, dv = (list(order) for order in zip(*DERIVATIVE_ORDERS, strict=True))
        both = weight[0][du][:, :, None] * weight[1][dv][:, None]  # (6, I, J, N, P)
        both = Interval(np.moveaxis(both.ends.reshape(6, -1, *both.ends.shape[3:]), (2, 3), (0, 1)))  # (N, P, 6, I * J)
        return (both[:, :, :, None] @ self.points)[..., 0, :] + self.base

    def over(self, parameters: Interval) -> Surface:
        """As `at`, narrower over boxes: within the control points of the part of the patch that is over a box."""
        lo, hi = (Interval.of(np.moveaxis(end, -1, 0)) for end in (parameters.lo, parameters.hi))  # (2, N, P)
        size = int(np.sqrt(self.points.shape[2]))
        blossoms = _blossoms(lo, hi, size - 1)
        N, P = lo.shape[1:]
        ends = np.zeros((N, P, 6, 3, 2))
        for n, orders in enumerate(DERIVATIVE_ORDERS):
            I, J = (max(degree - less + 1, 0) for degree, less in zip(self.degrees, orders, strict=True))
            if not I * J:
                continue
            own = Interval(self.points.ends.reshape(P, 6, size, size, 3, 2)[:, n, :I, :J].reshape(P, I, J * 3, 2))
            rows = (blossoms[I - 1][0] @ own).reshape(N, P, I, J, 3)
            ends[:, :, n] = (blossoms[J - 1][1][:, :, None] @ rows).ends.max(axis=(2, 3))
        return self._surface(Interval(ends) + self.base)

    def _surface(self, d: Interval) -> Surface:
        """Of the derivatives (N, P, 6, 3) in ORDERS."""
        slope = Interval(np.stack([d.ends[..., [1, 3, 4], :, :], d.ends[..., [2, 4, 5], :, :]]))
        jet = Dual(d[..., :3, :], slope)
        first, second = jet[..., 1, :], jet[..., 2, :]
        return Surface(jet[..., 0, :], unit(cross(first, second)) * self.sign, first, second)


def _hull(parts: Interval, boxes: int) -> Interval:
    """(..., N, K, 3) about the parts (..., N * parts, K, 3) of N boxes."""
    ends = parts.ends
    return Interval(ends.reshape(*ends.shape[:-4], boxes, -1, *ends.shape[-3:]).max(axis=-4))


def _narrowed(over: Dual, middle: Interval, away: Interval) -> Dual:
    """Values over boxes, which also are those in the middles plus derivatives times ways (2, N, K, 1) from there."""
    linear = middle + over.slope[0] * away[0] + over.slope[1] * away[1]
    lo, hi = np.fmax(over.value.lo, linear.lo), np.fmin(over.value.hi, linear.hi)
    return Dual(Interval.between(lo, hi), over.slope)


# kinds of regions, by their key in files
SURFACES: Mapping[str, type[_Patches | _Caps | _CylinderSides]] = {
    "bezier": _Patches,
    "cap": _Caps,
    "cylinder_side": _CylinderSides,
    "cone_side": _ConeSides,
}


def read_region(f: Fields) -> RegionData:
    """One region: exactly one kind, under its key, and perhaps `flip`."""
    kinds = [kind for kind in SURFACES if f.has(kind)]
    if len(kinds) != 1:
        raise BadFile(f"exactly one of {', '.join(SURFACES)} is needed", f.place)
    (kind,), sign = kinds, -1.0 if f.flag("flip", False) else 1.0
    inner = f if kind == "bezier" else f.object(kind)
    numbers = SURFACES[kind].read(inner)
    inner.done()
    f.done()
    ball, ends = kind == "cap", [[0.0, 1.0], [0.0, 1.0]]
    if ball:
        half = float(numbers["half_angle"])
        ends = [[0.0, half if half < pi else WHOLE_ANGLE], [-PARAMETER_RANGE, PARAMETER_RANGE]]
    return RegionData(kind, numbers, sign, ball, np.array(ends))


def _positive(f: Fields, name: str) -> float:
    value = f.number(name)
    if not value > 0:
        raise BadFile(f"is {value:g}; it must be positive", f.at(name))
    return value


def _stacked(regions: Sequence[RegionData], name: str) -> Array:
    return np.stack([r.numbers[name] for r in regions])


def _signs(regions: Sequence[RegionData]) -> Array:
    return np.array([[r.sign] for r in regions])


def _variables(parameters: Interval) -> list[Dual]:
    """Two parameters (N, P) of (N, P, 2), each with its derivatives (2, N, P) by both."""
    one = np.zeros((2, *parameters.ends.shape[:-2], 2))
    out = []
    for i in (0, 1):
        slope = one.copy()
        slope[i] = [-1.0, 1.0]
        out.append(Dual(parameters[..., i], Interval(slope)))
    return out


def _weights(degrees: tuple[int, int], size: int) -> tuple[Interval, Integers, Integers]:
    """(2, 3, size) binomials of degrees M, M-1, M-2, powers of u and of 1-u; 0 beyond the degree."""
    shape = (2, 3, size)
    binomials, up, down = np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    for p, degree in enumerate(degrees):
        for less in range(min(3, degree + 1)):
            for i in range(degree - less + 1):
                binomials[p, less, i] = comb(degree - less, i)
                up[p, less, i], down[p, less, i] = i, degree - less - i
    exact = Interval.of(binomials[..., None, None])
    return (exact if binomials.max() < 2.0**53 else exact * 1.0), up, down


def _blossoms(lo: Interval, hi: Interval, most: int) -> list[Interval]:
    """(2, N, P, d + 1, d + 1) for each degree d: the weights of control points in those of the part from lo to hi.

    Of the part, control point j is the blossom at d - j times lo and j times hi: the weight of control point i is the
    coefficient of x^i in the product of the factors 1 - lo + lo x and 1 - hi + hi x.
    """
    rows = [Interval.of(np.ones((*lo.shape, 1)))]
    out = []
    for degree in range(most + 1):
        out.append(join([row[..., None, :] for row in rows], -2))
        if degree < most:
            rows = [_times(rows[0], lo), *(_times(row, hi) for row in rows)]
    return out


def _times(row: Interval, end: Interval) -> Interval:
    """The coefficients (..., d + 1) of a polynomial times 1 - end + end x."""
    left, right = row * (1.0 - end)[..., None], row * end[..., None]
    zero = Interval.of(np.zeros((*end.shape, 1)))
    return join([left, zero], -1) + join([zero, right], -1)


def _powers(u: Interval, count: int) -> Interval:
    """(..., count) powers 0, 1, .. of u."""
    powers = [Interval.of(np.ones(u.shape)), u]
    while len(powers) < count:
        powers.append(powers[-1] * u)
    return join([p[..., None] for p in powers[:count]], -1)
