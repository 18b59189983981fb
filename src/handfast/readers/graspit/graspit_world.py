"""GraspIt! worlds: which robot holds which object, at which values of its DOFs, and where."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.errors import FaultsOf, InputError
from handfast.model.body import Body
from handfast.model.configuration import Configuration, PoseFile
from handfast.model.hand.hand import Hand
from handfast.readers.graspit.graspit_body import MILLI, GraspitBody, friction_of, parse, pose_of, text_of
from handfast.readers.graspit.robot import ChainJoint, Dof, link_materials, read_dofs
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.readers.xml_file import numbers_in

WORLD_ROUNDING = 1e-4  # [rad, mm] by which a value may pass a limit: a world has six digits
LOG = logging.getLogger("handfast")


def load_graspit_world(path: str | Path) -> tuple[Hand, Body, Configuration]:
    """Hand, object and configuration of a GraspIt! world; `world.xml#Barrett,mug` chooses among several.

    The object's friction is GraspIt!'s coefficient for its material on the hand's; where links are of several
    materials, the smallest.

    Raises:
        InputError: what `load_configuration`, `load_hand` and `load_body` raise.
    """
    name, _, chosen = str(path).partition("#")
    if not name.lower().endswith(".xml"):
        raise InputError("is no GraspIt! world", source=str(path))
    world = read_configuration(Path(name), tuple(filter(None, chosen.split(","))))
    robot, body = Path(str(world.hand)), Path(str(world.object))
    hand = load_hand(robot)
    own = GraspitBody.read(body).material
    mu = min(friction_of(own, m) for m in link_materials(parse(robot, ("robot",)), robot))
    return hand, load_body(body, friction=mu), world


def read_configuration(path: Path, chosen: tuple[str, ...] = ()) -> Configuration:
    """The robot and the object in a world file; a robot that carries another (an arm) does not count.

    Files that it names are looked for upwards from the world, as GraspIt! looks for them in its own folder. A joint in
    breakaway has its own value. Obstacles and cameras are left out.

    Args:
        chosen: names (of files, without ending) of the robot, the object or both, where there are several.

    Raises:
        InputError: not a world, no robot or object or several, a file that is missing, values of DOFs that
            are too few or beyond the limits. One line, naming the file.
    """
    root = parse(path, ("world",))
    with FaultsOf(path):
        return _read(root, path, chosen)


def _read(root: Element, path: Path, chosen: tuple[str, ...]) -> Configuration:
    robots, bodies = root.findall("robot"), root.findall("graspableBody")
    known = {Path(_name(e)).stem for e in (*robots, *bodies)}
    for name in chosen:
        if name not in known:
            raise InputError(f"has no robot or object '{name}'; known: {', '.join(sorted(known)) or 'none'}")
    carriers = {text_of(e, "parentRobot") for e in root.findall("connection")}
    hands = [e for i, e in enumerate(robots) if str(i) not in carriers]
    robot, body = _one(hands, "robot", chosen, path), _one(bodies, "object", chosen, path)
    robot_path, body_path = _found(robot, path), _found(body, path)
    obstacles = len(root.findall("obstacle"))
    if obstacles:
        LOG.warning("%s: %d obstacle%s left out", path, obstacles, "s are" if obstacles > 1 else " is")
    pose = np.linalg.inv(pose_of(robot, "robot")) @ pose_of(body, "graspableBody")
    with FaultsOf(robot_path):
        dofs, parts = read_dofs(parse(robot_path, ("robot",)))
    joints = joint_values(text_of(robot, "dofValues"), dofs, [p for part in parts for p in part])
    named: dict[str, Any] = {"hand": str(robot_path), "object": str(body_path), "joints": joints}
    return Configuration(schema="handfast/configuration/1", **named, object_pose=PoseFile.of(pose))


def _name(e: Element) -> str:
    return text_of(e, "filename").replace("\\", "/")


def _one(found: list[Element], kind: str, chosen: tuple[str, ...], path: Path) -> Element:
    named = [e for e in found if Path(_name(e)).stem in chosen] or found
    if len(named) == 1:
        return named[0]
    if not named:
        raise InputError(f"has no {kind}; one is needed")
    stems = [Path(_name(e)).stem for e in named]
    alike = len(set(stems)) == 1
    right = "leave one in a copy of the world" if alike else f"choose one: {path.name}#{stems[0]}"
    raise InputError(f"has {len(named)} {kind}s ({', '.join(stems)}); {right}")


def _found(e: Element, path: Path) -> Path:
    name = _name(e)
    if not name:
        raise InputError("names no file; save what is written out in the world as a file of its own", field=e.tag)
    for folder in path.resolve().parents:
        if os.path.isfile(folder / name):  # False, too, for what can be no name
            return folder / name
    raise InputError(f"its file '{name}' was not found upwards from {path.resolve().parent}", field=e.tag)


def joint_values(text: str, dofs: list[Dof], joints: list[ChainJoint]) -> dict[str, float]:
    """Joint values [rad, m] by name from a world's `dofValues` (rad, mm).

    A value for each DOF; after that of a breakaway DOF a flag for each of its joints, and after a flag that is 1 where
    that joint stopped, as a value of the DOF.

    Raises:
        InputError: too few or too many numbers, a value beyond the limits, a compliant DOF: its joints stand where its
            springs, which are not read, put them.
    """
    words = text.split()
    numbers = iter(numbers_in(text, len(words), "dofValues") if words else [])
    values: dict[str, float] = {}
    try:
        for number, dof in enumerate(dofs):
            value = next(numbers)
            if dof.kind == "c" and len(dof.joints) > 1 and value:
                problem = f"dof {number} is compliant: where its joints stand depends on springs, which are not read"
                raise InputError(problem, field="dofValues")
            for j, ratio in dof.joints:
                stopped = dof.kind == "b" and next(numbers) == 1
                values[joints[j].name] = _within(joints[j], ratio * (next(numbers) if stopped else value))
    except StopIteration:
        raise InputError(f"has {len(words)} numbers, too few for {len(dofs)} DOFs", field="dofValues") from None
    if list(numbers):
        raise InputError(f"has {len(words)} numbers, too many for {len(dofs)} DOFs", field="dofValues")
    return {p.name: values.get(p.name, 0.0) for p in joints}


def _within(joint: ChainJoint, value: float) -> float:
    """A value in rad or m, at its limit if it is past it by no more than rounding."""
    unit = MILLI if joint.type == "prismatic" else 1.0
    lower, upper = joint.limits
    value *= unit
    if not lower - WORLD_ROUNDING * unit <= value <= upper + WORLD_ROUNDING * unit:
        raise InputError(f"{joint.name} is {value:g}; the limits are [{lower:g}, {upper:g}]", field="dofValues")
    return min(max(value, lower), upper)
