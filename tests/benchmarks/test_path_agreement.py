"""What the study of load paths counts, on rows made by hand and on those that are stored."""

from __future__ import annotations

import json
from typing import Any

from benchmarks import load_path, simulation_agreement


def row(said: str, ending: str, paper: str = "holds", **more: Any) -> dict[str, Any]:
    own: dict[str, Any] = {
        "share": 0.5,
        "by_steps": {"1": 1.0},
        "other_choice": None,
        "proved": True,
        "paper again": paper,
    }
    return own | {"said": said, "ending": ending, "paper": paper, "seconds": 3.0, "seconds together": 1.0} | more


def test_answers_are_counted_beside_both_ways_to_squeeze() -> None:
    rows = [
        row("slips", "holds", slowly="settles"),
        row("holds", "holds", slowly="holds"),
        row("undecided", "slips", "slips"),
    ]
    asked = {
        "a": {"family": "random", "fragile": False, "rows": rows[:2]},
        "b": {"family": "random", "fragile": True, "rows": rows[2:]},
    }
    found = load_path.summary(asked)
    assert found["all"]["loads"] == 3
    assert found["all"]["path"] == {"agreement": 0.3333, "agree": 1, "open": 1, "said slips, holds": 1}
    assert found["all"]["together"]["agree"] == 3
    again = found["all"]["simulated again"]
    assert again["loads"] == 2
    assert again["at once"]["path"]["agree"] == 1
    assert again["slowly"]["path"]["agree"] == 2
    assert again["slowly"]["together"] == {"agreement": 0.5, "agree": 1, "said holds, settles": 1}
    assert found["not fragile"]["questions"] == 1
    assert found["path over check"] == {"sum": 3.0, "median": 3.0}


def test_questions_come_in_one_order_and_all_are_bounded() -> None:
    stored = json.loads(simulation_agreement.RESULTS.read_text())["questions"]
    names = load_path.order(stored)
    assert names == load_path.order(stored)
    assert sorted(names) == sorted(n for n, q in stored.items() if q.get("maximum"))
    assert names != sorted(names)


def test_what_is_stored_is_what_is_summed_up() -> None:
    data = json.loads(load_path.RESULTS.read_text())
    assert data["summary"] == load_path.summary(data["questions"])
    assert data["summary"]["proved"] == sum(len(question["rows"]) for question in data["questions"].values())
