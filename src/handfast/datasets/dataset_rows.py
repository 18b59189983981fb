"""Datasets of grasps as streams of rows: a grasp file's text, or a hand's joints and its object's pose.

Rows travel to the workers as they are; who uses them looks at their numbers.
"""

from __future__ import annotations

import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from handfast.core.arrays import Array
from handfast.core.errors import require_not_negative, require_positive
from handfast.core.schema import InFiles
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import from_dict


@dataclass(frozen=True)
class FaultyRow:
    """A row that could not even be read, and why."""

    reason: str


@dataclass(frozen=True, eq=False)
class PosedRow:
    """A row of a table of postures; numbers are looked at by who uses them.

    Attributes:
        joints: (l,) in the hand's order, or by name.
        position, quaternion: (3,) [m] and (4,) w, x, y, z of the object in the hand's base frame.
        preload: (a,) in the order of the hand's motors, or by name; None where the row says nothing.
        mass, friction: of this row; None where it says nothing.
    """

    joints: Array | dict[str, float]
    position: Array
    quaternion: Array
    preload: Array | dict[str, float] | None = None
    mass: float | None = None
    friction: float | None = None


@dataclass(frozen=True, eq=False)
class DatasetRow:
    """One row.

    Attributes:
        number: in the dataset, from 0.
        name: of the grasp.
        content: the text of a grasp file, a posture, or why there is neither.
        unnamed: is the name nobody's, so that the grasp's own is better?
        source: where it is from: FILE#INDEX of a published set, or a file of the dataset; "" if nothing says it.
    """

    number: int
    name: str
    content: str | PosedRow | FaultyRow
    unnamed: bool = False
    source: str = ""


@dataclass(frozen=True, eq=False)
class LabelPart:
    """Rows that follow each other and are labelled in one task.

    Attributes:
        rows: one or more.
        seconds: after which the task ends with the row in hand; what is left is another part.
    """

    rows: tuple[DatasetRow, ...]
    seconds: float = float("inf")

    @property
    def first(self) -> int:
        """The number of its first row."""
        return self.rows[0].number


class GraspDataset(ABC):
    """Rows in an order of their own, read as they are needed.

    Attributes:
        kind: of dataset, as files call it.
        posed: are rows postures, which need a hand and an object?
        path: file or folder. count: how many rows.
    """

    kind: ClassVar[str]
    posed = False
    count: int

    def __init__(self, path: Path) -> None:
        self.path = path

    def identity(self) -> dict[str, Any]:
        """What tells whether it is still the same dataset; JSON."""
        return {"kind": self.kind, "rows": self.count} | file_identity(self.path)

    @abstractmethod
    def items(self) -> Iterator[Any]:
        """What rows are made of, one by one, at the least cost."""

    @abstractmethod
    def row(self, number: int, item: Any) -> DatasetRow:
        """The row of an item; what is wrong with it is its content."""

    def parts(self, size: int, done: Iterable[range] = ()) -> Iterator[LabelPart]:
        """Rows that follow each other, at most `size` at a time, but for those that are done: ranges in order."""
        known = iter(done)
        skipped, rows = next(known, None), list[DatasetRow]()
        for number, item in enumerate(self.items()):
            while skipped and number >= skipped.stop:
                skipped = next(known, None)
            if skipped is None or number not in skipped:
                rows.append(self.row(number, item))
                if len(rows) < size:
                    continue
            if rows:
                yield LabelPart(tuple(rows))
                rows = []
        if rows:
            yield LabelPart(tuple(rows))


def file_identity(path: Path) -> dict[str, Any]:
    """SHA-256 of the whole file: that is read at a gigabyte a second, and labels take far longer."""
    with open(path, "rb") as stream:
        return {"bytes": os.fstat(stream.fileno()).st_size, "sha256": hashlib.file_digest(stream, "sha256").hexdigest()}


def printable(name: str) -> str:
    """A name that every file of text can hold."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


@dataclass(frozen=True)
class GraspChanges(InFiles):
    """What takes the place of what the rows say, if they say anything.

    Attributes:
        mass: [kg]. center_of_mass: (3,) [m], object frame. friction: at every contact. preload: actuator -> command.
    """

    mass: float | None = None
    center_of_mass: tuple[float, float, float] | None = None
    friction: float | None = None
    preload: dict[str, float] | None = None

    def __post_init__(self) -> None:
        if self.mass is not None:
            require_positive(self.mass, "mass", "a mass above 0 [kg] is needed")
        if self.friction is not None:
            require_not_negative(self.friction, "friction", "a friction coefficient is 0 or more")

    def changed(self, grasp: Grasp) -> Grasp:
        """The grasp with these; raises `InputError` as `Grasp` does."""
        if self.friction is not None:
            grasp = grasp.with_friction(self.friction)
        if self.preload is not None:
            grasp = grasp.with_preload(self.preload)
        if self.mass is not None or self.center_of_mass is not None:
            grasp = grasp.about(mass=self.mass, center_of_mass=self.center_of_mass)
        return grasp


def grasp_of_text(text: str, name: str, changes: GraspChanges) -> Grasp:
    """The grasp in the text of a grasp file; raises `InputError`."""
    from handfast.core.files import parse_json

    return changes.changed(from_dict(parse_json(text), name=name))
