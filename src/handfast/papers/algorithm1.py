"""Algorithm 1 of the stability paper: solve a relaxation, refine the active sectors, repeat (section V).

`refine` is the loop, `check`, `maximum` and `torques` ask the paper's three queries (section VII-A to C) with it. Every
relaxation's result is tried as the start of an exact state, so HOLDS and the witnessed bounds are proved here, too;
SLIPS and the other bounds rest on the mixed-integer solver's word, and there are no certificates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import mixed_integer_solvers
from handfast.papers.friction_relaxation import Discretisation, Sector, polygon, relaxation
from handfast.papers.mixed_integer import SOLVERS, Solver, SolverResult, SolverStatus
from handfast.proofs.constants import END_TOLERANCE
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.max_query import max_goal, shown_maximum
from handfast.stability.answers.torques_query import posed_torques, shown_torques, with_hardly_any
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.objective import ANY_STATE, INF, Effort, Objective
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem
from handfast.stability.problem.settings import MIN_SEARCH_TIME
from handfast.stability.problem.witness import Witness
from handfast.stability.search.proof import Outcome
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.search.search import exact_solution

MODE_TOLERANCES = (1e-6, 1e-4, 1e-2)  # (scaled) below which a motion or force is tried as zero
FIRST_FORCE_BOUND = 10.0  # (scaled) normal forces tried first when nothing else bounds them
STATUS_STOPS = {
    SolverStatus.OPTIMAL: Stop.COMPLETE,
    SolverStatus.INFEASIBLE: Stop.COMPLETE,
    SolverStatus.UNBOUNDED: Stop.COMPLETE,
    SolverStatus.TIME: Stop.TIME,
    SolverStatus.INTERRUPTED: Stop.INTERRUPTED,
    SolverStatus.FAILED: Stop.NUMERICAL,
}


@dataclass(frozen=True)
class RefinementSettings:
    """How Algorithm 1 runs.

    Attributes:
        solver: "scip" or "gurobi".
        sectors: the finest friction discretisation: 4, 8, .. 2048 .. (4 * 2^q).
        full: all sectors at the finest level at once, no refinement (the paper's comparison).
        as_printed: refine to the finest level even when an exact solution already answers, and take (19) as printed.
        gap: relative distance between witnessed and proved bound at which a number is precise enough.
        timeout: [s] for one question.

    Raises:
        InputError: a number of sectors that is not 4 * 2^q, an unknown solver, or limits that are not positive.
    """

    solver: Solver = "scip"
    sectors: int = 2048
    full: bool = False
    as_printed: bool = False
    gap: float = 1e-3
    timeout: float = INF

    def __post_init__(self) -> None:
        q = np.log2(self.sectors / 4) if self.sectors >= 4 else -1.0
        if q < 0 or q != int(q) or q > 20:
            raise InputError(f"is {self.sectors}; 4, 8, 16, ... (4 times a power of two) is needed", field="sectors")
        if not self.gap > 0:
            raise InputError(f"is {self.gap:g}; a positive number is needed", field="gap")
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a positive number is needed", field="timeout")
        if self.solver not in SOLVERS:
            raise InputError(f"is '{self.solver}'; one of {', '.join(SOLVERS)} is needed", field="solver")

    @property
    def q(self) -> int:
        """Refinements from four sectors to the finest level."""
        return round(np.log2(self.sectors / 4))

    def after(self, seconds: float) -> RefinementSettings:
        """For what follows a search of so many seconds: the rest of its time."""
        return replace(self, timeout=max(self.timeout - seconds, MIN_SEARCH_TIME))


@dataclass(frozen=True, eq=False)
class RefinementStep:
    """One pass of Algorithm 1.

    Attributes:
        number: counts from 1.
        result: the solver's answer, checked against its program.
        point: the relaxation's solution in the model's (scaled) unknowns, None without one. Its scalar is lambda, s
            or the objective, whatever the goal.
        bound: what the solver proved about the objective of this relaxation, hence of the exact problem.
        width: [rad] the widest active sector, 0 if none is active; `finished` once all are at gamma / 2^q.
        sectors: of each contact, at this step.
        edges: friction edges over all contacts.
        seconds: of this step.
    """

    number: int
    result: SolverResult
    point: ScaledPoint | None
    bound: float
    width: float
    finished: bool
    sectors: tuple[Discretisation, ...]
    edges: int
    seconds: float


class RefinementProgress(NamedTuple):
    """Where a question is: the bounds so far, the solver's nodes, and the last step."""

    lower: float
    upper: float
    nodes: int
    step: RefinementStep


OnProgress = Callable[[RefinementProgress], None]
A = TypeVar("A", bound=Answer)


class Refined(NamedTuple, Generic[A]):
    """What Algorithm 1 answers: as the queries do, without a certificate; and the steps that it took."""

    answer: A
    steps: tuple[RefinementStep, ...]


# --- the loop -----------------------------------------------------------------------------------------------------


def refine(p: ScaledProblem, goal: Objective, settings: RefinementSettings) -> Iterator[RefinementStep]:
    """Algorithm 1, one step per mixed-integer program, until nothing is left to refine or none is feasible.

    Each step returns control: limits and early stops live outside.

    Args:
        p: the scaled problem; with `p.mdp` False one program without sectors is solved.
        goal: the objective.
        settings: solver, sectors, the time for all steps together; as printed, (19) is an equality.
    """
    deadline = time.monotonic() + settings.timeout
    begin = Discretisation.full if settings.full else Discretisation.coarse
    sectors = [begin(settings.q) for _ in p.mu]
    for number in range(1, 10_000):
        clock = time.monotonic()
        edges = [s.edges() for s in sectors] if p.mdp else [polygon() for _ in p.mu]
        model = relaxation(p, goal, edges, settings.as_printed)
        result = mixed_integer_solvers.solve(model.program, settings.solver, timeout=deadline - clock)
        point = model.read(result.x) if result.x is not None else None
        to_refine: list[tuple[int, Sector]] = []
        width = 0.0
        if p.mdp and result.status is SolverStatus.OPTIMAL:
            for i, sector in enumerate(model.active(result.x)):
                if sector is not None:
                    width = max(width, 2 * np.pi * sector.width)
                    if not sectors[i].finest(sector):
                        to_refine.append((i, sector))
        yield RefinementStep(
            number=number,
            result=result,
            point=point,
            bound=result.bound,
            width=width,
            finished=result.status is SolverStatus.OPTIMAL and not to_refine,
            sectors=tuple(sectors),
            edges=sum(len(e.length) for e in edges),
            seconds=time.monotonic() - clock,
        )
        if result.status is not SolverStatus.OPTIMAL or not to_refine:
            return
        for i, sector in to_refine:
            sectors[i] = sectors[i].refined(sector)


Found = tuple[Outcome, tuple[RefinementStep, ...]]


def _search(p: ScaledProblem, goal: Objective, settings: RefinementSettings, on_progress: OnProgress | None) -> Found:
    """Refine until value and bound are as near as asked; Ctrl-C leaves what was reached."""
    start = time.monotonic()
    r = reduce(p, goal)
    end = float(r.lo[0]) if goal.has_direction else -INF  # of the search
    last = end + END_TOLERANCE * abs(end) if end > -INF else -INF
    found: Witness | None = None
    value, bound = INF, -INF
    steps: list[RefinementStep] = []
    interrupted = False
    try:
        for step in refine(p, goal, settings):
            steps.append(step)
            if step.result.status is SolverStatus.INFEASIBLE:
                bound = INF
            elif goal.has_scalar and step.bound > last:
                bound = max(bound, step.bound)
            if step.point is not None:
                at_end = end > -INF and goal.objective(step.point.scalar) <= last
                hit = _exact_state(r, step.point, hold=True) if at_end else None
                hit = hit or _exact_state(r, step.point)
                if hit and end > -INF and goal.objective(hit[1].scalar) < end:  # past it: is there one right there?
                    hit = _exact_state(r, hit[1], hold=True)
                if hit:
                    achieved = goal.achieved(hit[0], hit[1].scalar)
                    if achieved < value:
                        value, found = achieved, hit[0]
            if on_progress:
                bounds = goal.bounds(p, value, bound)
                on_progress(RefinementProgress(*bounds, sum(s.result.nodes for s in steps), step))
            if ((found and not goal.has_scalar) or value <= last or goal.near(p, value, bound, settings.gap)) and (
                not settings.as_printed
            ):
                break
    except KeyboardInterrupt:
        interrupted = True
    stop = Stop.INTERRUPTED if interrupted or not steps else STATUS_STOPS[steps[-1].result.status]
    done = value <= last or goal.near(p, value, bound, settings.gap) or (found is not None and not goal.has_scalar)
    if (bound == INF and found is None) or done:
        stop = Stop.COMPLETE
    elif stop is Stop.COMPLETE:
        stop = Stop.RESOLUTION
    if bound == INF:  # no state at all: whatever an earlier step seemed to find
        value, found = INF, None
    bound = min(bound, value)  # it holds within the motion cap, which Newton's method may leave
    nodes = sum(s.result.nodes for s in steps)
    return Outcome(value, bound, found, stop, time.monotonic() - start, nodes), tuple(steps)


def _exact_state(r: Reduced, start: ScaledPoint, *, hold: bool = False) -> tuple[Witness, ScaledPoint] | None:
    """A valid witness near a relaxation's solution, with its scaled point; None if Newton finds none.

    hold: at the end of the search for a maximum.
    """
    for tol in MODE_TOLERANCES:
        z = exact_solution(r, r.z(start), tolerance=tol, hold=hold)
        if z is None:
            continue
        x = r.point(z)
        witness = r.witness(x)
        if witness.valid:
            return witness, x
    return None


# --- the queries --------------------------------------------------------------------------------------------------


def check(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: RefinementSettings | None = None,
    on_progress: OnProgress | None = None,
) -> Refined[CheckAnswer]:
    """Is a wrench (6,) [N, N m], or a force (3,), resisted? Section VII-A, (20)-(22).

    Arguments are those of `handfast.check`.

    Raises:
        InputError: as there; laws of joints, and soft fingers, which the paper does not know; no such solver.
    """
    settings = settings or RefinementSettings()
    p = _posed(grasp, wrench, limits=limits, mdp=mdp)
    caps = (p.cn_max,) if p.mdp else (min(p.cn_max, FIRST_FORCE_BOUND), p.cn_max)  # without (6) moderate forces first
    for cap in caps:
        found, steps = _search(replace(p, cn_max=cap), ANY_STATE, settings, on_progress)
        verdict = Verdict.SLIPS if found.bound == INF else Verdict.HOLDS if found.witness else Verdict.UNDECIDED
        if verdict is Verdict.HOLDS:
            break
        settings = settings.after(found.seconds)
    posed = BoundProblem(replace(p, cn_max=cap), ANY_STATE)
    answer = CheckAnswer(verdict, found.stop, *found.cost, found.witness, None, posed=posed, verified=True)
    return Refined(answer.settled(), steps)


def maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: RefinementSettings | None = None,
    on_progress: OnProgress | None = None,
) -> Refined[MaxAnswer]:
    """The largest s such that base + s direction is resisted. Section VII-B, (23)-(25).

    Arguments and errors are those of `handfast.maximum` and of `check` here.
    """
    settings = settings or RefinementSettings()
    p = _posed(grasp, np.zeros(6) if base is None else base, direction, limits=limits, mdp=mdp)
    goal = max_goal(p)
    if not goal.has_scalar:  # nothing but the disturbance: resisted at every magnitude or at none
        p = replace(p, w0=p.direction, wrench=p.along)
    if goal.maximised and not (p.w0.any() or p.f_c.any()):  # beside limits there is the load alone
        free = scaled_problem.build(p.grasp, p.along, limits=GraspLimits(p.limits.eta), mdp=p.mdp)
        alone, steps = _search(free, ANY_STATE, settings, on_progress)
        if alone.bound == INF:  # what slips without limits slips with them
            return Refined(shown_maximum(BoundProblem(free, ANY_STATE), alone).settled(), steps)
        settings = settings.after(alone.seconds)
    found, steps = _search(p, goal, settings, on_progress)
    if found.witness is None and found.bound < INF and goal.maximised and found.stop is not Stop.INTERRUPTED:
        # is the base load resisted, at least?
        alone, more = _search(p, ANY_STATE, settings.after(found.seconds), None)
        found, steps = found.after(alone), steps + more
        if alone.witness is not None:
            found = replace(found, witness=alone.witness, value=0.0)
    return Refined(shown_maximum(BoundProblem(p, goal), found).settled(), steps)


