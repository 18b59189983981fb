"""Handfast's own measure: how large a wrench the grasp resists passively, in the worst of some directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.wrench_scale import WrenchScale
from handfast.model.grasp import Grasp
from handfast.stability.problem.scaled_problem import beyond_range
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import max_many

NODES, GAP = 1000, 1e-2  # of each direction's search: a limit that every machine meets at the same place


@dataclass(frozen=True, eq=False)
class PassiveMaxima:
    """The largest resisted wrench in twelve directions (stability paper, (23) to (25)), with the grasp's commands.

    Attributes:
        names: of the directions, see `WrenchScale.axes`.
        lower: (12,) [N] shown to be resisted, of a torque divided by the characteristic length; inf if unbounded.
        upper: (12,) [N] no more is resisted.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for field in ("lower", "upper"):
            values = np.array(getattr(self, field), dtype=float)  # some may be infinite
            values.flags.writeable = False
            object.__setattr__(self, field, values)

    @property
    def worst(self) -> tuple[float, float]:
        """Bounds [N] of the smallest of the maxima: shown to be resisted, and at most."""
        return float(self.lower.min()), float(self.upper.min())

    @property
    def worst_direction(self) -> str:
        """The name of the direction with the smallest maximum that is shown."""
        return self.names[int(np.argmin(self.lower))]


def passive_maxima(
    grasp: Grasp, scale: WrenchScale | None = None, *, settings: Settings | None = None, jobs: int | None = 1
) -> PassiveMaxima:
    """Ask `maximum` in the twelve directions of a scale.

    Args:
        scale: `WrenchScale.of(grasp)` unless given.
        settings: of each search; unless given, bounds within 1 % are enough and 1000 nodes are the most. An interval
            between the bounds is left where that does not suffice.
        jobs: cores to use.
    """
    chosen = scale or WrenchScale.of(grasp)
    names, wrenches = chosen.axes()
    G = chosen.grasp_map(grasp)
    possible = np.array([beyond_range(G, u) is None for u in chosen.scaled(wrenches.T).T])
    asked = settings or Settings(nodes=NODES, gap=GAP, verify=False)
    lower, upper = np.zeros(len(names)), np.zeros(len(names))
    if possible.any():
        found = max_many(grasp, wrenches[possible], settings=asked, jobs=jobs)
        known = found.error == ""  # all of them, unless Ctrl-C came first
        lower[possible] = np.where(found.unbounded, np.inf, np.where(known, found.lower, 0.0))
        upper[possible] = np.where(known & ~found.unbounded, found.upper, np.inf)
    return PassiveMaxima(names, lower, upper)
