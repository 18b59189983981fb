"""What soft fingers cost, whether their answers contradict each other, and whether a simulation agrees.

    python -m benchmarks.soft_fingers [--seconds 600]

Random grasps of two to five contacts, each a soft finger or, one in four, a point contact, on joints that squeeze or
are locked, and a random load. Asked: the largest disturbance with soft fingers and, side by side, with point contacts
where these can balance the load; `check` a hundredth above the upper bound, which must not hold; and the question in a
frame turned at random, whose bounds must overlap, but where one is proved up to a motion only and the other's state
moves more. Half and one and a half of each bounded maximum are simulated in MuJoCo's elliptic cones, which obey the
same ellipsoid. Writes results/soft_fingers.json.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs import checker
from handfast.simulation.simulate import simulate
from handfast.stability.answers.max_query import MaxAnswer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "soft_fingers.json"
SEED = 18
LIMIT = Settings(timeout=10.0)
SHARES = (0.5, 1.5)
TORSIONS = (0.0, 0.001, 0.004, 0.015)  # [m]
MOST = 5  # contacts


def random_grasp(rng: np.random.Generator, most: int = 4) -> Grasp:
    """Two or more contacts around an object, soft and hard ones, some on joints that squeeze or are locked."""
    contacts, joints = [], []
    for i in range(int(rng.integers(2, most + 1))):
        n = _unit(rng)
        p = -0.03 * n + 0.008 * rng.normal(size=3)
        n = n + 0.3 * rng.normal(size=3)
        torsion = float(rng.choice(TORSIONS))
        contacts.append(Contact(p, n / np.linalg.norm(n), float(rng.uniform(0.2, 1)), f"link {i}", torsion=torsion))
        if rng.random() < 0.75:
            axis, origin = _unit(rng), p + 0.05 * rng.normal(size=3)
            closes = np.cross(axis, p - origin) @ n > 0
            joints.append(GraspJoint(f"joint {i}", axis if closes else -axis, origin, (i,)))
    commands = {joint.name: float(rng.uniform(0.05, 0.5)) for joint in joints if rng.random() < 0.7}
    return Grasp(contacts, joints, preload=commands)


def random_load(rng: np.random.Generator) -> Array:
    """(6,) about one newton and three centinewton metres."""
    return np.asarray(rng.normal(size=6) * np.r_[1, 1, 1, 0.03, 0.03, 0.03])


def turned(g: Grasp, R: Array) -> Grasp:
    """The same grasp in a frame that is turned by R (3, 3)."""
    contacts = [replace(c, position=R @ c.position, normal=R @ c.normal) for c in g.contacts]
    joints = [replace(j, axis=R @ j.axis, origin=R @ j.origin) for j in g.joints]
    return Grasp(contacts, joints, g.mechanism, g.command)


def random_turn(rng: np.random.Generator) -> Array:
    """(3, 3) a rotation."""
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(Q * np.sign(np.linalg.det(Q)))


def _unit(rng: np.random.Generator) -> Array:
    x = rng.normal(size=3)
    return np.asarray(x / np.linalg.norm(x))


def _closed(answer: MaxAnswer) -> bool:
    return answer.unbounded or answer.upper - answer.lower <= 1.01e-3 * answer.upper + 1e-9


def _within(one: MaxAnswer, two: MaxAnswer) -> bool:
    """Does the state of one answer move no more than the proof of the other is about?"""
    cap = None if two.certificate is None else checker.verify(two.certificate).cap
    return cap is None or one.witness is None or one.witness.largest_motion <= cap


def _costs(g: Grasp, direction: Array) -> tuple[MaxAnswer, dict[str, Any]]:
    begun = time.process_time()
    answer = maximum(g, direction, settings=LIMIT)
    row = {"lower": answer.lower, "upper": answer.upper if np.isfinite(answer.upper) else None, "nodes": answer.nodes}
    return answer, row | {"closed": _closed(answer), "seconds": time.process_time() - begun}


def question(number: int) -> dict[str, Any] | None:
    """What is found of one grasp; None where nothing can balance the load."""
    rng = np.random.default_rng([SEED, number])
    g, direction = random_grasp(rng, MOST), random_load(rng)
    if not len(g.soft):
        return None
    try:
        found, soft = _costs(g, direction)
    except InputError:
        return None
    row: dict[str, Any] = {
        "number": number,
        "contacts": g.m,
        "fingers": len(g.soft),
        "soft": soft,
        "wrong": [],
        "beyond": [],
    }
    try:
        row["point"] = _costs(g.with_torsion(0.0), direction)[1]
    except InputError:
        row["point"] = None
    R = random_turn(rng)
    other = maximum(turned(g, R), np.r_[R @ direction[:3], R @ direction[3:]], settings=LIMIT)
    for one, two in ((found, other), (other, found)):
        if one.lower > two.upper * (1 + 1e-6) + 1e-9:
            row["wrong" if _within(one, two) else "beyond"].append("turned")
    if np.isfinite(found.upper) and found.upper > 0:
        above = check(g, 1.01 * found.upper * direction, settings=LIMIT)
        if above.verdict is Verdict.HOLDS:
            row["wrong"].append("above")
    row["simulated"] = []
    if found.lower > 1e-3 and not found.unbounded and _closed(found):
        for share in SHARES:
            load = share * found.lower * direction
            says = check(g, load, settings=LIMIT).verdict
            row["simulated"].append([share, str(says), str(simulate(g, load, ramp=2.0).ending)])
    return row


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Nodes and processor time by contacts, soft and point side by side; contradictions; the simulation's endings."""
    out: dict[str, Any] = {"questions": len(rows), "contradictions": sum(len(row["wrong"]) for row in rows)}
    out["states that move beyond a proof's cap"] = sum(len(row["beyond"]) for row in rows)
    for m in sorted({row["contacts"] for row in rows}):
        some = [row for row in rows if row["contacts"] == m]
        both = [row for row in some if row["point"]]
        out[f"{m} contacts"] = {
            "questions": len(some),
            "closed": sum(row["soft"]["closed"] for row in some),
            "both": len(both),
            "point closed": sum(row["point"]["closed"] for row in both),
        } | {
            f"{kind} {what}": [float(f([row[kind][what] for row in both])) for f in (np.median, np.mean)]
            for kind in ("soft", "point")
            for what in ("nodes", "seconds")
            if both
        }
    counted = Counter(" ".join(ending[1:]) for row in rows for ending in row["simulated"])
    out["simulated"] = dict(sorted(counted.items()))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    asked = parser.parse_args()
    begun, number, rows = time.monotonic(), 0, []
    while time.monotonic() - begun < asked.seconds:
        row = question(number)
        number += 1
        if row is not None:
            rows.append(row)
    said = summary(rows)
    RESULTS.write_text(json.dumps({"machine": describe(), "summary": said, "questions": rows}, indent=1) + "\n")
    print(json.dumps(said, indent=1))


if __name__ == "__main__":
    main()
