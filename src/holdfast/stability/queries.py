"""The three questions about one disturbance: check, max, torques.

Each builds the scaled problem, lets Algorithm 1 refine, tries every relaxation's solution as the
start of an exact one, and returns an immutable answer with its witness. Source: stability paper,
section VII: (20)-(22), (23)-(25), (26)-(27).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from holdfast.answer import Stop, Verdict
from holdfast.errors import InputError
from holdfast.grasp import Grasp
from holdfast.mechanism import Array, Mask
from holdfast.stability import algorithm1, problem, relaxation, witness
from holdfast.stability.algorithm1 import Step
from holdfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from holdfast.stability.exact import Load, Point
from holdfast.stability.mip import INF, Status
from holdfast.stability.problem import Problem
from holdfast.stability.relaxation import Goal
from holdfast.stability.settings import OnStep, Progress, Settings
from holdfast.stability.witness import Witness

MODEST = 10.0  # (scaled) normal forces tried first when nothing else bounds them
ZERO = 1e-9  # [N m or N] torques below this count as none

STOPS = {
    Status.OPTIMAL: Stop.COMPLETE,
    Status.INFEASIBLE: Stop.COMPLETE,
    Status.UNBOUNDED: Stop.COMPLETE,
    Status.TIME: Stop.TIME,
    Status.INTERRUPTED: Stop.INTERRUPTED,
    Status.FAILED: Stop.NUMERICAL,
}


def check(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    eta: float = 0.0,
    mdp: bool = True,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> CheckAnswer:
    """Does the grasp resist a disturbance passively? Stability paper, section VII-A, (20)-(22).

    Args:
        grasp: with the preload in force; an actuator without a command is locked.
        wrench: (6,) force [N] and torque [N m] on the object, object frame, at its origin.
        eta: uncertainty of the contact normals [rad], section VI.
        mdp: False leaves out the maximum dissipation principle (the friction of the grasp-force
            literature), for comparison only: it creates energy out of nothing.
        torque_limits: actuator -> largest |f| of motor and gearing together, passive reaction included.
        force_limit: largest normal force at any contact [N].
        settings: solver, resolution, limits.
        on_step: called after each step of Algorithm 1.

    Raises:
        InputError: see `holdfast.stability.problem.build`.
    """
    settings = settings or Settings()
    p = problem.build(grasp, wrench, eta=eta, mdp=mdp, torque_limits=torque_limits, force_limit=force_limit)
    if not mdp:  # moderate forces first: without dissipation nothing bounds them, and small ones are easier to read
        modest = _exists(replace(p, cn_max=min(p.cn_max, MODEST)), settings, on_step)
        if modest.verdict is Verdict.HOLDS:
            return modest
    return _exists(p, settings, on_step)


def _exists(p: Problem, settings: Settings, on_step: OnStep | None) -> CheckAnswer:
    search = _Search(p, Goal.EXISTS, settings, on_step)
    found: Witness | None = None
    with search:
        for step in search:
            if step.point is not None and (hit := witness.find(p, search.load, step.point)):
                found = hit[0]
                if not settings.as_printed:
                    break
    if search.infeasible:
        return CheckAnswer(Verdict.SLIPS, Stop.COMPLETE, *search.cost, None)
    if found is not None:
        return CheckAnswer(Verdict.HOLDS, Stop.COMPLETE, *search.cost, found)
    # a relaxation with a solution at the finest level is no proof that the exact model has one
    return CheckAnswer(Verdict.UNDECIDED, search.unproved, *search.cost, None)


def maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    eta: float = 0.0,
    mdp: bool = True,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> MaxAnswer:
    """The largest s such that the disturbance base + s direction is resisted: section VII-B, (23)-(25).

    The resisted magnitudes need not be an interval: a smaller one may slip.

    Args:
        direction: (6,) force [N] and torque [N m]; s multiplies it as given, normalise it yourself.
        base: (6,) a constant load such as gravity.

    The other arguments and errors are those of `check`.
    """
    settings = settings or Settings()
    w0 = np.zeros(6) if base is None else base
    p = problem.build(grasp, w0, direction, eta=eta, mdp=mdp, torque_limits=torque_limits, force_limit=force_limit)
    limited = bool(np.isfinite(p.f_max).any()) or np.isfinite(p.cn_max) or bool(p.w0.any())
    goal = Goal.LARGEST if limited else Goal.SMALLEST_PRELOAD
    search = _Search(p, goal, settings, on_step)
    end = relaxation.search_end(p)
    at_end = end * (1 - 1e-6)
    found: Witness | None = None
    with search:
        for step in search:
            # the solver's bound on lambda or on -s, as a bound on s
            bound = max(0.0, -step.bound) if limited else (1.0 / step.bound if step.bound > 0 else INF)
            search.upper = 0.0 if search.infeasible else min(search.upper, bound if bound < at_end else INF)
            if step.point is None:
                continue
            starts = [(search.load, step.point)]
            last = end if limited else 1.0 / end
            if (limited and step.point.sigma >= last * (1 - 1e-6)) or (
                not limited and step.point.sigma <= last * (1 + 1e-6)
            ):
                # the relaxation reaches the end of the search: is there an exact solution right there?
                starts.insert(0, (replace(search.load, free=False), replace(step.point, sigma=last)))
            hit = next((h for load, x in starts if (h := witness.find(p, load, x))), None)
            if hit:
                w, x = hit
                if not limited:
                    w, s = _at_commands(p, search.load, w, x, end)
                else:
                    s = x.sigma
                if s > search.lower:
                    found, search.lower = w, s
            close = search.lower >= at_end or search.upper <= search.lower * (1 + settings.gap)
            if close and not settings.as_printed:
                break
    if search.infeasible:
        return MaxAnswer(Verdict.SLIPS, Stop.COMPLETE, *search.cost, None, 0.0, 0.0, False)
    unbounded = search.lower >= at_end
    verdict = Verdict.HOLDS if found is not None else Verdict.UNDECIDED
    close = unbounded or search.upper <= search.lower * (1 + settings.gap)
    stop = Stop.COMPLETE if close else search.unproved
    return MaxAnswer(verdict, stop, *search.cost, found, search.lower, search.upper, unbounded)


def torques(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    objective: Literal["max", "sum"] = "max",
    actuators: Sequence[str] | None = None,
    eta: float = 0.0,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> TorquesAnswer:
    """The commands that resist a disturbance with the least effort: section VII-C, (26)-(27).

    An actuator that need not turn is locked and costs nothing, whatever passive load its gearing
    carries: that is (8), tau free where the command is zero.

    Args:
        objective: "max", the largest single command, or "sum".
        actuators: whose commands are sought; by default those that the grasp commands now, or all.
            The others stay locked.

    The other arguments and errors are those of `check`.

    Raises:
        InputError: also for an unknown objective or actuator.
    """
    settings = settings or Settings()
    if objective not in ("max", "sum"):
        raise InputError(f"is '{objective}'; 'max' or 'sum' is needed", field="objective")
    names = list(actuators or grasp.preload or grasp.mechanism.actuators)
    chosen = grasp.mechanism.commands(dict.fromkeys(names, 1.0), field="actuators") != 0
    sense = {n: v for n, v in grasp.preload.items() if n in names}
    asked = grasp.with_preload({n: np.sign(sense.get(n, 1.0)) for n in names})
    p = problem.build(asked, wrench, eta=eta, torque_limits=torque_limits, force_limit=force_limit)
    goal = Goal.SMALLEST_MAX_TORQUE if objective == "max" else Goal.SMALLEST_SUM_TORQUE
    search = _Search(p, goal, settings, on_step, driven=chosen)
    search.lower, search.upper = 0.0, INF
    found: Witness | None = None
    with search:
        for step in search:
            if step.bound > -INF:
                search.lower = max(search.lower, step.bound)
            if step.point is not None and (hit := witness.find(p, search.load, step.point, driven=chosen)):
                command = np.abs(hit[0].grasp.command)
                value = float(command.max(initial=0.0) if objective == "max" else command.sum())
                if value < search.upper:
                    found, search.upper = hit[0], value
            if _near(search, settings) and not settings.as_printed:
                break
    if search.infeasible:
        return TorquesAnswer(Verdict.SLIPS, Stop.COMPLETE, *search.cost, None, None, INF, INF)
    if found is None:
        return TorquesAnswer(Verdict.UNDECIDED, search.unproved, *search.cost, None, None, search.lower, INF)
    preload = dict(zip(found.grasp.mechanism.actuators, found.grasp.command.tolist(), strict=True))
    return TorquesAnswer(
        Verdict.HOLDS,
        Stop.COMPLETE if _near(search, settings) else search.unproved,
        *search.cost,
        found,
        {n: preload[n] for n in names},
        search.lower,
        search.upper,
    )


# --- helpers ------------------------------------------------------------------------------------


class _Search:
    """Algorithm 1 as an iterator that keeps the score: cost, bounds, why it ended. Ctrl-C ends it quietly."""

    def __init__(
        self, p: Problem, goal: Goal, settings: Settings, on_step: OnStep | None, driven: Mask | None = None
    ) -> None:
        self.load = relaxation.load(p, goal)
        if driven is not None:
            self.load = Load(self.load.w_a, self.load.w_b, np.zeros(len(p.f_c)), self.load.f_b, free=False)
        self.lower, self.upper = 0.0, INF
        self.steps: list[Step] = []
        self.interrupted = False
        self._on_step = on_step
        self._start = time.monotonic()
        self._run = algorithm1.run(
            p,
            goal,
            q=settings.q,
            solver=settings.solver,
            full=settings.full,
            printed_robustness=settings.as_printed,
            driven=driven,
            time_limit=settings.time_limit,
        )

    def __enter__(self) -> _Search:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        """Ctrl-C ends the search and leaves its bounds."""
        self.interrupted = kind is KeyboardInterrupt
        return self.interrupted

    def __iter__(self) -> _Search:
        return self

    def __next__(self) -> Step:
        if self.steps and self._on_step:
            self._on_step(Progress(self.steps[-1], self.lower, self.upper))
        step = next(self._run)
        self.steps.append(step)
        return step

    @property
    def infeasible(self) -> bool:
        return bool(self.steps) and self.steps[-1].solution.status is Status.INFEASIBLE

    @property
    def unproved(self) -> Stop:
        """Why there is no complete answer: the last step's limit, or that the numbers did not suffice."""
        if self.interrupted or not self.steps:
            return Stop.INTERRUPTED
        stop = STOPS[self.steps[-1].solution.status]
        return Stop.RESOLUTION if stop is Stop.COMPLETE else stop

    @property
    def cost(self) -> tuple[float, int, tuple[Step, ...]]:
        nodes = sum(s.solution.nodes for s in self.steps)
        return time.monotonic() - self._start, nodes, tuple(self.steps)


def _near(search: _Search, settings: Settings) -> bool:
    """Are the bounds on a torque as near as asked?"""
    return search.upper < INF and search.upper - search.lower <= settings.gap * search.upper + ZERO


def _at_commands(p: Problem, load: Load, w: Witness, x: Point, end: float) -> tuple[Witness, float]:
    """A homogeneous witness (w = d, commands lambda f_c) scaled so that the commands are the grasp's own."""
    s = end
    if p.f_c.any():
        if x.sigma < 1.0 / end:  # beyond the search's end: step back to it, or count for nothing
            back = witness.find(p, replace(load, free=False), replace(x, sigma=1.0 / end))
            if back is None:
                return w, 0.0
            w, x = back
        s = 1.0 / x.sigma
    grasp = w.grasp.with_preload(s * w.grasp.command)
    return Witness(grasp, s * w.wrench, w.state.scaled(s), w.eta, w.mdp), s
