"""A posed question to the engine, and what follows its search."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from handfast.core.answer import SearchLimits, Stop
from handfast.model.grasp import Grasp
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.objective import ANY_STATE, HIGHEST, INF, Objective
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import MIN_SEARCH_TIME, OnStep, Settings
from handfast.stability.search.proof import Outcome

ANY_STATE_GAP = 0.9  # relative: a gap with which the first state that is found ends a search, mostly,
ANY_STATE_NODES = 4096  # nodes at most


def solve(p: ScaledProblem, goal: Objective, settings: Settings, on_progress: OnStep | None, **hints: Any) -> Outcome:
    """What the search finds; hints: see `engine.search`. The engine loads when it is asked first."""
    from handfast.stability.search import engine

    return engine.search(p, goal, settings, on_progress, **hints)


def compiled() -> None:
    """Let the engine be compiled, or loaded, before the clock of a question runs: that is no question's time."""
    from handfast.stability.search.machine import LIBRARY

    LIBRARY.functions  # noqa: B018


def clock_of(settings: Settings) -> SearchLimits:
    """The time of a question, from now on."""
    compiled()
    return SearchLimits(settings.timeout)


def time_left(settings: Settings, limits: SearchLimits) -> Settings:
    """For what follows a search: the rest of its time."""
    return replace(settings, timeout=max(limits.seconds_left, MIN_SEARCH_TIME))


def without_end(
    p: ScaledProblem,
    goal: Objective,
    settings: Settings,
    on_progress: OnStep | None,
    found: Outcome,
    limits: SearchLimits,
) -> Outcome:
    """Nothing was found up to the end of a search: is there anything beyond? What both searches showed.

    Magnitudes however small, magnitudes and commands however large.
    """
    settings = time_left(settings, limits)
    if goal.maximised:  # any of them would do
        settings = replace(settings, gap=ANY_STATE_GAP, nodes=min(settings.nodes, ANY_STATE_NODES + 2 * found.nodes))
    if limits.late:
        beyond = Outcome(INF, -INF, None, Stop.TIME, 0.0, 0)
    else:
        beyond = solve(p, goal, settings, on_progress, endless=True)
    if beyond.witness is not None or beyond.bound == INF:
        stop = Stop.COMPLETE if goal.maximised else beyond.stop
        return replace(beyond.after(found), stop=stop)
    shown = found.proof.certificate if found.proof else None
    if goal.maximised or shown is None or shown.scalar is None:
        return replace(found.after(beyond), bound=-INF, proof=None, stop=beyond.stop)
    end = HIGHEST if goal.homogeneous else shown.scalar[1]
    return replace(found.after(beyond), bound=end, stop=beyond.stop)


def held_under(
    grasp: Grasp, p: ScaledProblem, settings: Settings, found: Outcome, limits: SearchLimits
) -> Outcome | None:
    """`found` with the witness of a check under the commands of this grasp; None if it is not resisted, or too late.

    The check begins with the witness that was found, if any, and gives up after a few nodes more than that took.
    """
    if limits.late:
        return None
    settings, near = replace(time_left(settings, limits), verify=False), []
    if found.witness is not None:
        settings = replace(settings, nodes=min(settings.nodes, ANY_STATE_NODES + 2 * found.nodes))
        near = [(found.witness.state, 0.0)]
    asked = scaled_problem.build(grasp, p.wrench, limits=p.limits, mdp=p.mdp)
    there = solve(asked, ANY_STATE, settings, None, near=near)
    return replace(found.after(there), witness=there.witness) if there.witness is not None else None
