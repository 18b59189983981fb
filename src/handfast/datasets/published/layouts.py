"""Published layouts, how each is recognised by its keys, and how its grasps are read.

DexGraspBench, Dexonomy and BODex pose hand and object in one world; a posture is a row of numbers: position [m],
quaternion (w, x, y, z), joint values [rad, m]. DexGraspNet, GraspQP, MultiDex, mj_grasp_sim, GraspGen and isaac_grasp
pose the hand in the frame of the object. Where nothing else is said the object is called as the file is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.transforms import roll_pitch_yaw, transform
from handfast.datasets.published.recorded import (
    Posture,
    RecordedGrasp,
    Rows,
    entry,
    matrix_pose,
    named_numbers,
    number,
    numbers,
    pose_of,
    positive,
    posture_of,
    rows,
    text,
)

AT_ORIGIN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # a pose
# [m]; [rad] about the fixed x, then y, then z
PLACE, ROTATION_JOINTS = ("WRJTx", "WRJTy", "WRJTz"), ("WRJRx", "WRJRy", "WRJRz")
SQUEEZE = 0.2  # [rad] of the joint that GraspQP's velocities move most; they say the direction alone


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


def read_dexgraspnet(data: Any, name: str) -> Rows:
    """DexGraspNet: a list of `{scale, qpos, energy}`; `qpos` by name, the wrist's place and Euler angles among them."""

    def grasp(i: int) -> RecordedGrasp:
        values = named_numbers(entry(data[i], "qpos"), "qpos")
        missing = [k for k in (*PLACE, *ROTATION_JOINTS) if k not in values]
        if missing:
            raise InputError(f"has no {missing[0]}", field="qpos")
        place, turn = ([values.pop(k) for k in keys] for keys in (PLACE, ROTATION_JOINTS))
        score = None if data[i].get("energy") is None else number(data[i]["energy"], "energy")
        at = Posture(transform(place, roll_pitch_yaw(*turn)), values)
        return RecordedGrasp(i, at, object=name, scale=positive(entry(data[i], "scale"), "scale"), score=score)

    return rows(len(data), grasp)


def read_graspqp(data: Any, name: str) -> Rows:
    """GraspQP: `parameters` hold the joints by name, (n,) each, and `root_pose` (n, 7).

    The squeeze follows `grasp_velocities_off` and a tenth of `grasp_velocities`.
    """
    parameters = data["parameters"]
    poses = numbers(entry(parameters, "root_pose"), (None, 7), "parameters.root_pose")
    n = len(poses)
    joints = {str(k): numbers(v, (n,), f"parameters.{k}") for k, v in parameters.items() if k != "root_pose"}
    if not joints:
        raise InputError("has no joints", field="parameters")

    def velocity(key: str, joint: str) -> Array:
        found = data.get(key)
        known = isinstance(found, Mapping) and joint in found
        return numbers(found[joint], (n,), f"{key}.{joint}") if known else np.zeros(n)

    factor = 0.1 if "grasp_velocities_off" in data else 1.0
    speeds = {k: factor * velocity("grasp_velocities", k) + velocity("grasp_velocities_off", k) for k in joints}
    scores = numbers(np.ravel(data["values"]), (n,), "values").tolist() if "values" in data else [None] * n

    def grasp(i: int) -> RecordedGrasp:
        at = Posture(pose_of(poses[i], "parameters.root_pose"), {k: float(v[i]) for k, v in joints.items()})
        most = max(abs(float(v[i])) for v in speeds.values())
        further = {k: float(v[i] + SQUEEZE * speeds[k][i] / most) for k, v in joints.items()} if most else None
        squeeze = None if further is None else Posture(at.root, further)
        return RecordedGrasp(i, at, squeeze, object=name, score=scores[i])

    return rows(n, grasp)


def read_multidex(data: Any, name: str) -> Rows:
    """MultiDex and GenDexGrasp: `metadata` is a list of (q, "set+object", robot).

    q is position [m], 6-D rotation, joints; the hand is posed in the frame of what stands after the "+".
    """
    found = entry(data, "metadata")

    def grasp(i: int) -> RecordedGrasp:
        row = found[i]
        if not isinstance(row, list | tuple) or not 2 <= len(row) <= 3:
            raise InputError("is no triple of joints, object and robot", field="metadata")
        q = numbers(row[0], (None,), "metadata.q")
        if len(q) < 9:
            raise InputError(f"has {len(q)} numbers; position, 6-D rotation and joints are needed", field="metadata.q")
        at = Posture(transform(q[:3], rotation_6d(q[3:9])), q[9:])
        return RecordedGrasp(i, at, object=text(row[1]), hand=text(row[2]) if len(row) == 3 else "")

    return rows(len(found), grasp)


def rotation_6d(six: Array) -> Array:
    """(3, 3) whose first two columns are the given ones (6,), made unit and turned apart evenly until square."""
    x, y = (v / max(float(np.linalg.norm(v)), 1e-12) for v in (six[:3], six[3:]))
    between, across = x + y, x - y
    lengths = np.linalg.norm(between), np.linalg.norm(across)
    if min(lengths) < 1e-6:
        raise InputError("has a 6-D rotation of parallel columns", field="metadata.q")
    a, b = between / lengths[0], across / lengths[1]
    x, y = (a + b) / np.sqrt(2), (a - b) / np.sqrt(2)
    return np.column_stack([x, y, np.cross(x, y)])


