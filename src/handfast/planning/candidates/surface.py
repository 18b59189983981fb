"""Points of an object's surface, drawn at random, and what lies opposite to them."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.model.body import Body

ITSELF = 1e-4  # [m] along a ray, what is nearer is the face where it began


class SurfaceSampler:
    """Points on an object's mesh, equally likely everywhere on its surface. Object frame.

    Attributes:
        middle: (3,) [m] the centre of mass.
        friction: coefficient of the object.
    """

    def __init__(self, body: Body) -> None:
        a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        double = np.linalg.norm(cross, axis=1)
        kept = double > 1e-12
        self._corners = a[kept], b[kept], c[kept]
        self._normals = cross[kept] / double[kept, None]
        self._share = double[kept] / double[kept].sum()
        self.middle, self.friction = body.center_of_mass, body.friction

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """A point (3,) [m] and the unit normal (3,) out of the object there.

        A mesh may be wound either way, so a normal that looks at the centre of mass is turned round.
        """
        k = rng.choice(len(self._share), p=self._share)
        u, v = rng.random(2)
        u, v = (u, v) if u + v <= 1 else (1 - u, 1 - v)
        a, b, c = (x[k] for x in self._corners)
        point, normal = a + u * (b - a) + v * (c - a), self._normals[k]
        return point, normal if normal @ (point - self.middle) >= 0 else -normal

    def opposite(self, point: Array, inwards: Array) -> tuple[Array, Array] | None:
        """Where a ray from a point (3,) [m] of the surface first meets it again, and the unit normal there, of
        either sense; None if it does not.

        Source: T. Möller, B. Trumbore, Fast, minimum storage ray-triangle intersection, 1997.
        """
        a, b, c = self._corners
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
