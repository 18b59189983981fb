"""mj_grasp_sim: npz with `pose` (N, 4, 4) of the hand in the object's frame and `joints` (N, k)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    matrix_pose,
    numbers,
    rows,
)


def recognises(data: Any) -> bool:
    """By `pose` and `joints`."""
    return isinstance(data, Mapping) and {"pose", "joints"} <= data.keys()


def read(data: Any, name: str) -> Rows:
    """The object is the file's name."""
    poses, joints = np.asarray(entry(data, "pose")), np.asarray(entry(data, "joints"))
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or joints.ndim != 2 or len(joints) != len(poses):
        problem = f"have shapes {poses.shape} and {joints.shape}; (N, 4, 4) and (N, k) are needed"
        raise InputError(problem, field="pose and joints")

    def grasp(i: int) -> RecordedGrasp:
        at = Posture(matrix_pose(poses[i], f"pose[{i}]"), numbers(joints[i], (None,), f"joints[{i}]"))
        return RecordedGrasp(i, at, object=name)

    return rows(len(poses), grasp)


LAYOUT = PublishedLayout("mj_grasp_sim", "pose (N, 4, 4) and joints (N, k)", recognises, read)
