"""What all GraspIt! files share, units, numbers and transforms, and its bodies: the file of an object or a link.

They have millimetres, degrees and grams. GraspIt!: A. T. Miller and P. K. Allen, "GraspIt! A versatile simulator for
robotic grasping" (2004), and its manual.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.mesh_pieces import Solid, center_of_volume, joined, solid_of
from handfast.model.shape import Mesh
from handfast.readers.mesh_file import MESH_FILES, read_mesh, read_meshes
from handfast.readers.registry import ObjectParts
from handfast.readers.xml_file import numbers_in, read_xml

MILLI = 1e-3  # [m/mm, kg/g]
TRANSFORM_PATTERN = re.compile(r"\(([^()\[\]]*)\)\s*\[([^()\[\]]*)\]")


def parse(path: Path, roots: Sequence[str]) -> Element:
    """The root element of a GraspIt! file, which is one of `roots`; `InputError` naming the file if not."""
    root = read_xml(path)
    if root.tag not in roots:
        wanted = " or ".join(f"<{r}>" for r in roots)
        raise InputError(f"has root element <{root.tag}>; {wanted} is needed", source=str(path))
    return root


def text_of(e: Element, tag: str) -> str:
    """The text of a child element, "" if there is none."""
    found = e.find(tag)
    return "" if found is None or found.text is None else found.text.strip()


def pose_of(e: Element, field: str) -> Array:
    """(4, 4) [m] of an element's <transform>, the identity without one: its parts multiplied in their order.

    Parts: translation (mm), rotation (degrees, axis x, y or z), rotationMatrix (nine numbers, column after column) and
    fullTransform "(w x y z)[x y z]" (mm).
    """
    pose, found = np.eye(4), e.find("transform")
    for part in () if found is None else found:
        text, where = (part.text or "").strip(), f"{field}.{part.tag}"
        if part.tag == "translation":
            pose = pose @ transform(MILLI * np.array(numbers_in(text, 3, where)))
        elif part.tag == "rotation":
            angle, _, axis = text.rpartition(" ")
            if axis not in ("x", "y", "z"):
                raise InputError(f"is '{text}'; an angle and x, y or z are needed", field=where)
            pose = pose @ transform(np.zeros(3), turned("xyz".index(axis), numbers_in(angle, 1, where)[0]))
        elif part.tag == "rotationMatrix":
            pose = pose @ transform(np.zeros(3), _orthonormal(numbers_in(text, 9, where), where))
        elif part.tag == "fullTransform":
            match = TRANSFORM_PATTERN.fullmatch(text)
            if not match:
                raise InputError(f"is '{text}'; (w x y z)[x y z] is needed", field=where)
            rotation = quaternion_matrix(numbers_in(match[1], 4, where))
            pose = pose @ transform(MILLI * np.array(numbers_in(match[2], 3, where)), rotation)
        else:
            raise InputError("is not a known part of a transform", field=where)
    return pose


def turned(axis: int, degrees: float) -> Array:
    """(3, 3) turn about axis 0, 1 or 2; exact at multiples of 90 degrees."""
    quarter = (degrees / 90) % 4
    exact = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(quarter)] if quarter.is_integer() else None
    c, s = exact or (np.cos(np.radians(degrees)), np.sin(np.radians(degrees)))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def _orthonormal(numbers: list[float], field: str) -> Array:
    """The rotation next to nine numbers, which files round to a few digits."""
    R = np.array(numbers).reshape(3, 3).T
    U, s, V = np.linalg.svd(R)
    if np.abs(s - 1).max() > 1e-2 or np.linalg.det(R) < 0:
        raise InputError("is no rotation", field=field)
    return np.asarray(U @ V)


# Static friction of two materials, from the tables that come with GraspIt!; any material on a frictionless one has 0.
_PAIRS = {
    "glass": {"glass": 0.2, "metal": 0.2, "plastic": 0.2, "wood": 0.3, "rubber": 1.0},
    "metal": {"metal": 0.2, "plastic": 0.2, "wood": 0.3, "rubber": 1.0},
    "plastic": {"plastic": 0.3, "wood": 0.4, "rubber": 1.0},
    "wood": {"wood": 0.4, "rubber": 1.0},
    "rubber": {"rubber": 2.0},
    "stone": {"stone": 0.7, "glass": 0.3, "metal": 0.4, "plastic": 0.4, "wood": 0.6, "rubber": 1.5},
}
MATERIALS = ("frictionless", *_PAIRS)
DEFAULT_MATERIAL = "wood"  # of a body that names none


def friction_of(first: str, second: str) -> float:
    """GraspIt!'s coefficient of static friction between two of `MATERIALS`."""
    if "frictionless" in (first, second):
        return 0.0
    return _PAIRS[first][second] if second in _PAIRS[first] else _PAIRS[second][first]


