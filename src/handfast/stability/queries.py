"""The three questions about one disturbance: check, max, torques.

Each builds the scaled problem, searches by the method of the settings (`search/front`, or `reference` for
the paper's Algorithm 1), and returns an immutable answer with its witness and its proof. Source: stability
paper, section VII: (20)-(22), (23)-(25), (26)-(27).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import goal as goals
from handfast.stability import problem
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.goal import NEAR_END, Goal, search_end
from handfast.stability.interval import resisted
from handfast.stability.outcome import INF, Outcome
from handfast.stability.problem import Problem
from handfast.stability.search import front
from handfast.stability.search.reduced import HIGHEST
from handfast.stability.settings import OnStep, Settings
from handfast.stability.witness import Witness

MODEST = 10.0  # (scaled) normal forces tried first when nothing else bounds them
MORE = (1e-3, 1e-2, 1e-1)  # shares of the gap by which commands are raised until a check holds
ANY = 0.9  # relative: a gap with which the first state that is found ends a search, mostly,
MANY = 4096  # nodes at most
NEARLY_NONE = 1e-6  # (scaled) commands where the least that hold are only approached, as they go to 0


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
        settings: method, precision, limits.
        on_step: called while it runs, with the bounds so far.

    Raises:
        InputError: see `handfast.stability.problem.build`.
    """
    settings = settings or Settings()
    p = problem.build(grasp, wrench, eta=eta, mdp=mdp, torque_limits=torque_limits, force_limit=force_limit)
    if not mdp:  # moderate forces first: without dissipation nothing bounds them, and small ones are easier to read
        modest = _exists(replace(p, cn_max=min(p.cn_max, MODEST)), settings, on_step)
        if modest.verdict is Verdict.HOLDS:
            return modest
    return _exists(p, settings, on_step)


def _exists(p: Problem, settings: Settings, on_step: OnStep | None) -> CheckAnswer:
    found = _search(p, Goal.EXISTS, settings, on_step)
    verdict = Verdict.SLIPS if found.bound == INF else Verdict.HOLDS if found.witness else Verdict.UNDECIDED
    posed, cost = (p, Goal.EXISTS), _cost(found)
    return CheckAnswer(verdict, found.stop, *cost, found.witness, found.proof, posed=posed, verified=_verified(found))


def maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    eta: float = 0.0,
    mdp: bool = True,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    interval: bool = False,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> MaxAnswer:
    """The largest s such that the disturbance base + s direction is resisted: section VII-B, (23)-(25).

    The resisted magnitudes need not be an interval: a smaller one may slip.

    Args:
        direction: (6,) force [N] and torque [N m]; s multiplies it as given, normalise it yourself.
        base: (6,) a constant load such as gravity.
        interval: show which smaller magnitudes are resisted, too, see `stability/interval`.

    The other arguments and errors are those of `check`.
    """
    settings = settings or Settings()
    w0 = np.zeros(6) if base is None else base
    p = problem.build(grasp, w0, direction, eta=eta, mdp=mdp, torque_limits=torque_limits, force_limit=force_limit)
    answer = largest(p, settings, on_step)
    return with_interval(answer, settings) if interval else answer


def with_interval(answer: MaxAnswer, settings: Settings) -> MaxAnswer:
    """A maximum with which smaller magnitudes are resisted; as it is if none is."""
    if answer.posed is None or answer.witness is None or not answer.lower > 0:
        return answer
    shown = resisted(*answer.posed, answer.lower, answer.upper, answer.witness.state, settings)
    return replace(answer, interval=shown)


