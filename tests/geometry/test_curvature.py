"""Curvature of surfaces that are known in closed form, and contacts that fit or do not."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix
from handfast.geometry.curvature import (
    cap_curvature,
    patch_curvature,
    principal_curvatures,
    relative_curvature,
    rim_depth,
)
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap
from handfast.proofs.configurations import ContactPoint, Existence
from handfast.synthesis.solution import Solution, relative_curvatures
from handfast.synthesis.task import ContactPair, Task
from handfast.synthesis.task_file import load_task
from tests.support.feasible import Feasible
from tests.support.places import FEASIBLE as FEASIBLE_FILE

FEASIBLE = json.loads(FEASIBLE_FILE.read_text("utf-8"))["tasks"]
UP = np.array([0.0, 0.0, 1.0])
SIDE = 0.02  # [m] half of it either way


def bowl(kx: float, ky: float, twist: float = 0.0, flip: bool = False) -> Bezier:
    """The surface z = -(kx x^2 + ky y^2) / 2 - twist x y over a square, exactly; its middle is the origin."""
    ends = np.array([-SIDE / 2, SIDE / 2])
    at = np.array([ends[0], 0.0, ends[1]])
    square = np.array([ends[0] ** 2, ends[0] * ends[1], ends[1] ** 2])  # blossom of x^2
    x, y = np.meshgrid(at, at, indexing="ij")
    z = -(kx * square[:, None] + ky * square[None]) / 2 - twist * x * y
    return Bezier(np.stack([x, y, z], axis=2), flip)


def rotation(seed: int) -> np.ndarray:
    return quaternion_matrix(np.random.default_rng(seed).normal(size=4))


# --- one surface ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("patch", "expected"),
    [(bowl(0, 0), (0, 0)), (bowl(50, 0), (0, 50)), (bowl(-40, 70), (-40, 70)), (bowl(0, 0, twist=30), (-30, 30))],
    ids=["plane", "cylinder", "saddle", "twisted"],
)
def test_principal_curvatures_of_quadrics(patch: Bezier, expected: tuple[float, float]) -> None:
    np.testing.assert_allclose(principal_curvatures(patch_curvature(patch, 0.5, 0.5), UP), expected, atol=1e-9)
    turned = Bezier(patch.points, flip=True)
    np.testing.assert_allclose(patch_curvature(turned, 0.5, 0.5), -patch_curvature(patch, 0.5, 0.5), atol=1e-12)


def test_curvature_along_a_parabola() -> None:
    k, x = 60.0, 0.3 * SIDE
    K = patch_curvature(bowl(k, 0), 0.8, 0.1)
    n = np.array([k * x, 0, 1]) / np.hypot(k * x, 1)
    expected = k / (1 + (k * x) ** 2) ** 1.5
    np.testing.assert_allclose(K @ n, 0, atol=1e-9)
    np.testing.assert_allclose(principal_curvatures(K, n), [0, expected], atol=1e-9)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6), flip=st.booleans())
def test_the_normal_turns_by_the_tensor(seed: int, flip: bool) -> None:
    """Weingarten: n changes by K x along a step x; for any patch, in any parameters."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.linspace(0, 0.03, 4), np.linspace(0, 0.05, 3), indexing="ij")
    patch = Bezier(np.stack([i, j, 0 * i], axis=2) + rng.uniform(-2e-3, 2e-3, (4, 3, 3)), flip)
    u, v = rng.uniform(0.1, 0.9, 2)
    K, h = patch_curvature(patch, u, v), 1e-5

    def normal(u: float, v: float) -> np.ndarray:
        n = patch.normal(u, v)
        return n / np.linalg.norm(n)

    np.testing.assert_allclose(K, K.T, atol=1e-9)
    np.testing.assert_allclose(K @ normal(u, v), 0, atol=1e-7)
    np.testing.assert_allclose(K @ patch.at(u, v, 1, 0), (normal(u + h, v) - normal(u - h, v)) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(K @ patch.at(u, v, 0, 1), (normal(u, v + h) - normal(u, v - h)) / (2 * h), atol=1e-6)


def test_a_cap_curves_as_its_sphere() -> None:
    cap = Cap([0, 0, 0], 0.02, UP, 1.0)
    n = rotation(3)[0]
    np.testing.assert_allclose(principal_curvatures(cap_curvature(cap, n), n), [50, 50], atol=1e-12)
    np.testing.assert_allclose(cap_curvature(cap, -n), cap_curvature(cap, n))
    hollow = Cap([0, 0, 0], 0.02, UP, 1.0, flip=True)
    np.testing.assert_allclose(principal_curvatures(cap_curvature(hollow, n), n), [-50, -50], atol=1e-12)


def test_a_point_without_a_normal_is_refused() -> None:
    patch = bowl(0, 0)
    collapsed = np.array(patch.points)
    collapsed[0] = collapsed[0, 0]  # one side becomes a point
    broken = Bezier.__new__(Bezier)
    object.__setattr__(broken, "points", collapsed)
    object.__setattr__(broken, "flip", False)
    with pytest.raises(InputError, match=r"bezier: has no normal at u = 0, v = 0.5"):
        patch_curvature(broken, 0.0, 0.5)
    assert np.isfinite(patch_curvature(broken, 0.5, 0.5)).all()


# --- two surfaces -----------------------------------------------------------------------------------


def test_a_ball_that_is_wider_than_the_groove_interpenetrates_it() -> None:
    groove = patch_curvature(bowl(-1 / 0.005, 0), 0.5, 0.5)
    wide, slim = (cap_curvature(Cap([0, 0, 0], r, UP, 1.0), UP) for r in (0.010, 0.004))
    assert relative_curvature(wide, groove, UP) == pytest.approx(100 - 200)
    assert relative_curvature(slim, groove, UP) == pytest.approx(250 - 200)
    # circle of 10 mm against the parabola of the groove, 1 mm aside: they cross by half 100 x^2
    assert rim_depth(-100.0, 1e-3) == pytest.approx(0.05e-3)
    x = 1e-3
    assert x**2 / (2 * 0.005) - (0.010 - np.sqrt(0.010**2 - x**2)) == pytest.approx(0.05e-3, rel=0.01)
    np.testing.assert_allclose(rim_depth([50.0, -100.0], 3e-3), [0, 0.45e-3])


def test_a_ball_in_a_round_hollow() -> None:
    hollow = cap_curvature(Cap([0, 0, 0], 0.02, UP, 1.0, flip=True), UP)
    for radius, fits in ((0.019, True), (0.021, False)):
        ball = cap_curvature(Cap([0, 0, 0], radius, UP, 1.0), UP)
        assert (relative_curvature(ball, hollow, UP) > 0) == fits


def test_crossed_saddles_fit_and_aligned_ones_do_not() -> None:
    saddle = patch_curvature(bowl(80, -80), 0.5, 0.5)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert relative_curvature(saddle, saddle, UP) == pytest.approx(-160)
    assert relative_curvature(saddle, quarter @ saddle @ quarter.T, UP) == pytest.approx(0, abs=1e-9)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6), spot=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_curvature_does_not_depend_on_the_frame(seed: int, spot: tuple[float, float]) -> None:
    R, patch = rotation(seed), bowl(60, -30, 20)
    there = Bezier(patch.points @ R.T + R[0])
    K, ball = patch_curvature(patch, *spot), cap_curvature(Cap([0, 0, 0], 0.02, UP, 1.0), UP)
    np.testing.assert_allclose(patch_curvature(there, *spot), R @ K @ R.T, atol=1e-8)
    n = patch.normal(*spot) / np.linalg.norm(patch.normal(*spot))
    before = relative_curvature(K, ball, n)
    assert relative_curvature(R @ K @ R.T, R @ ball @ R.T, R @ n) == pytest.approx(before, abs=1e-8)
    assert relative_curvature(ball, K, -n) == pytest.approx(before, abs=1e-8)


