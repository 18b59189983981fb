"""Every published layout: a file written here is recognised by its keys and says the grasp that was put in."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.datasets.published import published_file
from handfast.datasets.published.layouts import rotation_6d
from handfast.datasets.published.published_file import LAYOUTS, read_published
from handfast.datasets.published.recorded import BrokenRow, RecordedGrasp
from tests.support.published import LEFT, RIGHT, dexgraspnet_row, root, row, samples, saved_npy, torch_file


@pytest.mark.parametrize("name", LAYOUTS)
def test_each_layout(name: str, tmp_path: Path) -> None:
    layout, found = read_published(samples(tmp_path)[name])
    (grasp,) = found
    assert layout == name
    assert isinstance(grasp, RecordedGrasp)
    assert np.allclose(grasp.grasp.root, root(), atol=1e-6)
    joints = grasp.grasp.joints
    if name == "graspgen":
        assert joints == {}
    elif isinstance(joints, Mapping):
        assert joints == pytest.approx({"L": LEFT, "R": RIGHT}, abs=1e-7)
    else:
        assert np.allclose(joints, [RIGHT, LEFT], atol=1e-7)
    assert "cube" in grasp.object
    assert grasp.scale == 1
    squeezes = {"bodex": 0.3, "dexgraspbench": 0.3, "dexonomy": 0.3, "graspqp": LEFT + 0.2}
    assert (grasp.squeeze is not None) == (name in squeezes)
    if grasp.squeeze is not None:
        values = grasp.squeeze.joints
        assert (values["L"] if isinstance(values, Mapping) else values[1]) == pytest.approx(squeezes[name])
    assert (grasp.pregrasp is not None) == (name in ("bodex", "dexgraspbench", "dexonomy", "isaac_grasp"))


def test_the_hand_is_posed_in_the_frame_of_a_turned_object(tmp_path: Path) -> None:
    turned = np.array([0.1, 0.2, 0.3, np.sqrt(0.5), 0, np.sqrt(0.5), 0])  # a quarter about y
    data = {"grasp_qpos": row(), "obj_pose": turned, "obj_path": "cube"}
    (grasp,) = read_published(saved_npy(tmp_path / "0.npy", data))[1]
    assert isinstance(grasp, RecordedGrasp)
    world = np.array([[0, 0, 1, 0.1], [0, 1, 0, 0.2], [-1, 0, 0, 0.3], [0, 0, 0, 1]])
    assert np.allclose(world @ grasp.grasp.root, root())


def test_older_dexonomy_says_the_object_in_its_scene(tmp_path: Path) -> None:
    entry = {"pose": [0, 0, 0, 1, 0, 0, 0], "scale": [0.5] * 3, "file_path": "x/cube/mesh/cube.obj"}
    scene = {"scene": {"cube": entry}, "task": {"obj_name": "cube"}}
    data = {"grasp_qpos": row()[None], "hand_template_name": "pinch", "hand_type": "tiny", "scene_cfg": scene}
    layout, found = read_published(saved_npy(tmp_path / "0.npy", data))
    (grasp,) = found
    assert isinstance(grasp, RecordedGrasp)
    assert (layout, grasp.scale, grasp.object, grasp.hand) == ("dexonomy", 0.5, "x/cube/mesh/cube.obj", "tiny")


def test_euler_angles_are_about_fixed_axes_x_first(tmp_path: Path) -> None:
    one = dexgraspnet_row()
    one["qpos"] |= {"WRJRx": np.pi / 2, "WRJRy": 0.0, "WRJRz": np.pi / 2}
    (grasp,) = read_published(saved_npy(tmp_path / "cube.npy", np.array([one], dtype=object)))[1]
    assert isinstance(grasp, RecordedGrasp)
    # y goes to z by the first turn and stays there; z goes to -y, and by the second turn to x
    assert np.allclose(grasp.grasp.root[:3, :3] @ np.eye(3)[1], [0, 0, 1])
    assert np.allclose(grasp.grasp.root[:3, :3] @ np.eye(3)[2], [1, 0, 0])


def broken(**changes: Any) -> dict[str, Any]:
    one = dexgraspnet_row()
    qpos = one["qpos"] | changes.pop("qpos", {})
    return one | changes | {"qpos": {k: v for k, v in qpos.items() if v != "gone"}}


@pytest.mark.parametrize(
    "bad, says",
    [
        (broken(scale=0.0), "scale: .* above 0"),
        (broken(scale=[1.0, 2.0, 1.0]), "scale: .* one factor"),
        (broken(qpos={"WRJTx": float("nan")}), r"qpos\.WRJTx: .*NaN"),
        (broken(qpos={"L": "half"}), r"qpos\.L: .*no numbers"),
        (broken(qpos={"WRJRy": "gone"}), "has no WRJRy"),
        ({"scale": 1.0}, "qpos: is missing"),
        (7, "dictionary with the key 'qpos'"),
    ],
)
def test_a_broken_row_is_recorded_and_the_rest_goes_on(bad: Any, says: str, tmp_path: Path) -> None:
    data = np.array([dexgraspnet_row(), bad, dexgraspnet_row()], dtype=object)
    first, second, third = read_published(saved_npy(tmp_path / "cube.npy", data))[1]
    assert isinstance(first, RecordedGrasp)
    assert isinstance(third, RecordedGrasp)
    assert isinstance(second, BrokenRow)
    assert second.index == 1
    with pytest.raises(InputError, match=says):
        raise InputError(second.reason)


def test_quaternions_and_matrices_that_are_none(tmp_path: Path) -> None:
    short = row()
    short[3:7] *= 0.9
    (bad,) = read_published(saved_npy(tmp_path / "0.npy", {"grasp_qpos": short, "obj_path": "cube"}))[1]
    assert isinstance(bad, BrokenRow)
    assert "quaternion of length 0.9" in bad.reason
    np.savez(tmp_path / "cube.npz", pose=2 * root()[None], joints=np.zeros((1, 2)))
    (bad,) = read_published(tmp_path / "cube.npz")[1]
    assert isinstance(bad, BrokenRow)
    assert "no rigid motion" in bad.reason or "not a rigid motion" in bad.reason
    q = np.r_[np.zeros(3), 1, 0, 0, 2, 0, 0, 0, 0]
    (bad,) = read_published(torch_file(tmp_path / "t.pt", {"metadata": [(q, "a+b", "c")]}))[1]
    assert isinstance(bad, BrokenRow)
    assert "parallel columns" in bad.reason


def test_six_numbers_of_a_rotation_are_turned_apart_evenly() -> None:
    x, y = np.array([1.0, 0.1, 0]), np.array([0.1, 1.0, 0])
    assert np.allclose(rotation_6d(np.r_[2 * x, 3 * y]), np.eye(3))


@pytest.mark.parametrize(
    "name, content, says",
    [
        ("a.txt", "", "ends in '.txt'; known are .npy"),
        ("a.json", '{"grips": 1}', "no known layout: it holds a dictionary with grips; give --layout"),
        ("a.yaml", "a: &x [1]\nb: *x\n", "has a reference"),
        ("a.yaml", "a: !!python/object/apply:os.system [id]\n", "no plain YAML"),
        ("a.yaml", "{", "no plain YAML"),
        ("a.yaml", "format: isaac_grasp\nformat_version: 2.0\ngrasps: {}\n", "2.0; 1.0 is understood"),
    ],
)
def test_files_that_are_none(name: str, content: str, says: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=says):
        list(read_published(tmp_path / name)[1])
    with pytest.raises(InputError, match="no such file"):
        read_published(tmp_path / "other.npy")


def test_exponents_without_a_dot_are_numbers(tmp_path: Path) -> None:
    text = "{position: [1e-3, 0, 0], orientation: {w: 1, xyz: [0, 0, 0]}, cspace_position: {L: 1e-1}}"
    (tmp_path / "cube.yaml").write_text(f"format: isaac_grasp\ngrasps: {{a: {text}}}\n")
    (grasp,) = read_published(tmp_path / "cube.yaml")[1]
    assert isinstance(grasp, RecordedGrasp)
    assert grasp.grasp.root[0, 3] == 1e-3
    assert grasp.grasp.joints == {"L": 0.1}


def test_the_layout_asked_for_wins(tmp_path: Path) -> None:
    file = saved_npy(tmp_path / "0.npy", {"grasp_qpos": row(), "obj_path": "cube"})
    assert read_published(file, "dexonomy")[0] == "dexonomy"
    with pytest.raises(InputError, match=r"does not fit the layout graspgen|is missing"):
        read_published(file, "graspgen")
    with pytest.raises(InputError, match="unknown layout 'x'; known: dexgraspnet, bodex"):
        read_published(file, "x")


ODD: list[Any] = [
    1e300,
    float("nan"),
    None,
    "x",
    [],
    {},
    np.zeros(3),
    np.zeros((0, 7)),
    10**400,
    b"x",
    {"a": 1},
    3 + 4j,
]


@pytest.mark.parametrize("name", LAYOUTS)
def test_odd_values_anywhere_are_faults_of_the_file_or_the_row(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = samples(tmp_path)[name]
    whole = published_file._data(file)
    first = whole[0] if isinstance(whole, np.ndarray) else whole
    for place in paths(first):
        for odd in ODD:
            changed = altered(first, place, odd)
            data = [changed] if isinstance(whole, np.ndarray) else changed
            monkeypatch.setattr(published_file, "_data", lambda _, data=data: data)
            found = published_file._rows(file, name, None)
            if isinstance(found, InputError):
                assert str(file) in str(found)
            else:
                assert all(isinstance(r, RecordedGrasp) or r.reason for r in found[1])


def paths(data: Any) -> list[tuple[Any, ...]]:
    """Ways to each value in dictionaries and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list | tuple) else ()
    return [(), *((key, *rest) for key, value in items for rest in paths(value))]


def altered(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    """The same with another value at a place."""
    if not place:
        return value
    if isinstance(data, dict):
        return data | {place[0]: altered(data[place[0]], place[1:], value)}
    return type(data)(altered(x, place[1:], value) if i == place[0] else x for i, x in enumerate(data))
