"""GraspQP: `*.dexgrasp.pt`, `parameters` hold the joints by name and `root_pose` (N, 7) in the object's frame."""

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
    numbers,
    pose_of,
    rows,
)

REACH = 0.2  # [rad] a squeeze goes this far in the joint that its velocities move most; they say the direction alone


def recognises(data: Any) -> bool:
    """By `parameters` with a `root_pose`."""
    found = data.get("parameters") if isinstance(data, Mapping) else None
    return isinstance(found, Mapping) and "root_pose" in found


def read(data: Any, name: str) -> Rows:
    """The object is the file's name; the squeeze follows `grasp_velocities_off` and a tenth of `grasp_velocities`."""
    parameters = data["parameters"]
    poses = numbers(entry(parameters, "root_pose"), (None, 7), "parameters.root_pose")
    n = len(poses)
    joints = {str(k): numbers(v, (n,), f"parameters.{k}") for k, v in parameters.items() if k != "root_pose"}
    if not joints:
        raise InputError("has no joints", field="parameters")
    onwards = {k: _velocity(data, "grasp_velocities", k, n) for k in joints}
    factor = 0.1 if "grasp_velocities_off" in data else 1.0
    speeds = {k: factor * v + _velocity(data, "grasp_velocities_off", k, n) for k, v in onwards.items()}
    scores = np.ravel(numbers(np.ravel(data["values"]), (n,), "values")).tolist() if "values" in data else [None] * n

    def grasp(i: int) -> RecordedGrasp:
        at = Posture(pose_of(poses[i], "parameters.root_pose"), {k: float(v[i]) for k, v in joints.items()})
        most = max(abs(float(v[i])) for v in speeds.values())
        further = {k: float(v[i] + REACH * speeds[k][i] / most) for k, v in joints.items()} if most else None
        squeeze = None if further is None else Posture(at.root, further)
        return RecordedGrasp(i, at, squeeze, object=name, score=scores[i])

    return rows(n, grasp)


def _velocity(data: Mapping[str, Any], key: str, joint: str, n: int) -> Any:
    found = data.get(key)
    if not isinstance(found, Mapping) or joint not in found:
        return np.zeros(n)
    return numbers(found[joint], (n,), f"{key}.{joint}")


LAYOUT = PublishedLayout("graspqp", "parameters with root_pose", recognises, read)
