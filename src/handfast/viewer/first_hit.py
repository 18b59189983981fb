"""Where a ray from the viewer first meets a mesh."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.shape import Faces

EDGE = 1e-9  # a ray through an edge meets both triangles


def first_hit(vertices: Array, faces: Faces, eye: Array, through: Array) -> float:
    """The share of the way from `eye` (3,) to `through` (3,) at which a mesh is first met; 1 if it is not met."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    ray = through - eye
    across = np.cross(ray, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles along the ray
        away = eye - a
        u = np.einsum("ij,ij->i", away, across) / volume
        turned = np.cross(away, b - a)
        v = turned @ ray / volume
        share = np.einsum("ij,ij->i", c - a, turned) / volume
        met = (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1 + EDGE) & (share > 0) & (share < 1)
    return float(share[met].min(initial=1.0))
