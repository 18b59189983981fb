"""BODex: `robot_pose` (1, N, 3, 7 + q) of pre-grasp, grasp and squeeze, in the world of the object's own pose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
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


def recognises(data: Any) -> bool:
    """By `robot_pose` and `joint_names`."""
    return isinstance(data, Mapping) and {"robot_pose", "joint_names"} <= data.keys()


def read(data: Any, name: str) -> Rows:
    """The object, its pose and its scale are the mesh of `world_cfg` that `manip_name` names."""
    poses = numbers(entry(data, "robot_pose"), (1, None, 3, None), "robot_pose")[0]
    names = [text(n) for n in entry(data, "joint_names")]
    if len(names) != poses.shape[2] - 7 or not all(names) or len(set(names)) < len(names):
        raise InputError(f"has {len(names)} names for {poses.shape[2] - 7} joint values", field="joint_names")
    mesh = _mesh(data)
    scale = positive(mesh.get("scale", 1.0), "world_cfg.mesh.scale")
    object_pose = pose_of(np.ravel(mesh["pose"]), "world_cfg.mesh.pose") if "pose" in mesh else np.eye(4)
    path = text(mesh.get("file_path")) or text(data.get("scene_path"))

    def grasp(i: int) -> RecordedGrasp:
        before, at, after = (_named(poses[i, k], names, object_pose) for k in range(3))
        return RecordedGrasp(i, at, after, before, object=path or name, scale=scale)

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


def _named(row: Array, names: list[str], object_pose: Array) -> Posture:
    found = posture_of(row, "robot_pose", object_pose)
    return Posture(found.root, dict(zip(names, np.asarray(found.joints).tolist(), strict=True)))


LAYOUT = PublishedLayout("bodex", "robot_pose and joint_names", recognises, read)
