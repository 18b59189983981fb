"""A dataset of grasps as a stream of rows."""

from __future__ import annotations

import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from handfast.datasets.dataset_rows import DatasetRow, LabelPart


class GraspDataset(ABC):
    """Rows in an order of their own, read as they are needed.

    Attributes:
        path: file or folder.
        posed: are rows postures, which need a hand and an object?
    """

    posed = False

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    @abstractmethod
    def count(self) -> int:
        """How many rows."""

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """What tells whether it is still the same dataset; JSON."""

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
