"""`handfast grasp`: from regions to a certified, collision-free, passively stable grasp with its torques."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.load_options import SearchFlags
from handfast.cli.options import Command, load_solvable
from handfast.cli.scene_options import JointLawOptions, ObjectOptions
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.planning.results.grasps import Grasps


@dataclass(kw_only=True)
class FindGrasps(SearchFlags, JointLawOptions, ObjectOptions, Command):
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
    depth: Annotated[float, arg(metavar="M")] = 1e-3
    """how deep solids may be in each other, links beyond what they are at rest: shapes are approximations [m]"""
    timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds for the search after start-up; inf: until there are N"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write grasps as they are found: grasps.json for handfast verify, grasp-K.json and configuration-K.json of each"""

    def run(self) -> int:
        from handfast.cli import grasp_tables
        from handfast.planning.grasp_for import grasp_for
        from handfast.planning.question import Allowed, TaskGraspOptions, compared
        from handfast.planning.results.folder import GraspFolder
        from handfast.planning.search import Journal

        allowed = Allowed(self.depth, self.depth, self.depth)
        options: TaskGraspOptions = self.options(TaskGraspOptions, allowed=allowed)
        task = load_solvable(self.task)
        task = replace(task, hand=self.lawful(task.hand))
        name = self.object or task.object
        if name is None:
            raise InputError("names no object; give --object, its shape is needed", source=self.task)
        workers = self.workers()
        GraspFolder.refuse(self.output, resume=self.resume, force=self.force)
        body = self.load_object(name)
        console.warn(compared(task.hand, body))
        with console.watch("grasp") as watch:

            def note(so_far: Grasps) -> None:
                watch.say(grasp_tables.progress_text(so_far))

            folder = GraspFolder(self.output, resume=self.resume, on_progress=note) if self.output else None
            journal = folder or Journal(note)
            answer = grasp_for(task, body, self.asked(body), options=options, journal=journal, **workers)
        written = folder.written if folder else []
        if self.report and answer.grasps:
            from handfast.pictures.found_page import report_grasp

            report_grasp(self.report, answer, force=self.force)
            written = [*written, self.report]
        if self.json:
            console.print_json(answer.to_json())
        else:
            grasp_tables.show_grasps(console.out(), answer, written, self.safety)
        enough = len(answer.grasps) >= self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.grasps else console.UNDECIDED
