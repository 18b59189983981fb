"""Answers as tables of pandas: one row for an answer, a direction of a map, a command of a sweep, or a grasp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.errors import InputError
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.plan import Plan
from handfast.stability.answers import MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.batch_answer import BatchAnswer
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer

if TYPE_CHECKING:
    from pandas import DataFrame

WRENCH_COMPONENTS = ("fx", "fy", "fz", "tx", "ty", "tz")
Answers = Answer | HoldAnswer | MapAnswer | SweepAnswer | Plan | Grasps


def to_frame(what: Answers | BatchAnswer | Sequence[Answers | None] | Mapping[str, Answers]) -> DataFrame:
    """Answers as a `pandas.DataFrame`, SI units; numbers that are not known are NaN.

    - of `check`, `maximum`, `torques`: one row, `grasp`, `query`, `verdict`, `stop`, `seconds`, `nodes`, `verified`;
      the wrench that was asked about, or that the witness is of, as `fx` to `tz`; `residual` of the witness; of a
      maximum `lower`, `upper`, `unbounded`; of torques the bounds and `command_NAME` of each actuator,
    - of `hold`: one row for each `load`, with its wrench and its check's verdict and residual,
    - of `force_map`: one row for each curve (`preload` false, true) and direction `dx`, `dy`, `dz`: `lower`, `upper`
      [N], `unbounded`, `verdict`,
    - of `sweep`: one row for each `curve` and `command`, with the direction as `fx` to `tz`,
    - of `plan` and `grasp_for`: one row for each grasp, as their JSON says it.

    Of several answers the rows follow each other; a column `answer` counts them, or has their names if they are given
    by name. None is left out, and its number with it.

    Of `check_many` and its like: one row a question, see `BatchAnswer.to_frame`.

    Raises:
        InputError: pandas is not installed; something else than answers.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("is not installed; pip install 'handfast[pandas]'", source="pandas") from None
    if isinstance(what, BatchAnswer):
        return what.to_frame()
    if isinstance(what, Answers):
        return pandas.DataFrame(_rows(what))
    if isinstance(what, str) or not isinstance(what, Mapping | Sequence):
        raise InputError(f"is a {type(what).__name__}; an answer is needed, or several", field="what")
    named = what.items() if isinstance(what, Mapping) else enumerate(what)
    rows = [{"answer": name} | row for name, answer in named if answer is not None for row in _rows(answer)]
    return pandas.DataFrame(rows)


def _rows(answer: Answers) -> list[dict[str, Any]]:
    if isinstance(answer, MapAnswer):
        return [
            {"preload": with_it} | dict(zip(("dx", "dy", "dz"), d.tolist(), strict=True)) | _at(curve, i)
            for with_it, curve in zip((False, True), answer.curves, strict=False)
            for i, d in enumerate(answer.directions)
        ]
    if isinstance(answer, SweepAnswer):
        return [
            {"curve": k, "command": float(value)} | _wrench(d) | _at(curve, i)
            for k, (curve, d) in enumerate(zip(answer.curves, answer.directions, strict=True))
            for i, value in enumerate(answer.values)
        ]
    if isinstance(answer, HoldAnswer):
        checks = answer.checks or (None,) * len(answer.loads)
        return [
            {"load": name} | _wrench(w) | {"verdict": str(c.verdict if c else answer.verdict), "residual": _residual(c)}
            for name, w, c in zip(answer.loads.names, answer.loads.wrenches, checks, strict=True)
        ]
    if isinstance(answer, Plan | Grasps):
        return [dict(entry) for entry in answer.to_json()["grasps"]]
    if isinstance(answer, Answer):
        return [_answer(answer)]
    raise InputError(f"is a {type(answer).__name__}; an answer is needed, or several", field="what")


def _answer(a: Answer) -> dict[str, Any]:
    row: dict[str, Any] = {"grasp": a.posed.problem.grasp.name if a.posed else "", "query": a.query}
    row |= {
        "verdict": str(a.verdict),
        "stop": str(a.stop),
        "seconds": a.seconds,
        "nodes": a.nodes,
        "verified": a.verified,
    }
    if a.witness is not None:
        row |= _wrench(a.witness.wrench)
    elif a.posed is not None and not a.posed.goal.has_direction:
        row |= _wrench(a.posed.problem.wrench)
    else:
        row |= dict.fromkeys(WRENCH_COMPONENTS, np.nan)
    row["residual"] = _residual(a)
    if isinstance(a, MaxAnswer):
        row |= {"lower": a.lower, "upper": a.upper, "unbounded": a.unbounded}
    if isinstance(a, TorquesAnswer):
        row |= {"lower": a.lower, "upper": a.upper}
        row |= {f"command_{name}": value for name, value in (a.preload or {}).items()}
    return row


def _residual(a: Answer | None) -> float:
    return a.witness.residuals.worst if a is not None and a.witness is not None else np.nan


def _wrench(w: Any) -> dict[str, float]:
    return dict(zip(WRENCH_COMPONENTS, np.asarray(w, dtype=float).tolist(), strict=True))


def _at(curve: Curve, i: int) -> dict[str, Any]:
    bounds = {"lower": float(curve.lower[i]), "upper": float(curve.upper[i])}
    return bounds | {"unbounded": bool(curve.unbounded[i]), "verdict": str(curve.verdicts[i])}
