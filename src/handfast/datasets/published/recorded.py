"""A published grasp as its file records it: where the hand's root is, and its joints by name or in some order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import MAX_COORDINATE, nearest_rotation, quaternion_matrix, rigid, transform

Joints = Mapping[str, float] | Array  # by the file's names, or (k,) in an order that the file does not say
ROTATION_TOLERANCE = 1e-3  # by how much a rotation may miss being one, by the rounding of single precision


@dataclass(frozen=True, eq=False)
class Posture:
    """A hand in the frame of the object.

    Attributes:
        root: (4, 4) the frame in which the file poses the hand, in the object's frame [m].
        joints: [rad, m].
    """

    root: Array
    joints: Joints


@dataclass(frozen=True, eq=False)
class RecordedGrasp:
    """One grasp of a file.

    Attributes:
        index: in the file, from 0.
        grasp: the posture that is the grasp.
        squeeze: where its motors are to go from there; None if the file does not say.
        pregrasp: where the hand comes from.
        object: a code, a name or a path, as the file has it; "" if it does not say.
        scale: factor on the object's mesh.
        hand: as the file calls it.
        score: a confidence or energy as the file has it.
    """

    index: int
    grasp: Posture
    squeeze: Posture | None = None
    pregrasp: Posture | None = None
    object: str = ""
    scale: float = 1.0
    hand: str = ""
    score: float | None = None


@dataclass(frozen=True)
class BrokenRow:
    """One grasp of a file that cannot be read, and why."""

    index: int
    reason: str


Rows = Iterator[RecordedGrasp | BrokenRow]


def rows(count: int, make: Callable[[int], RecordedGrasp]) -> Rows:
    """`make` of 0 to count - 1; one that cannot be made is a `BrokenRow`, and the rest goes on."""
    for i in range(count):
        try:
            yield make(i)
        except InputError as fault:
            yield BrokenRow(i, str(fault))
        except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as fault:
            yield BrokenRow(i, f"does not fit the layout ({type(fault).__name__})")


def entry(data: Any, key: str) -> Any:
    """A key of a dictionary; `InputError` if it is missing."""
    if not isinstance(data, Mapping):
        raise InputError(f"is a {type(data).__name__}; a dictionary with the key '{key}' is needed")
    if key not in data:
        raise InputError("is missing", field=key)
    return data[key]


def numbers(value: Any, shape: tuple[int | None, ...], field: str) -> Array:
    """Finite numbers of a shape, None for any size; `InputError` if they are not."""
    try:
        if np.iscomplexobj(value):
            raise TypeError
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError("holds what are no numbers, or rows of different lengths", field=field) from None
    fits = found.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, found.shape, strict=True))
    if not fits:
        need = " x ".join("any" if n is None else str(n) for n in shape) or "a single number"
        raise InputError(f"has shape {found.shape}; {need} is needed", field=field)
    if not np.isfinite(found).all():
        raise InputError("has a number that is NaN or infinite", field=field)
    if np.abs(found).max(initial=0.0) > MAX_COORDINATE:
        raise InputError(f"has a number beyond {MAX_COORDINATE:g}; metres and radians are needed", field=field)
    return found


def number(value: Any, field: str) -> float:
    """A single finite number, also as an array or list of one."""
    return float(numbers(np.ravel(np.asarray(value, dtype=object)), (1,), field)[0])


def named_numbers(value: Any, field: str) -> dict[str, float]:
    """Single numbers by name."""
    if not isinstance(value, Mapping):
        raise InputError("is no dictionary of joint values", field=field)
    return {str(k): number(v, f"{field}.{k}") for k, v in value.items()}


def positive(value: Any, field: str) -> float:
    """A single number above 0: a scale, which may be written once for each axis if it is the same."""
    scales = np.ravel(np.asarray(value, dtype=object))
    found = numbers(scales, (None,), field)
    if len(found) not in (1, 3) or not (found > 0).all() or np.ptp(found) > 1e-9 * found.max():
        raise InputError(f"is {found.tolist()[:3]}; one factor above 0 is needed", field=field)
    return float(found[0])


def text(value: Any) -> str:
    """A text, also as a list or array of one; "" if there is none."""
    while isinstance(value, list | tuple | np.ndarray) and len(np.ravel(value)):
        value = np.ravel(np.asarray(value, dtype=object))[0]
    return value if isinstance(value, str) else ""


def pose_of(value: Any, field: str) -> Array:
    """(4, 4) from a position [m] and a quaternion (w, x, y, z)."""
    found = numbers(value, (7,), field)
    if abs(np.linalg.norm(found[3:]) - 1) > ROTATION_TOLERANCE:
        length = np.linalg.norm(found[3:])
        raise InputError(f"has a quaternion of length {length:.4g}; w, x, y, z of length 1 is needed", field=field)
    return transform(found[:3], quaternion_matrix(found[3:]))


def matrix_pose(value: Any, field: str) -> Array:
    """(4, 4) from a matrix that is a rigid motion but for rounding."""
    found = numbers(value, (4, 4), field)
    R = found[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > ROTATION_TOLERANCE or np.linalg.det(R) < 0:
        raise InputError("is not a rigid motion; a rotation and a translation are needed", field=field)
    return rigid(transform(found[:3, 3], nearest_rotation(R)), field)


def posture_of(value: Any, field: str, object_pose: Array | None = None) -> Posture:
    """A posture from position, quaternion and joints in one row, in the world in which the object has its pose."""
    found = numbers(value, (None,), field)
    if len(found) < 7:
        raise InputError(f"has {len(found)} numbers; position, quaternion and joints are needed", field=field)
    root = pose_of(found[:7], field)
    return Posture(root if object_pose is None else np.linalg.inv(object_pose) @ root, found[7:])
