"""URDF in, Hand out: links, fixed links, mimic joints, primitive and mesh collision shapes.

Its companion SRDF says which pairs of links are not checked against each other.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.core.transforms import roll_pitch_yaw, transform
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, direct_mechanism, guess_closing, refuse_large
from handfast.model.hand.joint_law import NO_LAW, JointLaw
from handfast.model.shape import Kind, Mesh, Shape
from handfast.readers.mesh_file import read_meshes
from handfast.readers.xml_file import numbers_in, read_robot_xml

URDF_SOLIDS: dict[Kind, dict[str, int]] = {  # how many numbers of which names
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
}
CONTINUOUS_LIMIT = 2 * np.pi  # limits of a continuous joint: a finger joint never needs more


def read_urdf(root: Element, path: Path, base: str | None = None) -> Hand:
    """A hand from a parsed URDF file.

    Fixed joints make links without joints, so the palm and every frame keep their names; the order of
    links and joints is depth first, as in the file. Limits are stops, too, and <dynamics friction> is dry friction;
    damping has no part at rest. `mimic` becomes a coupling; every other joint is its
    own actuator. Collision elements become shapes; a mesh is taken as its convex hull.

    Args:
        base: name of a link: only what hangs on it is read, in its frame, without the joint that moves it.

    Raises:
        InputError: no single root link, unknown joint type, missing limits, missing mesh file, bad numbers, an unknown
            base, a joint of its part that mimics one outside.
    """
    joints_xml = root.findall("joint")
    refuse_large(len(root.findall("link")), len(joints_xml), len(root.findall("link/collision")))
    elements, above = link_tree(root)
    if base is not None and base not in elements:
        raise unknown_name("link", base, elements, field="root")
    children: dict[str, list[tuple[str, Element]]] = {name: [] for name in elements}
    for child, (parent_link, joint) in above.items():
        children[parent_link].append((child, joint))
    top = base or next(name for name in elements if name not in above)

    frames: list[tuple[str, int, Array, tuple[int, ...]]] = []
    joints: list[Joint] = []
    order: dict[str, int] = {}
    todo: list[tuple[str, int, Element | None]] = [(top, -1, None)]
    while todo:
        name, parent, moving = todo.pop()
        own: tuple[int, ...] = ()
        pose = np.eye(4) if moving is None else origin(moving, f"joint {moving.get('name')}")
        if moving is not None and moving.get("type") != "fixed":
            own = (len(joints),)
            order[moving.get("name", "")] = len(joints)
            joints.append(_joint(moving))
        frames.append((name, parent, pose, own))
        todo += [(child, len(frames) - 1, joint) for child, joint in reversed(children[name])]
    named = ((name, g) for name, *_ in frames for g in elements[name].iterfind("collision/geometry/mesh"))
    meshes = read_meshes(_mesh(g, path, name)[0] for name, g in named)
    links = tuple(
        Link(name, parent, pose, own, tuple(_shape(e, name, i, path, meshes) for i, e in enumerate(solids)))
        for name, parent, pose, own in frames
        for solids in [elements[name].findall("collision")]
    )

    couplings = tuple(c for e in joints_xml if (c := _mimic(e, order)) is not None)
    mechanism = direct_mechanism([joint.name for joint in joints], couplings)
    closing = guess_closing(tuple(joints), couplings)
    name = root.get("name", path.stem)
    efforts = {e.get("name", ""): _effort(e) for e in joints_xml}
    stated = {n: efforts[n] for n in mechanism.actuators if efforts[n]}
    return Hand(name, links, tuple(joints), mechanism, couplings, closing, source=str(path), strengths=stated)


def named_links(parent: Element) -> dict[str, Element]:
    """The links by name; `InputError` if one has none, or two have the same."""
    found: dict[str, Element] = {}
    for e in parent.findall("link"):
        name = _attribute(e, "name", "link")
        if name in found:
            raise InputError("is the name of two links", field=f"link {name}")
        found[name] = e
    return found


def link_tree(root: Element) -> tuple[dict[str, Element], dict[str, tuple[str, Element]]]:
    """The links of a URDF file by name, and of each but the base the link above it and the joint that is between.

    Raises:
        InputError: links or joints without names, two of one name, links that are not defined or make no single tree.
    """
    links, above = named_links(root), dict[str, tuple[str, Element]]()
    for e in root.findall("joint"):
        where, ends = f"joint {_attribute(e, 'name', 'joint')}", []
        for end in ("parent", "child"):
            found = e.find(end)
            ends.append("" if found is None else found.get("link", ""))
            if ends[-1] not in links:
                raise InputError(f"has {end} link '{ends[-1]}', which is not defined", field=where)
        if ends[1] in above:
            raise InputError("leads to a link that has a parent already", field=where)
        above[ends[1]] = ends[0], e
    tops = [link for link in links if link not in above]
    if len(tops) != 1:
        raise InputError(f"has {len(tops)} links without a parent; exactly one base link is needed")
    below = {tops[0]}  # the base, and what hangs on it
    for link in links:
        way = dict[str, None]()
        while link not in below:
            if link in way:
                raise InputError("has a loop of links; a tree is needed")
            way[link], link = None, above[link][0]
        below.update(way)
    return links, above


def _joint(e: Element) -> Joint:
    name, kind = e.get("name", ""), e.get("type", "")
    if kind not in ("revolute", "continuous", "prismatic"):
        raise InputError(
            f"has type '{kind}'; revolute, continuous, prismatic and fixed joints are understood",
            field=f"joint {name}",
        )
    axis = e.find("axis")
    direction = [1.0, 0.0, 0.0] if axis is None else numbers(axis, "xyz", 3, f"joint {name}")
    dynamics = e.find("dynamics")
    rubs = 0.0 if dynamics is None else numbers(dynamics, "friction", 1, f"joint {name}", "0")[0]
    if rubs < 0:
        raise InputError(f"<dynamics> friction is {rubs:g}; 0 or more is needed", field=f"joint {name}")
    if kind == "continuous":
        return Joint(
            name, "revolute", np.array(direction), np.zeros(3), -CONTINUOUS_LIMIT, CONTINUOUS_LIMIT, law=JointLaw(rubs)
        )
    limit = e.find("limit")
    if limit is None:
        raise InputError("has no <limit>; lower and upper are needed", field=f"joint {name}")
    lower, upper = (numbers(limit, key, 1, f"joint {name}", "0")[0] for key in ("lower", "upper"))
    moves: Literal["revolute", "prismatic"] = "prismatic" if kind == "prismatic" else "revolute"
    law = JointLaw(rubs, stops=(lower, upper)) if lower <= upper else NO_LAW  # else the joint says what is wrong
    return Joint(name, moves, np.array(direction), np.zeros(3), lower, upper, law=law)


def _effort(e: Element) -> float:
    """The largest force of a joint's motor [N m or N]; 0 where nothing that can be one is stated."""
    limit = e.find("limit")
    try:
        effort = float("0" if limit is None else limit.get("effort", "0"))
    except ValueError:
        return 0.0
    return effort if 0 < effort < np.inf else 0.0


