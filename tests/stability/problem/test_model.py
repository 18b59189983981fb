"""The equations themselves: exact solutions pass, every planted fault is named, the laws hold."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.states import State
from handfast.stability.problem import judge, model
from handfast.stability.problem.model import state_of
from tests.support.problems import X, Z, bell, pinch, solved, table

SEEDS = st.integers(0, 10_000)
STEADY = settings(max_examples=40, deadline=None, derandomize=True)


def residuals(s, **kwargs):
    return judge.residuals(s.grasp, s.wrench, s.state, eta=s.eta, **kwargs)


@STEADY
@given(SEEDS, st.sampled_from([2, 3, 4, 6]), st.sampled_from([0.0, 0.05]), st.booleans())
def test_constructed_solutions_solve_the_model(seed: int, m: int, eta: float, stick: bool) -> None:
    assert residuals(solved(seed, m, eta, stick)).worst < 1e-12


@STEADY
@given(SEEDS, st.floats(1e-3, 1e3))
def test_positive_homogeneity(seed: int, scale: float) -> None:
    s = solved(seed)
    grown = replace(
        s,
        grasp=s.grasp.with_preload(scale * s.grasp.command),
        wrench=scale * s.wrench,
        state=model.scaled(s.state, scale),
    )
    assert residuals(grown).worst < 1e-12


@STEADY
@given(SEEDS)
def test_energy_law(seed: int) -> None:
    """w.r + f_c.t = sum c_n^2 + sum mu c_n |d_t|, DESIGN's law, from virtual work."""
    s = solved(seed)
    e = model.energy(s.grasp, s.wrench, s.state)
    cn = s.state.c.reshape(-1, 3)[:, 0]
    total = abs(e.disturbance) + abs(e.preload) + e.stored + e.maximum.sum()
    assert e.disturbance + e.preload == pytest.approx(float(cn @ cn) + float(e.maximum.sum()), abs=1e-9 * total)
    assert abs(e.residual) <= 1e-9 * total
    assert e.created <= 1e-12 * total
    np.testing.assert_allclose(e.friction, e.maximum, atol=1e-9 * total)


def moved(grasp: Grasp, R: np.ndarray, t: np.ndarray) -> Grasp:
    """The grasp described in another object frame."""
    contacts = [replace(c, position=R @ c.position + t, normal=R @ c.normal) for c in grasp.contacts]
    joints = [replace(j, axis=R @ j.axis, origin=R @ j.origin + t) for j in grasp.joints]
    return Grasp(contacts, joints, grasp.mechanism, grasp.command)


@STEADY
@given(SEEDS)
def test_frame_invariance(seed: int) -> None:
    """Forces and joint motions are what they were; w and r follow the frame."""
    s = solved(seed)
    rng = np.random.default_rng(seed + 1)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    t = 0.1 * rng.normal(size=3)
    other = moved(s.grasp, R, t)
    force = R @ s.wrench[:3]
    w = np.r_[force, R @ s.wrench[3:] + np.cross(t, force)]
    turn = R @ s.state.r[3:]
    r = np.r_[R @ s.state.r[:3] + np.cross(t, turn), turn]
    # contact frames are made from the normal alone, so their tangents turn about it: take c along
    c = []
    for old, new, ci in zip(s.grasp.contacts, other.contacts, s.state.c.reshape(-1, 3), strict=True):
        c.append(new.frame.T @ R @ old.frame @ ci)
    state = replace(s.state, r=r, c=np.concatenate(c))
    assert judge.residuals(other, w, state).worst < 1e-11


@STEADY
@given(SEEDS)
def test_unit_invariance(seed: int) -> None:
    """Millimetres for metres: the same relative residuals, so the same verdicts."""
    s = solved(seed)
    k = 1000.0
    contacts = [replace(c, position=k * c.position) for c in s.grasp.contacts]
    joints = [replace(j, origin=k * j.origin) for j in s.grasp.joints]
    grasp = Grasp(contacts, joints, preload=k * s.grasp.command)
    w = s.wrench * np.r_[1, 1, 1, k, k, k]
    r = s.state.r * np.r_[1, 1, 1, 1 / k, 1 / k, 1 / k]
    state = replace(s.state, r=r, q=s.state.q / k, f=k * s.state.f)
    assert judge.residuals(grasp, w, state).worst < 1e-11
    wrong = replace(s.state, r=1.001 * s.state.r)
    wrong_mm = replace(state, r=1.001 * state.r)
    a, b = judge.residuals(s.grasp, s.wrench, wrong), judge.residuals(grasp, w, wrong_mm)
    for f in fields(a):
        assert getattr(a, f.name) == pytest.approx(getattr(b, f.name), rel=1e-6, abs=1e-12)


