"""Programs over second-order cones with solutions by hand, and where their paths end."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.stability.search.interior_point import CENTRED, Cones, minimum

END = 1e-10


def ball(points: np.ndarray) -> Cones:
    """Over (x, radius): |x - p| <= radius of each point (K, 2)."""
    rows, offset = np.zeros((len(points), 4, 3)), np.zeros((len(points), 4))
    rows[:, 0, 2], rows[:, 1:3, :2], offset[:, 1:3] = 1.0, np.eye(2), -points
    return Cones(rows, offset)


def box(n: int) -> Cones:
    """0 <= x <= 1."""
    return Cones.at_least(np.vstack([np.eye(n), -np.eye(n)]), np.r_[np.zeros(n), np.ones(n)])


def test_the_smallest_ball() -> None:
    """Round (-1, 0), (1, 0) and (0, 0.5): the two that are farthest apart decide, the radius is 1 round the origin."""
    cones = ball(np.array([(-1.0, 0.0), (1.0, 0.0), (0.0, 0.5)]))
    found = minimum(cones, np.array([0.0, 0.0, 1.0]), np.zeros((3, 3)), END)
    assert found is not None
    np.testing.assert_allclose(found, [0, 0, 1], atol=1e-6)
    assert (cones.room(found) > 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_no_point_does_better(seed: int) -> None:
    """The radius of a ball round twelve random points, against balls round a hundred middles near its own."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 2))
    found = minimum(ball(points), np.array([0.0, 0.0, 1.0]), np.zeros((3, 3)), END)
    assert found is not None
    assert found[2] == pytest.approx(np.linalg.norm(points - found[:2], axis=1).max(), rel=1e-8)
    for middle in found[:2] + 0.1 * rng.normal(size=(100, 2)):
        assert np.linalg.norm(points - middle, axis=1).max() >= found[2] - 1e-8


def test_a_quadratic_cost_within_a_box() -> None:
    """(x - 3)^2 + (y - 0.5)^2 in the unit square: (1, 0.5)."""
    found = minimum(box(2), -2 * np.array([3.0, 0.5]), 2 * np.eye(2), END)
    assert found is not None
    np.testing.assert_allclose(found, [1, 0.5], atol=1e-8)


def test_the_path_ends_inside() -> None:
    """Nothing to be made small: x and 1 - x times their multipliers are alike, and the multipliers balance: x = 1/2.

    With cost x, 1 = end / x - end / (1 - x): for end = 0.1 that is x^2 - 1.2 x + 0.1 = 0.
    """
    middle = minimum(box(1), np.zeros(1), np.zeros((1, 1)), 0.1)
    assert middle is not None
    np.testing.assert_allclose(middle, 0.5, rtol=CENTRED)
    found = minimum(box(1), np.ones(1), np.zeros((1, 1)), 0.1)
    assert found is not None
    np.testing.assert_allclose(found, 0.6 - np.sqrt(0.26), rtol=CENTRED)


def test_nothing_is_inside() -> None:
    cones = Cones.at_least(np.array([[1.0], [-1.0]]), np.array([-1.0, 0.0]))  # x >= 1 and x <= 0
    assert minimum(cones, np.ones(1), np.zeros((1, 1)), END) is None


def test_without_a_cone() -> None:
    found = minimum(box(2).with_(box(2)).felt(), np.zeros(2), np.eye(2), END)
    assert found is not None
    unfelt = Cones(np.zeros((3, 4, 2)), np.ones((3, 4))).felt()
    assert len(unfelt.offset) == 0
    lowest = minimum(unfelt, np.array([-2.0, 4.0]), 2 * np.eye(2), END)
    assert lowest is not None
    np.testing.assert_allclose(lowest, [1, -2])
