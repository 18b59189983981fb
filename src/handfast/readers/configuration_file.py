"""Configurations in files: `handfast/configuration/1`, the worlds of other programs, and those behind grasps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import read_named, validate, write_text
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.model.provenance import Provenance
from handfast.readers import registry
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand


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
    return read_named("configurations", path, "configuration", _of_json)


def _of_json(data: Any, file: Path) -> Configuration:
    said = validate(Configuration, data)
    return said.model_copy(update={key: _seen_from(file.parent, getattr(said, key)) for key in ("hand", "object")})


def _seen_from(folder: Path, name: str | None) -> str | None:
    file, mark, part = (name or "").partition("#")
    beside = folder / file
    return str(beside) + mark + part if "/" in file and beside.is_file() else name


def save_configuration(configuration: Configuration, path: str | Path, *, force: bool = False) -> None:
    """Write a configuration file; `InputError` if it exists, unless `force`, or cannot be written."""
    write_text(path, configuration.dumped(), force=force)


@dataclass(frozen=True, eq=False)
class GraspParts:
    """Hand and object behind a grasp, and where they are.

    Attributes:
        q: (l,) joints of the hand [rad, m]. pose: (4, 4) of the object in the hand's base frame.
        files: the hand's and the object's.
    """

    hand: Hand
    q: Array
    body: Body
    pose: Array
    files: tuple[str, str]


def load_hand_of(grasp: Grasp) -> Hand:
    """The hand of a grasp as its provenance names it.

    Raises:
        InputError: it names none, or its file is gone, has changed or cannot be read.
    """
    came = grasp.provenance.hand if grasp.provenance else None
    fault = came.fault("hand") if came else "the grasp file does not say which hand it came from"
    if came is None or fault:
        raise InputError(f"the hand is not known: {fault}", source=grasp.name, field="provenance")
    return load_hand(came.path)


def load_parts(grasp: Grasp, right: str = "") -> GraspParts:
    """Hand, object and configuration as the grasp's provenance names them.

    Args:
        right: what would be right, for the message.

    Raises:
        InputError: it names none, they are gone or have changed, or cannot be read.
    """
    came = grasp.provenance or Provenance()
    faults = came.faults()
    if faults or not (came.hand and came.object and came.configuration):
        problem = f"hand and object are not known: {'; '.join(faults)}{right and f'; {right}'}"
        raise InputError(problem, source=grasp.name, field="provenance")
    placed = load_configuration(came.configuration.path)
    hand, q = placed.applied(load_hand(came.hand.path))
    body = load_body(came.object.path, scale=came.object.scale)
    return GraspParts(hand, q, body, placed.pose, (came.hand.path, came.object.path))
