"""What every test session begins with."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "handfast"
ENGINE = PACKAGE / "synthesis" / "search" / "kernel"


KERNELS = (  # each in a process of its own: every kernel is compiled once, not once by each worker
    "from handfast import load_task; from handfast.synthesis.problem import Problem;"
    "from handfast.synthesis.search.starts import Starts; from handfast.synthesis.search.diverse import Walks;"
    "Walks(Starts(Problem.of(load_task('scalpel-upholding')), 0))",
    "from handfast import load_task;"
    "from handfast.synthesis.problem import Problem; from handfast.synthesis.search.prover import Prover;"
    "Prover(Problem.of(load_task('scalpel-handling'))).run(seconds=0.1)",
)


STABILITY = "from handfast.stability.search.machine import LIBRARY; LIBRARY.machine_code()"


def pytest_configure(config: pytest.Config) -> None:
    # numba renews a function's machine code when its own file changes, not when a file that it calls does
    newest = max(f.stat().st_mtime for f in ENGINE.glob("*.py"))
    for code in ENGINE.glob("__pycache__/*.nb[ic]"):
        with suppress(FileNotFoundError):  # another session may be doing the same
            if code.stat().st_mtime < newest:
                code.unlink()
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS or hasattr(config, "workerinput"):
        return
    missing = [] if list(ENGINE.glob("__pycache__/local_search.find*.nbi")) else list(KERNELS)
    for process in [subprocess.Popen([sys.executable, "-c", code]) for code in (STABILITY, *missing)]:
        process.wait()
