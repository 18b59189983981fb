"""What is asked: the stages of an answer, maps that are kept, and requests that nobody waits for any more."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import pytest

from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.pictures.live import answering
from handfast.pictures.live.answering import LIVE_DIRECTIONS, Reply, answer
from handfast.pictures.live.live_session import LatestRequest
from handfast.pictures.live.view_state import ViewState
from tests.support.viewed import jaws, replies, until


def test_stages_end_in_the_numbers_found_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answering, "OF_MAP", replace(answering.OF_MAP, timeout=math.inf))
    state = ViewState.of(jaws()).with_plane("yz").pulled([0, 0, -9.0])
    told = replies(state)
    first, last = told[0], told[-1]
    assert first.verdict is Verdict.HOLDS
    assert first.most is None
    assert last.check is not None
    assert last.most is not None
    assert last.map is not None
    assert last.most.lower == pytest.approx(10.0, rel=1e-2)
    assert last.replayed
    assert last.check.verify().ok
    assert len(last.map.known) == len(last.map.directions)
    assert last.map.known.tolist() == list(range(LIVE_DIRECTIONS))
    assert last.map.sizes == pytest.approx(10.0, rel=1e-2)  # friction alone: the same all around
    assert told[2].map is not None
    assert len(told[2].map.known) == LIVE_DIRECTIONS // 6
    again = replies(state.with_force(11.0), before=last)
    assert again[0].verdict is Verdict.SLIPS
    assert again[0].map is last.map  # a map of the same plane is not asked for twice
    assert len(again) == 3


def test_a_verdict_is_told_even_if_it_is_outdated_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answering, "VERDICT_TIMEOUT", math.inf)
    told = replies(ViewState.of(jaws()), outdated=lambda: True)
    assert [(r.most, r.map) for r in told] == [(None, None)]


def test_an_outdated_verdict_that_takes_long_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answering, "VERDICT_TIMEOUT", -math.inf)
    told: list[Reply] = []
    answer(ViewState.of(jaws()), None, lambda: True, told.append)
    assert told == []


def test_a_map_that_was_left_is_taken_up() -> None:
    state = ViewState.of(jaws()).with_plane("yz")
    told: list[Reply] = []
    answer(state, None, lambda: bool(told and told[-1].map), told.append)
    part = told[-1]
    assert part.map is not None
    assert 0 < len(part.map.known) < LIVE_DIRECTIONS
    whole = replies(state, before=part)[-1]
    assert whole.map is not None
    assert len(whole.map.known) == len(whole.map.directions)


def test_the_newest_request_is_next_and_faults_do_not_end_the_thread() -> None:
    begun, go, done, faults = threading.Event(), threading.Event(), [], []

    def work(request: int, outdated: object) -> None:
        begun.set()
        go.wait()
        if request == 3:
            raise InputError("no")
        done.append(request)
        requests.answered()

    requests: LatestRequest[int] = LatestRequest(work, faults.append)
    requests.ask(0)
    begun.wait()
    requests.ask(1)
    requests.ask(2)  # passes over 1
    assert requests.outdated()
    assert requests.waited > 0
    go.set()
    until(lambda: done == [0, 2])
    assert requests.waited == 0
    requests.ask(3)
    until(lambda: faults)
    requests.ask(4)
    until(lambda: done == [0, 2, 4])
    requests.close()
    assert requests.outdated()
