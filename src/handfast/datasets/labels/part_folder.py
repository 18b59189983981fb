"""The folder beside a table in the making: its parts as they are done, and a manifest of what they belong to.

A part is there whole or not at all, and is never written twice. So a run that ended anyhow, by kill -9 or by a power
cut, goes on with the parts that are missing.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import read_json, same_json
from handfast.datasets.labels.label_files import LabelFormat, write_durably
from handfast.datasets.scene_source import same_scene

MANIFEST, LOCK = "manifest.json", "lock"
SCHEMA = "handfast/label-parts/1"
NAME = re.compile(r"(\d{12})-(\d+)-[0-9a-f]{16}")  # of a part: its first row, how many rows, checksum
PER_FOLDER = 64_000  # rows: a folder with a million files is slow everywhere


class PartFolder:
    """A context: within it no other run fills the folder.

    Args:
        output: of the whole table; the folder is its name with `.parts`.
        manifest: of the dataset and what is asked; JSON.
        rows: in the dataset.
    """

    def __init__(self, output: Path, format: LabelFormat, manifest: dict[str, Any], rows: int) -> None:
        self.path, self.format, self.rows = folder_of(output), format, rows
        self.manifest: dict[str, Any] = {"schema": SCHEMA, "rows": rows} | manifest
        self._lock: Any = None
        self._parts: dict[int, tuple[range, Path]] = {}  # by the first row

    @property
    def begun(self) -> bool:
        return (self.path / MANIFEST).exists()

    @property
    def foreign(self) -> bool:
        """Is there something in its place that no run has begun?"""
        if self.begun or not self.path.exists():
            return False
        return not self.path.is_dir() or not {f.name for f in self.path.iterdir()} <= {LOCK, f"{MANIFEST}.part"}

    def __enter__(self) -> PartFolder:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = open(self.path / LOCK, "w")
        except OSError as fault:
            raise InputError(f"cannot be written: {fault.strerror}", source=str(self.path)) from None
        with suppress(ImportError):
            import fcntl

            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # ends with the process, however that ends
            except OSError:
                self._lock.close()
                raise InputError("is being filled by another run", source=str(self.path)) from None
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        self._lock.close()
        if not self.begun:
            self.remove()

    def open(self, *, resume: bool) -> list[range]:
        """The rows that are done, in order; without `resume` none, and what was there is gone.

        Raises:
            InputError: the parts are of another dataset, or of other questions.
        """
        if self.begun and resume:
            known = read_json(self.path / MANIFEST, "manifest")
            for key, value in self.manifest.items():
                there: Any = known.get(key)
                if not (same_scene(there, value) if key == "scene" else same_json(there, value)):
                    problem = "is another than the parts were made with; give --force to begin anew"
                    raise InputError(problem, source=str(self.path / MANIFEST), field=key.replace("_", " "))
            return self._done()
        for entry in self.path.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry)
            elif entry.name != LOCK:
                entry.unlink()
        write_durably(self.path / MANIFEST, [json.dumps(self.manifest, indent=1).encode() + b"\n"])
        return []

    def _done(self) -> list[range]:
        """Parts that are as they were written; one that was damaged since is removed, to be made again."""
        self._parts, end = {}, 0
        for file in sorted(self.path.glob(f"*/*{self.format.ending}"), key=lambda f: f.name):
            found = NAME.fullmatch(file.name.removesuffix(self.format.ending))
            rows = range(int(found[1]), int(found[1]) + int(found[2])) if found else range(0)
            if rows and end <= rows.start and rows.stop <= self.rows and file == self.file(rows, file.read_bytes()):
                self._parts[rows.start], end = (rows, file), rows.stop
            else:
                file.unlink()
        return [rows for rows, _ in self._parts.values()]

    def file(self, rows: range, data: bytes) -> Path:
        """Where a part belongs: its rows and its checksum are its name."""
        known = hashlib.sha256(b"%d %d\0" % (rows.start, rows.stop) + data).hexdigest()[:16]
        name = f"{rows.start:012}-{len(rows)}-{known}{self.format.ending}"
        return self.path / f"{rows.start // PER_FOLDER:07}" / name

    def write(self, rows: range, data: bytes) -> None:
        """A part as it is packed, at once and for good."""
        file = self.file(rows, data)
        file.parent.mkdir(exist_ok=True)
        write_durably(file, [data])
        self._parts[rows.start] = rows, file

    def files(self) -> Iterator[Path]:
        """All parts in order."""
        return (file for _, (_, file) in sorted(self._parts.items()))

    def remove(self) -> None:
        """All of it, once the table is there."""
        shutil.rmtree(self.path, ignore_errors=True)


def folder_of(output: Path) -> Path:
    """Where the parts of a table are."""
    return output.with_name(output.name + ".parts")
