"""check, max and torques on problems solved by hand: answers, and a proof of every bound."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import TypeVar

import numpy as np
import pytest

from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs import checker
from handfast.readers.grasp_file import load_grasp
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.problem import judge, scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.search import search
from handfast.stability.studies import questions as queries
from tests.support.interruptions import ctrl_c, interrupt
from tests.support.problems import X, Y, Z, bell, nest, pinch, table

A = TypeVar("A", bound=Answer)


def proved(answer: A) -> A:
    """The answer, once its witness is valid, and a certificate of SLIPS or of its bound has passed the checker."""
    assert answer.witness is None or answer.witness.valid
    bound = isinstance(answer, MaxAnswer) and not answer.unbounded and answer.upper < np.inf
    bound = bound or (isinstance(answer, TorquesAnswer) and answer.lower > 0)
    if bound or answer.verdict is Verdict.SLIPS:
        assert answer.certificate is not None
        found = checker.verify(answer.certificate)
        assert found.ok, found.reason
    return answer


def check(*asked, **options) -> CheckAnswer:
    return proved(queries.check(*asked, **options))


def maximum(*asked, **options) -> MaxAnswer:
    return proved(queries.maximum(*asked, **options))


def torques(*asked, **options) -> TorquesAnswer:
    return proved(queries.torques(*asked, **options))


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
    assert_bounds(maximum(pinch(), w(0, 1, 0)), 1.0)
    assert_bounds(maximum(pinch(), w(0, 0, 1)), 1.0)
    assert check(pinch(), w(0, 0.99, 0)).verdict is Verdict.HOLDS
    assert check(pinch(), w(0, 1.01, 0)).verdict is Verdict.SLIPS


def test_pinch_diagonal_is_a_circle_not_a_pyramid() -> None:
    """Friction is isotropic: 1 N in every direction across, 45 and 30 degrees included."""
    for angle in (30.0, 45.0):
        a = np.radians(angle)
        assert_bounds(maximum(pinch(), w(0, np.cos(a), np.sin(a))), 1.0)


def test_pinch_along_the_fingers_is_resisted_at_any_magnitude() -> None:
    answer = maximum(pinch(), w(1, 0, 0))
    assert answer.unbounded
    assert answer.upper == np.inf
    assert answer.stop is Stop.COMPLETE
    assert answer.witness.valid
    assert answer.witness.grasp.preload == pytest.approx({"right": 0.1, "left": 0.1})


def test_pinch_without_preload_lets_go() -> None:
    bare = pinch().with_preload(None)
    assert check(bare, w(0, 0.01, 0)).verdict is Verdict.SLIPS
    answer = maximum(bare, w(0, 1, 0))
    assert (answer.verdict, answer.lower, answer.upper) == (Verdict.SLIPS, 0.0, 0.0)


def test_nest_carries_and_never_pulls() -> None:
    assert maximum(nest(), w(0, 0, -1)).unbounded
    assert maximum(nest(), w(0, 0, 1)).verdict is Verdict.SLIPS


def test_table_with_its_weight_is_coulomb() -> None:
    """base = weight: the general form w0 + s d. 10 N on mu = 0.4 resists 4 N."""
    assert_bounds(maximum(table(), w(1, 0, 0), base=w(0, 0, -10)), 4.0)


def test_largest_normal_force() -> None:
    """Four contacts of at most 2 N each carry at most 8 N of a centred load."""
    answer = maximum(table(), w(0, 0, -1), limits=GraspLimits(force_limit=2.0))
    assert_bounds(answer, 8.0)
    assert answer.witness.state.c[0::3].max() <= 2.0 + 1e-9


def test_largest_torque() -> None:
    """A locked finger 0.1 m below the contact carries 0.3 N m, so 3 N along x; the other one opens."""
    answer = maximum(pinch(), w(1, 0, 0), limits=GraspLimits(torque_limits={"right": 0.3}))
    assert answer.witness.valid
    # the left finger presses with torque / arm = 1 N as well, unless sliding lets go: never more than 3 N
    assert answer.lower <= 3.0 + 1e-9
    assert answer.upper >= 2.0 - 1e-6
    assert abs(answer.witness.state.f[0]) <= 0.3 + 1e-9


@pytest.mark.parametrize("limits", [GraspLimits(torque_limits={"right": 0.3}), GraspLimits(force_limit=5.0)])
def test_limits_do_not_hold_what_slips_without_them(limits) -> None:
    """Nothing presses without a preload: any force across slips, along the fingers 0.3 / 0.1 N or 5 N are carried."""
    bare = pinch().with_preload(None)
    answer = maximum(bare, w(0, 1, 0), settings=Settings(nodes=1000), limits=limits)
    assert (answer.verdict, answer.lower, answer.upper) == (Verdict.SLIPS, 0.0, 0.0)
    assert answer.stop is Stop.COMPLETE
    assert answer.verified
    assert answer.verify().ok
    assert_bounds(maximum(bare, w(1, 0, 0), limits=limits), 3.0 if limits.torque_limits else 5.0)


def test_least_torques() -> None:
    """1 N across needs c_n = 1 N at both tips: one finger at 0.1 N m is enough, the other is locked."""
    for objective, least in (("max", 0.1), ("sum", 0.1)):
        answer = torques(pinch(), w(0, 1, 0), objective=objective)
        assert answer.verdict is Verdict.HOLDS
        assert answer.lower <= least * (1 + 1e-6)
        assert least * (1 - 1e-6) <= answer.upper <= least * (1 + 1e-3)
        assert answer.witness.valid
        assert check(pinch().with_preload(answer.preload), w(0, 0.999, 0)).verdict is Verdict.HOLDS


def test_torques_that_do_not_exist() -> None:
    assert torques(nest(), w(0, 0, 1)).verdict is Verdict.SLIPS
    with pytest.raises(InputError, match="objective: is 'least'; 'max' or 'sum' is needed"):
        torques(pinch(), w(0, 1, 0), objective="least")
    with pytest.raises(InputError, match="actuators: unknown actuator 'thumb'; known: right, left"):
        torques(pinch(), w(0, 1, 0), actuators=["thumb"])


def test_negative_commands_are_the_mirror_image() -> None:
    g = pinch()
    flipped = [GraspJoint(j.name, -j.axis, j.origin, j.moves) for j in g.joints]
    other = Grasp(g.contacts, flipped, preload={"right": -0.1, "left": -0.1})
    assert_bounds(maximum(other, w(0, 1, 0)), 1.0)
    answer = torques(other, w(0, 1, 0))
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
        assert_bounds(maximum(g, w(0, 1, 0)), 1.0)


@pytest.mark.parametrize("command", [1.0, 1e5])
@pytest.mark.parametrize("ratio", [1.0, -1e-3])
def test_a_motor_may_drive_a_jaw_by_a_slide_that_touches_nothing(command: float, ratio: float) -> None:
    """Both contacts press with command / ratio, and carry half of that each, friction being a half."""
    contacts = [Contact([x, 0, 0], [-x, 0, 0], 0.5) for x in (-1.0, 1.0)]
    joints = [GraspJoint(name, [1, 0, 0], [0, 0, 0], on, "prismatic") for name, on in (("jaw", (0,)), ("slide", ()))]
    belt = Mechanism(("motor",), np.array([[0.0, 1.0]]), np.array([[1.0, -ratio]]), (False,))
    grasp = Grasp(contacts, joints, belt, preload={"motor": np.sign(ratio) * command})
    most = queries.maximum(grasp, Z)
    assert most.lower == pytest.approx(command / abs(ratio), rel=1e-3)
    assert most.upper == pytest.approx(most.lower, rel=1.001e-3)
    assert most.verify().ok


def test_the_magnitude_at_the_end_of_a_search_is_that_of_its_state() -> None:
    """Motions 10^4 times the load leave 4e-8 of the scalar to rounding; the commands of the state are the grasp's."""
    at = [[4.73, -27.1, -9.67], [3.33, -0.18, 9.44], [0.94, -40.1, 13.6], [-0.418, -39.9, 7.93], [20.1, -28.7, -3.98]]
    into = [[0.432, 0, 0.902], [-0.121, -0.986, -0.114], [0.522, 0.683, -0.511], [0.732, 0.666, -0.141]]
    into.append([-0.953, -0.107, 0.284])
    contacts = [
        Contact(0.001 * np.array(p), n / np.linalg.norm(n), 0.0 if k == 3 else 0.157, torsion=0.0 if k else 0.000526)
        for k, (p, n) in enumerate(zip(at, into, strict=True))
    ]
    axes = [[0.305, -0.147, 0.941], [0.372, 0.442, 0.816], [0.278, -0.702, -0.655]]
    origins = [[0.0312, -0.0179, -0.00233], [-0.0374, -0.0188, -0.0151], [0.0212, -0.0545, 0.0376]]
    joints = [
        GraspJoint(f"j{k}", a / np.linalg.norm(a), o, moves, torque=0.0195 if k == 1 else 0.0)
        for k, (a, o, moves) in enumerate(zip(axes, origins, [(1, 3), (4, 0), (2,)], strict=True))
    ]
    rows = np.array([[0, -0.41, 0], [0, 2.08, 0], [-1.01, 1.01, 0]])
    mechanism = Mechanism(("a", "b", "c"), rows, np.zeros((0, 3)), (False, True, False))
    grasp = Grasp(contacts, joints, mechanism, preload={"a": 0.00394})
    answer = queries.maximum(grasp, [0.0579, 0.0524, -0.234, 0.00615, 0.00218, 0.0011])
    assert answer.unbounded
    assert answer.verify().ok


