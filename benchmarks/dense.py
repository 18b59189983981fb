"""Dense grasps: what a check and a maximum cost at 8 and more contacts, and whether two versions agree.

    python -m benchmarks.dense FOLDER [--count 30] [--out new.json] [--against old.json]

FOLDER is what `handfast import` wrote of published grasps of the Shadow hand. Those of 8 to 12 contacts are asked, and
some of the families `power` and `random` (8 contacts) of `grasps.py`. Published grasps have no preload, and with its
coupled distal joints the Shadow hand balances hardly any contact beyond the last joint. So each joint gets a motor of
its own here; those at the knuckles of four fingers (J3) are commanded 0.3 N m where that presses, all others are
locked. Of each grasp: six checks with a weight of 0.3 kg along the axes, and six largest forces; one thread, proofs not
replayed. Times are processor times, and what takes more than a second of that is open: on a busy machine a second by
the clock says nothing. Two versions are compared by running this with each of them, at the
same time on a busy machine, the second with --against. The kept results/dense.json has three,
"before", "between" and "after". With --ways the six maxima alone are asked in three ways, by the clock: one by one,
one by one with two threads each, and together by `max_many`. On a quiet machine; kept there as "ways".
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import cases
from benchmarks.machine import describe
from handfast import check, load_grasp, max_many, maximum
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.stability.problem.settings import Settings

WEIGHT = 0.3 * 9.81  # [N]
COMMAND = 0.3  # [N m]
KNUCKLES = ("FFJ3", "MFJ3", "RFJ3", "LFJ3")
LIMIT = 1.0  # [s] of processor time, beyond which a question is open
PATIENCE = 20.0  # [s] by the clock
KINDS = ("published", "power", "random")


def published(folder: Path, least: int = 8, most: int = 12) -> list[tuple[str, Grasp]]:
    """Imported grasps with a motor for each joint."""
    out = []
    for file in sorted(folder.glob("*.grasp.json")):
        grasp = load_grasp(str(file))
        if not least <= grasp.m <= most:
            continue
        names, l = tuple(j.name for j in grasp.joints), grasp.l
        press = grasp.J[0::3].sum(axis=0)
        turned = [COMMAND if n.endswith(KNUCKLES) and x > 0.01 else 0.0 for n, x in zip(names, press, strict=True)]
        motors = Mechanism(names, np.eye(l), np.zeros((0, l)), (False,) * l)
        free = Grasp(grasp.contacts, grasp.joints, motors, np.array(turned))
        free = free.about(mass=0.3, center_of_mass=free.positions.mean(axis=0))
        out.append((f"published {file.name.split('.')[0]}", free))
    return out


def pulls(grasp: Grasp) -> list[Array]:
    """(6,) each: forces of 1 N along the axes both ways, in the middle of the contacts."""
    center = grasp.positions.mean(axis=0)
    return [np.r_[axis, np.cross(center, axis)] for axis in np.vstack([np.eye(3), -np.eye(3)])]


def asked(grasp: Grasp) -> dict[str, Any]:
    """Six checks and six maxima: verdicts, bounds, how they ended, nodes and processor time [ms]."""
    settings = Settings(verify=False, jobs=1, timeout=PATIENCE)
    out: dict[str, Any] = {"contacts": grasp.m, "checks": [], "maxima": []}
    for w in pulls(grasp):
        start = time.process_time()
        held = check(grasp, WEIGHT * w, settings=settings)
        middle = time.process_time()
        most = maximum(grasp, w, settings=settings)
        end = time.process_time()
        out["checks"].append([str(held.verdict), str(held.stop), held.nodes, 1e3 * (middle - start)])
        upper = most.upper if np.isfinite(most.upper) else None
        bounds = [str(most.verdict), most.lower, upper, most.unbounded]
        out["maxima"].append([*bounds, str(most.stop), most.nodes, 1e3 * (end - middle)])
    return out


def ways(grasp: Grasp) -> dict[str, float]:
    """Time [ms] by the clock of six maxima: one by one, with two threads each, and together."""
    one = Settings(verify=False, jobs=1, timeout=PATIENCE)
    two = replace(one, jobs=2)
    W = pulls(grasp)
    asks: dict[str, Callable[[], Any]] = {
        "one by one": lambda: [maximum(grasp, w, settings=one) for w in W],
        "two threads each": lambda: [maximum(grasp, w, settings=two) for w in W],
        "together": lambda: max_many(grasp, W, settings=one, jobs=1),
    }
    out = {}
    for way, ask in asks.items():
        start = time.monotonic()
        ask()
        out[way] = 1e3 * (time.monotonic() - start)
    return out


def in_ways(chosen: list[tuple[str, Grasp]]) -> dict[str, Any]:
    """Medians over the grasps of each kind, and of how much sooner than one by one."""
    out: dict[str, Any] = {}
    for kind in KINDS:
        times = [ways(grasp) for name, grasp in chosen if name.startswith(kind)]
        out[kind] = {f"{way}, median ms": statistics.median(t[way] for t in times) for way in times[0]}
        for way in list(times[0])[1:]:
            out[kind][f"{way}, times as soon"] = statistics.median(t["one by one"] / t[way] for t in times)
    return out


def summary(rows: dict[str, Any]) -> dict[str, Any]:
    """Medians and means [ms], questions that a limit left open."""
    checks = [x[-1] for row in rows.values() for x in row["checks"]]
    six = [sum(x[-1] for x in row["maxima"]) for row in rows.values()]
    ends = [(x[1], x[-1]) for row in rows.values() for x in row["checks"]]
    ends += [(x[4], x[-1]) for row in rows.values() for x in row["maxima"]]
    late = sum(stop != "complete" or ms > 1e3 * LIMIT for stop, ms in ends)
    out: dict[str, Any] = {"grasps": len(rows), "questions": len(ends), "open": late}
    for name, values in (("check", checks), ("six maxima", six)):
        out[f"{name}, median ms"], out[f"{name}, mean ms"] = statistics.median(values), statistics.fmean(values)
    return out


def contradictions(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Where two versions contradict each other: HOLDS against SLIPS, a witness above a bound."""
    out = []
    for name in old.keys() & new.keys():
        for kind in ("checks", "maxima"):
            for k, (a, b) in enumerate(zip(old[name][kind], new[name][kind], strict=True)):
                far = kind == "maxima" and any(
                    x[1] > (np.inf if y[2] is None else y[2]) * (1 + 1e-9) for x, y in ((a, b), (b, a))
                )
                if {a[0], b[0]} == {"holds", "slips"} or far:
                    out.append(f"{name}, {kind} {k}: {a[:3]} {b[:3]}")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=30, help="of the published grasps")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--ways", action="store_true", help="only this: six maxima in three ways, by the clock")
    options = parser.parse_args()
    found = published(options.folder)
    chosen = [found[i] for i in np.linspace(0, len(found) - 1, min(options.count, len(found))).astype(int)]
    check(chosen[0][1], np.zeros(6))  # loads the machine code
    chosen += [(f"power {c.name}", c.grasp) for c in [c for c in cases(("power",)) if c.contacts <= 12][::3]]
    chosen += [(c.name, c.grasp) for c in [c for c in cases(("random",)) if c.contacts == 8][::2]]
    if options.ways:
        print(json.dumps(in_ways(chosen), indent=1))
        return
    rows = {name: asked(grasp) for name, grasp in chosen}
    said: dict[str, Any] = {"machine": describe()}
    for kind in KINDS:
        said[kind] = summary({name: row for name, row in rows.items() if name.startswith(kind)})
    if options.out:
        options.out.write_text(json.dumps(said | {"rows": rows}) + "\n")
    print(json.dumps(said, indent=1))
    if options.against:
        print("contradictions:", contradictions(json.loads(options.against.read_text())["rows"], rows))


if __name__ == "__main__":
    main()
