"""Questions as users ask them, by families of fresh grasps: processor time beside an aim, the worst family first.

    python -m benchmarks.users [--only WORD ...] [--count 200] [--before ../before] [--rounds 3] [--published FOLDER]
    python -m benchmarks.users --peers 3 [--peer-limit 150]
    python -m benchmarks.users --profile [--only WORD ...] [--count 40]

Every family draws its grasps by seeds of its own, `FIRST` and on, which no other script has and nothing was tuned on;
those whose preload presses and whose largest pull is bounded count. Grasps are made anew for every run, so that
nothing of them is known yet.

- `many`: one maximum each of `--count` grasps in one call of `max_many`, one core;
- `prepare`: grasps of one shape made ready together, no load asked (`rows`); a grasp made ready and asked its first
  load, which it resists: in one call of `check_many` for all (`batch`), and by `prepare` one by one (`alone`);
- `next`: a prepared grasp under a load that changes slowly and holds (judged by the equations, or with its exact state
  proved: `next proved`), or slips (with its proof replayed); medians of each grasp;
- `bundled`: largest pulls of the bundled grasps along the axes, one by one, proofs replayed;
- `dense`: six maxima of a grasp of 8 to 12 contacts, one by one, proofs not replayed;
- `torques`: the least commands for a random load, with their proof replayed, and for Table II's wrenches on its two
  grasps of six contacts; with `--published FOLDER` (`handfast import ... --mass 0.1 -o FOLDER`) for the weight of
  every tenth grasp of a published set;
- `label`: a whole label of a random grasp, and of every tenth published one, which comes without commands.

With --before, another checkout (as `git worktree add` makes it) answers the same questions turn by turn, in a process
of its own; that of 23 November (d95b5b8) through `first_version`. `times` is the median of the ratios of neighbouring
turns; `same` counts answers that are equal to the last bit, `contradictions` those of which one cannot be true. With
--peers, Algorithm 1 on Gurobi is asked the maxima of the first grasps of each size, as in `batches.py`: `algorithm1` is
its mean processor time over our mean of all `--count`, `algorithm1_wall` the same by the clock. With --profile the
parts that take most of a family's time are kept as its `profile`, the compiled search as one of them, and which
questions of a label they belong to, by Python's profiler, which makes Python's share larger than it is. Times are of
the processor, all threads.
Results are kept in results/users.json.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import pstats
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.batches import peer, timed
from benchmarks.grasps import Case, presses, random_case
from benchmarks.machine import describe, revision
from handfast import check_many, load_grasp, max_many, maximum, prepare, torques
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.datasets.labels.label_columns import WRENCHES, wrench_column
from handfast.datasets.labels.labeller import Labelling, center_of, force_at, label
from handfast.model.grasp import Grasp
from handfast.papers.stability_tables import task_questions
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.grasp_rows import GraspRows, shape_of
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import Settings
from handfast.stability.search.load_rows import BatchSearch, Template

RESULTS = Path(__file__).parent / "results" / "users.json"
HERE = Path(__file__).parents[1]
BUNDLED = Path(str(files("handfast") / "data" / "grasps"))
FIRST = 7_700_000  # seeds from here on
SHARE = 0.3  # of the largest load: what a prepared grasp holds; it slips under the largest over this
STEPS = 40  # of a changing load
FEW, DENSE = 20, 6  # grasps of families that take longer
EVERY = 10  # of so many published grasps one is asked
UNKNOWN_THEN = ("prepare rows", "next proved")  # families that `first_version` cannot be asked
PUBLISHED = "HANDFAST_PUBLISHED"  # environment variable: their folder
LATE = 5.0  # [s] of a maximum for which a grasp is not drawn: whether it is bounded stays open
QUICK = Settings(verify=False, jobs=1, timeout=20.0)


class Measured(NamedTuple):
    """What a family took: processor time [s] of each unit, and what was answered, `[verdict, lower, upper]` each."""

    seconds: list[float]
    answers: list[list[Any]]


class Family(NamedTuple):
    """Some questions; ask: with how many grasps. aim: [ms] in the mean, or times as fast as Algorithm 1 (`peers`)."""

    ask: Callable[[int], Measured]
    aim: float
    contacts: int | None = None

    @property
    def is_ratio(self) -> bool:
        """Is the aim a ratio?"""
        return self.contacts is not None


# --- the grasps ---------------------------------------------------------------------------------


def bounded(m: int, count: int, *, wrapped: bool = False) -> list[Case]:
    """The first cases whose preload presses and whose largest pull is bounded, made anew."""
    return [random_case(m, seed, wrapped=wrapped) for seed, _ in _drawn(m, count, wrapped)]


_KNOWN: dict[tuple[int, bool], list[tuple[int, float]]] = {}


def _drawn(m: int, count: int, wrapped: bool = False) -> list[tuple[int, float]]:
    """Seeds, and the largest magnitudes that are resisted."""
    known = _KNOWN.setdefault((m, wrapped), [])
    seed = known[-1][0] + 1 if known else FIRST
    while len(known) < count:
        case = random_case(m, seed, wrapped=wrapped)
        if presses(case.grasp):
            found = maximum(case.grasp, case.direction, settings=Settings(verify=False, jobs=1, timeout=LATE))
            if found.lower > 0 and np.isfinite(found.upper):
                known.append((seed, found.lower))
        seed += 1
    return known[:count]


# --- the families -------------------------------------------------------------------------------


def published() -> list[Grasp]:
    """Every tenth grasp of the folder that is given."""
    folder = Path(os.environ.get(PUBLISHED, ""))
    files = sorted(folder.glob("*.grasp.json"))[::EVERY]
    if PUBLISHED not in os.environ or not files:
        raise InputError("has no grasps; `handfast import` writes some", field="--published")
    return [load_grasp(str(file)) for file in files]


def said(found: Any) -> list[list[Any]]:
    """The rows of a batch."""
    upper = [x if np.isfinite(x) else None for x in np.ravel(found.upper).tolist()]
    return [[str(v), low, up] for v, low, up in zip(np.ravel(found.verdict), np.ravel(found.lower), upper, strict=True)]


def verdict_alone(verdict: Any) -> list[Any]:
    """Of an answer without bounds."""
    return [str(verdict), None, None]


def many(m: int) -> Callable[[int], Measured]:
    """`max_many` of fresh grasps of m contacts."""

    def ask(count: int) -> Measured:
        cases = bounded(m, count)
        grasps, W = [c.grasp for c in cases], np.array([c.direction for c in cases])[:, None]
        found, spent = timed(lambda: max_many(grasps, W, settings=QUICK, jobs=1))
        return Measured([spent / count], said(found))

    return ask


def first_loads(m: int, count: int) -> tuple[list[Grasp], Array]:
    """Fresh grasps, and loads (n, 1, 6) below the largest."""
    cases, known = bounded(m, count), _drawn(m, count)
    W = np.array([SHARE * s * c.direction for c, (_, s) in zip(cases, known, strict=True)])
    return [c.grasp for c in cases], W[:, None]


def prepared_together(m: int) -> Callable[[int], Measured]:
    """`check_many` of fresh grasps, one load each."""

    def ask(count: int) -> Measured:
        grasps, W = first_loads(m, count)
        found, spent = timed(lambda: check_many(grasps, W, settings=QUICK, jobs=1))
        return Measured([spent / count], [verdict_alone(v) for v in np.ravel(found.verdict)])

    return ask


def made_ready(m: int) -> Callable[[int], Measured]:
    """What `check_many` makes of fresh grasps before it asks a load: scales, null spaces, rows; a shape at a time."""

    def ask(count: int) -> Measured:
        shapes: dict[Hashable, list[Grasp]] = {}
        for case in bounded(m, count):
            shapes.setdefault(shape_of(case.grasp), []).append(case.grasp)
        many = [some for some in shapes.values() if len(some) > 1]  # a single one is prepared by itself

        def prepared() -> None:
            for some in many:
                BatchSearch(Template.of_grasps(GraspRows.of(some), ANY_STATE, GraspLimits()), QUICK)

        _, spent = timed(prepared)
        count = sum(map(len, many))
        return Measured([spent / count], [verdict_alone("prepared")] * count)

    return ask


def prepared_alone(m: int) -> Callable[[int], Measured]:
    """`prepare` of fresh grasps, and a load each."""

    def ask(count: int) -> Measured:
        out = Measured([], [])
        for grasp, w in zip(*first_loads(m, count), strict=True):
            found, spent = timed(partial(lambda grasp, w: prepare(grasp, settings=QUICK).check(w), grasp, w[0]))
            out.seconds.append(spent)
            out.answers.append(verdict_alone(found.verdict))
        return out

    return ask


def changing(start: Array, steps: int) -> Iterator[Array]:
    """(6,) loads that swell and turn slowly about one."""
    side = 0.05 * np.linalg.norm(start)
    for k in range(steps):
        turn = np.r_[np.cos(0.05 * k), np.sin(0.05 * k), 0, 0, 0, 0]
        yield start * (1 + 0.2 * np.sin(0.03 * k)) + side * turn


def next_loads(m: int, verdict: Verdict, grasps: int, *, proved: bool) -> Callable[[int], Measured]:
    """Prepared grasps under loads below the largest, or beyond; of each the median of the answers with a verdict."""
    share = SHARE if verdict is Verdict.HOLDS else 1 / SHARE

    def ask(count: int) -> Measured:
        chosen, out = min(count, grasps), Measured([], [])
        for case, (_, largest) in zip(bounded(m, chosen), _drawn(m, chosen), strict=True):
            prepared = prepare(case.grasp, settings=Settings(jobs=1) if proved else QUICK)
            loads = changing(share * largest * case.direction, STEPS)
            found = [timed(partial(prepared.check, w)) for w in loads]
            some = [spent for answer, spent in found[1:] if answer.verdict is verdict]
            out.seconds.extend([statistics.median(some)] if some else [])
            out.answers.extend(verdict_alone(a.verdict) for a, _ in found)
        return out

    return ask


def dense(m: int, wrapped: bool) -> Callable[[int], Measured]:
    """Six maxima along the axes of a dense grasp, in the middle of its contacts, one by one."""

    def ask(count: int) -> Measured:
        out = Measured([], [])
        for case in bounded(m, min(count, DENSE), wrapped=wrapped):
            middle = case.grasp.positions.mean(axis=0)
            pulls = [np.r_[u, np.cross(middle, u)] for u in np.vstack([np.eye(3), -np.eye(3)])]
            found = [timed(partial(maximum, case.grasp, w, settings=QUICK)) for w in pulls]
            out.seconds.append(sum(s for _, s in found))
            for answer, _ in found:
                out.answers.extend(said(answer))
        return out

    return ask


def bundled(count: int) -> Measured:
    """Maxima along the axes of the first bundled grasps, one by one, each with its proof replayed."""
    out = Measured([], [])
    for file in sorted(BUNDLED.glob("*.json"))[:count]:
        grasp = load_grasp(file)
        for w in np.eye(6)[:3]:
            found, spent = timed(partial(maximum, grasp, w, settings=Settings(jobs=1, timeout=20.0)))
            out.seconds.append(spent)
            out.answers.extend(said(found))
    return out


def least_commands(questions: Iterable[tuple[Grasp, Array]]) -> Measured:
    """`torques` of each, one by one; loads that no forces at the contacts balance are none."""
    out = Measured([], [])
    for grasp, wrench in questions:
        if not unbalanced(grasp, wrench):
            found, spent = timed(partial(torques, grasp, wrench, settings=Settings(jobs=1, timeout=20.0)))
            out.seconds.append(spent)
            out.answers.extend(said(found))
    return out


def random_torques(m: int) -> Callable[[int], Measured]:
    """Of fresh grasps under a share of their largest loads."""

    def ask(count: int) -> Measured:
        cases, known = bounded(m, min(count, FEW)), _drawn(m, min(count, FEW))
        return least_commands((c.grasp, SHARE * s * c.direction) for c, (_, s) in zip(cases, known, strict=True))

    return ask


def table2_torques(count: int) -> Measured:
    """Of Table II, on its grasps of six contacts."""
    some = [q for name in ("bottle", "torch") for q in task_questions(name) if q.task == "torques"]
    return least_commands((q.grasp, q.wrench) for q in some[:count])


def published_torques(count: int) -> Measured:
    """For the weight along -z of published grasps."""
    down = np.array([0.0, 0.0, -9.81])
    return least_commands((g, g.mass * force_at(down, center_of(g))) for g in published()[:count] if g.mass)


def labels_of(grasps: Iterable[Grasp]) -> Measured:
    """A whole label of each; what was answered are the verdict and the bounds of the smallest commands."""
    out = Measured([], [])
    for grasp in grasps:
        row, spent = timed(partial(label, grasp, Labelling()))
        out.seconds.append(spent)
        least = [row["verdict"], row["largest_command_lower"], row["largest_command"]]
        pulls = [[row["verdict"], row[wrench_column(w)], row[f"{wrench_column(w)}_upper"]] for w in WRENCHES]
        out.answers.extend([least, *pulls])
    return out


def random_labels(m: int) -> Callable[[int], Measured]:
    """Of fresh grasps that hold their weight: a share of the largest pull."""

    def ask(count: int) -> Measured:
        cases, known = bounded(m, min(count, FEW)), _drawn(m, min(count, FEW))
        return labels_of(c.grasp.about(mass=SHARE * s / 9.81) for c, (_, s) in zip(cases, known, strict=True))

    return ask


FAMILIES: dict[str, Family] = {
    "many, 3 contacts": Family(many(3), 2_000, 3),
    "many, 4 contacts": Family(many(4), 10_000, 4),
    "many, 5 contacts": Family(many(5), 20_000, 5),
    **{f"prepare rows, {m} contacts": Family(made_ready(m), 0.1) for m in (3, 5)},
    **{f"prepare batch, {m} contacts": Family(prepared_together(m), 0.1) for m in (3, 5)},
    **{f"prepare alone, {m} contacts": Family(prepared_alone(m), 0.1) for m in (3, 5)},
    **{
        f"next holds, {m} contacts": Family(next_loads(m, Verdict.HOLDS, FEW, proved=False), 0.25) for m in (3, 4, 5, 6)
    },
    **{f"next proved, {m} contacts": Family(next_loads(m, Verdict.HOLDS, FEW, proved=True), 2.5) for m in (3, 5)},
    **{f"next slips, {m} contacts": Family(next_loads(m, Verdict.SLIPS, DENSE, proved=True), 5.0) for m in (3, 4)},
    "bundled": Family(bundled, 100.0),
    "dense, 8 contacts": Family(dense(8, False), 60.0),
    "dense, 10 contacts": Family(dense(10, True), 60.0),
    "dense, 12 contacts": Family(dense(12, True), 60.0),
    **{f"torques, {m} contacts": Family(random_torques(m), 50.0) for m in (3, 4, 5, 6)},
    "torques, Table II, 6 contacts": Family(table2_torques, 50.0),
    "torques, published": Family(published_torques, 40.0),
    "label, 4 contacts": Family(random_labels(4), 20.0),
    "label, published": Family(lambda count: labels_of(published()[:count]), 100.0),
}


# --- runs, and what is kept of them -------------------------------------------------------------


def drawn_for(names: Iterable[str], count: int) -> list[list[Any]]:
    """What families of these names ask, drawn once for all versions: contacts, wrapped, and what `_drawn` gives."""
    out = []
    for m, wrapped in [*((m, False) for m in (3, 4, 5, 6, 8)), (10, True), (12, True)]:
        some = [name for name in names if f" {m} contacts" in name]
        if some:
            out.append([m, wrapped, _drawn(m, DENSE if m > 6 else min(count, FEW) if m == 6 else count, wrapped)])
    return out


def answer(count: int) -> None:
    """The process of one version: what was drawn, then a family per line in, what was measured out."""
    for m, wrapped, some in json.loads(sys.stdin.readline()):
        _KNOWN[m, wrapped] = [(seed, largest) for seed, largest in some]
    case = random_case(3, FIRST)
    maximum(case.grasp, case.direction, settings=QUICK)  # loads the machine code
    print("ready", flush=True)
    for line in sys.stdin:
        print(json.dumps(FAMILIES[line.strip()].ask(count)), flush=True)


def is_first(checkout: Path | None) -> bool:
    """Is it the version of 23 November?"""
    return checkout is not None and not (checkout / "src" / "handfast" / "papers").is_dir()


class Version:
    """A checkout and the process that answers with it; the questions are those of this one."""

    def __init__(self, checkout: Path, count: int, drawn: list[list[Any]]) -> None:
        env = os.environ | {"PYTHONPATH": os.pathsep.join([str(checkout / "src"), str(HERE)])}
        module = "first_version" if is_first(checkout) else "users"
        command = [sys.executable, "-m", f"benchmarks.{module}", "--answer", "--count", str(count)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=env, cwd=HERE)
        self.revision = revision(checkout)
        self._tell(json.dumps(drawn))
        self._line()

    def _line(self) -> str:
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the process of {self.revision} ended; what it says is above")
        return line

    def _tell(self, line: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def ask(self, family: str) -> Measured:
        self._tell(family)
        return Measured(*json.loads(self._line()))


def contradictions(before: list[list[Any]], after: list[list[Any]]) -> int:
    """Of so many questions HOLDS stands against SLIPS, or a magnitude that is resisted above a bound."""
    out = 0
    for a, b in zip(before, after, strict=True):
        far = any(x[1] is not None and y[2] is not None and x[1] > y[2] * (1 + 1e-9) for x, y in ((a, b), (b, a)))
        out += {a[0], b[0]} == {"holds", "slips"} or far
    return out


def figures(measured: Measured, aim: float) -> dict[str, Any]:
    """Milliseconds, beside the aim if that is one."""
    ms = [1e3 * s for s in measured.seconds]
    out = {"questions": len(measured.answers), "mean_ms": statistics.fmean(ms), "median_ms": statistics.median(ms)}
    return out | {"worst_ms": max(ms), "aim": aim}


def measured(name: str, versions: list[Version], rounds: int) -> dict[str, Any]:
    """A family by each version, turn by turn; figures are those of the last, whose turn with the median mean counts."""
    turns: list[list[Measured]] = []
    for turn in range(rounds):
        order = range(len(versions)) if turn % 2 else range(len(versions) - 1, -1, -1)
        some = {k: versions[k].ask(name) for k in order}
        turns.append([some[k] for k in range(len(versions))])
    after = sorted((t[-1] for t in turns), key=lambda m: statistics.fmean(m.seconds))[rounds // 2]
    out = {"family": name, **figures(after, FAMILIES[name].aim)}
    if len(versions) > 1:
        before = sorted((t[0] for t in turns), key=lambda m: statistics.fmean(m.seconds))[rounds // 2]
        out["before"] = figures(before, FAMILIES[name].aim)
        out["times"] = statistics.median(sum(t[0].seconds) / sum(t[1].seconds) for t in turns)
        out["same"] = sum(a == b for a, b in zip(before.answers, after.answers, strict=True))
        out["contradictions"] = contradictions(before.answers, after.answers)
    return out


def against_peers(name: str, count: int, batch: int, limit: float) -> dict[str, Any]:
    """The first grasps of a family by Algorithm 1 on Gurobi, and our mean of a batch: processor and wall time [s]."""
    m = FAMILIES[name].contacts
    assert m is not None
    cases = bounded(m, count)
    batch = max(count, batch)
    many(m)(batch)  # what is drawn is no part of it
    start = time.perf_counter()
    ours = statistics.fmean(many(m)(batch).seconds)
    wall = (time.perf_counter() - start) / batch  # with the making of the grasps
    theirs = [peer(case, limit) for case in cases]
    return {"grasps": count, "batch": batch, "ours": ours, "ours_wall": wall, "peers": theirs}


COMPILED = {("search.py", "_run"), ("load_rows.py", "run"), ("row_kernel.py", "run"), ("search.py", "exact_solution")}


QUESTIONS = ("largest", "held", "commands", "resisted_by_none", "one_preload", "measured")  # of a label


def profiled(name: str, count: int) -> dict[str, Any]:
    """The shares of the time of a family by where it is spent, the largest first; of labels by question as well."""
    FAMILIES[name].ask(count)  # what is drawn, and loaded, is no part of it
    profile = cProfile.Profile()
    profile.runcall(FAMILIES[name].ask, count)
    spent: dict[str, float] = {}
    asked: dict[str, float] = {}
    for (file, _, function), (*_, own, below, _) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        path = Path(file)
        where = (
            "/".join(path.parts[path.parts.index("handfast") + 1 :][:-1])
            if "handfast" in path.parts
            else "numpy, Python"
        )
        if where == "datasets/labels" and function in QUESTIONS:
            asked[function] = below
        where = "compiled" if (path.name, function) in COMPILED else where
        spent[where] = spent.get(where, 0.0) + own
    total = sum(spent.values())
    some, of = ({k: x / total for k, x in sorted(d.items(), key=lambda item: -item[1])[:6]} for d in (spent, asked))
    return {"seconds": total, "grasps": count, "where": some} | ({"questions": of} if of else {})


def behind(row: dict[str, Any]) -> float:
    """How far a family is from its aim: 1 has it, 2 takes twice as long; families without a figure last."""
    family = FAMILIES[row["family"]]
    if not family.is_ratio:
        return float(row["mean_ms"] / family.aim)
    return float(family.aim / row["algorithm1"]) if "algorithm1" in row else 0.0


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown, the family that is farthest from its aim first."""
    lines = [
        "| family | questions | mean [ms] | median | worst | aim | of the aim | before, mean [ms] | times as fast |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in sorted(rows, key=behind, reverse=True):
        family = FAMILIES[row["family"]]
        before, times = ("", "")
        if "before" in row:
            before, times = f"{row['before']['mean_ms']:.2f}", f"{row['times']:.2f}"
        aim = f"{family.aim:,.0f} times" if family.is_ratio else f"{family.aim:g} ms"
        share = "" if family.is_ratio else f"{behind(row):.1f}"
        if "algorithm1" in row:
            share = f"{row['algorithm1']:,.0f} times"
        lines.append(
            f"| {row['family']} | {row['questions']} | {row['mean_ms']:.2f} | {row['median_ms']:.2f} "
            f"| {row['worst_ms']:.2f} | {aim} | {share} | {before} | {times} |"
        )
    return "\n".join(lines)


def kept() -> dict[str, Any]:
    """The results there are."""
    return json.loads(RESULTS.read_text()) if RESULTS.exists() else {"families": {}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD", help="families whose names begin so")
    parser.add_argument("--count", type=int, default=200, help="grasps of a family, at most")
    parser.add_argument("--before", type=Path, metavar="CHECKOUT", help="another version")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--published", type=Path, metavar="FOLDER", help="grasps of a published set, imported")
    parser.add_argument("--peers", type=int, default=0, metavar="N", help="ask Algorithm 1 on Gurobi N of each size")
    parser.add_argument("--peer-limit", type=float, default=150.0, metavar="S")
    parser.add_argument("--profile", action="store_true", help="print where the time goes")
    parser.add_argument("--answer", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.answer:
        answer(options.count)
        return
    if options.published:
        os.environ[PUBLISHED] = str(options.published.resolve())
    asked = [name for name in FAMILIES if name.startswith(tuple(options.only))]
    names = [name for name in asked if "published" not in name or PUBLISHED in os.environ]
    names = [name for name in names if not (is_first(options.before) and name.startswith(UNKNOWN_THEN))]
    if options.profile:
        data = kept()
        for name in names:
            row = data["families"].setdefault(name, {"family": name})
            row["profile"] = profiled(name, options.count)
            print(name, json.dumps(row["profile"]), flush=True)
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        return
    data = kept() | {"machine": describe()}
    versions: list[Version] = []
    if not options.peers:
        checkouts = [*([options.before] if options.before else []), HERE]
        drawn = drawn_for(names, options.count)
        versions = [Version(path.resolve(), options.count, drawn) for path in checkouts]
        data["revisions"] = [v.revision for v in versions]
    for name in names:
        row = data["families"].get(name, {"family": name})
        if versions:
            peers = {k: row[k] for k in ("algorithm1", "algorithm1_wall", "peers", "profile") if k in row}
            row = measured(name, versions, options.rounds) | peers
        elif FAMILIES[name].is_ratio:
            row["peers"] = against_peers(name, options.peers, options.count, options.peer_limit)
            for key, kind, ours in (("algorithm1", "seconds", "ours"), ("algorithm1_wall", "wall", "ours_wall")):
                spent = [p[kind] for p in row["peers"]["peers"] if p["seconds"] is not None]
                row[key] = statistics.fmean(spent) / row["peers"][ours]
        data["families"][name] = row
        print(json.dumps({k: v for k, v in row.items() if k not in ("peers", "profile")}), flush=True)
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    print(table([row for row in data["families"].values() if "mean_ms" in row]))
    for version in versions:
        version.process.communicate()


if __name__ == "__main__":
    main()
