"""A stability question as scaled arrays, so that one set of tolerances suits every hand and unit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.core.transforms import cross, cross_rows
from handfast.model.grasp import Grasp
from handfast.proofs.question import LARGEST_GOAL, Question
from handfast.proofs.states import State
from handfast.proofs.tolerance import drives, passed_on, ways
from handfast.stability.problem import model
from handfast.stability.problem.equivalent_grasp import EquivalentGrasp, equivalent_of
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.grasp_rows import AnyGrasp, GraspRows
from handfast.stability.problem.model import state_of

BALANCE_TOLERANCE = 1e-9  # relative: forces that miss a disturbance by less balance it
STRONGEST = 1e3  # times the other forces in play: as far goes the search for commands
UNBOUNDED_DISTURBANCE = 1e4  # a disturbance this many times the other forces in play counts as unbounded
COUPLING_ROUNDING = 1e-12  # relative: motions of contacts that are less are none
RUBS = 0.1  # share of a joint's dry friction that is a force in play: it is the most that may act, not what acts


@dataclass(frozen=True, eq=False)
class ScaledPoint:
    """Scaled unknowns (shapes as in `ScaledProblem`), the scalar of the goal, and (s,) torsions over levers."""

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    scalar: float = 0.0
    twist: Array = dataclasses.field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class ScaledProblem:
    """The model for one grasp, with lengths in grasp sizes, joints in moment arms, forces in force scales.

    Actuators commanded in the negative direction are mirrored here (rows of R and f change sign), so
    that (8) reads t >= 0, f >= f_c everywhere.

    Joints and actuators are those of the equivalent grasp, which are those of the grasp where it has no laws of joints.

    Of many grasps at once (`build_rows`) arrays and scales have one more axis in front, which the shapes below leave
    out; `grasp` and `equivalent` are those of the first.

    Attributes:
        grasp: the question's grasp; equivalent: what stands for it.
        wrench, along: (6,) the disturbance wrench + s along [N, N m], as asked.
        limits: uncertainty of contact normals, limits of forces, as asked.
        mdp: with the maximum dissipation principle.
        w0, direction: (6,) scaled: the disturbance is w0 + s / direction_scale * direction.
        direction_scale: a power of two that brings the direction to the size of the other forces, however long it was
            given.
        f_c: (a,) scaled commands, >= 0.
        moves: (a,) bool, actuators that may move.
        driven: (a,) bool, those among them whose command is what is sought.
        f_max: (a,) scaled limits of |f|; inf where there is none.
        cn_max: scaled limit of every normal force; inf for none.
        G, J, R, A, mu: scaled model arrays, (6, 3m), (3m, l), (a, l), (k, l), (m,).
        soft: (s,) contacts that are soft fingers; twist_map, twist_jacobian: (6, s), (s, l) scaled, as of the grasp.
        torque: (l,) scaled torques that are given.
        force: [N] the force scale; length: [m] the length scale; middle: (3,) of the contacts, scaled.
        joint_scale: (l,) moment arms [m]; actuator_scale (a,), coupling_scale (k,): of their forces, over `force`.
    """

    grasp: Grasp
    equivalent: EquivalentGrasp
    wrench: Array
    along: Array
    limits: GraspLimits
    mdp: bool
    w0: Array
    direction: Array
    direction_scale: float
    f_c: Array
    moves: Mask
    driven: Mask
    f_max: Array
    cn_max: float
    G: Array
    J: Array
    R: Array
    A: Array
    soft: Indices
    twist_map: Array
    twist_jacobian: Array
    torque: Array
    mu: Array
    force: float
    length: Any
    middle: Array
    joint_scale: Array
    actuator_scale: Array
    coupling_scale: Array

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """(m, l, a, k): contacts, joints, actuators, couplings."""
        return self.mu.shape[-1], self.J.shape[-1], self.R.shape[-2], self.A.shape[-2]

    @cached_property
    def lengths(self) -> Array:
        """(6,) 1 for translations and forces, 1 / length for rotations and torques: scaled wrench over wrench."""
        return _lengths(self.length)

    @cached_property
    def strongest(self) -> float:
        """[N] the largest of the forces in play beside a disturbance that is sought, limits included."""
        within, none = self.limits, np.zeros(6)
        question = Question(
            grasp_data(self.grasp),
            LARGEST_GOAL,
            False,
            none,
            none,
            within.eta,
            self.mdp,
            within.torque_limits,
            within.largest_normal_force,
            (),
        )
        return max(self.force, drives(question))

    @property
    def is_given(self) -> bool:
        """Does anything act whose size is given, beside loads and commands, so that states are no multiples?"""
        return self.equivalent.is_given or self.grasp.start is not None

    @property
    def gaps(self) -> Array:
        """(m,) scaled `Start.gaps`; 0 where nothing has moved yet."""
        start = self.grasp.start
        return np.zeros(self.mu.shape[-1]) if start is None else start.gaps / self.force

    @property
    def slack(self) -> Array:
        """(a,) scaled `Start.slack` of the equivalent grasp, its stops included."""
        start = self.equivalent.plain.start
        return np.zeros(self.R.shape[-2]) if start is None else start.slack * np.abs(self.actuator_scale) / self.force

    def size_of(self, w: Array) -> float:
        """[N] a disturbance (6,), wherever the object's frame is and however it is turned."""
        return _size(self.grasp, w)

    @property
    def search_end(self) -> float:
        """The scaled magnitude at which the search for a maximum ends: `UNBOUNDED_DISTURBANCE` times the other forces
        in play."""
        return UNBOUNDED_DISTURBANCE * self.strongest / (self.direction_scale * self.size_of(self.along))

    @property
    def last_magnitude(self) -> float:
        """`search_end` as a multiple of the direction as it was given."""
        return self.direction_scale * self.search_end

    @property
    def unit_magnitude(self) -> float:
        """The magnitude at which a disturbance that is sought is as large as the other forces in play."""
        return self.last_magnitude / UNBOUNDED_DISTURBANCE

    @property
    def command_unit(self) -> float:
        """[N m or N] of a scaled unit of the largest command that is sought; 1 if none is."""
        return float(self.command_units[self.driven].max()) if self.driven.any() else 1.0

    @property
    def command_end(self) -> float:
        """The scaled command of the largest that are sought at which their search ends.

        `STRONGEST` times the other forces in play, at contacts however far couplings let a motor move them.
        """
        if not len(self.A) or not self.driven.any():
            return STRONGEST
        arms, R = _arms_of_ways(self.equivalent.plain)
        R = R[self.driven]
        far = np.where((R > 0) & np.isfinite(arms), arms / np.where(R > 0, R, 1.0), 0.0).max(initial=0.0)
        return STRONGEST * max(1.0, float(far) * self.force / self.command_unit)

    @property
    def command_units(self) -> Array:
        """(a,) [N m or N] of a scaled unit of each actuator's force."""
        return np.abs(_wide(self.force) * self.actuator_scale)

    def relative_motion(self, r: Array, q: Array) -> Array:
        """(m, 3) scaled d = G^T r - J q, equation (3)."""
        return (self.G.T @ r - self.J @ q).reshape(-1, 3)

    def unscale(self, x: ScaledPoint, share: float = 1.0) -> State:
        """A solution of the scaled equations as a `State` of the grasp in its own units.

        share: what is given to joints, in multiples of what the grasp says.
        """
        q, f, coupling, reaction = self.equivalent.parts_of(
            self.force * x.q / self.joint_scale,
            self.force * x.f * self.actuator_scale,
            self.force * x.coupling * self.coupling_scale,
            share=share,
        )
        torsion = np.zeros(len(self.mu))
        torsion[self.soft] = self.force * x.twist * self.grasp.levers
        return state_of(
            r=self.force * self.lengths * x.r,
            q=q,
            c=self.force * x.c,
            f=f,
            coupling=coupling,
            reaction=reaction,
            torsion=torsion,
        )

    def scaled(self, state: State, scalar: float = 0.0, share: float = 1.0) -> ScaledPoint:
        """The other way round: a state as scaled unknowns, with the scalar that belongs to it; share: of `unscale`."""
        q, f, coupling = self.equivalent.plain_parts(state, share)
        return ScaledPoint(
            state.r / (self.force * self.lengths),
            q * self.joint_scale / self.force,
            state.c / self.force,
            f / (self.force * self.actuator_scale),
            coupling / (self.force * self.coupling_scale),
            scalar,
            model.twisting(self.grasp, state.torsion) / self.force,
        )

    def command(self, f_c: Array, share: float = 1.0) -> Array:
        """(a,) scaled, mirrored commands back in the grasp's units, of its own actuators; share: of `unscale`."""
        return self.equivalent.command_of(self.force * f_c * self.actuator_scale, share)


