"""What the checker shows to be impossible by itself: never a planted configuration, and what plainly cannot be."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.model.region import Cap
from handfast.proofs import impossibility
from handfast.proofs.impossibility import Conditions, Impossibility, impossible, narrowed_by
from handfast.proofs.intervals import Interval
from handfast.proofs.regions import PARAMETER_RANGE
from handfast.proofs.replay import Refused
from handfast.synthesis.task import PoseBounds, Task
from tests.support.holds import LARGE, OPEN, flat_grip, grip, pinch, square, turned
from tests.support.planted_proofs import PlantedProof, data_of, limited, odd_case, pose_of, reshaped, sah_case
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


# --- the search, on conditions that are given ---------------------------------------------------------


@dataclass
class Always:
    """Conditions that every box meets; what each side changes of two of them is given."""

    root: Array
    reach: Array
    two: Array = field(default_factory=lambda: np.zeros((2, 1)))
    directed: Array = field(default_factory=lambda: np.zeros((2, 1)))
    line: Array = field(default_factory=lambda: np.zeros((2, 0)))
    seen: list[Array] = field(default_factory=list)
    axes: Array = field(default_factory=lambda: np.zeros((2, 0, 3)))

    def narrowed(self, boxes: Array) -> tuple[Array, Array, Array]:
        self.seen += list(boxes)
        return np.ones(len(boxes), dtype=bool), boxes, np.tile(self.reach, (len(boxes), 1, 1))


def always(monkeypatch: pytest.MonkeyPatch, root: Any, reach: Any = None) -> Always:
    root = np.array(root, dtype=float)
    given = Always(root, np.full((len(root), 2), np.nan) if reach is None else np.array(reach, dtype=float))
    monkeypatch.setattr(Conditions, "of", classmethod(lambda *_: given))
    return given


def test_boxes_that_are_small_beside_the_whole_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The longest side of 4, 0.5 and 0 is halved, as a share of the whole: the first, then the second."""
    monkeypatch.setattr(impossibility, "MIN_BOX_SHARE", 0.5)
    given = always(monkeypatch, [[0, 4], [0, 0.5], [1, 1]])
    assert impossible(data_of(grip(0.05)), (0, 1), boxes=100) == Impossibility(False, 1 + 2 + 4, 0.0)
    assert [np.ptp(box, axis=1).tolist() for box in given.seen] == [
        [4, 0.5, 0],
        *[[2, 0.5, 0]] * 2,
        *[[2, 0.25, 0]] * 4,
    ]


def test_the_side_is_halved_that_changes_a_condition_most(monkeypatch: pytest.MonkeyPatch) -> None:
    given = always(monkeypatch, [[0, 4], [0, 0.5], [0, 1]], [[1, 0], [0, 3], [2, 2]])
    assert impossible(data_of(grip(0.05)), (0, 1), boxes=2) == Impossibility(False, 3, 0.0)
    assert {tuple(np.ptp(box, axis=1)) for box in given.seen[1:]} == {(4, 0.25, 1)}


@pytest.mark.parametrize(("budget", "seen"), [(24, 6), (40, 10)])
def test_many_derivatives_make_fewer_boxes_and_smaller_batches(
    monkeypatch: pytest.MonkeyPatch, budget: int, seen: int
) -> None:
    """3 coordinates and 2 conditions are 4 times 1.5: a quarter of the boxes, of each batch of 4 one."""
    monkeypatch.setattr(impossibility, "MANY_DERIVATIVES", 1.5)
    monkeypatch.setattr(impossibility, "REFUTATION_BATCH", 4)
    always(monkeypatch, [[0, 4], [0, 0.5], [0, 1]])
    assert impossible(data_of(grip(0.05)), (0, 1), boxes=budget).boxes == seen


def test_a_contact_alone_excludes_nothing_but_what_its_axis_does() -> None:
    assert impossible(data_of(grip(0.05)), (0,)) == Impossibility(False, 0, 0.0)
    assert not impossible(data_of(grip(0.05, pose=upright(1, 1))), (0,), boxes=5).shown
    axes = np.array(PoseBounds.none().axes)
    axes[1, 1, 1] = -0.9  # turned by half a turn
    over = PoseBounds(PoseBounds.none().position, axes)
    assert impossible(data_of(grip(0.05, pose=over)), (0,)) == Impossibility(True, 1, 1.0, axes=True)


# --- the conditions ---------------------------------------------------------------------------------------


