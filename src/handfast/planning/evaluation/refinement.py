"""A grasp that holds, made a better one: off the limits, out of shallow overlaps, with friction to spare.

Random starts are content with a joint a ten-thousandth of a radian from its limit. A few steps along the set of
certified configurations bring a grasp inwards. That it still holds is for the caller to decide anew.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.planning.evaluation.evaluator import Evaluator, GraspCandidate
from handfast.planning.evaluation.steps import Steps

ROUNDS = 12
LENGTHS = (0.02, 0.06, 0.15)  # of the steps, in the measure of `distance`
ENOUGH = 0.15  # of the range between a joint's limits, or of a patch's side: more room than that is not asked for
SHALLOW = 1e-3  # [m] of overlap, or share of friction short, that weighs as much as `ENOUGH` of room


class GraspRefinement:
    """Improves candidates that nothing forbids."""

    def __init__(self, evaluator: Evaluator, steps: Steps) -> None:
        self.evaluator, self.steps = evaluator, steps
        problem = evaluator.problem
        self.width = problem.flat.coordinates.upper - problem.flat.coordinates.lower
        self.bounded: Mask = np.array(
            [
                k.startswith("joint:") or (k.startswith("contact:") and w <= 1.0)
                for k, w in zip(problem.labels, self.width, strict=True)
            ]
        )

    def refined(self, c: GraspCandidate) -> GraspCandidate:
        """The best candidate on the way, which may be the first."""
        now, fails = c, 0
        for round_ in range(ROUNDS):
            inwards = self.inwards(now) if round_ % 2 == 0 else None
            new = self.steps.anywhere(now, LENGTHS) if inwards is None else self.steps.along(now, inwards, LENGTHS)
            found = [k for k in (self.evaluator.candidate(x) for x in new) if k and k.possible]
            best = max(found, key=self.quality, default=now)
            if self.quality(best) > self.quality(now) + 1e-3:
                now, fails = best, 0
            else:
                fails += 1
                if fails == 4:
                    break
        return now

    def quality(self, c: GraspCandidate) -> float:
        """Room to the limits, up to enough of it, less overlap and friction that is missing at a smaller share."""
        overlap = min(c.clearances.least_to_object, c.clearances.least_between, 0.0)
        return min(float(self.room(c).min(initial=ENOUGH)), ENOUGH) / ENOUGH + overlap / SHALLOW - c.cost

    def room(self, c: GraspCandidate) -> Array:
        """Distance of each bounded coordinate to its nearer bound, as a share of its range."""
        flat, x = self.evaluator.problem.flat, c.certified.x
        room = np.minimum(x - flat.coordinates.lower, flat.coordinates.upper - x)[self.bounded]
        return np.asarray(room / self.width[self.bounded])

    def inwards(self, c: GraspCandidate) -> Array | None:
        """(n,) away from the bounds that are near, in coordinates times the weights of `Walks`; None if none is."""
        flat, x = self.evaluator.problem.flat, c.certified.x
        g = np.zeros(len(x))
        short = np.maximum(0.0, ENOUGH - self.room(c))
        middle = (flat.coordinates.lower + flat.coordinates.upper)[self.bounded] / 2
        g[self.bounded] = short * np.sign(middle - x[self.bounded]) / self.width[self.bounded]
        return np.asarray(g / self.steps.walks.weight) if g.any() else None
