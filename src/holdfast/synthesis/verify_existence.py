"""Checks a proof of existence with interval arithmetic alone: nothing of the search that wrote it.

With F(x) = 0 the contact equations in the dependent coordinates x, the others frozen, X = c + [-r, r] the
proof's box, J an enclosure of F' over X and any matrix Y,

    K = c - Y F(c) + (I - Y J) (X - c)

lies inside X only if X contains a solution, just one, and that lies in K (Krawczyk 1969). Then limits,
patches and bounds are tested over all of X. Per contact, with the link at (R_k, p_k), the object at (R, p),
o and n its point and outward unit normal, o_s and o_t two tangents:

- a hand cap with centre c, radius r and sign g (-1 if hollow): its outward normal must be -R n, so
  p_k + R_k c = p + R (o + g r n), 3 equations; and -g R n must lie in the cone about R_k axis.
- a hand patch with point h and outward normal m: p_k + R_k h = p + R o, (R_k m) . (R o_s) = 0 and
  (R_k m) . (R o_t) = 0, 5 equations; and (R_k m) . (R n) < 0.

Every float of hand, task and regions is exact, except where no float can be: rotations and unit vectors are
those that Gram-Schmidt makes of the floats, so that links are rigid and spheres are round.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from holdfast.errors import InputError
from holdfast.hand.model import Coupling
from holdfast.mechanism import Array, Indices
from holdfast.region import Bezier, Cap
from holdfast.synthesis.existence import Existence, free_joints, moving_joints
from holdfast.synthesis.interval import (
    TINY,
    ULP,
    Dual,
    Interval,
    columns,
    cos,
    cross,
    dot,
    join,
    sin,
    sqr,
    sqrt,
    unit,
)
from holdfast.synthesis.task import Task

CROOKED = 1e-12  # by which the floats of a link's rotation may miss a rotation
SHORTEST = 1e-3  # length of a quaternion below which it is none
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # the derivatives of a patch that F and F' need


@dataclass(frozen=True)
class Report:
    """What the checker found.

    Attributes:
        ok: is the claim proved?
        reasons: empty if ok, else one line for each test that failed.
        slacks: by what each bound is missed at least, anywhere in the box: by label, or by joint for joints
            that follow; "contact:K:cone" and "contact:K:normals" are cosines, the latter 1 if opposite.
        contraction: the factor by which K is smaller than the box; infinite if it did not come to that.
        step: how far c - Y F(c) is from c, in radii; both together below 1 prove that there is a solution.
        gap: [m] the largest distance between two contact points at the floats.
    """

    ok: bool
    reasons: tuple[str, ...]
    slacks: Mapping[str, float]
    contraction: float
    step: float
    gap: float


class Refused(Exception):
    """Why a proof is none."""


def verify_existence(task: Task, proof: Existence) -> Report:
    """Does an exact configuration of the task exist in the box of the proof?"""
    try:
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
            equations = _equations_of(task)
            box = _box(equations, proof)
            at = equations.at(box.coordinates, box.slope)
            reasons, contraction, step, gap = _krawczyk(equations, box, at)
            bounds = _bounds(equations, box, at)
    except (Refused, InputError) as fault:
        return Report(False, (str(fault),), {}, np.inf, np.inf, np.inf)
    reasons += [bound.fault for bound in bounds if not bound.slack > 0]
    slacks = {bound.label: bound.slack for bound in bounds}
    return Report(not reasons, tuple(reasons), slacks, contraction, step, gap)


# --- what the proof claims --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Box:
    """The box of a proof.

    Attributes:
        dependent: (E,) columns of the dependent coordinates.
        labels: (E,) theirs; radii: (E,).
        coordinates: (2, N) all coordinates, at the floats and over the box.
        slope: (E, 2, N) their derivatives by the dependent ones: 0 or 1.
    """

    dependent: Indices
    labels: tuple[str, ...]
    radii: Array
    coordinates: Interval
    slope: Interval


def _box(equations: _Equations, proof: Existence) -> _Box:
    """The box; `Refused` for a proof that does not fit the task or contradicts itself."""
    e = equations
    _refuse_misfit(e.task, proof)
    values, labels = proof.coordinates, proof.dependent
    if len(labels) != e.count:
        raise Refused(f"{len(labels)} coordinates are dependent; the {e.count} equations need as many")
    unknown = [label for label in labels if label not in e.column]
    if unknown:
        raise Refused(f"'{unknown[0]}' is no coordinate of this task; they are {', '.join(e.column)}")
    twice = [label for label in labels if labels.count(label) > 1]
    if twice:
        raise Refused(f"{twice[0]} is dependent twice")
    if all(f"quaternion:{i}" in labels for i in range(4)):
        raise Refused("all of the quaternion is dependent; its length is free, so one component must be frozen")
    for label, radius in zip(labels, proof.radii.tolist(), strict=True):
        if not radius > 0:
            raise Refused(f"the radius of {label} is {radius:g}; it must be positive")
    dependent = np.array([e.column[label] for label in labels], dtype=np.intp)
    middle, radii = np.array([values[label] for label in e.column]), np.zeros(len(e.column))
    radii[dependent] = proof.radii
    box = Interval.around(middle, radii)
    frozen = radii == 0
    ends = [np.stack([middle, np.where(frozen, middle, end)]) for end in (box.lo, box.hi)]
    slope = np.zeros((len(labels), 2, len(middle)))
    slope[np.arange(len(labels)), :, dependent] = 1.0
    return _Box(dependent, labels, proof.radii, Interval(*ends), Interval.of(slope))


def _refuse_misfit(task: Task, proof: Existence) -> None:
    free = free_joints(task)
    for name in free:
        if name not in proof.joints:
            raise Refused(f"has no value for joint {name}; the free joints are {', '.join(free)}")
    for name in proof.joints:
        if name not in free:
            raise Refused(f"has a value for joint {name}; the free joints are {', '.join(free) or 'none'}")
    if len(proof.contacts) != len(task.touches):
        raise Refused(f"has {len(proof.contacts)} contacts; the task has {len(task.touches)}")
    for k, (point, touch) in enumerate(zip(proof.contacts, task.touches, strict=True)):
        if point.link != touch.link:
            raise Refused(f"contact {k} is on {point.link}; in the task it is on {touch.link}")
        patch = isinstance(touch.hand, Bezier)
        if patch != (point.hand is not None):
            needed = "a patch, which needs u and v" if patch else "a cap, which has no u and v"
            raise Refused(f"contact {k}: the hand region is {needed}")
    if not (proof.quaternion**2).sum() > SHORTEST**2:
        raise Refused(f"the quaternion is shorter than {SHORTEST:g}")


# --- is there a solution? ---------------------------------------------------------------------------


def _krawczyk(equations: _Equations, box: _Box, at: _Values) -> tuple[list[str], float, float, float]:
    """Reasons why no solution is shown; then the contraction, the step and the gap of the report."""
    F, J = at.F.value[0], at.F.slope[:, 1].swapped()
    gaps = sqrt(sqr(at.gap).sum()).hi
    gap = float(gaps.max()) if not np.isnan(gaps).any() else np.inf
    if not np.isfinite(J.mid).all():
        return ["the box is too wide: in it the equations have no finite derivatives"], np.inf, np.inf, gap
    try:
        Y = np.linalg.inv(J.mid)
    except np.linalg.LinAlgError:
        Y = np.full(J.shape, np.nan)
    if not np.isfinite(Y).all():
        return ["the dependent coordinates are not determined: their Jacobian is singular"], np.inf, np.inf, gap
    step = (Interval.of(Y) @ F[:, None])[:, 0]
    change = (np.eye(len(Y)) - Interval.of(Y) @ J) @ Interval.around(0.0, box.radii)[:, None]
    steps, changes = step.mag / box.radii, change[:, 0].mag / box.radii
    reasons = []
    if not (changes < 1).all():
        worst = _worst(changes)
        why = "the box is too wide, or the equations too nearly singular"
        reasons = [f"{why}: {box.labels[worst]} contracts by a factor of {changes[worst]:.3g} only"]
    elif not (steps < 1).all():
        worst, k = _worst(steps), _worst(gaps)
        why = f"the floats do not meet the equations (contact {k} is open by {gaps[k]:.3g} m)"
        reasons = [f"{why}: a Newton step moves {box.labels[worst]} by {steps[worst]:.3g} radii"]
    elif not ((step - change[:, 0]).mag < box.radii).all():
        worst = _worst(steps + changes)
        reasons = [f"the box is too tight: a solution near it may lie outside in {box.labels[worst]}"]
    return reasons, _most(changes), _most(steps), gap


def _worst(x: Array) -> int:
    return int(np.where(np.isnan(x), np.inf, x).argmax())


def _most(x: Array) -> float:
    """The largest, as an upper bound: the quotients were rounded once."""
    most = float(x.max())
    return most * (1 + 2 * ULP) if most == most else np.inf


# --- is it strictly inside all bounds? --------------------------------------------------------------


@dataclass(frozen=True)
class _Bound:
    """A test that passes if `slack` is positive, and what to say if not."""

    label: str
    slack: float
    fault: str


def _bounds(equations: _Equations, box: _Box, at: _Values) -> list[_Bound]:
    """Every bound, tested over the whole box."""
    return [
        *_joint_bounds(equations, at.joints[1]),
        *_pose_bounds(equations.task, box.coordinates[1, _slice(equations, "position:0", 3)], at.rotation[1]),
        *_contact_bounds(equations, box.coordinates[1], at.facing[1]),
    ]


def _slice(equations: _Equations, first: str, count: int) -> slice:
    return slice(equations.column[first], equations.column[first] + count)


def _between(label: str, what: str, x: Interval, lo: float, hi: float) -> _Bound:
    """Is x strictly between two floats?"""
    above = (x - lo).lo if lo > -np.inf else np.inf
    slack = np.minimum(above, (hi - x).lo if hi < np.inf else np.inf)  # NaN if one of them is
    fault = f"{what} comes to [{x.lo:.9g}, {x.hi:.9g}] in the box, not strictly inside [{lo:.9g}, {hi:.9g}]"
    return _Bound(label, float(slack), fault)


def _joint_bounds(equations: _Equations, q: Interval) -> list[_Bound]:
    out = []
    for i, j in enumerate(equations.drive.joints):
        joint = equations.task.hand.joints[j]
        if joint.lower == joint.upper:
            continue  # fixed: `_Drive.of` has seen to it
        out.append(_between(f"joint:{joint.name}", f"joint {joint.name}", q[i], joint.lower, joint.upper))
    return out


def _pose_bounds(task: Task, position: Interval, rotation: Interval) -> list[_Bound]:
    out = []
    for i, (lo, hi) in enumerate(task.pose.position.tolist()):
        if np.isfinite(lo) or np.isfinite(hi):
            out.append(_between(f"position:{i}", f"pose.position[{i}]", position[i], lo, hi))
    for k, i in np.argwhere((task.pose.axes != [-1.0, 1.0]).any(axis=2)).tolist():
        lo, hi = task.pose.axes[k, i].tolist()
        lo, hi = -np.inf if lo <= -1 else lo, np.inf if hi >= 1 else hi  # a component is never beyond 1
        name = f"{'xyz'[k]}_axis"
        if lo > -np.inf or hi < np.inf:
            out.append(_between(f"{name}:{i}", f"pose.{name}[{i}]", rotation[i, k], lo, hi))
    return out


def _contact_bounds(equations: _Equations, x: Interval, facing: Interval) -> list[_Bound]:
    """`facing` (K,): hand axis (cap) or outward normal (patch) times the object's outward normal."""
    out = []
    for k, touch in enumerate(equations.task.touches):
        for name in "stuv":
            label = f"contact:{k}:{name}"
            region = touch.object if name in "st" else touch.hand
            if isinstance(region, Bezier):
                out.append(_between(label, label, x[equations.column[label]], 0.0, 1.0))
            elif name == "s" and region.half_angle < np.pi:  # -s is the point opposite, as far from the axis
                s, most = x[equations.column[label]], region.half_angle
                out.append(_between(label, label, s, -most, most))
        if isinstance(touch.hand, Bezier):
            cosine = -facing[k]
            comes = f"their cosine comes to [{float(-cosine.hi):.9g}, {float(-cosine.lo):.9g}] in the box"
            fault = f"contact {k}: the normals are not opposite: {comes}"
            out.append(_Bound(f"contact:{k}:normals", float(cosine.lo), fault))
        elif touch.hand.half_angle < np.pi:
            inside = -touch.hand.sign * facing[k] - cos(Interval.of(touch.hand.half_angle))
            fault = f"contact {k} may leave the hand's cap, by a cosine of {-inside.lo:.3g}"
            out.append(_Bound(f"contact:{k}:cone", float(inside.lo), fault))
    return out


