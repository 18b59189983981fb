"""Pickles of plain data, read by the standard library's `Unpickler` with a list of admitted names.

A pickle is a program that may call whatever it names. Here a name stands for one of our own makers, of numbers, texts,
containers, numpy arrays and torch tensors; any other name ends the reading before anything is called. Makers check
shapes, types and sizes before they make anything: an array is as large as its bytes.

Memory and time are not limited here: read files of strangers with `read_published`, which does.
"""

from __future__ import annotations

import io
import math
import pickle
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from handfast.core.errors import InputError

DTYPE_PATTERN = re.compile(r"[|<>=]?(b1|[iu][1248]|f[248]|c(8|16)|[SU]\d{1,6}|O8?|\?)")
DIMENSIONS = 32
STORAGES = {
    **{"DoubleStorage": "<f8", "FloatStorage": "<f4", "HalfStorage": "<f2", "BFloat16Storage": "<u2"},
    **{"LongStorage": "<i8", "IntStorage": "<i4", "ShortStorage": "<i2", "CharStorage": "i1"},
    **{"ByteStorage": "u1", "BoolStorage": "b1"},
}
PICKLE_ERRORS = (  # what the standard library and our makers raise for bytes that are no pickle
    *(pickle.UnpicklingError, EOFError, ValueError, IndexError, KeyError, TypeError, AttributeError),
    *(OverflowError, RecursionError),
)


@dataclass(frozen=True)
class StorageId:
    """A storage of torch as a pickle names it.

    Attributes:
        type: a key of `STORAGES`. file: beside the pickle, which holds the numbers. count: of the numbers.
    """

    type: str
    file: str
    count: int


LoadStorage: TypeAlias = Callable[[StorageId], NDArray[Any]]


def read_pickle(data: bytes, storage: LoadStorage | None = None) -> Any:
    """What a pickle of plain data holds.

    Numpy scalars become Python numbers, ordered dictionaries plain ones, tensors numpy arrays.

    Args:
        data: the pickle, from its first byte; what follows its end is left alone.
        storage: gives the numbers (n,) of a storage of torch; without it storages are refused.

    Raises:
        InputError: no pickle, cut short, or a name that is not admitted. One line.
    """
    try:
        return _PlainUnpickler(data, storage).load()
    except InputError:
        raise
    except PICKLE_ERRORS as fault:
        reason = " ".join(str(fault).split())[:80]
        raise InputError(f"is no whole pickle ({type(fault).__name__}: {reason})") from None


class _PlainUnpickler(pickle.Unpickler):
    """Names are looked up in `ADMITTED` alone."""

    def __init__(self, data: bytes, storage: LoadStorage | None) -> None:
        super().__init__(io.BytesIO(data), encoding="latin-1")
        self.storage = storage

    def find_class(self, module: str, name: str) -> Any:
        made = ADMITTED.get((module, name))
        if made is None:
            said = f"names {module[:80]}.{name[:80]}, which is no plain array or container"
            raise InputError(f"{said}; nothing of the file was run")
        return made

    def persistent_load(self, key: Any) -> _Storage:
        if self.storage is None:
            raise InputError("has a persistent id, which only torch files of tensors may")
        match key:
            case ("storage", _StorageType() as kind, str(file), _, int(count)) if count >= 0:
                return _Storage(self.storage(StorageId(kind.name, file, count)))
        raise InputError("has a persistent id that is no storage of numbers")


class _Sealed:
    """What a pickle may mention and pass on, but not alter."""

    __slots__ = ()

    def __setstate__(self, state: Any) -> NoReturn:
        raise InputError("sets the inner state of what is no array; plain data has none")


class _Maker(_Sealed):
    """What an admitted name stands for: something that can be called. It is no class, so none can be made by it."""

    __slots__ = ("function",)

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)