def read_mj_grasp_sim(data: Any, name: str) -> Rows:
    """mj_grasp_sim: npz with `pose` (n, 4, 4) of the hand and `joints` (n, k)."""
    poses, joints = np.asarray(entry(data, "pose")), np.asarray(entry(data, "joints"))
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or joints.ndim != 2 or len(joints) != len(poses):
        problem = f"have shapes {poses.shape} and {joints.shape}; (N, 4, 4) and (N, k) are needed"
        raise InputError(problem, field="pose and joints")

    def grasp(i: int) -> RecordedGrasp:
        at = Posture(matrix_pose(poses[i], f"pose[{i}]"), numbers(joints[i], (None,), f"joints[{i}]"))
        return RecordedGrasp(i, at, object=name)

    return rows(len(poses), grasp)


def read_graspgen(data: Any, name: str) -> Rows:
    """GraspGen: JSON with `object` {file, scale} and `grasps` {transforms (n, 4, 4), object_in_gripper (n,)}.

    Transforms are of the gripper's base; its joints are the mapping's, as the files have none. A grasp that the file
    says failed is kept with the score 0.
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


def read_isaac_grasp(data: Any, name: str) -> Rows:
    """isaac_grasp 1.0: YAML with the gripper's pose and its joints by name, for each named grasp."""
    version = data.get("format_version")
    if version is not None and number(version, "format_version") != 1.0:
        raise InputError(f"is {version}; 1.0 is understood", field="format_version")
    found = entry(data, "grasps")
    if not isinstance(found, Mapping):
        raise InputError("is no dictionary of named grasps", field="grasps")
    names = list(found)

    def grasp(i: int) -> RecordedGrasp:
        with FaultsOf(field=f"grasps.{names[i]}"):
            return _isaac_grasp(found[names[i]], i, name)

    return rows(len(names), grasp)


def _isaac_grasp(row: Any, index: int, name: str) -> RecordedGrasp:
    turn = entry(row, "orientation")
    quaternion = [number(entry(turn, "w"), "orientation.w"), *numbers(entry(turn, "xyz"), (3,), "orientation.xyz")]
    root = pose_of([*numbers(entry(row, "position"), (3,), "position"), *quaternion], "orientation")
    at, before = (named_numbers(row.get(key) or {}, key) for key in ("cspace_position", "pregrasp_cspace_position"))
    score = number(row["confidence"], "confidence") if "confidence" in row else None
    pregrasp = Posture(root, before) if before else None
    return RecordedGrasp(index, Posture(root, at), pregrasp=pregrasp, object=name, score=score)


# --- which layout a file has ----------------------------------------------------------------------


@dataclass(frozen=True)
class PublishedLayout:
    """A published layout.

    Attributes:
        keys: what its files hold, in words.
        recognises: whether data are of this layout, by their keys.
        read: the grasps of the data of a file; the second argument is the file's name without its endings.
    """

    keys: str
    recognises: Callable[[Any], bool]
    read: Callable[[Any, str], Rows]


def _has(*keys: str, either: tuple[str, ...] = ()) -> Callable[[Any], bool]:
    """Is it a dictionary with all of these keys, and with one of some others?"""
    return lambda data: (
        isinstance(data, Mapping) and data.keys() >= {*keys} and (not either or not data.keys().isdisjoint(either))
    )


def _within(key: str, inner: str) -> Callable[[Any], bool]:
    """Is it a dictionary with a dictionary under a key, which has another key?"""
    return lambda data: _has(key)(data) and _has(inner)(data[key])


def _is_dexgraspnet(data: Any) -> bool:
    first = data[0] if isinstance(data, list | np.ndarray) and np.ndim(data) == 1 and len(data) else None
    return isinstance(first, Mapping) and isinstance(first.get("qpos"), Mapping)


def _is_multidex(data: Any) -> bool:
    found = data.get("metadata") if isinstance(data, Mapping) else None
    first = found[0] if isinstance(found, list | tuple) and found else ("", "")
    return isinstance(found, list | tuple) and isinstance(first, list | tuple) and len(first) >= 2


LAYOUTS: dict[str, PublishedLayout] = {  # the first that recognises a file has it
    "dexgraspnet": PublishedLayout("a list of {scale, qpos}", _is_dexgraspnet, read_dexgraspnet),
    "bodex": PublishedLayout("robot_pose and joint_names", _has("robot_pose", "joint_names"), read_bodex),
    "dexonomy": PublishedLayout(
        "grasp_qpos and tmpl_name (older: hand_template_name)",
        _has("grasp_qpos", either=("tmpl_name", "hand_template_name")),
        read_qpos,
    ),
    "dexgraspbench": PublishedLayout(
        "grasp_qpos beside obj_pose and obj_path",
        _has("grasp_qpos", either=("obj_path", "obj_pose")),
        read_qpos,
    ),
    "graspqp": PublishedLayout("parameters with root_pose", _within("parameters", "root_pose"), read_graspqp),
    "multidex": PublishedLayout("metadata, a list of (q, object, robot)", _is_multidex, read_multidex),
    "mj_grasp_sim": PublishedLayout("pose (N, 4, 4) and joints (N, k)", _has("pose", "joints"), read_mj_grasp_sim),
    "graspgen": PublishedLayout("object and grasps with transforms", _within("grasps", "transforms"), read_graspgen),
    "isaac_grasp": PublishedLayout(
        "format: isaac_grasp",
        lambda data: _has("format")(data) and bool(data["format"] == "isaac_grasp"),
        read_isaac_grasp,
    ),
}
