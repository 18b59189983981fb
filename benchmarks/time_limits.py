"""Do questions end in time? `hold`, `torques`, `check`, `max` and `map` on grasps of a hand of 22 joints.

    python -m benchmarks.time_limits [--limits 1 2 5 10] [--questions hold torques check max map]

The hand is a sketch of the Shadow hand: four fingers of an abduction and three flexions, the little one with a joint in
the palm besides, and a thumb of five; every joint has a motor of its own, as in most published grasps. It wraps a
superquadric with 5 to 10 contacts. `hold` is asked about its weight along the six axes. A question that takes long has
to end by itself, UNDECIDED, at its limit: each line says by how much it ended later. Writes results/time_limits.json.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import Quadric
from benchmarks.machine import describe
from handfast import Loads, check, force_map, hold, maximum, torques
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "time_limits.json"
LIMITS = (1.0, 2.0, 5.0, 10.0)  # [s]
MOST = 60.0  # [s] after which a question is given up
SEEDS = {5: (2,), 6: (3,), 8: (5,), 10: (4,)}  # of grasps by number of contacts, chosen by taking long
WEIGHT, COMMAND = 3.0, 0.1  # [N], [N m]
STEPS = 4  # directions of a map
FINGERS = {  # about where it touches [rad], number of joints
    "thumb": (np.pi, 5),
    "first": (-0.75, 4),
    "middle": (-0.2, 4),
    "ring": (0.35, 4),
    "little": (0.9, 5),
}
Ask = Callable[[Grasp, float], Any]


def drawn(contacts: int, seed: int) -> Grasp:
    """22 joints; tips first, then the links before them."""
    rng = np.random.default_rng([contacts, seed])
    body, friction = Quadric.drawn(rng), float(rng.uniform(0.3, 0.8))
    turn, height = rng.uniform(-0.2, 0.2, len(FINGERS)), rng.uniform(-0.7, 0.1, len(FINGERS))
    touching: list[Contact] = []
    for k in range(contacts):
        f = k % len(FINGERS)
        name, (azimuth, _) = list(FINGERS.items())[f]
        touching.append(body.contact(azimuth + turn[f], height[f] - 0.4 * (k // len(FINGERS)), friction, name))
    joints: list[GraspJoint] = []
    for f, (name, (azimuth, count)) in enumerate(FINGERS.items()):
        azimuth += turn[f]
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        tips, all_of = (f,), tuple(k for k in (f, f + len(FINGERS)) if k < contacts)
        flexes, base = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0]), 0.06 * out - np.array([0.0, 0.0, 0.07])
        for j in range(count):
            at = base + np.array([0.0, 0.0, 0.03 * max(j - (count - 3), 0)])
            axis, moved = (out, all_of) if j == count - 4 else (flexes, all_of if j < count - 1 else tips)
            if j == 0 and count == 5:  # in the palm
                axis = np.array([0.0, 0.0, 1.0])
            joints.append(GraspJoint(f"{name}_{j}", axis, at, moved))
    flexing = {j.name: COMMAND for j in joints if j.name.endswith(("_2", "_3"))}
    return Grasp(touching, joints, preload=flexing, name=f"22 joints, {contacts} contacts, seed {seed}")


def gravity(weight: float) -> Loads:
    """Along the six axes, at the origin."""
    along = np.vstack([weight * s * np.eye(3)[i] for i in range(3) for s in (1, -1)])
    return Loads(("+x", "-x", "+y", "-y", "+z", "-z"), np.hstack([along, np.zeros((6, 3))]))


PULL = np.array([1.0, 0.5, 2.0, 0.02, -0.01, 0.01])
QUESTIONS: dict[str, Ask] = {
    "hold": lambda g, s: hold(g, gravity(WEIGHT), timeout=s),
    "hold all": lambda g, s: hold(g, gravity(WEIGHT), actuators=g.mechanism.actuators, timeout=s),
    "torques": lambda g, s: torques(g, PULL, settings=Settings(timeout=s)),
    "check": lambda g, s: check(g, PULL, settings=Settings(timeout=s)),
    "max": lambda g, s: maximum(g, PULL, settings=Settings(timeout=s)),
    "interval": lambda g, s: maximum(g, PULL, interval=True, settings=Settings(timeout=s)),
    "map": lambda g, s: force_map(g, "xy", steps=STEPS, settings=Settings(timeout=s), jobs=1),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--limits", type=float, nargs="+", default=list(LIMITS))
    parser.add_argument("--contacts", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--questions", nargs="+", choices=QUESTIONS, default=list(QUESTIONS))
    parser.add_argument("--output", type=Path, default=RESULTS)
    given = parser.parse_args()
    check(drawn(5, 0), PULL)  # loads what is compiled
    rows: list[dict[str, Any]] = []
    for name, contacts in itertools.product(given.questions, given.contacts):
        for seed, limit in itertools.product(SEEDS[contacts], given.limits):
            seconds, said = timed(QUESTIONS[name], drawn(contacts, seed), limit)
            row = {"question": name, "contacts": contacts, "seed": seed, "limit": limit}
            rows.append(row | {"seconds": seconds, "answer": said})
            print(f"{name:8} {contacts:2} contacts, seed {seed}, {limit:4g} s: {seconds:7.2f} s {said}", flush=True)
    for limit in given.limits:
        over = [
            row["seconds"] - (STEPS if row["question"] == "map" else 1) * limit for row in rows if row["limit"] == limit
        ]
        print(f"limit {limit:g} s: over by {max(over):.2f} s at most")
    given.output.write_text(json.dumps({"machine": describe(), "rows": rows}, indent=1) + "\n")


def timed(ask: Ask, grasp: Grasp, limit: float) -> tuple[float, str]:
    """Seconds and answer; `MOST` seconds where it has to be given up."""
    ours, theirs = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=_sent, args=(theirs, ask, grasp, limit))
    process.start()
    out = ours.recv() if ours.poll(MOST) else (MOST, "given up")
    process.kill()
    process.join()
    return out


def _sent(pipe: Any, ask: Ask, grasp: Grasp, limit: float) -> None:
    begin = time.monotonic()
    answer = ask(grasp, limit)
    pipe.send((time.monotonic() - begin, f"{answer.verdict} {answer.stop}"))


if __name__ == "__main__":
    main()
