"""Chosen forces, internal forces, PCR and PGR against cases worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from handfast import Contact, Grasp, GraspJoint, InputError, Mechanism, load_grasp, measure
from handfast.measures import wrench_space
from handfast.measures.conic_program import largest_wrench, smallest_forces
from handfast.measures.internal_forces import (
    LOST,
    SLIDES,
    STICKS,
    _robustness,
    _StateForces,
    contact_robustness,
    grasp_robustness,
    internal_forces,
)
from handfast.measures.wrench_scale import WrenchScale, edge_wrenches
from handfast.measures.wrench_space import linf_epsilon
from tests.support.round_grasps import four, pair, three

MU = 0.2
SCALE = WrenchScale(np.zeros(3), 1.0)
X, Y, TX = np.eye(6)[[0, 1, 3]]


def best_squeeze(mu, force=1.0):
    """The distance of the best equal normal forces c from slipping, sin a c, and from the limit, force - c."""
    sine = mu / np.hypot(1, mu)
    return force * sine / (1 + sine)


pytest.importorskip("clarabel")


@pytest.mark.parametrize(
    ("grasp", "direction", "expected"),
    [
        (pair(MU), X, 1.0),  # one contact presses harder
        (pair(MU), Y, 2 * MU),  # friction of both
        (pair(MU), TX, 0.0),  # nothing turns it about the line
        (three(MU), TX, 1.5 * MU),  # z forces mu, -mu/2, -mu/2 at y = 1, -1/2, -1/2
        (four(MU), TX, 2 * MU),
        (four(0.0), Y, 1.0),  # cones that are lines
    ],
)
def test_largest_wrench(grasp, direction, expected):
    G = SCALE.grasp_map(grasp)
    assert largest_wrench(grasp, G, direction) == pytest.approx(expected, abs=1e-7)
    assert largest_wrench(grasp, G, direction, force=3.0) == pytest.approx(3 * expected, abs=1e-6)


@pytest.mark.parametrize(
    ("grasp", "direction", "expected"),
    [
        (pair(MU), X, 1.0),
        (pair(MU), Y, 0.5 * np.sqrt(1 + 1 / MU**2)),  # half of it in friction at each
        (pair(MU), TX, np.inf),
        (three(MU), TX, 2 / 3 * np.sqrt(1 + 1 / MU**2)),  # z forces 2/3, -1/3, -1/3
    ],
)
def test_smallest_forces(grasp, direction, expected):
    assert smallest_forces(grasp, SCALE.grasp_map(grasp), direction) == pytest.approx(expected, rel=1e-7)


def test_torque_limits():
    """A finger that slides along its normal carries its normal force: 0.25 N at most, so friction is a quarter."""
    grasp = pair(MU, fingers=True)
    G, limits = SCALE.grasp_map(grasp), {"finger_0": 0.25}
    assert largest_wrench(grasp, G, Y, torque_limits=limits) == pytest.approx(0.25 * 2 * MU, rel=1e-6)
    with pytest.raises(InputError, match="unknown actuator 'finger_9'"):
        largest_wrench(grasp, G, Y, torque_limits={"finger_9": 1.0})
    with pytest.raises(InputError, match=r"torque_limits.finger_0: is -1; a limit above 0"):
        smallest_forces(grasp, G, Y, torque_limits={"finger_0": -1.0})


@pytest.mark.parametrize("name", ["barrett-can", "fig7"])
def test_epsilon_is_below_the_largest_wrench_anywhere(name):
    """The pyramids lie inside the cones, and the worst of all directions below the worst of twelve."""
    grasp = load_grasp(name)
    scale = WrenchScale.of(grasp)
    G = scale.grasp_map(grasp)
    worst = min(largest_wrench(grasp, G, u) for u in np.vstack([np.eye(6), -np.eye(6)]))
    assert 0 < linf_epsilon(edge_wrenches(grasp, scale)) <= worst * (1 + 1e-6)


def dimensions(grasp):
    found = internal_forces(grasp, SCALE.grasp_map(grasp))
    G = SCALE.grasp_map(grasp)
    assert np.abs(G @ np.hstack([found.controllable, found.passive])).max(initial=0.0) < 1e-9
    assert np.abs(found.controllable.T @ found.passive).max(initial=0.0) < 1e-9
    return found.dimension, found.controllable.shape[1], found.passive.shape[1]


def test_internal_forces():
    """Internal forces have 3 m - rank G dimensions; fixed contacts leave them all passive."""
    assert dimensions(pair(MU)) == (1, 0, 1)
    assert dimensions(pair(MU, fingers=True)) == (1, 1, 0)
    assert dimensions(three(MU)) == (3, 0, 3)
    assert dimensions(three(MU, fingers=True)) == (3, 3, 0)
    assert dimensions(four(MU, fingers=True)) == (6, 4, 2)  # four joints, six internal forces


def test_one_motor_behind_a_coupling_controls_one_dimension():
    contacts, joints = three(MU, fingers=True).contacts, three(MU, fingers=True).joints
    together = Mechanism(("motor",), np.eye(3)[:1], np.array([[1.0, -1, 0], [0, 1, -1]]), (False,))
    grasp = Grasp(contacts, joints, together)
    assert dimensions(grasp) == (3, 1, 2)
    squeeze = internal_forces(grasp, SCALE.grasp_map(grasp)).controllable.reshape(3, 3)
    np.testing.assert_allclose(np.abs(squeeze), np.array([[1, 0, 0]] * 3) / np.sqrt(3), atol=1e-9)


def test_a_joint_that_nothing_drives_yields():
    """Fingers that slide freely press nothing: what is left is friction across, which no motor changes."""
    contacts, joints = pair(MU, fingers=True).contacts, pair(MU, fingers=True).joints
    loose = Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ())
    assert dimensions(Grasp(contacts, joints, loose))[1] == 0


@pytest.mark.parametrize(("grasp", "stiffness"), [(three(MU, fingers=True), 1.5), (four(MU, fingers=True), 2.0)])
def test_contact_robustness(grasp, stiffness):
    """Equal normal forces are the best squeeze; G G^T is least for tilting, sum of the squared arms: m / 2."""
    G = SCALE.grasp_map(grasp)
    assert wrench_space.smallest_singular_value(G) == pytest.approx(np.sqrt(stiffness))
    expected = best_squeeze(MU) * np.sqrt(stiffness)
    assert contact_robustness(grasp, G) == pytest.approx(expected, rel=1e-6)
    assert contact_robustness(grasp, G, force=4.0) == pytest.approx(4 * expected, rel=1e-6)


def test_grasp_robustness_gives_a_useless_contact_up():
    """A fourth contact without friction below can never be far from slipping; lost, it leaves three that hold."""
    with_palm = [*three(MU).contacts, Contact([0, 0, -1], [0, 0, 1], 0.0)]
    grasp = Grasp(with_palm, three(MU, fingers=True).joints)
    G = SCALE.grasp_map(grasp)
    assert contact_robustness(grasp, G) == pytest.approx(0.0, abs=1e-9)
    value, states = grasp_robustness(grasp, G)
    assert value == pytest.approx(best_squeeze(MU) * np.sqrt(1.5), rel=1e-6)
    assert states == (STICKS, STICKS, STICKS, LOST)


def test_no_robustness_without_joints():
    G = SCALE.grasp_map(four(MU))
    assert contact_robustness(four(MU), G) == 0.0
    assert grasp_robustness(four(MU), G)[0] == 0.0


@pytest.mark.parametrize("force", [1.0, 4.0])
@pytest.mark.parametrize("states", [(STICKS,) * 4, (STICKS, STICKS, STICKS, SLIDES)])
@pytest.mark.parametrize("mu", [0.2, 0.5, 1e3])
def test_what_a_state_can_reach_at_best_is_reached_by_an_even_squeeze(mu, states, force):
    """All normal forces alike: sine / (1 + sine) of the limit where contacts stick, half of it where all slide.

    Above mu = 0.35, where the first is above 1/4, a bound of 1/4 would be too small; with 1000 it is nearly the half.
    """
    grasp = four(mu, fingers=True)
    part = _StateForces(grasp, SCALE.grasp_map(grasp), states, force)
    assert part.bound > 0
    assert _robustness(grasp, part) == pytest.approx(part.bound, rel=1e-5)
    assert part.bound * part.gain == pytest.approx(best_squeeze(mu, force))


def test_a_contact_that_slides_has_no_cone_to_keep():
    """One of four slips at once, but as it slides and is pressed alone, the cones of the others are the bound."""
    contacts, joints = four(0.5, fingers=True).contacts, four(0.5, fingers=True).joints
    grasp = Grasp([*contacts[:3], replace(contacts[3], friction=0.01)], joints)
    part = _StateForces(grasp, SCALE.grasp_map(grasp), (STICKS, STICKS, STICKS, SLIDES), 1.0)
    assert part.bound * part.gain == pytest.approx(best_squeeze(0.5))
    assert _robustness(grasp, part) == pytest.approx(part.bound, rel=1e-5)


def test_grasp_robustness_is_the_best_of_all_states():
    """The order of programs leaves none out that would be better: all of them, one by one."""
    contacts, joints = three(MU, fingers=True).contacts, three(MU, fingers=True).joints
    tilted = [Contact(c.position + np.array([0, 0, 0.1 * k]), c.normal, 0.3 + 0.1 * k) for k, c in enumerate(contacts)]
    grasp = Grasp([*tilted, Contact([0, 0.2, -1], [0, 0, 1], 0.5)],
                  [*joints, GraspJoint("palm", [0, 0, 1], [0, 0, -1], (3,), "prismatic")])  # fmt: skip
    G = SCALE.grasp_map(grasp)
    parts = [_StateForces(grasp, G, states, 1.0) for states in product(range(3), repeat=4)]
    every = [_robustness(grasp, part) for part in parts]
    assert all(value <= part.bound * (1 + 1e-6) for value, part in zip(every, parts, strict=True))
    assert grasp_robustness(grasp, G)[0] == pytest.approx(max(every), rel=1e-6)
    assert max(every) > 0


def test_singular_values():
    """G G^T of three contacts on a unit circle is diag(3, 3, 3, 1.5, 1.5, 3); of two it has no torque about x."""
    G = SCALE.grasp_map(three(MU))
    assert wrench_space.isotropy(G) == pytest.approx(np.sqrt(0.5))
    assert wrench_space.ellipsoid_volume(G) == pytest.approx(np.sqrt(3**4 * 1.5**2))
    P = SCALE.grasp_map(pair(MU))
    assert wrench_space.isotropy(P) == pytest.approx(0.0, abs=1e-12)
    one = SCALE.grasp_map(Grasp(pair(MU).contacts[:1]))
    assert (wrench_space.smallest_singular_value(one), wrench_space.isotropy(one)) == (0.0, 0.0)


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_how_many_internal_forces_there_are_does_not_hang_on_the_unit_of_torques(length: float):
    found = measure(load_grasp("fig11"), only=["internal_dimension", "controllable_dimension"], length=length)
    assert (found["internal_dimension"], found["controllable_dimension"]) == (3, 3)
