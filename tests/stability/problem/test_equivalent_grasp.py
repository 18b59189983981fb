"""The equivalent grasp has the torques of the grasp at every motion: compared with the laws themselves."""

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import linprog

from handfast import check
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.problem import model
from handfast.stability.problem.equivalent_grasp import EquivalentGrasp, _made, equivalent_of
from handfast.stability.problem.model import state_of
from tests.support.law_grasps import BACKDRIVABLE, curled, jaw, random_law_grasp
from tests.support.slow_cases import slow_after

INF = np.inf
STILL = 1e-9


def actuator_ranges(grasp: Grasp, q: Array) -> list[tuple[float, float]] | None:
    """(lo, hi) of each actuator's force at a motion; None where the motion cannot be."""
    mech, out = grasp.mechanism, []
    for i, t in enumerate(mech.R @ q):
        command, sense = grasp.command[i], -1.0 if grasp.command[i] < 0 else 1.0
        if mech.backdrivable[i]:
            out.append((command, command))
        elif command == 0 and not mech.tendon[i]:
            if abs(t) > STILL:
                return None
            out.append((-INF, INF))
        elif sense * t < -STILL:
            return None
        elif sense * t > STILL:
            out.append((command, command))
        else:
            out.append((command, INF) if sense > 0 else (-INF, command))
    return out


def joint_ranges(grasp: Grasp, q: Array) -> list[tuple[float, float]] | None:
    """(lo, hi) of each joint's reaction at a motion; None where a joint would move into its stop."""
    out = []
    for joint, moved in zip(grasp.joints, q, strict=True):
        lo = -INF if joint.stop in ("upper", "both") else -joint.friction
        hi = INF if joint.stop in ("lower", "both") else joint.friction
        end = (lo, hi) if abs(moved) <= STILL else (lo, lo) if moved > 0 else (hi, hi)
        if np.isinf(end[0]) and end[0] == end[1]:
            return None
        out.append(end)
    return out


def largest_torque(grasp: Grasp, q: Array, along: Array) -> float | None:
    """The largest along . tau (l,) that joints carry at a motion q, by the laws; None where the motion cannot be."""
    mech = grasp.mechanism
    forces, reactions = actuator_ranges(grasp, q), joint_ranges(grasp, q)
    if forces is None or reactions is None or np.abs(mech.A @ q).max(initial=0.0) > STILL:
        return None
    columns = np.hstack([mech.R.T, mech.A.T, np.eye(grasp.l)])
    bounds = [*forces, *[(-INF, INF)] * len(mech.A), *reactions]
    found = linprog(-along @ columns, bounds=bounds)
    return INF if found.status == 3 else float(-found.fun + along @ grasp.given_torques)


def largest_torque_of_equivalent(same: EquivalentGrasp, q: Array, along: Array) -> float | None:
    """The same of the equivalent, whose own joints u move as their tendons let them."""
    plain, l = same.plain, same.grasp.l
    whole = np.concatenate([q, np.zeros(plain.l - l)])
    for pair in same.pairs:  # u above both 0 and weights . q would leave nothing to pull against -2 F
        whole[pair.slider] = max(0.0, float(pair.weights @ q))
    mech = plain.mechanism
    forces = actuator_ranges(plain, whole)
    if forces is None or np.abs(mech.A @ whole).max(initial=0.0) > STILL:
        return None
    columns = np.hstack([mech.R.T, mech.A.T])
    bounds = [*forces, *[(-INF, INF)] * len(mech.A)]
    sliders, given = columns[l:], plain.given_torques
    if not columns.shape[1]:
        return float(along @ given)
    equal = {"A_eq": sliders, "b_eq": -given[l:]} if len(sliders) else {}
    found = linprog(-along @ columns[:l], bounds=bounds, **equal)
    assert found.status in (0, 3)
    return INF if found.status == 3 else float(-found.fun + along @ given[:l])


def motions(grasp: Grasp, rng: np.random.Generator) -> list[Array]:
    """Rest, motions that ties and locked motors leave, and some that they do not."""
    mech = grasp.mechanism
    locked = mech.R[~model.commanded(grasp)]
    rows = np.vstack([mech.A, locked])
    Z = null_space(rows) if len(rows) else np.eye(grasp.l)
    free = [Z @ rng.choice([-1.0, 0.0, 1.0], Z.shape[1]) for _ in range(8)]
    return [np.zeros(grasp.l), *free, *rng.choice([-1.0, 0.0, 1.0], (4, grasp.l))]


