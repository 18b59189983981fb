"""Many questions at once against one at a time, and a prepared grasp under a changing load: processor time.

    python -m benchmarks.batches [--peers] [--peer-limit 60]
    python -m benchmarks.batches --slipping
    python -m benchmarks.batches --picture docs/img/latencies.png

For 3 to 6 contacts, on the first random grasps of `grasps.py`: `SIZE` random loads on each in one call of `max_many`
and of `check_many`; then the first of them in a call of their own, and one by one by `maximum` and `check` in the same
run, once with the replay of bounds and once without: means over the same questions. `across` asks one direction of
many grasps. `slipping_ms` are medians of a prepared grasp under slowly changing loads that slip, beside `check` of the
same loads in the same run. With --peers, Algorithm 1 on Gurobi is asked a maximum of each grasp, as in `engine.py`;
one that is stopped counts with its limit. Times are of the processor, all threads, since the machine is shared.
Results are kept in results/batches.json.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import Case, cases
from benchmarks.machine import describe
from handfast import check, check_many, max_many, maximum, prepare
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.papers import algorithm1
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "batches.json"
SIZES = (3, 4, 5, 6)
SIZE = 1000  # questions of a batch
GRASPS = 4  # of each number of contacts
ALONE = 40  # questions that are asked one by one
REPLAYED = 8  # of these with the replay of their bounds
STEPS = 400  # of a changing load
QUICK = Settings(verify=False)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """A result and its processor time [s]."""
    start = time.process_time()
    return run(), time.process_time() - start


def loads(case: Case) -> Array:
    """(SIZE, 6) loads in all directions [N, N m], of the size of what the grasp holds along its own direction."""
    rng, size = np.random.default_rng(case.contacts), case.grasp.size
    W = rng.normal(size=(SIZE, 6)) * np.r_[1, 1, 1, size, size, size]
    largest = min(maximum(case.grasp, case.direction, settings=QUICK).lower, 10.0)
    return W * largest / np.linalg.norm(W[:, :3], axis=1)[:, None]


def alone(ask: Callable[[Array], Any], W: Array) -> tuple[list[Any], float]:
    """Answers one by one, and the mean processor time [s]."""
    found = [timed(lambda w=w: ask(w)) for w in W]
    return [answer for answer, _ in found], statistics.fmean(seconds for _, seconds in found)


def row(case: Case) -> dict[str, Any]:
    """Seconds a question of each way, and whether bounds agree."""
    g, W = case.grasp, loads(case)
    maxima, together = timed(lambda: max_many(g, W, jobs=1))
    _, checked = timed(lambda: check_many(g, W, jobs=1, settings=QUICK))
    replayed, with_replay = timed(lambda: check_many(g, W[:100], jobs=1))
    some = W[:ALONE]
    same = timed(lambda: max_many(g, some, jobs=1))[1] / ALONE
    same_check = timed(lambda: check_many(g, some, jobs=1, settings=QUICK))[1] / ALONE
    ones, bare = alone(lambda w: maximum(g, w, settings=QUICK), some)
    whole = alone(lambda w: maximum(g, w), W[:REPLAYED])[1]
    bare_check = alone(lambda w: check(g, w, settings=QUICK), some)[1]
    whole_check = alone(lambda w: check(g, w), some)[1]
    agree = [
        a.verdict == v and a.lower <= u * (1 + 1e-9) and low <= a.upper * (1 + 1e-9)
        for a, v, low, u in zip(ones, maxima.verdict, maxima.lower, maxima.upper, strict=False)
    ]
    return {
        "name": case.name,
        "contacts": case.contacts,
        "max_many": together / SIZE,
        "max_many_same": same,
        "check_many_same": same_check,
        "maximum": bare,
        "maximum_replayed": whole,
        "check_many": checked / SIZE,
        "check_many_replayed": with_replay / 100,
        "check": bare_check,
        "check_replayed": whole_check,
        "agree": int(sum(agree)),
        "asked": len(agree),
        "slips": float((replayed.verdict == "slips").mean()),
    }


def across(chosen: list[Case]) -> dict[str, float]:
    """One direction of many grasps: seconds a question together and one by one."""
    grasps = [case.grasp for case in chosen]
    W = np.array([case.direction for case in chosen])[:, None]
    _, together = timed(lambda: max_many(grasps, W, jobs=1))
    ones = [timed(lambda c=c: maximum(c.grasp, c.direction, settings=QUICK))[1] for c in chosen]
    return {"together": together / len(chosen), "alone": statistics.fmean(ones)}


def changing(case: Case) -> list[float]:
    """Seconds of each question to a prepared grasp whose load changes slowly, and its preload every fiftieth time."""
    prepared, held = prepare(case.grasp), maximum(case.grasp, case.direction, settings=QUICK).lower
    start, out = 0.3 * min(held, 10.0) * case.direction, []
    side = 0.05 * np.linalg.norm(start)
    for k in range(STEPS):
        if k % 50 == 49:
            prepared.preload({name: 1.01 * f for name, f in prepared.grasp.preload.items()})
        w = start * (1 + 0.2 * np.sin(0.03 * k)) + side * np.r_[np.cos(0.05 * k), np.sin(0.05 * k), 0, 0, 0, 0]
        answer, seconds = timed(lambda w=w: prepared.check(w))
        assert answer.found is None or answer.found.valid
        out.append(seconds)
    return out


def slipping(case: Case) -> dict[str, float] | None:
    """Medians [ms] of questions about a load beyond the largest that changes slowly: prepared, and by `check`.

    None where the largest is not known to be finite.
    """
    prepared, upper = prepare(case.grasp), maximum(case.grasp, case.direction, settings=QUICK).upper
    if not upper < np.inf:
        return None
    start = 1.3 * upper * case.direction
    side, asks = 0.05 * np.linalg.norm(start), {"prepared": prepared.check, "check": partial(check, case.grasp)}
    seconds: dict[str, list[float]] = {name: [] for name in asks}
    for k in range(STEPS // 5):
        w = start * (1 + 0.2 * np.sin(0.03 * k)) + side * np.r_[np.cos(0.05 * k), np.sin(0.05 * k), 0, 0, 0, 0]
        for name, ask in asks.items():
            answer, spent = timed(lambda ask=ask, w=w: ask(w))
            assert answer.verified
            seconds[name].append(spent)
    return {name: round(1e3 * statistics.median(spent), 3) for name, spent in seconds.items()}


def peer(case: Case, limit: float) -> dict[str, Any]:
    """Algorithm 1 on Gurobi; processor time and wall time [s]."""
    settings = algorithm1.RefinementSettings(solver="gurobi", timeout=limit, as_printed=True)
    start = time.perf_counter()
    try:
        answer, seconds = timed(lambda: algorithm1.maximum(case.grasp, case.direction, settings=settings).answer)
    except InputError as error:
        return {"name": case.name, "contacts": case.contacts, "stop": str(error), "seconds": None}
    row = {"name": case.name, "contacts": case.contacts, "stop": str(answer.stop), "seconds": seconds}
    return row | {"wall": time.perf_counter() - start}


def table(data: dict[str, Any]) -> str:
    """Medians over the grasps, as Markdown."""
    lines = [
        "| contacts | `max_many` [ms] | `maximum` [ms], times | replayed, times | Algorithm 1, times "
        "| `check_many` [ms] | `check` [ms], times |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for m in SIZES:
        some = [r for r in data["rows"] if r["contacts"] == m]
        if not some:
            continue

        def median(key: str, some: list[dict[str, Any]] = some) -> float:
            return statistics.median(r[key] for r in some)

        def ratio(one: str, many: str, some: list[dict[str, Any]] = some) -> float:
            return statistics.median(r[one] / r[many] for r in some)

        batch, checked = median("max_many"), median("check_many")
        asked = [r for r in data.get("peers", []) if r["contacts"] == m and r["seconds"] is not None]
        other = ""
        if asked:
            floor = "≥ " if any(r["stop"] == "time" for r in asked) else ""
            other = f"{floor}{statistics.median(r['seconds'] for r in asked) / batch:,.0f}"
        lines.append(
            f"| {m} | {1e3 * batch:.2f} | {1e3 * median('maximum'):.2f}, {ratio('maximum', 'max_many_same'):.1f} "
            f"| {1e3 * median('maximum_replayed'):.0f}, {ratio('maximum_replayed', 'max_many_same'):.0f} | {other} "
            f"| {1e3 * checked:.3f} | {1e3 * median('check'):.2f}, {ratio('check', 'check_many_same'):.1f} |"
        )
    return "\n".join(lines)


def draw(data: dict[str, Any], file: Path) -> None:
    """The latencies of a prepared grasp as a histogram."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
    bins = np.geomspace(0.1, 1000, 100)
    for m, seconds in data["changing"].items():
        ms = 1e3 * np.array(seconds)
        axes.hist(ms, bins, histtype="step", linewidth=1.5, label=f"{m} contacts, median {np.median(ms):.2f} ms")
    axes.set_xscale("log")
    axes.set(xlabel="processor time of one question [ms]", ylabel="questions")
    axes.legend(frameon=False)
    figure.savefig(file, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", action="store_true", help="ask Algorithm 1 on Gurobi as well")
    parser.add_argument("--peer-limit", type=float, default=60.0, metavar="S")
    parser.add_argument("--slipping", action="store_true", help="only loads that slip, beside the results there are")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="JSON")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw the histogram of the results there are")
    options = parser.parse_args()
    if options.picture:
        draw(json.loads(options.out.read_text()), options.picture)
        return
    chosen = [c for m in SIZES for c in [c for c in cases(("random",)) if c.contacts == m][:GRASPS]]
    maximum(chosen[0].grasp, chosen[0].direction)  # loads the machine code
    slips = {case.name: slipping(case) for case in chosen}
    if options.slipping:
        data = json.loads(options.out.read_text()) | {"slipping_ms": slips}
        options.out.write_text(json.dumps(data) + "\n")
        print(slips)
        return
    rows = []
    data: dict[str, Any] = {"machine": describe(), "questions": SIZE, "rows": rows, "slipping_ms": slips}
    for case in chosen:
        rows.append(row(case))
        print(rows[-1], flush=True)
    data["across"] = {m: across([c for c in cases(("random",)) if c.contacts == m]) for m in SIZES}
    data["changing"] = {m: [s for case in chosen if case.contacts == m for s in changing(case)] for m in SIZES}
    options.out.write_text(json.dumps(data) + "\n")
    if options.peers:
        data["peers"] = []
        for case in chosen:
            data["peers"].append(peer(case, options.peer_limit))
            print(data["peers"][-1], flush=True)
            options.out.write_text(json.dumps(data) + "\n")
    print(table(data))


if __name__ == "__main__":
    main()
