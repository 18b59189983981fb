"""One door for datasets: the reader by the kind of the file."""

from __future__ import annotations

from pathlib import Path

from handfast.core.errors import InputError
from handfast.datasets.datasets import GraspDataset
from handfast.datasets.grasp_datasets import GraspFiles, GraspLines
from handfast.datasets.posture_tables import PackedPostures, ParquetPostures


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