def build(
    grasp: Grasp,
    w0: Sequence[float] | Array,
    direction: Sequence[float] | Array | None = None,
    *,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    driven: Mask | None = None,
) -> ScaledProblem:
    """Scale a question.

    Args:
        grasp: the grasp with its preload.
        w0: (6,) constant part of the disturbance [N, N m].
        direction: (6,) part multiplied by s.
        limits: uncertainty of the contact normals, limits of forces.
        mdp: with the maximum dissipation principle.
        driven: (a,) bool, actuators whose command is sought, in the sense of the grasp's; the others are locked.

    Raises:
        InputError: a wrench that is not three or six finite numbers, a zero direction, a limit of an unknown
            actuator, a disturbance that the contacts cannot balance (outside the range of G).
    """
    w0 = as_wrench(w0, "wrench")
    d = np.zeros(6) if direction is None else as_direction(direction)
    if limits.eta > 0 and not mdp:
        raise InputError("needs the maximum dissipation principle; leave one of the two out", field="eta")
    if limits.eta > 0:
        grasp.refuse_soft_fingers("uncertainty of the normals")
    same = equivalent_of(grasp, driven, limits.torque_limits)
    plain, back = same.plain, np.array(grasp.mechanism.backdrivable, dtype=bool)
    limits.check_backdrivable(grasp)
    # the force scale is what is asked about: it must not depend on an answer that is not known yet, nor, where
    # other forces are in play, on the direction, of which a map has many, or on the size of commands that are sought
    posed = grasp if driven is None else grasp.with_preload(np.where(back, grasp.command, 0.0))
    others = _others(posed, same, w0, limits, with_torques=direction is not None)
    direction_scale = _direction_scale(grasp, d, others) if direction is not None else 1.0
    force = others or (_size(grasp, d) if direction is not None else 0.0) or 1.0

    drive, f_c, f_max = np.zeros(plain.mechanism.a, dtype=bool), plain.command, np.full(plain.mechanism.a, np.inf)
    f_max[: len(same.kept)] = limits.largest_forces(grasp)[same.kept]
    if driven is not None:
        drive[: len(same.kept)], f_c = driven[same.kept], np.zeros(plain.mechanism.a)
    scale, drives = Scales(force, direction_scale, np.inf), _Drives(f_c, drive, f_max)
    p = _scaled(plain, same, w0, d, scale, drives, limits, mdp)
    _check_range(p, direction is not None)
    return p


