"""The comparison with the planar oracle finds contradictions that are planted, and only these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import planar
from handfast.core.answer import Verdict
from handfast.papers.planar_oracle import PlanarContact, PlanarGrasp

LIMIT = 10.0  # [s]
BOUNDED = 36  # a question whose magnitudes begin and end


def test_question() -> None:
    found = planar.compared(BOUNDED, LIMIT)
    assert found["contradictions"] == []
    assert found["ranges"][-1][1] is not None
    assert found["counts"]["check holds"] == 2
    assert found["counts"]["check slips"] == 2


def test_wrong_checks_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = planar.check
    other = {Verdict.HOLDS: Verdict.SLIPS, Verdict.SLIPS: Verdict.HOLDS}

    def wrong(*args, **options):
        answer = right(*args, **options)
        return replace(answer, verdict=other[answer.verdict])

    monkeypatch.setattr(planar, "check", wrong)
    assert len(planar.compared(BOUNDED, LIMIT)["contradictions"]) == 4


@pytest.mark.parametrize("change", [{"lower": 1.01}, {"upper": 0.99}])
def test_wrong_bounds_are_found(monkeypatch: pytest.MonkeyPatch, change: dict[str, float]) -> None:
    right = planar.maximum

    def wrong(*args, **options):
        answer = right(*args, **options)
        return replace(answer, **{name: factor * getattr(answer, name) for name, factor in change.items()})

    monkeypatch.setattr(planar, "maximum", wrong)
    assert any(words.startswith("maximum") for words in planar.compared(BOUNDED, LIMIT)["contradictions"])


def test_excuses_are_not_given_freely() -> None:
    """A load 10^-6 beside a frictionless contact's is not held by rounding; a cap excuses only what moves farther."""
    one = PlanarGrasp([PlanarContact([0, -1], [0, 1], 0.0)])
    assert planar.nearly(one, np.array([0, -1, 1e-12]))
    assert not planar.nearly(one, np.array([0, -1, 1e-6]))
    leaning = PlanarGrasp([PlanarContact([-1, 0], [1, 1e-6], 0.5), PlanarContact([1, 0], [-1, 1e-6], 0.5)])
    load = np.array([0, -1.0, 0])  # wedged by motions of 10^6
    assert planar.beyond(leaning, load, 1e4)
    assert not planar.beyond(leaning, load, 1e7)
    assert not planar.beyond(leaning, load, None)
    assert not planar.beyond(leaning, -load, 1e4)  # nothing resists it
