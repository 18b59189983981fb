"""How well do measures of grasps tell how much a grasp resists? Rank correlations over fresh random grasps.

    python -m benchmarks.measures [--count 1000] [--first 1810000] [--out results/measures.json]

Random grasps of `grasps.py` with 3, 4 and 5 contacts in turn, of which the first joint of each finger is commanded
with 0.1 N m, and whose commands some contact forces inside the friction cones balance. Of each: the largest
wrench that it resists passively in the worst of twelve directions (`handfast.measures.catalogue`, 1000 nodes each, and
5000 where these do not decide it); all classical measures; and that wrench once more with commands at random, between
a third of 0.1 N m and three times as much, which need not balance. The L infinity volume is of cones of four edges,
and of 3 and 4 contacts. Writes every twenty grasps and goes on where it was stopped.
`docs/make_measures_pictures.py` draws it.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import presses, random_case
from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.measures.catalogue import CATALOGUE, MEASURE_GAP, MEASURE_KEYS, PASSIVE, Measure, passive_maxima
from handfast.measures.measuring import measure_columns
from handfast.measures.wrench_space import MOST_SUMS
from handfast.model.grasp import Grasp
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "measures.json"
SIZES = (3, 4, 5)
COMMAND = 0.1  # [N m] of each first joint
NODES = (1000, 5000)  # of the search in each direction, at most
PYRAMID = 4  # edges of cones for the volume of the L infinity space, of 3 and 4 contacts
CLOSE = 0.05  # relative distance of the bounds of a worst maximum that counts as decided
CHOICE, DRAWS = 20, 2000  # of how many grasps a measure picks one, how often
DIGITS = 4  # significant ones that are kept


def grasp_of(k: int, first: int) -> Grasp:
    """The k-th grasp: the first one from its seed on whose commands balance."""
    m = SIZES[k % len(SIZES)]
    for seed in range(first + 1000 * k, first + 1000 * (k + 1)):
        grasp = random_case(m, seed).grasp
        grasp = grasp.with_preload(dict.fromkeys(grasp.preload, COMMAND))
        if presses(grasp):
            return grasp
    raise RuntimeError(f"no grasp from seed {first + 1000 * k} on balances its commands")


def short(x: float) -> float | None:
    """A number with few digits; None for an infinite one."""
    return float(f"{x:.{DIGITS}g}") if np.isfinite(x) else None


def row(k: int, first: int) -> dict[str, Any]:
    """A grasp and its passive maxima."""
    grasp = grasp_of(k, first)
    start = time.perf_counter()
    worst = worst_of(grasp)
    seconds = round(time.perf_counter() - start, 3)
    return {"grasp": grasp.name, "contacts": grasp.m, "worst": worst, "passive seconds": seconds}


def worst_of(grasp: Grasp) -> list[float | None]:
    """Bounds of the worst passive maximum, with more nodes if few do not decide it."""
    worst: list[float | None] = []
    for nodes in NODES:
        worst = [
            short(x) for x in passive_maxima(grasp, settings=Settings(nodes=nodes, gap=MEASURE_GAP, verify=False)).worst
        ]
        if decided(worst):
            break
    return worst


def measured(k: int, first: int) -> dict[str, Any]:
    """The classical measures of the k-th grasp, and the seconds that they take together."""
    grasp = grasp_of(k, first)
    start = time.perf_counter()
    values = measure_columns(grasp, only=[key for key in MEASURE_KEYS if key not in (PASSIVE, "volume_linf")])
    seconds = time.perf_counter() - start
    if (PYRAMID + 1) ** grasp.m <= MOST_SUMS:
        values |= measure_columns(grasp, only=["volume_linf"], edges=PYRAMID)
    return {key: short(float(v)) for key, v in values.items() if v is not None} | {"seconds": round(seconds, 3)}


def unmatched(k: int, first: int) -> list[float | None]:
    """Bounds of the worst maximum of the k-th grasp with commands drawn at random, whether they balance or not."""
    grasp, rng = grasp_of(k, first), np.random.default_rng([first, k])
    commands = {name: float(COMMAND * 10 ** rng.uniform(-0.5, 0.5)) for name in grasp.preload}
    return worst_of(grasp.with_preload(commands))


# --- what is made of it ---------------------------------------------------------------------------------


def decided(worst: list[float | None]) -> bool:
    """Are the bounds of a worst maximum finite and within 5 %?"""
    lower, upper = worst
    return lower is not None and upper is not None and upper - lower <= CLOSE * upper


def goodness(rows: list[dict[str, Any]], m: Measure) -> Array:
    """(n,) the values of a measure, larger for better; nan where it is not measured."""
    sign = -1.0 if m.better == "less" else 1.0
    return np.array([np.nan if r["measures"].get(m.key) is None else sign * r["measures"][m.key] for r in rows])


def rank_correlation(x: Array, y: Array) -> float | None:
    """Spearman's, over those that are measured; None if all of one are alike."""
    from scipy.stats import spearmanr

    known = np.isfinite(x)
    if known.sum() < 20 or np.ptp(x[known]) == 0:
        return None
    return round(float(spearmanr(x[known], y[known]).statistic), 3)


