"""Does a dynamics engine agree? Grasps of three to eight contacts, loads below and above their certified maxima.

    python -m benchmarks.simulation_agreement [--seconds 300] [--only barrett-egg]

Questions: the bundled grasps along the six axes, and the random, Barrett and Allegro grasps of `benchmarks.grasps`
along their own direction and, those of real hands, along one axis. Those whose maximum is bounded are simulated at
fixed shares of it and in the middle of the first hole below it, once with the commands first and the load after them,
once with both growing together. Where Handfast says HOLDS and neither rests, a third simulation begins at an
equilibrium that it found. What Handfast says at each load is asked by `check`.

The rule of what is fragile, fixed beforehand: what `check --margin` calls fragile, by its own default rule, at FIRM of
the maximum, or that cannot be asked there as it lies in a hole. An earlier study's rule, LITTLE, is counted beside it.
Undecided and ill-posed simulations agree with nothing. Questions come in a fixed shuffled order, those of more than
five contacts last. Writes results/simulation_agreement.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import cases
from benchmarks.machine import describe
from handfast.core import bundled
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.model.grasp_file import load_grasp
from handfast.simulation.ending import Ending
from handfast.simulation.loaded_twin import Loading, force_unit, simulate
from handfast.simulation.result import SimulationResult
from handfast.simulation.twin import STIFFNESS
from handfast.stability import scaled_problem
from handfast.stability.least_motion import least_motion
from handfast.stability.margin_search import margin
from handfast.stability.model import State, joint_torques, residuals
from handfast.stability.queries import check, maximum
from handfast.stability.queries.max_query import with_interval
from handfast.stability.settings import Settings

RESULTS = Path(__file__).parent / "results" / "simulation_agreement.json"
SHARES = (0.5, 0.8, 0.9, 1.1, 1.25, 1.5)
LOADINGS: tuple[Loading, ...] = ("preload-first", "together")
STATEMENT = "an equilibrium exists"  # the model's own: some simulation of the load rests at one
FIRM = 0.8  # of the maximum, where fragility is asked
LITTLE = 50.0  # times what the most loaded contact gives way, by the least motion at FIRM: an earlier study's rule
RAMP = 4.0  # [s]
LIMIT = Settings(time_limit=20.0)
QUICK = Settings(node_limit=1000, time_limit=20.0)  # of holes, and of each check of fragility
SEED = 19
LAST = 5  # grasps with more contacts come last: their fragility takes most of the time
RESTS = (Ending.HOLDS, Ending.SETTLES)
OPEN = (Ending.UNDECIDED, Ending.ILL_POSED)


def axes() -> dict[str, Array]:
    """Forces along the six directions of the object's axes."""
    return {f"{s}{a}": np.eye(6)[k] * (1 if s == "+" else -1) for k, a in enumerate("xyz") for s in "+-"}


def questions() -> Iterator[tuple[str, str, Grasp, Array]]:
    """Name, family, grasp and direction of all, shuffled, those with more than five contacts last."""
    along = axes()
    found = [(f"{n} {a}", "bundled", load_grasp(n), d) for n in bundled.names("grasps") for a, d in along.items()]
    draw = np.random.default_rng(SEED)
    for case in cases(("random", "barrett", "allegro")):
        found.append((case.name, case.family, case.grasp, case.direction))
        if case.family != "random":
            axis = str(draw.choice(list(along)))
            found.append((f"{case.name} {axis}", case.family, case.grasp, along[axis]))
    return iter(sorted((found[k] for k in draw.permutation(len(found))), key=lambda q: q[2].m > LAST))


def answered(grasp: Grasp, direction: Array) -> dict[str, Any]:
    """The maximum along a direction, whether it is fragile, and all simulations of it."""
    most = maximum(grasp, direction, settings=LIMIT)
    if most.unbounded or most.verdict is not Verdict.HOLDS or not most.lower:
        return {"maximum": None}
    largest = float(most.lower)
    shares = list(SHARES)
    most = with_interval(most, QUICK)
    if most.interval is not None and most.interval.holes:
        first, last = most.interval.holes[0]
        shares.append(float((first + last) / 2 / largest))
    firmly = FIRM * largest * direction
    firm = margin(grasp, firmly, settings=QUICK, answer=check(grasp, firmly, settings=LIMIT))
    rows = [row for share in shares for row in simulated(grasp, share, largest * direction)]
    fragile = ["hole"] if firm is None else list(firm.why)
    motion = None if firm is None else firm.motion / max(firm.squeeze, 1e-12)
    return {"maximum": largest, "contacts": grasp.m, "fragile": fragile, "motion": motion, "rows": rows}


