"""A load put on a grasp in a dynamics engine that shares no code with the search and no equation with the model.

`simulate` has the grasp's contacts on its joints, `simulate_bodies` the hand and the object behind it. A `Recording`
runs either: commands, load, and a wait until the motion has decided; its history, judged.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds, require_not_negative
from handfast.core.transforms import transform
from handfast.model.grasp import Grasp
from handfast.simulation.bodies import Bodies, BodyStepper, bodies_of, build_bodies
from handfast.simulation.result import (
    CREEPS,
    EVIDENT,
    FAINT_LOAD,
    LOST_DISTANCE,
    REST_RATE,
    SLIP,
    Ending,
    SimulationResult,
    judge,
)
from handfast.simulation.stepper import Moment, Stepper
from handfast.simulation.twin import TWIN_STIFFNESS, TWIN_TIME_STEP, Twin, build_twin, free_joints, load_force
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.settings import Loading as Loading

SLOWEST = 1e4  # [s of the twin] of a ramp: ten million steps
PRELOAD = 2.0  # [s] of the simulation for the commands alone
CLOSING_END = 1.5  # [s] over which commands grow where joints rub, whose dry friction would keep the squeeze of a jolt,
# and of hand and object themselves, which a jolt moves to where they touch otherwise than the grasp says
REST_SECONDS = PRELOAD - CLOSING_END  # [s] from then until the load begins
HOLD, MAX_HOLD_SECONDS = 2, 24  # [s] for the full load: at least, and at most while motion still fades
FADES = 0.7  # a rate that is less than this share of that a second before is fading
ELASTIC = 3.0  # times the usual speed at which a grasp gives way in step with the load: that fast it slips
SOFTER = 10.0  # times: friction in the engine, to tell its own creep from a slip
# of the commands comes first where they grow with the load: the hand touches before it is pulled at
TOUCH_COMMAND = 1e-3
GROWTH_POWER = 3  # commands and load grow with this power of time: in proportion to what acts already, never abruptly
SAMPLE = 0.02  # [s] between two moments of the history
RATE_WINDOW = 25  # moments over which the rate at the end is taken, 0.5 s

OnTime = Callable[[float, float], None]


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """How commands and load come in a simulation, and how stiff it is.

    Attributes:
        loading: "preload-first": the commands first, then gearings that stay where they are, then the load grows. As a
            real hand does. "together": commands and load grow in proportion: the state that the model's one set of
            equations describes, which knows no history.
        ramp: [s of the twin] over which the load grows.
        closing: [s of the twin] over which the commands grow with "preload-first"; 0: they act at once, a jolt of which
            friction at the contacts keeps a part. Unless given they act at once in `simulate` where no joint rubs, and
            grow within 1.5 s otherwise. Slowly grown ones lead to the state of the commands alone from which a path
            begins (`check` with this loading).
        step: [s of the twin] of the engine; rates by which endings are judged were measured at the default.
        stiffness: of a contact, in force units by grasp sizes; likewise.

    Raises:
        InputError: times and a stiffness that are not above 0 (a closing may be 0), times without end, an unknown way
            of loading.
    """

    loading: Loading = "preload-first"
    ramp: float = 8.0
    closing: float | None = None
    step: float = TWIN_TIME_STEP
    stiffness: float = TWIN_STIFFNESS

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        for name, value in (("ramp", self.ramp), ("step", self.step), ("stiffness", self.stiffness)):
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"is {value}; a number above 0 is needed", field=name)
        closing = 0.0 if self.closing is None else self.closing
        require_not_negative(closing, "closing", "0, at once, or more is needed")
        for name, value in (("ramp", self.ramp), ("closing", closing)):
            if value > SLOWEST:
                raise InputError(f"is {value:g}; at most {SLOWEST:g} s are possible", field=name)
        if self.closing is not None and self.loading != "preload-first":
            raise InputError("is for commands that come first; leave it out with 'together'", field="closing")
        if self.loading not in ("preload-first", "together"):
            raise InputError(f"is '{self.loading}'; 'preload-first' or 'together' is needed", field="loading")

    @property
    def preload_first(self) -> bool:
        """Do the commands come before the load?"""
        return self.loading == "preload-first"

    @property
    def seconds(self) -> float:
        """[s of the twin] until it is over, if nothing takes longer."""
        return self.ramp + HOLD + PRELOAD + (self.closing or 0.0)


@kinds_checked
def simulate(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    start: tuple[Array, Array] | None = None,
    on_progress: OnTime | None = None,
    **options: Any,
) -> SimulationResult:
    """Does the grasp resist the wrench in a simulation of its contacts (mujoco)?

    The contacts are stiff points with Coulomb friction on the grasp's joints; gearings do not turn back. Nothing is
    drawn at random: the same question has the same answer.

    Args:
        wrench: (6,) force [N] and torque [N m] on the object, at its origin, or (3,) a force; its directions stay while
            the object moves, the point of the force moves along.
        start: virtual motions of object (6,) and joints (l,) as in a witness's state [N, N/m]: commands and load act in
            full from the beginning, and it begins where that equilibrium is, at this stiffness. Does it rest there?
        on_progress: called with the time that has passed and the time there will be.
        options: of `SimulationOptions`, by name: `simulate(grasp, [0, 1, 0], ramp=4.0)`.

    Raises:
        InputError: a wrench of another length, a load and commands that are all zero, times that are not above 0.
    """
    asked, w = SimulationOptions(**options), _load(wrench)
    unit = force_unit(grasp, w)
    twin = build_twin(grasp, unit, step=asked.step, stiffness=asked.stiffness)
    stepper = Stepper(twin, grasp, twin.scaled(w))
    first = asked.preload_first and start is None
    if start is not None:
        from scipy.spatial.transform import Rotation

        per_newton = 1.0 / (unit * asked.stiffness)  # [grasp sizes/N], so that r [N] is a motion
        r, q = (np.asarray(part, dtype=float) for part in start)
        turns = np.array([grasp.joints[j].type == "revolute" for j in twin.joints], dtype=bool)
        moved = per_newton * q[list(twin.joints)] * np.where(turns, twin.length, 1.0)
        turned = Rotation.from_rotvec(per_newton * twin.length * r[3:]).as_matrix()
        stepper.place(moved, transform(per_newton * r[:3], turned))
    ramp = 0.0 if start is not None else asked.ramp
    recording = Recording(stepper, asked.step, asked.seconds - asked.ramp + ramp, on_progress)
    recording.run(ramp, preload=first, commands=not first and start is None, closing=asked.closing)
    return recording.result(grasp, w, asked.loading, twin, asked.stiffness)


def _load(wrench: Sequence[float] | Array) -> Array:
    """(6,) as a load is given."""
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
    bodies: Bodies | None = None,
    on_progress: OnTime | None = None,
    **options: Any,
) -> SimulationResult:
    """Do hand and object themselves resist the wrench? Where they touch is found by the engine as they move.

    They are `bodies`, or read from the files that the grasp's provenance names. Joints, couplings and gearings are
    those of the grasp; each contact point that the engine finds is as stiff as a contact of `simulate`, whose arguments
    these are.

    Raises:
        InputError: as `simulate` does; hand or object are not known or not those of this grasp.
    """
    asked, w = SimulationOptions(**options), _load(wrench)
    how = {"step": asked.step, "stiffness": asked.stiffness}
    twin = build_bodies(grasp, bodies or bodies_of(grasp), force_unit(grasp, w), **how)
    recording = Recording(BodyStepper(twin, grasp, twin.scaled(w)), asked.step, asked.seconds, on_progress)
    closing = CLOSING_END if asked.closing is None else asked.closing
    recording.run(asked.ramp, preload=asked.preload_first, commands=not asked.preload_first, closing=closing)
    return recording.result(grasp, w, asked.loading, twin, asked.stiffness, bodies=True)


# --- the run ---


class Recording:
    """Runs a stepper and keeps what happens.

    Attributes:
        history: the moments.
        before: how many of them were the preload's.
        rate: of the fastest contact over the last `RATE_WINDOW` moments [grasp sizes/s], before friction was made
        softer. creeping: whether that rate is the engine's own.
        why: what broke the engine down; '' if nothing did.
    """

    def __init__(self, stepper: Stepper, step: float, end: float, on_progress: OnTime | None) -> None:
        """`end` [s] is when it will be over if nothing takes longer."""
        self.stepper, self._step, self._end, self._on_progress = stepper, step, end, on_progress
        self.history: list[Moment] = []
        self.before, self.rate, self.creeping, self.why = 0, 0.0, False, ""
        self._begun = clock.perf_counter()

    @property
    def _lost(self) -> bool:
        return bool(self.history) and self.history[-1].moved > LOST_DISTANCE

    def run(self, ramp: float, *, preload: bool, commands: bool, closing: float | None = None) -> None:
        """The commands if `preload`, within `closing` [s], then the load within `ramp` [s], then the wait for rest.

        A `closing` of 0 is at once. With `commands` these grow along with the load, but for the `TOUCH_COMMAND` of them
        that comes first.
        """
        s = self.stepper
        try:
            if preload or commands:
                s.winding = False  # until all commands act: what closes first does not keep what it gained by that
                if commands:
                    s.command(TOUCH_COMMAND)
                slowly = CLOSING_END * s.rubs if closing is None else closing
                if preload and slowly:
                    self._close(slowly)
                self._go(REST_SECONDS if preload and slowly else PRELOAD, 0.0)
                s.winding, self.before = True, len(self.history)
            if ramp:
                self._go(ramp, 1.0, commands=commands)
            else:
                s.load = 1.0
            self._wait()
        except FloatingPointError as fault:
            self.why = str(fault)
        if not self.history:
            self.history.append(s.moment())

    def _close(self, seconds: float) -> None:
        """Let the commands grow evenly from nothing."""
        count = max(round(seconds / SAMPLE), 1)
        for k in range(count):
            self.stepper.command((k + 1) / count)
            self._go(SAMPLE, 0.0)

    def _go(self, seconds: float, grow: float, *, commands: bool = False) -> None:
        count = max(round(seconds / SAMPLE), 1)
        each = max(round(SAMPLE / self._step), 1)
        power = GROWTH_POWER if commands else 1
        shares = grow * (np.arange(count + 1) / count) ** power
        for share, more in pairwise(shares):
            if self._lost:
                return
            if commands:
                self.stepper.command(TOUCH_COMMAND + (1 - TOUCH_COMMAND) * more)
            self.stepper.run(each, (more - share) / each)
            self.history.append(self.stepper.moment())
            if self._on_progress is not None:
                self._on_progress(self.history[-1].time, max(self._end, self.history[-1].time))

    def _wait(self) -> None:
        """Until it rests, drives on without fading, or time is up; then tell what creeps from what slips."""
        before = np.inf
        for second in range(1, MAX_HOLD_SECONDS + 1):
            self._go(1.0, 0.0)
            self.rate = self._rate_now()
            fades = self.rate < FADES * before
            before = self.rate
            if self._lost or (second >= HOLD and (self.rate <= REST_RATE or not fades)):
                break
        if REST_RATE < self.rate <= SLIP and not self._lost:
            self.stepper.soften(SOFTER)
            self._go(1.0, 0.0)
            self.creeping = self._rate_now() > CREEPS * SOFTER * self.rate
            self.stepper.soften(1.0)

    def _rate_now(self) -> float:
        last = self.history[max(len(self.history) - 1 - RATE_WINDOW, 0)]
        now = self.history[-1]
        gone = np.linalg.norm(now.places - last.places, axis=1).max()
        return float(gone / max(now.time - last.time, self._step))

    def result(
        self, grasp: Grasp, wrench: Array, loading: str, twin: Twin, stiffness: float, *, bodies: bool = False
    ) -> SimulationResult:
        """The history in SI units, judged; `bodies` says whether they were simulated."""
        force, length, free = twin.force, twin.length, twin.joints
        history, before, why = self.history, self.before, self.why
        moved = np.array([h.moved for h in history])
        places = np.array([h.places for h in history])
        time = np.array([h.time for h in history])
        speed = np.array([h.speed for h in history])
        after = speed[before:] if len(speed) > before else speed
        sought = load_force(wrench, length)
        faint = 0 < sought < FAINT_LOAD * force
        start = min(max(before - 1, 0), len(history) - 1)
        forces = np.array([h.forces for h in history])
        yielded = float(forces[:, :, 0].max()) / stiffness
        travelled = float(np.linalg.norm(places[-1] - places[start], axis=1).max())
        ending = judge(
            self.rate, float(after.max()), travelled, yielded, broken=bool(why), faint=faint, creeping=self.creeping
        )
        if faint and ending is Ending.UNDECIDED:
            why = (
                f"the load is below {100 * FAINT_LOAD:g} % of the largest force; the engine could not tell it from none"
            )
        load = np.array([h.load for h in history])
        onset = _onset(load, speed, after, before, ending) if loading == "preload-first" else None
        scale = np.array([1.0 if grasp.joints[j].type == "revolute" else length for j in free])
        return SimulationResult(
            ending=ending, grasp=grasp, wrench=wrench, loading=loading, onset=onset, rate=self.rate * length,
            time=time, load=load, shift=length * np.array([h.shift for h in history]),
            turn=np.array([h.turn for h in history]), motion=length * moved, speed=length * speed,
            joints=np.array([h.joints for h in history]) * scale, free=free, forces=force * forces,
            steps=round(float(time[-1]) / self._step), seconds=clock.perf_counter() - self._begun, why=why,
            bodies=bodies, points=np.array([h.points for h in history]),
        )  # fmt: skip


def _onset(load: Array, speed: Array, after: Array, before: int, ending: Ending) -> float | None:
    """Share of the load at which a slip began; speeds are those of all moments, and `after` the preload."""
    if ending is Ending.SLIPS:
        along = speed[(load > 0) & (speed < EVIDENT)]  # giving way in step with the load, or hardly slipping
        bar = max(SLIP, ELASTIC * float(np.median(along))) if len(along) else SLIP
        rested = np.flatnonzero(speed <= bar)  # the slip that went on to the end began after the last of these
        return float(load[rested[-1]]) if len(rested) else 0.0
    if ending is Ending.SETTLES:
        return float(load[max(before + int(np.argmax(after > EVIDENT)) - 1, 0)])
    return None
