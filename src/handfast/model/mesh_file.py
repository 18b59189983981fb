"""Triangle meshes from files: Inventor and VRML by our own reader, other formats by trimesh within limits."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.interrupts import deferred_interrupt
from handfast.core.limited import limited
from handfast.model.inventor import Group, read_inventor
from handfast.model.shape import Faces

INVENTOR_FILES = (".iv", ".wrl")
MESH_FILES = (".obj", ".stl", ".ply", ".off", *INVENTOR_FILES)


def read_mesh(path: Path) -> list[Group]:
    """The groups of a mesh file as (vertices (n, 3), faces (k, 3)), file units, duplicates merged.

    An OBJ file has one group per `o` or `g`, an Inventor or VRML file one per shape; other formats have one. It is
    read within the limits of `limited`.

    Raises:
        InputError: no such file, a format that is not in `MESH_FILES`, unreadable, no triangles, corners that are no
            vertices, NaN vertices, more memory or time than it may take.
    """
    return read_meshes([path])[path]


def read_meshes(paths: Iterable[Path]) -> dict[Path, list[Group]]:
    """As `read_mesh`, of several files, which takes less time than one by one."""
    files = list(dict.fromkeys(paths))
    for path in files:
        if path.suffix.lower() not in MESH_FILES:
            raise InputError(f"is not a mesh file; known: {', '.join(MESH_FILES)}", source=str(path))
        if not os.path.isfile(path):
            raise InputError("no such file", source=str(path))
    own = [path for path in files if path.suffix.lower() in INVENTOR_FILES]
    return {path: read_inventor(path) for path in own} | _by_trimesh([path for path in files if path not in own])


def _by_trimesh(files: list[Path]) -> dict[Path, list[Group]]:
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


def _loaded(files: list[Path]) -> list[list[Group]]:
    """The groups of files that trimesh reads."""
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it tells of faults at length, and then raises them
    return [_loaded_one(trimesh, path) for path in files]


def _loaded_one(trimesh: Any, path: Path) -> list[Group]:
    obj = path.suffix.lower() == ".obj"
    split = ("split_object", "split_objects", "split_groups")  # trimesh 4 and 5 name them differently
    options: dict[str, Any] = dict.fromkeys(split, True) | {"group_material": False} if obj else {}
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
    if not found:
        raise InputError("has no triangles", source=str(path))
    return [checked_mesh(v, f, str(path)) for v, f in found]


def checked_mesh(v: Array, f: Faces, source: str) -> tuple[Array, Faces]:
    """Vertices (n, 3) and faces (k, 3) with duplicates merged; `InputError` if they are no triangle mesh."""
    if v.ndim != 2 or v.shape[1] != 3:
        raise InputError(f"has vertices of {v.shape[-1]} coordinates; three are needed", source=source)
    if f.ndim != 2 or f.shape[1] != 3 or f.min() < 0 or f.max() >= len(v):
        raise InputError(f"has a triangle with a corner that is none of its {len(v)} vertices", source=source)
    if not np.isfinite(v).all():
        raise InputError("has a vertex that is NaN or infinite", source=source)
    unique, inverse = np.unique(v, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[f]