# --- the equations ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Values:
    """The equations at the floats (first) and over the box (second).

    Attributes:
        F: (2, E) equations. gap: (K, 3) [m] between the contact points, at the floats.
        joints: (2, J) values of the moving joints.
        rotation: (2, 3, 3) of the object.
        facing: (2, K) hand axis or normal times the object's normal.
    """

    F: Dual
    gap: Interval
    joints: Interval
    rotation: Interval
    facing: Interval


@dataclass(frozen=True, eq=False)
class _Equations:
    """F for one task, its constants prepared. K contacts, N coordinates, E equations.

    Attributes:
        column: label -> column of a coordinate; the order of joints, position, quaternion, contacts.
        rows: (E,) of the 5 K numbers (gap, two tangents) per contact.
        radius: (K, 1) sign times radius of a hand cap, 0 for a patch.
    """

    task: Task
    column: Mapping[str, int]
    rows: Indices
    drive: _Drive
    arms: _Arms
    hand: _Surface
    object: _Surface
    radius: Array

    @property
    def count(self) -> int:
        """E."""
        return len(self.rows)

    def at(self, coordinates: Interval, slope: Interval) -> _Values:
        """F at coordinates (2, N) with derivatives (E, 2, N)."""
        x, K = Dual(coordinates, slope), len(self.task.touches)
        joints = self.drive.at(x)
        on_hand = self.arms.carry(joints, *self.hand.at(x)[:2])  # (2, K, 3, 2)
        R = _rotation(x[..., _slice(self, "quaternion:0", 4)])
        point, normal, first, second = self.object.at(x)
        on_object = R.reshape(2, 1, 3, 3) @ columns([point + normal * self.radius, first, second, normal])
        position = x[..., _slice(self, "position:0", 3)].reshape(2, 1, 3)
        gap = on_hand[..., 0] - position - on_object[..., 0]
        along = (on_hand[..., 1].reshape(2, K, 1, 3) @ on_object[..., 1:])[..., 0, :]
        F = join([gap, along[..., :2]], -1).reshape(2, 5 * K)[..., self.rows]
        return _Values(F, gap.value[0], joints.value, R.value, along.value[..., 2])


