"""Grippers whose jaws hang on closed loops: senses, fingers, and closing with the loops closed all along."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast import close, load_hand
from handfast.core.transforms import transform
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.model.hand.anatomy import Anatomy
from handfast.model.shape import Shape
from handfast.planning.candidates.palm_poses import palm_of
from handfast.planning.evaluation.attempt import Attempts, Runner
from handfast.stability.problem.loads import Loads

SIDE = """
  <body name="{n}_crank" pos="{x} 0 .03"><joint name="{n}_crank" axis="0 {s} 0" range="0 50"/>
   <geom type="capsule" size=".004" fromto="0 0 0 {out} 0 .04"/>
   <body name="{n}_jaw" pos="{out} 0 .04"><joint name="{n}_jaw" axis="0 {s} 0" range="-60 60"/>
    <geom type="box" size=".004 .01 .02" pos="0 0 .025"/></body></body>
  <body name="{n}_rod" pos="{x} 0 .015"><joint name="{n}_rod" axis="0 {s} 0" range="-90 90"/>
   <geom type="capsule" size=".003" fromto="0 0 0 {out} 0 .04" contype="0" conaffinity="0"/></body>"""


@pytest.fixture
def gripper(tmp_path: Path) -> Hand:
    """Two jaws on parallelograms, which keep them upright: the rods are pinned 15 mm below the jaws' hinges."""
    sides = "".join(SIDE.format(n=n, x=s * -0.02, s=s, out=s * -0.03) for n, s in (("left", 1), ("right", -1)))
    pins = "".join(f'<connect body1="{n}_jaw" body2="{n}_rod" anchor="0 0 -0.015"/>' for n in ("left", "right"))
    path = tmp_path / "parallelograms.xml"
    path.write_text(f"""<mujoco model="parallelograms"><compiler angle="degree"/>
 <worldbody><body name="base"><geom type="box" size=".03 .02 .01"/>{sides}</body></worldbody>
 <equality>{pins}<joint joint1="right_crank" joint2="left_crank"/></equality>
 <actuator><motor name="grip" joint="left_crank"/></actuator></mujoco>""")
    return load_hand(path)


def test_a_jaw_and_its_rod_are_one_finger(gripper: Hand) -> None:
    anatomy = Anatomy.of(gripper)
    finger = {name: anatomy.finger(i) for i, name in enumerate(gripper.link_names)}
    assert finger["left_jaw"] == finger["left_crank"] == finger["left_rod"]
    assert finger["left_jaw"] != finger["right_jaw"]
    assert finger["base"] == -1


def test_joints_that_follow_from_loops_close_with_what_drives_them(gripper: Hand) -> None:
    senses = dict(zip(gripper.joint_names, gripper.closing.tolist(), strict=True))
    assert senses == {f"{s}_{j}": v for s in ("left", "right") for j, v in (("crank", 1), ("jaw", -1), ("rod", 1))}
    assert palm_of(gripper).axis @ [0, 0, 1] > 0.99


def test_it_closes_on_a_block_with_upright_jaws(gripper: Hand) -> None:
    body = Body.of([Shape("box", (0.04, 0.03, 0.03))], mass=0.05)
    closed = close(gripper, palm_of(gripper).opened, body, transform([0, 0, 0.1], np.eye(3)))
    assert set(closed.touching) == {"left_jaw", "right_jaw"}
    np.testing.assert_allclose(gripper.closed(closed.q, closed.q), closed.q, atol=1e-9)
    values = gripper.values(closed.q)
    # the crank's end is 30 mm out and 40 up at 0; it touches where its jaw's inner face is 20 mm from the middle
    angle = np.arctan2(0.03, 0.04) - np.arcsin((0.02 + 0.004 - 0.02) / 0.05)
    for side in ("left", "right"):
        assert values[f"{side}_crank"] == pytest.approx(angle, abs=1e-3)
        assert values[f"{side}_jaw"] == pytest.approx(-values[f"{side}_crank"], abs=1e-6)
        assert values[f"{side}_rod"] == pytest.approx(values[f"{side}_crank"], abs=1e-6)
    assert {"left_crank", "left_jaw", "right_crank", "right_jaw"} <= set(closed.stopped)


def test_it_plans(gripper: Hand, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Runner, "measured", lambda _, g, *__: g)  # margins are not asked for
    body = Body.of([Shape("box", (0.04, 0.03, 0.03))], mass=0.05)
    runner = Runner(Attempts(gripper, body, Loads.gravity(body)))
    assert any(runner.run(n).found for n in range(6))
