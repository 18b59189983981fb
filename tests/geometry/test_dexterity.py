"""Dexterity of mechanisms whose answer is known: planar arms, prismatic pinches, limits."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.dexterity import (
    Dexterity,
    dexterity,
    distances_from_limits,
    finger_manipulability,
    object_singular_values,
)
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.hand import Hand, Joint, Link
from handfast.model.hand.hand import Coupling, coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.planning.closing import close
from handfast.readers.load_hand import load_hand
from tests.support.four_bar import FourBar

L1, L2 = 0.05, 0.03


def arm(ratio: float | None = None, third: tuple[float, float, float] | None = None) -> Hand:
    """A planar arm of two links about z, the second joint tied to the first if a ratio is given."""
    axes = [(0, 0, 1), (0, 0, 1)] + ([third] if third else [])
    joints = tuple(Joint(f"j{k}", "revolute", a, [0, 0, 0], -3, 3) for k, a in enumerate(axes))
    links = [
        Link("base", -1, np.eye(4)),
        Link("upper", 0, np.eye(4), (0,)),
        Link("fore", 1, transform([L1, 0, 0]), (1,)),
    ]
    if third:
        links.append(Link("tip", 2, np.eye(4), (2,)))
    couplings = (Coupling(1, 0, ratio),) if ratio is not None else ()
    driven = [j for j in range(len(joints)) if not (couplings and j == 1)]
    mechanism = Mechanism(
        tuple(joints[j].name for j in driven),
        np.eye(len(joints))[driven],
        coupling_rows(couplings, len(joints)),
        (False,) * len(driven),
    )
    return Hand("arm", tuple(links), joints, mechanism, couplings, np.zeros(len(joints)))


def end(hand: Hand, q: np.ndarray, link: int = 2) -> np.ndarray:
    return (hand.link_poses(q)[link] @ [L2, 0, 0, 1])[:3]


# --- a finger ---------------------------------------------------------------------------------------


@settings(max_examples=30, derandomize=True, deadline=None)
@given(q=st.tuples(st.floats(-3, 3), st.floats(-3, 3)))
def test_planar_arm(q: tuple[float, float]) -> None:
    hand, at = arm(), np.array(q)
    assert finger_manipulability(hand, 2, end(hand, at), at) == pytest.approx(L1 * L2 * abs(np.sin(q[1])), abs=1e-12)


def test_a_coupled_arm_sweeps_a_line() -> None:
    """One speed: the end moves by J1 + r J2 while the joints move by (1, r)."""
    r, hand, q = 0.5, arm(ratio=0.5), np.array([0.4, 0.2])
    J = hand.jacobian(2, end(hand, q), q)
    expected = np.linalg.norm(J[:, 0] + r * J[:, 1]) / np.hypot(1, r)
    assert finger_manipulability(hand, 2, end(hand, q), q) == pytest.approx(expected)


def test_three_joints_span_a_volume() -> None:
    """The third joint moves the end by L2 across the plane when it turns about an axis across the forearm."""
    hand, q = arm(third=(0, 1, 0)), np.array([0.3, 0.8, 0.0])
    expected = L1 * L2 * np.sin(0.8) * L2
    assert finger_manipulability(hand, 3, end(hand, q, 3), q) == pytest.approx(expected)


def test_links_that_cannot_move() -> None:
    hand, q = arm(), np.array([0.3, 0.8])
    assert finger_manipulability(hand, 0, np.zeros(3), q) == 0
    stiff = replace(hand, joints=(replace(hand.joints[0], lower=0.3, upper=0.3), hand.joints[1]))
    assert finger_manipulability(stiff, 2, end(hand, q), q) == pytest.approx(L2)  # only the forearm turns


def test_other_fingers_do_not_count() -> None:
    """A joint elsewhere that is tied to this finger's first joint leaves the finger's own measure alone."""
    hand, q = arm(), np.array([0.3, 0.8])
    joints = (*hand.joints, Joint("far", "revolute", [0, 0, 1], [0, 0, 0], -3, 3))
    couplings = (Coupling(2, 0, 1.0),)
    mechanism = Mechanism(("j0", "j1"), np.eye(3)[:2], coupling_rows(couplings, 3), (False, False))
    more = Hand("arms", (*hand.links, Link("far", 0, np.eye(4), (2,))), joints, mechanism, couplings, np.zeros(3))
    at = np.array([0.3, 0.8, 0.3])
    expected = finger_manipulability(hand, 2, end(hand, q), q)
    assert finger_manipulability(more, 2, end(more, at), at) == pytest.approx(expected)


def test_a_finger_on_a_linkage_moves_as_its_pins_let_it(tmp_path: Path) -> None:
    """One motor: the end moves as the closed form says while crank, coupler and rocker turn together."""
    bars, step, crank = FourBar(), 1e-6, 1.0
    hand = load_hand(bars.write(tmp_path))
    q = hand.configuration({"crank": crank - np.pi / 2})
    ends = [bars.pins(at)[1] for at in (crank - step, crank + step)]  # of the coupler
    turned = [np.array(list(bars.joints(at).values())) for at in (crank - step, crank + step)]
    rate = (turned[1] - turned[0])[:2] / (2 * step)  # of those between the base and the coupler
    expected = np.linalg.norm(ends[1] - ends[0]) / (2 * step) / np.linalg.norm(rate)
    point = np.r_[bars.pins(crank)[1], 0.0]
    assert finger_manipulability(hand, hand.link("coupler"), point, q) == pytest.approx(expected, rel=1e-6)


# --- the object -------------------------------------------------------------------------------------


ALL = np.eye(3)


def slides(points: np.ndarray, directions: np.ndarray = ALL, mechanism: Mechanism | None = None) -> Grasp:
    """Contacts that slide along some directions each, with a joint for each of them."""
    inwards = points.mean(axis=0) - points
    contacts = [Contact(p, n / np.linalg.norm(n), 0.5) for p, n in zip(points, inwards, strict=True)]
    joints = [
        GraspJoint(f"s{i}{k}", a, points[i], (i,), "prismatic")
        for i in range(len(points))
        for k, a in enumerate(directions)
    ]
    return Grasp(contacts, joints, mechanism)


PINCH = np.array([[0.02, 0, 0], [-0.02, 0, 0]])


def test_pinch_by_points_that_go_anywhere() -> None:
    """w = v +- omega x e in sizes: five motions with singular value sqrt 2 of G^T, and none about the line."""
    values = object_singular_values(slides(PINCH))
    np.testing.assert_allclose(values, [1 / np.sqrt(2)] * 5, atol=1e-12)
    told = Dexterity(values, np.zeros(0), {})
    assert told.manipulability == pytest.approx(2**-2.5)
    assert told.typical == pytest.approx(2**-0.5)
    assert told.isotropy == pytest.approx(1)
    assert told.smallest == pytest.approx(2**-0.5)
    assert told.least_from_limits == told.mean_from_limits == 1


def test_few_joints_span_few_directions() -> None:
    """Two slides along the line: the object goes along it; that they can squeeze moves nothing."""
    values = object_singular_values(slides(PINCH, ALL[:1]))
    np.testing.assert_allclose(values, [1 / np.sqrt(2), 0], atol=1e-12)
    assert Dexterity(values, np.zeros(0), {}).manipulability == pytest.approx(0, abs=1e-12)
    tied = Mechanism(("both",), np.array([[1.0, 0]]), np.array([[1.0, -1.0]]), (False,))  # one goes as the other
    assert object_singular_values(slides(PINCH, ALL[:1], tied)) == pytest.approx([1.0 / np.sqrt(2)])
    opposed = Mechanism(("both",), np.array([[1.0, 0]]), np.array([[1.0, 1.0]]), (False,))  # as in a gripper
    assert object_singular_values(slides(PINCH, ALL[:1], opposed)) == pytest.approx([0.0])
    alone = object_singular_values(slides(PINCH, ALL[:1]), locked=["s10", "unknown"])
    assert alone == pytest.approx([0.5])  # the object follows half way, as best fits


def test_a_fixture_moves_nothing() -> None:
    fixture = Grasp(slides(PINCH).contacts)
    told = Dexterity(object_singular_values(fixture), np.zeros(2), {})
    assert told.singular_values.shape == (0,)
    assert told.manipulability == told.typical == told.smallest == told.isotropy == 0


def fingers(seed: int) -> tuple[list[Contact], list[GraspJoint], Mechanism]:
    """Three contacts, two revolute joints and a slide behind each, one coupling among them."""
    rng = np.random.default_rng(seed)
    points, normals = rng.normal(size=(3, 3)) * 0.03, rng.normal(size=(3, 3))
    contacts = [Contact(p, n / np.linalg.norm(n), 0.5) for p, n in zip(points, normals, strict=True)]
    joints = []
    for i in range(3):
        for k, kind in enumerate(("revolute", "revolute", "prismatic")):
            axis = rng.normal(size=3)
            joints.append(
                GraspJoint(f"{i}{k}", axis / np.linalg.norm(axis), points[i] + rng.normal(size=3) * 0.04, (i,), kind)
            )
    A = np.zeros((1, 9))
    A[0, :2] = 1.0, -0.4
    return contacts, joints, Mechanism(tuple(j.name for j in joints), np.eye(9), A, (False,) * 9)


def moved(seed: int, R: np.ndarray, t: np.ndarray, scale: float) -> Grasp:
    contacts, joints, mechanism = fingers(seed)
    return Grasp(
        [replace(c, position=scale * R @ c.position + t, normal=R @ c.normal) for c in contacts],
        [replace(j, axis=R @ j.axis, origin=scale * R @ j.origin + t) for j in joints],
        mechanism,
    )


@settings(max_examples=40, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.01, 1000))
def test_neither_the_frame_nor_the_units_nor_the_order_matter(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    here = object_singular_values(moved(seed, np.eye(3), np.zeros(3), 1.0))
    there = moved(seed, quaternion_matrix(rng.normal(size=4)), scale * rng.normal(size=3), scale)
    assert here.shape == (6,)
    np.testing.assert_allclose(object_singular_values(there), here, rtol=1e-6)
    order = [2, 0, 1]
    joints = [replace(j, moves=tuple(order.index(i) for i in j.moves)) for j in there.joints]
    turned = Grasp([there.contacts[i] for i in order], joints, there.mechanism)
    np.testing.assert_allclose(object_singular_values(turned), here, rtol=1e-6)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_further_coupling_never_helps(seed: int) -> None:
    """Cauchy's interlacing: singular values over fewer speeds are no larger."""
    grasp = moved(seed, np.eye(3), np.zeros(3), 1.0)
    free, tied = object_singular_values(grasp), object_singular_values(grasp, locked=["22"])
    assert (tied <= free[: len(tied)] + 1e-12).all()


