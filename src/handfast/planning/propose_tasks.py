"""Propose tasks: which regions of an object a hand could touch for a pinch, a tripod or a power grasp.

The synthesis paper takes the regions as given and leaves their choice open. This is a heuristic for that choice. What
it proposes is then solved, so that a proposal that is FOUND has a certified configuration; what it does not propose may
be possible all the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Reach
from handfast.core.arrays import Array
from handfast.core.errors import kinds_checked, refuse_other_kinds
from handfast.core.files import refuse_existing
from handfast.core.presented import Presented
from handfast.geometry.guess_regions import regions_of
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegions
from handfast.planning.candidates.region_candidates import Kind, RegionCandidate, find_candidates
from handfast.planning.filters.non_contacting import placed, postures
from handfast.planning.filters.quick_look import QuickLook
from handfast.planning.no_balance import NoBalance
from handfast.planning.question import refuse_negative, refuse_no_positive
from handfast.planning.search import RejectionReason, Tally
from handfast.stability.problem.loads import Loads
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.starts import Starts
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from handfast.synthesis.task_file import save_task
from handfast.synthesis.task_problem import TaskProblem

CONFIGURATION_TRIES = 24  # certified configurations of a candidate from which the clearest is taken
# [m, -] the task's bounds on the object's position and on the components of its axes about that
TASK_POSE_BOUNDS = 0.03, 0.25
MIN_CLEARANCE = -1e-3  # [m] a clearance above this: regions and patches lie this near to the shapes
PROPOSAL_SETS = 16  # sets of places that are looked at closely for each proposal that is asked for
PER_PROPOSAL = 6  # candidates that are tried for each proposal that is asked for
NEAR_POSE_BOUNDS = 0.06, 0.5  # [m, -] such bounds about the pose at which a hand shape came near
BALANCE_BOXES = 192  # of placements, in which it is looked whether no forces balance the loads
ENOUGH_CLEARANCE = -3e-4  # [m] a clearance above this is not improved upon

OnStep = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class ProposeOptions:
    """Options of `propose`.

    Attributes:
        count: of proposals.
        seed: of everything that is drawn; the same seed gives the same proposals, unless a time limit interferes.
        timeout: [s] of synthesis for each candidate.
        friction: coefficient; None for the object's.
        object: name or path of the object, for the tasks.
        unbalanced: try regions, too, where no contact forces balance the object's weight from all six axis directions,
            which is shown; where its mass is unknown, they are tried anyway.

    Raises:
        InputError: a count or a time that is not positive, a negative seed.
    """

    count: int = 5
    seed: int = 0
    timeout: float = 1.0
    friction: float | None = None
    object: str | None = None
    unbalanced: bool = False

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        refuse_no_positive({"count": self.count, "timeout": self.timeout})
        refuse_negative(self.seed)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A task that was proposed, and what synthesis says to it.

    Attributes:
        task: regions of the hand and of the object, and bounds on the object's pose.
        answer: of `synthesize`, FOUND.
        names: of the hand regions, in the order of the task's contacts.
        score: see `RegionCandidate`, like margin and off_centre.
        margin: of the balance of forces at the middles of the object regions, up to 1.
        off_centre: [m] from the centre of mass to the middle of the object regions.
        clearance: [m] least signed distance between hand and object, and between links, at the configuration found;
            contacts count, so it is about 0 at best.
        error: [m] largest distance of an object region from the mesh.
    """

    task: Task
    answer: Synthesis
    names: tuple[str, ...]
    score: float
    margin: float
    off_centre: float
    clearance: float
    error: float

    @property
    def clear(self) -> bool:
        """Does the configuration cut into nothing, up to the error of the regions?"""
        return self.clearance > MIN_CLEARANCE

    def to_json(self) -> dict[str, Any]:
        measured = ("score", "margin", "off_centre", "clearance", "error")
        return {
            "name": self.task.name,
            "verdict": str(self.answer.verdict),
            "regions": list(self.names),
            "clear": self.clear,
            **{name: float(getattr(self, name)) for name in measured},
            "seconds": self.answer.seconds,
        }


