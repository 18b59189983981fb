"""One grasp asked again and again: `prepare`, then `check`, `maximum`, `torques`, `hold`, `map`, of one load or many.

What belongs to grasp, limits and commands is reduced once. A load is first tried by Newton's method from the states of
the loads before it, in the compiled kernel, and by the certificate of the last load that slipped, which often proves
as much of loads near it; only where both fail is there a search. What holds is judged by the equations (`judge.py`).
What slips is replayed by the checker. `batch.py` says how many loads are answered.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, overload

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import kinds_checked
from handfast.model.grasp import Grasp
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer, check, maximum, torques
from handfast.stability.answers.batch_answer import AnswerRows, BatchAnswer
from handfast.stability.answers.check_query import check_along, is_table
from handfast.stability.answers.load_path import comes_after
from handfast.stability.answers.max_query import largest_along
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.objective import ANY_STATE, Effort
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search.proof import Proof
from handfast.stability.studies import hold as holding
from handfast.stability.studies import maps
from handfast.stability.studies.batch import Query, RowQuestion, answer_rows, as_base, as_rows
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.maps import MapAnswer, Plane
from handfast.stability.studies.row_kernel import RowKernel

NEAR = 0.2  # of a load: how far another one is from it at most for which its certificate is tried
MOST_LEAVES = 100  # of such a certificate: with more a search takes no longer

One = Sequence[float] | Array
Many = Loads | Sequence[Sequence[float]] | Sequence[Array]


class PreparedGrasp:
    """A grasp that is asked again and again, made by `prepare`; not for two threads at a time.

    Each question takes one load, (6,) force [N] and torque [N m], object frame, or (3,) a force at its origin, and
    gives an answer; or many, (n, 6), (n, 3) or `Loads`, and gives a `BatchAnswer` with a row for each.

    Attributes:
        grasp: with the preload in force; see `preload`.
        limits: of every question. settings: of the searches. loading: do loads come with the commands, or after them?
    """

    def __init__(
        self,
        grasp: Grasp,
        limits: GraspLimits = NO_LIMITS,
        settings: Settings | None = None,
        loading: Loading = "together",
    ) -> None:
        limits.check_backdrivable(grasp)
        comes_after(loading)
        self.grasp, self.limits, self.settings, self.loading = grasp, limits, settings or Settings(), loading
        self._kernel = RowKernel(limits)
        self._slipped: Proof | None = None  # of the last load that was searched for

    def preload(self, preload: Mapping[str, float] | Array | None) -> None:
        """Let other commands be in force: by actuator name, or (a,) [N m or N]; absent ones are locked.

        As long as the same actuators are commanded in the same sense, what was prepared for `check` is kept.

        Raises:
            InputError: an unknown actuator, numbers that are not finite, a backdrivable motor's command beyond its
                limit. What was in force stays in force then.
        """
        grasp = self.grasp.with_preload(preload)
        self.limits.check_backdrivable(grasp)
        self._kernel.forget_maxima()
        self.grasp, self._slipped = grasp, None

    @overload
    def check(self, wrench: One) -> CheckAnswer: ...
    @overload
    def check(self, wrench: Many) -> BatchAnswer: ...
    def check(self, wrench: Any) -> CheckAnswer | BatchAnswer:
        """Is this load resisted, or which of these are? What Newton's method found is judged by the equations alone.

        Raises:
            InputError: see `handfast.check`.
        """
        if is_table(wrench):
            return self._rows("check", wrench, "wrenches")
        if self.loading != "together":
            return self._kernel.paths.answer(check_along, self.grasp, scaled_problem.as_wrench(wrench), self.settings)
        start = time.perf_counter()
        w = scaled_problem.as_wrench(wrench)
        backing: dict[str, Any] = {"verified": True}
        backing["posed"] = BoundProblem(partial(scaled_problem.build, self.grasp, w, limits=self.limits), ANY_STATE)
        unbalanced = scaled_problem.unbalanced(self.grasp, w)  # `check` refuses these
        slipped = None if unbalanced else self._slipped_near(w)
        few = slipped is not None and slipped.certificate is not None and len(slipped.certificate.leaves) <= MOST_LEAVES
        proof = slipped.under(w, time.monotonic() + self.settings.timeout) if slipped and few else None
        if proof is not None:
            cost = time.perf_counter() - start, 0
            return CheckAnswer(Verdict.SLIPS, Stop.COMPLETE, *cost, None, proof, **backing)
        searched = unbalanced or slipped or len(self.grasp.soft)
        found = None if searched else self._kernel.state(self.grasp, w, self.settings)
        if found is not None:
            witness = Witness(self.grasp, w, found[0], self.limits.eta, True)
            cost = time.perf_counter() - start, found[1]
            return CheckAnswer(Verdict.HOLDS, Stop.COMPLETE, *cost, witness, None, **backing)
        answer = check(self.grasp, w, limits=self.limits, settings=self.settings)
        slips = answer.verdict is Verdict.SLIPS and answer.verified and answer.certificate is not None
        self._slipped = answer.proof if slips else None
        return answer

    def _slipped_near(self, w: Array) -> Proof | None:
        """The proof of the last load that was searched for, if that slipped and is near a load (6,)."""
        last = self._slipped
        if last is None or last.certificate is None or not self.settings.verify:
            return None
        before = last.certificate.question.wrench
        near = np.linalg.norm(w - before) <= NEAR * np.linalg.norm(before)
        return last if near else None

    @overload
    def maximum(self, direction: One, *, base: One | None = ..., interval: bool = ...) -> MaxAnswer: ...
    @overload
    def maximum(self, direction: Many, *, base: Any = ..., interval: bool = ...) -> BatchAnswer: ...
    def maximum(self, direction: Any, *, base: Any = None, interval: bool = False) -> MaxAnswer | BatchAnswer:
        """The largest disturbance along a direction, or along each of these, see `handfast.maximum`."""
        if is_table(direction):
            return self._rows("max", direction, "directions", base=base, interval=interval)
        asked: dict[str, Any] = {"base": base, "interval": interval}
        if comes_after(self.loading, **asked):
            d = scaled_problem.as_direction(direction)
            return self._kernel.paths.answer(largest_along, self.grasp, d, self.settings)
        return maximum(self.grasp, direction, limits=self.limits, settings=self.settings, **asked)

    @overload
    def torques(
        self, wrench: One, *, objective: Effort = ..., actuators: Sequence[str] | None = ...
    ) -> TorquesAnswer: ...
    @overload
    def torques(
        self, wrench: Many, *, objective: Effort = ..., actuators: Sequence[str] | None = ...
    ) -> BatchAnswer: ...
    def torques(
        self, wrench: Any, *, objective: Effort = "max", actuators: Sequence[str] | None = None
    ) -> TorquesAnswer | BatchAnswer:
        """The least commands that resist a load, or each of these, see `handfast.torques`."""
        asked: dict[str, Any] = {"objective": objective, "actuators": actuators}
        if is_table(wrench):
            return self._rows("torques", wrench, "wrenches", **asked)
        return torques(self.grasp, wrench, **self._options, **asked)

    def hold(self, loads: Loads, **how: Any) -> HoldAnswer:
        """One preload for all of the loads; how: see `handfast.hold`."""
        return holding.hold(self.grasp, loads, **self._options, **how)

    def map(self, plane: Plane = "xy", **how: Any) -> MapAnswer:
        """The largest resisted force in every direction of a plane; how: see `handfast.force_map`."""
        return maps.force_map(self.grasp, plane, **self._options, **how)

    @property
    def _options(self) -> dict[str, Any]:
        return {"limits": self.limits, "settings": self.settings, "loading": self.loading}

    def _rows(self, query: Query, wrenches: Any, field: str, *, base: Any = None, **options: Any) -> BatchAnswer:
        W, asked = as_rows(wrenches, 1, field), RowQuestion(query=query, **self._options, **options).of_rows()
        comes_after(self.loading, base=base)
        part = answer_rows(self.grasp, AnswerRows(W[0], as_base(base, W)[0]), asked, self._kernel)
        return BatchAnswer.of(query, W[0], [part], interval=asked.interval)


@kinds_checked
def prepare(
    grasp: Grasp,
    *,
    preload: Mapping[str, float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    settings: Settings | None = None,
    loading: Loading = "together",
) -> PreparedGrasp:
    """A grasp to be asked again and again, as in a controller: `prepared.check(wrench)`.

    Args:
        preload: commands in force; those of the grasp by default. `PreparedGrasp.preload` changes them.
        limits: as in `check`.
        settings: as in `check`.
        loading: as in `check`; on paths the state of the commands alone is found once, for all loads.

    Raises:
        InputError: see `check`.
    """
    return PreparedGrasp(grasp if preload is None else grasp.with_preload(preload), limits, settings, loading)