# --- limits, and all together -----------------------------------------------------------------------


@pytest.mark.parametrize(("value", "expected"), [(-3, 0), (3, 0), (0, 1), (1.5, 0.5), (-2.25, 0.25), (3.3, -0.1)])
def test_distance_from_limits(value: float, expected: float) -> None:
    hand = arm()
    found = distances_from_limits(hand, np.array([value, 0.0]), [2])
    assert found["j0"] == pytest.approx(expected)
    assert found["j1"] == pytest.approx(1)
    assert set(distances_from_limits(hand, np.array([value, 0.0]), [1])) == {"j0"}
    assert distances_from_limits(hand, np.array([value, 0.0]), [0]) == {}
    stiff = replace(hand, joints=(replace(hand.joints[0], lower=value, upper=value), hand.joints[1]))
    assert set(distances_from_limits(stiff, np.array([value, 0.0]), [2])) == {"j1"}


def test_a_real_hand() -> None:
    hand = load_hand("barrett-bh8-280")
    ball = Body.of([Shape("sphere", 0.035)], mass=0.1)
    pose = transform([0, 0, 0.16])
    q = close(hand, hand.configuration({"finger_1_spread": 0.6}), ball, pose).q
    grasp = contact_grasp(hand, q, ball, pose)
    points = np.array([pose[:3, :3] @ c.position + pose[:3, 3] for c in grasp.contacts])
    links = [c.link for c in grasp.contacts]
    found = dexterity(hand, q, links, points, grasp)
    assert len(links) >= 3
    assert found.singular_values.shape == (4,)  # as many as the hand has motors
    assert (found.singular_values > 0).all()
    assert found.manipulability == pytest.approx(found.singular_values.prod())
    assert (found.fingers > 0).all()
    assert 0 <= found.least_from_limits <= found.mean_from_limits <= 1
    assert json.loads(json.dumps(found.to_json()))["least_from_limits"] == found.least_from_limits
    fixed = [replace(j, lower=x, upper=x) if "spread" in j.name else j for j, x in zip(hand.joints, q, strict=True)]
    stiff = dexterity(replace(hand, joints=tuple(fixed)), q, links, points, grasp)
    assert stiff.singular_values.shape == (3,)
    assert not any("spread" in name for name in stiff.from_limits)
    with pytest.raises(InputError, match="points: has shape"):
        dexterity(hand, q, links, points[:-1], grasp)
    with pytest.raises(InputError, match="unknown link 'thumb'"):
        dexterity(hand, q, ["thumb"], points[:1], grasp)
