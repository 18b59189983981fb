"""What "to 1e-9 of the load" means, for proofs that a state exists and for proofs that none does.

A state holds so if it solves the model exactly under a load w', with joint torques tau' and motions d' at the contacts
that differ from the given ones, and from those of object and fingers, by at most this: |dw_force| <= EPS F,
|dw_torque| <= EPS F size about the contacts' centroid, |dtau_j| <= EPS F times `GraspData.joint_units`,
|dd_i| <= EPS F at each contact, the turning of a soft finger included; and the work of dw and dtau along its motions is
at most WORK F^2. F is the scale of the load alone. Contact forces, however large, grant nothing. Proofs that no state
exists give way in (1), (2), (3) and the balance of energy by at least as much, so that there is no question of which
both can be proved.
"""

from __future__ import annotations

from functools import lru_cache
from math import hypot

import numpy as np
from flint import fmpq_mat

from handfast.proofs.fields import Array, cross_rows, rationals, rounded
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import Question

UNIT_ROUNDOFF = 2.0**-53  # relative error of one rounded operation
EPS = 1e-9
WORK = 1e-6
# [N], [m] nothing is proved of smaller scales and grasps: roundings of their products are not in proportion
MIN_FORCE_SCALE, MIN_SIZE = 1e-100, 1e-30
TOO_SMALL = (
    f"the load and the commands are below {MIN_FORCE_SCALE:g} N, or the grasp below {MIN_SIZE:g} m, where rounding is "
    "not bounded"
)
UNBOUNDED_FACTOR = 1e3  # times the other forces in play: a disturbance that is resisted up to there counts as unbounded
COMPLETE_CAP = 1e4  # times all forces in play: a proof for motions inside a cap counts as complete from there on
ENOUGH_CAP = 1e6  # likewise: where there has to be a cap, none is looked for beyond


def about_centroid(g: GraspData, w: Array) -> Array:
    """(3,) torque of a wrench (6,) about the contacts' centroid."""
    (x, y, z), (a, b, c) = g.centroid.tolist(), w[:3].tolist()
    return np.asarray(w[3:] - np.array([y * c - z * b, z * a - x * c, x * b - y * a]))


def size_of(g: GraspData, w: Array) -> float:
    """[N] of a wrench (6,): its force, or its torque about the contacts' centroid over `size`, whichever is larger."""
    return max(hypot(*w[:3].tolist()), hypot(*about_centroid(g, w).tolist()) / g.size)


def load_scale(g: GraspData, w: Array) -> float:
    """[N] of a load w (6,): `size_of` it.

    Without a load: the largest command or given torque as a force, each joint's over `joint_units`; 1 if none acts.
    As a norm of w it is at most the sum of the scales of the parts of w.
    """
    scale = size_of(g, w)
    if scale == 0 and g.l:
        drives = np.abs(g.R.T * g.command) / g.joint_units[:, None]
        scale = max(float(drives.max(initial=0.0)), float((np.abs(g.torque) / g.joint_units).max()))
    return scale or 1.0


def motion_size(g: GraspData, motion: Array, off: Array | float = 0.0) -> float:
    """[N] of motions (..., 6 + l) of object and joints, at unit stiffness: no less than the largest of all these.

    The object's motion at the contacts' centroid, its turn times `size`, and each joint's motion times `joint_units`.
    off: (6 + l,) by how much the motions may differ besides. HOLDS says how large its motions are, and a proof that
    holds for motions up to a cap only what that is, in this measure.
    """
    v, off = np.asarray(motion), np.broadcast_to(off, (6 + g.l,))
    at_centroid = v[..., :3] + cross_rows(v[..., 3:6], g.centroid)
    turn_off = float(np.linalg.norm(off[3:6]))
    arm = float(np.linalg.norm(g.centroid))
    rounding = 1e-15 * arm * np.abs(v[..., 3:6]).max(initial=0.0)
    moved = np.linalg.norm(at_centroid, axis=-1) + float(np.linalg.norm(off[:3])) + arm * turn_off + rounding
    turned = (np.linalg.norm(v[..., 3:6], axis=-1) + turn_off) * g.size
    joints = (np.abs(v[..., 6:]) + off[6:]) * g.joint_units
    return float(max(moved.max(), turned.max(), joints.max(initial=0.0)) * (1 + 1e-12))


def slack_units(g: GraspData) -> Array:
    """(6 + l,) by which (1), forces and torques about the contacts' centroid, and (2), by joint, may be missed, over
    `EPS` times the scale.
    """
    return np.concatenate([np.ones(3), np.full(3, g.size), g.joint_units])


# --- forces in play in a question [N], as forces at a contact: units, axes and the origin change nothing ----


def drives(q: Question, sought: float = 0.0) -> float:
    """[N] the largest of commands, limits, given torques and friction of joints, each where it meets a contact.

    sought: [N m, N] as large are commands that are sought.
    In a step of a load's path contact forces from before as well. Of joints that couplings drive at the contacts of all
    that they drive, too: a motor may turn a joint that itself moves none.
    """
    g = q.grasp
    force = q.force_limit if np.isfinite(q.force_limit) else 0.0
    pressed = -g.gaps  # before a step of a load's path
    own = [_drives(q, np.eye(g.l), sought), *([_drives(q, ways(g.A), sought)] if len(g.A) else [])]
    return float(max(*own, force, pressed.max(initial=0.0)))


