"""`handfast grasp`: from regions to a certified, collision-free, passively stable grasp with its torques."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.joint_options import SOLID, JointLawOptions
from handfast.cli.load_options import LoadsOptions
from handfast.cli.options import Assignments, Command, Triple, assigned, check_writable, load_solvable
from handfast.cli.scene_options import LinkPairs, load_object
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.planning.results.grasps import Grasps


@dataclass(kw_only=True)
class FindGrasps(LoadsOptions, JointLawOptions, Command):
    """Find grasps for a task: the hand reaches them, nothing collides, they hold, and with these torques.

    Every configuration comes with a proof that it exists, every load with an exact equilibrium under the
    preload. What else was tried is counted by the reason why it was dropped.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    """a handfast/task/1 file or the name of a bundled task"""
    joint_laws: Annotated[str, arg(metavar="LAWS")] = SOLID
    """what counts of the joints' stops, friction and springs in the hand's file: all, none, or names with commas"""
    count: Annotated[int, arg(metavar="N", aliases=["-n"])] = 3
    """grasps that differ from each other"""
    object: Annotated[str | None, arg(metavar="OBJECT")] = None
    """a mesh or handfast/body/1 file or the name of a bundled object, instead of the task's"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg], instead of its file's"""
    center_of_mass: Annotated[Triple, arg(aliases=["--com"])] = ()
    """centre of mass in the object's frame [m]; the object file's, or the centre of its volume; --com for short"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient between hand and object; the object file's, or 0.5"""
    depth: Annotated[float, arg(metavar="M")] = 1e-3
    """how deep solids may be in each other, links beyond what they are at rest: shapes are approximations [m]"""
    ignore_pair: LinkPairs = ()
    """two links of the hand that may overlap, as their shapes do and the real links do not; repeatable"""
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
        from handfast.planning.evaluation.evaluator import Allowed
        from handfast.planning.grasp_for import grasp_for
        from handfast.planning.journal import Journal
        from handfast.planning.requirements import Limits
        from handfast.planning.results.grasp_folder import GraspFolder
        from handfast.planning.sizes import compared

        task = load_solvable(self.task)
        task = replace(task, hand=self.lawful(task.hand))
        if self.count < 1:
            raise InputError(f"is {self.count}; at least 1 is needed", field="--count")
        name = self.object or task.object
        if name is None:
            raise InputError("names no object; give --object, its shape is needed", source=self.task)
        check_writable(self.report, self.force, (".html", ".htm"))
        GraspFolder.refuse(self.output, resume=self.resume, force=self.force)
        about: dict[str, Any] = {"mass": self.mass, "friction": self.friction, "center_of_mass": self.center_of_mass}
        body = load_object(name, scale=1.0, **about)
        console.warn(compared(task.hand, body))
        with console.watch("grasp") as watch:

            def note(so_far: Grasps) -> None:
                watch.say(grasp_tables.progress_text(so_far))

            folder = GraspFolder(self.output, resume=self.resume, on_note=note) if self.output else None
            answer = grasp_for(
                task,
                body,
                self.asked(body),
                limits=Limits(
                    command_limit=self.command_limit,
                    torque_limits=assigned(self.torque_limit, "--torque-limit"),
                    force_limit=self.force_limit,
                    eta=float(np.radians(self.eta)),
                ),
                count=self.count,
                seed=self.seed,
                timeout=None if self.timeout == float("inf") else self.timeout,
                allowed=Allowed(self.depth, self.depth, self.depth),
                ignored=self.ignore_pair,
                jobs=self.jobs,
                journal=folder or Journal(note),
            )
        written = folder.written if folder else []
        if self.report and answer.grasps:
            from handfast.pictures.grasp_page import report_grasp

            report_grasp(self.report, answer, force=self.force)
            written = [*written, self.report]
        if self.json:
            console.print_json(answer.to_json())
        else:
            grasp_tables.show_grasps(console.out(), answer, written, self.safety)
        enough = len(answer.grasps) >= self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.grasps else console.UNDECIDED
