"""What an import writes: a folder of configurations, grasps and objects with `import.json`, or one table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from handfast.core.bundled import relative_path
from handfast.core.errors import InputError
from handfast.core.files import refuse_existing, write_bytes, write_text
from handfast.core.libraries import optional
from handfast.datasets.published.importing import FoundObject, ImportedGrasp
from handfast.model.grasp import Grasp
from handfast.model.provenance import Provenance, SourceFile
from handfast.readers.configuration_file import save_configuration
from handfast.readers.grasp_file import save_grasp

IMPORT_SUMMARY, SCHEMA = "import.json", "handfast/import/1"
IMPORT_FILES = "{:05d}.configuration.json", "{:05d}.grasp.json"
IMPORT_TABLE_ENDINGS = (".csv", ".jsonl", ".parquet")


def refuse_target(path: Path, force: bool) -> None:
    """`InputError` for what cannot be written, before the work: an import that is there, a table that exists."""
    if path.suffix.lower() in IMPORT_TABLE_ENDINGS:
        refuse_existing(path, force=force)
        if path.suffix.lower() == ".parquet":
            _pandas(path)
    elif path.exists() and not path.is_dir():
        problem = f"is a file; a folder, or a table that ends in {', '.join(IMPORT_TABLE_ENDINGS)}, is needed"
        raise InputError(problem, source=str(path))
    elif (path / IMPORT_SUMMARY).exists() and not force:
        raise InputError("holds an import already; give --force to write over it", source=str(path))


def write_folder(path: Path, rows: Sequence[ImportedGrasp], about: dict[str, Any], friction: float | None) -> None:
    """Two files a grasp, `objects/` with a body file for each object and scale and its meshes, `import.json` last.

    The folder can be moved: its files name each other by relative paths, and meshes are copied. Hands, and objects that
    are no meshes, stay where they are.

    Args:
        about: of the whole import, for `import.json`.
        friction: of the body files.
    """
    for file in [
        path / IMPORT_SUMMARY,
        *(f for name in IMPORT_FILES for f in path.glob(name.format(0).replace("00000", "[0-9]*"))),
    ]:
        file.unlink(missing_ok=True)  # of an earlier import, which may have had more grasps
    entries: list[dict[str, Any]] = []
    objects = _ObjectFiles(path, about.get("mass"), friction)
    for row in rows:
        entry = row.to_json()
        if row.configuration is not None:
            body = None if row.object is None else objects.file(row.object, row.scale)
            named = {"object": row.configuration.object if body is None else _seen_from(path, body)}
            named["hand"] = _seen_from(path, row.configuration.hand) if row.configuration.hand else None
            number = sum("configuration_file" in e for e in entries)
            name, grasp = (file.format(number) for file in IMPORT_FILES)
            save_configuration(row.configuration.model_copy(update=named), path / name, force=True)
            entry["configuration_file"] = name
            if row.grasp is not None:
                save_grasp(_sourced(row.grasp, body, path / name, about.get("mass")), path / grasp, force=True)
                entry["grasp_file"] = grasp
        entries.append(entry)
    text = json.dumps({"schema": SCHEMA, **about, "rows": entries}, indent=1) + "\n"
    write_text(path / IMPORT_SUMMARY, text, force=True)


def _seen_from(folder: Path, name: str) -> str:
    """A file's path relative to a folder, with a "/" in it; what is no file stays."""
    file, mark, part = name.partition("#")
    if not Path(file).is_file():
        return name
    relative = relative_path(file, folder)
    return (relative if "/" in relative else f"./{relative}") + mark + part


def _sourced(grasp: Grasp, body: str | None, path: Path, mass: float | None) -> Grasp:
    """With the files that were written: configuration and object; and the mass that was said."""
    came = (grasp.provenance or Provenance()).with_configuration(path)
    if body:
        came = replace(came, object=SourceFile.of(body, "object"))
    return grasp.about(provenance=came, mass=mass)


