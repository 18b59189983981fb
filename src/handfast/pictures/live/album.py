"""The grasps that a page leafs through: one, several, or the files of a folder, read when they are looked at."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import load_grasp

ENDING = "*.grasp.json"  # as the programs of this package name them
SCHEMA = "handfast/grasp/1"
HEAD = 4096  # bytes of a file in which its schema is looked for
Read = Callable[[], Grasp]


@dataclass(frozen=True)
class Album:
    """Names, and how to read each."""

    names: tuple[str, ...]
    reads: tuple[Read, ...]

    def __len__(self) -> int:
        return len(self.names)

    def read(self, number: int) -> Grasp:
        """One grasp; `InputError` as `load_grasp`."""
        return self.reads[number]()

    @classmethod
    def of(cls, source: Grasp | Sequence[Grasp] | str | Path) -> Album:
        """From grasps, a grasp file, the name of a bundled grasp, or a folder of grasp files.

        Raises:
            InputError: a folder without grasp files, no grasps, a file as `load_grasp`.
        """
        if isinstance(source, Grasp):
            return cls((source.name,), (lambda: source,))
        if isinstance(source, str | Path):
            path = Path(source)
            if path.is_dir():
                return cls.of_folder(path)
            grasp = load_grasp(source)  # its faults are told before there is a page
            return cls((grasp.name,), (lambda: grasp,))
        if not hasattr(source, "__iter__"):
            raise InputError(
                f"is of type {type(source).__name__}; grasps or the name of a file are needed", field="grasp"
            )
        grasps = list(source)
        if not grasps:
            raise InputError("is empty; at least one grasp is needed", field="grasps")
        for k, g in enumerate(grasps):
            if not isinstance(g, Grasp):
                raise InputError(f"is {type(g).__name__}; a grasp is needed", field=f"grasps[{k}]")
        return cls(tuple(g.name for g in grasps), tuple(partial(_same, g) for g in grasps))

    @classmethod
    def of_folder(cls, path: Path) -> Album:
        """The files that end in .grasp.json, or else all JSON files that are grasps; numbers in their order."""
        files = sorted(path.glob(ENDING), key=_natural)
        files = files or sorted((f for f in path.glob("*.json") if _is_grasp(f)), key=_natural)
        if not files:
            raise InputError(f"has no grasp files ({ENDING}, or JSON of {SCHEMA})", source=str(path))
        return cls(tuple(_label(f) for f in files), tuple(partial(load_grasp, f) for f in files))


def first_that_reads(album: Album) -> tuple[int, Grasp, list[str]]:
    """The number of the first grasp that can be read, the grasp, and what is wrong with those before it.

    Raises:
        InputError: none can be read; it is about the first.
    """
    faults: list[InputError] = []
    for number in range(len(album)):
        try:
            return number, album.read(number), [str(fault) for fault in faults]
        except InputError as fault:
            faults.append(fault)
    raise faults[0]


def _same(grasp: Grasp) -> Grasp:
    return grasp


def _natural(file: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]


def _label(file: Path) -> str:
    return file.name.removesuffix(".json").removesuffix(".grasp")


def _is_grasp(file: Path) -> bool:
    """Does its beginning name the schema? What else is wrong with it is told when it is read."""
    try:
        with file.open("rb") as f:
            return json.dumps(SCHEMA).encode() in f.read(HEAD)
    except OSError:
        return False
