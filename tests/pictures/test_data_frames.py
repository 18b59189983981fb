"""Answers as tables of pandas, where it is installed; one line where it is not."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Loads, check, force_map, hold, max_many, maximum, sweep, torques
from handfast.pictures.data_frames import to_frame
from tests.support.problems import pinch

UP = [0, 1.0, 0, 0, 0, 0]


def test_without_pandas_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"^pandas: is not installed; pip install 'handfast\[pandas\]'$"):
        to_frame(check(pinch(), UP))


@pytest.fixture
def pandas() -> Any:
    return pytest.importorskip("pandas")


def test_an_answer_is_a_row(pandas: Any) -> None:
    largest = maximum(pinch(), UP)
    row = to_frame(largest).iloc[0]
    assert (row.grasp, row.query, row.verdict, row.upper) == ("pinch", "max", "holds", largest.upper)
    assert row.fy == pytest.approx(largest.lower)
    best = torques(pinch(), UP)
    commands = to_frame(best)[["command_left", "command_right"]].iloc[0]
    assert commands.tolist() == [(best.preload or {})[name] for name in ("left", "right")]
    slips = to_frame(check(pinch(), [0, 3.0, 0])).iloc[0]
    assert (slips.verdict, slips.fy) == ("slips", 3.0)
    assert np.isnan(slips.residual)


def test_several_answers_are_rows_with_numbers_or_names(pandas: Any) -> None:
    answers = [check(pinch(), [0, force, 0]) for force in (0.5, 1.5)]
    assert to_frame(answers)[["answer", "verdict"]].values.tolist() == [[0, "holds"], [1, "slips"]]
    named = to_frame({"light": answers[0], "heavy": answers[1]})
    assert named.set_index("answer").verdict["heavy"] == "slips"
    assert to_frame([None, answers[0]]).answer.tolist() == [1]
    assert len(to_frame(max_many(pinch(), [[0, 1, 0], [0, -1, 0]]))) == 2


def test_maps_sweeps_and_holds_are_tables(pandas: Any) -> None:
    drawn = force_map(pinch(), "xy", steps=4, jobs=1)
    frame = to_frame(drawn)
    assert len(frame) == 8
    assert frame[frame.preload & (frame.dy == 1)].lower.item() == pytest.approx(drawn.curves[1].lower[1])
    swept = sweep(pinch(), "left", [0.05, 0.1], [[0, 1, 0]], jobs=1)
    assert to_frame(swept).command.tolist() == [0.05, 0.1]
    assert to_frame(swept).fy.tolist() == [1.0, 1.0]
    held = hold(pinch(), Loads(("up", "down"), np.array([UP, [-x for x in UP]])))
    assert to_frame(held).set_index("load").verdict.to_dict() == {"up": "holds", "down": "holds"}


@pytest.mark.parametrize("what", ["text", 3, [3], None])
def test_what_is_no_answer_is_refused(pandas: Any, what: Any) -> None:
    with pytest.raises(InputError, match="an answer is needed, or several"):
        to_frame(what)
