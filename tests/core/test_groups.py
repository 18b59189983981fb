"""Named groups: what a table says, and what no table is made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from handfast.core.groups import Block, Flags, Layout, RealMatrix, Reals, Wholes, table, whole_vectors


class Pair(NamedTuple):
    matrix: RealMatrix
    flags: Flags
    many: int
    share: float
    sure: bool


class Room(NamedTuple):
    first: Reals
    second: RealMatrix
    third: Wholes


class Wrong(NamedTuple):
    name: str


def test_a_table_says_where_and_how_long_and_has_numbers_themselves() -> None:
    pair = Pair(np.arange(6.0).reshape(2, 3), np.zeros(4, np.bool_), -7, 0.1, True)
    lines = table(pair)
    assert lines[0].tolist() == [pair.matrix.ctypes.data, 2, 3, 0, 0, 0]
    assert lines[1].tolist() == [pair.flags.ctypes.data, 4, 0, 0, 0, 0]
    assert lines[2, 0] == -7
    assert lines[3:4, 0].view(np.float64)[0] == 0.1
    assert lines[4, 0] == 1


@pytest.mark.parametrize(
    "x", [np.zeros(3, np.float32), np.zeros((3, 3)), np.zeros((3, 2))[:, 0], np.zeros(3, np.int64)]
)
def test_a_table_takes_only_what_the_group_declares(x: np.ndarray) -> None:
    with pytest.raises(TypeError, match=r"Room\.first is .*, not a contiguous float64 array of 1 dimensions"):
        table(Room(x, np.zeros((1, 1)), np.zeros(1, np.int64)))


def test_a_group_declares_numbers_and_arrays_only() -> None:
    with pytest.raises(TypeError, match=r"Wrong\.name is .*str.*, which compiled code does not take"):
        table(Wrong("x"))


def test_the_arrays_of_a_block_are_those_of_its_table_and_lie_apart() -> None:
    block = Block(Layout(Room, {"second": (2, 3), "first": (5,), "third": (3,)}))
    made = block.arrays()
    assert table(made).tolist() == block.table.tolist()
    begin = block.table[:, 0]
    assert begin[0] == block.memory.ctypes.data
    assert np.diff(begin).tolist() == [8 * whole_vectors(5), 8 * whole_vectors(6)]
    assert begin[2] + 8 * 3 <= block.memory.ctypes.data + block.memory.nbytes
    made.third[:] = [1, 2, 3]
    assert block.array("third").tolist() == [1, 2, 3]


@pytest.mark.parametrize("shape", [(2, 2), ()])
def test_a_block_takes_only_shapes_that_fit(shape: tuple[int, ...]) -> None:
    with pytest.raises(TypeError, match=r"Room\.first of shape .* has no place in a block"):
        Layout(Room, {"first": shape, "second": (1, 1), "third": (1,)})
