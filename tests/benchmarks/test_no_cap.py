"""Grasps of contacts on one line, and that the attack on bounds finds what contradicts them."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.no_cap import attacked, collinear
from handfast.stability.studies.questions import maximum

FIRST = 900_000


@pytest.mark.parametrize("k", range(24))
def test_contacts_are_on_one_line_that_the_force_meets(k: int) -> None:
    kind, grasp, direction, _ = collinear(k, FIRST)
    places = np.array([c.position for c in grasp.contacts])
    along = (places[-1] - places[0]) / np.linalg.norm(places[-1] - places[0])
    np.testing.assert_allclose(np.cross(places - places[0], along), 0, atol=1e-15)
    about = direction[3:] - np.cross(places[0], direction[:3])  # the torque about a point on the line
    assert abs(along @ about) < 1e-15
    assert len(places) == 2 + k % 3
    assert sorted({round(float(abs(c.normal @ along))) for c in grasp.contacts}) == (
        [0] if kind.startswith("across") else [1] if len(places) == 2 else [0, 1]
    )
    for j, f in zip(grasp.joints, grasp.command, strict=True):  # what is commanded presses
        c = grasp.contacts[j.moves[0]]
        assert np.cross(j.axis, c.position - j.origin) @ c.normal > 0.02
        assert f >= 0


def test_wrong_bounds_are_contradicted() -> None:
    _, grasp, direction, _ = collinear(0, FIRST)
    found = maximum(grasp, direction)
    assert attacked(grasp, direction, {}, (found.lower, found.upper), 0) == []
    below = attacked(grasp, direction, {}, (found.lower, 0.5 * found.upper), 0)
    assert "check holds at 1.3 times the bound" in below
    assert "check slips at the lower bound" in attacked(grasp, direction, {}, (2 * found.upper, np.inf), 0)