def build_rows(grasps: GraspRows, base: Array, along: Array | None, limits: GraspLimits) -> ScaledProblem:
    """The problems of many grasps under base loads and directions (k, 6) as one: `build` of all of them.

    What `build` refuses is not refused here. Limits of forces have no place.
    """
    same = replace(equivalent_of(grasps.grasps[0]), arms=model.joint_arms(grasps))
    none, a = np.zeros(base.shape), grasps.mechanism.a
    drives = _Drives(grasps.command, np.zeros(a, dtype=bool), np.full(a, np.inf))
    scale = scales(grasps, same, base, along, limits)
    p = _scaled(grasps, same, base, none if along is None else along, scale, drives, limits, True)
    return replace(p, f_max=drives.f_max, cn_max=np.inf)


class _Drives(NamedTuple):
    """(a,) commands of the equivalent's actuators, which of them are sought, and the largest forces."""

    f_c: Array
    driven: Mask
    f_max: Array


def _scaled(
    plain: AnyGrasp,
    same: EquivalentGrasp,
    w0: Array,
    d: Array,
    scale: Scales,
    drives: _Drives,
    limits: GraspLimits,
    mdp: bool,
) -> ScaledProblem:
    """The problem in given scales; plain: the equivalent grasp, or many."""
    row, units, force = _lengths(plain.size), _joint_units(plain, same.arms), _wide(scale.force)
    f_c, driven, f_max = drives
    moves = model.commanded(plain, f_c) | driven
    return ScaledProblem(
        grasp=same.grasp,
        equivalent=same,
        wrench=w0,
        along=d,
        limits=limits,
        mdp=mdp,
        w0=row * w0 / force,
        direction=row * (_wide(scale.direction) * d) / force,
        direction_scale=scale.direction,
        f_c=f_c / (force * units.actuators),
        moves=moves if moves.ndim == 1 else moves[0],
        driven=driven,
        f_max=f_max / np.abs(force * units.actuators),
        cn_max=limits.largest_normal_force / scale.force,
        G=row[..., None] * plain.G,
        J=plain.J / units.joints[..., None, :],
        R=units.actuators[..., None] * units.R,
        A=units.couplings[..., None] * units.A,
        soft=plain.soft,
        twist_map=row[..., None] * plain.twist_map,
        twist_jacobian=plain.twist_jacobian / units.joints[..., None, :],
        torque=plain.given_torques / (force * units.joints),
        mu=plain.mu,
        force=scale.force,
        length=plain.size,
        middle=plain.middle / _wide(plain.size),
        joint_scale=units.joints,
        actuator_scale=units.actuators,
        coupling_scale=units.couplings,
    )


