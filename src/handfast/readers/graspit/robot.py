"""GraspIt! robots in, Hand out: a palm and chains of joints with Denavit-Hartenberg parameters, driven by DOFs."""

from __future__ import annotations

import logging
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, coupling_rows
from handfast.model.hand.joint_law import JointLaw
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.readers.graspit.graspit_body import MILLI, GraspitBody, pose_of, text_of, turned
from handfast.readers.xml_file import numbers_in

NUMBER_PATTERN = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
VALUE = re.compile(
    rf"d(\d+)(?:\*({NUMBER_PATTERN}))?(?:([+-])({NUMBER_PATTERN}))?"
)  # of a joint: d0, d0*2, d0+30, d0*-.5+-30
JOINTS_OF = {"Fixed": 0, "Revolute": 1, "Prismatic": 1, "Universal": 2, "Ball": 3}  # that move a link
MICRO = 1e-6  # GraspIt! counts forces in millionths of a newton, torques in millionths of a newton millimetre
OFF_RULE, PAIR = "Off", "OverlappingPair"  # rules by which a link does not collide
LOG = logging.getLogger("handfast")


@dataclass(frozen=True)
class Dof:
    """A degree of freedom: a motor, and the share that its joints take of it.

    Attributes:
        kind: "r" rigid, "b" with a clutch (breakaway), "c" through springs (compliant).
        velocity: by default, whose sign closes the hand.
        joints: of each joint its index in the hand and its ratio: its value is ratio times that of the DOF.
    """

    kind: str
    velocity: float
    joints: tuple[tuple[int, float], ...]


@dataclass(frozen=True, eq=False)
class ChainJoint:
    """A joint of a chain, [rad] or [m]: `before` takes its parent's frame to its axis, z; `after` to the next frame.

    `friction` is dry friction [N m, N].
    """

    name: str
    type: Literal["revolute", "prismatic"]
    limits: tuple[float, float]
    before: Array
    after: Array
    dof: int
    ratio: float
    friction: float


def read_robot(root: Element, path: Path, base: str | None = None) -> Hand:
    """A hand from a parsed GraspIt! robot file.

    Links are `palm` and `chain0_link0`, ...; joints `chain0_joint0`, ...; actuators `d0`, ... for the DOFs that move
    a joint. A link's mesh counts as its convex hull, a mesh without triangles as none. Joints of one rigid or
    breakaway DOF are coupled to its first; the joints of a compliant DOF share its torque by their ratios and
    are not coupled. `Hand.closing` has the signs of the default velocities. Ranges of joints are stops, too, and
    CoulombFriction is dry friction; viscous friction has no part at rest. Left out: breakaway torques, springs of
    joints, virtual contacts, eigengrasps, the approach direction. A link whose collision
    rule is Off has no solid; one that is an OverlappingPair with another, or the base, is not checked against it.

    Raises:
        InputError: no palm, a DOF, joint, link or collision rule that is not understood, a missing link or mesh file.
    """
    if base:
        raise InputError("is for URDF and MJCF files; a GraspIt! file is read whole", field="root")
    chains = root.findall("chain")
    dofs, parts = read_dofs(root)
    folder = path.parent / "iv"
    links = [Link("palm", -1, np.eye(4), (), _shapes(folder, text_of(root, "palm"), "palm"))]
    made: list[Joint] = []
    for c, chain in enumerate(chains):
        _add_chain(links, made, chain, c, parts[c], folder)
    joints = tuple(made)
    couplings, names, R = [], [], np.zeros((0, len(joints)))
    closing = np.zeros(len(joints))
    for number, dof in enumerate(dofs):
        moving = [(j, ratio) for j, ratio in dof.joints if ratio]
        couplings += [Coupling(j, -1, 0.0) for j, ratio in dof.joints if not ratio]
        if not moving:
            continue
        (first, share), row = moving[0], np.zeros(len(joints))
        row[first] = 1.0
        for j, ratio in moving[1:]:
            if dof.kind == "c":
                row[j] = ratio / share
            else:
                couplings.append(Coupling(j, first, ratio / share))
        for j, ratio in moving:
            closing[j] = np.sign(dof.velocity * ratio)
        names.append(f"d{number}")
        R = np.vstack([R, row])
    mechanism = Mechanism(tuple(names), R, coupling_rows(tuple(couplings), len(joints)), (False,) * len(names))
    breakaway = any(dof.kind == "b" and len(dof.joints) > 1 for dof in dofs)
    _say_what_is_left_out(root, dofs, path)
    overlapping = _overlapping_pairs(chains)
    made_of = path.stem, tuple(links), joints, mechanism, tuple(couplings), closing, breakaway, str(path)
    return Hand(*made_of, non_colliding=overlapping)


