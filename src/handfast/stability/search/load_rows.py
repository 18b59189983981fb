"""What all questions about one grasp share, reduced once, and what each load adds to it, worked out for many at once.

Motions, the null space of the equations and their inverse belong to the grasp, its commands and the goal. A load enters
through the right-hand side h of the equations, the scales of forces, and the balance of energy; a disturbance with a
magnitude to be found (`LargestMagnitude`) through one column of E as well. With E = (E0, w_b) and u = -E0+ w_b,

    null space of E = null space of E0, and (u, 1),

which are at right angles. Programs that begin with the magnitude as an unknown of its own break down, so that all
columns of the basis have a part of the last one (`mix`), by a reflection: what a row adds is one column times that.

Of many grasps of one shape (`GraspRows`) all of this is worked out at once, too, for one load of each at a time: the
arrays have one more axis in front, and the kernel is asked row by row.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask, times, transposed, transposed_times
from handfast.core.groups import Block, kinds, table, whole_vectors
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.grasp_rows import AnyGrasp, GraspRows
from handfast.stability.problem.model import StateRows
from handfast.stability.problem.objective import ANY_STATE, HIGHEST, INF, LARGEST_MAGNITUDE, SMALLEST_PRELOAD, Objective
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Settings
from handfast.stability.search.arrays import CHILDREN, HARD, HELD, LIMITED, NONE, UNASKED, QuestionRows, pool_layout
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.reduced import (
    EQUATION_TOLERANCE,
    PERTURBATION,
    Reduced,
    equilibrium,
    noise,
    padded,
    pseudo_inverse,
    reduce,
)
from handfast.stability.search.search import SLICE_NODES, SPARE, WITNESS_INSET, SearchWorker


@dataclass(frozen=True, eq=False)
class LoadRows:
    """Loads base + s along (k, 6) each, and their scales: forces (k,), directions (k,); solvable (k,) bool."""

    base: Array
    along: Array
    force: Array
    direction_scale: Array
    solvable: Mask
    last_column: Array  # (k, ny) of Y, where it is the row's own, else (k, 0)
    y0: Array  # (k, ny)
    last_magnitude: Array  # (k,) see `ScaledProblem`
    grasp: AnyGrasp  # with the commands in force


@dataclass(frozen=True, eq=False)
class Template:
    """The reduced problem of a grasp, or of many, for one goal, of any load.

    Attributes:
        reduced: of some load; E: its equilibrium equations, without the scalar's column where that is the load's.
        inverse: (ny, e) pseudo-inverse of E, filled up with a row of zeros for the scalar.
        mix: (nv,) parts that the columns of the basis have of a row's own one; empty where there is none.
        reach: 0, or of the smallest preload: sought however large, and as many times smaller than searches end.
    """

    reduced: Reduced
    E: Array
    inverse: Array
    mix: Array
    reach: float = 0.0

    @classmethod
    def of(cls, p: ScaledProblem, goal: Objective, reach: float = 0.0) -> Template:
        """From a problem with any load, of which only the commands and limits count."""
        if len(p.soft):
            raise ValueError("soft fingers are asked about one by one")
        r = reduce(p, goal, within=(1.0 / (reach * p.search_end), INF) if reach else None)
        E = equilibrium(p, goal)
        if goal != LARGEST_MAGNITUDE:
            return cls(r, E, r.solve, np.zeros(0), reach)
        bare = E[:, :-1]  # without the scalar, the last of y where there are no efforts
        inverse = np.vstack([np.linalg.pinv(bare, rcond=1e-10), np.zeros(len(E))])
        _, sv, Vt = np.linalg.svd(bare)
        rank = int((sv > 1e-10 * sv[0]).sum())
        Y = np.zeros((bare.shape[1] + 1, bare.shape[1] - rank + 1))
        Y[:-1, :-1] = Vt[rank:].T
        mix = np.full(Y.shape[1], 1.0 / np.sqrt(Y.shape[1]))
        v = np.eye(len(mix))[-1] - mix  # the reflection that takes the last unit vector to it
        if v.any():
            Y -= np.outer(Y @ v, v) * (2.0 / (v @ v))
        if r.M.shape[1] + len(mix) != len(r.cost):
            raise ValueError("a load that the grasp cannot balance is no template")
        forces = r.values @ Y
        C = np.hstack([np.zeros((len(forces), r.M.shape[1])), forces])
        return cls(replace(r, Y=Y, C=C, CT=padded(forces.T)), bare, inverse, mix)

    @classmethod
    def of_grasps(cls, grasps: GraspRows, goal: Objective, limits: GraspLimits, reach: float = 0.0) -> Template:
        """Of many grasps and a goal that adds no column.

        Raises:
            Uneven: the equations of some have a lower rank.
        """
        k = len(grasps.grasps)
        any_load = np.tile(np.eye(6)[0], (k, 1))
        bare = goal == ANY_STATE
        p = scaled_problem.build_rows(grasps, any_load * bare, None if bare else any_load, limits)
        r = reduce(p, goal, within=(0.0, INF if reach else HIGHEST))  # which the rows have their own of
        return cls(r, equilibrium(p, goal), r.solve, np.zeros(0), reach)

    @property
    def problem(self) -> ScaledProblem:
        return self.reduced.p

    @property
    def of_many(self) -> bool:
        """Has each row a grasp of its own?"""
        return self.reduced.C.ndim == 3

    @cached_property
    def _locked(self) -> tuple[Indices, Array]:
        """Actuators whose force the reduction leaves out, and what gives these and couplings of joint torques."""
        p = self.problem
        rest = np.flatnonzero(~(p.moves | np.isfinite(p.f_max)))
        held = np.concatenate([p.R[..., rest, :], p.A], axis=-2)
        return rest, pseudo_inverse(transposed(held)) if held.shape[-2] else np.zeros((0, p.sizes[1]))

    def loads(self, base: Array, along: Array | None, grasp: AnyGrasp) -> LoadRows:
        """Scales and right-hand sides of these loads (k, 6), as `scaled_problem.build` has them, one by one.

        grasp: the template's, or where any state is sought one with other commands in the same senses; or k of them.
        """
        p, r = self.problem, self.reduced
        k = len(base)
        scales = scaled_problem.scales(grasp, p.equivalent, base, along, p.limits)
        lengths = p.lengths
        direction = np.zeros((k, 6)) if along is None else along
        scaled_base = lengths * base / scales.force[:, None]
        scaled_direction = lengths * scales.direction[:, None] * direction / scales.force[:, None]
        if r.goal == SMALLEST_PRELOAD:
            constant, per_scalar = scaled_direction, np.zeros((k, 6))
        else:
            constant, per_scalar = scaled_base, scaled_direction
        h = np.zeros((k, self.E.shape[-2]))
        if r.goal != SMALLEST_PRELOAD:  # where it has the scalar as a factor
            h += times(r.of_torques, self._torques(grasp, scales.force))
        h[:, :6] = -constant
        y0 = times(self.inverse, h)
        wide = self.E.shape[-1]
        solvable = np.abs(times(self.E, y0[:, :wide]) - h).max(axis=1) < EQUATION_TOLERANCE
        column = np.zeros((k, 0))
        if len(self.mix):
            h = np.zeros((k, len(self.E)))
            h[:, :6] = -per_scalar
            column = h @ self.inverse.T
            solvable &= np.abs(column[:, :wide] @ self.E.T - h).max(axis=1) < EQUATION_TOLERANCE
            column[:, -1] = 1.0
            column /= np.linalg.norm(column, axis=1)[:, None]
        return LoadRows(
            base, direction, scales.force, scales.direction, solvable, column, y0, scales.last_magnitude, grasp
        )

    def _torques(self, grasp: AnyGrasp, force: Array) -> Array:
        """(k, l) the given torques under a grasp's commands, scaled by forces (k,)."""
        p = self.problem
        given: Array = p.equivalent.torques_under(grasp.command) / (force[:, None] * p.joint_scale)
        return given

    def _commands(self, grasp: AnyGrasp) -> Array:
        """(a,) a grasp's commands of the equivalent's actuators."""
        same = self.problem.equivalent
        out = np.zeros(self.problem.R.shape[:-1])
        out[..., : len(same.kept)] = grasp.command[..., same.kept]
        return out

    def rows(self, loads: LoadRows) -> QuestionRows:
        """What the kernel asks."""
        r, k = self.reduced, len(loads.base)
        nu, n = r.M.shape[-1], r.cost.shape[-1]
        column, plain = np.zeros((k, 0)), np.zeros((0, 0))
        if len(self.mix):
            column, plain = np.ascontiguousarray(loads.last_column @ r.values.T), np.ascontiguousarray(r.C[:, nu:])
        return QuestionRows(
            **self.posed(loads),
            column=column,
            mix=self.mix,
            plain=plain,
            noise=PERTURBATION * noise(n)[nu:],
            status=np.full(k, UNASKED, np.int64),
            nodes=np.zeros(k, np.int64),
            z=np.zeros((k, n)),
            best=np.zeros(k),
            cut=np.zeros(k),
            at_end=np.zeros(k, np.bool_),
        )

    def posed(self, loads: LoadRows) -> dict[str, Array]:
        """The arrays of `QuestionRows` in which the loads are."""
        p, r = self.problem, self.reduced
        k, F = len(loads.base), r.sizes[2]
        f_c = self._commands(loads.grasp) / (loads.force[:, None] * p.actuator_scale)
        off = np.zeros((k, whole_vectors(F)))
        off[:, :F] = times(r.values, loads.y0)
        if r.goal != SMALLEST_PRELOAD:  # whose commands have the scalar as a factor
            off[:, self._slack] -= f_c[:, r.active]
        lo, hi = (np.repeat(x[None], k, axis=0) for x in (r.lo, r.hi))
        if len(self._limits):
            share = (p.force / loads.force)[:, None]  # scaled forces of the template times this are those of the row
            lo[:, self._limits] *= share
            hi[:, self._limits] *= share
        if r.objective:
            end = loads.last_magnitude / loads.direction_scale
            lo[:, 0], hi[:, 0] = (1.0 / end, HIGHEST) if r.goal == SMALLEST_PRELOAD else (-end, 0.0)
            if self.reach:
                lo[:, 0], hi[:, 0] = 1.0 / (self.reach * end), INF
        energy = np.zeros((k, 0, r.M.shape[-1]))
        if r.names and r.names[-1][0] == "energy":
            energy = self._energy(loads, f_c)
        near = loads.along * loads.direction_scale[:, None] if r.objective else loads.base
        load = near * p.lengths / loads.force[:, None]
        return {"load": load, "off": off, "lo": lo, "hi": hi, "energy": energy}

    @cached_property
    def _slack(self) -> Indices:
        """Which forces are f - f_c."""
        return 3 * self.problem.sizes[0] + 2 * np.arange(len(self.reduced.active))

    @cached_property
    def _limits(self) -> Indices:
        """Which plain bounds are limits of forces."""
        return np.flatnonzero([kind in ("normal", "force") for kind, _ in self.reduced.names])

    def _energy(self, loads: LoadRows, f_c: Array) -> Array:
        """(k, 2, nu) the two parts of the balance of energy over the unknown motions; f_c: (k, a) scaled."""
        p, r = self.problem, self.reduced
        lengths = p.lengths
        D = np.zeros((len(f_c), 2, r.M.shape[-2]))
        if r.goal == SMALLEST_PRELOAD:
            D[:, 0, :6] = lengths * (loads.direction_scale / loads.force)[:, None] * loads.along
            D[:, 1, 6:] = transposed_times(p.R, f_c)
        else:
            D[:, 0, :6] = lengths * loads.base / loads.force[:, None]
            D[:, 0, 6:] = transposed_times(p.R, f_c) + self._torques(loads.grasp, loads.force)
        return np.ascontiguousarray(D @ r.M)

    def states(self, loads: LoadRows, z: Array) -> tuple[StateRows, Array]:
        """Reduced unknowns (k, n) as states in the grasp's units, and the scaled scalars (k,)."""
        p, r = self.problem, self.reduced
        m, _, a, _ = p.sizes
        nu, kept = r.M.shape[-1], r.kept
        x, v = times(r.M, z[:, :nu]), z[:, nu:]
        y = loads.y0 + times(r.Y, v)
        if len(self.mix):
            y += (v @ self.mix)[:, None] * loads.last_column
        c = y[:, : 3 * m]
        f = np.zeros((len(z), a))
        f[:, kept] = y[:, 3 * m : 3 * m + len(kept)]
        rest, inverse = self._locked
        scalar = y[:, 3 * m + len(kept)] if r.objective else np.zeros(len(z))
        share = scalar[:, None] if r.goal == SMALLEST_PRELOAD else np.ones((len(z), 1))
        torques = transposed_times(p.J, c) - transposed_times(p.R, f)
        passed = times(inverse, torques - share * self._torques(loads.grasp, loads.force))
        f[:, rest], coupling = passed[:, : len(rest)], passed[:, len(rest) :]
        force = loads.force[:, None]
        q, forces, couplings, reaction = p.equivalent.parts_of(
            force * x[:, 6:] / p.joint_scale,
            force * f * p.actuator_scale,
            force * coupling * p.coupling_scale,
            None if self.of_many else loads.grasp.command,
            share,
        )
        return StateRows(force * p.lengths * x[:, :6], q, force * c, forces, couplings, reaction), scalar


