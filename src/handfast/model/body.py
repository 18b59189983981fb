"""Body: the object in the hand, as convex pieces with mass, centre of mass and friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import FaultsOf, InputError, require_not_negative, require_positive
from handfast.core.presented import Presented
from handfast.model.mesh_pieces import center_of_volume, checked_mesh, checked_scale, joined, solid_of
from handfast.model.shape import Faces, Mesh, Shape

if TYPE_CHECKING:
    from trimesh import Trimesh


@dataclass(frozen=True, eq=False)
class Body(Presented):
    """An object made of convex pieces. Frame: the object's own (the mesh file's). SI units.

    Attributes:
        name: for reports.
        pieces: convex shapes; they may overlap.
        mass: [kg], None if unknown.
        center_of_mass: (3,) [m].
        friction: coefficient mu between this object and the hand.
        vertices, faces: (n, 3) [m] and (k, 3), a triangle mesh for drawing.
        source: the file it was read from, or the bundled name; "" if it was not read.
        scale: metres per unit of that file, if it is a mesh.
    """

    name: str
    pieces: tuple[Shape, ...]
    mass: float | None
    center_of_mass: Array
    friction: float
    vertices: Array
    faces: Faces
    source: str = ""
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not self.pieces:
            raise InputError("has no solids; an object needs at least one", field="pieces")
        if self.mass is not None:
            require_not_negative(self.mass, "mass", "a mass is 0 or more [kg]")
        require_not_negative(self.friction, "friction", "a friction coefficient is 0 or more")
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
        mesh: Mesh | None = None,
    ) -> Body:
        """A body from shapes; the centre of mass defaults to the pieces' centre of volume.

        `mesh` is drawn in place of the pieces.
        """
        if not pieces:
            raise InputError("has no solids; an object needs at least one", field="pieces")
        vertices, faces = mesh or joined([p.triangles() for p in pieces])
        if center_of_mass is None:
            center_of_mass = center_of_volume(pieces)
            if center_of_mass is None:
                raise InputError("has no volume; is its scale right?", field="pieces")
        return cls(name, tuple(pieces), mass, np.asarray(center_of_mass), friction, vertices, faces)

    @classmethod
    def from_mesh(
        cls,
        mesh: Trimesh,
        *,
        name: str = "object",
        mass: float | None = None,
        friction: float = 0.5,
        center_of_mass: object = None,
        scale: float = 1.0,
    ) -> Body:
        """A body from a `trimesh.Trimesh`, or anything with `vertices` (n, 3) and `faces` (k, 3), in its own frame.

        Taken apart as `load_body` does with a mesh file: connected parts that are convex as they are, the others
        decomposed into convex pieces. The centre of mass defaults to the centre of the volume, that of a surface that
        is not convex and not that of its pieces; the density of the trimesh is not looked at.

        Args:
            mass: [kg]. friction: coefficient. center_of_mass: (3,) [m] in the body's frame, after scaling.
            scale: metres per unit of the mesh.

        Raises:
            InputError: no mesh (a `trimesh.Scene` is none: `scene.to_mesh()` is), no triangles, NaN, zero scale, flat,
                negative mass or friction.
        """
        vertices, faces = getattr(mesh, "vertices", None), getattr(mesh, "faces", None)
        if vertices is None or faces is None or not len(faces):
            kind = type(mesh).__name__
            raise InputError(f"is a {kind} without vertices and faces; a trimesh.Trimesh is needed", source=name)
        checked_scale(scale)
        try:
            points, corners = np.asarray(vertices, dtype=float), np.asarray(faces, dtype=float)
        except (TypeError, ValueError):
            raise InputError(
                "has vertices or faces that are no numbers, or of different lengths", source=name
            ) from None
        if not (corners == corners.round()).all():
            raise InputError("has faces that are no whole numbers; three vertices by number are needed", source=name)
        group = checked_mesh(points, corners.astype(np.int64), name)
        with FaultsOf(name):
            solid = solid_of([group], name, scale)
            drawn = group[0] * scale, group[1]
            center = center_of_volume([solid]) if center_of_mass is None else center_of_mass
            about = {"mass": mass, "friction": friction, "center_of_mass": center}
            return cls.of(solid.pieces, name=name, mesh=drawn, **about)  # type: ignore[arg-type]

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
    require_positive(mass, "mass", "a weight needs a positive mass [kg]")
    d = frozen(direction, (3,), "direction")
    if np.abs(d).max() < 1e-12:
        raise InputError("is zero; give the direction in which gravity pulls", field="direction")
    d = d / np.abs(d).max()  # no square overflows
    force = mass * g * d / np.linalg.norm(d)
    return np.concatenate([force, np.cross(frozen(center_of_mass, (3,), "center of mass"), force)])
