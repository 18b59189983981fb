"""The options that `grasp` and `plan` share: how many grasps, within which limits, for how long, and where they go."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from handfast.cli.load_options import LoadsOptions
from handfast.cli.options import Assignments, WorkOptions, assigned, check_writable
from handfast.cli.scene_options import SOLID, LinkPairs
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.planning.question import SearchOptions


@dataclass(kw_only=True)
class SearchFlags(LoadsOptions, WorkOptions):
    """A search for grasps."""

    joint_laws: Annotated[str, arg(metavar="LAWS")] = SOLID
    """what counts of the joints' stops, friction and springs in the hand's file: all, none, or names with commas"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the random starts: the same seed gives the same grasps"""
    ignore_pair: LinkPairs = ()
    """two links of the hand that may overlap, as their shapes do and the real links do not; repeatable"""
    command_limit: Annotated[float | None, arg(metavar="V")] = None
    """largest command of any actuator [N m or N]; by default ten times the largest load at the grasp's size"""
    torque_limit: Assignments = ()
    """largest torque (force) of an actuator with its gearing, passive reaction included"""
    force_limit: Annotated[float | None, arg(metavar="N")] = None
    """largest normal force at any contact [N]"""
    eta: Annotated[float, arg(metavar="DEG")] = 0.0
    """how far the contact normals may be off [degrees]"""
    resume: bool = False
    """go on from what FOLDER holds; the same question, but for how many and how long, --pool and --jobs"""
    report: Annotated[Path | None, arg(metavar="FILE.html")] = None
    """write a self-contained page about the grasps that were found, the first to be turned with the mouse"""
    json: bool = False
    """print one JSON object instead of a table"""
    force: bool = False
    """write over files that exist"""

    def options(self, kind: type[SearchOptions], **more: Any) -> Any:
        """The options of the API, of a kind: by their names, `more` where these are others on the command line."""
        import numpy as np

        from handfast.planning.question import PlanLimits

        check_writable(self.report, self.force, (".html", ".htm"))
        limits = PlanLimits(
            command_limit=self.command_limit,
            torque_limits=assigned(self.torque_limit, "--torque-limit"),
            force_limit=self.force_limit,
            eta=float(np.radians(self.eta)),
        )
        same = {f.name: getattr(self, f.name) for f in fields(kind) if hasattr(self, f.name)}
        timeout = None if same["timeout"] == float("inf") else same["timeout"]
        try:
            return kind(**same | {"limits": limits, "timeout": timeout, "ignored": self.ignore_pair} | more)
        except InputError as fault:
            raise InputError(fault.problem, field=f"--{(fault.field or '').replace('_', '-')}") from None
