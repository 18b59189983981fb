"""The engine against Algorithm 1 on Gurobi and on SCIP: one run side by side over the set of `grasps.py`.

    python -m benchmarks.engine [--peers gurobi scip] [--peer-limit 120] [--per-size 9] [--early]
    python -m benchmarks.engine --summary
    python -m benchmarks.engine --picture docs/img/engine_times.png

The question is the largest disturbance along a direction, to a gap of 1e-3, exact normals. The engine answers
every case. Peers are asked right after it, on a subsample fixed beforehand: the first `--per-size` random cases
of 3, 4, 5 and 6 contacts, and the first real hands and fixtures of those sizes (`--real` of each kind). They
have 2048 sectors and refine to the finest ones, as the paper has it; with `--early` they stop as soon as an
exact solution closes the gap, which the paper does not do. A peer that runs out of time counts with the limit.
Times of less than 50 ms are medians of five runs, the first run of all (compilation) is not counted.

Results are saved after every case; rows and peers that are there already are not run again.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from benchmarks.grasps import FAMILIES, Case, cases, fingerprint
from benchmarks.machine import describe
from handfast.core.errors import InputError
from handfast.papers import algorithm1
from handfast.proofs.checker import verify
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.answer import finite
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "engine.json"
GAP = 1e-3
SECTORS = 2048
SOLVERS = ("gurobi", "scip")
KINDS = ("random", "real hand", "fixture", "power")
DRAWN = ("random", "power")
PEER_SIZES = (3, 4, 5, 6)
BRIEF, REPEATS = 0.05, 5  # [s] below this a time is a median of so many runs
APART = 3e-3  # relative; answers further apart than this disagree

Row = dict[str, Any]
T = TypeVar("T")


# --- running ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cost:
    """Wall and processor time [s] of an answer; all threads count for the latter."""

    seconds: float
    cpu: float


def record(answer: MaxAnswer, cost: Cost) -> Row:
    """What is kept of an answer; the load tells whether the machine did something else as well."""
    return {
        "verdict": str(answer.verdict),
        "stop": str(answer.stop),
        "lower": answer.lower,
        "upper": finite(answer.upper),
        "unbounded": answer.unbounded,
        "seconds": cost.seconds,
        "cpu_seconds": cost.cpu,
        "load": round(os.getloadavg()[0], 1),
        "nodes": answer.nodes,
    }


def timed(ask: Callable[[], T]) -> tuple[T, Cost]:
    """The answer and its cost."""
    wall, cpu = time.perf_counter(), time.process_time()
    answer = ask()
    return answer, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def ours(case: Case, limit: float) -> Row:
    """The engine on one case."""
    settings = Settings(gap=GAP, timeout=limit)

    def ask() -> MaxAnswer:
        return maximum(case.grasp, case.direction, base=case.base, settings=settings)

    answer, cost = timed(ask)
    if cost.seconds < BRIEF:
        more = [cost] + [timed(ask)[1] for _ in range(REPEATS - 1)]
        cost = Cost(statistics.median(c.seconds for c in more), statistics.median(c.cpu for c in more))
    row = {"name": case.name, "family": case.family, "contacts": case.contacts, "joints": case.grasp.l}
    row |= record(answer, cost)
    row["residual"] = answer.witness.residuals.worst if answer.witness else None
    return row | proof(answer)


def proof(answer: MaxAnswer) -> Row:
    """The certificate of the upper bound, written down and checked; the time for both is not the engine's."""
    clock = time.perf_counter()
    certificate = answer.certificate
    if certificate is None:
        return {"leaves": None, "verified": None}
    found = verify(certificate)
    return {
        "leaves": found.leaves,
        "verified": found.ok,
        "margin": finite(found.margin),
        "refused": found.reason,
        "proof_seconds": time.perf_counter() - clock,
    }


