"""Curvature: do two surfaces that touch with opposite normals curve into each other?

A surface is described at a point by its curvature tensor K (3, 3), symmetric, with K n = 0: the second
fundamental form, k1 t1 t1' + k2 t2 t2' for the principal curvatures k1, k2 [1/m] and their directions (do
Carmo, Differential Geometry of Curves and Surfaces, 1976, section 3-2). Its sign is such that a convex solid
has positive curvature: the unit outward normal changes by +K x along a small tangent step x, and the surface
falls away by x'K x / 2. Two solids that touch are therefore (x'(K_hand + K_object) x) / 2 apart at a tangent
step x from the contact, to second order (Montana, The kinematics of contact and grasp, IJRR 1988: relative
curvature), and interpenetrate next to it if the sum has a negative eigenvalue on the tangent plane.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import unit
from handfast.model.region import VANISHES, Cap, Region


def patch_curvature(patch: Region, u: float, v: float) -> Array:
    """(3, 3) [1/m] the curvature tensor of a region at parameters u, v, in the region's frame.

    Raises:
        InputError: the region has no normal there.
    """
    along = np.stack([patch.at(u, v, 1, 0), patch.at(u, v, 0, 1)])  # (2, 3)
    normal = patch.normal(u, v)
    length = np.linalg.norm(normal)
    if not length > VANISHES * patch.longest_normal:
        raise InputError(f"has no normal at u = {u:.3g}, v = {v:.3g}, so no curvature either", field=patch.kind)
    mixed = patch.at(u, v, 1, 1)
    second = np.array([[patch.at(u, v, 2, 0), mixed], [mixed, patch.at(u, v, 0, 2)]])  # (2, 2, 3)
    dual = np.linalg.solve(along @ along.T, along)  # (2, 3) with dual_i . along_j = 1 if i = j, else 0
    return -dual.T @ (second @ (normal / length)) @ dual


def cap_curvature(cap: Cap, normal: object) -> Array:
    """(3, 3) [1/m] the curvature tensor of a cap where its unit normal (3,) is so or opposite: 1 / radius all round.

    Negative for a flipped cap, which is a hollow.
    """
    n = unit(normal, "normal")
    return cap.sign / cap.radius * (np.eye(3) - np.outer(n, n))


def principal_curvatures(tensor: Array, normal: object) -> Array:
    """(2,) [1/m] the eigenvalues of a tensor (3, 3) on the plane across a unit normal (3,), ascending."""
    n = unit(normal, "normal")
    across = np.linalg.svd(n[None])[2][1:]  # (2, 3)
    return np.linalg.eigvalsh(across @ tensor @ across.T)


def relative_curvature(hand: Array, object: Array, normal: object) -> float:
    """[1/m] the least curvature of one surface against another that it touches; negative: they interpenetrate.

    Args:
        hand, object: (3, 3) curvature tensors, of one frame.
        normal: (3,) unit, the common normal in that frame, either way round.
    """
    return float(principal_curvatures(hand + object, normal)[0])


def rim_depth(curvature: object, radius: float) -> Array:
    """[m] how deep two surfaces interpenetrate at most on a disc about their contact, to second order.

    Args:
        curvature: (...) [1/m] relative curvatures.
        radius: [m] of the disc.
    """
    return 0.5 * np.maximum(0.0, -np.asarray(curvature, dtype=float)) * radius**2


def curvature_at(region: Region, at: tuple[float, float] | None, R: Array, normal: Array) -> Array:
    """(3, 3) a region's curvature tensor in the frame in which its carrier has rotation R, as has the normal."""
    if region.ball:
        return cap_curvature(region.ball, normal)
    if at is None:
        raise InputError("needs the parameters of the contact on the patch", field="hand")
    return R @ patch_curvature(region, *at) @ R.T
