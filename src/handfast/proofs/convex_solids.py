"""Convex solids of hand and object, as a file holds them: how deep a point is at least inside one, in intervals.

A solid stands in the frame of its carrier, a link or the object. Of a mesh the convex hull of its vertices is meant.
Which triangles bound it need not be believed: of a closed surface whose triangles all have a point on their inner side,
the solid angles that the point sees add up to a full turn at least; so it is not outside the convex hull of the
vertices. A point that is at least r below every triangle's plane is therefore the centre of a ball of radius r inside
the hull.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.proofs.constants import SIZE_COUNTS
from handfast.proofs.fields import Array, BadFile, Fields, Integers
from handfast.proofs.intervals import Dual, Interval, cross, dot, join, norm, orthonormal, unit
from handfast.proofs.replay import Refused

SOLID_ROTATION_ERROR = 1e-9  # by which the floats of a solid's rotation may miss a rotation


@dataclass(frozen=True, eq=False)
class SolidData:
    """A convex solid in its carrier's frame.

    Attributes:
        kind: a key of `SIZE_COUNTS`. size: [m] box: full edges; sphere: radius; capsule and cylinder: radius and length
            along z, a capsule's without its caps; ellipsoid: semi-axes; mesh: none.
        rotation: (3, 3), place: (3,) [m] of its own frame.
        vertices: (v, 3) [m] of a mesh, own frame.
        corner: (F, 3) a point of each face of a box or mesh, own frame. normal: (F, 3) outward unit normals.
    """

    kind: str
    size: Array
    rotation: Interval
    place: Array
    vertices: Array
    corner: Array
    normal: Interval

    @classmethod
    def read(cls, f: Fields) -> SolidData:
        """As it stands in a file; a mesh has no faces yet. `BadFile` for what is no solid."""
        kind = f.text("kind", among=tuple(SIZE_COUNTS))
        size, pose = f.numbers("size", (SIZE_COUNTS[kind],)), f.numbers("pose", (4, 4))
        if not (size > 0).all():
            raise BadFile("has a size that is not above 0", f.at("size"))
        vertices = f.numbers("vertices", (-1, 3)) if kind == "mesh" else np.zeros((0, 3))
        f.done()
        rotation = orthonormal(pose[None, :3, 0], pose[None, :3, 1])[0]
        if not np.abs(rotation.mid - pose[:3, :3]).max() <= SOLID_ROTATION_ERROR:
            raise BadFile("is no rotation", f.at("pose"))
        corner = normal = np.zeros((0, 3))
        if kind == "box":
            normal = np.vstack([np.eye(3), -np.eye(3)])
            corner = normal * size / 2
        return cls(kind, size, rotation, pose[:3, 3], vertices, corner, Interval.of(normal))

    def with_faces(self, faces: Integers) -> SolidData:
        """A mesh bounded by triangles (F, 3) of its vertices.

        Raises:
            Refused: they are no closed surface, or the solid is no mesh.
        """
        if self.kind != "mesh" or not len(faces) or not ((faces >= 0) & (faces < len(self.vertices))).all():
            raise Refused("faces are given of what is no mesh, or of vertices that it does not have")
        edges = Counter((a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True))
        if any(count != edges[b, a] for (a, b), count in edges.items()):
            raise Refused("the faces of a mesh are no closed surface")
        a, b, c = (Interval.of(self.vertices[faces[:, i]]) for i in range(3))
        return replace(self, corner=self.vertices[faces[:, 0]], normal=unit(cross(b - a, c - a)))

    def depths(self, x: Dual) -> Dual:
        """(N, F) how far points (N, 3) [m] of the carrier's frame are below each face.

        A ball about a point, of the least of them if that is not negative, is inside the solid. Of a mesh without faces
        nothing is known: (N, 0).
        """
        own = (x - self.place) @ self.rotation
        if self.kind in ("box", "mesh"):
            middle = dot(self.normal, Interval.of(self.corner))  # n.(corner - x)
            return middle - own @ self.normal.swapped()
        size = self.size.tolist()
        if self.kind == "ellipsoid":
            return ((1.0 - norm(own * (Interval.of(1.0) / self.size))) * min(size))[..., None]
        if self.kind == "sphere":
            return (size[0] - norm(own))[..., None]
        along = own[..., 2]
        if self.kind == "cylinder":
            sides = [size[0] - norm(own[..., :2]), size[1] / 2 - along, size[1] / 2 + along]
            return join([a[..., None] for a in sides], -1)
        ends = np.zeros((len(along.value.ends), 3))
        ends[:, 2] = np.clip(
            np.nan_to_num(along.value.mid), -size[1] / 2, size[1] / 2
        )  # a ball about a point of the axis
        return (size[0] - norm(own - ends))[..., None]


@dataclass(frozen=True, eq=False)
class SolidsData:
    """All solids of a question, and which may not overlap.

    Attributes:
        of_link: solids by index of a link. of_object: its own.
        allowed: [m] how deep a link may be in the object (key: its index, -1) or in another one (both indices).
    """

    of_link: dict[int, tuple[SolidData, ...]]
    of_object: tuple[SolidData, ...]
    allowed: dict[tuple[int, int], float]

    @classmethod
    def read(cls, f: Fields, links: list[str]) -> SolidsData:
        """From `question.solids`; `BadFile` with the field and what is wrong."""
        of_link: dict[int, tuple[SolidData, ...]] = {}
        for part in f.objects("links"):
            index = _link(part, "link", links)
            if index in of_link:
                raise BadFile("is there twice", part.place)
            of_link[index] = tuple(SolidData.read(s) for s in part.objects("solids"))
            part.done()
        of_object = tuple(SolidData.read(s) for s in f.objects("object"))
        into = f.number("depth", least=0.0)
        allowed = {(index, -1): into for index in of_link}
        for part in f.objects("pairs"):
            first, second = (_link(part, name, links) for name in ("first", "second"))
            if first == second:
                raise BadFile("is a link with itself", part.place)
            if (first, second) in allowed or (second, first) in allowed:
                raise BadFile("is there twice", part.place)
            allowed[first, second] = part.number("depth", least=0.0)
            part.done()
        f.done()
        return cls(of_link, of_object, allowed)

    def may_not_meet(self, link: int, body: int) -> bool:
        """Is it said how deep the two may be in each other?"""
        return (link, body) in self.allowed or (body, link) in self.allowed

    def depth_allowed(self, link: int, body: int) -> float:
        """[m] how deep a link may be in another, or in the object."""
        return self.allowed[(link, body) if (link, body) in self.allowed else (body, link)]

    def of(self, body: int) -> tuple[SolidData, ...]:
        """Those of a link, or of the object: -1."""
        return self.of_object if body < 0 else self.of_link.get(body, ())


def _link(f: Fields, name: str, links: list[str]) -> int:
    return links.index(f.text(name, among=links))


def solid_to_dict(kind: str, size: Any, pose: Array, vertices: Array) -> dict[str, Any]:
    """As `SolidData.read` wants it."""
    out = {"kind": kind, "size": [float(s) for s in size], "pose": np.asarray(pose).tolist()}
    return out | ({"vertices": np.asarray(vertices).tolist()} if kind == "mesh" else {})
