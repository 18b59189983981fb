"""Pickles that hold plain data, read by a stack machine that calls nothing a file names.

A pickle is a program, and Python's own reader runs whatever it names. Here the standard library only takes the program
apart (`pickletools.genops`); what its instructions mean is written below, for numbers, texts, containers, numpy arrays
and torch tensors. A name outside `ADMITTED` ends the reading before anything has been made of it.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.datasets.published.plain_parts import (
    ADMITTED,
    BUILDERS,
    ArrayInTheMaking,
    Name,
    StorageName,
    TypeInTheMaking,
    hashed,
)

DEPTH = 100  # of containers in each other
MADE = 2**30  # [bytes] made from one file, which may ask for the same arrays and texts again and again
PLACE, CONTAINER = 20, 200  # [bytes] about what an instruction leaves on stack or memo, and an empty container takes
VALUES = 2**28  # in all containers, and [8 bytes] in arrays, each counted as often as it is found from the top
SINGLE = (int, float, complex, str, bytes, type(None))
Storage = Callable[[tuple[Any, ...]], Any]


def read_pickle(data: bytes, storage: Storage | None = None) -> tuple[Any, int]:
    """What a pickle of plain data holds, and where it ends.

    Tuples, sets and frozensets stay what they are, numpy scalars become Python numbers, tensors become numpy arrays.

    Args:
        data: the pickle, from its first byte; what follows its end is left alone.
        storage: makes an array of a torch storage's persistent id; without it such ids are refused.

    Raises:
        InputError: no pickle, cut short, a name that is not admitted, an instruction that is not known, containers
            that contain themselves or are more than `DEPTH` deep, more than `MADE` bytes, or than `VALUES` numbers and
            texts when each shared part is counted as often as it is there.
    """
    machine = _Machine(storage)
    end = 0
    try:
        for code, argument, position in pickletools.genops(data):
            machine.step(code.name, argument)
            end = (position or 0) + 1
        return _finished(machine.result(), machine.made), end
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"is nested too deeply; at most {DEPTH} containers may be in each other") from None
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError, MemoryError) as fault:
        reason = " ".join(str(fault).split())[:80]
        raise InputError(f"is no whole pickle ({type(fault).__name__}: {reason})") from None


class _Mark:
    """Where a container's contents begin on the stack."""


class _Machine:
    """The stack and the memo of a pickle; each instruction is one method or one entry of `PUSHED`."""

    def __init__(self, storage: Storage | None) -> None:
        self.storage = storage
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.mark = _Mark()
        self.made = 0  # bytes

    def result(self) -> Any:
        if len(self.stack) != 1 or self.stack[0] is self.mark:
            raise ValueError(f"{len(self.stack)} values are left at the end")
        return self.stack[0]

    def step(self, name: str, argument: Any) -> None:
        self.made = _within(self.made + (PLACE + CONTAINER if name in CONTAINERS else PLACE))
        if name in PUSHED:
            self.stack.append(argument)
        elif name in CONSTANT:
            value = CONSTANT[name]
            self.stack.append(value() if isinstance(value, type) else value)
        elif name.endswith("PUT"):
            self.memo[int(argument)] = self.stack[-1]
        elif name.endswith("GET"):
            self.stack.append(self.memo[int(argument)])
        else:
            method = getattr(self, f"_{name.lower()}", None)
            if method is None:
                raise InputError(f"has the pickle instruction {name}; plain data needs none of it")
            method(argument)

    def _proto(self, _: Any) -> None: ...

    def _frame(self, _: Any) -> None: ...

    def _stop(self, _: Any) -> None: ...

    def _mark(self, _: Any) -> None:
        self.stack.append(self.mark)

    def _pop(self, _: Any) -> None:
        self.stack.pop()

    def _pop_mark(self, _: Any) -> None:
        self._since_mark()

    def _dup(self, _: Any) -> None:
        self.stack.append(self.stack[-1])

    def _memoize(self, _: Any) -> None:
        self.memo[len(self.memo)] = self.stack[-1]

    def _since_mark(self) -> list[Any]:
        """What stands above the last mark, taken off with it."""
        k = len(self.stack) - 1
        while self.stack[k] is not self.mark:
            k -= 1
            if k < 0:
                raise ValueError("a mark is missing")
        found = self.stack[k + 1 :]
        del self.stack[k:]
        return found

    def _tuple(self, _: Any) -> None:
        self.stack.append(tuple(self._since_mark()))

    def _tuple1(self, _: Any) -> None:
        self._last(1)

    def _tuple2(self, _: Any) -> None:
        self._last(2)

    def _tuple3(self, _: Any) -> None:
        self._last(3)

    def _last(self, count: int) -> None:
        if len(self.stack) < count:
            raise ValueError("the stack is empty")
        found = tuple(self.stack[-count:])
        del self.stack[-count:]
        self.stack.append(found)

    def _list(self, _: Any) -> None:
        self.stack.append(self._since_mark())

    def _append(self, _: Any) -> None:
        self._onto([self.stack.pop()])

    def _appends(self, _: Any) -> None:
        self._onto(self._since_mark())

    def _onto(self, values: list[Any]) -> None:
        target = self.stack[-1]
        if type(target) is not list:
            raise ValueError("something is appended to what is no list")
        target += values

    def _dict(self, _: Any) -> None:
        found = self._since_mark()
        self.stack.append({})
        self._into(found)

    def _setitem(self, _: Any) -> None:
        value, key = self.stack.pop(), self.stack.pop()
        self._into([key, value])

    def _setitems(self, _: Any) -> None:
        self._into(self._since_mark())

    def _into(self, found: list[Any]) -> None:
        target = self.stack[-1]
        if type(target) is not dict or len(found) % 2:
            raise ValueError("something is set in what is no dictionary")
        for key, value in zip(found[::2], found[1::2], strict=True):
            target[hashed(key)] = value

    def _additems(self, _: Any) -> None:
        found = self._since_mark()
        if type(self.stack[-1]) is not set:
            raise ValueError("something is added to what is no set")
        self.stack[-1].update(map(hashed, found))

    def _frozenset(self, _: Any) -> None:
        self.stack.append(frozenset(map(hashed, self._since_mark())))

    def _global(self, argument: str) -> None:
        module, _, name = argument.partition(" ")
        self.stack.append(_admitted(module, name))

    def _stack_global(self, _: Any) -> None:
        name, module = self.stack.pop(), self.stack.pop()
        if type(module) is not str or type(name) is not str:
            raise ValueError("a name that is no text")
        self.stack.append(_admitted(module, name))

    def _reduce(self, _: Any) -> None:
        arguments, name = self.stack.pop(), self.stack.pop()
        if not isinstance(name, Name) or not isinstance(arguments, tuple):
            raise InputError("calls something that has no name")
        if name.name not in BUILDERS:
            raise InputError(f"calls {name}, which is no array or container")
        made = BUILDERS[name.name](*arguments)
        self.made = _within(self.made + _size(made))
        self.stack.append(made)

    def _build(self, _: Any) -> None:
        state, made = self.stack.pop(), self.stack[-1]
        if isinstance(made, ArrayInTheMaking | TypeInTheMaking):
            made.fill(state)
        elif not (type(made) is dict and state in ({}, None)):  # an ordered dictionary says that it has no more
            raise InputError(f"sets the inner state of a {type(made).__name__}; plain data has none")

    def _binpersid(self, _: Any) -> None:
        key = self.stack.pop()
        if self.storage is None or not (isinstance(key, tuple) and len(key) == 5 and isinstance(key[1], StorageName)):
            raise InputError("has a persistent id, which only torch files of tensors may")
        self.stack.append(self.storage(key))


