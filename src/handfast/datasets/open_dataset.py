"""Opens a dataset by its kind: folders and JSON lines of grasp files, and tables of postures (.npz, Parquet).

Tables are read piece by piece:

joints             (n, l), or a column joints.NAME for each joint [rad, m]
object_position    (n, 3) [m], or object_pose.position.0 .. 2
object_quaternion  (n, 4) w, x, y, z, or object_pose.quaternion.0 .. 3; both in the hand's base frame
preload            (n, a), or preload.NAME [N m, N]; may be absent
mass, friction     (n,); may be absent
name               (n,); may be absent
"""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.core.libraries import optional
from handfast.datasets.dataset_rows import DatasetRow, FaultyRow, GraspDataset, PosedRow, printable

MAX_ROW_BYTES = 16 << 20  # [bytes] of a row: nothing of ours comes near, and memory has an end
READ_BYTES = 1 << 20  # [bytes] read at a time
COMPANION_ENDINGS = (".jsonl.about.json", ".summary.json")  # how files of labels end that are no grasp files,
IMPORT = "import.json"
IN_THE_MAKING = (".jsonl.parts", ".parquet.parts")  # and folders that have such files
READ_ROWS = 1024  # read at a time
MAX_NPY_HEADER = 10_000  # characters of an .npy header
POSE_COLUMNS = {"object_position": ("object_pose.position", 3), "object_quaternion": ("object_pose.quaternion", 4)}
NEEDED = ("joints", *POSE_COLUMNS)
OPTIONAL = ("preload", "mass", "friction", "name")
PUBLISHED = ("file", "index")  # of a row that `import` wrote
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, OSError)  # what an archive raises that was changed or cut
PARQUET = "needs pyarrow: pip install 'handfast[label]'"


def open_dataset(path: str | Path) -> GraspDataset:
    """The dataset in a folder or a file, by its kind.

    Raises:
        InputError: nothing is there, or nothing that is understood. One line, naming the file.
    """
    where = Path(path)
    try:
        if where.is_dir():
            return GraspFiles(where)
        if not where.exists():
            raise InputError("no such file; a folder, .jsonl, .parquet or .npz is needed", source=str(path))
        match where.suffix.lower():
            case ".jsonl" | ".ndjson":
                return GraspLines(where)
            case ".npz":
                return PackedPostures(where)
            case ".parquet":
                return ParquetPostures(where)
    except OSError as fault:
        raise InputError(f"cannot be read: {fault.strerror}", source=str(path)) from None
    known = "a folder or JSON lines (.jsonl) of grasp files, a table (.parquet, .npz) of postures"
    raise InputError(f"is of no kind that is known; {known} is needed", source=str(path))


class GraspFiles(GraspDataset):
    """A folder of grasp files, those below it included, in the order of their names: `*.grasp.json` and
    `grasp-*.json`, as our own commands call them, if there are any, else all `*.json`."""

    kind = "grasp files"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        found = [str(f.relative_to(path)) for f in path.rglob("*.json") if f.is_file()]
        found = [f for f in found if not _of_labels(f)]
        named = [f for f in found if f.endswith(".grasp.json") or Path(f).name.startswith("grasp-")]
        self.files = sorted(named or found)
        self.sources = {k: v for file in path.rglob(IMPORT) for k, v in _published(file, path).items()}
        self.count = len(self.files)
        if not self.files:
            raise InputError("has no grasp files (.json) in it or below", source=str(path))

    def identity(self) -> dict[str, Any]:
        digest = hashlib.sha256()
        for file in self.files:
            digest.update(file.encode("utf-8", "surrogateescape") + b"\0")
            digest.update(repr(_content(self.path / file)).encode("utf-8", "backslashreplace") + b"\0")
        return {"kind": self.kind, "rows": self.count, "sha256 of names and contents": digest.hexdigest()}

    def items(self) -> Iterator[str]:
        return iter(self.files)

    def row(self, number: int, item: str) -> DatasetRow:
        return DatasetRow(
            number, printable(item), _content(self.path / item), source=self.sources.get(item, printable(item))
        )


def _published(file: Path, dataset: Path) -> dict[str, str]:
    """FILE#INDEX of a published set by grasp file of the dataset, as an import says it; nothing if it is none."""
    try:
        found = read_json(file, "import")
        rows = [row for row in found["rows"] if "grasp_file" in row]
        return {
            str((file.parent / row["grasp_file"]).relative_to(dataset)): printable(f"{row['file']}#{row['index']}")
            for row in rows
        }
    except (InputError, LookupError, TypeError, ValueError):
        return {}


