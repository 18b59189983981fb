"""The folder that `handfast plan` fills as it finds grasps, and from which it can go on.

Two files a grasp, numbered in the order in which they were found, and `plan.json`, which names them and says how far
the search has come. Each is written at once or not at all, `plan.json` last: what it names is there.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate, write_text
from handfast.model.configuration import Configuration, load_configuration, save_configuration
from handfast.model.grasp_file import load_grasp, save_grasp
from handfast.planning.evaluation.attempt import Attempts, Fate, Held
from handfast.planning.plan_grasps import Plan
from handfast.planning.question import refuse_another
from handfast.stability.hold import HoldAnswer
from handfast.stability.queries import check

PLAN = "plan.json"
FILES = "{:03d}.configuration.json", "{:03d}.grasp.json"
PAUSE = 2.0  # [s] between two notes of how far the search has come, where nothing was found


class GraspEntry(Strict):
    """It says more than is needed to go on."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    attempt: int = Field(ge=0)
    nodes: int = Field(ge=0)
    penetration: float
    self_penetration: float
    configuration_file: str
    grasp_file: str


class PlanFile(Strict):
    """The file as it stands on disk; it says more than is needed to go on."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    query: Literal["plan"]
    question: str
    seconds: float
    fates: dict[str, int]
    grasps: list[GraspEntry]
    others: list[GraspEntry]


@dataclass
class Folder:
    """Attributes:
    path: of the folder.
    hand, object: names or paths, as they are to stand in the files.
    closing: senses to stand in the files.
    """

    path: Path
    hand: str
    object: str
    closing: dict[str, int] | None = None
    _written: int = field(default=-1, init=False)
    _when: float = field(default=0.0, init=False)

    def note(self, plan: Plan) -> None:
        """Write what is new of a plan that goes on: a grasp at once, anything else now and then."""
        if len(plan.grasps) + len(plan.others) != self._written or time.monotonic() > self._when + PAUSE:
            self.write(plan)

    def write(self, plan: Plan) -> dict[str, Any]:
        """Bring the folder up to date; returns what stands in `plan.json`."""
        found, new = plan.found, max(self._written, 0)
        number = {g.index: k for k, g in enumerate(found)}
        for k, g in enumerate(found[new:], start=new):
            configuration, grasp = (self.path / name.format(k) for name in FILES)
            names = {"hand": self.hand, "object": self.object, "closing": self.closing or None}
            placed = Configuration.of(plan.hand, g.q, g.pose, **names, preload=g.grasp.preload)
            save_configuration(placed, configuration, force=True)
            save_grasp(g.grasp, grasp, force=True)
        answer = plan.to_json()
        for entry in (*answer["grasps"], *answer["others"]):
            names_ = [name.format(number[entry["attempt"]]) for name in FILES]
            entry["configuration_file"], entry["grasp_file"] = names_
        write_text(self.path / PLAN, json.dumps(answer, indent=1) + "\n", force=True)
        self._written, self._when = len(found), time.monotonic()
        return answer

    def read(self, asked: Attempts) -> Plan | None:
        """The plan that the folder holds, every grasp checked under every load; None if it holds none.

        Raises:
            InputError: files that are missing or broken, of another question, or a grasp that does not hold.
        """
        path = self.path / PLAN
        if not path.exists():
            return None
        try:
            file = validate(PlanFile, read_json(path, "plan"))
            refuse_another(file.question, asked.question)
            fates = {fate: file.fates.get(fate.name.lower(), 0) for fate in Fate}
        except InputError as fault:
            raise fault.at(str(path)) from None
        grasps, others = (tuple(self._held(e, asked) for e in some) for some in (file.grasps, file.others))
        self._written = len(grasps) + len(others)
        return Plan(
            asked.hand,
            asked.body,
            asked.loads,
            len(grasps),
            asked.seed,
            grasps,
            fates,
            Stop.INTERRUPTED,
            file.seconds,
            file.question,
            others,
        )

    def _held(self, entry: GraspEntry, asked: Attempts) -> Held:
        place = load_configuration(self.path / entry.configuration_file)
        grasp = load_grasp(self.path / entry.grasp_file)
        limits: dict[str, Any] = {
            "torque_limits": asked.torque_limits,
            "force_limit": asked.force_limit,
            "eta": asked.eta,
            "settings": asked.settings_for(grasp),
        }
        checks = tuple(check(grasp, w, **limits) for w in asked.loads.wrenches)
        if any(a.verdict is not Verdict.HOLDS for a in checks):
            source = str(self.path / entry.grasp_file)
            raise InputError("does not hold what is asked; it was changed, or belongs to another plan", source=source)
        command = max((abs(v) for v in grasp.preload.values()), default=0.0)
        held = Verdict.HOLDS, Stop.COMPLETE, 0.0, entry.nodes, asked.loads, grasp.preload, 0.0, command, checks
        q = place.applied(asked.hand)[1]
        return Held(q, place.pose, grasp, HoldAnswer(*held), entry.penetration, entry.self_penetration, entry.attempt)
