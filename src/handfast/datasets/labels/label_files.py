"""Tables of labels on disk: Parquet, or JSON lines where there is no pyarrow. Whole or not at all, row after row."""

from __future__ import annotations

import io
import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import read_json, whole_file
from handfast.datasets.labels.label_columns import COLUMNS, NAMES

GROUP = 20_000  # rows of a table that are in memory at a time
KEY = "handfast"  # of the metadata


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
    def read(self, path: Path, columns: tuple[str, ...] = NAMES) -> Iterator[list[dict[str, Any]]]:
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

    def read(self, path: Path, columns: tuple[str, ...] = NAMES) -> Iterator[list[dict[str, Any]]]:
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
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            problem = "needs pyarrow: pip install 'handfast[label]'; a table in .jsonl needs nothing"
            raise InputError(problem) from None
        self.arrow, self.parquet = pyarrow, parquet

    def _schema(self, about: Mapping[str, Any] | None = None) -> Any:
        a = self.arrow
        number, text = a.float64(), a.string()
        kinds = {"integer": a.int64(), "number": number, "text": text, "numbers": a.list_(number)}
        kinds |= {"texts": a.list_(text), "points": a.list_(a.list_(number))}
        fields = [a.field(c.name, kinds[c.kind], metadata={"unit": c.unit, "about": c.about}) for c in COLUMNS]
        return a.schema(fields, metadata={KEY: json.dumps(about)} if about is not None else None)

    def packed(self, rows: list[dict[str, Any]]) -> bytes:
        out = io.BytesIO()
        self.parquet.write_table(self.arrow.Table.from_pylist(rows, schema=self._schema()), out, compression="zstd")
        return out.getvalue()

    def read(self, path: Path, columns: tuple[str, ...] = NAMES) -> Iterator[list[dict[str, Any]]]:
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
    try:
        return format_named(path.suffix.lower())
    except InputError as fault:
        raise fault.at(str(path)) from None


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