class _JointUnits(NamedTuple):
    """(l,), (a,), (k,) units of joints, actuators (negative where mirrored), couplings; R, A over scaled joints."""

    joints: Array
    actuators: Array
    couplings: Array
    R: Array
    A: Array


def _joint_units(plain: AnyGrasp, joints: Array) -> _JointUnits:
    R, A = plain.mechanism.R / joints[..., None, :], plain.mechanism.A / joints[..., None, :]
    sense = np.where(plain.command < 0, -1.0, 1.0)
    return _JointUnits(joints, sense / np.sqrt((R * R).sum(axis=-1)), 1.0 / np.sqrt((A * A).sum(axis=-1)), R, A)


def _wide(x: Any) -> Array:
    """Numbers (...) with an axis of length 1 behind them."""
    return np.asarray(x)[..., None]


class Scales(NamedTuple):
    """(k,) each, of many loads: as `ScaledProblem.force`, `direction_scale` and `last_magnitude` of each of them."""

    force: Any
    direction: Any
    last_magnitude: Any


def scales(
    grasp: AnyGrasp,
    same: EquivalentGrasp,
    base: Array,
    along: Array | None,
    limits: GraspLimits,
) -> Scales:
    """The scales that `build` finds for each of the loads base + s along, (k, 6) each, or base alone.

    grasp: of all of them, or of each its own; these have no limits of forces.
    """
    others = np.maximum(_sizes(grasp, base), np.maximum(_largest_command(grasp), _given(same)))
    if not others.all():
        at_most = _limits(grasp, limits, with_torques=along is not None)
        others = np.where(others > 0, others, max(at_most, default=0.0))
    none = np.ones(len(base))
    if along is None:
        return Scales(np.where(others > 0, others, 1.0), none, none * np.inf)
    size = _sizes(grasp, along)
    with np.errstate(divide="ignore"):
        direction = np.where(others > 0, 2.0 ** np.round(np.log2(others / size)), 1.0)
    force = np.where(others > 0, others, size)
    strongest = np.maximum(force, max([*_limits(grasp, limits), same.largest_friction]))
    strongest = np.maximum(strongest, _passed_on(grasp))
    return Scales(force, direction, UNBOUNDED_DISTURBANCE * strongest / size)


