"""`--loading preload-first`: a load that comes after the squeeze, said, saved and verified."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast import load_grasp
from handfast.readers import grasp_file
from tests.support.jaws_on_paths import jaw
from tests.support.program import run

FIRST = "--loading", "preload-first"


@pytest.fixture
def lone(tmp_path: Path) -> str:
    """A grasp whose commands alone are in no balance: one finger pushes."""
    one = {"position": [-1, 0, 0], "normal": [1, 0, 0], "friction": 0.5}
    joint = {"name": "jaw", "type": "prismatic", "axis": [1, 0, 0], "origin": [-1, 0, 0], "moves": [0]}
    path = tmp_path / "lone.json"
    path.write_text(
        json.dumps({"schema": "handfast/grasp/1", "contacts": [one], "joints": [joint], "preload": {"jaw": 1}})
    )
    return str(path)


def test_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / "path.json")
    asked = "check", "fig9", "--wrench", "0", "1", "0", *FIRST
    status, out, _ = run(capsys, *asked, "--save", file)
    assert status == 0
    assert "After the squeeze 4 steps lead to 1 N along +y" in out
    status, out, _ = run(capsys, "verify", file)
    assert status == 0
    assert "PROVED" in out
    assert "step 4" in out
    status, out, _ = run(capsys, *asked, "--json")
    said = json.loads(out)
    assert (said["loading"], said["steps"], said["reached"], said["slips_at"]) == ("preload-first", 4, 1.0, None)


def test_a_path_of_one_step(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "check", "fig9", "--wrench", "0", "0", "0.01", *FIRST)
    assert "After the squeeze 1 step leads to 0.01 N along +z" in " ".join(out.split())


def test_a_path_that_ends(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "check", "fig9", "--wrench", "0", "4", "0", *FIRST)
    assert "After the squeeze the path to 4 N along +y ends: from 50 % of it, 75 % are not reached" in " ".join(
        out.split()
    )
    _, out, _ = run(capsys, "max", "fig9", "--direction", "0", "1", "0", *FIRST)
    assert "After the squeeze a force along +y may grow to 2.9" in " ".join(out.split())


def test_a_path_that_does_not_begin(lone: str, capsys: pytest.CaptureFixture[str]) -> None:
    for asked in (("check", lone, "--wrench", "-1", "0", "0"), ("max", lone, "--direction", "-1", "0", "0")):
        status, out, _ = run(capsys, *asked, *FIRST)
        assert status == 0
        assert "The commands alone are in no balance" in " ".join(out.split())


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        (("check", "fig9", "--wrench", "0", "1", "0", "--margin"), "--margin is about commands and load together"),
        (("check", "fig9", "--wrench", "0", "1", "0", "--no-mdp"), "needs the maximum dissipation principle"),
        (("max", "fig9", "--direction", "0", "1", "0", "--interval"), "cannot be asked with interval"),
        (("max", "fig9", "--direction", "0", "1", "0", "--base", "0", "0", "1"), "cannot be asked with base"),
        (("map", "fig9", "--steps", "4", "--interval"), "cannot be asked with interval"),
    ],
)
def test_what_is_refused(asked: tuple[str, ...], fault: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = run(capsys, *asked, *FIRST)
    assert status == 2
    assert fault in err
    assert len(err.splitlines()) == 1


def test_the_start_of_a_step_is_no_part_of_grasp_files() -> None:
    """It stands in path files alone."""
    assert "from" not in grasp_file.to_dict(load_grasp("fig9"))


@pytest.mark.slow
def test_hold_map_and_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grasp, held, curve, grown = (str(tmp_path / f"{name}.json") for name in ("jaw", "hold", "map", "sweep"))
    grasp_file.save_grasp(jaw(), grasp)
    asked = "hold", grasp, "--wrench", "-0.3", "0.3", "0", "--no-least", *FIRST
    status, out, _ = run(capsys, *asked, "--save", held)
    assert status == 0
    assert "1 load, each on its path after the squeeze" in " ".join(out.split())
    assert "This preload leaves" in out
    status, out, _ = run(capsys, "verify", held)
    assert status == 0
    assert "first the squeeze, then the load" in " ".join(out.split())
    status, out, _ = run(capsys, "map", grasp, "--steps", "1", "--gap", "0.01", "-o", curve, *FIRST)
    assert "first the squeeze, then the load" in " ".join(out.split())
    again = "sweep", grasp, "--joint", "jaw", "--to", "1", "--steps", "2", "--direction", "-1", "1", "0"
    run(capsys, *again, "--gap", "0.01", "-o", grown, *FIRST)
    for file in (curve, grown):
        assert json.loads(Path(file).read_text())["question"]["loading"] == "preload-first"
        status, out, _ = run(capsys, "verify", "--replay", file)
        assert status == 0
        assert "first the squeeze, then the load" in " ".join(out.split())
