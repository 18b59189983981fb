"""Problem: a task in minimal coordinates, as flat arrays for the compiled kernels.

Coordinates x, in this order: the free joints (those that move a contact, neither driven by another joint nor
fixed by equal limits), the object's position (3), its unnormalised quaternion (4; w, x, y, z), and for
each contact the parameters s, t of the object region and, if the hand region is a patch, u, v of that one.

Equations, 3 or 5 a contact. A cap on the hand rolls: its centre lies at the distance of its radius from the
object region, along the region's normal, so that points coincide and normals oppose (15), (16) whatever
the direction,

    p_k + R_k c = p + R (o + r n)(s, t)                                                     three,

and a patch on the hand is tangent to the region with coinciding points,

    p_k + R_k h(u, v) = p + R o(s, t),   R_k m . R o_s = 0,   R_k m . R o_t = 0              five.

No equation is redundant, so the solutions have the dimension that the paper's d predicts. Inequalities:
the contact lies within the cap's cone (or the patch normals oppose), the object's axes lie within the
pose bounds. Bounds of x: joint limits (those of mimic joints carried over), pose and [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.model.hand.coupling import driver_ranges, drivers
from handfast.model.hand.hand import Hand
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.task import Task

CAP, PATCH = 0, 1
REVOLUTE, PRISMATIC = 0, 1
POSE = 7  # coordinates of the object's pose


class Flat(NamedTuple):
    """The arrays that the kernels take; lengths in units of `TaskProblem.unit`, b contacts, n coordinates.

    `steps` (b,) joints of each chain, `turn` (b, k+1, 3, 3) and `shift` (b, k+1, 3) the rigid motion before
    each joint (the joint's axis is then z) and after the last one, `kind`, `var` (-1: none), `ratio`,
    `offset` (b, k) of each joint: its value is ratio x[var] + offset. `hand` and `object` (b,) CAP or PATCH.
    `rows` (b,) first equation, `params` (b,) first parameter. Caps of the hand: `center`, `axis` (b, 3),
    `radius` (signed), `cone` (cosine), `sign`. Surfaces with parameters (2b: object regions, then hand
    regions): `degree` (2b, 2), `first` (2b,) into `points` (., 3); object caps have their frame, centre and
    radius in `ball` (b, 13), normals the sign `face` (2b,). `axes` (9, 2) bounds of R[i, k] at 3k+i.
    """

    steps: Indices
    turn: Array
    shift: Array
    kind: Indices
    var: Indices
    ratio: Array
    offset: Array
    hand: Indices
    object: Indices
    rows: Indices
    params: Indices
    center: Array
    axis: Array
    radius: Array
    cone: Array
    sign: Array
    degree: Indices
    first: Indices
    points: Array
    ball: Array
    face: Array
    axes: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class TaskProblem:
    """A task in minimal coordinates.

    Attributes:
        task: as given.
        free: (nj,) hand joint of each joint coordinate.
        labels: n names, "joint:<name>", "position:0", "quaternion:3", "contact:1:s".
        unit: [m], a power of two: one unit of length in `flat`.
        flat: the arrays for the kernels.
        equations: number of equations.
    """

    task: Task
    free: tuple[int, ...]
    labels: tuple[str, ...]
    unit: float
    flat: Flat
    equations: int

    @classmethod
    def of(cls, task: Task) -> TaskProblem:
        """The problem of a task.

        Raises:
            InputError: joints whose limits and couplings leave nothing, by name.
        """
        hand = task.hand
        follows = drivers(hand)
        ranges = driver_ranges(hand, task.involved.tolist())
        lower, upper = np.array([ranges.get(j, (0.0, 0.0)) for j in range(hand.l)]).T
        driving = sorted({follows[j][0] for j in task.involved.tolist() if follows[j][0] >= 0})
        free = tuple(j for j in driving if lower[j] < upper[j])
        reach = [
            _reach(hand, link) + _outermost(t.hand) for link, t in zip(task.links, task.contact_pairs, strict=True)
        ]
        unit = float(2.0 ** np.round(np.log2(max(max(reach), 1e-6))))
        # no contact lets the origin be farther from the palm than it is from the region beyond the hand's reach
        far = min(r + _outermost(t.object) for r, t in zip(reach, task.contact_pairs, strict=True)) * (1 + 1e-9)
        position = np.clip(task.pose.position, -far, far) / unit
        labels = [f"joint:{hand.joint_names[j]}" for j in free]
        labels += [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
        per = [unit if hand.joints[j].type == "prismatic" else 1.0 for j in free]
        box = [(lower[j] / p, upper[j] / p) for j, p in zip(free, per, strict=True)]
        box += [(lo, hi) for lo, hi in position] + [(-2.0, 2.0)] * 4
        params, rows, row = [], [], 0
        for k, t in enumerate(task.contact_pairs):
            params.append(len(labels))
            rows.append(row)
            names = "st" if isinstance(t.hand, Cap) else "stuv"
            labels += [f"contact:{k}:{name}" for name in names]
            box += [(0.0, t.object.half_angle), (-4.0, 4.0)] if isinstance(t.object, Cap) else [(0.0, 1.0)] * 2
            box += [(0.0, 1.0)] * (len(names) - 2)
            row += 3 if isinstance(t.hand, Cap) else 5
        chains = [_chain(hand, link, follows, free, lower, unit) for link in task.links]
        bounds = np.array(box)
        flat = Flat(
            **_chains(chains),
            **_regions(task, unit),
            rows=np.array(rows, dtype=np.intp),
            params=np.array(params, dtype=np.intp),
            axes=np.array(task.pose.axes.reshape(9, 2)),
            lower=bounds[:, 0].copy(),
            upper=bounds[:, 1].copy(),
        )
        return cls(task, free, tuple(labels), unit, flat, row)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.labels)

    @cached_property
    def lengths(self) -> Array:
        """(n,) [m] for coordinates that are lengths, 1 for the others: x times this is in SI units."""
        prismatic = {f"joint:{j.name}" for j in self.task.hand.joints if j.type == "prismatic"}
        return np.array([self.unit if v in prismatic or v.startswith("position") else 1.0 for v in self.labels])


def _reach(hand: Hand, link: int) -> float:
    """[m] no point that the link's frame origin can reach lies farther from the palm's origin."""
    reach = 0.0
    while link >= 0:
        joints = [hand.joints[j] for j in hand.links[link].joints]
        reach += float(np.linalg.norm(hand.links[link].pose[:3, 3]))
        for j in joints:
            travel = max(abs(j.lower), abs(j.upper)) if j.type == "prismatic" else 2 * np.linalg.norm(j.anchor)
            reach += float(travel)
        link = hand.links[link].parent
    return reach


def _outermost(region: Region) -> float:
    """[m] no point of the region lies farther from the origin of its frame."""
    if isinstance(region, Bezier):
        return float(np.linalg.norm(region.points, axis=2).max())
    return float(np.linalg.norm(region.center)) + region.radius


# --- chains ---------------------------------------------------------------------------------------


class _Chain(NamedTuple):
    motions: list[Array]  # rigid motions (4, 4): before each joint, and after the last
    joints: list[tuple[int, int, float, float]]  # kind, coordinate, ratio, offset


def _chain(
    hand: Hand,
    link: int,
    follows: dict[int, tuple[int, float, float]],
    free: tuple[int, ...],
    fixed: Array,
    unit: float,
) -> _Chain:
    """Palm to link: joints that cannot move are part of the rigid motions between the others."""
    path: list[int] = []
    while link >= 0:
        path.insert(0, link)
        link = hand.links[link].parent
    motions: list[Array] = []
    joints: list[tuple[int, int, float, float]] = []
    T: Array = np.eye(4)
    for i in path:
        T = T @ hand.links[i].pose if hand.links[i].parent >= 0 else T
        for j in hand.links[i].joints:
            joint = hand.joints[j]
            driver, ratio, offset = follows[j]
            if driver not in free:
                value = ratio * fixed[driver] + offset if driver >= 0 else offset
                T = T @ joint.motion(value)
                continue
            to_axis = np.eye(4)
            to_axis[:3, :3] = _onto_z(joint.axis)
            to_axis[:3, 3] = joint.anchor
            motions.append(T @ to_axis)
            scale = unit if joint.type == "prismatic" else 1.0
            per_unit = unit if hand.joints[driver].type == "prismatic" else 1.0
            kind = PRISMATIC if joint.type == "prismatic" else REVOLUTE
            joints.append((kind, free.index(driver), ratio * per_unit / scale, (offset - joint.ref) / scale))
            T = np.eye(4)
            T[:3, :3] = to_axis[:3, :3].T
            T[:3, 3] = -to_axis[:3, :3].T @ joint.anchor
    motions.append(T)
    for M in motions:
        M[:3, 3] /= unit
    return _Chain(motions, joints)


def _onto_z(axis: Array) -> Array:
    """(3, 3) a rotation that takes z to the unit vector `axis`."""
    x, y, z = axis.tolist()
    if z < -0.5:  # the formula below divides by 1 + z
        return np.diag([1.0, -1.0, -1.0]) @ _onto_z(np.array([x, -y, -z]))
    f = 1 / (1 + z)
    return np.array([[1 - f * x * x, -f * x * y, x], [-f * x * y, 1 - f * y * y, y], [-x, -y, z]])


def _chains(chains: list[_Chain]) -> dict[str, Any]:
    b, most = len(chains), max(len(c.joints) for c in chains)
    turn, shift = np.tile(np.eye(3), (b, most + 1, 1, 1)), np.zeros((b, most + 1, 3))
    kind, var = np.zeros((b, most), dtype=np.intp), np.full((b, most), -1, dtype=np.intp)
    ratio, offset = np.zeros((b, most)), np.zeros((b, most))
    for k, c in enumerate(chains):
        for i, M in enumerate(c.motions):
            turn[k, i], shift[k, i] = M[:3, :3], M[:3, 3]
        for i, (what, v, r, o) in enumerate(c.joints):
            kind[k, i], var[k, i], ratio[k, i], offset[k, i] = what, v, r, o
    steps = np.array([len(c.joints) for c in chains], dtype=np.intp)
    return {"steps": steps, "turn": turn, "shift": shift, "kind": kind, "var": var, "ratio": ratio, "offset": offset}


# --- regions --------------------------------------------------------------------------------------


def _regions(task: Task, unit: float) -> dict[str, Any]:
    b = len(task.contact_pairs)
    center, axis = np.zeros((b, 3)), np.zeros((b, 3))
    radius, cone, sign = np.zeros(b), np.full(b, -2.0), np.ones(b)
    degree, first = np.zeros((2 * b, 2), dtype=np.intp), np.zeros(2 * b, dtype=np.intp)
    ball, face = np.zeros((b, 13)), np.ones(2 * b)
    points: list[Array] = [np.zeros((1, 3))]
    for k, t in enumerate(task.contact_pairs):
        if isinstance(t.hand, Cap):
            center[k], axis[k], sign[k] = t.hand.center / unit, t.hand.axis, t.hand.sign
            radius[k] = t.hand.sign * t.hand.radius / unit
            cone[k] = np.cos(t.hand.half_angle) if t.hand.half_angle < np.pi else -2.0
        if isinstance(t.object, Cap):
            ball[k, :9], ball[k, 9:12] = t.object.frame.ravel(), t.object.center / unit
            ball[k, 12] = t.object.radius / unit
        for i, region in ((k, t.object), (b + k, t.hand)):
            face[i] = region.sign
            if isinstance(region, Bezier):
                degree[i], first[i] = region.degree, sum(len(p) for p in points)
                points.append(region.points.reshape(-1, 3) / unit)
    return {
        "hand": np.array([int(isinstance(t.hand, Bezier)) for t in task.contact_pairs], dtype=np.intp),
        "object": np.array([int(isinstance(t.object, Bezier)) for t in task.contact_pairs], dtype=np.intp),
        "center": center,
        "axis": axis,
        "radius": radius,
        "cone": cone,
        "sign": sign,
        "degree": degree,
        "first": first,
        "points": np.vstack(points),
        "ball": ball,
        "face": face,
    }
