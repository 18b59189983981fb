"""`handfast settle`: told, written, refused; a grasp that slips at first and holds some way on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.simulation_floor import pinch
from handfast.readers.grasp_file import load_grasp, save_grasp
from handfast.simulation.settling import LOADS
from tests.support.program import ask, complains, run

SLIPS = ("settle", "fig1", "--wrench", "0", "2.4", "0")


@pytest.mark.slow
def test_a_grasp_is_followed_to_where_it_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = ("-o", str(tmp_path / "out"), "--report", str(tmp_path / "a.html"), "--strip", str(tmp_path / "a.png"))
    found = ask(capsys, *SLIPS, "--no-judge", "--timeout", "inf", *files)
    assert (found["rest"], found["before"], found["after"]) == ("settles", "slips", "holds")
    assert found["onset"] == pytest.approx(2.2245 / 2.4, abs=1 / LOADS)  # its certified maximum
    assert 5e-3 < found["moved"] < 2e-2
    assert found["path"][0]["share"] == 0
    assert found["path"][-1]["share"] == 1
    assert {c["link"] for c in found["path"][-1]["contacts"]} <= {c["link"] for c in found["last"]["contacts"]}
    assert json.loads((tmp_path / "out" / "settled.json").read_text()) == found
    last = load_grasp(tmp_path / "out" / "last.grasp.json")
    assert last.m == len(found["last"]["contacts"])
    assert last.provenance is not None
    assert last.provenance.faults() == []
    assert "Slips under 2.4 N along +y at first, holds it after" in (tmp_path / "a.html").read_text()
    assert Image.open(tmp_path / "a.png").size[0] > 1000
    # the files are a grasp as any other: it holds the load that it was left with
    wrench = [str(x) for x in found["last_wrench"]]
    again = ask(capsys, "check", str(tmp_path / "out" / "last.grasp.json"), "--wrench", *wrench)
    assert again["verdict"] == "holds"
    complains(capsys, [*SLIPS, "-o", str(tmp_path / "out")], ["settled.json", "exists already"])


def test_what_holds_is_not_followed(capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "settle", "fig1", "--wrench", "0", "1", "0")
    assert status == 0
    assert "HOLDS  fig1 holds 1 N along +y as it stands: nothing was followed" in said


def test_the_files_have_the_mass_and_the_centre_that_were_asked_about(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """30 kg, 0.25 m behind the origin: 294.2 N and 73.55 N m."""
    weight = ("--gravity", "0", "0", "-1", "--mass", "30", "--com", "-0.25", "0", "0.1")
    found = ask(capsys, "settle", "four-feet", *weight, "--follow", "--no-judge", "-o", str(tmp_path / "out"))
    for name in ("first", "last"):
        grasp = load_grasp(tmp_path / "out" / f"{name}.grasp.json")
        assert grasp.mass == 30
        assert grasp.center_of_mass == pytest.approx([-0.25, 0, 0.1])
    assert found["wrench"] == pytest.approx([0, 0, -294.2, 0, -73.55, 0], rel=1e-3)
    again = ask(capsys, "settle", str(tmp_path / "out" / "first.grasp.json"), "--gravity", "0", "0", "-1", "--no-judge")
    assert again["wrench"] == found["wrench"]


def test_a_motion_without_end_in_its_steps_is_open(capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "settle", "fig11", "--wrench", "0", "1.1", "0", "--steps", "3")
    assert status == 3
    assert "UNDECIDED  fig11 still moves" in said


def test_it_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_grasp(pinch(0.5), tmp_path / "bare.json")
    complains(
        capsys, ["settle", str(tmp_path / "bare.json"), "--wrench", "0", "0", "2"], ["provenance", "does not say which"]
    )
    complains(capsys, [*SLIPS, "--distance", "0"], ["distance: is 0.0; a length above 0 [m]"])
    complains(capsys, [*SLIPS, "--report", "a.txt"], ["a.txt", ".html"])
