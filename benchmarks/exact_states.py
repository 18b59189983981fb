"""How many answers that hold are proved to hold exactly, and what that costs beside the search.

    python -m benchmarks.exact_states [--count 1000] [--first 3200000] [--limit 5] [--bundled | --folder IMPORTED]

Fresh random grasps of 3 to 8 contacts in ten families: those of `no_cap.py`, joints with laws of their own, soft
fingers, friction without the maximum dissipation principle. Of each: checks at 0.5 and 0.8 of its maximum, and the
lower bound of the maximum itself with the magnitude among the unknowns. With --bundled the bundled grasps instead, with
--folder published ones (`handfast import ... -o FOLDER`): checks with gravity along the axes and maxima along them.
Whatever is not exact is listed with its reason. Times are processor times, of answers without their proofs of SLIPS, in
one thread. Writes results/exact_states.json.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.agreement_grasps import lawful_case
from benchmarks.dense import pulls
from benchmarks.grasps import random_case
from benchmarks.machine import describe
from benchmarks.no_cap import KINDS, question
from handfast import load_grasp
from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.proofs.existence import Proved, prove
from handfast.proofs.grasp import read_grasp
from handfast.proofs.states import Problem
from handfast.readers.grasp_file import to_dict
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.grasp_limits import NO_LIMITS
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.questions import check, maximum, torques

RESULTS = Path(__file__).parent / "results" / "exact_states.json"
FAMILIES = (*KINDS, "joint laws", "soft fingers", "no dissipation")
SIZES = (3, 4, 5, 6, 7, 8)
SHARES = (0.5, 0.8)
WEIGHT = 0.3 * 9.81  # [N] where a bundled grasp has no mass


def drawn(k: int, first: int) -> tuple[str, Grasp, Array, dict[str, Any]]:
    """Family, grasp, direction and options of the k-th question."""
    family, m, seed = FAMILIES[k % len(FAMILIES)], SIZES[(k // len(FAMILIES)) % len(SIZES)], first + k
    if family in KINDS:
        place = KINDS.index(family) + len(KINDS) * SIZES.index(m)
        return question(place, seed - place)
    case = lawful_case(m, seed) if family == "joint laws" else random_case(m, seed)
    grasp = case.grasp
    if family == "soft fingers":
        rng = np.random.default_rng(seed)
        contacts = [replace(c, torsion=float(rng.choice([0.0, 0.002, 0.006]))) for c in grasp.contacts]
        grasp = Grasp(contacts, grasp.joints, grasp.mechanism, grasp.command)
    return family, grasp, case.direction, {"mdp": False} if family == "no dissipation" else {}


def problem(w: Witness, along: Array | None, magnitude: float, base: Array, options: dict[str, Any]) -> Problem:
    """What a witness has to solve."""
    g = read_grasp(to_dict(w.grasp), "grasp").with_command(np.array(w.grasp.command))
    limits = options.get("limits", NO_LIMITS)
    return Problem(
        grasp=g,
        wrench=np.array(w.wrench) if along is None else base,
        along=along,
        magnitude=magnitude,
        cos=float(np.cos(w.eta)),
        sin=float(np.sin(w.eta)),
        mdp=w.mdp,
        torque_limit=limits.largest_forces(w.grasp),
        force_limit=limits.largest_normal_force,
    )


def proved(
    answer: Answer, along: Array | None, magnitude: float, base: Array, options: dict[str, Any]
) -> tuple[Proved, float]:
    """What is proved of an answer's witness, and the time [s] that it takes with the grasp already read.

    What is not exact is settled as an answer is before it is told.
    """
    w = answer.witness
    assert w is not None
    asked = problem(w, along, magnitude, base, options)
    start = time.process_time()
    out = prove(asked, w.state)
    took = time.process_time() - start
    return (out if out.exact else answer.settled().proved or out), took


def rows_of(
    family: str, name: str, grasp: Grasp, direction: Array, options: dict[str, Any], loads: list[Array], limit: float
) -> Iterator[dict[str, Any]]:
    """Of the maximum along a direction, checks at shares of it, and checks of other loads: what is proved of each."""
    settings = Settings(timeout=limit, jobs=1, verify=False)
    rest = {key: value for key, value in options.items() if key != "base"}
    base = options.get("base", np.zeros(6))
    start = time.process_time()
    most = maximum(grasp, direction, settings=settings, **options)
    seconds = time.process_time() - start
    about = {"family": family, "name": name, "contacts": grasp.m}
    if most.witness is not None:
        # where there is no magnitude to speak of the witness is about the base load itself, or about any multiple
        scaled = np.isfinite(most.lower) and np.allclose(most.witness.wrench, base + most.lower * direction)
        along = direction if scaled and most.lower > 0 else None
        result, took = proved(most, along, most.lower if along is not None else 0.0, base, options)
        yield about | {"asked": "maximum", "search": seconds, "proof": took} | said(result)
        lower = most.lower if np.isfinite(most.lower) else most.posed.problem.unit_magnitude if most.posed else 1.0
        loads = [*loads, *(base + share * lower * direction for share in SHARES if lower > 0)]
    for load in loads:
        start = time.process_time()
        answer = check(grasp, load, settings=settings, **rest)
        seconds = time.process_time() - start
        if answer.witness is not None:
            result, took = proved(answer, None, 0.0, base, options)
            yield about | {"asked": "check", "search": seconds, "proof": took} | said(result)


def said(result: Proved) -> dict[str, Any]:
    """Of a proof, for the file."""
    kind = "exact" if result.exact else "tolerant" if result.tolerant else "none"
    return {"proved": kind, "reason": result.reason, "residual": result.residual, "margin": result.margin}


def fresh(count: int, first: int, limit: float) -> Iterator[dict[str, Any]]:
    """Random grasps."""
    for k in range(count):
        family, grasp, direction, options = drawn(k, first)
        yield from rows_of(family, str(first + k), grasp, direction, options, [], limit)


def of_files(family: str, files: dict[str, Path], limit: float) -> Iterator[dict[str, Any]]:
    """Grasps by name: gravity along the axes, and maxima along them.

    Grasps without commands get the least ones that hold their weight from above, and a fifth more.
    """
    for name, file in files.items():
        grasp = load_grasp(file)
        if not np.any(grasp.command):
            weight = (grasp.mass or 0.3) * 9.81 * pulls(grasp)[5]
            least = torques(grasp, weight, settings=Settings(timeout=limit, jobs=1, verify=False))
            if least.preload is None:
                continue
            grasp = grasp.with_preload({n: 1.2 * f for n, f in least.preload.items()})
        for k, direction in enumerate(pulls(grasp)):
            force = (grasp.mass or 0.3) * 9.81
            yield from rows_of(family, f"{name} {k}", grasp, direction, {}, [force * direction], limit)


def bundled_grasps() -> dict[str, Path]:
    """Files of the bundled grasps by name."""
    return {name: Path(bundled.resolve("grasps", name)) for name in bundled.names("grasps")}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares and times."""
    out: dict[str, Any] = {}
    for family in [*sorted({r["family"] for r in rows}), "all"]:
        for asked in ("check", "maximum"):
            some = [r for r in rows if family in (r["family"], "all") and r["asked"] == asked]
            if some:
                counts = Counter(r["proved"] for r in some)
                proof, search = (float(np.median([1e3 * r[key] for r in some])) for key in ("proof", "search"))
                times = {"proof ms": round(proof, 2), "search ms": round(search, 2)}
                out[f"{family}, {asked}"] = dict(counts) | {"share": counts["exact"] / len(some)} | times
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=3_200_000)
    parser.add_argument("--limit", type=float, default=5.0, help="[s] per question")
    parser.add_argument("--bundled", action="store_true")
    parser.add_argument("--folder", type=Path, help="of imported grasps; every --step-th is asked")
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    if args.bundled:
        family, asked = "bundled", of_files("bundled", bundled_grasps(), args.limit)
    elif args.folder:
        files = {file.name.split(".")[0]: file for file in sorted(args.folder.glob("*.grasp.json"))[:: args.step]}
        family, asked = "published", of_files("published", files, args.limit)
    else:
        family, asked = "fresh", fresh(args.count, args.first, args.limit)
    rows = list(asked)
    done = summary(rows)
    for name, line in done.items():
        print(f"{name:28s} {line}")
    missed = [r for r in rows if r["proved"] != "exact"]
    for r in missed:
        print(r["family"], r["name"], r["contacts"], r["asked"], r["proved"], f"{r['residual']:.1e}", r["reason"])
    data = json.loads(args.out.read_text()) if args.out.exists() else {}
    data |= {"machine": describe(), family: {"summary": done, "not exact": missed}}
    args.out.write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
