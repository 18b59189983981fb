"""Faults of files that the closed package finds: the whole line is compared."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager

import pytest

from handfast.proofs.fields import BadFile


def refused(problem: str, field: str = "") -> AbstractContextManager[pytest.ExceptionInfo[BadFile]]:
    """A `BadFile` whose whole line is this field and this problem."""
    line = f"{field}: {problem}" if field else problem
    return pytest.raises(BadFile, match=rf"\A{re.escape(line)}\Z")
