"""The surface of an object of convex solids, cut into parts: where contacts can be, with which normals.

At a face the normal is the face's; at an edge or a corner it may be any between those of the faces that meet there. A
part is a triangle of points together with a triangle of normals, either of which may be a line or a point, and holds
at least what there is of the surface. Of solids that are round, points are p = q + radius n, with q of the triangle.
A point of one solid that another one touches is on the surface with those normals only along which that one does not
reach beyond it: so nothing is within another solid, or where two meet. Solids touch that are less than 1e-5 of the
object's length apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, cross, floats, rationals

SOLID_SIZES = {"mesh": 0, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3}
EQUAL_NORMAL_ANGLE = 1e-7  # [rad] normals that differ by less are one
MIN_SINE = 1e-6  # of two sides of a triangle: above it floats have the normal to 1e-9 rad
MAX_NORMAL_CONE = 1.4  # [rad] half the angle of a cone of normals; a wider one has no middle that is worth anything
# of an object's length: solids that are this near touch; one that goes so far beyond a point covers it
SOLID_TOUCH_DISTANCE, COVER_DISTANCE = 1e-5, 2e-5
LOST_DEPTH = 1e-14  # relative: more than rounding loses of depths, over the largest coordinate
SOLID_POSE_TOLERANCE = 1e-12  # by which the floats of a rotation may miss one
CONVEXITY_TOLERANCE = 1e-5  # of a mesh's length: how far a vertex may be above a face of a convex one
SOLID_BATCH = 512  # parts that are looked at together
DEPTH_BATCH = 1 << 22  # depths of points below faces of a mesh that are in memory at a time
RIM_PARTS = 180  # parts of a rim
ELLIPSOID_QUARTERINGS = 5  # times that the eighths of an ellipsoid are quartered
EIGHTHS = np.array([[[i, 0, 0], [0, j, 0], [0, 0, k]] for i in (1, -1) for j in (1, -1) for k in (1, -1)], dtype=float)


@dataclass(frozen=True, eq=False)
class SurfaceParts:
    """N parts of a surface.

    Attributes:
        points: (N, 3, 3) [m] corners of a triangle. normals: (N, 3, 3) outward unit vectors, of which the normals are
            positive combinations.
        radius: (N,) [m] from the points outwards along the normal. slack: (N,) [m] how far beyond that points may be.
        solid: (N,) which it is of.
    """

    points: Array
    normals: Array
    radius: Array
    slack: Array
    solid: Integers

    @classmethod
    def of(cls, points: Array, normals: Array, radius: float = 0.0, slack: float = 0.0) -> SurfaceParts:
        """Of one solid."""
        n = len(points)
        return cls(points, normals, np.full(n, radius), np.full(n, slack), np.zeros(n, dtype=np.int64))

    @classmethod
    def joined(cls, parts: Sequence[SurfaceParts]) -> SurfaceParts:
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__dataclass_fields__))

    def __getitem__(self, key: Any) -> SurfaceParts:
        return SurfaceParts(*(getattr(self, name)[key] for name in self.__dataclass_fields__))

    def __len__(self) -> int:
        return len(self.points)

    def cones(self) -> tuple[Array, Array]:
        """Unit axes (N, 3) and half the angles (N,) [rad] of cones that hold the normals; pi where they are wide."""
        total = self.normals.sum(axis=1)
        length = np.linalg.norm(total, axis=1)
        axis = total / np.maximum(length, 1e-300)[:, None]
        half = angle(self.normals, axis[:, None]).max(axis=1) + EQUAL_NORMAL_ANGLE
        return axis, np.where((half < MAX_NORMAL_CONE) & (length > 1e-6), half, np.pi)

    def balls(self) -> tuple[Array, Array]:
        """Centres (N, 3) and radii (N,) [m] of balls that hold the points."""
        axis, half = self.cones()
        middle = self.points.mean(axis=1)
        reach = np.linalg.norm(self.points - middle[:, None], axis=2).max(axis=1)
        turn = 2 * self.radius * np.sin(np.minimum(half, np.pi) / 2)
        return middle + self.radius[:, None] * axis, (reach + turn + self.slack) * (1 + 1e-12)

    def halves(self, center: Array) -> SurfaceParts:
        """(2 N) each cut in two: its points or its normals, whichever span more as they are seen from a centre."""
        far = np.linalg.norm(self.points - center, axis=2).max(axis=1) + self.radius
        spans = [np.linalg.norm(np.roll(a, -1, axis=1) - a, axis=2) for a in (self.points, self.normals)]
        by_points = spans[0].max(axis=1) / np.maximum(far, 1e-300) > spans[1].max(axis=1)
        out = []
        for its, name, span in ((by_points, "points", spans[0]), (~by_points, "normals", spans[1])):
            some, k = self[its], span[its].argmax(axis=1)
            corners, n = getattr(some, name), np.arange(len(k))
            a, b, c = corners[n, k], corners[n, (k + 1) % 3], corners[n, (k + 2) % 3]
            middle = (a + b) / 2
            if name == "normals":
                middle /= np.linalg.norm(middle, axis=1, keepdims=True)
            out += [replace(some, **{name: np.stack([end, middle, c], axis=1)}) for end in (a, b)]
        return SurfaceParts.joined(out)


def angle(a: Array, b: Array) -> Array:
    """[rad] between vectors (..., 3) of any length: 0 or pi to full precision."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


