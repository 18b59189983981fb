"""Forces of contacts by their motions: derivatives, and how much these change."""

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.states import Laws, Modes, State, came_from, read_state
from tests.support.exact_states import problem

NONE = np.zeros(0, dtype=np.int64)


def drawn(rng, soft, sin):
    """A sliding contact, its modes and motions (5,) of which it presses."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], float(rng.uniform(0.1, 2)), torsion=0.01 * soft)])
    p = replace(problem(grasp, [0, 0, -1.0]), sin=sin, cos=float(np.sqrt(1 - sin**2)))
    modes = Modes(np.array([3]), np.zeros(1, dtype=bool), NONE, NONE)
    d = rng.normal(size=5) * 10 ** rng.uniform(-3, 3)
    d[0] = -abs(d[0]) * 10 ** rng.uniform(0, 2) - sin * np.linalg.norm(d[1:])
    d[3 + soft :] = 0.0
    return p, modes, d[: 4 + soft]


@pytest.mark.parametrize(("soft", "sin"), [(False, 0.0), (True, 0.0), (False, 0.05), (False, 0.5)])
def test_derivatives_change_by_no_more_than_is_said(soft, sin):
    rng = np.random.default_rng(7)
    nearest = 0.0
    for _ in range(400):
        p, modes, d = drawn(rng, soft, sin)
        laws = Laws.of(p, modes, d, np.zeros(len(d)))
        reach = float(laws.speed[0]) * 10 ** rng.uniform(-6, np.log10(0.45))
        step = rng.normal(size=len(d))
        step[3 + soft :] = 0.0
        step *= reach / np.linalg.norm(step)
        changed = np.abs(Laws.of(p, modes, d + step, np.zeros(len(d))).K - laws.K).max()
        bound = float(laws.change(p, np.array([reach]))[0])
        size = float(np.abs(laws.K).max())
        assert changed <= bound + 1e-12 * size
        nearest = max(nearest, changed / bound)
    assert nearest > 0.1  # it is no mere large number


@pytest.mark.parametrize(("soft", "sin"), [(False, 0.0), (True, 0.0), (False, 0.05)])
def test_derivatives_are_those_of_the_forces(soft, sin):
    rng = np.random.default_rng(8)
    for _ in range(50):
        p, modes, d = drawn(rng, soft, sin)
        laws, h = Laws.of(p, modes, d, np.zeros(len(d))), 1e-6 * float(np.abs(d).max())
        for k in range(3 + soft):
            ends = [Laws.of(p, modes, d + sign * h * np.eye(len(d))[k], np.zeros(len(d))).force[0] for sign in (1, -1)]
            slope = (ends[0] - ends[1]) / (2 * h)
            np.testing.assert_allclose(laws.K[0][:, k], slope, atol=1e-3 * max(1.0, float(np.abs(laws.K).max())))


def test_a_direction_that_may_turn_round_is_not_known():
    p, modes, d = drawn(np.random.default_rng(9), False, 0.0)
    laws = Laws.of(p, modes, d, np.zeros(len(d)))
    assert np.isfinite(laws.change(p, 0.49 * laws.speed)).all()
    assert np.isinf(laws.change(p, 0.51 * laws.speed)).all()
    still = Laws.of(p, modes, np.array([-1.0, 0, 0, 0]), np.zeros(4))
    assert np.isinf(still.change(p, np.zeros(1))).all()


def test_a_state_of_a_file_has_its_lengths_and_no_torsion_at_points():
    g = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0]).grasp
    data = {"r": [0.0] * 6, "q": [], "c": [1.0, 0, 0], "f": [], "coupling": []}
    x = read_state(Fields(data), g)
    assert isinstance(x, State)
    assert x.torsion.tolist() == [0.0]
    with pytest.raises(BadFile, match="3 are needed"):
        read_state(Fields(data | {"c": [1.0]}, "witness"), g)
    with pytest.raises(BadFile, match=r"witness.torsion: is not 0 at a point contact"):
        read_state(Fields(data | {"torsion": [-0.1]}, "witness"), g)


def test_where_a_step_came_to_by_hand():
    """Contact 0 opens by 0.8 x 10 + 0.6 x |(3, 4)| = 11, contact 1 presses with 0.5 N, joints and tendons move away."""
    contacts = [Contact([0, 0, 0], [0, 0, 1], 0.5), Contact([1, 0, 0], [0, 0, 1], 0.5)]
    joints = [
        GraspJoint(name, [1, 0, 0], [0, 0, 0], (), "prismatic", stop=stop)
        for name, stop in (("a", "lower"), ("b", "upper"), ("c", "lower"))
    ]
    mechanism = Mechanism(("t", "pulled"), np.array([[3.0, 0, 0], [1, 0, 0]]), np.zeros((0, 3)), (True, True))
    p = problem(Grasp(contacts, joints, mechanism, {"pulled": 1.0}), [0, 0, -1.0])
    none = np.zeros(3)
    r, c = np.array([3.0, 4, 10, 0, 0, 0]), np.array([0.0, 0, 0, 0.5, 0, 0])
    x = State(r, np.array([2.0, -5, 1e-12]), c, np.zeros(2), np.zeros(0), none, none[:2])
    came, room = came_from(replace(p, cos=0.8, sin=0.6), x)
    np.testing.assert_allclose(came.gaps, [11, -0.5])
    np.testing.assert_allclose(came.stops, [2, 5, 0], atol=0)
    np.testing.assert_allclose(came.slack, [6, 0], atol=0)
    np.testing.assert_allclose(room.stops, 2e-9, rtol=1e-3)
