"""An object's surface: points drawn at random, what lies opposite to them, and places where a finger could touch.

Places are points with nearly flat patches around them. The mesh itself may be coarse (a box has twelve triangles) or
made of several solids. So nothing is grown from face to face: around a point of the surface a grid in the tangent plane
is projected onto the mesh, which is the part of the surface that a patch can follow whatever the triangles are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array, Indices, Mask, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.geometry.region_fit import fit_grid, flat_cross
from handfast.model.body import Body
from handfast.model.region import Bezier

ITSELF = 1e-4  # [m] along a ray, what is nearer is the face where it began
NORMAL_SPREAD = np.radians(30)  # of the normals over a patch, from that in its middle
PATCH_SHAPES = ((1.0, 1.0), (1.0, 0.6), (0.6, 0.6), (1.0, 0.35), (0.6, 0.35), (0.35, 0.35), (0.6, 0.2), (0.2, 0.2))
COARSE_GRID, FINE_GRID = 7, 13  # points along each side of the projected grid, to look and to fit
ERROR = 5e-4  # [m] largest distance of a patch from the mesh
# [m] what is this high above the surface is in no solid, or less deep than that
SURFACE_HEIGHT, BURIED_DEPTH = 1e-3, 3e-4
POINT_DENSITY = 12  # points drawn for each one that is kept
RAY_OFFSET = 1e-5  # [m] where a ray through the object starts


class SurfaceSampler:
    """Points on an object's mesh, equally likely everywhere on its surface. Object frame.

    Attributes:
        middle: (3,) [m] the centre of mass.
        friction: coefficient of the object.
    """

    def __init__(self, body: Body) -> None:
        self._corners, self._normals, areas = _faces(body)
        self._share = areas / areas.sum()
        self.middle, self.friction = body.center_of_mass, body.friction

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """A point (3,) [m] and the unit normal (3,) out of the object there.

        A mesh may be wound either way, so a normal that looks at the centre of mass is turned round.
        """
        k = rng.choice(len(self._share), p=self._share)
        u, v = rng.random(2)
        u, v = (u, v) if u + v <= 1 else (1 - u, 1 - v)
        a, b, c = self._corners[k]
        point, normal = a + u * (b - a) + v * (c - a), self._normals[k]
        return point, normal if normal @ (point - self.middle) >= 0 else -normal

    def opposite(self, point: Array, inwards: Array) -> tuple[Array, Array] | None:
        """Where a ray from a point (3,) [m] of the surface first meets it again, and the unit normal there, of
        either sense; None if it does not.

        Source: T. Möller, B. Trumbore, Fast, minimum storage ray-triangle intersection, 1997.
        """
        a, b, c = self._corners.swapaxes(0, 1)
        first, second, off = b - a, c - a, point - a
        p, q = np.cross(inwards, second), np.cross(off, first)
        det = np.einsum("ij,ij->i", first, p)
        safe = np.where(np.abs(det) > 1e-18, det, np.inf)
        u, v = np.einsum("ij,ij->i", off, p) / safe, q @ inwards / safe
        along = np.where(np.isfinite(safe), np.einsum("ij,ij->i", second, q) / safe, 0.0)
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > ITSELF)
        if not hit.any():
            return None
        k = int(np.flatnonzero(hit)[along[hit].argmin()])
        return point + along[k] * inwards, self._normals[k]


def _faces(body: Body) -> tuple[Array, Array, Array]:
    """Of a mesh's faces that have an area: corners (k, 3, 3), unit normals (k, 3), areas (k,)."""
    corners = np.asarray(body.vertices, dtype=float)[body.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    real = length > 1e-9 * length.max()
    return corners[real], normal[real] / length[real, None], length[real] / 2


def near(rng: np.random.Generator, direction: Array, angle: float) -> Array:
    """A unit vector, equally likely anywhere within an angle [rad] of a unit direction."""
    height = 1 - rng.random() * (1 - np.cos(angle))
    around = rng.uniform(0, 2 * np.pi)
    frame = normal_frame(direction)
    flat = np.sqrt(1 - height**2)
    return frame @ np.array([height, flat * np.cos(around), flat * np.sin(around)])


def turned(source: Array, target: Array, roll: float) -> Array:
    """(3, 3) a rotation that takes one unit vector to another and rolls about it [rad]."""
    turn = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    return normal_frame(target) @ turn @ normal_frame(source).T


# --- places ---


@dataclass(frozen=True, eq=False)
class Place:
    """A part of an object's surface. Object frame.

    Attributes:
        point: (3,) [m] in its middle.
        normal: (3,) outward unit normal of the mesh there.
        patch: bicubic, through the surface around the point; its normal points outwards.
        error: [m] largest distance of the patch from the mesh, over points that were looked at.
        size: [m] half of its longer and of its shorter side.
    """

    point: Array
    normal: Array
    patch: Bezier
    error: float
    size: tuple[float, float]


def find_places(body: Body, radius: float, *, count: int = 60, seed: int = 0) -> tuple[tuple[Place, ...], int]:
    """Places spread over an object and those opposite to them; and at how many points no patch was near enough.

    Args:
        radius: [m] half a side of the largest patch.
        count: of points that are spread over the surface; as many more may lie opposite.
        seed: of the points that are drawn.

    Raises:
        InputError: a radius that is not positive, a count below 1.
    """
    if not radius > 0:
        raise InputError(f"is {radius:g}; a positive number [m] is needed", field="radius")
    if count < 1:
        raise InputError(f"is {count}; a number from 1 on is needed", field="count")
    surface = _MeshSurface.of(body)
    spread = surface.spread(count, np.random.default_rng(seed))
    across = (surface.opposite(point, normal) for point, normal in spread)
    found = [surface.place(point, normal, radius) for point, normal in [*spread, *filter(None, across)]]
    return tuple(p for p in found if p), sum(p is None for p in found)


@dataclass(frozen=True, eq=False)
class _MeshSurface:
    """A mesh ready to be met by rays: corners (k, 3, 3), outward unit normals (k, 3), areas (k,)."""

    body: Body
    corners: Array
    normals: Array
    areas: Array

    @classmethod
    def of(cls, body: Body) -> _MeshSurface:
        return cls(body, *_faces(body))

    def spread(self, count: int, random: np.random.Generator) -> list[tuple[Array, Array]]:
        """At most `count` points on the outer surface, each as far from those before it as can be, with normals."""
        many = POINT_DENSITY * count
        face = random.choice(len(self.areas), size=many, p=self.areas / self.areas.sum())
        a, b = np.sqrt(random.random(many)), random.random(many)
        weights = np.column_stack([1 - a, a * (1 - b), a * b])
        points = np.einsum("mi,mij->mj", weights, self.corners[face])
        seen = ~self.hidden(points, self.normals[face])
        points, normals = points[seen], self.normals[face[seen]]
        chosen: list[int] = []
        far = np.full(len(points), np.inf)
        while len(chosen) < min(count, len(points)):
            k = int(far.argmax())
            chosen.append(k)
            # two sides of a thin plate are different places
            step = np.linalg.norm(points - points[k], axis=1) + 0.01 * (1 - normals @ normals[k])
            far = np.minimum(far, step)
        return [(points[k], normals[k]) for k in chosen]

    def hidden(self, points: Array, normals: Array) -> Mask:
        """(m,) whether the space just above points of faces is inside one of the body's solids.

        So it is on a face within a solid, and on one along which two solids meet.
        """
        points = points + SURFACE_HEIGHT * normals
        out = np.zeros(len(points), dtype=bool)
        low, high = points.min(axis=0), points.max(axis=0)
        for solid, (least, most) in zip(self.body.pieces, self._boxes, strict=True):
            if (least < high).all() and (most > low).all():
                out |= solid.depth(points) > BURIED_DEPTH
        return out

    @cached_property
    def _boxes(self) -> list[tuple[Array, Array]]:
        """Corners of the boxes about the body's solids."""
        clouds = [solid.triangles()[0] for solid in self.body.pieces]
        return [(c.min(axis=0), c.max(axis=0)) for c in clouds]

    def opposite(self, point: Array, normal: Array) -> tuple[Array, Array] | None:
        """Where a ray from a point straight through the object comes out, and the normal there."""
        turn = _frame(normal)
        faces = np.flatnonzero(self.normals @ normal < 0)
        height = self._heights((turn[:2] @ point)[None], turn, faces)[0]
        below = np.flatnonzero(height < point @ normal - RAY_OFFSET)
        for k in below[np.argsort(-height[below])]:
            out = point + (height[k] - point @ normal) * normal
            if not self.hidden(out[None], self.normals[faces[k]])[0]:
                return out, self.normals[faces[k]]
        return None

    def place(self, point: Array, normal: Array, radius: float) -> Place | None:
        """The largest patch about a point, moved away from edges, over which the normal turns little; or None."""
        for _ in range(2):
            turn, facing = _frame(normal), self._facing(point, normal, radius)
            around = self._projected(point, turn, (radius, radius), facing, COARSE_GRID)
            hit = np.isfinite(around[:, 2])
            if hit.sum() < 3:
                return None
            middle = around[hit, :2].mean(axis=0)
            up = self._heights((middle + turn[:2] @ point)[None], turn, facing)[0] - point @ normal
            if not (np.abs(up) < radius).any():
                break
            best = int(np.nanargmax(np.where(np.abs(up) < radius, up, np.nan)))
            point, normal = point + np.append(middle, up[best]) @ turn, self.normals[facing[best]]
        facing = self._facing(point, normal, radius)
        along = np.linalg.eigh(np.cov(around[hit, :2].T))[1][:, -1] @ turn[:2]
        along -= (along @ normal) * normal
        along /= np.linalg.norm(along)
        turn = np.array([along, np.cross(normal, along), normal])
        for a, b in PATCH_SHAPES:
            grids = (
                self._projected(point, turn, (a * radius, b * radius), facing, n) for n in (COARSE_GRID, FINE_GRID)
            )
            for grid in grids:
                if not np.isfinite(grid[:, 2]).all() or np.ptp(grid[:, 2]) > a * radius:
                    break
            else:
                points = (point + grid @ turn).reshape(FINE_GRID, FINE_GRID, 3)
                fitted = fit_grid(points)
                if fitted.error_max < ERROR and not self.hidden(points.reshape(-1, 3), normal).any():
                    where, out = frozen(point, (3,), "point"), frozen(normal, (3,), "normal")
                    return Place(where, out, fitted.patch, fitted.error_max, (a * radius, b * radius))
        return None

    def _facing(self, point: Array, normal: Array, radius: float) -> Indices:
        """Faces near a point whose normals are within `NORMAL_SPREAD` of the one there."""
        away = np.linalg.norm(self._middles - point, axis=1) - self._reach
        return np.flatnonzero((self.normals @ normal > np.cos(NORMAL_SPREAD)) & (away < 2 * radius))

    @cached_property
    def _middles(self) -> Array:
        """(k, 3) [m] of the faces."""
        return self.corners.mean(axis=1)

    @cached_property
    def _reach(self) -> Array:
        """(k,) [m] from the middle of each face to its farthest corner."""
        return np.linalg.norm(self.corners - self._middles[:, None], axis=2).max(axis=1)

    def _projected(self, point: Array, turn: Array, half: tuple[float, float], faces: Indices, grid: int) -> Array:
        """(g*g, 3) a grid about a point along the rows of `turn`, with the heights of the surface over the plane.

        Of several, the highest that is near the plane; NaN where there is none.
        """
        steps = np.linspace(-1, 1, grid)
        x, y = (s.ravel() for s in np.meshgrid(half[0] * steps, half[1] * steps, indexing="ij"))
        flat = np.column_stack([x, y])
        near = np.linalg.norm((self._middles[faces] - point) @ turn[:2].T, axis=1) - self._reach[faces]
        faces = faces[near < np.hypot(*half)]
        if not len(faces):
            return np.column_stack([flat, np.full(len(x), np.nan)])
        up = self._heights(flat + turn[:2] @ point, turn, faces) - point @ turn[2]
        up[~(np.abs(up) <= max(half))] = -np.inf
        best = up.max(axis=1)
        return np.column_stack([flat, np.where(np.isfinite(best), best, np.nan)])

    def _heights(self, at: Array, turn: Array, faces: Indices) -> Array:
        """(m, k) heights along turn[2] at which lines over points (m, 2) of the plane meet faces; NaN if not."""
        flat = self.corners[faces] @ turn.T
        a, b, c = (flat[None, :, i, :2] - at[:, None] for i in range(3))
        w = np.stack([flat_cross(b, c), flat_cross(c, a), flat_cross(a, b)], axis=-1)
        det = w.sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            w = w / det[..., None]
            met = (np.abs(det) > 1e-18) & (w >= -1e-9).all(axis=-1)
            return np.where(met, np.einsum("mki,ki->mk", w, flat[:, :, 2]), np.nan)


def _frame(normal: Array) -> Array:
    """(3, 3) rows: two tangents and the normal, right-handed."""
    _, t1, t2 = normal_frame(normal).T
    return np.array([t1, t2, normal])
