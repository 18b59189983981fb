"""Published Shadow grasps with and without the laws of the hand's joints: how many hold, alone and their weight.

The set is DexGraspBench's example, 400 Shadow grasps by BODex; neither it nor the hand is here. The Shadow's outer two
joints hang on one tendon, which leaves their difference free: without a law of the joints nothing holds it. Every
grasp is imported as `handfast import` does it, with every motor locked, and with servos that pull to its squeeze: of
the set's own gain, and of less; all of them, or only those that close, in the closing sense. Of each there are four:
with no laws, with stops, with friction, and with no laws but the last joint on each such tendon locked, as if it stood
at two stops. Each is asked whether it holds no load at all, and its weight from six sides: 1 N for the set's own mass
of 0.1 kg. Resumable.

    python -m benchmarks.published_laws --bench ../DexGraspBench --results benchmarks/results/published_laws.json
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.import_published import GRASPS, HAND
from benchmarks.machine import describe
from handfast import Settings, check, load_hand
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.core.parallel import WorkerPool
from handfast.datasets.published.importing import Importer, imported
from handfast.datasets.published.mapping_file import mapping_for
from handfast.datasets.published.published_file import sources
from handfast.model.grasp import Grasp
from handfast.stability.problem.loads import Loads

VARIANTS = ("none", "stops", "friction", "locked")
GAINS = (5.0, 0.5, 0.05, 0.0)  # [N m/rad] of servos: the set's own, less, and none, with all motors locked
MASS = 0.1  # [kg] of its objects
SECONDS = 5.0  # for a question


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bench", type=Path, required=True, help="a clone of DexGraspBench")
    parser.add_argument("--hand", type=Path, help="the hand's model; the clone's")
    parser.add_argument("--friction", type=float, default=0.6, help="between hand and object; the set's own")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, required=True)
    options = parser.parse_args()
    hand = load_hand(options.hand or options.bench / HAND)
    found = list(sources(sorted((options.bench / GRASPS).rglob("*.npy"))))
    chosen = [found[i] for i in np.linspace(0, len(found) - 1, min(options.count, len(found))).astype(int)]
    _, mapping = mapping_for(chosen[0].layout, hand)
    about = {"mass": MASS, "friction": options.friction, "gain": 1.0}
    rows = imported(Importer(hand, mapping, hand_name="shadow", **about), chosen, options.jobs)
    grasps = [row.grasp for row in rows if row.grasp is not None]
    results: dict[str, Any] = json.loads(options.results.read_text()) if options.results.exists() else {}
    results |= {"grasps": len(grasps), **about, "seconds_a_question": SECONDS, "machine": describe()}
    for gain, motors in product(GAINS, ("closing", "all")):
        some = [pulled(g, gain, hand.closing_actuators if motors == "closing" else None) for g in grasps]
        name = f"{gain:g} N m/rad, {motors} motors"
        for laws in (v for v in VARIANTS if f"{name}, {v}" not in results):  # resumable
            start = time.monotonic()
            results[f"{name}, {laws}"] = found = held([with_laws(g, laws) for g in some], options.jobs)
            print(name, laws, found, f"{time.monotonic() - start:.0f} s", flush=True)
            options.results.write_text(json.dumps(results, indent=1) + "\n")


def pulled(grasp: Grasp, gain: float, closing: Sequence[str] | None) -> Grasp:
    """The grasp under servos of a gain; those of `closing` alone, where they close."""
    if closing is None:
        return grasp.with_preload({n: gain * f for n, f in grasp.preload.items()})
    return grasp.with_preload({n: gain * f for n, f in grasp.preload.items() if n in closing and f > 0})


def with_laws(grasp: Grasp, laws: str) -> Grasp:
    """The grasp with some of its joints' laws."""
    kept = laws.split(",")
    joints = [
        replace(j, friction=j.friction if "friction" in kept else 0.0, stop=j.stop if "stops" in kept else "")
        for j in grasp.joints
    ]
    mechanism = grasp.mechanism
    if laws == "locked":
        last = [int(np.flatnonzero(row)[-1]) for row in mechanism.R if np.count_nonzero(row) > 1]
        mechanism = replace(mechanism, A=np.vstack([mechanism.A, np.eye(grasp.l)[last]]))
    changed = Grasp(grasp.contacts, joints, mechanism, grasp.preload, grasp.name)
    return changed.about(mass=grasp.mass, center_of_mass=grasp.center_of_mass)


def held(grasps: Sequence[Grasp], jobs: int) -> dict[str, Any]:
    """How many hold without load and under their weight from every side, by verdict."""
    verdicts: dict[str, Counter[str]] = {"no load": Counter(), "weight": Counter()}
    stops = sum(any(j.stop for j in g.joints) for g in grasps)
    with WorkerPool(SECONDS, jobs) as pool:
        for alone, weight in pool.map(asked, grasps):
            verdicts["no load"][alone] += 1
            verdicts["weight"][weight] += 1
    return {"with a stop": stops, **{name: dict(found) for name, found in verdicts.items()}}


def asked(seconds: float, grasp: Grasp) -> tuple[str, str]:
    """Verdicts without load and under the weight: the first that does not hold."""
    settings = Settings(timeout=seconds)
    alone = str(check(grasp, np.zeros(6), settings=settings).verdict)
    try:
        for load in Loads.gravity(grasp).wrenches:
            verdict = check(grasp, load, settings=settings).verdict
            if verdict is not Verdict.HOLDS:
                return alone, str(verdict)
    except InputError:  # no forces at its contacts balance the load
        return alone, "cannot be balanced"
    return alone, str(Verdict.HOLDS)


if __name__ == "__main__":
    main()
