"""Version 1: bounds of forces from those of motions, by hand and outwards; how the error of sums enters them."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.certify.certificate import Columns, Question, Row
from handfast.stability.certify.claim import (
    Claim,
    _solution_bound,
    caps,
)
from tests.support.certificates import empty
from tests.support.rounding_edges import QUESTIONS, REFERENCES, hand

JUST = 1e-6  # relative: how far a planted case is from its edge
CAP_R, CAP_Q = np.array([0.3, 0.5, 0.2, 7.0, 9.0, 8.0]), np.array([4.0, 3.0, 0.6])


def outwards(found: Any, exact: Any, rel: float = 1e-9) -> None:
    """A bound: not below what is true, and hardly above."""
    found, exact = np.asarray(found, dtype=float), np.asarray(exact, dtype=float)
    assert found.shape == exact.shape
    assert (found >= exact).all(), found - exact
    np.testing.assert_allclose(found, exact, rtol=rel, atol=1e-299)


# --- bounds of what is unknown ---------------------------------------------------------------------------------


def test_caps_by_the_arms() -> None:
    """1 N at unit stiffness: as far as that for the object, by its size where it turns, by the joint's arm there."""
    g = hand()
    r, q = caps(g, 3.0)
    np.testing.assert_allclose(r, [3.0] * 3 + [3.0 / g.size] * 3, rtol=1e-15)
    assert q[2] == pytest.approx(3.0)  # a slide has the arm 1
    np.testing.assert_allclose(q, 3.0 / np.sqrt((g.J**2).sum(axis=0)), rtol=1e-9)


def forces(question: Question, scalar: Any = None) -> tuple[Claim, np.ndarray, np.ndarray]:
    """The claim, the largest |d|, and the most that forces of contacts can put on each joint."""
    g = question.grasp
    claim = Claim.of(empty(question, scalar, references=REFERENCES, caps=(CAP_R, CAP_Q)))
    d = np.abs(g.G.T) @ CAP_R + np.abs(g.J) @ CAP_Q
    c = claim.hi[claim.columns.c]
    return claim, d, np.abs(g.J.T) @ c


@pytest.mark.parametrize(
    ("name", "work"),
    [
        ("check", lambda w, t: w + 0.4 * t[0] + 0.15 * t[2]),
        ("turned", lambda w, t: w + 0.4 * t[0] + 0.15 * t[2]),
        ("preload", lambda w, t: w + 0.7 * (0.4 * t[0] + 0.15 * t[2])),
        ("largest", lambda w, t: w + 0.4 * t[0] + 0.15 * t[2]),
        ("max", lambda w, t: w + 0.5 * (t[0] + t[1])),
    ],
)
def test_bounds_of_contact_forces(name: str, work: Any) -> None:
    """c_n below |d_n|, the limit, and the root of the work of loads and commands; c_t below mu c_n."""
    question, scalar = QUESTIONS[name]
    if name == "max":
        scalar = (-0.3, 0.5) if question.goal.maximised else scalar
    claim, d, _ = forces(question, scalar)
    top = max(abs(x) for x in scalar) if scalar else 0.0
    w = (np.abs(question.load.w_a) + top * np.abs(question.load.w_b)) @ CAP_R
    energy = np.sqrt(work(w, np.abs(question.grasp.mechanism.R) @ CAP_Q))
    limit = np.inf if question.force_limit is None else question.force_limit
    normal = np.minimum(np.minimum(d[0::3], limit), energy)
    mu = question.grasp.mu
    outwards(claim.hi[claim.columns.c], np.column_stack([normal, mu * normal, mu * normal]).reshape(-1))
    c = claim.hi[claim.columns.c].reshape(-1, 3)
    assert (claim.lo[claim.columns.c].reshape(-1, 3) == -c * [0, 1, 1]).all()
    assert claim.hi[claim.columns.r].tolist() == CAP_R.tolist()
    assert claim.hi[claim.columns.q].tolist() == CAP_Q.tolist()
    for part in (claim.columns.r, claim.columns.q, claim.columns.f, claim.columns.coupling):
        assert (claim.lo[part] == -claim.hi[part]).all()


