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


@pytest.mark.parametrize("row", range(6))
def test_a_force_of_a_control_is_moved(row):
    """By 1e-6 of the load: more than the slack, and nothing makes up for it on a straight arc of given forces."""
    p, arc = asked(), straight(1.0, 2.0)
    forces = arc.forces.copy()
    forces[1, row] += 2e-6
    motions = arc.motions.copy()
    wrong = Arc(1.0, 2.0, motions, forces)
    if row in (1, 2, 4, 5):  # friction that the load does not ask for: a box about it has an exact state still
        assert unproved(replace(p, wrench=np.array([0, 0, 0, 0, 0, 1e-3])), wrong)
    else:
        motions = motions + np.eye(7)[0] * 1e-3 * (row == 0)
        assert unproved(replace(p, grasp=p.grasp.with_command(np.array([0.501]))), Arc(1.0, 2.0, motions, forces))


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
