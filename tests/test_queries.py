"""check, max and torques on problems solved by hand, and what they say when they cannot answer."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from holdfast.answer import Stop, Verdict
from holdfast.errors import InputError
from holdfast.grasp import Contact, Grasp, GraspJoint
from holdfast.mechanism import Mechanism
from holdfast.stability import mip, model
from holdfast.stability.mip import Solution, Status
from holdfast.stability.queries import check, maximum, torques
from holdfast.stability.settings import Settings
from problems import Z, bell, nest, pinch, solved, table

QUICK = Settings(sectors=256, time_limit=60)


def w(*force: float, torque: tuple[float, ...] = (0, 0, 0)) -> np.ndarray:
    return np.array([*force, *torque], dtype=float)


def assert_bounds(answer, value: float, gap: float = 1e-3) -> None:
    """A maximum is bracketed: witnessed just below (or at) the value derived by hand, certified just above."""
    assert answer.verdict is Verdict.HOLDS
    assert answer.lower <= value * (1 + 1e-9)
    assert answer.upper >= value * (1 - 1e-6)
    assert answer.gap <= gap
    assert answer.witness.valid


# --- hand-derived answers --------------------------------------------------------------------------


def test_pinch_across() -> None:
    """2 mu torque / arm = 2 * 0.5 * 0.1 / 0.1 = 1 N."""
    assert_bounds(maximum(pinch(), w(0, 1, 0), settings=QUICK), 1.0)
    assert_bounds(maximum(pinch(), w(0, 0, 1), settings=QUICK), 1.0)
    assert check(pinch(), w(0, 0.99, 0), settings=QUICK).verdict is Verdict.HOLDS
    assert check(pinch(), w(0, 1.01, 0), settings=QUICK).verdict is Verdict.SLIPS


def test_pinch_diagonal_is_a_circle_not_a_pyramid() -> None:
    """Friction is isotropic: 1 N in every direction across, 45 and 30 degrees included."""
    for angle in (30.0, 45.0):
        a = np.radians(angle)
        assert_bounds(maximum(pinch(), w(0, np.cos(a), np.sin(a)), settings=QUICK), 1.0)


def test_pinch_along_the_fingers_is_resisted_at_any_magnitude() -> None:
    answer = maximum(pinch(), w(1, 0, 0), settings=QUICK)
    assert answer.unbounded
    assert answer.upper == np.inf
    assert answer.stop is Stop.COMPLETE
    assert answer.witness.valid
    assert answer.witness.grasp.preload == pytest.approx({"right": 0.1, "left": 0.1})


def test_pinch_without_preload_lets_go() -> None:
    bare = pinch().with_preload(None)
    assert check(bare, w(0, 0.01, 0), settings=QUICK).verdict is Verdict.SLIPS
    answer = maximum(bare, w(0, 1, 0), settings=QUICK)
    assert (answer.verdict, answer.lower, answer.upper) == (Verdict.SLIPS, 0.0, 0.0)


def test_nest_carries_and_never_pulls() -> None:
    assert maximum(nest(), w(0, 0, -1), settings=QUICK).unbounded
    assert maximum(nest(), w(0, 0, 1), settings=QUICK).verdict is Verdict.SLIPS


def test_table_with_its_weight_is_coulomb() -> None:
    """base = weight: the general form w0 + s d. 10 N on mu = 0.4 resists 4 N."""
    assert_bounds(maximum(table(), w(1, 0, 0), base=w(0, 0, -10), settings=QUICK), 4.0)


def test_largest_normal_force() -> None:
    """Four contacts of at most 2 N each carry at most 8 N of a centred load."""
    answer = maximum(table(), w(0, 0, -1), force_limit=2.0, settings=QUICK)
    assert_bounds(answer, 8.0)
    assert answer.witness.state.c[0::3].max() <= 2.0 + 1e-9


def test_largest_torque() -> None:
    """A locked finger 0.1 m below the contact carries 0.3 N m, so 3 N along x; the other one opens."""
    answer = maximum(pinch(), w(1, 0, 0), torque_limits={"right": 0.3}, settings=QUICK)
    assert answer.witness.valid
    # the left finger presses with torque / arm = 1 N as well, unless sliding lets go: never more than 3 N
    assert answer.lower <= 3.0 + 1e-9
    assert answer.upper >= 2.0 - 1e-6
    assert abs(answer.witness.state.f[0]) <= 0.3 + 1e-9


def test_least_torques() -> None:
    """1 N across needs c_n = 1 N at both tips: one finger at 0.1 N m is enough, the other is locked."""
    for objective, least in (("max", 0.1), ("sum", 0.1)):
        answer = torques(pinch(), w(0, 1, 0), objective=objective, settings=QUICK)
        assert answer.verdict is Verdict.HOLDS
        assert answer.lower <= least * (1 + 1e-6)
        assert least * (1 - 1e-6) <= answer.upper <= least * (1 + 1e-3)
        assert answer.witness.valid
        assert check(pinch().with_preload(answer.preload), w(0, 0.999, 0), settings=QUICK).verdict is Verdict.HOLDS


def test_torques_that_do_not_exist() -> None:
    assert torques(nest(), w(0, 0, 1), settings=QUICK).verdict is Verdict.SLIPS
    with pytest.raises(InputError, match="objective: is 'least'; 'max' or 'sum' is needed"):
        torques(pinch(), w(0, 1, 0), objective="least")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="actuators: unknown actuator 'thumb'; known: right, left"):
        torques(pinch(), w(0, 1, 0), actuators=["thumb"])


def test_negative_commands_are_the_mirror_image() -> None:
    g = pinch()
    flipped = [GraspJoint(j.name, -j.axis, j.origin, j.moves) for j in g.joints]
    other = Grasp(g.contacts, flipped, preload={"right": -0.1, "left": -0.1})
    assert_bounds(maximum(other, w(0, 1, 0), settings=QUICK), 1.0)
    answer = torques(other, w(0, 1, 0), settings=QUICK)
    assert answer.upper == pytest.approx(0.1, rel=1e-3)
    assert min(answer.preload.values()) == pytest.approx(-0.1, rel=1e-3)


def test_coupled_and_tendon_driven_fingers() -> None:
    """The same pinch with each finger's joint split in two coupled ones, and pulled by tendons.

    Joints at arms 0.1 and 0.05 with dist = prox / 2: the finger's torque per newton is 0.1 + 0.025.
    """
    contacts = pinch().contacts
    joints, rows, couplings = [], [], []
    for k, (name, side) in enumerate((("right", 1.0), ("left", -1.0))):
        for part, arm in (("prox", 0.1), ("dist", 0.05)):
            joints.append(GraspJoint(f"{name}_{part}", side * Z, np.array([side * 0.03, -arm, 0]), (k,)))
        rows.append(np.eye(4)[2 * k])
        couplings.append(np.eye(4)[2 * k + 1] - 0.5 * np.eye(4)[2 * k])
    for tendon in (False, True):
        mechanism = Mechanism(("right", "left"), np.array(rows), np.array(couplings), (tendon, tendon))
        g = Grasp(contacts, joints, mechanism, {"right": 0.125, "left": 0.125})
        assert_bounds(maximum(g, w(0, 1, 0), settings=QUICK), 1.0)


def test_a_free_joint_carries_nothing() -> None:
    """A joint in no actuator swings: the right finger cannot press, so nothing is resisted across."""
    g = pinch()
    mechanism = Mechanism(("left",), np.array([[0.0, 1.0]]), np.zeros((0, 2)), (False,))
    free = Grasp(g.contacts, g.joints, mechanism, {"left": 0.1})
    assert maximum(free, w(0, 1, 0), settings=QUICK).verdict is Verdict.SLIPS


# --- the stability paper's points --------------------------------------------------------------------


def test_without_dissipation_the_bell_holds_anything_by_creating_energy() -> None:
    bare = bell().with_preload(None)
    for magnitude in (1.0, 1000.0):
        answer = check(bare, w(0, magnitude, 0), mdp=False, settings=QUICK)
        assert answer.verdict is Verdict.HOLDS
        assert answer.witness.energy.created > 0  # friction pushes along the motion
        state = answer.witness.state
        assert model.residuals(bare, w(0, magnitude, 0), state).dissipation > 1e-3  # not a solution with (6)
    assert check(bare, w(0, 1, 0), settings=QUICK).verdict is Verdict.SLIPS


def test_printed_refinement_ends_at_the_finest_sectors() -> None:
    """As printed: no early stop; the last step's active sectors are all at 360 / 64 degrees."""
    answer = check(bell(), w(0, 2.0, 0), settings=Settings(sectors=64, as_printed=True))
    assert answer.verdict is Verdict.HOLDS
    last = answer.steps[-1]
    assert last.finished
    assert last.width <= 2 * np.pi / 64 * (1 + 1e-9)
    assert len(answer.steps) >= 5