def torques(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    limits: GraspLimits = NO_LIMITS,
    settings: RefinementSettings | None = None,
    on_progress: OnProgress | None = None,
) -> Refined[TorquesAnswer]:
    """The commands that resist a wrench with the least effort. Section VII-C, (26)-(27).

    Arguments and errors are those of `handfast.torques` and of `check` here.
    """
    settings = settings or RefinementSettings()
    _refuse_what_the_paper_does_not_know(grasp)
    posed, names = posed_torques(grasp, wrench, objective, actuators, limits)
    p = posed.problem
    found, steps = _search(p, posed.goal, settings, on_progress)
    if found.witness is None and found.bound <= 0.0 and found.stop is not Stop.INTERRUPTED:
        held = scaled_problem.build(with_hardly_any(p), p.wrench, limits=p.limits)
        there, more = _search(held, ANY_STATE, settings.after(found.seconds), None)
        if there.witness is not None:
            found = replace(found.after(there), witness=there.witness, stop=Stop.COMPLETE)
            steps += more
    return Refined(shown_torques(posed, names, found).settled(), steps)


def _posed(grasp: Grasp, *loads: Any, **options: Any) -> ScaledProblem:
    """The scaled problem of a grasp that the paper's model knows."""
    _refuse_what_the_paper_does_not_know(grasp)
    return scaled_problem.build(grasp, *loads, **options)


def _refuse_what_the_paper_does_not_know(grasp: Grasp) -> None:
    grasp.refuse_laws("Algorithm 1")
    grasp.refuse_soft_fingers("Algorithm 1")
