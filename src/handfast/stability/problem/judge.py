"""How far a state, or many, is from solving equations (1) to (8) of `model.py`: the judge of every answer.

Nothing here knows how a solution was found.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from handfast.core.arrays import Array, Mask, times, transposed
from handfast.core.transforms import cross_rows
from handfast.model.grasp import Grasp
from handfast.stability.problem.exact_sums import Sums, exact_sums
from handfast.stability.problem.grasp_rows import AnyGrasp, grasp_of
from handfast.stability.problem.model import (
    State,
    StateRows,
    actuator_motion,
    arms_of_actuators,
    beyond_stops,
    commanded,
    cone_excess,
    dissipation_defect,
    friction,
    joint_arms,
    joint_balance,
    joint_units,
    lengths,
    object_balance,
    reaction_defect,
    reaction_range,
    relative_motion,
    scaled,
    sliding,
    spring_force,
    turning,
)

EXACT_SUM_THRESHOLD = 1e4  # times the largest force: motions and forces from which on sums are taken without rounding
VANISHING = 1e-100  # numbers below are scaled up before anything is squared


def load_scale(grasp: AnyGrasp, w: Array, command: Array | None = None) -> Any:
    """[N] what residuals are measured by: the load (6,), its force, or its torque about the contacts' middle over size.

    Without a load the largest command or given torque, each over its joint's unit; 1 if none acts. Contact forces,
    however large, have no part in it: what holds is what misses neither load nor commands. (k,) of many loads (k, 6).
    """
    scale = np.maximum(lengths(w[..., :3]), lengths(w[..., 3:] - cross_rows(grasp.middle, w[..., :3])) / grasp.size)
    if np.all(scale > 0) or not grasp.l:
        return np.where(scale > 0, scale, 1.0)[()]
    f_c = grasp.command if command is None else command
    units = _arms(grasp).units
    drives = np.abs(transposed(grasp.mechanism.R) * f_c[..., None, :]) / units[..., None]
    given = (np.abs(grasp.given_torques) / units).max(axis=-1)
    beside = np.maximum(drives.max(axis=(-2, -1), initial=0.0), given)
    return np.where(scale > 0, scale, np.where(beside > 0, beside, 1.0))[()]


class _Arms(NamedTuple):
    """What residuals of a grasp's states take of the grasp alone; of many grasps with one more axis in front."""

    joints: Array  # (l,) `joint_arms`
    actuators: Array  # (a,) `actuator_arms`
    units: Array  # (l,) `joint_units`
    rounded: Any  # bool: are contacts so near each other that the rounding of G and J counts?
    at_contact: Array  # (6 + 3 m + 2 l + a + k,) what one of r, c, q, reactions, f and couplings is at a contact
    slip: Array  # (k, l) motion at a contact per unit of each coupling
    moves: Mask  # (a,) bool: actuators that may move without a command
    backdrivable: Mask  # (a,)
    reaction: tuple[Array, Array]  # (l,) each: `reaction_range` over the arms


@lru_cache(maxsize=8)  # of a grasp that is asked again and again
def _arms(grasp: AnyGrasp) -> _Arms:
    mech, arms = grasp.mechanism, joint_arms(grasp)
    lo, hi = reaction_range(grasp)
    actuators = arms_of_actuators(np.abs(mech.R), arms)
    reach = np.abs(grasp.positions).max(axis=(-2, -1), initial=0.0)
    one = np.ones((*np.shape(reach), 3))
    turns = one * np.asarray(reach + grasp.size)[..., None]
    couplings = (np.abs(mech.A) / arms[..., None, :]).max(axis=-1, initial=0.0)
    forces = np.ones((*np.shape(reach), 3 * grasp.m))
    return _Arms(
        joints=arms,
        actuators=actuators,
        units=joint_units(grasp),
        rounded=reach / grasp.spacing > EXACT_SUM_THRESHOLD,
        at_contact=np.concatenate([one, turns, forces, arms, 1 / arms, 1 / actuators, couplings], axis=-1),
        slip=np.divide(arms[..., None, :], np.abs(mech.A), out=np.zeros(mech.A.shape), where=mech.A != 0),
        moves=commanded(grasp, np.zeros(mech.a)),
        backdrivable=np.array(mech.backdrivable, dtype=bool),
        reaction=(lo / arms, hi / arms),
    )