def read_dofs(root: Element) -> tuple[list[Dof], list[list[ChainJoint]]]:
    """The DOFs of a GraspIt! robot and the joints of its chains; indices of joints count through all chains."""
    count = len(root.findall("dof"))
    parts = [
        [_joint(e, f"chain{c}_joint{j}", count) for j, e in enumerate(chain.findall("joint"))]
        for c, chain in enumerate(root.findall("chain"))
    ]
    flat = [p for part in parts for p in part]
    dofs = []
    for number, e in enumerate(root.findall("dof")):
        kind, where = e.get("type", "").strip(), f"dof {number}"
        if kind not in ("r", "b", "c"):
            raise InputError(f"has type '{kind}'; r, b and c are understood", field=where)
        velocity = numbers_in(text_of(e, "defaultVelocity"), 1, f"{where}.defaultVelocity")[0]
        own = tuple((j, p.ratio) for j, p in enumerate(flat) if p.dof == number)
        dofs.append(Dof(kind, velocity, own))
    return dofs, parts


def _joint(e: Element, name: str, dofs: int) -> ChainJoint:
    kind, where = e.get("type", "").strip(), f"joint {name}"
    if kind not in ("Revolute", "Prismatic"):
        raise InputError(f"has type '{kind}'; Revolute and Prismatic are understood", field=where)
    slides = kind == "Prismatic"
    moves: Literal["revolute", "prismatic"] = "prismatic" if slides else "revolute"
    variable, unit = ("d", MILLI) if slides else ("theta", np.pi / 180)
    text = re.sub(r"\s", "", text_of(e, variable))
    match = VALUE.fullmatch(text)
    if not match:
        raise InputError(f"is '{text}'; such as d0, d0*2 or d0*0.33+40 is needed", field=f"{where}.{variable}")
    number, ratio, sign, offset = match.groups()
    if int(number) >= dofs:
        raise InputError(f"is '{text}', and there are {dofs} DOFs, d0 first", field=f"{where}.{variable}")
    still = {k: numbers_in(text_of(e, k), 1, f"{where}.{k}")[0] for k in ("theta", "d", "a", "alpha") if k != variable}
    if sign == "-":  # GraspIt! takes an offset after a plus sign alone, "d0+-2.46"; its postures are kept
        LOG.warning("%s: '%s' is read as GraspIt! reads it, without its offset; d0+-1 subtracts one", where, text)
    still[variable] = float(offset) if sign == "+" else 0.0
    before = transform(np.array([0, 0, MILLI * still["d"]]), turned(2, still["theta"]))
    after = transform(np.array([MILLI * still["a"], 0, 0]), turned(0, still["alpha"]))
    limits = sorted(unit * numbers_in(text_of(e, k), 1, f"{where}.{k}")[0] for k in ("minValue", "maxValue"))
    rubs = numbers_in((e.findtext("CoulombFriction") or "0").strip(), 1, f"{where}.CoulombFriction")[0]
    if rubs < 0:
        raise InputError(f"is {rubs:g}; 0 or more is needed", field=f"{where}.CoulombFriction")
    friction = rubs * MICRO * (1.0 if slides else MILLI)
    return ChainJoint(name, moves, (limits[0], limits[1]), before, after, int(number), float(ratio or 1), friction)


def _add_chain(
    links: list[Link], joints: list[Joint], chain: Element, number: int, parts: list[ChainJoint], folder: Path
) -> None:
    """Add the links of a chain on the palm, and their joints. Joints past the last link move an empty one."""
    base, parent, used = pose_of(chain, f"chain {number}"), 0, 0
    named = [(f"chain{number}_link{l}", e) for l, e in enumerate(chain.findall("link"))]
    for name, e in named:
        kind = e.get("dynamicJointType", "").strip()
        if kind not in JOINTS_OF:
            raise InputError(f"has dynamicJointType '{kind}'; known: {', '.join(JOINTS_OF)}", field=f"link {name}")
        own = parts[used : used + JOINTS_OF[kind]]
        if len(own) < JOINTS_OF[kind]:
            raise InputError(f"is {kind}, and its chain has too few joints", field=f"link {name}")
        shapes = () if _rule(e, name) == OFF_RULE else _shapes(folder, (e.text or "").strip(), name)
        _add_link(links, joints, name, parent, base, own, shapes)
        base, parent, used = np.eye(4), len(links) - 1, used + len(own)
    if parts[used:]:
        _add_link(links, joints, f"chain{number}_end", parent, base, parts[used:], ())


