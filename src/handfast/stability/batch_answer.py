"""Answers to many questions as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.core.shown import Shown
from handfast.stability.answers import Answer

if TYPE_CHECKING:
    from pandas import DataFrame

WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")


@dataclass(frozen=True, eq=False)
class BatchAnswer(Shown):
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
        columns |= dict(zip(WRENCH, self.wrenches.reshape(-1, 6).T, strict=True))
        names = ["verdict", "lower", "upper", "unbounded", "residual", "stop", "verified", "nodes", "seconds", "error"]
        for name in names if self.attained is None else [*names, "attained"]:
            columns[name] = getattr(self, name).ravel()
        return pandas.DataFrame(columns)
