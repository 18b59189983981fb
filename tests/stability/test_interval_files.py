"""Saved answers about smaller magnitudes: proved, and no forgery passes."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.model.grasp_file import load_grasp
from handfast.stability import answer_file, saved_answer
from handfast.stability.queries import MaxAnswer, check
from handfast.stability.witness import VALID


def test_a_saved_answer_is_proved(holed: tuple[Grasp, np.ndarray, MaxAnswer], tmp_path: Path) -> None:
    answer = holed[2]
    answer.save(tmp_path / "holed.json")
    done = answer_file.verify(tmp_path / "holed.json")
    assert done.ok, done.reason
    assert done.interval.arcs == len(answer.interval.arcs)
    assert done.interval.slips == len(answer.interval.slips) == 1
    assert done.interval.residual <= VALID
    assert done.to_json()["interval"]["ok"]


def forged(what: dict[str, Any], name: str) -> dict[str, Any]:
    """A result file in which something is claimed that is not shown."""
    out = copy.deepcopy(what)
    said, arcs = out["answer"], out["arcs"]
    first, last = said["holes"][0]
    if name == "no hole":
        said["holes"] = []
    elif name == "hole one step longer":
        said["holes"] = [[first, last * 1.001]]
    elif name == "hole one step shorter":
        said["holes"] = [[first * 1.001, last]]
    elif name == "holds up to the hole's end":
        said["holds_from_zero_to"] = last
    elif name == "slips earlier":
        said["holds_from_zero_upper"] = said["holds_from_zero_to"]
    elif name == "finer than it is":
        said["resolution"] = 1e-6
    elif name == "no resolution":
        del said["resolution"]
    elif name == "a range is missing":
        del arcs[1]
    elif name == "a range is longer":
        arcs[-1]["last"] *= 1.01
    elif name == "a state is off":
        arcs[0]["controls"][-1]["c"][0] *= 1 + 1e-6
    elif name == "a state across the hole":
        ends = sorted(arcs, key=lambda a: a["first"])
        left = max((a for a in ends if a["last"] <= first), key=lambda a: a["last"])
        right = min((a for a in ends if a["first"] >= last), key=lambda a: a["first"])
        middle = [left["controls"][-1], right["controls"][0]]
        arcs.append({"first": left["last"], "last": right["first"], "controls": middle})
    elif name == "no certificate":
        out["slips"] = []
    elif name == "a wider certificate":
        lo, hi = out["slips"][0]["scalar"]
        out["slips"][0]["scalar"] = [0.9 * lo, hi * 1.1]
    elif name == "a certificate of another question":
        out["slips"][0]["question"]["direction"][0] += 0.1
    elif name == "nothing asked":
        said["holds_from_zero_to"] = None
    return out


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("no hole", "it says"),
        ("hole one step longer", "it says"),
        ("hole one step shorter", "it says"),
        ("holds up to the hole's end", "it says"),
        ("slips earlier", "it says"),
        ("finer than it is", "it says"),
        ("no resolution", "states no resolution"),
        ("a range is missing", "it says"),
        ("a range is longer", "off by"),
        ("a state is off", "off by"),
        ("a state across the hole", "off by"),
        ("no certificate", "it says"),
        ("a wider certificate", "is not resisted with"),
        ("a certificate of another question", "another question"),
        ("nothing asked", "claims nothing of them"),
    ],
)
def test_forgeries_are_refused(holed: tuple[Grasp, np.ndarray, MaxAnswer], name: str, why: str) -> None:
    right = saved_answer.to_dict(holed[2].saved())
    assert answer_file.from_dict(right).verify().ok
    done = answer_file.from_dict(forged(right, name)).verify()
    assert not done.ok
    assert why in done.reason


def test_states_of_the_wrong_size_are_one_clear_line(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    data = saved_answer.to_dict(holed[2].saved())
    data["arcs"][2]["controls"][1]["c"].append(0.0)
    with pytest.raises(InputError, match=r"has 10 numbers, needs 9") as fault:
        answer_file.from_dict(data)
    assert fault.value.field == "arcs[2].controls[1].c"


def test_no_hole_where_the_cap_on_motions_made_one() -> None:
    """fig1 along +z: up to motions of 10^4 it slipped from 1.59 to 2.149; with larger ones it resists all of that."""
    grasp = load_grasp("fig1")
    for magnitude in (1.6, 1.8, 2.1):  # all of them at once: `handfast max fig1 --direction 0 0 1 --interval`
        witness = check(grasp, [0, 0, magnitude, 0, 0, 0]).witness
        assert witness.valid
        assert np.abs(witness.state.r[:3]).max() > 1e3
