"""The benchmark of measures: its grasps come back, and what it makes of numbers is right."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import measures as benchmark


def test_the_first_row_comes_back() -> None:
    """Of one grasp, the stored values of some measures and the worst passive maximum."""
    data = json.loads(benchmark.RESULTS.read_text())
    stored, again = data["rows"][0], benchmark.row(0, data["first seed"])
    assert again["grasp"] == stored["grasp"]
    for one, two in zip(again["worst"], stored["worst"], strict=True):
        assert one == pytest.approx(two, rel=0.02)
    grasp = benchmark.grasp_of(0, data["first seed"])
    for key, value in benchmark.measure_columns(grasp, only=["epsilon_l1", "isotropy", "dfc"]).items():
        assert value == pytest.approx(stored["measures"][key], rel=1e-3)


def test_rank_correlation_and_picks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The order itself has 1 and picks the best, its reverse -1 and the worst, noise nearly nothing and the middle."""
    rng = np.random.default_rng(0)
    y = rng.normal(size=400)
    assert benchmark.rank_correlation(y**3, y) == 1.0
    assert benchmark.rank_correlation(-y, y) == -1.0
    assert benchmark.rank_correlation(np.ones(400), y) is None
    monkeypatch.setattr(benchmark, "DRAWS", 200)
    assert benchmark.picked(y, y, rng) == 1.0
    assert benchmark.picked(-y, y, rng) == 0.0
    assert benchmark.picked(rng.normal(size=400), y, rng) == pytest.approx(0.5, abs=0.1)
