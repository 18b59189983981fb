"""The command line: close and contacts, and bundled data by name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast.cli import demo
from handfast.core import bundled
from handfast.model import provenance
from tests.support.program import ask, complains, run


@pytest.fixture
def can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shape = {"cylinder": {"radius": 0.035, "length": 0.12}}
    Path("can.json").write_text(json.dumps({"shapes": [shape], "mass": 0.3, "friction": 0.6}))
    pose = {"position": [0, 0, 0.16]}
    data = {"schema": "handfast/configuration/1", "object_pose": pose, "preload": {"finger_3_prox": 0.1}}
    Path("open.json").write_text(json.dumps(data))


@pytest.mark.usefixtures("can")
def test_close_then_contacts(capsys: pytest.CaptureFixture[str]) -> None:
    close = ["close", "barrett-bh8-280", "can.json", "--pose", "open.json", "-o", "closed.json"]
    answer = ask(capsys, *close, "--grasp", "grasp.json", "--report", "close.html")
    assert answer["query"] == "close"
    assert len(answer["contacts"]) == 3
    assert len(answer["touching"]) == 3
    assert "data:image/svg" in Path("close.html").read_text()
    found = ask(capsys, "contacts", "barrett-bh8-280", "can.json", "--configuration", "closed.json")
    assert found["schema"] == "handfast/grasp/1"
    assert found == json.loads(Path("grasp.json").read_text())
    assert found["preload"] == {"finger_3_prox": 0.1}
    assert {c["friction"] for c in found["contacts"]} == {0.6}
    status, out, _ = run(
        capsys,
        *[
            "contacts",
            "barrett-bh8-280",
            "can.json",
            "--configuration",
            "closed.json",
            "--mechanism",
            "direct",
        ],
        *["--friction", "0.4", "--lock", "finger_1_dist", "-o", "direct.json"],
    )
    assert status == 0
    assert out.startswith("3 contacts on 3 links")
    direct = json.loads(Path("direct.json").read_text())
    assert {c["friction"] for c in direct["contacts"]} == {0.4}
    assert {"finger_1_dist": 1.0} in direct["mechanism"]["couplings"]


@pytest.mark.usefixtures("can")
def test_close_refuses_a_motor_that_the_hand_does_not_have(capsys: pytest.CaptureFixture[str]) -> None:
    close = ["close", "barrett-bh8-280", "can.json", "--pose", "open.json"]
    said = ["--preload: unknown actuator 'finger_9'", "did you mean 'finger_"]
    complains(capsys, [*close, "--preload", "finger_9=1"], said)
    data = json.loads(Path("open.json").read_text()) | {"preload": {"elbow": 1.0}}
    Path("open.json").write_text(json.dumps(data))
    complains(capsys, close, ["open.json: preload: unknown actuator 'elbow'"])


@pytest.mark.usefixtures("can")
def test_close_keeps_a_joint_still(capsys: pytest.CaptureFixture[str]) -> None:
    close = ["close", "barrett-bh8-280", "can.json", "--pose", "open.json", "--closing"]
    answer = ask(capsys, *close, "finger_3_prox=0")
    assert {c["link"] for c in answer["contacts"]} == {"finger_1_dist", "finger_2_dist"}
    assert "finger_3_prox" not in answer["stopped"]
    assert answer["configuration"]["joints"]["finger_3_prox"] == 0
    complains(capsys, [*close, "finger_3_prox=2"], ["--closing finger_3_prox", "-1, 0 or 1"])


@pytest.mark.usefixtures("can")
def test_bundled_data_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    """`contacts`, `list` and the demo's grasp find objects and configurations by their bundled names."""
    monkeypatch.setattr(bundled, "folder", lambda kind: tmp_path / kind)
    monkeypatch.setattr(provenance, "_bundled", provenance._bundled.__wrapped__)  # what it keeps is of other folders
    close = ["close", "barrett-bh8-280", "can.json", "--pose", "open.json", "-o", "closed.json"]
    assert run(capsys, *close)[0] == 0
    data = json.loads(Path("closed.json").read_text()) | {"hand": "barrett-bh8-280", "object": "can"}
    for kind, name, text in (("configurations", "fig1", json.dumps(data)), ("objects", "can", None)):
        (tmp_path / kind).mkdir()
        (tmp_path / kind / f"{name}.json").write_text(text or Path("can.json").read_text())
    found = ask(capsys, "contacts", "barrett-bh8-280", "can", "--configuration", "fig1")
    assert len(found["contacts"]) == 3
    grasp, meshes = demo.build()
    assert grasp.preload == {"finger_3_prox": 0.1}
    assert len(meshes) > 10
    listed = ask(capsys, "list")
    assert listed["objects"] == {"can": "cylinder, 0.3 kg, friction 0.6"}
    assert "can in barrett-bh8-280" in listed["configurations"]["fig1"]
    complains(capsys, ["contacts", "barrett-bh8-280", "cup", "--configuration", "fig1"], ["cup", "bundled: can"])
