"""`handfast grasp`: from regions to a certified, collision-free, passively stable grasp with its torques."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.loads import LoadsOptions
from handfast.cli.options import Assignments, Command, assigned, check_folder, check_writable, load_solvable
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.planning.results.grasps import Grasps
    from handfast.planning.results.search_file import Search

FILES = ("grasps.json", "grasp-{}.json", "configuration-{}.json")
SEARCH = "search.json"
PAUSE = 2.0  # [s] between two notes of how far the search has come, where nothing was found


@dataclass(kw_only=True)
class Grasp(LoadsOptions, Command):
    """Find grasps for a task: the hand reaches them, nothing collides, they hold, and with these torques.

    Every configuration comes with a proof that it exists, every load with an exact equilibrium under the
    preload. What else was tried is counted by the reason why it was dropped.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    """a handfast/task/1 file or the name of a bundled task"""
    count: Annotated[int, arg(metavar="N", aliases=["-n"])] = 3
    """grasps that differ from each other"""
    object: Annotated[str | None, arg(metavar="OBJECT")] = None
    """a mesh or handfast/body/1 file or the name of a bundled object, instead of the task's"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg], instead of its file's"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient between hand and object; the object file's, or 0.5"""
    depth: Annotated[float, arg(metavar="M")] = 1e-3
    """how deep solids may be in each other: collision shapes are approximations [m]"""
    command_limit: Annotated[float | None, arg(metavar="V")] = None
    """largest command of any actuator [N m or N]; ten times the largest load at the size of the grasp"""
    torque_limit: Assignments = ()
    """largest torque (force) of an actuator with its gearing, passive reaction included"""
    force_limit: Annotated[float | None, arg(metavar="N")] = None
    """largest normal force at any contact [N]"""
    eta: Annotated[float, arg(metavar="DEG")] = 0.0
    """how far the contact normals may be off [degrees]"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the random starts: the same seed finds the same grasps"""
    timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds for the search after start-up; inf: until there are N"""
    jobs: Annotated[int | None, arg(metavar="N")] = None
    """processes; by default all cores"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write grasps as they are found: grasps.json for handfast verify, grasp-K.json and configuration-K.json of each"""
    resume: bool = False
    """go on from what FOLDER holds; the same question, but for --count, --timeout and --jobs"""
    report: Annotated[Path | None, arg(metavar="FILE.html")] = None
    """write a self-contained page about the best grasp, to be turned with the mouse"""
    json: bool = False
    """print one JSON object instead of a table"""
    force: bool = False
    """write over files that exist"""

    def run(self) -> int:
        from handfast.cli import grasp_tables
        from handfast.model.body import load_body
        from handfast.planning.evaluation.evaluator import Allowed
        from handfast.planning.grasp_for import grasp_for
        from handfast.planning.results.search_file import load_search

        task = load_solvable(self.task)
        if self.count < 1:
            raise InputError(f"is {self.count}; at least 1 is needed", field="--count")
        name = self.object or task.object
        if name is None:
            raise InputError("names no object; give --object, its shape is needed", source=self.task)
        check_writable(self.report, self.force, (".html", ".htm"))
        self._check_folder()
        body = load_body(name, mass=self.mass, friction=self.friction)
        loads = self.asked(body)
        state = self.output / SEARCH if self.output else None
        earlier = load_search(state, task) if state and self.resume and state.exists() else None
        with console.watch("grasp") as watch:
            answer = grasp_for(
                task,
                body,
                loads,
                count=self.count,
                seed=self.seed,
                timeout=None if self.timeout == float("inf") else self.timeout,
                allowed=Allowed(self.depth, self.depth, self.depth),
                command_limit=self.command_limit,
                torque_limits=assigned(self.torque_limit, "--torque-limit"),
                force_limit=self.force_limit,
                eta=float(np.radians(self.eta)),
                jobs=self.jobs,
                earlier=earlier,
                on_step=lambda p: watch.say(grasp_tables.progress_text(p)),
                on_find=self._note,
            )
        written = self._write(answer)
        if self.json:
            console.print_json(answer.to_json())
        else:
            grasp_tables.show_grasps(console.out(), answer, written)
        enough = len(answer.grasps) >= self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.grasps else console.UNDECIDED

    def _check_folder(self) -> None:
        """Refuse a folder that could not be filled before the work that would fill it."""
        self._noted = -math.inf
        if self.output is None:
            if self.resume:
                raise InputError("needs the folder to go on from; give --output FOLDER", field="--resume")
            return
        check_folder(self.output)
        if self.resume and self.force:
            raise InputError("give either --resume or --force")
        begun = any(any(self.output.glob(file.format("[0-9]*"))) for file in (SEARCH, *FILES))
        if begun and not (self.force or self.resume):
            problem = "holds grasps already; give --resume to go on, or --force to write over them"
            raise InputError(problem, source=str(self.output))

    def _note(self, search: Search, answer: Grasps | None) -> None:
        """Write what is new: grasps at once, and then how far the search has come."""
        if self.output is None:
            return
        if answer is not None:
            self._save(answer)
        if answer is not None or time.monotonic() > self._noted + PAUSE:
            from handfast.planning.results.search_file import save_search

            save_search(search, self.output / SEARCH)
            self._noted = time.monotonic()

    def _save(self, answer: Grasps) -> list[Path]:
        """The files of the grasps, best first."""
        from handfast.model.configuration import save_configuration
        from handfast.model.grasp_file import save_grasp

        assert self.output is not None
        whole, grasp, configuration = (self.output / file for file in FILES)
        written = []
        for k, g in enumerate(answer.grasps, start=1):
            for file in (grasp, configuration):
                written.append(file.with_name(file.name.format(k)))
            save_grasp(g.grasp, written[-2], force=True)
            save_configuration(g.configuration, written[-1], force=True)
        answer.save(whole, force=True)
        return [whole, *written]

    def _write(self, answer: Grasps) -> list[Path]:
        written = self._save(answer) if self.output and answer.grasps else []
        if self.report and answer.grasps:
            from handfast.report.grasp_report import report_grasp

            report_grasp(self.report, answer, force=self.force)
            written.append(self.report)
        return written
