"""What a pickle of plain data may name, and what we make of it: numpy's arrays and types, torch's tensors.

The makers check what a file says about shapes and types before they make anything: an array is as large as its bytes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handfast.core.errors import InputError

TYPES = re.compile(r"[|<>=]?(b1|[iu][1248]|f[248]|c(8|16)|[SU]\d{1,6}|O8?|\?)")
DIMENSIONS = 32
KEYS = (int, float, str, bytes, type(None))
LARGEST_KEY = 2**60
STORAGES = {
    **{"DoubleStorage": "f8", "FloatStorage": "f4", "HalfStorage": "f2", "BFloat16Storage": "u2"},
    **{"LongStorage": "i8", "IntStorage": "i4", "ShortStorage": "i2", "CharStorage": "i1"},
    **{"ByteStorage": "u1", "BoolStorage": "b1"},
}
_ARRAYS = ("numpy.core.multiarray", "numpy._core.multiarray")
_NUMERIC = ("numpy.core.numeric", "numpy._core.numeric")
_BUILT_IN = ("builtins", "__builtin__")
ADMITTED: dict[str, tuple[str, ...]] = {  # name: the modules in which it is admitted
    **{"_reconstruct": _ARRAYS, "scalar": _ARRAYS, "_frombuffer": _NUMERIC, "ndarray": ("numpy",), "dtype": ("numpy",)},
    **dict.fromkeys(("set", "frozenset", "bytearray", "bytes", "complex"), _BUILT_IN),
    **{"encode": ("_codecs",), "OrderedDict": ("collections",), "Size": ("torch",)},
    **dict.fromkeys(("_rebuild_tensor", "_rebuild_tensor_v2", "_rebuild_parameter"), ("torch._utils",)),
    **dict.fromkeys(STORAGES, ("torch",)),
}


@dataclass(frozen=True)
class Name:
    """A name that a pickle mentions; nothing but a key of `BUILDERS`."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


