"""The folder that `handfast plan` fills as it finds grasps, and from which it can go on.

Three files a grasp, numbered in the order in which they were found: its configuration, the grasp, and what backs that
it holds. `plan.json` names them and says how far the search has come. Each is written at once or not at all,
`plan.json` last: what it names is there.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate, write_text
from handfast.model.configuration import Configuration
from handfast.planning.evaluation.attempt import REASONS, Attempts, PlannedGrasp
from handfast.planning.evaluation.holding import held_again
from handfast.planning.evaluation.preload_search import SearchedContacts, checking_settings_for
from handfast.planning.journal import SearchFolder
from handfast.planning.question import refuse_another
from handfast.planning.rejection import OverlapEntry, Tally
from handfast.planning.results.planned import Plan
from handfast.readers.configuration_file import load_configuration, save_configuration
from handfast.readers.grasp_file import load_grasp, save_grasp

PLAN = "plan.json"
FILES = "{:03d}.configuration.json", "{:03d}.grasp.json", "{:03d}.hold.json"
KEYS = "configuration_file", "grasp_file", "hold_file"  # in `plan.json`


class PreloadSearchEntry(Strict):
    """As `SearchedContacts`."""

    touching: int = Field(ge=1)
    searched: int = Field(ge=1)
    error: float = Field(ge=0)


class PlannedEntry(Strict):
    """It says more than is needed to go on."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    attempt: int = Field(ge=0)
    nodes: int = Field(ge=0)
    penetration: float
    self_penetration: float
    configuration_file: str
    grasp_file: str
    hold_file: str
    preload_search: PreloadSearchEntry | None = None


class PlanFile(Strict):
    """The file as it stands on disk; it says more than is needed to go on."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    query: Literal["plan"]
    question: str
    seconds: float
    fates: dict[str, int]
    overlaps: dict[str, list[OverlapEntry]] = Field(default_factory=dict)
    grasps: list[PlannedEntry]
    others: list[PlannedEntry]


class PlanFolder(SearchFolder[Plan]):
    """Three files a grasp, and `plan.json`.

    Args:
        hand, object: names or paths, as they are to stand in the files.
        closing: senses to stand in the files.
    """

    holds = "a plan"
    files = (PLAN, "[0-9]*.grasp.json")

    def __init__(
        self, path: Path, hand: str, object: str, closing: dict[str, int] | None = None, **journal: Any
    ) -> None:
        super().__init__(path, **journal)
        self.hand, self.object, self.closing = hand, object, closing
        self._written = 0  # grasps
        self.answer: dict[str, Any] = {}  # what stands in `plan.json`

    def write(self, state: Plan) -> None:
        found = state.found
        number = {g.index: k for k, g in enumerate(found)}
        for k, g in enumerate(found[self._written :], start=self._written):
            configuration, grasp, held = (self.path / name.format(k) for name in FILES)
            names = {"hand": self.hand, "object": self.object, "closing": self.closing or None}
            placed = Configuration.of(state.hand, g.q, g.pose, **names, preload=g.grasp.preload)
            save_configuration(placed, configuration, force=True)
            save_grasp(g.grasp.from_configuration(configuration), grasp, force=True)
            g.held.save(held, force=True)
        self.answer = state.to_json()
        for entry in (*self.answer["grasps"], *self.answer["others"]):
            entry |= {key: name.format(number[entry["attempt"]]) for key, name in zip(KEYS, FILES, strict=True)}
        write_text(self.path / PLAN, json.dumps(self.answer, indent=1) + "\n", force=True)
        self._written = len(found)

    def earlier(self, question: Attempts) -> Plan | None:
        """The plan that the folder holds, every grasp checked under every load; None if it holds none.

        Raises:
            InputError: files that are missing or broken, of another question, or a grasp that does not hold.
        """
        path, asked = self.path / PLAN, question
        if not (self.resume and path.exists()):
            return None
        try:
            file = validate(PlanFile, read_json(path, "plan"))
            refuse_another(file.question, asked.question)
            tally = Tally.from_json(file.fates, "kept", REASONS)
            tally.take_overlaps(file.overlaps)
        except InputError as fault:
            raise fault.at(str(path)) from None
        grasps, others = (tuple(self._held(e, asked) for e in some) for some in (file.grasps, file.others))
        self._written = len(grasps) + len(others)
        count, stop = len(grasps), Stop.INTERRUPTED
        return Plan(asked, count, grasps, tally, stop, file.seconds, file.question, others)

    def _held(self, entry: PlannedEntry, asked: Attempts) -> PlannedGrasp:
        place = load_configuration(self.path / entry.configuration_file)
        grasp = load_grasp(self.path / entry.grasp_file)
        body = asked.body
        of_another = grasp.center_of_mass is not None and not np.array_equal(grasp.center_of_mass, body.center_of_mass)
        if of_another or grasp.mass not in (None, body.mass):
            source = str(self.path / entry.grasp_file)
            raise InputError("is of an object of another mass or centre of mass; it was changed", source=source)
        known = grasp.preload, 0.0, max((abs(v) for v in grasp.preload.values()), default=0.0)
        answer = held_again(grasp, asked.loads, asked.limits, checking_settings_for(grasp), known, entry.nodes)
        if answer is None:
            source = str(self.path / entry.grasp_file)
            raise InputError("does not hold what is asked; it was changed, or belongs to another plan", source=source)
        q = place.applied(asked.hand)[1]
        how = SearchedContacts(**entry.preload_search.model_dump()) if entry.preload_search else None
        depths = entry.penetration, entry.self_penetration
        return PlannedGrasp(q, place.pose, grasp, answer, *depths, entry.attempt, how)