@dataclass
class _ObjectFiles:
    """The body files of a folder, and the meshes that they name; each is written once.

    Attributes:
        path: of the folder. mass [kg], friction: of the objects.
    """

    path: Path
    mass: float | None
    friction: float | None
    _bodies: dict[tuple[tuple[Path, ...], float], str] = field(default_factory=dict)
    _meshes: dict[tuple[Path, ...], list[str]] = field(default_factory=dict)  # from `objects/`
    _taken: set[str] = field(default_factory=set)

    def file(self, found: FoundObject, scale: float) -> str:
        """The body file of an object at a scale."""
        if found.states_its_size:
            return str(found.meshes[0])
        key = found.meshes, scale
        if key not in self._bodies:
            body = found.body_file(self._copied(found), scale, self.mass, self.friction)
            text = json.dumps(body.model_dump(by_alias=True, exclude_none=True, exclude_defaults=True), indent=1)
            text = json.dumps({"schema": "handfast/body/1"} | json.loads(text), indent=1) + "\n"
            file = self.path / "objects" / f"{self._free(f'{found.name}-{scale:g}')}.json"
            write_text(file, text, force=True)
            self._bodies[key] = str(file)
        return self._bodies[key]

    def _copied(self, found: FoundObject) -> list[str]:
        """The object's meshes in a folder of their own."""
        if found.meshes not in self._meshes:
            folder = self._free(found.name)
            for mesh in found.meshes:
                write_bytes(self.path / "objects" / folder / mesh.name, mesh.read_bytes(), force=True)
            self._meshes[found.meshes] = [f"{folder}/{mesh.name}" for mesh in found.meshes]
        return self._meshes[found.meshes]

    def _free(self, name: str) -> str:
        """A name that a file can have and no other has."""
        plain = "".join(c if c.isalnum() or c in "-_." else "-" for c in name)
        names = (plain if k == 0 else f"{plain}_{k}" for k in count())
        free = next(n for n in names if n not in self._taken)
        self._taken.add(free)
        return free


def write_table(path: Path, rows: Sequence[ImportedGrasp], *, force: bool = False) -> None:
    """One row a grasp: as JSON, a line each, or flat, with a column for each number; Parquet through pandas.

    Raises:
        InputError: the file exists and `force` is not set; Parquet without pandas and pyarrow.
    """
    entries = [_entry(row) for row in rows]
    ending = path.suffix.lower()
    if ending == ".jsonl":
        write_text(path, "".join(json.dumps(e) + "\n" for e in entries), force=force)
        return
    flat = [dict(_flat(e)) for e in entries]
    columns = list(dict.fromkeys(name for e in flat for name in e))
    if ending == ".csv":
        out = io.StringIO()
        writer = csv.DictWriter(out, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)
        write_text(path, out.getvalue(), force=force)
        return
    pandas = _pandas(path)
    packed = io.BytesIO()
    pandas.DataFrame(flat, columns=columns).to_parquet(packed)
    write_bytes(path, packed.getvalue(), force=force)


def _entry(row: ImportedGrasp) -> dict[str, Any]:
    """A row with its configuration and contacts."""
    entry = row.to_json()
    if row.configuration is not None:
        entry["joints"] = row.configuration.joints
        entry["object_pose"] = row.configuration.object_pose.model_dump()
    if row.grasp is not None:
        entry["contact_list"] = [
            {"position": c.position.tolist(), "normal": c.normal.tolist(), "friction": c.friction, "link": c.link}
            for c in row.grasp.contacts
        ]
    return entry


def _flat(entry: Any, prefix: str = "") -> list[tuple[str, Any]]:
    """Columns `a.b.0`; contacts stay one column of JSON, as their number differs."""
    found: list[tuple[str, Any]] = []
    items = entry.items() if isinstance(entry, dict) else enumerate(entry)
    for key, value in items:
        name = f"{prefix}{key}"
        if key in ("contact_list", "gaps_closed", "gaps_left"):
            found.append((name, json.dumps(value)))
        elif isinstance(value, dict | list | tuple):
            found += _flat(value, f"{name}.")
        else:
            found.append((name, value))
    return found


def _pandas(path: Path) -> Any:
    problem = "needs pandas and pyarrow, which are not installed; a .csv or .jsonl needs neither"
    optional("pyarrow", problem, path)
    return optional("pandas", problem, path)