@dataclass(frozen=True)
class StorageName:
    """The type of a torch storage."""

    name: str

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of its numbers as they lie in the file; a bfloat16 is the upper half of a float32."""
        return np.dtype("<" + STORAGES[self.name]) if self.name != "BoolStorage" else np.dtype("b1")


class TypeInTheMaking:
    """A numpy dtype; its byte order comes with its state."""

    def __init__(self, text: Any, *_: Any) -> None:
        self.dtype = plain_type(text)

    def fill(self, state: Any) -> None:
        """The state: version, byte order, then what only records and subarrays have."""
        if not (isinstance(state, tuple) and 8 <= len(state) <= 9 and state[1] in tuple("<>|=")):
            raise ValueError("the state of a dtype")
        if any(x is not None for x in state[2:5]):
            raise InputError("has an array of records; plain numbers are needed")
        if state[1] in "<>":
            self.dtype = self.dtype.newbyteorder(state[1])


class ArrayInTheMaking:
    """A numpy array; shape, type and contents come with its state."""

    def __init__(self, *_: Any) -> None:
        self.shape: tuple[int, ...] | None = None
        self.dtype = np.dtype("f8")
        self.data: Any = b""
        self.order = "C"

    def fill(self, state: Any) -> None:
        """The state: (version,) shape, type, whether columns run fastest, and bytes or a list of objects."""
        if not (isinstance(state, tuple) and 4 <= len(state) <= 5):
            raise ValueError("the state of an array")
        shape, kind, columns, data = state[-4:]
        if not isinstance(kind, TypeInTheMaking):
            raise ValueError("the type of an array")
        self.shape, self.dtype, self.data = checked_shape(shape), kind.dtype, data
        self.order = "F" if columns else "C"

    def array(self, whole: Callable[[Any], Any]) -> NDArray[Any]:
        """The array; objects in it are finished by `whole`."""
        if self.shape is None:
            raise ValueError("an array without contents")
        if self.dtype.kind != "O":
            return from_bytes(self.data, self.dtype, self.shape, self.order)
        if type(self.data) is not list or len(self.data) != math.prod(self.shape):
            raise InputError(f"has an array of objects whose shape {self.shape} is not that of its contents")
        out = np.empty(len(self.data), dtype=object)
        for i, x in enumerate(self.data):
            out[i] = whole(x)
        return out.reshape(self.shape)  # objects are written row by row, whatever the order of the array


def plain_type(text: Any) -> np.dtype[Any]:
    """The dtype of numbers, truth values, texts or objects that a text stands for."""
    if isinstance(text, bytes):
        text = text.decode("latin-1")
    if not (isinstance(text, str) and TYPES.fullmatch(text)):
        said = repr(text[:40]) if isinstance(text, str) else f"a {type(text).__name__}"
        raise InputError(f"has an array of type {said}; numbers, texts and objects are admitted")
    return np.dtype(text.replace("O8", "O"))


def checked_shape(shape: Any) -> tuple[int, ...]:
    """A shape of whole numbers that are not negative."""
    sizes = (shape,) if type(shape) is int else shape
    if not isinstance(sizes, tuple) or len(sizes) > DIMENSIONS or any(type(n) is not int or n < 0 for n in sizes):
        raise InputError("has an array whose shape is none")
    return sizes


def from_bytes(data: Any, dtype: np.dtype[Any], shape: tuple[int, ...], order: str = "C") -> NDArray[Any]:
    """The array of that type and shape whose contents are `data`; `InputError` unless they fit exactly."""
    if not isinstance(data, str | bytes | bytearray):
        raise ValueError("the contents of an array")
    raw = data.encode("latin-1") if isinstance(data, str) else bytes(data)  # Python 2 wrote bytes as text
    if math.prod(shape) * dtype.itemsize != len(raw):
        need = f"{' x '.join(map(str, shape)) or 1} of {dtype.itemsize} bytes"
        raise InputError(f"has an array of {need} with {len(raw)} bytes of contents")
    if not dtype.itemsize:
        raise InputError("has an array of empty texts")
    return np.frombuffer(raw, dtype=dtype).reshape(shape, order=order)  # type: ignore[call-overload]


def _scalar(kind: Any, data: Any = b"") -> Any:
    if not isinstance(kind, TypeInTheMaking) or kind.dtype.kind == "O":
        raise InputError("has a numpy scalar that is no number or text")
    return from_bytes(data, kind.dtype, ()).item()


def _from_buffer(data: Any, kind: Any, shape: Any, order: Any, *_: Any) -> NDArray[Any]:
    if not isinstance(kind, TypeInTheMaking) or kind.dtype.kind == "O" or order not in ("C", "F"):
        raise ValueError("the type of an array")
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
    if not isinstance(storage, np.ndarray) or type(offset) is not int or offset < 0 or len(sizes) != len(steps):
        raise ValueError("the parts of a tensor")
    count = math.prod(sizes)
    last = offset + sum((n - 1) * step for n, step in zip(sizes, steps, strict=True))
    if count and (count > len(storage) or last >= len(storage)):
        raise InputError(f"has a tensor of {' x '.join(map(str, sizes))} that is larger than its contents")
    if not count:
        return np.zeros(sizes, storage.dtype)
    strides = tuple(step * storage.itemsize for step in steps)
    return np.lib.stride_tricks.as_strided(storage[offset:], sizes, strides).copy()


def _complex(*parts: Any) -> complex:
    if not all(isinstance(x, int | float) for x in parts):
        raise ValueError("the parts of a complex number")
    return complex(*parts)


def _collection(kind: type) -> Callable[..., Any]:
    def made(*values: Any) -> Any:
        if len(values) > 1 or not all(isinstance(v, list | tuple) for v in values):
            raise ValueError(f"the contents of a {kind.__name__}")
        return kind(hashed(x) for x in values[0]) if values else kind()

    return made


def hashed(key: Any) -> Any:
    """A key, or an element of a set: a number or a text.

    The hash of a deep tuple would exhaust the stack, that of one whose parts are shared would never end, and the
    hashes of large whole numbers can be made all the same.
    """
    if not isinstance(key, KEYS) or (isinstance(key, int) and abs(key) > LARGEST_KEY):
        raise ValueError(f"a {type(key).__name__} is a key")
    return key


def _ordered(*pairs: Any) -> dict[Any, Any]:
    """An ordered dictionary comes empty, or, from Python 2, as a list of pairs."""
    if len(pairs) != 1 or type(pairs[0]) is not list:
        return {}
    if not all(isinstance(p, list | tuple) and len(p) == 2 for p in pairs[0]):
        raise ValueError("the contents of a dictionary")
    return {hashed(key): value for key, value in pairs[0]}


BUILDERS: dict[str, Callable[..., Any]] = {
    "_reconstruct": ArrayInTheMaking,
    "dtype": TypeInTheMaking,
    "scalar": _scalar,
    "_frombuffer": _from_buffer,
    "encode": _encoded,
    "bytearray": _bytes,
    "bytes": lambda: b"",  # what older protocols make of empty ones
    "set": _collection(set),
    "frozenset": _collection(frozenset),
    "complex": _complex,
    "OrderedDict": _ordered,
    "Size": lambda sizes: checked_shape(sizes),
    "_rebuild_tensor": _tensor,
    "_rebuild_tensor_v2": _tensor,
    "_rebuild_parameter": lambda tensor, *_: tensor,
}
