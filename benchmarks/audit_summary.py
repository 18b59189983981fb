"""Tables and ROC curves of an audited set of grasps, see `dataset_audit.py`."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.catalogue import CATALOGUE

HARD = "0.3"  # the coefficient of friction of a harder test
OURS = "margin"  # how many times the load is resisted in the worst of the six directions
MEASURES = (
    *("epsilon_l1", "volume_l1", "closure_margin", "largest_wrench", "smallest_forces", "pcr"),
    *("smallest_singular_value", "ellipsoid_volume", "isotropy", "q1", "qp", "graspqp", "tdg", "dfc"),
)


def goodness(rows: list[dict[str, Any]], key: str) -> Array:
    """(n,) a measure, larger for better; what is infinitely bad or not measured comes last."""
    better = {m.key: m.better for m in CATALOGUE}.get(key, "more")
    raw = [r["measures"].get(key) for r in rows]
    return np.array([-np.inf if v is None else -v if better == "less" else v for v in raw], dtype=float)


def roc(good: Array, passed: Array) -> tuple[Array, Array, float]:
    """False and true positive rates from (0, 0) to (1, 1) as the threshold falls, and the area under them.

    Equal values are one step, so that a constant measure has the area 0.5.
    """
    order = np.unique(good)[::-1]
    yes, no = max(int(passed.sum()), 1), max(int((~passed).sum()), 1)
    true = np.r_[0.0, [(good[passed] >= t).sum() / yes for t in order]]
    false = np.r_[0.0, [(good[~passed] >= t).sum() / no for t in order]]
    return false, true, float(np.sum(np.diff(false) * (true[1:] + true[:-1]) / 2))


def uncertainty(good: Array, passed: Array, draws: int = 300) -> tuple[float, float]:
    """5 % and 95 % of the area over bootstrap samples of the grasps."""
    rng, n = np.random.default_rng(0), len(good)
    areas = []
    for _ in range(draws):
        some = rng.integers(0, n, n)
        if 0 < passed[some].sum() < n:
            areas.append(roc(good[some], passed[some])[2])
    return tuple(np.round(np.quantile(areas, (0.05, 0.95)), 3).tolist()) if areas else (0.0, 1.0)  # type: ignore[return-value]


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Tables and areas of a set."""
    whole = [r for r in rows if "measures" in r]
    sure = [r for r in whole if r["passes"]["own"] is not None]
    out: dict[str, Any] = {"grasps": len(rows), "asked": len(whole), "test decided": len(sure)}
    out["passes"] = {
        mu: sum(bool(r["passes"].get(mu)) for r in rows) for mu in sorted({k for r in rows for k in r["passes"]})
    }
    table: dict[str, int] = {}
    for r in whole:
        test = {True: "passes", False: "fails", None: "open"}[r["passes"]["own"]]
        key = f"{test}, {r['here']['own']}"
        table[key] = table.get(key, 0) + 1
    out["there, here"] = dict(sorted(table.items()))
    keys = sorted({k for r in whole for k in r["here"]})
    out["holds here"] = {k: sum(r["here"][k] == "holds" for r in whole) for k in keys}
    out["open here"] = {k: sum(r["here"][k] == "undecided" for r in whole) for k in keys}
    for variant in ("without laws", "tendons free"):
        if any(variant in r for r in whole):
            kinds = ("own", "preload alone")
            out[variant] = {k: sum(r[variant][k] == "holds" for r in whole) for k in kinds}
    if any("sides here" in r for r in whole):
        out["sides"] = by_side(whole)
    out["area"] = areas(sure, "own")
    if any(HARD in r["passes"] for r in sure):
        out["area, hard test"] = areas(sure, HARD)
    return out


def areas(rows: list[dict[str, Any]], test: str) -> dict[str, Any]:
    """Of each measure the area under its curve for a test, and its uncertainty; None where all pass or all fail."""
    passed = np.array([bool(r["passes"].get(test)) for r in rows])
    if not 0 < passed.sum() < len(passed):
        return dict.fromkeys((OURS, *MEASURES))
    found = {key: goodness(rows, key) for key in (OURS, *MEASURES)}
    return {key: [round(roc(good, passed)[2], 3), *uncertainty(good, passed)] for key, good in found.items()}


def by_side(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Single directions: held there and here."""
    table: dict[str, int] = {}
    for r in rows:
        for there, here in zip(r["sides"], r["sides here"], strict=True):
            key = f"{'held' if there else 'lost'}, {here}"
            table[key] = table.get(key, 0) + 1
    return dict(sorted(table.items()))