@STEADY
@given(SEEDS)
def test_contact_order_does_not_matter(seed: int) -> None:
    s = solved(seed, m=4)
    order = [2, 0, 3, 1]
    contacts = [s.grasp.contacts[i] for i in order]
    joints = [replace(j, moves=tuple(order.index(i) for i in j.moves)) for j in s.grasp.joints]
    grasp = Grasp(contacts, joints, preload=s.grasp.command)
    state = replace(s.state, c=s.state.c.reshape(-1, 3)[order].reshape(-1))
    assert judge.residuals(grasp, s.wrench, state).worst < 1e-12


# --- planted faults: each is found, and by the right residual ------------------------------------------


def holding_pinch() -> tuple[Grasp, np.ndarray, State]:
    """2 N along y on the pinch with mu = 1: both tips stick, c_n = 1 (torque / arm), c_t = 1; by hand."""
    g = pinch(mu=1.0)
    w = np.array([0, 1.2, 0, 0, 0, 0])
    force = [np.array([-1.0, -0.6, 0]), np.array([1.0, -0.6, 0])]
    c = np.concatenate([k.frame.T @ f for k, f in zip(g.contacts, force, strict=True)])
    # c_n = -d_n = arm * q: the joint motion 10 / m brings both springs to 1 N
    return g, w, state_of(np.zeros(6), np.array([10.0, 10.0]), c, np.array([0.1, 0.1]), np.zeros(0))


def test_the_hand_made_state_is_exact() -> None:
    g, w, state = holding_pinch()
    assert judge.residuals(g, w, state).worst < 1e-15


def edited(state: State, field: str, index: int, value: float) -> State:
    array = getattr(state, field).copy()
    array[index] += value
    return replace(state, **{field: array})


@pytest.mark.parametrize(
    ("field", "index", "value", "named"),
    [
        ("c", 1, 0.1, "object_balance"),  # (1): a friction force too many
        ("f", 0, 0.01, "joint_balance"),  # (2): the motor does not carry what the contact asks
        ("c", 0, 0.1, "normal"),  # (4): a normal force without its spring
        ("r", 1, 0.5, "dissipation"),  # (7): the object slides, friction points nowhere near against it
        ("q", 1, -20.0, "actuators"),  # (8): a commanded joint backs away
    ],
)
def test_planted_faults_are_named(field: str, index: int, value: float, named: str) -> None:
    g, w, state = holding_pinch()
    res = judge.residuals(g, w, edited(state, field, index, value))
    assert getattr(res, named) > 1e-3


def test_too_much_friction_is_outside_the_cone() -> None:
    g, w, state = holding_pinch()
    assert judge.residuals(g.with_friction(0.5), w, state).cone == pytest.approx(0.1 / 1.2)


def test_a_locked_joint_that_moves_is_refused() -> None:
    g, w, state = holding_pinch()
    assert judge.residuals(g.with_preload({"right": 0.1}), w, state).actuators > 0.1


def test_less_than_the_command_is_refused_and_more_is_not() -> None:
    """(8): tau may exceed the command where the joint is still, never fall short."""
    g, w, state = holding_pinch()
    still = replace(state, q=np.zeros(2), r=np.zeros(6), c=np.zeros(6), f=np.zeros(2))
    assert judge.residuals(g, 0 * w, still).actuators > 0.1
    pushed = np.array([2.0, 0, 0, 0, 0, 0])  # onto the right finger; the left one follows at its command
    force = [np.array([-3.0, 0, 0]), np.array([1.0, 0, 0])]
    c = np.concatenate([k.frame.T @ f for k, f in zip(g.contacts, force, strict=True)])
    moved = state_of(np.array([3.0, 0, 0, 0, 0, 0]), np.array([0.0, 40.0]), c, np.array([0.3, 0.1]), np.zeros(0))
    assert judge.residuals(g, pushed, moved).worst < 1e-14


def test_negative_commands_are_the_mirror_image() -> None:
    g, w, state = holding_pinch()
    mirrored = [replace(j, axis=-j.axis) for j in g.joints]
    other = Grasp(g.contacts, mirrored, preload={"right": -0.1, "left": -0.1})
    flipped = replace(state, q=-state.q, f=-state.f)
    assert judge.residuals(other, w, flipped).worst < 1e-15
    assert judge.residuals(other, w, replace(flipped, q=state.q)).worst > 0.1


