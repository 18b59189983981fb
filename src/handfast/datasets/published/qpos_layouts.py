"""Layouts that pose hand and object in one world: DexGraspBench, Dexonomy, BODex.

A posture is a row of numbers: position [m], quaternion (w, x, y, z), joint values [rad, m].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.datasets.published.recorded import (
    Posture,
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

AT_ORIGIN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def read_qpos(data: Any, name: str) -> Rows:
    """DexGraspBench and Dexonomy: `grasp_qpos` (q) or (n, q), `squeeze_qpos` and `pregrasp_qpos` like it.

    A DexGraspBench file holds one grasp. Older files of Dexonomy say the object in their scene. Where the pre-grasps
    of a file are more or fewer than its grasps, the last one is taken.
    """
    grasps = _matrix(entry(data, "grasp_qpos"), "grasp_qpos")
    scene = _scene(data)
    path = text(data.get("obj_path")) or text(scene.get("file_path")) or text(data.get("scene_path")) or name
    hand = text(data.get("hand_name")) or text(data.get("hand_type"))

    def grasp(i: int) -> RecordedGrasp:
        pose = pose_of(np.ravel(data.get("obj_pose", scene.get("pose", AT_ORIGIN))), "obj_pose")
        scale = positive(data.get("obj_scale", scene.get("scale", 1.0)), "obj_scale")

        def posture(key: str) -> Posture | None:
            if key not in data:
                return None
            found = _matrix(data[key], key)
            return posture_of(found[i if len(found) == len(grasps) else -1], key, pose)

        at = posture_of(grasps[i], "grasp_qpos", pose)
        squeeze, before = posture("squeeze_qpos"), posture("pregrasp_qpos")
        return RecordedGrasp(i, at, squeeze, before, object=path, scale=scale, hand=hand)

    return rows(len(grasps), grasp)


def _matrix(value: Any, field: str) -> Array:
    """(n, q) of what has one row or several, in as many dimensions as it likes."""
    found = np.asarray(value)
    return numbers(
        found.reshape(-1, found.shape[-1]) if found.ndim != 1 and found.size else found[None], (None, None), field
    )


def _scene(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The object's entry in the scene that older files of Dexonomy hold; empty without one."""
    whole = data.get("scene_cfg")
    scene = whole.get("scene") if isinstance(whole, Mapping) else None
    task = whole.get("task") if isinstance(whole, Mapping) else None
    name = text(task.get("obj_name")) if isinstance(task, Mapping) else ""
    found = scene.get(name) if isinstance(scene, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def read_bodex(data: Any, name: str) -> Rows:
    """BODex: `robot_pose` (1, n, 3, 7 + q) of pre-grasp, grasp and squeeze, `joint_names`.

    The object, its pose and its scale are the mesh of `world_cfg` that `manip_name` names.
    """
    poses = numbers(entry(data, "robot_pose"), (1, None, 3, None), "robot_pose")[0]
    names = [text(n) for n in entry(data, "joint_names")]
    if len(names) != poses.shape[2] - 7 or not all(names) or len(set(names)) < len(names):
        raise InputError(f"has {len(names)} names for {poses.shape[2] - 7} joint values", field="joint_names")
    mesh = _mesh(data)
    scale = positive(mesh.get("scale", 1.0), "world_cfg.mesh.scale")
    object_pose = pose_of(np.ravel(mesh.get("pose", AT_ORIGIN)), "world_cfg.mesh.pose")
    path = text(mesh.get("file_path")) or text(data.get("scene_path")) or name

    def named(row: Array) -> Posture:
        found = posture_of(row, "robot_pose", object_pose)
        return Posture(found.root, dict(zip(names, np.asarray(found.joints).tolist(), strict=True)))

    def grasp(i: int) -> RecordedGrasp:
        before, at, after = map(named, poses[i])
        return RecordedGrasp(i, at, after, before, object=path, scale=scale)

    return rows(len(poses), grasp)


def _mesh(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The entry of the object; empty where the file leaves it to a scene file."""
    world = data.get("world_cfg")
    while isinstance(world, list | tuple | np.ndarray) and len(world):
        world = world[0]
    meshes = world.get("mesh") if isinstance(world, Mapping) else None
    if not isinstance(meshes, Mapping) or not meshes:
        return {}
    chosen = meshes.get(text(data.get("manip_name")), next(iter(meshes.values())))
    return chosen if isinstance(chosen, Mapping) else {}