def _content(file: Path) -> str | FaultyRow:
    try:
        if file.stat().st_size > MAX_ROW_BYTES:
            return FaultyRow(f"is larger than {MAX_ROW_BYTES >> 20} MiB")
        return file.read_text("utf-8")
    except OSError as fault:
        return FaultyRow(f"cannot be read: {fault.strerror}")
    except UnicodeDecodeError:
        return FaultyRow("is no text in UTF-8")


def _of_labels(file: str) -> bool:
    """Is it a file that a table of labels has beside it? The table may be in the folder that it is about."""
    *folders, name = Path(file).parts
    return name.endswith(COMPANION_ENDINGS) or any(folder.endswith(IN_THE_MAKING) for folder in folders)


class GraspLines(GraspDataset):
    """JSON lines, a grasp file in each."""

    kind = "JSON lines"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        lines, last = 0, b"\n"
        with open(path, "rb") as stream:
            while block := stream.read(READ_BYTES):
                lines, last = lines + block.count(b"\n"), block
        self.count = lines + (not last.endswith(b"\n"))
        if not self.count:
            raise InputError("is empty; a grasp file in each line is needed", source=str(path))

    def items(self) -> Iterator[bytes | None]:
        """Lines; None for one that is too long."""
        with open(self.path, "rb") as stream:
            while line := stream.readline(MAX_ROW_BYTES):
                if len(line) < MAX_ROW_BYTES or line.endswith(b"\n"):
                    yield line
                    continue
                while (rest := stream.readline(MAX_ROW_BYTES)) and not rest.endswith(b"\n"):
                    pass
                yield None

    def row(self, number: int, item: bytes | None) -> DatasetRow:
        name = f"line {number + 1}"
        if item is None:
            return DatasetRow(number, name, FaultyRow(f"is longer than {MAX_ROW_BYTES >> 20} MiB"))
        if not item.strip():
            return DatasetRow(number, name, FaultyRow("is empty; a grasp file in each line is needed"))
        try:
            return DatasetRow(number, name, item.decode("utf-8").rstrip(), unnamed=True)
        except UnicodeDecodeError:
            return DatasetRow(number, name, FaultyRow("is no text in UTF-8"))


class PostureTable(GraspDataset):
    """Rows of a hand's joints and its object's pose."""

    posed = True

    def row(self, number: int, item: dict[str, Any]) -> DatasetRow:
        name = item.get("name")
        posed = PosedRow(
            item["joints"],
            item["object_position"],
            item["object_quaternion"],
            preload=item.get("preload"),
            mass=_single(item.get("mass")),
            friction=_single(item.get("friction")),
        )
        source = printable(f"{item['file']}#{item['index']}") if item.get("file") is not None else ""
        return DatasetRow(number, f"row {number}" if name is None else printable(str(name)), posed, source=source)


class PackedPostures(PostureTable):
    """An `.npz` archive of plain arrays; each is read a thousand rows at a time, and nothing is unpickled."""

    kind = "npz"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            with zipfile.ZipFile(path) as archive:
                keys = {n.removesuffix(".npy") for n in archive.namelist() if n.endswith(".npy")}
                self.keys = [key for key in (*NEEDED, *OPTIONAL) if key in keys]
                missing = [key for key in NEEDED if key not in keys]
                if missing:
                    raise InputError(f"is missing; it holds {', '.join(sorted(keys)) or 'nothing'}", field=missing[0])
                self.shapes = {}
                for key in self.keys:
                    with archive.open(f"{key}.npy") as stream:
                        self.shapes[key] = _header(stream, key)[0]
            lengths = {shape[0] if shape else 0 for shape in self.shapes.values()}
            if len(lengths) > 1:
                said = ", ".join(f"{key} {shape[0] if shape else 'none'}" for key, shape in self.shapes.items())
                raise InputError(f"its arrays are of different lengths: {said}")
            self.count = max(lengths)
            if self.count <= 0:
                raise InputError("has no rows")
        except InputError as fault:
            raise fault.at(str(path)) from None
        except (*DAMAGED, NotImplementedError, RuntimeError, ValueError) as fault:
            raise InputError(f"is no .npz archive ({' '.join(str(fault).split())[:80]})", source=str(path)) from None

    def items(self) -> Iterator[dict[str, Any]]:
        with ExitStack() as stack:
            archive = stack.enter_context(zipfile.ZipFile(self.path))
            streams = {key: stack.enter_context(archive.open(f"{key}.npy")) for key in self.keys}
            kinds = {key: _header(stream, key) for key, stream in streams.items()}
            for first in range(0, self.count, READ_ROWS):
                rows = min(READ_ROWS, self.count - first)
                block = {key: self._block(streams[key], key, kinds[key], rows) for key in self.keys}
                for k in range(rows):
                    yield {key: values[k] for key, values in block.items()}

    def _block(self, stream: Any, key: str, kind: tuple[tuple[int, ...], np.dtype[Any]], rows: int) -> Any:
        shape, dtype = kind
        size = rows * int(np.prod(shape[1:])) * dtype.itemsize
        try:
            data = stream.read(size)
        except DAMAGED as fault:
            problem = f"is damaged ({' '.join(str(fault).split())[:80]})"
            raise InputError(problem, source=str(self.path), field=key) from None
        if len(data) < size:
            raise InputError("ends too soon", source=str(self.path), field=key)
        return np.frombuffer(data, dtype).reshape(rows, *shape[1:])


