"""One grasp asked again and again: `prepare`, then `check`, `maximum`, `torques`, `hold`, `map`, of one load or many.

`questions.py` has the same questions as functions, one line each on top of it: a prepared grasp's first answer is
theirs. What belongs to grasp, limits and commands is reduced once, for the second load. From then on a load is first
tried by Newton's method from the states of the loads before it, in the compiled kernel, and by the certificate of the
last load that slipped, which often proves as much of loads near it; only where both fail is there a search.

One rule for all answers about one load: with `settings.verify` what is said is proved before it is said, states that
hold (`Answer.settled`) and certificates of what slips. Without, a state is judged by the equations (`judge.py`), and
proved where the answer is asked for `exact`, or saved. `batch.py` says how many loads are answered.
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
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer, check_query, torques_query
from handfast.stability.answers.batch_answer import AnswerRows, BatchAnswer
from handfast.stability.answers.check_query import check_along
from handfast.stability.answers.load_path import comes_after
from handfast.stability.answers.max_query import largest, largest_along
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.objective import ANY_STATE, Effort
from handfast.stability.problem.settings import Loading, OnStep, Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search.proof import Proof
from handfast.stability.search.solve import clock_of
from handfast.stability.studies import hold as holding
from handfast.stability.studies import maps
from handfast.stability.studies.batch import Query, RowQuestion, answer_rows, as_base, as_rows, is_table, kernel_of
from handfast.stability.studies.hold import HoldAnswer, HoldOptions, OnSample
from handfast.stability.studies.maps import MapAnswer, Plane

NEAR_LOAD = 0.2  # of a load: how far another one is from it at most for which its certificate is tried
MAX_CERTIFICATE_LEAVES = 100  # of such a certificate: with more a search takes no longer

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
        self._kernel = kernel_of(limits)
        self._slipped: Proof | None = None  # of the last load that was searched for
        self._asked_before = False  # nothing is prepared for a single load: a search takes no longer

    def __setattr__(self, name: str, value: object) -> None:
        if name == "preload":  # it would hide the method, and the old commands stay in force
            raise AttributeError("preload is a method: call prepared.preload({...})")
        super().__setattr__(name, value)

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
    def check(self, wrench: One, *, mdp: bool = ..., on_progress: OnStep | None = ...) -> CheckAnswer: ...
    @overload
    def check(self, wrench: Many, *, mdp: bool = ...) -> BatchAnswer: ...
    def check(self, wrench: Any, *, mdp: bool = True, on_progress: OnStep | None = None) -> CheckAnswer | BatchAnswer:
        """Is this load resisted, or which of these are? See `handfast.check`.

        What is said is proved first; with `settings.verify=False` a state is judged by the equations alone, and
        proved when the answer is asked for `exact`, or saved.
        """
        if is_table(wrench):
            return self._rows("check", wrench, "wrenches", mdp=mdp)
        w = scaled_problem.as_wrench(wrench)
        if comes_after(self.loading, mdp):
            return self._kernel.paths.answer(check_along, self.grasp, w, self.settings, on_progress)
        found = self._without_search(w) if mdp and self._asked_before else None
        if found is not None:
            return found
        answer = check_query.ask(self.grasp, w, mdp=mdp, on_progress=on_progress, **self._options)
        self._asked_before |= mdp
        slips = mdp and answer.verdict is Verdict.SLIPS and answer.verified and answer.certificate is not None
        self._slipped = answer.proof if slips else None
        return answer

    def _without_search(self, w: Array) -> CheckAnswer | None:
        """The answer by the certificate of the last load, or by Newton's method; None where neither gives one."""
        if scaled_problem.unbalanced(self.grasp, w):  # `check` refuses these
            return None
        start, clock = time.perf_counter(), clock_of(self.settings)
        posed = BoundProblem(partial(scaled_problem.build, self.grasp, w, limits=self.limits), ANY_STATE)
        backing: dict[str, Any] = {"verified": True, "posed": posed}
        slipped = self._slipped_near(w)
        if slipped is not None:
            few = slipped.certificate is not None and len(slipped.certificate.leaves) <= MAX_CERTIFICATE_LEAVES
            proof = slipped.under(w, clock.end) if few else None
            cost = time.perf_counter() - start, 0
            return CheckAnswer(Verdict.SLIPS, Stop.COMPLETE, *cost, None, proof, **backing) if proof else None
        found = None if len(self.grasp.soft) else self._kernel.state(self.grasp, w, self.settings)
        if found is None:
            return None
        witness = Witness(self.grasp, w, found[0], self.limits.eta, True)
        cost = time.perf_counter() - start, found[1]
        answer = CheckAnswer(Verdict.HOLDS, Stop.COMPLETE, *cost, witness, None, **backing)
        answer = answer.settled(clock.end) if self.settings.verify else answer
        return answer if answer.verdict is Verdict.HOLDS else None

    def _slipped_near(self, w: Array) -> Proof | None:
        """The proof of the last load that was searched for, if that slipped and is near a load (6,)."""
        last = self._slipped
        if last is None or last.certificate is None or not self.settings.verify:
            return None
        before = last.certificate.question.wrench
        near = np.linalg.norm(w - before) <= NEAR_LOAD * np.linalg.norm(before)
        return last if near else None

    @overload
    def maximum(
        self,
        direction: One,
        *,
        base: One | None = ...,
        mdp: bool = ...,
        interval: bool = ...,
        on_progress: OnStep | None = ...,
    ) -> MaxAnswer: ...
    @overload
    def maximum(self, direction: Many, *, base: Any = ..., mdp: bool = ..., interval: bool = ...) -> BatchAnswer: ...
    def maximum(
        self,
        direction: Any,
        *,
        base: Any = None,
        mdp: bool = True,
        interval: bool = False,
        on_progress: OnStep | None = None,
    ) -> MaxAnswer | BatchAnswer:
        """The largest disturbance along a direction, or along each of these, see `handfast.maximum`."""
        asked: dict[str, Any] = {"base": base, "interval": interval, "mdp": mdp}
        if is_table(direction):
            return self._rows("max", direction, "directions", **asked)
        if comes_after(self.loading, **asked):
            d = scaled_problem.as_direction(direction)
            return self._kernel.paths.answer(largest_along, self.grasp, d, self.settings, on_progress)
        w = np.zeros(6) if base is None else base
        p = scaled_problem.build(self.grasp, w, direction, limits=self.limits, mdp=mdp)
        return largest(p, self.settings, on_progress, interval=interval)

    @overload
    def torques(
        self,
        wrench: One,
        *,
        objective: Effort = ...,
        actuators: Sequence[str] | None = ...,
        on_progress: OnStep | None = ...,
    ) -> TorquesAnswer: ...
    @overload
    def torques(
        self, wrench: Many, *, objective: Effort = ..., actuators: Sequence[str] | None = ...
    ) -> BatchAnswer: ...
    def torques(
        self,
        wrench: Any,
        *,
        objective: Effort = "max",
        actuators: Sequence[str] | None = None,
        on_progress: OnStep | None = None,
    ) -> TorquesAnswer | BatchAnswer:
        """The least commands that resist a load, or each of these, see `handfast.torques`."""
        asked: dict[str, Any] = {"objective": objective, "actuators": actuators}
        if is_table(wrench):
            return self._rows("torques", wrench, "wrenches", **asked)
        return torques_query.ask(self.grasp, wrench, on_progress=on_progress, **self._options, **asked)

    def hold(self, loads: Loads, *, on_progress: OnSample | None = None, **how: Any) -> HoldAnswer:
        """One preload for all of the loads; how: see `handfast.hold`."""
        return holding.ask(self.grasp, loads, HoldOptions(**self._options, **how), on_progress)

    def map(self, plane: Plane = "xy", **how: Any) -> MapAnswer:
        """The largest resisted force in every direction of a plane; how: see `handfast.force_map`."""
        return maps.ask_map(self.grasp, plane, **self._options, **how)

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
