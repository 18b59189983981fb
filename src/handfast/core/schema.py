"""Dataclasses that are their own file format: read by `core.files.validate`, written by `written`.

    @dataclass(frozen=True, eq=False)
    class Contact(InFiles):
        position: Vector3
        normal: Vector3
        friction: float
        torsion: float = field(default=0.0, metadata=LEFT_OUT)

        def __post_init__(self) -> None: ...  # what a number has to be; raises InputError with the field

    validate(Contact, {"position": [0, 0, 0.1], "normal": [0, 0, 1], "friction": 0.5})  # a Contact
    written(contact)  # the same JSON again

The names, types and defaults of the fields are those of the file; unknown fields are refused. What a value has to be
beyond its type is checked once, in `__post_init__`, for files and for programs. A pydantic model (`core.files.Strict`)
may have such classes as fields, and is for what a file holds that no class is. pydantic, slow to import, is
imported when the first file is read.
"""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np

from handfast.core.arrays import Array


class InFiles:
    """Base of dataclasses that stand in files: fields that they do not have are errors."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}


# metadata of a field that `written` leaves out where it has its default, and of one of several numbers, some of which
# may be infinite and are null then
LEFT_OUT, OPEN_FIELD = {"written": "left out"}, {"written": "open"}


class Numbers:
    """How an array stands in a file: lists of finite numbers of a shape, None for any length.

    `Annotated[Array, Numbers(None, 3)]` is a list of points.
    """

    def __init__(self, *shape: int | None) -> None:
        self.shape = shape

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> Any:
        from pydantic_core import core_schema as core

        lists: Any = core.float_schema(allow_inf_nan=False)
        for n in reversed(self.shape):
            lists = core.list_schema(lists) if n is None else core.tuple_schema([lists] * n)
        array = core.plain_serializer_function_ser_schema(np.ndarray.tolist)
        return core.no_info_after_validator_function(lambda x: np.array(x, dtype=float), lists, serialization=array)


class NullFor:
    """A number that a file gives as null where it is `value`, an infinity: `Annotated[float, NullFor(inf)]`.

    The field has the metadata `OPEN_FIELD`.
    """

    def __init__(self, value: float) -> None:
        self.value = value

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> Any:
        from pydantic_core import core_schema as core

        number = core.nullable_schema(core.float_schema(allow_inf_nan=False))
        return core.no_info_after_validator_function(lambda x: self.value if x is None else x, number)


Vector3 = Annotated[Array, Numbers(3)]
Vectors3 = Annotated[Array, Numbers(None, 3)]


def written(value: Any) -> Any:
    """JSON of a value: dataclasses as objects of their fields, arrays as lists, names of an enumeration as texts."""
    if isinstance(value, str | float | int | None) and not isinstance(value, Enum | np.generic):
        return value
    if is_dataclass(value) and not isinstance(value, type):
        told = ((name, getattr(value, name), how, default) for name, how, default in _fields_of(type(value)))
        kept = ((name, x, how) for name, x, how, default in told if how != "left out" or x != default)
        ends = ((name, [None if math.isinf(e) else e for e in x] if how == "open" else x) for name, x, how in kept)
        return {name: written(x) for name, x in ends}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return str(value)
    if isinstance(value, dict):
        return {name: written(x) for name, x in value.items()}
    if isinstance(value, list | tuple):
        return [written(x) for x in value]
    return value


@lru_cache(maxsize=256)
def _fields_of(kind: Any) -> tuple[tuple[str, Any, Any], ...]:
    """Of each field of a dataclass: its name, how it is written, and its default."""
    return tuple((f.name, f.metadata.get("written"), f.default) for f in fields(kind))
