"""Each of the eleven hands of the synthesis paper's Table 1 solves one precision grasp, with proof."""

from __future__ import annotations

import pytest

from handfast.core.answer import Reach
from handfast.model.hand.structures import TABLE_1, table_1_hand
from handfast.synthesis.query import synthesize
from handfast.synthesis.task import pinch


@pytest.mark.parametrize("name", list(TABLE_1))
def test_every_hand_takes_a_small_cube_between_index_and_thumb(name: str) -> None:
    answer = synthesize(pinch(table_1_hand(name)), timeout=30)
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok
