"""A grasp as a mujoco model: its exact contacts on joints with its axes, nothing else of hand and object.

The twin shares the grasp file's numbers with the rest of Handfast and none of its equations. All of it is scaled: the
unit of length is the grasp's size, the unit of force the largest in play, so that what was measured on one twin is true
of all.
Mass is numerical: the questions are about rest, where it does not matter, and the object weighs one unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import matrix_quaternion, normal_frame
from handfast.model.grasp import Contact, Grasp

TWIN_TIME_STEP = 1e-3  # [s]
# of a contact [force unit / length unit]: the force unit presses it in by 1e-5 of the grasp's size
TWIN_STIFFNESS = 1e5
CONTACT_RATE = 100.0  # [1/s] at which a pressed contact comes to rest, critically damped
FRICTION_RATE = 20.0  # [1/s] at which a sticking contact does; mujoco lifts a sliding contact in proportion to it
TWIN_CREEP_RATIO = 1e5  # mujoco's impratio: how much stiffer a contact is against sliding than against pressing
DRAG_TIME = 0.05  # [s] after which what nothing drives has stopped: motion is slow, as the question is about rest
TIP = 0.02  # [length unit] radius of the sphere that stands for a finger at a contact
# solref and solimp of couplings and gearings: all but rigid
RIGID_COUPLING = (2 * TWIN_TIME_STEP, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
UNLIMITED_RANGE = 1e3  # [rad, length unit] no joint gets there
STOP_RANGES = {
    "": (-UNLIMITED_RANGE, UNLIMITED_RANGE),
    "lower": (0.0, UNLIMITED_RANGE),
    "upper": (-UNLIMITED_RANGE, 0.0),
    "both": (-1e-9, 0.0),
}


@dataclass(frozen=True, eq=False)
class Twin:
    """The model and what its numbers mean.

    Attributes:
        model: an `mujoco.MjModel`, in scaled units.
        length, force: one unit [m], [N].
        joints: those of the grasp that can move; the others are part of the ground.
        copies: of each of them, where its values stand among the model's coordinates.
        address: of the first copy of each of them among the model's degrees of freedom.
        drive: (nv, d) columns: generalised force of a unit force of each driven actuator, mirrored where its
            command is negative, so that all of them close.
        command: (d,) forces of driven actuators, 0 or more [force unit].
        gear: mujoco tendon of each actuator that does not turn back; its lower end is where the gearing stands.
        winds: of each of these, whether the gearing follows when the actuator closes; a tendon without command stays
            where it is.
        given: (nv,) generalised forces that act on joints besides.
    """

    model: Any
    length: float
    force: float
    joints: tuple[int, ...]
    copies: tuple[tuple[int, ...], ...]
    address: tuple[int, ...]
    drive: Array
    command: Array
    gear: tuple[int, ...]
    winds: tuple[bool, ...]
    given: Array

    def scaled(self, wrench: Array) -> Array:
        """(6,) [N, N m] in the twin's units."""
        return np.r_[wrench[:3], wrench[3:] / self.length] / self.force


def build_twin(grasp: Grasp, force: float, *, step: float = TWIN_TIME_STEP, stiffness: float = TWIN_STIFFNESS) -> Twin:
    """The twin of a grasp under its commands; `force` [N] is the unit.

    Args:
        step: [s] of the engine.
        stiffness: of every contact [force unit / length unit].
    """
    length = grasp.size
    free = free_joints(grasp)
    spec = engine_spec(step)
    names = _add_hand(spec, grasp, free, length)
    add_object(spec, grasp, length)
    for i, contact in enumerate(grasp.contacts):
        _add_face(spec, i, contact, length)
        add_pair(spec, f"contact {i}", (f"tip {i}", f"face {i}"), contact.friction, torsion=contact.torsion / length)
    return assembled(spec, grasp, free, names, force, stiffness)


