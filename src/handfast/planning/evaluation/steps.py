"""Steps from one candidate to a better one, along the set of certified configurations.

They go where the distances grow (`gradient`) or anywhere, and each is certified anew before it counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.geometry.collision import SeparationVector
from handfast.planning.evaluation.evaluator import DEEP, Evaluator, GraspCandidate, requests
from handfast.planning.evaluation.gradient import Gradients
from handfast.synthesis.search.diverse import Walks
from handfast.synthesis.search.starts import Certified

AIR = 5e-4  # [m] further apart than allowed: where a step away aims
SLACK = 2e-3  # room to every bound below which a step does not press on it; in coordinates


class Steps:
    """Steps from a candidate, most of them downhill."""

    def __init__(self, evaluator: Evaluator, walks: Walks, rng: np.random.Generator) -> None:
        self.evaluator, self.walks, self.rng = evaluator, walks, rng
        self.gradients = Gradients(evaluator.problem)

    def away(self, c: GraspCandidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps that take apart what penetrates; [] if nothing does."""
        direction = self.direction(c)
        return [] if direction is None else self.along(c, direction, lengths)

    def along(self, c: GraspCandidate, direction: Array, lengths: Sequence[float]) -> list[Certified]:
        """Steps along what is tangent of a direction (n,), in coordinates times the weights of `Walks`."""
        m = len(lengths)
        return self.walks.steps(np.tile(c.certified.x, (m, 1)), np.tile(direction, (m, 1)), np.array(lengths))

    def anywhere(self, c: GraspCandidate, lengths: Sequence[float]) -> list[Certified]:
        """Steps in random directions."""
        begin = np.tile(c.certified.x, (len(lengths), 1))
        return self.walks.steps(begin, self.rng.standard_normal(begin.shape), np.array(lengths))

    def direction(self, c: GraspCandidate) -> Array | None:
        """(n,) downhill for the penetrations, in coordinates times the weights of `Walks`; None if there are none."""
        allowed, x = self.evaluator.allowed, c.certified.x
        limit = {True: AIR - allowed.depth, False: AIR - allowed.self_depth}
        g = np.zeros(len(x))
        for p in self.evaluator.collisions.separations(c.q, c.solution.pose, requests(c.solution), margin=AIR):
            short = limit[p.link_b is None] - p.distance
            if short > 0:
                g += short / DEEP * self.slope(p, c)
        if not g.any():
            return None
        flat = self.evaluator.problem.flat
        low, high = x - flat.coordinates.lower < SLACK, flat.coordinates.upper - x < SLACK
        g = np.where((low & (g < 0)) | (high & (g > 0)), 0.0, g)
        return np.asarray(g / self.walks.weight)

    def slope(self, p: SeparationVector, c: GraspCandidate) -> Array:
        """(n,) of the distance of two points."""
        g = self.gradients
        a = g.link(p.link_a, p.point_a, c.q)
        b = g.object(p.point_b, c.certified.x) if p.link_b is None else g.link(p.link_b, p.point_b, c.q)
        return np.asarray(p.direction @ (a - b))
