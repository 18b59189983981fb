"""The engine's own floor: how fast a simulated grasp moves that should rest, and how fast one that should slip.

    python -m benchmarks.simulation_floor

Two questions with answers by hand, put to the same twin as every grasp: a block of four contacts on a slope, which
slips where tan alpha > mu, and a pinch, one finger commanded to f against a fixed one, which carries 2 mu f across.
Loads below and above the threshold; friction, the engine's step and contact stiffness varied. Then three ways to keep a
joint from turning back, on the pinch pushed onto its driven finger by five times the command.
Writes results/simulation_floor.json; REST and SLIP in simulation/result.py are its summary.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.simulation.simulate import Loading, simulate
from handfast.simulation.stepper import Stepper
from handfast.simulation.twin import build_twin

RESULTS = Path(__file__).parent / "results" / "simulation_floor.json"
SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.01, 1.02, 1.05, 1.1, 1.25)  # of the threshold
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)  # [s]
FRICTIONS = (0.2, 0.5, 1.0)
STIFFNESSES = (1e4, 1e5, 1e6)  # [force units / grasp sizes]
CLEAR = 0.02  # a load this far from the threshold has to be told from one on the other side


def block(mu: float) -> Grasp:
    """Four contacts on a plane, normals up, nothing that moves: a block on a slope, seen from the block."""
    corners = [np.array([x, y, 0.0]) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]
    return Grasp([Contact(p, np.array([0.0, 0, 1]), mu) for p in corners], name="block")


def on_slope(mu: float, share: float) -> Array:
    """(6,) a weight of 1 N on a slope of tan alpha = share mu."""
    alpha = np.arctan(share * mu)
    return np.array([np.sin(alpha), 0, -np.cos(alpha), 0, 0, 0])


def pinch(mu: float, command: float = 1.0) -> Grasp:
    """Two opposite contacts; the finger at +x is pushed in the -x direction with a command, the other is fixed."""
    contacts = [
        Contact(np.array([0.05, 0, 0]), np.array([-1.0, 0, 0]), mu),
        Contact(np.array([-0.05, 0, 0]), np.array([1.0, 0, 0]), mu),
    ]
    joint = GraspJoint("slide", np.array([-1.0, 0, 0]), np.zeros(3), (0,), "prismatic")
    return Grasp(contacts, [joint], Mechanism.direct(["slide"]), {"slide": command}, "pinch")


def across(mu: float, share: float) -> Array:
    """(6,) a share of what the pinch carries across."""
    return np.array([0, 0, -2 * mu * share, 0, 0, 0])


CASES = {"slope": (block, on_slope), "pinch": (pinch, across)}


def measured(case: str, mu: float, share: float, **options: Any) -> dict[str, Any]:
    """Rate at the end [grasp sizes/s] and ending of one question."""
    make, load = CASES[case]
    grasp = make(mu)
    loading: Loading = "together" if case == "slope" else "preload-first"  # a slope's threshold has no preload
    found = simulate(grasp, load(mu, share), loading=loading, ramp=4.0, **options)
    rate = found.rate / grasp.size
    return {"case": case, "mu": mu, "share": share, **options, "rate": rate, "ending": str(found.ending)}


def study() -> list[dict[str, Any]]:
    """All questions, one setting varied at a time."""
    rows = []
    for case in CASES:
        for mu in FRICTIONS:
            rows += [measured(case, mu, share) for share in SHARES]
        for step in STEPS:
            rows += [measured(case, 0.5, share, step=step) for share in (0.98, 1.02)]
        for stiffness in STIFFNESSES:
            rows += [measured(case, 0.5, share, stiffness=stiffness) for share in (0.98, 1.02)]
    return rows


class Damped(Stepper):
    """The joint resists opening by a damper alone."""

    strength = 1e3

    def hold_gears(self) -> None:
        opening = self.data.qvel[0] < 0
        self._model.dof_damping[0] = self.strength if opening else 20.0


class Rubbing(Stepper):
    """Dry friction of twice ten commands, the motor stronger by as much: closes under its command, opens beyond 21."""

    def hold_gears(self) -> None:
        self._model.dof_frictionloss[0] = 10.0
        self._close[0] = 11.0


def pushed_pinch(kind: type[Stepper]) -> Stepper:
    """A pinch commanded to 1 N, under a push of 5 N onto its driven finger, whose gears are held in some way."""
    grasp = pinch(0.5)
    twin = build_twin(grasp, 1.0)
    if kind is not Stepper:
        twin.model.tendon_limited[:] = 0
    return kind(twin, grasp, np.array([5.0, 0, 0, 0, 0, 0]))


def ways(seconds: float = 10.0) -> dict[str, Any]:
    """Three ways to keep the pinch's finger from opening: how far it opens, and what is left of the squeeze.

    `opened` [grasp sizes] under a push of five commands for ten seconds; `squeeze` [commands] at rest before the push,
    and `after`, when it has been taken away.
    """
    out = {}
    for name, kind in (("moving limit", Stepper), ("one-sided damper", Damped), ("dry friction", Rubbing)):
        stepper = pushed_pinch(kind)
        stepper.run(5000)
        before = stepper.moment()
        stepper.run(500, 1 / 500)
        pushed = stepper.moment()
        stepper.run(round(seconds / 1e-3))
        later = stepper.moment()
        stepper.run(500, -1 / 500)
        stepper.run(2000)
        after = stepper.moment()
        out[name] = {
            "squeeze": float(before.forces[0, 0]),
            "opened": float(pushed.joints[0] - later.joints[0]),
            "after": float(after.forces[0, 0]),
        }
    return out


def main() -> None:
    rows = study()
    rests = [r["rate"] for r in rows if r["share"] <= 1 - CLEAR and "step" not in r and "stiffness" not in r]
    slips = [r["rate"] for r in rows if r["share"] >= 1 + CLEAR and "step" not in r and "stiffness" not in r]
    floor, least = max(rests), min(slips)
    summary = {"fastest_rest": floor, "slowest_slip": least, "clear": CLEAR}
    data = {"machine": describe(), "summary": summary, "rows": rows, "ways": ways()}
    RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    print(f"rests at most {floor:.2g}, slips at least {least:.2g} grasp sizes/s")


if __name__ == "__main__":
    main()
