"""Soft fingers on the command line: from a hand's MJCF, as a number, and in what is printed, saved and replayed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handfast import contact_grasp, load_hand
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.readers.grasp_file import save_grasp
from tests.support.program import ask, complains, run
from tests.support.soft_fingers import coin

HAND = """<mujoco model="jaw"><compiler angle="radian"/><default><geom friction="0.8 0.004 0.0001"/></default>
  <worldbody>
  <body name="palm"><geom name="palm" type="box" size=".06 .02 .01" pos="0 0 -.05"/>
    <body name="left" pos="-.03 0 0"><joint name="left" type="slide" axis="1 0 0" range="-.01 .01"/>
      <geom name="pad" type="box" size=".01 .01 .01" condim="4"/><geom name="nail" type="box" size=".004 .004 .02"
        pos="-.004 0 .02"/></body>
    <body name="right" pos=".03 0 0"><joint name="right" type="slide" axis="-1 0 0" range="-.01 .01"/>
      <geom name="hard" type="box" size=".01 .01 .01"/></body></body>
  </worldbody></mujoco>"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A jaw with a soft and a hard pad on a ball of 4 cm, and the coin."""
    monkeypatch.chdir(tmp_path)
    Path("jaw.xml").write_text(HAND)
    Path("ball.json").write_text(json.dumps({"shapes": [{"sphere": {"radius": 0.02}}], "mass": 0.1}))
    posed = {"schema": "handfast/configuration/1", "object_pose": {"position": [0, 0, 0]}}
    Path("at.json").write_text(json.dumps(posed))
    save_grasp(coin(), "coin.json")
    return tmp_path


MAKE = ["contacts", "jaw.xml", "ball.json", "--configuration", "at.json"]


@pytest.mark.usefixtures("here")
def test_contacts_of_geoms_with_condim_4(capsys: pytest.CaptureFixture[str]) -> None:
    """Of the pad alone: the nail beside it on the same link and the other finger are hard."""
    by_link = {c["link"]: c.get("torsion", 0.0) for c in ask(capsys, *MAKE, "--torsion", "hand")["contacts"]}
    assert by_link == {"left": 0.004, "right": 0.0}
    assert all("torsion" not in c for c in ask(capsys, *MAKE)["contacts"])
    assert {c["torsion"] for c in ask(capsys, *MAKE, "--torsion", "0.002")["contacts"]} == {0.002}
    assert load_hand("jaw.xml").links[1].torsion == (0.004, 0.0)


@pytest.mark.usefixtures("here")
def test_no_friction_no_torsion() -> None:
    ball = Body.of([Shape("sphere", 0.02)], mass=0.1)
    hand = load_hand("jaw.xml")
    q = np.zeros(2)
    grasp = contact_grasp(hand, q, ball, np.eye(4), friction=0.0, torsion="hand")
    assert [c.torsion for c in grasp.contacts] == [0.0, 0.0]
    with pytest.raises(InputError, match="a soft finger needs a friction above 0"):
        contact_grasp(hand, q, ball, np.eye(4), friction=0.0, torsion=0.001)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("text", ["soft", "-0.001", "nan", "2"])
def test_what_is_wrong_is_said(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    says = ["--torsion", f"is '{text}'; a length from 0 to below 1 m, or hand is needed"]
    complains(capsys, [*MAKE, f"--torsion={text}"], says)


@pytest.mark.usefixtures("here")
def test_a_question_its_answer_and_its_proof(capsys: pytest.CaptureFixture[str]) -> None:
    turn = ["--wrench", "0", "0", "0", "0", "0", "0.05"]
    status, out, _ = run(capsys, "check", "coin.json", *turn, "--save", "answer.json")
    assert status == 0
    assert "torsion [N m]" in " ".join(out.split())
    assert "2 contacts (2 soft)" in " ".join(out.split())
    assert run(capsys, "verify", "answer.json")[0] == 0
    _, out, _ = run(capsys, "check", "coin.json", *turn, "--torsion", "0.002", "--save", "slips.json")
    assert "SLIPS" in out
    assert run(capsys, "verify", "slips.json")[0] == 0
    asked = ["check", "coin.json", *turn]
    complains(capsys, [*asked, "--torsion", "0"], ["cannot be balanced by any forces"])
    complains(capsys, [*asked, "--eta", "5"], ["contacts[0].torsion", "uncertainty of the normals knows point"])
    complains(capsys, [*asked, "--torsion", "-1"], ["torsion: is -1; a coefficient of torsional friction"])
