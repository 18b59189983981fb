"""Tables of labels on disk, Parquet, or JSON lines where there is no pyarrow: whole or not at all, row after row.

Beside a table in the making is a folder of its parts as they are done, with a manifest of what they belong to. A part
is never written twice. So a run that ended anyhow, by kill -9 or by a power cut, goes on with the parts that are
missing.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import read_json, same_json, whole_file
from handfast.core.libraries import optional
from handfast.datasets.labels.label_columns import COLUMN_NAMES, LABEL_COLUMNS
from handfast.datasets.scene_source import same_scene

GROUP = 20_000  # rows of a table that are in memory at a time
KEY = "handfast"  # of the metadata
MANIFEST, LOCK = "manifest.json", "lock"
PARTS_SCHEMA = "handfast/label-parts/1"
PART_NAME = re.compile(r"(\d{12})-(\d+)-[0-9a-f]{16}")  # of a part: its first row, how many rows, checksum
PER_FOLDER = 64_000  # rows: a folder with a million files is slow everywhere


class BrokenFile(Exception):
    """A file that is not what it was written as."""


class LabelFormat(ABC):
    """How rows become bytes and come back.

    Attributes:
        ending: of files.
    """

    ending: str

    @abstractmethod
    def packed(self, rows: list[dict[str, Any]]) -> bytes:
        """A part."""

    @abstractmethod
    def read(self, path: Path, columns: tuple[str, ...] = COLUMN_NAMES) -> Iterator[list[dict[str, Any]]]:
        """The rows of a part or table, many at a time; `BrokenFile` if it is damaged."""

    @abstractmethod
    def write(self, path: Path, parts: Iterable[Path], about: Mapping[str, Any]) -> None:
        """One table of all parts, and what it is about in its metadata."""

    @abstractmethod
    def about(self, path: Path) -> Any:
        """What a table is about, as it was written; None where nothing says it."""


class LinesFormat(LabelFormat):
    """JSON lines; what they are about is in a file beside them."""

    ending = ".jsonl"
    beside = ".about.json"

    def packed(self, rows: list[dict[str, Any]]) -> bytes:
        return "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode("utf-8")

    def read(self, path: Path, columns: tuple[str, ...] = COLUMN_NAMES) -> Iterator[list[dict[str, Any]]]:
        try:
            with open(path, encoding="utf-8") as stream:
                while lines := stream.readlines(1 << 20):
                    rows = map(json.loads, lines)
                    yield [{name: row[name] for name in columns} for row in rows]
        except (ValueError, KeyError) as fault:
            raise BrokenFile(str(fault)) from None

    def write(self, path: Path, parts: Iterable[Path], about: Mapping[str, Any]) -> None:
        def blocks() -> Iterator[bytes]:
            for part in parts:
                yield part.read_bytes()

        text = json.dumps(about, indent=1, allow_nan=False) + "\n"
        write_durably(path.with_name(path.name + self.beside), [text.encode()])
        write_durably(path, blocks())

    def about(self, path: Path) -> Any:
        file = path.with_name(path.name + self.beside)
        return read_json(file, "metadata") if file.exists() else None


class ParquetFormat(LabelFormat):
    """Parquet, by pyarrow. `InputError` if that is not installed."""

    ending = ".parquet"

    def __init__(self) -> None:
        problem = "needs pyarrow: pip install 'handfast[label]'; a table in .jsonl needs nothing"
        self.arrow, self.parquet = (optional(name, problem) for name in ("pyarrow", "pyarrow.parquet"))

    def _schema(self, about: Mapping[str, Any] | None = None) -> Any:
        a = self.arrow
        number, text = a.float64(), a.string()
        kinds = {"integer": a.int64(), "number": number, "text": text, "numbers": a.list_(number)}
        kinds |= {"texts": a.list_(text), "points": a.list_(a.list_(number))}
        fields = [a.field(c.name, kinds[c.kind], metadata={"unit": c.unit, "about": c.about}) for c in LABEL_COLUMNS]
        return a.schema(fields, metadata={KEY: json.dumps(about)} if about is not None else None)

    def packed(self, rows: list[dict[str, Any]]) -> bytes:
        out = io.BytesIO()
        self.parquet.write_table(self.arrow.Table.from_pylist(rows, schema=self._schema()), out, compression="zstd")
        return out.getvalue()

    def read(self, path: Path, columns: tuple[str, ...] = COLUMN_NAMES) -> Iterator[list[dict[str, Any]]]:
        try:
            with self.parquet.ParquetFile(path) as file:
                for batch in file.iter_batches(GROUP, columns=list(columns)):
                    yield batch.to_pylist()
        except (self.arrow.ArrowException, OSError) as fault:
            raise BrokenFile(" ".join(str(fault).split())[:100]) from None

    def write(self, path: Path, parts: Iterable[Path], about: Mapping[str, Any]) -> None:
        schema = self._schema(about)
        with (
            whole_file(path, durably=True) as target,
            open(target, "wb") as stream,
            self.parquet.ParquetWriter(stream, schema, compression="zstd") as writer,
        ):
            held, rows = [], 0
            for part in parts:
                held.append(self.parquet.read_table(part, partitioning=None))
                rows += held[-1].num_rows
                if rows >= GROUP:
                    writer.write_table(self.arrow.concat_tables(held).cast(schema), GROUP)
                    held, rows = [], 0
            if held:
                writer.write_table(self.arrow.concat_tables(held).cast(schema), GROUP)

    def about(self, path: Path) -> Any:
        try:
            found = (self.parquet.read_schema(path).metadata or {}).get(KEY.encode())
        except (self.arrow.ArrowException, OSError) as fault:
            raise InputError(f"is no Parquet file ({' '.join(str(fault).split())[:80]})", source=str(path)) from None
        return None if found is None else json.loads(found)


def format_of(path: Path) -> LabelFormat:
    """By a file's ending; `InputError` for another one, or without what it needs."""
    with FaultsOf(path):
        return format_named(path.suffix.lower())


