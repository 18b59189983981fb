"""Shape: the convex solids that hand links and objects are made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import MAX_COORDINATE, rigid
from handfast.proofs.constants import SIZE_COUNTS

Kind = Literal["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]
Faces = NDArray[np.int64]  # (k, 3) indices of vertices
Mesh = tuple[Array, Faces]  # with vertices (n, 3)

RIM_POINTS = 16  # points that stand for the rim of a cylinder
MIN_SOLID_SIZE = 1e-9  # [m] a solid smaller than this, or reaching further than `MAX_COORDINATE`, is in another unit


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex solid with its own frame, placed in the frame of the link or object that carries it.

    Attributes:
        kind: box, sphere, capsule, cylinder, ellipsoid or mesh.
        size: [m] box: the three full edges; sphere: radius; capsule and cylinder: radius and length
            (a capsule's without its caps) along the shape's z; ellipsoid: three semi-axes; mesh: ().
        pose: (4, 4) shape frame in the carrier's frame, a rigid motion.
        vertices: (n, 3) [m] of a mesh, shape frame; (0, 3) for the other kinds.
        faces: (k, 3) triangles of a mesh, wound outwards.
        name: for reports.

    Raises:
        InputError: wrong number of sizes, a size that is not positive, a pose that is not rigid, lengths that are
            not within `MIN_SOLID_SIZE` and `MAX_COORDINATE`.
    """

    kind: Kind
    size: tuple[float, ...]
    pose: Array
    vertices: Array
    faces: Faces
    name: str = ""

    def __init__(
        self,
        kind: Kind,
        size: object = (),
        pose: object = None,
        vertices: object = (),
        faces: object = (),
        name: str = "",
    ) -> None:
        put = object.__setattr__
        if kind not in SIZE_COUNTS:
            raise InputError(f"is '{kind}'; known: {', '.join(SIZE_COUNTS)}", field="shape.kind")
        numbers = np.atleast_1d(np.asarray(size, dtype=float)).ravel()
        if len(numbers) != SIZE_COUNTS[kind]:
            raise InputError(f"has {len(numbers)} numbers, not {SIZE_COUNTS[kind]}", field=f"{kind}.size")
        if not (np.isfinite(numbers).all() and (numbers > 0).all()):
            raise InputError(f"is {numbers.tolist()}; sizes are positive and finite", field=f"{kind}.size")
        if len(numbers) and not (numbers.min() >= MIN_SOLID_SIZE and numbers.max() <= MAX_COORDINATE):
            problem = f"is {numbers.tolist()}; sizes are {MIN_SOLID_SIZE:g} to {MAX_COORDINATE:g} m"
            raise InputError(problem, field=f"{kind}.size")
        put(self, "kind", kind)
        put(self, "size", tuple(float(s) for s in numbers))
        put(self, "pose", rigid(np.eye(4) if pose is None else pose, f"{kind}.pose"))
        n = len(vertices) if kind == "mesh" else 0  # type: ignore[arg-type]
        put(self, "vertices", frozen(vertices if n else np.zeros((0, 3)), (n, 3), "mesh.vertices"))
        refuse_far(self.vertices, "mesh")
        triangles = np.array(faces if n else np.zeros((0, 3)), dtype=np.int64).reshape(-1, 3)
        triangles.flags.writeable = False
        put(self, "faces", triangles)
        put(self, "name", name)

    @classmethod
    def hull(cls, points: object, pose: object = None, name: str = "") -> Shape:
        """The convex hull of (n, 3) points [m] as a mesh shape.

        Raises:
            InputError: fewer than four points, not finite, or all in one plane.
        """
        from scipy.spatial import ConvexHull, QhullError

        p = np.asarray(points, dtype=float).reshape(-1, 3)
        refuse_far(p, name or "mesh")
        p = np.unique(p, axis=0)
        try:
            found = ConvexHull(p)
        except (QhullError, ValueError):
            raise InputError("is flat; a solid is needed", field=name or "mesh") from None
        index = np.full(len(p), -1)
        index[found.vertices] = np.arange(len(found.vertices))
        corners = p[found.simplices]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inward = np.einsum("ij,ij->i", normal, found.equations[:, :3]) < 0
        triangles = np.where(inward[:, None], found.simplices[:, ::-1], found.simplices)
        return cls("mesh", (), pose, p[found.vertices], index[triangles], name)

    def placed(self, pose: object, name: str | None = None) -> Shape:
        """The same solid carried by a frame in which its carrier now stands at `pose` (4, 4)."""
        label = self.name if name is None else name
        return Shape(self.kind, self.size, np.asarray(pose) @ self.pose, self.vertices, self.faces, label)

    @cached_property
    def planes(self) -> Array:
        """(k, 4) outward face planes (n, d) of a box or mesh, n.x + d <= 0 inside, shape frame."""
        if self.kind == "box":
            axes = np.vstack([np.eye(3), -np.eye(3)])
            return np.column_stack([axes, -np.tile(np.array(self.size) / 2, 2)])
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        n = np.cross(b - a, c - a)
        length = np.linalg.norm(n, axis=1)
        keep = length > 1e-14  # a sliver has no direction of its own
        n = n[keep] / length[keep, None]
        return np.column_stack([n, -np.einsum("ij,ij->i", n, a[keep])])

    @cached_property
    def corners(self) -> Array:
        """(n, 3) vertices of a box or mesh, shape frame."""
        if self.kind == "box":
            signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
            return signs * np.array(self.size) / 2
        return self.vertices

    @cached_property
    def volume(self) -> float:
        """[m^3]."""
        s = self.size
        match self.kind:
            case "box":
                return s[0] * s[1] * s[2]
            case "sphere":
                return 4 / 3 * np.pi * s[0] ** 3
            case "capsule":
                return np.pi * s[0] ** 2 * s[1] + 4 / 3 * np.pi * s[0] ** 3
            case "cylinder":
                return np.pi * s[0] ** 2 * s[1]
            case "ellipsoid":
                return 4 / 3 * np.pi * s[0] * s[1] * s[2]
        return volume_and_centroid(self.vertices, self.faces)[0]

    @cached_property
    def centroid(self) -> Array:
        """(3,) [m] centre of volume in the carrier's frame."""
        local = volume_and_centroid(self.vertices, self.faces)[1] if self.kind == "mesh" else np.zeros(3)
        return self.pose[:3, :3] @ local + self.pose[:3, 3]

    def depth(self, points: Array) -> Array:
        """(n,) how far (n, 3) points, in the carrier's frame, lie below the surface; negative outside.

        Exact inside a box, mesh, sphere, capsule or cylinder; for an ellipsoid a lower bound there.
        Outside only the sign is meant.
        """
        p = (np.atleast_2d(points) - self.pose[:3, 3]) @ self.pose[:3, :3]
        s = self.size
        match self.kind:
            case "sphere":
                return s[0] - np.linalg.norm(p, axis=1)
            case "capsule":
                along = np.clip(p[:, 2], -s[1] / 2, s[1] / 2)
                return s[0] - np.linalg.norm(p - np.outer(along, [0, 0, 1]), axis=1)
            case "cylinder":
                return np.minimum(s[0] - np.linalg.norm(p[:, :2], axis=1), s[1] / 2 - np.abs(p[:, 2]))
            case "ellipsoid":
                return (1 - np.linalg.norm(p / s, axis=1)) * min(s)
        return -(p @ self.planes[:, :3].T + self.planes[:, 3]).max(axis=1)

    def feature(self, direction: Array, tolerance: float) -> Array:
        """(k, 3) points spanning what lies furthest along a unit `direction`, to within `tolerance` [m].

        A vertex, an edge or a face: one point, two, or several. Everything in the carrier's frame.
        """
        R, n = self.pose[:3, :3], self.pose[:3, :3].T @ direction
        s = self.size
        match self.kind:
            case "sphere":
                points = n[None] * s[0]
            case "ellipsoid":
                points = (np.array(s) ** 2 * n / np.linalg.norm(np.array(s) * n))[None]
            case "capsule":
                points = np.array([[0, 0, s[1] / 2], [0, 0, -s[1] / 2]]) + n * s[0]
            case "cylinder":
                start = np.arctan2(n[1], n[0])  # so that the exact side line is among the points
                around = start + np.arange(RIM_POINTS) * 2 * np.pi / RIM_POINTS
                ring = np.column_stack([s[0] * np.cos(around), s[0] * np.sin(around)])
                points = np.vstack([np.column_stack([ring, np.full(RIM_POINTS, z)]) for z in (-s[1] / 2, s[1] / 2)])
            case _:
                points = self.corners
        height = points @ n
        return points[height >= height.max() - tolerance] @ R.T + self.pose[:3, 3]

    def triangles(self) -> tuple[Array, Faces]:
        """Vertices (n, 3) [m] in the carrier's frame and faces (k, 3), for drawing; curves are faceted."""
        local = self if self.kind == "mesh" else _faceted(self.kind, self.size)
        return local.vertices @ self.pose[:3, :3].T + self.pose[:3, 3], local.faces


