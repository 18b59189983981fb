"""Table II of the stability paper on the twelve bundled Barrett grasps: three tasks, beside Algorithm 1 on Gurobi.

    python -m benchmarks.table2 [--limit 60] [--rounds 10]
    python -m benchmarks.table2 --print

The paper's three tasks (section VII-D), each grasp with its stored preload: is the object's weight along its -z
resisted; the largest disturbance along ten random directions; the smallest largest command against ten random
wrenches. A direction is uniform on the unit sphere of forces and torques / size, about the centre of mass, where size
is the grasp's; a wrench is such a direction times the weight. The draws are the same for all grasps.

The engine (gap 1e-3, with its certificate, which the checker then verifies off the clock) and Algorithm 1 on
Gurobi (2048 sectors, refined to the finest ones as the paper has it) are asked one after the other in one process.
Compiling does not count; times of the engine below 50 ms are medians of five runs; a time-out counts with the limit.
Processor times are kept as well, of all threads: they say more where other work keeps the cores busy.

Results are saved after every answer. Each round asks all grasps: first the check, then direction and wrench 1,
direction and wrench 2, ..., so that a run can be stopped at any time. A grasp whose file has changed is asked again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.engine import BRIEF, REPEATS, Cost, load, proof, save, seconds, timeout
from benchmarks.machine import describe
from handfast import load_body, load_configuration, load_grasp
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import to_dict
from handfast.stability.answers import Answer, finite
from handfast.stability.loads import Loads
from handfast.stability.queries import CheckAnswer, check, maximum, torques
from handfast.stability.settings import Settings

RESULTS = Path(__file__).parent / "results" / "table2.json"
SEED = 2020
ROUNDS = 10  # directions, and wrenches
GAP = 1e-3
SECTORS = 2048
APART = 1e-3  # relative; brackets further apart than this disagree
NIL = 1e-6  # [N, N m] and smaller differences are rounding
TASKS: dict[str, Callable[..., Answer]] = {"check": check, "max": maximum, "torques": torques}
METHODS = ("handfast", "gurobi")

Row = dict[str, Any]
Numbers = tuple[float, float, float]  # mean, standard error, median [s]


@dataclass(frozen=True)
class Printed:
    """A row of the paper's Table II: letter in Fig. 13, contacts, and its times [s] as printed.

    Attributes:
        check: a time.
        max, torques: mean ± standard error, and median.
    """

    letter: str
    contacts: int
    check: tuple[str]
    max: tuple[str, str]
    torques: tuple[str, str]


PAPER = (
    Printed("a", 3, ("0.246",), ("0.797 ± 0.067", "0.754"), ("0.389 ± 0.063", "0.343")),
    Printed("b", 3, ("0.234",), ("0.785 ± 0.085", "0.745"), ("0.447 ± 0.074", "0.408")),
    Printed("c", 3, ("0.294",), ("0.893 ± 0.056", "0.907"), ("0.347 ± 0.017", "0.345")),
    Printed("d", 3, ("0.259",), ("0.664 ± 0.081", "0.560"), ("0.308 ± 0.036", "0.281")),
    Printed("e", 4, ("1.07",), ("10.0 ± 3.4", "6.39"), ("3.26 ± 0.50", "3.83")),
    Printed("f", 4, ("15.7",), ("36.7 ± 6.5", "39.5"), ("13.5 ± 4.8", "9.58")),
    Printed("g", 4, ("2.78",), ("33.8 ± 9.3", "20.8"), ("16.8 ± 5.3", "12.3")),
    Printed("h", 4, ("8.02",), ("23.7 ± 4.2", "23.2"), ("12.3 ± 3.3", "8.10")),
    Printed("i", 4, ("1.66",), ("14.4 ± 2.7", "11.4"), ("1.67 ± 0.12", "1.60")),
    Printed("j", 5, ("6.06",), ("150 ± 24", "105"), ("22.8 ± 5.8", "19.0")),
    Printed("k", 6, ("51.0",), ("398 ± 104", "344"), ("136 ± 54", "80.6")),
    Printed("l", 6, ("27.5",), ("488 ± 99", "330"), ("777 ± 288", "626")),
)
# our grasp with as many contacts for each of those
GRASPS = ("ball", "can", "mug", "pear", "block", "egg", "dumbbell", "wedge", "mallet", "ring", "bottle", "torch")


# --- questions ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Question:
    """One cell's question.

    Attributes:
        name: of the object in the hand.
        task: a key of `TASKS`.
        k: number of the direction or wrench, from 1; 0 for the check.
        wrench: (6,) disturbance or direction [N, N m], object frame, at its origin.
        fingerprint: of the grasp as it is stored, and the object's weight.
    """

    name: str
    grasp: Grasp
    task: str
    k: int
    wrench: Array
    fingerprint: str

    @property
    def key(self) -> tuple[str, str, int]:
        return self.name, self.task, self.k

    def ask(self, settings: Settings) -> tuple[Answer, Cost]:
        """The answer and its cost."""
        wall, cpu = time.perf_counter(), time.process_time()
        answer = TASKS[self.task](self.grasp, self.wrench, settings=settings)
        return answer, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def drawn() -> tuple[Array, Array]:
    """(n, 6) each: unit directions for the disturbances and for the wrenches."""
    x = np.random.default_rng(SEED).normal(size=(2, ROUNDS, 6))
    x /= np.linalg.norm(x, axis=2, keepdims=True)
    return x[0], x[1]


def of_grasp(name: str) -> list[Question]:
    """All questions about one of the twelve, as its files are now."""
    grasp = load_grasp(f"barrett-{name}")
    body = load_body(load_configuration(f"barrett-{name}").object or "")
    weight = Loads.gravity(body, "-z").wrenches[0]
    numbers = {key: value for key, value in to_dict(grasp).items() if key != "schema"}
    text = json.dumps([numbers, np.round(weight, 9).tolist()], sort_keys=True)
    fingerprint = hashlib.sha256(text.encode()).hexdigest()[:16]

    def about_center(x: Array) -> Array:
        return np.r_[x[:3], grasp.size * x[3:] + np.cross(body.center_of_mass, x[:3])]

    disturbances, wrenches = drawn()
    asked = [("check", 0, weight)]
    for k, (d, w) in enumerate(zip(disturbances, wrenches, strict=True), start=1):
        asked += [("max", k, about_center(d)), ("torques", k, float(np.linalg.norm(weight[:3])) * about_center(w))]
    return [Question(name, grasp, task, k, wrench, fingerprint) for task, k, wrench in asked]


def questions() -> Iterator[Question]:
    """All questions, round by round."""
    for a_round in zip(*(of_grasp(name) for name in GRASPS), strict=True):
        yield from a_round


# --- running ------------------------------------------------------------------------------------


def record(answer: Answer, cost: Cost) -> Row:
    """What is kept of an answer; the load tells whether the machine did something else as well."""
    row: Row = {"verdict": str(answer.verdict), "stop": str(answer.stop)}
    if not isinstance(answer, CheckAnswer):
        bounds: Any = answer
        row |= {"lower": finite(bounds.lower), "upper": finite(bounds.upper)}
        row |= {"unbounded": getattr(answer, "unbounded", False)}
    row |= {"seconds": cost.seconds, "cpu_seconds": cost.cpu, "load": round(os.getloadavg()[0], 1)}
    row["nodes"] = answer.nodes
    return row | {"residual": answer.witness.residuals.worst if answer.witness else None}


def ours(question: Question, limit: float) -> Row:
    """The engine, and what the checker says to its certificate."""
    settings = Settings(gap=GAP, time_limit=limit)
    answer, cost = question.ask(settings)
    if cost.seconds < BRIEF:
        more = [cost, *(question.ask(settings)[1] for _ in range(REPEATS - 1))]
        cost = Cost(statistics.median(c.seconds for c in more), statistics.median(c.cpu for c in more))
    return record(answer, cost) | proof(answer)


def theirs(question: Question, limit: float) -> Row:
    """Algorithm 1 on Gurobi, refined to the finest sectors."""
    settings = Settings("algorithm1", GAP, limit, solver="gurobi", sectors=SECTORS, as_printed=True)
    answer, cost = question.ask(settings)
    return record(answer, cost) | {"programs": len(answer.steps)}


def answered(question: Question, method: str, limit: float) -> Row:
    """A row of either method; an input that is refused (a licence that is too small) is a row as well."""
    clock = time.perf_counter()
    try:
        return ours(question, limit) if method == "handfast" else theirs(question, limit)
    except InputError as error:
        return {"verdict": None, "stop": str(error), "seconds": time.perf_counter() - clock}


def pending(data: dict[str, Any], rounds: int) -> list[tuple[Question, str]]:
    """What is not answered of the first round that is not done; rows of grasps that changed are dropped on the way."""
    rows = {(r["grasp"], r["task"], r["k"]): r for r in data["rows"]}
    asked = [q for q in questions() if q.k <= rounds]
    for q in asked:
        if q.key in rows and rows[q.key]["fingerprint"] != q.fingerprint:
            del rows[q.key]
    data["rows"] = list(rows.values())
    left = [(q, method) for q in asked for method in METHODS if method not in rows.get(q.key, {})]
    return [(q, method) for q, method in left if (q.task, q.k) == (left[0][0].task, left[0][0].k)]


def keep(data: dict[str, Any], question: Question, method: str, found: Row) -> None:
    """Add an answer to its row."""
    key = question.key
    row = next((r for r in data["rows"] if (r["grasp"], r["task"], r["k"]) == key), None)
    if row is None:
        row = dict(zip(("grasp", "task", "k"), key, strict=True))
        row |= {"contacts": question.grasp.m, "fingerprint": question.fingerprint}
        data["rows"].append(row)
    row[method] = found


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Every question that has no answer yet."""
    data = load(options.out) or {
        "question": f"check, max and torques of Table II, gap {GAP:g}, {SECTORS} sectors, seed {SEED}",
        "limit": options.limit,
        "machine": describe(),
        "rows": [],
    }
    if data["limit"] != options.limit:
        raise SystemExit(f"{options.out} has another time limit, {data['limit']:g} s; choose another --out")
    for name in (GRASPS[0], GRASPS[-1]):  # compile whatever the engine compiles
        for question in of_grasp(name)[:3]:
            question.ask(Settings(gap=GAP, time_limit=options.limit))
    while some := pending(data, options.rounds):
        for question, method in some:
            found = answered(question, method, options.limit)
            if found["stop"] == "interrupted":
                raise SystemExit("interrupted; what was finished is kept")
            keep(data, question, method, found)
            save(data, options.out)
            print(*question.key, method, line(found), flush=True)
    return data


