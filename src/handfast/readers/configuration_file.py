"""Configurations in files: `handfast/configuration/1`, and the worlds of other programs."""

from __future__ import annotations

from pathlib import Path

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.core.files import read_json, validate, write_text
from handfast.model.configuration import Configuration
from handfast.readers import registry


def load_configuration(path: str | Path) -> Configuration:
    """Read a configuration file, or a bundled one by name, or the configuration in a GraspIt! world.

    A hand or an object that is named by a relative path with a "/" is looked for from the file's folder first; what is
    not there stays as it is named.

    Of a world (XML), hand and object are named by their files. `world.xml#Barrett,mug` chooses among several; a robot
    that carries another, an arm, is not the hand. Obstacles are left out.

    Raises:
        InputError: no such file, not JSON, or the first field that is wrong. One line, naming the file.
    """
    name, _, chosen = str(path).partition("#")
    read = registry.reader(registry.CONFIGURATIONS, registry.ending(Path(name)))
    if read:
        found: Configuration = read(Path(name), tuple(filter(None, chosen.split(","))))
        return found
    file = bundled.resolve("configurations", str(path))
    data = read_json(file, "configuration")
    try:
        read_file = validate(Configuration, data)
    except InputError as fault:
        raise fault.at(str(path)) from None
    named = {key: _seen_from(Path(file).parent, getattr(read_file, key)) for key in ("hand", "object")}
    return read_file.model_copy(update=named)


def _seen_from(folder: Path, name: str | None) -> str | None:
    file, mark, part = (name or "").partition("#")
    beside = folder / file
    return str(beside) + mark + part if "/" in file and beside.is_file() else name


def save_configuration(configuration: Configuration, path: str | Path, *, force: bool = False) -> None:
    """Write a configuration file; `InputError` if it exists, unless `force`, or cannot be written."""
    write_text(path, configuration.dumped(), force=force)
