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
import math
import os
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.engine import BRIEF, REPEATS, Cost, load, proof, save, seconds, timed, timeout
from benchmarks.machine import describe
from handfast.core.errors import InputError
from handfast.papers.stability_tables import (
    PRINTED_2,
    TABLE_DIRECTIONS,
    TABLE_GAP,
    TABLE_SECTORS,
    TABLE_SEED,
    TWELVE_OBJECTS,
    PrintedTimes,
    TaskQuestion,
    task_questions,
)
from handfast.stability.answers import CheckAnswer
from handfast.stability.answers.answer import Answer, finite
from handfast.stability.problem.settings import Settings

RESULTS = Path(__file__).parent / "results" / "table2.json"
APART = 1e-3  # relative; brackets further apart than this disagree
NIL = 1e-6  # [N, N m] and smaller differences are rounding
METHODS = ("handfast", "gurobi")

Row = dict[str, Any]
Numbers = tuple[float, float, float]  # mean, standard error, median [s]


def questions() -> Iterator[TaskQuestion]:
    """All questions, round by round."""
    for a_round in zip(*(task_questions(name) for name in TWELVE_OBJECTS), strict=True):
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


def ours(question: TaskQuestion, limit: float) -> Row:
    """The engine, and what the checker says to its certificate."""
    settings = Settings(gap=TABLE_GAP, timeout=limit)
    answer, cost = timed(lambda: question.ask(settings))
    if cost.seconds < BRIEF:
        more = [cost, *(timed(lambda: question.ask(settings))[1] for _ in range(REPEATS - 1))]
        cost = Cost(statistics.median(c.seconds for c in more), statistics.median(c.cpu for c in more))
    return record(answer, cost) | proof(answer)


def theirs(question: TaskQuestion, limit: float) -> Row:
    """Algorithm 1 on Gurobi, refined to the finest sectors."""
    found, cost = timed(lambda: question.refined("gurobi", limit))
    return record(found.answer, cost) | {"programs": len(found.steps)}


def answered(question: TaskQuestion, method: str, limit: float) -> Row:
    """A row of either method; an input that is refused (a licence that is too small) is a row as well."""
    clock = time.perf_counter()
    try:
        return ours(question, limit) if method == "handfast" else theirs(question, limit)
    except InputError as error:
        return {"verdict": None, "stop": str(error), "seconds": time.perf_counter() - clock}


def pending(data: dict[str, Any], rounds: int) -> list[tuple[TaskQuestion, str]]:
    """What is not answered of the first round that is not done; rows of grasps that changed are dropped on the way."""
    rows = {(r["grasp"], r["task"], r["k"]): r for r in data["rows"]}
    asked = [q for q in questions() if q.k <= rounds]
    for q in asked:
        if q.key in rows and rows[q.key]["fingerprint"] != q.fingerprint:
            del rows[q.key]
    data["rows"] = list(rows.values())
    left = [(q, method) for q in asked for method in METHODS if method not in rows.get(q.key, {})]
    return [(q, method) for q, method in left if (q.task, q.k) == (left[0][0].task, left[0][0].k)]


def keep(data: dict[str, Any], question: TaskQuestion, method: str, found: Row) -> None:
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
        "question": f"check, max and torques of Table II, gap {TABLE_GAP:g}, {TABLE_SECTORS} sectors, "
        f"seed {TABLE_SEED}",
        "limit": options.limit,
        "machine": describe(),
        "rows": [],
    }
    if data["limit"] != options.limit:
        raise SystemExit(f"{options.out} has another time limit, {data['limit']:g} s; choose another --out")
    for name in (TWELVE_OBJECTS[0], TWELVE_OBJECTS[-1]):  # compile whatever the engine compiles
        for question in task_questions(name)[:3]:
            question.ask(Settings(gap=TABLE_GAP, timeout=options.limit))
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


def cells(name: str, printed: PrintedTimes, task: str, data: dict[str, Any]) -> list[str]:
    """A grasp's row of one task's table: the paper's times, Algorithm 1's, ours, their ratios."""
    done = [r for r in data["rows"] if r["grasp"] == name and r["task"] == task and all(m in r for m in METHODS)]
    both = [r for r in done if all(r[m]["verdict"] for m in METHODS)]
    single, limit = task == "check", data["limit"]
    count = f"{len(both)} of {1 if single else TABLE_DIRECTIONS}"
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
    rows = [cells(name, printed, task, data) for name, printed in zip(TWELVE_OBJECTS, PRINTED_2, strict=True)]
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
    parser.add_argument("--rounds", type=int, default=TABLE_DIRECTIONS, help="directions and wrenches, at most ten")
    parser.add_argument("--out", type=Path, default=RESULTS, help="JSON file of the results")
    parser.add_argument("--print", action="store_true", help="print the tables of what is there")
    options = parser.parse_args()
    data = load(options.out) if options.print else run(options)
    if data is None:
        raise SystemExit(f"{options.out}: no results yet")
    print(f"\n{summary(data)}")


if __name__ == "__main__":
    main()
