"""Hand and object themselves in the dynamics engine, beside the grasp's contacts alone and the certified maximum.

    python -m benchmarks.simulation_bodies [--seconds 300]

The bundled grasps and two planned ones along the six axes of the object, where the maximum is bounded: loads of 0.9 and
1.25 of it after the commands, once at contact level, once with `simulate_bodies`. The second gives the onset of slip.
Writes results/simulation_bodies.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.agreement_grasps import axes
from benchmarks.machine import describe
from benchmarks.simulation_agreement import LIMIT
from handfast.core import bundled
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.planning.plan_grasps import plan
from handfast.readers.configuration_file import save_configuration
from handfast.readers.grasp_file import load_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.simulation.simulate import simulate, simulate_bodies
from handfast.stability.studies.questions import maximum

RESULTS = Path(__file__).parent / "results" / "simulation_bodies.json"
SHARES = (0.9, 1.25)
RAMP = 6.0  # [s]
PLANNED = (("barrett-bh8-280", "jar"), ("schunk-sah", "mallet"))
KINDS = {"contacts": simulate, "bodies": simulate_bodies}


def grasps(folder: Path) -> Iterator[tuple[str, Grasp]]:
    """The bundled grasps, then the planned ones; their configurations are written to a folder."""
    for name in bundled.names("grasps"):
        yield name, load_grasp(name)
    for hand, thing in PLANNED:
        found = plan(load_hand(hand), load_body(thing), count=1, seed=0, jobs=1)
        grasp, file = found.grasps[0], folder / f"{hand}-{thing}.json"
        save_configuration(Configuration.of(load_hand(hand), grasp.q, grasp.pose, hand=hand, object=thing), file)
        yield f"planned {hand} {thing}", grasp.grasp.from_configuration(file)


def answered(grasp: Grasp, direction: Array) -> dict[str, Any]:
    """The maximum along a direction, and what both kinds of simulation say."""
    most = maximum(grasp, direction, settings=LIMIT)
    if most.unbounded or most.verdict is not Verdict.HOLDS or not most.lower:
        return {"maximum": None}
    largest = float(most.lower)
    out: dict[str, Any] = {"maximum": largest}
    for kind, ask in KINDS.items():
        for share in SHARES:
            try:
                found = ask(grasp, share * largest * direction, ramp=RAMP, closing=0.0)
            except InputError as fault:
                out[f"{kind} {share}"] = {"fault": str(fault)}
                continue
            onset = None if found.onset is None else share * found.onset
            row = {"ending": str(found.ending), "onset": onset, "rate": found.rate / grasp.size}
            row |= {"points": int(found.points[-1]), "seconds": round(found.seconds, 2)}
            row["moved"] = float(found.motion[-1] / grasp.size)
            out[f"{kind} {share}"] = row | {"normal": np.round(found.forces[-1, :, 0], 4).tolist()}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after the question at which this is over")
    limit, begun = parser.parse_args().seconds, time.monotonic()
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"questions": {}}
    with tempfile.TemporaryDirectory() as folder:
        for name, grasp in grasps(Path(folder)):
            for axis, direction in axes().items():
                if time.monotonic() - begun > limit:
                    return
                if f"{name} {axis}" in data["questions"]:
                    continue
                data["questions"][f"{name} {axis}"] = answered(grasp, direction)
                data["machine"] = describe()
                RESULTS.write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
