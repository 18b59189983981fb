"""`handfast verify --replay` as it is typed: proved, refused, undecided, and one line for what is wrong."""

from __future__ import annotations

import json
import re
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from handfast.cli.tables import show_replay
from handfast.proofs.replay import Replay
from handfast.readers.grasp_file import save_grasp
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import force_map
from tests.support.problems import pinch
from tests.support.program import ask, complains, run


@pytest.fixture
def saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A map of one direction, along x, in a new current folder."""
    monkeypatch.chdir(tmp_path)
    data = force_map(pinch(), "yz", steps=1, settings=Settings(gap=1e-2), jobs=1).to_json()
    Path("map.json").write_text(json.dumps(data))
    return data


def test_a_map_is_proved(saved: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "verify", "map.json", "--replay")
    assert (status, err) == (0, "")
    assert out.startswith("PROVED  asked again: map of pinch: HOLDS, stop complete\n")
    assert "largest forces by direction: 2 claims" in out
    assert "Proved: forces in 1 direction of the yz plane" in out
    assert "lower bounds to within 1 %" in out
    assert out.rstrip().endswith("s, asked again; witnesses and certificates replayed")
    answer = ask(capsys, "verify", "map.json", "--replay")
    assert answer["ok"] is True
    assert answer["question"]["grasp"]["name"] == "pinch"
    assert answer["question"]["directions"] == [[0.0, 1.0, 0.0]]


def test_what_was_changed_is_refused(saved: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    saved["with_preload"]["upper"][0] = saved["with_preload"]["lower"][0] = 0.5
    Path("map.json").write_text(json.dumps(saved))
    status, out, _ = run(capsys, "verify", "map.json", "--replay")
    assert status == 1
    assert out.startswith("REFUSED  asked again: map of pinch")
    assert "with_preload: upper[0]: is 0.5; asked again, " in out.splitlines()[1]


def test_without_time_it_is_undecided(saved: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "verify", "map.json", "--replay", "--timeout", "1e-9")
    assert status == 3
    assert out.splitlines()[:2] == [
        "UNDECIDED  asked again: map of pinch: HOLDS, stop complete",
        "without_preload: not asked: no time was left to ask again",
    ]
    answer = ask(capsys, "verify", "map.json", "--replay", "--timeout", "1e-9", status=3)
    assert (answer["ok"], answer["undecided"]) == (False, True)


def test_a_sweep_tells_its_question(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grasp, file = str(tmp_path / "pinch.json"), str(tmp_path / "sweep.json")
    save_grasp(pinch(), grasp)
    asked = ["--joint", "left", "--from", "0.1", "--to", "0.2", "--steps", "2", "--direction", "0", "1", "0"]
    assert run(capsys, "sweep", grasp, *asked, "-o", file, "--gap", "0.01")[0] == 0
    status, out, _ = run(capsys, "verify", file, "--replay")
    assert status == 0
    assert "Proved: 1 direction under 2 commands of left" in out


def test_what_is_wrong_is_one_line(saved: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    again = "map.json: schema: is an answer without its proof; ask again: handfast verify FILE --replay"
    complains(capsys, ["verify", "map.json"], [again])
    complains(capsys, ["verify", "map.json", "--replay", "--row", "1"], ["map.json: --row: is for tables of labels"])
    complains(capsys, ["verify", "map.json", "--replay", "--dataset", "a"], ["map.json: --dataset: is for tables"])
    complains(capsys, ["verify", "none.jsonl", "--replay"], ["none.jsonl: no such file; a table of labels is needed"])
    complains(capsys, ["verify", "map.json", "--replay", "--question-timeout", "0"], ["timeout: is 0 s"])
    complains(
        capsys, ["verify", "map.json", "--replay", "--timeout", "-1"], ["timeout: is -1 s; a number above 0 is needed"]
    )
    saved.pop("question")
    Path("map.json").write_text(json.dumps(saved))
    complains(
        capsys, ["verify", "map.json", "--replay"], ["map.json: question: is missing, so that it cannot be asked"]
    )


@pytest.mark.parametrize("word", ["proved", "refused"])
def test_of_many_claims_some_are_shown(word: str) -> None:
    """The first and the last ten that are proved, the first twenty that are not."""
    out = Console(record=True, width=100, file=StringIO())
    parts = tuple(Replay(f"step {k}", f"claim {k}", "" if word == "proved" else "no") for k in range(53))
    assert show_replay(out, "all", Replay("all", parts=parts)) == word.upper()
    text = out.export_text()
    shown = [k for k in range(53) if re.search(rf"claim {k}\b", text)]
    assert shown == ([*range(10), *range(43, 53)] if word == "proved" else [*range(20)])
    assert ("33 claims between; --json lists all" in text) == (word == "proved")
    assert ("33 claims more that are not proved" in text) == (word == "refused")
    few = Console(record=True, width=100, file=StringIO())
    show_replay(few, "all", Replay("all", parts=parts[:20]))
    assert "--json" not in few.export_text()
