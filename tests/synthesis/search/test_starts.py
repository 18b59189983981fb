"""Many configurations: all certified, spread out, reproducible, never more than there are."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.answer import Reach, Stop
from handfast.model.region import Cap
from handfast.proofs.constants import RADIAN_LENGTH
from handfast.synthesis.distance import DISTINCT_DISTANCE, farthest, features, features_of
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.starts import START_BLOCK, Starts, Walks
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import grip, pinch


def test_every_one_is_certified_and_they_differ() -> None:
    answer = synthesize(pinch(), count=40)
    assert (answer.verdict, answer.stop, len(answer.solutions)) == (Reach.FOUND, Stop.COMPLETE, 40)
    assert answer.verify().ok
    at = features(answer.solutions)
    gaps = np.linalg.norm(at[:, None] - at[None], axis=2)[~np.eye(40, dtype=bool)]
    assert answer.spread == pytest.approx(gaps.min())
    first = synthesize(pinch()).solutions[0]
    assert np.array_equal(answer.solutions[0].q, first.q)


def test_selection_spreads_them() -> None:
    """Further apart than as many random starts as they come."""
    chosen = synthesize(pinch(), count=20)
    plain = Starts(TaskProblem.of(pinch()), 0).run()[:20]
    at = features_of(pinch(), np.array([c.x for c in plain]) * TaskProblem.of(pinch()).lengths)
    gaps = np.linalg.norm(at[:, None] - at[None], axis=2)[~np.eye(20, dtype=bool)]
    assert chosen.spread > 2 * gaps.min()


def test_the_same_seed_gives_the_same_many() -> None:
    a, b, c = (synthesize(pinch(), count=12, seed=s) for s in (5, 5, 6))
    assert np.array_equal(features(a.solutions), features(b.solutions))
    assert not np.array_equal(features(a.solutions), features(c.solutions))


def test_farthest_points() -> None:
    """On a line: first the start, then the far end, the middle, the quarters."""
    at = np.linspace(0, 1, 9)[:, None]
    assert farthest(at, 3).tolist() == [0, 8, 4]
    assert set(farthest(at, 5).tolist()) == {0, 2, 4, 6, 8}
    same = np.repeat([[0.0], [0.5 * DISTINCT_DISTANCE], [1.0]], 3, axis=0)
    assert farthest(same, 9).tolist() == [0, 6]


def test_distance_is_what_is_written() -> None:
    """A radian of a joint, 0.1 m, a turn, a contact point: each alone."""
    task = pinch()
    labels = list(synthesize(task).solutions[0].existence.coordinates)
    row = np.array([list(synthesize(task).solutions[0].existence.coordinates.values())])
    zero = features_of(task, row)

    def far(label: str, value: float) -> float:
        other = row.copy()
        other[0, labels.index(label)] = value
        return float(np.linalg.norm(features_of(task, other) - zero))

    here = dict(zip(labels, row[0], strict=True))
    assert far("joint:index_middle", here["joint:index_middle"] + 0.3) == pytest.approx(0.3)
    assert far("position:1", here["position:1"] + 0.02) == pytest.approx(0.02 / RADIAN_LENGTH)
    side = 0.02  # of the square that is touched
    assert far("contact:0:s", here["contact:0:s"] + 0.1) == pytest.approx(0.1 * side / RADIAN_LENGTH)
    turned = row.copy()
    i = labels.index("quaternion:0")
    turned[0, i : i + 4] = [1, 0, 0, 0]
    other = turned.copy()
    other[0, i : i + 4] = 2 * np.array([np.cos(0.2), 0, np.sin(0.2), 0])  # 0.4 rad, of another length
    gap = np.linalg.norm(features_of(task, other) - features_of(task, turned))
    assert gap == pytest.approx(2 * np.sin(0.2))


def test_prismatic_joints_count_as_lengths() -> None:
    task = grip(0.05)
    row = np.array([list(synthesize(task).solutions[0].existence.coordinates.values())])
    other = row + np.eye(row.shape[1])[0] * 0.01
    assert np.linalg.norm(features_of(task, other) - features_of(task, row)) == pytest.approx(0.01 / RADIAN_LENGTH)


def test_object_caps_have_their_contact_points() -> None:
    ball = Cap((0.01, 0, 0), 0.02, (0, 0, 1), 3.0)
    task = grip(0.05)
    task = type(task)(
        task.hand, (type(task.contact_pairs[0])("left_finger", task.contact_pairs[0].hand, ball),), task.pose
    )
    row = np.array([[0.01, 0, 0, 0, 1, 0, 0, 0, 0.7, 0.4]])
    d = ball.frame @ [np.sin(0.7) * np.cos(0.4), np.sin(0.7) * np.sin(0.4), np.cos(0.7)]
    assert features_of(task, row)[0, -3:] == pytest.approx((ball.center + 0.02 * d) / RADIAN_LENGTH)


def test_steps_stay_on_the_set_and_move() -> None:
    starts = Starts(TaskProblem.of(pinch()), 0)
    pool = starts.run(8)
    walks = Walks(starts)
    new = walks.run(pool)
    assert len(new) > 0.9 * 256
    lengths = starts.problem.lengths
    old = features_of(pinch(), np.array([c.x for c in pool]) * lengths)
    at = features_of(pinch(), np.array([c.x for c in new]) * lengths)
    nearest = np.linalg.norm(at[:, None] - old[None], axis=2).min(axis=1)
    assert np.median(nearest) > 0.1
    proofs = [c.existence(starts.problem) for c in new[:20]]
    from handfast.synthesis.solution import verify_existence

    assert all(verify_existence(pinch(), p).ok for p in proofs)


def test_blocks_of_starts_are_independent_of_how_many_are_taken() -> None:
    p = TaskProblem.of(pinch())
    one, many = Starts(p, 7), Starts(p, 7)
    first, all_of_it = one.run(1), many.run()
    assert np.array_equal(first[0].x, all_of_it[0].x)
    later = Starts(p, 7, block=1)
    assert np.array_equal(many.run()[0].x, later.run()[0].x)
    assert (later.count, many.count) == (2 * START_BLOCK, 2 * START_BLOCK)


def test_no_more_than_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where only what is far apart counts as different, fewer come than were asked for, and it says so."""
    monkeypatch.setattr("handfast.synthesis.distance.DISTINCT_DISTANCE", 2.0)
    answer = synthesize(pinch(), count=60)
    assert (answer.verdict, answer.stop) == (Reach.FOUND, Stop.RESOLUTION)
    assert 2 <= len(answer.solutions) < 60
    assert answer.spread >= 2.0