def conditions_of(task: Task, origin: bool = False) -> Conditions:
    with np.errstate(all="ignore"):
        return Conditions.of(data_of(task), origin)


def point(*x: float) -> Array:
    """(1, n, 2)"""
    return np.repeat(np.array(x)[None, :, None], 2, axis=2)


def test_conditions_of_two_tips_by_hand() -> None:
    """Each slide 10 mm closed: tips 70 mm apart; a block of 79 mm and both radii are 89 mm. Caps of 1 rad each."""
    conditions = conditions_of(grip(0.079))
    assert list(conditions.sides.column) == ["joint:left_slide", *(f"contact:{k}:{x}" for k in (0, 1) for x in "st")]
    rows = conditions.at(point(0.01, 0.5, 0.5, 0.5, 0.5))
    assert rows.middle.mid[0] == pytest.approx([0.07**2 - 0.089**2, 0, 0.089 - 0.07, 0.07 - 0.089])
    least = np.array([0, 2 * np.sin(1), 2 * np.sin(0.5) * 0.07, 2 * np.sin(0.5) * 0.07])
    assert (rows.tolerance[0] >= least * (1 + 9e-10)).all()  # not rounded downwards
    assert (rows.tolerance[0] <= least * (1 + 1.1e-9)).all()


@pytest.mark.parametrize(("angle", "most"), [(1.5, 2 * np.sin(1.5)), (1.7, 2), (np.pi, 2)])
def test_directions_of_wide_caps_are_anything(angle: float, most: float) -> None:
    task = grip(0.05)
    for k in (0, 1):
        task = reshaped(task, k, hand={"half_angle": angle})
    rows = conditions_of(task).at(point(0.01, 0.5, 0.5, 0.5, 0.5))
    assert rows.tolerance[0, 1] == pytest.approx(most, rel=2e-9)


def test_flat_regions_face_each_other_exactly() -> None:
    conditions = conditions_of(flat_grip(0.05))
    assert conditions.half.tolist() == [0, 0]
    assert not conditions.at(point(0.01, *[0.5] * 8)).tolerance.any()


def test_which_conditions_there_are_of_two_contacts_the_origin_and_two_axes() -> None:
    axes = np.array(PoseBounds.none().axes)
    axes[1, 1, 0] = axes[2, 2, 0] = 0.9
    task = grip(0.05, pose=PoseBounds(PoseBounds.none().position, axes))
    conditions = conditions_of(task, origin=True)
    assert conditions.two.T.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert conditions.directed.T.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    of_contacts = [[0, 0], [1, 0], [0, 1], [1, 2]]
    assert conditions.line.T.tolist() == [*of_contacts, *([2 + i, n] for n in range(3) for i in range(2))]
    alone = conditions_of(task)
    assert (alone.two.T.tolist(), alone.line.T.tolist()) == ([[0, 1]], [[k, 0] for k in range(4)])
    assert len(alone.root) == 5


def test_the_size_of_a_hand_and_where_an_origin_can_be() -> None:
    """Open tips are 45 mm aside and 95 mm up; the block's corners 25, 10 and 10 mm from its middle, the radius 5 mm."""
    conditions = conditions_of(grip(0.05), origin=True)
    size, out = np.hypot(0.045, 0.095), np.sqrt(0.025**2 + 2 * 0.01**2)
    assert conditions.size == pytest.approx(size)
    assert (conditions.position[:, 0] == -conditions.position[:, 1]).all()
    far = conditions.position[:, 1]
    assert (far >= (size + out + 0.005) * (1 + 1e-9)).all()
    assert (far < size + np.sqrt(3) * 0.025 + 0.005).all()  # wide bounds of a corner
    away = reshaped(grip(0.05), 1, object={"points": square(-1, -0.025).points + 9.0})
    other = conditions_of(away, origin=True)
    assert (other.position == conditions.position).all()  # the nearer of the contacts counts
    longer = conditions_of(reshaped(grip(0.05), 1, hand={"center": (0, -0.005, 0.145)}), origin=True)
    assert longer.size == pytest.approx(np.hypot(0.045, 0.195))  # the farther of the tips counts
    assert (longer.position == conditions.position).all()


