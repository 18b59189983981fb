"""Tables I and II of the stability paper: what Algorithm 1 costs, on the grasps as they are rebuilt here."""

from __future__ import annotations

import hashlib
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.answer import uninterrupted
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import algorithm1
from handfast.papers.algorithm1 import Refined, RefinementSettings, refine
from handfast.papers.exhibits import MakingOptions, TextTable
from handfast.papers.mixed_integer import Solver, SolverStatus
from handfast.papers.mixed_integer_solvers import installed
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp, to_dict
from handfast.readers.load_body import load_body
from handfast.stability.answers.answer import Answer
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.objective import SMALLEST_PRELOAD
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum, torques

# --- Table I ------------------------------------------------------------------------------------------------------

DOWN = np.array([0, -1.0, 0, 0, 0, 0])  # the largest force along -y that Fig. 9 resists
ETAS = (0.0, 2.5)  # [degrees] uncertainty of the normals
SECTOR_LEVELS = range(10)  # 4 * 2^q sectors
QUICK_LEVELS = 6  # up to 128 sectors

# as printed, by the number of sectors: largest force [N] without and with uncertain normals
PRINTED_1 = {
    4: (">100", ">100"),
    8: ("7.07435", "7.07435"),
    16: ("6.34905", "3.73377"),
    32: ("3.71036", "3.70539"),
    64: ("3.70095", "2.31479"),
    128: ("3.69775", "1.21805"),
    256: ("3.69751", "1.21756"),
    512: ("3.69681", "1.21743"),
    1024: ("3.07268", "1.21740"),
    2048: ("3.07267", "1.21739"),
}


def resolution_cell(solver: Solver, q: int, full: bool, eta: float, timeout: float) -> dict[str, Any]:
    """One cell of Table I: Algorithm 1 at 4 * 2^q sectors, to the end, (19) as printed.

    full: all sectors at once. eta [degrees]. Value, seconds, programs, nodes, and how it ended.
    """
    p = scaled_problem.build(load_grasp("fig9"), np.zeros(6), DOWN, limits=GraspLimits(np.radians(eta)))
    settings = RefinementSettings(solver, 4 * 2**q, full=full, as_printed=True, timeout=timeout)
    cell = {"solver": solver, "sectors": 4 * 2**q, "method": "full" if full else "refined", "eta": eta}
    try:
        steps = list(refine(p, SMALLEST_PRELOAD, settings))
    except InputError:
        return cell | {"status": "licence too small"}
    last = steps[-1]
    bound = max(s.bound for s in steps)
    return cell | {
        "status": "finished" if last.finished else str(last.result.status),
        "value": 1.0 / last.point.scalar if last.finished and last.point is not None else None,
        "upper": 1.0 / bound if bound > 0 else None,
        "seconds": sum(s.seconds for s in steps),
        "programs": len(steps),
        "nodes": sum(s.result.nodes for s in steps),
        "edges": last.edges,
    }


def table1(options: MakingOptions) -> TextTable:
    """The largest force by the number of sectors, refined and all at once; `count` rows."""
    solver = options.solver or installed()
    rows, gave_up = [], set[float]()
    for q in SECTOR_LEVELS[: options.count or QUICK_LEVELS]:
        cells = [str(4 * 2**q)]
        for k, eta in enumerate(ETAS):
            refined = _whole_cell(resolution_cell(solver, q, False, eta, options.timeout))
            took = "–"
            if eta not in gave_up:  # as the paper does: twice the sectors are no faster
                full = _whole_cell(resolution_cell(solver, q, True, eta, options.timeout))
                took = _seconds(full)
                gave_up |= set() if full["status"] == "finished" else {eta}
            value = refined.get("value")
            cells += [PRINTED_1[4 * 2**q][k], f"{value:.5f}" if value else "–", took, _seconds(refined)]
        rows.append(tuple(cells))
    heads = ["sectors"]
    for eta in ETAS:
        heads += [f"paper [N], η {eta:g}°", "here [N]", "full [s]", "refined [s]"]
    settings = Settings(timeout=options.timeout)
    limits = [GraspLimits(np.radians(eta)) for eta in ETAS]
    exact = [uninterrupted(maximum(load_grasp("fig9"), DOWN, limits=each, settings=settings)) for each in limits]
    brackets = "; ".join(f"η {eta:g}°: {a.lower:.5f} to {a.upper:.5f} N" for eta, a in zip(ETAS, exact, strict=True))
    note = f"Fig. 9 is rebuilt, so values differ from the paper's. Algorithm 1 on {solver}. Exact: {brackets}."
    return TextTable(tuple(heads), tuple(rows), (note,))


def _whole_cell(cell: dict[str, Any]) -> dict[str, Any]:
    """As `uninterrupted`: `KeyboardInterrupt` if Ctrl-C ended it."""
    if cell["status"] == SolverStatus.INTERRUPTED:
        raise KeyboardInterrupt
    return cell


def _seconds(cell: dict[str, Any]) -> str:
    return f"{cell['seconds']:.2f}" if cell["status"] == "finished" else str(cell["status"])


# --- Table II -----------------------------------------------------------------------------------------------------

TABLE_SEED = 2020
TABLE_DIRECTIONS = 10  # directions, and wrenches, as in the paper
TABLE_SECTORS = 2048
TABLE_GAP = 1e-3
ENGINE: dict[str, Callable[..., Answer]] = {"check": check, "max": maximum, "torques": torques}
PAPER_ALGORITHMS: dict[str, Callable[..., Refined[Any]]] = {
    "check": algorithm1.check,
    "max": algorithm1.maximum,
    "torques": algorithm1.torques,
}


