"""How far floats may miss what they stand for: fixed joints that follow others, rotations of links."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from holdfast.hand import Hand
from holdfast.hand.model import Coupling
from holdfast.region import Cap
from holdfast.synthesis.checker.chains import CROOKED, Arms, Drive
from holdfast.synthesis.checker.interval import TINY, ULP
from holdfast.synthesis.checker.refused import Refused
from holdfast.synthesis.task import Task, Touch
from planted import bump, chain, joint, pose

X, Y, Z = np.eye(3)
OFFSET = 0.25


def follower(at: float, leader: float = 0.5, ratio: float = -1.5) -> Task:
    """A contact behind two joints that their limits fix: a at `leader`, b at `at`, to be ratio a + 0.25."""
    hand = chain(
        ("near", "palm", pose(0.1 * X), [joint("a", Z, leader, leader)]),
        ("far", "near", pose(0.1 * X), [joint("b", Z, at, at)]),
        couplings=[Coupling(1, 0, ratio, OFFSET)],
    )
    return touched(hand, "far")


def touched(hand: Hand, link: str) -> Task:
    return Task.of(hand, (Touch(link, Cap([0, 0, 0], 0.01, X, 1.0), bump(np.random.default_rng(0))),))


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
    with pytest.raises(Refused, match=r"joint b is fixed at -0.5 by its limits, at -0.5 by its coupling"):
        Drive.of(follower(-0.5 + off * ULP), {})


def test_what_counts_as_rounding_is_of_the_terms() -> None:
    """With a leader at 0 only the offset is left: 16 roundings of 0.25; without an offset either, of nothing."""
    Drive.of(follower(OFFSET * (1 + 14 * ULP), leader=0.0), {})
    with pytest.raises(Refused, match=r"joint b is fixed at 0.25 by its limits, at 0.25 by its coupling"):
        Drive.of(follower(OFFSET * (1 + 20 * ULP), leader=0.0), {})
    with pytest.raises(Refused, match=r"joint b is fixed at 1 by its limits, at -0.5 by its coupling"):
        Drive.of(follower(1.0), {})
    small = replace(follower(0.0), hand=zero_offset(64 * TINY))
    with pytest.raises(Refused, match="joint b is fixed"):
        Drive.of(small, {})
    Drive.of(replace(follower(0.0), hand=zero_offset(8 * TINY)), {})


def zero_offset(at: float) -> Hand:
    hand = follower(at, leader=0.0).hand
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
        with pytest.raises(Refused, match=r"link near does not stand at a rotation, but .*e-1[12] off one"):
            Arms.of(task, (0,))
