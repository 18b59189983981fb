"""Opens a dataset by its kind; folders and JSON lines of grasp files are read here, tables of postures beside."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.datasets.dataset_rows import DatasetRow, FaultyRow, GraspDataset, file_identity, printable
from handfast.datasets.posture_tables import PackedPostures, ParquetPostures

LONGEST = 16 << 20  # [bytes] of a row: nothing of ours comes near, and memory has an end
BLOCK = 1 << 20  # [bytes] read at a time
BESIDE = (".jsonl.about.json", ".summary.json")  # how files of labels end that are no grasp files,
IMPORT = "import.json"
IN_THE_MAKING = (".jsonl.parts", ".parquet.parts")  # and folders that have such files


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

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        found = [str(f.relative_to(path)) for f in path.rglob("*.json") if f.is_file()]
        found = [f for f in found if not _of_labels(f)]
        named = [f for f in found if f.endswith(".grasp.json") or Path(f).name.startswith("grasp-")]
        self.files = sorted(named or found)
        self.sources = {k: v for file in path.rglob(IMPORT) for k, v in _published(file, path).items()}
        if not self.files:
            raise InputError("has no grasp files (.json) in it or below", source=str(path))

    @property
    def count(self) -> int:
        return len(self.files)

    def identity(self) -> dict[str, Any]:
        digest = hashlib.sha256()
        for file in self.files:
            digest.update(file.encode("utf-8", "surrogateescape") + b"\0")
            digest.update(repr(_content(self.path / file)).encode("utf-8", "backslashreplace") + b"\0")
        return {"kind": "grasp files", "rows": self.count, "sha256 of names and contents": digest.hexdigest()}

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
        if file.stat().st_size > LONGEST:
            return FaultyRow(f"is larger than {LONGEST >> 20} MiB")
        return file.read_text("utf-8")
    except OSError as fault:
        return FaultyRow(f"cannot be read: {fault.strerror}")
    except UnicodeDecodeError:
        return FaultyRow("is no text in UTF-8")


def _of_labels(file: str) -> bool:
    """Is it a file that a table of labels has beside it? The table may be in the folder that it is about."""
    *folders, name = Path(file).parts
    return name.endswith(BESIDE) or any(folder.endswith(IN_THE_MAKING) for folder in folders)


class GraspLines(GraspDataset):
    """JSON lines, a grasp file in each."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        lines, last = 0, b"\n"
        with open(path, "rb") as stream:
            while block := stream.read(BLOCK):
                lines, last = lines + block.count(b"\n"), block
        self._count = lines + (not last.endswith(b"\n"))
        if not self._count:
            raise InputError("is empty; a grasp file in each line is needed", source=str(path))

    @property
    def count(self) -> int:
        return self._count

    def identity(self) -> dict[str, Any]:
        return {"kind": "JSON lines", "rows": self.count} | file_identity(self.path)

    def items(self) -> Iterator[bytes | None]:
        """Lines; None for one that is too long."""
        with open(self.path, "rb") as stream:
            while line := stream.readline(LONGEST):
                if len(line) < LONGEST or line.endswith(b"\n"):
                    yield line
                    continue
                while (rest := stream.readline(LONGEST)) and not rest.endswith(b"\n"):
                    pass
                yield None

    def row(self, number: int, item: bytes | None) -> DatasetRow:
        name = f"line {number + 1}"
        if item is None:
            return DatasetRow(number, name, FaultyRow(f"is longer than {LONGEST >> 20} MiB"))
        if not item.strip():
            return DatasetRow(number, name, FaultyRow("is empty; a grasp file in each line is needed"))
        try:
            return DatasetRow(number, name, item.decode("utf-8").rstrip(), unnamed=True)
        except UnicodeDecodeError:
            return DatasetRow(number, name, FaultyRow("is no text in UTF-8"))
