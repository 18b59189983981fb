"""The `handfast/body/1` file: an object from primitive shapes and meshes, as pydantic models.

    {"schema": "handfast/body/1", "mass": 0.4, "friction": 0.6,
     "shapes": [{"box": {"size": [0.1, 0.06, 0.2]}, "pose": {"position": [0, 0, 0.1]}},
                {"mesh": {"file": "handle.obj", "scale": 0.001}}]}

`{"mesh": "mug.obj", ...}` in place of `shapes` is short for one mesh in metres.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Positive, Strict, Vector, read_json, validate
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.mesh_file import read_meshes
from handfast.model.mesh_pieces import pieces_of
from handfast.model.shape import Shape

Sizes = tuple[Positive, Positive, Positive]


class PoseFile(Strict):
    """A rigid motion: position [m] and unit quaternion (w, x, y, z)."""

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: tuple[Finite, Finite, Finite, Finite] = (1.0, 0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _turns(self) -> PoseFile:
        length = float(np.linalg.norm(self.quaternion))
        if abs(length - 1) > 1e-3:
            raise ValueError(f"quaternion has length {length:.4g}; a unit quaternion w, x, y, z is needed")
        return self

    @property
    def matrix(self) -> Array:
        """(4, 4)."""
        return transform(self.position, quaternion_matrix(self.quaternion))


class Box(Strict):
    """Full edge lengths [m]."""

    size: Sizes


class Ball(Strict):
    """[m]."""

    radius: Positive


class Round(Strict):
    """A capsule (length without its caps) or cylinder along z [m]."""

    radius: Positive
    length: Positive

    @property
    def both(self) -> tuple[float, float]:
        """Radius and length [m]."""
        return self.radius, self.length


class Ellipsoid(Strict):
    """Semi-axes [m]."""

    semi_axes: Sizes


class MeshFile(Strict):
    """A mesh file relative to the JSON file; `scale` in metres per unit."""

    file: str
    scale: Positive = 1.0


class ShapeFile(Strict):
    """Exactly one solid, and where it stands in the object frame."""

    box: Box | None = None
    sphere: Ball | None = None
    capsule: Round | None = None
    cylinder: Round | None = None
    ellipsoid: Ellipsoid | None = None
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

    def shapes_in(self, folder: Path) -> list[Shape]:
        """The convex pieces, mesh files relative to `folder`."""
        pieces: list[Shape] = []
        shapes = self.shapes or [ShapeFile(mesh=MeshFile(file=self.mesh or ""))]
        named = {i: s.mesh.file for i, s in enumerate(shapes) if s.mesh}
        files = {i: folder / name for i, name in named.items()}
        for i, file in files.items():
            if not os.path.isfile(file):  # False, too, for what can be no name
                raise InputError(f"mesh '{named[i]}' was not found in {folder}", field=f"shapes.{i}")
        meshes = read_meshes(files.values())
        for i, s in enumerate(shapes):
            pose = s.pose.matrix
            if s.box:
                pieces.append(Shape("box", s.box.size, pose, name=f"box_{i}"))
            elif s.sphere:
                pieces.append(Shape("sphere", s.sphere.radius, pose, name=f"sphere_{i}"))
            elif s.capsule:
                pieces.append(Shape("capsule", s.capsule.both, pose, name=f"capsule_{i}"))
            elif s.cylinder:
                pieces.append(Shape("cylinder", s.cylinder.both, pose, name=f"cylinder_{i}"))
            elif s.ellipsoid:
                pieces.append(Shape("ellipsoid", s.ellipsoid.semi_axes, pose, name=f"ellipsoid_{i}"))
            elif s.mesh:
                pieces += pieces_of(meshes[files[i]], files[i].name, s.mesh.scale, pose)
        return pieces


def read_body_file(path: Path) -> BodyFile:
    """The file, checked; `InputError` naming the first field that is wrong."""
    return validate(BodyFile, read_json(path, "mesh or handfast/body/1"))