@pytest.mark.parametrize("seed", range(2))
def test_derivatives_are_those_of_the_conditions(seed: int) -> None:
    """By differences over 2e-6, at random points."""
    axes = np.array(PoseBounds.none().axes)
    axes[2, 2, 0] = 0.9
    conditions = conditions_of(grip(0.05, pose=PoseBounds(PoseBounds.none().position, axes)), origin=True)
    lower, upper = conditions.root.T
    x = lower + (upper - lower) * np.random.default_rng(seed).random(len(lower))
    slope = conditions.at(point(*x)).value.slope
    assert (slope.hi - slope.lo < 1e-9).all()
    for k, step in enumerate(1e-6 * np.eye(len(x))):
        high, low = (conditions.at(point(*(x + sign * step))).middle.mid[0] for sign in (1, -1))
        assert slope.mid[k, 0] == pytest.approx((high - low) / 2e-6, abs=1e-7)


def test_limits_say_which_boxes_are_possible() -> None:
    """The left slide is free from 0 to 40 mm, the right one follows it from 20 mm on."""
    conditions = conditions_of(limited(grip(0.05), "right_slide", 0.02, 0.04))
    cases = {(0, 0.01): False, (0, 0.02): True, (0.03, 0.03): True, (0.04, 0.04): True, (0.041, 0.05): False}
    boxes = np.stack([np.vstack([ends, np.full((4, 2), 0.5)]) for ends in cases])
    assert conditions.at(boxes).possible.tolist() == list(cases.values())
    ends = {(0, 0): True, (-0.02, -0.01): False, (-0.01, 0): True}
    boxes = np.stack([np.vstack([its, np.full((4, 2), 0.5)]) for its in ends])
    assert conditions_of(grip(0.05)).at(boxes).possible.tolist() == list(ends.values())


def test_what_is_narrowed_and_in_which_units() -> None:
    """79 mm are between the tips where each slide is 0.5 mm closed."""
    conditions = conditions_of(grip(0.079))
    box = point(0, 0.5, 0.5, 0.5, 0.5)
    box[0, 0, 1] = 0.01
    with np.errstate(all="ignore"):
        alive, left, one = replace(conditions, size=1.0).narrowed(box)
        _, _, three = replace(conditions, size=3.0).narrowed(box)
    assert alive.all()
    assert left[0, 0, 0] <= 0.0005 <= left[0, 0, 1] < 0.001
    # tips of 80 to 90 mm come together by 20 mm: products of lengths, cosines, lengths along an axis
    assert one[0, 0] == pytest.approx([2 * 0.09 * 0.01, 0, 0.01, 0.01], rel=0.3, abs=1e-9)
    assert (one / three)[0, 0, [0, 2, 3]] == pytest.approx([9, 3, 3])
    assert one[0, 1:, 1] == pytest.approx(three[0, 1:, 1])


def test_regions_are_the_first_coordinates_of_a_hand_that_does_not_move() -> None:
    task = limited(limited(grip(0.05), "left_slide", 0.01, 0.01), "right_slide", 0.0, 0.04)
    a, b = task.contact_pairs
    ball = replace(a, object=Cap((0, 0.02, 0), 0.005, (0, 1, 0), 0.5))
    conditions = conditions_of(replace(task, contact_pairs=(ball, b)))
    assert list(conditions.sides.column) == [f"contact:{k}:{x}" for k in (0, 1) for x in "st"]
    assert conditions.root.tolist() == [[0, 0.5], [-PARAMETER_RANGE, PARAMETER_RANGE], [0, 1], [0, 1]]


def test_the_cone_of_an_axis_by_hand() -> None:
    """Of a component of 0.9 to 1 the middle is along its axis, and the cosine is 0.9 or more, but for rounding."""
    vectors, angles = impossibility._cones(np.array(upright(1, 2).axes))
    assert vectors.tolist() == [[[0, 0, 1]], [[0, 1, 0]]]
    assert angles == pytest.approx([np.arccos((0.855 - 1e-9) / 0.95) + 1e-9], abs=1e-10)
    wide = np.tile([-1.0, 1.0], (3, 3, 1))
    assert impossibility._cones(wide)[0].shape == (2, 0, 3)
    wide[0, :2, 1] = 0.99  # least at the corner, beyond -1 times the length
    assert impossibility._cones(wide)[1] == []


# --- boxes by rows ------------------------------------------------------------------------------------------


