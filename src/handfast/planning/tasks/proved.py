"""What `grasp_for` answers: grasps with all their proofs, ranked, and what became of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Reach, Stop, header
from handfast.core.arrays import Array
from handfast.geometry.collision import Clearances
from handfast.geometry.dexterity import Dexterity
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.planning.tasks.asked import Asked
from handfast.planning.tasks.follows import Follows
from handfast.planning.tasks.judge import Reason
from handfast.stability.answers import finite
from handfast.stability.hold import HoldAnswer
from handfast.stability.loads import Loads
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import Task

BETTER = {"command": -1, "spare_friction": 1, "clearance": 1, "from_limits": 1, "manipulability": 1}


@dataclass(frozen=True, eq=False)
class ProvedGrasp:
    """A configuration that exists, is free of collision, and holds every load.

    Attributes:
        solution: the configuration of synthesis with its proof.
        q: (l,) all joints [rad, m], unused fingers placed.
        grasp: at the certified contacts, object frame, with the preload in force.
        answer: the preload and a witness for each load.
        clearances: to the object and of the hand to itself.
        curvatures: (b,) [1/m] relative curvature at the contacts, negative where they curve into each other.
        dexterity: manipulability and distance to the joint limits.
        spare_friction: share of the friction without which forces could still balance every load.
        repaired: was it improved from a start that did not hold?
        score: mean rank share among the grasps of one answer, 1 for one that is best in everything.
    """

    solution: Solution
    q: Array
    grasp: Grasp
    answer: HoldAnswer
    clearances: Clearances
    curvatures: Array
    dexterity: Dexterity
    spare_friction: float
    repaired: bool
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
            "spare_friction": self.spare_friction,
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
    def follows(self) -> Follows:
        """What is said of it that its proofs, preload and loads alone give: a replay computes it again."""
        preload = self.answer.preload or {}
        return Follows(self.configuration, preload, self.spare_friction, self.curvatures, self.dexterity)

    @property
    def noted(self) -> dict[str, Any]:
        """What the search says of it, and no replay can: shapes, other grasps and certificates are not at hand."""
        return {
            "score": self.score,
            "repaired": self.repaired,
            "lower": finite(self.answer.lower),
            "residual": max((a.witness.residuals.worst for a in self.answer.checks if a.witness), default=None),
            "clearances": self.clearances.to_json(),
        }

    def to_json(self) -> dict[str, Any]:
        """The keys that the command line prints for it."""
        return self.noted | self.follows.to_json()


@dataclass(frozen=True, eq=False)
class Grasps:
    """From regions to grasps.

    Attributes:
        task, body, loads: as asked. count: how many grasps were asked for. seed: of the random starts.
        verdict: FOUND with at least one; NONE if the hand cannot bring the regions together at all; else
            UNDECIDED.
        stop: why the search ended. seconds: wall time after start-up.
        grasps: best first.
        fates: what became of the certified random starts; the sum is their number.
        judged: configurations that were looked at, steps included. starts, unproved: of the local search.
        synthesis: the answer behind NONE, or behind an UNDECIDED where no start was ever certified.
        asked: friction, actuators and limits, as asked.
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
    fates: Mapping[Reason, int]
    judged: int
    starts: int
    unproved: int
    synthesis: Synthesis | None = field(default=None, repr=False)
    asked: Asked = field(kw_only=True, repr=False)

    @property
    def fates_total(self) -> int:
        """Certified starts that were judged."""
        return sum(self.fates.values())

    @property
    def nodes(self) -> int:
        """Of the searches that hold the grasps."""
        return sum(g.answer.nodes for g in self.grasps)

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        return self.noted | {"loads": self.loads.by_name, "grasps": [g.to_json() for g in self.grasps]}

    @property
    def noted(self) -> dict[str, Any]:
        """The account of the search: verdict, stop, cost, and what became of the starts."""
        return header(self, "grasp") | {
            "seed": self.seed,
            "starts": self.starts,
            "unproved": self.unproved,
            "judged": self.judged,
            "fates": {r.name.lower(): n for r, n in self.fates.items()},
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/grasps/2` file, for `handfast verify`.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        from handfast.planning.tasks import grasps_file

        grasps_file.save_grasps(self, path, force=force)


def rank(grasps: Sequence[ProvedGrasp]) -> list[float]:
    """A score for each of some grasps: its mean rank share over the terms, 1 best, equal ones alike.

    Every term counts the same, in ranks rather than amounts, so that no unit has to be weighed against
    another: the largest command (smaller is better), the spare friction, the clearance, the distance to the
    joint limits and the manipulability (larger is better).
    """
    if len(grasps) < 2:
        return [1.0] * len(grasps)
    shares = []
    for name, sense in BETTER.items():
        x = sense * np.array([g.terms[name] for g in grasps])
        worse = (x[None] < x[:, None]).sum(axis=1)
        better = (x[None] > x[:, None]).sum(axis=1)
        shares.append((worse + (len(x) - 1 - worse - better) / 2) / (len(x) - 1))
    return np.mean(shares, axis=0).tolist()
