"""The program: what it lists, helps with and imports, progress, Ctrl-C."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from dataclasses import fields

import pytest

from benchmarks.grasps import random_case
from handfast.cli import console
from handfast.cli.app import COMMAND_CLASSES, command, option_name
from handfast.readers.grasp_file import save_grasp
from tests.support.interruptions import interrupted_program
from tests.support.program import ask, run


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    listed = ask(capsys, "list")
    assert {"grasps", "hands", "objects", "configurations"} <= set(listed)
    assert "barrett-bh8-280" in listed["hands"]
    assert all(text for kind in ("grasps", "hands", "objects") for text in listed[kind].values())


@pytest.mark.parametrize("name", COMMAND_CLASSES)
def test_help_shows_every_option(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, name, "--help")
    assert (status, err) == (0, "")
    for field in fields(command(name)):
        if "Positional" not in str(field.type) and field.type != "GraspName":
            assert option_name(field) in out


def test_quick_commands_import_nothing_heavy() -> None:
    code = (
        "import sys; from handfast.cli import main; main(sys.argv[1:]);"
        "heavy = {'mujoco', 'trimesh', 'matplotlib', 'numba', 'pyscipopt', 'scipy', 'gurobipy'} & set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    for arguments in (["--help"], ["list"], ["check", "--help"]):
        done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_progress_is_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "PROGRESS_DELAY", 0.0)
    for stream in (Terminal(), io.StringIO()):
        monkeypatch.setattr(sys, "stderr", stream)
        with console.watch("map") as watch:
            watch.item(1, 4)
        assert ("1 of 4" in stream.getvalue()) == isinstance(stream, Terminal)


def test_ctrl_c_leaves_the_bounds_of_a_maximum(grasp: str) -> None:
    hard = random_case(15, 6)  # fifteen contacts, with uncertain normals: thousands of nodes
    save_grasp(hard.grasp, "hard.json")
    direction = [repr(v) for v in hard.direction.tolist()]
    asked = ["max", "hard.json", "--eta", "5.73", "--gap", "1e-14", "--direction", *direction, "--json"]
    done = interrupted_program("handfast.stability.search.search.Search._run", 5, *asked)
    assert (done.returncode, done.stderr) == (3, "")
    assert json.loads(done.stdout)["stop"] == "interrupted"


@pytest.mark.slow
def test_ctrl_c_leaves_the_directions_of_a_map_that_were_asked(grasp: str) -> None:
    done = interrupted_program("handfast.cli.console.Watch.item", 40, "map", "grasp.json", "--steps", "6000", "--json")
    assert (done.returncode, done.stderr) == (3, "")
    answer = json.loads(done.stdout)
    assert answer["stop"] == "interrupted"
    without, with_preload = (answer[key]["lower"] for key in ("without_preload", "with_preload"))
    assert len(without) == len(with_preload) == 6000
    asked = without.index(None)  # directions are answered in blocks
    assert 40 <= asked < 1000
    assert set(without[asked:]) == set(with_preload) == {None}


@pytest.mark.parametrize("name", COMMAND_CLASSES)
def test_help_shows_no_default_that_is_none(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):  # the second time finds what the first has changed
        status, out, _ = run(capsys, name, "--help")
        helped = " ".join(re.sub("[│╭╰─╮╯]", " ", out).split())
        assert status == 0
        assert not re.search(r"\(default: ?(None|True|False)?\)", helped)
    assert "(default: " in helped or name in ("export", "list", "show", "verify")
