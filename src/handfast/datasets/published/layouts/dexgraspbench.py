"""DexGraspBench: one `.npy` a grasp, `grasp_qpos` and its like hold position, quaternion and joints in the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.datasets.published.recorded import (
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    pose_of,
    positive,
    posture_of,
    rows,
    text,
)


def recognises(data: Any) -> bool:
    """By `grasp_qpos` beside `obj_path` or `obj_pose`, and no keys of Dexonomy's."""
    if not isinstance(data, Mapping) or "grasp_qpos" not in data:
        return False
    return bool({"obj_path", "obj_pose"} & data.keys()) and not {"tmpl_name", "hand_template_name"} & data.keys()


def read(data: Any, name: str) -> Rows:
    """A file holds one grasp."""

    def grasp(i: int) -> RecordedGrasp:
        at_all = entry(data, "grasp_qpos")
        object_pose = pose_of(np.ravel(data["obj_pose"]), "obj_pose") if "obj_pose" in data else np.eye(4)
        at = posture_of(np.ravel(at_all), "grasp_qpos", object_pose)
        squeeze, before = (
            posture_of(np.ravel(data[key]), key, object_pose) if key in data else None
            for key in ("squeeze_qpos", "pregrasp_qpos")
        )
        scale = positive(data.get("obj_scale", 1.0), "obj_scale")
        return RecordedGrasp(i, at, squeeze, before, object=text(data.get("obj_path")) or name, scale=scale)

    return rows(1, grasp)


def written(rows_: dict[str, Array], object_path: str, scale: float) -> dict[str, Any]:
    """A grasp as a file holds it; `rows_` by key, position, quaternion and joints, with the object at the origin."""
    pose = np.array([0.0, 0, 0, 1, 0, 0, 0])
    return {"obj_pose": pose, "obj_scale": scale, "obj_path": object_path, **rows_}


LAYOUT = PublishedLayout("dexgraspbench", "grasp_qpos beside obj_pose and obj_path", recognises, read)
