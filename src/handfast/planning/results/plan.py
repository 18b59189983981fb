"""What `plan` answers: the grasps that were found, and what became of the other attempts."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from pydantic import ConfigDict, Field

from handfast.core.answer import Reach, Stop, Verdict, header
from handfast.core.files import Strict
from handfast.core.presented import Presented
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.planning.evaluation.attempt import ATTEMPT_REASONS, Attempts, PlannedGrasp
from handfast.planning.evaluation.preload_search import SearchedContacts
from handfast.planning.evaluation.quality import largest_command
from handfast.planning.filters.surroundings import Way
from handfast.planning.results.verify import verify_planned
from handfast.planning.search import OverlapEntry, Tally, diagnosis
from handfast.proofs import few_contacts
from handfast.proofs.replay import Replay
from handfast.stability.problem.loads import Loads

FEW_STARTS = 10  # starts tell nothing yet
STARTS_NOT_REPLAYED = (
    "what became of the other starts, that the grasps differ from each other, and that the ways in and out are free",
)


class PlannedEntry(Strict):
    """What of a grasp in `plan.json` is needed to go on; it says more."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    attempt: int = Field(ge=0)
    nodes: int = Field(ge=0)
    penetration: float
    self_penetration: float
    configuration_file: str
    grasp_file: str
    hold_file: str
    preload_search: SearchedContacts | None = None
    way: Way | None = None


class PlanFile(Strict):
    """What of `plan.json` is needed to go on; it says more."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    query: Literal["plan"]
    question: str
    seconds: float
    first_seconds: float | None = None
    fates: dict[str, int]
    overlaps: dict[str, list[OverlapEntry]] = Field(default_factory=dict)
    grasps: list[PlannedEntry]
    others: list[PlannedEntry]


@dataclass(frozen=True, eq=False)
class Plan(Presented):
    """The grasps that were found, and what became of the other attempts.

    Attributes:
        asked: what the attempts share; count: how many grasps were asked for.
        grasps: those that hold every load and differ from each other, best first (`ranking.best_first`).
            others: those that were left out, of a pool, or fragile ones.
        tally: what became of the attempts.
        stop: COMPLETE; TIME, NODES (the attempts were used up), FRUITLESS (so many attempts came to nothing that it was
            given up) or INTERRUPTED if fewer were found.
        seconds: wall time.
        question: the fingerprint of what was asked, but for how many and how long.
        first: [s] after which the first grasp was found; None if none was.
    """

    asked: Attempts
    count: int
    grasps: tuple[PlannedGrasp, ...]
    tally: Tally
    stop: Stop
    seconds: float
    question: str = ""
    others: tuple[PlannedGrasp, ...] = ()
    first: float | None = None

    @property
    def hand(self) -> Hand:
        return self.asked.hand

    @property
    def body(self) -> Body:
        return self.asked.body

    @property
    def loads(self) -> Loads:
        """What each grasp holds."""
        return self.asked.loads

    @property
    def tried(self) -> int:
        """Number of attempts."""
        return self.tally.total

    @property
    def found(self) -> list[PlannedGrasp]:
        """All that differ from each other, in the order in which they were found."""
        return sorted((*self.grasps, *self.others), key=lambda g: g.index)

    def number(self, grasp: PlannedGrasp) -> int:
        """Of one of those found, from 0."""
        return [g.index for g in self.found].index(grasp.index)

    @property
    def verdict(self) -> Verdict | Reach:
        """HOLDS if as many were found as asked for, NONE if so few contacts cannot hold, else UNDECIDED: others may
        exist.
        """
        if len(self.grasps) >= self.count:
            return Verdict.HOLDS
        return Reach.NONE if self.asked.impossible else Verdict.UNDECIDED

    @property
    def fewest_contacts(self) -> str:
        """In words, how many contacts it takes at least; "" if one or two may do, and that is what was asked."""
        fewest = self.asked.fewest
        return few_contacts.words(fewest) if self.asked.impossible or fewest.most > 1 else ""

    def contacts_json(self) -> dict[str, Any]:
        """What `handfast verify` takes of that."""
        held, names = self.asked.held, self.loads.names
        return few_contacts.to_json(held, names, self.body.source or self.body.name, self.asked.fewest)

    @property
    def diagnosis(self) -> list[str]:
        """What rejected most of the attempts, and what may help, if nothing was found; [] if time ended it at once."""
        at_once = self.stop == Stop.TIME and self.tried < FEW_STARTS
        return [] if self.grasps or self.asked.impossible or at_once else diagnosis(self.tally, self.hand)

    @property
    def nodes(self) -> int:
        """Of the searches that hold the grasps."""
        return sum(g.answer.nodes for g in self.grasps)

    def verify(self) -> Replay:
        """Every grasp again: joints, mechanism and contacts of the hand, and each load's witness under its preload.

        And how many contacts it takes at least.
        """
        scene = Scene(self.hand, self.body, self.asked.options.ignored)
        parts = [replace(verify_planned(self.asked, scene, g), name=f"grasp {self.number(g)}") for g in self.found]
        parts += [few_contacts.replay(self.contacts_json())] if self.fewest_contacts else []
        return Replay("plan", parts=tuple(parts), not_replayed=STARTS_NOT_REPLAYED)

    def to_json(self) -> dict[str, Any]:
        """The keys that the command line prints and writes to plan.json, beside the files' names."""
        return header(self, "plan") | {
            "seconds": round(self.seconds, 3),
            "first_seconds": None if self.first is None else round(self.first, 3),
            "seed": self.asked.options.seed,
            "safety": self.asked.options.safety,
            **({"torsion": self.asked.options.torsion} if self.asked.options.torsion else {}),
            "loads": self.loads.by_name,
            "tried": self.tried,
            "fates": self.tally.to_json("kept", ATTEMPT_REASONS),
            "overlaps": self.tally.overlaps_json(),
            "diagnosis": self.diagnosis,
            "fewest_contacts": self.fewest_contacts or None,
            "question": self.question,
            "grasps": [_entry(g) for g in self.grasps],
            "others": [_entry(g) for g in self.others],
        }


def _entry(g: PlannedGrasp) -> dict[str, Any]:
    searched = {"preload_search": asdict(g.searched)} if g.searched else {}
    measured = g.quality.to_json() if g.quality else {}
    return (
        searched
        | measured
        | {
            "attempt": g.index,
            "nodes": g.answer.nodes,
            "contacts": g.grasp.m,
            "links": sorted({c.link for c in g.grasp.contacts}),
            "preload": g.grasp.preload,
            "penetration": g.penetration,
            "self_penetration": g.self_penetration,
            "largest_command": largest_command(g.grasp),
            "way": asdict(g.way) if g.way else None,
            "residual": max(a.proved.residual for a in g.answer.checks if a.proved),
        }
    )