def picked(x: Array, y: Array, rng: np.random.Generator) -> float | None:
    """The share of `CHOICE` random grasps that resist no more than the one that a measure says is best, on average."""
    known = np.flatnonzero(np.isfinite(x))
    if len(known) < CHOICE:
        return None
    shares = []
    for _ in range(DRAWS):
        some = rng.choice(known, CHOICE, replace=False)
        best = some[np.flatnonzero(x[some] == x[some].max())]
        shares.append(np.mean([(np.count_nonzero(y[some] <= y[b]) - 1) / (CHOICE - 1) for b in best]))
    return round(float(np.mean(shares)), 3)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Correlations of each measure with the worst passive maximum, over all grasps and by number of contacts."""
    rows = [r for r in rows if "measures" in r]
    sure = [r for r in rows if decided(r["worst"])]
    y = np.array([r["worst"][0] for r in sure])
    other = [r for r in rows if "unmatched" in r and decided(r["unmatched"])]
    z = np.array([r["unmatched"][0] for r in other])
    out: dict[str, Any] = {"measured": len(rows), "decided": len(sure), "slips at 0": int((y == 0).sum())}
    out |= {"unmatched decided": len(other), "unmatched slips at 0": int((z == 0).sum()), "measures": {}}
    for m in CATALOGUE:
        if m.key == PASSIVE or not m.better:
            continue
        x = goodness(sure, m)
        entry = {"grasps": int(np.isfinite(x).sum()), "all": rank_correlation(x, y)}
        for size in SIZES:
            these = np.array([r["contacts"] == size for r in sure])
            entry[str(size)] = rank_correlation(x[these], y[these])
        entry["best of 20"] = picked(x, y, np.random.default_rng(1))
        entry["unmatched"] = rank_correlation(goodness(other, m), z) if other else None
        out["measures"][m.key] = entry
    return out


def save(path: Path, first: int, rows: list[dict[str, Any]]) -> None:
    data = {"machine": describe(), "first seed": first, "grasps": len(rows), "summary": summary(rows), "rows": rows}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(data, separators=(",", ":")).replace('{"grasp"', '\n{"grasp"') + "\n")
    part.replace(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=1_810_000)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rows: list[dict[str, Any]] = json.loads(args.out.read_text())["rows"] if args.out.exists() else []
    for k in range(args.count):
        if k == len(rows):
            rows.append(row(k, args.first))
        if "measures" not in rows[k]:
            rows[k]["measures"] = measured(k, args.first)
        if "unmatched" not in rows[k]:
            rows[k]["unmatched"] = unmatched(k, args.first)
            if (k + 1) % 20 == 0:
                save(args.out, args.first, rows)
                print(k + 1, flush=True)
    save(args.out, args.first, rows)
    print(json.dumps(summary(rows), indent=1))


if __name__ == "__main__":
    main()
