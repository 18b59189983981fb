"""A pytest plugin for `mutation.py`: quick tests come first, as most mutants die of one of these.

How long a test takes is what mutmut wrote down when it looked which functions each of them reaches.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """By duration, in the folder that mutmut runs tests in."""
    notes = Path("mutmut-stats.json")
    known = json.loads(notes.read_text("utf-8"))["duration_by_test"] if notes.exists() else {}
    items.sort(key=lambda item: known.get(item.nodeid, 0.0))
