"""What became of a dataset: counts, reasons, and how its numbers are spread, in memory that does not grow with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

REASONS = 100  # different ones that are kept, and broken rows that are listed one by one
SPREAD = {"weight_factor": (1e-3, 1e3), "worst_force": (1e-3, 1e3), "largest_command": (1e-4, 1e2)}
SPREAD_BINS = 60
KEPT = (
    "row",
    "name",
    "status",
    "reason",
    "verdict",
    "held_by",
    "contacts",
    "open",
    "stop",
    "nodes",
    "seconds",
    *SPREAD,
)


def edges(name: str) -> Any:
    """(bins + 1,) of the histogram of a column; what lies beyond is counted in the last on its side."""
    return np.geomspace(*SPREAD[name], SPREAD_BINS + 1)


@dataclass
class LabelSummary:
    """Counts over rows.

    Attributes:
        rows: all of them. labelled, broken: of these.
        reasons: of broken rows: how many, and the first row. broken_rows: row, name and reason of the first ones.
        verdicts, held_by, contacts, stops: how many rows of each. open: questions that a limit left open.
        nodes, seconds: of all labels together.
        spread: histograms by column and verdict, over `edges`.
        wall: [s] of this run. fresh: rows that this run labelled; the others were there.
    """

    rows: int = 0
    labelled: int = 0
    broken: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    first: dict[str, int] = field(default_factory=dict)
    broken_rows: list[dict[str, Any]] = field(default_factory=list)
    verdicts: Counter[str] = field(default_factory=Counter)
    held_by: Counter[str] = field(default_factory=Counter)
    contacts: Counter[int] = field(default_factory=Counter)
    stops: Counter[str] = field(default_factory=Counter)
    open: int = 0
    nodes: int = 0
    seconds: float = 0.0
    spread: dict[str, dict[str, Any]] = field(default_factory=lambda: {name: {} for name in SPREAD})
    wall: float = 0.0
    fresh: int = 0

    def take(self, rows: Iterable[dict[str, Any]]) -> None:
        """Count more rows, which have the columns `KEPT`."""
        for row in rows:
            self.rows += 1
            if row["status"] == "broken":
                self._take_broken(row)
                continue
            self.labelled += 1
            verdict = row["verdict"] or "no weight"
            self.verdicts[verdict] += 1
            if row["held_by"]:
                self.held_by[row["held_by"]] += 1
            self.contacts[row["contacts"]] += 1
            self.stops[row["stop"]] += 1
            self.open += row["open"]
            self.nodes += row["nodes"]
            self.seconds += row["seconds"]
            for name in SPREAD:
                if row[name] is not None:
                    bins = self.spread[name].setdefault(verdict, [0] * SPREAD_BINS)
                    k = int(np.searchsorted(edges(name), row[name], side="right")) - 1
                    bins[min(max(k, 0), SPREAD_BINS - 1)] += 1

    def _take_broken(self, row: dict[str, Any]) -> None:
        self.broken += 1
        if row["reason"] in self.reasons or len(self.reasons) < REASONS:
            self.reasons[row["reason"]] += 1
            self.first.setdefault(row["reason"], row["row"])
        if len(self.broken_rows) < REASONS:
            self.broken_rows.append({key: row[key] for key in ("row", "name", "reason")})

    @property
    def rate(self) -> float:
        """Rows a second of this run; 0 if it had none to do."""
        return self.fresh / self.wall if self.wall > 0 else 0.0

    def to_json(self) -> dict[str, Any]:
        reasons = [{"reason": r, "rows": n, "first": self.first[r]} for r, n in self.reasons.most_common()]
        return {
            "rows": self.rows,
            "labelled": self.labelled,
            "broken": self.broken,
            "reasons": reasons,
            "broken_rows": self.broken_rows,
            "verdicts": dict(sorted(self.verdicts.items())),
            "held_by": dict(sorted(self.held_by.items())),
            "contacts": {str(k): n for k, n in sorted(self.contacts.items())},
            "stops": dict(sorted(self.stops.items())),
            "open": self.open,
            "nodes": self.nodes,
            "seconds": self.seconds,
            "wall": self.wall,
            "fresh": self.fresh,
            "rate": self.rate,
        }
