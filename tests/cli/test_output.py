"""Output that goes nowhere: a full disk, a reader that has left, an encoding of few letters."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.queries import check

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
