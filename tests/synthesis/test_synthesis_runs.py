"""Synthesis is reproducible, can be stopped, and goes on where it stopped."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.core import answer as search_limits
from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.synthesis import query
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.prover import Disproof
from handfast.synthesis.synthesis_answer import Synthesis
from tests.support.holds import LARGE, OPEN, grip, pinch


def test_the_same_seed_finds_the_same(pinched: Synthesis) -> None:
    again, other = synthesize(pinch()), synthesize(pinch(), seed=1)
    assert np.array_equal(again.solutions[0].q, pinched.solutions[0].q)
    assert not np.array_equal(other.solutions[0].q, pinched.solutions[0].q)
    state = np.random.get_state()[1].copy()  # noqa: NPY002 - that it is not touched is the point
    synthesize(pinch(), count=3)
    assert np.array_equal(np.random.get_state()[1], state)  # noqa: NPY002


@pytest.mark.parametrize("looks", [1, 10])
def test_a_time_limit_leaves_it_undecided(looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the random starts, and in the search for a contradiction; on a clock that goes on when it is looked at."""
    clock = itertools.count()
    monkeypatch.setattr(search_limits, "time", SimpleNamespace(monotonic=lambda: float(next(clock))))
    answer = synthesize(pinch(LARGE), timeout=float(looks))
    assert (answer.verdict, answer.stop) == (Reach.UNDECIDED, Stop.TIME)
    assert (answer.searched is None) == (looks == 1)
    assert answer.state


@pytest.mark.parametrize("when", [1, 3])
def test_ctrl_c_keeps_what_was_reached(when: int) -> None:
    """In the random starts, and in the search for a contradiction."""
    seen = []

    def step(progress: query.Progress) -> None:
        seen.append(progress)
        if len(seen) == when:
            raise KeyboardInterrupt

    answer = synthesize(grip(OPEN), timeout=None, on_progress=step)
    assert (answer.verdict, answer.stop) == (Reach.UNDECIDED, Stop.INTERRUPTED)
    again = synthesize(grip(OPEN), resume=answer, timeout=None, nodes=1)
    assert again.starts >= answer.starts


def test_ctrl_c_keeps_those_of_many_that_were_found() -> None:
    def step(progress: query.Progress) -> None:
        if progress.found >= 5:
            raise KeyboardInterrupt

    answer = synthesize(pinch(), count=1000, on_progress=step)
    assert (answer.verdict, answer.stop) == (Reach.FOUND, Stop.INTERRUPTED)
    assert 5 <= len(answer.solutions) < 1000
    assert all(solution.verify().ok for solution in answer.solutions[:20])


def test_resumed_where_it_stopped(undecided: Synthesis, tmp_path: Path) -> None:
    """From a file and from the answer, and in the end as without the stop."""
    path = tmp_path / "s.json"
    undecided.save(path)
    again = synthesize(pinch(LARGE), resume=path, timeout=None, nodes=2000, seed=99)
    assert again.verdict is Reach.UNDECIDED
    assert again.nodes >= undecided.nodes + 2000
    assert again.seed == undecided.seed == 3
    assert again.state["block"] >= undecided.state["block"]
    ended = synthesize(pinch(LARGE), resume=again, timeout=None)
    assert (ended.verdict, ended.stop) == (Reach.NONE, Stop.COMPLETE)
    assert ended.nodes > again.nodes


def test_only_an_undecided_answer_of_the_same_task_is_resumed(undecided: Synthesis, found: Synthesis) -> None:
    with pytest.raises(InputError, match=r"^resume: is answered, FOUND; only an UNDECIDED one can go on$"):
        synthesize(grip(0.05), resume=found)
    for other in (pinch(LARGE + 1e-9), pinch(LARGE, limits={"index_proximal": (0.0, 0.3)}), grip(0.05)):
        with pytest.raises(
            InputError, match=r"^resume: is of another task: its hand, limits, bounds or regions differ"
        ):
            synthesize(other, resume=undecided)


class Scripted:
    """A prover that says what it is told, so that the turns of both searches can be seen."""

    script: list[bool]
    asked: list[dict[str, Any]]

    def __init__(self, problem: Any, *, workers: int = 2) -> None:
        self.nodes = 0

    def restore(self, state: dict[str, Any]) -> None:
        self.asked.append({"restored": state})

    def run(self, *, seconds: float, nodes: int | None, on_progress: Any) -> Disproof:
        self.asked.append({"seconds": seconds, "nodes": nodes})
        self.nodes += 10
        empty = self.script.pop(0)
        return Disproof(empty, "contacts 0 and 1", self.nodes, 0.5, 1, 7, 0.1, 0.2)

    def save(self) -> dict[str, Any]:
        return {"at": self.nodes}

    def leaves(self) -> np.ndarray:
        return np.zeros((0, 1))


def test_none_only_if_the_prover_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.synthesis.search.prover.Prover", Scripted)
    Scripted.script, Scripted.asked = [False, False, True], []
    answer = synthesize(grip(OPEN), timeout=None)
    assert (answer.verdict, answer.nodes, answer.state) == (Reach.NONE, 30, {})
    assert [a["seconds"] for a in Scripted.asked] == [0.0, query.FIRST_TURN_SECONDS, 2 * query.FIRST_TURN_SECONDS]
    Scripted.script, Scripted.asked = [False, False], []
    answer = synthesize(grip(OPEN), timeout=None, nodes=20)
    assert (answer.verdict, answer.stop, answer.state["prover"]) == (Reach.UNDECIDED, Stop.NODES, {"at": 20})
    Scripted.script, Scripted.asked = [True], []
    assert synthesize(grip(OPEN), timeout=None, resume=answer).verdict is Reach.NONE
    assert Scripted.asked[0] == {"restored": {"at": 20}}


def test_what_random_starts_find_ends_the_search_for_a_contradiction(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.synthesis.search.prover.Prover", Scripted)
    monkeypatch.setattr(query, "FIRST_BLOCKS", 0)
    Scripted.script, Scripted.asked = [False, False], []
    answer = synthesize(grip(0.05), timeout=None)
    assert (answer.verdict, answer.stop, len(Scripted.asked)) == (Reach.FOUND, Stop.COMPLETE, 1)
