"""The page about a table of labels: what holds, what is broken and why, and each grasp."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from handfast import InputError
from handfast.datasets.labels.label_columns import LabelSummary, complete
from handfast.pictures.label_page import LISTED_GRASPS, report_labels


def labels(number: int) -> list[dict[str, Any]]:
    row = {"status": "labelled", "contacts": 3, "verdict": "holds", "held_by": "these", "object": "can"}
    return [complete({**row, "row": k, "name": f"grasp-{k}.json", "weight_factor": 1.5 + k}) for k in range(number)]


def test_a_page_has_counts_reasons_and_grasps(tmp_path: Path) -> None:
    broken = complete({"row": 2, "name": "<b>", "status": "broken", "reason": "no contacts"})
    slips = complete({**labels(1)[0], "row": 3, "verdict": "slips", "held_by": "none", "weight_factor": 0.25})
    summary = LabelSummary(
        rows=4,
        labelled=3,
        verdicts=Counter(holds=2, slips=1),
        contacts=Counter({3: 3}),
        held_by=Counter(these=2, none=1),
    )
    summary.reasons["no contacts"], summary.first["no contacts"] = 1, 2
    page = tmp_path / "labels.html"
    report_labels(page, "a.jsonl", summary, [*labels(2), broken, slips])
    text = page.read_text("utf-8")
    for said in ("3 of 4 grasps labelled", "cannot hold with any commands", ">2.5<", ">0.25<", "grasp-1.json"):
        assert said in text
    assert text.count("no contacts") == 2
    assert "&lt;b&gt;" in text
    assert "<td><b>" not in text
    columns = "row", "grasp", "verdict", "commands", "times the weight", "worst force [N]", "contacts", "object"
    heads = [text.index(f">{name}</th>") for name in columns]
    assert heads == sorted(heads)  # the object, whose name may be long, hides no verdict on a phone
    with pytest.raises(InputError, match="exists already"):
        report_labels(page, "a.jsonl", summary, [])


def test_of_many_grasps_the_first_are_listed_and_the_rest_counted(tmp_path: Path) -> None:
    summary = LabelSummary(
        rows=LISTED_GRASPS + 5, labelled=LISTED_GRASPS + 5, verdicts=Counter(holds=LISTED_GRASPS + 5)
    )
    report_labels(tmp_path / "many.html", "a.jsonl", summary, labels(LISTED_GRASPS + 5))
    text = (tmp_path / "many.html").read_text("utf-8")
    assert "5 grasps more in a.jsonl" in text
    assert (f"grasp-{LISTED_GRASPS - 1}.json" in text, f"grasp-{LISTED_GRASPS}.json" in text) == (True, False)
