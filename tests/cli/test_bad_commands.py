"""The command line: files and arguments that are wrong are refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast.cli.app import COMMAND_CLASSES
from tests.support.program import complains, planar, run

Grasp = dict  # a parsed grasp file


def change(data: Grasp, *path: str | int, to: object) -> None:
    for key in path[:-1]:
        data = data[key]
    data[path[-1]] = to


FAULTS = {
    "unknown field": (["colour"], "red", ["bad.json", "colour", "not a known field"]),
    "zero normal": (["contacts", 1, "normal"], [0, 0, 0], ["contacts[1].normal", "zero"]),
    "long normal": (["contacts", 1, "normal"], [0, 2, 0], ["contacts[1].normal", "length 2", "unit"]),
    "NaN": (["contacts", 0, "position"], [float("nan"), 0, 0], ["NaN", "finite"]),
    "negative friction": (["contacts", 2, "friction"], -0.1, ["contacts[2].friction", "-0.1"]),
    "moves out of range": (["joints", 0, "moves"], [0, 7], ["joints[0].moves", "7", "0 to 3"]),
    "unknown actuator": (["preload"], {"thumb": 1}, ["preload", "thumb", "right, left"]),
    "no contacts": (["contacts"], [], ["contacts", "at least one contact"]),
    "no number": (["contacts", 0, "friction"], "wood", ["contacts[0].friction"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_grasp_file_is_one_line(fault: str, grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    path, value, says = FAULTS[fault]
    data = planar()
    if fault == "no contacts":
        data["joints"], data["preload"] = [], {}
    change(data, *path, to=value)
    Path("bad.json").write_text(json.dumps(data))
    complains(capsys, ["check", "bad.json", "--wrench", "0", "1", "0"], ["bad.json", *says])


WRONG = {
    "missing file": (["check", "no.json", "--wrench", "0", "1", "0"], ["no.json", "no such file"]),
    "unknown command": (
        ["chekc", "g"],
        ["chekc", f"known: {', '.join(COMMAND_CLASSES)}", "did you mean 'check'?"],
    ),
    "nearly a name": (["check", "fig12", "--wrench", "0", "1", "0"], ["bundled grasp", "did you mean 'fig1'?"]),
    "nearly a task": (["synthesize", "guitar-tunig"], ["bundled task", "did you mean 'guitar-tuning'?"]),
    "nearly a hand": (["show", "barret"], ["did you mean 'barrett-bh8-280'?", "menagerie:ROBOT", "handfast[hands]"]),
    "a word for a number": (["plan", "barrett-bh8-280", "can", "--timeout", "5m"], ["--timeout: '5m' is not a number"]),
    "a word for a count": (
        ["plan", "barrett-bh8-280", "can", "--count", "two"],
        ["--count: 'two' is not a whole number"],
    ),
    "an object for a hand": (["plan", "can.json", "schunk-sah"], ["can.json: is an object; the hand comes first"]),
    "a unit beside a mass": (["plan", "barrett-bh8-280", "can", "--mass", "100g"], ["--mass: '100g' is not a number"]),
    "part of a job": (["plan", "barrett-bh8-280", "can", "--pool", "2.5"], ["--pool: '2.5' is not a whole number"]),
    "all for one load": (
        ["robust", "fig1", "--gravity", "all"],
        ["--gravity: is 'all', and one direction is needed here", "handfast hold asks about all"],
    ),
    "a hand for a task": (
        ["synthesize", "hand.urdf"],
        ["hand.urdf: is a hand, and a task is needed; handfast propose hand.urdf OBJECT writes tasks"],
    ),
    "an object for a grasp": (["hold", "mug", "--gravity", "all"], ["mug: is an object, and a grasp is needed"]),
    "a mesh for a grasp": (["check", "a.STL", "--wrench", "0", "0", "1"], ["a.STL: is an object", "plan HAND a.STL"]),
    "commas in a wrench": (["check", "fig1", "--wrench", "0,1,0"], ["'0,1,0' is not a number; numbers have spaces"]),
    "a hand for a grasp": (
        ["check", "schunk-sah", "--wrench", "0", "1", "0"],
        ["schunk-sah: is a hand, and a grasp is needed", "handfast plan schunk-sah OBJECT"],
    ),
    "a hand's file for a grasp": (["max", "hand.urdf", "--direction", "0", "1", "0"], ["hand.urdf: is a hand"]),
    "a grasp for a task": (["grasp", "fig1"], ["fig1: is a bundled grasp; a task is needed"]),
    "no command": ([], ["check, max"]),
    "an option like none": (["hold", "fig1", "--all"], ["unknown option '--all'; see handfast hold --help"]),
    "unknown option": (
        ["check", "grasp.json", "--wrnch", "0", "1", "0"],
        ["--wrnch", "did you mean --wrench?"],
    ),
    "node limit": (["check", "grasp.json", "--wrench", "0", "1", "0", "--nodes", "0"], ["nodes", "0"]),
    "an option in place of a command": (["--wat"], ["unknown option '--wat'; a command comes first: check, max"]),
    "a short option in place of a command": (["-x", "check"], ["unknown option '-x'; a command comes first"]),
    "a demo in a file": (["demo", "-o", "empty.obj"], ["empty.obj: is a file; a folder is needed"]),
    "the end of choices": (["map", "g", "--plane", "zz"], ["--plane", "one of xy, xz, yz."]),
    "a scale of a body file": (["show", "parallel-gripper", "slab", "--scale", "2"], ["slab: states its own size"]),
    "a scale of nothing": (["show", "parallel-gripper", "--scale", "2"], ["--scale: is for the meshes of an object"]),
    "choices": (["plan", "barrett-bh8-280", "ball", "--up", "w"], ["'w'", "--up", "one of -x, x, -y, y, -z, z"]),
    "verify nothing": (["verify"], ["missing", "RESULT"]),
    "verify no file": (["verify", "none.json"], ["none.json", "no such file"]),
    "verify a grasp": (
        ["verify", "grasp.json"],
        ["grasp.json", "schema", "handfast/result/1", "handfast/certificate/1", "handfast/hold/1", "this is a grasp"],
    ),
    "two numbers": (["check", "grasp.json", "--wrench", "0", "1"], ["--wrench", "2 numbers", "six"]),
    "no numbers": (["check", "grasp.json", "--wrench", "up"], ["--wrench", "'up' is not a number"]),
    "missing option": (["check", "grasp.json"], ["missing", "--wrench", "--loads", "--gravity"]),
    "missing grasp": (["check", "--wrench", "0", "1", "0"], ["missing: GRASP; GRASP is a file"]),
    "all that is missing": (["sweep"], ["missing: GRASP --joint NAME --to VALUE; --direction FX FY FZ TX TY TZ, or"]),
    "missing beside a grasp": (["sweep", "g", "--to=1"], ["missing: --joint NAME; --direction FX FY FZ TX TY TZ, or"]),
    "one of two": (["max", "grasp.json"], ["missing: --direction FX FY FZ TX TY TZ, or --gravity GX GY GZ"]),
    "both of two": (
        ["max", "grasp.json", "--direction", "0", "1", "0", "--gravity", "0", "0", "-1"],
        ["give one of the two: --direction"],
    ),
    "a mass without gravity": (["max", "grasp.json", "--direction", "0", "1", "0", "--mass", "1"], ["--mass is for"]),
    "missing value": (["check", "grasp.json", "--wrench", "0", "1", "0", "--eta"], ["--eta"]),
    "bad choice": (["map", "grasp.json", "--plane", "yx"], ["yx", "--plane", "xz"]),
    "no pair": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--preload", "left"],
        ["left", "NAME=VALUE"],
    ),
    "unknown joint": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--preload", "thumb=1"],
        ["grasp.json", "preload", "thumb", "right, left"],
    ),
    "named twice": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--preload", "left=1", "left=2"],
        ["--preload", "left", "twice"],
    ),
    "both preloads": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--preload", "left=1", "--no-preload"],
        ["--no-preload"],
    ),
    "NaN wrench": (["check", "grasp.json", "--wrench", "0", "nan", "0"], ["wrench", "NaN"]),
    "zero direction": (["max", "grasp.json", "--direction", "0", "0", "0"], ["direction", "zero"]),
    "out of range": (
        ["check", "pair.json", "--wrench", "0", "0", "0", "1", "0", "0"],
        ["wrench", "balanced"],
    ),
    "eta": (["check", "grasp.json", "--wrench", "0", "1", "0", "--eta", "60"], ["eta", "60", "45"]),
    "torque limit": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--torque-limit", "thumb=1"],
        ["torque limit", "thumb", "right, left"],
    ),
    "sweep joint": (
        ["sweep", "grasp.json", "--joint", "thumb", "--to", "1", "--direction", "0", "1", "0"],
        ["joint", "thumb", "right, left"],
    ),
    "picture format": (["map", "grasp.json", "-o", "map.bmp"], ["map.bmp", ".png"]),
    "report format": (
        ["check", "grasp.json", "--wrench", "0", "1", "0", "--report", "r.txt"],
        ["r.txt", ".html"],
    ),
    "missing mesh": (
        ["contacts", "barrett-bh8-280", "none.obj", "--configuration", "c.json"],
        ["none.obj", "no such file"],
    ),
    "object that no file can be named": (
        ["plan", "barrett-bh8-280", "o" * 5000],
        ["no such file, and no bundled object"],
    ),
    "mesh that no file can be named": (
        ["plan", "barrett-bh8-280", "o" * 5000 + ".obj", "--mass", "1"],
        ["no such file"],
    ),
    "unknown hand": (
        ["contacts", "claw", "flat.obj", "--configuration", "c.json"],
        ["claw", "barrett-bh8-280"],
    ),
    "mesh with no triangles": (
        ["contacts", "barrett-bh8-280", "empty.obj", "--configuration", "c.json"],
        ["empty.obj", "triangle"],
    ),
    "missing configuration": (
        ["close", "barrett-bh8-280", "jar", "--pose", "none.json"],
        ["none.json"],
    ),
    "a hand that is not there, before anything else": (
        ["close", "menagerie:no_such_hand", "empty.obj", "--pose", "none.json"],
        ["menagerie:no_such_hand: "],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_bad_command_is_one_line(case: str, grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    data = planar()
    data["contacts"] = [data["contacts"][0], data["contacts"][2]]  # opposing points: no torque about x
    data["joints"], data["preload"] = [], {}
    Path("pair.json").write_text(json.dumps(data))
    Path("empty.obj").write_text("v 0 0 0\n")
    Path("c.json").write_text(json.dumps({"schema": "handfast/configuration/1"}))
    arguments, says = WRONG[case]
    complains(capsys, arguments, says)


@pytest.mark.parametrize("option", ["-o", "--report"])
def test_nothing_is_written_over_without_force(option: str, grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    name = "map.json" if option == "-o" else "map.html"
    Path(name).write_text("mine")
    question = ["map", grasp, "--steps", "1", option, name, "--gap", "0.02"]
    complains(capsys, question, [name, "exists already", "--force"])
    assert Path(name).read_text() == "mine"
    assert run(capsys, *question, "--force")[0] == 0
    assert Path(name).read_text() != "mine"


def test_an_object_for_a_grasp(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ball.json").write_text('{"schema": "handfast/body/1", "shapes": [{"sphere": {"radius": 0.02}}]}')
    complains(capsys, ["check", "ball.json", "--gravity", "all"], ["ball.json: is an object, and a grasp is needed"])


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (
            ["check", "FOLDER", "--gravity", "all"],
            ["is a folder, and one grasp file is needed", "handfast label FOLDER"],
        ),
        (["grasp", "GRASP"], ["is a grasp (handfast check", "and a task is needed"]),
        (["synthesize", "GRASP"], ["is a grasp (handfast check", "and a task is needed"]),
        (["torques", "GRASP", "--gravity", "all"], ["--gravity", "one direction is needed here", "handfast hold"]),
    ],
)
def test_what_is_given_is_told_as_what_it_is(
    command: list[str], says: list[str], grasp: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = {"FOLDER": str(tmp_path), "GRASP": grasp}
    wanted = [text.replace("FOLDER", str(tmp_path)) for text in says]
    complains(capsys, [named.get(word, word) for word in command], wanted)


def test_what_cannot_be_written_is_told_before_the_work(
    grasp: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file where a folder is needed, and a folder that is read-only: nothing is asked, nothing written."""
    monkeypatch.setattr("handfast.cli.questions.check", None)  # asked, it would be a traceback
    (tmp_path / "file").write_text("x")
    asked = ["check", grasp, "--wrench", "0", "0", "-1", "--report"]
    complains(capsys, [*asked, str(tmp_path / "file" / "page.html")], ["cannot be written", "file is a file"])
    monkeypatch.setattr("handfast.cli.options.os.access", lambda path, mode: False)
    complains(capsys, [*asked, str(tmp_path / "new" / "page.html")], ["cannot be written", "read-only"])
    assert not (tmp_path / "new").exists()


def test_more_mistakes_are_told_in_words(grasp: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text("[" * 5000 + "]" * 5000)
    complains(capsys, ["check", str(deep), "--wrench", "0", "0", "1"], ["deep.json"])
    complains(capsys, ["plan", "can", "barrett-bh8-280"], ["can: is an object, and a hand is needed"])
    complains(capsys, ["plan", "barrett-bh8-280", "can", "--tilt", "z"], ["--tilt", "is z; a word and a number"])
    scene = ["export", grasp, "--layout", "mujoco", "-o", str(tmp_path / "scene.yaml")]
    complains(capsys, scene, ["scene.yaml", "is of another layout"])
