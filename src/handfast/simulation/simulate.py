"""A load put on a grasp in a dynamics engine that shares no code with the search and no equation with the model.

`simulate` has the grasp's contacts on its joints, `simulate_bodies` the hand and the object behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, kinds_checked
from handfast.core.transforms import transform
from handfast.model.grasp import Grasp
from handfast.simulation.bodies import Bodies, BodyStepper, bodies_of, build_bodies
from handfast.simulation.recording import HOLD, PRELOAD, Recording
from handfast.simulation.result import SimulationResult
from handfast.simulation.stepper import Stepper
from handfast.simulation.twin import STEP, STIFFNESS, build_twin, free_joints, load_force
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.settings import Loading as Loading

SLOWEST = 1e4  # [s of the twin] of a ramp: ten million steps


@kinds_checked
def simulate(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    loading: Loading = "preload-first",
    ramp: float = 8.0,
    step: float = STEP,
    stiffness: float = STIFFNESS,
    on_progress: Callable[[float, float], None] | None = None,
    start: tuple[Array, Array] | None = None,
) -> SimulationResult:
    """Does the grasp resist the wrench in a simulation of its contacts (mujoco)?

    The contacts are stiff points with Coulomb friction on the grasp's joints; gearings do not turn back. Nothing is
    drawn at random: the same question has the same answer.

    Args:
        wrench: (6,) force [N] and torque [N m] on the object, at its origin, or (3,) a force; its directions stay while
            the object moves, the point of the force moves along.
        loading: "preload-first": the commands first, then gearings that stay where they are, then the load grows. As a
            real hand does. "together": commands and load grow in proportion: the state that the model's one set of
            equations describes, which knows no history.
        ramp: [s of the twin] over which the load grows.
        step: [s of the twin] of the engine; rates by which endings are judged were measured at the default.
        stiffness: of a contact, in force units by grasp sizes; likewise.
        on_progress: called with the time that has passed and the time there will be.
        start: virtual motions of object (6,) and joints (l,) as in a witness's state [N, N/m]: commands and load act in
            full from the beginning, and it begins where that equilibrium is, at this stiffness. Does it rest there?

    Raises:
        InputError: a wrench of another length, a load and commands that are all zero, times that are not above 0.
    """
    w = checked_wrench(wrench)
    checked_times(ramp, step, stiffness, loading)
    unit = force_unit(grasp, w)
    twin = build_twin(grasp, unit, step=step, stiffness=stiffness)
    stepper = Stepper(twin, grasp, twin.scaled(w))
    first = loading == "preload-first" and start is None
    if start is not None:
        from scipy.spatial.transform import Rotation

        ramp = 0.0
        per_newton = 1.0 / (unit * stiffness)  # [grasp sizes/N], so that r [N] is a motion
        r, q = (np.asarray(part, dtype=float) for part in start)
        turns = np.array([grasp.joints[j].type == "revolute" for j in twin.joints], dtype=bool)
        moved = per_newton * q[list(twin.joints)] * np.where(turns, twin.length, 1.0)
        turned = Rotation.from_rotvec(per_newton * twin.length * r[3:]).as_matrix()
        stepper.place(moved, transform(per_newton * r[:3], turned))
    recording = Recording(stepper, step, ramp + HOLD + PRELOAD, on_progress)
    recording.run(ramp, preload=first, commands=not first and start is None)
    return recording.result(grasp, w, loading, twin, stiffness)


def checked_times(ramp: float, step: float, stiffness: float, loading: str) -> None:
    """Raises `InputError` for numbers that are not above 0, a ramp without end, and an unknown way of loading."""
    for name, value in (("ramp", ramp), ("step", step), ("stiffness", stiffness)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"is {value}; a number above 0 is needed", field=name)
    if ramp > SLOWEST:
        raise InputError(f"is {ramp:g}; at most {SLOWEST:g} s are possible", field="ramp")
    if loading not in ("preload-first", "together"):
        raise InputError(f"is '{loading}'; 'preload-first' or 'together' is needed", field="loading")


def checked_wrench(wrench: Sequence[float] | Array) -> Array:
    """(6,) of six numbers, or of a force; raises `InputError` for others."""
    return frozen(scaled_problem.as_wrench(wrench), (6,), "wrench")


def force_unit(grasp: Grasp, wrench: Array) -> float:
    """[N] the largest force in play: the load's, or what a command or a spring is at the contact that it moves most.

    Springs of joints that are locked press nothing. Raises `InputError` if there is none.
    """
    size = grasp.size
    least = load_force(wrench, size)
    for row, f in zip(grasp.mechanism.R, grasp.command, strict=True):
        arms = [  # of the contacts' motion over the actuator's
            float(np.linalg.norm(joint.velocity_at(grasp.contacts[i].position))) / abs(float(row[j]))
            for j, joint in enumerate(grasp.joints)
            for i in joint.moves
            if row[j]
        ]
        if max(arms, default=0.0) > 0:
            least = max(least, abs(float(f)) / max(arms))
    for joint in (grasp.joints[j] for j in free_joints(grasp)):
        arm = max(
            (float(np.linalg.norm(joint.velocity_at(grasp.contacts[i].position))) for i in joint.moves), default=0
        )
        if arm > 0:
            least = max(least, abs(joint.torque) / arm)
    if least == 0:
        raise InputError("and all commands are zero; nothing would happen", field="wrench")
    return least


@kinds_checked
def simulate_bodies(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    loading: Loading = "preload-first",
    ramp: float = 8.0,
    step: float = STEP,
    stiffness: float = STIFFNESS,
    on_progress: Callable[[float, float], None] | None = None,
    bodies: Bodies | None = None,
) -> SimulationResult:
    """Do hand and object themselves resist the wrench? Where they touch is found by the engine as they move.

    They are `bodies`, or read from the files that the grasp's provenance names. Joints, couplings and gearings are
    those of the grasp; each contact point that the engine finds is as stiff as a contact of `simulate`, whose arguments
    these are.

    Raises:
        InputError: as `simulate` does; hand or object are not known or not those of this grasp.
    """
    w = checked_wrench(wrench)
    checked_times(ramp, step, stiffness, loading)
    twin = build_bodies(grasp, bodies or bodies_of(grasp), force_unit(grasp, w), step=step, stiffness=stiffness)
    first = loading == "preload-first"
    recording = Recording(BodyStepper(twin, grasp, twin.scaled(w)), step, ramp + HOLD + PRELOAD, on_progress)
    recording.run(ramp, preload=first, commands=not first)
    return recording.result(grasp, w, loading, twin, stiffness, bodies=True)
