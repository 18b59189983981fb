"""Named groups of arrays and numbers, in which Python and compiled code hand each other what they work on.

A group is a NamedTuple whose fields are annotated with `int`, `float`, `bool`, or one of the array types below. It
is declared once. Python fills it like any other tuple and passes its `table`, one line a field: an array's address
and its lengths, or a number itself. Compiled functions get the same tuple of arrays (`compiler.py`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Annotated, Any, Generic, TypeVar, get_type_hints

import numpy as np

from handfast.core.arrays import Array, Indices, Mask

LINE = 4  # 64-bit numbers in a line of a table
WHOLE_VECTOR = 4  # numbers that the processor takes at once: arrays in one piece of memory begin at multiples


@dataclass(frozen=True)
class Kind:
    """What a field holds: numbers of one type in an array of so many dimensions, a plain number if there are none."""

    dtype: type
    dimensions: int


Reals = Annotated[Array, Kind(np.float64, 1)]
RealMatrix = Annotated[Array, Kind(np.float64, 2)]
RealMatrices = Annotated[Array, Kind(np.float64, 3)]
Wholes = Annotated[Indices, Kind(np.int64, 1)]
WholeMatrix = Annotated[Indices, Kind(np.int64, 2)]
WholeMatrices = Annotated[Indices, Kind(np.int64, 3)]
Flags = Annotated[Mask, Kind(np.bool_, 1)]
FlagMatrix = Annotated[Mask, Kind(np.bool_, 2)]

_NUMBERS = {int: Kind(np.int64, 0), float: Kind(np.float64, 0), bool: Kind(np.bool_, 0)}
_UNUSED = tuple((0,) * (LINE - 1 - dimensions) for dimensions in range(LINE))

Shape = tuple[int, ...]
Group = TypeVar("Group", bound=tuple[Any, ...])


@cache
def kinds(group: type[tuple[Any, ...]]) -> dict[str, Kind]:
    """What each field of a group holds, in their order.

    Raises:
        TypeError: a field is annotated with anything else.
    """
    out = {}
    for name, hint in get_type_hints(group, include_extras=True).items():
        kind = _NUMBERS.get(hint) or next((x for x in getattr(hint, "__metadata__", ()) if isinstance(x, Kind)), None)
        if kind is None:
            raise TypeError(f"{group.__name__}.{name} is {hint}, which compiled code does not take")
        out[name] = kind
    return out


def table(group: tuple[Any, ...]) -> Indices:
    """(fields, LINE) where the arrays of a group are and how long, and its numbers. The caller keeps the arrays alive.

    Raises:
        TypeError: an array is not of the kind that the group declares, or not contiguous.
    """
    lines = np.zeros((len(group), LINE), np.int64)
    reals = lines.view(np.float64)
    for k, ((name, kind), x) in enumerate(zip(kinds(type(group)).items(), group, strict=True)):
        if kind.dimensions == 0:
            (reals if kind.dtype is np.float64 else lines)[k, 0] = x
            continue
        if x.dtype != kind.dtype or x.ndim != kind.dimensions or not x.flags.c_contiguous:
            wanted = f"contiguous {np.dtype(kind.dtype)} array of {kind.dimensions} dimensions"
            raise TypeError(f"{type(group).__name__}.{name} is {x.dtype} of shape {x.shape}, not a {wanted}")
        lines[k] = (x.ctypes.data, *x.shape, *_UNUSED[kind.dimensions])
    return lines


class Block(Generic[Group]):
    """The arrays of a group in one piece of memory that nobody has written to yet, and their table."""

    def __init__(self, group: type[Group], shapes: Mapping[str, Shape]) -> None:
        """shapes: of all fields, in any order."""
        self._group, self._shapes = group, tuple(shapes[name] for name in kinds(group))
        places, self._begin, total = _places(group, self._shapes)
        self._memory = np.empty(total)
        self.table: Indices = places.copy()
        self.table[:, 0] += self._memory.ctypes.data

    def arrays(self) -> Group:
        """The group, whose arrays keep the memory alive."""
        each = zip(kinds(self._group).values(), self._begin, self._shapes, strict=True)
        return self._group(*(self._array(*place) for place in each))

    def array(self, name: str) -> Any:
        """One array of the group."""
        k = list(kinds(self._group)).index(name)
        return self._array(kinds(self._group)[name], self._begin[k], self._shapes[k])

    def _array(self, kind: Kind, begin: int, shape: Shape) -> Any:
        return self._memory[begin : begin + math.prod(shape)].view(kind.dtype).reshape(shape)


@lru_cache(maxsize=256)
def _places(group: type[tuple[Any, ...]], shapes: tuple[Shape, ...]) -> tuple[Indices, tuple[int, ...], int]:
    """The table relative to the beginning of the memory, where arrays begin, and how many numbers there are."""
    out, begin, at = np.zeros((len(shapes), LINE), np.int64), [], 0
    for line, (name, kind), shape in zip(out, kinds(group).items(), shapes, strict=True):
        if np.dtype(kind.dtype).itemsize != 8 or kind.dimensions != len(shape) or not shape:
            raise TypeError(f"{group.__name__}.{name} of shape {shape} has no place in a block")
        line[: 1 + len(shape)] = 8 * at, *shape
        begin.append(at)
        at += whole_vectors(math.prod(shape))
    return out, tuple(begin), at


def whole_vectors(n: int) -> int:
    """The least number of at least n that the processor's vectors hold without a rest."""
    return n + -n % WHOLE_VECTOR
