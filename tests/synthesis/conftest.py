"""Answers that several tests look at."""

from __future__ import annotations

import pytest

from handfast.synthesis.query import synthesize
from handfast.synthesis.synthesis_answer import Synthesis
from tests.support.holds import LARGE, grip, pinch


@pytest.fixture(scope="session")
def found() -> Synthesis:
    return synthesize(grip(0.05))


@pytest.fixture(scope="session")
def pinched() -> Synthesis:
    return synthesize(pinch())


@pytest.fixture(scope="session")
def none() -> Synthesis:
    return synthesize(grip(0.12))


@pytest.fixture(scope="session")
def undecided() -> Synthesis:
    return synthesize(pinch(LARGE), timeout=None, nodes=2000, seed=3)
