"""SearchLimits of a search, on a clock that the test turns."""

from __future__ import annotations

import math

import pytest

from handfast.core.answer import SearchLimits, Stop


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("handfast.core.answer.time.monotonic", made)
    return made


def test_time(clock: Clock) -> None:
    limits = SearchLimits(seconds=2.0)
    assert (limits.seconds_left, limits.late, limits.stop(10**9)) == (2.0, False, None)
    clock.now += 1.5
    assert (limits.seconds_left, limits.late, limits.stop(0)) == (0.5, False, None)
    clock.now += 0.5
    assert (limits.seconds_left, limits.late, limits.stop(0)) == (0.0, True, Stop.TIME)
    clock.now += 5.0
    assert limits.seconds_left == 0.0


def test_nodes(clock: Clock) -> None:
    limits = SearchLimits(nodes=10)
    assert (limits.nodes_left(4), limits.nodes_left(12)) == (6, 0)
    assert (limits.stop(9), limits.stop(10), limits.stop(11)) == (None, Stop.NODES, Stop.NODES)
    clock.now += 1e9
    assert limits.stop(9) is None


def test_without_limits(clock: Clock) -> None:
    limits = SearchLimits()
    clock.now += 1e9
    assert (limits.seconds_left, limits.nodes_left(5), limits.stop(10**12)) == (math.inf, None, None)


def test_a_pause_takes_no_time_even_if_it_is_broken_off(clock: Clock) -> None:
    limits = SearchLimits(seconds=2.0)
    with limits.paused():
        clock.now += 60.0
    broken_off = limits.paused()
    broken_off.__enter__()
    clock.now += 60.0
    broken_off.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert limits.seconds_left == 2.0
    assert limits.begin == 100.0