PUSHED = {
    *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
    *("STRING", "BINSTRING", "SHORT_BINSTRING", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
    *("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8"),
}
CONSTANT: dict[str, Any] = {
    **{"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()},
    **{"EMPTY_LIST": list, "EMPTY_DICT": dict, "EMPTY_SET": set},
}


CONTAINERS = {
    *("EMPTY_LIST", "EMPTY_DICT", "EMPTY_SET", "EMPTY_TUPLE", "LIST", "DICT", "FROZENSET", "REDUCE"),
    *("TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"),
}


def _admitted(module: str, name: str) -> Any:
    for known, prefixes in ADMITTED.items():
        if name == known and module in prefixes:
            return StorageName(name) if name.endswith("Storage") else Name(module, name)
    raise InputError(
        f"names {module[:80]}.{name[:80]}, which is no plain array or container; nothing of the file was run"
    )


def _size(x: Any) -> int:
    """[bytes] about what an array or a text takes, with the objects that it holds."""
    if isinstance(x, np.ndarray):
        return x.nbytes if x.dtype.kind != "O" else 64 * x.size
    return 4 * len(x) if isinstance(x, str | bytes) else 0


def _within(made: int) -> int:
    if made > MADE:
        raise InputError(f"makes more than {MADE} bytes of data")
    return made


def _finished(value: Any, made: int) -> Any:
    """Plain values in place of those in the making; what is shared stays shared, so that it takes no longer.

    Args:
        made: [bytes] that were made so far.
    """
    done: dict[int, Any] = {}
    kept: list[Any] = []  # so that no address is used twice
    open_: set[int] = set()
    values = 0  # found so far
    inside: dict[int, int] = {}  # how many values are in each that is done

    def found(count: int) -> None:
        nonlocal values
        values += count
        if values > VALUES:
            raise InputError(f"has more than {VALUES} values, where each shared part counts as often as it is there")

    def whole(x: Any, depth: int) -> Any:
        nonlocal made
        if isinstance(x, SINGLE):
            found(1)
            return x
        if depth > DEPTH:
            raise RecursionError
        key = id(x)
        if key in done:
            found(inside[key])
            return done[key]
        if key in open_:
            raise InputError("has a container that contains itself")
        open_.add(key)
        kept.append(x)
        before = values
        done[key] = _one(x, lambda y: whole(y, depth + 1))
        open_.discard(key)
        if isinstance(x, ArrayInTheMaking):
            made = _within(made + _size(done[key]))
        found(1 + (done[key].nbytes // 8 if isinstance(done[key], np.ndarray) else 0))
        inside[key] = values - before
        return done[key]

    return whole(value, 0)


def _one(x: Any, whole: Callable[[Any], Any]) -> Any:
    if isinstance(x, dict):
        return {whole(k): whole(v) for k, v in x.items()}
    if isinstance(x, list | tuple | set | frozenset):
        return type(x)(_each(x, whole))
    if isinstance(x, ArrayInTheMaking):
        return x.array(whole)
    if isinstance(x, Name | TypeInTheMaking | _Mark):
        raise InputError(f"holds {x} itself, which is no plain data")
    return x


def _each(values: Any, whole: Callable[[Any], Any]) -> Iterator[Any]:
    for value in values:
        yield whole(value)
