"""Contacts of flat faces: what lies between others is left out, and nothing that can be held is lost."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.planning.filters.balance import imbalance
from handfast.planning.filters.spanning import spanning

UP = np.array([0.0, 0.0, 1.0])


def contact(x: float, y: float, *, z: float = 0.0, normal: object = UP, link: str = "pad") -> Contact:
    n = np.asarray(normal, dtype=float)
    return Contact(np.array([x, y, z]), n / np.linalg.norm(n), 0.5, link)


def test_corners_of_a_face_and_ends_of_a_line_stay() -> None:
    grid = [contact(0.01 * i, 0.01 * j) for i in range(3) for j in range(3)]
    assert spanning(grid) == (grid[0], grid[2], grid[6], grid[8])
    line = [contact(0.01 * i, 0.005 * i) for i in (1, 0, 3, 2)]
    assert spanning(line) == (line[1], line[2])
    assert spanning(line[:1]) == (line[0],)
    assert spanning(()) == ()


@pytest.mark.parametrize(
    "other",
    [
        contact(0.01, 0, link="tip"),
        contact(0.01, 0, z=1e-3),
        contact(0.01, 0, normal=(0.01, 0, 1)),
        Contact(np.array([0.01, 0, 0]), UP, 0.4, "pad"),
    ],
)
def test_only_contacts_of_one_face_stand_for_each_other(other: Contact) -> None:
    ends = [contact(0, 0), contact(0.02, 0)]
    assert spanning([*ends, other]) == (*ends, other)
    assert spanning([*ends, contact(0.01, 0)]) == tuple(ends)


def test_of_many_corners_the_four_that_are_spread_most_stay() -> None:
    around = np.radians([0, 40, 90, 140, 180, 220, 270, 320])
    ring = [contact(0.02 * np.cos(a), 0.01 * np.sin(a)) for a in around]
    few = spanning(ring)
    assert few == (ring[0], ring[2], ring[4], ring[6])
    rng = np.random.default_rng(0)
    loads = rng.standard_normal((30, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    whole, spanned = (imbalance(Grasp(c), loads) for c in (ring, few))
    assert (spanned[whole > 0] > 0).all()  # nothing is balanced that the whole face does not balance


def test_no_load_is_lost() -> None:
    rng = np.random.default_rng(3)
    below = [contact(*rng.uniform(-0.02, 0.02, 2)) for _ in range(12)]
    above = [contact(*rng.uniform(-0.02, 0.02, 2), z=0.03, normal=-UP, link="jaw") for _ in range(12)]
    few = spanning([*below, *above])
    assert len(few) < 20
    loads = rng.standard_normal((30, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    whole, spanned = (imbalance(Grasp(c), loads) for c in ((*below, *above), few))
    np.testing.assert_array_equal(whole > 0, spanned > 0)
    assert not whole.all()
