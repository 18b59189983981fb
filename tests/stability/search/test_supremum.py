"""Maxima that are only approached: limits derived by hand, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.stability.answers.check_query import ask as check
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

TWIST = np.eye(6)[5]
DOWN = -np.eye(6)[2]


def cup(slope: float, radius: float, friction: float, points: int = 3) -> list[Contact]:
    """Points on a circle whose walls rise at `slope`: normals lean inwards, and up by sin(slope).

    A body that sinks by h in it slides down the walls, by h cos(slope), while d_n = -h sin(slope). Turned about the
    upright axis it slides along the circle. Friction is against both together, so the more it turns the less
    friction helps to carry. With m the share of friction along the slope,

        k c_n (sin(slope) + mu m cos(slope)) = W,    torque = k mu c_n R sqrt(1 - m^2)
                                                           = mu W R sqrt(1 - m^2) / (sin(slope) + mu m cos(slope)),

    which grows as m > 0 falls to 0, where nothing but a turn without end leads: the limit is mu W R / sin(slope).
    """
    out = []
    for angle in 2 * np.pi * np.arange(points) / points:
        outward = np.round([np.cos(angle), np.sin(angle), 0.0], 15)  # four points lie on the axes exactly
        normal = np.array([0.0, 0.0, np.sin(slope)]) - np.cos(slope) * outward
        out.append(Contact(radius * outward, normal / np.linalg.norm(normal), friction))
    return out


@pytest.mark.parametrize(("slope", "friction", "weight"), [(1.2, 0.3, 5.0), (0.9, 0.2, 1.0)])
def test_a_weight_in_a_cup(slope: float, friction: float, weight: float) -> None:
    """The torque that a weight in a conical cup resists."""
    grasp = Grasp(cup(slope, 0.05, friction))
    answer = maximum(grasp, TWIST, base=weight * DOWN, settings=Settings(gap=1e-4))
    limit = friction * weight * 0.05 / np.sin(slope)
    assert answer.stop is Stop.COMPLETE
    assert answer.verdict is Verdict.HOLDS
    assert not answer.attained
    assert answer.limit is not None
    assert answer.limit.value == pytest.approx(limit, rel=1e-6)
    assert answer.lower < limit <= answer.upper
    assert answer.upper <= limit * (1 + 2e-4)
    assert answer.limit.slides == (0, 1, 2)
    assert answer.limit.words.startswith("the object turns about the line through (0, 0, 0) m along (0, 0, ")
    assert answer.to_json()["attained"] is False
    assert answer.to_json()["limit"]["value"] == answer.limit.value


@pytest.mark.parametrize("force", [2.0, 0.01])
def test_a_finger_presses_into_a_cup(force: float) -> None:
    """The same with a prismatic finger that presses down without friction in place of the weight."""
    slope, friction, radius = 1.1, 0.25, 0.04
    finger = Contact([0.0, 0.0, 0.03], [0.0, 0.0, -1.0], 0.0)
    joint = GraspJoint("push", [0.0, 0.0, -1.0], [0.0, 0.0, 0.0], (4,), "prismatic")
    grasp = Grasp([*cup(slope, radius, friction, 4), finger], [joint], preload={"push": force})
    answer = maximum(grasp, TWIST, settings=Settings(gap=1e-4))
    limit = friction * force * radius / np.sin(slope)
    assert answer.stop is Stop.COMPLETE
    assert answer.limit is not None
    assert answer.limit.value == pytest.approx(limit, rel=1e-6)
    assert answer.lower < limit <= answer.upper <= limit * (1 + 2e-4)
    assert check(grasp, 1.001 * answer.upper * TWIST).verdict is Verdict.SLIPS
    assert check(grasp, 0.999 * answer.lower * TWIST).verdict is Verdict.HOLDS


def test_what_is_attained_is_no_limit() -> None:
    """A weight on a table that is pushed: friction at its full strength holds without any motion."""
    corners = [Contact([x, y, 0.0], [0.0, 0.0, 1.0], 0.5) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    answer = maximum(Grasp(corners), np.eye(6)[0], base=4 * DOWN)
    assert answer.lower == pytest.approx(2.0, rel=2e-3)
    assert answer.attained
    assert answer.to_json()["limit"] is None
