"""GraspGen: JSON with `object` {file, scale} and `grasps` {transforms (N, 4, 4), object_in_gripper (N,)}."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    matrix_pose,
    positive,
    rows,
    text,
)


def recognises(data: Any) -> bool:
    """By `grasps` with `transforms`."""
    found = data.get("grasps") if isinstance(data, Mapping) else None
    return isinstance(found, Mapping) and "transforms" in found


def read(data: Any, name: str) -> Rows:
    """The gripper's base in the object's frame; its joints are the mapping's, as the files have none.

    A grasp that the file says failed is kept with the score 0.
    """
    about, found = data.get("object"), data["grasps"]
    about = about if isinstance(about, Mapping) else {}
    poses = entry(found, "transforms")
    held = found.get("object_in_gripper")
    if not isinstance(poses, list) or (held is not None and len(held) != len(poses)):
        raise InputError("are no list, or not as many as object_in_gripper", field="grasps.transforms")
    scale = positive(about.get("scale", 1.0), "object.scale")

    def grasp(i: int) -> RecordedGrasp:
        at = Posture(matrix_pose(poses[i], f"grasps.transforms[{i}]"), {})
        score = None if held is None else float(bool(held[i]))
        return RecordedGrasp(i, at, object=text(about.get("file")) or name, scale=scale, score=score)

    return rows(len(poses), grasp)


def written(roots: Sequence[Array], scores: Sequence[float | None], file: str, scale: float) -> dict[str, Any]:
    """A file's JSON from the gripper's frames (4, 4) in the object's."""
    held = [True if s is None else s > 0 for s in scores]
    grasps = {"transforms": [r.tolist() for r in roots], "object_in_gripper": held}
    return {"object": {"file": file, "scale": scale}, "grasps": grasps}


LAYOUT = PublishedLayout("graspgen", "object and grasps with transforms", recognises, read)
