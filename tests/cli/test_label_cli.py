"""`handfast label` as it is typed: a table, a summary and its picture, and one line for what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast.cli.label import progress_text
from handfast.datasets.labels.label_dataset import LabelProgress
from handfast.datasets.labels.label_files import load_labels
from tests.support.labelled import fixture, write_lines
from tests.support.program import run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_lines(tmp_path / "a.jsonl", fixture(), {"schema": "handfast/grasp/1"})
    return tmp_path


@pytest.mark.slow
def test_a_table_a_summary_and_a_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["label", "a.jsonl", "-o", "b.jsonl", "--directions", "1", "--gravity", "0", "0", "-1", "--mass", "1"]
    status, out, err = run(capsys, *asked)
    assert (status, err.splitlines()[0]) == (0, "label: 0 of 2")
    assert "1 of 2 grasps labelled, 1 broken" in out
    assert "contacts: is missing" in out
    assert [row["mass"] for row in load_labels("b.jsonl")] == [1.0, None]
    summary = json.loads(Path("b.summary.json").read_text())
    assert summary["verdicts"] == {"holds": 1}
    assert summary["broken_rows"] == [{"row": 1, "name": "line 2", "reason": "contacts: is missing"}]
    assert Path("b.summary.png").read_bytes().startswith(b"\x89PNG")
    status, out, _ = run(capsys, *asked, "--resume", "--json")
    assert (status, json.loads(out)["fresh"]) == (0, 0)


def test_paths_are_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["label", "a.jsonl", "-o", "b.jsonl", "--directions", "1", "--gravity", "0", "0", "-1", "--mass", "1"]
    status, out, _ = run(capsys, *asked, "--gap", "0.1", "--loading", "preload-first")
    assert status == 0
    assert "First the squeeze, then the load: weights are held on their paths" in out
    assert json.loads(Path("b.summary.json").read_text())["loading"] == "preload-first"
    status, out, _ = run(capsys, "verify", "b.jsonl", "--replay", "--dataset", "a.jsonl", "--row", "1")
    assert "with which commands; first the squeeze, then the load" in out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["a.jsonl"], "label: missing: -o LABELS.parquet, or a table that ends in .jsonl"),
        (["a.jsonl", "-o", "b.csv"], "b.csv: a name that ends in .parquet or .jsonl is needed"),
        (["a.jsonl", "-o", "b.jsonl", "--hand", "x"], "--object: is missing; a table of postures needs both"),
        (["a.jsonl", "-o", "b.jsonl", "--jobs", "-1"], "--jobs: is -1; 0 or more is needed"),
        (["a.jsonl", "-o", "b.jsonl", "--gap", "0"], "gap: is 0; a positive number is needed"),
        (
            ["a.jsonl", "-o", "b.jsonl", "--joint-laws", "none"],
            "--joint-laws: is of the --hand of a table of postures; grasp files say it themselves",
        ),
        (
            ["a.jsonl", "-o", "b.jsonl", "--hand", "barrett-bh8-280", "--object", "can", "--joint-laws", "some"],
            "--joint-laws: is 'some'; all, none, or some of stops, friction, springs with commas between them",
        ),
        (["a.jsonl", "-o", "b.jsonl", "--friction", "-1"], "friction: is -1; a friction coefficient is 0 or more"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], line: str
) -> None:
    assert run(capsys, "label", *arguments) == (2, "", f"handfast: {line}\n")
    assert not list(folder.glob("b*"))


@pytest.mark.parametrize("name", ["b.summary.json", "b.summary.png"])
def test_a_summary_of_something_else_is_not_written_over(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (folder / name).write_text("mine")
    told = f"handfast: {name}: exists already; give --force to write over it\n"
    assert run(capsys, "label", "a.jsonl", "-o", "b.jsonl") == (2, "", told)
    assert (folder / name).read_text() == "mine"


@pytest.mark.slow
def test_where_every_row_is_broken_the_table_says_why(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_lines(folder / "c.jsonl", "{", "{")
    status, out, _ = run(capsys, "label", "c.jsonl", "-o", "d.jsonl")
    assert status == 2
    assert "0 of 2 grasps labelled, 2 broken" in out
    assert len(list(load_labels("d.jsonl"))) == 2


def test_progress_tells_rate_and_what_is_left() -> None:
    assert progress_text(LabelProgress(50, 250, 50, 1.0, 0)) == " · 50 a second · 0:00:04 left"
    assert progress_text(LabelProgress(50, 1_000_050, 50, 10.0, 3)) == " · 5 a second · 55:33:20 left · 3 broken"
    assert progress_text(LabelProgress(9, 10, 0, 0.0, 0)) == ""
