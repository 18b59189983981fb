"""Wrench spaces against polytopes and grasps that are worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from handfast import InputError, load_grasp
from handfast.measures.conic_program import NotMeasured
from handfast.measures.wrench_scale import WrenchScale, edge_forces, edge_wrenches
from handfast.measures.wrench_space import L1Space, force_closure, linf_epsilon, linf_volume
from tests.support.round_grasps import four, pair, three

MU = 0.2
BOTH = np.stack([np.eye(6), -np.eye(6)], axis=1)  # (6, 2, 6): six contacts that push and pull along one axis each


def cones(grasp, edges=4):
    return edge_wrenches(grasp, WrenchScale(np.zeros(3), 1.0), edges)


def test_known_polytopes():
    """Of wrenches +-e_i, L1 is the cross-polytope, L infinity the cube."""
    space = L1Space(BOTH)
    radius, volume = space.epsilon, space.volume
    assert radius == pytest.approx(1 / np.sqrt(6), rel=1e-12)
    assert volume == pytest.approx(2**6 / 720, rel=1e-12)
    assert linf_epsilon(BOTH) == pytest.approx(1.0, rel=1e-9)
    assert linf_volume(BOTH) == pytest.approx(2**6, rel=1e-12)


def test_cube_on_four_points():
    """A direction (torque about z, and z force with tilting torques) meets every contact with mu max(|t|, |o s_i|).

    In L1 it is smallest where |t| = |o s_i| = c at all: c^2 (1 + 2) = 1. In L infinity the sum over the contacts is
    smallest for a tilting torque about the line through two of them: 2 mu.
    """
    assert L1Space(cones(four(MU))).epsilon == pytest.approx(MU / np.sqrt(3), rel=1e-9)
    assert linf_epsilon(cones(four(MU))) == pytest.approx(2 * MU, rel=1e-7)


def test_epsilon_in_another_scale_is_that_of_the_wrenches_there():
    """Facets stay facets where all wrenches are turned alike; outside of them it is 0, however they are turned."""
    points = cones(four(MU))
    turned = np.eye(6) + np.random.default_rng(3).normal(size=(6, 6)) / 4
    there = L1Space(points @ turned.T).epsilon
    assert L1Space(points).epsilon_in(turned) == pytest.approx(there, rel=1e-9)
    assert abs(there - L1Space(points).epsilon) > 1e-3
    beside = L1Space(points + 2.0)
    assert beside.epsilon == beside.epsilon_in(turned) == 0.0
    assert beside.volume > 0


def test_three_at_120_degrees():
    """Out of the plane the sum is mu (|v1| + |v2| + |v3|), v_i = a + b s_i; least at v = (c, 0, 0), c = 3/sqrt(5)."""
    assert linf_epsilon(cones(three(MU))) == pytest.approx(3 * MU / np.sqrt(5), rel=1e-7)


def test_antipodal_contacts_cannot_turn():
    """Nothing resists a torque about the line through both, however much friction there is."""
    flat = L1Space(cones(pair(MU)))
    assert (flat.epsilon, flat.volume, flat.epsilon_in(np.eye(6))) == (0.0, 0.0, 0.0)
    assert linf_epsilon(cones(pair(MU))) == 0.0
    assert linf_volume(cones(pair(MU))) == 0.0
    closed, margin = force_closure(cones(pair(MU)))
    assert not closed
    assert margin == pytest.approx(1.0)  # the forces balance, but do not span


@pytest.mark.parametrize("name", ["barrett-can", "fig11"])
def test_growing_agrees_with_the_whole_sum(name):
    """The polytope that grows ends at the radius of the Minkowski sum built in full."""
    from scipy.spatial import ConvexHull

    grasp = load_grasp(name)
    wrenches = edge_wrenches(grasp, WrenchScale.of(grasp), 4)
    points = np.zeros((1, 6))
    for cone in wrenches:
        points = (points[:, None] + np.vstack([np.zeros((1, 6)), cone])[None]).reshape(-1, 6)
    whole = ConvexHull(points)
    assert linf_epsilon(wrenches) == pytest.approx(-whole.equations[:, -1].max(), rel=1e-7)
    assert linf_volume(wrenches) == pytest.approx(whole.volume, rel=1e-9)


def test_too_many_corners():
    with pytest.raises(NotMeasured, match="4 cones of 8 edges has too many corners"):
        linf_volume(cones(four(MU), 8))


def test_force_closure():
    """Equal forces balance round a circle; without friction, or with all contacts on one side, none close."""
    for grasp in (three(MU), four(MU)):
        closed, margin = force_closure(cones(grasp))
        assert closed
        assert margin == pytest.approx(1.0)
    assert not force_closure(cones(four(0.0)))[0]
    from tests.support.round_grasps import round_grasp

    assert force_closure(cones(round_grasp((0, 60, 300), MU))) == (False, 0.0)


@pytest.mark.parametrize("side", [0.0, 0.02, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_facets_tell_the_margin_and_the_volume_with_the_origin(side, seed):
    """As the linear program and a hull of more points do; where all edges lie on one side there is no margin."""
    rng = np.random.default_rng(seed)
    wrenches = rng.normal(size=(5, 4, 6))
    wrenches[:, :, 0] = (1 - side) * wrenches[:, :, 0] + side * (1 + rng.uniform(size=(5, 4)))
    space = L1Space(wrenches)
    closed, margin = force_closure(wrenches)
    assert space.closure_margin == pytest.approx(margin, abs=1e-9)
    assert (space.closure_margin > 0) == closed
    assert closed == (side < 1.0 and seed > 0)
    whole = ConvexHull(np.vstack([wrenches.reshape(-1, 6), np.zeros((1, 6))]))
    assert space.volume == pytest.approx(whole.volume, rel=1e-9)


def test_flat_cones_leave_the_margin_to_the_program():
    assert L1Space(cones(pair(MU))).closure_margin is None


def test_scale():
    """Torques are about the point and divided by the length; a unit of the scale is a wrench and back."""
    grasp = load_grasp("barrett-can")
    scale = WrenchScale.of(grasp, about=[0.01, 0.02, 0.03], length=0.05)
    names, axes = scale.axes()
    np.testing.assert_allclose(scale.scaled(axes.T).T, np.repeat(np.eye(6), 2, axis=0) * np.tile([1, -1], 6)[:, None])
    assert names[0] == "force +x"
    assert names[7] == "torque -x"
    np.testing.assert_allclose(axes[0], [1, 0, 0, 0, 0.03, -0.02])
    c = grasp.contacts[0]
    expected = np.r_[c.normal, np.cross(c.position - scale.about, c.normal) / 0.05]
    np.testing.assert_allclose(scale.grasp_map(grasp)[:, 0], expected)
    usual = WrenchScale.of(grasp)
    np.testing.assert_allclose(usual.about, grasp.center_of_mass)
    assert usual.length == pytest.approx(np.linalg.norm(grasp.positions - usual.about, axis=1).max())


@pytest.mark.parametrize(("edges", "length", "words"), [(2, 1.0, "3 to 64 edges"), (8, 0.0, "a length above 0")])
def test_bad_choices(edges, length, words):
    with pytest.raises(InputError, match=words):
        edge_wrenches(pair(MU), WrenchScale.of(pair(MU), length=length), edges)


def test_edges_are_inside_the_cone():
    f = edge_forces(0.7, 5)
    np.testing.assert_allclose(f[:, 0], 1)
    np.testing.assert_allclose(np.hypot(f[:, 1], f[:, 2]), 0.7)
