"""Joints that follow others, through chains of couplings with ratios and offsets."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.hand import Hand, Joint, Link
from handfast.model.hand.coupling import coupled, driver_ranges, drivers
from handfast.model.hand.hand import Coupling, coupling_rows
from handfast.model.mechanism import Mechanism


def chain(*couplings: Coupling, limits: tuple[tuple[float, float], ...] = ((-10.0, 10.0),) * 4) -> Hand:
    """Four hinges in a row, some of which follow others."""
    joints = tuple(Joint(f"j{k}", "revolute", [0, 0, 1], [0, 0, 0], *ends) for k, ends in enumerate(limits))
    links = (Link("base", -1, np.eye(4)), *(Link(f"l{k}", k, np.eye(4), (k,)) for k in range(4)))
    driven = [j for j in range(4) if j not in {c.joint for c in couplings}]
    names = tuple(f"j{j}" for j in driven)
    mechanism = Mechanism(names, np.eye(4)[driven], coupling_rows(couplings, 4), (False,) * len(driven))
    return Hand("chain", links, joints, mechanism, couplings, np.ones(4))


CHAIN = (Coupling(1, 0, 3.0, 0.2), Coupling(2, 1, 2.0, 0.1), Coupling(3, 2, -0.5, 0.4))


def test_offsets_are_geared_as_they_are_passed_on() -> None:
    """q1 = 3 q0 + 0.2, q2 = 2 q1 + 0.1 = 6 q0 + 0.5, q3 = 0.4 - q2 / 2 = 0.15 - 3 q0."""
    found = drivers(chain(*CHAIN))
    assert found[0] == (0, 1.0, 0.0)
    assert found[1] == (0, 3.0, 0.2)
    assert found[2] == (0, 6.0, pytest.approx(0.5))
    assert found[3] == (0, -3.0, pytest.approx(0.15))
    q = coupled(chain(*CHAIN), np.array([[0.1, 9, 9, 9], [-1, 9, 9, 9]]))
    np.testing.assert_allclose(q, [[0.1, 0.5, 1.1, -0.15], [-1, -2.8, -5.5, 3.15]])


def test_what_follows_a_constant_is_one() -> None:
    """q1 = 0.2 whatever moves, q2 = 2 q1 + 0.1 = 0.5, q3 = 0.4 - q2 / 2 = 0.15."""
    hand = chain(Coupling(1, -1, 0.0, 0.2), *CHAIN[1:])
    assert {j: drivers(hand)[j] for j in (1, 2, 3)} == {
        1: (-1, 0.0, 0.2),
        2: (-1, 0.0, pytest.approx(0.5)),
        3: (-1, 0.0, pytest.approx(0.15)),
    }
    np.testing.assert_allclose(coupled(hand, np.array([0.7, 9, 9, 9])), [0.7, 0.2, 0.5, 0.15])
    assert driver_ranges(hand) == {0: (-10.0, 10.0)}


def test_a_driver_goes_where_all_that_follow_it_may_go() -> None:
    """q3 = 0.15 - 3 q0 within (-0.45, 0.9) leaves q0 from -0.25 to 0.2, q2 = 6 q0 + 0.5 above -0.4 from -0.15 on."""
    limits = ((-1.0, 1.0), (-10.0, 10.0), (-0.4, 10.0), (-0.45, 0.9))
    assert driver_ranges(chain(*CHAIN, limits=limits)) == {0: pytest.approx((-0.15, 0.2))}
    nothing = (*limits[:2], (-0.4, -0.3), (-0.45, 0.0))  # from 0.05 on, and up to -0.8 / 6
    with pytest.raises(InputError, match=r"limits.j3: leave nothing for j0, to which it is coupled"):
        driver_ranges(chain(*CHAIN, limits=nothing))
    point = (*limits[:2], (1.7, 10.0), limits[3])  # from 0.2 on
    assert driver_ranges(chain(*CHAIN, limits=point))[0] == pytest.approx((0.2, 0.2))
    with pytest.raises(InputError, match=r"leave a single value for j0"):
        driver_ranges(chain(*CHAIN, limits=(*limits[:2], (1.7, 1.7), (-0.45, 0.9))), needed=[2])
