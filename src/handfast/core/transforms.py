"""Rigid transforms, rotations and the one frame that is made from a normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError

_AFTER, _BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])  # which coordinates follow x, y, z, and come before them
MAX_COORDINATE = 1e6  # [m] what reaches further is in another unit


def cross(a: Array, b: Array) -> Array:
    """(3,) a x b of two 3-vectors; numpy's own takes twenty times as long for so little."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def cross_rows(a: Array, b: Array) -> Array:
    """(..., 3) a x b of many vectors (..., 3); `np.cross` takes several times as long."""
    (a1, a2), (b1, b2) = ((x.take(_AFTER, axis=-1), x.take(_BEFORE, axis=-1)) for x in (a, b))
    out: Array = a1 * b2 - a2 * b1
    return out


def normal_frame(normal: Array) -> Array:
    """(3, 3) orthonormal columns n, t1, t2, right-handed, made from the unit vector n (3,) alone.

    t1 = n x e with e the coordinate axis that n is least aligned with (the first of them, if several are), and
    t2 = n x t1. Every tangent in this package is one of these two, up to its sign.
    """
    e = np.zeros(3)
    e[np.argmin(np.abs(normal))] = 1.0  # keeps the product large
    t1 = cross(normal, e)
    t1 /= np.linalg.norm(t1)
    return np.column_stack([normal, t1, cross(normal, t1)])


def normal_frames(normals: Array) -> Array:
    """(..., 3, 3) the `normal_frame` of each normal (..., 3), but for rounding."""
    e = np.eye(3)[np.abs(normals).argmin(axis=-1)]
    t1 = cross_rows(normals, e)
    t1 /= np.sqrt((t1 * t1).sum(axis=-1))[..., None]
    return np.stack([normals, t1, cross_rows(normals, t1)], axis=-1)


def transform(position: ArrayLike, rotation: ArrayLike | None = None) -> Array:
    """(4, 4) from a position (3,) [m] and a rotation matrix (3, 3)."""
    T = np.eye(4)
    T[:3, 3] = position
    if rotation is not None:
        T[:3, :3] = rotation
    return T


def rigid(pose: object, field: str = "pose") -> Array:
    """`pose` as a read-only (4, 4) rigid motion; `InputError` unless it is one to 1e-6, at most `MAX_COORDINATE`
    away."""
    T = frozen(pose, (4, 4), field)
    R = np.clip(T[:3, :3], -2, 2)  # no product overflows, and what is clipped turns nothing
    turns = np.abs(R @ R.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0
    if not turns or np.abs(T[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise InputError("is not a rigid motion; a rotation and a translation are needed", field=field)
    if np.abs(T[:3, 3]).max() > MAX_COORDINATE:
        raise InputError(f"is more than {MAX_COORDINATE:g} m away", field=field)
    return T


def roll_pitch_yaw(r: float, p: float, y: float) -> Array:
    """(3, 3) turned by r about x, then p about y, then y about z [rad], all of the fixed frame."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (r, p, y))
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(Rz @ Ry @ Rx)


def quaternion_matrix(q: object) -> Array:
    """(3, 3) rotation of a unit quaternion (w, x, y, z); it is normalised first. `InputError` if that is impossible."""
    given = np.asarray(q, dtype=float)
    length = float(np.linalg.norm(given))
    if not 0 < length < np.inf:
        raise InputError(f"is {given.tolist()}; a unit quaternion w, x, y, z is needed", field="quaternion")
    w, x, y, z = given / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def nearest_rotation(R: Array) -> Array:
    """(3, 3) the rotation next to a matrix that is one but for rounding."""
    u, _, vt = np.linalg.svd(R)
    return np.asarray(u @ vt)


def matrix_quaternion(R: Array) -> Array:
    """(4,) unit quaternion (w, x, y, z) of a rotation matrix (3, 3), the one of the two whose w is not negative."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True))