def engine_spec(step: float) -> Any:
    """An empty model with the engine's settings."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = (0.0, 0.0, 0.0)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = TWIN_CREEP_RATIO
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # to the last digit: a solver that stops earlier leaves accelerations by which contacts at their cones walk
    spec.option.iterations, spec.option.tolerance = 100, 0.0
    spec.option.ls_iterations, spec.option.ls_tolerance = 50, 1e-6
    spec.compiler.degree = False
    return spec


def add_pair(
    spec: Any, name: str, geoms: tuple[str, str], friction: float, margin: float = 0.0, torsion: float = 0.0
) -> None:
    """Let a part of the hand touch one of the object; `assembled` makes all pairs equally stiff.

    `margin` [length unit] is how far apart they touch, `torsion` [length unit] a soft finger's torsional friction.
    """
    mu = max(friction, 1e-5)  # mujoco's least
    spec.add_pair(
        name=name, geomname1=geoms[0], geomname2=geoms[1], condim=4 if torsion else 3,
        friction=[mu, mu, torsion, 0, 0],
        solref=[-(CONTACT_RATE**2), -2 * CONTACT_RATE], solreffriction=[0.0, -FRICTION_RATE],
        solimp=[0.9, 0.9, 0.001, 0.5, 2.0], margin=margin,
    )  # fmt: skip


def assembled(
    spec: Any, grasp: Grasp, free: tuple[int, ...], names: list[list[str]], force: float, stiffness: float
) -> Twin:
    """The compiled model with couplings, gearings and drives on the joints `names`."""
    length = grasp.size
    unit = np.array([1.0 if grasp.joints[j].type == "revolute" else length for j in free])
    _add_rows(spec, grasp, free, names, unit)
    gears = _gears(grasp, free)
    for each in gears:
        _add_tendon(spec, f"gear {each.name}", each.row * unit, names)
    model = spec.compile()
    _equal_stiffness(model, stiffness)
    address = tuple(int(model.jnt_dofadr[model.joint(copies[0]).id]) for copies in names)
    places = tuple(tuple(int(model.jnt_qposadr[model.joint(c).id]) for c in copies) for copies in names)
    drive = np.zeros((model.nv, len(gears)))
    for d, gear in enumerate(gears):
        drive[list(address), d] = gear.row * unit / length
    held = [(int(model.tendon(f"gear {g.name}").id), g.winds) for g in gears if g.holds]
    for t, _ in held:
        model.tendon_limited[t], model.tendon_range[t] = 1, (0.0, 1e3)
        model.tendon_solref_lim[t], model.tendon_solimp_lim[t] = RIGID_COUPLING
    given = np.zeros(model.nv)
    for j, at, one in zip(free, address, unit, strict=True):
        torque_unit = force * length / one  # [N m, N]
        given[at] = grasp.joints[j].torque / torque_unit
        if grasp.joints[j].friction:
            model.dof_frictionloss[at] = grasp.joints[j].friction / torque_unit
            model.dof_solref[at], model.dof_solimp[at] = RIGID_COUPLING
    command = np.array([g.command / force for g in gears])
    stands, winds = tuple(t for t, _ in held), tuple(w for _, w in held)
    return Twin(model, length, force, free, places, address, drive, command, stands, winds, given)


def load_force(wrench: Array, length: float) -> float:
    """[N] a load (6,): its force, or its torque over a length [m]."""
    return max(math.hypot(*wrench[:3]), math.hypot(*wrench[3:]) / length)  # squares of tiny numbers are none


def free_joints(grasp: Grasp) -> tuple[int, ...]:
    """Joints that the locked actuators and the couplings together leave free."""
    held = _held_rows(grasp)
    if not len(held):
        return tuple(range(grasp.l))
    _, s, Vt = np.linalg.svd(held)
    rank = int((s > 1e-9 * s.max(initial=1e-300)).sum())
    return tuple(int(j) for j in np.flatnonzero(np.abs(Vt[rank:]).max(axis=0, initial=0.0) > 1e-9))


def _held_rows(grasp: Grasp) -> Array:
    """Rows of what stands still: locked actuators that are no tendons and do not turn back, and couplings."""
    mech = grasp.mechanism
    gives = np.array(mech.tendon, dtype=bool) | np.array(mech.backdrivable, dtype=bool)
    locked = [row for row, f, loose in zip(mech.R, grasp.command, gives, strict=True) if f == 0 and not loose]
    rows = [*locked, *mech.A]
    return np.array(rows) if rows else np.zeros((0, grasp.l))


@dataclass(frozen=True, eq=False)
class _Gear:
    """An actuator that is driven, or an idle tendon: its row over the free joints, in the sense that closes.

    `holds`: it does not turn back; `winds`: where it stands follows as it closes.
    """

    name: str
    row: Array
    command: float
    holds: bool
    winds: bool


def _gears(grasp: Grasp, free: tuple[int, ...]) -> list[_Gear]:
    mech = grasp.mechanism
    out = []
    kinds = zip(mech.actuators, mech.R, grasp.command, mech.tendon, mech.backdrivable, strict=True)
    for name, row, f, slack, turns in kinds:
        row = row[list(free)]
        if (f != 0 or slack) and np.abs(row).max(initial=0.0) > 0:
            out.append(_Gear(name, row * (-1.0 if f < 0 else 1.0), abs(float(f)), not turns, f != 0))
    return out


def _add_hand(spec: Any, grasp: Grasp, free: tuple[int, ...], length: float) -> list[list[str]]:
    """Chains of joints that end in a sphere at each contact; the names of each free joint's copies.

    Contacts share the joints that they have in common as a hand does, the joint that moves more of them first. Where
    that is no tree, a joint has copies that are tied to each other.
    """
    import mujoco

    order = sorted(range(len(free)), key=lambda k: (-len(grasp.joints[free[k]].moves), k))
    names: list[list[str]] = [[] for _ in free]
    bodies: dict[tuple[int, ...], Any] = {(): spec.worldbody}
    paths = [tuple(k for k in order if i in grasp.joints[free[k]].moves) for i in range(grasp.m)]
    idle = [(k,) for k in order if not grasp.joints[free[k]].moves]
    for path in [*paths, *idle]:
        for end in range(1, len(path) + 1):
            if path[:end] in bodies:
                continue
            k = path[end - 1]
            name = f"{grasp.joints[free[k]].name} {len(names[k])}"
            body = add_jointed(bodies[path[: end - 1]], name, grasp, free[k])
            if names[k]:
                tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=name, name2=names[k][0])
                tie.objtype = mujoco.mjtObj.mjOBJ_JOINT
                tie.data[:5], tie.solref, tie.solimp = [0, 1, 0, 0, 0], *RIGID_COUPLING
            names[k].append(name)
            bodies[path[:end]] = body
    for i, (path, contact) in enumerate(zip(paths, grasp.contacts, strict=True)):
        centre = contact.position / length - TIP * contact.normal
        bodies[path].add_geom(
            name=f"tip {i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[TIP, 0, 0], pos=centre.tolist(),
            contype=0, conaffinity=0, mass=0,
        )  # fmt: skip
    return names


def add_jointed(parent: Any, name: str, grasp: Grasp, j: int) -> Any:
    """A body on joint `j` of the grasp, as heavy as makes it as quick as the object; frames are the object's."""
    import mujoco

    joint, length = grasp.joints[j], grasp.size
    arms = [np.linalg.norm(joint.velocity_at(grasp.contacts[i].position)) for i in joint.moves]
    turns = joint.type == "revolute"
    arm = max(arms, default=0.0) / (length if turns else 1.0) or 1.0
    # mujoco overlooks the armature of what only slides when it estimates inverse masses: there the body has it
    body = parent.add_body(mass=1e-6 if turns else 1.0, inertia=[1e-6] * 3, ipos=[0, 0, 0], explicitinertial=1)
    kind = mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE
    body.add_joint(
        name=name, type=kind, axis=joint.axis.tolist(), pos=(joint.origin / length).tolist(),
        armature=arm**2 if turns else 0.0, damping=[arm**2 / DRAG_TIME, 0, 0],
        limited=bool(joint.stop), range=STOP_RANGES[joint.stop], solref_limit=RIGID_COUPLING[0],
        solimp_limit=RIGID_COUPLING[1],
    )  # fmt: skip
    return body


