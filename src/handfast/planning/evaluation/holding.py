"""Does a grasp hold its loads? Asked within limits, for the first time and again of what was kept."""

from __future__ import annotations

from typing import Any

from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Grasp
from handfast.planning.requirements import Limits
from handfast.stability.hold import HoldAnswer, hold
from handfast.stability.loads import Loads
from handfast.stability.queries import CheckAnswer, check
from handfast.stability.settings import Settings


def held(grasp: Grasp, loads: Loads, limits: Limits, settings: Settings, **how: Any) -> HoldAnswer:
    """One preload for all loads; `settings` where the limits state none, `how` as in `hold`."""
    return hold(grasp, loads, settings=limits.settings or settings, **limits.of_a_load, **how)


def held_again(
    grasp: Grasp,
    loads: Loads,
    limits: Limits,
    settings: Settings,
    known: tuple[dict[str, float], float, float],
    nodes: int,
) -> HoldAnswer | None:
    """What was found before, every load asked again under the preload of a grasp; None if one is not held.

    Args:
        known: preload, lower and upper bound of its largest command.
        nodes: of the search that found it.
    """
    how = limits.of_a_load | {"settings": limits.settings or settings}
    checks: list[CheckAnswer] = []
    for wrench in loads.wrenches:
        checks.append(check(grasp, wrench, **how))
        if checks[-1].verdict is not Verdict.HOLDS:
            return None
    asked: dict[str, Any] = {"grasp": grasp, "limits": limits.of_a_load, "actuators": tuple(known[0])}
    return HoldAnswer(Verdict.HOLDS, Stop.COMPLETE, 0.0, nodes, loads, *known, tuple(checks), **asked)