def _add_link(
    links: list[Link],
    joints: list[Joint],
    name: str,
    parent: int,
    base: Array,
    parts: list[ChainJoint],
    shapes: tuple[Shape, ...],
) -> None:
    """Add a link at `base` in its parent and the joints that move it, stated in its own frame with all at 0."""
    pose, beyond, own = base, np.eye(4), []
    for part in parts:
        pose = pose @ part.before @ part.after
    for part in reversed(parts):
        beyond = part.after @ beyond  # the link's frame in that of this joint, whose axis is z
        R, p = beyond[:3, :3], beyond[:3, 3]
        law = JointLaw(part.friction, stops=part.limits)
        own.append(Joint(part.name, part.type, R.T @ [0, 0, 1], -R.T @ p, *part.limits, law=law))
        beyond = part.before @ beyond
    links.append(Link(name, parent, pose, tuple(range(len(joints), len(joints) + len(parts))), shapes))
    joints += reversed(own)


def _rule(e: Element, name: str) -> str:
    """The collision rule of a link, '' for the usual one: it collides with all but its neighbours."""
    rule = e.get("collisionRule", "").strip()
    if rule not in ("", OFF_RULE, PAIR):
        raise InputError(f"has collisionRule '{rule}'; known: {OFF_RULE}, {PAIR}", field=f"link {name}")
    return rule


def _overlapping_pairs(chains: list[Element]) -> frozenset[tuple[str, str]]:
    """Pairs of links, by name, that do not collide: a link's `targetLink` in `targetChain`, its own if absent."""
    counts = [len(chain.findall("link")) for chain in chains]
    found = set()
    for c, chain in enumerate(chains):
        for k, e in enumerate(chain.findall("link")):
            name = f"chain{c}_link{k}"
            at, link = e.get("targetChain", str(c)).strip(), e.get("targetLink", "").strip()
            if _rule(e, name) != PAIR:
                continue
            if at == "base":
                found.add(("palm", name))
            elif link:
                known = at.isdecimal() and int(at) < len(chains) and link.isdecimal() and int(link) < counts[int(at)]
                if not known:
                    right = "a chain and a link, both counted from 0, or targetChain='base', are needed"
                    raise InputError(f"overlaps link '{link}' of chain '{at}'; {right}", field=f"link {name}")
                found.add((f"chain{int(at)}_link{int(link)}", name))
    return frozenset(found)


def link_materials(root: Element, path: Path) -> frozenset[str]:
    """The materials of the palm and links of a GraspIt! robot."""
    names = [text_of(root, "palm"), *((e.text or "").strip() for e in root.findall("chain/link"))]
    return frozenset(GraspitBody.read(_file(path.parent / "iv", n, "")).material for n in set(names))


def _file(folder: Path, name: str, link: str) -> Path:
    file = folder / name.replace("\\", "/")
    if not name or not os.path.isfile(file):  # False, too, for what can be no name
        problem = f"its file '{name}' was not found in {folder}" if name else "names no file"
        raise InputError(problem, field=f"link {link}")
    return file


def _shapes(folder: Path, name: str, link: str) -> tuple[Shape, ...]:
    file = _file(folder, name, link)
    body = GraspitBody.read(file)
    groups = body.groups()
    if not groups:
        return ()
    try:
        return (Shape.hull(np.vstack([v for v, _ in groups]), body.offset, link),)
    except InputError as fault:
        raise InputError(fault.problem, source=str(file), field=fault.field) from None


def _say_what_is_left_out(root: Element, dofs: list[Dof], path: Path) -> None:
    kinds = {dof.kind for dof in dofs}
    found = [
        name
        for name, there in (
            ("breakaway torques", "b" in kinds),
            ("springs of compliant joints", "c" in kinds),
            ("virtual contacts", root.find("virtualContacts") is not None),
            ("eigengrasps", root.find("eigenGrasps") is not None),
        )
        if there
    ]
    if found:
        LOG.warning("%s: not read: %s", path, ", ".join(found))
