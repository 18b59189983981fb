"""Many cases of one test: a few are run with every test run, the others by `.ci/run`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def slow_after(few: int, cases: Iterable[Any]) -> list[Any]:
    """The first few cases as they are, the others with the marker `slow`; a case of several values is a tuple."""
    return [
        case if k < few else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for k, case in enumerate(cases)
    ]
