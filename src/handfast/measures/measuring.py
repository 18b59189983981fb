"""`measure`: all measures of a grasp in one table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import kinds_checked, unknown_name
from handfast.core.presented import Presented
from handfast.core.schema import written
from handfast.measures.catalogue import (
    CATALOGUE,
    MEASURE_KEYS,
    PASSIVE,
    RIGID_JOINTS,
    Measure,
    MeasuredGrasp,
    MeasureOptions,
    PassiveMaxima,
)
from handfast.measures.conic_program import NotMeasured, check_limits
from handfast.measures.energies import benchmark_scale
from handfast.measures.internal_forces import LOST, SLIDES
from handfast.measures.wrench_scale import WrenchScale
from handfast.model.grasp import Grasp

SCHEMA = "handfast/measures/1"
SHOWN_BOUNDS_GAP = 0.02  # relative distance of the bounds of a passive maximum from which on both are shown


@dataclass(frozen=True)
class MeasuredValue:
    """A measure's value for a grasp.

    Attributes:
        value: inf where there is no bound; None where it is not measured.
        note: what else is to be said of it, such as why there is no value; "" for nothing.
    """

    measure: Measure
    value: float | bool | None
    note: str = ""


@dataclass(frozen=True, eq=False)
class Measures(Presented):
    """The measures of a grasp, and what they were made with.

    Attributes:
        scale: how torques are compared with forces; that of the energies is `energy_scale`.
        edges: of a friction cone's pyramid.
        force_limit: [N] the largest normal force at each contact, where a measure has one.
        values: in the order of the table.
        passive: the passive maxima in twelve directions; None if they were not asked.
        chosen: (12,) [N] the largest wrench that chosen forces balance there; None without clarabel.
    """

    grasp: Grasp
    scale: WrenchScale
    energy_scale: WrenchScale
    edges: int
    force_limit: float
    values: tuple[MeasuredValue, ...]
    passive: PassiveMaxima | None
    chosen: Array | None

    def __getitem__(self, key: str) -> float | bool | None:
        """The value of a measure by its key; raises `InputError` for one that is not there."""
        for v in self.values:
            if v.measure.key == key:
                return v.value
        raise unknown_name("measure", key, [v.measure.key for v in self.values], field="measures")

    def columns(self) -> dict[str, float | bool | None]:
        """Values by key, flat, for a row of a table; `passive_worst_upper` is beside the passive maximum."""
        out = {v.measure.key: v.value for v in self.values}
        if self.passive is not None:
            out["passive_worst_upper"] = self.passive.worst[1]
        return out

    def to_json(self) -> dict[str, Any]:
        """One object, schema `handfast/measures/1`; what is unbounded or not measured is null, and has a note."""

        def entry(v: MeasuredValue) -> dict[str, Any]:
            value = None if isinstance(v.value, float) and not np.isfinite(v.value) else v.value
            m = v.measure
            about = {"unit": m.unit, "better": m.better, "hand": m.assumes, "source": m.source, "note": v.note}
            return {"value": value, "name": m.name} | about

        out: dict[str, Any] = {"schema": SCHEMA, "grasp": self.grasp.name, "preload": self.grasp.preload}
        out |= {"scale": written(self.scale), "energy_scale": written(self.energy_scale)}
        out |= {"edges": self.edges, "force_limit": self.force_limit}
        out["measures"] = {v.measure.key: entry(v) for v in self.values}
        if self.passive is not None:
            rows = zip(self.passive.names, self.passive.lower, self.passive.upper, strict=True)
            out["passive"] = [{"direction": n, "lower": _finite(a), "upper": _finite(b)} for n, a, b in rows]
        return out


@kinds_checked
def measure(
    grasp: Grasp,
    *,
    about: object = None,
    length: float | None = None,
    only: tuple[str, ...] | list[str] | None = None,
    passive: bool = True,
    **options: Any,
) -> Measures:
    """The measures of a grasp that the literature compares grasps by, beside Handfast's own: `docs/measures.md`.

    Args:
        about: (3,) [m] the point about which torques are taken; the centre of mass, or the contacts' middle where it
            is unknown. Energies of planners are about the contacts' middle unless this is given.
        length: [m] by which torques are divided; the largest distance of a contact from that point. For the energies
            the mean distance, unless this is given.
        only: keys of the measures that are wanted; all unless given.
        passive: ask for Handfast's own passive maxima, too: searches that may take seconds.
        options: of `MeasureOptions`, by name: `edges`, `force_limit`, `torque_limits`, `settings`, `jobs`.

    Raises:
        InputError: a point, length, number of edges, limit or name that cannot be.
    """
    for key in only or ():
        if key not in MEASURE_KEYS:
            raise unknown_name("measure", key, MEASURE_KEYS, field="only")
    given, scale = MeasureOptions(**options), WrenchScale.of(grasp, about, length)
    check_limits(grasp, given.torque_limits)
    usual = benchmark_scale(grasp)
    point, arm = scale.about if about is not None else usual.about, scale.length if length is not None else usual.length
    asked = MeasuredGrasp(grasp, scale, WrenchScale(point, arm), **vars(given))
    wanted = [m for m in CATALOGUE if (m.key in only if only is not None else passive or m.key != PASSIVE)]
    values = tuple(_measured(m, asked) for m in wanted)
    found = asked.__dict__  # what the measures have asked for is kept there
    return Measures(
        grasp,
        scale,
        asked.energy_scale,
        asked.edges,
        float(asked.force_limit),
        values,
        found.get("passive"),
        found.get("chosen"),
    )


@kinds_checked
def measure_columns(grasp: Grasp, **options: Any) -> dict[str, float | bool | None]:
    """`measure(grasp, **options).columns()`: a flat row, for tables of many grasps."""
    return measure(grasp, **options).columns()


def _measured(m: Measure, asked: MeasuredGrasp) -> MeasuredValue:
    try:
        value = m.value(asked)
    except NotMeasured as reason:
        return MeasuredValue(m, None, str(reason))
    return MeasuredValue(m, value, _note(m, value, asked))


def _note(m: Measure, value: float | bool, asked: MeasuredGrasp) -> str:
    """What is to be said beside a value."""
    if m.key == PASSIVE:
        lower, upper = asked.passive.worst
        if not np.isfinite(lower):
            return "any wrench is resisted"
        more = f", at most {upper:.4g}" if np.isfinite(upper) else ", or more"
        return asked.passive.worst_direction + (more if lower < (1 - SHOWN_BOUNDS_GAP) * upper else "")
    if m.assumes == RIGID_JOINTS and asked.grasp.has_laws:
        return "friction, springs and stops of its joints are left out"
    if m.key == "smallest_forces" and not np.isfinite(value):
        return "some wrench is not balanced by any"
    if m.key == "pgr" and value > 0:
        named = [[str(i) for i, s in enumerate(asked.robust[1]) if s == kind] for kind in (SLIDES, LOST)]
        words = zip(("sliding", "lost"), named, strict=True)
        return "; ".join(f"contact{'s' * (len(which) > 1)} {', '.join(which)} {what}" for what, which in words if which)
    return ""


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
