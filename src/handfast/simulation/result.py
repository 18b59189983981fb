"""What a simulation answers: how it ends, where the object is then, and how it got there."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array
from handfast.core.files import write_text
from handfast.core.presented import Presented
from handfast.core.schema import written
from handfast.model.grasp import Grasp

# Grasp sizes per second, measured by benchmarks/simulation_floor.py on a slope and a pinch (docs/simulation.md): what
# is 2 % or more below the threshold moves at 3.2e-7 at most, what is 2 % or more above it at 4.7e-5 at least.
REST_RATE = 2.5e-7  # ten times the fastest that rests
SLIP = 4.6e-5  # the slowest that slips
EVIDENT = 5e-4  # what a hundredth of the force unit drives: what gives way in step with the load is slower
CREEPS = 0.5  # of what creep grows by as friction is made softer; a slip does not heed it
LOST_DISTANCE = 0.5  # [grasp sizes] beyond it the contacts are others
FAINT_LOAD = 1e-4  # [force units] a smaller load that nothing resists would drift hardly faster than what rests
SLIP_FACTOR = 10.0  # times what the contacts give way: a grasp that jerked and moved less than this has not slipped


class Ending(StrEnum):
    """What became of the grasp. `ILL_POSED` and `UNDECIDED` are no agreement with anything."""

    HOLDS = "holds"
    SETTLES = "settles"
    SLIPS = "slips"
    UNDECIDED = "undecided"
    ILL_POSED = "ill-posed"


def judge(
    rate: float,
    fastest: float,
    moved: float,
    yielded: float,
    *,
    broken: bool,
    faint: bool = False,
    creeping: bool = False,
) -> Ending:
    """The ending of a simulation.

    Args:
        rate: of the fastest contact at the end [grasp sizes/s].
        fastest: largest rate since the load began to grow.
        moved: of the contact that moved farthest, since then [grasp sizes].
        yielded: how far the contacts gave way at most [grasp sizes].
        broken: whether the engine's numbers ran away.
        faint: whether the load is too small beside the commands to be seen.
        creeping: whether that rate is the engine's own, which grows as its friction is made softer.
    """
    if broken:
        return Ending.ILL_POSED
    if moved > LOST_DISTANCE or rate > SLIP:
        return Ending.SLIPS
    if (rate > REST_RATE and not creeping) or faint:
        return Ending.UNDECIDED
    return Ending.SETTLES if fastest > EVIDENT and moved > SLIP_FACTOR * yielded else Ending.HOLDS


@dataclass(frozen=True, eq=False)
class SimulationResult(Presented):
    """A simulated question. Everything is in SI units and the object's frame as it stood at the beginning.

    Attributes:
        ending: holds, settles, slips, undecided or ill-posed.
        grasp: as it was asked about.
        wrench: (6,) the full load [N, N m].
        loading: "preload-first" or "together".
        onset: share of the load at which the slip began that lasts to the end, or the first one where it settles;
            None if there is none, or if loaded together.
        rate: of the fastest contact point at the end [m/s].
        time: (n,) [s]; of the twin, whose mass is numerical.
        load: (n,) share of the wrench that acted.
        shift, turn: (n, 3) of the object: displacement of the point amid the contacts [m], rotation vector [rad].
        motion: (n,) displacement of the contact point that moved farthest [m], and speed: (n,) the largest [m/s].
        joints: (n, f) displacement [rad, m] of the joints `free`, the others stand.
        free: indices of the joints that could move.
        forces: (n, m, 3) contact forces [N]: normal, and two tangential components.
        steps: of the engine.
        seconds: that it took.
        bodies: whether hand and object themselves were simulated, not the grasp's contacts alone.
        points: (n,) contact points that the engine has; of bodies, several may belong to one contact of the grasp.
        why: of an ill-posed ending, or a load too small to be seen, a sentence.
    """

    ending: Ending
    grasp: Grasp
    wrench: Array
    loading: str
    onset: float | None
    rate: float
    time: Array
    load: Array
    shift: Array
    turn: Array
    motion: Array
    speed: Array
    joints: Array
    free: tuple[int, ...]
    forces: Array
    steps: int
    seconds: float
    bodies: bool
    points: NDArray[np.int64]
    why: str = ""

    @property
    def touching(self) -> tuple[int, ...]:
        """Contacts that carry force at the end."""
        normal = self.forces[-1, :, 0]
        return tuple(int(i) for i in (normal > 1e-6 * max(float(normal.max(initial=0.0)), 1e-300)).nonzero()[0])

    def to_json(self) -> dict[str, Any]:
        """One JSON object; `series` holds the history."""
        own = {name: written(getattr(self, name)) for name in ("why", "wrench", "loading", "bodies", "onset", "rate")}
        series = {name: written(getattr(self, name)) for name in ("time", "load", "shift", "turn", "motion", "speed")}
        joints = {self.grasp.joints[j].name: self.joints[:, k].tolist() for k, j in enumerate(self.free)}
        return {
            "schema": "handfast/simulation/1",
            "grasp": self.grasp.name,
            "ending": str(self.ending),
            **own,
            "moved": float(self.motion[-1]),
            "shift": self.shift[-1].tolist(),
            "turn": self.turn[-1].tolist(),
            "touching": list(self.touching),
            "steps": self.steps,
            "seconds": self.seconds,
            "series": series | {"joints": joints, "forces": self.forces.tolist(), "points": self.points.tolist()},
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write `to_json` to a file; raises `InputError` if it exists and `force` is not set."""
        write_text(path, json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n", force=force)

    def series_csv(self) -> str:
        """The history as a table: time, load, shift, turn, motion, speed, each joint and each contact's forces."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        head = ["time", "load", *(f"shift_{a}" for a in "xyz"), *(f"turn_{a}" for a in "xyz"), "motion", "speed"]
        head += [self.grasp.joints[j].name for j in self.free]
        head += [f"contact_{i}_{part}" for i in range(self.grasp.m) for part in ("normal", "tangent_1", "tangent_2")]
        table.writerow(head)
        for k in range(len(self.time)):
            row = [self.time[k], self.load[k], *self.shift[k], *self.turn[k], self.motion[k], self.speed[k]]
            table.writerow([f"{x:.9g}" for x in (*row, *self.joints[k], *self.forces[k].ravel())])
        return text.getvalue()
