"""The program run inside the test's own process, and what every fault of a user has to look like."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from handfast.cli import main


def planar() -> dict[str, Any]:
    """A grasp file: two fingers, four contacts in a plane, mirror images: 2.222 N in +y by hand, see `test_max`."""
    a, b = np.array([-0.819, 0.574]) / np.hypot(0.819, 0.574)
    right = [([0.078, 0, 0], [-1, 0, 0]), ([0.0955, -0.0463, 0], [a, b, 0])]
    mirror = [([-p[0], *p[1:]], [-n[0], *n[1:]]) for p, n in right]
    names = ["right_distal", "right_proximal", "left_distal", "left_proximal"]
    return {
        "schema": "handfast/grasp/1",
        "contacts": [
            {"position": p, "normal": n, "friction": 1.0, "link": link}
            for (p, n), link in zip([*right, *mirror], names, strict=True)
        ],
        "joints": [
            {"name": "right", "axis": [0, 0, 1], "origin": [0.075, -0.093, 0], "moves": [0, 1]},
            {"name": "left", "axis": [0, 0, -1], "origin": [-0.075, -0.093, 0], "moves": [2, 3]},
        ],
        "preload": {"right": 0.1, "left": 0.1},
    }


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit status, standard output, standard error."""
    status = main(list(arguments))
    said = capsys.readouterr()
    return status, said.out, said.err


def ask(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> dict[str, Any]:
    """The JSON object of a command that is expected to end with `status`, and nothing else said."""
    got, out, err = run(capsys, *arguments, "--json")
    assert (got, err) == (status, "")
    answer: dict[str, Any] = json.loads(out)
    return answer


def complains(capsys: pytest.CaptureFixture[str], arguments: list[str], says: list[str]) -> None:
    """The command is refused in one line that says all of this."""
    status, out, err = run(capsys, *arguments)
    assert status == 2, err
    assert out == ""
    assert err.startswith("handfast: ")
    assert err.count("\n") == 1
    for text in says:
        assert text in err
