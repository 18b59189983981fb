"""The style of all tables on the screen."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.table import Table


def table(*heads: str) -> Table:
    """An empty table in the house style; columns with a unit hold numbers."""
    grid = Table(box=SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for i, head in enumerate(heads):
        number = i > 0 and "[" in head and head not in ("force [N]", "position [mm]")
        grid.add_column(head, justify="right" if number else "left", overflow="fold", no_wrap=i < 2)
    return grid
