"""Output that goes nowhere: a full disk, a reader that has left, an encoding of few letters; numbers in tables."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from handfast.cli.console import table
from handfast.cli.tables import show_witness
from handfast.model.grasp import Contact, Grasp
from handfast.stability.problem.model import state_of
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.questions import check
from tests.support.soft_fingers import TORSION, coin

CHECK = [sys.executable, "-m", "handfast.cli", "check", "fig1", "--wrench", "0", "1", "0"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("more", [["--json"], []])
def test_a_full_disk_is_told(more: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*CHECK, *more], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.stderr == "handfast: standard output cannot be written: No space left on device\n"
    assert done.returncode == 2


@pytest.mark.parametrize("more", [["--json"], []])
def test_a_reader_that_has_had_enough(more: list[str]) -> None:
    with subprocess.Popen([*CHECK, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        assert running.stderr.read() == ""
    assert running.returncode == 0


def test_an_output_of_few_letters() -> None:
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(CHECK, capture_output=True, text=True, env=environment)
    assert done.returncode == 2
    assert done.stderr.startswith("handfast: standard output: ascii has no '")
    assert done.stderr.count("\n") == 1


def test_no_output_at_all() -> None:
    script = "import sys; sys.stdout = None; from handfast.cli import main; sys.exit(main(['list']))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("handfast: standard output is closed")


def test_the_smallest_question_is_still_answered() -> None:
    assert check(Grasp([Contact(np.zeros(3), np.array([0, 0, 1.0]), 0.5)]), [0, 0, -1, 0, 0, 0]).verdict == "holds"


def test_no_word_of_a_table_is_broken() -> None:
    """Long cells in the first columns leave room for the others."""
    name, claim = "bottle, hold, gravity, margin, certificate", "nothing above that is resisted " * 4
    grid = table(["", "claims", "replayed", ""], [(name, claim, "136 leaves", "proved")])
    shown = io.StringIO()
    Console(width=60, file=shown).print(grid)
    said = {word for line in shown.getvalue().splitlines() for word in line.split() if word[0] != "─"}
    assert said == {"claims", "replayed", *f"{name} {claim} 136 leaves proved".split()}


@pytest.mark.parametrize(("torsion", "shares"), [(TORSION, ["100 %", "20 %"]), (0.0, ["60 %", "20 %"])])
def test_the_share_of_the_limit_is_that_of_friction_and_torsion_together(torsion: float, shares: list[str]) -> None:
    """3 N of friction and 0.032 N m of torsion, 4 N over the lever of 8 mm, are 5 N: all that mu times 10 N allows."""
    c, twist = np.array([10.0, 3, 0, 10, 0, -1]), np.array([0.032, 0.0]) if torsion else np.zeros(2)
    state = state_of([0, 0, -10, 0, 0, 0], [20], c, [10], [], torsion=twist)
    grasp = coin(torsion, half=1e-2)
    to = Console(file=io.StringIO(), width=160)
    show_witness(to, Witness(grasp, np.zeros(6), state, 0.0, True))
    rows = [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in to.file.getvalue().splitlines()]
    contacts = [row for row in rows if row[1:2] in (["above"], ["below"])]
    heads = next(row for row in rows if "of limit" in row)
    assert [row[heads.index("of limit")] for row in contacts] == shares
    assert [row[heads.index("friction [N]")] for row in contacts] == ["3", "1"]
