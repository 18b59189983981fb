"""The tables of the agreement study, on planted answers and on the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.agreement_tables import by_family, counted, disagreements
from benchmarks.simulation_agreement import RESULTS, STATEMENT, summary

PAGE = Path(__file__).parents[2] / "docs" / "simulation.md"


def question(ending: str, fragile: list[str]) -> dict[str, Any]:
    rows = [
        {"said": "holds", "ending": e, "loading": loading, "share": 0.5, "rate": 1e-9}
        for loading, e in (("preload-first", "holds"), ("together", ending))
    ]
    return {"family": "random", "maximum": 1.0, "contacts": 4, "fragile": fragile, "motion": 2.0, "rows": rows}


def test_what_does_not_agree_is_counted_and_listed() -> None:
    asked = {"firm": question("holds", []), "loose": question("slips", ["tilt"])}
    asked["free"] = {"family": "bundled", "maximum": None}
    table = counted(summary(asked))

    assert "| all | together | 2 | 1 (50.0 %) | 1 | 0 | 0 | 0 |" in table
    assert f"| all | **{STATEMENT}** | 2 | 2 (100.0 %) | 0 | 0 | 0 | 0 |" in table
    assert by_family(asked).splitlines()[2:] == [
        "| bundled | 1 | 0 |  | 0 |  | 0 | 0 |  |",
        "| random | 2 | 2 | 4 to 4 | 2 | 100.0 % | 1 | 1 | 100.0 % |",
        "| all | 3 | 2 | 4 to 4 | 2 | 100.0 % | 1 | 1 | 100.0 % |",
    ]
    (line,) = disagreements(asked)
    assert line.startswith("loose (4; tilt) at 0.5: together: said holds, slips")


def test_the_page_has_the_tables_of_the_results() -> None:
    data, page = json.loads(RESULTS.read_text("utf-8")), PAGE.read_text("utf-8")

    assert counted(data["summary"]) in page
    assert by_family(data["questions"]) in page
