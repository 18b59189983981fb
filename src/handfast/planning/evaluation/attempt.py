"""One attempt at a grasp: a random start, push up, close, and every reason why it may be dropped."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.presented import Presented
from handfast.geometry.contacts import THRESHOLD, grasp_of, of_body
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.hand.hand import Hand
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import Palm, PreShape, palm_of
from handfast.planning.candidates.surface import SurfaceSampler
from handfast.planning.closing import Closed, close
from handfast.planning.evaluation.preload_search import PreloadSearch, SearchedContacts, spanning
from handfast.planning.evaluation.quality import GraspQuality, leans_on, quality, with_margins
from handfast.planning.filters.balance import balances, held_by_contacts
from handfast.planning.filters.quick_look import Overlaps, QuickLook
from handfast.planning.filters.surroundings import OBSTACLE_CLEARANCE, Way, WayFinder
from handfast.planning.question import PlanOptions, fingerprint
from handfast.planning.search import FILTERED, Overlap, RejectionReason, Tally, UnitResult, of_verdict
from handfast.proofs.few_contacts import Fewest, Held
from handfast.simulation.bodies import Bodies
from handfast.simulation.result import Ending
from handfast.simulation.simulate import simulate_bodies
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.hold import HoldAnswer

PENETRATION = 1e-3  # [m] what may at most overlap, hand with object or with itself
CALMER = (0.5, 0.5, 0.0)  # of its abductions a hand keeps, where it started in itself, one after the other
CLEARANCE_DIGITS = 9  # of a clearance [m], which is measured to about 1e-9
PUSHES = 4  # of the object by a finger, at most
FIRMER = (1.25, 2.0, 4.0)  # times the commands of a fragile grasp: under the first with which it is robust it is kept

ATTEMPT_REASONS = (
    *FILTERED,
    RejectionReason.SLIPS,
    RejectionReason.UNDECIDED,
    RejectionReason.STRONG,
    RejectionReason.SIMULATED,
    RejectionReason.ALIKE,
)
OBJECT_NAME = "the object"  # in the place of a link's name
Dropped = tuple[RejectionReason, Overlap | None]  # why an attempt was, and what was in what


@dataclass(frozen=True, eq=False)
class PlannedGrasp(Presented):
    """A hand around an object that holds its loads.

    Attributes:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame.
        grasp: with the preload in force, object frame.
        answer: what `hold` says, a witness for each load.
        penetration: [m] largest overlap of hand and object, 0 if none; self_penetration: of two links,
            beyond what overlaps in the hand at rest.
        index: number of the attempt, which with the seed reproduces it.
        searched: with which contacts its preload was looked for; None where that is not known.
        quality: margin, fragility, clearance; None until it is measured.
        way: in and out; None where it was not looked for.
    """

    q: Array
    pose: Array
    grasp: Grasp
    answer: HoldAnswer
    penetration: float
    self_penetration: float
    index: int
    searched: SearchedContacts | None = None
    quality: GraspQuality | None = None
    way: Way | None = None

    @property
    def robust(self) -> bool:
        """Was it measured, and leans on nothing?"""
        return self.quality is not None and not self.quality.fragile

    @property
    def held(self) -> HoldAnswer:
        """The answer, which knows its grasp."""
        return self.answer if self.answer.grasp else replace(self.answer, grasp=self.grasp)


@dataclass(frozen=True, eq=False)
class Attempts:
    """All that attempts share.

    Attributes:
        loads: what is to be held, the factor of safety included.
        options: no `command_limit` is `STRONG` times the largest load, no `settings` a number of nodes, so that the
            outcome does not hang on the machine.
    """

    hand: Hand
    body: Body
    loads: Loads
    options: PlanOptions = field(default_factory=PlanOptions)

    @cached_property
    def palm(self) -> Palm:
        """Where the hand grasps and which way it approaches."""
        return palm_of(self.hand, self.options.sampling.approach)

    @cached_property
    def held(self) -> Held:
        """The object and what is to be held, for what it takes whatever the hand."""
        limit, torsion = self.options.limits.force_limit, self.options.torsion
        return held_by_contacts(self.body, self.loads, np.inf if limit is None else limit, torsion=torsion)

    @cached_property
    def fewest(self) -> Fewest:
        """How many contacts it takes at least."""
        return self.held.fewest()

    @property
    def impossible(self) -> bool:
        """Is it shown that no grasp of as many contacts as allowed holds?"""
        return self.fewest.most >= (np.inf if self.options.contacts is None else self.options.contacts)

    @property
    def question(self) -> str:
        """The fingerprint of all this."""
        o = self.options
        others = vars(o.limits) | {"palm": self.palm, "sampling": o.sampling}
        if o.limits.loading == "together":
            del others["loading"]
        named = "ignored", "simulate", "contacts", "torsion"
        others |= {name: getattr(o, name) for name in named if getattr(o, name)}
        others |= {"surroundings": o.surroundings.numbers} if o.surroundings else {}
        return fingerprint(self.hand, self.body, self.loads, o.seed, **others)


class Placed(NamedTuple):
    """A hand that was closed, the object's pose (4, 4) in its base frame, and the start from which it closed."""

    closed: Closed
    pose: Array
    start: PreShape


