"""Body: the object in the hand, as convex pieces with mass, centre of mass and friction."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from holdfast import bundled
from holdfast.decompose import decompose
from holdfast.errors import InputError
from holdfast.mechanism import Array, frozen
from holdfast.shape import MESH_FILES, Faces, Shape, read_mesh, refuse_far, rigid, volume_and_centroid

CONVEX = 0.02  # a piece is convex if its hull adds less than this share of volume


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
        vertices, faces = mesh or _joined([p.triangles() for p in pieces])
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
    """An object from a mesh file or a `holdfast/body/1` JSON file, or a bundled one by name.

    A mesh may consist of several convex parts (groups, or connected components): they are taken as they
    are, each as its convex hull. A part that is not convex is decomposed into convex pieces with CoACD,
    with a fixed seed. The centre of mass defaults to the centre of the volume (of the pieces, if there
    are several).

    Args:
        source: OBJ, STL, PLY, OFF or JSON.
        mass: [kg]; unknown if absent here and in the file.
        friction: coefficient; 0.5 if absent here and in the file.
        center_of_mass: (3,) [m] in the object frame, after scaling.
        scale: metres per unit of a mesh file; a JSON file states its own.

    Raises:
        InputError: no such file, no triangles, NaN, flat, negative mass or friction, zero scale, a
            field that the JSON schema does not know. One line, naming the file.
    """
    path = Path(bundled.resolve("objects", str(source)))
    if not os.path.isfile(path):  # False, too, for what can be no name
        raise InputError("no such file; an OBJ, STL, PLY, OFF or JSON file is needed", source=str(path))
    try:
        if path.suffix.lower() in MESH_FILES:
            pieces = mesh_pieces(path, scale)
            vertices, faces = _joined(read_mesh(path))
            drawn = (vertices * scale, faces)
            name, found = path.stem, (mass, friction, center_of_mass)
        else:
            from holdfast.body_file import read_body_file  # pydantic, slow to import

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


def mesh_pieces(path: Path, scale: float = 1.0, pose: object = None) -> list[Shape]:
    """Convex pieces of a mesh file, scaled to metres and placed at `pose` (4, 4)."""
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"is {scale}; metres per unit of the mesh are needed, more than 0", field="scale")
    pose = rigid(np.eye(4) if pose is None else pose)
    groups = [(v * scale, f) for v, f in read_mesh(path)]
    for vertices, _ in groups:
        refuse_far(vertices, path.name)
    if len(groups) > 1 and not all(closed(f) for _, f in groups):
        groups = [_merged(groups)]  # groups that only colour one solid
    parts = [part for group in groups for part in components(*group)]
    if _hollow(parts):
        parts = [_merged(groups)]
    hulls = [points for v, f in parts for points in ([v] if is_convex(v, f) else decompose(v, f))]
    return [Shape.hull(points, pose, f"{path.stem}/{i}") for i, points in enumerate(hulls)]


def _hollow(parts: list[tuple[Array, Faces]]) -> bool:
    """Whether one part is the inner surface of another: inside it, and wound the other way."""
    outer = max(parts, key=lambda part: abs(volume_and_centroid(*part)[0]))
    size, hull = volume_and_centroid(*outer)[0], None
    for v, f in parts:
        if closed(f) and volume_and_centroid(v, f)[0] * size < 0:
            hull = hull or Shape.hull(outer[0])
            if (hull.depth(v) > 0).all():
                return True
    return False


def closed(faces: Faces) -> bool:
    """Whether every edge belongs to two triangles."""
    edges = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def components(vertices: Array, faces: Faces) -> list[tuple[Array, Faces]]:
    """The connected parts of a triangle mesh, in the order of their first triangles."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    i, j = np.concatenate([faces[:, 0], faces[:, 1]]), np.concatenate([faces[:, 1], faces[:, 2]])
    label = connected_components(coo_array((np.ones(len(i)), (i, j)), (n, n)), directed=False)[1]
    of_face = label[faces[:, 0]]
    _, first = np.unique(of_face, return_index=True)
    parts = []
    for name in of_face[np.sort(first)]:
        used, compact = np.unique(faces[of_face == name], return_inverse=True)
        parts.append((vertices[used], compact.reshape(-1, 3)))
    return parts


def is_convex(vertices: Array, faces: Faces) -> bool:
    """Whether a mesh is its own convex hull: to 2 % of its volume, or of its size if it is open."""
    hull = Shape.hull(vertices)
    if closed(faces):
        return abs(volume_and_centroid(vertices, faces)[0]) >= (1 - CONVEX) * hull.volume
    points = np.vstack([vertices, vertices[faces].mean(axis=1)])
    return bool(hull.depth(points).max() <= CONVEX * np.ptp(vertices, axis=0).max())


def _joined(meshes: list[tuple[Array, Faces]]) -> tuple[Array, Faces]:
    """Several triangle meshes as one."""
    starts = np.cumsum([0] + [len(v) for v, _ in meshes])
    vertices = np.vstack([v for v, _ in meshes])
    return vertices, np.vstack([f + start for (_, f), start in zip(meshes, starts, strict=False)])


def _merged(meshes: list[tuple[Array, Faces]]) -> tuple[Array, Faces]:
    """Several triangle meshes as one, with the vertices that they share merged."""
    vertices, faces = _joined(meshes)
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[faces]
