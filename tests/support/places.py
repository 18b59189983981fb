"""Where things are that tests read."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
SHARED = ROOT.parent / "shared"  # data beside the repository; tests that use it skip where it is absent
FEASIBLE = TESTS / "data" / "feasible.json"
