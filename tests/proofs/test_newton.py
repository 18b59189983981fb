"""Ranks in rational numbers, of rows that may depend on each other by structure."""

from __future__ import annotations

import pytest
from flint import fmpq

from handfast.proofs.newton import PRIME, spans


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
