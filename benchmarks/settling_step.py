"""Is a step of `settle` without drag the stability model? Asked of questions that `check` has answered.

    python -m benchmarks.settling_step

A step from an untouched state, commands and load at once, its duration raised until drag is as good as none, on the
bundled grasps under the loads of `benchmarks.simulation_agreement`: 0.5, 0.9, 1.1 and 1.25 times certified maxima along
their axes. *Balanced* is a step whose drag carries less than 1e-4 of the force unit and whose friction is made of the
pressure that it has, to 1e-3: an equilibrium of the model, so that none may be found where `check` proves that it
slips. Where `check` holds, one exists, and the repetition may lead past it. Writes results/settling_step.json.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks import simulation_agreement
from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import load_grasp
from handfast.simulation.drag_step import StepProblem, drag_step
from handfast.simulation.simulate import force_unit
from handfast.simulation.slow_motion import DRAG_STIFFNESS, HARDER
from handfast.stability.problem.model import commanded

RESULTS = Path(__file__).parent / "results" / "settling_step.json"
SHARES = (0.5, 0.9, 1.1, 1.25)
DURATIONS = (1.0, 1e2, 1e4, 1e6)
CARRIED, REPEATED = 1e-4, 1e-3  # [force units] by drag; between friction's pressure and the contact's


def first_step(grasp: Grasp, wrench: Array) -> StepProblem:
    """The step from an untouched state under all commands and the whole load, from the grasp's own matrices."""
    L, F, mech = grasp.size, force_unit(grasp, wrench), grasp.mechanism
    unit = np.array([1.0 if j.type == "revolute" else L for j in grasp.joints])
    moves = commanded(grasp)
    held = np.vstack([mech.A, mech.R[~moves]]) * unit
    basis = np.eye(grasp.l)
    if len(held):
        _, s, V = np.linalg.svd(held)
        basis = V[int((s > 1e-9 * s.max(initial=1e-300)).sum()) :].T
    parting = np.hstack([grasp.G[:3].T, grasp.G[3:].T / L, -(grasp.J * unit / L) @ basis]).reshape(grasp.m, 3, -1)
    load = np.r_[wrench[:3] / F, wrench[3:] / (F * L)]
    torque = basis.T @ (unit * (mech.R.T @ grasp.command)) / (F * L)
    sense = np.where(grasp.command < 0, -1.0, 1.0)
    stops = -(sense[:, None] * mech.R * unit)[moves] @ basis
    size = np.linalg.norm(stops, axis=1)
    stops = stops[size > 1e-9] / size[size > 1e-9, None]
    n = 6 + basis.shape[1]
    return StepProblem(
        drag=np.r_[np.ones(3), np.full(3, 0.4), np.ones(n - 6)], push=np.r_[load, torque],
        normal=parting[:, 0], tangent=parting[:, 1:], depth=np.zeros(grasp.m), stiffness=DRAG_STIFFNESS,
        friction=grasp.mu,
        stops=np.hstack([np.zeros((len(stops), 6)), stops]), room=np.zeros(len(stops)),
        stop_stiffness=HARDER * DRAG_STIFFNESS,
    )  # fmt: skip


def outcome(grasp: Grasp, wrench: Array) -> str:
    """'balanced', 'dragged', or 'not repeated' where friction and pressure did not come together."""
    p = first_step(grasp, wrench)
    x, c = np.zeros(len(p.drag)), np.zeros(grasp.m)
    for h in DURATIONS:
        x, c = drag_step(p, h, x, c)
    if np.abs(p.pressure(x) - c).max() > REPEATED:
        return "not repeated"
    return "balanced" if np.abs(p.drag * x / DURATIONS[-1]).max() < CARRIED else "dragged"


def main() -> None:
    questions = json.loads(simulation_agreement.RESULTS.read_text())["questions"]
    directions = simulation_agreement.axes()
    counts: Counter[str] = Counter()
    for name, question in questions.items():
        if question["maximum"] is None:
            continue
        grasp, axis = load_grasp(name.split()[0]), name.split()[1]
        for share in SHARES:
            said = next(r["said"] for r in question["rows"] if r["share"] == share)
            counts[f"{said}, {outcome(grasp, share * question['maximum'] * directions[axis])}"] += 1
    found = {"questions": sum(counts.values()), "counts": dict(sorted(counts.items())), "machine": describe()}
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found["counts"], indent=1))


if __name__ == "__main__":
    main()
