"""From regions to a held object: synthesis, collision and passive stability in one search.

Certified random starts are evaluated as grasps; the most promising are improved along the set of certified
configurations until nothing penetrates, friction forces can balance every load, and `hold` finds a preload that resists
them all. What is returned is decided by the proofs alone: existence by Krawczyk boxes, every load by a witness of the
exact model. That nothing was found proves nothing, except where synthesis answers NONE, or one of the two searches
for a proof that there is no grasp (`no_balance`, `joined_search`): these take a share of the time in which nothing is
found.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from handfast.core.answer import Reach, Stop
from handfast.core.arrays import Array
from handfast.core.errors import InputError, kinds_checked, unknown_name
from handfast.core.libraries import deferred_interrupt
from handfast.core.parallel import Workers, workers_of
from handfast.geometry.collision import Collisions
from handfast.geometry.contacts import of_body
from handfast.geometry.dexterity import dexterity
from handfast.geometry.scene import Scene, rest_overlaps
from handfast.model.body import Body
from handfast.planning.evaluation.evaluator import EVALUATION_CUTOFF, Evaluator, requests
from handfast.planning.evaluation.local_search import SETTINGS, ConfigurationUnit, Improved, LocalSearch, Strength
from handfast.planning.filters.balance import friction_margin
from handfast.planning.joined_search import JoinedSearch
from handfast.planning.load_bound import LoadBound
from handfast.planning.no_balance import NoBalance
from handfast.planning.question import (
    PlanLimits,
    Requirements,
    TaskGraspOptions,
    fingerprint,
    link_pairs,
    refuse_another,
    refuse_no_cone,
)
from handfast.planning.results.grasps import Grasps, ProvedGrasp, ranked
from handfast.planning.results.grasps_file import motors_to_dict
from handfast.planning.results.search_file import COUNTED_REASONS, FoundEntry, SavedSearch
from handfast.planning.search import Gathering, Journal, UnitResult
from handfast.proofs.contact_force_limits import ForceLimits, contact_force_limits
from handfast.proofs.fields import Fields
from handfast.proofs.motors import Motors
from handfast.proofs.tasks import read_task
from handfast.readers.load_body import load_body
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.hold import HoldAnswer
from handfast.synthesis.distance import features_of
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.starts import Certified
from handfast.synthesis.solution import relative_curvatures, verify_existence
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import Task
from handfast.synthesis.task_problem import TaskProblem

FIRST_BOXES = 512  # of placements that are examined before any configuration is sought
BOUND_FIRST = 0.25  # of all the time, before any configuration is sought, for at most so many boxes
BOUND_SHARE = 0.5  # of the time of the search, for the bound of what any placement holds, where the best is asked for
CLOSED_RATIO = 1.01  # a bound over what the best grasp holds: near enough to end the search
BALANCE_SHARE = 0.2  # of the time in which nothing is found, for the proof that no forces balance the loads
LAST_BOXES = 4096  # .. of that proof, where synthesis certifies nothing and the search ends
JOINED_SHARE = 0.3  # .. for the proof that every configuration is discarded for some reason
Searched = TypeVar("Searched", NoBalance, LoadBound)
DIFFERENT = 0.1  # grasps nearer to each other, in the measure of `synthesis/distance`, are alike
FRUITLESS = 4  # units without any certified start after which synthesis is asked whether there is one


@kinds_checked
def grasp_for(
    task: Task,
    body: Body | None = None,
    loads: Loads | None = None,
    *,
    options: TaskGraspOptions | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    journal: Journal[Grasps] | None = None,
    **changes: Any,
) -> Grasps:
    """Certified, collision-free, passively stable grasps for a task, with the torques to apply.

    Args:
        body: the object; `task.object` is loaded unless given.
        loads: what one preload must hold, `options.safety` times; the weight from all six axis directions unless given.
        options: see `TaskGraspOptions`.
        jobs: processes; by default all cores.
        scheduler: address of a Dask scheduler, whose workers take the place of processes here.
        journal: hears of the grasps so far after each unit of work, and may give a search to go on from.
        changes: options by name, in place of those of `options`: `grasp_for(task, count=3, timeout=None)`.

    Raises:
        InputError: no object, an object without mass where the loads are left to its weight, an unknown actuator or
            link, a number out of range, limits and couplings that leave nothing; an earlier search of another
            question, or with grasps that are not proved or do not hold.
    """
    o = replace(options or TaskGraspOptions(), **changes)
    if body is None:
        if task.object is None:
            raise InputError("names no object; give one, its shape is needed", source=task.name or None, field="object")
        body = load_body(task.object)
    loads = (Loads.gravity(body) if loads is None else loads).scaled(o.safety)
    names = tuple(task.hand.closing_actuators if o.actuators is None else o.actuators)
    for name in names:
        if name not in task.hand.mechanism.actuators:
            raise unknown_name("actuator", name, task.hand.mechanism.actuators, field="actuators")
    o.limits.refuse_unknown(task.hand)
    friction = body.friction if o.friction is None else o.friction
    refuse_no_cone(friction, o.torsion)
    scene = Scene(task.hand, body, link_pairs(task.hand, o.ignored))
    problem = TaskProblem.of(task)
    collisions = Collisions(scene, cutoff=EVALUATION_CUTOFF, at_rest=rest_overlaps(scene, at_zero=True))
    evaluator = Evaluator(problem, collisions, loads, friction, o.allowed, o.torsion)
    asked = Requirements.of(o.limits, friction, names, o.torsion)
    work = LocalSearch(evaluator, o.seed, asked, best=o.best, force_limits=force_limits_of(task, asked))
    search = _TaskSearch(work, body, o.count, journal or Journal())
    return search.run(o.timeout, jobs, scheduler)


def force_limits_of(task: Task, asked: Requirements) -> ForceLimits:
    """What no normal force at a contact exceeds, by the limits that are asked, wherever the hand is."""
    most, motors = np.inf if asked.force_limit is None else asked.force_limit, motors_of(task, asked)
    data = read_task(task_to_dict(task))
    return contact_force_limits(data, motors, asked.friction, asked.torsion).up_to(most)


def motors_of(task: Task, asked: PlanLimits) -> Motors:
    """What drives and holds the hand's joints, within the limits that are asked."""
    commands = np.inf if asked.command_limit is None else asked.command_limit
    said = Fields(json.loads(json.dumps(motors_to_dict(task.hand), allow_nan=False)))
    return Motors.read(said, read_task(task_to_dict(task)), asked.torque_limits or {}, commands)


