"""The engine against a linear program for each combination of what contacts, actuators and joints do."""

import numpy as np
import pytest

from handfast import Settings, maximum
from handfast.stability.problem.grasp_limits import GraspLimits
from tests.support.law_enumeration import largest_load
from tests.support.law_grasps import random_law_grasp
from tests.support.slow_cases import slow_after

SEEDS = 4, 11, 12, 17, 19, 21, 22, 23
LIMITED = 17, 19, 21, 23  # the other grasps have no motor whose torque can be limited


@pytest.mark.parametrize(
    ("seed", "limited"), slow_after(3, [*((x, False) for x in SEEDS), *((x, True) for x in LIMITED)])
)
def test_the_largest_load_is_that_of_the_enumeration(seed: int, limited: bool) -> None:
    """Random laws, actuators and couplings; every bound replayed by the checker."""
    rng = np.random.default_rng(seed)
    grasp = random_law_grasp(rng)
    direction = -grasp.G[:, ::3] @ rng.exponential(size=grasp.m)
    direction /= np.linalg.norm(direction[:3]) + np.linalg.norm(direction[3:]) / 0.03
    back = dict(zip(grasp.mechanism.actuators, grasp.mechanism.backdrivable, strict=True))
    limits = {name: 0.2 for name in back if not back[name]} if limited else {}
    assert bool(limits) == limited
    most = largest_load(grasp, direction, limits)
    found = maximum(grasp, direction, limits=GraspLimits(torque_limits=limits), settings=Settings(gap=1e-6))
    verified = found.verify()
    assert verified.ok, verified.reason
    if most == np.inf:
        assert found.unbounded
    elif most < 1e-7:
        assert found.upper <= 1e-6
    else:
        assert found.lower == pytest.approx(most, rel=1e-5)
        assert found.upper == pytest.approx(most, rel=1e-5)