def largest(p: Problem, settings: Settings, on_step: OnStep | None = None, **hints: Any) -> MaxAnswer:
    """The answer to a built problem; hints: to the engine's `search`, what a neighbour left."""
    end = p.stretch * search_end(p)
    goal = max_goal(p)
    if goal is Goal.EXISTS:  # nothing but the disturbance: resisted at every magnitude or at none
        p = replace(p, w0=p.direction, wrench=p.along)
    found: Outcome | None = None
    if goal is Goal.LARGEST and not (p.w0.any() or p.f_c.any()):  # beside limits there is the load alone
        # no search tells small magnitudes from 0, which every limit allows; what slips without limits slips with them
        free = problem.build(p.grasp, p.along, eta=p.eta, mdp=p.mdp)
        alone = _search(free, Goal.EXISTS, settings, on_step)
        if alone.bound == INF:
            p, goal, found = free, Goal.EXISTS, alone
    found = found or _search(p, goal, settings, on_step, **hints)
    if found.bound == INF and goal is not Goal.EXISTS and settings.method == "engine":
        found = _without_end(p, goal, _left(settings, found), on_step, found)
    if found.witness is None and found.bound < INF and goal is Goal.LARGEST and found.stop is not Stop.INTERRUPTED:
        found = _base_alone(p, _left(settings, found), found)

    def answer(verdict: Verdict, witness: Witness | None, lower: float, upper: float, unbounded: bool) -> MaxAnswer:
        cost, backing = _cost(found), _verified(found)
        return MaxAnswer(
            verdict,
            found.stop,
            *cost,
            witness,
            found.proof,
            lower,
            upper,
            unbounded,
            point=found.point if verdict is Verdict.HOLDS else None,
            posed=(p, goal),
            verified=backing,
        )

    if found.bound == INF:
        return answer(Verdict.SLIPS, None, 0.0, 0.0, False)
    if found.witness is None:
        upper = goals.interval(p, goal, INF, found.bound)[1] if goal is not Goal.EXISTS else INF
        return answer(Verdict.UNDECIDED, None, 0.0, upper, False)
    w = found.witness
    if goal is Goal.EXISTS:
        s, upper, unbounded = end, INF, True
        w = _scaled(w, s)
    else:
        s, upper = goals.interval(p, goal, found.value, found.bound)
        unbounded = bool(s >= end * (1 - NEAR_END))
        if goal is Goal.SMALLEST_PRELOAD:
            w = _scaled(w, s / p.stretch)
    if unbounded:
        upper = INF
    return answer(Verdict.HOLDS, w, s, upper, unbounded)


def _without_end(p: Problem, goal: Goal, settings: Settings, on_step: OnStep | None, found: Outcome) -> Outcome:
    """Nothing was found up to the end of a search: is there anything beyond? What both searches showed.

    Magnitudes however small, magnitudes and commands however large.
    """
    if goal is Goal.LARGEST:  # any of them would do
        settings = replace(settings, gap=ANY, node_limit=min(settings.node_limit, MANY + 2 * found.nodes))
    beyond = _search(p, goal, settings, on_step, endless=True)
    seconds, nodes = found.seconds + beyond.seconds, found.nodes + beyond.nodes
    if beyond.witness is not None or beyond.bound == INF:
        stop = Stop.COMPLETE if goal is Goal.LARGEST else beyond.stop
        return replace(beyond, stop=stop, seconds=seconds, nodes=nodes)
    shown = found.proof.certificate if found.proof else None
    if goal is Goal.LARGEST or shown is None or shown.scalar is None:
        return replace(found, bound=-INF, proof=None, stop=beyond.stop, seconds=seconds, nodes=nodes)
    end = HIGHEST if goal is Goal.SMALLEST_PRELOAD else shown.scalar[1]
    return replace(found, bound=end, stop=beyond.stop, seconds=seconds, nodes=nodes)


def _base_alone(p: Problem, settings: Settings, found: Outcome) -> Outcome:
    """No magnitude was witnessed: is the base load resisted, at least?"""
    alone = _search(p, Goal.EXISTS, settings, None)
    seconds, nodes = found.seconds + alone.seconds, found.nodes + alone.nodes
    if alone.witness is None:
        return replace(found, seconds=seconds, nodes=nodes)
    return replace(found, witness=alone.witness, value=0.0, point=None, seconds=seconds, nodes=nodes)


