"""`handfast robust`: said, written, refused."""

from __future__ import annotations

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


def test_the_spread_is_told_and_written(pinched: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["robust", pinched, "--direction", "0", "0", "1", "--normals", "2", "--frictions", "0.1", "--samples", "5"]
    answer = ask(capsys, *asked, "-o", str(tmp_path / "a.json"))
    assert answer["bounds"] == pytest.approx({"positions": 0, "normals": 0.0349066, "friction": 0.1, "command": 0})
    assert len(answer["lower"]) == 5
    assert {**json.loads((tmp_path / "a.json").read_text()), "seconds": 0} == {**answer, "seconds": 0}
    status, said, _ = run(capsys, *asked, "-o", str(tmp_path / "a.png"))
    assert status == 0
    assert "with eta = 2°, equation (17)" in said
    assert "Eta is about normals alone; beside them, friction is off." in said
    assert Image.open(tmp_path / "a.png").size[0] > 700


def test_it_refuses(pinched: str, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["robust", pinched, "--direction", "0", "0", "1"]
    complains(capsys, asked, ["nothing is off", "--positions, --normals, --frictions and --commands"])
    complains(capsys, [*asked, "--normals", "45"], ["--normals: is 45; 0 to below 45 degrees"])
    complains(capsys, [*asked, "--commands", "1"], ["--commands: is 1; a share from 0 to below 1"])
    complains(capsys, [*asked, "--normals", "1", "-o", "a.gif"], ["a.gif", ".png or .svg or .json"])
