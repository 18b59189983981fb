"""A load's path beside a simulation of the same load: contact forces load by load, where each of them ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.simulation.result import SimulationResult
from handfast.stability.answers import CheckAnswer, MaxAnswer
from handfast.stability.answers.load_path import LoadPath

MULTIPLE_TOLERANCE = 1e-9  # relative: the simulated load is a multiple of the path's


@dataclass(frozen=True, eq=False)
class PathBeside:
    """A path and a simulation at the same loads. Magnitudes are multiples of the load that the path was asked about.

    Attributes:
        magnitudes: (k,) of the path's states, as far as the simulation's load goes.
        path: (k, m) [N] normal forces of these states; simulated: (k, m) [N] the engine's when that load acts.
        reached: the last magnitude that the path reaches; slips_at: one that it is shown not to; None if not shown.
        largest: the magnitude that was simulated. ending: of the simulation.
        onset: the magnitude at which the slip began in it; None if there is none.
    """

    magnitudes: Array
    path: Array
    simulated: Array
    reached: float
    slips_at: float | None
    largest: float
    ending: str
    onset: float | None

    @property
    def apart(self) -> Array:
        """(k,) the largest difference of normal forces at each magnitude, relative to the largest of the path's."""
        least = np.maximum(np.abs(self.path).max(axis=1), 1e-300)
        return np.asarray(np.abs(self.path - self.simulated).max(axis=1) / least)

    def lines(self) -> list[str]:
        """Where both end, and how far apart they are at each load, in words."""
        if self.slips_at is not None:
            end = f"the path ends at {self.reached:.4g} of the load"
        else:
            end = f"the path goes on to {self.reached:.4g} times the load"
        onset = "does not slip" if self.onset is None else f"begins to slip at {self.onset:.4g}"
        shown = dict.fromkeys((0, len(self.magnitudes) // 2, len(self.magnitudes) - 1))
        apart = ", ".join(f"{100 * self.apart[k]:.2g} % at {self.magnitudes[k]:.3g}" for k in shown)
        worst = f"{100 * float(self.apart.max()):.2g} %"
        return [f"{end}; the simulation {onset}", f"normal forces differ by {apart} of the load, {worst} at most"]

    def to_json(self) -> dict[str, Any]:
        """One JSON object."""
        rows = zip(self.magnitudes.tolist(), self.path.tolist(), self.simulated.tolist(), strict=True)
        return {
            "reached": self.reached,
            "slips_at": self.slips_at,
            "simulated_to": self.largest,
            "ending": self.ending,
            "onset": self.onset,
            "loads": [{"magnitude": m, "path": p, "simulated": s} for m, p, s in rows],
        }


def beside_path(answer: CheckAnswer | MaxAnswer, found: SimulationResult) -> PathBeside:
    """A path's states and what a simulation has at the same loads.

    Args:
        answer: of `check` or `maximum` with loading="preload-first".
        found: a simulation of the same grasp with the commands first, under a multiple of the same load. It begins
            where the path does if the commands grow slowly, `simulate(..., closing=4)`.

    Raises:
        InputError: the answer has no path, or none that begins; the simulation is of another load or way of loading.
    """
    path = answer.path
    if not isinstance(path, LoadPath):
        raise InputError("has no path; ask with loading='preload-first'", field="answer")
    if path.reached is None:
        raise InputError("has a path that does not begin: no state of the commands alone is shown", field="answer")
    if found.loading != "preload-first":
        raise InputError(f"is loaded '{found.loading}'; 'preload-first' is needed beside a path", field="found")
    load = path.whole.problem.wrench
    largest = float(found.wrench @ load / (load @ load))
    if not (
        largest > 0 and np.abs(found.wrench - largest * load).max() <= MULTIPLE_TOLERANCE * np.abs(found.wrench).max()
    ):
        raise InputError("is of another load than the path; simulate a multiple of it", field="found")
    states = [
        (m, s.witness)
        for m, s in zip(path.magnitudes, path.held, strict=False)
        if m <= largest * (1 + MULTIPLE_TOLERANCE)
    ]
    magnitudes = np.array([m for m, _ in states])
    return PathBeside(
        magnitudes, np.array([w.state.c[::3] for _, w in states if w is not None]),
        _forces_at(found, magnitudes / largest), path.reached, path.slips_at, largest, str(found.ending),
        None if found.onset is None else found.onset * largest,
    )  # fmt: skip


def _forces_at(found: SimulationResult, shares: Array) -> Array:
    """(k, m) [N] normal forces of a simulation when these shares of its load first acted."""
    before = int(np.flatnonzero(found.load <= 0)[-1])  # the last moment of the commands alone
    load, forces = found.load[before:], found.forces[before:, :, 0]
    until = int(np.argmax(load >= load[-1])) + 1
    return np.array([np.interp(shares, load[:until], row[:until]) for row in forces.T]).T