@lru_cache(maxsize=16)
def _equations_of(task: Task) -> _Equations:
    """The constants; `Refused` for a task in which no proof could hold."""
    _refuse_impossible(task)
    labels = [f"joint:{name}" for name in free_joints(task)]
    labels += [f"position:{i}" for i in range(3)] + [f"quaternion:{i}" for i in range(4)]
    rows: list[int] = []
    for k, touch in enumerate(task.touches):
        patch = isinstance(touch.hand, Bezier)
        labels += [f"contact:{k}:{name}" for name in ("stuv" if patch else "st")]
        rows += range(5 * k, 5 * k + (5 if patch else 3))
    column = {label: n for n, label in enumerate(labels)}
    radius = [0.0 if isinstance(t.hand, Bezier) else t.hand.sign * t.hand.radius for t in task.touches]
    drive = _Drive.of(task, column)
    return _Equations(
        task,
        column,
        np.array(rows, dtype=np.intp),
        drive,
        _Arms.of(task, drive.joints),
        _Surface.of([t.hand for t in task.touches], "uv", column, still=True),
        _Surface.of([t.object for t in task.touches], "st", column, still=False),
        np.array(radius)[:, None],
    )


def _refuse_impossible(task: Task) -> None:
    for i, (lo, hi) in enumerate(task.pose.position):
        if lo == hi:
            raise Refused(f"pose.position[{i}] is bounded to {lo:g} alone; nothing lies strictly inside")
    for k, i in np.argwhere(task.pose.axes[..., 0] == task.pose.axes[..., 1]).tolist():
        only = task.pose.axes[k, i, 0]
        raise Refused(f"pose.{'xyz'[k]}_axis[{i}] is bounded to {only:g} alone; nothing lies strictly inside")


