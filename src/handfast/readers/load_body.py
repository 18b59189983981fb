"""One door for objects: bundled names, meshes, folders of meshes, and files of every format in the registry."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from handfast.core import bundled
from handfast.core.errors import FaultsOf, InputError, kinds_checked
from handfast.model.body import Body
from handfast.model.mesh_pieces import center_of_volume, checked_scale, joined, solid_of, surface_facts
from handfast.model.shape import Mesh
from handfast.readers import registry
from handfast.readers.body_models import read_folder
from handfast.readers.mesh_file import read_mesh
from handfast.readers.registry import ObjectParts

LOG = logging.getLogger("handfast")


@kinds_checked
def load_body(
    source: str | Path,
    mass: float | None = None,
    friction: float | None = None,
    center_of_mass: object = None,
    scale: float = 1.0,
) -> Body:
    """An object from a mesh, URDF, SDF, GraspIt! or `handfast/body/1` file, a folder of meshes, or a bundled one.

    A mesh may consist of several convex parts (groups, or connected components): they are taken as they
    are, each as its convex hull. A part that is not convex is decomposed into convex pieces with CoACD,
    with a fixed seed. The centre of mass defaults to the centre of the volume: of the surface of a part that is
    decomposed, not of its pieces, which fill hollows. Of a URDF or SDF file count collision shapes, masses and (SDF)
    the smallest friction; the meshes of a folder are pieces of one object.

    Args:
        source: OBJ, STL, PLY, OFF, Inventor (.iv), VRML (.wrl), URDF, SDF, JSON, a folder, or XML of GraspIt!, which
            states mm and grams.
        mass: [kg]; unknown if absent here and in the file.
        friction: coefficient; 0.5 if absent here and in the file.
        center_of_mass: (3,) [m] in the object frame, after scaling.
        scale: metres per unit of a mesh, a folder's meshes, or a URDF or SDF file; other files state their own.

    Raises:
        InputError: no such file, no triangles, NaN, flat, negative mass or friction, zero scale, a
            field that the JSON schema does not know. One line, naming the file.
    """
    return body_of(source, mass, friction, center_of_mass, scale)


def body_of(
    source: str | Path,
    mass: float | None = None,
    friction: float | None = None,
    center_of_mass: object = None,
    scale: float = 1.0,
    meshes: list[Mesh] | None = None,
) -> Body:
    """As `load_body`; meshes: of a mesh file, from `seen_mesh`."""
    path = Path(bundled.resolve("objects", str(source)))
    if not os.path.isfile(path) and not os.path.isdir(path):  # False, too, for what can be no name
        known = "an OBJ, STL, PLY, OFF, IV, WRL, URDF, SDF, JSON or XML file"
        raise InputError(f"no such file; {known} is needed", source=str(path))
    with FaultsOf(path):
        checked_scale(scale)
        parts = _parts(path, scale, meshes)
        if friction is None and parts.friction is None and parts.without_friction:
            LOG.warning("%s: %s", path, parts.without_friction)
        mu = parts.friction if friction is None else friction
        body = Body.of(
            parts.pieces,
            name=parts.name,
            mass=parts.mass if mass is None else mass,
            friction=0.5 if mu is None else mu,
            center_of_mass=parts.center_of_mass if center_of_mass is None else center_of_mass,
            mesh=parts.mesh,
        )
        named = str(source) if str(source) in bundled.names("objects") else str(path)
        return replace(body, source=named, scale=parts.scale)


def seen_mesh(path: Path, scale: float = 1.0) -> tuple[dict[str, Any], list[Mesh] | None]:
    """What a mesh file is like before it is taken apart (`surface_facts`), and its meshes; {}, None of other files."""
    if registry.ending(path) not in registry.MESHES or not os.path.isfile(path):
        return {}, None
    with FaultsOf(path):
        checked_scale(scale)
        meshes = read_mesh(path)
        return surface_facts(meshes, scale), meshes


def _parts(path: Path, scale: float, meshes: list[Mesh] | None) -> ObjectParts:
    if path.is_dir():
        return read_folder(path, scale)
    if registry.ending(path) in registry.MESHES:
        meshes = meshes or read_mesh(path)
        vertices, faces = joined(meshes)
        solid = solid_of(meshes, path.name, scale)
        mesh, center = (vertices * scale, faces), center_of_volume([solid])
        return ObjectParts(path.stem, solid.pieces, center_of_mass=center, mesh=mesh, scale=scale)
    parts: ObjectParts = registry.reader(registry.OBJECTS, registry.ending(path))(path, scale)
    return parts
