"""The `handfast/body/1` file: an object from primitive shapes and meshes, as pydantic models.

    {"schema": "handfast/body/1", "mass": 0.4, "friction": 0.6,
     "shapes": [{"box": {"size": [0.1, 0.06, 0.2]}, "pose": {"position": [0, 0, 0.1]}},
                {"mesh": {"file": "handle.obj", "scale": 0.001}}]}

`{"mesh": "mug.obj", ...}` in place of `shapes` is short for one mesh in metres.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from handfast.core import bundled
from handfast.core.bundled import relative_path
from handfast.core.errors import InputError
from handfast.core.files import Positive, Strict, Vector, read_json, validate, write_text
from handfast.model.configuration import PoseFile
from handfast.model.mesh_pieces import Solid, center_of_volume, pieces_of, solid_of
from handfast.model.shape import Kind, Shape
from handfast.readers.mesh_file import MESH_FILES, read_meshes
from handfast.readers.registry import ObjectParts

Sizes = tuple[Positive, Positive, Positive]
SOLID_FIELDS: tuple[Kind, ...] = ("box", "sphere", "capsule", "cylinder", "ellipsoid")  # fields of `ShapeFile`


class BoxEntry(Strict):
    """Full edge lengths [m]."""

    size: Sizes


class SphereEntry(Strict):
    """[m]."""

    radius: Positive


class RoundEntry(Strict):
    """A capsule (length without its caps) or cylinder along z [m]."""

    radius: Positive
    length: Positive


class EllipsoidEntry(Strict):
    """Semi-axes [m]."""

    semi_axes: Sizes


class MeshFile(Strict):
    """A mesh file relative to the JSON file; `scale` in metres per unit."""

    file: str
    scale: Positive = 1.0


class ShapeFile(Strict):
    """Exactly one solid, and where it stands in the object frame."""

    box: BoxEntry | None = None
    sphere: SphereEntry | None = None
    capsule: RoundEntry | None = None
    cylinder: RoundEntry | None = None
    ellipsoid: EllipsoidEntry | None = None
    mesh: MeshFile | None = None
    pose: PoseFile = PoseFile()

    @model_validator(mode="after")
    def _one(self) -> ShapeFile:
        kinds = [k for k in type(self).model_fields if k != "pose"]
        if sum(getattr(self, k) is not None for k in kinds) != 1:
            raise ValueError(f"exactly one of {', '.join(kinds)} is needed")
        return self


class BodyFile(Strict):
    """The whole file."""

    schema_: Literal["handfast/body/1"] = Field("handfast/body/1", alias="schema")
    name: str = ""
    shapes: list[ShapeFile] = Field(default_factory=list)
    mesh: str | None = None
    mass: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    center_of_mass: Vector | None = None
    friction: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None

    @model_validator(mode="after")
    def _something(self) -> BodyFile:
        if bool(self.shapes) == bool(self.mesh):
            raise ValueError("either shapes or a mesh is needed")
        return self

    def solids_in(self, folder: Path) -> list[Solid | Shape]:
        """Each shape, mesh files relative to `folder`."""
        solids: list[Solid | Shape] = []
        shapes = self.shapes or [ShapeFile(mesh=MeshFile(file=self.mesh or ""))]
        named = {i: s.mesh.file for i, s in enumerate(shapes) if s.mesh}
        files = {i: folder / name for i, name in named.items()}
        for i, file in files.items():
            if not os.path.isfile(file):  # False, too, for what can be no name
                raise InputError(f"mesh '{named[i]}' was not found in {folder}", field=f"shapes.{i}")
        meshes = read_meshes(files.values())
        for i, s in enumerate(shapes):
            pose = s.pose.matrix
            for kind in SOLID_FIELDS:
                if solid := getattr(s, kind):
                    sizes = np.hstack(list(solid.model_dump().values()))
                    solids.append(Shape(kind, sizes, pose, name=f"{kind}_{i}"))
            if s.mesh:
                solids.append(solid_of(meshes[files[i]], files[i].name, s.mesh.scale, pose))
        return solids


def read_body_file(path: Path) -> BodyFile:
    """The file, checked; `InputError` naming the first field that is wrong."""
    return validate(BodyFile, read_json(path, "mesh or handfast/body/1"))


def read_body(path: Path, _scale: float) -> ObjectParts:
    """The object of the file, which states its own units."""
    file = read_body_file(path)
    solids = file.solids_in(path.parent)
    center = center_of_volume(solids) if file.center_of_mass is None else file.center_of_mass
    return ObjectParts(file.name or path.stem, pieces_of(solids), file.mass, center, file.friction)


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

    if path.suffix.lower() in MESH_FILES:
        body = BodyFile(
            schema="handfast/body/1",
            name=path.stem,
            shapes=[ShapeFile(mesh=MeshFile(file=relative_path(path, folder), scale=scale))],
        )
    elif path.suffix.lower() == ".json":
        body = read_body_file(path)
        shapes = [
            s.model_copy(
                update={"mesh": s.mesh.model_copy(update={"file": relative_path(path.parent / s.mesh.file, folder)})}
            )
            if s.mesh
            else s
            for s in body.shapes
        ]
        mesh = relative_path(path.parent / body.mesh, folder) if body.mesh else None
        body = body.model_copy(update={"name": body.name or path.stem, "shapes": shapes, "mesh": mesh})
    else:
        raise InputError(
            "is neither a mesh nor a body file; write a body file that says mass and scale", source=str(path)
        )
    given = {"mass": mass, "friction": friction, "center_of_mass": center_of_mass}
    body = body.model_copy(update={name: value for name, value in given.items() if value is not None})
    text = body.model_dump_json(by_alias=True, exclude_defaults=False, exclude_none=True, indent=1)
    write_text(target, text + "\n", force=force)
