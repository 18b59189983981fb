"""The joints' laws on the command line: which count, which motors are backdrivable, servos that pull to a squeeze."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast import load_grasp
from handfast.cli.contacts import Contacts
from handfast.cli.grasp import FindGrasps
from handfast.cli.load_options import JointLawOptions
from handfast.cli.plan import PlanGrasps
from handfast.cli.published import ImportGrasps
from tests.support.program import ask, complains, run
from tests.support.published import LEFT, RIGHT, samples, tiny
from tests.support.tendon_hand import tendon_hand, write_tendon_hand

NAMES = [f"{finger}_{part}" for finger in ("left", "right") for part in ("proximal", "middle", "distal")]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Straight fingers beside a ball of 0.1 kg: they stand at the lower stops of their outer joints."""
    monkeypatch.chdir(tmp_path)
    write_tendon_hand(tmp_path)
    Path("ball.json").write_text(json.dumps({"shapes": [{"sphere": {"radius": 0.0235}}], "mass": 0.1}))
    posed = {"schema": "handfast/configuration/1", "object_pose": {"position": [0, 0, 0.1]}}
    Path("straight.json").write_text(json.dumps(posed | {"closing": dict.fromkeys(NAMES, 1)}))
    return tmp_path


MAKE = ["contacts", "tendon-hand.xml", "ball.json", "--configuration", "straight.json", "--threshold", "1e-3"]


@pytest.mark.usefixtures("here")
def test_which_laws_count(capsys: pytest.CaptureFixture[str]) -> None:
    every, *some = (
        ask(capsys, *MAKE, *more)["joints"]
        for more in ([], ["--joint-laws", "none"], ["--joint-laws", "friction"], ["--joint-laws", "stops,springs"])
    )
    assert [(j["friction"], j.get("stop", "")) for j in every[:3]] == [(0.01, ""), (0.01, "lower"), (0.01, "lower")]
    assert [sorted({"friction", "stop"} & set(joints[1])) for joints in some] == [[], ["friction"], ["stop"]]
    status, out, _ = run(capsys, *MAKE, "-o", "grasp.json", "--report", "grasp.html")
    assert status == 0
    assert "friction 0.01 N·m, cannot open further" in " ".join(out.split())
    page = Path("grasp.html").read_text("utf-8")
    stopped = "left_middle, left_distal, right_middle and right_distal cannot open further"
    assert f"Joint laws: friction 0.01 N·m at 6 joints; {stopped}." in page


@pytest.mark.usefixtures("here")
def test_backdrivable_motors(capsys: pytest.CaptureFixture[str]) -> None:
    motors = ask(capsys, *MAKE, "--backdrivable", "left_pull", "--backdrivable", "right_pull")["mechanism"]["actuators"]
    assert [a["name"] for a in motors if a.get("backdrivable")] == ["left_pull", "right_pull"]


@pytest.mark.usefixtures("here")
def test_what_is_wrong_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    right = "all, none, or some of stops, friction, springs with commas between them"
    complains(capsys, [*MAKE, "--joint-laws", "damping"], [f"--joint-laws: is 'damping'; {right}"])
    complains(
        capsys, [*MAKE, "--backdrivable", "thumb"], ["--backdrivable: unknown actuator 'thumb'; known: left_base"]
    )


def test_servos_that_pull_to_a_squeeze(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """kp (target - q): each hinge of the sample has its own way to the squeeze."""
    tiny(here)
    file = samples(here)["dexgraspbench"]
    make = ["import", str(file), "--hand", "tiny.xml", "--mapping", "tiny.json", "--objects", "objects", "--jobs", "1"]
    bare = ["--no-separate", "--no-close-gaps", "--force", "-o", "out"]
    (row,) = ask(capsys, *make, *bare, "--gain", "0.5")["rows"]
    preload = load_grasp("out/00000.grasp.json").preload
    way = {n: row["squeeze"][n] - at for n, at in (("left_hinge", LEFT), ("right_hinge", RIGHT))}
    assert {n: abs(f) for n, f in preload.items()} == pytest.approx({n: abs(0.5 * w) for n, w in way.items()}, abs=1e-9)
    assert all(f > 0 for f in preload.values())  # a squeeze closes
    assert json.loads(Path("out/00000.configuration.json").read_text())["preload"] == preload
    ask(capsys, *make, *bare)
    assert load_grasp("out/00000.grasp.json").preload == {}
    complains(capsys, [*make, *bare, "--gain", "0"], ["--gain: is 0; a number above 0"])


def test_a_search_leaves_friction_out_unless_asked() -> None:
    hand = tendon_hand()
    for command, friction in ((PlanGrasps, 0.0), (FindGrasps, 0.0), (Contacts, 0.01), (ImportGrasps, 0.01)):
        options = JointLawOptions(joint_laws=command.joint_laws)
        law = options.lawful(hand).joints[1].law
        assert (law.friction, law.stops) == (friction, (0.0, 1.5))