def line(found: Row) -> str:
    """An answer in one line."""
    keys = ("verdict", "stop", "lower", "upper", "unbounded", "nodes", "verified", "seconds")
    return "  ".join(f"{v:.4g}" if isinstance(v := found[k], float) else str(v) for k in keys if k in found)


# --- what came out ------------------------------------------------------------------------------


def disagreement(a: Row, b: Row) -> str | None:
    """What two answers to one question contradict each other in, None if they do not.

    Both are brackets: of Algorithm 1 from its exact witness to the bound of its finest sectors. So answers that
    differ by no more than its resolution overlap.
    """
    verdicts = {a["verdict"], b["verdict"]}
    if verdicts == {"holds", "slips"}:
        return "verdict"
    if verdicts & {None, "slips"} or "lower" not in a:
        return None
    low, high = max(a["lower"], b["lower"]), min(math.inf if r["upper"] is None else r["upper"] for r in (a, b))
    return "bounds" if low > high * (1 + APART) + NIL else None


def numbers(times: list[float]) -> Numbers:
    """Mean, standard error (NaN of a single time) and median."""
    error = statistics.stdev(times) / math.sqrt(len(times)) if len(times) > 1 else math.nan
    return statistics.mean(times), error, statistics.median(times)


def cells(name: str, printed: Printed, task: str, data: dict[str, Any]) -> list[str]:
    """A grasp's row of one task's table: the paper's times, Algorithm 1's, ours, their ratios."""
    done = [r for r in data["rows"] if r["grasp"] == name and r["task"] == task and all(m in r for m in METHODS)]
    both = [r for r in done if all(r[m]["verdict"] for m in METHODS)]
    single, limit = task == "check", data["limit"]
    count = f"{len(both)} of {1 if single else ROUNDS}"
    out = [name, str(printed.contacts), printed.letter, *getattr(printed, task)]
    if not both:
        return [*out, *[""] * (5 if single else 7), count]
    late = sum(timeout(r["gurobi"], limit) for r in both)
    took = [seconds(r["gurobi"], limit) for r in both]
    theirs = numbers(took)
    mine = numbers([1e3 * r["handfast"]["seconds"] for r in both])
    cpu = [statistics.median(r[m]["cpu_seconds"] for r in both) for m in METHODS]
    floor = "≥ " if statistics.median_high(took) >= limit else ""
    ratios = [f"{floor}{float(f'{x:.2g}'):,.10g}" for x in (1e3 * theirs[2] / mine[2], cpu[1] / cpu[0])]
    medians = floor + digits(theirs[2]), digits(mine[2])
    if single:
        return [*out, *medians, *ratios, both[0]["handfast"]["verdict"], count]
    mean = ("≥ " if late else "") + spread(theirs)
    return [*out, mean, medians[0], str(late or ""), spread(mine), medians[1], *ratios, count]


