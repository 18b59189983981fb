"""Energies of dexterous grasp planners against cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from handfast import Contact, Grasp
from handfast.measures.energies import benchmark_scale, dfc, graspqp, sphere, tdg, wrench_error
from handfast.measures.wrench_scale import WrenchScale
from tests.support.round_grasps import four, pair, round_grasp, three

MU = 0.3
ONE = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)])


def scaled(grasp):
    return benchmark_scale(grasp).grasp_map(grasp)


def test_benchmark_scale():
    """About the middle of the contacts, by the mean distance: two contacts on a circle's quadrant are 1/sqrt(2) off."""
    scale = benchmark_scale(round_grasp((0, 90), MU))
    np.testing.assert_allclose(scale.about, [0.5, 0.5, 0], atol=1e-12)
    assert scale.length == pytest.approx(np.sqrt(0.5))


def test_dfc():
    """Normals that balance leave nothing; two at a right angle leave sqrt(2), with no torque about their middle."""
    for grasp in (pair(MU), three(MU), four(MU)):
        assert dfc(scaled(grasp)) == pytest.approx(0.0, abs=1e-12)
    assert dfc(scaled(round_grasp((0, 90), MU))) == pytest.approx(np.sqrt(2))
    twisted = Grasp([Contact([1, 0, 0], [0, 1, 0], MU), Contact([-1, 0, 0], [0, -1, 0], MU)])
    assert dfc(WrenchScale(np.zeros(3), 1.0).grasp_map(twisted)) == pytest.approx(2.0)  # a couple alone


def test_tdg_of_one_contact_without_friction():
    """It answers every direction with its normal: the mean of 1 - cos over the sphere is 1."""
    assert tdg(ONE, scaled(ONE)) == pytest.approx(1.0, abs=1e-3)


def test_tdg_where_contacts_answer_with_nothing():
    """Without friction two that face each other cancel in every direction, which is a right angle to it: 1 - 0."""
    assert tdg(pair(0.0), scaled(pair(0.0))) == 1.0


def test_tdg_of_two_contacts_is_an_integral_over_the_angle():
    """Contacts at both ends of a line: the one faced answers 1 + min(tan, mu) across, the other fades out."""

    def lost(angle):
        c, s = np.cos(angle), np.sin(angle)
        fade = s / (s + 2 * MU * c)
        faced, other = min(s / c, MU), fade * MU
        along, across, torque = 1 - fade, faced + other, faced - other
        return (1 - (along * c + across * s) / np.sqrt(along**2 + across**2 + torque**2)) * s

    expected = quad(lost, 0, np.pi / 2, points=[np.arctan(MU)])[0]
    assert tdg(pair(MU), scaled(pair(MU)), 20000) == pytest.approx(expected, rel=1e-3)


def test_directions_are_even():
    d = sphere(1000)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1)
    np.testing.assert_allclose(d.T @ d / 1000, np.eye(3) / 3, atol=2e-3)


def test_wrench_error():
    """One contact must press 1 N: 1.1, 0.9 and four times sqrt(1.01) are left of 0.1 N along the axes."""
    pytest.importorskip("clarabel")
    assert wrench_error(ONE, scaled(ONE)) == pytest.approx((1.1 + 0.9 + 4 * np.sqrt(1.01)) / 6, rel=1e-7)
    assert wrench_error(pair(0.0), scaled(pair(0.0))) == pytest.approx(0.4 / 6, rel=1e-7)  # nothing across
    assert wrench_error(pair(MU), scaled(pair(MU))) == 0.0


def test_graspqp():
    """One contact leaves 1 N, half its square and 0.01 doubled are 1.02; its map has no volume."""
    assert graspqp(ONE, scaled(ONE)) == pytest.approx(1.02, rel=1e-9)
    sizes = np.linalg.svd(np.hstack([scaled(four(MU))[:, 3 * i : 3 * i + 3] @ edges().T for i in range(4)]))[1]
    expected = 0.02 * np.exp(-0.1 * np.prod(sizes) ** (1 / 6))
    assert graspqp(four(MU), scaled(four(MU))) == pytest.approx(expected, rel=1e-7)


def edges():
    """(4, 3) the forces along the cone's edges: unit vectors, shared out."""
    f = np.array([[1, MU, 0], [1, 0, MU], [1, -MU, 0], [1, 0, -MU]])
    return f / np.linalg.norm(f[0]) / 4