@dataclass(frozen=True)
class PrintedTimes:
    """A row of Table II: letter in Fig. 13, contacts, and its times [s] as printed.

    Attributes:
        check: a time.
        max, torques: mean ± standard error, and median.
    """

    letter: str
    contacts: int
    check: tuple[str]
    max: tuple[str, str]
    torques: tuple[str, str]


PRINTED_2 = (
    PrintedTimes("a", 3, ("0.246",), ("0.797 ± 0.067", "0.754"), ("0.389 ± 0.063", "0.343")),
    PrintedTimes("b", 3, ("0.234",), ("0.785 ± 0.085", "0.745"), ("0.447 ± 0.074", "0.408")),
    PrintedTimes("c", 3, ("0.294",), ("0.893 ± 0.056", "0.907"), ("0.347 ± 0.017", "0.345")),
    PrintedTimes("d", 3, ("0.259",), ("0.664 ± 0.081", "0.560"), ("0.308 ± 0.036", "0.281")),
    PrintedTimes("e", 4, ("1.07",), ("10.0 ± 3.4", "6.39"), ("3.26 ± 0.50", "3.83")),
    PrintedTimes("f", 4, ("15.7",), ("36.7 ± 6.5", "39.5"), ("13.5 ± 4.8", "9.58")),
    PrintedTimes("g", 4, ("2.78",), ("33.8 ± 9.3", "20.8"), ("16.8 ± 5.3", "12.3")),
    PrintedTimes("h", 4, ("8.02",), ("23.7 ± 4.2", "23.2"), ("12.3 ± 3.3", "8.10")),
    PrintedTimes("i", 4, ("1.66",), ("14.4 ± 2.7", "11.4"), ("1.67 ± 0.12", "1.60")),
    PrintedTimes("j", 5, ("6.06",), ("150 ± 24", "105"), ("22.8 ± 5.8", "19.0")),
    PrintedTimes("k", 6, ("51.0",), ("398 ± 104", "344"), ("136 ± 54", "80.6")),
    PrintedTimes("l", 6, ("27.5",), ("488 ± 99", "330"), ("777 ± 288", "626")),
)
# our grasp with as many contacts for each of those
TWELVE_OBJECTS = (
    "ball",
    "can",
    "mug",
    "pear",
    "block",
    "egg",
    "dumbbell",
    "wedge",
    "mallet",
    "ring",
    "bottle",
    "torch",
)


@dataclass(frozen=True, eq=False)
class TaskQuestion:
    """One question of Table II.

    Attributes:
        name: of the object in the hand.
        task: "check", "max" or "torques".
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

    def ask(self, settings: Settings) -> Answer:
        """What the engine answers."""
        return ENGINE[self.task](self.grasp, self.wrench, settings=settings)

    def refined(self, solver: Solver, timeout: float, gap: float = TABLE_GAP) -> Refined[Any]:
        """What Algorithm 1 answers, refined to the finest sectors as the paper has it."""
        settings = RefinementSettings(solver, TABLE_SECTORS, as_printed=True, gap=gap, timeout=timeout)
        return PAPER_ALGORITHMS[self.task](self.grasp, self.wrench, settings=settings)


def drawn() -> tuple[Array, Array]:
    """(n, 6) each: unit directions for the disturbances and for the wrenches, the same for all grasps."""
    x = np.random.default_rng(TABLE_SEED).normal(size=(2, TABLE_DIRECTIONS, 6))
    x /= np.linalg.norm(x, axis=2, keepdims=True)
    return x[0], x[1]


def task_questions(name: str) -> list[TaskQuestion]:
    """All questions about one of the twelve, as its files are now: the check, then direction and wrench 1, 2, ...

    The check is the object's weight along its -z. A direction is uniform on the unit sphere of forces and
    torques / size, about the centre of mass; a wrench is such a direction times the weight.
    """
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
    return [TaskQuestion(name, grasp, task, k, wrench, fingerprint) for task, k, wrench in asked]


def table2(options: MakingOptions) -> TextTable:
    """Median times of the three queries on twelve grasps, `count` directions and wrenches each.

    With a solver, Algorithm 1 is timed beside the engine.
    """
    count, settings = options.count or 3, Settings(timeout=options.timeout)
    task_questions(TWELVE_OBJECTS[0])[0].ask(settings)  # loads machine code
    rows = []
    for name, printed in zip(TWELVE_OBJECTS, PRINTED_2, strict=True):
        questions = [q for q in task_questions(name) if q.k <= count]
        cells = [f"{name} ({printed.letter})", str(printed.contacts)]
        for task in ENGINE:
            mine = [q for q in questions if q.task == task]
            cells += [getattr(printed, task)[-1], _median(mine, lambda q: q.ask(settings), 1e3)]
            if solver := options.solver:
                cells.append(_median(mine, lambda q, by=solver: q.refined(by, options.timeout).answer, 1))  # type: ignore[misc]
        rows.append(tuple(cells))
    heads = ["grasp", "contacts"]
    for task in ENGINE:
        heads += [f"{task}: paper [s]", "engine [ms]", *(["Algorithm 1 [s]"] if options.solver else [])]
    note = "The paper's grasps are not published: ours have as many contacts. Medians; --solver adds Algorithm 1."
    return TextTable(tuple(heads), tuple(rows), (note,))


def _median(questions: list[TaskQuestion], ask: Callable[[TaskQuestion], Answer], factor: float) -> str:
    """The median time, in units of 1 / factor seconds; a question that a licence refuses has none."""
    took = []
    for question in questions:
        clock = time.perf_counter()
        try:
            uninterrupted(ask(question))
        except InputError:
            return "refused"
        took.append(time.perf_counter() - clock)
    return f"{factor * statistics.median(took):.3g}"
