"""Runs the compiled kernel over many questions about one grasp: what becomes of each, without Python in between."""

from __future__ import annotations

from dataclasses import dataclass

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.groups import table
from handfast.stability.batch_judge import StateRows
from handfast.stability.search.arrays import CHILDREN, HARD, HELD, NONE, UNASKED, QuestionRows
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.search import SLICE, SPARE, SearchWorker, new_pool
from handfast.stability.search.template import LoadRows, Template
from handfast.stability.settings import Settings

INSIDE = 1e-3  # of the gap, as in `front`
BUDGET = 2048  # nodes that are expanded for one question before it is left to a whole search
TRIED = 2  # boxes where its programs begin


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