def _drives(q: Question, moved: Array, sought: float) -> float:
    """[N] the largest of commands, limits, given torques and friction, where joints move in some ways (l, d).

    Each as it acts on a way, or on another to which actuators that are held pass it on.
    """
    g = q.grasp
    arms, R = g.arms_of(moved), np.abs(g.R @ moved)
    touching = (g.J @ moved).any(axis=0) | (g.twist_jacobian @ moved).any(axis=0)
    limits = np.array([q.torque_limits.get(name, 0.0) for name in g.actuators])
    given = np.where(g.backdrivable | (not q.seeks_commands), np.abs(g.command), sought * q.sought)
    commands = np.maximum(given, limits)
    free = ((moved != 0) & ~q.equivalent.held[:, None]).any(axis=0)
    of_joints = np.where(free, (np.abs(g.torque) + g.friction) @ np.abs(moved), 0.0)
    acts = np.maximum((commands[:, None] * R).max(axis=0, initial=0.0), of_joints)
    there = (acts[:, None] * passed_on(R[~g.backdrivable])).max(axis=0, initial=0.0)
    return float((there / arms)[touching].max(initial=0.0))


def passed_on(R: Array) -> Array:
    """(..., l, l) the largest torque at the second joint for one at the first, by actuators of rows |R| (..., a, l).

    One that is held passes torques on between its joints as the entries of its row are. Which are held is not known, so
    this is the most that chains of them can do.
    """
    with np.errstate(divide="ignore"):
        inverse = np.where(R > 0, 1 / R, 0.0)
    step: Array = np.max(inverse[..., :, None] * R[..., None, :], axis=-3, initial=0.0)
    out = step = np.maximum(step, np.eye(R.shape[-1]))
    for _ in range(int(np.max(((R > 0).sum(axis=-1) > 1).sum(axis=-1), initial=0)) - 1):
        out = np.max(out[..., :, :, None] * step[..., None, :, :], axis=-2)
    return out


def ways(A: Array) -> Array:
    """(l, d) how joints may move where couplings (k, l) hold: each column moves one by 1, and those that it drives."""
    return _ways(A.shape, np.ascontiguousarray(A, dtype=float).tobytes())


@lru_cache(maxsize=64)
def _ways(shape: tuple[int, int], entries: bytes) -> Array:
    (k, l), every = shape, np.frombuffer(entries)
    reduced, rank = fmpq_mat(k, l, rationals(every)).rref() if k and l else (None, 0)
    rows = [] if reduced is None else [[reduced[i, j] for j in range(l)] for i in range(rank)]
    driven = [next(j for j, x in enumerate(row) if x) for row in rows]
    own = [j for j in range(l) if j not in driven]
    out = np.zeros((l, len(own)))
    out[own, np.arange(len(own))] = 1.0
    for j, row in zip(driven, rows, strict=True):
        out[j] = [-rounded(row[k]) for k in own]
    out.flags.writeable = False
    return out


def travel(g: GraspData, rows: Array) -> Array:
    """(k,) [N] how far contacts move at most where sums of joint motions, rows (k, l), move by 1.

    With the joints that couplings drive, and those that actuators drive which are held: a joint may itself move no
    contact.
    """
    out, held = np.zeros(len(rows)), ~g.backdrivable
    for moved in (np.eye(g.l), ways(g.A)) if len(g.A) else (np.eye(g.l),):
        its, R = np.abs(rows @ moved), np.abs(g.R @ moved)[held]
        far = (g.arms_of(moved)[:, None] * passed_on(R)).max(axis=0, initial=0.0)
        out = np.maximum(out, np.where(its > 0, far / np.where(its > 0, its, 1.0), 0.0).max(axis=1, initial=0.0))
    return out


def left_behind(g: GraspData) -> float:
    """[N] how far contacts have to go back, at most, until they, stops and tendons are where they were from rest."""
    if g.start is None:
        return 0.0
    gap, away = float(np.abs(g.gaps).max()), np.abs(np.concatenate([g.stops_left, g.slack]))
    if not away.any():
        return gap
    return max(gap, float((away[away > 0] * travel(g, np.vstack([np.eye(g.l), g.R])[away > 0])).max()))


def in_play(q: Question, magnitude: float) -> float:
    """[N] the largest of all forces in play, with the direction at a magnitude or, where they are sought, commands."""
    sought = magnitude if q.seeks_commands else 0.0
    return max(load_scale(q.grasp, q.wrench + magnitude * q.direction), drives(q, sought))


def no_magnitude(q: Question) -> float:
    """A magnitude that counts as none beside what else acts, in ranges of them."""
    return farthest(q) / 1e4


def farthest(q: Question) -> float:
    """The magnitude up to which a maximum is to be sought at least: `UNBOUNDED_FACTOR` times the other forces in play.

    Endless where the direction is no force.
    """
    others = max(size_of(q.grasp, q.wrench), drives(q))
    along = size_of(q.grasp, q.direction)
    return UNBOUNDED_FACTOR * (others or along) / along if along else np.inf