def test_full_resolution_agrees_with_refinement() -> None:
    full = maximum(bell(), w(0, 1, 0), settings=Settings(sectors=32, full=True))
    fine = maximum(bell(), w(0, 1, 0), settings=Settings(sectors=32, as_printed=True))
    assert len(full.steps) == 1
    assert full.upper == pytest.approx(fine.upper, rel=1e-6)


def test_bounds_are_monotone_under_refinement() -> None:
    """A child's bound is never better than its parent's; coarse sectors resist more, never less."""
    answer = maximum(bell(), w(0.2, 1, 0), settings=Settings(sectors=256, as_printed=True))
    bounds = [s.bound for s in answer.steps]
    assert all(b >= a - 1e-6 for a, b in itertools.pairwise(bounds))
    by_resolution = [maximum(bell(), w(0, 1, 0), settings=Settings(sectors=n)).upper for n in (4, 16, 64)]
    assert all(b <= a + 1e-6 for a, b in itertools.pairwise(by_resolution))


@hypothesis_settings(max_examples=12, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sampled_from([2, 3]), st.sampled_from([0.0, 0.05]))
def test_a_relaxation_contains_every_exact_solution(seed: int, m: int, eta: float) -> None:
    """A disturbance that a constructed exact solution resists is never said to slip, at any resolution."""
    s = solved(seed, m, eta)
    if not s.wrench.any():
        return
    for sectors in (4, 32):
        answer = check(s.grasp, s.wrench, eta=eta, settings=Settings(sectors=sectors, time_limit=20))
        assert answer.verdict is not Verdict.SLIPS


