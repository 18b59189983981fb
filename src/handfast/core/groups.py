"""Named groups of arrays and numbers, in which Python and compiled code hand each other what they work on.

A group is a NamedTuple whose fields are annotated with `int`, `float`, `bool`, or one of the array types below. It
is declared once. Python fills it like any other tuple and passes its `table`, one line a field: an array's address
and its lengths, or a number itself. Compiled functions get the same tuple of arrays (`compiler.py`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Generic, TypeVar, get_type_hints

import numpy as np

from handfast.core.arrays import Array, Indices, Mask

LINE_NUMBERS = 6  # 64-bit numbers in a line of a table: an address and up to five lengths
WHOLE_VECTOR = 4  # numbers that the processor takes at once: arrays in one piece of memory begin at multiples


@dataclass(frozen=True)
class FieldKind:
    """What a field holds: numbers of one type in an array of so many dimensions, a plain number if there are none."""

    dtype: type
    dimensions: int


Reals = Annotated[Array, FieldKind(np.float64, 1)]
RealMatrix = Annotated[Array, FieldKind(np.float64, 2)]
RealMatrices = Annotated[Array, FieldKind(np.float64, 3)]
RealArrays4 = Annotated[Array, FieldKind(np.float64, 4)]  # of four dimensions
RealArrays5 = Annotated[Array, FieldKind(np.float64, 5)]
Wholes = Annotated[Indices, FieldKind(np.int64, 1)]
WholeMatrix = Annotated[Indices, FieldKind(np.int64, 2)]
Flags = Annotated[Mask, FieldKind(np.bool_, 1)]

_NUMBERS = {int: FieldKind(np.int64, 0), float: FieldKind(np.float64, 0), bool: FieldKind(np.bool_, 0)}
_UNUSED = tuple((0,) * (LINE_NUMBERS - 1 - dimensions) for dimensions in range(LINE_NUMBERS))

Shape = tuple[int, ...]
Group = TypeVar("Group", bound=tuple[Any, ...])


@cache
def kinds(group: type[tuple[Any, ...]]) -> dict[str, FieldKind]:
    """What each field of a group holds, in their order.

    Raises:
        TypeError: a field is annotated with anything else.
    """
    out = {}
    for name, hint in get_type_hints(group, include_extras=True).items():
        kind = _NUMBERS.get(hint) or next(
            (x for x in getattr(hint, "__metadata__", ()) if isinstance(x, FieldKind)), None
        )
        if kind is None:
            raise TypeError(f"{group.__name__}.{name} is {hint}, which compiled code does not take")
        out[name] = kind
    return out


def table(group: tuple[Any, ...]) -> Indices:
    """(fields, LINE) where the arrays of a group are and how long, and its numbers. The caller keeps the arrays alive.

    Raises:
        TypeError: an array is not of the kind that the group declares, or not contiguous.
    """
    lines, reals = [], []
    for k, ((name, kind), x) in enumerate(zip(kinds(type(group)).items(), group, strict=True)):
        if kind.dimensions == 0:
            lines.append((0 if kind.dtype is np.float64 else int(x), *_UNUSED[0]))
            if kind.dtype is np.float64:
                reals.append((k, x))
            continue
        if x.dtype != kind.dtype or x.ndim != kind.dimensions or not x.flags.c_contiguous:
            wanted = f"contiguous {np.dtype(kind.dtype)} array of {kind.dimensions} dimensions"
            raise TypeError(f"{type(group).__name__}.{name} is {x.dtype} of shape {x.shape}, not a {wanted}")
        lines.append((x.ctypes.data, *x.shape, *_UNUSED[kind.dimensions]))
    out = np.array(lines, np.int64)
    for k, x in reals:
        out.view(np.float64)[k, 0] = x
    return out


class Layout(Generic[Group]):
    """Where the arrays of a group lie in one piece of memory."""

    def __init__(self, group: type[Group], shapes: Mapping[str, Shape]) -> None:
        """shapes: of all fields, in any order."""
        self.group, self.table = (
            group,
            np.zeros((len(kinds(group)), LINE_NUMBERS), np.int64),
        )  # its addresses are relative
        self.fields: dict[str, tuple[type, int, int, Shape]] = {}  # type of the numbers, begin and end, shape
        self.size = 0
        for line, (name, kind) in zip(self.table, kinds(group).items(), strict=True):
            shape = shapes[name]
            if np.dtype(kind.dtype).itemsize != 8 or kind.dimensions != len(shape) or not shape:
                raise TypeError(f"{group.__name__}.{name} of shape {shape} has no place in a block")
            line[: 1 + len(shape)] = 8 * self.size, *shape
            self.fields[name] = kind.dtype, self.size, self.size + math.prod(shape), shape
            self.size += whole_vectors(math.prod(shape))


class Block(Generic[Group]):
    """The arrays of a group in one piece of memory, by default one that nobody has written to yet, and their table."""

    def __init__(self, layout: Layout[Group], memory: Reals | None = None) -> None:
        self.layout, self.memory = layout, np.empty(layout.size) if memory is None else memory
        self.table: Indices = layout.table.copy()
        self.table[:, 0] += self.memory.ctypes.data

    def arrays(self) -> Group:
        """The group, whose arrays keep the memory alive."""
        return self.layout.group(*map(self.array, self.layout.fields))

    def array(self, name: str) -> Any:
        """One array of the group."""
        dtype, begin, end, shape = self.layout.fields[name]
        return self.memory[begin:end].view(dtype).reshape(shape)


def whole_vectors(n: int) -> int:
    """The least number of at least n that the processor's vectors hold without a rest."""
    return n + -n % WHOLE_VECTOR