class Runner:
    """Runs attempts; each depends on its number and the seed alone, not on those before it.

    It has the compiled scene and what is worth keeping between attempts.
    """

    def __init__(self, asked: Attempts, until: float = np.inf) -> None:
        """until: when the search has to end, on the monotonic clock."""
        self.asked, self.until = asked, until
        self.scene = Scene(asked.hand, asked.body, asked.options.ignored)
        self.surface = SurfaceSampler(asked.body)
        self.clearance = QuickLook(self.scene)
        around = asked.options.surroundings
        self.ways = WayFinder(self.scene, around) if around else None

    def __getstate__(self) -> dict[str, Any]:
        """For another machine, whose clock is another: the time that is left."""
        return vars(self) | {"until": self.until - time.monotonic()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"until": state["until"] + time.monotonic()})

    def run(self, number: int) -> UnitResult[PlannedGrasp]:
        """The attempt of a number: what became of it, and the grasp if it holds."""
        a, tally = self.asked, Tally()
        rng = np.random.default_rng([a.options.seed, number])
        start = palm_poses.draw(rng, a.hand, a.palm, self.surface, a.options.sampling)
        placed = self.placed(start, rng.exponential(a.options.sampling.back))
        found = self.evaluated(placed, number) if isinstance(placed, Placed) else placed
        if isinstance(found, tuple):
            tally.add(found[0], overlap=found[1])
            return UnitResult(tally, ())
        tally.add(None)
        return UnitResult(tally, (found,))

    def placed(self, start: PreShape, back: float) -> Placed | Dropped:
        """The hand pushed up to the object and closed; or why that gives no grasp."""
        deep = self.clearance.overlaps(start.q)
        for share in CALMER:
            if deep.itself <= PENETRATION:
                break
            start = replace(start, q=palm_poses.calmer(self.asked.palm, start.q, share))
            deep = self.clearance.overlaps(start.q)
        if deep.itself > PENETRATION:
            return _overlap(deep, RejectionReason.INSIDE, RejectionReason.FOLDED)
        pose = palm_poses.pushed(self.scene, start, back)
        if pose is None:
            return RejectionReason.PAST, None
        deep = self.clearance.overlaps(start.q, pose)
        if deep.inside > PENETRATION:
            return _overlap(deep, RejectionReason.INSIDE, RejectionReason.INSIDE)
        if self.ways and self.ways.clearance(start.q, pose) < OBSTACLE_CLEARANCE:
            return RejectionReason.BLOCKED, None
        near = palm_poses.sweeps(self.scene, self.asked.palm.anatomy, start.q, pose)
        if len({self.asked.palm.anatomy.finger(i) for i in np.flatnonzero(near).tolist()}) < 2:
            return RejectionReason.MISSES, None
        try:
            closed, pose = self._closed(start.q, pose)
        except InputError:  # it started deeper in the object than closing allows
            return _overlap(deep, RejectionReason.INSIDE, RejectionReason.INSIDE)
        return Placed(closed, pose, start)

    def evaluated(self, placed: Placed, number: int) -> PlannedGrasp | Dropped:
        """The grasp of a closed hand with a preload that holds all loads, or why it is rejected."""
        a, (closed, pose, start) = self.asked, placed
        if len({a.palm.anatomy.finger(a.hand.link(c.link)) for c in closed.contacts}) < 2:
            return RejectionReason.FEW, None
        deep = self.clearance.overlaps(closed.q, pose)
        inside = max(deep.inside, closed.penetration)
        if max(inside, deep.itself) > PENETRATION:
            return _overlap(deep, RejectionReason.PENETRATES, RejectionReason.PENETRATES)
        grasp = self._grasp(closed, pose, spanning(closed.contacts))
        if grasp.m > (a.options.contacts or np.inf):
            return RejectionReason.MANY, None
        if grasp.m <= a.fewest.most or not balances(grasp, a.loads.wrenches):
            return RejectionReason.UNBALANCED, None
        way = self.ways.way(start.q, closed.q, pose, start.approach) if self.ways else None
        if self.ways and not way:
            return RejectionReason.BLOCKED, None
        actuators = squeezing(grasp, {j for j, why in closed.stopped.items() if why.endswith("touches")})
        if not actuators:
            return RejectionReason.UNDECIDED, None
        search = PreloadSearch(a.body, a.loads, a.options.limits, self.until)
        answer, searched = search.run(grasp, len(closed.contacts), partial(self._grasp, closed, pose), actuators)
        reason = of_verdict(answer.verdict)
        if reason:
            return reason, None
        grasp = grasp.with_preload(answer.preload)
        if search.strength(grasp) > 1:
            return RejectionReason.STRONG, None
        found = PlannedGrasp(closed.q, pose, grasp, answer, inside, deep.itself, number, searched, way=way)
        found = self.firmer(self.measured(found), search)
        if a.options.simulate and not self.simulated(found.grasp, Bodies.of(a.hand, closed.q, a.body, pose)):
            return RejectionReason.SIMULATED, None
        checks = tuple(replace(c, proof=None) for c in found.answer.checks)  # grasps travel between processes
        return replace(found, answer=replace(found.answer, checks=checks))

    def firmer(self, g: PlannedGrasp, search: PreloadSearch) -> PlannedGrasp:
        """A fragile grasp with larger commands under which it is robust; as it is if there are none.

        They hold every load as well, and are within what is allowed and what the hand's file states of its motors.
        """
        if not (g.quality and g.quality.fragile and g.grasp.preload):
            return g
        for level in FIRMER:
            preload = {name: level * f for name, f in g.grasp.preload.items()}
            if any(abs(f) > self.asked.hand.strengths.get(name, np.inf) for name, f in preload.items()):
                break
            answer = search.under(g.grasp, g.answer, level)
            if answer and not leans_on(answer, self.asked.options, g.quality.weakest):
                firm = replace(g, grasp=g.grasp.with_preload(preload), answer=answer)
                found = self.measured(firm, g.quality.weakest)
                if found.robust:
                    return found
        return g

    def simulated(self, grasp: Grasp, bodies: Bodies) -> bool:
        """Does the dynamics engine hold every load, without the factor of safety?"""
        for wrench in self.asked.loads.wrenches:
            try:
                found = simulate_bodies(grasp, wrench / self.asked.options.safety, bodies=bodies)
            except InputError:  # the engine has no model of this hand and object
                return False
            if found.ending is not Ending.HOLDS:
                return False
        return True

    def measured(self, g: PlannedGrasp, robust_under: str = "") -> PlannedGrasp:
        """A grasp with its margins and its quality, see there; as it is if there is no time."""
        o = self.asked.options
        answer = with_margins(g.held, o, self.until)
        if not answer.margins and answer.loads.wrenches.any():
            return g
        clearance = self.clearance.clearance(g.q, g.pose, but=[str(c.link) for c in g.grasp.contacts])
        clearance = min(clearance, self.ways.clearance(g.q, g.pose)) if self.ways else clearance
        return replace(g, answer=answer, quality=quality(answer, o, round(clearance, CLEARANCE_DIGITS), robust_under))

    def _grasp(self, closed: Closed, pose: Array, contacts: Sequence[Contact]) -> Grasp:
        """The grasp of a closed hand with some of its contacts."""
        a = self.asked
        name = f"{a.hand.name} on {a.body.name}"
        contacts = [replace(c, torsion=a.options.torsion) for c in contacts] if a.options.torsion else contacts
        return of_body(grasp_of(a.hand, closed.q, contacts, pose, name=name), a.hand, a.body)

    def _closed(self, q: Array, pose: Array) -> tuple[Closed, Array]:
        """The hand closed, and where the object then is.

        A finger that is tied to one that touched has stopped short of the object, as one jaw of a gripper does.
        The first would push the object on to the other: it is moved by half the gap, and the hand closed again.
        """
        hand, finger = self.asked.hand, self.asked.palm.anatomy.finger
        for _ in range(PUSHES):
            closed = close(hand, q, self.asked.body, pose, scene=self.scene)
            tied = set().union(*(self._across(name, why) for name, why in closed.stopped.items()))
            tied -= {finger(hand.link(name)) for name in closed.touching}
            links = {i for i in range(len(hand.links)) if finger(i) in tied}
            gaps = (
                [n for n in self.scene.nearest(closed.q, pose, palm_poses.PALM_CUTOFF) if n.link in links]
                if links
                else []
            )
            short = min(gaps, key=lambda n: n.distance, default=None)
            if short is None or short.distance <= THRESHOLD:
                break
            pose = pose.copy()
            pose[:3, 3] -= short.distance / 2 * short.normal
        return closed, pose

    def _across(self, name: str, why: str) -> set[int]:
        """The fingers of the joint of a name if it stopped because one of other fingers did, else none."""
        hand = self.asked.hand
        if not why.startswith("follows "):
            return set()
        own = self._fingers(hand.joint(name))
        return set() if own & self._fingers(hand.joint(why.removeprefix("follows "))) else own

    def _fingers(self, joint: int) -> set[int]:
        """Of the links that a joint moves; what a loop ties together is one finger."""
        hand = self.asked.hand
        return {self.asked.palm.anatomy.finger(i) for i in range(len(hand.links)) if joint in hand.moved_by(i)}


def _overlap(deep: Overlaps, inside: RejectionReason, itself: RejectionReason) -> Dropped:
    """Which of two reasons it is, and what is deepest in what."""
    if deep.itself > deep.inside:
        return itself, (deep.pair, deep.itself)
    return inside, ((deep.link, OBJECT_NAME), deep.inside) if deep.link else None


def squeezing(grasp: Grasp, stopped: set[str]) -> tuple[str, ...]:
    """The actuators of joints that a touch stopped, or that are coupled to one: those whose command squeezes."""
    touched = np.array([j.name in stopped for j in grasp.joints])
    for _ in grasp.mechanism.A:  # a coupled joint may itself be coupled further
        for row in grasp.mechanism.A != 0:
            touched |= row & (row & touched).any()
    rows = grasp.mechanism.R
    return tuple(n for n, row in zip(grasp.mechanism.actuators, rows, strict=True) if (row[touched] != 0).any())
