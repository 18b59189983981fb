"""The version of 23 November (d95b5b8) answers the questions of `users`, under the names of today.

    git worktree add ../first d95b5b8
    python -m benchmarks.users --before ../first

`users` starts this module in place of itself for a checkout that has no `papers`. It puts the modules of that version
in place of those that `users` imports, and says nothing of families which that version cannot be asked: grasps made
ready without a load (`prepare rows`), and an exact state proved for every answer (`next proved`).
"""

from __future__ import annotations

import argparse
import importlib
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

MOVED = {
    "handfast.datasets.labels.label_columns": "handfast.label.label_columns",
    "handfast.readers.grasp_file": "handfast.model.grasp_file",
    "handfast.readers.load_body": "handfast.model.body",
    "handfast.readers.load_hand": "handfast.model.hand.load",
    "handfast.stability.problem.model": "handfast.stability.model",
    "handfast.stability.problem.scaled_problem": "handfast.stability.scaled_problem",
}
UNUSED = ("BRIEF", "REPEATS", "Cost", "load", "proof", "save", "seconds", "timeout")  # of that version's table2
PARENTS = ("datasets", "datasets.labels", "papers", "readers", "stability.problem")


def put(name: str, **parts: Any) -> None:
    """A module of today with these parts."""
    module = ModuleType(name)
    vars(module).update(parts)
    sys.modules[name] = module


def settings(verify: bool = True, jobs: int = 0, timeout: float = np.inf) -> Any:
    """`Settings` by the words of today."""
    from handfast.stability.settings import Settings

    return Settings(verify=verify, workers=jobs, time_limit=timeout)


class Prepared:
    """A prepared grasp that is asked by `check`."""

    def __init__(self, grasp: Any, settings: Any) -> None:
        from handfast.stability.prepared import prepare

        self.check = prepare(grasp, settings=settings).holds


def install() -> None:
    """Make `benchmarks.users` importable beside that version."""
    for parent in PARENTS:
        put(f"handfast.{parent}", __path__=[])
    for today, then in MOVED.items():
        sys.modules[today] = importlib.import_module(then)
    import handfast

    for name in ("check_many", "max_many", "maximum", "torques", "check", "load_grasp"):
        setattr(handfast, name, getattr(handfast, name))  # loaded, so that no module of today is looked for
    handfast.prepare = Prepared
    labeller = importlib.import_module("handfast.label.labeller")
    center = lambda grasp: np.zeros(3) if grasp.center_of_mass is None else grasp.center_of_mass  # noqa: E731
    put(
        "handfast.datasets.labels.labeller",
        Labelling=labeller.Labelling,
        label=labeller.label,
        force_at=labeller._force,
        center_of=center,
    )
    put("handfast.stability.problem.settings", Settings=settings)
    put("handfast.papers.stability_tables", task_questions=table2)
    sys.modules["handfast.papers"].algorithm1 = None  # type: ignore[attr-defined]
    for name, part in (("grasp_limits", "GraspLimits"), ("objective", "ANY_STATE")):
        put(f"handfast.stability.problem.{name}", **{part: None})
    put("handfast.stability.problem.grasp_rows", GraspRows=None, shape_of=None)
    put("handfast.stability.search.load_rows", BatchSearch=None, Template=None)


def table2(name: str) -> list[Any]:
    """The questions of Table II about a grasp, by that version's own script."""
    import handfast

    spec = spec_from_file_location("table2_then", Path(handfast.__file__).parents[2] / "benchmarks" / "table2.py")
    assert spec
    assert spec.loader
    put(
        "benchmarks.engine",
        **dict.fromkeys(UNUSED),
    )
    then = sys.modules.setdefault(spec.name, module_from_spec(spec))
    if not hasattr(then, "of_grasp"):
        spec.loader.exec_module(then)
    return list(then.of_grasp(name))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--answer", action="store_true")
    parser.add_argument("--count", type=int, default=200)
    options = parser.parse_args()
    install()
    importlib.import_module("benchmarks.users").answer(options.count)