def simulated(grasp: Grasp, share: float, most: Array) -> Iterator[dict[str, Any]]:
    """The simulations at one share of the maximum (6,)."""
    wrench = share * most
    answer = check(grasp, wrench, settings=LIMIT)
    rests = False
    for loading in LOADINGS:
        found = simulate(grasp, wrench, loading=loading, ramp=RAMP)
        rests = rests or found.ending in RESTS
        yield {"share": share, "loading": loading, "said": str(answer.verdict)} | seen(grasp, found, share)
    if answer.witness is not None and not rests:
        state = least_motion(scaled_problem.build(grasp, wrench), answer.witness).state
        found = simulate(grasp, wrench, start=(state.r, state.q))
        yield {"share": share, "loading": "at it", "said": str(answer.verdict)} | seen(grasp, found, share)


def seen(grasp: Grasp, found: SimulationResult, share: float) -> dict[str, Any]:
    """What is kept of a simulation; of one at rest `missed`: by how much it misses the model's equations.

    Its forces and all that has moved since the beginning are put into `model.residuals` as a witness would be.
    """
    out: dict[str, Any] = {"ending": str(found.ending), "rate": found.rate / grasp.size}
    out["onset"] = None if found.onset is None else share * found.onset
    if found.ending in RESTS:
        missed = asdict(residuals(grasp, found.wrench, state_of(grasp, found)))
        out["missed"] = {name: round(value, 5) for name, value in missed.items()}
    return out


def state_of(grasp: Grasp, found: SimulationResult) -> State:
    """Where a simulation rests, as the state of the model that it would be."""
    newtons = force_unit(grasp, found.wrench) * STIFFNESS / grasp.size  # [N/m] of every contact
    turn = found.turn[-1]
    shift = found.shift[-1] - np.cross(turn, grasp.positions.mean(axis=0))
    q = np.zeros(grasp.l)
    q[list(found.free)] = found.joints[-1]
    c = found.forces[-1].ravel()
    held = np.vstack([grasp.mechanism.R, grasp.mechanism.A])
    carried = np.linalg.lstsq(held.T, joint_torques(grasp, c), rcond=None)[0]
    f, coupling = carried[: grasp.mechanism.a], carried[grasp.mechanism.a :]
    return State(newtons * np.r_[shift, turn], newtons * q, c, f, coupling)


def outcome(row: dict[str, Any]) -> str:
    """'agree', 'open', or what disagrees: 'said holds, slips'; a grasp that jumped before it came to rest did slip."""
    ending = Ending(row["ending"])
    if ending in OPEN or row["said"] == str(Verdict.UNDECIDED):
        return "open"
    held = ending is Ending.HOLDS
    if held == (row["said"] == str(Verdict.HOLDS)):
        return "agree"
    return f"said {row['said']}, {row['ending']}"


def statement(rows: list[dict[str, Any]]) -> str:
    """The same of all simulations of one load: HOLDS says that a rest exists, SLIPS that loading together has none."""
    if rows[0]["said"] == str(Verdict.HOLDS):
        if any(Ending(r["ending"]) in RESTS for r in rows):
            return "agree"
        return "open" if any(Ending(r["ending"]) in OPEN for r in rows) else "said holds, slips"
    return outcome(next(r for r in rows if r["loading"] == "together"))


def summary(asked: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts by loading: of all answers, of those that move little, and of those that are not fragile."""
    out: dict[str, Any] = {}
    bounded = [q for q in asked.values() if q["maximum"] is not None]
    parts = {
        "all": bounded,
        "moves little": [q for q in bounded if (q.get("motion") or np.inf) <= LITTLE],
        "not fragile": [q for q in bounded if not q["fragile"]],
    }
    for name, chosen in parts.items():
        for loading in (*LOADINGS, STATEMENT):
            counts: Counter[str] = Counter()
            for q in chosen:
                if loading != STATEMENT:
                    counts.update(outcome(r) for r in q["rows"] if r["loading"] == loading)
                    continue
                for share in dict.fromkeys(r["share"] for r in q["rows"]):
                    counts.update([statement([r for r in q["rows"] if r["share"] == share])])
            total = sum(counts.values())
            rate = {"simulated": total, "agreement": round(counts["agree"] / total, 4)} if total else {}
            out[f"{name}, {loading}"] = {"questions": len(chosen)} | rate | dict(sorted(counts.items()))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after the question at which this is over")
    parser.add_argument("--only", default="", help="questions whose name begins so")
    args = parser.parse_args()
    begun = time.monotonic()
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"questions": {}}
    for name, family, grasp, direction in questions():
        if name in data["questions"] or not name.startswith(args.only):
            continue
        if time.monotonic() - begun > args.seconds:
            break
        data["questions"][name] = {"family": family} | answered(grasp, direction)
        data |= {"machine": describe(), "rule": f"margin at {FIRM}", "summary": summary(data["questions"])}
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    print(json.dumps(data.get("summary", {}), indent=1), flush=True)


if __name__ == "__main__":
    main()