def theirs(case: Case, solver: str, limit: float, early: bool) -> Row:
    """Algorithm 1 on one case."""
    settings = algorithm1.RefinementSettings(
        solver=solver, sectors=SECTORS, gap=GAP, timeout=limit, as_printed=not early
    )
    clock = time.perf_counter()
    try:
        found, cost = timed(lambda: algorithm1.maximum(case.grasp, case.direction, base=case.base, settings=settings))
    except InputError as error:  # a licence that is too small for the program
        return {"verdict": None, "stop": str(error), "seconds": time.perf_counter() - clock}
    return record(found.answer, cost) | {"programs": len(found.steps)}


def subsample(chosen: Iterable[Case], per_size: int, real: int) -> set[str]:
    """Names of the cases that peers are asked: the first ones of each size and kind."""
    names, count = set(), Counter[tuple[str, int]]()
    for case in chosen:
        key = (case.family, case.contacts)
        allowed = per_size if case.family == "random" else real
        if case.contacts in PEER_SIZES and count[key] < allowed:
            names.add(case.name)
        count[key] += 1
    return names


def warm_up(chosen: list[Case]) -> None:
    """Compile whatever the engine compiles: a maximum of each kind of question."""
    for family in ("random", "fixture"):
        case = next((c for c in chosen if c.family == family), chosen[0])
        maximum(case.grasp, case.direction, base=case.base, settings=Settings(gap=GAP, timeout=60.0))