def linear_sums(grasp: AnyGrasp, w: Array, state: State | StateRows, force: Any) -> Sums:
    """The linear equations at a state, or at many, in floating point where rounding cannot matter, else exact.

    Large numbers that cancel hide what they are added to, and G and J are rounded: a locked motor and a coupling on
    the same joints may carry 10^17 each way, two joints that move alike may turn as far against each other.

    force: [N] the largest that acts, (k,) of many.
    """
    x, own = state, _arms(grasp)
    torsion = x.torsion if len(grasp.soft) else None
    sums = Sums(
        object_balance(grasp, x.c, w, torsion),
        joint_balance(grasp, x.c, x.f, x.coupling, x.reaction, torsion),
        times(grasp.mechanism.A, x.q),
        relative_motion(grasp, x.r, x.q),
        actuator_motion(grasp, x.q),
        turning(grasp, x.r, x.q),
    )
    parts = np.concatenate([x.r, x.c, x.q, x.reaction, x.f, x.coupling], axis=-1)
    largest = (np.abs(parts) * own.at_contact).max(axis=-1)
    exact = (largest / force > EXACT_SUM_THRESHOLD) | own.rounded
    if not np.any(exact):
        return sums
    if isinstance(x, State):
        return exact_sums(grasp_of(grasp), w, x)
    for i in np.flatnonzero(exact & np.isfinite(largest) & np.isfinite(w).all(axis=-1)):
        one = exact_sums(grasp_of(grasp, int(i)), w[i], x.row(int(i)))
        for f in fields(Sums):
            getattr(sums, f.name)[i] = getattr(one, f.name)
    return sums


@dataclass(frozen=True)
class Residuals:
    """How far a state is from solving (1)-(8), relative to the load (`load_scale`): without units; (k,) of k states.

    Torques on the object are about the contacts' middle, over the grasp's size; those of joints over `joint_units`;
    motions are measured by the force that they cause at a contact. A sliding contact's direction is judged at full
    weight once it slides farther than the scale; below, in proportion.
    """

    object_balance: Any  # (1)
    joint_balance: Any  # (2)
    couplings: Any  # A q = 0
    normal: Any  # (4), with (17) if eta > 0
    cone: Any  # (5)
    dissipation: Any  # (6), (7); 0 by definition if the maximum dissipation principle is left out
    actuators: Any  # (8)
    reactions: Any = 0.0  # the joints' own, see `reaction_range`

    @property
    def worst(self) -> Any:
        """The largest of them; NaN if one is."""
        return np.max([getattr(self, f.name) for f in fields(self)], axis=0)[()]


def residuals(
    grasp: AnyGrasp,
    w: Array,
    state: State | StateRows,
    *,
    eta: float = 0.0,
    command: Array | None = None,
    mdp: bool = True,
) -> Residuals:
    """Check a state, or many of one grasp, against the exact model, equations (1) to (8).

    Args:
        grasp: contacts, joints, mechanism, commands; of many states it may be one grasp each.
        w: (6,) disturbance [N, N m], object frame at the object's origin; (k, 6) of many states.
        state: the candidate, or the candidates.
        eta: uncertainty of the contact normals [rad], equation (17).
        command: (a,) commanded forces to use instead of the grasp's; (k, a) of many states.
        mdp: leave out (6) and (7) if False, the friction of the grasp-force literature (section VII-A).
    """
    w = np.asarray(w, dtype=float)
    f_c = np.broadcast_to(grasp.command if command is None else command, state.f.shape)
    largest = np.maximum(np.abs(w).max(axis=-1), np.abs(state.c).max(axis=-1, initial=0.0))
    small = (largest > 0) & (largest < VANISHING)  # numbers whose squares vanish
    with np.errstate(all="ignore"):
        if isinstance(state, State):
            return (
                _scaled_up(grasp_of(grasp), w, state, f_c, eta, mdp)
                if small
                else _residuals(grasp, w, state, f_c, eta, mdp)
            )
        out = _residuals(grasp, w, state, f_c, eta, mdp)
        for i in np.flatnonzero(small):
            one = _scaled_up(grasp_of(grasp, int(i)), w[i], state.row(int(i)), f_c[i], eta, mdp)
            for f in fields(out):
                getattr(out, f.name)[i] = getattr(one, f.name)
    return out


