"""One grasp asked again and again while its load and its preload change: `prepare`, then `holds` and `maximum`.

What belongs to grasp, limits and the choice of commanded actuators is reduced once. A load is first tried by Newton's
method from the states of the loads before it, in the compiled kernel; only where that fails is there a search. What
holds is judged by the equations (`batch_judge.py`). What slips is asked once more by `check`, for its certificate and
the replay, which takes many times as long.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import kinds_checked
from handfast.core.groups import table
from handfast.model.grasp import Grasp
from handfast.proofs.certificate import Certificate
from handfast.stability import scaled_problem
from handfast.stability.batch_judge import Judge
from handfast.stability.goal import ANY_STATE
from handfast.stability.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.least_motion import least_motion
from handfast.stability.model import State
from handfast.stability.queries import CheckAnswer, MaxAnswer, check, maximum
from handfast.stability.search.arrays import HARD, HELD, UNASKED, QuestionRows
from handfast.stability.search.batch_search import BatchSearch
from handfast.stability.search.template import Template
from handfast.stability.settings import Settings
from handfast.stability.witness import VALID, Witness

MEMORY = 8  # states of loads before


@dataclass(frozen=True, eq=False)
class PreparedAnswer:
    """Does the prepared grasp resist a load? True where it HOLDS.

    Attributes:
        verdict: HOLDS with a state, SLIPS with a certificate, else UNDECIDED.
        wrench: (6,) the load [N, N m], object frame.
        grasp: with the preload in force.
        found: an exact state of the model, as it was found; None unless HOLDS.
        certificate: of a load that slips; replayed, unless that was switched off.
        stop: why the search ended. nodes, seconds: its cost.
        limits: as asked.
    """

    verdict: Verdict
    wrench: Array
    grasp: Grasp = field(repr=False)
    found: Witness | None = field(repr=False)
    certificate: Certificate | None = field(repr=False)
    stop: Stop
    nodes: int
    seconds: float
    limits: GraspLimits = field(repr=False)

    def __bool__(self) -> bool:
        return self.verdict is Verdict.HOLDS

    @cached_property
    def witness(self) -> Witness | None:
        """The state of least motion with what it answers for, see `least_motion`; sought when it is read."""
        if self.found is None:
            return None
        return least_motion(self.found, self.limits)

    @property
    def state(self) -> State | None:
        """That of the witness."""
        return self.witness.state if self.witness else None

    @property
    def residual(self) -> float:
        """The worst of the witness, by the equations alone; NaN without one."""
        return self.witness.residuals.worst if self.witness else np.nan


class PreparedGrasp:
    """A grasp whose loads are asked about one after the other, made by `prepare`; not for two threads at a time.

    Attributes:
        grasp: with the preload in force; see `preload`.
        settings: of the searches.
    """

    def __init__(self, grasp: Grasp, limits: GraspLimits, settings: Settings) -> None:
        self.grasp, self.settings, self._limits = grasp, settings, limits
        self._kernels: dict[bytes, _Kernel] = {}
        self._kernel = self._prepared(grasp)

    def preload(self, preload: Mapping[str, float] | Array | None) -> None:
        """Let other commands be in force: by actuator name, or (a,) [N m or N]; absent ones are locked.

        As long as the same actuators are commanded in the same sense, what was prepared is kept.

        Raises:
            InputError: an unknown actuator, numbers that are not finite, a backdrivable motor's command beyond its
                limit. What was in force stays in force then.
        """
        grasp = self.grasp.with_preload(preload)
        self._kernel = self._prepared(grasp)
        self.grasp = grasp

    def holds(self, wrench: Sequence[float] | Array) -> PreparedAnswer:
        """Is this load resisted? (6,) force [N] and torque [N m], object frame, or (3,) a force at its origin.

        Raises:
            InputError: see `check`.
        """
        start = time.perf_counter()
        w = scaled_problem.as_wrench(wrench)
        refused = scaled_problem.unbalanced(self.grasp, w)  # `check` says why
        found = self._kernel.ask(self.grasp, w) if self._kernel and not refused else None
        if found is not None and found[1] <= VALID:
            state = Witness(self.grasp, w, found[0], self._limits.eta, True)
            return self._said(Verdict.HOLDS, w, start, state, None, Stop.COMPLETE, found[2])
        answer: CheckAnswer = check(self.grasp, w, settings=self.settings, limits=self._limits)
        return self._said(answer.verdict, w, start, answer.found, answer.certificate, answer.stop, answer.nodes)

    def maximum(self, direction: Sequence[float] | Array, **options: Any) -> MaxAnswer:
        """The largest disturbance along a direction, see `handfast.maximum`; options: `base`, `interval`."""
        return maximum(self.grasp, direction, settings=self.settings, limits=self._limits, **options)

    def _said(
        self,
        verdict: Verdict,
        w: Array,
        start: float,
        found: Witness | None,
        certificate: Certificate | None,
        stop: Stop,
        nodes: int,
    ) -> PreparedAnswer:
        seconds = time.perf_counter() - start
        return PreparedAnswer(verdict, w, self.grasp, found, certificate, stop, nodes, seconds, self._limits)

    def _prepared(self, grasp: Grasp) -> _Kernel | None:
        """What is prepared for the commanded actuators and their senses; None with soft fingers, which are searched."""
        self._limits.check_backdrivable(grasp)
        if len(grasp.soft):
            return None
        key = np.sign(grasp.command).tobytes()
        if key not in self._kernels:
            self._kernels[key] = _Kernel(grasp, self._limits, self.settings)
        return self._kernels[key]


@kinds_checked
def prepare(
    grasp: Grasp,
    *,
    preload: Mapping[str, float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    settings: Settings | None = None,
) -> PreparedGrasp:
    """A grasp to be asked again and again, as in a controller: `prepared.holds(wrench)`.

    Args:
        preload: commands in force; those of the grasp by default. `PreparedGrasp.preload` changes them.
        limits: as in `check`.
        settings: as in `check`.

    Raises:
        InputError: see `check`.
    """
    return PreparedGrasp(grasp if preload is None else grasp.with_preload(preload), limits, settings or Settings())


class _Kernel:
    """The kernel's arrays for one choice of commanded actuators, with the states found last."""

    def __init__(self, grasp: Grasp, limits: GraspLimits, settings: Settings) -> None:
        self.template = Template.of(scaled_problem.build(grasp, np.zeros(6), limits=limits), ANY_STATE)
        self._search, self._next = BatchSearch(self.template, settings), 0
        self._judge = Judge(grasp, eta=limits.eta)
        self._rows: QuestionRows | None = None

    def ask(self, grasp: Grasp, w: Array) -> tuple[State, float, int] | None:
        """A state, its worst residual, and the nodes that it took; None if none was found."""
        loads = self.template.loads(w[None], None, grasp)
        if not loads.solvable[0]:
            return None
        if self._rows is None:
            row = self.template.rows(loads)
            many = {name: np.repeat(x, MEMORY + 1, axis=0) for name, x in row._asdict().items()}
            many |= {"mix": row.mix, "plain": row.plain, "noise": row.noise}
            self._rows = QuestionRows(**many)
            self._rows.status[:] = HARD
            self._lines = table(self._rows)
        rows = self._rows
        for name, values in self.template.posed(loads).items():
            getattr(rows, name)[MEMORY] = values[0]
        rows.status[MEMORY] = UNASKED
        self._search.run(rows, self._lines)
        if rows.status[MEMORY] != HELD:
            return None
        states, _ = self.template.states(loads, rows.z[MEMORY:])
        residual = float(self._judge.worst(w[None], states, grasp.command[None])[0])
        rows.load[self._next], rows.z[self._next], rows.status[self._next] = rows.load[MEMORY], rows.z[MEMORY], HELD
        self._next = (self._next + 1) % MEMORY
        return states.row(0), residual, int(rows.nodes[MEMORY])
