"""Triangle meshes from files: OBJ, STL, PLY and OFF by trimesh within limits, others by the reader of their format."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.core.libraries import deferred_interrupt
from handfast.core.limited import limited
from handfast.model.mesh_pieces import checked_mesh
from handfast.model.shape import Mesh
from handfast.readers import registry

POINTER = b"version https://git-lfs"  # how a file begins that stands for one in Git LFS
MESH_FILES = registry.MESHES.keys()  # endings, those of formats that were added among them


def read_mesh(path: Path) -> list[Mesh]:
    """The groups of a mesh file as (vertices (n, 3), faces (k, 3)), file units, duplicates merged.

    An OBJ file has one group per `o` or `g`, an Inventor or VRML file one per shape; other formats have one. It is
    read within the limits of `limited`.

    Raises:
        InputError: no such file, a format that is not in `MESH_FILES`, unreadable, no triangles, corners that are no
            vertices, NaN vertices, more memory or time than it may take.
    """
    return read_meshes([path])[path]


def read_meshes(paths: Iterable[Path], *, empty: bool = False) -> dict[Path, list[Mesh]]:
    """As `read_mesh`, of several files, which takes less time than one by one; `empty` files are [] if they may be."""
    files = list(dict.fromkeys(paths))
    found: dict[Path, list[Mesh]] = {}
    for path in files:
        if registry.ending(path) not in registry.MESHES:
            known = ", ".join(registry.MESHES)
            raise InputError(f"is no mesh file that can be read; known: {known}; convert it to one", source=str(path))
        if not os.path.isfile(path):
            raise InputError("no such file", source=str(path))
        _refuse_pointer(path)
        read = registry.reader(registry.MESHES, registry.ending(path))
        if read is not read_by_trimesh:
            found[path] = read(path)
    found |= _by_trimesh([path for path in files if path not in found])
    for path, meshes in found.items():
        if not (meshes or empty):
            raise InputError("has no triangles", source=str(path))
    return found


def read_by_trimesh(path: Path) -> list[Mesh]:
    """The groups of one file that trimesh reads."""
    return _by_trimesh([path])[path]


def _by_trimesh(files: list[Path]) -> dict[Path, list[Mesh]]:
    if not files:
        return {}
    with deferred_interrupt():
        import trimesh  # noqa: F401, slow to import: once, here, and not in each process that reads

    try:
        return dict(zip(files, limited(_loaded, files), strict=True))
    except InputError as fault:
        if fault.source:
            raise
        if len(files) == 1:
            raise fault.at(str(files[0])) from None
    return {path: groups for one in files for path, groups in _by_trimesh([one]).items()}  # each has the whole limits


def _loaded(files: list[Path]) -> list[list[Mesh]]:
    """The groups of files that trimesh reads."""
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it tells of faults at length, and then raises them
    return [_loaded_one(trimesh, path) for path in files]


def _loaded_one(trimesh: Any, path: Path) -> list[Mesh]:
    obj = path.suffix.lower() == ".obj"
    split = ("split_object", "split_objects", "split_groups")  # trimesh 4 and 5 name them differently
    options: dict[str, Any] = dict.fromkeys(split, True) | {"group_material": False} if obj else {}
    if obj:
        _refuse_zero(path)
    try:
        with np.errstate(all="ignore"):
            scene: Any = trimesh.load(path, force="scene", process=False, skip_materials=True, **options)
        meshes = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh) and len(g.faces)]
        found = [(np.asarray(m.vertices, dtype=float), np.asarray(m.faces, dtype=np.int64)) for m in meshes]
    except MemoryError:
        raise
    except Exception as fault:  # whatever a library makes of bytes that are no mesh
        reason = " ".join([type(fault).__name__, *str(fault).splitlines()[:1]])
        raise InputError(f"cannot be read as a mesh ({reason})", source=str(path)) from None
    return [checked_mesh(v, f, str(path)) for v, f in found]


def _refuse_pointer(path: Path) -> None:
    """`InputError` for a file that Git LFS has not fetched."""
    with open(path, "rb") as file:
        if file.read(len(POINTER)) == POINTER:
            problem = "is a Git LFS pointer, not the file itself; `git lfs pull` in its repository fetches it"
            raise InputError(problem, source=str(path))


def _refuse_zero(path: Path) -> None:
    """`InputError` for a face of an OBJ file with vertex 0: they are counted from 1, and trimesh takes the last one."""
    with open(path, "rb") as lines:
        for number, line in enumerate(lines, 1):
            if line.startswith(b"f") and any(_is_zero(word) for word in line.split()[1:]):
                raise InputError(f"has a face with vertex 0 in line {number}; vertices count from 1", source=str(path))


def _is_zero(word: bytes) -> bool:
    """Whether a corner, such as 3, -1 or 3/1/2, is vertex 0."""
    index = word.partition(b"/")[0]
    return index.isdigit() and not index.strip(b"0")
