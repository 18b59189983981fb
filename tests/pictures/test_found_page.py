"""Pages about what was found: a picture of each, and nothing where nothing was."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import InputError, Loads, load_body, load_hand, load_task
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.pictures.found_page import report_plan
from handfast.pictures.scene import scene_meshes
from handfast.planning.plan_grasps import plan
from tests.support.driven_page import embedded
from tests.support.program import ask, complains


def pictures(page: Path) -> int:
    return len(re.findall(r"data:image/png;base64", page.read_text()))


@pytest.mark.slow
def test_a_plan_is_one_page_with_all_its_grasps(tmp_path: Path) -> None:
    ball = Body.of([Shape("sphere", 0.02)], mass=0.1, friction=0.8, name="ball")
    planned = plan(load_hand("parallel-gripper"), ball, count=2, seed=1, jobs=1, loads=Loads.gravity(ball, "-z"))
    report_plan(tmp_path / "plan.html", planned)
    text = (tmp_path / "plan.html").read_text()
    assert pictures(tmp_path / "plan.html") == len(planned.grasps) == 2
    for k, seen in enumerate(embedded(text)["grasps"]):  # all of them in one scene, each with its loads
        assert seen["title"] == str(planned.number(planned.grasps[k]))
        assert len(seen["contacts"]) == planned.grasps[k].grasp.m
        assert [load["said"][:5] for load in seen["loads"]] == ["HOLDS"] * len(planned.loads)
    assert all(f"Does it hold “{name}”?" in text for name in planned.loads.names)
    assert "<h2>Settings</h2>" in text
    with pytest.raises(InputError, match=r"none\.html: nothing was found"):
        report_plan(tmp_path / "none.html", replace(planned, grasps=()))
    assert not (tmp_path / "none.html").exists()


@pytest.mark.slow
def test_configurations_are_drawn_with_the_object_if_the_task_names_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ask(capsys, "synthesize", "scalpel-upholding", "--report", "s.html")
    assert pictures(Path("s.html")) == 1
    assert "Whether it collides or holds was not asked." in Path("s.html").read_text()
    hand = load_hand("parallel-gripper")
    q = hand.configuration({})
    assert {m.kind for m in scene_meshes(hand, q, None, np.eye(4))} == {"hand"}
    assert {m.kind for m in scene_meshes(hand, q, load_body("ball"), np.eye(4))} == {"hand", "object"}


def test_a_page_that_cannot_be_written_is_refused_before_the_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.html").touch()
    hopeless = ["--timeout", "1e9"]
    for command in (["plan", "barrett-bh8-280", "ball"], ["propose", "barrett-bh8-280", "ball"], ["synthesize", "x"]):
        asked = [*command[:-1], "scalpel-upholding"] if command[0] == "synthesize" else command
        complains(capsys, [*asked, *hopeless, "--report", "s.html"], ["s.html: exists already"])
        complains(capsys, [*asked, *hopeless, "--report", "s.pdf"], ["s.pdf: a name that ends in .html or .htm"])


@pytest.mark.slow
def test_proposals_for_a_mesh_in_millimetres_know_its_size_and_mass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import trimesh

    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((40, 60, 100)).export("box.stl")
    asked = ["propose", "barrett-bh8-280", "box.stl", "--scale", "0.001", "--mass", "0.2", "--count", "1"]
    said = ask(capsys, *asked, "-o", "tasks", "--report", "p.html")
    assert said["files"] == ["tasks/box-pinch-1.json", "tasks/box.body.json", "p.html"]
    assert pictures(Path("p.html")) == 1
    assert json.loads(Path("tasks/box-pinch-1.json").read_text())["object"] == "box.body.json"
    body = load_body(load_task("tasks/box-pinch-1.json").object or "")
    assert (body.mass, body.name) == (0.2, "box")
    assert sorted(body.vertices.max(axis=0) - body.vertices.min(axis=0)) == pytest.approx([0.04, 0.06, 0.1])
    complains(capsys, [*asked, "-o", "tasks"], ["tasks/box.body.json: exists already"])
    complains(capsys, ["propose", "barrett-bh8-280", "ball", "--scale", "2"], ["ball: states its own size"])
