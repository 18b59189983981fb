"""Checks a proof of existence with interval arithmetic alone: nothing of the search that wrote it.

With F(x) = 0 the contact equations in the dependent coordinates x, the others frozen, X = c + [-r, r] the
proof's box, J an enclosure of F' over X and any matrix Y,

    K = c - Y F(c) + (I - Y J) (X - c)

lies inside X only if X contains a solution, just one, and that lies in K (Krawczyk 1969). Then limits,
patches and bounds are tested over all of X. Per contact, with the link at (R_k, p_k), the object at (R, p),
o and n its point and outward unit normal, o_s and o_t two tangents:

- a hand cap with centre c, radius r and sign g (-1 if hollow): its outward normal must be -R n, so
  p_k + R_k c = p + R (o + g r n), 3 equations; and -g R n must lie in the cone about R_k axis.
- any other hand region with point h and outward normal m: p_k + R_k h = p + R o, (R_k m) . (R o_s) = 0 and
  (R_k m) . (R o_t) = 0, 5 equations; and (R_k m) . (R n) < 0.

Every float of hand, task and regions is exact, except where no float can be: rotations and unit vectors are
those that Gram-Schmidt makes of the floats, so that links are rigid and spheres are round.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.synthesis.certify.equations import Equations, Values, equations_of
from handfast.synthesis.certify.existence import Existence, ProofRefused, free_joints
from handfast.synthesis.certify.interval_arithmetic import ULP, Interval, cos, sqr, sqrt
from handfast.synthesis.task import Task

SHORTEST = 1e-3  # length of a quaternion below which it is none


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


def verify_existence(task: Task, proof: Existence) -> Report:
    """Does an exact configuration of the task exist in the box of the proof?"""
    try:
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
            equations = equations_of(task)
            box = _box(equations, proof)
            at = equations.at(box.coordinates, box.slope)
            reasons, contraction, step, gap = _krawczyk(box, at)
            bounds = _bounds(equations, box, at)
    except (ProofRefused, InputError) as fault:
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


def _box(equations: Equations, proof: Existence) -> _Box:
    """The box; `ProofRefused` for a proof that does not fit the task or contradicts itself."""
    e = equations
    _refuse_misfit(e.task, proof)
    values, labels = proof.coordinates, proof.dependent
    if len(labels) != e.count:
        raise ProofRefused(f"{len(labels)} coordinates are dependent; the {e.count} equations need as many")
    unknown = [label for label in labels if label not in e.column]
    if unknown:
        raise ProofRefused(f"'{unknown[0]}' is no coordinate of this task; they are {', '.join(e.column)}")
    twice = [label for label in labels if labels.count(label) > 1]
    if twice:
        raise ProofRefused(f"{twice[0]} is dependent twice")
    if all(f"quaternion:{i}" in labels for i in range(4)):
        raise ProofRefused("all of the quaternion is dependent; its length is free, so one component must be frozen")
    for label, radius in zip(labels, proof.radii.tolist(), strict=True):
        if not radius > 0:
            raise ProofRefused(f"the radius of {label} is {radius:g}; it must be positive")
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
            raise ProofRefused(f"has no value for joint {name}; the free joints are {', '.join(free)}")
    for name in proof.joints:
        if name not in free:
            raise ProofRefused(f"has a value for joint {name}; the free joints are {', '.join(free) or 'none'}")
    if len(proof.contacts) != len(task.contact_pairs):
        raise ProofRefused(f"has {len(proof.contacts)} contacts; the task has {len(task.contact_pairs)}")
    for k, (point, pair) in enumerate(zip(proof.contacts, task.contact_pairs, strict=True)):
        if point.link != pair.link:
            raise ProofRefused(f"contact {k} is on {point.link}; in the task it is on {pair.link}")
        patch = pair.hand.ball is None
        if patch != (point.hand is not None):
            needed = "no cap, so it needs u and v" if patch else "a cap, which has no u and v"
            raise ProofRefused(f"contact {k}: the hand region is {needed}")
    if not (proof.quaternion**2).sum() > SHORTEST**2:
        raise ProofRefused(f"the quaternion is shorter than {SHORTEST:g}")


# --- is there a solution? ---------------------------------------------------------------------------


def _krawczyk(box: _Box, at: Values) -> tuple[list[str], float, float, float]:
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


def _bounds(equations: Equations, box: _Box, at: Values) -> list[_Bound]:
    """Every bound, tested over the whole box."""
    return [
        *_joint_bounds(equations, at.joints[1]),
        *_pose_bounds(equations.task, box.coordinates[1, equations.columns("position:0", 3)], at.rotation[1]),
        *_contact_bounds(equations, box.coordinates[1], at.facing[1]),
    ]


def _between(label: str, what: str, x: Interval, lo: float, hi: float) -> _Bound:
    """Is x strictly between two floats?"""
    above = (x - lo).lo if lo > -np.inf else np.inf
    slack = np.minimum(above, (hi - x).lo if hi < np.inf else np.inf)  # NaN if one of them is
    fault = f"{what} comes to [{x.lo:.9g}, {x.hi:.9g}] in the box, not strictly inside [{lo:.9g}, {hi:.9g}]"
    return _Bound(label, float(slack), fault)


def _joint_bounds(equations: Equations, q: Interval) -> list[_Bound]:
    out = []
    for i, j in enumerate(equations.drive.joints):
        joint = equations.task.hand.joints[j]
        if joint.lower == joint.upper:
            continue  # fixed: `Drive.of` has seen to it
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


def _contact_bounds(equations: Equations, x: Interval, facing: Interval) -> list[_Bound]:
    """`facing` (K,): hand axis (cap) or outward normal (patch) times the object's outward normal."""
    out = []
    for k, pair in enumerate(equations.task.contact_pairs):
        for name in "stuv":
            label = f"contact:{k}:{name}"
            region = pair.object if name in "st" else pair.hand
            if not region.ball:
                out.append(_between(label, label, x[equations.column[label]], 0.0, 1.0))
            elif name == "s" and region.ball.half_angle < np.pi:  # -s is the point opposite, as far from the axis
                s, most = x[equations.column[label]], region.ball.half_angle
                out.append(_between(label, label, s, -most, most))
        if not (ball := pair.hand.ball):
            cosine = -facing[k]
            comes = f"their cosine comes to [{float(-cosine.hi):.9g}, {float(-cosine.lo):.9g}] in the box"
            fault = f"contact {k}: the normals are not opposite: {comes}"
            out.append(_Bound(f"contact:{k}:normals", float(cosine.lo), fault))
        elif ball.half_angle < np.pi:
            inside = -ball.sign * facing[k] - cos(Interval.of(ball.half_angle))
            fault = f"contact {k} may leave the hand's cap, by a cosine of {-inside.lo:.3g}"
            out.append(_Bound(f"contact:{k}:cone", float(inside.lo), fault))
    return out
