"""The folders that `handfast plan` and `handfast grasp` fill as they find grasps, and from which they can go on.

Each file is written at once or not at all, the one that says how far the search has come last: what it names is there.
"""

from __future__ import annotations

import json
import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.core.files import read_json, validate, write_text
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.attempt import ATTEMPT_REASONS, Attempts, PlannedGrasp
from handfast.planning.evaluation.preload_search import checking_settings_for, held_again
from handfast.planning.question import refuse_another
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.plan import Plan, PlanFile, PlannedEntry
from handfast.planning.results.search_file import SavedSearch, load_search, save_search
from handfast.planning.search import Journal, State, Tally
from handfast.readers.configuration_file import load_configuration, save_configuration
from handfast.readers.grasp_file import load_grasp, save_grasp
from handfast.synthesis.task import Task

NOTE_INTERVAL = 2.0  # [s] between two notes of how far a search has come, where nothing was found
PLAN_FILE, SEARCH_FILE, GRASPS_FILE, CONTACTS_FILE = "plan.json", "search.json", "grasps.json", "contacts.json"
PLAN_FILES = {  # of a planned grasp, by their keys in `plan.json`
    "configuration_file": "{:03d}.configuration.json",
    "grasp_file": "{:03d}.grasp.json",
    "hold_file": "{:03d}.hold.json",
}
GRASP_FILES = "grasp-{}.json", "configuration-{}.json"


class SearchFolder(Journal[State]):
    """Files that are written as grasps are found.

    Args:
        path: of the folder.
        resume: go on from what it holds.
    """

    holds: ClassVar[str]  # what stands in a folder that was begun
    files: ClassVar[tuple[str, ...]]  # patterns of its files, first the one that says how far the search has come

    def __init__(self, path: Path, *, resume: bool = False, on_progress: Callable[[State], None] | None = None) -> None:
        super().__init__(on_progress)
        self.path, self.resume, self._when = path, resume, -NOTE_INTERVAL
        self.source = str(path / self.files[0])

    @classmethod
    def refuse(cls, path: Path | None, *, resume: bool, force: bool) -> None:
        """`InputError` for a folder that could not be filled, before the work that would fill it."""
        if path is None:
            if resume:
                raise InputError("needs the folder to go on from; give --output FOLDER", field="--resume")
            return
        if path.exists() and not path.is_dir():
            raise InputError("is a file; a folder is needed", source=str(path))
        if resume and force:
            raise InputError("give either --resume or --force")
        if any(any(path.glob(file)) for file in cls.files) and not (force or resume):
            problem = f"holds {cls.holds} already; give --resume to go on, or --force to write over it"
            raise InputError(problem, source=str(path))

    @property
    def begun(self) -> bool:
        """Is there a search to go on from, and is it to be gone on with?"""
        return self.resume and Path(self.source).exists()

    def note(self, state: State, *, new: bool) -> None:
        """Write what is new: a grasp at once, anything else now and then."""
        super().note(state, new=new)
        if new or time.monotonic() > self._when + NOTE_INTERVAL:
            self.close(state)

    def close(self, state: State) -> None:
        self.write(state)
        self._when = time.monotonic()

    @abstractmethod
    def write(self, state: State) -> None:
        """Bring the folder up to date."""


def _save_placed(grasp: Grasp, place: Configuration, grasp_path: Path, configuration: Path) -> None:
    """A grasp, and the configuration that it names as its source."""
    save_configuration(place, configuration, force=True)
    save_grasp(grasp.from_configuration(configuration), grasp_path, force=True)


class GraspFolder(SearchFolder[Grasps]):
    """What `grasp` finds: `grasps.json` for `handfast verify`, two files of each grasp, best first, and `search.json`.

    Attributes:
        written: the files of the grasps.
    """

    holds = "grasps"
    files = (SEARCH_FILE, GRASPS_FILE, *(file.format("[0-9]*") for file in GRASP_FILES))

    def __init__(self, path: Path, **journal: Any) -> None:
        super().__init__(path, **journal)
        self.written: list[Path] = []

    def earlier(self, question: Task) -> SavedSearch | None:
        """How far the search that the folder holds has come; its proofs are not replayed."""
        return load_search(self.source, question) if self.begun else None

    def write(self, state: Grasps) -> None:
        if state.grasps or state.proof_of_none:
            self.written = [self.path / GRASPS_FILE]
            for k, g in enumerate(state.grasps, start=1):
                grasp, configuration = (self.path / file.format(k) for file in GRASP_FILES)
                _save_placed(g.grasp, g.configuration, grasp, configuration)
                self.written += [grasp, configuration]
            state.save(self.written[0], force=True)
        save_search(state.search, self.source)