@lru_cache(maxsize=256)  # hands are of few sizes, and are read again and again
def _faceted(kind: Kind, size: tuple[float, ...]) -> Shape:
    """A solid that is no mesh as one, in its own frame."""
    if kind == "box":
        return Shape.hull(Shape(kind, size).corners)
    around, up = np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-np.pi / 2, np.pi / 2, 13)
    u, v = (a.ravel() for a in np.meshgrid(around, up))
    ball = np.column_stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)])
    ends = np.array([[[0, 0, -0.5]], [[0, 0, 0.5]]])
    match kind:
        case "sphere":
            points = ball * size[0]
        case "ellipsoid":
            points = ball * np.array(size)
        case "capsule":
            points = (ball * size[0] + ends * size[1]).reshape(-1, 3)
        case _:
            rim = ball[np.abs(ball[:, 2]) < 1e-9] * size[0]
            points = (rim + ends * size[1]).reshape(-1, 3)
    return Shape.hull(points.round(12))


def refuse_far(points: Array, field: str) -> None:
    """`InputError` unless points (n, 3) [m] are finite, within `MAX_COORDINATE`, and further apart than
    `MIN_SOLID_SIZE`."""
    if not np.isfinite(points).all():
        raise InputError("has a vertex that is NaN or infinite", field=field)
    if len(points) and np.abs(points).max() > MAX_COORDINATE:
        raise InputError(
            f"has a vertex at {np.abs(points).max():.3g} m; at most {MAX_COORDINATE:g} m is possible", field=field
        )
    if len(points) and np.ptp(points, axis=0).max() < MIN_SOLID_SIZE:
        raise InputError(f"is smaller than {MIN_SOLID_SIZE:g} m; is its scale right?", field=field)


def volume_and_centroid(vertices: Array, faces: Faces) -> tuple[float, Array]:
    """Signed volume [m^3] and centre of volume (3,) of a closed triangle mesh (inside out: negative)."""
    middle = vertices.mean(axis=0)  # subtracted so that a mesh far from its origin loses no digits
    a, b, c = (vertices[faces[:, i]] - middle for i in range(3))
    parts = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    volume = float(parts.sum())
    if abs(volume) < 1e-18:
        return 0.0, middle
    return volume, middle + (parts[:, None] * (a + b + c)).sum(axis=0) / 4 / volume
