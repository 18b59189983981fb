"""`handfast simulate`: said, written, and looked at."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.simulation_floor import pinch
from handfast.readers.grasp_file import save_grasp
from tests.support.program import ask, complains, run


@pytest.fixture
def pinched(tmp_path: Path) -> str:
    """A pinch that carries 1 N across."""
    path = tmp_path / "pinch.json"
    save_grasp(pinch(0.5), path)
    return str(path)


@pytest.mark.slow
def test_a_simulation_is_told_and_written(pinched: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = {"--save": "a.json", "--series": "a.csv", "--strip": "a.png", "--film": "a.gif"}
    files = [word for option, name in names.items() for word in (option, str(tmp_path / name))]
    asked = ("simulate", pinched, "--wrench", "0", "0", "-1.2", "--ramp", "2")
    answer = ask(capsys, *asked, *files)
    assert answer["ending"] == "slips"
    assert 1.2 * answer["onset"] == pytest.approx(1.0, abs=0.06)
    saved = json.loads((tmp_path / "a.json").read_text())
    assert saved["series"] == answer["series"]
    with (tmp_path / "a.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == len(answer["series"]["time"])
    assert float(rows[-1]["contact_1_normal"]) == pytest.approx(answer["series"]["forces"][-1][1][0], rel=1e-6)
    assert Image.open(tmp_path / "a.gif").n_frames > 10
    assert Image.open(tmp_path / "a.png").size[0] > 1000


def test_the_ending_in_words(pinched: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "simulate", pinched, "--wrench", "0", "0", "-0.5", "--ramp", "1")
    assert status == 0
    assert "HOLDS" in said
    assert "contacts that carry: 0, 1" in said


def test_hand_and_object_are_simulated_where_they_are_known(pinched: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "simulate", "fig11", "--bodies", "--wrench", "0", "0.5", "0", "--ramp", "0.5")
    assert status == 0
    assert "hand and object touch at 2 points" in said
    complains(capsys, ["simulate", pinched, "--bodies", "--wrench", "0", "0", "-0.5"], ["provenance", "not known"])


@pytest.mark.slow
def test_a_path_stands_beside_a_simulation(pinched: str, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["simulate", pinched, "--wrench", "0", "0", "-1.2", "--ramp", "2", "--path", "--closing", "1"]
    path = ask(capsys, *asked)["path"]
    assert path["reached"] * 1.2 == pytest.approx(1.0, rel=0.02)
    assert path["onset"] * 1.2 == pytest.approx(1.0, abs=0.06)
    assert path["loads"][-1]["simulated"] == pytest.approx(path["loads"][-1]["path"], rel=0.02)
    status, said, _ = run(capsys, *asked)
    assert status == 0
    assert "the path ends at 0.83" in said
    complains(capsys, [*asked, "--loading", "together"], ["--path", "commands first"])


def test_it_refuses_what_it_cannot_write(pinched: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "there.csv"
    there.write_text("kept")
    asked = ["simulate", pinched, "--wrench", "0", "0", "-0.5"]
    complains(capsys, [*asked, "--series", str(there)], ["there.csv", "exists already"])
    assert there.read_text() == "kept"
    complains(capsys, [*asked, "--film", "a.mp4"], ["a.mp4", "ends in .gif"])
    complains(capsys, ["simulate", pinched], ["--wrench", "--gravity"])
    complains(capsys, [*asked, "--ramp", "-1"], ["ramp: is -1.0", "above 0"])
