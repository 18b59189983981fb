"""Write in docs/api.md what each of its names is, so that the page can be read where nobody builds it.

A table above each group of names: what their docstrings begin with.

    python tools/api_page.py
"""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
HEAD = "| name | what it is |\n|---|---|\n"
GROUP = re.compile(
    r"(?:^\| name \| what it is \|\n\|---\|---\|\n(?:^\|.*\n)*\n)?((?:^::: .*\n(?:^    .*\n)*)+)", re.MULTILINE
)


def listed(text: str) -> str:
    """The page with a table above each group of names; one that is there is written anew."""
    return GROUP.sub(lambda group: f"{HEAD}{''.join(map(row, names(group[1])))}\n{group[1]}", text)


def names(group: str) -> list[str]:
    """The full names of a group; those of its `members` where it has some."""
    found = []
    for name, options in re.findall(r"^::: (\S+)\n((?:    .*\n)*)", group, re.MULTILINE):
        members = re.search(r"members: \[(.*)\]", options)
        found += [f"{name}.{m.strip()}" for m in members[1].split(",")] if members else [name]
    return found


def row(name: str) -> str:
    """A line of the table."""
    said = (inspect.getdoc(thing(name)) or "").split("\n\n")[0]
    return f"| `{name.rpartition('.')[2]}` | {' '.join(said.split()).replace('|', '&#124;')} |\n"


def thing(name: str) -> Any:
    """What a full name is of."""
    module, _, last = name.rpartition(".")
    try:
        return importlib.import_module(name)
    except ImportError:
        return getattr(importlib.import_module(module), last)


if __name__ == "__main__":
    PAGE.write_text(listed(PAGE.read_text("utf-8")), "utf-8")