@pytest.mark.parametrize("block", slow_after(1, range(2)))
def test_the_torques_at_every_motion_are_the_same(block: int) -> None:
    """At a motion the torques are a convex set, which its largest values in all directions tell."""
    seen = 0
    for seed in range(20 * block, 20 * (block + 1)):
        rng = np.random.default_rng(seed)
        grasp = random_law_grasp(rng)
        same = equivalent_of(grasp)
        for q in motions(grasp, rng):
            for along in rng.normal(size=(2, grasp.l)):
                mine, its = largest_torque(grasp, q, along), largest_torque_of_equivalent(same, q, along)
                assert (mine is None) == (its is None), (seed, q)
                if mine is not None and its is not None:
                    assert its == pytest.approx(mine, abs=1e-9), (seed, q, along)
                    seen += mine < INF
    assert seen > 50


@pytest.mark.parametrize("seed", range(12))
def test_states_go_there_and_back(seed: int) -> None:
    """Forces of the equivalent as motors and reactions, and these as forces of the equivalent."""
    rng = np.random.default_rng(seed)
    grasp = random_law_grasp(rng)
    same = equivalent_of(grasp)
    q, mech = rng.normal(size=same.plain.l), same.plain.mechanism
    f, coupling = rng.exponential(size=mech.a), rng.normal(size=len(mech.A))
    for pair in same.pairs:  # as their tendons and torques have it
        q[pair.slider] = max(0.0, float(pair.weights @ q[: grasp.l]))
        f[pair.first] = pair.friction * rng.uniform(0, 2)
        f[pair.first + 1] = 2 * pair.friction - f[pair.first]
    parts = same.parts_of(q, f, coupling)
    state = state_of(np.zeros(6), parts[0], np.zeros(3 * grasp.m), parts[1], parts[2], parts[3])
    again = same.plain_parts(state)
    for mine, its in zip(again, (q, f, coupling), strict=True):
        assert mine == pytest.approx(its, abs=1e-12)
    left = model.joint_balance(grasp, state.c, state.f, state.coupling, state.reaction)
    assert left == pytest.approx(model.joint_balance(same.plain, state.c, f, coupling)[: grasp.l], abs=1e-12)


def test_a_grasp_without_laws_is_its_own_equivalent() -> None:
    grasp = jaw(Mechanism.direct(["hinge"]))
    same = equivalent_of(grasp)
    assert same.is_same
    assert same.plain is grasp
    assert not same.is_given


@pytest.mark.parametrize(
    ("grasp", "limited", "stops", "pairs"),
    [
        (jaw(friction=0.2), (), 0, 1),
        (jaw(Mechanism.direct(["hinge"]), friction=0.2), (), 0, 0),  # locked: friction does nothing
        (jaw(Mechanism.direct(["hinge"]), friction=0.2), ("hinge",), 0, 1),  # but beside a limit it does
        (jaw(Mechanism.direct(["hinge"]), {"hinge": 0.1}, friction=0.2), (), 0, 0),
        (jaw(Mechanism.direct(["hinge"]), {"hinge": 0.1}, friction=0.2), ("hinge",), 0, 1),
        (jaw(friction=0.2, stop="upper"), (), 1, 0),
        (jaw(friction=0.2, stop="both"), (), 0, 0),
        (jaw(Mechanism.direct(["hinge"]), stop="lower"), (), 0, 0),  # locked: a stop does nothing
        (jaw(BACKDRIVABLE, friction=0.2), (), 0, 1),
        (curled(knuckle={"friction": 0.1}, tip={"friction": 0.1}), (), 0, 2),
        (curled(0.1, knuckle={"friction": 0.1}, tip={"stop": "lower", "friction": 0.1}), (), 1, 1),
    ],
)
def test_only_what_is_needed_is_added(grasp: Grasp, limited: tuple[str, ...], stops: int, pairs: int) -> None:
    """Each pair of friction has a joint and two tendons, each stop a tendon."""
    same = equivalent_of(grasp, limited=limited)
    assert (len(same.stops), len(same.pairs)) == (stops, pairs)
    assert same.plain.l == grasp.l + pairs
    assert same.plain.mechanism.a == len(same.kept) + stops + 2 * pairs