@lru_cache(maxsize=8)  # of a grasp that is asked again and again
def _largest_command(grasp: AnyGrasp) -> Any:
    """[N] the largest command as a force at a contact."""
    commands = np.abs(grasp.command) / model.actuator_arms(grasp)
    return np.where(_takes_part(grasp), commands, 0.0).max(axis=-1, initial=0.0)


@lru_cache(maxsize=8)
def _passed_on(grasp: AnyGrasp) -> Any:
    """[N] the largest command as a force at a contact to which couplings, or actuators that are held, take it.

    0 where no joints are tied.
    """
    A, R = grasp.mechanism.A, grasp.mechanism.R
    if not A.shape[-2] and not ((R != 0).sum(axis=-1) > 1).any():
        return 0.0
    arms, R = _arms_of_ways(grasp)
    acts = (np.abs(grasp.command)[..., None] * R).max(axis=-2)
    there = (acts[..., None] * passed_on(R[..., ~np.array(grasp.mechanism.backdrivable, dtype=bool), :])).max(axis=-2)
    return (there / arms).max(axis=-1, initial=0.0)


def _arms_of_ways(grasp: AnyGrasp) -> tuple[Array, Array]:
    """(d,) [m] how far contacts move, inf where none does, and (a, d) actuators, along each of the `ways` of joints."""
    A = grasp.mechanism.A
    moved = ways(A) if A.ndim == 2 else np.stack([ways(x) for x in A])
    arms = np.linalg.norm(grasp.J @ moved, axis=-2)
    touches = arms > COUPLING_ROUNDING * np.linalg.norm(np.abs(grasp.J) @ np.abs(moved), axis=-2)
    return np.where(touches, arms, np.inf), np.abs(grasp.mechanism.R @ moved)


def _given(same: EquivalentGrasp) -> float:
    """[N] the largest force at a contact of what is given to joints."""
    return max(same.largest_given, RUBS * same.largest_friction)


def _sizes(grasp: AnyGrasp, w: Array) -> Array:
    """(k,) `_size` of each of the disturbances (k, 6)."""
    force, torque = w[:, :3], w[:, 3:] - cross_rows(grasp.middle, w[:, :3])
    out: Array = np.sqrt(np.maximum((force * force).sum(axis=1), (torque * torque).sum(axis=1) / grasp.size**2))
    return out


def _others(grasp: Grasp, same: EquivalentGrasp, w0: Array, limits: GraspLimits, *, with_torques: bool = True) -> float:
    """[N] the forces in play beside a disturbance that is sought: base load and drives, else limits; 0 for none."""
    scale = max(_size(grasp, w0), float(_largest_command(grasp)), _given(same))
    return scale or max(_limits(grasp, limits, with_torques=with_torques), default=0.0)


def _limits(grasp: AnyGrasp, limits: GraspLimits, *, with_torques: bool = True) -> list[float]:
    """[N] each limit as a force at a contact, those of actuators included or not."""
    if isinstance(grasp, GraspRows) or not limits.limits_forces:
        return []
    arms = dict(zip(grasp.mechanism.actuators, model.actuator_arms(grasp), strict=True))
    takes_part = dict(zip(grasp.mechanism.actuators, _takes_part(grasp), strict=True))
    torques = limits.torque_limits.items() if with_torques else ()
    at_most = [v / arms[name] for name, v in torques if takes_part.get(name)]
    return [*at_most, *([] if limits.force_limit is None else [limits.force_limit])]


def _takes_part(grasp: AnyGrasp) -> Mask:
    """(a,) bool: actuators that move a contact, be it by joints that couplings, or actuators that are held, tie."""
    held = ~np.array(grasp.mechanism.backdrivable, dtype=bool)
    tied, coupled = grasp.touches, np.concatenate([grasp.mechanism.A, grasp.mechanism.R[..., held, :]], axis=-2) != 0
    for _ in range(coupled.shape[-2]):
        tied = tied | ((tied[..., None, :] & coupled).any(axis=-1)[..., None] & coupled).any(axis=-2)
    out: Mask = ((grasp.mechanism.R != 0) & tied[..., None, :]).any(axis=-1)
    return out


