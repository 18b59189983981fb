"""Does a dynamics engine agree? Grasps of three to ten contacts, loads below and above their certified maxima.

    python -m benchmarks.simulation_agreement [--hands FOLDER] [--shared ../shared] [--seconds 300] [--only barrett-egg]

Questions are those of `benchmarks.agreement_grasps`: a thousand grasps, bundled, random, and closed Barrett, Allegro,
SA, Shadow and Adroit hands on YCB and other objects. Those of hands that are not in the repository are left out, and
counted, unless `--hands` and `--shared` say where these are. Those whose maximum is bounded are simulated at
fixed shares of it and in the middle of the first hole below it, once with the commands first and the load after them,
once with both growing together. Where Handfast says HOLDS and neither rests, a third simulation begins at an
equilibrium that it found. What Handfast says at each load is asked by `check`; beyond the maximum its proof says it.

The rule of what is fragile, fixed beforehand: what `check --margin` calls fragile, by its own default rule, at FIRM of
the maximum, or that cannot be asked there as it lies in a hole. An earlier study's rule, LITTLE, is counted beside it.
Undecided and ill-posed simulations agree with nothing. Questions come in a fixed shuffled order. Writes
results/simulation_agreement.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.agreement_grasps import questions
from benchmarks.closed_grasps import ClosedHands, add_folders
from benchmarks.machine import describe
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.proofs.states import State
from handfast.simulation.result import Ending, SimulationResult
from handfast.simulation.simulate import Loading, force_unit, simulate
from handfast.simulation.twin import TWIN_STIFFNESS
from handfast.stability.answers.check_query import CheckAnswer
from handfast.stability.answers.max_query import with_interval
from handfast.stability.problem.judge import residuals
from handfast.stability.problem.model import joint_torques, state_of
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.margin_search import margin
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "simulation_agreement.json"
SHARES = (0.5, 0.8, 0.9, 1.1, 1.25, 1.5)
LOADINGS: tuple[Loading, ...] = ("preload-first", "together")
STATEMENT = "an equilibrium exists"  # the model's own: some simulation of the load rests at one
FIRM = 0.8  # of the maximum, where fragility is asked
LITTLE = 50.0  # times what the most loaded contact gives way, by the least motion at FIRM: an earlier study's rule
RAMP = 4.0  # [s]
LIMIT = Settings(timeout=60.0)
QUICK = Settings(nodes=1000, timeout=60.0)  # of each check of fragility
HOLES = Settings(nodes=1000, timeout=4.0, gap=1e-2)  # of the search for holes, the widest ranges first
RESTS = (Ending.HOLDS, Ending.SETTLES)
OPEN = (Ending.UNDECIDED, Ending.ILL_POSED)


def answered(grasp: Grasp, direction: Array) -> dict[str, Any]:
    """The maximum along a direction, whether it is fragile, and all simulations of it."""
    most = maximum(grasp, direction, settings=LIMIT)
    if most.unbounded or most.verdict is not Verdict.HOLDS or not most.lower:
        why = "unbounded" if most.unbounded else "no load" if most.verdict is Verdict.HOLDS else str(most.verdict)
        return {"maximum": None, "contacts": grasp.m, "why": why}
    largest = float(most.lower)
    shares = list(SHARES)
    most = with_interval(most, HOLES)
    if most.interval is not None and most.interval.holes:
        first, last = most.interval.holes[0]
        shares.append(float((first + last) / 2 / largest))
    firmly = FIRM * largest * direction
    known = {FIRM: check(grasp, firmly, settings=LIMIT)}
    firm = margin(grasp, firmly, settings=QUICK, answer=known[FIRM])
    rows = []
    for share in shares:
        beyond = share * largest > most.upper  # slips: the maximum's own proof says that nothing larger is resisted
        answer = None if beyond else known.get(share) or check(grasp, share * largest * direction, settings=LIMIT)
        rows += simulated(grasp, share, largest * direction, answer)
    fragile = ["hole"] if firm is None else list(firm.why)
    motion = None if firm is None else firm.motion / max(firm.squeeze, 1e-12)
    return {"maximum": largest, "contacts": grasp.m, "fragile": fragile, "motion": motion, "rows": rows}


def simulated(grasp: Grasp, share: float, most: Array, answer: CheckAnswer | None) -> Iterator[dict[str, Any]]:
    """The simulations at one share of the maximum (6,), of which `check` says this; None: slips, as it is beyond."""
    wrench = share * most
    said = str(Verdict.SLIPS if answer is None else answer.verdict)
    rests = False
    for loading in LOADINGS:
        found = simulate(grasp, wrench, loading=loading, ramp=RAMP)
        rests = rests or found.ending in RESTS
        yield {"share": share, "loading": loading, "said": said} | seen(grasp, found, share)
    if answer is not None and answer.witness is not None and not rests:
        state = answer.witness.state
        found = simulate(grasp, wrench, start=(state.r, state.q))
        yield {"share": share, "loading": "at it", "said": said} | seen(grasp, found, share)


def seen(grasp: Grasp, found: SimulationResult, share: float) -> dict[str, Any]:
    """What is kept of a simulation; of one at rest `missed`: by how much it misses the model's equations.

    Its forces and all that has moved since the beginning are put into `judge.residuals` as a witness would be.
    """
    out: dict[str, Any] = {"ending": str(found.ending), "rate": float(f"{found.rate / grasp.size:.4g}")}
    out["onset"] = None if found.onset is None else round(share * found.onset, 4)
    if found.ending in RESTS:
        missed = asdict(residuals(grasp, found.wrench, rest_state(grasp, found)))
        out["missed"] = {name: round(value, 5) for name, value in missed.items()}
    return out


def rest_state(grasp: Grasp, found: SimulationResult) -> State:
    """Where a simulation rests, as the state of the model that it would be."""
    newtons = force_unit(grasp, found.wrench) * TWIN_STIFFNESS / grasp.size  # [N/m] of every contact
    turn = found.turn[-1]
    shift = found.shift[-1] - np.cross(turn, grasp.positions.mean(axis=0))
    q = np.zeros(grasp.l)
    q[list(found.free)] = found.joints[-1]
    c = found.forces[-1].ravel()
    held = np.vstack([grasp.mechanism.R, grasp.mechanism.A])
    carried = np.linalg.lstsq(held.T, joint_torques(grasp, c), rcond=None)[0]
    f, coupling = carried[: grasp.mechanism.a], carried[grasp.mechanism.a :]
    return state_of(newtons * np.r_[shift, turn], newtons * q, c, f, coupling)


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


def loads(question: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """The simulations of each load of a question."""
    shares = dict.fromkeys(r["share"] for r in question["rows"])
    return [[r for r in question["rows"] if r["share"] == share] for share in shares]


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
                if loading == STATEMENT:
                    counts.update(map(statement, loads(q)))
                else:
                    counts.update(outcome(r) for r in q["rows"] if r["loading"] == loading)
            total = sum(counts.values())
            rate = {"simulated": total, "agreement": round(counts["agree"] / total, 4)} if total else {}
            out[f"{name}, {loading}"] = {"questions": len(chosen)} | rate | dict(sorted(counts.items()))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_folders(parser)
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after the question at which this is over")
    parser.add_argument("--only", default="", help="questions whose name begins so")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--part", default="1/1", help="K/N: every N-th question alone, from the K-th; for several runs")
    args = parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends at once: an answer that Ctrl-C cut off is none
    begun = time.monotonic()
    data = json.loads(args.results.read_text()) if args.results.exists() else {"questions": {}}
    whole = questions(ClosedHands(args.hands, args.shared))
    absent = Counter(q.missing for q in whole if q.missing and q.name not in data["questions"])
    for what, count in absent.items():
        print(f"left out: {count} questions for want of {what}", flush=True)
    part, parts = map(int, args.part.split("/"))
    for question in whole[part - 1 :: parts]:
        if question.name in data["questions"] or question.missing or not question.name.startswith(args.only):
            continue
        if time.monotonic() - begun > args.seconds:
            break
        used = time.process_time()
        try:
            found = answered(*question.made())
        except InputError as fault:
            found = {"maximum": None, "reason": str(fault)}
        found["processor seconds"] = round(time.process_time() - used, 2)
        data["questions"][question.name] = {"family": question.family} | found
        data |= {"machine": describe(), "rule": f"margin at {FIRM}", "asked of": len(whole)}
        save(data | {"summary": summary(data["questions"])}, args.results)
    data["summary"] = summary(data["questions"])
    save(data, args.results)
    print(json.dumps(data["summary"], indent=1), flush=True)


def save(data: dict[str, Any], target: Path) -> None:
    """Written beside and moved, so that what is there is whole whenever it is stopped."""
    part = target.with_suffix(".part")
    part.write_text(json.dumps(data, separators=(",", ":")).replace('},"', '},\n"') + "\n")
    part.replace(target)


if __name__ == "__main__":
    main()
