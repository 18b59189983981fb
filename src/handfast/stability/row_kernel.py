"""Rows about one grasp answered by the compiled kernel together; what belongs to the grasp is made once and kept."""

from __future__ import annotations

import time
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.batch_judge import Judge, StateRows
from handfast.stability.goal import ANY_STATE, FARTHER, NEAR_END, SMALLEST_PRELOAD, Goal
from handfast.stability.grasp_limits import GraspLimits
from handfast.stability.idle_joints import runs_away
from handfast.stability.queries.max_query import max_goal
from handfast.stability.search.batch_search import BatchSearch, FoundRows
from handfast.stability.search.template import LoadRows, Template
from handfast.stability.settings import Settings
from handfast.stability.witness import VALID

Settled = tuple[dict[str, Any], Mask]  # columns, and the rows (k,) that they answer


class RowKernel:
    """Asks the kernel many rows about one grasp under its preload; templates are made at the first row of a goal.

    Attributes:
        grasp: with the preload in force. limits: as `check` has them.
    """

    def __init__(self, grasp: Grasp, limits: GraspLimits) -> None:
        self.grasp, self.limits = grasp, limits
        self._judge = Judge(grasp, eta=self.limits.eta)
        self._searches: dict[tuple[Goal, float], BatchSearch] = {}

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
        if template.reduced.goal == SMALLEST_PRELOAD and not settings.verify and found.none.any():
            self._slipping(columns, settled, np.flatnonzero(found.none), W, B, settings)
        columns.setdefault("stop", np.full(len(W), str(Stop.COMPLETE)))
        columns["seconds"] = np.full(len(W), (time.monotonic() - start) / len(W))
        return columns, settled

    def _search(self, goal: Goal, w: Array, base: Array, settings: Settings, reach: float = 0.0) -> BatchSearch | None:
        """The search for a goal, made for the first row; None where that is refused, or another goal's."""
        if (goal, reach) not in self._searches:
            of_max = goal != ANY_STATE
            try:
                p = scaled_problem.build(self.grasp, base if of_max else w, w if of_max else None, limits=self.limits)
                if of_max and max_goal(p) != goal:
                    return None
                self._searches[goal, reach] = BatchSearch(Template.of(p, goal, reach), settings)
            except (InputError, ValueError):  # its first row is asked alone, and says what is wrong
                return None
        search = self._searches[goal, reach]
        search.limit(settings)
        return search

    def _checks(
        self, template: Template, loads: LoadRows, found: FoundRows, W: Array, B: Array, settings: Settings
    ) -> Settled:
        """Columns of these checks, and which rows are settled: what slips is replayed, unless that is switched off.

        Where the limit of nodes was reached, a whole search would reach it as well.
        """
        residual = self._residuals(found.held, W, found.states)
        held = found.held & (residual <= VALID)
        slips = found.none & (not settings.verify)
        limited = found.hard & (found.nodes >= settings.node_limit)
        verdict = np.select([held, limited], [str(Verdict.HOLDS), str(Verdict.UNDECIDED)], str(Verdict.SLIPS))
        columns = {
            "verdict": verdict,
            "residual": np.where(held, residual, np.nan),
            "verified": held,
            "nodes": found.nodes,
            "stop": np.where(limited, str(Stop.NODES), str(Stop.COMPLETE)),
        }
        return columns, held | slips | limited

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
        residual = self._residuals(good, B + np.where(good, lower, 0.0)[:, None] * W, states)
        good &= residual <= VALID
        verdict = np.full(len(W), str(Verdict.HOLDS))
        upper = np.where(unbounded | found.at_end, np.inf, upper)
        columns = {"verdict": verdict, "lower": lower, "upper": upper, "unbounded": unbounded, "residual": residual}
        return columns | {"verified": unbounded, "nodes": found.nodes}, good

    def _slipping(
        self, columns: dict[str, Any], settled: Mask, none: Indices, W: Array, B: Array, settings: Settings
    ) -> None:
        """Settle those of the rows without a state (none) that have none either at any magnitude, however small.

        A search ends at commands that are some ten thousand times as large as the load, and some smaller loads may
        be resisted: see `solve.without_end`. What it would find there, or not, is left to it.
        """
        search = self._search(SMALLEST_PRELOAD, W[0], B[0], settings, 1.0 if self._runs_away else FARTHER)
        if search is None:
            return
        found = search.ask(search.template.loads(B[none], W[none]))
        columns["nodes"][none] += found.nodes
        slips = none[found.none]
        settled[slips] = True
        said = {"verdict": str(Verdict.SLIPS), "residual": np.nan, "verified": False}
        for name, value in (said | {"lower": 0.0, "upper": 0.0, "unbounded": False}).items():
            columns[name][slips] = value

    def _residuals(self, there: Mask, W: Array, states: StateRows) -> Array:
        """(k,) the worst residuals of those states that are there, NaN for the others."""
        out = np.full(len(W), np.nan)
        if there.any():
            out[there] = self._judge.worst(W[there], states.rows(there))
        return out

    @cached_property
    def _runs_away(self) -> bool:
        return runs_away(self.grasp)


def _times(x: StateRows, s: Array) -> StateRows:
    """States times (k,) numbers: with load and commands times these they solve the model again."""
    return StateRows(*(s[:, None] * y for y in (x.r, x.q, x.c, x.f, x.coupling, x.reaction)))
