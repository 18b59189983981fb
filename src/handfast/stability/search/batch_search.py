"""Runs the compiled kernel over many questions about one grasp: what becomes of each, without Python in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.groups import table
from handfast.model.grasp import Grasp
from handfast.stability.batch_judge import StateRows
from handfast.stability.search.arrays import CHILDREN, HARD, HELD, NONE, UNASKED, QuestionRows
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.search import SLICE, SPARE, SearchWorker, new_pool
from handfast.stability.search.template import LoadRows, Template
from handfast.stability.settings import Settings

INSIDE = 1e-3  # of the gap, as in `front`
BUDGET = 2048  # nodes that are expanded for one question before it is left to a whole search
TRIED = 2  # boxes where its programs begin
MEMORY = 8  # loads before, whose states are tried first


@dataclass(frozen=True, eq=False)
class FoundRows:
    """What searches of k questions showed.

    Attributes:
        held, none, hard: (k,) bool: a state was found, there is none, or a whole search is needed.
        nodes: (k,).
        states: of those that held; the others' mean nothing. scalar: (k,) theirs, scaled.
        best, cut: (k,) the objective of the state, and no state has a smaller one than the cut.
        at_end: (k,) bool: is the objective at the end of its range?
    """

    held: Mask
    none: Mask
    hard: Mask
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
        self._table = table(self._question)
        room = CHILDREN * (BUDGET + SLICE) + SPARE
        self._worker = SearchWorker.of(r, heap=room)
        self._pool, self._pool_table = new_pool(room, 3 * r.sizes[0] + r.sizes[1], len(r.cost))
        self._tables = self._table, self._worker.table, self._pool_table, *self._worker.workspace.tables
        self._boxes = [r.beginning(box).box for box in r.boxes[:TRIED]]
        self._gaps = r.goal.gaps(settings.gap * (1 - 2 * INSIDE), r.scale)

    def limit(self, settings: Settings) -> None:
        """Let other limits hold for the questions that follow; the gap stays."""
        self.budget = int(min(BUDGET, settings.node_limit))

    def ask(self, loads: LoadRows) -> FoundRows:
        """Answers for these loads, each with what those before it showed."""
        rows = self.template.rows(loads)
        rows.status[~loads.solvable] = HARD
        self.run(rows)
        rows.z[rows.status != HELD] = 0.0
        states, scalar = self.template.states(loads, rows.z)
        status = rows.status
        return FoundRows(
            status == HELD,
            status == NONE,
            status == HARD,
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
        tables = *self._tables, table(rows) if lines is None else lines
        refused = rows.status == HARD
        for box in self._boxes:
            self._question.box[:] = box
            LIBRARY.functions.ask_rows(*tables, *self._gaps, INSIDE * self.gap, self.budget)
            again = (rows.status == HARD) & ~refused & (rows.nodes < self.budget)
            if not again.any():
                return
            rows.status[again] = UNASKED
        rows.status[again] = HARD


class LoadMemory:
    """Loads asked about one after the other, each tried by Newton's method from the states of the `MEMORY` before."""

    def __init__(self, search: BatchSearch) -> None:
        self._search, self._next = search, 0
        self._rows: QuestionRows | None = None

    def ask(self, w: Array, grasp: Grasp) -> tuple[StateRows, int] | None:
        """The state (1 row) that was found for a load (6,), and the nodes that it took; None if none was found.

        grasp: with commands in the senses of the search's.
        """
        template = self._search.template
        loads = template.loads(w[None], None, grasp)
        if not loads.solvable[0]:
            return None
        if self._rows is None:
            row = template.rows(loads)
            many = {name: np.repeat(x, MEMORY + 1, axis=0) for name, x in row._asdict().items()}
            many |= {"mix": row.mix, "plain": row.plain, "noise": row.noise}
            self._rows = QuestionRows(**many)
            self._rows.status[:] = HARD
            self._lines = table(self._rows)
        rows = self._rows
        for name, values in template.posed(loads).items():
            getattr(rows, name)[MEMORY] = values[0]
        rows.status[MEMORY] = UNASKED
        self._search.run(rows, self._lines)
        if rows.status[MEMORY] != HELD:
            return None
        states, _ = template.states(loads, rows.z[MEMORY:])
        rows.load[self._next], rows.z[self._next], rows.status[self._next] = rows.load[MEMORY], rows.z[MEMORY], HELD
        self._next = (self._next + 1) % MEMORY
        return states, int(rows.nodes[MEMORY])
