"""Answers to many questions as arrays: `BatchAnswer`, and the rows that are being answered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.core.presented import Presented
from handfast.stability.answers import MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer

if TYPE_CHECKING:
    from pandas import DataFrame

    from handfast.stability.search.interval_search import ResistedInterval

WRENCH_COLUMNS = ("fx", "fy", "fz", "tx", "ty", "tz")
ANSWER_COLUMNS = ("lower", "upper", "unbounded", "residual", "verified", "nodes", "seconds")
NUMERIC = {"unbounded": np.bool_, "verified": np.bool_, "nodes": np.int64}
INTERRUPTED = "was not asked: Ctrl-C came first"


@dataclass(frozen=True, eq=False)
class BatchAnswer(Presented):
    """What `check_many`, `max_many` and `torques_many` answer: arrays of one shape.

    The shape is (n,) for n loads on one grasp, (g, n) for g grasps.

    Attributes:
        query: "check", "max" or "torques".
        wrenches: (..., 6) what was asked about, force [N] and torque [N m], object frame; of a maximum the directions.
        verdict: "holds", "slips" or "undecided" as text, equal to members of `Verdict`; "" where `error` says why.
        lower, upper: of a maximum as multiples of the direction, as `MaxAnswer` has them; of torques [N m or N]; NaN
            of a check.
        unbounded: of a maximum: resisted as far as the search goes.
        residual: the worst relative residual of the state that was found, by the equations alone; NaN without one.
        stop: why the search ended, as text, equal to members of `Stop`; "" where `error` says why.
        verified: was everything behind the row replayed? A witness always is; a proof that nothing holds, unless that
            was switched off; the upper bound of a maximum only where whole answers were asked for.
        nodes: programs solved. seconds: wall time; rows that were answered together have equal shares of theirs.
        error: why a row has no answer, one line, or "".
        answers: the whole answers with witness and certificate in the order of the raveled arrays, if they were asked
            for; None where `error` says why.
        attained: of a maximum with whole answers: False where it is only approached, see `MaxAnswer`; else None.
        intervals: of a maximum, which smaller magnitudes are resisted, in the order of the raveled arrays, if they were
            asked for; None where none is.
    """

    query: str
    wrenches: Array
    verdict: Any
    lower: Array
    upper: Array
    unbounded: Mask
    residual: Array
    stop: Any
    verified: Mask
    nodes: Indices
    seconds: Array
    error: Any
    answers: tuple[Answer | None, ...] | None = field(default=None, repr=False)
    attained: Mask | None = field(default=None, repr=False)
    intervals: tuple[ResistedInterval | None, ...] | None = field(default=None, repr=False)

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.verdict.shape)

    def to_frame(self) -> DataFrame:
        """One row a question: `grasp` and `load` count them, then the wrench as `fx` to `tz`, and every array.

        Raises:
            InputError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise InputError("is not installed; pip install 'handfast[pandas]'", source="pandas") from None
        place = np.indices(self.shape if len(self.shape) > 1 else (1, *self.shape))
        columns: dict[str, Any] = {"grasp": place[0].ravel(), "load": place[1].ravel()}
        columns |= dict(zip(WRENCH_COLUMNS, self.wrenches.reshape(-1, 6).T, strict=True))
        names = ["verdict", "lower", "upper", "unbounded", "residual", "stop", "verified", "nodes", "seconds", "error"]
        for name in names if self.attained is None else [*names, "attained"]:
            columns[name] = getattr(self, name).ravel()
        return pandas.DataFrame(columns)

    @classmethod
    def of(
        cls, query: str, wrenches: Array, parts: Sequence[AnswerRows], *, answers: bool = False, interval: bool = False
    ) -> BatchAnswer:
        """The columns of all parts in the shape of the wrenches (..., 6)."""
        shape = wrenches.shape[:-1]

        def whole(name: str) -> Any:
            return np.concatenate([part[name] for part in parts]).reshape(shape) if parts else np.zeros(shape)

        each = [a for part in parts for a in part.answers]
        attained = None
        if answers and query == "max":
            attained = np.array([isinstance(a, MaxAnswer) and a.attained for a in each], bool).reshape(shape)
        return cls(
            query,
            wrenches,
            answers=tuple(each) if answers else None,
            attained=attained,
            intervals=tuple(i for part in parts for i in part.intervals) if interval else None,
            **{name: whole(name) for name in (*ANSWER_COLUMNS, "verdict", "stop", "error")},
        )


class AnswerRows(dict[str, Any]):
    """The columns of some rows about one grasp as they are answered, whole answers and intervals where these are kept.

    Attributes:
        wrenches, base: (k, 6) what is asked about: loads, or directions above base loads.
    """

    def __init__(self, wrenches: Array, base: Array, error: str = "") -> None:
        k = len(wrenches)
        super().__init__({name: np.zeros(k, NUMERIC.get(name, np.float64)) for name in ANSWER_COLUMNS})
        self["lower"][:] = self["upper"][:] = self["residual"][:] = np.nan
        self["verdict"], self["stop"], self["error"] = np.zeros(k, "U9"), np.zeros(k, "U11"), np.zeros(k, object)
        self["error"][:] = error
        self.wrenches, self.base = wrenches, base
        self.answers: list[Answer | None] = [None] * k
        self.intervals: list[ResistedInterval | None] = [None] * k

    def put(self, i: int, answer: Answer, *, keep: bool) -> None:
        """A whole answer; keep: it, and the proofs of its interval."""
        self["verdict"][i], self["verified"][i] = str(answer.verdict), answer.verified
        self["nodes"][i] += answer.nodes
        self["stop"][i] = str(answer.stop)
        if answer.found:
            self["residual"][i] = answer.found.residuals.worst
        if isinstance(answer, MaxAnswer | TorquesAnswer):
            self["lower"][i], self["upper"][i] = answer.lower, answer.upper
        if isinstance(answer, MaxAnswer):
            self["unbounded"][i], shown = answer.unbounded, answer.interval
            self.intervals[i] = shown if keep or shown is None else replace(shown, arcs=(), slips=())
        self.answers[i] = answer if keep else None
