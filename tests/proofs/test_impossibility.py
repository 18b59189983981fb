"""What the checker shows to be impossible by itself: never a planted configuration, and what plainly cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.impossibility import Conditions, Impossibility, impossible
from handfast.proofs.replay import Refused
from handfast.synthesis.task import PoseBounds, Task
from tests.support.holds import LARGE, OPEN, flat_grip, grip, pinch, turned
from tests.support.planted_proofs import PlantedProof, data_of, limited, odd_case, pose_of, sah_case
from tests.support.slow_cases import slow_after

CASES = [*(("sah", k) for k in range(6)), *(("odd", k) for k in range(6))]


def planted(kind: str, seed: int) -> PlantedProof:
    """With bounds about where the object's origin is, and how it stands."""
    case = sah_case(seed) if kind == "sah" else odd_case(seed)
    at = np.array([case.values[f"position:{i}"] for i in range(3)])
    axes = np.clip(pose_of(case)[0].T[..., None] + [-0.3, 0.2], -1, 1)
    bounds = PoseBounds(at[:, None] + [-0.02, 0.03], axes)
    return replace(case, task=replace(case.task, pose=bounds))


def coordinates(case: PlantedProof) -> Array:
    """(n,) in the order of the conditions: the object's orientation is none of theirs."""
    return np.array([x for label, x in case.values.items() if not label.startswith("quaternion")])


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_a_planted_configuration_meets_every_condition(kind: str, seed: int) -> None:
    case = planted(kind, seed)
    x = coordinates(case)
    with np.errstate(all="ignore"):
        conditions = Conditions.of(data_of(case.task), True)
    rows = conditions.at(np.stack([x, x], axis=1)[None])
    assert rows.possible.all()
    assert (np.abs(rows.middle.mid) <= rows.tolerance + 1e-9).all()
    K = len(case.task.contact_pairs)
    points, directions = (K + 1) * K // 2, (K + 3) * (K + 2) // 2
    assert rows.middle.shape == (1, points + directions + K * K + 3 * points)


@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3, 1e-7])
@pytest.mark.parametrize(("kind", "seed"), CASES)
@pytest.mark.slow
def test_boxes_around_a_planted_configuration_keep_it(kind: str, seed: int, size: float) -> None:
    case, rng = planted(kind, seed), np.random.default_rng(seed)
    x = coordinates(case)
    with np.errstate(all="ignore"):
        conditions = Conditions.of(data_of(case.task), True)
    lower, upper = conditions.root.T
    ends = [x + sign * size * rng.random((20, len(x))) * (upper - lower) for sign in (-1, 1)]
    boxes = np.clip(np.stack(ends, axis=2), lower[:, None], upper[:, None])
    with np.errstate(all="ignore"):
        alive, left, _ = conditions.narrowed(boxes)
    assert alive.all()
    assert ((left[..., 0] <= x + 1e-9) & (x - 1e-9 <= left[..., 1])).all()


@pytest.mark.parametrize(("kind", "seed"), [*slow_after(3, CASES[:6]), *slow_after(3, CASES[6:])])
def test_what_is_possible_is_never_shown_impossible(kind: str, seed: int) -> None:
    case = planted(kind, seed)
    done = impossible(data_of(case.task), range(len(case.task.contact_pairs)), origin=True, boxes=150)
    assert not done.shown
    assert done.discarded < 1


def upright(axis: int, along: int) -> PoseBounds:
    """An axis of the object near to one of the palm frame."""
    axes = np.array(PoseBounds.none().axes)
    axes[axis, along, 0] = 0.9
    return PoseBounds(PoseBounds.none().position, axes)


def away(lower: float) -> PoseBounds:
    return PoseBounds([[lower, lower + 0.1], [-0.1, 0.1], [-np.inf, np.inf]], PoseBounds.none().axes)


@pytest.mark.parametrize(
    ("task", "contacts", "origin"),
    [
        (grip(0.081), (0, 1), False),  # 1 mm wider than the gripper opens
        (grip(3 * OPEN), (0, 1), False),
        (flat_grip(0.12), (0, 1), False),
        (turned(grip(0.05)), (0, 1), False),
        (pinch(2 * LARGE), (0, 1), False),
        (pinch(pose=away(0.5)), (0,), True),
        (pinch(pose=away(0.5)), (0, 1), True),
        (
            grip(0.05, pose=upright(1, 2)),
            (0, 1),
            False,
        ),  # the jaws face each other along the object's y and the palm's y
    ],
)
def test_what_cannot_be_is_shown(task: Task, contacts: tuple[int, ...], origin: bool) -> None:
    done = impossible(data_of(task), contacts, origin=origin)
    assert done.shown
    assert done.discarded == 1.0


@pytest.mark.parametrize(
    ("task", "contacts", "origin"),
    [
        (grip(0.079), (0, 1), False),
        (grip(0.081), (0,), False),  # one contact alone
        (grip(0.05, pose=upright(1, 1)), (0, 1), False),
        (pinch(), (0, 1), False),
        (pinch(pose=away(0.0)), (0,), True),
    ],
)
def test_what_can_be_stays_open(task: Task, contacts: tuple[int, ...], origin: bool) -> None:
    assert not impossible(data_of(task), contacts, origin=origin, boxes=2000).shown


def test_shares_of_the_space_add_up() -> None:
    """Of the gripper's travel what is left of a block of 79 mm is a small part."""
    done = impossible(data_of(grip(0.079)), (0, 1), boxes=500)
    assert isinstance(done, Impossibility)
    assert 500 <= done.boxes < 700
    assert 0.5 < done.discarded < 1


def test_limits_of_a_joint_that_follows_count() -> None:
    """The gripper's right finger follows the left one: held half closed, it keeps both at most 40 mm apart."""
    task = limited(grip(0.07), "right_slide", 0.02, 0.04)
    assert impossible(data_of(task), (0, 1)).shown
    assert not impossible(data_of(grip(0.07)), (0, 1), boxes=500).shown


def test_couplings_that_contradict_limits_are_refused() -> None:
    task = limited(grip(0.07), "right_slide", 0.01, 0.01)
    with pytest.raises(Refused, match=r"joint right_slide is fixed by its limits, but follows left_slide"):
        impossible(data_of(task), (0, 1))
