"""The classical computations of `benchmarks/other_bodies.py` against numbers derived by hand."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.other_bodies import held_constant, ray, rough
from handfast import load_grasp

pytest.importorskip("clarabel")


def test_the_classical_region_reaches_behind_the_hind_feet() -> None:
    """x = −a − mu (2 a mu − h) / (1 − mu²) and −a + (2 a mu² + mu h) / (1 + mu²), with a = 0.3, h = 0.1, mu = 0.5."""
    grasp = load_grasp("four-feet")
    back, front = ray(grasp, (-0.2, 0.0), np.pi), ray(grasp, (-0.2, 0.0), 0.0)
    assert back["classical"] == pytest.approx(0.3 + 0.4 / 3 - 0.2, abs=1e-6)
    assert back["passive"][0] == pytest.approx(0.1, rel=2e-3)
    assert front["classical"] == pytest.approx(0.2 - 0.14, abs=1e-6)
    assert front["passive"][0] == pytest.approx(0.06, rel=2e-3)


@pytest.mark.parametrize("angle", [0.0, 1.2, 2.5, 4.0])
def test_what_holds_passively_is_balanced_by_some_forces(angle: float) -> None:
    found = ray(rough(), (0.0, 0.0), angle)
    assert found["passive"][0] <= found["classical"] * (1 + 1e-6)


def test_constant_tensions_hold_as_much_along_the_fingers_and_little_across() -> None:
    grasp = load_grasp("tendon-block")
    assert held_constant(grasp, [0, 1, 0, 0, 0, 0]) == pytest.approx(140 / 9, rel=1e-6)
    assert held_constant(grasp, [0, -1, 0, 0, 0, 0]) == pytest.approx(15, rel=1e-6)
    assert held_constant(grasp, [-1, 0, 0, 0, 0, 0]) < 6
    assert held_constant(grasp.with_preload(None), [0, 1, 0, 0, 0, 0]) == pytest.approx(0, abs=1e-6)


def test_a_locator_has_no_end() -> None:
    assert held_constant(load_grasp("milling-fixture"), [-1, 0, 0, 0, 0, 0]) == np.inf


def test_a_base_load_that_nothing_balances() -> None:
    grasp = load_grasp("four-feet")
    assert np.isnan(held_constant(grasp, [0, 1, 0, 0, 0, 0], [0, 0, 100, 0, 0, 0]))
