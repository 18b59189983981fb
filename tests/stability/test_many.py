"""Many maxima at once are the maxima one by one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.core.parallel import WorkerPool
from handfast.proofs.checker import verify
from handfast.readers.grasp_file import load_grasp
from handfast.stability import many
from handfast.stability.grasp_limits import GraspLimits
from handfast.stability.many import max_answers
from handfast.stability.queries import MaxAnswer, maximum
from handfast.stability.settings import Settings
from tests.support.problems import bell, pinch, table
from tests.support.slow_cases import slow_after

CIRCLE = [[np.cos(a), np.sin(a), 0, 0, 0, 0] for a in np.linspace(0, 2 * np.pi, 24, endpoint=False)]


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("make", slow_after(1, [pinch, bell]))
def test_neighbours_help_but_do_not_change_the_answer(make, jobs: int) -> None:
    """Shared reductions and first guesses: the bounds of both ways overlap, verdicts are the same."""
    grasp = make()
    for direction, answer in zip(CIRCLE, max_answers(grasp, CIRCLE, jobs=jobs), strict=True):
        alone = maximum(grasp, direction)
        assert (answer.verdict, answer.unbounded, answer.stop) == (alone.verdict, alone.unbounded, alone.stop)
        assert answer.lower <= alone.upper * (1 + 1e-9)
        assert alone.lower <= answer.upper * (1 + 1e-9)
        if answer.witness:
            assert answer.witness.valid
            np.testing.assert_allclose(answer.witness.wrench, answer.lower * np.array(direction), rtol=3e-9, atol=1e-12)


def test_every_bound_is_certified() -> None:
    for answer in max_answers(bell(), CIRCLE):
        if not answer.unbounded:
            assert verify(answer.certificate).ok


@pytest.mark.slow
def test_processes_and_threads_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    grasp, directions = bell(), CIRCLE
    monkeypatch.setattr("handfast.stability.many.FEW", len(directions) - 1)
    monkeypatch.setattr("handfast.stability.many.BLOCK", 7)  # as many as that know of each other
    ways = [max_answers(grasp, directions, jobs=2)]
    monkeypatch.setattr("handfast.core.parallel.START", "spawn")
    ways.append(max_answers(grasp, directions, jobs=2))
    ways.append(max_answers(grasp, directions, jobs=1))
    for first, *others in zip(*ways, strict=True):
        for answer in others:
            assert (answer.lower, answer.upper, answer.nodes) == (first.lower, first.upper, first.nodes)
        assert first.witness.valid
        assert first.unbounded or verify(first.certificate).ok


def test_solvers_of_algorithm1_are_not_for_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[int, bool]] = []

    class Pool(WorkerPool):
        def __init__(self, shared: object, jobs: int, *, threads: bool) -> None:
            super().__init__(shared, jobs, threads=threads)
            seen.append((self.jobs, threads))

        def map(self, *_: object) -> Iterator[list[MaxAnswer]]:
            return iter(())

    monkeypatch.setattr("handfast.core.parallel.START", "spawn")
    monkeypatch.setattr(many, "WorkerPool", Pool)
    max_answers(bell(), CIRCLE, settings=Settings(method="algorithm1"), jobs=4)
    max_answers(bell(), CIRCLE, jobs=4)
    assert seen == [(1, True), (4, True)]


def test_ctrl_c_leaves_none_in_processes_either() -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    answers = max_answers(pinch(), CIRCLE * 4, jobs=2, on_item=stop)
    assert answers[0] is not None
    assert answers[-1] is None


def test_base_loads_and_limits() -> None:
    answers = max_answers(table(), [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0]], base=[0, 0, -10, 0, 0, 0])
    assert [a.lower for a in answers] == pytest.approx([4.0, 4.0], rel=1e-3)
    (pressed,) = max_answers(table(), [[0, 0, -1, 0, 0, 0]], limits=GraspLimits(force_limit=2.0))
    assert pressed.lower == pytest.approx(8.0, rel=1e-3)


def test_ctrl_c_leaves_none() -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    answers = max_answers(pinch(), CIRCLE, jobs=1, on_item=stop)
    assert answers[0] is not None
    assert answers[-1] is None


def test_limits_hold_for_each(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = max_answers(bell(), CIRCLE[:3], settings=Settings(node_limit=3))
    assert {a.stop for a in answers} <= {Stop.NODES, Stop.COMPLETE}
    assert Stop.NODES in {a.stop for a in answers}


def test_bad_directions() -> None:
    with pytest.raises(InputError, match="direction: has 2 numbers; six are needed"):
        max_answers(pinch(), [[0, 1]])
    with pytest.raises(InputError, match="direction: is zero"):
        max_answers(pinch(), [[0, 1, 0, 0, 0, 0], [0] * 6])


@pytest.mark.parametrize("length", slow_after(2, [1e-6, 1e6, 1e-3, 1.0, 1e3]))
def test_the_length_of_a_direction_is_a_unit(length: float) -> None:
    """However long the direction is given, the force resisted is the same 2.2222 N, and so is its proof."""
    answer = maximum(bell(), length * np.array([0, 1.0, 0, 0, 0, 0]))
    assert answer.lower * length == pytest.approx(0.2 / 0.09, rel=1e-3)
    assert answer.upper * length == pytest.approx(0.2 / 0.09, rel=1.1e-3)
    assert verify(answer.certificate).ok
    np.testing.assert_allclose(answer.witness.wrench[1], answer.lower * length, rtol=3e-9)
    loaded = maximum(table(), [length, 0, 0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0])
    assert loaded.lower * length == pytest.approx(4.0, rel=1e-3)
    assert verify(loaded.certificate).ok
    pressed = maximum(table(), [0, 0, -length, 0, 0, 0], limits=GraspLimits(force_limit=2.0))
    assert pressed.lower * length == pytest.approx(8.0, rel=1e-3)
    (first, second) = max_answers(bell(), [[0, length, 0, 0, 0, 0], [0, 1e3 * length, 0, 0, 0, 0]], jobs=1)
    assert first.lower == pytest.approx(1e3 * second.lower, rel=1e-3)


def test_a_finished_tree_helps_the_next_direction() -> None:
    """A degree each: most leaves close as they are, and what comes out is proved as ever."""
    grasp, turn = load_grasp("fig7"), np.radians(np.arange(40, 43))
    circle = np.column_stack([np.cos(turn), np.sin(turn), *np.zeros((4, len(turn)))])
    answers = max_answers(grasp, circle, jobs=1)
    alone = [maximum(grasp, w) for w in circle]
    assert answers[0].nodes == alone[0].nodes
    assert sum(a.nodes for a in answers) < 0.8 * sum(a.nodes for a in alone)
    for answer, other in zip(answers, alone, strict=True):
        assert answer.witness.valid
        assert answer.gap <= 1e-3
        assert answer.lower == pytest.approx(other.lower, rel=1e-3)
        assert verify(answer.certificate).ok
