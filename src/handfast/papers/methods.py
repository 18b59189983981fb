"""The papers' own methods, as `handfast paper METHOD` runs them on a grasp or a task."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core import parallel
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import algorithm1
from handfast.papers.algorithm1 import RefinementSettings, RefinementStep
from handfast.papers.baselines import BaselineState, pyramid_step, turn_scheme
from handfast.papers.box_shrinking import Over, PaperSolver, ShrinkingSettings
from handfast.papers.canonical_equations import canonical
from handfast.papers.exhibits import TextTable
from handfast.papers.mixed_integer import Solver
from handfast.papers.planar_oracle import PlanarGrasp, planar_check, planar_ranges
from handfast.pictures import sentences, words
from handfast.readers.grasp_file import load_grasp
from handfast.stability.answers.answer import Answer, finite
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.synthesis.task_file import load_task

Numbers = tuple[float, ...]
MILLIMETRE = 0.001  # [m] the unit of the paper's Table 3


@dataclass(frozen=True)
class MethodOptions:
    """What a method is asked, and how it runs.

    Attributes:
        direction, wrench, base: (6,) [N, N m], or ()
        least: seek the smallest commands for the wrench.
        plane: "xy", "xz" or "yz": the largest force in `steps` directions of it.
        limits: of forces and normals, of Algorithm 1 alone.
        settings: of Algorithm 1; its solver and timeout are the earlier scheme's, too.
        edges: of a friction pyramid.
        unit: [m] of the canonical system.
        over: which variables box shrinking shrinks.
    """

    direction: Numbers = ()
    wrench: Numbers = ()
    base: Numbers = ()
    least: bool = False
    plane: str | None = None
    steps: int = 36
    limits: GraspLimits = NO_LIMITS
    settings: RefinementSettings = field(default_factory=RefinementSettings)
    edges: int = 8
    unit: float = MILLIMETRE
    over: Over = Over.ALL

    @property
    def solver(self) -> Solver:
        return self.settings.solver

    def one_load(self, method: str) -> Numbers:
        """The wrench; `InputError` without one."""
        if not self.wrench:
            raise InputError(f"is missing; {method} judges a load", field="--wrench")
        return self.wrench


@dataclass(frozen=True)
class MethodAnswer:
    """What a method says.

    Attributes:
        sentence: in a line.
        undecided: it ended without an answer.
        lines: more of it.
        table: numbers, or None.
        numbers: the same for programs.
    """

    sentence: str
    undecided: bool = False
    lines: tuple[str, ...] = ()
    table: TextTable | None = None
    numbers: dict[str, Any] = field(default_factory=dict)


# --- Algorithm 1 --------------------------------------------------------------------------------------------------


def refined(grasp: Grasp, asked: MethodOptions) -> MethodAnswer:
    """Algorithm 1: the largest disturbance in a direction or in a plane of them, a load, the smallest commands."""
    if asked.plane:
        return _plane(grasp, asked)
    if bool(asked.direction) == bool(asked.wrench):
        raise InputError("give either --direction, how much is resisted, or --wrench, is it resisted")
    options: dict[str, Any] = {"settings": asked.settings, "limits": asked.limits}
    answer: Answer
    if asked.direction:
        largest, steps = algorithm1.maximum(grasp, asked.direction, base=asked.base or None, **options)
        sentence, answer = sentences.max_sentence(largest, asked.direction), largest
    elif asked.least:
        least, steps = algorithm1.torques(grasp, asked.wrench, **options)
        sentence, answer = sentences.torques_sentence(least, words.load_text(asked.wrench), "max"), least
    else:
        answer, steps = algorithm1.check(grasp, asked.wrench, **options)
        sentence = sentences.check_sentence(answer, words.load_text(asked.wrench))
    lines = [f"Algorithm 1 on {asked.solver}: {words.count(len(steps), 'program')}, {answer.seconds:.2f} s."]
    if why := _open_end(answer, steps, asked.settings):
        lines.append(why)
    if answer.witness:
        worst = answer.witness.residuals.worst
        lines.append(f"The state is checked against equations (1) to (8): residual {worst:.1e}.")
    heads = ("step", "friction edges", "widest active sector [°]", "nodes", "seconds", "program")
    rows = [
        (
            str(s.number),
            str(s.edges),
            f"{np.degrees(s.width):.3g}",
            str(s.result.nodes),
            f"{s.seconds:.2f}",
            str(s.result.status),
        )
        for s in steps
    ]
    numbers = answer.to_json() | {"steps": [dict(zip(heads, row, strict=True)) for row in rows]}
    undecided = answer.verdict is Verdict.UNDECIDED or answer.stop in (Stop.TIME, Stop.INTERRUPTED)
    head = f"{answer.verdict.upper()}  {sentence}"
    return MethodAnswer(head, undecided, tuple(lines), TextTable(heads, tuple(rows)), numbers)


def _open_end(answer: Answer, steps: tuple[RefinementStep, ...], settings: RefinementSettings) -> str:
    """Why an answer is not complete, and what helps; '' if it is."""
    match answer.stop:
        case Stop.COMPLETE:
            return ""
        case Stop.TIME:
            return f"The time of {settings.timeout:g} s was up; a larger --timeout may decide it."
        case Stop.INTERRUPTED:
            return "It was interrupted; these are the bounds so far."
        case _ if answer.verdict is Verdict.HOLDS:
            apart = f"{100 * settings.gap:g} % with {settings.sectors} sectors"
            return f"The bounds have not met to {apart}; more --sectors may bring them closer."
        case _ if steps and steps[-1].finished:
            return (
                f"The relaxed model has a solution at the finest of {settings.sectors} sectors, but no exact one was "
                "found near it; more --sectors may decide it."
            )
        case _:
            return "The search ended without an answer: the solver's numbers did not suffice."


def _plane(grasp: Grasp, asked: MethodOptions) -> MethodAnswer:
    """The largest force in every direction of a plane, each in a process of its own: solvers are not for threads."""
    if asked.steps < 1:
        raise InputError(f"is {asked.steps}; 1 or more is needed", field="--steps")
    i, j = ("xyz".index(axis) for axis in asked.plane or "xy")
    angles = 2 * np.pi * np.arange(asked.steps) / asked.steps
    directions = np.zeros((asked.steps, 6))
    directions[:, i], directions[:, j] = np.cos(angles), np.sin(angles)
    forked = parallel.START == "fork"
    jobs = min(parallel.default_jobs(), asked.steps) if forked else 1
    with parallel.WorkerPool((grasp, asked), jobs, threads=not forked) as pool:
        found = list(pool.map(_direction, list(directions)))
    rows, numbers = [], []
    for angle, (lower, upper, stop) in zip(np.degrees(angles), found, strict=True):
        rows.append((f"{angle:g}", f"{lower:.5g}", f"{upper:.5g}", stop))
        numbers.append({"angle": angle, "lower": lower, "upper": finite(upper), "stop": stop})
    table = TextTable((f"angle in {asked.plane} [°]", "resisted [N]", "at most [N]", "stop"), tuple(rows))
    sentence = f"Largest forces in the {asked.plane} plane, by Algorithm 1 on {asked.solver}."
    return MethodAnswer(sentence, table=table, numbers={"directions": numbers})


def _direction(shared: tuple[Grasp, MethodOptions], direction: Any) -> tuple[float, float, str]:
    grasp, asked = shared
    options: dict[str, Any] = {"settings": asked.settings, "limits": asked.limits}
    answer, _ = algorithm1.maximum(grasp, direction, base=asked.base or None, **options)
    return answer.lower, np.inf if answer.unbounded else answer.upper, str(answer.stop)


# --- older methods ------------------------------------------------------------------------------------------------


def pyramids(grasp: Grasp, asked: MethodOptions) -> MethodAnswer:
    """Friction pyramids: one time step from rest, a linear complementarity problem."""
    return _baseline(pyramid_step(grasp, asked.one_load("pyramids"), edges=asked.edges))


def earlier_scheme(grasp: Grasp, asked: MethodOptions) -> MethodAnswer:
    """The authors' earlier scheme in turns."""
    limits: dict[str, Any] = {"solver": asked.solver, "timeout": asked.settings.timeout}
    return _baseline(turn_scheme(grasp, asked.one_load("earlier-scheme"), edges=asked.edges, **limits))


