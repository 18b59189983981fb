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

import numpy as np

from handfast.core.answer import Reach, Stop
from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.geometry.collision import Collisions
from handfast.geometry.dexterity import dexterity
from handfast.geometry.scene import Scene
from handfast.model.body import Body, load_body
from handfast.planning.question import fingerprint, refuse_another
from handfast.planning.tasks.asked import Asked
from handfast.planning.tasks.climb import Unit, Worker
from handfast.planning.tasks.crew import Crew
from handfast.planning.tasks.judge import NEAR, Allowed, Judge, Reason, requests
from handfast.planning.tasks.proved import Grasps, ProvedGrasp, rank
from handfast.planning.tasks.search_file import Find, Search
from handfast.stability.hold import HoldAnswer
from handfast.stability.loads import Loads
from handfast.stability.many import default_jobs
from handfast.stability.settings import Settings
from handfast.stability.statics import spare_friction
from handfast.synthesis.certify.verify_existence import verify_existence
from handfast.synthesis.curvatures import relative_curvatures
from handfast.synthesis.distance import features_of
from handfast.synthesis.embedded import task_to_dict
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.starts import Certified
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import Task
from handfast.synthesis.task_problem import TaskProblem

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
OnFind = Callable[[Search, "Grasps | None"], None]


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
    earlier: Search | None = None,
    on_step: OnStep | None = None,
    on_find: OnFind | None = None,
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
        earlier: a search that was cut short, to go on from.
        on_step: called while it runs.
        on_find: called with how far it has come, after each unit of work, and with the grasps so far where there are
            new ones.

    Raises:
        InputError: no object, an object without mass where the loads are left to its weight, an unknown actuator, a
            number out of range, limits and couplings that leave nothing; an earlier search of another question, or
            with grasps that are not proved or do not hold.
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
        TaskProblem.of(task),
        Collisions(Scene(hand, body), cutoff=NEAR),
        loads,
        body.friction if friction is None else friction,
        allowed or Allowed(),
    )
    limits = {"torque_limits": torque_limits, "force_limit": force_limit, "eta": eta}
    worker = Worker(judge, seed, names, limits, command_limit, settings or SETTINGS)
    asked = Asked(judge.friction, names, eta, dict(torque_limits or {}), force_limit, command_limit)
    said = {"actuators": names, "friction": judge.friction, "allowed": judge.allowed, "command": command_limit}
    regions = {key: value for key, value in task_to_dict(task).items() if key in ("contacts", "pose")}
    question = fingerprint(hand, body, loads, seed, **said, **limits, **regions, settings=worker.settings)
    search = _Search(worker, body, count, asked, question, on_step, on_find)
    return search.run(timeout, jobs or default_jobs(), earlier)


@dataclass(eq=False)
class _Found:
    """A configuration that holds; answer: the least preload, None until it is known."""

    certified: Certified
    repaired: bool
    answer: HoldAnswer | None = None


