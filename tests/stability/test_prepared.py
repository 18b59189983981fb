"""A prepared grasp says what a check says, under loads and preloads that change."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast import InputError, check, maximum, prepare
from handfast.model.grasp import Grasp
from handfast.proofs import checker
from handfast.stability.grasp_limits import GraspLimits
from handfast.stability.settings import Settings
from tests.support.problems import bell, pinch, solved

QUICK = Settings(verify=False)


@pytest.mark.parametrize(
    ("g", "asked"),
    [
        (bell(), {}),
        (bell(), {"limits": GraspLimits(force_limit=2.0)}),
        (solved(5, 3, eta=0.1).grasp, {"limits": GraspLimits(0.1)}),
    ],
)
def test_loads_that_change_are_answered_as_by_check(g: Grasp, asked: dict[str, Any]) -> None:
    prepared = prepare(g, settings=QUICK, **asked)
    first = maximum(g, g.G @ np.tile([1.0, 0.3, 0.1], g.m), settings=QUICK, **asked).lower
    for k in range(20):
        w = min(first, 3.0) * (0.1 + 0.1 * k) * (g.G @ np.tile([1.0, 0.3, 0.1], g.m))
        if k == 10:
            prepared.preload({name: 1.3 * f for name, f in g.preload.items()})
        found = prepared.holds(w)
        assert found.verdict is check(prepared.grasp, w, settings=QUICK, **asked).verdict
        assert bool(found) == (found.verdict == "holds")
        if found:
            assert found.witness is not None
            assert found.witness.valid
            np.testing.assert_array_equal(found.witness.wrench, w)
            assert found.residual <= 1e-9


def test_what_is_near_takes_no_search() -> None:
    prepared = prepare(bell())
    assert prepared.holds([0, 0.5, 0.1])
    for k in range(5):
        assert prepared.holds([0, 0.5 + 0.02 * k, 0.1]).nodes == 0


def test_what_slips_has_a_certificate() -> None:
    """A pinch holds 1 N along y, in proportion to its preload."""
    prepared = prepare(pinch(), preload={"right": 0.1, "left": 0.1})
    assert prepared.holds([0, 0.95, 0])
    slips = prepared.holds([0, 1.05, 0])
    assert slips.verdict == "slips"
    assert slips.witness is None
    assert slips.certificate is not None
    assert checker.verify(slips.certificate).ok
    prepared.preload({"right": 0.12, "left": 0.12})
    assert prepared.holds([0, 1.05, 0])
    assert abs(prepared.maximum([0, 1, 0]).lower - 1.2) < 3e-3
    prepared.preload({"right": -0.1, "left": 0.1})  # the other sense is another question, prepared by itself
    assert prepared.holds([0, 0.5, 0]).verdict is check(prepared.grasp, [0, 0.5, 0]).verdict


def test_bad_loads_are_refused() -> None:
    prepared = prepare(pinch())
    with pytest.raises(InputError, match="has 2 numbers"):
        prepared.holds([0, 1])
    with pytest.raises(InputError, match="rank 5"):
        prepared.holds([0, 0, 0, 1, 0, 0])
    with pytest.raises(InputError, match="nobody"):
        prepared.preload({"nobody": 1.0})


def test_a_command_beyond_its_limit_is_refused_and_the_old_one_stays() -> None:
    """Whatever was prepared for the same senses: a backdrivable motor has nothing but its command."""
    g = random_case(3, 9_300_000).grasp
    i = int(np.argmax(np.abs(g.command)))
    back = tuple(k == i for k in range(len(g.command)))
    g = Grasp(g.contacts, g.joints, replace(g.mechanism, backdrivable=back), g.command)
    prepared = prepare(g, limits=GraspLimits(torque_limits={g.mechanism.actuators[i]: 2 * abs(g.command[i])}))
    idle = np.flatnonzero(g.command == 0)[0]
    for more in (0.0, 0.01):  # in the same senses, and in others
        command = 3 * g.command
        command[idle] += more
        with pytest.raises(InputError, match="is backdrivable and gives its command"):
            prepared.preload(command)
        np.testing.assert_array_equal(prepared.grasp.command, g.command)
    prepared.preload(1.5 * g.command)
    np.testing.assert_array_equal(prepared.grasp.command, 1.5 * g.command)


def test_a_load_that_no_forces_balance_is_refused_however_small() -> None:
    case = random_case(2, 9_400_001)  # two contacts: no torque about the line through them
    prepared = prepare(case.grasp)
    for size in (1e-3, 1e-8, 1e-9):
        with pytest.raises(InputError, match="cannot be balanced by any forces"):
            prepared.holds(size * case.direction)
