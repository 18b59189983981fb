"""Scenes in which something slides or rolls, and where it comes to rest is known by hand."""

from __future__ import annotations

import numpy as np

from handfast.core.transforms import transform
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.simulation.settling import GraspInScene

DIAGONAL = np.array([[1.0, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)  # a quarter of a half turn about z


def fixture(*shapes: Shape) -> Hand:
    """Solids that do not move."""
    still = Mechanism((), np.zeros((0, 0)), np.zeros((0, 0)), ())
    return Hand("fixture", (Link("table", -1, np.eye(4), (), shapes),), (), still, (), np.zeros(0))


def placed(hand: Hand, body: Body, position: list[float], friction: float, **command: float) -> GraspInScene:
    """The object at a position, its axes those of the hand, joints at 0."""
    scene, q, pose = Scene(hand, body), np.zeros(hand.l), transform(position)
    grasp = contact_grasp(hand, q, body, pose, scene=scene, friction=friction, preload=command or None)
    return GraspInScene(grasp, scene, q, pose)


def block_and_stop(gap: float, friction: float) -> GraspInScene:
    """A block of 40 mm on a table, a wall at a distance in front of it along x."""
    table = Shape("box", (0.4, 0.4, 0.02), transform([0, 0, -0.01]))
    wall = Shape("box", (0.02, 0.4, 0.1), transform([0.02 + gap + 0.01, 0, 0.05]))
    return placed(fixture(table, wall), Body.of([Shape("box", (0.04, 0.04, 0.02))]), [0, 0, 0.01], friction)


def ball_in_groove(radius: float, up: float, friction: float) -> GraspInScene:
    """A ball on the right side of a groove of two walls at 45 degrees, its centre higher by `up` than in its bottom."""
    walls = [
        Shape("box", (0.4, 0.02, 0.2), transform(offset, turn))
        for offset, turn in (
            (-0.01 * DIAGONAL[:, 1], DIAGONAL),  # rises to the right
            (-0.01 * DIAGONAL[:, 0], DIAGONAL[:, [1, 0, 2]] * [-1, 1, 1]),  # and to the left
        )
    ]
    bottom = radius * np.sqrt(2)
    return placed(fixture(*walls), Body.of([Shape("sphere", radius)]), [up, bottom + up, 0.0], friction)


def pinch_of_balls(friction: float, command: float) -> GraspInScene:
    """A block of 40 mm between a fixed ball and one on a slide that closes along -x."""
    fixed = Shape("sphere", 0.01, transform([-0.03, 0, 0]))
    driven = Shape("sphere", 0.01, transform([0.03, 0, 0]))
    slide = Joint("slide", "prismatic", np.array([-1.0, 0, 0]), np.zeros(3), -0.05, 0.05)
    links = (Link("palm", -1, np.eye(4), (), (fixed,)), Link("finger", 0, np.eye(4), (0,), (driven,)))
    hand = Hand("pincher", links, (slide,), Mechanism.direct(["slide"]), (), np.ones(1))
    return placed(hand, Body.of([Shape("box", (0.04, 0.1, 0.1))]), [0, 0, 0], friction, slide=command)
