"""The mesh of a published grasp's object: where files name it by a code or by a path on the machine that made them.

A path from a file is never followed as it stands: its last parts are looked for below folders that the user gave, or,
if it is relative, below those that hold the file of grasps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from handfast.core.errors import InputError
from handfast.readers.body_file import BodyFile, MeshFile, ShapeFile
from handfast.readers.mesh_file import MESH_FILES

PIECES = ("coacd/decomposed.obj", "urdf/meshes", "meshes", "mesh/coacd.obj", "mesh/simplified.obj", "")
INNER = ("mesh", "meshes", "urdf", "coacd")  # folders in an object's own
UPWARDS = 8  # folders above the file of grasps


@dataclass(frozen=True)
class FoundObject:
    """An object's mesh files, its convex pieces if there are several.

    Attributes:
        name: of the object, for files.
        meshes: one or more; or a single body file.
    """

    name: str
    meshes: tuple[Path, ...]

    @property
    def states_its_size(self) -> bool:
        """Whether it is a `handfast/body/1` file, which no grasp scales."""
        return self.meshes[0].suffix.lower() not in MESH_FILES

    def body_file(self, meshes: Sequence[str], scale: float, mass: float | None, friction: float | None) -> BodyFile:
        """As a `handfast/body/1` file, with its meshes as the file is to name them and the scale of the grasp."""
        shapes = [ShapeFile(mesh=MeshFile(file=mesh, scale=scale)) for mesh in meshes]
        return BodyFile(schema="handfast/body/1", name=self.name, shapes=shapes, mass=mass, friction=friction)


def find_object(named: str, grasps: Path, roots: Sequence[Path] = ()) -> FoundObject:
    """The object that a file of grasps names.

    Args:
        named: a code, "set+object", or a path, as the file has it.
        grasps: the file.
        roots: folders in which objects are; without them the folders above the file.

    Raises:
        InputError: there is none; the line says what to give.
    """
    parts = [p for p in PurePosixPath(named.replace("+", "/")).parts if p not in ("/", "..", ".")]
    absolute = PurePosixPath(named).is_absolute()
    above = grasps.resolve().parents[:UPWARDS]
    bases = list(roots) or ([] if absolute else [Path.cwd(), *above])
    for base in bases:
        for start in range(len(parts) if roots else min(1, len(parts))):
            for candidate in _candidates(base.joinpath(*parts[start:])):
                meshes = meshes_of(candidate) if candidate not in (base, *base.parents) else ()
                if meshes:
                    return FoundObject(candidate.stem if candidate.suffix in MESH_FILES else candidate.name, meshes)
    where = f"below {', '.join(map(str, roots))}" if roots else "beside the file"
    raise InputError(f"object '{named}' was not found {where}; give --objects FOLDER, or --object OBJECT for all")


def _candidates(path: Path) -> Iterator[Path]:
    """The object's folder comes first: pieces that are convex spare a decomposition."""
    if path.suffix.lower() in (*MESH_FILES, ".urdf", ".xml"):
        if path.parent.name in INNER:
            yield path.parent.parent
        yield path
        yield path.with_suffix("")
    yield path
    for ending in MESH_FILES:
        yield path.with_name(path.name + ending)


def meshes_of(path: Path) -> tuple[Path, ...]:
    """The mesh file at a path, or those of the object in a folder; none if there are none."""
    if path.is_file():
        return (path,) if path.suffix.lower() in MESH_FILES else ()
    if not path.is_dir():
        return ()
    for inner in PIECES:
        place = path / inner
        if place.is_file():
            return (place,)
        if place.is_dir():
            found = tuple(sorted(f for f in place.iterdir() if f.suffix.lower() in MESH_FILES and f.is_file()))
            if found:
                return found
    return ()
