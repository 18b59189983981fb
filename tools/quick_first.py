"""A pytest plugin for `mutation.py`: quick tests come first, as most mutants die of one of these, and slow ones not at
all if it says so.

How long a test takes is what mutmut wrote down when it looked which functions each of them reaches.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

LONGEST = "MUTATION_LONGEST_TEST"  # [s] of the environment


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """By duration, in the folder that mutmut runs tests in; what is not known yet is run, so that it is."""
    notes = Path("mutmut-stats.json")
    known = json.loads(notes.read_text("utf-8"))["duration_by_test"] if notes.exists() else {}
    items.sort(key=lambda item: known.get(item.nodeid, 0.0))
    longest = float(os.environ.get(LONGEST, "inf"))
    slow = [item for item in items if known.get(item.nodeid, 0.0) > longest]
    if slow:
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if known.get(item.nodeid, 0.0) <= longest]
