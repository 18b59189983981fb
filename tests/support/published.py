"""A tiny hand, its object, and files of published layouts, written here with the standard library."""

from __future__ import annotations

import io
import pickle
import sys
import types
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array

# Two fingers, hinges 60 mm apart, capsules of 8 mm radius: 22 mm of room on either side of the middle at q = 0.
HAND = """<mujoco model="tiny">
  <compiler angle="radian"/>
  <worldbody>
    <body name="palm" pos="0 0 0.034">
      <geom type="box" size="0.045 0.02 0.008"/>
      <body name="left" pos="-0.03 0 0.012">
        <joint name="left_hinge" axis="0 1 0" range="-0.6 0.8"/>
        <geom type="capsule" fromto="0 0 0.012 0 0 0.07" size="0.008"/>
      </body>
      <body name="right" pos="0.03 0 0.012">
        <joint name="right_hinge" axis="0 -1 0" range="-0.6 0.8"/>
        <geom type="capsule" fromto="0 0 0.012 0 0 0.07" size="0.008"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
LEFT, RIGHT = 0.1, 0.12  # [rad] of the grasp that the files hold
AT = 0.05  # [m] the object's centre above the palm's origin
OFFSET = 0.034  # [m] of the palm above the frame in which the files pose the hand


def tiny(folder: Path, *, half: float = 0.02) -> tuple[str, str, str]:
    """Files of the hand, of a mapping for it and, as `cube/cube.obj` in `objects/`, of a cube: its half edge [m]."""
    import json

    (folder / "objects" / "cube").mkdir(parents=True, exist_ok=True)
    hand, mapping, mesh = folder / "tiny.xml", folder / "tiny.json", folder / "objects" / "cube" / "cube.obj"
    hand.write_text(HAND)
    order = {"joints": ["right_hinge", "left_hinge"], "names": {"L": "left_hinge", "R": "right_hinge"}}
    about = {"schema": "handfast/mapping/1", "link": "palm", "offset": {"position": [0, 0, OFFSET]}}
    mapping.write_text(json.dumps(about | order))
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    mesh.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {f}\n" for f in faces))
    return str(hand), str(mapping), str(mesh)


def root(turn: float = 0.3) -> Array:
    """(4, 4) the files' hand frame in the object's: the palm below the object, and all of it turned about z."""
    out = np.eye(4)
    out[:3, :3] = [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    out[2, 3] = -AT - OFFSET
    return out


def row(q: tuple[float, ...] = (RIGHT, LEFT), turn: float = 0.3) -> Array:
    """(9,) position, quaternion w x y z, joints."""
    return np.r_[root(turn)[:3, 3], np.cos(turn / 2), 0, 0, np.sin(turn / 2), q]


def saved_npy(path: Path, data: Any) -> Path:
    """As `numpy.save` does it for what is pickled."""
    np.save(path, np.array(data, dtype=object) if isinstance(data, dict) else data, allow_pickle=True)
    return path


def dexgraspnet_row(turn: float = 0.3) -> dict[str, Any]:
    at = root(turn)
    place = {f"WRJT{a}": float(x) for a, x in zip("xyz", at[:3, 3], strict=True)}
    return {"scale": 1.0, "qpos": {**place, "WRJRx": 0.0, "WRJRy": 0.0, "WRJRz": turn, "L": LEFT, "R": RIGHT}}


class FloatStorage:
    """Stands for torch's class of that name."""


class _Tensor:
    def __init__(self, numbers: Array) -> None:
        self.numbers = np.ascontiguousarray(numbers, dtype="<f4")


def _rebuild_tensor_v2(*_: Any) -> None: ...