def test_the_robust_normal_unloads_the_contact() -> None:
    """(17) with the erratum: sliding at 45 degrees to the pressing motion takes force away."""
    d = np.array([-1.0, 0.6, 0.8])
    assert model.spring_force(d)[0] == 1.0
    assert model.spring_force(d, np.radians(30))[0] == pytest.approx(np.cos(np.pi / 6) - 0.5)


def test_couplings_carry_torque_and_bind_motion() -> None:
    """A distal joint at 1/3 of the proximal: motions in ratio, torques summed with the same ratio."""
    contact = Contact(np.array([0.0, 0, 0]), np.array([1.0, 0, 0]), 0.5)
    joints = [
        GraspJoint("prox", np.array([0, 0, -1.0]), np.array([0, -0.1, 0]), (0,)),
        GraspJoint("dist", np.array([0, 0, -1.0]), np.array([0, -0.04, 0]), (0,)),
    ]
    mechanism = Mechanism(("finger",), np.array([[1.0, 0]]), np.array([[-1 / 3, 1.0]]), (False,))
    torque = 0.1 + 0.04 / 3  # c_n = 1: f = tau_prox + tau_dist / 3
    g = Grasp([contact], joints, mechanism, {"finger": torque})
    q = np.array([3.0, 1.0]) / (0.3 + 0.04)
    w = np.array([-1.0, 0, 0, 0, 0, 0])
    state = state_of(np.zeros(6), q, np.array([1.0, 0, 0]), np.array([torque]), np.array([0.04]))
    assert judge.residuals(g, w, state).worst < 1e-15
    assert judge.residuals(g, w, replace(state, q=np.array([3.4, 0.0]) / 0.34)).couplings > 0.1
    assert judge.residuals(g, w, replace(state, coupling=np.array([0.05]))).joint_balance > 1e-3


def test_a_slack_tendon_is_allowed_and_a_pushing_one_is_not() -> None:
    contact = Contact(np.zeros(3), np.array([1.0, 0, 0]), 0.5)
    joint = GraspJoint("j", np.array([0, 0, -1.0]), np.array([0, -0.1, 0]), (0,))
    mechanism = Mechanism(("t",), np.array([[1.0]]), np.zeros((0, 1)), (True,))
    g = Grasp([contact], [joint], mechanism)
    slack = state_of(np.array([1.0, 0, 0, 0, 0, 0]), np.array([10.0]), np.zeros(3), np.zeros(1), np.zeros(0))
    assert judge.residuals(g, np.zeros(6), slack).worst < 1e-15
    pushing = replace(slack, q=np.zeros(1), f=np.array([-0.1]))
    assert judge.residuals(g, np.zeros(6), pushing).actuators > 0.1


def test_energy_out_of_nothing_is_counted() -> None:
    """The shape of the paper's Fig. 4: friction along the motion feeds energy in."""
    g = bell().with_preload(None)
    r = np.array([0, -1.0, 0, 0, 0, 0])
    d = model.relative_motion(g, r, np.zeros(2)).reshape(-1, 3)
    c = np.zeros((4, 3))
    c[:, 0] = model.spring_force(d.reshape(-1))
    c[:, 1:] = c[:, :1] * d[:, 1:] / np.maximum(np.linalg.norm(d[:, 1:], axis=1, keepdims=True), 1e-12)
    state = state_of(r, np.zeros(2), c.reshape(-1), np.zeros(2), np.zeros(0))
    e = model.energy(g, -g.G @ c.reshape(-1), state)
    assert e.created > 0.5
    assert judge.residuals(g, -g.G @ c.reshape(-1), state).dissipation > 0.1


# --- what residuals are measured against, by hand -------------------------------------------------------


def in_units(grasp: Grasp, k: float) -> Grasp:
    """The grasp with lengths in 1/k metres: torques are k times as many newton lengths."""
    contacts = [replace(c, position=k * c.position) for c in grasp.contacts]
    joints = [replace(j, origin=k * j.origin) for j in grasp.joints]
    return Grasp(contacts, joints, grasp.mechanism, k * grasp.command)


