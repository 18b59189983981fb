"""Rows about one grasp answered by the compiled kernel together; what belongs to the grasp is made once and kept."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array, Mask
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.batch_judge import Judge, StateRows
from handfast.stability.goal import ANY_STATE, NEAR_END, SMALLEST_PRELOAD, Goal
from handfast.stability.queries.max_query import max_goal
from handfast.stability.search.batch_search import BatchSearch, FoundRows
from handfast.stability.search.template import LoadRows, Template
from handfast.stability.settings import Settings
from handfast.stability.witness import VALID

Settled = tuple[dict[str, Any], Mask]  # columns, and the rows (k,) that they answer


class RowKernel:
    """Asks the kernel many rows about one grasp under its preload; templates are made at the first row of a goal.

    Attributes:
        grasp: with the preload in force. limits: `eta`, `torque_limits`, `force_limit`, as `check` has them.
    """

    def __init__(self, grasp: Grasp, limits: Mapping[str, Any]) -> None:
        self.grasp, self.limits = grasp, dict(limits)
        self._judge = Judge(grasp, eta=self.limits["eta"])
        self._searches: dict[Goal, BatchSearch] = {}

    def ask(self, goal: Goal, W: Array, B: Array, settings: Settings) -> Settled | None:
        """Columns of rows (k, 6): loads, or directions with their base loads; None where no row can be asked so."""
        if not len(W):
            return None
        start = time.monotonic()
        of_max = goal != ANY_STATE
        search = self._search(goal, W[0], B[0], settings)
        if search is None:
            return None
        template = search.template
        loads = template.loads(B if of_max else W, W if of_max else None)
        found = search.ask(loads)
        columns, settled = (self._maxima if of_max else self._checks)(template, loads, found, W, B, settings)
        columns["stop"] = np.full(len(W), str(Stop.COMPLETE))
        columns["seconds"] = np.full(len(W), (time.monotonic() - start) / len(W))
        return columns, settled

    def _search(self, goal: Goal, w: Array, base: Array, settings: Settings) -> BatchSearch | None:
        """The search for a goal, made for the first row; None where that is refused, or another goal's."""
        if goal not in self._searches:
            of_max = goal != ANY_STATE
            try:
                p = scaled_problem.build(self.grasp, base if of_max else w, w if of_max else None, **self.limits)
                if of_max and max_goal(p) != goal:
                    return None
                self._searches[goal] = BatchSearch(Template.of(p, goal), settings)
            except (InputError, ValueError):  # its first row is asked alone, and says what is wrong
                return None
        search = self._searches[goal]
        search.limit(settings)
        return search

    def _checks(
        self, template: Template, loads: LoadRows, found: FoundRows, W: Array, B: Array, settings: Settings
    ) -> Settled:
        """Columns of these checks, and which rows are settled: what slips is replayed, unless that is switched off."""
        residual = self._judge.worst(W, found.states)
        held = found.held & (residual <= VALID)
        slips = found.none & (not settings.verify)
        verdict = np.where(held, str(Verdict.HOLDS), str(Verdict.SLIPS))
        residual = np.where(held, residual, np.nan)
        return {"verdict": verdict, "residual": residual, "verified": held, "nodes": found.nodes}, held | slips

    def _maxima(
        self, template: Template, loads: LoadRows, found: FoundRows, W: Array, B: Array, settings: Settings
    ) -> Settled:
        """Columns of these maxima, and which rows are settled: those where a magnitude was found."""
        scale, states = loads.direction_scale, found.states
        with np.errstate(all="ignore"):
            if template.reduced.goal == SMALLEST_PRELOAD:
                lower, upper = scale / found.scalar, scale / found.cut
                states = _times(states, 1.0 / found.scalar)
            else:
                lower, upper = np.maximum(0.0, found.scalar * scale), np.maximum(0.0, -found.cut * scale)
        unbounded = lower >= loads.last_magnitude * (1 - NEAR_END)
        good = found.held & np.isfinite(lower) & (lower > 0)
        residual = self._judge.worst(B + np.where(good, lower, 0.0)[:, None] * W, states)
        good &= residual <= VALID
        verdict = np.full(len(W), str(Verdict.HOLDS))
        upper = np.where(unbounded | found.at_end, np.inf, upper)
        columns = {"verdict": verdict, "lower": lower, "upper": upper, "unbounded": unbounded, "residual": residual}
        return columns | {"verified": unbounded, "nodes": found.nodes}, good


def _times(x: StateRows, s: Array) -> StateRows:
    """States times (k,) numbers: with load and commands times these they solve the model again."""
    return StateRows(*(s[:, None] * y for y in (x.r, x.q, x.c, x.f, x.coupling, x.reaction)))
