"""What a grasp map and a hand Jacobian say: contacts and joints that have exactly these matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import cross
from handfast.model.mechanism import Mechanism

ORTHONORMAL = 1e-6  # of the columns of G, and of the skew symmetry of [p]x
SPEED_TOLERANCE = 1e-9  # relative to the largest speed of a joint: a hinge that moves all its contacts as J says
MIN_CONTACT_SPEED = 1e-12  # a contact slower than this, relative to the joint's fastest, does not move
JOINT_KINDS = ("revolute", "prismatic")


class UnitJoint(NamedTuple):
    """A joint in numbers, as `GraspJoint` has it, and the rate at which it goes with its column of J."""

    name: str
    axis: Array
    origin: Array
    moves: tuple[int, ...]
    type: Literal["revolute", "prismatic"]
    rate: float


@dataclass(frozen=True, eq=False)
class GraspNumbers:
    """A grasp in numbers: positions and normals (m, 3), joints, the mechanism over them."""

    positions: Array
    normals: Array
    joints: list[UnitJoint]
    mechanism: Mechanism


def numbers_of(
    G: object,
    J: object,
    normal: int,
    joints: Sequence[str] | None,
    types: Sequence[str] | None,
    mechanism: Mechanism | None,
) -> GraspNumbers:
    """Contacts and joints that have a grasp map G (6, 3 m) and a Jacobian J (3 m, l), see `Grasp.from_matrices`."""
    points, frames = _grasp_map(G, normal)
    m = len(points)
    jacobian = _jacobian(J, m)
    l = jacobian.shape[1]
    names = tuple(joints) if joints is not None else tuple(f"joint_{j + 1}" for j in range(l))
    kinds = tuple(types) if types is not None else ("revolute",) * l
    for field, given in (("joints", names), ("types", kinds)):
        if len(given) != l:
            raise InputError(f"has {len(given)} entries; J has {l} columns", field=field)
    for j, name in enumerate(names):
        if not isinstance(name, str):
            raise InputError(f"is {name!r}; a name is needed", field=f"joints[{j}]")
    for j, kind in enumerate(kinds):
        if kind not in JOINT_KINDS:
            raise InputError(f"is '{kind}'; 'revolute' or 'prismatic' is needed", field=f"types[{j}]")
    asked = Mechanism.direct(names) if mechanism is None else mechanism
    if asked.R.shape[1] != l:
        raise InputError(f"has {asked.R.shape[1]} joint columns; J has {l}", field="mechanism")
    speeds = np.einsum("iab,ibj->ija", frames, jacobian.reshape(m, 3, l))  # (m, l, 3) of the finger at each contact
    made = [_unit_joints(names[j], kinds[j], speeds[:, j], points) for j in range(l)]
    whole = [part for parts in made for part in parts]
    return GraspNumbers(points, frames[:, :, normal], whole, _mechanism(asked, made))


def _mechanism(asked: Mechanism, made: Sequence[Sequence[UnitJoint]]) -> Mechanism:
    """A mechanism over columns of J as one over the joints made of each: the first has what moves the column, at its
    rate, and the others are coupled to it."""
    count = sum(map(len, made))
    R, A, ties = np.zeros((asked.a, count)), np.zeros((len(asked.A), count)), []
    k = 0
    for j, parts in enumerate(made):
        R[:, k], A[:, k] = asked.R[:, j] / parts[0].rate, asked.A[:, j] / parts[0].rate
        for n in range(1, len(parts)):
            row = np.zeros(count)
            row[k], row[k + n] = 1 / parts[0].rate, -1 / parts[n].rate
            ties.append(row)
        k += len(parts)
    return Mechanism(asked.actuators, R, np.vstack([A, *ties]) if ties else A, asked.tendon, asked.backdrivable)


def _grasp_map(G: Any, normal: int) -> tuple[Array, Array]:
    """(m, 3) points and (m, 3, 3) frames of the contacts behind a grasp map, object frame."""
    if isinstance(normal, bool) or not isinstance(normal, int | np.integer) or normal not in (0, 1, 2):
        raise InputError(f"is {normal}; 0, 1 or 2 is needed, the place of the normal among three", field="normal")
    shape = _shape(G, "G")
    if len(shape) != 2 or shape[0] != 6 or shape[1] == 0 or shape[1] % 3:
        raise InputError(f"has shape {shape}; (6, 3 m) is needed, three columns a contact", field="G")
    given = frozen(G, shape, "G")
    m = shape[1] // 3
    points, frames = [], []
    for i in range(m):
        field = f"G[:, {3 * i}:{3 * i + 3}]"
        frame, moments = given[:3, 3 * i : 3 * i + 3], given[3:, 3 * i : 3 * i + 3]
        if np.abs(frame.T @ frame - np.eye(3)).max() > ORTHONORMAL:
            raise InputError("has no orthonormal frame in its first three rows: a normal and two tangents", field=field)
        skew = moments @ frame.T  # [p]x
        if np.abs(skew + skew.T).max() > ORTHONORMAL * max(1.0, float(np.abs(skew).max())):
            problem = "is no force at a point: its last three rows are not position x its first three"
            raise InputError(problem, field=field)
        place = np.array([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]]) / 2
        points.append(place)
        frames.append(frame)
    return np.array(points), np.array(frames)


def _jacobian(J: Any, m: int) -> Array:
    shape = _shape(J, "J")
    if len(shape) != 2 or shape[0] != 3 * m:
        raise InputError(
            f"has shape {shape}; ({3 * m}, l) is needed, three rows for each of the {m} contacts", field="J"
        )
    return frozen(J, shape, "J")


def _shape(a: Any, field: str) -> tuple[int, ...]:
    try:
        return np.shape(a)
    except ValueError:
        raise InputError("has rows of different lengths", field=field) from None


def _unit_joints(name: str, kind: str, speeds: Array, points: Array) -> list[UnitJoint]:
    """Unit joints that together move the contacts (m, 3) with these speeds (m, 3): one, if a single one can."""
    size = np.linalg.norm(speeds, axis=1)
    moves = tuple(int(i) for i in np.flatnonzero(size > MIN_CONTACT_SPEED * size.max(initial=0.0)))
    if not moves:  # it moves nothing; where it is makes no difference
        return [UnitJoint(name, np.eye(3)[2], np.zeros(3), (), "prismatic" if kind == "prismatic" else "revolute", 1.0)]
    v, p = speeds[list(moves)], points[list(moves)]
    if kind == "prismatic":
        if np.abs(v - v[0]).max() <= SPEED_TOLERANCE * size.max():
            first = float(size[moves[0]])
            return [UnitJoint(name, v[0] / first, p[0], moves, "prismatic", first)]
    else:
        hinge = _hinge(p, v)
        if hinge is not None:
            return [UnitJoint(name, *hinge, moves, "revolute", 1.0)]
    parts = []
    for n, i in enumerate(moves):
        part = name if n == 0 else f"{name} at contact {i}"
        if kind == "prismatic":
            parts.append(UnitJoint(part, v[n] / size[i], p[n], (i,), "prismatic", float(size[i])))
        else:
            parts.append(UnitJoint(part, *_any_hinge(p[n], v[n]), (i,), "revolute", 1.0))
    return parts


def _any_hinge(point: Array, speed: Array) -> tuple[Array, Array]:
    """An axis and a point on it about which turning at 1 rad/s moves a point (3,) with a speed (3,)."""
    e = np.eye(3)[int(np.argmin(np.abs(speed)))]
    axis = cross(speed, e)
    axis /= np.linalg.norm(axis)
    return axis, point - cross(speed, axis)


def _hinge(points: Array, speeds: Array) -> tuple[Array, Array] | None:
    """The axis and a point on it of the hinge that moves all points (k, 3) with these speeds (k, 3); None without.

    Sought are w and v with w x p + v the speed of each p, w of length 1 and perpendicular to v.
    """
    if np.ptp(points, axis=0).max() < 1e-12:  # one point, maybe of several contacts: many hinges do
        same = np.abs(speeds - speeds[0]).max() <= SPEED_TOLERANCE * np.abs(speeds).max()
        return _any_hinge(points[0], speeds[0]) if same else None
    arms, faster = points - points.mean(axis=0), speeds - speeds.mean(axis=0)
    rows = np.vstack([[[0, a[2], -a[1]], [-a[2], 0, a[0]], [a[1], -a[0], 0]] for a in arms])  # w x a = rows @ w
    w, _, _, sv = np.linalg.lstsq(rows, faster.ravel(), rcond=1e-9)
    turns = [w]
    if sv[2] <= 1e-9 * sv[0]:  # all points on a line: any turn about it may be added
        line = np.linalg.svd(rows)[2][2]
        left = 1.0 - float(w @ w)
        turns = [w + s * np.sqrt(max(left, 0.0)) * line for s in (1.0, -1.0)]
    for turn in turns:
        length = float(np.linalg.norm(turn))
        if abs(length - 1.0) > SPEED_TOLERANCE:
            continue
        turn = turn / length
        middle = speeds.mean(axis=0)
        origin = points.mean(axis=0) - cross(middle, turn)
        off = np.array([cross(turn, p - origin) - v for p, v in zip(points, speeds, strict=True)])
        if np.abs(off).max() <= SPEED_TOLERANCE * np.abs(speeds).max():
            return turn, origin
    return None
