"""The `handfast/loads/1` file: the wrenches that a task asks a grasp to hold.

{"schema": "handfast/loads/1", "loads": {"weight": [0, 0, -3, 0, 0, 0], "cut": [0.4, 0, -4, 0, 0.01, 0]}}
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from handfast.core.errors import InputError
from handfast.core.files import Six, Strict, read_json, validate
from handfast.stability.loads import Loads


class LoadsFile(Strict):
    """The whole file: force [N] and torque [N m] at the object's origin, object frame, by name."""

    format: Literal["handfast/loads/1"] = Field(alias="schema")
    loads: dict[str, Six]


def load_loads(path: str | Path) -> Loads:
    """Read a loads file.

    Raises:
        InputError: one line with file, field and fault.
    """
    try:
        entry = validate(LoadsFile, read_json(path, "handfast/loads/1"))
        return Loads(tuple(entry.loads), np.array(list(entry.loads.values())).reshape(-1, 6))
    except InputError as fault:
        raise fault.at(str(path)) from None