def _header(stream: Any, key: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array; the stream stands at its first number then."""
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, columns, dtype = read(stream, max_header_size=MAX_NPY_HEADER)
    if dtype.kind not in ("U" if key == "name" else "fiu") or (columns and len(shape) > 1):
        need = "texts" if key == "name" else "numbers, row by row (C order)"
        raise InputError(f"is an array of {dtype}; {need} are needed", field=key)
    if len(shape) != (2 if key in (*NEEDED, "preload") else 1):
        raise InputError(f"has shape {shape}; a row for each grasp is needed", field=key)
    return shape, dtype


class ParquetPostures(PostureTable):
    """A Parquet table, such as `handfast import` writes, or with lists of numbers."""

    kind = "Parquet"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        pyarrow, parquet = (optional(name, PARQUET, path) for name in ("pyarrow", "pyarrow.parquet"))
        try:
            file = parquet.ParquetFile(path)
        except (pyarrow.ArrowException, OSError) as fault:
            problem = f"is no Parquet file ({' '.join(str(fault).split())[:80]})"
            raise InputError(problem, source=str(path)) from None
        with file:
            self.count, names = int(file.metadata.num_rows), file.schema_arrow.names
        if not self.count:
            raise InputError("has no rows", source=str(path))
        wanted = (*NEEDED, *OPTIONAL, *(PUBLISHED if {*PUBLISHED} <= {*names} else ()))
        self._taken = {key: columns for key in wanted if (columns := _columns(key, names))}
        for key in NEEDED:
            if key not in self._taken:
                problem = f"is missing; the columns are {', '.join(names[:8])}{', ...' if len(names) > 8 else ''}"
                raise InputError(problem, source=str(path), field=key)

    def items(self) -> Iterator[dict[str, Any]]:
        from pyarrow import ArrowException, parquet

        wanted = [name for columns in self._taken.values() for name in columns.values()]
        try:
            with parquet.ParquetFile(self.path) as file:
                for batch in file.iter_batches(READ_ROWS, columns=wanted):
                    yield from (self._item(row) for row in batch.to_pylist())
        except (ArrowException, OSError) as fault:
            raise InputError(f"is damaged ({' '.join(str(fault).split())[:80]})", source=str(self.path)) from None

    def _item(self, row: dict[str, Any]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, columns in self._taken.items():
            if key in columns:
                out[key] = row[columns[key]]
            elif key in POSE_COLUMNS:
                out[key] = [row[name] for name in columns.values()]
            else:
                out[key] = {part: np.nan if row[name] is None else row[name] for part, name in columns.items()}
        return out


def _columns(key: str, names: list[str]) -> dict[str, str]:
    """Where a value is: in a column of its own under its key, or each of its parts in one; empty if nowhere."""
    if key in names:
        return {key: key}
    if key in POSE_COLUMNS:
        stem, count = POSE_COLUMNS[key]
        parts = {str(k): f"{stem}.{k}" for k in range(count)}
        return parts if set(parts.values()) <= set(names) else {}
    return {n.removeprefix(f"{key}."): n for n in names if n.startswith(f"{key}.")}


def _single(value: Any) -> Any:
    """A number as a float, whatever type it is stored as; all else as it is, for the row to be refused."""
    if isinstance(value, int | float | np.number | Decimal) and not isinstance(value, bool):
        return float(value)
    return value