@pytest.mark.parametrize("tendon", [False, True])
@pytest.mark.parametrize("command", [1.0, 1e5])
def test_a_motor_may_press_by_another_that_is_held(command: float, tendon: bool) -> None:
    """Its slide touches nothing; an actuator without a command ties it to the jaw. Friction carries a half at each."""
    contacts = [Contact([x, 0, 0], [-x, 0, 0], 0.5) for x in (-1.0, 1.0)]
    joints = [GraspJoint(name, [1, 0, 0], [0, 0, 0], on, "prismatic") for name, on in (("slide", ()), ("jaw", (0,)))]
    tie = [-1.0, 1.0] if tendon else [1.0, -1.0]
    belt = Mechanism(("motor", "tie"), np.array([[1.0, 0.0], tie]), np.zeros((0, 2)), (False, tendon))
    grasp = Grasp(contacts, joints, belt, preload={"motor": command})
    assert_bounds(maximum(grasp, Z), command, gap=1.001e-3)
    on_path = queries.maximum(grasp, Z, loading="preload-first")
    assert on_path.lower == pytest.approx(command, rel=2e-3)
    assert on_path.verify().ok


def test_a_bound_near_the_end_of_a_search_is_shown_to_twice_as_far() -> None:
    """A toggle: 1 N along x meets a slide along (-1, -1e-4), which gives way but for 10^4 N down: 10^4 N across."""
    contacts = [Contact([x, y, 0], [0, -y, 0], 0.5) for x, y in ((0.0, 1.0), (0.5, -1.0), (-0.5, -1.0))]
    slide = np.array([-1.0, -1e-4, 0]) / np.hypot(1, 1e-4)
    joints = [GraspJoint(name, along, [0, 1, 0], (0,), "prismatic") for name, along in (("a", X), ("b", slide))]
    motor = Mechanism(("m",), np.array([[1.0, 0.0]]), np.zeros((0, 2)), (False,), (True,))
    answer = maximum(Grasp(contacts, joints, motor, {"m": 1.0}), Z)
    assert_bounds(answer, 1e4 - 1e-4, gap=1.001e-3)
    assert answer.verify().ok