def test_contacts_that_touch_harder_than_work_allows_are_bounded_by_their_motion() -> None:
    """0.1 N of load far from home: |d_n| is the smaller bound, and the only one without (6)."""
    g = Grasp(hand().contacts)
    for mdp in (True, False):
        claim = Claim.of(empty(Question(g, wrench=1e6 * np.ones(6), mdp=mdp), caps=(CAP_R, np.zeros(0))))
        d = np.abs(g.G.T) @ CAP_R
        outwards(claim.hi[claim.columns.c][0::3], d[0::3])


def test_bounds_of_actuators_and_couplings() -> None:
    """R^T f + A^T lambda carry what the contacts put on three joints: of as many columns the inverse bounds three.

    A limit is a bound, too, and what has one need not be found: with a limit for "n" three of four are bounded by
    the inverse of the columns that are left.
    """
    g, limit = hand(), 0.05
    K = np.hstack([g.mechanism.R.T, g.mechanism.A.T])
    free = Claim.of(empty(Question(g, wrench=np.ones(6)), caps=(CAP_R, CAP_Q)))
    assert free.unbounded == ("m", "n", "t", "coupling 0")
    assert not np.isfinite(free.hi[free.columns.f]).any()
    question = Question(g, wrench=np.ones(6), torque_limits={"n": limit})
    claim, _, load = forces(question)
    assert claim.unbounded == ()
    z = claim.hi[claim.columns.f].tolist() + claim.hi[claim.columns.coupling].tolist()
    left = [0, 2, 3]
    expected = np.abs(np.linalg.inv(K[:, left])) @ (load + np.abs(K[:, 1]) * limit)
    assert z[1] == limit
    outwards([z[k] for k in left], expected, rel=1e-8)


def test_independent_columns_are_bounded_without_limits() -> None:
    """Two of three joints are driven; a limit below the bound is the bound, one above is none."""
    g = hand()
    R = np.array([[1.0, 0.5, 0.0], [0.0, 0.3, 0.2]])
    g = Grasp(g.contacts, g.joints, Mechanism(("m", "n"), R, np.zeros((0, 3)), (False, False)), {"m": 0.4})
    claim, _, load = forces(Question(g, wrench=np.ones(6)))
    expected = np.abs(np.linalg.pinv(R.T)) @ load
    outwards(claim.hi[claim.columns.f], expected, rel=1e-8)
    for limit in (0.5 * expected[0], 2.0 * expected[0]):
        found = forces(Question(g, wrench=np.ones(6), torque_limits={"m": limit}))[0]
        outwards(found.hi[found.columns.f], [min(limit, expected[0]), expected[1]], rel=1e-8)


def test_bounds_of_the_scalar_and_the_efforts() -> None:
    question, scalar = QUESTIONS["sum"]
    claim = Claim.of(empty(question, scalar, caps=(CAP_R, CAP_Q)))
    at = claim.columns
    assert (claim.lo[at.scalar].tolist(), claim.hi[at.scalar].tolist()) == ([0.2], [0.5])
    assert (claim.lo[at.e].tolist(), claim.hi[at.e].tolist()) == ([0.0] * 3, [0.5, 0.5, 0.0])


