"""Balance by statics alone: of loads on a grasp, and of squeezes at places that are to be touched."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handfast import Verdict, check
from handfast.model.grasp import Contact, Grasp
from handfast.planning.filters.balance import (
    balances,
    circumscribed,
    friction_margin,
    imbalance,
    squeeze_imbalance,
    squeeze_margin,
)
from tests.support.problems import X, Y, Z, nest, table
from tests.support.problems import pinch as gripped

ZERO = np.zeros(3)

# --- loads --------------------------------------------------------------------------------------


def pinch(friction: float) -> Grasp:
    return Grasp([Contact([-0.02, 0, 0], [1, 0, 0], friction), Contact([0.02, 0, 0], [-1, 0, 0], friction)])


def test_a_pinch_balances_a_weight_with_friction_alone() -> None:
    weight = np.array([0, 0, -1.0, 0, 0, 0])
    assert balances(pinch(0.5), weight[None])
    assert not balances(pinch(0.0), weight[None])
    assert balances(pinch(0.0), np.array([1.0, 0, 0, 0, 0, 0])[None])


def test_point_contacts_do_not_balance_a_moment_about_their_line() -> None:
    assert not balances(pinch(1.0), np.array([0, 0, 0, 0.1, 0, 0])[None])


def test_contacts_on_one_side_cannot_pull() -> None:
    table = Grasp([Contact([x, y, 0], [0, 0, 1], 0.5) for x, y in ((0.1, 0), (-0.1, 0.1), (-0.1, -0.1))])
    assert balances(table, np.array([0, 0, -1.0, 0, 0, 0])[None])
    assert not balances(table, np.array([0, 0, 1.0, 0, 0, 0])[None])
    assert not balances(table, np.array([0, 0, -1.0, 0, 0.2, 0])[None])  # it would tip over the edge


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(1, 6), st.floats(0, 1.5))
def test_what_forces_within_the_cones_make_is_balanced(seed: int, m: int, mu: float) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.standard_normal((m, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    grasp = Grasp([Contact(0.1 * rng.standard_normal(3), n, mu) for n in normals])
    pressed, angle, share = rng.random(m), rng.uniform(0, 2 * np.pi, m), rng.random(m)
    c = np.column_stack([pressed, share * mu * pressed * np.cos(angle), share * mu * pressed * np.sin(angle)])
    assert balances(grasp, (-grasp.G @ c.ravel())[None])


def test_imbalance_of_a_pinch() -> None:
    side, along = np.concatenate([Y, ZERO]), np.concatenate([X, ZERO])
    turn, pulled = np.concatenate([ZERO, X]), np.concatenate([Z, ZERO])
    np.testing.assert_allclose(imbalance(gripped(), np.array([side, along, turn])), [0, 0, 1], atol=1e-9)
    assert imbalance(nest(), pulled[None])[0] == pytest.approx(1.0, abs=1e-9)
    assert imbalance(nest(), -pulled[None])[0] == pytest.approx(0.0, abs=1e-9)


def test_friction_margin_of_a_wedge() -> None:
    """Two tips on faces that lean by 20 degrees towards each other squeeze it out unless mu >= tan 20 degrees."""
    a, mu = np.radians(20), 0.8
    n = np.array([[-np.cos(a), 0, np.sin(a)], [np.cos(a), 0, np.sin(a)]])
    grasp = Grasp([Contact(np.array([s, 0.0, 0.0]) * 0.03, k, mu) for s, k in zip((1, -1), n, strict=True)])
    down = np.array([[0, 0, 1.0, 0, 0, 0]])  # out of the wedge, the way the faces push
    margin = friction_margin(grasp, down)
    least = np.tan(a) / mu  # of the cones; a pyramid's edge lies in this plane
    assert 1 - least - 1 / 64 <= margin <= 1 - least
    assert friction_margin(grasp.with_friction(0.3), down) == 0.0


@given(st.integers(0, 200))
@settings(max_examples=25, derandomize=True, deadline=None)
def test_what_is_resisted_is_balanced(seed: int) -> None:
    """Statics is necessary: a witness of `check` lies within pyramids around the cones."""
    rng = np.random.default_rng(seed)
    w = rng.normal(size=6) * [1, 1, 1, 0.02, 0.02, 0.02]
    if seed % 2:
        grasp, w[2] = table(mu=0.5), -10.0  # pressed on: it would slide from 5 N on
    else:
        grasp, w[3] = gripped(torque=1.0), 0.0  # a pinch has no torque about the line between its tips
    assert check(grasp, w).verdict is Verdict.HOLDS
    assert imbalance(grasp, w[None], circumscribed())[0] < 1e-6


# --- squeezes -----------------------------------------------------------------------------------


def test_planted_balances() -> None:
    two = np.array([[-0.03, 0, 0], [0.03, 0, 0]])
    against, across = np.array([[1.0, 0, 0], [-1, 0, 0]]), np.array([[1.0, 0, 0], [0, 1, 0]])
    assert squeeze_margin(two, against, 0.5) == pytest.approx(1)
    assert squeeze_margin(two, across, 0.5) < 0
    assert squeeze_imbalance(two[None], against[None])[0] < 1e-3 < 0.5 < squeeze_imbalance(two[None], across[None])[0]
    angles = np.radians([90, 210, 330])
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    assert squeeze_margin(0.03 * out, -out, 0.4) == pytest.approx(1)
    assert squeeze_margin(0.03 * out, -out + 2 * out * [[1], [0], [0]], 0.4) < 0  # one would have to pull


@pytest.mark.parametrize(("tilt", "friction"), [(10, 0.3), (20, 0.3), (20, 0.5), (30, 0.5)])
def test_two_tilted_faces_balance_within_the_friction_cone(tilt: float, friction: float) -> None:
    """In closed form: the line between must be within both cones; the polygon loses at most 8 % of the radius."""
    s, c = np.sin(np.radians(tilt)), np.cos(np.radians(tilt))
    m = squeeze_margin(np.array([[-0.03, 0, 0], [0.03, 0, 0]]), np.array([[c, 0, s], [-c, 0, s]]), friction)
    exact = 1 - (s / c) / friction
    assert exact - 0.09 * (1 - exact) - 1e-9 <= m <= exact + 1e-9


@settings(max_examples=15, derandomize=True, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 4))
def test_balance_does_not_depend_on_the_frame(seed: int, k: int) -> None:
    random = np.random.default_rng(seed)
    points = 0.05 * random.normal(size=(k, 3))
    normals = -points / np.linalg.norm(points, axis=1)[:, None]
    R = Rotation.random(rng=seed).as_matrix()
    moved = points @ R.T + [0.3, -0.1, 0.2]
    assert squeeze_imbalance(moved[None], (normals @ R.T)[None]) == pytest.approx(
        squeeze_imbalance(points[None], normals[None])
    )
    a, b = squeeze_margin(points, normals, 0.5), squeeze_margin(moved, normals @ R.T, 0.5)
    assert (a > 0.1) <= (b > 0)  # the polygon turns with the frame
    assert abs(a - b) < 0.2 or max(a, b) <= 0.05
