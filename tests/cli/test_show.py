"""The command line: show."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from handfast.readers.configuration_file import load_configuration
from handfast.readers.load_hand import load_hand
from tests.support.driven_page import embedded
from tests.support.program import ask, complains, run
from tests.support.shown_hands import write_wristed


@pytest.fixture(autouse=True)
def wristed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_wristed(tmp_path)


def test_a_table_says_what_is_known_and_guessed(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "show", "wristed.xml")
    assert status == 0
    first, *lines = out.splitlines()
    assert first == "wristed: 7 links, 5 joints, 4 actuators, 1 coupling, 2 fingers"
    l2 = next(line for line in lines if line.startswith("l2 "))
    assert "−5.73° to 80.2°" in l2
    assert "follows 0.5 × l1 + 0.1" in l2
    assert any(line.startswith("mass") and "0.45 kg" in line for line in lines)
    assert any(line.startswith("regions") and "guessed" in line for line in lines)


def test_json_says_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "show", "parallel-gripper")
    assert answer["schema"] == "handfast/hand-facts/1"
    assert [j["name"] for j in answer["joints"]] == list(load_hand("parallel-gripper").joint_names)
    assert answer["palm"]["approach"] == pytest.approx([0, 0, 1], abs=1e-9)


def test_a_page_with_an_object_at_its_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["show", "barrett-bh8-280", "mug", "--configuration", "barrett-mug"]
    status, out, _ = run(capsys, *asked, "-o", "mug.html")
    assert status == 0
    assert out.splitlines()[-1] == "Written: mug.html"
    data, placed = embedded(Path("mug.html").read_text("utf-8")), load_configuration("barrett-mug")
    _, q = placed.applied(load_hand("barrett-bh8-280"))
    assert data["q"] == pytest.approx(q.tolist())
    assert data["object"]["pose"] == pytest.approx(placed.pose[:3].ravel().tolist())
    out = run(capsys, *asked)[1]
    assert any(line.startswith("object ") and "0.3 kg" in line for line in out.splitlines())
    assert next(line for line in out.splitlines() if line.startswith("finger_1_spread")).rstrip().endswith("102°")


def test_the_pages_configuration_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    """What the page offers as a file is read back."""
    assert run(capsys, "show", "parallel-gripper", "ball", "-o", "a.html")[0] == 0
    data = embedded(Path("a.html").read_text("utf-8"))
    Path("c.json").write_text(json.dumps(data["configuration"] | {"joints": {"left_slide": 0.01}}))
    found = load_configuration("c.json")
    assert found.hand == "parallel-gripper"
    assert found.pose[:3].ravel().tolist() == pytest.approx(data["object"]["pose"], abs=1e-9)


def test_an_object_alone(capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> None:
    """A cube of 30 mm, in millimetres, as it is and in metres; and a ring that is open, before it is refused."""
    cube = trimesh.creation.box([30, 20, 10])
    cube.export("cube.stl")
    status, out, err = run(capsys, "show", "cube.stl", "--scale", "0.001")
    assert (status, err) == (0, "")
    rows = dict(line.rstrip().split("  ", 1) for line in out.splitlines()[:-2])
    facts = {"size": "30 × 20 × 10 mm", "triangles": "12", "parts": "1", "convex": "yes", "open edges": "0"}
    assert {name: rows[name].strip() for name in facts} == facts
    assert out.splitlines()[-2] == "cube: 30 × 20 × 10 mm, 1 convex piece, mass not stated, friction 0.5"
    run(capsys, "show", "cube.stl")
    assert caplog.messages == ["cube.stl: is 30 m long; a mesh in millimetres needs the scale 0.001"]
    answer = ask(capsys, "show", "cube.stl", "--scale", "0.001")
    assert answer["schema"] == "handfast/object-facts/1"
    assert answer["mesh"] == {
        "size": pytest.approx([0.03, 0.02, 0.01]), "triangles": 12, "parts": 1, "convex": True, "open_edges": 0,
        "badly_wound": 0,
    }  # fmt: skip
    ring = trimesh.creation.annulus(0.02, 0.03, 0.01, sections=40)
    keep = np.ones(len(ring.faces), dtype=bool)
    keep[::7] = False
    ring.faces[5] = ring.faces[5][::-1]
    ring.update_faces(keep)
    ring.export("ring.obj")
    status, out, err = run(capsys, "show", "ring.obj")
    assert status == 2
    assert "decomposing  about 2." in out
    assert "badly wound  " in out
    assert "badly wound  0" not in out
    assert "is open: " in err
    complains(capsys, ["show", "can", "-o", "can.html"], ["-o: is for a hand; an object is shown in one"])
    assert ask(capsys, "show", "can")["mass"] == 0.35


def test_bad_requests_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    complains(capsys, ["show"], ["missing: HAND"])
    complains(capsys, ["show", "nosuch"], ["unknown hand 'nosuch'", "barrett-bh8-280"])
    complains(capsys, ["show", "wristed.xml", "-o", "a.txt"], ["a.txt: a name that ends in .html"])
    complains(capsys, ["show", "wristed.xml", "nosuch"], ["nosuch: no such file, and no bundled object"])
    complains(capsys, ["show", "wristed.xml", "--configuration", "fig1"], ["unknown joint", "known: lift, turn"])
    complains(capsys, ["show", "wristed.xml", "--regions", "schunk-sah"], ["unknown link"])
    Path("t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    complains(capsys, ["show", "parallel-gripper", "t.obj", "--scale", "0"], ["scale: is 0", "metres per unit"])
    Path("mine.html").write_text("mine")
    complains(capsys, ["show", "wristed.xml", "-o", "mine.html"], ["mine.html: exists already; give --force"])
    assert Path("mine.html").read_text() == "mine"
