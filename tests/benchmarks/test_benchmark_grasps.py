"""The published set of benchmark grasps: promised sizes, always the same, every grasp valid."""

from __future__ import annotations

from collections import Counter
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from handfast.core.answer import Stop
from handfast.proofs.checker import verify
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

FINGERPRINT = "795e9b567f5f6719637db87607d74ff773c10cafc0a401d855cf5557109a8b9d"


@pytest.fixture(scope="module")
def grasps() -> ModuleType:
    from benchmarks import grasps

    return grasps


@pytest.fixture(scope="module")
def chosen(grasps: ModuleType) -> list[Any]:
    return grasps.cases()


def test_the_set_has_the_promised_sizes(grasps: ModuleType, chosen: list[Any]) -> None:
    count = Counter((c.family, c.contacts) for c in chosen)

    for family in ("random", "barrett", "allegro", "fixture"):
        assert {m: count[family, m] for m in grasps.SIZES} == dict.fromkeys(grasps.SIZES, grasps.PER_SIZE[family])
    assert {m: count["power", m] for m in grasps.POWER} == dict.fromkeys((10, 12, 15), 15)
    assert sum(3 <= c.contacts <= 8 for c in chosen) >= 200
    assert len({c.name for c in chosen}) == len(chosen)


def test_the_set_is_the_published_one(grasps: ModuleType, chosen: list[Any]) -> None:
    assert grasps.fingerprint(chosen) == FINGERPRINT


def test_every_case_is_a_question_that_can_be_asked(grasps: ModuleType, chosen: list[Any]) -> None:
    for case in chosen:
        g = case.grasp
        p = scaled_problem.build(g, case.base, case.direction)  # raises if no forces could balance it

        assert p.sizes[0] == case.contacts == g.m
        assert np.linalg.norm(case.direction[:3]) == pytest.approx(1.0)
        if g.l:
            assert g.command.any()
            assert not case.base.any()
        else:
            assert case.base[2] == pytest.approx(-grasps.WEIGHT)


def test_random_preloads_press_the_contacts(grasps: ModuleType, chosen: list[Any]) -> None:
    some = [c for c in chosen if c.family == "random"][::30]

    assert len(some) == 4
    assert all(grasps.presses(c.grasp) for c in some)


@pytest.mark.parametrize("name", ["allegro_6_3", "allegro_7_4"])
@pytest.mark.slow
def test_contacts_at_one_point_close(chosen: list[Any], name: str) -> None:
    """Nearly parallel rows make working sets singular: no program may be given up for that."""
    case = next(c for c in chosen if c.name == name)

    answer = maximum(case.grasp, case.direction, base=case.base, settings=Settings(gap=1e-3, nodes=40_000))

    assert answer.stop is Stop.COMPLETE
    assert answer.nodes < 30_000
    assert answer.unbounded or verify(answer.certificate).ok