def test_a_path_whose_first_state_is_not_near_enough_is_left_open() -> None:
    """A finger of 1 N levers with 10^5 N: numbers are off by more than 1e-5 of the force that is commanded."""
    at = [[0, 1e-5, 0], [0, -1e-5, 0], [0, 1, 0]]
    contacts = [Contact(p, [0, 0, n], mu) for p, n, mu in zip(at, (1, -1, -1), (0.5, 0.5, 0.0), strict=True)]
    finger = GraspJoint("f", [0, 0, -1], [0, 1, 0], (2,), "prismatic")
    answer = queries.maximum(Grasp(contacts, [finger], preload={"f": 1.0}), X, loading="preload-first")
    assert answer.verify().ok


def test_where_no_path_begins_the_cap_is_that_of_each_time_of_the_direction() -> None:
    """Contacts that all but face each other: 10^-6 of what they press with holds, moving by 2 x 10^12 N for 1 N."""
    contacts = [Contact([-1, 0, 0], [1, 0, 0], 0.0), Contact([1, 0, 0], np.array([-1, 1e-6, 0]), 0.0)]
    answer = queries.maximum(Grasp(contacts), w(0, -1, 0, torque=(0, 0, -1)), loading="preload-first")
    assert (answer.verdict, answer.upper) == (Verdict.SLIPS, 0)
    assert answer.path.slips_at > 100
    assert answer.motion_cap == pytest.approx(answer.proof.cap / answer.path.slips_at)
    assert answer.motion_cap < 2e12
    assert answer.verify().ok