def question_of(work: LocalSearch, body: Body) -> str:
    """The fingerprint of what is asked, but for how many and how long."""
    evaluator, r = work.evaluator, work.requirements
    said = {"actuators": r.actuators, "friction": r.friction, "allowed": evaluator.allowed, "command": r.command_limit}
    regions = {key: value for key, value in task_to_dict(evaluator.task).items() if key in ("contacts", "pose")}
    ignored = evaluator.collisions.scene.ignored
    regions |= {"ignored": ignored} if ignored else {}
    regions |= {"best": work.best} if work.best else {}
    regions |= {"torsion": r.torsion} if r.torsion else {}
    settings = r.settings or SETTINGS
    others = said | r.of_a_load.to_json() | regions | {"settings": settings}
    return fingerprint(evaluator.task.hand, body, evaluator.loads, work.seed, **others)


@dataclass(eq=False)
class _Found:
    """A configuration that holds.

    Attributes:
        feature: where it is, in the measure of `synthesis/distance`.
        first: the first preload that held. answer: the least one, or that which holds most; None until it is known.
        strength: how many times the loads it holds; None where that was not asked.
        proved: with everything that is said of it.
    """

    certified: Certified
    repaired: bool
    feature: Array
    first: HoldAnswer
    answer: HoldAnswer | None = None
    strength: Strength | None = None
    proved: ProvedGrasp | None = None

    @property
    def factor(self) -> float:
        """How many times the loads it holds, as far as that was asked."""
        return self.strength.factor if self.strength else 1.0


def _alike(a: _Found, b: _Found) -> bool:
    return bool(np.linalg.norm(a.feature - b.feature) < DIFFERENT)