def spread(x: Numbers) -> str:
    """Mean ± standard error, if there is one."""
    return digits(x[0]) + (f" ± {digits(x[1], 2)}" if not math.isnan(x[1]) else "")


def digits(x: float, count: int = 3) -> str:
    """So many significant digits, or all of the whole number."""
    return f"{x:,.{max(0, count - 1 - math.floor(math.log10(x)))}f}" if x > 0 else "0"


def table(task: str, data: dict[str, Any]) -> list[str]:
    """One task as Markdown, a row for each of the twelve."""
    head = ["grasp", "contacts", "paper's"]
    if task == "check":
        head += ["paper [s]", "Algorithm 1 [s]", "Handfast [ms]", "ratio", "processor", "verdict", "done"]
    else:
        head += ["paper, mean [s]", "median", "Algorithm 1, mean [s]", "median", "time-outs"]
        head += ["Handfast, mean [ms]", "median", "ratio of medians", "processor", "done"]
    rows = [cells(name, printed, task, data) for name, printed in zip(GRASPS, PAPER, strict=True)]
    lines = [head, ["---", "---:", "---", *["---:"] * (len(head) - 3)], *rows]
    return [f"| {' | '.join(r)} |" for r in lines]


def complaints(data: dict[str, Any]) -> list[str]:
    """Every disagreement, open answer, unverified certificate and question that was refused."""
    out = []
    for r in data["rows"]:
        name, mine, peer = f"{r['grasp']} {r['task']} {r['k']}", r.get("handfast", {}), r.get("gurobi", {})
        for found, who in ((mine, "Handfast"), (peer, "Algorithm 1")):
            if found and not found["verdict"]:
                out.append(f"- {name}: {who}: {found['stop']}")
        if mine.get("verdict") and mine["stop"] != "complete":
            out.append(f"- {name}: open, {line(mine)}")
        if mine.get("verified") is False:
            out.append(f"- {name}: certificate refused, {mine['refused']}")
        if mine and peer and (why := disagreement(mine, peer)):
            out.append(f"- {name}: disagree in {why}: {line(mine)} / {line(peer)}")
    return out or ["none"]


