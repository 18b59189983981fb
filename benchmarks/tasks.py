"""The tasks that the synthesis benchmarks run on, and what the synthesis paper published about them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from handfast.core import bundled
from handfast.papers.region_exhibits import PRINTED_TASKS
from handfast.synthesis.task import Task
from handfast.synthesis.task_file import load_task

AUTHORS = Path(__file__).parents[2] / "shared" / "tasks"  # three of the authors' own files, where they are at hand
SAME = {"upholding": "scalpel-upholding", "handling": "scalpel-handling", "service": "teapot-service"}


def tasks() -> dict[str, Task]:
    """The bundled tasks of Table 2, then the authors' own files, by name."""
    known = bundled.names("tasks")
    found = {name: load_task(name) for name in PRINTED_TASKS if name in known}
    files = sorted(AUTHORS.glob("*.json")) if AUTHORS.is_dir() else []
    return found | {f"{f.stem} (authors' file)": load_task(f) for f in files}


def origin(name: str) -> str:
    """Which row of Table 2 a task is."""
    stem = name.split(" ")[0]
    return SAME.get(stem, stem)


def published(name: str) -> int | None:
    """[s] for one configuration in Table 2, on 64 cores, sigma = 0.1."""
    printed = PRINTED_TASKS.get(origin(name))
    return printed.seconds if printed else None


class Others:
    """How busy other processes keep the machine from now on: then times are too long."""

    def __init__(self) -> None:
        self._start = self._now()

    def busy(self) -> bool:
        """Did they take more than a tenth of a core? Also if that cannot be told."""
        wall, total, own = (b - a for a, b in zip(self._start, self._now(), strict=True))
        return not total - own < 0.1 * max(wall, 0.1)

    @staticmethod
    def _now() -> tuple[float, float, float]:
        """[s] of wall time, of all processors at work, and of this process."""
        try:
            user, nice, system = map(int, Path("/proc/stat").read_text("utf-8").split("\n")[0].split()[1:4])
            total = (user + nice + system) / os.sysconf("SC_CLK_TCK")
        except (OSError, ValueError):
            total = float("inf")
        return time.monotonic(), total, time.process_time()


def load_text(rows: Iterable[Mapping[str, Any]]) -> str:
    """What the times of these rows are worth."""
    busy = any(row["busy"] for row in rows)
    return "absolute times were taken while other processes ran" if busy else "no other process ran"
