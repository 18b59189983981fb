"""Exported MuJoCo scenes are run: what the grasp holds is lifted and stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast import load_grasp, save_grasp
from handfast.core.errors import InputError
from handfast.datasets.published.mujoco_scene import HEIGHT, TIMES, scene_text, standing
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import from_dict, to_dict
from tests.support.program import complains, run

mujoco = pytest.importorskip("mujoco")


def lifted(grasp: Grasp, until: float = 4.5) -> list[float]:
    """[m] how high the object is above its first place, at the end of the lift and later."""
    model = mujoco.MjModel.from_xml_string(scene_text(grasp))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    first, found = float(data.qpos[2]), []
    for stop in (TIMES["lifted"] + 0.5, until):
        while data.time < stop:
            data.ctrl[:] = [np.interp(data.time, model.key_time, model.key_ctrl[:, i]) for i in range(model.nu)]
            mujoco.mj_step(model, data)
        found.append(float(data.qpos[2]) - first)
    return found


@pytest.mark.parametrize("name", ["barrett-can", "barrett-torch", "fig7"])
def test_the_object_is_lifted_and_stays(name: str) -> None:
    grasp = load_grasp(name)
    there, later = lifted(grasp if grasp.mass else grasp.about(mass=0.2))
    assert there == pytest.approx(HEIGHT, rel=0.1)
    assert later == pytest.approx(there, abs=1e-3)


def test_without_friction_it_is_not_lifted() -> None:
    there, _ = lifted(load_grasp("barrett-can").with_friction(0.01))
    assert there < 0.5 * HEIGHT


def test_the_keyframes_are_the_controller() -> None:
    model = mujoco.MjModel.from_xml_string(scene_text(load_grasp("barrett-can")))
    assert model.key_time.tolist() == list(TIMES.values())
    assert [model.key(k).name for k in range(model.nkey)] == list(TIMES)
    assert model.key_ctrl[:, -1].tolist() == [0, 0, 0, HEIGHT]
    names = [model.actuator(k).name for k in range(model.nu)]
    for motor in ("finger_1_prox", "finger_2_prox", "finger_3_prox"):
        opened, closed, squeezed, _ = model.key_ctrl[:, names.index(motor)]
        assert opened < closed < squeezed
        k, force = names.index(motor), load_grasp("barrett-can").preload[motor]
        assert model.actuator_gainprm[k, 0] * (squeezed - closed) == pytest.approx(force, rel=1e-3)  # six digits
    assert model.body("object").mass == pytest.approx(load_grasp("barrett-can").mass)


def test_what_stands_firmest() -> None:
    slab = np.array([[x, y, z] for x in (-0.01, 0.01) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    assert abs((slab @ standing(slab, np.zeros(3)).T)[:, 2]).max() == pytest.approx(0.01)
    heavy = np.array([0.0, 0.0, -0.09])  # at one end of a cube
    cube = slab * [10, 1, 1]
    assert (standing(cube, heavy) @ heavy)[2] == pytest.approx(-0.09)


def test_what_a_scene_needs() -> None:
    with pytest.raises(InputError, match="provenance: hand and object are not known"):
        scene_text(load_grasp("tendon-fingers").about(mass=0.1))
    with pytest.raises(InputError, match="mass: is missing; what is lifted needs one"):
        scene_text(from_dict({key: value for key, value in to_dict(load_grasp("fig7")).items() if key != "mass"}))


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    for number in range(2):
        save_grasp(load_grasp("barrett-can"), Path(f"planned/00{number}.grasp.json"))
    command = ["export", "planned", "--layout", "mujoco"]
    assert run(capsys, *command, "-o", "scenes")[:2] == (0, "2 scenes, layout mujoco: scenes\n")
    assert sorted(f.name for f in Path("scenes").iterdir()) == ["000.xml", "001.xml"]
    assert mujoco.MjModel.from_xml_path("scenes/000.xml").nkey == 4
    complains(capsys, [*command, "-o", "scenes"], ["000.xml: exists already; give --force"])
    complains(capsys, [*command, "-o", "one.xml"], ["one.xml: is one file for 2 grasps; give a folder"])
    complains(capsys, [*command, "-o", "x", "--hand", "a"], ["--hand: is of other layouts"])
    complains(capsys, [*command], ["missing: -o FOLDER"])
