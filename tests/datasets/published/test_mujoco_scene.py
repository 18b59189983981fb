"""Exported MuJoCo scenes are run: what the grasp holds is lifted and stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast import load_grasp, save_grasp
from handfast.core.errors import InputError
from handfast.datasets.published.mujoco_scene import HEIGHT, OPEN_ANGLE, TIMES, _Scene, play, scene_text, standing
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Grasp
from handfast.readers.configuration_file import load_parts
from handfast.readers.grasp_file import from_dict, to_dict
from tests.support.program import complains, run
from tests.support.sprung_jaws import sprung_jaws

mujoco = pytest.importorskip("mujoco")


def lifted(grasp: Grasp, until: float = 5.1) -> list[float]:
    """[m] how high the object is above its first place, at the end of the lift and later."""
    model = mujoco.MjModel.from_xml_string(scene_text(grasp))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    first, found = float(data.qpos[2]), []
    for stop in (TIMES["lifted"] + 0.5, until):
        play(model, data, stop)
        found.append(float(data.qpos[2]) - first)
    return found


@pytest.mark.parametrize("name", ["barrett-can", "barrett-torch", "fig7"])
def test_the_object_is_lifted_and_stays(name: str) -> None:
    grasp = load_grasp(name)
    there, later = lifted(grasp if grasp.mass else grasp.about(mass=0.2))
    assert there == pytest.approx(HEIGHT, rel=0.1)
    assert later == pytest.approx(there, abs=1e-3)


def test_without_friction_it_is_not_lifted() -> None:
    there, _ = lifted(load_grasp("barrett-torch").with_friction(0.01))
    assert there < 0.5 * HEIGHT


def test_the_keyframes_are_the_controller() -> None:
    grasp = load_grasp("barrett-can")
    model = mujoco.MjModel.from_xml_string(scene_text(grasp))
    assert model.key_time.tolist() == list(TIMES.values())
    assert [model.key(k).name for k in range(model.nkey)] == list(TIMES)
    assert model.key_ctrl[:, -1].tolist() == [0, 0, 0, 0, HEIGHT]
    names = [model.actuator(k).name for k in range(model.nu)]
    for motor in ("finger_1_prox", "finger_2_prox", "finger_3_prox"):
        k, gearing = names.index(motor), names.index(f"{motor} gearing")
        opened, closed, squeezed, *after = model.key_ctrl[:, k]
        assert [closed - opened, squeezed - closed] == pytest.approx([OPEN_ANGLE, OPEN_ANGLE], abs=1e-4)  # six digits
        assert after == [squeezed, squeezed]
        # it presses with its command and no more, and does not turn back from where it has squeezed
        assert model.actuator_forcerange[k] == pytest.approx(np.array([-1, 1]) * grasp.preload[motor], rel=1e-3)
        assert model.actuator_forcerange[gearing, 0] == 0
        stood = model.key_ctrl[list(TIMES).index("locked"), gearing]
        assert 0 <= stood - closed < 0.01
        assert model.key_ctrl[:, gearing] == pytest.approx([opened, closed, closed, stood, stood], abs=1e-4)
    assert model.body("object").mass == pytest.approx(grasp.mass)


def test_a_load_that_exceeds_the_command_does_not_open_the_hand() -> None:
    grasp = load_grasp("barrett-can")
    model = mujoco.MjModel.from_xml_string(scene_text(grasp))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    play(model, data, TIMES["lifted"])
    stands = data.actuator("finger_1_prox gearing").ctrl[0]
    data.joint("finger_1_prox").qfrc_applied[0] = -5 * grasp.preload["finger_1_prox"]
    play(model, data, TIMES["lifted"] + 1)
    assert data.tendon("motor finger_1_prox").length[0] > stands - 2e-3


def test_a_clutch_that_has_opened_stays_so() -> None:
    """The far joint of a finger whose near one was stopped is off its coupling: the scene begins and stays there."""
    grasp = load_grasp("barrett-can")
    placed = load_parts(grasp)
    name, near = "finger_1_dist", "finger_1_prox"
    q = placed.q.copy()
    q[placed.hand.joint(name)] += 0.2
    model = mujoco.MjModel.from_xml_string(str(_Scene(replace(placed, q=q), grasp).spec().to_xml()))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    play(model, data, 0.2)
    far, first = float(data.joint(name).qpos[0]), float(data.joint(near).qpos[0])
    off = placed.q[placed.hand.joint(name)] - placed.q[placed.hand.joint(near)] / 3
    assert far - first / 3 == pytest.approx(off + 0.2, abs=0.01)


def test_motors_of_joints_alone_press_too() -> None:
    """A grasp of a hand with couplings whose every joint has a motor of its own."""
    given = load_grasp("barrett-can")
    placed = load_parts(given)
    command = {"finger_1_dist": 0.05}
    direct = grasp_of(
        placed.hand, placed.q, given.contacts, placed.pose, preload=command, mechanism="direct"
    ).about(mass=0.1, provenance=given.provenance)  # fmt: skip
    model = mujoco.MjModel.from_xml_string(scene_text(direct))
    assert model.actuator("finger_1_dist").forcerange == pytest.approx([-0.05, 0.05])
    assert model.neq == 0


@pytest.mark.parametrize("left", ["lift", "object"])
def test_names_of_the_scene_and_springs(left: str, tmp_path: Path) -> None:
    """Links and joints may be called as parts of the scene are, as `world` is in published hands; springs are kept."""
    grasp = sprung_jaws(tmp_path, left=left).about(mass=0.1)
    parts = load_parts(grasp)
    palm, *jaws = parts.hand.links
    hand = replace(parts.hand, links=(replace(palm, name="world"), *jaws))
    model = _Scene(replace(parts, hand=hand), grasp).spec().compile()
    assert {model.body(n).name for n in range(model.nbody)} >= {"world", "object", "lift", "hand world", f"hand {left}"}
    assert {model.joint(n).name for n in range(model.njnt)} == {"object", "lift", f"hand {left}", "right"}
    springs = np.flatnonzero(model.tendon_stiffness)
    assert model.tendon_stiffness[springs] == pytest.approx([50, 40])
    assert model.tendon_lengthspring[springs] == pytest.approx(np.array([[0.03, 0.03], [-0.05, -0.05]]))


def test_what_stands_firmest() -> None:
    slab = np.array([[x, y, z] for x in (-0.01, 0.01) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    assert abs((slab @ standing(slab, np.zeros(3)).T)[:, 2]).max() == pytest.approx(0.01)
    heavy = np.array([0.0, 0.0, -0.09])  # at one end of a cube
    cube = slab * [10, 1, 1]
    assert (standing(cube, heavy) @ heavy)[2] == pytest.approx(-0.09)


def test_what_lies_askew_in_its_frame_stands_on_a_face() -> None:
    """On none of the six sides along its axes would it stay."""
    slab = np.array([[x, y, z] for x in (-0.01, 0.01) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    askew = slab @ Rotation.from_euler("xyz", [0.5, 0.6, 0.7]).as_matrix().T
    R = standing(askew, np.zeros(3))
    assert np.linalg.det(R) == pytest.approx(1)
    assert abs((askew @ R.T)[:, 2]).max() == pytest.approx(0.01)


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
    assert mujoco.MjModel.from_xml_path("scenes/000.xml").nkey == len(TIMES)
    complains(capsys, [*command, "-o", "scenes"], ["000.xml: exists already; give --force"])
    complains(capsys, [*command, "-o", "one.xml"], ["one.xml: is one file for 2 grasps; give a folder"])
    complains(capsys, [*command, "-o", "x", "--hand", "a"], ["--hand: is of other layouts"])
    complains(capsys, [*command], ["missing: -o FOLDER"])
