"""What counts as agreement of a simulation with a verdict."""

from __future__ import annotations

import pytest

from benchmarks.simulation_agreement import FRAGILE, outcome, summary


@pytest.mark.parametrize(
    ("said", "ending", "counted"),
    [
        ("holds", "holds", "agree"),
        ("slips", "slips", "agree"),
        ("slips", "settles", "agree"),
        ("holds", "slips", "said holds, slips"),
        ("holds", "settles", "said holds, settles"),
        ("slips", "holds", "said slips, holds"),
        ("slips", "undecided", "open"),
        ("holds", "ill-posed", "open"),
        ("undecided", "slips", "open"),
    ],
)
def test_what_is_open_never_agrees(said: str, ending: str, counted: str) -> None:
    assert outcome({"said": said, "ending": ending}) == counted


def test_fragile_questions_are_counted_apart() -> None:
    def asked(motion: float | None) -> dict[str, object]:
        row = {"said": "holds", "ending": "holds", "loading": "together"}
        return {"maximum": 1.0, "motion": motion, "rows": [row]}

    questions = {
        "firm": asked(2.0),
        "fragile": asked(2 * FRAGILE),
        "unknown": asked(None),
        "unbounded": {"maximum": None},
    }
    found = summary(questions)
    assert found["together, all"] == {"agree": 3}
    assert found["together, not fragile"] == {"agree": 1}
    assert found["preload-first, all"] == {}
