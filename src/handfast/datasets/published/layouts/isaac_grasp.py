"""isaac_grasp 1.0: YAML with a gripper's pose in the object's frame and its joints by name, for each named grasp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import matrix_quaternion
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    number,
    numbers,
    pose_of,
    rows,
)


def recognises(data: Any) -> bool:
    """By its `format`."""
    return isinstance(data, Mapping) and data.get("format") == "isaac_grasp"


def read(data: Any, name: str) -> Rows:
    """The object is the file's name."""
    version = data.get("format_version")
    if version is not None and number(version, "format_version") != 1.0:
        raise InputError(f"is {version}; 1.0 is understood", field="format_version")
    found = entry(data, "grasps")
    if not isinstance(found, Mapping):
        raise InputError("is no dictionary of named grasps", field="grasps")
    names = list(found)
    return rows(len(names), lambda i: _grasp(found[names[i]], i, f"grasps.{names[i]}", name))


def _grasp(row: Any, index: int, field: str, name: str) -> RecordedGrasp:
    try:
        turn = entry(row, "orientation")
        quaternion = [number(entry(turn, "w"), "orientation.w"), *numbers(entry(turn, "xyz"), (3,), "orientation.xyz")]
        root = pose_of([*numbers(entry(row, "position"), (3,), "position"), *quaternion], "orientation")
        before = row.get("pregrasp_cspace_position")
        return RecordedGrasp(
            index,
            Posture(root, _joints(row.get("cspace_position"), "cspace_position")),
            pregrasp=Posture(root, _joints(before, "pregrasp_cspace_position")) if before else None,
            object=name,
            score=number(row["confidence"], "confidence") if "confidence" in row else None,
        )
    except InputError as fault:
        raise fault.within(field) from None


def _joints(value: Any, field: str) -> dict[str, float]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise InputError("is no dictionary of joint values", field=field)
    return {str(k): number(v, f"{field}.{k}") for k, v in value.items()}


def written(
    roots: Sequence[Array],
    joints: Sequence[Mapping[str, float]],
    before: Sequence[Mapping[str, float] | None],
    scores: Sequence[float | None],
) -> dict[str, Any]:
    """A file's data from the gripper's frames (4, 4) in the object's, its joints, and those before the grasp."""
    grasps = {}
    for i, (root, q, q0, score) in enumerate(zip(roots, joints, before, scores, strict=True)):
        w, *xyz = matrix_quaternion(root[:3, :3]).tolist()
        grasps[f"grasp_{i}"] = {
            "confidence": 1.0 if score is None else score,
            "position": root[:3, 3].tolist(),
            "orientation": {"w": w, "xyz": xyz},
            "cspace_position": dict(q),
            **({"pregrasp_cspace_position": dict(q0)} if q0 is not None else {}),
        }
    return {"format": "isaac_grasp", "format_version": 1.0, "grasps": grasps}


LAYOUT = PublishedLayout("isaac_grasp", "format: isaac_grasp", recognises, read)
