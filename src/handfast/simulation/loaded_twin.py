"""A load put on a grasp in a dynamics engine that shares no code with the search and no equation with the model."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.simulation.ending import LEAST, LOST, SLIP, Ending, judge
from handfast.simulation.result import SimulationResult
from handfast.simulation.stepper import Moment, Stepper
from handfast.simulation.twin import STEP, STIFFNESS, build_twin

Loading = Literal["preload-first", "together"]
PRELOAD, HOLD = 2.0, 2.0  # [s] of the twin for the commands alone, and for the full load
SAMPLE = 0.02  # [s] between two moments of the history
WINDOW = 25  # moments over which the rate at the end is taken, 0.5 s


def simulate(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    loading: Loading = "preload-first",
    ramp: float = 8.0,
    step: float = STEP,
    stiffness: float = STIFFNESS,
    on_time: Callable[[float, float], None] | None = None,
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
        on_time: called with the time that has passed and the time there will be.

    Raises:
        InputError: a wrench of another length, a load and commands that are all zero, times that are not above 0.
    """
    w = np.asarray(wrench, dtype=float).ravel()
    w = frozen(np.r_[w, 0, 0, 0] if len(w) == 3 else w, (6,), "wrench")
    for name, value in (("ramp", ramp), ("step", step), ("stiffness", stiffness)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"is {value}; a number above 0 is needed", field=name)
    if loading not in ("preload-first", "together"):
        raise InputError(f"is '{loading}'; 'preload-first' or 'together' is needed", field="loading")
    begun = clock.perf_counter()
    unit = force_unit(grasp, w)
    twin = build_twin(grasp, unit, step=step, stiffness=stiffness)
    scaled = np.r_[w[:3], w[3:] / twin.length] / unit
    frames = np.array([c.frame for c in grasp.contacts])
    stepper = Stepper(twin, grasp.positions / twin.length, frames, scaled)
    history: list[Moment] = []
    end = ramp + HOLD + (PRELOAD if loading == "preload-first" else 0.0)
    lost = False

    def go(seconds: float, grow: float, *, commands: bool = False) -> None:
        nonlocal lost
        count = max(round(seconds / SAMPLE), 1)
        each = max(round(SAMPLE / step), 1)
        for k in range(count):
            if lost:
                return
            if commands:
                stepper.command((k + 1) / count)
            stepper.run(each, grow / (count * each))
            history.append(stepper.moment())
            lost = history[-1].moved > LOST
            if on_time is not None:
                on_time(history[-1].time, end)

    why, before = "", 0
    try:
        if loading == "preload-first":
            stepper.winding = False  # until all commands act: what closes first does not keep what it gained by that
            go(PRELOAD, 0.0)
            stepper.winding, before = True, len(history)
        go(ramp, 1.0, commands=loading == "together")
        go(HOLD, 0.0)
    except FloatingPointError as fault:
        why = str(fault)
    if not history:
        history.append(Moment.nothing(grasp.m, len(twin.joints)))
    seconds = clock.perf_counter() - begun
    return _result(grasp, w, loading, history, before, why, (unit, twin.length), twin.joints, step, stiffness, seconds)


def force_unit(grasp: Grasp, wrench: Array) -> float:
    """[N] the largest force in play: the load's, or what a command is at the contact that it moves most.

    Raises `InputError` if there is none.
    """
    size = grasp.size
    least = max(float(np.linalg.norm(wrench[:3])), float(np.linalg.norm(wrench[3:])) / size)
    for row, f in zip(grasp.mechanism.R, grasp.command, strict=True):
        arms = [
            abs(row[j]) * float(np.linalg.norm(joint.velocity_at(grasp.contacts[i].position)))
            for j, joint in enumerate(grasp.joints)
            for i in joint.moves
        ]
        if max(arms, default=0.0) > 0:
            least = max(least, abs(float(f)) / max(arms))
    if least == 0:
        raise InputError("and all commands are zero; nothing would happen", field="wrench")
    return least


def _result(
    grasp: Grasp,
    wrench: Array,
    loading: Loading,
    history: list[Moment],
    before: int,
    why: str,
    units: tuple[float, float],
    free: tuple[int, ...],
    step: float,
    stiffness: float,
    seconds: float,
) -> SimulationResult:
    """The history in SI units, judged; `before` moments of it were the preload's."""
    force, length = units
    moved = np.array([h.moved for h in history])
    places = np.array([h.places for h in history])
    time = np.array([h.time for h in history])
    last = max(len(history) - 1 - WINDOW, 0)
    gone = np.linalg.norm(places[-1] - places[last], axis=1).max()
    rate = float(gone / max(time[-1] - time[last], step))
    speed = np.array([h.speed for h in history])
    after = speed[before:] if len(speed) > before else speed
    sought = max(float(np.linalg.norm(wrench[:3])), float(np.linalg.norm(wrench[3:])) / length)
    faint = 0 < sought < LEAST * force
    start = min(max(before - 1, 0), len(history) - 1)
    forces = np.array([h.forces for h in history])
    yielded = float(forces[:, :, 0].max()) / stiffness
    travelled = float(np.linalg.norm(places[-1] - places[start], axis=1).max())
    ending = judge(rate, float(after.max()), travelled, yielded, broken=bool(why), faint=faint)
    if faint and ending is Ending.UNDECIDED:
        why = f"the load is below {100 * LEAST:g} % of the largest force; the engine could not tell it from none"
    load = np.array([h.load for h in history])
    onset = None
    if loading == "preload-first" and ending is Ending.SLIPS:
        rested = np.flatnonzero(speed <= SLIP)  # the slip that went on to the end began after the last of these
        onset = float(load[rested[-1]]) if len(rested) else 0.0
    elif loading == "preload-first" and ending is Ending.SETTLES:
        onset = float(load[max(before + int(np.argmax(after > SLIP)) - 1, 0)])
    scale = np.array([1.0 if grasp.joints[j].type == "revolute" else length for j in free])
    return SimulationResult(
        ending=ending, grasp=grasp, wrench=wrench, loading=loading, onset=onset, rate=rate * length, time=time,
        load=load, shift=length * np.array([h.shift for h in history]), turn=np.array([h.turn for h in history]),
        motion=length * moved, speed=length * speed, joints=np.array([h.joints for h in history]) * scale, free=free,
        forces=force * forces, steps=round(float(time[-1]) / step), seconds=seconds,
        why=why,
    )  # fmt: skip