def summary(data: dict[str, Any]) -> str:
    """The three tables, how the answers compare, and whatever is not as it should be."""
    titles = {"check": "Stability check", "max": "Maximum disturbance", "torques": "Optimal torques"}
    lines: list[str] = []
    for task, title in titles.items():
        lines += [f"{title}:", "", *table(task, data), ""]
    both = [r for r in data["rows"] if all(r.get(m, {}).get("verdict") for m in METHODS)]
    proofs = [r["handfast"]["verified"] for r in both if r["handfast"]["verified"] is not None]
    worst = max((r["handfast"]["residual"] or 0.0 for r in both), default=0.0)
    wrong = sum(disagreement(*(r[m] for m in METHODS)) is not None for r in both)
    late = sum(timeout(r["gurobi"], data["limit"]) for r in both)
    lines += [f"{len(both)} questions asked of both, {wrong} disagreements, {late} time-outs of Algorithm 1;",
              f"{sum(proofs)} of {len(proofs)} certificates accepted, worst residual {worst:.1e}."]  # fmt: skip
    return "\n".join([*lines, "", "Disagreements, open and refused:", "", *complaints(data)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--limit", type=float, default=60.0, help="[s] per question and method")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="directions and wrenches, at most ten")
    parser.add_argument("--out", type=Path, default=RESULTS, help="JSON file of the results")
    parser.add_argument("--print", action="store_true", help="print the tables of what is there")
    options = parser.parse_args()
    data = load(options.out) if options.print else run(options)
    if data is None:
        raise SystemExit(f"{options.out}: no results yet")
    print(f"\n{summary(data)}")


if __name__ == "__main__":
    main()
