"""Reading and writing files: strict JSON in, whole files out, every fault one clear line."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from holdfast.errors import InputError

SAME = 1e-9  # relative, or absolute below 1: two numbers that say the same


class Strict(BaseModel):
    """Base of every file format: unknown fields, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)


T = TypeVar("T", bound=BaseModel)


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


def write_text(path: str | Path, text: str, *, force: bool) -> None:
    """Write a whole file or nothing; raises `InputError` if it exists and `force` is not set."""
    write_bytes(path, text.encode("utf-8"), force=force)


def write_bytes(path: str | Path, data: bytes, *, force: bool) -> None:
    """Write a whole file or nothing; raises `InputError` if it exists and `force` is not set."""
    target = Path(path)
    if target.exists() and not force:
        raise InputError("exists already; give --force to write over it", source=str(path))
    part = target.with_name(target.name + ".part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        part.replace(target)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        raise InputError(f"cannot be written: {error.strerror}", source=str(path)) from None


def parse_json(text: str) -> Any:
    """Parsed JSON; NaN and infinity are refused like any other fault."""

    def refuse(constant: str) -> Any:
        raise InputError(f"contains {constant}; finite numbers are needed")

    try:
        return json.loads(text, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise InputError(f"is not valid JSON: {error.msg} (line {error.lineno}, column {error.colno})") from None


def validate(model: type[T], data: Any) -> T:
    """Data as a pydantic model; the first fault becomes an `InputError` with its field."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        field = ""
        for part in first["loc"]:
            field += f"[{part}]" if isinstance(part, int) else f".{part}" if field else str(part)
        if first["type"] == "extra_forbidden":
            raise InputError("is not a known field; leave it out", field=field) from None
        if first["type"] == "missing":
            raise InputError("is missing", field=field) from None
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(message[0].lower() + message[1:], field=field or None) from None


def same_json(a: Any, b: Any) -> bool:
    """Equal JSON, numbers within `SAME`, absolute or relative."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same_json(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same_json(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= SAME * max(1.0, abs(a))
    return bool(a == b)
