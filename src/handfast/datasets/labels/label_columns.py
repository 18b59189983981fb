"""What a label says: the columns of a table of labels, their units and meaning; and counts over rows, in memory that
does not grow with the table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

SCHEMA = "handfast/labels/1"
Kind = Literal["integer", "number", "text", "numbers", "texts", "points"]  # plural: a list of them; points: of (3,)

# commands of the row, others that were found, no commands at all
HELD_BY_VALUES = "these", "others", "none", "undecided"
WRENCHES = tuple(sign + axis for sign in ("+", "-") for axis in ("fx", "fy", "fz", "tx", "ty", "tz"))


@dataclass(frozen=True)
class LabelColumn:
    """One column. Any value may be null where nothing is known, and all but row, name, status and reason of a row
    that could not be labelled."""

    name: str
    kind: Kind
    unit: str
    about: str
    course: bool = False  # of the course of the search: may differ from run to run


def _axes() -> tuple[LabelColumn, ...]:
    out = []
    for name in WRENCHES:
        unit = "N" if name[1] == "f" else "N m"
        what = f"{'force' if name[1] == 'f' else 'torque'} along {name[0]}{name[2]} at the centre"
        out.append(LabelColumn(wrench_column(name), "number", unit, f"largest {what}, witnessed"))
        upper = f"no larger {what} is resisted; null: unbounded, or not shown"
        out.append(LabelColumn(f"{wrench_column(name)}_upper", "number", unit, upper))
    return tuple(out)


def wrench_column(name: str) -> str:
    """The column of a largest disturbance such as "+fx"."""
    return f"max_{'plus' if name[0] == '+' else 'minus'}_{name[1:]}"


MEASURES = (  # those of `handfast measures` that need no further package and next to no time
    LabelColumn("epsilon_l1", "number", "N", "Ferrari and Canny's epsilon, forces of 1 N in all"),
    LabelColumn("volume_l1", "number", "N^6", "volume of the same wrenches"),
    LabelColumn("force_closure", "integer", "", "1: forces at the contacts balance any wrench; 0: they do not"),
    LabelColumn("closure_margin", "number", "", "margin of force closure"),
    LabelColumn("smallest_singular_value", "number", "", "of the grasp map"),
    LabelColumn("ellipsoid_volume", "number", "", "of the grasp map"),
    LabelColumn("isotropy", "number", "", "of the grasp map: smallest over largest singular value"),
    LabelColumn("q1", "number", "N", "epsilon as benchmarks scale it"),
    LabelColumn("graspqp", "number", "", "energy of GraspQP, less is better"),
    LabelColumn("tdg", "number", "", "energy TDG, less is better"),
    LabelColumn("dfc", "number", "N", "energy DFC, less is better"),
)

LABEL_COLUMNS = (
    LabelColumn("row", "integer", "", "number of the row in the dataset, from 0"),
    LabelColumn("name", "text", "", "of the row: its file, or as the dataset calls it"),
    LabelColumn("grasp", "text", "", "name of the grasp; null if it has none of its own"),
    LabelColumn("object", "text", "", "name of the object: its file without ending; null if nothing names it"),
    LabelColumn(
        "source", "text", "", "where the row is from: FILE#INDEX of a published set, else its file in the dataset"
    ),
    LabelColumn("status", "text", "", "labelled, or broken"),
    LabelColumn("reason", "text", "", "why a row is broken; null if it is not"),
    LabelColumn("joints", "numbers", "rad, m", "joint values of the hand, in its order; null for grasp files"),
    LabelColumn("object_position", "numbers", "m", "of the object in the hand's base frame; null for grasp files"),
    LabelColumn("object_quaternion", "numbers", "", "w, x, y, z, of the object in the hand's base frame"),
    LabelColumn("contacts", "integer", "", "how many contacts"),
    LabelColumn("contact_positions", "points", "m", "of the contacts, object frame"),
    LabelColumn("contact_normals", "points", "", "into the object, unit, object frame"),
    LabelColumn("contact_frictions", "numbers", "", "friction coefficients"),
    LabelColumn("contact_links", "texts", "", "links of the hand that touch"),
    LabelColumn("motors", "texts", "", "actuators behind the contacts"),
    LabelColumn("preload", "numbers", "N m, N", "their commands, under which all of this was asked; 0 is locked"),
    LabelColumn("mass", "number", "kg", "of the object"),
    LabelColumn("center", "numbers", "m", "where disturbances act: the centre of mass, else the object's origin"),
    LabelColumn(
        "verdict", "text", "", "is the weight held from every direction with this preload: holds, slips, undecided"
    ),
    LabelColumn(
        "held_by", "text", "", f"commands that hold the weight from every direction: {', '.join(HELD_BY_VALUES)}"
    ),
    LabelColumn(
        "holding_commands", "numbers", "N m, N", "those commands, one preload for all directions; null: none found"
    ),
    LabelColumn("verdicts", "texts", "", "the same for each direction of gravity, in the order of the metadata"),
    LabelColumn("weight_factor", "number", "", "least over the directions: so many times the weight is resisted"),
    LabelColumn("weight_factor_upper", "number", "", "no larger factor is resisted in that direction"),
    LabelColumn("hardest", "numbers", "", "the direction of gravity with the least factor, object axes"),
    *_axes(),
    LabelColumn("worst_force", "number", "N", "least over the directions of the largest resisted force at the centre"),
    LabelColumn("worst_force_upper", "number", "N", "no larger force is resisted in that direction; null: unbounded"),
    LabelColumn("worst_direction", "numbers", "", "that direction, object axes"),
    LabelColumn(
        "commands", "numbers", "N m, N", "smallest commands found that hold the weight in the hardest direction"
    ),
    LabelColumn("largest_command", "number", "N m, N", "the largest of them; null: none were found"),
    LabelColumn(
        "largest_command_lower", "number", "N m, N", "no smaller largest command holds; null: not shown, or none holds"
    ),
    *MEASURES,
    LabelColumn("open", "integer", "", "maxima, checks and commands that a limit left open"),
    LabelColumn("stop", "text", "", "complete, or the limit that was hit: nodes, time, numerical", course=True),
    LabelColumn("nodes", "integer", "", "of the searches"),
    LabelColumn("seconds", "number", "s", "that the label took", course=True),
)
COLUMN_NAMES = tuple(c.name for c in LABEL_COLUMNS)


def complete(values: Mapping[str, Any]) -> dict[str, Any]:
    """A row with every column, null where nothing is said. `KeyError` for what is no column."""
    for name in values:
        if name not in COLUMN_NAMES:
            raise KeyError(name)
    return {name: values.get(name) for name in COLUMN_NAMES}


def broken(row: int, name: str, reason: str) -> dict[str, Any]:
    """The row of a grasp that could not be labelled."""
    return complete({"row": row, "name": name, "status": "broken", "reason": reason})


def described() -> list[dict[str, str]]:
    """The columns as the metadata of a file have them."""
    return [{"name": c.name, "kind": c.kind, "unit": c.unit, "about": c.about} for c in LABEL_COLUMNS]


MAX_REASONS = 100  # different ones that are kept, and broken rows that are listed one by one
SPREAD_RANGES = {"weight_factor": (1e-3, 1e3), "worst_force": (1e-3, 1e3), "largest_command": (1e-4, 1e2)}
SPREAD_BINS = 60
SUMMARY_COLUMNS = (
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
    *SPREAD_RANGES,
)


def edges(name: str) -> Any:
    """(bins + 1,) of the histogram of a column; what lies beyond is counted in the last on its side."""
    return np.geomspace(*SPREAD_RANGES[name], SPREAD_BINS + 1)


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
    spread: dict[str, dict[str, Any]] = field(default_factory=lambda: {name: {} for name in SPREAD_RANGES})
    wall: float = 0.0
    fresh: int = 0

    def take(self, rows: Iterable[dict[str, Any]]) -> None:
        """Count more rows, which have the columns `SUMMARY_COLUMNS`."""
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
            for name in SPREAD_RANGES:
                if row[name] is not None:
                    bins = self.spread[name].setdefault(verdict, [0] * SPREAD_BINS)
                    k = int(np.searchsorted(edges(name), row[name], side="right")) - 1
                    bins[min(max(k, 0), SPREAD_BINS - 1)] += 1

    def _take_broken(self, row: dict[str, Any]) -> None:
        self.broken += 1
        if row["reason"] in self.reasons or len(self.reasons) < MAX_REASONS:
            self.reasons[row["reason"]] += 1
            self.first.setdefault(row["reason"], row["row"])
        if len(self.broken_rows) < MAX_REASONS:
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