@pytest.mark.parametrize("seed", [3, 8])
def test_laws_of_the_maximum(seed: int) -> None:
    """Twice the preload resists twice as much; the order of contacts and the frame do not matter."""
    g = pinch(mu=0.6, offset=0.004)
    rng = np.random.default_rng(seed)
    d = np.r_[0, rng.normal(size=2), 0, 0, 0]
    d /= np.linalg.norm(d)
    base = maximum(g, d, settings=QUICK)
    twice = maximum(g.with_preload(2 * g.command), d, settings=QUICK)
    assert twice.upper == pytest.approx(2 * base.upper, rel=2e-3)
    order = Grasp(
        g.contacts[::-1],
        [GraspJoint(j.name, j.axis, j.origin, tuple(1 - i for i in j.moves)) for j in g.joints],
        preload=g.command,
    )
    assert maximum(order, d, settings=QUICK).upper == pytest.approx(base.upper, rel=2e-3)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    turned = Grasp(
        [Contact(R @ c.position, R @ c.normal, c.friction) for c in g.contacts],
        [GraspJoint(j.name, R @ j.axis, R @ j.origin, j.moves) for j in g.joints],
        preload=g.command,
    )
    assert maximum(turned, np.r_[R @ d[:3], 0, 0, 0], settings=QUICK).upper == pytest.approx(base.upper, rel=2e-3)


# --- three values: a limit is never "slips" -------------------------------------------------------------


