"""What the checker shows to be impossible pose by pose: never a planted configuration, and what plainly cannot be."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs import pose_by_pose
from handfast.proofs.impossibility import Impossibility
from handfast.proofs.pose_by_pose import impossible_at_every_pose
from handfast.proofs.replay import Refused
from tests.proofs.test_impossibility import CASES, away, planted
from tests.support.holds import flat_grip, grip, pinch, turned
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
        value = np.array([[1.0, -2.0], [np.nan, 1.0], [0.0, 0.0], [1.0, 1.0], [np.inf, 1.0], [1.0, 1.0], [1.0, 1.0]])
        slope = np.ones((7, 3, 2))
        slope[3], slope[5, 0, 0], slope[6] = np.inf, np.inf, 0.0
        factors = pose_by_pose._factors(value, slope, np.ones((7, 3)))
    assert np.isfinite(factors).all()
    assert np.abs(factors[0]).max() == 1.0
    assert not factors[1:].any()


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_the_factors_of_a_row_by_hand(size: float) -> None:
    """Of two rows of one side each, 2 and 6 wide: each over its width twice, the largest of them is 1."""
    slope = size * np.array([[[1.0, 0], [0, 2], [0, 0]]] * 2)
    factors = pose_by_pose._factors(np.array([[4.0, -72], [5, 45]]), slope, np.array([[2.0, 3, 5]] * 2))
    np.testing.assert_allclose(factors, np.array([[0.5, -1], [1, 1]]))


def test_rows_that_go_together_have_factors_that_part_them() -> None:
    slope = 1e6 * np.array([[[1.0, 1], [0, 0], [0, 0]]])
    factors = pose_by_pose._factors(np.array([[3.0, -3]]), slope, np.ones((1, 3)))
    np.testing.assert_allclose(factors, [[1, -1]])


# --- one contact ------------------------------------------------------------------------------------------


def of_grip(side: int = 0, flat: bool = False) -> pose_by_pose._Contact:
    return pose_by_pose._contacts(data_of(flat_grip(0.05) if flat else grip(0.05)))[side]


def box_of(contact: pose_by_pose._Contact, **sides: list[float]) -> Array:
    """(1, n, 2) the object anywhere within 0.1 m and not turned, but for the sides that are named."""
    box = contact.root.copy()
    ends = {f"position:{i}": [-0.1, 0.1] for i in range(3)} | {f"quaternion:{i}": [0.0, 0.0] for i in range(1, 4)}
    for label, its in (
        ends | {"quaternion:0": [1.0, 1.0]} | {k.replace("_", ":"): x for k, x in sides.items()}
    ).items():
        box[contact.equations.column[label]] = its
    return box[None]


def narrowed(contact: pose_by_pose._Contact, box: Array) -> tuple[list[bool], Array]:
    with np.errstate(all="ignore"):
        alive, left, _ = contact.narrowed(box)
    return alive.tolist(), left


def test_units_of_a_contact() -> None:
    """A gap of 50 mm, a cosine of 1; the cosine of what faces is at least 0, or that of the cap's angle of 1."""
    flat, round_ = of_grip(flat=True), of_grip()
    assert flat.facing == 0.5
    assert round_.facing == (1 + np.cos(1.0)) / 2
    assert flat.unit.tolist() == [0.05, 0.05, 0.05, 1, 1, np.inf, 1]
    assert round_.unit.tolist() == [0.05, 0.05, 0.05, np.inf, 1]


def test_the_angle_at_which_hand_and_object_face_each_other_narrows_a_turn() -> None:
    """About x by 2 atan(0.3 to 0.8), of which the cap allows 1: a quaternion of up to tan(1/2), 0.5463."""
    contact = of_grip()
    k = contact.equations.column["quaternion:1"]
    alive, left = narrowed(contact, box_of(contact, quaternion_1=[0.3, 0.8]))
    assert alive == [True]
    assert left[0, k, 0] == 0.3
    assert np.tan(0.5) <= left[0, k, 1] < 0.55
    assert narrowed(contact, box_of(contact, quaternion_1=[0.6, 0.8]))[0] == [False]


@pytest.mark.parametrize("ends", [[-0.9, -0.8], [0.8, 0.9]])
@pytest.mark.parametrize("axis", range(3))
def test_an_object_that_is_away_on_either_side_is_not_touched(axis: int, ends: list[float]) -> None:
    for side in (0, 1):
        assert narrowed(of_grip(side), box_of(of_grip(side), **{f"position_{axis}": ends}))[0] == [False]