def test_unknowns_of_which_nothing_is_known() -> None:
    """Equalities that meet one are left out, and what else they have: of two motors on one joint."""
    contact = Contact([0.03, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5)
    joints = [GraspJoint(n, [0.0, 0.0, 1.0], [0.03, -0.1, 0.0], (0,)) for n in "ab"]
    two = Mechanism(("x", "y", "z"), np.array([[1.0, 0], [1, 0], [0, 1]]), np.zeros((0, 2)), (False,) * 3)
    g = Grasp([contact, Contact([-0.03, 0.0, 0.0], [1.0, 0.0, 0.0], 0.5)], joints, two, {"z": 0.1})
    claim = Claim.of(empty(Question(g, wrench=np.eye(6)[1]), caps=(np.ones(6), np.ones(2))))
    assert claim.unbounded == ("x", "y", "z")
    assert claim.E.shape == (6 + 2, claim.columns.n)  # balance of the object, and the two that are locked
    assert not claim.E[:, claim.columns.f].any()
    assert len(claim.h) == len(claim.slack) == len(claim.growth) == 8
    assert claim.slack[:6].all()
    assert not claim.slack[6:].any()


def test_the_error_grows_with_the_sums() -> None:
    """k = 256 + 8 (n + 3 m) + the rows of the longest leaf: k u / (1 - k u)."""
    question, _ = QUESTIONS["check"]
    n = Columns.of(question).n
    for count in (0, 500):
        c = empty(question, None, [(Row.CN_UP, 0, 0, 0)] * count, np.ones(count), caps=(CAP_R, CAP_Q))
        k = Fraction(256 + 8 * (n + 9) + count) / 2**53
        assert Claim.of(c).error == pytest.approx(float(k / (1 - k)), rel=1e-14, abs=0)


# --- bounds of z with |K z| <= load ------------------------------------------------------------------------------


def test_a_bound_of_one_unknown() -> None:
    """P = 1 / K misses by d = 2 e (1 + e): |z| <= load (1 + e) / K, 2 d of it more, and 4 e for the sums.

    K may be smaller by e: the least that is right is load / K (1 - e).
    """
    for e in (0.0, 1e-3, 1e-2):
        for K in (1.0, 4.0, -0.5, 3.0):
            (found,) = _solution_bound(np.array([[K]]), np.array([6.0]), e)
            z = 6.0 / abs(K) * (1 + e)
            assert found == pytest.approx(z * (1 + 4 * e * (1 + e)) * (1 + 4 * e), rel=1e-9)
            assert found >= 6.0 / abs(K) / (1 - e) * (1 - 1e-15)


def test_a_bound_of_two_unknowns() -> None:
    """K = (1 3/4; 0 3/4), P = (1 -1; 0 4/3) and |P||K| = (1 3/2; 0 1): d = (2 + 5/2) e (1 + e), of the largest z."""
    e, load = 1e-3, np.array([3.0, 2.0])
    z = np.array([5.0, 8 / 3]) * (1 + e)
    expected = (z + 2 * 4.5 * e * (1 + e) * z.max()) * (1 + 4 * e)
    np.testing.assert_allclose(_solution_bound(np.array([[1.0, 0.75], [0.0, 0.75]]), load, e), expected, rtol=1e-9)


def test_columns_of_any_size() -> None:
    """Columns are scaled by powers of two, which rounds nothing and leaves the error what it was."""
    e, load = 1e-3, np.array([3.0, 2.0])
    for scale in (2.0**40, 2.0**-40):
        K = np.array([[1.0, 0.75 * scale], [0.0, 0.75 * scale]])
        plain = _solution_bound(np.array([[1.0, 0.75], [0.0, 0.75]]), load, e)
        np.testing.assert_allclose(_solution_bound(K, load, e) * [1.0, scale], plain, rtol=1e-9)


def test_columns_that_depend_on_each_other_have_no_bound() -> None:
    for K in ([[1.0, 2.0], [2.0, 4.0]], [[1.0, 1.0]], [[1.0, 0.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0 + 1e-15]]):
        assert np.isinf(_solution_bound(np.array(K), np.ones(len(K)), 1e-13)).all()
    assert _solution_bound(np.zeros((3, 0)), np.ones(3), 1e-13).shape == (0,)


def test_a_right_inverse_that_is_not_shown() -> None:
    """d = 2 e (1 + e) of one column has to be below 1/2."""
    edge = (np.sqrt(2.0) - 1) / 2  # 2 e + 2 e^2 = 1/2
    assert np.isfinite(_solution_bound(np.eye(1), np.ones(1), edge * (1 - JUST))).all()
    assert np.isinf(_solution_bound(np.eye(1), np.ones(1), edge * (1 + JUST))).all()
