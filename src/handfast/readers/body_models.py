"""Objects from robot description files and folders: URDF, SDF, and meshes that are convex pieces of one object.

Read are the links' collision elements (their visual ones if no link has any), their masses and centres of mass,
and where fixed poses put them. An object is one rigid body: what moves inside it is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, roll_pitch_yaw, transform
from handfast.model.mesh_pieces import Solid, center_of_volume, components, is_convex, pieces_of, solid_of
from handfast.model.shape import Shape
from handfast.readers.mesh_file import MESH_FILES, read_meshes
from handfast.readers.registry import ObjectParts
from handfast.readers.urdf import find_mesh, link_tree, named_links, origin, sizes, solid
from handfast.readers.xml_file import numbers_in, read_robot_xml

FRICTIONS = ("ode/mu", "ode/mu2", "bullet/friction", "bullet/friction2")  # coefficients in an SDF file's surface


def read_folder(folder: Path, scale: float = 1.0) -> ObjectParts:
    """The meshes of a folder as the convex pieces of one object.

    Args:
        scale: metres per unit.

    Raises:
        InputError: no meshes in it, one that is not convex, as where a folder has an object in several versions, and
            what is wrong with one of them.
    """
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in MESH_FILES and f.is_file())
    if not files:
        raise InputError(f"is a folder without meshes; files of convex pieces are needed ({', '.join(MESH_FILES)})")
    meshes = read_meshes(files)
    for file in files:
        if not all(is_convex(*part) for group in meshes[file] for part in components(*group)):
            right = "a folder is taken for the convex pieces of one object; name the mesh itself"
            raise InputError(f"is not convex; {right}", source=str(file))
    solids = [solid_of(meshes[file], file.name, scale) for file in files]
    return ObjectParts(folder.name, pieces_of(solids), center_of_mass=center_of_volume(solids), scale=scale)


def read_body_model(path: Path, scale: float = 1.0) -> ObjectParts:
    """The object of a URDF or SDF file. The frame is the base link's (URDF), the model's (SDF).

    Args:
        scale: by which everything in the file is longer.

    Raises:
        InputError: another kind of file, no solid or several models in it, links that make no tree or share a name,
            joints that move, a geometry or pose that is not understood, a negative mass, a mesh that is missing or
            scaled differently along its axes.
    """
    root = read_robot_xml(path)
    if root.tag == "robot":
        return _of_urdf(root, path, scale)
    if root.tag == "sdf":
        return _of_sdf(root, path, scale)
    raise InputError(f"has root element <{root.tag}>; an object is a <robot> (URDF) or an <sdf>")


def _of_urdf(root: Element, path: Path, scale: float) -> ObjectParts:
    links, above = link_tree(root)
    for _, joint in above.values():
        _refuse_moving(joint)

    def pose(link: str) -> Array:
        T = np.eye(4)
        while link in above:
            link, joint = above[link]
            T = origin(joint, f"joint {joint.get('name')}") @ T
        return T

    return _parts(root.get("name", path.stem), links, pose, origin, path, scale)


def _of_sdf(root: Element, path: Path, scale: float) -> ObjectParts:
    models = root.findall("model")
    if len(models) != 1 or models[0].find("model") is not None or models[0].find("include") is not None:
        raise InputError("is not of one model without others in it; such an SDF file is needed")
    for joint in models[0].findall("joint"):
        _refuse_moving(joint)
    links = named_links(models[0])
    return _parts(
        models[0].get("name", path.stem),
        links,
        lambda name: _sdf_pose(links[name], f"link {name}"),
        _sdf_pose,
        path,
        scale,
    )


def _refuse_moving(joint: Element) -> None:
    if joint.get("type") != "fixed":
        problem = f"is {joint.get('type')}; an object is one rigid body"
        raise InputError(problem, field=f"joint {joint.get('name', '?')}")


def _parts(
    name: str,
    links: dict[str, Element],
    pose: Callable[[str], Array],
    place: Callable[[Element, str], Array],
    path: Path,
    scale: float,
) -> ObjectParts:
    """The solids and masses of all links, `pose` of each, and `place` of what is in one."""
    solids: list[Solid | Shape] = []
    masses: list[tuple[float, Array]] = []
    frictions: list[float] = []
    kind = "collision" if any(e.find("collision") is not None for e in links.values()) else "visual"
    named = ((link, g) for link, e in links.items() for g in e.iterfind(f"{kind}/geometry/mesh"))
    meshes = read_meshes(_mesh(g, path, f"link {link}")[0] for link, g in named)
    for link, e in links.items():
        where = f"link {link}"
        base = pose(link)
        for element in e.findall(kind):
            geometry = element.find("geometry")
            if geometry is None or not len(geometry):
                raise InputError(f"has a {kind} without geometry", field=where)
            at = _scaled(base @ place(element, where), scale)
            if geometry[0].tag == "mesh":
                file, larger = _mesh(geometry[0], path, where)
                solids.append(solid_of(meshes[file], file.name, larger * scale, at))
            else:
                solids.append(solid(geometry[0], at, f"{link}/{len(pieces_of(solids))}", where, scale))
            given = (element.find(f"surface/friction/{key}") for key in FRICTIONS)
            frictions += [numbers_in(mu.text or "", 1, where, f"<{mu.tag}> ")[0] for mu in given if mu is not None]
        inertial = e.find("inertial")
        mass = None if inertial is None else inertial.find("mass")
        if inertial is not None and mass is not None:
            (kg,) = numbers_in(mass.get("value") or mass.text or "", 1, where, "<mass> ")
            if kg < 0:
                raise InputError(f"has a mass of {kg:g} kg; 0 or more is needed", field=where)
            masses.append((kg, _scaled(base @ place(inertial, where), scale)[:3, 3]))
    if not solids:
        raise InputError("has no collision or visual shapes; an object needs at least one solid")
    whole = sum(m for m, _ in masses) if masses else None
    center = sum(m * c for m, c in masses) / whole if whole else center_of_volume(solids)
    return ObjectParts(name, pieces_of(solids), whole, center, min(frictions, default=None), scale=scale)


def _scaled(T: Array, scale: float) -> Array:
    return transform(scale * T[:3, 3], T[:3, :3])


def _mesh(g: Element, path: Path, where: str) -> tuple[Path, float]:
    """The file of a <mesh>, and by which it is larger than that."""
    along = sizes(g, "scale", 3, where, "1 1 1")
    if g.find("submesh") is not None or max(along) - min(along) > 1e-9 * max(along) or min(along) <= 0:
        raise InputError("has a mesh of which a part is taken, or whose scales differ or are no lengths", field=where)
    return find_mesh(g.findtext("uri", g.get("filename", "")).strip(), path, where), along[0]


def _sdf_pose(e: Element, where: str) -> Array:
    """(4, 4) of an element's <pose>: position and roll, pitch, yaw, or a quaternion x, y, z, w."""
    pose = e.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    other = pose.get("relative_to") or pose.get("frame")  # as it was called before SDF 1.7
    if other not in (None, "", "__model__"):
        raise InputError(f"has a pose relative to {other}; the model's frame is needed", field=where)
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers_in(pose.text or "", 7, where, "<pose> ")
        return transform(values[:3], quaternion_matrix([values[6], *values[3:6]]))
    values = numbers_in(pose.text or "", 6, where, "<pose> ")
    turn = np.pi / 180 if pose.get("degrees") in ("true", "1") else 1.0
    return transform(values[:3], roll_pitch_yaw(*(turn * v for v in values[3:])))
