"""Proofs of all motions and of motions inside a cap, by the name of their case."""

from __future__ import annotations

import pytest

from tests.support.certificates import (
    capped_proof,
    proof,
)


@pytest.fixture(params=[proof, capped_proof], ids=["all motions", "capped"])
def proof_of(request):
    """The proofs of the cases, in both versions."""
    return request.param