def _scaled_up(grasp: Grasp, w: Array, x: State, f_c: Array, eta: float, mdp: bool) -> Residuals:
    """Of a state of vanishing numbers; all is homogeneous, so that it is judged as well as any."""
    largest = max(np.abs(w).max(), np.abs(x.c).max(initial=0.0))
    s = 2.0 ** min(-np.round(np.log2(largest)), 1000.0)
    return residuals(grasp.with_laws_times(s), s * w, scaled(x, s), eta=eta, command=s * f_c, mdp=mdp)


def _residuals(grasp: AnyGrasp, w: Array, x: State | StateRows, f_c: Array, eta: float, mdp: bool) -> Residuals:
    own, many = _arms(grasp), w.shape[:-1]
    F = load_scale(grasp, w, f_c)
    sums = linear_sums(grasp, w, x, F)
    d, c = (y.reshape(*many, grasp.m, 3) for y in (sums.d, x.c))
    if len(grasp.soft):
        rubs, slides = friction(grasp, x.c, x.torsion), sliding(grasp, sums.d, sums.twist)
    else:  # the same without what torsion adds, which is 0
        rubs, slides = c[..., 1:], d[..., 1:]
    dt = lengths(slides)
    moment = sums.object[..., 3:] - cross_rows(grasp.middle, sums.object[..., :3])

    # (8) in the actuator's own sense of command, motions and forces both brought to newtons
    sense = np.where(f_c < 0, -1.0, 1.0)
    t = sense * (sums.t + _of_start(grasp, "slack")) * own.actuators
    slack = sense * (x.f - f_c) / own.actuators
    missed = np.maximum.reduce([-t, -slack, np.minimum(np.abs(t), np.abs(slack))])
    actuator = np.where((f_c != 0) | own.moves, missed, np.abs(t))
    actuator = np.where(own.backdrivable, np.abs(slack), actuator)
    side, carried = beyond_stops(grasp, x.reaction)
    reaction = reaction_defect(x.q * own.joints, (x.reaction - carried) / own.joints, *own.reaction)
    if side.any():
        left = np.where(side != 0, _of_start(grasp, "stops") + side * x.q, np.inf) * own.joints
        reaction = np.maximum.reduce([reaction, -left, np.minimum(left, np.abs(carried) / own.joints)])
    dissipation = dissipation_defect(c[..., 0], rubs, slides, grasp.mu) / np.maximum(dt, _wide(F, 1))[..., None]
    slip = np.abs(sums.couplings)[..., None] * own.slip

    def worst(values: Array, axes: int = 1) -> Any:
        return values.max(axis=tuple(range(-axes, 0)), initial=0.0) / F

    idle: Any = 0.0  # torsion of point contacts, which carry none
    if isinstance(x, State):
        idle = worst(np.abs(np.delete(x.torsion, grasp.soft)) / grasp.size)
    return Residuals(
        object_balance=np.maximum(lengths(sums.object[..., :3]), lengths(moment) / grasp.size) / F,
        joint_balance=worst(np.abs(sums.joints) / own.units),
        couplings=worst(slip, 2),
        normal=worst(np.abs(c[..., 0] - spring_force(d, eta, _of_start(grasp, "gaps")))),
        cone=np.maximum(worst(cone_excess(c[..., 0], rubs, grasp.mu)), idle),
        dissipation=worst(np.abs(dissipation), 2) if mdp else np.zeros(many)[()],
        actuators=worst(actuator),
        reactions=worst(reaction),
    )


def _of_start(grasp: AnyGrasp, name: str) -> Any:
    """A part of the state that a step starts from, 0 where nothing has moved yet."""
    return 0.0 if grasp.start is None else getattr(grasp.start, name)


def _wide(x: Any, axes: int) -> Array:
    """Numbers (...) with so many axes of length 1 behind them."""
    x = np.asarray(x)
    return x.reshape(*x.shape, *[1] * axes)