# --- the kernel's run over such rows ------------------------------------------------------------

BUDGET = 2048  # nodes that are expanded for one question before it is left to a whole search
STARTING_BOXES = 2  # boxes where its programs begin
REMEMBERED_LOADS = 8  # loads before, whose states are tried first


@dataclass(frozen=True, eq=False)
class FoundRows:
    """What searches of k questions showed.

    Attributes:
        held, none, hard: (k,) bool: a state was found, there is none, or a whole search is needed.
        limited: (k,) bool: a whole search would end there, too; the best state is the best so far, if it is finite.
        nodes: (k,).
        states: of those that have one; the others' mean nothing. scalar: (k,) theirs, scaled.
        best, cut: (k,) the objective of the state, and no state has a smaller one than the cut.
        at_end: (k,) bool: is the objective at the end of its range?
    """

    held: Mask
    none: Mask
    hard: Mask
    limited: Mask
    nodes: Indices
    states: StateRows
    scalar: Array
    best: Array
    cut: Array
    at_end: Mask


class BatchSearch:
    """Room for searches of one template, to be used by one thread at a time."""

    def __init__(self, template: Template, settings: Settings) -> None:
        self.template, self.gap = template, settings.gap
        self.limit(settings)
        r = template.reduced
        q = r.question
        copies = {name: getattr(q, name).copy() for name in ("C", "CT", "D", "DT", "off", "lo", "cost", "box")}
        self._question = q._replace(**copies)
        self._lines = tables(self._question)
        room = CHILDREN * (BUDGET + SLICE_NODES) + SPARE
        self._worker = SearchWorker.of(r, heap=room)
        self._tree = pool_layout(room, 3 * r.sizes[0] + r.sizes[1], r.cost.shape[-1])
        self._boxes = [r.beginning(box).box for box in r.boxes[:STARTING_BOXES]]
        self._gaps = r.goal.gaps(settings.gap * (1 - 2 * WITNESS_INSET))

    def limit(self, settings: Settings) -> None:
        """Let other limits hold for the questions that follow; the gap stays."""
        self.budget, self.nodes = int(min(BUDGET, settings.nodes)), float(settings.nodes)

    def ask(self, loads: LoadRows) -> FoundRows:
        """Answers for these loads, each with what those before it showed."""
        rows = self.template.rows(loads)
        rows.status[~loads.solvable] = HARD
        self.run(rows)
        rows.z[~np.isfinite(rows.best)] = 0.0
        states, scalar = self.template.states(loads, rows.z)
        status = rows.status
        return FoundRows(
            status == HELD,
            status == NONE,
            status == HARD,
            status == LIMITED,
            rows.nodes,
            states,
            scalar,
            rows.best,
            rows.cut,
            rows.at_end,
        )

    def run(self, rows: QuestionRows, lines: Indices | None = None) -> None:
        """Let the kernel answer the rows that are unasked; those whose programs break down from another box as well.

        lines: the table of these rows, if there is one.
        """
        of_rows = tables(apart(rows) if self.template.of_many else rows) if lines is None else lines[None]
        refused = rows.status == HARD
        tree = Block(self._tree, _scratch(self._tree.size))
        tables_ = self._worker.table, tree.table, *self._worker.workspace.tables
        for box in self._boxes:
            self._question.box[:] = box
            asked = np.flatnonzero(rows.status == UNASKED).tolist() if self.template.of_many else [0]
            for i in asked:
                ask = (
                    self._lines[i],
                    *tables_,
                    of_rows[i],
                    *self._gaps,
                    WITNESS_INSET * self.gap,
                    self.budget,
                    self.nodes,
                )
                LIBRARY.functions.ask_rows(*ask)
            again = (rows.status == HARD) & ~refused & (rows.nodes < self.budget)
            if not again.any():
                return
            rows.status[again] = UNASKED
        rows.status[again] = HARD


