"""A body file that says of an object what a command line said: its scale, mass and friction."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.core.files import write_text
from handfast.model.body_file import BodyFile, MeshFile, ShapeFile, read_body_file
from handfast.model.mesh_file import MESH_FILES


def save_body_copy(
    source: str | Path,
    target: str | Path,
    *,
    scale: float = 1.0,
    mass: float | None = None,
    friction: float | None = None,
    center_of_mass: Sequence[float] | None = None,
    force: bool = False,
) -> None:
    """Write a `handfast/body/1` file about the object of another file; meshes are referred to, not copied.

    Args:
        source: a mesh or body file, or a bundled name.
        scale: metres per unit of a mesh file. mass: [kg]. friction: coefficient.
        center_of_mass: (3,) [m] in the object's frame. What is None stays as it is.

    Raises:
        InputError: the source is neither a mesh nor a body file; the target exists, unless `force`.
    """
    path, folder = Path(bundled.resolve("objects", str(source))), Path(target).parent

    def seen_from_target(file: str | Path) -> str:
        return Path(os.path.relpath(file, folder)).as_posix()

    if path.suffix.lower() in MESH_FILES:
        body = BodyFile(
            schema="handfast/body/1",
            name=path.stem,
            shapes=[ShapeFile(mesh=MeshFile(file=seen_from_target(path), scale=scale))],
        )
    elif path.suffix.lower() == ".json":
        body = read_body_file(path)
        shapes = [
            s.model_copy(
                update={"mesh": s.mesh.model_copy(update={"file": seen_from_target(path.parent / s.mesh.file)})}
            )
            if s.mesh
            else s
            for s in body.shapes
        ]
        mesh = seen_from_target(path.parent / body.mesh) if body.mesh else None
        body = body.model_copy(update={"name": body.name or path.stem, "shapes": shapes, "mesh": mesh})
    else:
        raise InputError(
            "is neither a mesh nor a body file; write a body file that says mass and scale", source=str(path)
        )
    given = {"mass": mass, "friction": friction, "center_of_mass": center_of_mass}
    body = body.model_copy(update={name: value for name, value in given.items() if value is not None})
    text = body.model_dump_json(by_alias=True, exclude_defaults=False, exclude_none=True, indent=1)
    write_text(target, text + "\n", force=force)
