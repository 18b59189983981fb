"""The compiled kernels of synthesis, as one library of machine code."""

from __future__ import annotations

from pathlib import Path

from handfast.core.machine_code import EntryPoint, Library
from handfast.synthesis.search import workspace as w
from handfast.synthesis.task_groups import Chains, Coordinates, Regions

HERE = Path(__file__).parent
KERNELS = "handfast.synthesis.search.kernel"
TASK = (Chains, Regions, Coordinates)
LOCAL = (w.SystemValues, w.SystemValues, w.ContactBalls, w.StepWork, w.ProofWork, w.StartWork)
TAYLOR = (w.CenteredBox, w.Polynomials, w.TaylorWork)

LIBRARY = Library(
    name="synthesis",
    module=__name__,
    entries={
        "find": EntryPoint(f"{KERNELS}.local_search", (*TASK, w.Draws, *LOCAL, w.Found, int)),
        "walk": EntryPoint(f"{KERNELS}.local_search", (*TASK, w.Departures, *LOCAL, w.Found)),
        "explore_set": EntryPoint(
            f"{KERNELS}.set_search", (*TASK, w.Stack, w.SetQuestion, *TAYLOR, w.LineWork, w.AngleTerms, int, float)
        ),
        "explore_poses": EntryPoint(
            f"{KERNELS}.pose_search", (*TASK, w.Stack, w.PoseQuestion, *TAYLOR, w.TurnWork, w.InnerWork, int, float)
        ),
    },
    sources=(
        HERE / "library.py",
        HERE / "workspace.py",
        HERE.parent / "task_groups.py",
        *sorted((HERE / "kernel").glob("*.py")),
    ),
)