def save(data: dict[str, Any], file: Path) -> None:
    """Write all, or leave what was there."""
    draft = file.with_suffix(".tmp")
    draft.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    os.replace(draft, file)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Every case that is not in the file yet, peers right after the engine."""
    whole = cases()
    asked = subsample(whole, options.per_size, options.real)
    chosen = [c for c in whole if c.family in options.families and (not options.sizes or c.contacts in options.sizes)]
    data = load(options.out) or {
        "question": f"largest disturbance, gap {GAP:g}, exact normals",
        "set": fingerprint(whole),
        "sectors": SECTORS,
        "limit": options.limit,
        "peer_limit": options.peer_limit,
        "machine": describe(),
        "rows": [],
    }
    if data["set"] != fingerprint(whole):
        raise SystemExit(f"{options.out} belongs to another set of grasps; choose another --out")
    if data["peer_limit"] != options.peer_limit or data["limit"] != options.limit:
        raise SystemExit(f"{options.out} has other time limits; choose another --out")
    rows = {r["name"]: r for r in data["rows"]}
    if not options.no_engine:
        warm_up(whole)
    for case in chosen:
        row = rows.setdefault(case.name, {"name": case.name, "family": case.family, "contacts": case.contacts})
        if "verdict" not in row and not options.no_engine:
            row |= ours(case, options.limit)
            keep(data, rows, options.out, row)
        for solver in options.peers if case.name in asked else ():
            key = f"{solver} early" if options.early else solver
            if key not in row.get("peers", {}):
                found = theirs(case, solver, options.peer_limit, options.early)
                row.setdefault("peers", {})[key] = found
                keep(data, rows, options.out, {"name": f"{case.name}, {key}"} | found)
    return data


def keep(data: dict[str, Any], rows: dict[str, Row], file: Path, last: Row) -> None:
    """Save all rows that have something in them, unless the last answer was interrupted."""
    if last["stop"] == "interrupted":
        raise SystemExit("interrupted; what was finished is kept")
    data["rows"] = [r for r in rows.values() if "verdict" in r or r.get("peers")]
    save(data, file)
    print(line(last), flush=True)


def line(row: Row) -> str:
    """A row in one line."""
    keys = ("name", "verdict", "stop", "lower", "upper", "unbounded", "nodes", "leaves", "verified", "seconds")
    shown = (f"{v:.4g}" if isinstance(v := row[k], float) else str(v) for k in keys if row.get(k) is not None)
    return "  ".join(shown)


def load(file: Path) -> dict[str, Any] | None:
    return json.loads(file.read_text("utf-8")) if file.exists() else None


# --- what came out ------------------------------------------------------------------------------


def disagreement(a: Row, b: Row) -> str | None:
    """What two answers to one question contradict each other in, None if they do not."""
    if not a.get("verdict") or not b.get("verdict"):
        return None
    if {a["verdict"], b["verdict"]} == {"holds", "slips"}:
        return "verdict"
    low, high = max(a["lower"], b["lower"]), min(top(a), top(b))
    if low > high * (1 + APART):
        return "bounds"
    closed = all(r["stop"] == "complete" and not r["unbounded"] for r in (a, b))
    if closed and abs(a["lower"] - b["lower"]) > APART * low:
        return "values"
    return None


def top(row: Row) -> float:
    """The upper bound, infinite if there is none."""
    return math.inf if row["upper"] is None else row["upper"]


def timeout(row: Row, limit: float) -> bool:
    """Was it stopped? A peer that refines to the end can be, though its bounds have met."""
    return row["stop"] == "time" or row["seconds"] >= limit


def seconds(row: Row, limit: float) -> float:
    """A time, or the limit for one that ran out."""
    return limit if timeout(row, limit) else row["seconds"]


def usable(row: Row, key: str) -> bool:
    """Was this peer asked, and could its licence do it?"""
    return bool(row.get("peers", {}).get(key, {}).get("verdict"))


def peer_keys(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(k for r in rows for k in r.get("peers", {})))


def summary(data: dict[str, Any]) -> str:
    """Engine by number of contacts, peers by number of contacts, and everything that is not as it should be."""
    rows, limit = data["rows"], data["peer_limit"]
    lines = ["The engine:", "", *engine_table([r for r in rows if "verdict" in r]), ""]
    for key in peer_keys(rows):
        lines += [f"Algorithm 1 on {key}, limit {limit:g} s:", "", *peer_table(rows, key, limit), ""]
    return "\n".join([*lines, *complaints(rows)])


def grouped(rows: list[Row]) -> dict[str, list[Row]]:
    """Rows by number of contacts and kind of grasp."""
    out: dict[str, list[Row]] = {}
    for r in sorted(rows, key=lambda r: (r["contacts"], KINDS.index(named(r)))):
        out.setdefault(f"{r['contacts']} {named(r)}", []).append(r)
    return out


def named(row: Row) -> str:
    """The kind of grasp a row is counted with."""
    return {"barrett": "real hand", "allegro": "real hand"}.get(row["family"], row["family"])


def engine_table(rows: list[Row]) -> list[str]:
    """Times and nodes of the engine, and what the answers were."""
    head = ["contacts", "n", "bounded", "unbounded", "slips", "open", "median [ms]", "mean [ms]", "worst [ms]", "nodes"]
    head += ["leaves", "verified"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for name, group in grouped(rows).items():
        ms = [1e3 * r["seconds"] for r in group]
        kinds = Counter(kind(r) for r in group)
        cells = [name, len(group), *(kinds[k] or "" for k in ("bounded", "unbounded", "slips", "open"))]
        cells += [f"{f(ms):.3g}" for f in (statistics.median, statistics.mean, max)]
        proofs = [r["leaves"] for r in group if r["leaves"] is not None]
        cells += [f"{statistics.median(r['nodes'] for r in group):.0f}"]
        cells += [f"{statistics.median(proofs):.0f}" if proofs else "", sum(bool(r["verified"]) for r in group) or ""]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines


def kind(row: Row) -> str:
    """What an answer says: bounded, unbounded, slips (at every magnitude) or open."""
    if row["unbounded"]:
        return "unbounded"
    if row["stop"] != "complete":
        return "open"
    return "bounded" if row["lower"] > 0 else "slips"


def peer_table(rows: list[Row], key: str, limit: float) -> list[str]:
    """A peer beside the engine on the same cases."""
    head = ["contacts", "n", "median [s]", "mean [s]", "worst [s]", "nodes", "time-outs", "engine median [s]"]
    head += ["ratio of medians", "median of ratios", "same, bounded only", "disagreements"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    for name, group in grouped([r for r in rows if usable(r, key)]).items():
        lines.append("| " + " | ".join([name, *peer_cells(group, key, limit)]) + " |")
    return lines


def peer_cells(group: list[Row], key: str, limit: float) -> list[str]:
    peers = [r["peers"][key] for r in group]
    took = [seconds(p, limit) for p in peers]
    cells = [str(len(group)), *(f"{f(took):.3g}" for f in (statistics.median, statistics.mean, max))]
    cells += [f"{statistics.median(p['nodes'] for p in peers):.0f}", str(sum(timeout(p, limit) for p in peers) or "")]
    if any("verdict" not in r for r in group):
        return [*cells, *[""] * 5]
    mine = [r["seconds"] for r in group]
    ratios = [t / s for t, s in zip(took, mine, strict=True)]
    bounded = [x for x, r in zip(ratios, group, strict=True) if kind(r) == "bounded"]
    cells += [f"{statistics.median(mine):.3g}", f"{statistics.median(took) / statistics.median(mine):.3g}"]
    cells += [f"{statistics.median(x):.3g}" if x else "" for x in (ratios, bounded)]
    return [*cells, str(sum(disagreement(r, p) is not None for r, p in zip(group, peers, strict=True)))]


def complaints(rows: list[Row]) -> list[str]:
    """Every disagreement, open answer, unverified certificate and peer that could not be asked."""
    out = []
    for r in rows:
        if "verdict" in r and kind(r) == "open":
            out.append(f"- {r['name']}: engine {r['stop']}, {r['lower']:.5g} to {top(r):.5g}")
        if r.get("verified") is False:
            out.append(f"- {r['name']}: certificate refused: {r['refused']}")
        peers = r.get("peers", {})
        for key, p in peers.items():
            if not p["verdict"]:
                out.append(f"- {r['name']}: {key} {p['stop']}")
            elif "verdict" in r and (why := disagreement(r, p)):
                out.append(f"- {r['name']}: engine and {key} disagree ({why}): {line(r)} / {line(p)}")
        out += [f"- {r['name']}: {a} and {b} disagree ({why})"
                for a in peers for b in peers if a < b and (why := disagreement(peers[a], peers[b]))]  # fmt: skip
    return ["Disagreements and open answers:", "", *(out or ["none"])]


# --- picture ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Series:
    """What is drawn of one method: how it looks, and its answer in a row."""

    label: str
    color: str
    marker: str
    dash: str
    limit: float
    get: Callable[[Row], Row | None]


def series_of(data: dict[str, Any], rows: list[Row]) -> list[Series]:
    """The engine and every peer that was asked."""
    from handfast.pictures.drawing import BLUE, MAROON

    colors = {"gurobi": (MAROON, "s", "Gurobi"), "scip": ("#c98a12", "^", "SCIP")}
    out = [Series("engine", BLUE, "o", "-", data["limit"], lambda r: r if "verdict" in r else None)]
    for key in peer_keys(rows):
        color, marker, name = colors[key.split()[0]]
        early = key.endswith("early")
        label = f"Algorithm 1, {name}{', stopped early' if early else ''}"

        def get(row: Row, key: str = key) -> Row | None:
            return row["peers"][key] if usable(row, key) else None

        out.append(Series(label, color, marker, ":" if early else "-", data["peer_limit"], get))
    return out


def draw(data: dict[str, Any]) -> Any:
    """Time against contacts, logarithmic: a point per case, medians joined; hollow points ran out of time."""
    from matplotlib.figure import Figure

    from handfast.pictures.drawing import DPI, GREY, INK

    figure = Figure(figsize=(8.0, 5.0), dpi=DPI)
    ax = figure.add_axes((0.10, 0.20, 0.87, 0.71))
    rows = [r for r in data["rows"] if r["family"] in DRAWN]
    drawn = series_of(data, rows)
    for k, series in enumerate(drawn):
        scatter(ax, rows, series, shift=0.2 * (k - (len(drawn) - 1) / 2))
    ax.set_yscale("log")
    ax.set_xticks(sorted({r["contacts"] for r in rows}))
    ax.set_xlabel("contacts")
    ax.set_ylabel("time for a maximum [s]")
    title = "Largest disturbance of random and power grasps, gap 1e-3"
    ax.set_title(title, loc="left", fontsize=12, color=INK)
    ax.grid(color="#e4e4e4", lw=0.6, zorder=0)
    for side, shown in {"top": False, "right": False, "left": True, "bottom": True}.items():
        ax.spines[side].set_visible(shown)
        ax.spines[side].set_color(GREY)
    ax.tick_params(which="both", color=GREY, labelcolor=INK)
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.015)}
    figure.legend(*ax.get_legend_handles_labels(), ncols=4, frameon=False, fontsize=9.5, **place)
    return figure


def scatter(ax: Any, rows: list[Row], series: Series, shift: float) -> None:
    """Points beside the number of contacts, and a line of medians for each family."""
    rng = np.random.default_rng(0)
    limit, color = series.limit, series.color
    label: str | None = series.label
    for family in DRAWN:
        answers = [(r["contacts"], a) for r in rows if r["family"] == family and (a := series.get(r))]
        if not answers:
            continue
        for late in (False, True):
            some = [(m, seconds(a, limit)) for m, a in answers if timeout(a, limit) == late]
            places = [m + shift + 0.05 * rng.uniform(-1, 1) for m, _ in some]
            style = {"ms": 3.4, "mfc": "none" if late else color, "mec": color, "mew": 0.8, "alpha": 0.55}
            ax.plot(places, [t for _, t in some], series.marker, ls="", zorder=3, **style)
        sizes = sorted({m for m, _ in answers})
        medians = [statistics.median(seconds(a, limit) for m, a in answers if m == size) for size in sizes]
        style = {"color": color, "ls": series.dash, "lw": 1.8, "marker": series.marker, "ms": 7, "mec": "white"}
        ax.plot([m + shift for m in sizes], medians, label=label, zorder=4, **style)
        label = None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", nargs="*", default=list(SOLVERS), choices=SOLVERS)
    parser.add_argument("--peer-limit", type=float, default=120.0, help="[s] per case and peer")
    parser.add_argument("--limit", type=float, default=120.0, help="[s] per case for the engine")
    parser.add_argument("--per-size", type=int, default=9, help="random cases per number of contacts for the peers")
    parser.add_argument("--real", type=int, default=2, help="cases of each other family and number of contacts")
    parser.add_argument("--early", action="store_true", help="peers stop as soon as an exact solution closes the gap")
    parser.add_argument("--families", nargs="*", default=list(FAMILIES), choices=FAMILIES)
    parser.add_argument("--sizes", nargs="*", type=int, help="numbers of contacts")
    parser.add_argument("--no-engine", action="store_true", help="only the peers")
    parser.add_argument("--out", type=Path, default=RESULTS, help="JSON file of the results")
    parser.add_argument("--summary", action="store_true", help="print the tables of what is there")
    parser.add_argument("--picture", type=Path, help="draw what is there to a PNG or SVG file")
    options = parser.parse_args()
    if not options.summary and not options.picture:
        print(f"\n{summary(run(options))}")
        return
    data = load(options.out)
    if data is None:
        raise SystemExit(f"{options.out}: no results yet")
    if options.summary:
        print(summary(data))
    if options.picture:
        from handfast.pictures.drawing import picture

        options.picture.write_bytes(picture(draw(data), options.picture.suffix[1:], dpi=150))


if __name__ == "__main__":
    main()
