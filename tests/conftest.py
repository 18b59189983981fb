"""What every test session begins with."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from typing import Any

import pytest

for library in ("OPENBLAS", "MKL"):  # before numpy is imported, as the program does
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# or each worker, and each program that a test starts, compiles all the Python that it imports
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

gc.set_threshold(100_000, 20, 20)  # what is imported and collected is kept: to look through it again takes a tenth

# compiled in processes of their own, once, not once by each worker; what is there already is found at once
COMPILE = "from {} import LIBRARY; LIBRARY.machine_code()"
LIBRARIES = (
    "handfast.stability.search.machine",
    "handfast.synthesis.search.library",
    "tests.support.stability_pieces",
    "tests.support.synthesis_pieces",
)


def pytest_configure(config: pytest.Config) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it for what runs in the background
    if hasattr(config, "workerinput"):
        share_cores(config.workerinput)
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS or hasattr(config, "workerinput"):
        return
    for process in [subprocess.Popen([sys.executable, "-c", COMPILE.format(name)]) for name in LIBRARIES]:
        process.wait()


def share_cores(worker: dict[str, Any]) -> None:
    """Each worker has its cores, and so has what it starts: processes beyond them would do work ahead for nothing."""
    number, workers = int(worker["workerid"].removeprefix("gw")), worker["workercount"]
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []
    if number < workers <= len(cores):
        os.sched_setaffinity(0, cores[number::workers])


def pytest_collection_finish() -> None:
    gc.freeze()


@pytest.fixture(autouse=True)
def found_proved_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """That a state exists is proved once, and a certificate is checked once, whoever asks again with the same numbers;
    but where proofs are tested."""
    if "tests/proofs/" not in request.path.as_posix() and "PROVE_ANEW" not in os.environ:
        from tests.support.once import STATES_AND_CERTIFICATES

        for place, name, work in STATES_AND_CERTIFICATES:
            monkeypatch.setattr(place, name, work)


@pytest.fixture
def proved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file and of those forged from it the same proof is replayed once."""
    from tests.support.once import PROOFS

    for place, name, work in PROOFS:
        monkeypatch.setattr(place, name, work)


@pytest.fixture
def asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file and of those forged from it the same question is asked again once."""
    from tests.support.once import ASKED_AGAIN

    for place, name, work in ASKED_AGAIN:
        monkeypatch.setattr(place, name, work)