def test_a_time_out_is_undecided() -> None:
    answer = check(bell(), w(0, 2.0, 0), settings=Settings(time_limit=1e-6))
    assert (answer.verdict, answer.stop) == (Verdict.UNDECIDED, Stop.TIME)
    best = maximum(bell(), w(0, 1, 0), settings=Settings(time_limit=1e-6))
    assert (best.verdict, best.stop, best.upper) == (Verdict.UNDECIDED, Stop.TIME, np.inf)


@pytest.mark.parametrize("status", [Status.FAILED, Status.INTERRUPTED, Status.TIME])
def test_whatever_the_solver_does_nothing_slips_without_infeasible(
    monkeypatch: pytest.MonkeyPatch, status: Status
) -> None:
    monkeypatch.setattr(mip, "solve", lambda *a, **k: Solution(status, None, -np.inf, 0))
    for answer in (check(bell(), w(0, 9, 0)), maximum(bell(), w(0, 1, 0)), torques(bell(), w(0, 1, 0))):
        assert answer.verdict is Verdict.UNDECIDED
        assert answer.stop is not Stop.COMPLETE


def test_a_relaxation_without_an_exact_solution_is_undecided() -> None:
    """With four sectors 2.5 N on the bell looks feasible, and no exact solution exists: neither verdict."""
    answer = check(bell(), w(0, 2.4, 0), settings=Settings(sectors=4))
    assert (answer.verdict, answer.stop) == (Verdict.UNDECIDED, Stop.RESOLUTION)


def test_ctrl_c_leaves_the_bounds_so_far() -> None:
    def interrupt(progress) -> None:
        raise KeyboardInterrupt

    answer = maximum(bell(), w(0, 1, 0), settings=QUICK, on_step=interrupt)
    assert answer.stop is Stop.INTERRUPTED
    assert len(answer.steps) == 1
    assert answer.upper >= 2.2222 - 1e-6


def test_progress_reports_every_step() -> None:
    seen = []
    answer = maximum(bell(), w(0, 1, 0), settings=QUICK, on_step=seen.append)
    assert [p.step.number for p in seen] == [s.number for s in answer.steps][: len(seen)]
    assert all(p.lower <= p.upper for p in seen)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("sectors", 100, "sectors: is 100; 4, 8, 16"),
        ("sectors", 2, "sectors: is 2; 4, 8, 16"),
        ("gap", 0.0, "gap: is 0; a positive number"),
        ("time_limit", -1.0, "time limit: is -1 s; a positive number"),
        ("solver", "cplex", "solver: is 'cplex'; one of scip, gurobi"),
    ],
)
def test_settings_are_checked(field: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Settings(**{field: value})  # type: ignore[arg-type]


# --- witnesses ----------------------------------------------------------------------------------------


def test_answers_as_json() -> None:
    answer = check(pinch(), w(0, 0.5, 0), settings=QUICK)
    data = answer.to_json()
    assert data["verdict"] == "holds"
    assert data["stop"] == "complete"
    total = np.sum([c["force"] for c in data["contacts"]], axis=0)
    np.testing.assert_allclose(total, [0, -0.5, 0], atol=1e-9)
    assert data["residual"] <= 1e-9
    none = check(pinch(), w(0, 5, 0), settings=QUICK).to_json()
    assert none["contacts"] is None
    endless = maximum(pinch(), w(1, 0, 0), settings=QUICK).to_json()
    assert endless["upper"] is None
    assert endless["unbounded"] is True


@pytest.mark.skipif(not mip.available("gurobi"), reason="gurobipy is not installed")
@pytest.mark.parametrize("direction", [(0, 1, 0), (0.5, 1, 0), (-1, 0.2, 0.1)])
def test_gurobi_agrees_with_scip(direction: tuple[float, ...]) -> None:
    g = bell(0.02)
    a = maximum(g, w(*direction), settings=Settings(sectors=128, time_limit=60))
    b = maximum(g, w(*direction), settings=Settings(sectors=128, time_limit=60, solver="gurobi"))
    assert a.unbounded == b.unbounded
    if not a.unbounded:
        assert a.lower <= b.upper * (1 + 1e-6)
        assert b.lower <= a.upper * (1 + 1e-6)
