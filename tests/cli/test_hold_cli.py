"""The command line: hold, of one grasp and of several."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.program import ask, complains, planar, run

# of `planar`: commands of 0.1 N m hold 2 * 0.1 / (0.093 - 0.003) N along +y, and all is homogeneous
NEEDED = 0.045  # [N m] for 1 N
UP, HALF = ["--wrench", "0", "1", "0"], ["--wrench", "0", "0.5", "0"]
QUICK = ["--gap", "0.02"]


def several(folder: Path) -> str:
    """A folder of a grasp, one that cannot hold (no friction), and a broken file."""
    smooth = planar()
    for contact in smooth["contacts"]:
        contact["friction"] = 0.0
    folder.mkdir()
    for name, data in (("a.json", planar()), ("b.json", {"schema": "handfast/grasp/1"}), ("c.json", smooth)):
        (folder / name).write_text(json.dumps(data))
    return str(folder)


def test_one_preload_holds_two_loads(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "hold", grasp, *UP, *HALF)
    assert (answer["query"], answer["verdict"], answer["stop"]) == ("hold", "holds", "complete")
    assert answer["upper"] == max(map(abs, answer["preload"].values())) == pytest.approx(NEEDED, rel=2e-3)
    assert answer["lower"] == pytest.approx(NEEDED, rel=2e-3)
    assert answer["hardest"] == "wrench 1"
    assert answer["margin"] == pytest.approx(1.0, rel=2e-3)
    assert answer["margins"]["wrench 1"]["lower"] == pytest.approx(1.0, rel=2e-3)
    assert answer["margins"]["wrench 2"]["lower"] == pytest.approx(2.0, rel=2e-3)  # of half the load
    assert answer["margins"]["wrench 2"]["upper"] == pytest.approx(2.0, rel=3e-3)


@pytest.mark.slow
def test_the_table_the_file_and_the_page_of_two_loads(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "hold", grasp, *UP, *HALF, *QUICK, "--save", "hold.json", "--report", "hold.html")
    assert status == 0
    assert "One preload holds 2 loads; its largest command is 0.045" in out
    assert "N·m" in out
    assert "wrench 1 has the least" in out
    assert "--safety 1.5 asks for 1.5" in out
    assert "Written: hold.json" in out
    done = ask(capsys, "verify", "hold.json")
    assert done["ok"]
    assert {"wrench 1, margin", "wrench 2, margin"} <= {part["name"] for part in done["parts"]}
    assert "Does it hold “wrench 1”?" in Path("hold.html").read_text("utf-8")


def test_safety_multiplies_the_loads(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "hold", grasp, *UP, "--safety", "2", "--no-margin", *QUICK)
    assert answer["loads"] == {"wrench": [0, 2, 0, 0, 0, 0]}
    assert answer["upper"] == pytest.approx(2 * NEEDED, rel=2e-2)
    assert "margin" not in answer
    _, out, _ = run(capsys, "hold", grasp, *UP, "--safety", "2", "--no-least", *QUICK)
    assert "which are 2 times what was given" in out


def test_loads_of_any_size_have_no_margin_in_numbers(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Locked fingers carry what presses the object on them at any size: no command is needed."""
    down = ["--wrench", "0", "-1", "0"]
    _, out, _ = run(capsys, "hold", grasp, *down, *QUICK, "--save", "hold.json")
    answer = json.loads(Path("hold.json").read_text())["answer"]
    assert (answer["upper"], answer["margin"], answer["margins"]["wrench"]["unbounded"]) == (0.0, None, True)
    assert "Every actuator may stay locked: 1 load resisted" in out
    assert "any size" in out