def test_joints_that_are_tied_have_one_friction() -> None:
    """The second turns half as far and the other way: together they rub as 0.1 + 0.5 * 0.2 would at the first."""
    joints = [
        GraspJoint(name, [0, -1, 0], [0.01, 0, -0.1], (1,), friction=friction)
        for name, friction in (("a", 0.1), ("b", 0.2))
    ]
    tied = Mechanism((), np.zeros((0, 2)), np.array([[1.0, 2.0]]), ())
    same = equivalent_of(Grasp(jaw().contacts, joints, tied))
    (pair,) = same.pairs
    assert pair.friction == 0.5  # the power of two above 0.3
    assert pair.weights @ [1.0, -0.5] * pair.friction == pytest.approx(0.1 + 0.5 * 0.2)


def test_names_that_are_taken_are_no_trouble() -> None:
    """Rows that are added have names of their own."""
    joints = [
        GraspJoint("hinge", [0, -1, 0], [0.01, 0, -0.1], (1,), friction=0.1),
        GraspJoint("friction of hinge", [0, -1, 0], [0.01, 0, -0.1], (1,), stop="lower"),
    ]
    taken = Mechanism(("stop of friction of hinge",), np.array([[1.0, 1.0]]), np.zeros((0, 2)), (True,))
    same = equivalent_of(Grasp(jaw().contacts, joints, taken))
    assert len(set(same.plain.mechanism.actuators)) == 4
    assert len({joint.name for joint in same.plain.joints}) == 3


def test_what_is_left_of_torques_that_cancel_is_exact() -> None:
    """0.1 + 0.2 - 0.3 is 5.6e-17 in floating point, and half of that by the numbers; either is far below the load."""
    back = Mechanism(("a", "b"), np.ones((2, 1)), np.zeros((0, 1)), (False,) * 2, (True,) * 2)
    grasp = jaw(back, {"a": 0.1, "b": 0.2}, torque=-0.3)
    assert equivalent_of(grasp).plain.given_torques.tolist() == [2.0**-55] != [0.1 + 0.2 - 0.3]
    assert check(grasp, [-1, 0, 0]).verdict == "holds"
    assert check(grasp, [0, 0, -1]).verdict == "slips"


@pytest.mark.parametrize(("stop", "torque"), [("lower", 0.1), ("upper", -0.1)])
def test_a_stop_says_how_a_joint_that_is_tied_to_it_rubs(stop: str, torque: float) -> None:
    """q_a = -q_b: where b stands at its lower stop it can only close, so a only opens, and its friction closes it."""
    joints = [
        GraspJoint("a", [0, -1, 0], [0.01, 0, -0.1], (1,), friction=0.1),
        GraspJoint("b", [0, -1, 0], [0.01, 0, -0.1], (1,), stop=stop),  # type: ignore[arg-type]
    ]
    for A in ([[1.0, 1.0]], [[-2.0, -2.0]]):
        same = equivalent_of(Grasp(jaw().contacts, joints, Mechanism((), np.zeros((0, 2)), np.array(A), ())))
        assert same.constant.tolist() == [torque, 0.0]
        assert (len(same.stops), len(same.pairs)) == (1, 0)


def parts(found: EquivalentGrasp) -> list[np.ndarray]:
    """Everything of an equivalent that is a number."""
    plain, pairs = found.plain, found.pairs
    numbers = [plain.command, plain.mechanism.R, plain.mechanism.A, plain.given_torques, plain.mechanism.tendon]
    numbers += [found.grasp.command, found.kept, found.arms, found.constant, found.of_forces, found.of_couplings]
    of_pairs = [np.r_[pair.slider, pair.first, pair.weights, pair.friction] for pair in pairs]
    return [np.asarray(x, dtype=float) for x in (*numbers, found.held, found.stops, *of_pairs)]


@pytest.mark.parametrize("seed", range(12))
def test_commands_of_other_sizes_and_signs_after_those_of_a_grasp(seed: int) -> None:
    """What was replaced for a grasp is kept for its other commands: as if nothing had been kept."""
    rng = np.random.default_rng(seed)
    grasp = random_law_grasp(rng)
    a = grasp.mechanism.a
    some = rng.random(a) < 0.5
    for driven in (None, some & ~np.array(grasp.mechanism.backdrivable, dtype=bool)):
        for factor in (np.ones(a), np.full(a, 3.0), rng.choice([-2.0, 0.0, 1.0], size=a)):
            other = grasp.with_preload(factor * np.where(np.array(grasp.mechanism.tendon), 1.0, grasp.command))
            kept = equivalent_of(other, driven)
            _made.cache_clear()
            made = equivalent_of(other, driven)
            assert kept.grasp is other
            for one, two in zip(parts(kept), parts(made), strict=True):
                assert np.array_equal(one, two)
            equivalent_of(grasp, driven)  # what the next one begins with
