"""The checker's links and regions: how far floats may miss what they stand for, and what stands in what frame."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from handfast.model.hand import Hand
from handfast.model.hand.hand import Coupling
from handfast.model.region import Cap
from handfast.synthesis.certify.chains import CROOKED, Arms, Drive, orthonormal
from handfast.synthesis.certify.equations import _quadratics
from handfast.synthesis.certify.existence import ProofRefused
from handfast.synthesis.certify.interval_arithmetic import TINY, ULP, Dual, Interval
from handfast.synthesis.certify.regions import ContactSide, _weights
from handfast.synthesis.task import ContactPair, Task
from tests.support.planted import bump, chain, joint, pose

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


def touched(hand: Hand, link: str) -> Task:
    return Task.of(hand, (ContactPair(link, Cap([0, 0, 0], 0.01, X, 1.0), bump(np.random.default_rng(0))),))


@pytest.mark.parametrize("off", [0.0, 1.0, -1.0, 14.0, -14.0])
@pytest.mark.parametrize("size", [1.0, 2.0**-20])
def test_a_fixed_joint_may_miss_its_coupling_by_rounding(off: float, size: float) -> None:
    """-1.5 * 0.5 + 0.25 = -0.5: the terms are 0.75 and 0.25, so 16 roundings of 1."""
    task = follower(-0.5 + off * ULP, 0.5) if size == 1.0 else follower(OFFSET + off * ULP * OFFSET, 0.0)
    drive = Drive.of(task, {})
    assert drive.joints == (0, 1)
    mine = float(task.hand.joints[1].lower)
    its = -0.5 if size == 1.0 else OFFSET
    assert drive.shift.lo[1] <= min(mine, its)
    assert max(mine, its) <= drive.shift.hi[1]
    assert not drive.gain.mag.any()


@pytest.mark.parametrize("off", [18.0, -18.0, 160.0, -1600.0])
def test_a_fixed_joint_may_not_miss_its_coupling_by_more(off: float) -> None:
    with pytest.raises(ProofRefused, match=r"joint b is fixed at -0.5 by its limits, at -0.5 by its coupling"):
        Drive.of(follower(-0.5 + off * ULP), {})


def test_what_counts_as_rounding_is_of_the_terms() -> None:
    """With a driver at 0 only the offset is left: 16 roundings of 0.25; without an offset either, of nothing."""
    Drive.of(follower(OFFSET * (1 + 14 * ULP), driver=0.0), {})
    with pytest.raises(ProofRefused, match=r"joint b is fixed at 0.25 by its limits, at 0.25 by its coupling"):
        Drive.of(follower(OFFSET * (1 + 20 * ULP), driver=0.0), {})
    with pytest.raises(ProofRefused, match=r"joint b is fixed at 1 by its limits, at -0.5 by its coupling"):
        Drive.of(follower(1.0), {})
    small = replace(follower(0.0), hand=zero_offset(64 * TINY))
    with pytest.raises(ProofRefused, match="joint b is fixed"):
        Drive.of(small, {})
    Drive.of(replace(follower(0.0), hand=zero_offset(8 * TINY)), {})


def zero_offset(at: float) -> Hand:
    hand = follower(at, driver=0.0).hand
    return replace(hand, couplings=(Coupling(1, 0, -1.5, 0.0),))


@pytest.mark.parametrize(("off", "stands"), [(0.0, True), (0.5, True), (-0.5, True), (3.0, False), (-50.0, False)])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_link_s_frame_is_a_rotation_but_for_rounding(column: int, off: float, stands: bool) -> None:
    """A column that is longer by some 1e-12 is one that floats may have come to; by 3e-12 it was never a rotation."""
    turned = pose(0.1 * X, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    turned[:3, column] *= 1 + off * CROOKED
    assert CROOKED == 1e-12
    task = touched(chain(("near", "palm", turned, [joint("a", Z)])), "near")
    if stands:
        arms = Arms.of(task, (0,))
        exact = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
        assert (arms.R.lo[-1] <= exact).all()
        assert (exact <= arms.R.hi[-1]).all()
        assert (arms.R.hi - arms.R.lo).max() < CROOKED / 10
    else:
        with pytest.raises(ProofRefused, match=r"link near does not stand at a rotation, but .*e-1[12] off one"):
            Arms.of(task, (0,))


def test_without_joints_there_is_nothing_to_drive() -> None:
    drive = Drive.of(touched(chain(("tip", "palm", pose(X), [])), "palm"), {})
    assert drive.joints == ()
    assert drive.column.shape == drive.gain.shape == drive.shift.shape == (0,)


def test_the_palm_s_own_pose_moves_nothing() -> None:
    """The palm frame is where the base link is, wherever a file puts that."""
    hand = chain(("near", "palm", pose(0.1 * X), [joint("a", Z)]))
    away = replace(hand, links=(replace(hand.links[0], pose=pose(Y, np.diag([-1.0, -1, 1]))), *hand.links[1:]))
    ours, theirs = (Arms.of(touched(h, "near"), (0,)) for h in (hand, away))
    for name in ("R", "p", "turn", "slide"):
        np.testing.assert_array_equal(getattr(ours, name).lo, getattr(theirs, name).lo)
        np.testing.assert_array_equal(getattr(ours, name).hi, getattr(theirs, name).hi)


def test_a_second_axis_is_turned_square_to_the_first() -> None:
    """60 degrees between them: the second column is what of it is across the first."""
    first, second = np.array([[2.0, 0, 0]]), np.array([[0.5, np.sqrt(0.75), 0]])
    R = orthonormal(first, second)
    assert (R.lo <= np.eye(3)).all()
    assert (np.eye(3) <= R.hi).all()
    assert (R.hi - R.lo).max() < 1e-14


@pytest.mark.parametrize("seed", range(5))
def test_products_of_a_quaternion_make_its_matrix(seed: int) -> None:
    from scipy.spatial.transform import Rotation

    q = np.random.default_rng(seed).normal(size=4)
    made = (np.outer(q, q).reshape(16) @ _quadratics()).reshape(3, 3) / (q @ q)
    np.testing.assert_allclose(made, Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=1e-14)
    assert _quadratics().shape == (16, 9)


@pytest.mark.parametrize("degree", [1, 2, 5, 56, 60, 70])
def test_binomials_that_no_float_holds_are_between_two(degree: int) -> None:
    """From degree 57 on the largest is above 2^53."""
    (binomials, up, down) = _weights([degree, 1], degree + 1)
    assert binomials.shape == up.shape == down.shape == (2, 3, degree + 1)
    for less in range(min(3, degree + 1)):
        for i in range(degree - less + 1):
            exact = math.comb(degree - less, i)
            lo, hi = binomials.lo[0, less, i], binomials.hi[0, less, i]
            assert Fraction(lo) <= exact <= Fraction(hi)
            assert hi - lo <= 1e-14 * exact
            assert lo == hi or degree > 56
            assert (up[0, less, i], down[0, less, i]) == (i, degree - less - i)


@pytest.mark.parametrize("degree", [(3, 1), (1, 3), (2, 2)])
def test_patches_of_any_degrees_stand_beside_each_other(degree: tuple[int, int]) -> None:
    """Point and tangents of each are those of the patch; a smaller one is filled up."""
    rng = np.random.default_rng(3)
    patches = [bump(rng, degree), bump(rng, (2, 1))]
    column = {f"contact:{k}:{name}": 2 * k + n for k in range(len(patches)) for n, name in enumerate("st")}
    surface = ContactSide.of(patches, "st", column, still=False)
    at = rng.uniform(0.2, 0.8, 2 * len(patches))
    x = Dual(Interval.of(np.stack([at, at])), Interval.of(np.zeros((1, 2, len(at)))))
    point, normal, first, second = surface.at(x)
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
    at = 1 + off * ULP
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z, 0, 0)]),
        ("mid", "near", pose(0.1 * X), [joint("b", Z, 0, 0)]),
        ("far", "mid", pose(0.1 * X), [joint("c", Z, at, at)]),
        couplings=[Coupling(1, 0, 1.0, 0.0), Coupling(2, 1, 1.0, 1.0)],
    )
    if passes:
        assert Drive.of(touched(hand, "far"), {}).joints == (0, 1, 2)
    else:
        with pytest.raises(ProofRefused, match="joint c is fixed at 1 by its limits, at 1 by its coupling"):
            Drive.of(touched(hand, "far"), {})


def test_a_link_that_no_joint_moves_stands_at_its_pose() -> None:
    """Of five variables the points depend on the third; they come turned by 90 degrees about z and 1 m along x."""
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    arms = Arms.of(touched(chain(("tip", "palm", pose(X, turned), [])), "tip"), ())
    rng = np.random.default_rng(2)
    point, vector = rng.normal(size=(2, 2, 1, 3))
    slope = np.zeros((5, 2, 1, 3))
    slope[2] = rng.normal(size=(2, 1, 3))
    none = Dual(Interval.of(np.zeros((2, 0))), Interval.of(np.zeros((5, 2, 0))))
    there = arms.carry(
        none, Dual(Interval.of(point), Interval.of(slope)), Dual(Interval.of(vector), Interval.of(slope))
    )
    assert there.value.shape == (2, 1, 3, 2)
    np.testing.assert_allclose(there.value.mid, np.stack([point @ turned.T + X, vector @ turned.T], -1), atol=1e-14)
    np.testing.assert_allclose(there.slope.mid, np.stack([slope @ turned.T] * 2, -1), atol=1e-14)