_MEMORY = threading.local()


def _scratch(size: int) -> Array:
    """(size or more,) memory of this thread for one run: pages that are new take longer than most runs."""
    if len(getattr(_MEMORY, "tree", ())) < size:
        _MEMORY.tree = np.empty(size)
    tree: Array = _MEMORY.tree
    return tree


def tables(group: tuple[Any, ...]) -> Indices:
    """(k, fields, LINE) the table of each of k groups; (1, fields, LINE) of one.

    Arrays with as many dimensions as the group declares are the same in all of them, those with one more are k arrays.
    """
    several = [np.ndim(x) > kind.dimensions for x, kind in zip(group, kinds(type(group)).values(), strict=True)]
    first = table(type(group)(*(x[0] if more else x for x, more in zip(group, several, strict=True))))
    count = max((len(x) for x, more in zip(group, several, strict=True) if more), default=1)
    out: Indices = np.repeat(first[None], count, axis=0)
    for field, (x, more) in enumerate(zip(group, several, strict=True)):
        if more:
            out[:, field, 0] += x.strides[0] * np.arange(count)
    return out


def apart(rows: QuestionRows) -> QuestionRows:
    """Rows as groups of one row each, for `tables`."""
    shared = "mix", "plain", "noise"
    return rows._replace(**{name: x[:, None] for name, x in rows._asdict().items() if name not in shared})