@dataclass(frozen=True, eq=False)
class ConvexSolid:
    """A convex solid in the object's frame.

    Attributes:
        kind: a key of `SOLID_SIZES`. size: [m] radius; radius and length along z; three semi-axes.
        pose: (4, 4) of its own frame. vertices, faces: of a mesh, wound outwards, in the object's frame.
    """

    kind: str
    size: tuple[float, ...]
    pose: Array
    vertices: Array
    faces: Integers

    @classmethod
    def read(cls, f: Fields) -> ConvexSolid:
        """From a file."""
        kind = f.text("kind", among=tuple(SOLID_SIZES))
        size = f.numbers("size", (SOLID_SIZES[kind],), [])
        pose = f.numbers("pose", (4, 4), np.eye(4).tolist())
        vertices, faces = f.numbers("vertices", (-1, 3), []), f.numbers("faces", (-1, 3), [])
        f.done()
        off = np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max()
        if (size <= 0).any() or off > SOLID_POSE_TOLERANCE or np.linalg.det(pose[:3, :3]) < 0:
            raise BadFile("has a size that is not positive, or a pose that is not rigid", f.place)
        if kind == "mesh" and not (len(faces) and faces.min() >= 0 and faces.max() < len(vertices)):
            raise BadFile("has no faces, or one with a vertex that is not there", f.place)
        if (faces % 1).any() or (len(vertices) and (kind != "mesh" or (pose != np.eye(4)).any())):
            raise BadFile("has faces that are no whole numbers, or vertices beside a size or a pose", f.place)
        return cls(kind, tuple(size.tolist()), pose, vertices, faces.astype(np.int64))

    def parts(self) -> SurfaceParts | None:
        """Of its surface; None of a mesh that is not closed or not convex."""
        if self.kind == "mesh":
            return self._of_mesh()
        R, origin = self.pose[:3, :3], self.pose[:3, 3]
        local = SurfaceParts.joined(list(self._local()))
        return replace(local, points=local.points @ R.T + origin, normals=local.normals @ R.T)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of a box about it."""
        lower, upper = self.farthest(np.vstack([-np.eye(3), np.eye(3)])).reshape(2, 3, 3)
        return np.diagonal(lower), np.diagonal(upper)

    @cached_property
    def middle(self) -> Array:
        """(3,) a point inside."""
        return np.asarray(self.vertices.mean(axis=0) if self.kind == "mesh" else self.pose[:3, 3])

    def reach(self, center: Array) -> float:
        """[m] from a point to the farthest of the solid, at least."""
        corners = self.vertices if self.kind == "mesh" else self.pose[None, :3, 3]
        return float(np.linalg.norm(corners - center, axis=1).max()) * (1 + 1e-12) + sum(self.size)

    def farthest(self, normals: Array) -> Array:
        """(N, 3) [m] the points that are farthest along unit vectors (N, 3)."""
        if self.kind == "mesh":
            return np.asarray(self.vertices[(normals @ self.vertices.T).argmax(axis=1)])
        n, s, up = normals @ self.pose[:3, :3], self.size, np.array([0.0, 0.0, 1.0])
        if self.kind == "ellipsoid":
            local = n * np.array(s) ** 2 / np.linalg.norm(n * np.array(s), axis=1, keepdims=True)
        else:
            flat = n * (1 - up) if self.kind == "cylinder" else n
            local = s[0] * flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
            local += np.sign(n[:, 2:]) * up * (s[1] / 2 if len(s) > 1 else 0.0)
        return np.asarray(local @ self.pose[:3, :3].T + self.pose[:3, 3])

    @cached_property
    def _planes(self) -> tuple[Array, Array]:
        """Unit normals (k, 3) of a mesh's faces, NaN where one has no area, and heights (k,)."""
        a, b, c = self.vertices[self.faces].swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        with np.errstate(all="ignore"):
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            sides = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1)
            for k in np.flatnonzero(~(size[:, 0] > MIN_SINE * sides)):  # rounding would turn the normal
                normal[k] = self._normal(self.faces[k])
                size[k] = np.linalg.norm(normal[k])
            normal /= size
        return normal, (a * normal).sum(axis=1)

    def _normal(self, face: Integers) -> Array:
        """(3,) along a face's normal, of rational numbers rounded once; 0 where it has no area."""
        a, b, c = (rationals(v) for v in self.vertices[face].tolist())
        exact = cross([x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)])
        return floats([x / (max(map(abs, exact)) or 1) for x in exact])

    def _of_mesh(self) -> SurfaceParts | None:
        corners, (normal, _) = self.vertices[self.faces], self._planes
        # over each face nothing is above it
        if not -self.depth(self.vertices).min() <= CONVEXITY_TOLERANCE * np.ptp(self.vertices, axis=0).max():
            return None
        starts, ends = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        face = np.repeat(np.arange(len(self.faces)), 3)
        edges = list(zip(starts.tolist(), ends.tolist(), strict=True))
        other = {(b, a): k for k, (a, b) in enumerate(edges)}
        if len(other) != len(edges) or not other.keys() >= set(edges):
            return None
        across = face[[other[edge] for edge in edges]]
        middle = np.zeros_like(self.vertices)
        np.add.at(middle, starts, normal[face])
        length = np.linalg.norm(middle, axis=1, keepdims=True)
        middle /= np.maximum(length, 1e-300)
        spread = np.zeros(len(middle))  # of the normals at a vertex: many edges that are all but flat may make a corner
        np.maximum.at(spread, starts, angle(normal[face], middle[starts]))
        bent = np.flatnonzero((starts < ends) & (angle(normal[face], normal[across]) > EQUAL_NORMAL_ANGLE))
        edge = self.vertices[np.stack([starts, ends, starts], axis=1)[bent]]
        fan = np.flatnonzero((spread[starts] > EQUAL_NORMAL_ANGLE / 2) & (normal[face] != normal[across]).any(axis=1))
        left, right = normal[face], normal[across]
        return SurfaceParts.joined(
            [
                SurfaceParts.of(corners, np.repeat(normal[:, None], 3, axis=1)),
                SurfaceParts.of(edge, np.stack([left, right, left], axis=1)[bent]),
                SurfaceParts.of(
                    np.repeat(self.vertices[starts[fan]][:, None], 3, axis=1),
                    np.stack([middle[starts], left, right], axis=1)[fan],
                ),
            ]
        )

    def _local(self) -> Sequence[SurfaceParts]:
        """Of a round solid, in its own frame."""
        r, up = self.size[0], np.array([0.0, 0.0, 1.0])
        if self.kind == "sphere":
            return [SurfaceParts.of(np.zeros((8, 3, 3)), EIGHTHS, r)]
        if self.kind == "ellipsoid":
            m = EIGHTHS
            for _ in range(ELLIPSOID_QUARTERINGS):
                a, b, c = np.moveaxis(m, 1, 0)
                ab, bc, ca = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (a + b, b + c, c + a))
                m = np.concatenate([np.stack(v, axis=1) for v in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
            deep = 1 - np.linalg.norm(m.mean(axis=1), axis=1).min()  # of the sphere below which no triangle goes
            normals = m / np.array(self.size)
            normals /= np.linalg.norm(normals, axis=2, keepdims=True)
            return [SurfaceParts.of(m * np.array(self.size), normals, slack=2 * deep * max(self.size))]
        h = self.size[1] / 2 * up
        turns = np.arange(RIM_PARTS + 1) * 2 * np.pi / RIM_PARTS
        e = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
        first, last = e[:-1], e[1:]
        quarter = e[:: RIM_PARTS // 4]
        sides = np.stack([quarter[:-1], quarter[1:], quarter[:-1]], axis=1)
        side = SurfaceParts.of(np.tile(np.array([-h, h, h]), (4, 1, 1)), sides, r)
        if self.kind == "capsule":
            tops = np.where(EIGHTHS[:, 2, 2] > 0, 1.0, -1.0)[:, None, None] * h
            return [side, SurfaceParts.of(np.repeat(tops, 3, axis=1), EIGHTHS, r)]
        corner = (first + last) / (1 + (first * last).sum(axis=1, keepdims=True))  # where tangents meet
        out = [side]
        for z in (1.0, -1.0):
            normal = np.broadcast_to(z * up, first.shape)
            flat = np.stack([first * 0, r * first, r * corner], axis=1)
            rest = np.stack([first * 0, r * corner, r * last], axis=1)
            rim = np.stack([r * first, r * corner, r * last], axis=1)
            out += [SurfaceParts.of(p + z * h, np.stack([normal] * 3, axis=1)) for p in (flat, rest)]
            out += [SurfaceParts.of(rim + z * h, np.stack([first, last, normal], axis=1))]
        return out

    def depth(self, points: Array) -> Array:
        """(...) [m] how far points (..., 3) lie below the surface; a concave function, below 0 outside."""
        if self.kind == "mesh":
            out = np.full(points.shape[:-1], np.inf)
            step = max(1, DEPTH_BATCH // max(1, out.size))
            for normal, height in zip(*(np.split(a, range(step, len(a), step)) for a in self._planes), strict=True):
                np.minimum(out, (height - points @ normal.T).min(axis=-1), out=out)
            return out
        p, s = (points - self.pose[:3, 3]) @ self.pose[:3, :3], self.size
        if self.kind == "ellipsoid":
            return np.asarray((1 - np.linalg.norm(p / np.array(s), axis=-1)) * min(s))
        if self.kind == "cylinder":
            return np.minimum(s[0] - np.linalg.norm(p[..., :2], axis=-1), s[1] / 2 - np.abs(p[..., 2]))
        along = np.clip(p[..., 2], -s[1] / 2, s[1] / 2) if self.kind == "capsule" else 0.0 * p[..., 2]
        return np.asarray(s[0] - np.linalg.norm(p - along[..., None] * np.array([0, 0, 1]), axis=-1))


def hidden(parts: SurfaceParts, solids: Sequence[ConvexSolid]) -> Mask:
    """(N,) parts that are nowhere on the surface: in another solid, which reaches beyond them along each normal.

    What is in a solid once it is moved to the solid's middle by the distance at which solids touch is that near it; and
    so is all between.
    """
    axis, half = parts.cones()
    narrow, far = half < MAX_NORMAL_CONE, parts.radius[:, None, None]
    raised = (parts.points[:, :, None] + far[..., None] * parts.normals[:, None]).reshape(-1, 9, 3)
    bulge = parts.radius * (1 / np.cos(half) - 1) + parts.slack  # of arcs over their chords
    low, high = raised.min(axis=1), raised.max(axis=1)
    out = np.zeros(len(parts), dtype=bool)
    corners = np.array([solid.box for solid in solids])
    length = float(np.ptp(corners, axis=(0, 1)).max())
    lost = LOST_DEPTH * float(np.abs(corners).max())
    touch, cover = SOLID_TOUCH_DISTANCE * length, COVER_DISTANCE * length + lost
    for k, solid in enumerate(solids):
        inside = (low >= solid.box[0] - touch).all(axis=1) & (high <= solid.box[1] + touch).all(axis=1)
        its = np.flatnonzero(~out & narrow & inside & (parts.solid != k))
        for some in np.split(its, range(SOLID_BATCH, len(its), SOLID_BATCH)):
            ways = solid.farthest(axis[some])[:, None] - parts.points[some]
            beyond = (
                (ways @ parts.normals[some].swapaxes(1, 2)).min(axis=(1, 2)) - parts.radius[some] - parts.slack[some]
            )
            out_by = raised[some] - solid.middle
            moved = touch / np.maximum(np.linalg.norm(out_by, axis=2, keepdims=True), touch)
            within = solid.depth(raised[some] - moved * out_by).min(axis=1) >= bulge[some] + lost
            out[some] = within & (beyond >= cover)
    return out
