"""Ranks of rows that may depend on each other by structure, and parts that are between two modes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.proofs.newton import PRIME, Modes, between, greedy, spans
from handfast.proofs.states import ContactMode, Part


@pytest.mark.parametrize(
    "basis, others, so",
    [
        ([[1, 0, 1], [0, 1, 1]], [[1, 1, 2]], True),
        ([[1, 0, 1], [0, 1, 1]], [[1, 1, 2 + fmpq(1, 2**70)]], False),
        ([[1, 0], [2, 0]], [[0, 1]], False),  # as many as the rank of all, but dependent themselves
        ([[1, 0], [2, 0]], [[3, 0]], True),
        ([[1, 0]], [[0, PRIME]], False),  # modulo the prime it is 0
        ([], [[0, 0]], True),
        ([], [[0, 1]], False),
    ],
)
def test_rows_span_others_exactly(basis, others, so: bool) -> None:
    rational = lambda rows: [[fmpq(x) for x in row] for row in rows]  # noqa: E731
    assert spans(rational(basis), rational(others)) is so


A = np.ones(3) / 3**0.5
B = A + np.array([2e-9, -2e-9, 0])


@pytest.mark.parametrize(
    ("rows", "chosen"),
    [
        (np.zeros((0, 2)), []),
        ([[0, 0], [1, 0], [1, 0.9e-9], [1, 1.1e-9]], [1, 3]),
        ([A, B, A + 2.0**28 * (B - A), [0, 0, 1]], [0, 1, 3]),  # B off A is known to 1e-7 only
    ],
)
def test_rows_are_chosen_that_are_not_near_the_span_of_those_before(rows: Any, chosen: list[int]) -> None:
    assert greedy(np.array(rows, dtype=float)).tolist() == chosen


C, P = ContactMode, Part


@pytest.mark.parametrize(
    ("contact", "full", "actuator", "joint", "part"),
    [
        ([C.STICKS, C.SLIDES], [False, False], [P.LOCKED, P.MOVES], [P.FREE, P.BACK], ""),
        ([C.STICKS, C.TOUCHES], [False, False], [P.LOW], [P.LOW], "contact 1"),
        ([C.LEANS, C.TOUCHES], [False, False], [], [], "contact 0"),
        ([C.STICKS, C.STICKS], [False, True], [P.LOW], [], "contact 1"),
        ([C.STICKS], [False], [P.RESTS, P.LOW], [P.HIGH], "actuator 1"),
        ([C.STICKS], [False], [P.RESTS, P.HIGH], [], "actuator 1"),
        ([], [], [P.LOWEST], [P.LOW], "actuator 0"),
        ([], [], [P.OPENS], [P.LOWEST, P.LOW], "joint 1"),
        ([], [], [], [P.HIGH], "joint 0"),
    ],
)
def test_which_part_is_between_two_modes(contact: Any, full: Any, actuator: Any, joint: Any, part: str) -> None:
    arrays = (np.array(x, dtype=kind) for x, kind in ((contact, int), (full, bool), (actuator, int), (joint, int)))
    modes: Modes = SimpleNamespace(**dict(zip(("contact", "full", "actuator", "joint"), arrays, strict=True)))  # type: ignore[assignment]
    assert between(modes) == part
