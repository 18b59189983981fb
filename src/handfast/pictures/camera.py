"""Where to look from: directions, and those from which contacts can be seen past the hand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp

TILT = Rotation.from_euler("yx", [-25.0, 22.0], degrees=True).as_matrix()  # of the first view, out of the flat one
RAY_TOLERANCE = 1e-9  # a ray through an edge meets both triangles
CONTACT_OFFSET = 1e-3  # [m] from a contact, the point that is to be seen
AZIMUTHS, ELEVATIONS = range(0, 360, 45), (-25, 15, 50)  # [degrees] azimuths and elevations that are tried
STEEP_PENALTY = 0.2  # of a contact: for how much more of them one looks from far above or below


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look along: rows of `matrix` are right, up and towards the viewer."""

    title: str
    matrix: Array

    @classmethod
    def of(cls, azimuth: float, elevation: float, title: str) -> View:
        a, e = np.radians([azimuth, elevation])
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(title, np.array([right, np.cross(back, right), back]))


ALONG = {
    "x": View("seen from +x", np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])),
    "y": View("seen from −y", np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])),
    "z": View("seen from +z", np.eye(3)),
}


def views(grasp: Grasp, count: int = 2) -> list[View]:
    """The axis view in which the contacts spread most, one at an angle, then the other axes."""
    p = grasp.positions
    flat = sorted("xyz", key=lambda a: float(np.var(p[:, "xyz".index(a)])))
    order = [ALONG[flat[0]], View.of(-55.0, 28.0, "at an angle"), *(ALONG[a] for a in flat[1:])]
    return order[:count]


def upright(matrix: Array, up: Array) -> Array:
    """(3, 3) rows right, up, towards the viewer: the view nearest to another in which `up` (3,) points up."""
    up = up / np.linalg.norm(up)
    back = max((b - (b @ up) * up for b in (matrix[2], matrix[1], matrix[0])), key=lambda b: round(float(b @ b), 3))
    back /= np.linalg.norm(back)
    return np.array([np.cross(up, back), up, back])


def around(up: Array) -> list[View]:
    """Views from all sides in which `up` (3,) points up, those from a little above first."""
    third = up / np.linalg.norm(up)
    base = Rotation.align_vectors(np.eye(3)[2:], third[None])[0].as_matrix()
    sides = [(a, e) for e in sorted(ELEVATIONS, key=lambda e: abs(e - ELEVATIONS[1])) for a in AZIMUTHS]
    return [View(f"{a}° around, {e}° above", View.of(a, e, "").matrix @ base) for a, e in sides]


def in_view(view: View, points: Array, normals: Array, triangles: Array) -> float:
    """How many points (b, 3) can be seen past triangles (n, 3, 3), and how much of the length of normals there."""
    far = 10.0 * max(1.0, float(np.abs(triangles).max(initial=0.0)))
    seen = sum(first_hit(triangles, p, p + far * view.matrix[2]) == 1.0 for p in points)
    return seen + float(np.linalg.norm(np.cross(normals, view.matrix[2]), axis=1).mean())


def clearest(views: Iterable[View], grasp: Grasp, triangles: Array) -> View:
    """The view in which most contacts of a grasp can be seen past the hand's triangles (n, 3, 3)."""
    normals = np.array([c.normal for c in grasp.contacts])
    points = grasp.positions + CONTACT_OFFSET * normals
    scores = [
        (in_view(v, points, normals, triangles) - STEEP_PENALTY * (k >= len(AZIMUTHS)), v) for k, v in enumerate(views)
    ]
    return max(scores, key=lambda s: s[0])[1]


def first_hit(triangles: Array, eye: Array, through: Array) -> float:
    """The share of the way from `eye` (3,) to `through` (3,) at which one of (n, 3, 3) is first met; 1 if none is."""
    a, b, c = (triangles[:, k] for k in range(3))
    ray = through - eye
    across = np.cross(ray, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles along the ray
        away = eye - a
        u = np.einsum("ij,ij->i", away, across) / volume
        turned = np.cross(away, b - a)
        v = turned @ ray / volume
        share = np.einsum("ij,ij->i", c - a, turned) / volume
        met = (u >= -RAY_TOLERANCE) & (v >= -RAY_TOLERANCE) & (u + v <= 1 + RAY_TOLERANCE) & (share > 0) & (share < 1)
    return float(share[met].min(initial=1.0))
