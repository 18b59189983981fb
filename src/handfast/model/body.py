"""Body: the object in the hand, as convex pieces with mass, centre of mass and friction."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handfast.core import bundled
from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.model.graspit_body import GraspitBody
from handfast.model.mesh_pieces import joined, mesh_pieces
from handfast.model.shape import MESH_FILES, Faces, Shape, read_mesh


@dataclass(frozen=True, eq=False)
class Body:
    """An object made of convex pieces. Frame: the object's own (the mesh file's). SI units.

    Attributes:
        name: for reports.
        pieces: convex shapes; they may overlap.
        mass: [kg], None if unknown.
        center_of_mass: (3,) [m].
        friction: coefficient mu between this object and the hand.
        vertices, faces: (n, 3) [m] and (k, 3), a triangle mesh for drawing.
    """

    name: str
    pieces: tuple[Shape, ...]
    mass: float | None
    center_of_mass: Array
    friction: float
    vertices: Array
    faces: Faces

    def __post_init__(self) -> None:
        if not self.pieces:
            raise InputError("has no solids; an object needs at least one", field="pieces")
        if self.mass is not None and not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError(f"is {self.mass}; a mass is 0 or more [kg]", field="mass")
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise InputError(f"is {self.friction}; a friction coefficient is 0 or more", field="friction")
        object.__setattr__(self, "center_of_mass", frozen(self.center_of_mass, (3,), "center_of_mass"))

    @classmethod
    def of(
        cls,
        pieces: tuple[Shape, ...] | list[Shape],
        *,
        name: str = "object",
        mass: float | None = None,
        friction: float = 0.5,
        center_of_mass: object = None,
        mesh: tuple[Array, Faces] | None = None,
    ) -> Body:
        """A body from shapes; the centre of mass defaults to the pieces' centre of volume.

        `mesh` is drawn in place of the pieces.
        """
        if not pieces:
            raise InputError("has no solids; an object needs at least one", field="pieces")
        vertices, faces = mesh or joined([p.triangles() for p in pieces])
        if center_of_mass is None:
            volumes = np.array([p.volume for p in pieces])
            if not volumes.sum() > 0:
                raise InputError("has no volume; is its scale right?", field="pieces")
            center_of_mass = volumes @ np.array([p.centroid for p in pieces]) / volumes.sum()
        return cls(name, tuple(pieces), mass, np.asarray(center_of_mass), friction, vertices, faces)

    def gravity_wrench(self, direction: object, g: float = 9.81) -> Array:
        """(6,) [N, N m] weight as a wrench at the object's origin, object axes.

        Args:
            direction: (3,) in which gravity pulls, object axes, any length.
            g: [m/s^2].

        Raises:
            InputError: the mass is unknown, or the direction is zero.
        """
        if self.mass is None:
            raise InputError("is unknown; give the object a mass [kg]", source=self.name, field="mass")
        return weight(self.mass, self.center_of_mass, direction, g)

    def __repr__(self) -> str:
        mass = "unknown mass" if self.mass is None else f"{self.mass:g} kg"
        return f"Body({self.name!r}, {len(self.pieces)} pieces, {mass}, mu={self.friction:g})"


def weight(mass: float, center_of_mass: object, direction: object, g: float = 9.81) -> Array:
    """(6,) [N, N m] the wrench of a mass [kg] at its centre (3,) [m], gravity along direction (3,), at the origin.

    Raises:
        InputError: a mass that is not positive, a zero direction.
    """
    if not mass > 0:
        raise InputError(f"is {mass:g}; a weight needs a positive mass [kg]", field="mass")
    d = frozen(direction, (3,), "direction")
    if np.abs(d).max() < 1e-12:
        raise InputError("is zero; give the direction in which gravity pulls", field="direction")
    d = d / np.abs(d).max()  # no square overflows
    force = mass * g * d / np.linalg.norm(d)
    return np.concatenate([force, np.cross(frozen(center_of_mass, (3,), "center of mass"), force)])


def load_body(
    source: str | Path,
    mass: float | None = None,
    friction: float | None = None,
    center_of_mass: object = None,
    scale: float = 1.0,
) -> Body:
    """An object from a mesh file, a `handfast/body/1` JSON file or a GraspIt! body file, or a bundled one by name.

    A mesh may consist of several convex parts (groups, or connected components): they are taken as they
    are, each as its convex hull. A part that is not convex is decomposed into convex pieces with CoACD,
    with a fixed seed. The centre of mass defaults to the centre of the volume (of the pieces, if there
    are several).

    Args:
        source: OBJ, STL, PLY, OFF, Inventor (.iv), VRML (.wrl), JSON, or XML of GraspIt!, which states mm and grams.
        mass: [kg]; unknown if absent here and in the file.
        friction: coefficient; 0.5 if absent here and in the file.
        center_of_mass: (3,) [m] in the object frame, after scaling.
        scale: metres per unit of a mesh file; other files state their own.

    Raises:
        InputError: no such file, no triangles, NaN, flat, negative mass or friction, zero scale, a
            field that the JSON schema does not know. One line, naming the file.
    """
    path = Path(bundled.resolve("objects", str(source)))
    if not os.path.isfile(path):  # False, too, for what can be no name
        raise InputError("no such file; an OBJ, STL, PLY, OFF, IV, WRL, JSON or XML file is needed", source=str(path))
    try:
        if path.suffix.lower() in MESH_FILES:
            pieces = mesh_pieces(path, scale)
            vertices, faces = joined(read_mesh(path))
            drawn = (vertices * scale, faces)
            name, found = path.stem, (mass, friction, center_of_mass)
        elif path.suffix.lower() == ".xml":
            thing = GraspitBody.read(path)
            pieces, drawn = thing.solids()
            center = thing.center_of_mass if center_of_mass is None else center_of_mass
            name, found = path.stem, (thing.mass if mass is None else mass, friction, center)
            if friction is None:
                thing.say_friction()
        else:
            from handfast.model.body_file import read_body_file  # pydantic, slow to import

            file, drawn = read_body_file(path), None
            pieces = file.shapes_in(path.parent)
            name = file.name or path.stem
            given, stored = (mass, friction, center_of_mass), (file.mass, file.friction, file.center_of_mass)
            found = tuple(s if v is None else v for v, s in zip(given, stored, strict=True))  # type: ignore[assignment]
        return Body.of(
            pieces,
            name=name,
            mass=found[0],
            friction=0.5 if found[1] is None else found[1],
            center_of_mass=found[2],
            mesh=drawn,
        )
    except InputError as fault:
        raise fault.at(str(path)) from None