def max_goal(p: Problem) -> Goal:
    """How a maximum is posed: limits and a base load break homogeneity; without commands there is only yes or no."""
    if np.isfinite(p.f_max).any() or np.isfinite(p.cn_max) or p.w0.any():
        return Goal.LARGEST
    return Goal.SMALLEST_PRELOAD if p.f_c.any() else Goal.EXISTS


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
    p = problem.build(asked, wrench, eta=eta, torque_limits=torque_limits, force_limit=force_limit, driven=chosen)
    goal = Goal.SMALLEST_MAX_TORQUE if objective == "max" else Goal.SMALLEST_SUM_TORQUE
    finer = replace(settings, gap=(1 - 2 * MORE[-1]) * settings.gap)  # leaves room for raising the commands
    found = _search(p, goal, finer, on_step)
    if found.bound == INF and settings.method == "engine":
        found = _without_end(p, goal, _left(finer, found), on_step, found)
    if found.stop is Stop.INTERRUPTED:
        pass
    elif found.witness is None and found.bound <= 0.0:  # any will do, and none will not: ask for hardly any
        little = NEARLY_NONE * np.abs(p.command(np.ones(grasp.mechanism.a))) * asked.command
        found = _held(p, asked.with_preload(little), settings, found) or found
    elif found.witness is not None and settings.method == "engine":
        # commands that are the smallest to the last bit hold by luck: a little more, as `check` answers
        for factor in 1 + settings.gap * np.array(MORE):
            held = _held(p, grasp.with_preload(factor * found.witness.grasp.command), _left(settings, found), found)
            if held is not None:
                found = held
                break

    def answer(verdict: Verdict, preload: dict[str, float] | None, lower: float, upper: float) -> TorquesAnswer:
        cost, backing = _cost(found), _verified(found)
        return TorquesAnswer(
            verdict,
            found.stop,
            *cost,
            found.witness,
            found.proof,
            preload,
            lower,
            upper,
            posed=(p, goal),
            verified=backing,
        )

    if found.bound == INF:
        return answer(Verdict.SLIPS, None, INF, INF)
    lower = max(found.bound, 0.0)
    if found.witness is None:
        return answer(Verdict.UNDECIDED, None, lower, INF)
    commands = found.witness.grasp.command
    preload = dict(zip(found.witness.grasp.mechanism.actuators, commands.tolist(), strict=True))
    effort = np.abs(commands).max(initial=0.0) if objective == "max" else np.abs(commands).sum()
    return answer(Verdict.HOLDS, {n: preload[n] for n in names}, lower, float(effort))


# --- helpers ------------------------------------------------------------------------------------


def _search(p: Problem, goal: Goal, settings: Settings, on_step: OnStep | None, **hints: Any) -> Outcome:
    if settings.method == "algorithm1":
        from handfast.stability.paper import reference

        return reference.search(p, goal, settings, on_step)
    return front.search(p, goal, settings, on_step, **hints)


def _left(settings: Settings, found: Outcome) -> Settings:
    """For what follows a search: the rest of the time, at least a quarter of all."""
    return replace(settings, time_limit=max(settings.time_limit - found.seconds, settings.time_limit / 4))


def _held(p: Problem, grasp: Grasp, settings: Settings, found: Outcome) -> Outcome | None:
    """`found` with the witness of a check under these commands; None if it is not resisted."""
    limits = {"torque_limits": p.torque_limits, "force_limit": p.force_limit}
    q = problem.build(grasp, p.wrench, eta=p.eta, mdp=p.mdp, **limits)  # type: ignore[arg-type]
    there = _search(q, Goal.EXISTS, replace(settings, verify=False), None)
    if there.witness is None:
        return None
    seconds, nodes = found.seconds + there.seconds, found.nodes + there.nodes
    return replace(found, witness=there.witness, seconds=seconds, nodes=nodes)


def _verified(found: Outcome) -> bool:
    """Was everything replayed? Witnesses always are."""
    return bool(found.verified or found.proof is None)


def _cost(found: Outcome) -> tuple[float, int, tuple[Any, ...]]:
    return found.seconds, found.nodes, found.steps


def _scaled(w: Witness, s: float) -> Witness:
    """A homogeneous witness (w = d, commands lambda f_c) scaled so that the commands are the grasp's own."""
    return Witness(w.grasp.with_preload(s * w.grasp.command), s * w.wrench, w.state.scaled(s), w.eta, w.mdp)
