"""The page about a table of labels: counts, their picture, and the first grasps one by one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape
from itertools import islice
from pathlib import Path
from typing import Any

from handfast.core.files import write_text
from handfast.datasets.labels.label_columns import LabelSummary
from handfast.pictures.label_picture import draw_labels
from handfast.pictures.page_parts import BAD, page, still, table
from handfast.pictures.words import count, num

HELD_BY_TEXTS = {  # a word of the column: what it says
    "these": "holds with these commands",
    "others": "could hold with others: column holding_commands",
    "none": "cannot hold with any commands",
    "undecided": "undecided",
}
NO_MASS = "not asked: no mass is known; give --mass KG"
LISTED_GRASPS = 100  # grasps that are listed
CAPTION = "Grasps by contacts, and how factors on the weight, forces and commands are spread; colours are verdicts."

LISTED = (
    "Commands: those that hold the weight from every direction, these of the row or others. Times the weight: least "
    "over the directions. Worst force: of the direction in which the least is resisted."
)


def held_rows(summary: LabelSummary) -> list[tuple[str, str]]:
    """What holds the weight from every direction, and how many grasps; without what there is none of."""
    held = [(said, summary.held_by[key]) for key, said in HELD_BY_TEXTS.items()]
    held.append((NO_MASS, summary.verdicts["no weight"]))
    return [(said, str(number)) for said, number in held if number]


def report_labels(
    path: str | Path, name: str, summary: LabelSummary, labels: Iterable[Mapping[str, Any]], *, force: bool = False
) -> None:
    """Write a page about a table of labels.

    Args:
        name: of the table.
        labels: its rows, of which the first `LISTED_GRASPS` are listed.

    Raises:
        InputError: the file exists and `force` is not set, or cannot be written.
    """
    first = list(islice(labels, LISTED_GRASPS))
    about = f"{summary.labelled} of {count(summary.rows, 'grasp')} labelled, {summary.broken} broken."
    if summary.open:
        about += f" {count(summary.open, 'question')} stayed open; the rows say what was shown."
    reasons = [[str(n), str(summary.first[reason]), reason] for reason, n in summary.reasons.most_common()]
    counted = table(["weight from every direction", "grasps"], held_rows(summary), "What holds the weight")
    broken = table(["rows", "first", "broken because"], reasons, "Rows that are broken")
    left = summary.rows - len(first)
    more = f'<p class="note">{count(left, "grasp")} more in {escape(name)}.</p>' if left > 0 else ""
    heads = ["#row", "#grasp", "#verdict", "#commands", "times the weight", "worst force [N]", "contacts", "#object"]
    listed = table(heads, [_row(label) for label in first], "Grasp by grasp") + f'<p class="note">{LISTED}</p>'
    parts = [
        f'<h1>{escape(name)}</h1><p class="facts">{escape(about)}</p>',
        f'<section class="overview">{counted}{broken}</section>' if counted or broken else "",
        f"<section>{still(draw_labels(summary, name), CAPTION, 'png')}</section>",
        f"<section>{listed}{more}</section>",
    ]
    write_text(path, page(name, ["page.css"], parts), force=force)


def _row(label: Mapping[str, Any]) -> list[str]:
    named, thing = (str(label["row"]), label["name"] or "–"), label["object"] or "–"  # last: it may be long
    if label["status"] == "broken":
        return [*named, f"{BAD}broken", label["reason"] or "–", "–", "–", "–", thing]
    verdict = label["verdict"] or "–"
    says = BAD + verdict if verdict == "slips" else verdict
    numbers = [_number(label["weight_factor"], verdict), _number(label["worst_force"], "")]
    return [*named, says, label["held_by"] or "–", *numbers, str(label["contacts"] or "–"), thing]


def _number(x: float | None, verdict: str) -> str:
    if x is None:
        return "any size" if verdict == "holds" else "–"
    return num(x) if math.isfinite(x) else "any size"