def geared_pinch(*ratios: float) -> Grasp:
    """A fixed contact, and jaws opposite that a motor's slide, which touches nothing, drives: so far per motion."""
    contacts, joints = [Contact([-1, 0, 0], [1, 0, 0], 0.5)], []
    for i in range(len(ratios)):
        contacts.append(Contact([1, 0.3 * np.cos(2.1 * i), 0.3 * np.sin(2.1 * i)], [-1, 0, 0], 0.5))
        joints.append(GraspJoint(f"jaw{i}", [-1, 0, 0], [0, 0, 0], (i + 1,), "prismatic"))
    joints.append(GraspJoint("slide", [0, 0, 1], [0, 0, 0], (), "prismatic"))
    couplings = np.hstack([np.eye(len(ratios)), -np.array(ratios)[:, None]])
    belt = Mechanism(("motor",), np.eye(len(joints))[-1:], couplings, (False,))
    return Grasp(contacts, joints, belt, preload={"motor": 1.0})


@pytest.mark.parametrize("along", [Y, Z])
def test_commands_beyond_the_end_of_a_search_are_not_said_to_be_none(along: np.ndarray) -> None:
    """Certificates end where the search did, at 10^6 N for the first jaw; what carries Z may be beyond."""
    answer = queries.torques(geared_pinch(1e3, 1e-3), along)
    assert answer.verdict is not Verdict.SLIPS
    assert answer.lower < np.inf
    assert answer.verify().ok


def test_where_no_least_commands_are_found_those_of_the_grasp_may_hold() -> None:
    """The search for the least fails, with the second jaw's ratio of 0.003; a check of 100 N does not."""
    grasp = geared_pinch(100, 3e-3).with_preload({"motor": 100.0})
    assert check(grasp, w(0, 1, 0.4)).verdict is Verdict.HOLDS
    answer = queries.torques(grasp, w(0, 1, 0.4))
    assert answer.verdict is Verdict.HOLDS
    assert answer.upper <= 100.0
    assert answer.verify().ok


def test_commands_are_sought_as_far_as_couplings_take_forces() -> None:
    """1,000 N at a contact are 10^6 N of a motor whose jaw goes 1,000 times as far."""
    p = scaled_problem.build(geared_pinch(1e3), w(0, 1, 0), driven=np.array([True]))
    assert p.force == pytest.approx(1.0)
    assert p.command_end * p.command_unit == pytest.approx(1e6)
    none = scaled_problem.build(pinch(), w(0, 1, 0), driven=np.array([True, True]))
    assert none.command_end == 1e3


def test_a_free_joint_carries_nothing() -> None:
    """A joint in no actuator swings: the right finger cannot press, so nothing is resisted across."""
    g = pinch()
    mechanism = Mechanism(("left",), np.array([[0.0, 1.0]]), np.zeros((0, 2)), (False,))
    free = Grasp(g.contacts, g.joints, mechanism, {"left": 0.1})
    assert maximum(free, w(0, 1, 0)).verdict is Verdict.SLIPS


# --- the stability paper's points, and laws ------------------------------------------------------------


def test_without_dissipation_the_bell_holds_anything_by_creating_energy() -> None:
    bare = bell().with_preload(None)
    for magnitude in (1.0, 1000.0):
        answer = check(bare, w(0, magnitude, 0), mdp=False)
        assert answer.verdict is Verdict.HOLDS
        assert answer.witness.energy.created > 0  # friction pushes along the motion
        state = answer.witness.state
        assert judge.residuals(bare, w(0, magnitude, 0), state).dissipation > 1e-3  # not a solution with (6)
    assert check(bare, w(0, 1, 0)).verdict is Verdict.SLIPS