def _mimic(e: Element, order: dict[str, int]) -> Coupling | None:
    mimic, name = e.find("mimic"), e.get("name", "")
    if mimic is None or name not in order:
        return None
    driver = mimic.get("joint", "")
    if driver not in order:
        problem = f"mimics joint '{driver}', which is not a moving joint of what is read"
        raise InputError(problem, field=f"joint {name}")
    ratio = numbers(mimic, "multiplier", 1, f"joint {name}", "1")[0]
    offset = numbers(mimic, "offset", 1, f"joint {name}", "0")[0]
    return Coupling(order[name], order[driver], ratio, offset)


def _mesh(g: Element, path: Path, link: str) -> tuple[Path, Array]:
    """The file of a <mesh>, and by which it is larger than that."""
    scale = np.array(numbers(g, "scale", 3, f"link {link}", "1 1 1"))
    return find_mesh(g.get("filename", ""), path, f"link {link}"), scale


def _shape(e: Element, link: str, number: int, path: Path, meshes: dict[Path, list[Mesh]]) -> Shape:
    where = f"link {link}"
    pose, geometry = origin(e, where), e.find("geometry")
    name = e.get("name") or f"{link}/{number}"
    if geometry is None or not len(geometry):
        raise InputError("has a collision without geometry", field=where)
    if geometry[0].tag != "mesh":
        return solid(geometry[0], pose, name, where)
    file, scale = _mesh(geometry[0], path, link)
    return Shape.hull(np.vstack([v for v, _ in meshes[file]]) * scale, pose, name)


