"""A GraspIt! world as what Handfast works with: a hand, an object and a configuration."""

from __future__ import annotations

from pathlib import Path

from handfast.core.errors import InputError
from handfast.model.body import Body, load_body
from handfast.model.configuration import Configuration, load_configuration
from handfast.model.graspit_body import GraspitBody, friction_of
from handfast.model.graspit_xml import parse
from handfast.model.hand.graspit import link_materials
from handfast.model.hand.hand import Hand
from handfast.model.hand.load import load_hand


def load_graspit_world(path: str | Path) -> tuple[Hand, Body, Configuration]:
    """Hand, object and configuration of a GraspIt! world; `world.xml#Barrett,mug` chooses among several.

    The object's friction is GraspIt!'s coefficient for its material on the hand's; where links are of several
    materials, the smallest.

    Raises:
        InputError: what `load_configuration`, `load_hand` and `load_body` raise.
    """
    world = load_configuration(path)
    if world.hand is None or world.object is None or not world.hand.lower().endswith(".xml"):
        raise InputError("is no GraspIt! world", source=str(path))
    robot, body = Path(world.hand), Path(world.object)
    hand = load_hand(robot)
    own = GraspitBody.read(body).material
    mu = min(friction_of(own, m) for m in link_materials(parse(robot, ("robot",)), robot))
    return hand, load_body(body, friction=mu), world