@pytest.mark.parametrize("seed", [3, 8])
def test_laws_of_the_maximum(seed: int) -> None:
    """Twice the preload resists twice as much; the order of contacts and the frame do not matter."""
    g = pinch(mu=0.6, offset=0.004)
    rng = np.random.default_rng(seed)
    d = np.r_[0, rng.normal(size=2), 0, 0, 0]
    d /= np.linalg.norm(d)
    base = maximum(g, d)
    twice = maximum(g.with_preload(2 * g.command), d)
    assert twice.upper == pytest.approx(2 * base.upper, rel=2e-3)
    order = Grasp(
        g.contacts[::-1],
        [GraspJoint(j.name, j.axis, j.origin, tuple(1 - i for i in j.moves)) for j in g.joints],
        preload=g.command,
    )
    assert maximum(order, d).upper == pytest.approx(base.upper, rel=2e-3)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    turned = Grasp(
        [Contact(R @ c.position, R @ c.normal, c.friction) for c in g.contacts],
        [GraspJoint(j.name, R @ j.axis, R @ j.origin, j.moves) for j in g.joints],
        preload=g.command,
    )
    assert maximum(turned, np.r_[R @ d[:3], 0, 0, 0]).upper == pytest.approx(base.upper, rel=2e-3)


# --- settings -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("gap", 0.0, "gap: is 0; a positive number"),
        ("timeout", -1.0, "timeout: is -1 s; a positive number"),
        ("nodes", 0, "nodes: is 0; a positive number"),
        ("jobs", 3, "jobs: is 3; 1 or 2"),
    ],
)
def test_settings_are_checked(field: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Settings(**{field: value})  # type: ignore[arg-type]


# --- witnesses ----------------------------------------------------------------------------------------


def test_answers_as_json() -> None:
    answer = check(pinch(), w(0, 0.5, 0))
    data = answer.to_json()
    assert data["verdict"] == "holds"
    assert data["stop"] == "complete"
    total = np.sum([c["force"] for c in data["contacts"]], axis=0)
    np.testing.assert_allclose(total, [0, -0.5, 0], atol=1e-9)
    assert data["residual"] <= 1e-9
    none = check(pinch(), w(0, 5, 0)).to_json()
    assert none["contacts"] is None
    endless = maximum(pinch(), w(1, 0, 0)).to_json()
    assert endless["upper"] is None
    assert endless["unbounded"] is True


def test_commands_that_any_small_one_replaces() -> None:
    """Locked, the ball slips; with a joint of the second finger free it holds, whatever little turns it."""
    grasp, w = load_grasp("barrett-ball"), np.array([0.94, 0.30, -0.045, 0.066, 0.049, -0.0014])
    assert check(grasp.with_preload(None), w).verdict is Verdict.SLIPS
    answer = torques(grasp, w)
    assert answer.verdict is Verdict.HOLDS
    assert answer.lower == 0
    assert 0 < answer.upper < 1e-4
    assert answer.witness.valid
    assert check(grasp.with_preload(answer.preload), w).verdict is Verdict.HOLDS


# --- two lanes ---------------------------------------------------------------------------------------


def sideways(degrees: float) -> np.ndarray:
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0, 0, 0, 0])


@pytest.mark.parametrize("degrees", [15, 60, 75])
def test_the_number_of_threads_changes_nothing(degrees: float) -> None:
    grasp = load_grasp("barrett-torch")
    one, two = (maximum(grasp, sideways(degrees), settings=Settings(jobs=k)) for k in (1, 2))
    assert two.nodes > 300  # enough to be dealt
    assert (one.lower, one.upper, one.nodes, one.stop) == (two.lower, two.upper, two.nodes, two.stop)
    for field in ("r", "q", "c", "f"):
        np.testing.assert_array_equal(getattr(one.witness.state, field), getattr(two.witness.state, field))
    for field in ("parent", "state", "multiplier"):
        np.testing.assert_array_equal(getattr(one.certificate, field), getattr(two.certificate, field))
    assert len(two.certificate.parent) == two.nodes  # none of the rows between the lanes' nodes


@pytest.mark.parametrize("nodes", [350, 400, 450, 500])
def test_bounds_of_two_lanes_at_a_limit_are_proved(nodes: int) -> None:
    """To a gap of 1e-6 it is 9.6812 N."""
    grasp = load_grasp("barrett-torch")
    answer = maximum(grasp, sideways(60), settings=Settings(jobs=2, nodes=nodes, gap=1e-9))
    assert answer.stop is Stop.NODES
    assert answer.lower <= 9.68129
    assert answer.upper >= 9.68117


