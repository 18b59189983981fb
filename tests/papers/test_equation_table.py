"""The table of equations in docs/architecture.md: a row for each equation, table and figure, whose places exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from handfast.papers.exhibits import EXHIBITS
from handfast.papers.methods import METHODS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
SECTION = PAGE[PAGE.index("## Where an equation is") : PAGE.index("## How to add a query")]
LINES = [line for line in SECTION.splitlines() if line.startswith("| ")][1:]
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in LINES]


def numbers(paper: str) -> set[int]:
    """Equations of a paper that rows name, ranges written out."""
    found: set[int] = set()
    for first, *_ in (row for row in ROWS if row[0].startswith(paper)):
        for one, last in re.findall(r"\((\d+)\)(?: to \((\d+)\))?", first):
            found |= set(range(int(one), int(last or one) + 1))
    return found


def test_each_numbered_equation_has_a_row() -> None:
    assert numbers("S") == set(range(1, 28))
    assert numbers("C") == set(range(1, 34))


def test_each_table_figure_and_method_is_named() -> None:
    commands = re.findall(r"`(?:handfast paper )?([a-z0-9-]+)`", SECTION)
    made = {e.name for e in EXHIBITS.values() if e.maker}
    assert made <= set(commands)
    assert set(METHODS) <= set(commands)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_the_place_that_a_row_names_is_there(row: list[str]) -> None:
    """Files exist; functions and classes named after a file are defined in it."""
    for cell in row[1:]:
        for part in re.split(r";", cell):
            files = re.findall(r"`([\w/]+\.py)`", part)
            sources = "\n".join(_source(file).read_text("utf-8") for file in files)
            for name in re.findall(r"`([A-Za-z_][\w.]*)`", part.split(".py`")[-1]) if files else ():
                last = name.split(".")[-1]
                assert re.search(rf"\b(def|class) {last}\b|\b{last}:", sources), name


def _source(file: str) -> Path:
    found = ROOT / "src" / "handfast" / file
    return found if found.exists() else ROOT / file
