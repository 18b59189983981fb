"""Measures of the grasp map alone: its singular values."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array


def smallest_singular_value(G: Array) -> float:
    """The smallest singular value of a (6, 3m) grasp map in a scale: 0 if contacts cannot press in some direction.

    Li and Sastry, *Task-oriented optimal grasping by multifingered robot hands* (1988): how far the grasp is from
    one whose map loses rank. Friction cones have no part in it.
    """
    return float(np.linalg.svd(G, compute_uv=False)[5]) if G.shape[1] >= 6 else 0.0


def ellipsoid_volume(G: Array) -> float:
    """sqrt(det(G G^T)), the volume of the ellipsoid of wrenches of unit contact forces up to a constant.

    Li and Sastry (1988), their second measure.
    """
    return float(np.prod(np.linalg.svd(G, compute_uv=False)[:6])) if G.shape[1] >= 6 else 0.0


def isotropy(G: Array) -> float:
    """Smallest over largest singular value: 1 if contact forces count alike in all directions.

    Kim, Oh, Yi and Suh, *Optimal grasping based on non-dimensionalized performance indices* (IROS 2001).
    """
    if G.shape[1] < 6:
        return 0.0
    sizes = np.linalg.svd(G, compute_uv=False)
    return float(sizes[5] / sizes[0])
