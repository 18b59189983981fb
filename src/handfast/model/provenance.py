"""Where a grasp came from: the files of its hand, its object and its configuration, by path and checksum."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path

from handfast.core import bundled
from handfast.core.bundled import relative_path
from handfast.core.errors import InputError, require_positive
from handfast.core.schema import LEFT_OUT, InFiles

SOURCE_FOLDERS = {"hand": "hands", "object": "objects", "configuration": "configurations"}


@dataclass(frozen=True)
class SourceFile(InFiles):
    """A file that something was read from.

    Attributes:
        path: of the file, or a bundled name; of a hand that is part of a robot, the file and "#LINK"; of an object
            that is a folder of meshes, the folder.
        sha256: of the file's bytes alone, not of further files that it names; of a folder, of a line "SHA-256 NAME" for
            each file in it, by name; None where the source is no file.
        scale: metres per unit, of a mesh file.
    """

    path: str
    sha256: str | None = None
    scale: float = field(default=1.0, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        if not self.path:
            raise InputError("is empty; the name of a file is needed", field="path")
        if self.sha256 is not None and not re.fullmatch("[0-9a-f]{64}", self.sha256):
            raise InputError("is no SHA-256 checksum; 64 digits 0 to 9 and a to f are needed", field="sha256")
        require_positive(self.scale, "scale", "metres per unit are needed, more than 0")

    @classmethod
    def of(cls, source: str | Path, kind: str, scale: float = 1.0) -> SourceFile | None:
        """The file behind a path or bundled name as it is now; None if nothing was named.

        Raises:
            InputError: the file cannot be read.
        """
        if not str(source):
            return None
        file = _file(str(source), kind)
        if file is None:
            return cls(str(source), None, scale)
        path = str(source) if _bundled(str(source), kind) else os.path.realpath(file) + _part(str(source))
        return cls(path, _digest(file), scale)

    def fault(self, kind: str) -> str:
        """Why the file cannot be taken for the one that was read; '' if it can."""
        if self.sha256 is None:
            return f"the {kind} '{self.path}' came from no file, so that nothing tells whether it is the same"
        file = _file(self.path, kind)
        if file is None:
            return f"the {kind}'s file {self.path} is not there"
        try:
            found = _digest(file)
        except InputError as fault:
            return str(fault)
        if found != self.sha256:
            return f"the {kind}'s file {self.path} has changed: its checksum is another"
        return ""


@dataclass(frozen=True)
class Provenance(InFiles):
    """Where a grasp came from. What is not known is None.

    Attributes:
        hand: a URDF or MJCF file, or a bundled hand.
        object: a mesh or body file, or a bundled object.
        configuration: the joint values and the object's pose in the hand.
    """

    hand: SourceFile | None = field(default=None, metadata=LEFT_OUT)
    object: SourceFile | None = field(default=None, metadata=LEFT_OUT)
    configuration: SourceFile | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        for kind, part in (("hand", self.hand), ("configuration", self.configuration)):
            if part and part.scale != 1:
                raise InputError("is of objects alone; leave it out", field=f"{kind}.scale")

    def __bool__(self) -> bool:
        return any(self.parts())

    def parts(self) -> Iterable[SourceFile | None]:
        """Hand, object, configuration."""
        return (getattr(self, f.name) for f in fields(self))

    def with_configuration(self, path: str | Path) -> Provenance:
        """The same with a configuration file, as it is now."""
        return replace(self, configuration=SourceFile.of(path, "configuration"))

    def faults(self) -> list[str]:
        """Why hand and object cannot be shown as they were, a line each; none if they can."""
        missing = [k for k in SOURCE_FOLDERS if getattr(self, k) is None]
        if missing:
            return [f"the grasp file does not say which {' and '.join(missing)} it came from"]
        found = (getattr(self, kind).fault(kind) for kind in SOURCE_FOLDERS)
        return [line for line in found if line]

    def relative_to(self, folder: str | Path) -> Provenance:
        """With paths as they stand in a file in `folder`."""
        at = Path(folder).resolve()
        return self._changed(lambda kind, part, file, link: replace(part, path=relative_path(file, at) + link))

    def resolved_from(self, folder: str | Path) -> Provenance:
        """With the paths of a file in `folder`, absolute.

        The folder may have been moved alone. A file that is not where it should be is looked for below the folders
        above, and where the configuration names it: taken is what has the checksum.
        """
        at = Path(folder).resolve()

        def one(kind: str, part: SourceFile, file: str, link: str) -> SourceFile:
            path = Path(os.path.normpath(at / file))
            if not os.path.lexists(path):
                inside = file.removeprefix("../" * file.count("../"))
                others = [*(above / inside for above in at.parents), *self._named_by_configuration(at, kind)]
                path = next((f for f in others if _is(f, kind, part.sha256)), path)
            return replace(part, path=f"{path}{link}")

        return self._changed(one)

    def _named_by_configuration(self, folder: Path, kind: str) -> list[Path]:
        """The file of a kind that the configuration file in a folder names, if it names one."""
        if self.configuration:
            with suppress(OSError, ValueError, AttributeError):  # it is gone, or broken: said where it is read
                name = json.loads((folder / self.configuration.path).read_text("utf-8")).get(kind)
                if isinstance(name, str):
                    return [Path(os.path.normpath(folder / name.removesuffix(_part(name))))]
        return []

    def _changed(self, one: Callable[[str, SourceFile, str, str], SourceFile]) -> Provenance:
        """Every part by its kind, path and the link after it; bundled names, and what is no file, stay."""

        def changed(kind: str) -> SourceFile | None:
            part: SourceFile | None = getattr(self, kind)
            if part is None or part.sha256 is None or _bundled(part.path, kind):
                return part
            link = _part(part.path)
            return one(kind, part, part.path.removesuffix(link), link)

        return Provenance(**{kind: changed(kind) for kind in SOURCE_FOLDERS})


@lru_cache(maxsize=256)
def _bundled(source: str, kind: str) -> str | None:
    """The file behind a bundled name, None if it is none."""
    return bundled.resolve(SOURCE_FOLDERS[kind], source) if source in bundled.names(SOURCE_FOLDERS[kind]) else None


def _part(source: str) -> str:
    """What a name says beside a file: "#LINK", the part of a robot that is the hand; '' if it says nothing."""
    file, mark, link = source.rpartition("#")
    return mark + link if file and not os.path.isfile(source) and "/" not in link else ""


def _file(source: str, kind: str) -> Path | None:
    """The file behind a path, maybe of a part of it, or a bundled name; None if there is none."""
    file = _bundled(source, kind) or source.removesuffix(_part(source))
    there = os.path.isfile(file) or (kind == "object" and os.path.isdir(file))  # False, too, for what can be no name
    return Path(file) if there else None


def _is(file: Path, kind: str, sha256: str | None) -> bool:
    """Whether a file, or an object's folder, is there and has a checksum."""
    if not (file.is_file() or (kind == "object" and file.is_dir())):
        return False
    with suppress(OSError, InputError):
        return _digest(file) == sha256
    return False


def _digest(file: Path) -> str:
    if file.is_dir():
        inside = sorted(f for f in file.iterdir() if f.is_file())
        return hashlib.sha256("".join(f"{_digest(f)} {f.name}\n" for f in inside).encode()).hexdigest()
    status = file.stat()
    return _digest_of(str(file), status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=256)
def _digest_of(file: str, _changed: int, _size: int) -> str:
    """SHA-256 of a file's bytes, read once for each time that it was written."""
    try:
        with Path(file).open("rb") as data:
            return hashlib.file_digest(data, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=file) from None
