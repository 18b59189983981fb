"""One attempt at a grasp: a random start, push up, close, and every reason why it may be dropped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.geometry.collision import always_meeting
from handfast.geometry.contacts import THRESHOLD, contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, Palm, Sampling, Surface
from handfast.planning.closing import Closed, close
from handfast.planning.filters.balance import balances
from handfast.planning.question import fingerprint
from handfast.stability.hold import STRONG, HoldAnswer, hold
from handfast.stability.loads import Loads
from handfast.stability.settings import Settings

PENETRATION = 1e-3  # [m] what may at most overlap, hand with object or with itself
PUSHES = 4  # of the object by a finger, at most
NODES = 250_000  # of a query of one contact; a node's cost grows with the cube of the contacts
PATIENCE = 30.0  # [s] for all queries about a grasp: a fuse, the nodes end them much earlier


class Fate(StrEnum):
    """What became of an attempt; all but the first are reasons to drop it."""

    KEPT = "kept"
    PAST = "passed the object by"
    INSIDE = "started with the hand in the object or in itself"
    MISSES = "would miss, as a few steps of closing show (heuristic)"
    FEW = "touches with fewer than two fingers or a finger and the palm"
    PENETRATES = "penetrates by more than 1 mm"
    UNBALANCED = "no contact forces balance a load (shown)"
    SLIPS = "no preload resists a load (shown)"
    UNDECIDED = "no preload was found"
    STRONG = "needs larger commands than allowed"
    ALIKE = "like one that was kept"


@dataclass(frozen=True, eq=False)
class Held:
    """A hand around an object that holds its loads.

    Attributes:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame.
        grasp: with the preload in force, object frame.
        answer: what `hold` says, a witness for each load.
        penetration: [m] largest overlap of hand and object, 0 if none; self_penetration: of two links.
        index: number of the attempt, which with the seed reproduces it.
    """

    q: Array
    pose: Array
    grasp: Grasp
    answer: HoldAnswer
    penetration: float
    self_penetration: float
    index: int


@dataclass(frozen=True, eq=False)
class Attempts:
    """All that attempts share. `run(i)` depends on i and the seed alone, not on the attempts before it.

    Attributes:
        loads: what is to be held. command_limit: largest command [N m, N]; None for `STRENGTH`.
        torque_limits, force_limit, eta: as in `hold`.
        sampling: of the starts.
        settings: of each query; by default a number of nodes, so that the outcome does not hang on the machine.
    """

    hand: Hand
    body: Body
    palm: Palm
    loads: Loads
    seed: int
    command_limit: float | None = None
    torque_limits: Mapping[str, float] | None = None
    force_limit: float | None = None
    eta: float = 0.0
    settings: Settings | None = None
    sampling: Sampling = STANDARD

    @property
    def question(self) -> str:
        """The fingerprint of all this."""
        names = ("palm", "command_limit", "torque_limits", "force_limit", "eta", "sampling", "settings")
        others = {name: getattr(self, name) for name in names}
        return fingerprint(self.hand, self.body, self.loads, self.seed, **others)

    def settings_for(self, grasp: Grasp) -> Settings:
        """Of a query about a grasp."""
        return self.settings or Settings(node_limit=NODES / grasp.m**3)

    def begin(self) -> Runner:
        """A runner, with what cannot travel between processes."""
        return Runner(self)


class Runner:
    """Attempts in one process: the compiled scene and what is worth keeping between attempts."""

    def __init__(self, asked: Attempts) -> None:
        self.asked = asked
        self.scene = Scene(asked.hand, asked.body)
        self.surface = Surface(asked.body)
        apart = set(self.scene.self_pairs) - set(always_meeting(self.scene))
        self.watched = np.array([pair in apart for pair in self.scene.self_pairs], dtype=bool)

    def run(self, index: int) -> tuple[Fate, Held | None]:
        """The attempt of a number: what became of it, and the grasp if it holds."""
        a = self.asked
        rng = np.random.default_rng([a.seed, index])
        start = palm_poses.draw(rng, a.hand, a.palm, self.surface, a.sampling)
        pose = palm_poses.pushed(self.scene, start, rng.exponential(a.sampling.back))
        if pose is None:
            return Fate.PAST, None
        if max(self._depths(start.q, pose)) > PENETRATION:
            return Fate.INSIDE, None
        near = palm_poses.sweeps(self.scene, start.q, pose)
        if len({self._finger(a.hand.link_names[i]) for i in np.flatnonzero(near)}) < 2:
            return Fate.MISSES, None
        try:
            closed, pose = self._closed(start.q, pose)
        except InputError:  # it started deeper in the object than closing allows
            return Fate.INSIDE, None
        if len({self._finger(c.link) for c in closed.contacts}) < 2:
            return Fate.FEW, None
        inside, itself = self._depths(closed.q, pose)
        inside = max(inside, closed.penetration)
        if max(inside, itself) > PENETRATION:
            return Fate.PENETRATES, None
        grasp = contact_grasp(a.hand, closed.q, a.body, pose, scene=self.scene)
        if not all(balances(grasp, w) for w in a.loads.wrenches):
            return Fate.UNBALANCED, None
        drivers = driven(grasp, {j for j, why in closed.stopped.items() if why.endswith("touches")})
        if not drivers:
            return Fate.UNDECIDED, None
        answer = hold(
            grasp,
            a.loads,
            actuators=drivers,
            least=False,
            torque_limits=a.torque_limits,
            force_limit=a.force_limit,
            eta=a.eta,
            settings=a.settings_for(grasp),
            timeout=PATIENCE,
        )
        if answer.verdict is not Verdict.HOLDS:
            return Fate.SLIPS if answer.verdict is Verdict.SLIPS else Fate.UNDECIDED, None
        if self._strength(grasp.with_preload(answer.preload)) > 1:
            return Fate.STRONG, None
        grasp = grasp.with_preload(answer.preload)
        return Fate.KEPT, Held(closed.q, pose, grasp, answer, inside, itself, index)

    def _closed(self, q: Array, pose: Array) -> tuple[Closed, Array]:
        """The hand closed, and where the object then is.

        A finger that is tied to one that touched has stopped short of the object, as one jaw of a gripper does.
        The first would push the object on to the other: it is moved by half the gap, and the hand closed again.
        """
        hand = self.asked.hand
        for _ in range(PUSHES):
            closed = close(hand, q, self.asked.body, pose, scene=self.scene)
            tied = [self._across(name, why) for name, why in closed.stopped.items()]
            links = {i for i in range(len(hand.links)) if any(j in hand.moved_by(i) for j in tied)}
            gaps = [n for n in self.scene.nearest(closed.q, pose, palm_poses.FAR) if n.link in links] if links else []
            short = min(gaps, key=lambda n: n.distance, default=None)
            if short is None or short.distance <= THRESHOLD:
                break
            pose = pose.copy()
            pose[:3, 3] -= short.distance / 2 * short.normal
        return closed, pose

    def _across(self, name: str, why: str) -> int | None:
        """The joint of a name if it stopped because one of another finger did, else None."""
        hand = self.asked.hand
        if not why.startswith("follows "):
            return None
        j, leader = hand.joint(name), hand.joint(why.removeprefix("follows "))
        chains = (hand.moved_by(i) for i in range(len(hand.links)))
        return None if any(j in c and leader in c for c in chains) else j

    def _strength(self, grasp: Grasp) -> float:
        """The largest command, as a share of what is allowed: a force for sliding joints and tendons, else a torque."""
        a, mechanism = self.asked, grasp.mechanism
        if a.command_limit is not None:
            return float(np.abs(grasp.command).max(initial=0.0)) / a.command_limit
        w = a.loads.wrenches
        load = float((np.linalg.norm(w[:, :3], axis=1) + np.linalg.norm(w[:, 3:], axis=1) / grasp.size).max())
        turns = np.array([joint.type == "revolute" for joint in grasp.joints])
        torque = (mechanism.R[:, turns] != 0).any(axis=1) & ~np.array(mechanism.tendon, dtype=bool)
        return float(np.max(np.abs(grasp.command) / np.where(torque, grasp.size, 1.0), initial=0.0)) / (STRONG * load)

    def _depths(self, q: Array, pose: Array) -> tuple[float, float]:
        """Largest overlap [m] of hand and object, and of two links, 0 if none."""
        links, meetings = self.scene.clearances(q, pose)
        return max(0.0, -links.min()), max(0.0, -meetings[self.watched].min(initial=0.0))

    def _finger(self, link: str) -> int:
        """Fingers are told apart by the joint next to the base; -1 is the palm."""
        return (self.asked.hand.moved_by(self.asked.hand.link(link)) or (-1,))[0]


def driven(grasp: Grasp, stopped: set[str]) -> tuple[str, ...]:
    """The actuators of joints that a touch stopped, or that are coupled to one: those whose command squeezes."""
    touched = np.array([j.name in stopped for j in grasp.joints])
    for _ in grasp.mechanism.A:  # a coupled joint may itself be coupled further
        for row in grasp.mechanism.A != 0:
            touched |= row & (row & touched).any()
    rows = grasp.mechanism.R
    return tuple(n for n, row in zip(grasp.mechanism.actuators, rows, strict=True) if (row[touched] != 0).any())
