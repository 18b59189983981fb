"""The checker's links and regions: how far floats may miss what they stand for, and what stands in what frame."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.model.hand import Hand
from handfast.model.hand.hand import Coupling
from handfast.model.region import Cap
from handfast.proofs.chains import LINK_ROTATION_ERROR, Arms, Drive, JointStep, Pose, joint_rates, orthonormal
from handfast.proofs.contact_equations import rotations
from handfast.proofs.fields import Fields
from handfast.proofs.intervals import MACHINE_EPSILON, UNDERFLOW_BOUND, Dual, Interval, crossing
from handfast.proofs.regions import ContactSide, _weights, read_region
from handfast.proofs.replay import Refused
from handfast.readers.region_file import region_to_dict
from handfast.synthesis.task import ContactPair, Task
from tests.support.planted import bump, chain, joint, pose
from tests.support.planted_proofs import data_of

X, Y, Z = np.eye(3)
OFFSET = 0.25


def follower(at: float, driver: float = 0.5, ratio: float = -1.5) -> Task:
    """A contact behind two joints that their limits fix: a at `driver`, b at `at`, to be ratio a + 0.25."""
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z, driver, driver)]),
        ("far", "near", pose(0.1 * X), [joint("b", Z, at, at)]),
        couplings=[Coupling(1, 0, ratio, OFFSET)],
    )
    return touched(hand, "far")


def drive_of(task: Task) -> Drive:
    """Without coordinates: all joints are fixed."""
    return Drive.of(data_of(task), {})


def arms_of(task: Task) -> Arms:
    data = data_of(task)
    column = {f"joint:{data.hand.joints[j]}": n for n, j in enumerate(data.free)}
    return Arms.of(data, Drive.of(data, column), 5)


def touched(hand: Hand, link: str) -> Task:
    return Task.of(hand, (ContactPair(link, Cap([0, 0, 0], 0.01, X, 1.0), bump(np.random.default_rng(0))),))


@pytest.mark.parametrize("off", [0.0, 1.0, -1.0, 14.0, -14.0])
@pytest.mark.parametrize("size", [1.0, 2.0**-20])
def test_a_fixed_joint_may_miss_its_coupling_by_rounding(off: float, size: float) -> None:
    """-1.5 * 0.5 + 0.25 = -0.5: the terms are 0.75 and 0.25, so 16 roundings of 1."""
    task = (
        follower(-0.5 + off * MACHINE_EPSILON, 0.5)
        if size == 1.0
        else follower(OFFSET + off * MACHINE_EPSILON * OFFSET, 0.0)
    )
    drive = drive_of(task)
    assert drive.joints == (0, 1)
    mine = float(task.hand.joints[1].lower)
    its = -0.5 if size == 1.0 else OFFSET
    assert drive.shift.lo[1] <= min(mine, its)
    assert max(mine, its) <= drive.shift.hi[1]
    assert not drive.gain.mag.any()


def test_coupled_joints_move_as_their_driver_does() -> None:
    """c = -1.5 b, b = 2 a, and d, e stay where they are whatever a does; what is said of these does not count."""
    joints = [joint(name, Z, -1.0, 1.0) for name in "abcde"]
    couplings = [
        Coupling(1, 0, 2.0, 0.0),
        Coupling(2, 1, -1.5, 0.1),
        Coupling(3, 0, 0.0, 0.2),
        Coupling(4, -1, 3.0, 0.2),
    ]
    hand = chain(("near", "palm", pose(0.1 * X), joints), couplings=couplings)
    rates = joint_rates(data_of(touched(hand, "near")).hand, np.array([[1.0, 7, 7, 7, 7], [0.0, 7, 7, 7, 7]]))
    np.testing.assert_allclose((rates.lo + rates.hi) / 2, [[1, 2, -3, 0, 0], [0, 0, 0, 0, 0]], rtol=1e-14)
    assert not rates.ends[0, 3:].any()
    assert not rates.ends[1].any()


@pytest.mark.parametrize("off", [16.5, -16.5, 18.0, -18.0, 160.0, -1600.0])
def test_a_fixed_joint_may_not_miss_its_coupling_by_more(off: float) -> None:
    with pytest.raises(Refused, match=r"joint b is fixed at -0.5 by its limits, at -0.5 by its coupling"):
        drive_of(follower(-0.5 + off * MACHINE_EPSILON))


def test_what_counts_as_rounding_is_of_the_terms() -> None:
    """With a driver at 0 only the offset is left: 16 roundings of 0.25; without an offset either, of nothing."""
    drive_of(follower(OFFSET * (1 + 14 * MACHINE_EPSILON), driver=0.0))
    with pytest.raises(Refused, match=r"joint b is fixed at 0.25 by its limits, at 0.25 by its coupling"):
        drive_of(follower(OFFSET * (1 + 20 * MACHINE_EPSILON), driver=0.0))
    with pytest.raises(Refused, match=r"joint b is fixed at 1 by its limits, at -0.5 by its coupling"):
        drive_of(follower(1.0))
    small = replace(follower(0.0), hand=zero_offset(64 * UNDERFLOW_BOUND))
    with pytest.raises(Refused, match="joint b is fixed"):
        drive_of(small)
    drive_of(replace(follower(0.0), hand=zero_offset(8 * UNDERFLOW_BOUND)))


def zero_offset(at: float) -> Hand:
    hand = follower(at, driver=0.0).hand
    return replace(hand, couplings=(Coupling(1, 0, -1.5, 0.0),))


@pytest.mark.parametrize(("off", "stands"), [(0.0, True), (0.5, True), (-0.5, True), (3.0, False), (-50.0, False)])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_link_s_frame_is_a_rotation_but_for_rounding(column: int, off: float, stands: bool) -> None:
    """A column that is longer by some 1e-12 is one that floats may have come to; by 3e-12 it was never a rotation."""
    turned = pose(0.1 * X, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    turned[:3, column] *= 1 + off * LINK_ROTATION_ERROR
    assert LINK_ROTATION_ERROR == 1e-12
    task = touched(chain(("near", "palm", turned, [joint("a", Z)])), "near")
    if stands:
        arms = arms_of(task)
        exact = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
        assert (arms.frame.lo[-1] <= exact).all()
        assert (exact <= arms.frame.hi[-1]).all()
        assert (arms.frame.hi - arms.frame.lo).max() < LINK_ROTATION_ERROR / 10
    else:
        with pytest.raises(Refused, match=r"link near does not stand at a rotation, but .*e-1[12] off one"):
            arms_of(task)


def test_a_joint_without_a_driver_stands_at_the_offset_of_its_coupling() -> None:
    """Nothing is 3 times as far as the last joint; a that is coupled to nothing is where its limits say, to the bit."""
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z, 0.3, 0.3)]),
        ("far", "near", pose(0.1 * X), [joint("b", Z, OFFSET, OFFSET)]),
        couplings=[Coupling(1, -1, 3.0, OFFSET)],
    )
    drive = drive_of(touched(hand, "far"))
    assert (drive.joints, drive.column.tolist()) == ((0, 1), [0, 0])
    assert (drive.shift.lo[0], drive.shift.hi[0]) == (0.3, 0.3)
    assert drive.shift.mid[1] == OFFSET
    assert drive.at(Interval.of(np.zeros((2, 1)))).mid.tolist() == [[0.3, OFFSET]] * 2


def test_an_upright_frame_is_exact() -> None:
    frame = arms_of(touched(chain(("near", "palm", pose(0.1 * X), [joint("a", Z)])), "near")).frame
    np.testing.assert_array_equal(frame.ends, Interval.of(np.tile(np.eye(3), (2, 1, 1))).ends)


def test_a_link_behind_two_joints_stands_at_its_pose_once() -> None:
    """0.1 m out on x: turns by a quarter about y there, after that by a quarter about z; its x axis is along y then."""
    hand = chain(("tip", "palm", pose(0.1 * X), [joint("a", Y), joint("b", Z)]))
    point, vector = (Dual.constant(Interval.of(v.reshape(1, 1, 3)), 2) for v in (0.5 * X, X))
    at, along, _ = arms_of(touched(hand, "tip")).carry(Interval.of(np.full((1, 2), np.pi / 2)), point, vector, 5)
    np.testing.assert_allclose(at.value.mid[0, 0], [0.1, 0.5, 0], atol=1e-15)
    np.testing.assert_allclose(along.value.mid[0, 0], Y, atol=1e-15)


def test_without_joints_there_is_nothing_to_drive() -> None:
    drive = drive_of(touched(chain(("tip", "palm", pose(X), [])), "palm"))
    assert drive.joints == ()
    assert drive.column.shape == drive.gain.shape == drive.shift.shape == (0,)


def test_the_palm_s_own_pose_moves_nothing() -> None:
    """The palm frame is where the base link is, wherever a file puts that."""
    hand = chain(("near", "palm", pose(0.1 * X), [joint("a", Z)]))
    away = replace(hand, links=(replace(hand.links[0], pose=pose(Y, np.diag([-1.0, -1, 1]))), *hand.links[1:]))
    ours, theirs = (arms_of(touched(h, "near")) for h in (hand, away))
    for name in ("frame", "place", "first", "second", "axis", "slide"):
        np.testing.assert_array_equal(getattr(ours, name).lo, getattr(theirs, name).lo)
        np.testing.assert_array_equal(getattr(ours, name).hi, getattr(theirs, name).hi)


def test_a_second_axis_is_turned_square_to_the_first() -> None:
    """60 degrees between them: the second column is what of it is across the first."""
    first, second = np.array([[2.0, 0, 0]]), np.array([[0.5, np.sqrt(0.75), 0]])
    R = orthonormal(first, second)
    assert (R.lo <= np.eye(3)).all()
    assert (np.eye(3) <= R.hi).all()
    assert (R.hi - R.lo).max() < 2e-14


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_turn_and_their_derivatives_enclose_differences(seed: int) -> None:
    from scipy.spatial.transform import Rotation

    q = np.random.default_rng(seed).normal(size=(2, 4))
    R, by = rotations(Interval.of(q))

    def exact(at: Array) -> Array:
        return Rotation.from_quat(at, scalar_first=True).as_matrix()

    assert R.shape == (2, 3, 3)
    np.testing.assert_allclose(R.mid, exact(q), atol=1e-14)
    assert (R.hi - R.lo).max() < 2e-14
    h = 1e-6
    for i, step in enumerate(h * np.eye(4)):
        np.testing.assert_allclose(by.mid[i], (exact(q + step) - exact(q - step)) / (2 * h), atol=1e-8)


@pytest.mark.parametrize("degree", [1, 2, 5, 56, 60, 70])
def test_binomials_that_no_float_holds_are_between_two(degree: int) -> None:
    """From degree 57 on the largest is above 2^53."""
    (binomials, up, down) = _weights((degree, 1), degree + 1)
    assert binomials.shape[:3] == up.shape == down.shape == (2, 3, degree + 1)
    for less in range(min(3, degree + 1)):
        for i in range(degree - less + 1):
            exact = math.comb(degree - less, i)
            lo, hi = binomials.lo[0, less, i, 0, 0], binomials.hi[0, less, i, 0, 0]
            assert Fraction(lo) <= exact <= Fraction(hi)
            assert hi - lo <= 1e-14 * exact
            assert lo == hi or degree > 56
            assert (up[0, less, i], down[0, less, i]) == (i, degree - less - i)


@pytest.mark.parametrize("degree", [(3, 1), (1, 3), (2, 2)])
def test_patches_of_any_degrees_stand_beside_each_other(degree: tuple[int, int]) -> None:
    """Point and tangents of each are those of the patch; a smaller one is filled up."""
    rng = np.random.default_rng(3)
    patches = [bump(rng, degree), bump(rng, (2, 1))]
    regions = [read_region(Fields(region_to_dict(patch) | {"flip": patch.flip})) for patch in patches]
    surface = ContactSide.of(regions, np.arange(2 * len(patches)).reshape(-1, 2), still=False)
    at = rng.uniform(0.2, 0.8, 2 * len(patches))
    point, normal, first, second = surface.at(Interval.of(np.stack([at, at])))
    for k, patch in enumerate(patches):
        u, v = at[2 * k : 2 * k + 2]
        true = [patch.at(u, v), patch.normal(u, v) / np.linalg.norm(patch.normal(u, v))]
        true += [patch.at(u, v, 1, 0), patch.at(u, v, 0, 1)]
        for got, exact in zip((point, normal, first, second), true, strict=True):
            np.testing.assert_allclose(got.value.mid[0, k], exact, atol=1e-12)
            assert (got.value.hi - got.value.lo).max() < 1e-11


@pytest.mark.parametrize(("off", "passes"), [(14.0, True), (20.0, False)])
def test_what_counts_as_rounding_is_of_the_whole_chain_of_couplings(off: float, passes: bool) -> None:
    """c = b + 1 and b = a with a at 0: the 1 counts, though it is not of the last coupling."""
    at = 1 + off * MACHINE_EPSILON
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z, 0, 0)]),
        ("mid", "near", pose(0.1 * X), [joint("b", Z, 0, 0)]),
        ("far", "mid", pose(0.1 * X), [joint("c", Z, at, at)]),
        couplings=[Coupling(1, 0, 1.0, 0.0), Coupling(2, 1, 1.0, 1.0)],
    )
    if passes:
        assert drive_of(touched(hand, "far")).joints == (0, 1, 2)
    else:
        with pytest.raises(Refused, match="joint c is fixed at 1 by its limits, at 1 by its coupling"):
            drive_of(touched(hand, "far"))


def test_a_link_that_no_joint_moves_stands_at_its_pose() -> None:
    """Points, vectors and their derivatives by two parameters come turned by 90 degrees about z and 1 m along x."""
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    arms = arms_of(touched(chain(("tip", "palm", pose(X, turned), [])), "tip"))
    rng = np.random.default_rng(2)
    point, vector = rng.normal(size=(2, 3, 1, 3))
    slopes = rng.normal(size=(2, 2, 3, 1, 3))
    none = Interval.of(np.zeros((3, 0)))
    at, along, by_joints = arms.carry(
        none, *(Dual(Interval.of(v), Interval.of(s)) for v, s in zip((point, vector), slopes, strict=True)), 5
    )
    np.testing.assert_allclose(at.value.mid, point @ turned.T + X, atol=1e-14)
    np.testing.assert_allclose(along.value.mid, vector @ turned.T, atol=1e-14)
    for got, slope in zip((at, along), slopes, strict=True):
        np.testing.assert_allclose(got.slope.mid, slope @ turned.T, atol=1e-14)
    assert by_joints.shape == (2, 5, 3, 1, 3)
    assert by_joints.mag.max() < 1e-280


def test_a_revolute_and_a_prismatic_joint_move_what_is_behind_them() -> None:
    """A turn about z at (0.1, 0, 0), then a slide along the turned x: at 90 degrees and 0.2 m, and the derivatives."""
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z)]),
        ("far", "near", pose(0.3 * X), [replace(joint("b", X), type="prismatic")]),
    )
    arms = arms_of(touched(hand, "far"))
    q = Interval.of(np.array([[np.pi / 2, 0.2]]))
    still = [Dual.constant(Interval.of(v.reshape(1, 1, 3)), 2) for v in (0.05 * Y, X)]
    at, along, by_joints = arms.carry(q, *still, 5)
    np.testing.assert_allclose(at.value.mid[0, 0], [0.05, 0.5, 0], atol=1e-15)  # (0.1, 0) + (-0.05, 0.5) turned
    np.testing.assert_allclose(along.value.mid[0, 0], Y, atol=1e-15)
    np.testing.assert_allclose(by_joints.mid[0, 0, 0, 0], [-0.5, -0.05, 0], atol=1e-15)  # z x (-0.05, 0.5)
    np.testing.assert_allclose(by_joints.mid[0, 1, 0, 0], Y, atol=1e-15)
    np.testing.assert_allclose(by_joints.mid[1, 0, 0, 0], -X, atol=1e-15)
    np.testing.assert_allclose(by_joints.mid[1, 1, 0, 0], 0, atol=1e-15)


@pytest.mark.parametrize("revolute", [True, False])
def test_a_joint_moves_its_link_about_its_own_axis(revolute: bool) -> None:
    """Points of a revolute joint's axis stay, a prismatic one moves all alike; the way back undoes both."""
    axis, anchor, x = np.array([0.0, 0.6, 0.8]), np.array([0.3, -0.2, 0.5]), np.array([0.7, 0.1, -0.4])
    turn = crossing(Interval.of(axis))
    step = JointStep(0.25, revolute, Interval.of(axis), turn, turn @ turn, anchor)
    value = Dual.constant(Interval.of([0.25, 1.05]), 0)
    there, back = step.pose(value), step.pose(value, back=True)

    def moved(pose: Pose, point: Array) -> Array:
        out: Array = pose.moved(Dual.constant(Interval.of(np.tile(point, (2, 1))), 0)).value.mid
        return out

    for k, by in enumerate((0.0, 0.8)):
        about = Rotation.from_rotvec(by * axis).apply(x - anchor) + anchor if revolute else x + by * axis
        np.testing.assert_allclose(moved(there, x)[k], about, atol=1e-14)
        np.testing.assert_allclose(moved(back, about)[k], x, atol=1e-14)
    R, place = Rotation.from_rotvec([0.3, -0.4, 0.9]).as_matrix(), np.array([1.0, 2.0, 3.0])
    along, point = step.seen(Pose.fixed(Interval.of(R), place, 2, 0))
    np.testing.assert_allclose(along.value.mid, np.tile(R @ axis, (2, 1)), atol=1e-14)
    np.testing.assert_allclose(point.value.mid, np.tile(R @ anchor + place, (2, 1)), atol=1e-14)


def test_rounding_of_large_terms_is_none_that_counts() -> None:
    """1.1 a - 1e14 is 0.00495 where floats make it 0.0078: b cannot be at either."""
    driver = next(x for k in range(-400, 400) if 1.1 * (x := 1e14 / 1.1 + k * 2.0**-7) == 1e14)
    assert abs(Fraction(1.1) * Fraction(driver) - Fraction(10) ** 14) > 1e-4
    task = data_of(follower(0.0))
    coupling = replace(task.hand.couplings[1], ratio=1.1, offset=-1e14)
    limits = np.array([[driver, driver], [0.0, 0.0]])
    large = replace(task, hand=replace(task.hand, couplings={1: coupling}, limits=limits))
    with pytest.raises(Refused, match=r"joint b is fixed at 0 by its limits, at 0\.0078125 by its coupling"):
        Drive.of(large, {})