def solid(g: Element, pose: Array, name: str, where: str, scale: float = 1.0) -> Shape:
    """The shape of a geometry that is no mesh, `scale` times as large as it is said to be; `InputError` with `where`.

    Its numbers are in attributes, as in a URDF file, or in elements, as in an SDF file.
    """
    if g.tag not in URDF_SOLIDS:
        raise InputError(f"has a {g.tag}; {', '.join(URDF_SOLIDS)} and mesh are understood", field=where)
    kind: Kind = g.tag
    size = [x for key, n in URDF_SOLIDS[kind].items() for x in sizes(g, key, n, where)]
    return Shape(kind, [scale * x for x in size], pose, name=name)


def sizes(g: Element, key: str, n: int, where: str, default: str | None = None) -> list[float]:
    """The n numbers of a geometry, in an attribute or in an element."""
    inner = g.find(key)
    return numbers(g, key, n, where, default) if inner is None else numbers_in(inner.text or "", n, where, f"<{key}> ")


def find_mesh(filename: str, path: Path, where: str) -> Path:
    """The file that a URDF or SDF file at `path` means by `filename`.

    `package://name/rest`, in an SDF file `model://name/rest`, is looked for upwards from the file, both as a
    directory called `name` that holds it and beside one; other names are relative to the file's directory.

    Raises:
        InputError: nothing there, naming the file and the link (`where`).
    """
    folder = path.resolve().parent
    candidates = []
    scheme = next((s for s in ("package://", "model://") if filename.startswith(s)), "")
    if scheme:
        package, _, rest = filename.removeprefix(scheme).partition("/")
        for up in (folder, *folder.parents):
            if up.name == package:
                candidates.append(up / rest)
            candidates.append(up / package / rest)
    else:
        candidates.append(folder / filename.removeprefix("file://"))
    for candidate in candidates:
        if os.path.isfile(candidate):  # False, too, for what can be no name
            return candidate
    upwards = "searched upwards from" if scheme else "searched in"
    raise InputError(f"its mesh file '{filename}' was not found ({upwards} {folder})", field=where)


def origin(e: Element, where: str) -> Array:
    """(4, 4) of an element's <origin>, the identity without one; `InputError` if it is not of numbers."""
    o = e.find("origin")
    if o is None:
        return np.eye(4)
    rotation = roll_pitch_yaw(*numbers(o, "rpy", 3, where, "0 0 0"))
    return transform(numbers(o, "xyz", 3, where, "0 0 0"), rotation)


def numbers(e: Element, key: str, n: int, where: str, default: str | None = None) -> list[float]:
    """The n finite numbers of an attribute; `InputError` if it has others, or is missing without a default."""
    text = e.get(key, default)
    if text is None:
        raise InputError(f"<{e.tag}> has no {key}", field=where)
    return numbers_in(text, n, where, f"<{e.tag}> {key} ")


def _attribute(e: Element, key: str, where: str) -> str:
    value = e.get(key)
    if not value:
        raise InputError(f"a <{where}> has no {key}")
    if not value.isprintable():
        problem = f"is {value[:40]!r}; one line without control characters is needed"
        raise InputError(problem, field=f"{key} of a <{where}>")
    return value


def read_srdf(path: Path, hand: Hand, *, strict: bool = True) -> frozenset[tuple[str, str]]:
    """The pairs of an SRDF file's `disable_collisions` elements. Everything else in it is left alone.

    Args:
        hand: whose links they have to be.
        strict: False leaves out pairs with a link that the hand does not have, as where only a part of a robot is read.

    Raises:
        InputError: not an SRDF file; an element without two links, with the same one twice, or with one that the hand
            does not have.
    """
    root = read_robot_xml(path)
    if root.tag != "robot":
        raise InputError(f"has root element <{root.tag}>; an SRDF file has <robot>", source=str(path))
    pairs = set()
    for n, e in enumerate(root.iter("disable_collisions")):
        field, ends = f"disable_collisions[{n}]", []
        for key in ("link1", "link2"):
            name = e.get(key)
            if not name:
                raise InputError(f"has no {key}; two links are needed", source=str(path), field=field)
            ends.append(name)
        if ends[0] == ends[1]:
            raise InputError(f"names {ends[0]} twice; two links are needed", source=str(path), field=field)
        strangers = [name for name in ends if name not in hand.link_names]
        if strangers and strict:
            problem = f"names link '{strangers[0]}', which the hand does not have"
            raise InputError(problem, source=str(path), field=field)
        if not strangers:
            pairs.add((ends[0], ends[1]))
    return frozenset(pairs)