def add_object(spec: Any, grasp: Grasp, length: float) -> Any:
    """A body of unit mass, its centre amid the contacts."""
    middle = grasp.middle / length
    body = spec.worldbody.add_body(
        name="object", mass=1.0, inertia=[0.4] * 3, ipos=middle.tolist(), explicitinertial=1,
    )  # fmt: skip
    body.add_freejoint(name="object")
    return body


def _add_face(spec: Any, i: int, contact: Contact, length: float) -> None:
    """A flat face of the object at a contact."""
    import mujoco

    n = contact.normal
    axes = normal_frame(n)[:, [1, 2, 0]]
    spec.body("object").add_geom(
        name=f"face {i}", type=mujoco.mjtGeom.mjGEOM_BOX, size=[3.0, 3.0, 0.5],
        pos=(contact.position / length + 0.5 * n).tolist(), quat=matrix_quaternion(axes).tolist(),
        contype=0, conaffinity=0, mass=0,
    )  # fmt: skip


def _add_rows(spec: Any, grasp: Grasp, free: tuple[int, ...], names: list[list[str]], unit: Array) -> None:
    """Couplings, and locked actuators that move several joints, as equalities."""
    import mujoco

    for r, row in enumerate(_held_rows(grasp)[:, list(free)]):
        if np.abs(row).max(initial=0.0) == 0:
            continue
        _add_tendon(spec, f"row {r}", row * unit, names)
        tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_TENDON, name1=f"row {r}")
        tie.objtype = mujoco.mjtObj.mjOBJ_TENDON
        tie.data[:5], tie.solref, tie.solimp = [0, 0, 0, 0, 0], *RIGID_COUPLING


def _add_tendon(spec: Any, name: str, row: Array, names: list[list[str]]) -> None:
    tendon = spec.add_tendon(name=name)
    for copies, weight in zip(names, row, strict=True):
        if weight != 0:
            tendon.wrap_joint(copies[0], float(weight))


def _equal_stiffness(model: Any, stiffness: float) -> None:
    """Give every pair the same stiffness, which mujoco makes of the masses behind it.

    At rest its force is rate^2 / R times the penetration, with R = (1 - d) / d of the inverse mass that it assumes:
    the sum of those of both bodies as the model begins.
    """
    inverse = model.body_invweight0[:, 0]
    bodies = model.geom_bodyid[model.pair_geom1], model.geom_bodyid[model.pair_geom2]
    inverse_mass = inverse[bodies[0]] + inverse[bodies[1]]
    d = np.clip(inverse_mass / (inverse_mass + CONTACT_RATE**2 / stiffness), 1e-4, 0.9999)
    model.pair_solimp[:, :2] = d[:, None]
    # mujoco divides both by d squared and by d
    model.pair_solref[:] = np.column_stack([-(CONTACT_RATE**2) * d, -2 * CONTACT_RATE * d])
    model.pair_solreffriction[:] = np.column_stack([np.zeros(len(d)), -FRICTION_RATE * d])