@dataclass(frozen=True, eq=False)
class GraspitBody:
    """What a GraspIt! body file says.

    Attributes:
        path: of the file. geometry: the mesh file that it names.
        scale: (3,) metres per unit of the mesh, along its axes. offset: (4, 4) [m] of the scaled mesh in the body.
        material: one of `MATERIALS`. mass: [kg] or None. center_of_mass: (3,) [m] or None.
    """

    path: Path
    geometry: Path
    scale: Array
    offset: Array
    material: str
    mass: float | None
    center_of_mass: Array | None

    @classmethod
    def read(cls, path: Path) -> GraspitBody:
        """A body file, or a mesh alone. Inertia, elasticity and compliance are not read.

        Raises:
            InputError: not the format, an unknown material, no geometry file. One line, naming the file.
        """
        if path.suffix.lower() in MESH_FILES:
            return cls(path, path, np.full(3, MILLI), np.eye(4), DEFAULT_MATERIAL, None, None)
        root = parse(path, ("root", "body"))
        with FaultsOf(path):
            return cls._of(root, path)

    @classmethod
    def _of(cls, root: Element, path: Path) -> GraspitBody:
        name = text_of(root, "geometryFile").replace("\\", "/")
        geometry = path.parent / name
        if not name or not os.path.isfile(geometry):  # False, too, for what can be no name
            problem = f"is '{name}', which was not found in {path.parent}" if name else "is missing"
            raise InputError(problem, field="geometryFile")
        scale = np.ones(3)
        if uniform := text_of(root, "geometryScaling"):
            scale *= numbers_in(uniform, 1, "geometryScaling")[0]
        else:
            for i, axis in enumerate("XYZ"):
                if along := text_of(root, f"geometryScaling{axis}"):
                    scale[i] = numbers_in(along, 1, f"geometryScaling{axis}")[0]
        if not (scale > 0).all():
            raise InputError("is not positive", field="geometryScaling")
        material = text_of(root, "material") or DEFAULT_MATERIAL
        if material not in MATERIALS:
            raise InputError(f"is '{material}'; known: {', '.join(MATERIALS)}", field="material")
        mass = numbers_in(text_of(root, "mass"), 1, "mass")[0] * MILLI if text_of(root, "mass") else None
        cog, offset = text_of(root, "cog"), root.find("geometryOffset")
        center = MILLI * np.array(numbers_in(cog, 3, "cog")) if cog else None
        place = np.eye(4) if offset is None else pose_of(offset, "geometryOffset")
        return cls(path, geometry, MILLI * scale, place, material, mass, center)

    def groups(self) -> list[Mesh]:
        """The surfaces of the geometry [m], before the offset; none if the file is empty."""
        found = read_meshes([self.geometry], empty=True)[self.geometry]
        return [(v * self.scale, f) for v, f in found]

    def solid(self) -> tuple[Solid, Mesh]:
        """Taken apart, and the mesh as it is, [m] in the body's frame; `InputError` if the axes differ in scale."""
        if np.ptp(self.scale) > 0:
            raise InputError("differs along the axes; scale the mesh itself", field="geometryScaling")
        meshes = read_mesh(self.geometry)
        solid = solid_of(meshes, self.geometry.name, float(self.scale[0]), self.offset)
        vertices, faces = joined([(v * self.scale, f) for v, f in meshes])
        return solid, (vertices @ self.offset[:3, :3].T + self.offset[:3, 3], faces)


def read_object(path: Path, _scale: float) -> ObjectParts:
    """The object of a GraspIt! body file, which states its own units; its friction depends on the hand."""
    body = GraspitBody.read(path)
    solid, mesh = body.solid()
    center = center_of_volume([solid]) if body.center_of_mass is None else body.center_of_mass
    known = ", ".join(f"{friction_of(body.material, m):g} on {m}" for m in MATERIALS[1:])
    warning = f"is of {body.material}; its friction depends on the hand (GraspIt!: {known})"
    warning += "; 0.5 is taken unless you give it"
    return ObjectParts(path.stem, solid.pieces, body.mass, center, mesh=mesh, without_friction=warning)
