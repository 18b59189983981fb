"""From regions to a held object: synthesis, collision and passive stability in one search.

Certified random starts are judged as grasps; the most promising climb along the set of certified configurations
until nothing penetrates, friction forces can balance every load, and `hold` finds a preload that resists them all.
What is returned is decided by the proofs alone: existence by Krawczyk boxes, every load by a witness of the exact
model. That nothing was found proves nothing, except where synthesis answers NONE.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from holdfast.answer import Reach, Stop
from holdfast.body import Body, load_body
from holdfast.collision import Collisions
from holdfast.curvature import relative_curvatures
from holdfast.dexterity import dexterity
from holdfast.errors import InputError, unknown_name
from holdfast.planning.tasks.asked import Asked
from holdfast.planning.tasks.climb import Unit, Worker
from holdfast.planning.tasks.crew import Crew
from holdfast.planning.tasks.judge import NEAR, Allowed, Judge, Reason, requests
from holdfast.planning.tasks.proved import Grasps, ProvedGrasp, rank
from holdfast.scene import Scene
from holdfast.stability.hold import HoldAnswer
from holdfast.stability.loads import Loads
from holdfast.stability.many import default_jobs
from holdfast.stability.settings import Settings
from holdfast.stability.statics import spare_friction
from holdfast.synthesis.answers import Synthesis
from holdfast.synthesis.distance import features_of
from holdfast.synthesis.problem import Problem
from holdfast.synthesis.queries import synthesize
from holdfast.synthesis.starts import Certified
from holdfast.synthesis.task import Task

SETTINGS = Settings(node_limit=4000)  # nodes, not seconds: the same seed finds the same grasps
DIFFERENT = 0.1  # grasps nearer to each other, in the measure of `synthesis/distance`, are alike
FRUITLESS = 4  # units without any certified start after which synthesis is asked whether there is one


@dataclass(frozen=True)
class Progress:
    """Where the search is: starts judged so far, grasps found, and what became of the others."""

    starts: int
    found: int
    wanted: int
    fates: Mapping[Reason, int]


OnStep = Callable[[Progress], None]


def grasp_for(
    task: Task,
    body: Body | None = None,
    loads: Loads | None = None,
    *,
    count: int = 1,
    seed: int = 0,
    timeout: float | None = 60.0,
    actuators: Sequence[str] | None = None,
    friction: float | None = None,
    allowed: Allowed | None = None,
    command_limit: float | None = None,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    eta: float = 0.0,
    settings: Settings | None = None,
    jobs: int | None = None,
    on_step: OnStep | None = None,
) -> Grasps:
    """Certified, collision-free, passively stable grasps for a task, with the torques to apply.

    Args:
        body: the object; `task.object` is loaded unless given.
        loads: what one preload must hold; the weight from all six axis directions unless given.
        count: of grasps that differ from each other.
        seed: of the random numbers; the same seed finds the same grasps on any number of cores.
        timeout: [s] after start-up; None goes on until there are `count`.
        actuators: that may be commanded, those that close the hand unless given.
        friction: coefficient; the object's unless given.
        allowed: how deep solids may be in each other.
        command_limit: largest command [N m or N]; ten times the largest load at the size of the grasp unless
            given (`hold.moderate`).
        torque_limits: as in `check`, like force_limit and eta.
        settings: of each question about stability.
        jobs: processes; by default all cores.
        on_step: called while it runs.

    Raises:
        InputError: no object, an object without mass where the loads are left to its weight, an unknown
            actuator, a number out of range, limits and couplings that leave nothing.
    """
    if body is None:
        if task.object is None:
            raise InputError("names no object; give one, its shape is needed", source=task.name or None, field="object")
        body = load_body(task.object)
    if count < 1:
        raise InputError(f"is {count}; at least 1 is needed", field="count")
    if timeout is not None and not timeout > 0:
        raise InputError(f"is {timeout:g} s; a positive number is needed", field="timeout")
    loads = Loads.gravity(body) if loads is None else loads
    hand = task.hand
    names = tuple(hand.closing_actuators if actuators is None else actuators)
    for name in names:
        if name not in hand.mechanism.actuators:
            raise unknown_name("actuator", name, hand.mechanism.actuators, field="actuators")
    judge = Judge(
        Problem.of(task),
        Collisions(Scene(hand, body), cutoff=NEAR),
        loads,
        body.friction if friction is None else friction,
        allowed or Allowed(),
    )
    limits = {"torque_limits": torque_limits, "force_limit": force_limit, "eta": eta}
    worker = Worker(judge, seed, names, limits, command_limit, settings or SETTINGS)
    asked = Asked(judge.friction, names, eta, dict(torque_limits or {}), force_limit, command_limit)
    search = _Search(worker, body, count, asked, on_step)
    return search.run(timeout, jobs or default_jobs())


class _Search:
    """One call: units in order, what they found, the grasps that differ."""

    def __init__(self, worker: Worker, body: Body, count: int, asked: Asked, on_step: OnStep | None) -> None:
        self.worker, self.judge, self.body = worker, worker.judge, body
        self.count, self.asked, self.on_step = count, asked, on_step
        self.fates: Counter[Reason] = Counter()
        self.chosen: list[tuple[Certified, bool]] = []
        self.features: list[Any] = []
        self.judged = self.starts = self.unproved = self.units = 0
        self.stop = Stop.TIME
        self.synthesis: Synthesis | None = None

    def run(self, timeout: float | None, jobs: int) -> Grasps:
        """Units until enough are found, then the torques of each."""
        self.worker.warm()
        begin = time.monotonic()
        self.worker.end = np.inf if timeout is None else begin + timeout
        with Crew(self.worker, jobs) as crew:
            try:
                self.search(crew)
            except KeyboardInterrupt:
                self.stop = Stop.INTERRUPTED
            self.worker.stopped.set()
            proofs = crew.proofs([certified for certified, _ in self.chosen])
            grasps = [self.proved(*found, proof) for found, proof in zip(self.chosen, proofs, strict=True)]
        none = self.synthesis is not None and self.synthesis.verdict is Reach.NONE
        return Grasps(
            self.judge.task,
            self.body,
            self.judge.loads,
            self.count,
            self.worker.seed,
            Reach.FOUND if grasps else Reach.NONE if none else Reach.UNDECIDED,
            self.stop,
            time.monotonic() - begin,
            tuple(ranked(grasps)),
            {r: self.fates[r] for r in Reason},
            self.judged,
            self.starts,
            self.unproved,
            self.synthesis,
            asked=self.asked,
        )

    def search(self, crew: Crew) -> None:
        """Units in order until there are enough, or the time is over."""
        for unit in crew.units():
            self.take(unit)
            if len(self.chosen) >= self.count:
                self.stop = Stop.COMPLETE
                return
            if not self.fates and self.units == FRUITLESS:
                self.synthesis = self.possible()
                if self.synthesis.verdict is not Reach.FOUND:
                    self.stop = self.synthesis.stop
                    return

    def take(self, unit: Unit) -> None:
        """Count a unit, and choose what differs of what it found."""
        self.fates += unit.fates
        self.judged, self.starts = self.judged + unit.judged, self.starts + unit.starts
        self.unproved, self.units = self.unproved + unit.unproved, self.units + 1
        for certified, repaired in unit.found:
            at = features_of(self.judge.task, (certified.x * self.judge.problem.lengths)[None])[0]
            if any(np.linalg.norm(at - other) < DIFFERENT for other in self.features):
                self.fates[Reason.HOLDS] -= 1
                self.fates[Reason.ALIKE] += 1
            elif len(self.chosen) < self.count:
                self.chosen.append((certified, repaired))
                self.features.append(at)
        if self.on_step:
            self.on_step(Progress(self.fates.total(), len(self.chosen), self.count, self.fates))

    def possible(self) -> Synthesis:
        """Whether there is any configuration at all, asked of synthesis with the time that is left."""
        left = self.worker.end - time.monotonic()
        return synthesize(self.judge.task, seed=self.worker.seed, timeout=None if np.isinf(left) else max(left, 0.1))

    def proved(self, certified: Certified, repaired: bool, answer: HoldAnswer) -> ProvedGrasp:
        """A grasp with everything that is said of it."""
        (c,), task, near = self.worker.candidates([certified]), self.judge.task, self.judge.collisions
        grasp = c.grasp.with_preload(answer.preload)
        wide = Collisions(near.scene, radius=near.radius, left_out=near.left_out)
        clearances = wide.clearances(c.q, c.solution.pose, requests(c.solution))
        curved = relative_curvatures(c.solution)
        able = dexterity(task.hand, c.q, [t.link for t in task.touches], c.solution.points, grasp)
        spare = spare_friction(grasp, self.judge.loads.wrenches)
        return ProvedGrasp(c.solution, c.q, grasp, answer, clearances, curved, able, spare, repaired)


def ranked(grasps: Sequence[ProvedGrasp]) -> list[ProvedGrasp]:
    """Best first, with their scores."""
    scored = [replace(g, score=s) for g, s in zip(grasps, rank(grasps), strict=True)]
    return sorted(scored, key=lambda g: -g.score)
