"""Dexonomy: `grasp_qpos` (1, q) and `squeeze_qpos` of one grasp, with its template; newer and older keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    numbers,
    pose_of,
    positive,
    posture_of,
    rows,
    text,
)

NEW, OLD = ("tmpl_name", "hand_name"), ("hand_template_name", "hand_type")


def recognises(data: Any) -> bool:
    """By `grasp_qpos` and a template's name, in either spelling."""
    return isinstance(data, Mapping) and "grasp_qpos" in data and bool({NEW[0], OLD[0]} & data.keys())


def read(data: Any, name: str) -> Rows:
    """As many grasps as `grasp_qpos` has rows; the pre-grasp is the last of a file's that has one grasp."""
    grasps = np.atleast_2d(numbers(_flat(entry(data, "grasp_qpos")), (None, None), "grasp_qpos"))
    scene = _scene(data)
    object_pose = pose_of(np.ravel(_first(data, scene, "obj_pose", "pose", [0, 0, 0, 1, 0, 0, 0])), "obj_pose")
    scale = positive(_first(data, scene, "obj_scale", "scale", 1.0), "obj_scale")
    path = text(data.get("obj_path")) or text(scene.get("file_path")) or text(data.get("scene_path")) or name
    hand = text(data.get(NEW[1])) or text(data.get(OLD[1]))

    def row(key: str, i: int) -> Posture | None:
        if key not in data:
            return None
        found = numbers(_flat(data[key]), (None, None), key)
        return posture_of(found[i if len(found) == len(grasps) else -1], key, object_pose)

    def grasp(i: int) -> RecordedGrasp:
        at = posture_of(grasps[i], "grasp_qpos", object_pose)
        return RecordedGrasp(
            i, at, row("squeeze_qpos", i), row("pregrasp_qpos", i), object=path, scale=scale, hand=hand
        )

    return rows(len(grasps), grasp)


def _flat(value: Any) -> Array:
    """(n, q) of what has one row or several."""
    found = np.asarray(value)
    return found.reshape(-1, found.shape[-1]) if found.ndim != 1 and found.size else found[None]


def _scene(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The object's entry in the scene that older files hold; empty without one."""
    whole = data.get("scene_cfg")
    scene = whole.get("scene") if isinstance(whole, Mapping) else None
    task = whole.get("task") if isinstance(whole, Mapping) else None
    name = text(task.get("obj_name")) if isinstance(task, Mapping) else ""
    found = scene.get(name) if isinstance(scene, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _first(data: Mapping[str, Any], scene: Mapping[str, Any], key: str, in_scene: str, otherwise: Any) -> Any:
    return data[key] if key in data else scene.get(in_scene, otherwise)


LAYOUT = PublishedLayout("dexonomy", "grasp_qpos and tmpl_name (older: hand_template_name)", recognises, read)
