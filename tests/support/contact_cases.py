"""Hands and objects whose contacts are worked out by hand."""

from __future__ import annotations

import numpy as np

from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.contacts import find_contacts
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape

NO_MOTION = Mechanism((), np.zeros((0, 0)), np.zeros((0, 0)), ())


def jointless(*shapes: Shape) -> Hand:
    """A hand without joints: one link per shape."""
    links = [Link("base", -1, np.eye(4))]
    links += [Link(s.name or f"part_{i}", 0, np.eye(4), (), (s,)) for i, s in enumerate(shapes)]
    return Hand("fixture", tuple(links), (), NO_MOTION, (), np.zeros(0))


def contacts_of(hand: Hand, *pieces: Shape, at: object = (0, 0, 0), **options: object) -> tuple:
    return find_contacts(hand, np.zeros(hand.l), Body.of(pieces), transform(at), **options)


def random_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return transform(rng.normal(size=3), quaternion_matrix(rng.normal(size=4)))


def pinching(sign: float = 1.0) -> Hand:
    """Two fingers that pinch along y; the second one's joint runs backwards if `sign` is -1."""
    solid = Shape("sphere", 0.01, transform([0.05, 0, 0]))
    axes = (np.array([0, 0, -1.0]), sign * np.array([0, 0, 1.0]))
    limits = ((0, 1), (0, 1) if sign > 0 else (-1, 0))
    joints = [Joint(n, "revolute", a, np.zeros(3), *r) for n, a, r in zip("ab", axes, limits, strict=True)]
    joints.append(Joint("idle", "revolute", np.array([1.0, 0, 0]), np.zeros(3), 0, 1))
    links = (
        Link("palm", -1, np.eye(4)),
        Link("left", 0, transform([0, 0.03, 0]), (0,), (solid,)),
        Link("right", 0, transform([0, -0.03, 0]), (1,), (solid,)),
        Link("spare", 0, transform([-1, 0, 0]), (2,), (solid,)),
    )
    R = np.array([[2.0, 0, 0], [0, 3.0, 0], [0, 0, 1.0]])
    mechanism = Mechanism(("ma", "mb", "mi"), R, np.zeros((0, 3)), (False,) * 3)
    return Hand("pinch", links, tuple(joints), mechanism, (), np.array([1, sign, 1]))


def linked_finger(R: np.ndarray, A: np.ndarray, closing: tuple[float, ...], tendon: bool = False) -> Hand:
    """A finger of three joints about z, of which the first alone moves the touching link; a palm; a slide besides."""
    ball = Shape("sphere", 0.01, transform([0.05, 0, 0]))
    axis, zero = np.array([0, 0, 1.0]), np.zeros(3)
    joints = [Joint(name, "revolute", axis, zero, -1, 1) for name in "abc"]
    joints.append(Joint("s", "prismatic", np.array([0, 1.0, 0]), zero, -1, 1))
    links = (
        Link("palm", -1, np.eye(4), (), (Shape("sphere", 0.01, transform([-0.05, 0, 0])),)),
        Link("one", 0, np.eye(4), (0,), (ball,)),
        Link("two", 1, transform([0, 0, 1]), (1,)),
        Link("three", 2, np.eye(4), (2,)),
        Link("sled", 0, transform([0, 0, 0.2]), (3,), (ball,)),
    )
    names = tuple(f"m{i}" for i in range(len(R)))
    return Hand("linked", links, tuple(joints), Mechanism(names, R, A, (tendon,) * len(R)), (), np.array(closing))


def contact_on(link: str) -> list[Contact]:
    return [Contact(np.zeros(3), np.array([1.0, 0, 0]), 0.5, link)]