class _StorageType(_Sealed):
    """The type of a torch storage: a key of `STORAGES`."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name


class _Storage(_Sealed):
    """The numbers (n,) of a storage of torch."""

    __slots__ = ("numbers",)

    def __init__(self, numbers: NDArray[Any]) -> None:
        self.numbers = numbers


class _DType:
    """A numpy dtype of numbers, truth values, texts or objects; its byte order comes with its state."""

    __slots__ = ("dtype",)

    def __init__(self, text: Any, *_: Any) -> None:
        self.dtype = plain_dtype(text)

    def __setstate__(self, state: Any) -> None:
        """The state: version, byte order, then what only records and subarrays have."""
        if not (isinstance(state, tuple) and 8 <= len(state) <= 9 and state[1] in tuple("<>|=")):
            raise ValueError("the state of a dtype")
        if any(x is not None for x in state[2:5]):
            raise InputError("has an array of records; plain numbers are needed")
        if state[1] in "<>":
            self.dtype = self.dtype.newbyteorder(state[1])


class _Array(np.ndarray[Any, Any]):
    """A numpy array that is filled by its state, once that was checked."""

    __slots__ = ()

    def __setstate__(self, state: Any) -> None:
        """The state: (version,) shape, dtype, whether columns run fastest, and bytes or a list of objects."""
        if self.size:  # others may look at its memory, which numpy would free
            raise ValueError("an array is filled twice")
        if not (isinstance(state, tuple) and 4 <= len(state) <= 5 and isinstance(state[-3], _DType)):
            raise ValueError("the state of an array")
        shape, dtype, columns, data = checked_shape(state[-4]), state[-3].dtype, bool(state[-2]), state[-1]
        if dtype.kind != "O":
            data = raw_bytes(data, dtype, shape)
        elif type(data) is not list or len(data) != math.prod(shape):
            raise InputError(f"has an array of objects whose shape {shape} is not that of its contents")
        super().__setstate__((1, shape, dtype, columns, data))  # type: ignore[arg-type]


def plain_dtype(text: Any) -> np.dtype[Any]:
    """The dtype of numbers, truth values, texts or objects that a text stands for; `InputError` for another one."""
    if isinstance(text, bytes):
        text = text.decode("latin-1")
    if not (isinstance(text, str) and DTYPE_PATTERN.fullmatch(text)):
        said = repr(text[:40]) if isinstance(text, str) else f"a {type(text).__name__}"
        raise InputError(f"has an array of type {said}; numbers, texts and objects are admitted")
    return np.dtype(text.replace("O8", "O"))


def checked_shape(shape: Any) -> tuple[int, ...]:
    """A shape of whole numbers that are not negative; `InputError` for another one."""
    sizes = (shape,) if type(shape) is int else shape
    if not isinstance(sizes, tuple) or len(sizes) > DIMENSIONS or any(type(n) is not int or n < 0 for n in sizes):
        raise InputError("has an array whose shape is none")
    return sizes


def raw_bytes(data: Any, dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """The contents of an array of that dtype and shape; `InputError` unless they fit exactly."""
    if not isinstance(data, str | bytes | bytearray):
        raise ValueError("the contents of an array")
    raw = data.encode("latin-1") if isinstance(data, str) else bytes(data)  # Python 2 wrote bytes as text
    if math.prod(shape) * dtype.itemsize != len(raw):
        need = f"{' x '.join(map(str, shape)) or 1} of {dtype.itemsize} bytes"
        raise InputError(f"has an array of {need} with {len(raw)} bytes of contents")
    if not dtype.itemsize:
        raise InputError("has an array of empty texts")
    return raw


def from_bytes(data: Any, dtype: np.dtype[Any], shape: tuple[int, ...], order: Any = "C") -> NDArray[Any]:
    """The array of that dtype and shape whose contents are `data`; `InputError` unless they fit exactly."""
    return np.frombuffer(raw_bytes(data, dtype, shape), dtype=dtype).reshape(shape, order=order)


def _scalar(kind: Any, data: Any = b"") -> Any:
    if not isinstance(kind, _DType) or kind.dtype.kind == "O":
        raise InputError("has a numpy scalar that is no number or text")
    return from_bytes(data, kind.dtype, ()).item()


def _from_buffer(data: Any, kind: Any, shape: Any, order: Any, *_: Any) -> NDArray[Any]:
    if not isinstance(kind, _DType) or kind.dtype.kind == "O" or order not in ("C", "F"):
        raise ValueError("the dtype of an array")
    return from_bytes(data, kind.dtype, checked_shape(shape), order)


def _encoded(text: Any, encoding: Any) -> bytes:
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise ValueError("bytes as text in another encoding")
    return text.encode("latin-1")


def _bytes(data: Any = b"", encoding: Any = "latin-1") -> bytes:
    if not isinstance(data, str | bytes):
        raise ValueError("the contents of a bytearray")
    return _encoded(data, encoding) if isinstance(data, str) else data


def _tensor(storage: Any, offset: Any, size: Any, stride: Any, *more: Any) -> NDArray[Any]:
    """A tensor's numbers, copied; no larger than its storage, and within it."""
    if len(more) > 2 and more[2]:  # after whether gradients are wanted, and hooks
        raise InputError("has a tensor that stands for the negative or conjugate of its contents")
    sizes, steps = checked_shape(size), checked_shape(stride)
    if not isinstance(storage, _Storage) or type(offset) is not int or offset < 0 or len(sizes) != len(steps):
        raise ValueError("the parts of a tensor")
    numbers, count = storage.numbers, math.prod(sizes)
    last = offset + sum((n - 1) * step for n, step in zip(sizes, steps, strict=True))
    if count and (count > len(numbers) or last >= len(numbers)):
        raise InputError(f"has a tensor of {' x '.join(map(str, sizes))} that is larger than its contents")
    if not count:
        return np.zeros(sizes, numbers.dtype)
    strides = tuple(step * numbers.itemsize for step in steps)
    return np.lib.stride_tricks.as_strided(numbers[offset:], sizes, strides).copy()