def test_what_is_beyond_a_bound_is_no_place_and_what_is_at_it_is_one() -> None:
    """0 to 40 mm, of the left slide and of the right one that follows it."""
    contact = of_grip()
    column = contact.equations.column["joint:left_slide"]
    cases = {(0.0, 0.0): True, (0.04, 0.04): True, (0.041, 0.05): False, (-0.01, -0.001): False, (-0.01, 0.0): True}
    for ends, there in cases.items():
        box = box_of(contact)
        box[0, column] = ends
        assert narrowed(contact, box)[0] == [there]
    for edge in (0.0, 1.0):  # of the object's region
        assert narrowed(contact, box_of(contact, contact_0_s=[edge, edge]))[0] == [True]


def test_a_box_that_is_empty_leaves_others_alone() -> None:
    contact = of_grip()
    boxes = np.concatenate([box_of(contact), box_of(contact, position_0=[1e-3, -1e-3]), box_of(contact)])
    assert narrowed(contact, boxes)[0] == [True, False, True]


def left_of(contact: pose_by_pose._Contact, own: Array) -> pose_by_pose._Left:
    with np.errstate(all="ignore"):
        return contact.left(box_of(contact)[:, contact.outer], [own])


def test_a_contact_without_boxes_is_nowhere() -> None:
    contact = of_grip()
    looked = left_of(contact, box_of(contact)[:0])
    assert (looked.alive.tolist(), looked.boxes, len(looked.own[0])) == ([False], 0, 0)


def test_the_own_side_that_blurs_most_is_halved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pose_by_pose, "OWN", 0.01)
    monkeypatch.setattr(pose_by_pose, "HALVING_ROUNDS", 1)
    contact = of_grip()
    for name, others in (("s", "t"), ("t", "s")):
        looked = left_of(contact, box_of(contact, **{f"contact_0_{others}": [0.4, 0.5]}))
        assert looked.boxes == 3  # it, and both halves
        at = [contact.equations.column[f"contact:0:{x}"] for x in (name, others)]
        (cut, kept), (after, too) = looked.own[0][:, at].tolist()
        assert cut[0] < cut[1] - 0.1 < after[1] - 0.2
        assert cut[1] == pytest.approx(after[0])
        assert kept == too == [0.4, 0.5]


def test_own_boxes_are_halved_up_to_a_number_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside one that is a point, and is not halved, one becomes 2, these 4: together 5, of at least 4."""
    monkeypatch.setattr(pose_by_pose, "OWN", 0.01)
    contact = of_grip()
    point = box_of(contact, contact_0_s=[0.5, 0.5], contact_0_t=[0.5, 0.5])
    for most, looked_at, remain in ((2, 2, 2), (3, 2 + 2, 3), (4, 2 + 2 + 4, 5), (5, 2 + 2 + 4, 5)):
        monkeypatch.setattr(pose_by_pose, "MAX_CONTACT_BOXES", most)
        looked = left_of(contact, np.concatenate([point, box_of(contact)]))
        assert (looked.boxes, len(looked.own[0])) == (looked_at, remain)


# --- all of them ------------------------------------------------------------------------------------------


def test_only_joints_of_several_contacts_are_shared() -> None:
    """The gripper's left slide moves both fingers; index and thumb have nothing in common."""
    assert pose_by_pose._labels(data_of(grip(0.05)))[:-7] == ["joint:left_slide"]
    assert pose_by_pose._labels(data_of(pinch()))[:-7] == []


@dataclass
class Anywhere:
    """A contact that can be made everywhere but where the second side is a point; it notes the boxes of poses."""

    reach: list[float]
    nowhere: bool = False
    seen: list[Array] = field(default_factory=list)
    decided: int = 0

    def left(self, poses: Array, own: list[Array]) -> pose_by_pose._Left:
        self.seen += list(poses)
        alive = (poses[:, 1, 1] > poses[:, 1, 0]) & (not self.nowhere)
        return pose_by_pose._Left(alive, poses, np.tile(self.reach, (len(poses), 1)), own, len(poses))