def _baseline(found: BaselineState) -> MethodAnswer:
    lines = [f"{words.count(found.turns, 'program')}; {found.unbalanced:.2e} of the forces stays unbalanced."]
    numbers: dict[str, Any] = {"verdict": str(found.verdict), "unbalanced": finite(found.unbalanced)}
    if found.residuals is not None:
        lines.append(f"Its state misses the equations (1) to (8) by {found.residuals.worst:.1e}.")
        numbers["residual"] = found.residuals.worst
    slides = found.friction_errors[np.isfinite(found.friction_errors)]
    if len(slides):
        worst = float(np.degrees(slides.max()))
        lines.append(f"Friction is off the direction against the slip by up to {worst:.3g}°.")
        numbers["friction_error"] = worst
    sentence = f"{found.verdict.upper()}  by this method; nothing of it is proved."
    return MethodAnswer(sentence, found.verdict is Verdict.UNDECIDED, tuple(lines), None, numbers)


def planar(grasp: Grasp, asked: MethodOptions) -> MethodAnswer:
    """A grasp in the plane z = 0 with immobile fingers, decided exactly in rational numbers."""
    flat = PlanarGrasp.of(grasp)
    load = np.array(asked.direction or asked.one_load("planar"))[[0, 1, 5]]
    if asked.direction:
        found = planar_ranges(flat, load, np.array(asked.base or np.zeros(6))[[0, 1, 5]])
        ranges = [f"{lo:.9g} to {'any' if hi is None else f'{hi:.9g}'}" for lo, hi in found.shown]
        sentence = f"Resisted magnitudes: {', '.join(ranges) or 'none'}."
        lines = (f"{words.count(found.programs, 'linear program')}, exact.",)
        return MethodAnswer(sentence, lines=lines, numbers={"ranges": found.shown})
    state = planar_check(flat, load)
    verdict = Verdict.SLIPS if state is None else Verdict.HOLDS
    sentence = f"{verdict.upper()}  {words.load_text(asked.wrench)}, decided exactly."
    return MethodAnswer(sentence, numbers={"verdict": str(verdict)})