def _complex(*parts: Any) -> complex:
    if not all(isinstance(x, int | float) for x in parts):
        raise ValueError("the parts of a complex number")
    return complex(*parts)


def _collection(kind: type) -> Callable[..., Any]:
    def made(*values: Any) -> Any:
        if len(values) > 1 or not all(isinstance(v, list | tuple) for v in values):
            raise ValueError(f"the contents of a {kind.__name__}")
        return kind(*values)

    return made


def _ordered(*pairs: Any) -> dict[Any, Any]:
    """An ordered dictionary comes empty, or, from Python 2, as a list of pairs."""
    if len(pairs) != 1 or type(pairs[0]) is not list:
        return {}
    if not all(isinstance(p, list | tuple) and len(p) == 2 for p in pairs[0]):
        raise ValueError("the contents of a dictionary")
    return dict(pairs[0])


def _no_array(*_: Any) -> NoReturn:
    raise InputError("calls numpy.ndarray, which is no array or container")


_ARRAYS = ("numpy.core.multiarray", "numpy._core.multiarray")
_NUMERIC = ("numpy.core.numeric", "numpy._core.numeric")
_BUILT_IN = ("builtins", "__builtin__")
_MAKERS: dict[str, tuple[tuple[str, ...], Callable[..., Any]]] = {  # name: the modules in which it is admitted, maker
    "_reconstruct": (_ARRAYS, lambda *_: np.ndarray.__new__(_Array, (0,))),
    "scalar": (_ARRAYS, _scalar),
    "_frombuffer": (_NUMERIC, _from_buffer),
    "ndarray": (("numpy",), _no_array),  # an argument of `_reconstruct`
    "dtype": (("numpy",), _DType),
    "set": (_BUILT_IN, _collection(set)),
    "frozenset": (_BUILT_IN, _collection(frozenset)),
    "bytearray": (_BUILT_IN, _bytes),
    "bytes": (_BUILT_IN, lambda: b""),  # what older protocols make of empty ones
    "complex": (_BUILT_IN, _complex),
    "encode": (("_codecs",), _encoded),
    "OrderedDict": (("collections",), _ordered),
    "Size": (("torch",), lambda sizes: checked_shape(sizes)),
    "_rebuild_tensor": (("torch._utils",), _tensor),
    "_rebuild_tensor_v2": (("torch._utils",), _tensor),
    "_rebuild_parameter": (("torch._utils",), lambda tensor, *_: tensor),
}
ADMITTED: dict[tuple[str, str], Any] = {
    **{(module, name): _Maker(made) for name, (modules, made) in _MAKERS.items() for module in modules},
    **{("torch", name): _StorageType(name) for name in STORAGES},
}
