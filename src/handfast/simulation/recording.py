"""A simulated question as it runs: commands, load, and a wait until the motion has decided; its history, judged."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.simulation.result import CREEPS, EVIDENT, LEAST, LOST, REST, SLIP, Ending, SimulationResult, judge
from handfast.simulation.stepper import Moment, Stepper
from handfast.simulation.twin import Twin, load_force

PRELOAD = 2.0  # [s] of the simulation for the commands alone
CLOSING = 1.5  # [s] of these over which commands grow where joints rub: dry friction would keep the squeeze of a jolt
HOLD, LONGEST = 2, 24  # [s] for the full load: at least, and at most while motion still fades
FADES = 0.7  # a rate that is less than this share of that a second before is fading
ELASTIC = 3.0  # times the usual speed at which a grasp gives way in step with the load: that fast it slips
SOFTER = 10.0  # times: friction in the engine, to tell its own creep from a slip
TOUCH = 1e-3  # of the commands comes first where they grow with the load: the hand touches before it is pulled at
TOGETHER = 3  # commands and load grow with this power of time: in proportion to what acts already, never abruptly
SAMPLE = 0.02  # [s] between two moments of the history
WINDOW = 25  # moments over which the rate at the end is taken, 0.5 s

OnTime = Callable[[float, float], None]


class Recording:
    """Runs a stepper and keeps what happens.

    Attributes:
        history: the moments.
        before: how many of them were the preload's.
        rate: of the fastest contact over the last `WINDOW` moments [grasp sizes/s], before friction was made softer.
        creeping: whether that rate is the engine's own.
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
        return bool(self.history) and self.history[-1].moved > LOST

    def run(self, ramp: float, *, preload: bool, commands: bool) -> None:
        """The commands if `preload`, then the load within `ramp` [s], then the wait for rest.

        With `commands` these grow along with the load, but for the `TOUCH` of them that comes first.
        """
        s = self.stepper
        try:
            if preload or commands:
                s.winding = False  # until all commands act: what closes first does not keep what it gained by that
                if commands:
                    s.command(TOUCH)
                if preload and s.rubs:
                    self._close(CLOSING)
                self._go(PRELOAD - CLOSING if preload and s.rubs else PRELOAD, 0.0)
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
        power = TOGETHER if commands else 1
        shares = grow * (np.arange(count + 1) / count) ** power
        for share, more in pairwise(shares):
            if self._lost:
                return
            if commands:
                self.stepper.command(TOUCH + (1 - TOUCH) * more)
            self.stepper.run(each, (more - share) / each)
            self.history.append(self.stepper.moment())
            if self._on_progress is not None:
                self._on_progress(self.history[-1].time, max(self._end, self.history[-1].time))

    def _wait(self) -> None:
        """Until it rests, drives on without fading, or time is up; then tell what creeps from what slips."""
        before = np.inf
        for second in range(1, LONGEST + 1):
            self._go(1.0, 0.0)
            self.rate = self._rate_now()
            fades = self.rate < FADES * before
            before = self.rate
            if self._lost or (second >= HOLD and (self.rate <= REST or not fades)):
                break
        if REST < self.rate <= SLIP and not self._lost:
            self.stepper.soften(SOFTER)
            self._go(1.0, 0.0)
            self.creeping = self._rate_now() > CREEPS * SOFTER * self.rate
            self.stepper.soften(1.0)

    def _rate_now(self) -> float:
        last = self.history[max(len(self.history) - 1 - WINDOW, 0)]
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
        faint = 0 < sought < LEAST * force
        start = min(max(before - 1, 0), len(history) - 1)
        forces = np.array([h.forces for h in history])
        yielded = float(forces[:, :, 0].max()) / stiffness
        travelled = float(np.linalg.norm(places[-1] - places[start], axis=1).max())
        ending = judge(
            self.rate, float(after.max()), travelled, yielded, broken=bool(why), faint=faint, creeping=self.creeping
        )
        if faint and ending is Ending.UNDECIDED:
            why = f"the load is below {100 * LEAST:g} % of the largest force; the engine could not tell it from none"
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