def _direction_scale(grasp: Grasp, d: Array, others: float) -> float:
    """The power of two that brings a direction (6,) to the size of the other forces; 1 if there are none."""
    return float(2.0 ** np.round(np.log2(others / _size(grasp, d)))) if others > 0 else 1.0


def _size(grasp: Grasp, w: Array) -> float:
    """[N] a disturbance (6,): its force, or its torque about the middle of the contacts over the grasp's size.

    However the object's frame is placed or turned, it is the same.
    """
    torque = np.linalg.norm(w[3:] - cross(grasp.middle, w[:3]))
    return float(max(np.linalg.norm(w[:3]), torque / grasp.size))


def _lengths(length: Any) -> Array:
    return np.where(np.arange(6) < 3, 1.0, 1.0 / _wide(length))


# of the largest number of a direction, and of any disturbance: squares stay numbers
MIN_DISTURBANCE, MAX_DISTURBANCE = 1e-100, 1e100


def as_wrench(w: object, field: str = "wrench") -> Array:
    """(6,) force [N] and torque [N m] from six numbers, or from three: a force at the origin.

    Raises:
        InputError: another count of numbers, one that is not finite or too large.
    """
    try:
        a = np.array(w, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        raise InputError("needs six numbers FX FY FZ TX TY TZ", field=field) from None
    if a.shape == (3,):
        a = np.concatenate([a, np.zeros(3)])
    if a.shape != (6,):
        needed = "six are needed, FX FY FZ TX TY TZ, or three for a force alone"
        raise InputError(f"has {a.size} numbers; {needed}", field=field)
    if not np.isfinite(a).all():
        raise InputError("contains NaN or infinity; six finite numbers are needed", field=field)
    largest = np.abs(a).max()
    if largest > MAX_DISTURBANCE:
        raise InputError(f"has {largest:.3g}; numbers up to {MAX_DISTURBANCE:g} are possible", field=field)
    return a


def as_direction(direction: object) -> Array:
    """(6,) `as_wrench` of a direction. Raises `InputError` for one that is zero."""
    d = as_wrench(direction, "direction")
    if not np.abs(d).max() >= MIN_DISTURBANCE:
        raise InputError("is zero, or next to it; give a force, a torque or both", field="direction")
    return d


def beyond_range(G: Array, w: Array) -> int | None:
    """The rank of G (6, 3m) if no contact forces whatever could balance w (6,), else None; lengths scaled alike."""
    with suppress(np.linalg.LinAlgError):  # forces that do balance it settle most questions
        c = np.linalg.solve(G @ G.T, w) @ G
        if np.abs(G @ c - w).max() <= BALANCE_TOLERANCE * np.abs(w).max():
            return None
    U, sv, _ = np.linalg.svd(G)
    if len(sv) == 6 and sv[5] >= 1e-9 * sv[0]:
        return None
    out = U[:, (np.r_[sv, np.zeros(6 - len(sv))] < 1e-9 * sv[0])]
    beyond = out.size and np.abs(out.T @ w).max() > BALANCE_TOLERANCE * max(np.abs(w).max(), 1e-300)
    return 6 - out.shape[1] if beyond else None


def unbalanced(grasp: Grasp, wrench: Array) -> bool:
    """Is there no force at the contacts whatever, friction aside, that balances a wrench (6,)? Queries refuse it."""
    if grasp.spans:
        return False
    alike = np.r_[np.ones(3), np.full(3, 1 / grasp.size)]
    return beyond_range(alike[:, None] * np.hstack([grasp.G, grasp.twist_map]), alike * wrench) is not None


def _check_range(p: ScaledProblem, with_direction: bool) -> None:
    """Refuse a disturbance that is beyond the range of G."""
    for w, field in ((p.w0, "wrench"), (p.direction, "direction")):
        rank = beyond_range(np.hstack([p.G, p.twist_map]), w) if w.any() else None
        if rank is not None:
            raise InputError(
                f"cannot be balanced by any forces at these {p.sizes[0]} contacts "
                f"(the grasp map G has rank {rank} of 6); leave out the component that G lacks",
                field=field,
            )
