"""Rows about one grasp answered by the compiled kernel together; what belongs to the grasp is made once and kept.

Or about many grasps of one shape, of each one row: what belongs to them is made for all at once. What holds is judged
by the equations; what the kernel does not settle is left to a search of its own.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.proofs.constants import END_TOLERANCE
from handfast.proofs.states import State
from handfast.stability.answers.load_path import PathsFromRest
from handfast.stability.answers.max_query import max_goal
from handfast.stability.problem import judge, scaled_problem
from handfast.stability.problem.equivalent_grasp import runs_away
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.grasp_rows import AnyGrasp, GraspRows
from handfast.stability.problem.model import StateRows
from handfast.stability.problem.objective import ANY_STATE, COMMAND_END_FACTOR, SMALLEST_PRELOAD, Objective
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import VALID
from handfast.stability.search.load_rows import BatchSearch, FoundRows, LoadMemory, LoadRows, Template


class SettledRows(NamedTuple):
    """What the kernel showed of some rows.

    Attributes:
        columns: of `BatchAnswer`, by name. rows: (k,) bool, those that they answer.
        states: (k,) at the lower bounds of maxima; those of other rows mean nothing.
        endless: (k,) bool, maxima that are resisted farther than a search for one goes.
    """

    columns: dict[str, Any]
    rows: Mask
    states: StateRows
    endless: Mask


class RowKernel:
    """Asks the kernel rows about one grasp; what its rows share is reduced for the first row of a goal.

    Attributes:
        limits: as `check` has them.
        paths: of the grasp's loads, where these come after the commands.
    """

    def __init__(self, limits: GraspLimits) -> None:
        self.limits = limits
        self.paths = PathsFromRest(limits)
        self._searches: dict[tuple[Any, ...], BatchSearch] = {}
        self._memories: dict[bytes, LoadMemory] = {}

    def forget_maxima(self) -> None:
        """Before other commands: what was reduced for maxima, and where paths begin, is of these alone."""
        self._searches = {key: search for key, search in self._searches.items() if key[0] == ANY_STATE}
        self.paths = PathsFromRest(self.limits)

    def state(self, grasp: Grasp, w: Array, settings: Settings) -> tuple[State, int] | None:
        """A state that resists a load (6,), from those of the loads before, and its nodes; None if none is found.

        Grasps may differ in the sizes of their commands.
        """
        search = self._search(grasp, ANY_STATE, w, np.zeros(6), settings)
        if search is None:
            return None
        key = np.sign(grasp.command).tobytes()
        if key not in self._memories:
            self._memories[key] = LoadMemory(search)
        found = self._memories[key].ask(w, grasp)
        if found is None:
            return None
        states, nodes = found
        held = judge.residuals(grasp, w[None], states, eta=self.limits.eta).worst[0] <= VALID
        return (states.row(0), nodes) if held else None

    def ask(
        self, grasp: AnyGrasp, goal: Objective, W: Array, B: Array, settings: Settings, *, farther: bool = True
    ) -> SettledRows | None:
        """Columns of rows (k, 6): loads, or directions with their base loads; None where no row can be asked so.

        Args:
            grasp: of all rows, or of each its own.
            farther: may magnitudes beyond the usual end be sought with the others? Without commands that takes no more
                nodes, and shows at once what slips; what is `endless` then is to be asked again without.

        Raises:
            Uneven: the equations of some of many grasps have a lower rank.
        """
        if not len(W):
            return None
        start = time.monotonic()
        of_max = goal != ANY_STATE
        farther &= goal == SMALLEST_PRELOAD and not grasp.command.any() and not settings.verify
        reach = _reach(grasp) if farther else 0.0
        search = self._search(grasp, goal, W[0], B[0], settings, reach)
        if search is None:
            return None
        loads = search.template.loads(B if of_max else W, W if of_max else None, grasp)
        found = search.ask(loads)
        out = (self._maxima if of_max else self._checks)(search.template, loads, found, W, B, settings)
        if farther:
            _slip(out, np.flatnonzero(found.none))
        elif goal == SMALLEST_PRELOAD and not settings.verify and found.none.any():
            self._slipping(out, np.flatnonzero(found.none), grasp, W, B, settings)
        out.columns["seconds"] = np.full(len(W), (time.monotonic() - start) / len(W))
        return out

    def _search(
        self, grasp: AnyGrasp, goal: Objective, w: Array, base: Array, settings: Settings, reach: float = 0.0
    ) -> BatchSearch | None:
        """The search for a goal, made for the first row; None where that is refused, or another goal's."""
        if isinstance(grasp, GraspRows):
            return BatchSearch(Template.of_grasps(grasp, goal, self.limits, reach), settings)
        of_max = goal != ANY_STATE
        commands = grasp.command if of_max else np.sign(grasp.command)
        key = goal, reach, settings.gap, commands.tobytes()
        if key not in self._searches:
            try:
                p = scaled_problem.build(grasp, base if of_max else w, w if of_max else None, limits=self.limits)
                if of_max and max_goal(p) != goal:
                    return None
                self._searches[key] = BatchSearch(Template.of(p, goal, reach), settings)
            except (InputError, ValueError):  # its first row is asked alone, and says what is wrong
                return None
        search = self._searches[key]
        search.limit(settings)
        return search

    def _checks(
        self, template: Template, loads: LoadRows, found: FoundRows, W: Array, B: Array, settings: Settings
    ) -> SettledRows:
        """Columns of these checks, and which rows are settled: what slips is replayed, unless that is switched off.

        Where the limit of nodes was reached, a whole search would reach it as well.
        """
        residual = self._residuals(loads.grasp, found.held, W, found.states)
        held = found.held & (residual <= VALID)
        slips = found.none & (not settings.verify)
        limited = found.hard & (found.nodes >= settings.nodes)
        verdict = np.select([held, limited], [str(Verdict.HOLDS), str(Verdict.UNDECIDED)], str(Verdict.SLIPS))
        columns = {
            "verdict": verdict,
            "residual": np.where(held, residual, np.nan),
            "verified": held,
            "nodes": found.nodes,
            "stop": np.where(limited, str(Stop.NODES), str(Stop.COMPLETE)),
        }
        return SettledRows(columns, held | slips | limited, found.states, np.zeros(len(W), bool))

    def _maxima(
        self, template: Template, loads: LoadRows, found: FoundRows, W: Array, B: Array, settings: Settings
    ) -> SettledRows:
        """Columns of these maxima, and which rows are settled: with a magnitude, or at the limit of a search."""
        scale, states, homogeneous = loads.direction_scale, found.states, template.reduced.goal == SMALLEST_PRELOAD
        limited = found.limited & homogeneous  # else the base load by itself may be resisted
        there = found.held | (limited & np.isfinite(found.best))
        with np.errstate(all="ignore"):
            if homogeneous:
                lower, upper = scale / found.scalar, np.where(found.cut > 0, scale / found.cut, np.inf)
                states = states.times(1.0 / found.scalar)
            else:
                lower, upper = np.maximum(0.0, found.scalar * scale), np.maximum(0.0, -found.cut * scale)
        unbounded = there & (lower >= loads.last_magnitude * (1 - END_TOLERANCE))
        good = there & np.isfinite(lower) & (lower > 0)
        residual = self._residuals(loads.grasp, good, B + np.where(good, lower, 0.0)[:, None] * W, states)
        endless = unbounded & (template.reach > 1.0)
        good &= (residual <= VALID) & ~endless
        none = limited & ~good & ~endless
        lower, residual = np.where(none, 0.0, lower), np.where(none, np.nan, residual)
        verdict = np.where(none, str(Verdict.UNDECIDED), str(Verdict.HOLDS))
        upper = np.where(unbounded | found.at_end, np.inf, upper)
        columns = {"verdict": verdict, "lower": lower, "upper": upper, "unbounded": unbounded & good}
        columns |= {"residual": residual, "verified": unbounded & good, "nodes": found.nodes}
        columns["stop"] = np.where(limited, str(Stop.NODES), str(Stop.COMPLETE))
        return SettledRows(columns, good | none, states, endless)

    def _slipping(
        self, out: SettledRows, none: Indices, grasp: AnyGrasp, W: Array, B: Array, settings: Settings
    ) -> None:
        """Settle those of the rows without a state (none) that have none either at any magnitude, however small.

        A search ends at commands that are some ten thousand times as large as the load, and some smaller loads may
        be resisted: see `solve.without_end`. What it would find there, or not, is left to it.
        """
        grasp = grasp.rows(none) if isinstance(grasp, GraspRows) else grasp
        search = self._search(grasp, SMALLEST_PRELOAD, W[0], B[0], settings, _reach(grasp))
        if search is None:
            return
        found = search.ask(search.template.loads(B[none], W[none], grasp))
        out.columns["nodes"][none] += found.nodes
        _slip(out, none[found.none])

    def _residuals(self, grasp: AnyGrasp, there: Mask, W: Array, states: StateRows) -> Array:
        """(k,) the worst residuals of those states that are there, NaN for the others."""
        out = np.full(len(W), np.nan)
        if there.any():
            grasp = grasp.rows(there) if isinstance(grasp, GraspRows) else grasp
            out[there] = judge.residuals(grasp, W[there], states.rows(there), eta=self.limits.eta).worst
        return out


def _reach(grasp: AnyGrasp) -> float:
    """So many times farther than searches end it is looked for what is resisted of a direction that seems to slip."""
    return 1.0 if isinstance(grasp, Grasp) and runs_away(grasp) else COMMAND_END_FACTOR


def _slip(out: SettledRows, rows: Indices) -> None:
    """Settle rows of which nothing is resisted at any magnitude."""
    out.rows[rows] = True
    said = {"verdict": str(Verdict.SLIPS), "residual": np.nan, "verified": False}
    for name, value in (said | {"lower": 0.0, "upper": 0.0, "unbounded": False}).items():
        out.columns[name][rows] = value
