"""Two contacts under a load: configurations moved to where it has no moment about the line through both.

Forces at two points have no moment about the line between them, so the load must have none. That is an equation of the
task beside those of the contacts, which random starts and steps never meet. It is solved along a step on the set of
certified configurations, by regula falsi and bisection on the step's length.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.planning.filters.balance import POINT
from handfast.stability.problem.loads import Loads
from handfast.synthesis.search.starts import Certified, Walks

LENGTHS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # of steps, up to the first beyond the solution; the measure of `distance`
ROUNDS = 40  # of steps between two that are on either side of it
EXACT = 1e-14  # of the regions' distance from the origin and of each other: an arm that is none
PROPORTIONAL = 1e-12  # relative: loads that are multiples of one another
SMALL = 1e-6  # of a parameter, for differences


class LineBalance:
    """The equation of two contacts, and its solution.

    Attributes:
        load: (6,) of which all loads are multiples; None if there is no such equation to solve.
    """

    def __init__(self, walks: Walks, loads: Loads) -> None:
        self.walks, self.load = walks, None
        pairs = walks.problem.task.contact_pairs
        self.regions = [pair.object for pair in pairs]
        largest = loads.wrenches[np.abs(loads.wrenches).max(axis=1).argmax()]
        shares = loads.wrenches @ largest / (largest @ largest)
        rest = np.abs(loads.wrenches - shares[:, None] * largest).max()
        if len(pairs) == 2 and largest[:3].any() and rest <= PROPORTIONAL * np.abs(largest).max():
            self.load = largest / np.linalg.norm(largest[:3])
        labels = walks.problem.labels
        self.columns = [labels.index(f"contact:{k}:{name}") for k in range(len(pairs)) for name in "st"]
        self.size = max(region.outermost for region in self.regions)

    def arm(self, parameters: Array) -> float:
        """[m] of the load about the line through both contacts, at the parameters (4,) of their regions."""
        first, second = (r.at(*parameters[2 * k : 2 * k + 2]) for k, r in enumerate(self.regions))
        turn = second - first
        assert self.load is not None
        moment = self.load[:3] @ np.cross(first, second) + self.load[3:] @ turn
        return float(moment / max(float(np.linalg.norm(turn)), POINT))

    def balanced(self, certified: Certified) -> Certified:
        """Near a certified configuration one without an arm; itself where none is found or no equation is to solve."""
        if self.load is None:
            return certified
        here = certified.x[self.columns]
        low, at_low, high, at_high = 0.0, self.arm(here), 0.0, 0.0
        if abs(at_low) <= EXACT * self.size:
            return certified
        sides = SMALL * np.eye(4)
        slope = np.zeros(len(certified.x))
        slope[self.columns] = [(self.arm(here + d) - self.arm(here - d)) / (2 * SMALL) for d in sides]
        direction = -np.sign(at_low) * slope / self.walks.weight
        for length in LENGTHS:
            found = self._step(certified, direction, length)
            if found is None:
                return certified
            value = self.arm(found.x[self.columns])
            if value * at_low <= 0:
                high, at_high = length, value
                break
            low, at_low = length, value
        for k in range(ROUNDS if high else 0):
            between = (low + high) / 2 if k % 4 == 3 else high - at_high * (high - low) / (at_high - at_low)
            found = self._step(certified, direction, between)
            if found is None:
                return certified
            value = self.arm(found.x[self.columns])
            if abs(value) <= EXACT * self.size:
                return found
            if value * at_low > 0:
                low, at_low = between, value
            else:
                high, at_high = between, value
        return certified

    def _step(self, certified: Certified, direction: Array, length: float) -> Certified | None:
        found = self.walks.steps(certified.x[None], direction[None], np.array([length]))
        return found[0] if found else None