class _Search:
    """One call: units in order, what they found, the grasps that differ."""

    def __init__(
        self,
        worker: Worker,
        body: Body,
        count: int,
        asked: Asked,
        question: str,
        on_step: OnStep | None,
        on_find: OnFind | None,
    ) -> None:
        self.worker, self.judge, self.body, self.asked = worker, worker.judge, body, asked
        self.count, self.question, self.on_step, self.on_find = count, question, on_step, on_find
        self.fates: Counter[Reason] = Counter()
        self.found: list[_Found] = []
        self.grasps: list[ProvedGrasp] = []
        self.features: list[Array] = []
        self.judged = self.starts = self.unproved = self.units = 0
        self.done = Search(question)  # after the last unit that was done before the time was up
        self.cut = False
        self.stop = Stop.TIME
        self.synthesis: Synthesis | None = None
        self.begin, self.spent = time.monotonic(), 0.0

    def run(self, timeout: float | None, jobs: int, earlier: Search | None) -> Grasps:
        """Units until enough are found, and the torques of each."""
        self.worker.warm()
        if earlier:
            try:
                self.go_on(earlier)
            except InputError as fault:
                raise fault.at(earlier.source) from None
        self.begin = time.monotonic()
        self.worker.end = np.inf if timeout is None else self.begin + timeout
        with Crew(self.worker, jobs) as crew:
            try:
                self.search(crew)
            except KeyboardInterrupt:
                self.stop = Stop.INTERRUPTED
            self.worker.stopped.set()
            self.prove(crew)
        return self.answer(self.stop)

    def go_on(self, earlier: Search) -> None:
        """From where an earlier search was, every grasp of it proved again."""
        refuse_another(earlier.question, self.question)
        self.done, self.spent = earlier, earlier.seconds
        self.fates, self.units = Counter(earlier.fates), earlier.units
        self.judged, self.starts, self.unproved = earlier.judged, earlier.starts, earlier.unproved
        for i, find in enumerate(earlier.found):
            report = verify_existence(self.judge.task, find.existence)
            if not report.ok:
                raise InputError(f"is not proved: {report.reasons[0]}", field=f"found[{i}].existence")
            certified = Certified.of(find.existence, self.judge.problem)
            again = self.worker.held_again(certified, find, f"found[{i}]")
            self.choose(_Found(certified, find.repaired, again))
        self.grasps = [self.proved(f) for f in self.found]

    def answer(self, stop: Stop) -> Grasps:
        """What is known so far."""
        none = self.synthesis is not None and self.synthesis.verdict is Reach.NONE
        return Grasps(
            self.judge.task,
            self.body,
            self.judge.loads,
            self.count,
            self.worker.seed,
            Reach.FOUND if self.grasps else Reach.NONE if none else Reach.UNDECIDED,
            stop,
            self.seconds,
            tuple(ranked(self.grasps)),
            {r: self.fates[r] for r in Reason},
            self.judged,
            self.starts,
            self.unproved,
            self.synthesis,
            asked=self.asked,
        )

    @property
    def seconds(self) -> float:
        """[s] this time and before."""
        return self.spent + time.monotonic() - self.begin

    def search(self, crew: Crew) -> None:
        """Units in order until there are enough, or the time is over."""
        if len(self.found) >= self.count:
            self.stop = Stop.COMPLETE
            return
        for unit in crew.units(self.units):
            self.take(unit)
            if self.on_step:
                self.on_step(Progress(self.fates.total(), len(self.found), self.count, self.fates))
            self.prove(crew)
            if len(self.found) >= self.count:
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
        self.cut = self.cut or not unit.whole
        for certified, repaired in unit.found:
            if self.is_alike(certified):
                self.fates[Reason.HOLDS] -= 1
                self.fates[Reason.ALIKE] += 1
            elif len(self.found) < self.count:
                self.choose(_Found(certified, repaired))
            else:
                self.cut = True  # who wants more will want this one

    def is_alike(self, certified: Certified) -> bool:
        """Whether a configuration is like one that was chosen."""
        at = self.feature(certified)
        return any(np.linalg.norm(at - other) < DIFFERENT for other in self.features)

    def choose(self, found: _Found) -> None:
        """Add a configuration to those found."""
        self.found.append(found)
        self.features.append(self.feature(found.certified))

    def feature(self, certified: Certified) -> Array:
        """Where a configuration is, in the measure of `synthesis/distance`."""
        return features_of(self.judge.task, (certified.x * self.judge.problem.lengths)[None])[0]

    def prove(self, crew: Crew) -> None:
        """The least preloads of what was found last, and word of how far the search has come."""
        new = [f for f in self.found if f.answer is None]
        begin = time.monotonic()
        for f, answer in zip(new, crew.proofs([f.certified for f in new]), strict=True):
            f.answer = answer
        self.grasps += [self.proved(f) for f in new]
        if crew.alone:
            self.worker.end += time.monotonic() - begin  # the time is for the search
        if not self.cut:
            counted = self.units, self.fates.copy(), self.judged, self.starts, self.unproved
            self.done = Search(self.question, *counted)
        if self.on_find:
            found = tuple(self.find(f) for f in self.found)
            done = replace(self.done, found=found, seconds=self.seconds)
            self.on_find(done, self.answer(Stop.INTERRUPTED) if new else None)

    def find(self, f: _Found) -> Find:
        """A grasp as it is remembered."""
        assert f.answer is not None
        a = f.answer
        assert a.preload is not None
        return Find(f.certified.existence(self.judge.problem), f.repaired, a.preload, a.lower, a.upper, a.nodes)

    def possible(self) -> Synthesis:
        """Whether there is any configuration at all, asked of synthesis with the time that is left."""
        left = self.worker.end - time.monotonic()
        return synthesize(self.judge.task, seed=self.worker.seed, timeout=None if np.isinf(left) else max(left, 0.1))

    def proved(self, f: _Found) -> ProvedGrasp:
        """A grasp with everything that is said of it."""
        assert f.answer is not None
        (c,), task, near = self.worker.candidates([f.certified]), self.judge.task, self.judge.collisions
        answer = f.answer
        grasp = c.grasp.with_preload(answer.preload)
        wide = Collisions(near.scene, radius=near.radius, left_out=near.left_out)
        clearances = wide.clearances(c.q, c.solution.pose, requests(c.solution))
        curved = relative_curvatures(c.solution)
        able = dexterity(task.hand, c.q, [t.link for t in task.contact_pairs], c.solution.points, grasp)
        spare = spare_friction(grasp, self.judge.loads.wrenches)
        return ProvedGrasp(c.solution, c.q, grasp, answer, clearances, curved, able, spare, f.repaired)


def ranked(grasps: Sequence[ProvedGrasp]) -> list[ProvedGrasp]:
    """Best first, with their scores."""
    scored = [replace(g, score=s) for g, s in zip(grasps, rank(grasps), strict=True)]
    return sorted(scored, key=lambda g: -g.score)