class PlanFolder(SearchFolder[Plan]):
    """What `plan` finds: three files a grasp, numbered in the order in which they were found (its configuration, the
    grasp, what backs that it holds), and `plan.json`, which names them. `contacts.json` backs how many contacts it
    takes.

    Args:
        hand, object: names or paths, as they are to stand in the files.
        closing: senses to stand in the files.
        joint_laws, backdrivable: what the hand has in place of its file, as `Hand.with_laws` and `with_backdrivable`
            were told.
    """

    holds = "a plan"
    files = (PLAN_FILE, "[0-9]*.grasp.json")

    def __init__(
        self,
        path: Path,
        hand: str,
        object: str,
        closing: dict[str, int] | None = None,
        *,
        joint_laws: str = "all",
        backdrivable: Sequence[str] = (),
        **journal: Any,
    ) -> None:
        super().__init__(path, **journal)
        self.named: dict[str, Any] = {"hand": hand, "object": object, "closing": closing or None}
        self.scene: dict[str, Any] = {"joint_laws": joint_laws, "backdrivable": list(backdrivable)}
        self._written = 0  # grasps
        self.answer: dict[str, Any] = {}  # what stands in `plan.json`

    def write(self, state: Plan) -> None:
        found = state.found
        number = {g.index: k for k, g in enumerate(found)}
        for k, g in enumerate(found[self._written :], start=self._written):
            configuration, grasp, held = (self.path / name.format(k) for name in PLAN_FILES.values())
            place = Configuration.of(state.hand, g.q, g.pose, **self.named, preload=g.grasp.preload)
            _save_placed(g.grasp, place, grasp, configuration)
            g.held.save(held, force=True)
        scene = self.scene | {"friction": state.body.friction, "scale": state.body.scale}
        self.answer = state.to_json() | {"scene": scene}
        if state.fewest_contacts:
            said = state.contacts_json() | {"object": self.named["object"]}
            write_text(self.path / CONTACTS_FILE, json.dumps(said) + "\n", force=True)
            self.answer |= {"contacts_file": CONTACTS_FILE}
        for entry in (*self.answer["grasps"], *self.answer["others"]):
            entry |= {key: name.format(number[entry["attempt"]]) for key, name in PLAN_FILES.items()}
        write_text(self.source, json.dumps(self.answer, indent=1) + "\n", force=True)
        self._written = len(found)

    def earlier(self, question: Attempts) -> Plan | None:
        """The plan that the folder holds, every grasp checked under every load; None if it holds none.

        Raises:
            InputError: files that are missing or broken, of another question, or a grasp that does not hold.
        """
        if not self.begun:
            return None
        try:
            file = validate(PlanFile, read_json(self.source, "plan"))
            refuse_another(file.question, question.question)
            tally = Tally.from_json(file.fates, "kept", ATTEMPT_REASONS)
            tally.take_overlaps(file.overlaps)
        except InputError as fault:
            raise fault.at(self.source) from None
        grasps, others = (tuple(self._held(e, question) for e in some) for some in (file.grasps, file.others))
        self._written = len(grasps) + len(others)
        spent = file.seconds, file.question, others, file.first_seconds
        return Plan(question, len(grasps), grasps, tally, Stop.INTERRUPTED, *spent)

    def _held(self, entry: PlannedEntry, asked: Attempts) -> PlannedGrasp:
        place, source = load_configuration(self.path / entry.configuration_file), self.path / entry.grasp_file
        grasp, body = load_grasp(source), asked.body
        of_another = grasp.center_of_mass is not None and not np.array_equal(grasp.center_of_mass, body.center_of_mass)
        if of_another or grasp.mass not in (None, body.mass):
            raise InputError("is of an object of another mass or centre of mass; it was changed", source=str(source))
        known = grasp.preload, 0.0, max((abs(v) for v in grasp.preload.values()), default=0.0)
        limits = asked.options.limits
        answer = held_again(grasp, asked.loads, limits, checking_settings_for(grasp), known, entry.nodes)
        if answer is None:
            problem = "does not hold what is asked; it was changed, or belongs to another plan"
            raise InputError(problem, source=str(source))
        found = entry.penetration, entry.self_penetration, entry.attempt, entry.preload_search
        return PlannedGrasp(place.applied(asked.hand)[1], place.pose, grasp, answer, *found, way=entry.way)
