"""Files of published grasps: recognised by their keys, read by processes with limits of memory and time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError, unknown_name
from handfast.core.files import read_json
from handfast.core.limited import CPU_SECONDS, EXTRA_MEMORY, limited
from handfast.datasets.published.array_file import read_array_file
from handfast.datasets.published.layouts import LAYOUTS, PublishedLayout
from handfast.datasets.published.recorded import BrokenRow, RecordedGrasp

ENDINGS = (".npy", ".npz", ".pt", ".pth", ".pkl", ".pickle", ".json", ".yaml", ".yml")
BATCH_FILES, BYTES = 200, 1 << 24  # files, and [bytes] of them, that one process reads
MEMORY_A_BYTE, SECONDS_A_BYTE = 20, 4e-6  # that reading a file may take beyond the usual limits


def published_files(paths: Sequence[Path]) -> list[Path]:
    """Files as they are, folders as what is in them and below that can hold published grasps, in order.

    JSON has too many other uses to be taken from a folder.
    """
    found: list[Path] = []
    for path in paths:
        inside = path.rglob("*") if path.is_dir() else ()
        files = sorted(f for f in inside if f.suffix.lower() in ENDINGS and f.suffix.lower() != ".json" and f.is_file())
        if path.is_dir() and not files:
            raise InputError("has no files of published grasps in it or below", source=str(path))
        found += files or [path]
    return found


@dataclass(frozen=True)
class Source:
    """A row of a published file.

    Attributes:
        file: its path. layout: one of `LAYOUTS`; "" where the file could not be read.
        row: the grasp, or why it cannot be read.
    """

    file: str
    layout: str
    row: RecordedGrasp | BrokenRow


def sources(files: Sequence[str | Path], layout: str | None = None, count: int | None = None) -> Iterator[Source]:
    """The rows of files; one that cannot be read raises `InputError` if it is the only one, else it is one row.

    Args:
        layout: one of `LAYOUTS`, in place of what the files' keys say.
        count: the first so many rows only.
    """
    left = count
    for together in _batches([Path(f) for f in files]):
        for file, found in zip(together, _read(together, layout, left), strict=True):
            if isinstance(found, InputError):
                if len(files) == 1:
                    raise found
                found = layout or "", [BrokenRow(0, str(found))]
            name, rows = found
            for row in rows[:left]:
                yield Source(str(file), name, row)
            left = None if left is None else left - len(rows[:left])
        if left == 0:
            return


def read_published(
    path: str | Path, layout: str | None = None, count: int | None = None
) -> tuple[str, list[RecordedGrasp | BrokenRow]]:
    """The name of a file's layout, and its grasps; a broken one is a `BrokenRow`.

    The file is read by a process of its own, with limits of memory and time that grow with its size.

    Args:
        path: `.npy`, `.npz`, `.pt`, `.pth`, `.pkl`, `.json` or `.yaml`.
        layout: one of `LAYOUTS`, in place of what the keys say.
        count: the first so many grasps only.

    Raises:
        InputError: no such file, another kind of file, data that no layout has, a pickle that names what is no plain
            data, keys that are missing for the layout, too much memory or time. One line, naming the file.
    """
    (found,) = _read([Path(path)], layout, count)
    if isinstance(found, InputError):
        raise found
    return found


Found = tuple[str, list[RecordedGrasp | BrokenRow]] | InputError  # of a file


def _batches(files: list[Path]) -> Iterator[list[Path]]:
    """Files that are read together: a process takes some milliseconds to begin."""
    batch, size = list[Path](), 0
    for file in files:
        own = _size(file)
        if batch and (len(batch) >= BATCH_FILES or size + own > BYTES):
            yield batch
            batch, size = [], 0
        batch, size = [*batch, file], size + own
    if batch:
        yield batch


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def _read(files: list[Path], layout: str | None, count: int | None) -> list[Found]:
    """What is in files, or what is wrong with each, read by a process with limits; one by one if it met them."""
    if layout is not None and layout not in LAYOUTS:
        raise unknown_name("layout", layout, LAYOUTS, field="--layout")
    size = sum(map(_size, files))
    memory, seconds = EXTRA_MEMORY + MEMORY_A_BYTE * size, CPU_SECONDS + int(SECONDS_A_BYTE * size)
    try:
        return limited(_read_here, files, layout, count, memory=memory, seconds=seconds)
    except InputError as fault:
        if len(files) > 1:
            return [_read([file], layout, count)[0] for file in files]
        return [fault.at(str(files[0]))]


def _read_here(files: list[Path], layout: str | None, count: int | None) -> list[Found]:
    return [_rows(file, layout, count) for file in files]


def _rows(file: Path, layout: str | None, count: int | None) -> Found:
    try:
        data = _data(file)
        name = layout or next((known for known in LAYOUTS if _recognised(LAYOUTS[known], data)), None)
        if name is None:
            problem = f"is of no known layout: it holds {_described(data)}; give --layout if you know better"
            return InputError(problem, source=str(file))
        return name, list(islice(LAYOUTS[name].read(data, _stem(file)), count))
    except InputError as fault:
        return fault.at(str(file))
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        right = f"{layout}; {LAYOUTS[layout].keys} is needed" if layout else "that its keys are of"
        return InputError(f"does not fit the layout {right}", source=str(file))


def _recognised(layout: PublishedLayout, data: Any) -> bool:
    """Whether data are of a layout; what a test of the keys stumbles over is not."""
    try:
        return layout.recognises(data)
    except (TypeError, ValueError, LookupError, AttributeError):
        return False


def _stem(path: Path) -> str:
    """The file's name without its endings; a dot in an object's own name stays."""
    name = path.name
    for ending in (*ENDINGS, ".dexgrasp"):
        name = name.removesuffix(ending)
    return name


def _data(path: Path) -> Any:
    if not path.is_file():
        raise InputError("no such file; a file of published grasps is needed")
    match path.suffix.lower():
        case ".json":
            return read_json(path, "published grasps")
        case ".yaml" | ".yml":
            return read_yaml(path)
        case ending if ending in ENDINGS:
            return read_array_file(path)
    raise InputError(f"ends in '{path.suffix}'; known are {', '.join(ENDINGS)}")


def read_yaml(path: Path) -> Any:
    """Plain YAML: no tags beyond the standard ones, no references, which could grow without end.

    Raises:
        InputError: PyYAML is not installed, or the file is no such YAML.
    """
    try:
        import yaml
    except ImportError:
        raise InputError("is YAML, which needs PyYAML: pip install 'handfast[published]'") from None

    class PlainLoader(yaml.SafeLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise InputError("has a reference (*name); write it out")
            return super().compose_node(parent, index)

    try:
        return yaml.load(path.read_text("utf-8"), PlainLoader)
    except yaml.YAMLError as fault:
        raise InputError(f"is no plain YAML: {' '.join(str(fault).split())[:120]}") from None
    except (UnicodeDecodeError, RecursionError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        raise InputError("is no plain YAML: no text, or nested too deeply") from None


def _described(data: Any) -> str:
    """What data are, for someone who has to find out why they are not recognised."""
    if isinstance(data, dict):
        keys = [str(k) for k in list(data)[:6]]
        return f"a dictionary with {', '.join(keys) or 'nothing'}{', ...' if len(data) > 6 else ''}"
    shape = getattr(data, "shape", None)
    return f"a {type(data).__name__}" + (f" of shape {shape}" if shape is not None else "")