class _TorchPickler(pickle.Pickler):
    """Writes what torch writes: names, and the numbers in files beside."""

    def __init__(self, stream: io.BytesIO, stored: list[bytes]) -> None:
        super().__init__(stream, 2)
        self.stored = stored

    def reducer_override(self, x: Any) -> Any:
        if isinstance(x, _Tensor):
            self.stored.append(x.numbers.tobytes())
            key = _Key(len(self.stored) - 1, x.numbers.size)
            stride = tuple(s // 4 for s in x.numbers.strides)
            return _rebuild_tensor_v2, (key, 0, x.numbers.shape, stride, False, {})
        return NotImplemented

    def persistent_id(self, x: Any) -> Any:
        return ("storage", FloatStorage, str(x.key), "cpu", x.count) if isinstance(x, _Key) else None


class _Key:
    def __init__(self, key: int, count: int) -> None:
        self.key, self.count = key, count


def torch_file(path: Path, data: Any) -> Path:
    """A file as `torch.save` writes it; arrays in `data` are its tensors."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    stream, stored = io.BytesIO(), list[bytes]()
    with pytest.MonkeyPatch.context() as patch:  # pickle looks up what it names
        for module, thing in ((torch, FloatStorage), (utils, _rebuild_tensor_v2)):
            setattr(module, thing.__name__, thing)
            patch.setattr(thing, "__module__", module.__name__)
            patch.setitem(sys.modules, module.__name__, module)
        _TorchPickler(stream, stored).dump(_tensors(data))
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("archive/data.pkl", stream.getvalue())
        packed.writestr("archive/byteorder", "little")
        for k, raw in enumerate(stored):
            packed.writestr(f"archive/data/{k}", raw)
    return path


def _tensors(data: Any) -> Any:
    if isinstance(data, np.ndarray):
        return _Tensor(data)
    if isinstance(data, dict):
        return {k: _tensors(v) for k, v in data.items()}
    return type(data)(map(_tensors, data)) if isinstance(data, list | tuple) else data


def samples(folder: Path) -> dict[str, Path]:
    """A file of each layout, all of the same grasp of the cube, by the layout's name."""
    import json

    import yaml

    pose, turned = root(), [float(x) for x in row()[3:7]]
    squeeze, before = row((0.3, 0.3)), row((-0.1, -0.1))
    cube = {"obj_pose": np.array([0, 0, 0, 1.0, 0, 0, 0]), "obj_scale": 1.0, "obj_path": "objects/cube"}
    postures = {"grasp_qpos": row(), "squeeze_qpos": squeeze, "pregrasp_qpos": before}
    world = {
        "mesh": {"s_cube": {"scale": np.ones(3), "pose": cube["obj_pose"], "file_path": "/far/cube/mesh/cube.obj"}}
    }
    contacts = {"hand_cpn_w": np.zeros((2, 6)), "n_evo": 3}
    bodex = {"robot_pose": np.stack([before, row(), squeeze])[None, None], "joint_names": ["R", "L"]}
    parameters = {"root_pose": row()[None, :7], "L": np.array([LEFT]), "R": np.array([RIGHT])}
    onwards = {"L": np.array([1.0]), "R": np.array([0.5])}
    isaac = {
        "confidence": 0.9,
        "position": pose[:3, 3].tolist(),
        "orientation": {"w": turned[0], "xyz": turned[1:]},
        "cspace_position": {"L": LEFT, "R": RIGHT},
        "pregrasp_cspace_position": {"L": -0.1, "R": -0.1},
    }
    generated = {"transforms": [pose.tolist()], "object_in_gripper": [True]}
    q = np.r_[pose[:3, 3], pose[:3, 0], pose[:3, 1], RIGHT, LEFT]
    files = {
        "dexgraspnet": saved_npy(folder / "cube.npy", np.array([dexgraspnet_row()], dtype=object)),
        "bodex": saved_npy(folder / "0_grasp.npy", bodex | {"world_cfg": [world], "manip_name": ["s_cube"]}),
        "dexgraspbench": saved_npy(folder / "1.npy", cube | postures),
        "dexonomy": saved_npy(
            folder / "new.npy",
            cube | {k: v[None] for k, v in postures.items()} | contacts | {"hand_name": "tiny", "tmpl_name": "pinch"},
        ),
        "graspqp": torch_file(
            folder / "cube.dexgrasp.pt",
            {"values": np.array([0.5]), "parameters": parameters, "grasp_velocities": onwards, "grasp_type": "pinch"},
        ),
        "multidex": torch_file(folder / "tiny.pt", {"info": {}, "metadata": [(q, "set+cube", "tiny")]}),
        "mj_grasp_sim": folder / "cube.npz",
        "graspgen": folder / "cube.json",
        "isaac_grasp": folder / "cube.yaml",
    }
    np.savez(files["mj_grasp_sim"], pose=pose[None], joints=np.array([[RIGHT, LEFT]]))
    files["graspgen"].write_text(json.dumps({"object": {"file": "cube.obj", "scale": 1.0}, "grasps": generated}))
    text = yaml.safe_dump({"format": "isaac_grasp", "format_version": 1.0, "grasps": {"grasp_0": isaac}})
    files["isaac_grasp"].write_text(text)
    return files
