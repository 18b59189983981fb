"""What `grasp_for` answers: grasps with all their proofs, ranked, and what became of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Reach, Stop, header
from handfast.core.arrays import Array
from handfast.core.presented import Presented
from handfast.geometry.collision import Clearances
from handfast.geometry.dexterity import Dexterity
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.evaluator import Derived
from handfast.planning.evaluation.local_search import Strength
from handfast.planning.joined_search import JoinedSearched
from handfast.planning.load_bound import BoundSearched
from handfast.planning.no_balance import BalanceSearched
from handfast.planning.question import Requirements
from handfast.planning.ranking import rank
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps_file import ObjectEntry, SavedGrasp, SavedGrasps
from handfast.planning.results.search_file import COUNTED_REASONS, SavedSearch
from handfast.planning.results.verify import verify
from handfast.planning.search import Tally
from handfast.proofs.replay import Replay
from handfast.proofs.states import State
from handfast.readers import grasp_file
from handfast.stability.answers import CheckAnswer
from handfast.stability.answers.answer import finite
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.hold import HoldAnswer
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import Task


@dataclass(frozen=True, eq=False)
class ProvedGrasp(Presented):
    """A configuration that exists, is free of collision, and holds every load.

    Attributes:
        solution: the configuration of synthesis with its proof.
        q: (l,) all joints [rad, m], those of non-contacting fingers placed.
        grasp: at the certified contacts, object frame, with the preload in force.
        answer: the preload and a witness for each load.
        requirements: friction, actuators and limits, as asked.
        clearances: to the object and of the hand to itself.
        curvatures: (b,) [1/m] relative curvature at the contacts, negative where they curve into each other.
        dexterity: manipulability and distance to the joint limits.
        friction_margin: share of the friction without which forces could still balance every load.
        repaired: was it improved from a start that did not hold?
        strength: how many times all loads the preload holds, with an answer for each; None where that was not asked.
        score: mean rank share among the grasps of one answer, 1 for one that is best in everything.
    """

    solution: Solution
    q: Array
    grasp: Grasp
    answer: HoldAnswer
    requirements: Requirements
    clearances: Clearances
    curvatures: Array
    dexterity: Dexterity
    friction_margin: float
    repaired: bool
    strength: Strength | None = None
    score: float = 0.0

    @property
    def pose(self) -> Array:
        """(4, 4) of the object in the palm frame."""
        return self.solution.pose

    @property
    def command(self) -> float:
        """The largest command [N m or N]."""
        return self.answer.upper

    @cached_property
    def terms(self) -> dict[str, float]:
        """What grasps are ranked by: see `BETTER`, and `rank`."""
        c, d = self.clearances, self.dexterity
        return {
            "command": self.command,
            "friction_margin": self.friction_margin,
            "clearance": min(c.least_to_object, c.least_between),
            "from_limits": d.least_from_limits,
            "manipulability": d.manipulability,
        }

    @property
    def configuration(self) -> Configuration:
        """As a `handfast/configuration/1` file, with the preload."""
        task = self.solution.task
        named = {"hand": task.hand.source or task.hand.name, "object": task.object}
        return Configuration.of(task.hand, self.q, self.pose, preload=self.grasp.preload or None, **named)

    @property
    def fragile(self) -> bool:
        """Do two point contacts balance the loads, which they do only at exactly this placement?"""
        return len(self.grasp.contacts) == 2 and not len(self.grasp.soft)

    @property
    def derived(self) -> Derived:
        """What is said of it that its proofs, preload and loads alone give: a replay computes it again."""
        preload = self.answer.preload or {}
        return Derived(self.configuration, preload, self.friction_margin, self.curvatures, self.dexterity)

    @property
    def noted(self) -> dict[str, Any]:
        """What the search says of it, and no replay can: shapes, other grasps and certificates are not at hand."""
        return {
            "score": self.score,
            "factor": self.strength.factor if self.strength else None,
            "repaired": self.repaired,
            "fragile": self.fragile,
            "lower": finite(self.answer.lower),
            "residual": max((a.proved.residual for a in self.answer.checks if a.proved), default=None),
            "clearances": self.clearances.to_json(),
        }

    @property
    def saved(self) -> SavedGrasp:
        """As a file holds it."""
        witnesses = self._states(self.answer.checks)
        strength = (self.strength.factor, self._states(self.strength.checks)) if self.strength else None
        said = grasp_file.to_dict(self.grasp)
        joints = self.solution.task.hand.values(self.q)
        return SavedGrasp(self.solution, joints, self.grasp, said, witnesses, self.derived.to_json(), strength)

    def _states(self, checks: Sequence[CheckAnswer]) -> dict[str, State]:
        return {name: a.witness.state for name, a in zip(self.answer.loads.names, checks, strict=True) if a.witness}

    def to_json(self) -> dict[str, Any]:
        """The keys that the command line prints for it."""
        return self.noted | self.derived.to_json()


@dataclass(frozen=True, eq=False)
class Grasps(Presented):
    """From regions to grasps.

    Attributes:
        task, body, loads: as asked. count: how many grasps were asked for. seed: of the random starts.
        verdict: FOUND with at least one; NONE if no contact forces balance the loads wherever in the regions the
            contacts are, if every configuration is discarded for one reason or another, as that it collides, or if the
            hand cannot bring the regions together at all; else UNDECIDED.
        stop: why the search ended. seconds: wall time after start-up.
        grasps: best first.
        tally: what became of the certified random starts.
        evaluated: configurations that were looked at, steps included. starts, unproved: of the local search.
        synthesis: the answer behind NONE, or behind an UNDECIDED where no start was ever certified.
        balance: how far the proof has come that no contact forces balance the loads; None with a grasp.
        joined: how far the proof has come that every configuration is discarded; None with a grasp, or not begun.
        requirements: friction, actuators and limits, as asked.
        search: how far it has come, to go on from.
        bound: so many times the loads no placement of the contacts holds; None unless the best was asked for, and
            where a limit of the contact forces is missing.
    """

    task: Task = field(repr=False)
    body: Body
    loads: Loads
    count: int
    seed: int
    verdict: Reach
    stop: Stop
    seconds: float
    grasps: tuple[ProvedGrasp, ...]
    tally: Tally
    evaluated: int
    starts: int
    unproved: int
    synthesis: Synthesis | None = field(default=None, repr=False)
    balance: BalanceSearched | None = field(kw_only=True)
    joined: JoinedSearched | None = field(default=None, kw_only=True)
    requirements: Requirements = field(kw_only=True, repr=False)
    search: SavedSearch = field(kw_only=True, repr=False)
    bound: BoundSearched | None = field(default=None, kw_only=True)

    @property
    def nodes(self) -> int:
        """Of the searches that hold the grasps."""
        return sum(g.answer.nodes for g in self.grasps)

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return self.noted | {"loads": self.loads.by_name, "grasps": [g.to_json() for g in self.grasps]}

    @property
    def proof_of_none(self) -> Mapping[str, Any] | None:
        """That there is no grasp, by forces alone or joined with other reasons, for files; None if it is not shown."""
        searched = self.balance, self.joined
        return next((s.proof for s in searched if s is not None and s.proof is not None), None)

    @property
    def noted(self) -> dict[str, Any]:
        """The account of the search: verdict, stop, cost, and what became of the starts."""
        return header(self, "grasp") | {
            "seed": self.seed,
            "starts": self.starts,
            "unproved": self.unproved,
            "judged": self.evaluated,
            "fates": self.tally.to_json("holds", COUNTED_REASONS),
            "balance": self.balance.to_json() if self.balance else None,
            "bound": self.bound.to_json() if self.bound else None,
            "joined": self.joined.to_json() if self.joined else None,
        }

    @property
    def saved(self) -> SavedGrasps:
        """As a `handfast/grasps/1` file holds it."""
        mass, center = self.body.mass, np.asarray(self.body.center_of_mass, dtype=float).tolist()
        thing = ObjectEntry(name=self.body.name, mass=None if mass is None else float(mass), center_of_mass=center)
        record = {k: v for k, v in self.noted.items() if k not in ("schema", "query", "verdict")}
        record |= {"count": self.count, "grasps": [g.noted for g in self.grasps]}
        saved = [g.saved for g in self.grasps]
        none = self.proof_of_none
        proofs = {"none": none, "bound": self.bound.proof if self.bound and saved else None}
        proofs["solids"] = self.joined.solids if self.joined and none is self.joined.proof else None
        return SavedGrasps.of(self.task, thing, self.loads, self.requirements, self.verdict, saved, record, **proofs)

    def verify(self) -> Replay:
        """Everything that is proved of the grasps, checked again without any search, see `results.verify`."""
        return verify(self.saved)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/grasps/1` file, for `handfast verify`.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        grasps_file.save_grasps(self.saved, path, force=force)


def ranked(grasps: Sequence[ProvedGrasp]) -> tuple[ProvedGrasp, ...]:
    """Best first, with their scores; those that hold the largest multiple of the loads, where that was asked."""
    scores = rank([g.terms for g in grasps])
    scored = [replace(g, score=s) for g, s in zip(grasps, scores, strict=True)]
    return tuple(sorted(scored, key=lambda g: (-g.strength.factor if g.strength else 0.0, -g.score)))
