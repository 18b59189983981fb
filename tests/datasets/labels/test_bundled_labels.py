"""The bundled grasps with labels: complete, small, as the page on datasets says, and as the engine answers."""

from __future__ import annotations

import gzip
import json
import re
from collections import Counter
from typing import Any

import numpy as np
import pytest

from handfast.core.bundled import folder
from handfast.model.grasp import Contact, Grasp
from tests.support.places import ROOT

TABLE = folder("labels") / "barrett-allegro.jsonl.gz"
PAGE = ROOT / "docs" / "datasets.md"


@pytest.fixture(scope="module")
def rows() -> list[dict[str, Any]]:
    return [json.loads(line) for line in gzip.decompress(TABLE.read_bytes()).splitlines()]


def test_it_is_what_the_page_says(rows: list[dict[str, Any]]) -> None:
    assert len(rows) == 1000
    assert TABLE.stat().st_size < 300_000
    assert len({row["object"] for row in rows}) == 12
    holds, hands = (
        Counter(row["hand"] for row in rows if row["verdict"] == "holds"),
        Counter(row["hand"] for row in rows),
    )
    text = " ".join(PAGE.read_text("utf-8").split())
    for hand in ("barrett", "allegro"):
        assert f"{holds[hand]} of {hands[hand]} {hand.title()}" in text


def test_rows_are_grasps(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        n = np.array(row["contact_normals"])
        assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-3
        contacts = zip(row["contact_positions"], row["contact_normals"], row["contact_links"], strict=True)
        Grasp([Contact(np.array(p), np.array(v), row["friction"], link) for p, v, link in contacts])
        assert (row["verdict"] == "slips") == ("slips" in row["verdicts"])
        assert row["verdict"] != "holds" or row["weight_factor"] >= 0.999


@pytest.mark.optional
def test_the_page_learns_from_it() -> None:
    """Its code runs, and what it prints is what the page says."""
    pytest.importorskip("sklearn")
    pytest.importorskip("pandas")
    page = PAGE.read_text("utf-8")
    code = re.findall(r"```python\n(.*?)```", page[page.index("## A thousand grasps") :], re.DOTALL)
    names: dict[str, Any] = {}
    for block in code:
        exec(block.replace("RandomForestClassifier(300", "RandomForestClassifier(60"), names)
    right, constant = (names["guess"] == names["y"]).mean(), max(names["y"].mean(), 1 - names["y"].mean())
    said = re.search(r"right for (\d+) % of the grasps, .*? (\d+) %", " ".join(page.split()))
    assert said
    assert right == pytest.approx(int(said[1]) / 100, abs=0.03)
    assert constant == pytest.approx(int(said[2]) / 100, abs=0.01)
