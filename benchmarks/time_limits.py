"""Do questions end in time? `hold`, `torques`, `check`, `max` and `map` on grasps of a hand of 22 joints.

    python -m benchmarks.time_limits [--limits 1 2 5 10] [--questions hold torques check max map]

The hand is a sketch of the Shadow hand: four fingers of an abduction and three flexions, the little one with a joint in
the palm besides, and a thumb of five; every joint has a motor of its own, as in most published grasps. It wraps a
superquadric with 5 to 10 contacts. `hold` is asked about its weight along the six axes. A question that takes long has
to end by itself, UNDECIDED, at its limit: each line says by how much it ended later. Writes results/time_limits.json.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import Quadric
from benchmarks.machine import describe
from handfast import Loads, check, force_map, hold, maximum, torques
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.stability.settings import Settings

RESULTS = Path(__file__).parent / "results" / "time_limits.json"
LIMITS = (1.0, 2.0, 5.0, 10.0)  # [s]
CONTACTS = (5, 6, 8, 10)
BODY = Quadric(np.array([0.035, 0.03, 0.055]), 4.0)  # [m]
FRICTION, WEIGHT, COMMAND = 0.6, 3.0, 0.1  # [N], [N m]
STEPS = 4  # directions of a map
FINGERS = {  # where it touches [rad], heights of its tip and of the link before, number of joints
    "thumb": (np.pi, 0.2, -0.3, 5),
    "first": (-0.75, 0.5, 0.1, 4),
    "middle": (-0.2, 0.3, -0.1, 4),
    "ring": (0.35, 0.1, -0.3, 4),
    "little": (0.9, -0.1, -0.5, 5),
}
Ask = Callable[[Grasp, float], Any]


def wrapped(contacts: int) -> Grasp:
    """22 joints; tips first, then the links before them."""
    touching: list[Contact] = []
    for k in range(contacts):
        name, (azimuth, tip, before, _) = list(FINGERS.items())[k % len(FINGERS)]
        touching.append(BODY.contact(azimuth, tip if k < len(FINGERS) else before, FRICTION, f"{name} {k // 5}"))
    joints: list[GraspJoint] = []
    for f, (name, (azimuth, _, _, count)) in enumerate(FINGERS.items()):
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        tips, all_of = (f,), tuple(k for k in (f, f + 5) if k < contacts)
        flexes, base = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0]), 0.06 * out - np.array([0.0, 0.0, 0.07])
        for j in range(count):
            at = base + np.array([0.0, 0.0, 0.03 * max(j - (count - 3), 0)])
            axis, moved = (out, all_of) if j == count - 4 else (flexes, all_of if j < count - 1 else tips)
            if j == 0 and count == 5:  # in the palm
                axis = np.array([0.0, 0.0, 1.0])
            joints.append(GraspJoint(f"{name}_{j}", axis, at, moved))
    flexing = {j.name: COMMAND for j in joints if j.name.endswith(("_2", "_3"))}
    return Grasp(touching, joints, preload=flexing, name=f"22 joints, {contacts} contacts")


def gravity(weight: float) -> Loads:
    """Along the six axes, at the origin."""
    along = np.vstack([weight * s * np.eye(3)[i] for i in range(3) for s in (1, -1)])
    return Loads(("+x", "-x", "+y", "-y", "+z", "-z"), np.hstack([along, np.zeros((6, 3))]))


PULL = np.array([1.0, 0.5, 2.0, 0.02, -0.01, 0.01])
QUESTIONS: dict[str, Ask] = {
    "hold": lambda g, s: hold(g, gravity(WEIGHT), timeout=s),
    "hold all": lambda g, s: hold(g, gravity(WEIGHT), actuators=g.mechanism.actuators, timeout=s),
    "torques": lambda g, s: torques(g, PULL, settings=Settings(time_limit=s)),
    "check": lambda g, s: check(g, PULL, settings=Settings(time_limit=s)),
    "max": lambda g, s: maximum(g, PULL, settings=Settings(time_limit=s)),
    "interval": lambda g, s: maximum(g, PULL, interval=True, settings=Settings(time_limit=s)),
    "map": lambda g, s: force_map(g, "xy", steps=STEPS, settings=Settings(time_limit=s), jobs=1),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--limits", type=float, nargs="+", default=list(LIMITS))
    parser.add_argument("--contacts", type=int, nargs="+", default=list(CONTACTS))
    parser.add_argument("--questions", nargs="+", choices=QUESTIONS, default=list(QUESTIONS))
    parser.add_argument("--output", type=Path, default=RESULTS)
    given = parser.parse_args()
    hold(replace_commands(wrapped(5)), gravity(0.0))  # loads what is compiled
    rows: list[dict[str, Any]] = []
    for name in given.questions:
        for contacts in given.contacts:
            for limit in given.limits:
                g, begin = wrapped(contacts), time.monotonic()
                answer = QUESTIONS[name](g, limit)
                seconds = time.monotonic() - begin
                shown = "" if name == "map" else f"{answer.verdict} {answer.stop}"
                row = {"question": name, "contacts": contacts, "limit": limit, "seconds": seconds, "answer": shown}
                rows.append(row)
                print(f"{name:8} {contacts:2} contacts, limit {limit:4g} s: {seconds:7.2f} s {shown}", flush=True)
    given.output.write_text(json.dumps({"machine": describe(), "rows": rows}, indent=1) + "\n")


def replace_commands(g: Grasp) -> Grasp:
    """Without commands."""
    return g.with_preload(None)


if __name__ == "__main__":
    main()
