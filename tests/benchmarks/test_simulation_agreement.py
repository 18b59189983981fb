"""What counts as agreement of a simulation with a verdict."""

from __future__ import annotations

import pytest

from benchmarks.simulation_agreement import LITTLE, STATEMENT, outcome, statement, summary


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


def rows(said: str, **endings: str) -> list[dict[str, object]]:
    names = {"first": "preload-first", "together": "together", "at_it": "at it"}
    return [{"said": said, "ending": e, "loading": names[n], "share": 0.9} for n, e in endings.items()]


def test_that_an_equilibrium_exists_is_shown_by_any_rest() -> None:
    assert statement(rows("holds", first="slips", together="settles")) == "agree"
    assert statement(rows("holds", first="slips", together="slips", at_it="holds")) == "agree"
    assert statement(rows("holds", first="slips", together="slips", at_it="slips")) == "said holds, slips"
    assert statement(rows("holds", first="slips", together="undecided", at_it="slips")) == "open"


def test_that_none_exists_is_contradicted_by_a_rest_without_history_alone() -> None:
    assert statement(rows("slips", first="holds", together="slips")) == "agree"
    assert statement(rows("slips", first="slips", together="holds")) == "said slips, holds"
    assert statement(rows("undecided", first="slips", together="holds")) == "open"


def test_fragile_questions_are_counted_apart() -> None:
    def asked(fragile: list[str], motion: float | None) -> dict[str, object]:
        return {"maximum": 1.0, "fragile": fragile, "motion": motion, "rows": rows("holds", together="holds")}

    questions = {"firm": asked([], 2.0), "fragile": asked(["tilt"], LITTLE), "hole": asked(["hole"], None)}
    questions["unbounded"] = {"maximum": None}
    found = summary(questions)
    assert found["all, together"] == {"questions": 3, "simulated": 3, "agreement": 1.0, "agree": 3}
    assert found["not fragile, together"]["agree"] == 1
    assert found["moves little, together"]["agree"] == 2
    assert found[f"not fragile, {STATEMENT}"]["agree"] == 1
    assert found["all, preload-first"] == {"questions": 3}