# --- a configuration --------------------------------------------------------------------------------


def held(region: Bezier | Cap, groove: Bezier, at: tuple[float, float] | None, seed: int = 0) -> Solution:
    """One contact of a finger that is turned by its joint, on a groove that is turned as a whole."""
    joint = Joint("j", "revolute", UP, [0, 0, 0], -2, 2)
    links = (Link("palm", -1, np.eye(4)), Link("tip", 0, np.eye(4), (0,)))
    hand = Hand("finger", links, (joint,), Mechanism.direct(["j"]), (), np.zeros(1))
    task = Task.of(hand, (ContactPair("tip", region, groove),))
    quaternion = np.random.default_rng(seed).normal(size=4) if seed else np.array([1.0, 0, 0, 0])
    spot = ContactPoint("tip", (0.5, 0.5), at)
    return Solution.of(task, Existence({"j": np.pi / 2}, np.zeros(3), quaternion, (spot,), (), np.zeros(0)))


@pytest.mark.parametrize(("radius", "expected"), [(0.010, -100.0), (0.004, 50.0)])
@pytest.mark.parametrize("seed", [0, 5])
def test_the_groove_in_a_configuration(radius: float, expected: float, seed: int) -> None:
    found = held(Cap([0, 0, 0], radius, -UP, np.pi), bowl(-1 / 0.005, 0), None, seed)
    np.testing.assert_allclose(relative_curvatures(found), [expected], atol=1e-9)


def test_the_joint_turns_the_finger_s_patch() -> None:
    """A ridge along y, turned by 90 degrees, lies along x: across a groove along y, not in it."""
    groove, ridge = bowl(-50, 0), bowl(100, 0)
    down = Bezier(ridge.points * [1, 1, -1], flip=True)  # faces downwards, solid above
    np.testing.assert_allclose(relative_curvatures(held(down, groove, (0.5, 0.5))), [-50], atol=1e-9)
    along = bowl(0, 100)
    across = Bezier(along.points * [1, 1, -1], flip=True)
    np.testing.assert_allclose(relative_curvatures(held(across, groove, (0.5, 0.5))), [0], atol=1e-9)


@pytest.mark.parametrize("name", sorted(FEASIBLE))
def test_tasks_whose_configurations_do_not_interpenetrate(name: str) -> None:
    """The stored configurations are free of collision, so nothing curves in by more than their meshes show."""
    task, held = load_task(name), Feasible.of(FEASIBLE[name])
    R = held.pose[:3, :3]
    links = task.hand.link_poses(held.q(task))
    for pair, p, n in zip(task.contact_pairs, held.parameters, held.normals(task), strict=True):
        its = R @ patch_curvature(pair.object, *p[:2]) @ R.T
        if isinstance(pair.hand, Cap):
            mine = cap_curvature(pair.hand, n)
        else:
            L = links[task.hand.link(pair.link), :3, :3]
            mine = L @ patch_curvature(pair.hand, *p[2:4]) @ L.T
        assert rim_depth(relative_curvature(mine, its, n), 3e-3) < 1e-4