def rows(box: Any, at: Any, middle: Any, slope: Any, half: float = 0.0, value: Any = None) -> tuple[Array, Array]:
    """Of one box (n, 2) and C rows of constant slopes (n, C), known at a point (n,), which are to be 0 or near it."""
    box, at, middle, slope = (np.array(x, dtype=float) for x in (box, at, middle, slope))
    far = np.tile([-np.inf, np.inf], (len(middle), 1)) if value is None else np.array([value], dtype=float)
    within = Interval.between(*np.full((2, 1, len(middle)), half) * [[[-1.0]], [[1.0]]])
    with np.errstate(all="ignore"):
        over, here, by = Interval.between(*far.T[:, None]), Interval.of(middle[None]), Interval.of(slope[None])
        alive, left, _ = narrowed_by(box[None], at[None], over, here, by, within)
    return alive[0], left[0]


@pytest.mark.parametrize(
    ("middle", "alive"), [(3.0, False), (2.1, False), (1.9, True), (-3.0, True), (-3.9, True), (-4.1, False)]
)
def test_a_row_of_two_sides_by_hand(middle: float, alive: bool) -> None:
    """2 x - y, known at (-0.5, 0), changes by -2 to 4 over x and y from -1 to 1."""
    assert rows([[-1, 1], [-1, 1]], [-0.5, 0], [middle], [[2], [-1]])[0] == alive


def test_a_row_narrows_each_side_by_what_the_others_may_be() -> None:
    """2 (x + 0.5) - (y - 0.5) + 2 = 0, x from -1 to 1, y from -1 to 2: so x is -2.25 to -0.75, and y 1.5 to 5.5."""
    _, left = rows([[-1, 1], [-1, 2]], [-0.5, 0.5], [2.0], [[2], [-1]])
    assert left == pytest.approx(np.array([[-1, -0.75], [1.5, 2]]))
    assert (left[:, 0] <= [-1, 1.5]).all()
    assert (left[:, 1] >= [-0.75, 2]).all()


def test_sides_of_rows_that_contradict_each_other_are_nowhere() -> None:
    """Of x both 0.75 and -0.75 are wanted, to 0.1; y is free."""
    assert not rows([[-1, 1], [-1, 1]], [0, 0], [-0.75, 0.75], [[1, 1], [0, 0]], 0.1)[0]
    assert rows([[-1, 1], [-1, 1]], [0, 0], [-0.75, -0.75], [[1, 1], [0, 0]], 0.1)[0]


@pytest.mark.parametrize("value", [[0.0, 5.0], [-5.0, 0.0]])
def test_a_row_that_only_touches_its_bound_is_possible(value: list[float]) -> None:
    assert rows([[-1, 1]], [0], [0.0], [[1]], value=value)[0]
    assert not rows([[-1, 1]], [0], [0.0], [[1]], value=np.add(value, np.sign(sum(value)) * 1e-9))[0]


def test_a_sum_of_many_small_changes_is_not_lost_to_rounding() -> None:
    """1 and 200 times 0.4 roundings of it: a sum in order stays 1, and would never reach what is wanted at the end."""
    few = 0.4 * 2.0**-52
    box = np.array([[-1.0, 1.0], *[[-few, few]] * 200])
    alive, left = rows(box, np.zeros(201), [-(1 + 80 * 2.0**-52)], np.ones((201, 1)))
    assert alive
    assert (left[:, 0] <= box[:, 1]).all()
    assert (left[:, 1] == box[:, 1]).all()


def test_each_box_is_judged_alone() -> None:
    """x - 3 and x, and a box of 1e20 beside them: 3 is not reached, whatever another box loses to rounding."""
    box = np.array([[[-1.0, 1]], [[-1, 1]], [[-1e20, 1e20]], [[-1, 1]]])
    middle = Interval.of(np.array([[-3.0, 0], [0, 0], [0, 0], [-0.75, 0.75]]))
    far = Interval.between(np.full((4, 2), -np.inf), np.full((4, 2), np.inf))
    within = Interval.between(np.full((4, 2), -0.1), np.full((4, 2), 0.1))
    alive, left, _ = narrowed_by(box, np.zeros((4, 1)), far, middle, Interval.of(np.ones((4, 1, 2))), within)
    assert alive.tolist() == [False, True, True, False]
    assert left[1, 0] == pytest.approx([-0.1, 0.1])


def test_of_very_many_contacts_nothing_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """3 coordinates and 2 conditions are 6 derivatives."""
    for most, boxes in ((6, 1), (5, 0)):
        monkeypatch.setattr(impossibility, "MOST_DERIVATIVES", most)
        always(monkeypatch, [[0, 4], [0, 0.5], [0, 1]])
        assert impossible(data_of(grip(0.05)), (0, 1), boxes=1).boxes == boxes
