"""What Python and the compiled kernel have in common: the arrays of a search, and the numbers that stand in them.

Arrays go to the kernel as tables of addresses and lengths, so that it is called like any C function: nothing of
numba is needed once its machine code exists (`machine`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask

# what became of a node
WAITING, SPLIT, EMPTY, UNRESOLVED = 0, 1, 2, 3
# why a run of the kernel ended
EXHAUSTED, ENOUGH, ROOM, FOUND, ENDLESS = 0, 1, 2, 3, 4
# what is sought
ANY, SCALAR, LARGEST_EFFORT, SUM_OF_EFFORTS = 0, 1, 2, 3
# places in `stats`
NODES, EXCHANGES, DROPS, RESTARTS, NEWTONS, HITS, USED, HEAP, FAILURES = STATS = 0, 1, 2, 3, 4, 5, 6, 7, 8

KEPT = 64  # inverses of nodes that wait, those made last; in one more place, that of the node being split
VECTOR = 4  # numbers that the processor takes at once

KINDS = {"f": np.dtype(np.float64), "i": np.dtype(np.int64), "b": np.dtype(np.bool_)}
LINE = 4  # numbers for an array in a table: its address and up to three lengths

UNUSED = tuple((0,) * (LINE - 1 - ndim) for ndim in range(LINE))

# kinds and dimensions of the arrays in the tables, in the order in which the kernel takes them; see `kernel.tree`
QUESTION = "f2 f2 f2 f2 f1 f1 f1 f1 f1 b1"  # C, D, CT, DT, off, mu, lo, cost, box, driven
LANE = "f1 f1 f1 i1 f2 i1"  # hi, best, best_z, stats, guess, heap
POOL = "i2 i2 f2 f1 f1 i1 i1 i1"  # states, ids, data, key, bound, parent, part, status
POINTS = "f1 f1"  # where Newton's method begins, and where it ends
LEAVES = "i1 b1"  # their numbers, and whether their rays hold
# room: owners and working sets that are kept,
_KEPT = "i2 i2 f2 f3 f3"
# state, child, skip, trig, amounts, normal of the node at hand,
_NODE = "i1 i2 i1 f2 f1 f1"
# its program: ids, order, age, rhs, W, T, y, z, c, d, enter_row, column, pivot, delta, gradient,
_PROGRAM = "i1 i1 i1 f1 f2 f2 f1 f1 f1 f1 f1 f1 f1 f1 f1"
# and Newton's method from its point: modes, motors, side, z, c, d, G, J, g, q, size, start, step, trial
_EXACT = "i1 i1 i1 f1 f1 f1 f2 f2 f1 f1 f1 f1 f1 f1"
WORK = f"{_KEPT} {_NODE} {_PROGRAM} {_EXACT}"
EXACT = len(WORK.split()) - len(_EXACT.split())  # where Newton's begin
ROW = EXACT - 5  # where enter_row, column, pivot, delta, gradient begin

Shape = tuple[int, ...]


def vectors(n: int) -> int:
    """So many numbers that whole vectors of the processor hold n of them."""
    return n + -n % VECTOR


def table(layout: str, arrays: Sequence[Array | Indices | Mask]) -> Indices:
    """(k, LINE) where these arrays are and how long. The caller keeps them alive.

    Raises:
        TypeError: an array is not of the kind that the layout names, or not contiguous.
    """
    lines = []
    for x, kind in zip(arrays, layout.split(), strict=True):
        if x.dtype != KINDS[kind[0]] or x.ndim != int(kind[1]) or not x.flags.c_contiguous:
            raise TypeError(f"{x.dtype} array of shape {x.shape} where the kernel takes {kind}")
        lines.append((x.ctypes.data, *x.shape, *UNUSED[x.ndim]))
    return np.array(lines, np.int64)


class Block:
    """Arrays in one piece of memory, and the table of them."""

    def __init__(self, layout: str, shapes: tuple[Shape, ...]) -> None:
        self._layout, self._shapes = layout, shapes
        places, self._begin, total = _places(layout, shapes)
        self._memory = np.empty(total)
        self.table = places.copy()
        self.table[:, 0] += self._memory.ctypes.data

    def arrays(self) -> list[Any]:
        """The arrays, which keep the memory alive."""
        return [self._array(*place) for place in zip(self._layout.split(), self._begin, self._shapes, strict=True)]

    def first(self) -> Any:
        """The first of them."""
        return self._array(self._layout[:2], self._begin[0], self._shapes[0])

    def _array(self, kind: str, begin: int, shape: Shape) -> Any:
        return self._memory[begin : begin + math.prod(shape)].view(KINDS[kind[0]]).reshape(shape)


@lru_cache(maxsize=256)
def _places(layout: str, shapes: tuple[Shape, ...]) -> tuple[Indices, tuple[int, ...], int]:
    """The table relative to the beginning of the memory, where arrays begin, and how many numbers there are."""
    out, begin, at = np.zeros((len(shapes), LINE), np.int64), [], 0
    for line, kind, shape in zip(out, layout.split(), shapes, strict=True):
        assert int(kind[1]) == len(shape)
        assert kind[0] != "b"
        line[0] = 8 * at
        line[1 : 1 + len(shape)] = shape
        begin.append(at)
        at += vectors(math.prod(shape))
    return out, tuple(begin), at


def room(sizes: Shape) -> Block:
    """Arrays that the kernel alone writes and reads.

    sizes: m, a, F, unknowns, forces and motions with what fills them up, plain base values.
    """
    out = Block(WORK, _shapes(*sizes))
    out.first()[:] = -1  # no inverse is kept
    return out


@lru_cache(maxsize=64)
def _shapes(m: int, a: int, F: int, n: int, forces: int, motions: int, plain: int) -> tuple[Shape, ...]:
    """Of `WORK`."""
    N, most = vectors(n), 4 * m + 2 * a + plain
    kept = (2, KEPT + 1), (KEPT + 1, n), (KEPT + 1, n), (KEPT + 1, n, n), (KEPT + 1, n, N)
    node = (3 * m + a,), (4, 3), (m + a + plain,), (m, 4), (2,), (m,)
    program: tuple[Shape, ...] = (
        (n + 1,), (n,), (1,), (n,), (n, n), (n, N), (n + 1,), (n,), (forces,), (motions,),
        (n,), (n,), (2 * N,), (N,), (6,),
    )  # fmt: skip
    exact = (
        (m,), (a,), (F - 3 * m - 2 * a,), (n,), (forces,), (motions,), (4, 6), (most, n), (most,), (most,), (most,),
        (n,), (n,), (n,),
    )  # fmt: skip
    return (*kept, *node, *program, *exact)
