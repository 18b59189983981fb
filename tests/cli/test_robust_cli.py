"""`handfast robust`: said, written, refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.simulation_floor import pinch
from handfast.pictures.sampled_picture import bound_text, conclusion
from handfast.pictures.words import num
from handfast.readers.grasp_file import save_grasp
from handfast.stability.studies.sampled_maximum import Perturbation, sampled_maximum
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


def test_lower_bounds_are_called_so() -> None:
    """Where the time ended a search: of the grasp, of the promise for its normals, of a sample."""
    bounds = Perturbation(normals=0.03)
    found = sampled_maximum(pinch(0.5), [0, 0, 1, 0, 0, 0], bounds, samples=3, jobs=1)
    assert not any("lower bound" in line for line in conclusion(found))
    upper = found.upper.copy()
    upper[0] *= 2
    assert "1 value is a lower bound: the search ended before" in " ".join(conclusion(replace(found, upper=upper)))
    assert bound_text(found.nominal, 1.0) == num(found.nominal.lower)
    apart = replace(found.nominal, upper=2 * found.nominal.lower)
    assert bound_text(apart, 1.0) == f"{num(apart.lower)} to {num(apart.upper)}"
    assert bound_text(replace(apart, upper=float("inf")), 1.0) == f"{num(apart.lower)} or more"
    assert bound_text(replace(apart, lower=0.0), 1.0) == f"not decided, at most {num(apart.upper)}"


def test_it_refuses(pinched: str, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["robust", pinched, "--direction", "0", "0", "1"]
    complains(capsys, asked, ["nothing is off", "--positions, --normals, --frictions and --commands"])
    complains(capsys, [*asked, "--normals", "45"], ["--normals: is 45; 0 to below 45 degrees"])
    complains(capsys, [*asked, "--commands", "1"], ["--commands: is 1; a share from 0 to below 1"])
    complains(capsys, [*asked, "--normals", "1", "-o", "a.gif"], ["a.gif", ".png or .svg or .json"])
