"""Tables of loads on paths beside the engine: shares by hand, and hands that few have counted apart."""

from __future__ import annotations

from typing import Any

from benchmarks.load_path import summary, tables


def row(said: str, ending: str, **more: Any) -> dict[str, Any]:
    """A load of which `together` says that it holds; the path takes three times as long as the check."""
    about = {
        "share": 1.1,
        "ending": ending,
        "paper": "holds",
        "paper again": "holds",
        "said": said,
        "by_steps": {"1": 1},
    }
    return about | {"other_choice": None, "proved": True, "seconds": 0.3, "seconds together": 0.1} | more


def question(family: str, *rows: dict[str, Any]) -> dict[str, Any]:
    return {"family": family, "fragile": False, "rows": list(rows)}


ASKED = {
    "one": question(
        "random", row("holds", "holds", slowly="holds"), row("slips", "holds", slowly="slips"), row("holds", "slips")
    ),
    "two": question("bundled", row("holds", "settles")),
    "three": question("closed shadow", row("slips", "slips")),
}


def test_shares_are_of_all_but_hands_that_few_have() -> None:
    found = summary(ASKED)
    assert (found["all"]["questions"], found["all"]["loads"]) == (2, 4)
    assert found["all"]["together"]["agreement"] == 0.5
    counts = {"agree": 1, "said holds, settles": 1, "said holds, slips": 1, "said slips, holds": 1}
    assert found["all"]["path"] == {"agreement": 0.25} | counts
    assert found["closed shadow"]["path"]["agreement"] == 1.0
    assert found["path over check"] == {"sum": 3.0, "median": 3.0}
    assert found["proved"] == 5


def test_tables_have_a_row_for_each_part() -> None:
    first, again = tables(summary(ASKED)).split("\n\n")
    assert "| all | 2 | 4 | 50.0 % | 25.0 % | 1 | 2 | 0 |" in first
    assert "| closed shadow | 1 | 1 | 0.0 % | 100.0 % | 0 | 0 | 0 |" in first
    assert "fragile | 0" not in first
    assert "| all | 2 | act at once | 100.0 % | 50.0 % |" in again
    assert "| all | 2 | grow within 4 s | 50.0 % | 100.0 % |" in again
