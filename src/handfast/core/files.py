"""Reading and writing files: strict JSON in, whole files out, every fault one clear line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from handfast.core import bundled
from handfast.core.errors import FaultsOf, InputError
from handfast.proofs import strict_json

NUMBER_TOLERANCE = 1e-9  # relative, or absolute below 1: two numbers that say the same

ANSWER = "an answer"
SCHEMA_KINDS = {  # schemas of files that are given where others are needed: what they are
    "handfast/body/1": "an object",
    "handfast/configuration/1": "a configuration (handfast contacts makes a grasp of it)",
    "handfast/grasp/1": "a grasp (handfast check asks about it)",
    "handfast/task/1": "a task (handfast grasp finds grasps for it)",
    "handfast/loads/1": "a file of loads",
    "handfast/hand-regions/1": "a file of regions",
    "handfast/result/1": ANSWER,
    "handfast/hold/1": ANSWER,
}


class Strict(BaseModel):
    """Base of every file format: unknown fields, NaN and infinity are errors, and so are texts and truth values
    where a number belongs (see `validate`)."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]

T = TypeVar("T")


def read_json(path: str | Path, kind: str) -> Any:
    """The parsed JSON of a file; `InputError` if it is missing, no text or not JSON."""
    try:
        return parse_json(Path(path).read_text("utf-8"))
    except InputError as error:
        raise error.at(str(path)) from None
    except FileNotFoundError:
        raise InputError(f"no such file; a {kind} file is needed", source=str(path)) from None
    except IsADirectoryError:
        raise InputError(f"is a folder; a {kind} file is needed", source=str(path)) from None
    except UnicodeDecodeError:
        raise InputError(f"is not a text file; a {kind} file is JSON", source=str(path)) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=str(path)) from None
    except ValueError:  # a NUL in the path
        raise InputError(f"is no name of a file; a {kind} file is needed", source=repr(str(path))) from None


def read_named(folder: str, source: str | Path, kind: str, make: Callable[[Any, Path], T]) -> T:
    """What `make` gives of the parsed JSON and the path of a file, or of what comes with the package by name.

    Args:
        folder: of what comes with the package, see `bundled`.
        kind: of file, in words.

    Raises:
        InputError: as `read_json` and `make`, naming the source.
    """
    file = Path(bundled.resolve(folder, str(source)))
    data = read_json(file, kind)
    with FaultsOf(source):
        return make(data, file)


def write_text(path: str | Path, text: str, *, force: bool) -> None:
    """Write a whole file or nothing; raises `InputError` if it exists and `force` is not set."""
    write_bytes(path, text.encode("utf-8"), force=force)


def write_bytes(path: str | Path, data: bytes, *, force: bool) -> None:
    """Write a whole file or nothing; raises `InputError` if it exists and `force` is not set."""
    refuse_existing(path, force=force)
    with whole_file(path) as part:
        part.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)


@contextmanager
def whole_file(path: str | Path, *, durably: bool = False) -> Iterator[Path]:
    """A file to fill, which takes the place of `path` if nothing is raised; `InputError` if it cannot be written.

    Args:
        durably: it is whole or not there at all also if the power fails.
    """
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        yield part
        if durably:
            with open(part, "rb+") as stream:
                os.fsync(stream.fileno())
        part.replace(target)
        if durably and hasattr(os, "O_DIRECTORY"):
            folder = os.open(target.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        raise InputError(f"cannot be written: {error.strerror or error}", source=str(path)) from None


def refuse_existing(path: str | Path, *, force: bool) -> None:
    """`InputError` for a file that would be written over, unless `force`; also before the work that fills it."""
    if Path(path).exists() and not force:
        raise InputError("exists already; give --force to write over it", source=str(path))


def parse_json(text: str) -> Any:
    """Parsed JSON, which any code may walk through and write again; `InputError` for what `strict_json` refuses."""
    try:
        return strict_json.parse(text)
    except strict_json.BadFile as fault:
        raise InputError(fault.problem) from None


def validate(model: type[T], data: Any) -> T:
    """JSON data as a pydantic model, or as a dataclass that is its own schema; the first fault becomes an `InputError`.

    Only JSON can be read strictly (a number is no text and no truth value) and still have lists for tuples.
    """
    try:
        checked: T = _adapter(model).validate_json(json.dumps(data), strict=True)  # type: ignore[arg-type]
        return checked
    except ValidationError as error:
        first = error.errors()[0]
        field = ""
        for part in first["loc"]:
            field += f"[{part}]" if isinstance(part, int) else f".{part}" if field else str(part)
        if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            raise InputError("is not a known field; leave it out", field=field) from None
        if first["type"] in ("missing", "missing_argument"):
            raise InputError("is missing", field=field) from None
        if first["type"] == "too_long":
            found, most = first["ctx"]["actual_length"] or "more", first["ctx"]["max_length"]
            raise InputError(f"has {found} entries; at most {most} are possible", field=field) from None
        raised = first.get("ctx", {}).get("error")
        if isinstance(raised, InputError):  # what a class says of its own numbers
            raise (raised.within(field) if field else raised) from None
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(message[0].lower() + message[1:], field=field or None) from None


@lru_cache(maxsize=256)
def _adapter(model: type[Any]) -> Any:
    return TypeAdapter(model)


def same_json(a: Any, b: Any) -> bool:
    """Equal JSON, numbers within `NUMBER_TOLERANCE`, absolute or relative."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same_json(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same_json(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= NUMBER_TOLERANCE * max(1.0, abs(a))
    return bool(a == b)
