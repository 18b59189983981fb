"""Where a gripper of two jaws may start: around two points of the object that press against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.model.hand.anatomy import Anatomy
from handfast.model.hand.hand import Link
from handfast.model.shape import Shape
from handfast.planning.candidates.surface import SurfaceSampler, turned

DRAWS = 20  # of a point, until another is opposite to it
DEEP = 2e-3  # [m] what of a jaw is so near to its innermost point is its face
FACING = 0.8  # cosine of the angle of its normals to the other jaw
SHORT = 1e-6  # length, or sine, below which a direction is none


@dataclass(frozen=True, eq=False)
class Pads:
    """The faces that two jaws turn to each other. Frame: the hand's base.

    Attributes:
        points: (2, 3) [m] their middles.
        line: (3,) unit, the direction in which they face each other, from the first to the second.
    """

    points: Array
    line: Array

    @property
    def width(self) -> float:
        """[m] between them."""
        return max(0.0, float((self.points[1] - self.points[0]) @ self.line))

    @classmethod
    def of(cls, anatomy: Anatomy, tips: tuple[int, ...], q: Array) -> Pads:
        """Of two fingertips at q (l,): what of their solids is innermost, and which way that faces."""
        first, second = anatomy.middles(q, tips)
        apart = second - first
        length = float(np.linalg.norm(apart))
        towards = apart / length if length > SHORT else np.eye(3)[0]
        poses = anatomy.hand.link_poses(q)
        faces = [_face(anatomy.hand.links[i], poses[i], s * towards) for i, s in zip(tips, (1, -1), strict=True)]
        line = faces[0][1] - faces[1][1]
        return cls(np.array([point for point, _ in faces]), line / max(float(np.linalg.norm(line)), SHORT))


def _face(link: Link, pose: Array, towards: Array) -> tuple[Array, Array]:
    """The middle (3,) [m] of what of a link is outermost in a direction (3,), and its mean normal (3,), unit."""
    solids = [(vertices @ pose[:3, :3].T + pose[:3, 3], faces) for vertices, faces in map(Shape.triangles, link.shapes)]
    a, b, c = np.vstack([vertices[faces] for vertices, faces in solids]).swapaxes(0, 1)
    corners = np.vstack([vertices for vertices, _ in solids])
    height = corners @ towards
    outermost = corners[height > height.max() - DEEP]
    normals = np.cross(b - a, c - a)
    within = np.minimum(np.minimum(a @ towards, b @ towards), c @ towards) > height.max() - DEEP
    within &= normals @ towards > FACING * np.linalg.norm(normals, axis=1)
    normal = normals[within].sum(axis=0) if within.any() else towards
    return (outermost.min(axis=0) + outermost.max(axis=0)) / 2, normal / np.linalg.norm(normal)


def antipodal(rng: np.random.Generator, surface: SurfaceSampler, width: float) -> tuple[Array, Array] | None:
    """The middle (3,) [m] of two points of the surface, and the unit direction (3,) from one to the other.

    It goes straight in at the first, as a flat jaw turns an object until they lie on each other, and comes out within
    the friction cone of the second, so that forces along it balance (Nguyen 1988). None after some draws without.

    Args:
        width: [m] they are at most so far apart.
    """
    for _ in range(DRAWS):
        point, normal = surface.draw(rng)
        opposite = surface.opposite(point, -normal)
        if opposite is None:
            continue
        other, facing = opposite
        sliding = np.arccos(min(1.0, abs(float(facing @ normal))))
        if np.linalg.norm(other - point) <= width and np.tan(sliding) <= surface.friction:
            return (point + other) / 2, -normal
    return None


def squeezed(closing: Array, line: Array, seen: tuple[Array, Array] | None, roll: float) -> Array:
    """(3, 3) a rotation of the object that lays a direction of it, `line` (3,), along that in which jaws close.

    Args:
        closing: (3,) unit, from one jaw to the other.
        seen: directions (3,) of the object and of the hand's base frame that come together as far as rolling about the
            line goes; None for the roll [rad].
    """
    R = turned(line, closing, 0.0)
    if seen:
        flat = normal_frame(closing)[:, 1:]
        of, to = (R @ seen[0]) @ flat, seen[1] @ flat
        roll = float(np.arctan2(to[1], to[0]) - np.arctan2(of[1], of[0]))
    return turned(line, closing, roll)