def test_loads_of_a_file_and_weights(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    loads = {"schema": "handfast/loads/1", "loads": {"lift": [0, 1, 0, 0, 0, 0]}}
    Path("loads.json").write_text(json.dumps(loads))
    answer = ask(capsys, "hold", grasp, "--loads", "loads.json", "--no-margin", *QUICK)
    assert answer["loads"] == loads["loads"]
    weight = ["--gravity", "0", "1", "0", "--mass", "0.1", "--com", "0", "0", "0"]
    heavy = ask(capsys, "hold", grasp, *weight, "--no-margin", *QUICK)
    assert heavy["loads"]["gravity 0 1 0"] == pytest.approx([0, 0.981, 0, 0, 0, 0])
    assert heavy["upper"] == pytest.approx(0.981 * NEEDED, rel=2e-2)


def test_commands_have_a_limit(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "hold", grasp, *UP, "--command-limit", "0.04", *QUICK)
    assert status == 0
    assert "SLIPS  No preload of commands up to 0.04 holds wrench." in out
    quick = ask(capsys, "hold", grasp, *UP, "--command-limit", "0.08", "--no-least", "--no-margin", *QUICK)
    assert quick["verdict"] == "holds"
    assert quick["upper"] <= 0.08
    assert quick["lower"] == 0.0


def test_no_time_leaves_it_open(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "hold", grasp, *UP, "--timeout", "1e-9", status=3)
    assert (answer["verdict"], answer["stop"], answer["preload"]) == ("undecided", "time", None)
    status, out, _ = run(capsys, "hold", grasp, *UP, "--timeout", "1e-9")
    assert status == 3
    assert "It was not decided whether one preload holds 1 load." in out
    assert "a larger --timeout may decide it" in out


@pytest.mark.slow
def test_a_folder_has_a_line_each(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = several(Path("grasps"))
    status, out, _ = run(capsys, "hold", folder, *UP, *QUICK, "--jobs", "1", "--save", "kept")
    assert status == 0
    assert "3 grasps: 1 holds, 1 slips, 1 broken" in out
    lines = {line.split()[1]: line for line in out.splitlines() if line[:1].isdigit() and ".json" in line}
    assert "HOLDS" in lines["a.json"]
    assert "N·m" in lines["a.json"]
    assert "BROKEN" in lines["b.json"]
    assert "SLIPS" in lines["c.json"]
    assert "1: contacts: is missing" in out
    assert sorted(p.name for p in Path("kept").iterdir()) == ["000.hold.json", "002.hold.json"]
    for saved in Path("kept").iterdir():
        assert ask(capsys, "verify", str(saved))["ok"]
    done = ask(capsys, "verify", "kept")
    assert [part["name"] for part in done["parts"]] == ["000.hold.json", "002.hold.json"]
    assert done["ok"]
    assert set(done["question"]) == {"000.hold.json", "002.hold.json"}
    status, out, _ = run(capsys, "verify", "kept")
    assert (status, out.split("\n")[0]) == (0, "PROVED  folder: 2 answers")
    Path("kept/002.hold.json").write_text("{}")
    complains(capsys, ["verify", "kept"], ["handfast: kept/002.hold.json: schema: is missing"])
    complains(capsys, ["verify", "grasps"], ["handfast: grasps: holds nothing to verify; a folder that plan, grasp or"])


def test_rows_as_json_are_the_same_on_two_processes(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = several(Path("grasps"))
    Path("all.jsonl").write_text(
        "".join(json.dumps(json.loads(f.read_text())) + "\n" for f in sorted(Path(folder).iterdir()))
    )
    asked = ["--no-margin", *UP, *QUICK]
    one, two = (ask(capsys, "hold", folder, *asked, "--jobs", jobs) for jobs in ("1", "2"))
    lines = ask(capsys, "hold", "all.jsonl", *asked, "--jobs", "1")
    assert [row["name"] for row in one["rows"]] == ["a.json", "b.json", "c.json"]
    for rows in (two["rows"], lines["rows"]):
        for row, other in zip(one["rows"], rows, strict=True):
            assert (row["reason"] is None) == (other["reason"] is None) == (row["answer"] is not None)
            if row["answer"]:
                keys = ("verdict", "preload", "lower", "upper", "hardest")
                assert [row["answer"][key] for key in keys] == [other["answer"][key] for key in keys]


def test_a_folder_of_nothing_but_faults_is_bad_input(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("grasps").mkdir()
    Path("grasps/a.json").write_text("{}")
    status, out, _ = run(capsys, "hold", "grasps", *UP, "--jobs", "1")
    assert status == 2
    assert "1 grasp: none asked, 1 broken" in out


def test_an_open_row_makes_it_open(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "hold", several(Path("grasps")), *UP, "--jobs", "1", "--timeout", "1e-9")
    assert status == 3
    assert "UNDECIDED, time" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["grasp.json"], ["missing: --wrench", "--gravity"]),
        (["folder"], ["missing: --wrench", "--gravity"]),
        (["folder", *UP, "--report", "page.html"], ["--report", "one grasp"]),
        (["folder", *UP, "--save", "grasp.json"], ["grasp.json", "is a file; a folder is needed"]),
        (["folder", *UP, "--save", "folder"], ["folder", "is not empty", "--force"]),
        (["folder", *UP, "--jobs", "-1"], ["--jobs", "is -1; 0 or more"]),
        (["folder", *UP, "--jobs", "2", "--scheduler", "tcp://a:1"], ["--jobs: is of this machine; a --scheduler has"]),
        (["fig1", *UP, "--scheduler", "tcp://a:1"], ["--scheduler: is for a folder of grasps; one is asked about"]),
        (["grasp.json", *UP, "--timeout", "0"], ["--timeout", "is 0 s; a positive number is needed"]),
        (["grasp.json", *UP, "--timeout", "nan"], ["--timeout", "a positive number is needed"]),
        (["grasp.json", *UP, "--command-limit", "-1"], ["--command-limit", "is -1; 0 or more is needed"]),
        (["grasp.json", *UP, "--safety", "0"], ["safety", "is 0; a positive number is needed"]),
        (["grasp.json", *UP, "--save", "hold.txt"], ["hold.txt", "ends in .json"]),
        (["nobody", *UP], ["nobody: no such file", "bundled:"]),
    ],
)
def test_bad_input(arguments: list[str], says: list[str], grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    several(Path("folder"))
    complains(capsys, ["hold", *arguments], says)
