"""What a plan says that a grasp holds, `check` says of its own file; and no mass or centre of mass is assumed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handfast import (
    InputError,
    Loads,
    Verdict,
    check,
    check_many,
    load_body,
    load_grasp,
    max_many,
    maximum,
    save_grasp,
    sweep,
    torques,
)
from handfast.readers.grasp_file import to_dict
from tests.support.problems import bell, pinch
from tests.support.program import ask, complains, planar, run

SIX = ("+x", "-x", "+y", "-y", "+z", "-z")


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan for a ball whose centre is not at its frame's origin, as `plan` writes it."""
    from handfast.cli import main

    folder = tmp_path_factory.mktemp("planned")
    ball = {"shapes": [{"sphere": {"radius": 0.045}, "pose": {"position": [0.01, 0, 0.03]}}], "mass": 0.2}
    (folder / "ball.json").write_text(json.dumps(ball))
    asked = ["plan", "barrett-bh8-280", str(folder / "ball.json"), "--seed", "5", "--count", "1", "--jobs", "1"]
    assert main([*asked, "-o", str(folder / "out")]) == 0
    return folder


@pytest.mark.slow
def test_what_plan_says_that_holds_check_says_of_its_file(planned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = json.loads((planned / "out" / "plan.json").read_text())
    file = str(planned / "out" / said["grasps"][0]["grasp_file"])
    answer = ask(capsys, "check", file, "--gravity", "all")
    assert answer["loads"].keys() == said["loads"].keys()
    for name, load in answer["loads"].items():
        assert said["loads"][name] == pytest.approx([1.5 * x for x in load])  # with the safety that is usual
    assert {a["verdict"] for a in answer["answers"].values()} == {"holds"}
    # the weight at the frame's origin is another load: this is what was assumed once
    aside = ask(capsys, "check", file, "--gravity", "0", "0", "-1", "--com", "0.5", "0", "0")
    assert aside["verdict"] == "slips"


def test_a_plan_whose_object_was_changed_is_not_gone_on_with(planned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = planned / "out" / "000.grasp.json"
    whole = file.read_text()
    file.write_text(json.dumps(json.loads(whole) | {"mass": 0.3}))
    asked = ["plan", "barrett-bh8-280", str(planned / "ball.json"), "--seed", "5", "--count", "1", "--jobs", "1"]
    complains(capsys, [*asked, "-o", str(planned / "out"), "--resume"], [str(file), "another mass or centre of mass"])
    file.write_text(whole)


def test_a_report_of_the_file_shows_hand_and_object(planned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, page = str(planned / "out" / "000.grasp.json"), planned / "page.html"
    assert run(capsys, "check", file, "--gravity", "0", "0", "-1", "--report", str(page))[0] == 0
    assert "are not shown" not in page.read_text()
    assert "The same without the solids" in page.read_text()
    ball = planned / "ball.json"
    ball.write_text(ball.read_text() + " ")
    assert run(capsys, "check", file, "--gravity", "0", "0", "-1", "--report", str(page), "--force")[0] == 0
    assert "ball.json has changed: its checksum is another" in page.read_text()


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A grasp that knows nothing of its object, one that knows the mass alone, one that knows both."""
    monkeypatch.chdir(tmp_path)
    Path("bare.json").write_text(json.dumps(to_dict(bell())))
    save_grasp(bell().about(mass=0.1), "heavy.json")
    save_grasp(bell().about(mass=0.1, center_of_mass=[0, 0, 0.01]), "both.json")


@pytest.mark.usefixtures("files")
def test_what_is_missing_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    down = ["--gravity", "0", "-1", "0"]
    for query in ("check", "torques"):
        complains(capsys, [query, "bare.json", *down], ["bare.json", "mass", "--mass KG"])
        complains(
            capsys, [query, "bare.json", *down, "--mass", "0.1"], ["bare.json", "--com X Y Z", "0 0 0 is its origin"]
        )
        complains(capsys, [query, "heavy.json", *down], ["heavy.json", "centre of mass", "--com X Y Z"])
        complains(capsys, [query, "both.json", "--wrench", "0", "1", "0", "--mass", "1"], ["--mass is for --gravity"])
        complains(capsys, [query, "both.json", "--wrench", "0", "1", "0", "--com", "0", "0", "0"], ["is for --gravity"])
    both = ask(capsys, "check", "both.json", *down)
    given = ask(capsys, "check", "bare.json", *down, "--mass", "0.1", "--com", "0", "0", "0.01")
    long = ask(capsys, "check", "heavy.json", *down, "--center-of-mass", "0", "0", "0.01")
    unlike = {"seconds", "nodes"}
    same = [{k: v for k, v in a.items() if k not in unlike} for a in (both, given, long)]
    assert same[0] == same[1] == same[2]


@pytest.mark.usefixtures("files")
def test_the_program_and_python_answer_alike(capsys: pytest.CaptureFixture[str]) -> None:
    grasp = load_grasp("both.json")
    down = grasp.gravity_wrench([0, -1, 0])
    mine, said = check(grasp, down), ask(capsys, "check", "both.json", "--gravity", "0", "-1", "0")
    assert (str(mine.verdict), mine.to_json()["contacts"]) == (said["verdict"], said["contacts"])
    best, commands = torques(grasp, down), ask(capsys, "torques", "both.json", "--gravity", "0", "-1", "0")
    assert best.upper == pytest.approx(commands["upper"])
    _, out, _ = run(capsys, "check", "both.json", "--gravity", "0", "-1", "0")
    assert "Weight of 0.1 kg at (0, 0, 10) mm: mass and centre of mass as the grasp file says." in out
    _, out, _ = run(capsys, "check", "both.json", "--gravity", "0", "-1", "0", "--mass", "0.05")
    assert "Weight of 0.05 kg at (0, 0, 10) mm: the mass as given, the rest as the grasp file says." in out


def test_a_direction_of_gravity_asks_for_multiples_of_the_weight(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`planar` resists 2.222 N in +y (by hand): a weight of 0.5 N 4.444 times."""
    monkeypatch.chdir(tmp_path)
    Path("grasp.json").write_text(json.dumps(planar()))
    up = ["--gravity", "0", "1", "0", "--mass", f"{0.5 / 9.81}", "--com", "0", "0", "0"]
    lower = [
        ask(capsys, "max", "grasp.json", *up)["lower"],
        ask(capsys, "sweep", "grasp.json", *up, "--joint", "right", "--from", "0.1", "--to", "0.2", "--steps", "2")[
            "rows"
        ][0]["lower"][0],
        ask(capsys, "robust", "grasp.json", *up, "--commands", "1e-9", "--samples", "1")["nominal"][0],
    ]
    assert lower == pytest.approx([4.444] * 3, rel=2e-3)
    assert "It resists 4.4" in run(capsys, "max", "grasp.json", *up)[1]


def test_a_centre_of_mass_that_no_file_knows_is_given_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A hammer's head: given to `contacts`, it is in the grasp file, and `check` takes it from there."""
    monkeypatch.chdir(tmp_path)
    asked = ["contacts", "barrett-bh8-280", "flask", "--configuration", "fig9"]
    assert "The object weighs 0.3 kg, its centre of mass is at (0, −9.34, 0) mm." in run(capsys, *asked)[1]
    assert run(capsys, *asked, "--mass", "0.5", "--com", "0", "0.04", "0", "-o", "g.json")[0] == 0
    grasp = load_grasp("g.json")
    assert (grasp.mass, grasp.center_of_mass.tolist()) == (0.5, [0, 0.04, 0])  # type: ignore[union-attr]
    mine = check(grasp, grasp.gravity_wrench([1, 0, 0])).verdict
    assert ask(capsys, "check", "g.json", "--gravity", "1", "0", "0")["verdict"] == str(mine)
    Path("m.json").write_text('{"shapes": [{"sphere": {"radius": 0.03}}]}')
    Path("c.json").write_text('{"schema": "handfast/configuration/1", "object_pose": {"position": [0, 0, 0.13]}}')
    close = ["close", "barrett-bh8-280", "m.json", "--pose", "c.json", "--grasp", "x.json"]
    assert "Its mass is unknown; give --mass KG" in run(capsys, *close)[1]
    complains(capsys, ["check", "x.json", "--gravity", "0", "0", "-1"], ["x.json: does not say the object's mass"])
    complains(capsys, [*asked, "--com", "1"], ["--com/--center-of-mass: has 1 numbers; three are needed"])


# --- several disturbances -------------------------------------------------------------------------------


def test_several_wrenches_are_for_another_function() -> None:
    rows = [[0, 0.5, 0, 0, 0, 0], [0, 1.5, 0, 0, 0, 0], [0, 0, 0.9, 0, 0, 0]]
    assert [check(pinch(), w).verdict for w in rows] == [Verdict.HOLDS, Verdict.SLIPS, Verdict.HOLDS]
    for several in (rows, np.array(rows), [w[:3] for w in rows], Loads(("a", "b", "c"), np.array(rows)), [[0], [0, 1]]):
        with pytest.raises(InputError, match="wrench: is several loads; check_many takes them"):
            check(pinch(), several)  # type: ignore[arg-type]


def test_three_numbers_are_a_force_for_every_question(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_grasp(pinch(), tmp_path / "p.json")
    file, up, six = str(tmp_path / "p.json"), ["0", "1", "0"], [0.0, 1, 0, 0, 0, 0]
    largest = ask(capsys, "max", file, "--direction", *up, "--base", "0", "0", "0.1")
    mine = [maximum(pinch(), d, base=b) for d, b in (([0, 1, 0], [0, 0, 0.1]), (six, [0, 0, 0.1, 0, 0, 0]))]
    assert [a.lower for a in mine] == [largest["lower"]] * 2
    assert torques(pinch(), [0, 1, 0]).upper == torques(pinch(), six).upper
    assert max_many(pinch(), [[0, 1, 0]]).lower == max_many(pinch(), [six]).lower
    swept = [sweep(pinch(), "left", [0.1], [d], jobs=1) for d in ([0, 1, 0], six)]
    assert swept[0].directions.tolist() == swept[1].directions.tolist() == [six]
    assert Loads.wrench([0, 1, 0]).wrenches.tolist() == [six]
    with pytest.raises(ValueError, match="direction: has 4 numbers; six are needed"):
        maximum(pinch(), [0, 1, 0, 0])


@pytest.mark.parametrize("rows", [[[0, 1, 0], [0, 1]], [[0.0] * 6, ["x"] * 6]])
def test_rows_that_are_none_are_refused(rows: list[list[float]]) -> None:
    with pytest.raises(InputError, match=r"wrenches: must be numbers, \(n, 6\)"):
        check_many(pinch(), rows)


def test_several_wrenches_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_grasp(pinch(), tmp_path / "p.json")
    file, loads = str(tmp_path / "p.json"), tmp_path / "loads.json"
    loads.write_text(json.dumps({"schema": "handfast/loads/1", "loads": {"cut": [0, 0, 0.9, 0, 0, 0]}}))
    asked = ["check", file, "--wrench", "0", "0.5", "0", "--wrench", "0", "1.5", "0", "--loads", str(loads)]
    answer = ask(capsys, *asked)
    assert {name: a["verdict"] for name, a in answer["answers"].items()} == {
        "wrench 1": "holds",
        "wrench 2": "slips",
        "cut": "holds",
    }
    assert answer["schema"] == "handfast/answers/1"
    status, out, _ = run(capsys, *asked, "--report", str(tmp_path / "r.html"))
    assert (status, out.startswith("SLIPS  2 of 3 disturbances are resisted.")) == (0, True)
    assert (tmp_path / "r.html").read_text().count("Does it hold “") >= 3
    assert ask(capsys, "check", file, "--loads", str(loads))["verdict"] == "holds"
    complains(capsys, [*asked, "--save", str(tmp_path / "s.json")], ["--save: keeps one answer, and 3"])
    complains(capsys, [*asked, "--gravity", "all", "--mass", "1"], ["give one of the two"])
    complains(capsys, ["check", file, "--gravity", "up", "--mass", "1"], ["--gravity", "X Y Z, or the word all"])
    twice = ["--gravity", "all", "--gravity", "all", "--mass", "1", "--com", "0", "0", "0"]
    complains(capsys, ["check", file, *twice], ["'gravity +x' is asked about twice"])


def test_loads_of_a_body_and_of_the_program_have_one_set_of_names() -> None:
    assert Loads.gravity(load_body("can")).names == tuple(f"gravity {d}" for d in SIX)
