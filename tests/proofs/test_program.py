"""`python -m handfast.proofs FILE`: what it prints, and its exit status."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

from handfast.proofs import __main__ as program
from handfast.proofs import files
from handfast.proofs.replay import Replay

SCHEMA = "handfast/said/1"


def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, done: Replay) -> int:
    """Of a file of which a reader of this test says what is proved."""
    monkeypatch.setitem(files.READERS, SCHEMA, lambda data, place: done)
    (tmp_path / "file.json").write_text(json.dumps({"schema": SCHEMA}))
    status: Any = program.main([str(tmp_path / "file.json")])
    return int(status)


def test_what_is_proved(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = {"motion_cap": None, "leaves": 12, "margin": 0.123456, "exact": True}
    leaf = Replay("witness", "the load is held", figures=figures)
    inner = Replay("grasp 0", parts=(leaf, Replay("bare")), not_replayed=("clearances", "names"))
    done = Replay("plan", parts=(inner, Replay("certificate", "2 N slips")), not_replayed=("the rest",))
    assert run(monkeypatch, tmp_path, done) == 0
    assert capsys.readouterr().out.splitlines() == [
        "plan",
        "  grasp 0",
        "    proved: the load is held (leaves 12, margin 0.123456, exact True)",
        "    not shown here: clearances",
        "    not shown here: names",
        "  proved: 2 N slips",
        "  not shown here: the rest",
        "PROVED",
    ]


def test_what_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = {"motion_cap": 2.0}
    parts = (Replay("witness", "the load is held"), Replay("certificate", "2 N slips", "a leaf is open", figures))
    assert run(monkeypatch, tmp_path, Replay("answer", "both", parts=parts)) == 1
    assert capsys.readouterr().out.splitlines() == [
        "refused: both",
        "  proved: the load is held",
        "  refused: 2 N slips (motion cap 2)",
        "REFUSED: certificate: a leaf is open",
    ]


def test_files_that_cannot_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = str(tmp_path / "none.json")
    assert program.main([missing]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"{missing}: no such file; one that --save wrote is needed\n"


@pytest.mark.parametrize("arguments", [[], ["a", "b"]])
def test_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "usage: python -m handfast.proofs FILE\n"


def test_run_as_a_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = str(tmp_path / "none.json")
    monkeypatch.setattr("sys.argv", ["handfast.proofs", missing])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(program.__file__), run_name="__main__")
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"{missing}: no such file; one that --save wrote is needed\n"
