"""The scale of a load, and the slack: by hand, in any frame, at any size."""

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.tolerance import EPS, load_scale, slack
from tests.support.exact_states import data

HINGE = GraspJoint("hinge", [0, 0, 1], [0.1, 0, 0], (1,))
SLIDE = GraspJoint("slide", [1, 0, 0], [0, 0, 0], (1,), "prismatic")
CONTACTS = [Contact([-0.02, 0, 0], [1, 0, 0], 0.5), Contact([0.02, 0, 0], [-1, 0, 0], 0.5)]


def test_the_scale_is_that_of_the_load():
    g = data(Grasp(CONTACTS, [HINGE, SLIDE], preload={"hinge": 0.3, "slide": 2.0}))
    assert load_scale(g, np.array([3.0, 0, 4, 0, 0, 0])) == pytest.approx(5.0)
    assert load_scale(g, np.array([0.0, 0, 1, 0, 0, 0.1])) == pytest.approx(0.1 / 0.02)
    # without a load: 0.3 N m at the size 0.02 m is 15 N, 2 N of the slide is less
    assert load_scale(g, np.zeros(6)) == pytest.approx(15.0)
    spring = replace(g, torque=np.array([0.0, 40.0]))
    assert load_scale(spring, np.zeros(6)) == pytest.approx(40.0)


def test_the_scale_does_not_depend_on_the_origin():
    there = np.array([0.3, -0.2, 5.0])
    moved = data(Grasp([Contact(c.position + there, c.normal, 0.5) for c in CONTACTS]))
    here = data(Grasp(CONTACTS))
    w = np.array([1.0, -2, 0.5, 0.02, 0.01, -0.03])
    shifted = np.concatenate([w[:3], w[3:] + np.cross(there, w[:3])])
    assert load_scale(moved, shifted) == pytest.approx(load_scale(here, w), rel=1e-9)
    assert moved.size == pytest.approx(here.size)


def test_the_slack_has_the_units_of_its_rows():
    g = data(Grasp(CONTACTS, [HINGE, SLIDE]))
    np.testing.assert_allclose(slack(g, 7.0) / (7 * EPS), [1, 1, 1, 0.02, 0.02, 0.02, 0.02, 1.0])


@pytest.mark.parametrize("exponent", range(-20, 21, 4))
def test_sizes_are_in_proportion(exponent):
    """One contact on a hinge, contacts apart, contacts at one point: no length is absolute."""
    a = 10.0**exponent
    cases = [
        (CONTACTS, HINGE, 0.02, 0.08),
        ([Contact([0.02, 0, 0], [-1, 0, 0], 0.5)] * 2, HINGE, 0.08, 0.08),
        ([Contact([0.1, 0, 0], [-1, 0, 0], 0.5)] * 2, HINGE, 0.1, 0.1),
    ]
    for contacts, joint, size, arm in cases:
        g = data(Grasp(contacts, [joint]))
        scaled = replace(g, positions=a * g.positions, origins=a * g.origins)
        assert scaled.size == pytest.approx(a * size)
        assert scaled.joint_arms[0] == pytest.approx(a * arm)