@pytest.mark.parametrize("run", [1, 3, 8])
@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_comes_while_lanes_are_searched(workers: int, run: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within compiled code: the first run has one lane alone, later ones have two."""
    interrupt(monkeypatch, "handfast.stability.search.search.Search._run", run)
    settings = Settings(jobs=workers, gap=1e-9)
    answer = maximum(load_grasp("barrett-torch"), sideways(60), settings=settings)
    assert answer.stop is Stop.INTERRUPTED
    assert answer.lower <= 9.68129
    assert answer.upper >= 9.68117


def test_ctrl_c_comes_while_one_lane_waits_for_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is heard when the other one has ended as well: both write to the tree that what was reached is read from."""
    begun, ended = [], []

    class Waiting:
        """The other lane begins when it is waited for, and Ctrl-C has come by then."""

        def __init__(self, work: Callable[..., int], *args: object) -> None:
            self.work, self.args = work, args
            begun.append(self)

        def result(self) -> int:
            if not ended:
                ctrl_c()
            found = self.work(*self.args)
            ended.append(self)
            return found

    monkeypatch.setattr(search, "helpers", lambda: SimpleNamespace(submit=Waiting))
    settings = Settings(jobs=2, gap=1e-9)
    answer = maximum(load_grasp("barrett-torch"), sideways(60), settings=settings)
    assert answer.stop is Stop.INTERRUPTED
    assert len(begun) == len(ended) == 1
    assert answer.lower <= 9.68129
    assert answer.upper >= 9.68117


@pytest.mark.parametrize("weight", [10.0, 1e-3])
@pytest.mark.parametrize("points", [3, 4])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_lifting_against_the_weight(weight: float, points: int, mu: float) -> None:
    """On a table an upward force is resisted up to the weight, at which nothing is left that presses."""
    angles = 2 * np.pi * np.arange(points) / points + 0.3
    grasp = Grasp([Contact([0.1 * np.cos(a), 0.1 * np.sin(a), 0.0], [0.0, 0.0, 1.0], mu) for a in angles])
    up = np.eye(6)[2]
    answer = maximum(grasp, up, base=-weight * up)
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.HOLDS, Stop.COMPLETE, True)
    assert answer.lower <= weight * (1 + 1e-12)
    assert answer.upper >= weight * (1 - 1e-12)
    assert answer.gap <= 1e-3


def test_what_holds_beyond_the_usual_end_only_is_found() -> None:
    """A push of which a millionth goes across beats the 1 N of a frictionless jaw from 10^6 N on."""
    grasp = Grasp(
        [Contact([0, 0, -0.02], [0, 0, 1], 0.0), Contact([0.03, 0, 0], [-1, 0, 0], 0.0)],
        [GraspJoint("jaw", [-1, 0, 0], [0, 0, 0], (1,), "prismatic")],
        preload={"jaw": 1.0},
    )
    direction = np.array([1e-6, 0, -1.0, 0, 0, 0])
    assert queries.check(grasp, 1e4 * direction).verdict is Verdict.SLIPS
    assert queries.check(grasp, 1e7 * direction).verdict is Verdict.HOLDS
    most = queries.maximum(grasp, direction)
    assert most.verdict is Verdict.HOLDS
    assert most.lower >= 1e6
    assert most.unbounded


@pytest.mark.parametrize("wrench", [[0, 1, 0, 0, 0, 0], [0, 0, -1, 0, 0, 0], [0, 0, 0, 0, 0.1, 0]])
def test_without_dissipation_two_workers_answer(wrench: list[float]) -> None:
    """Where any state is sought, and no energy is bounded, there is no number at which nodes are cut off."""
    quick = Settings(jobs=2)
    answer = queries.check(load_grasp("fig11"), wrench, mdp=False, settings=quick)
    assert answer.verdict is not Verdict.UNDECIDED
    assert answer.verify().ok


def test_a_state_between_two_modes_is_saved_and_replayed() -> None:
    """The weight of 0.3 kg along x of fig11: a contact is in line with others but for rounding, and hardly presses."""
    grasp = load_grasp("fig11")
    answer = queries.check(grasp, [0.3 * 9.81, 0, 0, 0, 0, 0])
    assert (answer.verdict, answer.exact) == (Verdict.HOLDS, True)
    contacts = answer.to_json()["contacts"]
    total = sum(np.array(contact["force"]) for contact in contacts)
    np.testing.assert_allclose(total, [-0.3 * 9.81, 0, 0], atol=1e-8)
    assert {c["state"] for c in contacts if c["normal_force"] == 0} <= {"open"}
    assert {c["state"] for c in contacts if c["normal_force"] > 0} <= {"stick", "slide"}
    assert answer.verify().ok, answer.verify().reason