@dataclass(frozen=True, eq=False)
class Proposals(Presented):
    """Ranked proposals: those that cut into nothing first, then by score.

    Attributes:
        hand, object: names.
        kind: of grasp.
        proposals: certified ones only, at most as many as were asked for.
        tally: what became of the others.
        tried: candidates that were put to synthesis.
        seconds: wall time.
    """

    hand: str
    object: str
    kind: Kind
    proposals: tuple[Proposal, ...]
    tally: Tally
    tried: int
    seconds: float

    def to_json(self) -> dict[str, Any]:
        return {
            "schema": "handfast/proposals/1",
            "hand": self.hand,
            "object": self.object,
            "kind": self.kind,
            "tried": self.tried,
            "seconds": self.seconds,
            "proposals": [p.to_json() for p in self.proposals],
            "dropped": self.tally.examples(),
        }

    def save(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write each task as FOLDER/<name>.json; returns the files.

        Raises:
            InputError: one of them exists and `force` is not set, or the hand was not loaded from a file.
        """
        files = [Path(folder) / f"{p.task.name}.json" for p in self.proposals]
        for file in files:
            refuse_existing(file, force=force)
        for file, proposal in zip(files, self.proposals, strict=True):
            save_task(proposal.task, file, force=force)
        return files


@kinds_checked
def propose(
    hand: Hand,
    regions: HandRegions | None,
    body: Body,
    kind: Kind = "pinch",
    *,
    options: ProposeOptions | None = None,
    on_progress: OnStep | None = None,
    **changes: Any,
) -> Proposals:
    """Tasks in which a hand holds an object with a kind of grasp, each with a certified configuration.

    A heuristic: see the page on regions for what it looks at and what it can miss.

    Args:
        regions: the hand's; None takes the bundled ones or guesses (`regions_of`).
        kind: "pinch", "tripod" or "power".
        options: see `ProposeOptions`.
        on_progress: called with a line of text while it runs.
        changes: options by name, in place of those of `options`: `propose(hand, None, body, count=3)`.

    Raises:
        InputError: an unknown kind, a count below 1, a timeout or friction that is not positive, a region on a
            link that the hand does not have, too few regions for the kind.
    """
    o, clock = replace(options or ProposeOptions(), **changes), time.monotonic()
    regions, count = regions or regions_of(hand), o.count
    trial = _Trial(hand, body, o)
    candidates, tally = find_candidates(
        trial.look, regions, body, kind, trial.friction, seed=o.seed, short=PROPOSAL_SETS * count
    )
    most = PER_PROPOSAL * count
    for n, candidate in enumerate(candidates):
        if sum(p.clear for p in trial.found) == count:
            tally.add(
                RejectionReason.NOT_TRIED, min(most - trial.tried, len(candidates) - n), "enough were found before"
            )
            break
        if trial.tried == most:
            break
        trial.run(candidate)
        if on_progress:
            on_progress(
                f"{trial.tried} of at most {min(most, len(candidates))} candidates, {len(trial.found)} certified"
            )
    best = sorted(trial.found, key=lambda p: (not p.clear, -p.score))
    tally.add(RejectionReason.CERTIFIED_BEHIND, len(best) - min(len(best), count))
    tally.add_all(trial.tally)
    named = tuple(
        replace(p, task=replace(p.task, name=f"{body.name}-{kind}-{k}")) for k, p in enumerate(best[:count], 1)
    )
    return Proposals(hand.name, body.name, kind, named, tally, trial.tried, time.monotonic() - clock)


class _Trial:
    """Candidates made into tasks and solved, one after the other."""

    def __init__(self, hand: Hand, body: Body, options: ProposeOptions) -> None:
        self.hand, self.body, self.options = hand, body, options
        self.loads = None if body.mass is None or options.unbalanced else Loads.gravity(body)
        self.friction = body.friction if options.friction is None else options.friction
        self.look = QuickLook(Scene(hand, body))
        self.found: list[Proposal] = []
        self.tried, self.tally = 0, Tally()

    def run(self, candidate: RegionCandidate) -> None:
        """Solve, and keep or reject."""
        names = tuple(r.name for r in candidate.regions)
        pairs = tuple(
            ContactPair(r.link, r.region, p.patch) for r, p in zip(candidate.regions, candidate.places, strict=True)
        )
        task = Task.of(self.hand, pairs, object=self.options.object)
        if self._unbalanced(task):
            self.tally.add(RejectionReason.UNBALANCED, 1, ", ".join(names))
            return
        self.tried += 1
        task = self._about(task, candidate.pose)
        answer = synthesize(task, seed=self.options.seed, timeout=self.options.timeout)
        if answer.verdict is not Reach.FOUND:
            reason = RejectionReason.UNREACHABLE if answer.verdict is Reach.NONE else RejectionReason.UNREACHED
            self.tally.add(reason, 1, ", ".join(names))
            return
        c, (solution,) = candidate, answer.solutions
        error = max(p.error for p in c.places)
        clearance = self.look.clearance(solution.q, solution.pose)
        self.found.append(Proposal(task, answer, names, c.score, c.margin, c.off_centre, clearance, error))

    def _unbalanced(self, task: Task) -> bool:
        """Is it shown that no contact forces balance the loads, wherever in the regions the contacts are?"""
        if self.loads is None:
            return False
        center = np.asarray(self.body.center_of_mass, dtype=float)
        search = NoBalance(task, self.loads, self.friction, center=center, seed=self.options.seed)
        search.run(BALANCE_BOXES)
        return search.shown

    def _about(self, task: Task, pose: Array) -> Task:
        """The task with bounds about the clearest of some configurations; as it is if none is found quickly.

        They are sought near a pose of the object first, then anywhere.
        """
        links = [t.link for t in task.contact_pairs]
        best: tuple[float, Task] | None = None
        for asked in (_bounded(task, pose, NEAR_POSE_BOUNDS, {}), task):
            problem = TaskProblem.of(asked)
            for c in Starts(problem, self.options.seed).run(CONFIGURATION_TRIES):
                solution = Solution.of(asked, c.existence(problem))
                for values in postures(self.hand, links):
                    clearance = self.look.clearance(placed(self.hand, solution.q, values), solution.pose)
                    if best is None or clearance > best[0] + 1e-5:
                        best = clearance, _bounded(task, solution.pose, TASK_POSE_BOUNDS, values)
                if best and best[0] > ENOUGH_CLEARANCE:
                    return best[1]
        return best[1] if best else task


def _bounded(task: Task, pose: Array, window: tuple[float, float], limits: dict[str, float]) -> Task:
    """The task with the object's pose bounded about one and some joints fixed."""
    position = pose[:3, 3].round(3)
    axes = (pose[:3, :3].T.round(3)[..., None] + [-window[1], window[1]]).round(3)
    bounds = PoseBounds((position[:, None] + [-window[0], window[0]]).round(3), np.clip(axes, -1, 1))
    fixed = {name: (value, value) for name, value in limits.items()}
    return Task.of(task.hand, task.contact_pairs, limits=fixed, pose=bounds, object=task.object)