class LoadMemory:
    """Loads asked about one after the other, each tried by Newton's method from the states of the `REMEMBERED_LOADS`
    before."""

    def __init__(self, search: BatchSearch) -> None:
        self._search, self._next = search, 0
        self._rows: QuestionRows | None = None

    def ask(self, w: Array, grasp: AnyGrasp) -> tuple[StateRows, int] | None:
        """The state (1 row) that was found for a load (6,), and the nodes that it took; None if none was found.

        grasp: with commands in the senses of the search's.
        """
        template = self._search.template
        loads = template.loads(w[None], None, grasp)
        if not loads.solvable[0]:
            return None
        if self._rows is None:
            row = template.rows(loads)
            many = {name: np.repeat(x, REMEMBERED_LOADS + 1, axis=0) for name, x in row._asdict().items()}
            many |= {"mix": row.mix, "plain": row.plain, "noise": row.noise}
            self._rows = QuestionRows(**many)
            self._rows.status[:] = HARD
            self._lines = table(self._rows)
        rows = self._rows
        for name, values in template.posed(loads).items():
            getattr(rows, name)[REMEMBERED_LOADS] = values[0]
        rows.status[REMEMBERED_LOADS] = UNASKED
        self._search.run(rows, self._lines)
        if rows.status[REMEMBERED_LOADS] != HELD:
            return None
        states, _ = template.states(loads, rows.z[REMEMBERED_LOADS:])
        rows.load[self._next], rows.z[self._next], rows.status[self._next] = (
            rows.load[REMEMBERED_LOADS],
            rows.z[REMEMBERED_LOADS],
            HELD,
        )
        self._next = (self._next + 1) % REMEMBERED_LOADS
        return states, int(rows.nodes[REMEMBERED_LOADS])