class _TaskSearch:
    """One call: units in order, what they found, the grasps that differ."""

    def __init__(self, work: LocalSearch, body: Body, count: int, journal: Journal[Grasps]) -> None:
        self.work, self.evaluator, self.body, self.count = work, work.evaluator, body, count
        self.journal, self.question = journal, question_of(work, body)
        self.gathered: Gathering[_Found] = Gathering(count, _alike, value=self.value)
        self.evaluated = self.starts = self.unproved = self.units = 0
        self.done = self.counted()  # after the last unit that was done before the time was up
        self.cut = False
        self.synthesis: Synthesis | None = None
        self.balance = self.proof_of_none()
        self.bound: LoadBound | None = None
        self.joined: JoinedSearch | None = None
        self.begin, self.spent = time.monotonic(), 0.0

    @property
    def value(self) -> Callable[[_Found], float] | None:
        """By what grasps are chosen; None for the first that are found."""
        return None if self.work.best is None else lambda f: f.factor

    @property
    def grasps(self) -> list[ProvedGrasp]:
        """Those that are proved so far."""
        return [f.proved for f in self.gathered.kept if f.proved]

    @property
    def enough(self) -> bool:
        """Is there nothing more to look for?"""
        if self.work.best is None:
            return self.gathered.enough
        held = max((f.factor for f in self.gathered.kept), default=0.0)
        return self.gathered.enough and self.bound is not None and self.bound.factor <= CLOSED_RATIO * held

    def run(self, timeout: float | None, jobs: int | None, scheduler: str | None) -> Grasps:
        """Units until enough are found, and the torques of each."""
        self.work.warm()
        earlier = self.journal.earlier(self.evaluator.task)
        if earlier:
            try:
                self.go_on(earlier)
            except InputError as fault:
                raise fault.at(self.journal.source) from None
        self.begin = time.monotonic()
        self.work.end = np.inf if timeout is None else self.begin + timeout
        with workers_of(self.work, jobs, scheduler) as pool:
            try:
                stop = self.search(pool)
            except KeyboardInterrupt:
                stop = Stop.INTERRUPTED
                for f in self.gathered.kept:
                    f.proved = f.proved or self.proved(f, f.first)
        answer = self.answer(stop)
        self.journal.close(answer)
        return answer

    def go_on(self, earlier: SavedSearch) -> None:
        """From where an earlier search was, every grasp of it proved again."""
        refuse_another(earlier.question, self.question)
        self.done, self.spent, self.units = earlier, earlier.seconds, earlier.units
        self.evaluated, self.starts, self.unproved = earlier.judged, earlier.starts, earlier.unproved
        for name, saved, made in (
            ("balance", earlier.balance, self.proof_of_none),
            ("bound", earlier.bound, self.bound_of_all),
        ):
            try:
                if saved is not None:
                    setattr(self, name, made(saved))
            except InputError as fault:
                raise fault.within(name) from None
        if earlier.joined is not None:
            try:
                self.joined = self.joined_proof(earlier.joined)
            except InputError as fault:
                raise fault.within("joined") from None
        kept = []
        for i, found in enumerate(earlier.found):
            proof = found.proof(self.evaluator.task, f"found[{i}]")
            report = verify_existence(self.evaluator.task, proof)
            if not report.ok:
                raise InputError(f"is not proved: {report.reason}", field=f"found[{i}].existence")
            certified, strength = Certified.of(proof, self.evaluator.problem), None
            known = found.preload, found.lower, found.upper
            answer = self.work.answer_again(certified, known, found.nodes, f"found[{i}]")
            if found.factor is not None:
                strength = self.work.strength_again(answer, found.factor, f"found[{i}].factor")
            kept.append(replace(self.found(Improved(certified, found.repaired, answer, strength)), answer=answer))
        self.gathered = Gathering(self.count, _alike, earlier.tally, kept, self.value)
        for f in kept:
            f.proved = self.proved(f, f.first)

    def proof_of_none(self, saved: Any = None) -> NoBalance:
        """The search for a proof that no forces balance the loads, from where an earlier one was."""
        return self.of_placements(NoBalance, saved)

    def bound_of_all(self, saved: Any = None) -> LoadBound | None:
        """The search for a bound on what any placement holds; None where a limit of the contact forces is missing."""
        return self.of_placements(LoadBound, saved) if np.isfinite(self.work.force_limits.most).any() else None

    def of_placements(self, kind: type[Searched], saved: Any) -> Searched:
        """A search over the placements of the contacts."""
        e, r, center = self.evaluator, self.work.requirements, np.asarray(self.body.center_of_mass, dtype=float)
        how: dict[str, Any] = {"center": center, "force_limits": self.work.force_limits, "seed": self.work.seed}
        how |= {"torsion": r.torsion}
        return kind(e.task, e.loads, r.friction, **how, saved=saved)

    def joined_proof(self, saved: Any = None) -> JoinedSearch:
        """The search for a proof with several reasons, from where an earlier one was."""
        e = self.evaluator
        motors = motors_of(e.task, self.work.requirements)
        return JoinedSearch(e.task, e.collisions, e.allowed, self.balance, motors, saved=saved)

    def search(self, pool: Workers[LocalSearch]) -> Stop:
        """Units in order until there are enough, or it is shown that there are none, or the time is over."""
        if self.enough:
            return Stop.COMPLETE
        if not self.gathered.kept:
            self.balance.run(FIRST_BOXES, self.work.end)
        if self.balance.shown:
            return Stop.COMPLETE
        if self.work.best and self.bound is None:
            self.bound = self.bound_of_all()
        if self.bound and self.bounded(FIRST_BOXES, BOUND_FIRST * (self.work.end - time.monotonic())):
            return Stop.COMPLETE
        begin = time.monotonic()
        for unit in pool.map(LocalSearch.run, self.work.numbers(self.units), ahead=pool.count + 1):
            new = self.take(unit)
            self.prove(pool)
            self.journal.note(self.answer(Stop.INTERRUPTED), new=new)
            if self.enough:
                return Stop.COMPLETE
            now = time.monotonic()
            if self.bound and not self.bound.over:
                if self.bounded(sys.maxsize, BOUND_SHARE * (now - begin)):
                    return Stop.COMPLETE
                begin = time.monotonic()
            elif not self.gathered.kept:
                self.balance.run(sys.maxsize, min(self.work.end, now + BALANCE_SHARE * (now - begin)))
                self.joined = self.joined or self.joined_proof()
                spent, here = now - begin, time.monotonic()
                self.joined.run(sys.maxsize, min(self.work.end, here + JOINED_SHARE * spent))
                begin = time.monotonic()
                if self.balance.shown or self.joined.shown:
                    return Stop.COMPLETE
            if not self.gathered.tally.total and self.units == FRUITLESS:
                self.synthesis = self.possible()
                if self.synthesis.verdict is not Reach.FOUND:
                    return self.last_proof(self.synthesis)
        return Stop.TIME

    def last_proof(self, synthesis: Synthesis) -> Stop:
        """The proof with several reasons goes on where no configuration was certified, nor shown not to exist."""
        if synthesis.verdict is Reach.NONE or self.joined is None:
            return synthesis.stop
        self.joined.run(LAST_BOXES, self.work.end)
        return Stop.COMPLETE if self.joined.shown else synthesis.stop

    def bounded(self, boxes: int, seconds: float) -> bool:
        """Go on with the bound; does it show that there is no grasp?"""
        assert self.bound is not None
        self.bound.run(boxes, min(self.work.end, time.monotonic() + seconds))
        if self.bound.factor < 1:
            self.balance = self.proof_of_none({k: v for k, v in self.bound.to_json().items() if k != "factor"})
        return self.bound.factor < 1

    def take(self, unit: ConfigurationUnit) -> bool:
        """Count a unit, and choose what differs of what it found; was anything chosen?"""
        self.evaluated, self.starts = self.evaluated + unit.evaluated, self.starts + unit.starts
        self.unproved, self.units = self.unproved + unit.unproved, self.units + 1
        found = tuple(self.found(f) for f in unit.found)
        new = self.gathered.take(UnitResult(unit.tally, found))
        beyond = self.gathered.beyond and self.work.best is None  # who wants more will want what is beyond
        self.cut = self.cut or beyond or not unit.whole
        return new

    def found(self, of_unit: Improved) -> _Found:
        """What a unit found, and where it is."""
        x = (of_unit.certified.x * self.evaluator.problem.lengths)[None]
        feature = features_of(self.evaluator.task, x)[0]
        return _Found(of_unit.certified, of_unit.repaired, feature, of_unit.first, strength=of_unit.strength)

    def prove(self, pool: Workers[LocalSearch]) -> None:
        """The least preloads of what was found last, and how far the search has come."""
        begin = time.monotonic()
        new = [f for f in self.gathered.kept if f.answer is None]
        if self.work.best:
            answers = [f.first for f in new]  # under the preload that holds most
        else:
            answers = list(pool.map(LocalSearch.proof, [f.certified for f in new]))  # all of them, or none on Ctrl-C
        with deferred_interrupt():
            for f, answer in zip(new, answers, strict=True):
                f.proved, f.answer = self.proved(f, answer), answer
        if pool.alone:
            self.work.end += time.monotonic() - begin  # the time is for the search
        if not self.cut:
            self.done = self.counted()

    def counted(self) -> SavedSearch:
        """How far the search has come, without what it found."""
        return SavedSearch(
            schema="handfast/search/1",
            question=self.question,
            units=self.units,
            fates=self.gathered.tally.to_json("holds", COUNTED_REASONS),
            judged=self.evaluated,
            starts=self.starts,
            unproved=self.unproved,
            seconds=0.0,
            found=[],
        )

    def answer(self, stop: Stop) -> Grasps:
        """What is known so far."""
        balance, bound = None if self.grasps else self.balance.searched, self.bound.bound if self.bound else None
        joined = None if self.grasps or self.joined is None else self.joined.searched
        none = self.balance.shown or (joined is not None and joined.shown)
        none = none or (self.synthesis is not None and self.synthesis.verdict is Reach.NONE)
        going_on = None if self.grasps or self.balance.over else self.balance.to_json()
        trees = None if self.grasps or self.joined is None or self.joined.over else self.joined.to_json()
        seconds = self.spent + time.monotonic() - self.begin
        found = [self.remembered(f) for f in self.gathered.kept if f.answer]
        return Grasps(
            self.evaluator.task,
            self.body,
            self.evaluator.loads,
            self.count,
            self.work.seed,
            Reach.FOUND if self.grasps else Reach.NONE if none else Reach.UNDECIDED,
            stop,
            seconds,
            ranked(self.grasps),
            self.gathered.tally.copy(),
            self.evaluated,
            self.starts,
            self.unproved,
            self.synthesis,
            balance=balance,
            joined=joined,
            requirements=self.work.requirements,
            search=self.done.model_copy(
                update={
                    "found": found,
                    "seconds": seconds,
                    "balance": going_on,
                    "bound": bound and bound.proof,
                    "joined": trees,
                }
            ),
            bound=bound,
        )

    def remembered(self, f: _Found) -> FoundEntry:
        """A grasp as it stands in the file of a search."""
        a = f.answer
        assert a is not None
        assert a.preload is not None
        return FoundEntry(
            existence=f.certified.existence(self.evaluator.problem).to_json(),
            repaired=f.repaired,
            preload=a.preload,
            lower=a.lower,
            upper=a.upper,
            nodes=a.nodes,
            factor=f.strength.factor if f.strength else None,
        )

    def possible(self) -> Synthesis:
        """Whether there is any configuration at all, asked of synthesis with the time that is left."""
        left = None if np.isinf(self.work.end) else max(self.work.end - time.monotonic(), 0.1)
        return synthesize(self.evaluator.task, seed=self.work.seed, timeout=left)

    def proved(self, f: _Found, answer: HoldAnswer) -> ProvedGrasp:
        """A grasp with everything that is said of it under the preload of an answer."""
        c, task, near = self.work.candidate(f.certified), self.evaluator.task, self.evaluator.collisions
        grasp = of_body(c.grasp.with_preload(answer.preload), task.hand, self.body)
        wide = Collisions(near.scene, radius=near.radius, left_out=near.left_out, at_rest=near.at_rest)
        return ProvedGrasp(
            c.solution,
            c.q,
            grasp,
            answer,
            self.work.requirements,
            wide.clearances(c.q, c.solution.pose, requests(c.solution)),
            relative_curvatures(c.solution),
            dexterity(task.hand, c.q, [t.link for t in task.contact_pairs], c.solution.points, grasp),
            friction_margin(grasp, self.evaluator.loads.wrenches),
            f.repaired,
            f.strength,
        )
