"""The command line: answers, exit statuses, faults, files, Ctrl-C."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from benchmarks.grasps import random_case

from handfast.cli import console, demo, main
from handfast.cli.app import COMMANDS, option_name
from handfast.core import bundled
from handfast.model.grasp_file import save_grasp
from handfast.stability.paper import mip
from handfast.stability.queries import maximum
from tests.support.problems import pinch

QUICK = ["--gap", "0.02"]
COMMON = {"schema", "query", "verdict", "stop", "seconds", "nodes"}
PROOF = {"certified", "verified", "motion_cap"}
Grasp = dict  # a parsed grasp file


def planar() -> Grasp:
    """Two fingers, four contacts in a plane, mirror images: 2.222 N in +y by hand, see `test_max`."""
    a, b = np.array([-0.819, 0.574]) / np.hypot(0.819, 0.574)
    right = [([0.078, 0, 0], [-1, 0, 0]), ([0.0955, -0.0463, 0], [a, b, 0])]
    mirror = [([-p[0], *p[1:]], [-n[0], *n[1:]]) for p, n in right]
    names = ["right_distal", "right_proximal", "left_distal", "left_proximal"]
    return {
        "schema": "handfast/grasp/1",
        "contacts": [
            {"position": p, "normal": n, "friction": 1.0, "link": link}
            for (p, n), link in zip([*right, *mirror], names, strict=True)
        ],
        "joints": [
            {"name": "right", "axis": [0, 0, 1], "origin": [0.075, -0.093, 0], "moves": [0, 1]},
            {"name": "left", "axis": [0, 0, -1], "origin": [-0.075, -0.093, 0], "moves": [2, 3]},
        ],
        "preload": {"right": 0.1, "left": 0.1},
    }


@pytest.fixture
def grasp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("grasp.json").write_text(json.dumps(planar()))
    return "grasp.json"


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(list(arguments))
    said = capsys.readouterr()
    return status, said.out, said.err


def ask(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> dict:
    """The JSON object of a command that is expected to end with `status`, and nothing else said."""
    got, out, err = run(capsys, *arguments, "--json")
    assert (got, err) == (status, "")
    return json.loads(out)


# --- answers ------------------------------------------------------------------------------------


def test_check(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    holds = ask(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "0", "0", "0")
    keys = PROOF | {"residual", "contacts", "joint_torques", "object_motion", "joint_motion", "margin"}
    assert COMMON | keys <= set(holds)
    assert holds["verdict"] == "holds"
    assert holds["stop"] == "complete"
    assert holds["residual"] < 1e-9
    assert {"force", "motion", "state"} <= set(holds["contacts"][0])
    assert {c["state"] for c in holds["contacts"]} <= {"open", "stick", "slide"}
    assert np.sum([c["force"] for c in holds["contacts"]], axis=0) == pytest.approx([0, -2.2, 0])

    slips = ask(capsys, "check", grasp, "--wrench", "0", "2.5", "0")
    assert set(slips) == set(holds)
    assert slips["verdict"] == "slips"
    assert (holds["certified"], slips["certified"]) == (False, True)
    assert (holds["verified"], slips["verified"]) == (True, True)


def test_max(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "max", grasp, "--direction", "0", "1", "0", *QUICK)
    assert COMMON | PROOF | {"lower", "upper", "gap", "unbounded", "holds_from_zero_to", "attained", "limit"} == set(
        answer
    )
    # each finger's command turns it about its joint: normal and friction force at full strength at the
    # tip, n (0.093 - 0.003 mu) = 0.1 N m, so 2 mu n = 2.222 N in all
    assert answer["lower"] == pytest.approx(2 * 0.1 / (0.093 - 0.003), rel=1e-9)
    assert answer["lower"] <= answer["upper"] <= 1.02 * answer["lower"]
    assert answer["gap"] == pytest.approx(answer["upper"] / answer["lower"] - 1)
    assert answer["holds_from_zero_to"] is None


def test_max_without_bound(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "max", grasp, "--no-preload", "--direction", "0", "-1", "0", *QUICK)
    assert (answer["verdict"], answer["unbounded"], answer["upper"]) == ("holds", True, None)
    status, out, _ = run(capsys, "max", grasp, "--no-preload", "--direction", "0", "-1", "0", *QUICK)
    assert status == 0
    assert "force along −y of any size is resisted" in out


def test_max_with_a_constant_load(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "max", grasp, "--direction", "0", "1", "0", "--base", "0", "-1", "0", *QUICK)
    assert answer["lower"] == pytest.approx(3.2222, rel=0.02)


def test_torques(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "torques", grasp, "--wrench", "0", "2", "0", *QUICK)
    assert COMMON | PROOF | {"preload", "lower", "upper"} == set(answer)
    assert answer["upper"] == pytest.approx(0.09, rel=1e-4)  # raised by up to a tenth of the gap, so that a check holds
    assert max(answer["preload"].values()) == pytest.approx(answer["upper"])


def test_tables_say_the_verdict_first(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "check", grasp, "--wrench", "0", "1", "0", *QUICK)
    assert (status, err) == (0, "")
    assert out.startswith("HOLDS  The grasp resists 1 N along +y")
    assert "right_distal" in out
    assert "0.1 N·m" in out
    status, out, _ = run(capsys, "check", grasp, "--no-preload", "--wrench", "0", "1", "0", *QUICK)
    assert status == 0
    assert out.startswith("SLIPS")
    assert "every actuator is locked" in out
    status, out, _ = run(capsys, "torques", grasp, "--wrench", "0", "2", "0", *QUICK)
    assert "largest command that 2 N along +y needs is 0.09" in out


def test_without_dissipation_it_holds_but_is_called_unphysical(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["check", grasp, "--no-preload", "--no-mdp", "--wrench", "0", "10", "0", *QUICK]
    assert ask(capsys, *question)["verdict"] == "holds"
    status, out, _ = run(capsys, *question)
    assert status == 0
    assert out.startswith("HOLDS?")
    assert "not physical" in out


def test_preload_replaces_that_of_the_file(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", *QUICK]
    double = ask(capsys, *question, "--preload", "left=0.2", "right=0.2")
    again = ask(capsys, *question, "--preload", "left=0.2", "--preload", "right=0.2")
    assert double["lower"] == pytest.approx(2 * 2.2222, rel=1e-4)
    assert again["lower"] == double["lower"]


def test_friction_and_limits(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", *QUICK]
    assert ask(capsys, *question, "--friction", "0.5")["lower"] < 1.2
    limited = ask(capsys, *question, "--force-limit", "0.5")
    # a limit on the normal forces leaves the contacts less than the commands would press
    assert limited["verdict"] in ("slips", "holds", "undecided")
    assert limited["lower"] <= 2.23


def test_undecided_is_status_3(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "--time-limit", "1e-6", status=3)
    assert (answer["verdict"], answer["stop"]) == ("undecided", "time")
    status, out, _ = run(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "--time-limit", "1e-6")
    assert status == 3
    assert out.startswith("UNDECIDED")
    assert "--time-limit" in out


def test_a_node_limit_is_undecided_too(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", "--node-limit", "1", "--gap", "1e-12"]
    assert ask(capsys, *question, status=3)["stop"] == "nodes"
    status, out, _ = run(capsys, *question)
    assert status == 3
    assert "The node limit of 1 was hit; a larger --node-limit may decide it." in out


@pytest.mark.parametrize("solver", mip.SOLVERS)
def test_a_missing_solver_is_one_line(
    solver: str, grasp: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mip, "available", lambda solver: False)
    question = ["check", grasp, "--wrench", "0", "1", "0", "--method", "algorithm1", "--solver", solver]
    complains(capsys, question, [f"'{solver}' is not installed", "--method algorithm1", "'handfast[reference]'"])


# --- maps and sweeps ----------------------------------------------------------------------------


def test_map_writes_what_it_answers(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "map", grasp, "--plane", "xy", "--steps", "4", "-o", "map.csv", *QUICK)
    assert COMMON | {"plane", "directions", "without_preload", "with_preload"} <= set(answer)
    assert {"lower", "upper", "unbounded"} <= set(answer["with_preload"])
    assert answer["with_preload"]["lower"][1] == pytest.approx(2.2222, rel=1e-4)
    assert answer["with_preload"]["unbounded"][3] is True
    assert answer["without_preload"]["lower"][1] == 0
    lines = Path("map.csv").read_text().splitlines()
    heads = lines[0].split(",")
    for i, line in enumerate(lines[1:]):
        row = dict(zip(heads, line.split(","), strict=True))
        assert [float(row[k]) for k in ("dx", "dy", "dz")] == answer["directions"][i]
        for name in ("without", "with"):
            curve = answer[f"{name}_preload"]
            assert float(row[f"lower_{name}_preload"]) == curve["lower"][i]
            upper = row[f"upper_{name}_preload"]
            assert (float(upper) if upper else None) == curve["upper"][i]
            assert row[f"unbounded_{name}_preload"] == str(curve["unbounded"][i]).lower()
    assert len(lines) == 5


def test_map_table_and_picture(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "map", grasp, "--steps", "2", "-o", "map.json", "--report", "map.html", *QUICK)
    assert (status, err) == (0, "")
    assert "2 directions of force in the xy plane" in out
    assert json.loads(Path("map.json").read_text())["query"] == "map"
    assert "data:image/svg+xml;base64," in Path("map.html").read_text()


def test_sweep(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["sweep", grasp, "--joint", "left", "--from", "0.1", "--to", "0.2", "--steps", "2"]
    question += ["--direction", "0", "1", "0", "--direction", "0", "-1", "0", "0", "0", "0", *QUICK]
    answer = ask(capsys, *question, "-o", "sweep.csv")
    assert COMMON | {"joint", "directions", "rows"} == set(answer)
    assert [r["preload"] for r in answer["rows"]] == [0.1, 0.2]
    assert answer["rows"][0]["lower"][0] == pytest.approx(2.2222, rel=1e-4)
    assert answer["rows"][0]["unbounded"] == [False, True]
    lines = [line.split(",") for line in Path("sweep.csv").read_text().splitlines()]
    assert lines[0] == ["left", "lower_1", "upper_1", "unbounded_1", "lower_2", "upper_2", "unbounded_2"]
    for row, line in zip(answer["rows"], lines[1:], strict=True):
        assert [float(line[0]), float(line[1]), float(line[2])] == [
            row["preload"],
            row["lower"][0],
            row["upper"][0],
        ]
        assert line[5] == ""


# --- bad input ----------------------------------------------------------------------------------


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
        ["chekc", f"known: {', '.join(COMMANDS)}"],
    ),
    "no command": ([], ["check, max"]),
    "unknown option": (
        ["check", "grasp.json", "--wrnch", "0", "1", "0"],
        ["--wrnch", "did you mean --wrench?"],
    ),
    "node limit": (["check", "grasp.json", "--wrench", "0", "1", "0", "--node-limit", "0"], ["node limit", "0"]),
    "method": (["check", "grasp.json", "--wrench", "0", "1", "0", "--method", "guess"], ["--method", "algorithm1"]),
    "verify nothing": (["verify"], ["missing", "RESULT"]),
    "verify no file": (["verify", "none.json"], ["none.json", "no such file"]),
    "verify a grasp": (
        ["verify", "grasp.json"],
        ["grasp.json", "schema", "handfast/result/1", "handfast/certificate/1"],
    ),
    "two numbers": (["check", "grasp.json", "--wrench", "0", "1"], ["--wrench", "2 numbers", "six"]),
    "no numbers": (["check", "grasp.json", "--wrench", "up"], ["--wrench", "'up' is not a number"]),
    "missing option": (["check", "grasp.json"], ["missing", "--wrench"]),
    "missing grasp": (["check", "--wrench", "0", "1", "0"], ["GRASP"]),
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
    "sectors": (["check", "grasp.json", "--wrench", "0", "1", "0", "--sectors", "100"], ["sectors", "100"]),
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
    "unknown hand": (
        ["contacts", "claw", "flat.obj", "--configuration", "c.json"],
        ["claw", "barrett-bh8-280"],
    ),
    "mesh with no triangles": (
        ["contacts", "barrett-bh8-280", "empty.obj", "--configuration", "c.json"],
        ["empty.obj", "triangle"],
    ),
    "missing configuration": (
        ["close", "barrett-bh8-280", "empty.obj", "--pose", "none.json"],
        ["none.json"],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_bad_command_is_one_line(case: str, grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    data = planar()
    data["contacts"] = [data["contacts"][0], data["contacts"][2]]  # opposing points: no moment about x
    data["joints"], data["preload"] = [], {}
    Path("pair.json").write_text(json.dumps(data))
    Path("empty.obj").write_text("v 0 0 0\n")
    Path("c.json").write_text(json.dumps({"schema": "handfast/configuration/1"}))
    arguments, says = WRONG[case]
    complains(capsys, arguments, says)


def complains(capsys: pytest.CaptureFixture[str], arguments: list[str], says: list[str]) -> None:
    status, out, err = run(capsys, *arguments)
    assert status == 2, err
    assert out == ""
    assert err.startswith("handfast: ")
    assert err.count("\n") == 1
    for text in says:
        assert text in err


@pytest.mark.parametrize("option", ["-o", "--report"])
def test_nothing_is_written_over_without_force(option: str, grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    name = "map.json" if option == "-o" else "map.html"
    Path(name).write_text("mine")
    question = ["map", grasp, "--steps", "1", option, name, *QUICK]
    complains(capsys, question, [name, "exists already", "--force"])
    assert Path(name).read_text() == "mine"
    assert run(capsys, *question, "--force")[0] == 0
    assert Path(name).read_text() != "mine"


# --- hands and objects --------------------------------------------------------------------------


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


# --- the program as a program -------------------------------------------------------------------


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    listed = ask(capsys, "list")
    assert {"grasps", "hands", "objects", "configurations"} <= set(listed)
    assert "barrett-bh8-280" in listed["hands"]
    assert all(text for kind in ("grasps", "hands", "objects") for text in listed[kind].values())


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_every_option(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, name, "--help")
    assert (status, err) == (0, "")
    others = {"close": ("hand", "object"), "verify": ("result",), "synthesize": ("task",), "grasp": ("task",)}
    positional = others.get(name, ("grasp", "hand", "object"))
    for field in fields(COMMANDS[name]):
        if field.name not in positional:
            assert option_name(field) in out


def test_quick_commands_import_nothing_heavy() -> None:
    code = (
        "import sys; from handfast.cli import main; main(sys.argv[1:]);"
        "heavy = {'mujoco', 'trimesh', 'matplotlib', 'numba', 'pyscipopt', 'scipy', 'gurobipy'} & set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    for arguments in (["--help"], ["list"], ["check", "--help"]):
        done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_progress_is_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "PATIENCE", 0.0)
    for stream in (Terminal(), io.StringIO()):
        monkeypatch.setattr(sys, "stderr", stream)
        with console.watch("map") as watch:
            watch.item(1, 4)
        assert ("1 of 4" in stream.getvalue()) == isinstance(stream, Terminal)


SLOW = {
    "max": ["max", "hard.json", "--eta", "5.73", "--gap", "1e-14", "--direction"],
    "map": ["map", "grasp.json", "--steps", "6000", "--gap", "1e-9"],
}


@pytest.mark.parametrize("name", SLOW)
def test_interrupt_reports_the_bounds_so_far(name: str, grasp: str) -> None:
    hard = random_case(15, 6)  # fifteen contacts, with uncertain normals: not closed in half a minute
    save_grasp(hard.grasp, "hard.json")
    maximum(pinch(), np.eye(6)[1])  # compiles what is not compiled yet, so that the signal meets a search
    direction = [repr(v) for v in hard.direction.tolist()] if name == "max" else []
    command = [sys.executable, "-m", "handfast.cli", *SLOW[name], *direction, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            time.sleep(5.0)
            assert process.poll() is None, process.communicate()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 3, err
    assert err == ""
    answer = json.loads(out)
    assert answer["stop"] == "interrupted"
    if name == "map":
        assert len(answer["with_preload"]["lower"]) == 6000
        assert answer["with_preload"]["lower"][-1] is None
