"""Which function reads which file: one table each for meshes, hands, objects and configurations.

A table maps the ending of a file, or the root element of an XML file, to "module:function". The module is imported
when the first such file is opened, so that no reader costs anything until it is used, and nothing else has to know its
name. A reader of another format adds its own entries:

    registry.MESHES[".stp"] = "my_package.step_files:read_step"
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from handfast.model.shape import Mesh, Shape

_READERS = "handfast.readers"

# (path) -> list[Mesh] in the file's units; a file without triangles is an empty list
MESHES: dict[str, str] = dict.fromkeys((".obj", ".stl", ".ply", ".off"), f"{_READERS}.mesh_file:read_by_trimesh")
MESHES |= dict.fromkeys((".iv", ".wrl"), f"{_READERS}.graspit.inventor:read_inventor")

# (root element, path, name of the root link or None) -> Hand; "robot/chain" is a <robot> that has a <chain>
HAND_READERS: dict[str, str] = {
    "robot/chain": f"{_READERS}.graspit.robot:read_robot",
    "robot": f"{_READERS}.urdf:read_urdf",
    "mujoco": f"{_READERS}.mjcf:read_mjcf",
}
STATES_SENSES = {"robot/chain"}  # formats that say which way joints close; for the others it is guessed

# (path, metres per unit) -> ObjectParts; "" is for files with other endings
OBJECTS: dict[str, str] = {
    ".urdf": f"{_READERS}.body_models:read_body_model",
    ".sdf": f"{_READERS}.body_models:read_body_model",
    ".xml": f"{_READERS}.graspit.graspit_body:read_object",
    "": f"{_READERS}.body_file:read_body",
}

# (path, names that choose among several) -> Configuration; files with other endings are handfast/configuration/1
CONFIGURATIONS: dict[str, str] = {".xml": f"{_READERS}.graspit.graspit_world:read_configuration"}


@dataclass(frozen=True, eq=False)
class ObjectParts:
    """What a file says of an object, in its frame.

    Attributes:
        name: for reports.
        pieces: convex solids [m].
        mass: [kg]. center_of_mass: (3,) [m]. friction: coefficient. None where the file does not say it; the
            centre may be that of the volume then, or None for that of the pieces' volume.
        mesh: to be drawn in place of the pieces [m]; None to draw the pieces.
        scale: metres per unit of the file that the caller chose; 1 for a file that states its own units.
        without_friction: a warning for callers that give no friction either; "" for none.
    """

    name: str
    pieces: list[Shape]
    mass: float | None = None
    center_of_mass: object = None
    friction: float | None = None
    mesh: Mesh | None = None
    scale: float = 1.0
    without_friction: str = ""


def reader(table: Mapping[str, str], key: str) -> Any:
    """The function of an entry, else of the entry "", its module imported; None if the table has neither."""
    if key not in table and "" not in table:
        return None
    module, _, name = (table.get(key) or table[""]).partition(":")
    return getattr(importlib.import_module(module), name)


def hand_format(root: Element) -> str:
    """The key of `HAND_READERS` for a root element; "" if there is none."""
    for key in HAND_READERS:
        tag, _, child = key.partition("/")
        if root.tag == tag and (not child or root.find(child) is not None):
            return key
    return ""


def ending(path: Path) -> str:
    """The ending by which a file is looked up, in small letters."""
    return path.suffix.lower()