def format_named(ending: str) -> LabelFormat:
    """As `format_of`."""
    match ending:
        case ".parquet":
            return ParquetFormat()
        case ".jsonl":
            return LinesFormat()
    raise InputError("a name that ends in .parquet or .jsonl is needed")


def load_labels(path: str | Path) -> Iterator[dict[str, Any]]:
    """The rows of a table of labels, one by one, as `label_columns` describes them.

    Raises:
        InputError: no such file, or no table of labels. One line, naming the file.
    """
    where = Path(path)
    if not where.is_file():
        raise InputError("no such file; a table of labels is needed", source=str(path))
    try:
        for rows in format_of(where).read(where):
            yield from rows
    except BrokenFile as fault:
        raise InputError(f"is no table of labels ({fault})", source=str(path)) from None


def write_durably(path: Path, blocks: Iterable[bytes]) -> None:
    """A whole file or none, also if the power fails: written beside its place, synced, and renamed."""
    with whole_file(path, durably=True) as target, open(target, "wb") as stream:
        stream.writelines(blocks)


# --- the parts of a table in the making -------------------------------------------------------------


class PartFolder:
    """A context: within it no other run fills the folder.

    Args:
        output: of the whole table; the folder is its name with `.parts`.
        manifest: of the dataset and what is asked; JSON.
        rows: in the dataset.
    """

    def __init__(self, output: Path, format: LabelFormat, manifest: dict[str, Any], rows: int) -> None:
        self.path, self.format, self.rows = folder_of(output), format, rows
        self.manifest: dict[str, Any] = {"schema": PARTS_SCHEMA, "rows": rows} | manifest
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
            found = PART_NAME.fullmatch(file.name.removesuffix(self.format.ending))
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