@pytest.mark.parametrize("k", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("axis", [3, 4, 5])
def test_a_moment_out_of_balance_is_measured_by_load_and_size(axis: int, k: float) -> None:
    """0.006 N m beside the load, 1.2 N, at 0.03 m, the contacts' distance from their middle, whatever the units."""
    g, w, state = holding_pinch()
    state = replace(state, q=state.q / k, f=k * state.f)
    w = w + 0.006 * k * np.eye(6)[axis]
    res = judge.residuals(in_units(g, k), w, state)
    assert res.object_balance == pytest.approx(0.006 / (1.2 * 0.03), rel=1e-12)
    assert max(getattr(res, f.name) for f in fields(res) if f.name != "object_balance") < 1e-14


@pytest.mark.parametrize(
    ("edits", "named", "value"),
    [
        ([("c", 1, 0.12)], "object_balance", 0.1),  # 0.12 N of 1.2 N
        ([("f", 0, 0.012)], "joint_balance", 0.012 / 0.03 / 1.2),  # of a joint that turns: over the size, 0.03 m
        ([("c", 0, 0.12)], "normal", 0.1),  # 0.12 N of 1.2 N, whatever contact force it makes
        ([("r", 1, 0.5)], "dissipation", 0.2 / 1.2**2),  # 0.6 N * 0.5 - 1 N * 0.5, slower than the load
        ([("r", 2, 3.0)], "dissipation", 3 / 3 / 1.2),  # faster: 1 N is missing, and 0.6 N is across
        ([("q", 1, -20.0)], "actuators", 1 / 1.2),  # back by 10 rad at an arm of 0.1 m
        ([("f", 0, -0.012)], "actuators", 0.1),  # short of the command
        ([("f", 0, 0.012)], "actuators", 0.1),  # beyond it, though the joint moves by more than that
        ([("f", 0, 0.3), ("q", 0, -4.0)], "actuators", 0.6 / 1.2),  # moves by less than it is beyond
    ],
)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_faults_have_the_size_that_they_have_by_hand(
    edits: list[tuple[str, int, float]], named: str, value: float, sense: float
) -> None:
    """With a load of 1.2 N; joints and commands the other way round give the same numbers."""
    g, w, state = holding_pinch()
    for edit in edits:
        state = edited(state, *edit)
    g = Grasp(g.contacts, [replace(j, axis=sense * j.axis) for j in g.joints], preload=sense * g.command)
    state = replace(state, q=sense * state.q, f=sense * state.f)
    assert getattr(judge.residuals(g, w, state), named) == pytest.approx(value, rel=1e-12)


def test_friction_is_not_asked_to_dissipate_most_where_that_is_left_out() -> None:
    g, w, state = holding_pinch()
    slides = edited(state, "r", 1, 0.5)
    assert judge.residuals(g, w, slides).dissipation > 0.1
    without = judge.residuals(g, w, slides, mdp=False)
    assert without.dissipation == 0.0
    assert without.worst < 1e-14


def test_other_commands_than_the_grasps() -> None:
    g, w, state = holding_pinch()
    locked, command = g.with_preload(None), np.array([0.1, 0.1])
    assert judge.residuals(locked, w, state).actuators == pytest.approx(1 / 1.2)
    assert judge.residuals(locked, w, state, command=command).worst < 1e-14
    assert judge.residuals(g, w, state, command=0 * command).actuators == pytest.approx(1 / 1.2)
    assert judge.residuals(g, w, state, command=-command).actuators == pytest.approx(2 / 1.2)  # 0.2 N m from it
    assert model.energy(g, w, state).preload == pytest.approx(2.0)
    assert model.energy(g, w, state, command=2 * command).preload == pytest.approx(4.0)
    assert model.commanded(g).tolist() == [True, True]
    assert model.commanded(locked).tolist() == [False, False]
    assert model.commanded(g, np.array([0.0, -0.1])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("w", "c", "scale"),
    [
        ([0, -8, 0, 0, 0, 0], [], 8.0),
        ([3, 0, -4, 0, 0, 0], [], 5.0),
        ([1, 0, 0, 0, 0, 0], [0, 0, 0, 0, -5, 0], 5.0),
        ([1, 0, 0, 0, 0, 0], [3, 0, 4, 0, 2, 0], 5.0),
        ([7, 0, 0, 0, 0, 0], [0, 0, 0, 0, -5, 0], 7.0),
        ([1e-3, 0, 0, 0.6, 0, 0], [], 1e-3),  # a torque is no force
        ([0, 0, 0, 0, 0, 0.6], [0, 0, 0], 1.0),  # of nothing at all
    ],
)
def test_the_force_scale_is_the_largest_force_that_acts(w: list[float], c: list[float], scale: float) -> None:
    assert model.force_scale(np.array(w, dtype=float), np.array(c, dtype=float)) == pytest.approx(scale, rel=1e-12)


def two_fingers(mechanism: Mechanism | None = None) -> Grasp:
    """Two contacts, 0.1 m and 0.3 m above one joint, the second also 0.04 m above another; a third moves nothing."""
    contacts = [Contact(np.array([0, y, 0]), X, 0.5) for y in (0.0, 0.2)]
    joints = [
        GraspJoint("both", -Z, np.array([0, -0.1, 0]), (0, 1)),
        GraspJoint("upper", -Z, np.array([0, 0.16, 0]), (1,)),
        GraspJoint("idle", -Z, np.zeros(3), ()),
    ]
    return Grasp(contacts, joints, mechanism)


def test_arms_of_joints_and_actuators() -> None:
    """A joint that turns nothing has the grasp's size for an arm: the contacts are 0.1 m from their middle."""
    g = two_fingers()
    arms = [np.hypot(0.1, 0.3), 0.04, 0.1]
    np.testing.assert_allclose(model.joint_arms(g), arms, rtol=1e-12)
    np.testing.assert_allclose(model.actuator_arms(g), arms, rtol=1e-12)
    R = np.array([[0.0, 2.0, 0.0], [-4.0, 0.25, 0.0], [0.0, 0.0, 5.0]])
    geared = two_fingers(Mechanism(("a", "b", "c"), R, np.zeros((0, 3)), (False,) * 3))
    np.testing.assert_allclose(model.actuator_arms(geared), [0.02, arms[0] / 4, 0.02], rtol=1e-12)


def test_couplings_are_measured_by_what_they_move() -> None:
    """A q as the motion of one joint alone, at that joint's arm: of the joint where that is most."""
    # arms, the size 0.1 m of the last, over |A|: 0.04 and 0.1; 1 / 1.5 and 1 / 3
    A = np.array([[0.0, 1.0, -1.0], [-1.5 / np.sqrt(10), 0.0, 0.3]])
    g = two_fingers(Mechanism((), np.zeros((0, 3)), A, ()))
    none = state_of(np.zeros(6), np.zeros(3), np.zeros(6), np.zeros(0), np.zeros(2))
    w = np.array([2.0, 0, 0, 0, 0, 0])  # the scale: 0.1 m off the middle, its torque over the size is 2 N too
    # A q is (0.5, 0), (0, -0.3 / sqrt(10)), (-1, 0.3): the last is 1 * 0.1 and 0.3 / 1.5
    for q, value in (([0, 0.5, 0], 0.5 * 0.1), ([0.2, 0, 0], 0.2 / np.sqrt(10)), ([0, 0, 1.0], 0.3 / 1.5)):
        res = judge.residuals(g, w, replace(none, q=np.array(q)))
        assert res.couplings == pytest.approx(value / 2, rel=1e-12)


def test_a_fixture_has_no_joints_and_no_actuators() -> None:
    """A weight of 8 N on four corners: 2 N each, and nothing that could be out of order behind the contacts."""
    g, w = table(), np.array([0, 0, -8, 0, 0, 0])
    assert model.actuator_arms(g).shape == (0,)
    assert model.commanded(g).shape == (0,)
    still = state_of([0, 0, -2, 0, 0, 0], np.zeros(0), np.tile([2, 0, 0], 4), np.zeros(0), np.zeros(0))
    assert judge.residuals(g, w, still).worst < 1e-15
    assert judge.residuals(g, w, replace(still, r=np.zeros(6))).normal == pytest.approx(2 / 8)


def test_the_cone_is_round() -> None:
    c = np.array([1.0, 0.3, 0.4, 2.0, -0.6, 0.0, 1.0, 0.0, -0.2])
    rubs = np.column_stack([c.reshape(-1, 3)[:, 1:], np.zeros(3)])
    np.testing.assert_allclose(
        model.cone_excess(c[::3], rubs, np.array([0.2, 0.5, 0.4])), [0.3, -0.4, -0.2], atol=1e-15
    )


def test_normals_are_certain_unless_said_otherwise() -> None:
    d = np.array([-1.0, 0.6, 0.8, 0.5, 0.0, 0.0])
    np.testing.assert_array_equal(model.normal_motion(d), [-1.0, 0.5])
    np.testing.assert_array_equal(model.spring_force(d), [1.0, 0.0])


@pytest.mark.parametrize("field", ["r", "q", "c", "f", "coupling"])
def test_a_state_is_of_numbers(field: str) -> None:
    _, _, state = holding_pinch()
    with pytest.raises(InputError, match=rf"^{field}: contains NaN"):
        state_of(**(vars(state) | {field: np.array([np.nan])}))


def test_contact_forces_are_no_measure() -> None:
    """Fingers that squeeze with 5 N each, without springs that would, load or command: 5 N are missing."""
    g = pinch().with_preload(None)
    squeeze = state_of(np.zeros(6), np.zeros(2), np.array([5.0, 0, 0, 5.0, 0, 0]), np.zeros(2), np.zeros(0))
    assert judge.residuals(g, np.zeros(6), squeeze).normal == pytest.approx(5.0)
