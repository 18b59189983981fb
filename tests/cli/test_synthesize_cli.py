"""`handfast synthesize`: tables, JSON, files, exit statuses, progress, and bad input read aloud."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.cli import console, main, synthesize
from handfast.cli.app import ABOUT
from handfast.core import bundled
from handfast.readers.load_hand import load_hand
from handfast.synthesis.query import SynthesisProgress
from handfast.synthesis.task_file import save_task
from tests.support.holds import HARD, LARGE, grip_file, pinch
from tests.support.interruptions import interrupted_program

LIMITED = ("--nodes", "2000", "--timeout", "inf")
KEYS = {"schema", "query", "verdict", "stop", "seconds", "nodes"}


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("grip.json").write_text(json.dumps(grip_file()))
    return "grip.json"


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(list(arguments))
    said = capsys.readouterr()
    return status, said.out, said.err


# --- answers ------------------------------------------------------------------------------------


def test_found_as_json(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "synthesize", task, "--json")
    answer = json.loads(out)
    assert (status, err, answer["verdict"], answer["stop"]) == (0, "", "found", "complete")
    assert set(answer) >= KEYS | {"configurations", "starts", "unproved", "seed", "spread", "searched"}
    assert (answer["query"], answer["spread"], answer["searched"]) == ("synthesize", None, None)
    (c,) = answer["configurations"]
    assert set(c) == {"joints", "object_pose", "contacts", "slacks", "existence"}
    assert [x["link"] for x in c["contacts"]] == ["left_finger", "right_finger"]
    assert c["joints"]["left_slide"] == c["existence"]["joints"]["left_slide"]
    assert len(c["existence"]["dependent"]) == len(c["existence"]["radii"]) == 6
    assert np.linalg.norm(c["object_pose"]["quaternion"]) == pytest.approx(1)


def test_found_as_table(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "synthesize", task)
    assert status == 0
    assert out.startswith("FOUND  1 configuration, proved to exist (")
    for text in ("left_slide", "0 to 40", "left_finger", "Object at (", "normal into the object", "Nearest bounds: "):
        assert text in out
    assert "Proved: an exact configuration is within" in out


def test_table_is_in_degrees_and_millimetres(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "synthesize", task, "--json")
    (c,) = json.loads(out)["configurations"]
    _, out, _ = run(capsys, "synthesize", task)
    row = next(line for line in out.splitlines() if line.startswith("left_slide"))
    assert float(row.split()[1]) == pytest.approx(1e3 * c["joints"]["left_slide"], rel=1e-3)
    p = pinch()
    assert synthesize.slack_text(p, "joint:index_middle", np.radians(3)) == "3°"
    assert synthesize.slack_text(p, "contact:0:cone", np.radians(2)) == "2°"
    assert synthesize.slack_text(p, "contact:0:s", 0.25) == "0.25"
    assert synthesize.slack_text(p, "position:1", 0.002) == "2 mm"


def test_several(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "synthesize", task, "--count", "5", "--seed", "2")
    assert status == 0
    assert "FOUND  5 configurations, proved to exist" in out
    assert out.count("Object at (") == synthesize.SHOWN == 3
    assert "Any two of them are at least" in out
    _, first, _ = run(capsys, "synthesize", task, "--count", "5", "--seed", "2", "--json")
    _, second, _ = run(capsys, "synthesize", task, "--count", "5", "--seed", "2", "--json")
    assert json.loads(first)["configurations"] == json.loads(second)["configurations"]


def test_none(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(task).write_text(json.dumps(grip_file(0.1)))
    status, out, _ = run(capsys, "synthesize", task)
    assert status == 0
    assert out.startswith("NONE  No configuration exists: contacts 0 and 1 cannot go together (")
    assert "1 box examined, depth 0, all discarded" in out
    status, out, _ = run(capsys, "synthesize", task, "--json", "--save", "s.json")
    answer = json.loads(out)
    assert (status, answer["verdict"], answer["configurations"]) == (0, "none", [])
    assert answer["searched"]["discarded"] == 1
    status, out, _ = run(capsys, "verify", "s.json")
    assert (status, out.split("  ")[0]) == (0, "PROVED")
    assert "contacts 0 and 1 exclude each other, by 1 box of the checker's own" in " ".join(out.split())


def test_undecided_saved_and_resumed(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    save_task(pinch(LARGE), task, force=True)
    status, out, _ = run(capsys, "synthesize", task, *LIMITED, "--save", "s.json")
    assert status == 3
    assert "UNDECIDED  Neither a configuration nor a contradiction was found: the node limit was hit (" in out
    assert "Written: s.json" in out
    status, out, _ = run(capsys, "verify", "s.json")
    assert (status, out.split("  ")[0]) == (0, "NOTHING CLAIMED")
    resumed = ("--resume", "s.json", "--json", "--save", "s.json", "--force")
    status, out, _ = run(capsys, "synthesize", task, *LIMITED, *resumed)
    assert status == 3
    assert json.loads(out)["nodes"] >= 4000
    Path(task).write_text(json.dumps(grip_file(0.07)))
    status, out, err = run(capsys, "synthesize", task, "--resume", "s.json")
    assert (status, out) == (2, "")
    assert err == (
        "handfast: s.json: resume: is of another task: its hand, limits, bounds or regions differ from this one's\n"
    )


def test_fewer_than_asked_for_is_undecided(
    task: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handfast.synthesis.distance.DISTINCT_DISTANCE", 0.5)
    status, out, _ = run(capsys, "synthesize", task, "--count", "50", "--timeout", "inf")
    assert status == 3
    assert re.search(r"FOUND  \d+ configurations of 50, proved to exist", out)
    assert "no others were met that differ" in " ".join(out.split())


# --- files --------------------------------------------------------------------------------------


def test_save_verify_configuration(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "synthesize", task, "--save", "s.json", "--configuration", "c.json")
    assert status == 0
    assert "Written: s.json" in out
    assert "Written: c.json" in out
    status, out, _ = run(capsys, "verify", "s.json")
    assert (status, out.split("  ")[0]) == (0, "PROVED")
    assert "proved" in out.splitlines()[4]
    status, out, _ = run(capsys, "verify", "s.json", "--json")
    done = json.loads(out)
    assert (status, done["schema"], done["ok"]) == (0, "handfast/verification/1", True)
    (configuration,) = (part for part in done["parts"] if part["name"].startswith("configuration"))
    assert configuration["ok"]
    assert (done["question"]["hand"]["name"], len(done["question"]["task"]["sha256"])) == ("parallel-gripper", 64)
    assert configuration["gap"] < 1e-12
    data = json.loads(Path("c.json").read_text())
    assert data["hand"] == "parallel-gripper"
    assert set(data["joints"]) == set(load_hand("parallel-gripper").joint_names)
    status, _, err = run(capsys, "synthesize", task, "--save", "s.json")
    assert (status, err) == (2, "handfast: s.json: exists already; give --force to write over it\n")


def test_several_configurations_are_numbered(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "synthesize", task, "--count", "3", "--configuration", "c.json")[0] == 0
    assert sorted(p.name for p in Path().glob("c*.json")) == ["c-1.json", "c-2.json", "c-3.json"]
    status, _, err = run(capsys, "synthesize", task, "--count", "3", "--configuration", "c.json")
    assert (status, err) == (2, "handfast: c-1.json: exists already; give --force to write over it\n")


def test_a_file_that_was_changed_is_refused(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "synthesize", task, "--save", "s.json")
    text = Path("s.json").read_text()
    Path("s.json").write_text(text.replace('"left_slide": 0.0', '"left_slide": 0.00', 1))
    status, out, err = run(capsys, "verify", "s.json")
    assert (status, out) == (2, "")
    assert err == "handfast: s.json: checksum: does not fit: the file was changed after it was written\n"


def test_a_proof_that_fails_is_refused(task: str, capsys: pytest.CaptureFixture[str]) -> None:
    from handfast.synthesis.embedded_task import digest

    run(capsys, "synthesize", task, "--save", "s.json")
    data = json.loads(Path("s.json").read_text())
    data["answer"]["configurations"][0]["existence"]["position"][1] += 1e-3
    data.pop("checksum")
    Path("s.json").write_text(json.dumps(data | {"checksum": digest(data)}))
    status, out, _ = run(capsys, "verify", "s.json")
    assert (status, out.split("  ")[0]) == (1, "REFUSED")
    assert "configuration 0: the floats do not meet the equations" in out
    status, out, _ = run(capsys, "verify", "s.json", "--json")
    assert (status, json.loads(out)["ok"]) == (1, False)


def test_bundled_tasks_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "synthesize", "scalpel-upholding")
    assert status == 0
    assert "scalpel-upholding: 2 contacts of schunk-sah" in out
    assert "scalpel-upholding" in bundled.names("tasks")


@pytest.mark.parametrize("ending, begins", [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_picture(task: str, ending: str, begins: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("handfast.pictures.task_picture")
    status, out, _ = run(capsys, "synthesize", task, "-o", f"hold.{ending}")
    assert status == 0
    assert f"Written: hold.{ending}" in out
    assert Path(f"hold.{ending}").read_bytes().startswith(begins)


# --- progress and Ctrl-C --------------------------------------------------------------------------


def test_progress_in_words() -> None:
    assert synthesize.progress_text(SynthesisProgress(512, 0, 1)) == "512 starts"
    text = synthesize.progress_text(SynthesisProgress(512, 0, 1, nodes=70, depth=3, pending=5, discarded=0.25))
    assert text == "512 starts · 70 boxes, 5 left, depth 3, 25 % discarded"
    assert synthesize.progress_text(SynthesisProgress(256, 40, 80)) == "256 starts · 40 of 80 found"


def test_progress_goes_to_a_terminal_only(
    task: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    save_task(pinch(LARGE), task, force=True)
    screen = Terminal()
    monkeypatch.setattr(console, "PROGRESS_DELAY", 0.0)
    monkeypatch.setattr(sys, "stderr", screen)
    assert main(["synthesize", task, *LIMITED]) == 3
    assert "boxes" in screen.getvalue()
    assert "discarded" in screen.getvalue()
    assert "boxes," not in capsys.readouterr().out


def test_ctrl_c(task: str) -> None:
    """The answer so far, exit status 3, a state that can be resumed."""
    save_task(pinch(HARD), task, force=True)
    step = "handfast.core.branch.BranchAndPrune._commit"
    done = interrupted_program(step, 100, "synthesize", task, "--timeout", "inf", "--save", "s.json")
    assert (done.returncode, done.stderr) == (3, "")
    assert "UNDECIDED" in done.stdout
    assert "interrupted" in done.stdout
    state = json.loads(Path("s.json").read_text())["state"]
    assert state["seed"] == 0
    assert sum(s["steps"] for s in state["prover"]["sets"].values()) == 100


# --- bad input, read aloud --------------------------------------------------------------------------


def contact(data: dict[str, Any], k: int = 0) -> dict[str, Any]:
    return data["contacts"][k]


FAULTS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (
        lambda d: contact(d)["hand"].update(link="thumb"),
        "grip.json: contacts[0].hand.link: unknown link 'thumb'; known: palm, left_finger, right_finger",
    ),
    (
        lambda d: d.update(limits={"slide": [0, 0.01]}),
        "grip.json: limits: unknown joint 'slide'; known: left_slide, right_slide",
    ),
    (
        lambda d: d.update(limits={"left_slide": [0.03, 0.01]}),
        "grip.json: limits.left_slide: is [0.03, 0.01]; the lower one comes first",
    ),
    (
        lambda d: d.update(couplings=[{"joint": "left_slide", "equals": "middle"}]),
        "grip.json: couplings[0].equals: unknown joint 'middle'; known: left_slide, right_slide",
    ),
    (
        lambda d: contact(d)["object"]["region"].update(bezier=[[[0, 0, 0], [0, 0, 1]]]),
        "grip.json: contacts[0].object.region.bezier: has 1 x 2 points; at least 2 x 2 are needed",
    ),
    (
        lambda d: contact(d, 1)["hand"]["region"]["cap"].pop("radius"),
        "grip.json: contacts[1].hand.region.cap.radius: is missing",
    ),
    (
        lambda d: contact(d, 1)["hand"]["region"]["cap"].update(radius=-1),
        "grip.json: contacts[1].hand.region.cap.radius: is -1; it must be positive [m]",
    ),
    (
        lambda d: d.update(pose={"x_axis": [[0.9, 1], [-1, 1], [-1, 1]], "y_axis": [[0.9, 1], [-1, 1], [-1, 1]]}),
        "grip.json: pose: x_axis and y_axis contradict each other: no rotation has its axes within these bounds; "
        "widen one",
    ),
    (
        lambda d: d.update(pose={"z_axis": [[-0.1, 0.1], [-0.1, 0.1], [-0.1, 0.1]]}),
        "grip.json: pose.z_axis: contradicts itself: every vector within is shorter than 1",
    ),
    (
        lambda d: d.update(pose={"position": [[0.2, 0.1], [0, 1], [0, 1]]}),
        "grip.json: pose.position[0]: is [0.2, 0.1]; the lower one comes first",
    ),
    (lambda d: d.update(contacts=[]), "grip.json: contacts: is empty; at least one pair of regions is needed"),
    (
        lambda d: d.update(hand="hand"),
        "grip.json: hand: 'hand' is no file beside the task and no bundled hand; bundled: ",
    ),
    (lambda d: d.update(touches=[]), "grip.json: touches: is not a known field; leave it out"),
    (
        lambda d: d.update(limits={"right_slide": [0.05, 0.06]}),
        "grip.json: limits.right_slide: leave nothing for left_slide, to which it is coupled; widen them, or fix "
        "left_slide itself by equal limits",
    ),
]


@pytest.mark.parametrize("change, line", FAULTS, ids=lambda x: None)
def test_bad_tasks(
    change: Callable[[dict[str, Any]], Any], line: str, task: str, capsys: pytest.CaptureFixture[str]
) -> None:
    data = grip_file()
    change(data)
    Path(task).write_text(json.dumps(data))
    status, out, err = run(capsys, "synthesize", task)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"handfast: {line}")


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["nothing"], "nothing: no such file, and no bundled task of that name; bundled: guitar-holding, "),
        (["missing.json"], "missing.json: no such file; a task file is needed"),
        (["grip.json", "--count", "0"], "--count: is 0; at least 1 is needed"),
        (["grip.json", "--seed", "-1"], "seed: is -1; a number from 0 on is needed"),
        (["grip.json", "--timeout", "0"], "timeout: is 0 s; a positive number is needed"),
        (["grip.json", "--timeout", "nan"], "timeout: is nan s; a positive number is needed"),
        (["grip.json", "--save", "s.txt"], "s.txt: a name that ends in .json is needed"),
        (["grip.json", "-o", "s.txt"], "s.txt: a name that ends in .png or .svg is needed"),
        (["grip.json", "--resume", "grip.json"], "grip.json: schema: is not 'handfast/synthesis/1', as written by "),
        (["grip.json", "--resume", "none.json"], "none.json: no such file; a synthesis file is needed"),
        (["grip.json", "--cont", "3"], "synthesize: unknown option '--cont'; did you mean --count?"),
        ([], "synthesize: missing: TASK"),
    ],
)
def test_bad_arguments(arguments: list[str], line: str, task: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "synthesize", *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"handfast: {line}")


def test_about_names_both_questions(capsys: pytest.CaptureFixture[str]) -> None:
    assert "Will this grasp hold" in ABOUT
    assert "can the hand take that hold" in ABOUT
    assert run(capsys, "--help")[0] == 0


def test_the_package_offers_both_and_stays_quick() -> None:
    code = (
        "import sys, handfast; "
        "assert {'synthesize', 'load_task', 'Task', 'ContactPair', 'Bezier', 'Cap', 'PoseBounds', 'Reach'} "
        "<= set(handfast.__all__); "
        "assert not {'numpy', 'numba', 'pydantic'} & set(sys.modules); "
        "print(handfast.Reach.FOUND, handfast.Task.__name__, handfast.synthesize.__name__)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "found Task synthesize"
