"""Fields of a parsed JSON object, read one by one: every fault is one line with the field, and what is left is one.

And floating-point numbers as the rational numbers that they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from handfast.proofs.strict_json import MAX_JSON_NUMBER as MAX_JSON_NUMBER
from handfast.proofs.strict_json import BadFile as BadFile

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]

EQUALITY_TOLERANCE = 1e-9  # relative, or absolute below 1: two numbers that say the same
_NEEDED: Any = object()


class Fields:
    """An object of a file. Each field is taken once; `done` refuses what nobody took.

    Raises:
        BadFile: it is no object.
    """

    def __init__(self, data: Any, place: str = "") -> None:
        if not isinstance(data, Mapping):
            raise BadFile("is no object", place)
        self.place, self._left = place, dict(data)

    def at(self, name: str) -> str:
        """The field's whole name."""
        return f"{self.place}.{name}" if self.place else name

    def names(self) -> tuple[str, ...]:
        """Of the fields that are left."""
        return tuple(self._left)

    def has(self, name: str) -> bool:
        """Is it there, and not null? Null is as good as left out, and taken."""
        if self._left.get(name) is None:
            self._left.pop(name, None)
        return name in self._left

    def take(self, name: str, default: Any = _NEEDED) -> Any:
        """The value as it is."""
        if name not in self._left and default is _NEEDED:
            raise BadFile("is missing", self.at(name))
        return self._left.pop(name, default)

    def done(self) -> None:
        """`BadFile` for a field that nobody took."""
        if self._left:
            raise BadFile("is not a known field; leave it out", self.at(next(iter(self._left))))

    def text(self, name: str, default: Any = _NEEDED, among: Sequence[str] = ()) -> str:
        """A text, one of `among` if these are given."""
        value = self.take(name, default)
        if not isinstance(value, str) or (among and value not in among):
            raise BadFile(f"is {value!r}; {' or '.join(map(repr, among)) or 'a text'} is needed", self.at(name))
        return value

    def flag(self, name: str, default: Any = _NEEDED) -> bool:
        """True or false."""
        value = self.take(name, default)
        if not isinstance(value, bool):
            raise BadFile(f"is {value!r}; true or false is needed", self.at(name))
        return value

    def number(self, name: str, default: Any = _NEEDED, least: float = -MAX_JSON_NUMBER) -> float:
        """A finite number, at least `least`."""
        return number(self.take(name, default), self.at(name), least)

    def whole(self, name: str, default: Any = _NEEDED, least: int = 0) -> int:
        """A whole number, at least `least`."""
        value = self.take(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise BadFile(f"is {value!r}; a whole number of {least} or more is needed", self.at(name))
        return value

    def numbers(self, name: str, shape: tuple[int, ...], default: Any = _NEEDED) -> Array:
        """Finite numbers of a shape, in which -1 is any length."""
        return numbers(self.take(name, default), shape, self.at(name))

    def named(self, name: str, default: Any = _NEEDED) -> dict[str, float]:
        """Finite numbers by name."""
        value = self.take(name, default)
        if not isinstance(value, Mapping):
            raise BadFile("is no object of numbers by name", self.at(name))
        return {key: number(x, f"{self.at(name)}.{key}") for key, x in value.items()}

    def texts(self, name: str, default: Any = _NEEDED) -> tuple[str, ...]:
        """A list of texts."""
        return texts(self.take(name, default), self.at(name))

    def object(self, name: str) -> Fields:
        """The object in a field."""
        return Fields(self.take(name), self.at(name))

    def objects(self, name: str, default: Any = _NEEDED) -> Iterator[Fields]:
        """The objects of a list."""
        return (Fields(x, place) for x, place in self.items(name, default))

    def items(self, name: str, default: Any = _NEEDED) -> list[tuple[Any, str]]:
        """What is in a list, each with its place."""
        value = self.take(name, default)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise BadFile("is no list", self.at(name))
        return [(x, f"{self.at(name)}[{i}]") for i, x in enumerate(value)]

    def table(self, name: str, columns: Sequence[str]) -> dict[str, list[Any]]:
        """The objects of a list that all have these fields and no others, field by field."""
        rows = self.items(name)
        for row, place in rows:
            if not isinstance(row, Mapping) or row.keys() != {*columns}:
                entry = Fields(row, place)
                for column in columns:
                    entry.take(column)
                entry.done()
        return {column: [row[column] for row, _ in rows] for column in columns}


def number(value: Any, field: str, least: float = -MAX_JSON_NUMBER) -> float:
    """A finite number, no text and no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) == math.inf or value != value:
        raise BadFile(f"is {value!r}; a finite number is needed", field)
    if abs(value) > MAX_JSON_NUMBER:  # whole numbers may be beyond all floating-point numbers
        raise BadFile(f"is beyond {MAX_JSON_NUMBER:g}, the largest number that is possible", field)
    if value < least:
        raise BadFile(f"is {value:g}; {least:g} or more is needed", field)
    return float(value)


def numbers(value: Any, shape: tuple[int, ...], field: str) -> Array:
    """Finite numbers of a shape, in which -1 is any length; a list of lists, or an array."""
    wanted = " x ".join("n" if n < 0 else str(n) for n in shape)
    if not isinstance(value, np.ndarray):
        _only_numbers(value, field)
    try:
        out = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BadFile(f"is no table of {wanted} numbers", field) from None
    if out.size == 0 and -1 in shape:
        out = out.reshape([max(n, 0) for n in shape])
    if out.ndim != len(shape) or any(n not in (-1, k) for n, k in zip(shape, out.shape, strict=True)):
        raise BadFile(f"has {' x '.join(map(str, out.shape)) or 'one'} numbers; {wanted} are needed", field)
    if not (np.abs(out) <= MAX_JSON_NUMBER).all():
        raise BadFile(f"has a number that is not finite, or beyond {MAX_JSON_NUMBER:g}", field)
    out.flags.writeable = False
    return out


def _only_numbers(value: Any, field: str) -> None:
    layer = [value]
    while layer and {*map(type, layer)} <= {list, tuple}:
        layer = list(chain.from_iterable(layer))
    if not {*map(type, layer)} <= {float, int}:
        wrong = (x for x in layer if isinstance(x, bool) or not isinstance(x, int | float | np.floating | np.integer))
        for x in wrong:
            raise BadFile(f"has {x!r} where a number is needed", field)


def texts(value: Any, field: str) -> tuple[str, ...]:
    """A list of texts."""
    if not isinstance(value, Sequence) or isinstance(value, str) or not all(isinstance(x, str) for x in value):
        raise BadFile("is no list of texts", field)
    return tuple(value)


def refuse_no_limit(value: float, field: str) -> None:
    """`BadFile` unless a limit of forces is positive."""
    if not value > 0:
        raise BadFile(f"is {value:g}; a limit is positive", field)


def refuse_unknown(name: str, known: Sequence[str], kind: str, field: str) -> None:
    """`BadFile` for a name that nothing has."""
    if name not in known:
        raise BadFile(f"has unknown {kind} '{name}'; known are {', '.join(known) or 'none'}", field)


def same(a: Any, b: Any, relative: float = EQUALITY_TOLERANCE) -> bool:
    """Equal JSON; numbers within `EQUALITY_TOLERANCE`, or `relative` to their size."""
    if type(a) is float and type(b) is float:
        return abs(a - b) <= max(EQUALITY_TOLERANCE, relative * abs(b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[k], b[k], relative) for k in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(same(x, y, relative) for x, y in zip(a, b, strict=True))
    if isinstance(a, bool) or isinstance(b, bool):
        return a is b
    if isinstance(a, float | int) and isinstance(b, float | int):
        return bool(abs(a - b) <= max(EQUALITY_TOLERANCE, relative * abs(b)))
    return bool(a == b)


# --- products of matrices and vectors ---------------------------------------------------------------

MOST_MULTIPLICATIONS = 1 << 17  # BLAS begins threads from twice as many on


def product(a: Array, b: Array | Mask) -> Array:
    """(..., k, p) a @ b, of few rows at a time: threads of BLAS only wait for each other in products of this size."""
    rows = max(1, MOST_MULTIPLICATIONS // max(1, b.shape[-2] * b.shape[-1]))
    if a.shape[-2] <= rows:
        return np.asarray(a @ b)
    return np.concatenate([a[..., k : k + rows, :] @ b for k in range(0, a.shape[-2], rows)], axis=-2)


def cross_rows(a: Array, b: Array) -> Array:
    """a x b along the last axis; `np.cross` takes several times as long for few."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[..., ahead] * b[..., behind] - a[..., behind] * b[..., ahead])


# --- rational numbers -------------------------------------------------------------------------------

ZERO = fmpq(0)


def rational(x: float) -> fmpq:
    """A floating-point number as it is."""
    return fmpq(*float(x).as_integer_ratio())


exact: Callable[[Any], Any] = np.frompyfunc(rational, 1, 1)  # arrays of them, of arrays


def rationals(values: Iterable[float]) -> list[fmpq]:
    """Several."""
    return [rational(x) if x else ZERO for x in values]


def cross(a: Sequence[fmpq], b: Sequence[fmpq]) -> list[fmpq]:
    """(3,) a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Iterable[fmpq], b: Iterable[fmpq]) -> fmpq:
    """a . b."""
    return sum((x * y for x, y in zip(a, b, strict=True)), ZERO)


def rounded(x: fmpq) -> float:
    """The nearest floating-point number; integers of any length. Infinite beyond the largest."""
    try:
        return int(x.p) / int(x.q)
    except OverflowError:
        return math.inf if x > 0 else -math.inf


def not_zero(x: fmpq) -> float:
    """The same, but never 0 for what is not: the smallest floating-point number with its sign stands for that."""
    return rounded(x) or 5e-324 * ((x > 0) - (x < 0))


def floats(values: Any, nearest: Callable[[fmpq], float] = rounded) -> Array:
    """Of an array of rational numbers."""
    return np.asarray(np.frompyfunc(nearest, 1, 1)(values), dtype=np.float64)
