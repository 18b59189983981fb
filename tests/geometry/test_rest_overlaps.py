"""What two links overlap at rest is not held against them; what they overlap beyond that is."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.transforms import transform
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene, beyond_rest, rest_overlaps
from handfast.model.body import Body
from handfast.model.hand.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape

AWAY = transform([0, 0, -1], np.eye(3))


def two_balls(lower: float = -0.01) -> Hand:
    """Balls of 10 mm, 16 mm apart at rest, each on a joint that slides along x."""
    joints = tuple(Joint(n, "prismatic", np.array([1.0, 0, 0]), np.zeros(3), lower, 0.01) for n in ("a", "b"))
    balls = [
        Link(name, 0, transform([x, 0, 0.1], np.eye(3)), (k,), (Shape("sphere", 0.01),))
        for k, (name, x) in enumerate((("left", -0.008), ("right", 0.008)))
    ]
    base = Link("base", -1, np.eye(4), (), (Shape("sphere", 0.01),))
    return Hand("balls", (base, *balls), joints, Mechanism.direct(["a", "b"]), (), np.zeros(2))


def scene(hand: Hand) -> Scene:
    return Scene(hand, Body.of([Shape("sphere", 0.01)]))


def between(found: Collisions, q: Array) -> float:
    clearances = found.clearances(q, AWAY)
    return float(clearances.between[clearances.pairs.index(("left", "right"))])


def test_an_overlap_counts_from_the_one_at_rest_on() -> None:
    one = scene(two_balls())
    rest = rest_overlaps(one)
    assert rest.sum() == pytest.approx(0.004)
    found = Collisions(one, at_rest=rest)
    assert between(found, np.array([0.0, 0.0])) == 0
    assert between(found, np.array([0.001, 0.0])) == pytest.approx(-0.001)
    assert between(found, np.array([0.0, 0.005])) == pytest.approx(0.001)
    assert between(Collisions(one), np.array([0.001, 0.0])) == pytest.approx(-0.005)
    assert found.clearances(np.array([0.0009, 0.0]), AWAY).free()
    assert not found.clearances(np.array([0.002, 0.0]), AWAY).free()


def test_steps_take_apart_what_is_deeper_than_at_rest() -> None:
    one = scene(two_balls())
    found = Collisions(one, at_rest=rest_overlaps(one))
    assert found.separations(np.zeros(2), AWAY) == []
    (deeper,) = found.separations(np.array([0.002, 0.0]), AWAY)
    assert deeper.distance == pytest.approx(-0.002)
    (near,) = found.separations(np.array([0.0, 0.0045]), AWAY)
    assert near.distance == pytest.approx(0.0005)


def test_joints_that_are_held_away_from_zero_are_not_at_rest() -> None:
    held = scene(two_balls(lower=0.001))  # both at 1 mm, as a task may fix them
    assert rest_overlaps(held).sum() == pytest.approx(0.004)
    assert not rest_overlaps(held, at_zero=True).any()
    assert rest_overlaps(scene(two_balls()), at_zero=True).sum() == pytest.approx(0.004)


def test_distances_beyond_rest() -> None:
    distances, rest = np.array([-3.0, -1.0, 2.0, -1.0]), np.array([1.0, 2.0, 1.0, 0.0])
    np.testing.assert_array_equal(beyond_rest(distances, rest), [-2, 0, 2, -1])