def _rotation(q: Dual) -> Dual:
    """(2, 3, 3) of quaternions (2, 4) of any length."""
    products = q[..., :, None] * q[..., None, :]
    length = products[..., range(4), range(4)].sum()
    return (products.reshape(2, 1, 16) @ QUADRATICS).reshape(2, 3, 3) / length[..., None, None]


def _quadratics() -> Array:
    """(16, 9): a quaternion's products times this are its matrix times the squared length."""
    out = np.zeros((4, 4, 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = i + 1, j + 1, k + 1
        out[0, 0, i, i] = out[a, a, i, i] = 1.0
        out[b, b, i, i] = out[c, c, i, i] = -1.0
        out[b, c, j, k] = out[b, c, k, j] = 2.0
        out[0, a, k, j], out[0, a, j, k] = 2.0, -2.0
    return out.reshape(16, 9)


QUADRATICS = _quadratics()


# --- joints -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Drive:
    """How the coordinates set the moving joints: value = gain * coordinate + shift.

    Attributes:
        joints: (J,) indices into the hand's joints.
        column: (J,) the coordinate; where the gain is 0, any.
        gain, shift: (J,).
    """

    joints: tuple[int, ...]
    column: Indices
    gain: Interval
    shift: Interval

    @classmethod
    def of(cls, task: Task, column: Mapping[str, int]) -> _Drive:
        """`Refused` if a joint that its limits fix would have to move or to stand elsewhere."""
        if not len(task.involved):
            return cls((), np.zeros(0, dtype=np.intp), Interval.of(np.zeros(0)), Interval.of(np.zeros(0)))
        moving = moving_joints(task)
        lead, gain, shift = zip(*(_driven(task, j, path, column) for j, path in moving.items()), strict=True)
        return cls(tuple(moving), np.array(lead, dtype=np.intp), join(gain, -1), join(shift, -1))

    def at(self, x: Dual) -> Dual:
        """(2, J) joint values."""
        return x[..., self.column] * self.gain + self.shift


def _driven(task: Task, j: int, path: Sequence[Coupling], column: Mapping[str, int]) -> tuple[int, Interval, Interval]:
    """Column, gain (1,) and shift (1,) of a joint that the couplings of `path` tie to the one that leads it."""
    joint, leader = task.hand.joints[j], path[-1].leader if path else j
    gain, shift, size = Interval.of([1.0]), Interval.of([0.0]), 0.0
    for c in path:  # q = gain q' + shift and q' = ratio q" + offset
        shift = gain * c.offset + shift
        size += float(gain.mag[0]) * abs(c.offset)
        gain = gain * c.ratio
    if leader >= 0:
        first = task.hand.joints[leader]
        if f"joint:{first.name}" in column:
            if joint.lower == joint.upper:
                raise Refused(f"joint {joint.name} is fixed by its limits, but follows {first.name}, which is free")
            return column[f"joint:{first.name}"], gain, shift
        shift = gain * first.lower + shift
        size += float(gain.mag[0]) * abs(first.lower)
    if joint.lower == joint.upper:
        if not np.abs(shift.mid[0] - joint.lower) <= 16 * ULP * size + 16 * TINY:
            stands = f"{joint.lower:.9g} by its limits, at {shift.mid[0]:.9g} by its coupling"
            raise Refused(f"joint {joint.name} is fixed at {stands}")
        # the two agree but for rounding: whichever is meant, a solution exists
        shift = Interval(np.minimum(shift.lo, joint.lower), np.maximum(shift.hi, joint.lower))
    return 0, Interval.of([0.0]), shift if path else Interval.of([joint.lower])


@dataclass(frozen=True, eq=False)
class _Arms:
    """The links of the contacts, as chains of S different steps: a fixed frame, then a joint's motion.

    Attributes:
        chain: (K, D) steps from the palm outwards; step 0 stands still and fills up short chains.
        joint: (S,) column of the joint's value in (2, J).
        ref: (S,) its value at which it stands at the frame.
        R, p: (S, 3, 3), (S, 3, 1) the frame in the one before.
        turn, turn_twice: (S, 3, 3) cross product matrix of a revolute joint's axis and its square; else 0.
        slide: (S, 3, 1) a prismatic joint's axis; else 0.
        anchor: (S, 3, 1) a point of a revolute joint's axis; else 0.
    """

    chain: Indices
    joint: Indices
    ref: Array
    R: Interval
    p: Interval
    turn: Interval
    turn_twice: Interval
    slide: Interval
    anchor: Array

    @classmethod
    def of(cls, task: Task, joints: Sequence[int]) -> _Arms:
        """`Refused` for a link whose frame is not rotated rigidly."""
        hand, frames = task.hand, _frames(task)
        steps: dict[tuple[int, int], int] = {(-1, -1): 0}  # a joint and -1, or -1 and the link that ends a chain
        identity = Interval.of(np.eye(4)[:3])
        poses, chains = [identity], []
        for end in task.links:
            path, link = [], end
            while link >= 0:
                path.append(link)
                link = hand.links[link].parent
            pose, chain = identity, []
            for link in reversed(path):
                pose = _compose(pose, frames[link]) if link in frames else pose
                passed = [(j, -1) for j in hand.links[link].joints]
                if link == end and not passed and pose is not identity:
                    passed = [(-1, end)]
                for step in passed:
                    if step not in steps:
                        steps[step] = len(steps)
                        poses.append(pose)
                    chain.append(steps[step])
                    pose = identity
            chains.append(chain)
        depth = max(len(chain) for chain in chains)
        turning, sliding, anchor = (np.zeros((len(steps), 3)) for _ in range(3))
        ref, column = np.zeros(len(steps)), np.zeros(len(steps), dtype=np.intp)
        for (j, _), n in steps.items():
            if j >= 0:
                joint, revolute = hand.joints[j], hand.joints[j].type == "revolute"
                (turning if revolute else sliding)[n] = joint.axis
                anchor[n] = joint.anchor if revolute else 0.0
                ref[n], column[n] = joint.ref, joints.index(j)
        axis, pose = _unit_or_zero(turning), join([p[None] for p in poses], -3)
        turn = cross(axis[:, None, :], Interval.of(np.eye(3))).swapped()  # columns axis x e_i
        return cls(
            np.array([chain + [0] * (depth - len(chain)) for chain in chains], dtype=np.intp),
            column,
            ref,
            pose[..., :3],
            pose[..., 3:],
            turn,
            turn @ turn,
            _unit_or_zero(sliding)[..., None],
            anchor[..., None],
        )

    def carry(self, joints: Dual, point: Dual, vector: Dual) -> Dual:
        """(2, K, 3, 2) points and vectors (2, K, 3) of the contacts' links, in the palm frame."""
        if joints.value.shape[1]:
            by = joints[..., self.joint] - self.ref
            s, c = sin(by)[..., None, None], cos(by)[..., None, None]
            motion = s * self.turn + (1.0 - c) * self.turn_twice + np.eye(3)
            away = self.anchor - motion @ self.anchor + by[..., None, None] * self.slide
            R, p = self.R @ motion, self.R @ away + self.p
        else:
            n = joints.slope.shape[0]
            R, p = (Dual.constant(a.reshape(1, *a.shape), n) for a in (self.R, self.p))
        carried = columns([point, vector])
        for d in reversed(range(self.chain.shape[1])):
            at = self.chain[:, d]
            carried = R[..., at, :, :] @ carried + p[..., at, :, :] * np.array([1.0, 0.0])
        return carried


def _frames(task: Task) -> dict[int, Interval]:
    """(3, 4) of the links between the palm and the contacts, those exactly at their parent's left out."""
    hand, links = task.hand, set()
    for end in task.links:
        while end >= 0 and end not in links:
            links.add(end)
            end = hand.links[end].parent
    # the base's own pose moves nothing: the palm frame is the base's
    moved = [i for i in sorted(links) if hand.links[i].parent >= 0 and (hand.links[i].pose != np.eye(4)).any()]
    if not moved:
        return {}
    pose = np.array([hand.links[i].pose for i in moved])
    R = _orthonormal(pose[:, :3, 0], pose[:, :3, 1])
    crooked = np.abs(R.mid - pose[:, :3, :3]).max(axis=(1, 2))
    for i, by in zip(moved, crooked, strict=True):
        if not by <= CROOKED:
            raise Refused(f"link {hand.links[i].name} does not stand at a rotation, but {by:.3g} off one")
    frames = join([R, Interval.of(pose[:, :3, 3:])], -1)
    return {i: frames[n] for n, i in enumerate(moved)}


def _compose(a: Interval, b: Interval) -> Interval:
    """(3, 4) frame b in frame a."""
    return join([a[:, :3] @ b[:, :3], a[:, :3] @ b[:, 3:] + a[:, 3:]], -1)


def _orthonormal(first: Array, second: Array) -> Interval:
    """(n, 3, 3) rotations with column 0 along `first` (n, 3), column 1 as near to `second` as can be."""
    x, y = unit(Interval.of(first)), Interval.of(second)
    y = unit(y - dot(x, y)[:, None] * x)
    return columns([x, y, cross(x, y)])


def _unit_or_zero(a: Array) -> Interval:
    """(n, 3) unit vectors along the rows of a, 0 where they are 0."""
    zero = (a == 0).all(axis=1, keepdims=True)
    u = unit(Interval.of(np.where(zero, 1.0, a)))
    return Interval(np.where(zero, 0.0, u.lo), np.where(zero, 0.0, u.hi))


# --- regions ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Surface:
    """The regions of one side of the contacts, patches and caps apart.

    Attributes:
        patches, caps: None without.
        order: (K,) of the contacts, in the patches followed by the caps.
    """

    patches: _Patches | None
    caps: _Caps | _Centres | None
    order: Indices

    @classmethod
    def of(cls, regions: Sequence[Bezier | Cap], names: str, column: Mapping[str, int], *, still: bool) -> _Surface:
        """With parameters of these names; `still`: of a cap only its centre and axis are wanted."""
        patches = {k: r for k, r in enumerate(regions) if isinstance(r, Bezier)}
        caps = {k: r for k, r in enumerate(regions) if isinstance(r, Cap)}

        def at(contacts: Mapping[int, object]) -> Indices:
            of = [[column[f"contact:{k}:{name}"] for name in names] for k in contacts]
            return np.array(of, dtype=np.intp).T

        kind = _Centres.of if still else _Caps.of
        return cls(
            _Patches.of(list(patches.values()), at(patches)) if patches else None,
            kind(list(caps.values()), np.zeros(0, dtype=np.intp) if still else at(caps)) if caps else None,
            np.argsort([*patches, *caps]),
        )

    def at(self, x: Dual) -> tuple[Dual, ...]:
        """(2, K, 3) each: point, outward unit normal (of a cap that stands still: axis), two tangents."""
        parts = [part.at(x) for part in (self.patches, self.caps) if part is not None]
        return tuple(join(list(p), -2)[..., self.order, :] for p in zip(*parts, strict=True))


@dataclass(frozen=True, eq=False)
class _Centres:
    """Hand caps: centre and axis, constant in the link."""

    centre: Interval
    axis: Interval

    @classmethod
    def of(cls, caps: Sequence[Cap], at: Indices) -> _Centres:
        return cls(
            Interval.of(np.tile([c.center for c in caps], (2, 1, 1))),
            unit(Interval.of(np.tile([c.axis for c in caps], (2, 1, 1)))),
        )

    def at(self, x: Dual) -> tuple[Dual, ...]:
        n = x.slope.shape[0]
        centre, axis = Dual.constant(self.centre, n), Dual.constant(self.axis, n)
        return centre, axis, axis, axis  # a cap's equations have no tangents


@dataclass(frozen=True, eq=False)
class _Caps:
    """Object caps (C): rotations of their frames, centres, radii and signs; columns (2, C) of s and t."""

    parameters: Indices
    frame: Interval
    centre: Array
    radius: Array
    sign: Array

    @classmethod
    def of(cls, caps: Sequence[Cap], at: Indices) -> _Caps:
        frame = np.array([c.frame for c in caps])
        R = _orthonormal(frame[:, :, 2], frame[:, :, 0])[..., [1, 2, 0]]  # the axis exactly, e1 near its float
        centre, radius, sign = (np.array([getattr(c, name) for c in caps]) for name in ("center", "radius", "sign"))
        return cls(at, R, centre, radius[:, None], sign[:, None])

    def at(self, x: Dual) -> tuple[Dual, ...]:
        s, t = x[..., self.parameters[0]], x[..., self.parameters[1]]
        sin_s, cos_s, sin_t, cos_t = sin(s), cos(s), sin(t), cos(t)
        zero = 0.0 * sin_t
        local = [(sin_s * cos_t, sin_s * sin_t, cos_s), (cos_s * cos_t, cos_s * sin_t, -sin_s), (-sin_t, cos_t, zero)]
        turned = self.frame @ columns([join([a[..., None] for a in v], -1) for v in local])
        direction = turned[..., 0]
        return direction * self.radius + self.centre, direction * self.sign, turned[..., 1], turned[..., 2]


@dataclass(frozen=True, eq=False)
class _Patches:
    """Bezier patches (P) of any degrees, as control points of their derivatives filled up with 0.

    Attributes:
        parameters: (2, P) columns of u and v.
        sign: (P, 1) of the normal.
        base: (P, 6, 3) a point amid the control points of each of the derivatives in ORDERS.
        points: (P, 6, I * J, 3) these control points less the base: the polynomials sum to 1, and small
            points lose little to the width of the polynomials.
        weights: for u and for v the Bernstein polynomials of degree M, M-1, M-2: coefficient (P, 3, I),
            power of u and of 1-u.
    """

    parameters: Indices
    sign: Array
    base: Array
    points: Interval
    weights: tuple[tuple[Interval, NDArray[np.intp], NDArray[np.intp]], ...]

    @classmethod
    def of(cls, patches: Sequence[Bezier], at: Indices) -> _Patches:
        size = [max(p.points.shape[axis] for p in patches) for axis in (0, 1)]
        points, bases = [], []
        for patch in patches:
            for du, dv in ORDERS:
                derived = Interval.of(patch.points)
                for _ in range(du):
                    derived = float(derived.shape[0] - 1) * (derived[1:] - derived[:-1])
                for _ in range(dv):
                    derived = float(derived.shape[1] - 1) * (derived[:, 1:] - derived[:, :-1])
                bases.append(derived.mid.sum(axis=(0, 1)) / max(1, derived.shape[0] * derived.shape[1]))
                derived = derived - bases[-1]
                fill = [(0, n - m) for n, m in zip(size, derived.shape[:2], strict=True)] + [(0, 0)]
                points.append(Interval(np.pad(derived.lo, fill), np.pad(derived.hi, fill)))
        all_points = join([p.reshape(1, -1, 3) for p in points], -3).reshape(len(patches), 6, -1, 3)
        weights = tuple(_weights([p.degree[axis] for p in patches], size[axis]) for axis in (0, 1))
        base = np.array(bases).reshape(len(patches), 6, 3)
        return cls(at, np.array([[p.sign] for p in patches]), base, all_points, weights)

    def at(self, x: Dual) -> tuple[Dual, ...]:
        uv = [x[..., column] for column in self.parameters]
        u, v = (_bernstein(w.value, *weights) for w, weights in zip(uv, self.weights, strict=True))
        du, dv = (list(order) for order in zip(*ORDERS, strict=True))
        weight = u[..., du, :, None] * v[..., dv, None, :]  # (2, P, 6, I, J)
        d = (weight.reshape(*weight.shape[:3], 1, -1) @ self.points)[..., 0, :] + self.base  # (2, P, 6, 3)
        by_u, by_v = (w.slope[..., None, None] for w in uv)
        jet = Dual(d[..., [0, 1, 2], :], by_u * d[..., [1, 3, 4], :] + by_v * d[..., [2, 4, 5], :])
        first, second = jet[..., 1, :], jet[..., 2, :]
        return jet[..., 0, :], unit(cross(first, second)) * self.sign, first, second


def _weights(degrees: Sequence[int], size: int) -> tuple[Interval, NDArray[np.intp], NDArray[np.intp]]:
    """(P, 3, size) binomials of degrees M, M-1, M-2 of P patches, powers of u and of 1-u; 0 beyond the degree."""
    shape = (len(degrees), 3, size)
    binomials, up, down = np.zeros(shape), np.zeros(shape, dtype=np.intp), np.zeros(shape, dtype=np.intp)
    for p, degree in enumerate(degrees):
        for less in range(min(3, degree + 1)):
            for i in range(degree - less + 1):
                binomials[p, less, i] = comb(degree - less, i)
                up[p, less, i], down[p, less, i] = i, degree - less - i
    exact = Interval.of(binomials)
    return (exact if binomials.max() < 2.0**53 else exact * 1.0), up, down


def _bernstein(u: Interval, binomials: Interval, up: NDArray[np.intp], down: NDArray[np.intp]) -> Interval:
    """(2, P, 3, I) Bernstein polynomials at u (2, P)."""
    patch = np.arange(u.shape[1])[:, None, None]
    return _powers(u, up.shape[-1])[..., patch, up] * _powers(1.0 - u, up.shape[-1])[..., patch, down] * binomials


def _powers(u: Interval, count: int) -> Interval:
    """(2, P, count) powers 0, 1, .. of u."""
    powers = [Interval.of(np.ones(u.shape))]
    for _ in range(count - 1):
        powers.append(powers[-1] * u if len(powers) > 1 else u)
    return join([p[..., None] for p in powers], -1)
