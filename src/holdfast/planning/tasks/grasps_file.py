"""The `holdfast/grasps/1` file: the grasps of a task with all their proofs, for `holdfast verify`.

The task is embedded with the hand, each grasp with its proof of existence and one `holdfast/result/1` object for
each load, so that nothing else is needed. `checksum` is that of all the rest. Clearances are measured, not proved:
they stand in the answer for the record.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from holdfast import grasp_file
from holdfast.errors import InputError
from holdfast.files import Strict, read_json, validate, write_text
from holdfast.grasp import Grasp
from holdfast.stability import result_file
from holdfast.stability.certificate_file import Six
from holdfast.stability.loads import Loads
from holdfast.stability.result_file import Result
from holdfast.synthesis.answers import Solution
from holdfast.synthesis.embedded import refuse_broken, sealed, task_from_dict, task_to_dict
from holdfast.synthesis.existence import existence_to_dict
from holdfast.synthesis.result_file import solution_of
from holdfast.synthesis.task import Task

if TYPE_CHECKING:
    from holdfast.planning.tasks.proved import Grasps, ProvedGrasp


class ProvedEntry(Strict):
    """`joints` are all of the hand, `grasp` a `holdfast/grasp/1` object, `checks` one for each load, in order."""

    existence: dict[str, Any]
    joints: dict[str, float]
    grasp: dict[str, Any]
    checks: list[dict[str, Any]]


class GraspsFile(Strict):
    """The file as it stands on disk."""

    format: Literal["holdfast/grasps/1"] = Field(alias="schema")
    checksum: str
    task: dict[str, Any]
    loads: dict[str, Six]
    answer: dict[str, Any]
    grasps: list[ProvedEntry]


@dataclass(frozen=True, eq=False)
class SavedGrasp:
    """A grasp as it stands in a file: the proof's configuration, all joints (l,), the grasp, a check for each load."""

    solution: Solution
    joints: dict[str, float]
    grasp: Grasp
    checks: tuple[Result, ...]


@dataclass(frozen=True, eq=False)
class SavedGrasps:
    """The grasps of a task as they stand in a file, with what the file says of them."""

    task: Task
    loads: Loads
    grasps: tuple[SavedGrasp, ...]
    said: dict[str, Any]


def to_dict(answer: Grasps) -> dict[str, Any]:
    """The answer as a `holdfast/grasps/1` object; numbers come back exactly."""
    data = {
        "schema": "holdfast/grasps/1",
        "task": task_to_dict(answer.task),
        "loads": answer.loads.by_name,
        "answer": answer.to_json(),
        "grasps": [_entry(g) for g in answer.grasps],
    }
    return sealed(data)


def _entry(g: ProvedGrasp) -> dict[str, Any]:
    return {
        "existence": existence_to_dict(g.solution.existence),
        "joints": g.solution.task.hand.values(g.q),
        "grasp": grasp_file.to_dict(g.grasp),
        "checks": [result_file.to_dict(Result.of(a)) for a in g.answer.checks],
    }


def from_dict(data: Any) -> SavedGrasps:
    """The grasps in a parsed object; raises `InputError` with field and fault."""
    entry = validate(GraspsFile, data)
    refuse_broken(data)
    try:
        task = task_from_dict(entry.task)
    except InputError as fault:
        raise fault.within("task") from None
    loads = Loads(tuple(entry.loads), np.array(list(entry.loads.values())).reshape(-1, 6))
    grasps = []
    for i, e in enumerate(entry.grasps):
        field = f"grasps[{i}]"
        solution = solution_of(task, e.existence, f"{field}.existence")
        try:
            if set(e.joints) != set(task.hand.joint_names):
                raise InputError(f"are not those of the hand: {', '.join(task.hand.joint_names)}", field="joints")
            checks = tuple(result_file.from_dict(c) for c in e.checks)
            grasps.append(SavedGrasp(solution, e.joints, grasp_file.from_dict(e.grasp), checks))
        except InputError as fault:
            raise fault.within(field) from None
    return SavedGrasps(task, loads, tuple(grasps), entry.answer)


def load_grasps(path: str | Path) -> SavedGrasps:
    """The grasps in a file; `InputError` if it is none, or was changed after it was written."""
    try:
        return from_dict(read_json(path, "grasps"))
    except InputError as fault:
        raise fault.at(str(path)) from None


def save_grasps(answer: Grasps, path: str | Path, *, force: bool = False) -> None:
    """Write the file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(answer), allow_nan=False) + "\n", force=force)