# --- the canonical system -----------------------------------------------------------------------------------------


def canonical_system(name: str, asked: MethodOptions) -> MethodAnswer:
    """The system (26) of a task and its expansion (29)."""
    system = canonical(load_task(name), unit=asked.unit)
    numbers = {"n_v": system.n_v, "n_e": system.n_e, "d": system.d, "n_x": system.expanded.n}
    first, *lines = system.describe().splitlines()
    return MethodAnswer(first, lines=tuple(lines), numbers=numbers)


def box_shrinking(name: str, asked: MethodOptions) -> MethodAnswer:
    """Box shrinking and bisection, depth first, until a solution box is found or the time is up."""
    settings, end = ShrinkingSettings(over=asked.over), time.monotonic() + asked.settings.timeout
    solver = PaperSolver(canonical(load_task(name), unit=asked.unit), settings, end=end)
    search = solver.search()
    for state in search:
        if state.finals or solver.late:
            break
    state, s = search.state, solver.statistics
    open_ = bool(state.pending) and not state.finals
    found = f"Solution boxes of side {solver.settings.sigma:g}: {len(state.finals)}"
    sentence = f"{found}. Boxes that wait: {state.pending}, the deepest at {state.depth}."
    lines = (
        f"{s.boxes} boxes, {s.passes} passes, {s.programs} linear programs in {s.seconds:.1f} s, "
        f"{100 * s.program_share:.0f} % of it in programs.",
        f"{100 * state.discarded:.3g} % of the root is discarded.",
    )
    numbers = {
        "solution_boxes": len(state.finals), "pending": state.pending, "depth": state.depth, "boxes": s.boxes,
        "passes": s.passes, "programs": s.programs, "seconds": s.seconds, "discarded": state.discarded,
    }  # fmt: skip
    return MethodAnswer(sentence, open_, lines, None, numbers)


# --- the list -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Method:
    """A method: what it is, what it is asked about ("GRASP" or "TASK"), where it is described."""

    title: str
    about: str
    ask: Callable[[Any, MethodOptions], MethodAnswer]

    def run(self, source: str, options: MethodOptions) -> MethodAnswer:
        """The answer for a file, or the name of a bundled grasp or task."""
        return self.ask(load_grasp(source) if self.about == "GRASP" else source, options)


METHODS = {
    "algorithm1": Method("successive refinement of friction sectors, section V", "GRASP", refined),
    "earlier-scheme": Method("the authors' earlier scheme in turns, reference 18", "GRASP", earlier_scheme),
    "planar": Method("planar grasps decided exactly, reference 19", "GRASP", planar),
    "pyramids": Method("friction pyramids and Lemke's method, references 45, 51", "GRASP", pyramids),
    "canonical": Method("the canonical system (26) and its expansion (29)", "TASK", canonical_system),
    "box-shrinking": Method("linear programs over polytopes, bisection, 4.2 and 4.3", "TASK", box_shrinking),
}
