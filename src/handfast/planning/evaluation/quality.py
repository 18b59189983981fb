"""How good a planned grasp is: how much more it holds, on how little that leans, how much room the hand has."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.core.answer import uninterrupted
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.preload_search import PRELOAD_TIMEOUT, checking_settings_for, settings_for
from handfast.planning.question import PlanOptions
from handfast.stability.answers.answer import finite
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.margin_search import why_fragile
from handfast.stability.studies.questions import maximum

QUALITY_GAP = 1e-2  # of the margins: their bounds may be so far apart


@dataclass(frozen=True)
class GraspQuality:
    """What tells grasps apart that all hold their loads.

    Attributes:
        margin: the largest factor, certified, by which each load may be multiplied under the preload; of the loads as
            they were given, before the factor of safety. inf if all are resisted at any size.
        weakest: name of the load with that margin; "" where all loads are 0.
        leans_on: what makes that HOLDS fragile (`Margin.why`): "motion", "friction", "tilt"; () if it
            is robust. Of commands and load together; () where these do not hold and the path does.
        clearance: [m] the least distance of links that do not touch to the object, of links to each other, and
            of the hand to what is around the object (that up to 50 mm).
    """

    margin: float
    weakest: str
    leans_on: tuple[str, ...]
    clearance: float

    @property
    def fragile(self) -> bool:
        return bool(self.leans_on)

    def to_json(self) -> dict[str, Any]:
        """Keys of `plan.json`; a margin of null is any size."""
        return {
            "margin": finite(self.margin),
            "weakest": self.weakest or None,
            "fragile": self.fragile,
            "leans_on": list(self.leans_on),
            "clearance": self.clearance,
        }


def largest_command(grasp: Grasp) -> dict[str, Any]:
    """Which actuator is commanded most, how much, and in which unit; 0 of none where all are locked."""
    name = max(grasp.preload, key=lambda n: abs(grasp.preload[n]), default=None)
    if name is None:
        return {"actuator": None, "value": 0.0, "unit": "N m"}
    k = grasp.mechanism.actuators.index(name)
    turns = any(j.type == "revolute" for j, r in zip(grasp.joints, grasp.mechanism.R[k], strict=True) if r)
    unit = "N m" if turns and not grasp.mechanism.tendon[k] else "N"
    return {"actuator": name, "value": grasp.preload[name], "unit": unit}


def with_margins(answer: HoldAnswer, options: PlanOptions, until: float) -> HoldAnswer:
    """An answer that holds, with how much of each load is resisted under its preload; as it is if there is no time.

    What is shown has its witness. That no more is resisted is not kept where commands and load are asked together:
    proving it took four fifths of the time for grasps of eight contacts, and nothing asks for it.

    Args:
        until: on the monotonic clock.
    """
    assert answer.grasp is not None
    grasp, limits, found = answer.grasp.with_commands(answer.preload or {}), options.limits, {}
    asked = [(name, w) for name, w in answer.loads.by_name.items() if np.any(w)]
    for k, (name, w) in enumerate(asked):
        left = min(until - time.monotonic(), PRELOAD_TIMEOUT) / (len(asked) - k)
        if left <= 0:
            return answer
        settings = limits.settings or replace(settings_for(grasp), gap=QUALITY_GAP, timeout=left)
        how: dict[str, Any] = {"limits": limits.of_grasp(grasp), "loading": limits.loading}
        if limits.loading == "together":
            shown = uninterrupted(maximum(grasp, w, settings=replace(settings, verify=False), **how))
            found[name] = replace(shown.settled(time.monotonic() + left), proof=None, upper=np.inf)
        else:
            found[name] = uninterrupted(maximum(grasp, w, settings=settings, **how))
    return replace(answer, margins=found)


def quality(answer: HoldAnswer, options: PlanOptions, clearance: float, robust_under: str = "") -> GraspQuality:
    """Of a grasp whose answer knows its margins, see `with_margins`; on what it leans is asked at the weakest load.

    Args:
        clearance: [m].
        robust_under: name of a load under which it is known to lean on nothing.
    """
    asked, weakest = answer.margin, answer.weakest
    times = np.inf if asked is None else asked * options.safety
    leans = leans_on(answer, options, weakest) if weakest not in ("", robust_under) else ()
    return GraspQuality(float(times), weakest, leans, clearance)


def leans_on(answer: HoldAnswer, options: PlanOptions, name: str) -> tuple[str, ...]:
    """What a grasp whose answer holds leans on under the load of a name, without the factor of safety."""
    assert answer.grasp is not None
    grasp, limits = answer.grasp.with_commands(answer.preload or {}), options.limits
    wrench = answer.loads.wrenches[answer.loads.names.index(name)] / options.safety
    settings = limits.settings or checking_settings_for(grasp)
    why = why_fragile(grasp, wrench, limits.of_grasp(grasp), settings)
    return why if why is not None else ("motion",) if limits.loading == "together" else ()