def planned(monkeypatch: pytest.MonkeyPatch, contacts: list[Anywhere], *poses: Any) -> None:
    """Instead of the contacts of a task, and of its charts."""
    own = (np.zeros((1, 1, 2)),) * len(contacts)
    charts = [pose_by_pose._PoseBox(np.array(pose, dtype=float), own, 1 / len(poses)) for pose in poses]
    monkeypatch.setattr(pose_by_pose, "_contacts", lambda task: contacts)
    monkeypatch.setattr(pose_by_pose, "_charts", lambda task: iter(charts))


@pytest.mark.parametrize(
    ("budget", "boxes", "discarded"), [(1, 2, 0.25), (2, 2, 0.25), (3, 3, 0.5), (4, 4, 0.75), (5, 5, 1)]
)
def test_the_contact_that_decided_is_looked_at_first(
    monkeypatch: pytest.MonkeyPatch, budget: int, boxes: int, discarded: float
) -> None:
    """One by one: both contacts in the first chart, then only the second, which is nowhere."""
    monkeypatch.setattr(pose_by_pose, "POSE_BATCH", 1)
    planned(monkeypatch, [Anywhere([1, 1]), Anywhere([1, 1], nowhere=True)], *[[[0.0, 1], [0, 1]]] * 4)
    done = impossible_at_every_pose(data_of(grip(0.05)), boxes=budget)
    assert done == Impossibility(budget == 5, boxes, discarded)


def test_the_contact_that_decided_most_is_looked_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three points and a box that remains open: the first decides of three at once, the second of nothing else."""
    contacts = [Anywhere([1, 1]), Anywhere([1, 1], nowhere=True)]
    monkeypatch.setattr(pose_by_pose, "POSE_BATCH", 3)
    planned(monkeypatch, contacts, *[[[0.0, 1], [0, 1]]] * 2, *[[[0.0, 1], [0, 0]]] * 3)
    done = impossible_at_every_pose(data_of(grip(0.05)))
    assert done == Impossibility(True, 3 + 2 + 2, 1.0)
    assert [contact.decided for contact in contacts] == [3, 2]


@pytest.mark.parametrize(
    ("reach", "cut"),
    [([3, 1], 0), ([1, 3], 1), ([np.inf, 1], 1), ([np.nan, 1], 1), ([3, np.inf], 1), ([np.inf, np.inf], 1)],
)
def test_the_side_is_cut_that_changes_most_or_else_the_longest(
    monkeypatch: pytest.MonkeyPatch, reach: list[float], cut: int
) -> None:
    contact = Anywhere(reach)
    planned(monkeypatch, [contact], [[0, 1], [0, 4]])
    assert impossible_at_every_pose(data_of(grip(0.05)), boxes=2) == Impossibility(False, 3, 0.0)
    halves = [[[0, 0.5], [0, 4]], [[0.5, 1], [0, 4]]] if cut == 0 else [[[0, 1], [0, 2]], [[0, 1], [2, 4]]]
    assert np.array(contact.seen[1:]).tolist() == halves


@pytest.mark.parametrize(
    ("sides", "boxes"), [([0.25, 0.5], 2), ([0.25, 1.0], 2 + 2), ([0.5, 0.5], 2 + 2), ([1.0, 1.0], 2 + 2 + 4 + 8)]
)
def test_sides_that_are_small_beside_those_of_the_first_chart_end_it(
    monkeypatch: pytest.MonkeyPatch, sides: list[float], boxes: int
) -> None:
    """Half of 0.5, and half of 1 where the first one's is a point."""
    monkeypatch.setattr(pose_by_pose, "MIN_BOX_SHARE", 0.5)
    contact = Anywhere([np.inf, np.inf])
    planned(monkeypatch, [contact], [[0, 0.5], [2, 2]], [[0, side] for side in sides])
    assert impossible_at_every_pose(data_of(grip(0.05)), boxes=100) == Impossibility(False, boxes, 0.5)
    assert np.ptp(contact.seen[-1], axis=1).tolist() == [0.25, 0.5]


def test_links_that_do_not_stand_at_rotations_are_refused() -> None:
    task = data_of(turned(grip(0.05)))
    bent = task.hand.poses * np.array([[1.1, 1, 1, 1]] * 3 + [[1, 1, 1, 1]])
    with pytest.raises(Refused, match="rotation"):
        impossible_at_every_pose(replace(task, hand=replace(task.hand, poses=bent)))
