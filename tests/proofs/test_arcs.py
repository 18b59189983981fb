"""Arcs by hand: a jaw that squeezes with 5 N and holds up to 5 N down; planted wrong ones."""

from dataclasses import replace

import numpy as np
import pytest

from handfast.proofs.arcs import Arc, read_arc, unproved
from handfast.proofs.fields import BadFile, Fields
from handfast.stability.queries import check
from tests.support.exact_states import problem, state
from tests.support.law_grasps import DOWN, jaw

GRASP = jaw(None, {"hinge": 0.5})


def at(s):
    """The state of a magnitude: by hand 5 N at both contacts, s / 2 of friction each."""
    return state(check(GRASP, s * np.array(DOWN, dtype=float)).witness.state)


def asked():
    return replace(problem(GRASP, np.zeros(6)), along=np.array(DOWN, dtype=float))


def straight(first, last):
    """All convex combinations of two states that stick."""
    one, two = at(first), at(last)
    motion = {"r": one.r, "q": one.q}
    return Arc.of(asked().grasp, first, last, [one, replace(two, **motion)])


@pytest.mark.parametrize(("first", "last"), [(1.0, 2.0), (0.01, 4.9), (0.0, 1.0), (0.0, 1e-12)])
def test_what_sticks_is_resisted_all_along(first, last):
    assert unproved(asked(), straight(first, last)) == []


def test_nothing_is_said_of_loads_beyond_friction():
    p, arc = asked(), straight(1.0, 2.0)
    left = unproved(p, Arc(1.0, 8.0, arc.motions, np.stack([arc.forces[0], 7 * arc.forces[1] - 6 * arc.forces[0]])))
    assert left
    assert left[-1][1] == 8.0
    assert left[0][0] == pytest.approx(5.0, rel=0.05)  # 2 mu N


@pytest.mark.parametrize(
    ("torque", "missed"), [(1e-3, True), (1e-9, True), (1e-10, True), (1e-13, False), (0.0, False)]
)
def test_a_torque_about_the_line_of_two_contacts_is_nothing_that_they_resist(torque, missed):
    """The slack is 1e-9 of 1 N at 0.01 m: half of 1e-11 N m."""
    p = replace(asked(), wrench=np.array([0, 0, 0, torque, 0, 0]))
    left = unproved(p, straight(1.0, 2.0))
    assert left == ([(1.0, 2.0)] if missed else [])


@pytest.mark.parametrize(
    "changed",
    [{"mu": np.full(2, 0.09)}, {"command": np.array([0.09])}, {"stop": np.array([2])}, {"R": np.eye(1) * 0.1}],
)
def test_an_arc_of_another_grasp_is_refused(changed):
    """Friction, command, stop, gearing: 1 N and more is not held, or not by these states."""
    p = asked()
    assert unproved(replace(p, grasp=replace(p.grasp, **changed)), straight(1.0, 2.0)) == [(1.0, 2.0)]


def test_a_part_of_an_arc_is_the_arc():
    arc = straight(1.0, 2.0)
    controls = np.stack([arc.forces[0], arc.forces[1], 2 * arc.forces[0], arc.forces[1] - arc.forces[0]])
    motions = np.repeat(arc.motions[:1], 4, axis=0)
    bent = Arc(1.0, 2.0, motions, controls)
    part = bent.between(1.25, 1.75)
    t = np.array([0.25, 0.5, 0.75])
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    expected = weights @ controls
    np.testing.assert_allclose(part.forces[0], expected[0], atol=1e-14)
    np.testing.assert_allclose(part.middle[1], expected[1], atol=1e-14)
    np.testing.assert_allclose(part.forces[-1], expected[2], atol=1e-14)


@pytest.mark.parametrize(
    ("changed", "words"),
    [({"last": 1.0}, "range of magnitudes"), ({"controls": []}, "2 to 13 are possible"), ({"more": 1}, "known field")],
)
def test_what_is_no_arc_is_refused(changed, words):
    x = at(1.0)
    control = {name: getattr(x, name).tolist() for name in ("r", "q", "c", "f", "coupling")}
    data = {"first": 1.0, "last": 2.0, "controls": [control, control]}
    assert read_arc(Fields(data, "arcs[0]"), asked().grasp).last == 2.0
    with pytest.raises(BadFile, match=words):
        read_arc(Fields(data | changed, "arcs[0]"), asked().grasp)
