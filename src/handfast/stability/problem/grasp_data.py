"""A grasp as proofs take it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from handfast.model.grasp import Grasp
from handfast.proofs.grasp import GraspData, StartData, read_grasp
from handfast.readers import grasp_file


@dataclass(frozen=True)
class _Parts:
    """What `GraspData` is made of, but for the start of a step."""

    parts: tuple[Any, ...]
    grasp: Grasp = field(compare=False)


@lru_cache(maxsize=64)  # of a grasp that is asked again and again
def grasp_data(grasp: Grasp) -> GraspData:
    """A grasp as proofs read it from a file."""
    if grasp.start is None:
        return read_grasp(grasp_file.to_dict(grasp), "grasp")
    bare = _without_start(_Parts((grasp.contacts, grasp.joints, grasp.mechanism, grasp.command.tobytes()), grasp))
    return bare.with_start(StartData(grasp.start.gaps, grasp.start.stops, grasp.start.slack))


@lru_cache(maxsize=8)  # of all steps of a path
def _without_start(made_of: _Parts) -> GraspData:
    return read_grasp(grasp_file.to_dict(made_of.grasp), "grasp")
