"""What the checker shows to be impossible pose by pose: never a planted configuration, and what plainly cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs import pose_by_pose
from handfast.proofs.pose_by_pose import impossible_at_every_pose
from handfast.proofs.replay import Refused
from tests.proofs.test_impossibility import CASES, away, planted
from tests.support.holds import grip, pinch, turned
from tests.support.planted_proofs import PlantedProof, data_of


def in_a_chart(case: PlantedProof) -> dict[str, float]:
    """Its coordinates by label, the quaternion with its largest component 1."""
    out = dict(case.values)
    turn = np.array([out[f"quaternion:{i}"] for i in range(4)])
    return out | {f"quaternion:{i}": float(q) for i, q in enumerate(turn / turn[np.abs(turn).argmax()])}


def around(x: Array, root: Array, size: float, rng: np.random.Generator) -> Array:
    """(20, n, 2) boxes within the root, with x in them."""
    wide = np.where(np.isfinite(np.ptp(root, axis=1)), np.ptp(root, axis=1), 1.0)
    ends = [x + sign * size * rng.random((20, len(x))) * wide for sign in (-1, 1)]
    return np.clip(np.stack(ends, axis=2), root[:, :1], root[:, 1:])


@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3, 1e-7])
@pytest.mark.parametrize(("kind", "seed"), CASES[::2])
def test_boxes_around_a_planted_configuration_keep_it(kind: str, seed: int, size: float) -> None:
    case, rng = planted(kind, seed), np.random.default_rng(seed)
    values, task = in_a_chart(case), data_of(case.task)
    with np.errstate(all="ignore"):
        for k, contact in enumerate(pose_by_pose._contacts(task)):
            labels = [label.replace("contact:0:", f"contact:{k}:") for label in contact.equations.column]
            x, root = np.array([values[label] for label in labels]), contact.root.copy()
            root[contact.outer] = [[values[labels[i]] - 0.3, values[labels[i]] + 0.3] for i in contact.outer.tolist()]
            alive, left, _ = contact.narrowed(around(x, root, size, rng))
            assert alive.all()
            assert ((left[..., 0] <= x + 1e-9) & (x - 1e-9 <= left[..., 1])).all()


@pytest.mark.parametrize(("kind", "seed"), CASES[::4])
def test_a_box_of_poses_keeps_the_planted_one_in_some_box_of_each_contact(kind: str, seed: int) -> None:
    """From the whole of a contact's own coordinates, halved as they are in a search."""
    case = planted(kind, seed)
    values, task = in_a_chart(case), data_of(case.task)
    labels = pose_by_pose._labels(task)
    pose = np.array([values[label] for label in labels])
    with np.errstate(all="ignore"):
        for size in (0.3, 1e-2):
            poses = np.stack([pose - size, pose + 0.7 * size], axis=1)[None]
            for k, contact in enumerate(pose_by_pose._contacts(task)):
                own = contact.root.copy()
                own[contact.outer] = poses[0, contact.pose]
                left = contact.left(poses, [own[None]])
                assert left.alive.all()
                assert ((left.poses[0, :, 0] <= pose + 1e-9) & (pose - 1e-9 <= left.poses[0, :, 1])).all()
                its = [label.replace("contact:0:", f"contact:{k}:") for label in contact.equations.column]
                x, boxes = np.array([values[label] for label in its]), left.own[0]
                assert ((boxes[..., 0] <= x + 1e-9) & (x - 1e-9 <= boxes[..., 1])).all(axis=1).any()


@pytest.mark.parametrize(("kind", "seed"), CASES[1::4])
def test_what_is_possible_is_never_shown_impossible(kind: str, seed: int) -> None:
    done = impossible_at_every_pose(data_of(planted(kind, seed).task), boxes=1000)
    assert not done.shown
    assert done.discarded < 1


def test_what_cannot_be_is_shown() -> None:
    done = impossible_at_every_pose(data_of(turned(grip(0.05))))
    assert (done.shown, done.discarded) == (True, 1.0)
    assert done.boxes < 5000
    far = impossible_at_every_pose(data_of(pinch(pose=away(0.5))))
    assert far.shown
    assert far.boxes == 4  # no finger comes near, whichever way the object is turned


def test_halves_leave_nothing_out_and_charts_hold_all_rotations() -> None:
    charts = list(pose_by_pose._charts(data_of(grip(0.05))))
    assert [one.share for one in charts] == [0.25] * 4
    assert [one.pose[-4:].tolist() for one in charts] == [
        [[1.0, 1.0] if i == k else [-1.0, 1.0] for i in range(4)] for k in range(4)
    ]
    for cut in range(3):
        low, high = charts[1].halves(cut)
        assert low.pose[cut, 0] == charts[1].pose[cut, 0]
        assert low.pose[cut, 1] == high.pose[cut, 0]
        assert high.pose[cut, 1] == charts[1].pose[cut, 1]
        assert low.share + high.share == charts[1].share
        assert all(a is b is c for a, b, c in zip(low.own, high.own, charts[1].own, strict=True))
        np.testing.assert_array_equal(np.delete(low.pose, cut, 0), np.delete(charts[1].pose, cut, 0))


def test_a_budget_ends_it() -> None:
    done = impossible_at_every_pose(data_of(turned(grip(0.05))), boxes=500)
    assert not done.shown
    assert 0 < done.discarded < 1
    assert 500 <= done.boxes < 1500


def test_boxes_that_are_small_beside_the_whole_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four charts are as large as the whole, and each of two contacts may be made in all of them."""
    monkeypatch.setattr(pose_by_pose, "MIN_BOX_SHARE", 1.0)
    done = impossible_at_every_pose(data_of(grip(0.05)))
    assert (done.shown, done.boxes, done.discarded) == (False, 8, 0.0)


def test_joints_that_several_contacts_share_belong_to_the_pose() -> None:
    task = data_of(planted(*CASES[0]).task)
    labels = pose_by_pose._labels(task)
    assert labels[-7:] == [*(f"position:{i}" for i in range(3)), *(f"quaternion:{i}" for i in range(4))]
    shared = {label.removeprefix("joint:") for label in labels[:-7]}
    for k, contact in enumerate(pose_by_pose._contacts(task)):
        its = {task.hand.joints[j] for j in task.part([k]).free}
        inner = {list(contact.equations.column)[i] for i in contact.inner.tolist()}
        assert {f"joint:{j}" for j in its - shared} <= inner
        assert not inner & set(labels)


def test_the_factors_of_a_row_are_finite_where_rows_are_not() -> None:
    with np.errstate(all="ignore"):
        value = np.array([[1.0, -2.0], [np.nan, 1.0], [0.0, 0.0], [1.0, 1.0], [np.inf, 1.0]])
        slope = np.ones((5, 3, 2))
        slope[3] = np.inf
        factors = pose_by_pose._factors(value, slope, np.ones((5, 3)))
    assert np.isfinite(factors).all()
    assert np.abs(factors[0]).max() == 1.0
    assert not factors[2].any()


def test_links_that_do_not_stand_at_rotations_are_refused() -> None:
    task = data_of(turned(grip(0.05)))
    bent = task.hand.poses * np.array([[1.1, 1, 1, 1]] * 3 + [[1, 1, 1, 1]])
    with pytest.raises(Refused, match="rotation"):
        impossible_at_every_pose(replace(task, hand=replace(task.hand, poses=bent)))
