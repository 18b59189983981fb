"""Bodies that some contacts hold under their weight from six sides."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.planning.filters.balance import held_by_contacts
from handfast.proofs.few_contacts import Held
from handfast.stability.problem.loads import Loads

CENTER = np.array([0.002, -0.001, 0.003])


def held(pieces: Shape | list[Shape], friction: float, center: Array = CENTER, **how: Any) -> Held:
    """A body of 1 N under its weight from six sides."""
    some = [pieces] if isinstance(pieces, Shape) else pieces
    body = Body.of(some, mass=1 / 9.81, center_of_mass=center)
    return held_by_contacts(body, how.get("loads", Loads.gravity(body)), how.get("limit", np.inf), friction)


def stone(seed: int, points: int = 7) -> Shape:
    """An irregular solid about its origin."""
    return Shape.hull(np.random.default_rng(seed).normal(size=(points, 3)) * [0.05, 0.03, 0.02])


BALL = Shape("sphere", [0.03])
